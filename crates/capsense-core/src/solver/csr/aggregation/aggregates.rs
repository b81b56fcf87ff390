//! Which nodes of a level form one node of the next.

use super::level::{Level, NONE};

/// How often pairs are formed: aggregates have up to 2 to the power of this members.
const PASSES: usize = 3;

/// A row with at least this part of its diagonal leading to fixed potentials needs no coarse level: it is held fast.
const HELD: f32 = 0.8;

/// A neighbour is strongly coupled when its weight is at least this part of the node's largest.
const STRONG: f32 = 0.25;

/// The neighbours of every row and how strongly each is coupled to it.
///
/// Between aggregates that is less than the sum of their weights: of two rows in line with two others only one has a weight
/// to them, and the way from the middle of the ones to the middle of the others is twice as long. Sums take what is in line
/// for as near as ever, and where spacings differ by three, aggregates are lines of eight. A correction that is constant on
/// those is of little use to fields along them, as are those in dielectrics.
pub(super) struct Couplings {
    offsets: Vec<usize>,
    neighbours: Vec<(u32, f32)>,
}

impl Couplings {
    /// The weights of a level.
    pub(super) fn of(level: &Level) -> Self {
        let pattern = &level.pattern;
        let entries = (0..level.rows()).flat_map(|row| pattern.entries(row));
        Self {
            offsets: (0..level.rows())
                .map(|row| pattern.entries(row).start)
                .chain([pattern.columns().len()])
                .collect(),
            neighbours: entries.map(|entry| (pattern.columns()[entry], level.weights[entry])).collect(),
        }
    }

    pub(super) fn at(&self, row: usize) -> &[(u32, f32)] {
        &self.neighbours[self.offsets[row]..self.offsets[row + 1]]
    }

    /// The couplings of aggregates, `count` of them: sums of weights, times the root of the part of the rows of both that
    /// have a share in them. With that part itself, which is by how much the way becomes longer, a grounded bar takes 65
    /// instead of 89 steps sideways at 300,000 tetrahedra, but a first frame among slivers 41 instead of 27. The parts
    /// come with them.
    pub(super) fn merged(&self, aggregate: &[u32], count: usize) -> (Self, Vec<f32>) {
        let mut members = vec![0.0; count];
        let mut weights = Vec::with_capacity(self.neighbours.len());
        for (row, &own) in aggregate.iter().enumerate().filter(|(_, own)| **own != NONE) {
            members[own as usize] += 1.0;
            for &(other, weight) in self.at(row) {
                let other = aggregate[other as usize];
                if other != NONE && other != own {
                    weights.push((own, other, row, weight));
                }
            }
        }
        weights.sort_by_key(|&(own, other, ..)| (own, other));
        let (sums, shares) = Self::summed(&weights, count);
        let share = |from: usize, to: usize| {
            let place = sums.at(from).binary_search_by_key(&(to as u32), |&(other, _)| other);
            place.map_or(0.0, |place| shares[sums.offsets[from] + place])
        };
        let pairs = (0..count).flat_map(|own| sums.at(own).iter().map(move |of| (own, of.0 as usize)));
        let parts: Vec<f32> =
            pairs.map(|(own, to)| (share(own, to) + share(to, own)) / (members[own] + members[to])).collect();
        let weakened = sums.neighbours.iter().zip(&parts);
        let neighbours = weakened.map(|(&(other, weight), part)| (other, weight * part.sqrt())).collect();
        (Self { neighbours, offsets: sums.offsets }, parts)
    }

    /// Adds up weights from rows of one aggregate to another one, in the order of both, and tells how many rows have a share
    /// in each sum: as many as if all of those had the same.
    fn summed(weights: &[(u32, u32, usize, f32)], count: usize) -> (Self, Vec<f32>) {
        let mut offsets = vec![0; count + 1];
        let (mut neighbours, mut shares) = (Vec::new(), Vec::new());
        for same in weights.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            let of_rows = same.chunk_by(|a, b| a.2 == b.2).map(|of| of.iter().map(|of| of.3).sum::<f32>());
            let [sum, sizes, squares] = of_rows
                .fold([0.0; 3], |[sum, sizes, squares], of| [sum + of, sizes + of.abs(), squares + of * of]);
            neighbours.push((same[0].1, sum));
            shares.push(if squares > 0.0 { sizes * sizes / squares } else { 0.0 });
            offsets[same[0].0 as usize + 1] = neighbours.len();
        }
        (1..offsets.len()).for_each(|own| offsets[own] = offsets[own].max(offsets[own - 1]));
        (Self { offsets, neighbours }, shares)
    }
}

