//! What walls leave of the edges beside them, found by edge at once.

use super::beside::BesideWall;

const BITS: usize = u64::BITS as usize;

/// What walls leave of edges below a bound: in the order of the edges, with the number of those before each 64. Of an edge that no
/// wall is beside any more nothing is kept but its place, as one may soon be there again.
#[derive(Clone, Debug, Default)]
pub(super) struct Walls {
    of_edges: Vec<(u32, Option<BesideWall>)>,
    /// One bit for each edge, and how many edges are before those of each word that has any.
    words: Vec<u64>,
    before: Vec<u32>,
    /// Working storage: edges that have no place yet, and all that are to have one.
    others: Vec<(u32, Option<BesideWall>)>,
    next: Vec<(u32, Option<BesideWall>)>,
}

impl Walls {
    /// None, of edges below a bound.
    pub(super) fn below(bound: usize) -> Self {
        let words = bound.div_ceil(BITS);
        Self { words: vec![0; words], before: vec![0; words], ..Self::default() }
    }

    /// What a wall leaves of an edge, if it is beside one.
    #[inline]
    pub(super) fn get(&self, edge: usize) -> Option<&BesideWall> {
        self.of_edges.get(self.place(edge)?)?.1.as_ref()
    }

    #[inline]
    fn place(&self, edge: usize) -> Option<usize> {
        let (word, bit) = (self.words[edge / BITS], 1 << (edge % BITS));
        let before = || self.before[edge / BITS] + (word & (bit - 1)).count_ones();
        (word & bit != 0).then(|| before() as usize)
    }

    /// Takes over what is another of some edges, in their order: what walls leave of them now, nothing where none is beside.
    pub(super) fn take(&mut self, changes: impl Iterator<Item = (u32, Option<BesideWall>)>) {
        for (edge, now) in changes {
            match self.place(edge as usize) {
                Some(place) => self.of_edges[place].1 = now,
                None => self.others.push((edge, now)),
            }
        }
        if !self.others.is_empty() {
            self.merge();
        }
    }

    /// Gives the others their places, and takes those of edges that no wall is beside.
    fn merge(&mut self) {
        let Self { of_edges, words, before, others, next } = self;
        let mut others = others.drain(..).peekable();
        next.clear();
        for known in of_edges.drain(..) {
            words[known.0 as usize / BITS] = 0;
            while let Some(other) = others.next_if(|(edge, _)| *edge < known.0) {
                next.push(other);
            }
            next.extend(known.1.is_some().then_some(known));
        }
        next.extend(others);
        std::mem::swap(of_edges, next);
        for (place, (edge, _)) in of_edges.iter().enumerate() {
            let (word, bit) = (*edge as usize / BITS, edge % BITS as u32);
            if words[word] == 0 {
                before[word] = place as u32;
            }
            words[word] |= 1 << bit;
        }
    }

    /// Forgets all, and visits them.
    pub(super) fn drain(&mut self, mut visit: impl FnMut(usize, &BesideWall)) {
        for (edge, wall) in self.of_edges.drain(..) {
            self.words[edge as usize / BITS] = 0;
            wall.iter().for_each(|wall| visit(edge as usize, wall));
        }
    }
}
