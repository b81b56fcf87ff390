//! Which nodes of a level form one node of the next.

use super::level::{Level, NONE};

/// How often pairs are formed: aggregates have up to 2 to the power of this members.
const PASSES: usize = 3;

/// A row with at least this part of its diagonal leading to fixed potentials needs no coarse level: it is held fast.
const HELD: f32 = 0.8;

/// A neighbour is strongly coupled when its weight is at least this part of the node's largest.
const STRONG: f32 = 0.25;

/// The neighbours of every row of a level and the weights to them.
pub(super) struct Graph {
    offsets: Vec<usize>,
    neighbours: Vec<(u32, f32)>,
    free: Vec<bool>,
    /// Rows of different blocks form no pairs, so that restriction can go block by block.
    block: Vec<u32>,
}

impl Graph {
    pub(super) fn of(level: &Level) -> Self {
        // The inverse of the diagonal times the leak is the part of the diagonal that leads to fixed potentials.
        let loose = |row: usize| level.inverse[row] != 0.0 && level.leak[row] * level.inverse[row] < HELD;
        let pattern = &level.pattern;
        let around = |row: usize| {
            pattern
                .entries(row)
                .map(move |entry| (row as u32, pattern.columns()[entry], level.weights[entry]))
        };
        let blocks = (0..level.rows()).map(|row| (row / pattern.block()) as u32);
        Self::new(
            (0..level.rows()).flat_map(around).collect(),
            (0..level.rows()).map(loose).collect(),
            blocks.collect(),
        )
    }

    /// From the weights between rows, which are added up.
    fn new(mut weights: Vec<(u32, u32, f32)>, free: Vec<bool>, block: Vec<u32>) -> Self {
        weights.retain(|&(row, other, _)| block[row as usize] == block[other as usize]);
        weights.sort_by_key(|&(row, other, _)| (row, other));
        let mut offsets = vec![0; free.len() + 1];
        let mut neighbours = Vec::with_capacity(weights.len());
        for same in weights.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            neighbours.push((same[0].1, same.iter().map(|&(_, _, weight)| weight).sum()));
            offsets[same[0].0 as usize + 1] = neighbours.len();
        }
        (1..offsets.len()).for_each(|row| offsets[row] = offsets[row].max(offsets[row - 1]));
        Self { offsets, neighbours, free, block }
    }

    fn neighbours(&self, row: usize) -> &[(u32, f32)] {
        &self.neighbours[self.offsets[row]..self.offsets[row + 1]]
    }

    /// The graph of the aggregates.
    fn merged(&self, aggregate: &[u32], count: usize) -> Self {
        let mut weights = Vec::with_capacity(self.neighbours.len());
        let mut block = vec![0; count];
        for (row, &own) in aggregate.iter().enumerate() {
            if let Some(block) = block.get_mut(own as usize) {
                *block = self.block[row];
            }
            for &(other, weight) in self.neighbours(row) {
                let other = aggregate[other as usize];
                if own != NONE && other != NONE && own != other {
                    weights.push((own, other, weight));
                }
            }
        }
        Self::new(weights, vec![true; count], block)
    }

    /// Joins each row to the one left over that it is coupled to most; those that stay alone join a pair.
    fn pairs(&self) -> (Vec<u32>, usize) {
        let mut pair = vec![NONE; self.free.len()];
        let mut count = 0;
        for row in (0..pair.len()).filter(|&row| self.free[row]) {
            if pair[row] != NONE {
                continue;
            }
            let near = self.neighbours(row);
            let largest = near.iter().map(|&(_, weight)| weight).fold(0.0, f32::max);
            let open = near.iter().filter(|&&(other, weight)| {
                self.free[other as usize] && pair[other as usize] == NONE && weight > STRONG * largest
            });
            let best = open.reduce(|best, next| if next.1 > best.1 { next } else { best });
            if let Some(&(other, _)) = best {
                pair[row] = count;
                pair[other as usize] = count;
                count += 1;
            }
        }
        let paired = pair.clone();
        for row in (0..pair.len()).filter(|&row| self.free[row] && paired[row] == NONE) {
            let taken = self.neighbours(row).iter().filter(|&&(other, _)| paired[other as usize] != NONE);
            let best = taken.reduce(|best, next| if next.1 > best.1 { next } else { best });
            pair[row] = best.map_or(count, |&(other, _)| paired[other as usize]);
            count += u32::from(best.is_none());
        }
        (pair, count as usize)
    }
}

/// The aggregate of each row and their number: pairs, pairs of pairs, and so on, none in more than one block. They are
/// ordered by their first rows.
pub(super) fn aggregates(level: &Level) -> (Vec<u32>, usize) {
    let mut graph = Graph::of(level);
    let (mut pair_of, mut pairs) = graph.pairs();
    let mut aggregate = pair_of.clone();
    for _ in 1..PASSES {
        graph = graph.merged(&pair_of, pairs);
        (pair_of, pairs) = graph.pairs();
        aggregate.iter_mut().filter(|own| **own != NONE).for_each(|own| *own = pair_of[*own as usize]);
    }
    let (mut place, mut count) = (vec![NONE; pairs], 0);
    for own in aggregate.iter_mut().filter(|own| **own != NONE) {
        let place = &mut place[*own as usize];
        if *place == NONE {
            *place = count;
            count += 1;
        }
        *own = *place;
    }
    (aggregate, pairs)
}