/// Rows, or aggregates of them, that may be joined.
struct Graph<'a> {
    couplings: &'a Couplings,
    free: Vec<bool>,
    /// Rows of different blocks form no pairs, so that restriction can go block by block.
    block: Vec<u32>,
}

impl Graph<'_> {
    /// Joins each row to the one left over that it is coupled to most; those that stay alone join a pair.
    fn pairs(&self) -> (Vec<u32>, usize) {
        let mut pair = vec![NONE; self.free.len()];
        let mut count = 0;
        for row in (0..pair.len()).filter(|&row| self.free[row]) {
            if pair[row] != NONE {
                continue;
            }
            let largest = self.near(row).map(|(_, weight)| weight).fold(0.0, f32::max);
            let open = self.near(row).filter(|&(other, weight)| {
                self.free[other as usize] && pair[other as usize] == NONE && weight > STRONG * largest
            });
            let best = open.reduce(|best, next| if next.1 > best.1 { next } else { best });
            if let Some((other, _)) = best {
                pair[row] = count;
                pair[other as usize] = count;
                count += 1;
            }
        }
        let paired = pair.clone();
        for row in (0..pair.len()).filter(|&row| self.free[row] && paired[row] == NONE) {
            let taken = self.near(row).filter(|&(other, _)| paired[other as usize] != NONE);
            let best = taken.reduce(|best, next| if next.1 > best.1 { next } else { best });
            pair[row] = best.map_or(count, |(other, _)| paired[other as usize]);
            count += u32::from(best.is_none());
        }
        (pair, count as usize)
    }

    /// The neighbours of a row in its block.
    fn near(&self, row: usize) -> impl Iterator<Item = (u32, f32)> {
        let is_near = move |other: u32| self.block[row] == self.block[other as usize];
        self.couplings.at(row).iter().copied().filter(move |&(other, _)| is_near(other))
    }
}

/// The aggregates of a level.
pub(super) struct Aggregates {
    /// That of each row; [`NONE`] where it is held.
    pub(super) of_row: Vec<u32>,
    pub(super) count: usize,
    pub(super) couplings: Couplings,
    /// Of each of these, which part of the rows of both aggregates has a share in it.
    pub(super) parts: Vec<f32>,
}

impl Aggregates {
    /// The neighbours of an aggregate and the part of the rows of both that is coupled.
    pub(super) fn parts(&self, own: usize) -> impl Iterator<Item = (u32, f32)> {
        let range = self.couplings.offsets[own]..self.couplings.offsets[own + 1];
        let others = self.couplings.at(own).iter().map(|&(other, _)| other);
        others.zip(self.parts[range].iter().copied())
    }
}

/// Pairs of a level's rows, pairs of pairs, and so on, none in more than one block. They are ordered by their first rows.
pub(super) fn aggregates(level: &Level, couplings: &Couplings) -> Aggregates {
    // The inverse of the diagonal times the leak is the part of the diagonal that leads to fixed potentials.
    let loose = |row: usize| level.inverse[row] != 0.0 && level.leak[row] * level.inverse[row] < HELD;
    let block_of = |row: usize| (row / level.pattern.block()) as u32;
    let graph = Graph {
        couplings,
        free: (0..level.rows()).map(loose).collect(),
        block: (0..level.rows()).map(block_of).collect(),
    };
    let (mut of_row, mut count) = graph.pairs();
    for _ in 1..PASSES {
        let mut block = vec![0; count];
        for (row, own) in of_row.iter().enumerate().filter(|(_, own)| **own != NONE) {
            block[*own as usize] = block_of(row);
        }
        let (merged, _) = couplings.merged(&of_row, count);
        let (pair_of, pairs) = Graph { couplings: &merged, free: vec![true; count], block }.pairs();
        of_row.iter_mut().filter(|own| **own != NONE).for_each(|own| *own = pair_of[*own as usize]);
        count = pairs;
    }
    number_by_first_rows(&mut of_row, count);
    let (couplings, parts) = couplings.merged(&of_row, count);
    Aggregates { of_row, count, couplings, parts }
}

fn number_by_first_rows(aggregate: &mut [u32], count: usize) {
    let (mut place, mut next) = (vec![NONE; count], 0);
    for own in aggregate.iter_mut().filter(|own| **own != NONE) {
        let place = &mut place[*own as usize];
        if *place == NONE {
            *place = next;
            next += 1;
        }
        *own = *place;
    }
}
