//! What walls leave of the edges beside them, found by edge at once.

use super::beside::BesideWall;
use crate::occupancy::{Coupling, Span};
use std::ops::Range;

const BITS: usize = u64::BITS as usize;

/// What the edge rule made of an edge when surfaces last cut it anew, and what was on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::occupancy) struct Cut {
    pub(in crate::occupancy) coupling: Coupling,
    pub(in crate::occupancy) edge: u32,
    pub(in crate::occupancy) on_edge: OnEdge,
}

/// The objects on an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::occupancy) enum OnEdge {
    /// None.
    Nothing,
    /// One alone.
    One(u16),
    /// More than one.
    Several,
}

impl OnEdge {
    /// What the spans of an edge tell, one for each object.
    #[inline]
    pub(in crate::occupancy) fn of(spans: &[(u16, Span)]) -> Self {
        match *spans {
            [] => Self::Nothing,
            [(object, _)] => Self::One(object),
            _ => Self::Several,
        }
    }
}

/// An edge that a wall is or was beside.
#[derive(Clone, Copy, Debug)]
struct Kept {
    edge: u32,
    wall: Option<BesideWall>,
    cut: Option<Cut>,
}

/// What walls leave of edges below a bound: in the order of the edges, with the number of those before each 64. Of an edge that no
/// wall is beside any more nothing is kept but its place, as one may soon be there again.
#[derive(Clone, Debug, Default)]
pub(super) struct Walls {
    of_edges: Vec<Kept>,
    /// One bit for each edge, and how many edges are before those of each word that has any.
    words: Vec<u64>,
    before: Vec<u32>,
    /// Working storage: edges that have no place yet.
    others: Vec<(u32, Option<BesideWall>)>,
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
        self.of_edges.get(self.place(edge)?)?.wall.as_ref()
    }

    /// What is kept of how surfaces cut an edge. Whoever cuts one anew that has a place is to tell [`Walls::keep`].
    #[inline]
    pub(super) fn cut(&self, edge: usize) -> Option<&Cut> {
        self.of_edges.get(self.place(edge)?)?.cut.as_ref()
    }

    /// Keeps how surfaces cut an edge that has a place.
    pub(super) fn keep(&mut self, cut: Cut) {
        if let Some(place) = self.place(cut.edge as usize) {
            self.of_edges[place].cut = Some(cut);
        }
    }

    /// How many edges have places.
    pub(super) fn places(&self) -> usize {
        self.of_edges.len()
    }

    /// Whether an edge has a place; others are beside no wall.
    #[inline]
    pub(super) fn may_have(&self, edge: usize) -> bool {
        self.words[edge / BITS] >> (edge % BITS) & 1 != 0
    }

    /// Whether any of some edges, or of those next to them, has one.
    #[inline]
    pub(super) fn may_have_any(&self, edges: Range<usize>) -> bool {
        self.words[edges.start / BITS..edges.end.div_ceil(BITS)].iter().any(|word| *word != 0)
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
                Some(place) => self.of_edges[place].wall = now,
                None => self.others.push((edge, now)),
            }
        }
        if !self.others.is_empty() {
            self.forget_empty();
            self.give_places();
        }
    }

    /// Takes back the places of edges that no wall is beside, once these are more than half.
    fn forget_empty(&mut self) {
        let Self { of_edges, words, .. } = self;
        if 2 * of_edges.iter().filter(|kept| kept.wall.is_none()).count() > of_edges.len() {
            of_edges.iter().for_each(|kept| words[kept.edge as usize / BITS] = 0);
            of_edges.retain(|kept| kept.wall.is_some());
            of_edges
                .iter()
                .for_each(|kept| words[kept.edge as usize / BITS] |= 1 << (kept.edge % BITS as u32));
        }
    }

    /// Gives the others places between those that are there, from the last on.
    fn give_places(&mut self) {
        let Self { of_edges, words, before, others } = self;
        let mut end = of_edges.len();
        of_edges.resize(end + others.len(), Kept { edge: 0, wall: None, cut: None });
        while let Some((edge, wall)) = others.pop() {
            let place = of_edges[..end].partition_point(|kept| kept.edge < edge);
            of_edges.copy_within(place..end, place + others.len() + 1);
            of_edges[place + others.len()] = Kept { edge, wall, cut: None };
            words[edge as usize / BITS] |= 1 << (edge % BITS as u32);
            end = place;
        }
        let mut last = None;
        for (place, kept) in of_edges.iter().enumerate() {
            let word = kept.edge as usize / BITS;
            if last.replace(word) != Some(word) {
                before[word] = place as u32;
            }
        }
    }

    /// Forgets all, and visits them.
    pub(super) fn drain(&mut self, mut visit: impl FnMut(usize, &BesideWall)) {
        for Kept { edge, wall, .. } in self.of_edges.drain(..) {
            self.words[edge as usize / BITS] = 0;
            wall.iter().for_each(|wall| visit(edge as usize, wall));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::dual_face::Past;
    use super::*;
    use std::collections::BTreeMap;

    fn wall(through: f64) -> BesideWall {
        let past = Past { through, tap: 0.0, abruptness: 1.0 };
        BesideWall { object: 0, end: 0, is_under: false, past }
    }

    /// Walls that come, change and go where a body is that moves along are found as in a map.
    #[test]
    fn every_edge_is_found_with_what_it_was_told_last() {
        const EDGES: usize = 4000;
        let (mut walls, mut map, mut state) = (Walls::below(EDGES), BTreeMap::new(), 1_u64);
        let mut noise = move |below: usize| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as usize % below
        };
        let (mut fewest, mut largest, mut cuts) = (EDGES, 0, BTreeMap::new());
        for round in 0..400 {
            let near = 9 * round..9 * round + 400;
            let mut told = BTreeMap::new();
            for _ in 0..noise(60) {
                told.insert((near.start + noise(near.len())) as u32, Some(wall(noise(1000) as f64)));
            }
            // Those behind the body go.
            told.extend(
                map.keys().copied().filter(|edge| (*edge as usize) < near.start).map(|edge| (edge, None)),
            );
            for (&edge, &now) in &told {
                match now {
                    Some(now) => drop(map.insert(edge, now)),
                    None => drop(map.remove(&edge)),
                }
            }
            walls.take(told.into_iter());
            for edge in 0..EDGES {
                assert_eq!(walls.get(edge), map.get(&(edge as u32)), "{round} {edge}");
                // Cuts stay with their edges as long as these have places.
                let cut = walls.cut(edge).map(|cut| cut.coupling.through);
                assert!(cut.is_none() || cut == cuts.get(&edge).copied(), "{round} {edge}");
                assert!(cut.is_some() || !map.contains_key(&(edge as u32)) || !cuts.contains_key(&edge));
            }
            cuts.retain(|&edge, _| walls.may_have(edge));
            for edge in map.keys().map(|&edge| edge as usize).filter(|edge| edge % 5 == round % 5) {
                let coupling = Coupling::only_through(noise(1000) as f64);
                walls.keep(Cut { coupling, edge: edge as u32, on_edge: OnEdge::Nothing });
                cuts.insert(edge, coupling.through);
            }
            let places = walls.of_edges.len();
            (fewest, largest) =
                (if places < largest { fewest.min(places) } else { fewest }, largest.max(places));
        }
        assert!(fewest < largest / 2, "no place was taken: {fewest} {largest}");
        assert!(map.len() > 20);
        let mut drained = Vec::new();
        walls.drain(|edge, wall| drained.push((edge as u32, *wall)));
        assert_eq!(drained, map.into_iter().collect::<Vec<_>>());
        assert!((0..EDGES).all(|edge| walls.get(edge).is_none()));
    }
}
