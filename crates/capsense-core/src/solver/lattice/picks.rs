//! Which nodes of fine rows a stage across x keeps: they and those behind them are picked in blocks of coarse nodes.

use super::layout::BLOCK;
use std::ops::Range;

/// As never two neighbours are eliminated, a block of coarse nodes and those behind them are within so many fine ones.
const SPAN: usize = 2 * BLOCK;

/// The blocks of a coarse row.
#[derive(Clone, Debug)]
pub(super) struct Picks(Vec<Block>);

#[derive(Clone, Copy, Debug, Default)]
struct Block {
    /// The fine node of the first.
    first: usize,
    /// How many there are.
    count: u32,
    /// Where the fine nodes are from the first on.
    offsets: [u8; BLOCK],
}

impl Picks {
    /// For the coarse nodes that are these fine ones.
    pub(super) fn new(fine: &[usize]) -> Self {
        let block = |nodes: &[usize]| {
            let mut offsets = [0; BLOCK];
            offsets.iter_mut().zip(nodes).for_each(|(offset, node)| *offset = (node - nodes[0]) as u8);
            Block { first: nodes[0], count: nodes.len() as u32, offsets }
        };
        Self(fine.chunks(BLOCK).map(block).collect())
    }

    /// Picks coarse nodes, in whole blocks, from a fine row, or, from one that begins later, those behind them. Behind the last
    /// there are zeros. The first coarse node goes behind one block.
    #[inline(always)]
    pub(super) fn pick(&self, to: &mut [f32], row: &[f32], nodes: &Range<usize>) {
        let to = to[BLOCK + nodes.start..].as_chunks_mut::<BLOCK>().0;
        for (block, to) in self.of(nodes).iter().zip(to) {
            let Some(span) = row[block.first..].first_chunk::<SPAN>() else { return };
            block.pick(to, span);
        }
    }

    /// Picks coarse nodes and those behind them.
    #[inline(always)]
    pub(super) fn pick_pairs(&self, own: &mut [f32], behind: &mut [f32], row: &[f32], nodes: &Range<usize>) {
        let own = own[BLOCK + nodes.start..].as_chunks_mut::<BLOCK>().0;
        let behind = behind[BLOCK + nodes.start..].as_chunks_mut::<BLOCK>().0;
        for ((block, own), behind) in self.of(nodes).iter().zip(own).zip(behind) {
            let row = &row[block.first..];
            let (Some(span), Some((_, next))) = (row.first_chunk::<SPAN>(), row.split_first()) else {
                return;
            };
            let Some(next) = next.first_chunk::<SPAN>() else { return };
            block.pick(own, span);
            block.pick(behind, next);
        }
    }

    /// The blocks of some nodes.
    #[inline(always)]
    fn of(&self, nodes: &Range<usize>) -> &[Block] {
        &self.0[nodes.start / BLOCK..nodes.end.div_ceil(BLOCK)]
    }
}

impl Block {
    /// Picks those of a block from what is behind its first.
    #[inline(always)]
    fn pick(&self, to: &mut [f32; BLOCK], span: &[f32; SPAN]) {
        for (to, offset) in to.iter_mut().zip(self.offsets) {
            *to = span[usize::from(offset) % SPAN];
        }
        if self.count < BLOCK as u32 {
            for (lane, to) in to.iter_mut().enumerate() {
                *to = if (lane as u32) < self.count { *to } else { 0.0 };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coarse_nodes_and_those_behind_them_are_picked() {
        let eliminated = [1, 4, 6, 8, 10, 12, 14, 16, 18, 20];
        let fine: Vec<usize> = (0..30).filter(|node| !eliminated.contains(node)).collect();
        let picks = Picks::new(&fine);
        let row: Vec<f32> = (0..31 + SPAN).map(|node| node as f32 + 0.5).collect();
        let room = fine.len().next_multiple_of(BLOCK) + 2 * BLOCK;
        for nodes in [0..24, 8..16, 8..24] {
            let (mut own, mut behind, mut alone) = (vec![-1.0; room], vec![-1.0; room], vec![-1.0; room]);
            picks.pick_pairs(&mut own, &mut behind, &row, &nodes);
            picks.pick(&mut alone, &row[1..], &nodes);
            for node in 0..room - BLOCK {
                let expected = match fine.get(node) {
                    _ if !nodes.contains(&node) => [-1.0, -1.0],
                    Some(&fine) => [row[fine], row[fine + 1]],
                    None => [0.0, 0.0],
                };
                let at = BLOCK + node;
                assert_eq!([own[at], behind[at]], expected, "{nodes:?} {node}");
                assert_eq!(alone[at], expected[1], "{nodes:?} {node}");
            }
        }
    }
}
