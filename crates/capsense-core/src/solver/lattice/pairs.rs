//! Coarse rows along x, together with the nodes that are eliminated between theirs.
//!
//! Where nodes are eliminated follows the spacing of the lattice, so it is different in different pieces of a row. Only
//! the copying from and to fine rows goes by such pieces; all arithmetic is one loop over the row, the same whatever is
//! eliminated, because each kept node has an eliminated one behind it: one without shares where there is none.

use super::between::{half_row, place_in_halves};
use super::layout::BLOCK;
use super::rows::{collect, combine, copy, deal, gather};
use super::stage::Stage;
use pulp::Simd;

/// A row in every column. Each step is done for all columns before the next, so that what one has written is in the cache
/// when the next reads it at other places: before that, a processor would have to wait.
#[derive(Clone, Debug)]
pub(super) struct Pairs {
    /// Number of kept nodes, in whole blocks for each parity.
    len: usize,
    /// Room for each column.
    room: usize,
    kept: Vec<f32>,
    behind: Vec<f32>,
}

/// The shares of a row's eliminated nodes in the values of the nodes before and behind them.
#[derive(Clone, Copy)]
pub(super) struct RowShares<'a> {
    previous: &'a [f32],
    next: &'a [f32],
}

/// Successive nodes that are copied together: a block of kept nodes with eliminated ones between them, or two blocks with
/// none between. A piece may have fewer nodes, and what is copied too much is overwritten by the pieces behind it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    /// Where the first node and the one behind it are in a fine row, and where the first is in pairs.
    own: u32,
    next: u32,
    kept: u32,
    paired: bool,
}

impl<'a> RowShares<'a> {
    /// Those of row (j, k), if there is a stage across x.
    #[inline(always)]
    pub(super) fn of(stage: Option<&'a Stage>, j: usize, k: usize) -> Option<Self> {
        stage.map(|stage| Self { previous: stage.previous.row(j, k), next: stage.next.row(j, k) })
    }
}

impl Pairs {
    pub(super) fn clear(&mut self) {
        for values in [&mut self.kept, &mut self.behind] {
            values.fill(0.0);
        }
    }

    /// For rows of so many kept nodes and so many columns.
    pub(super) fn zeros(nodes: usize, columns: usize) -> Self {
        let (len, room) = (nodes.next_multiple_of(2 * BLOCK), room_for_pairs(nodes));
        let zeros = vec![0.0; columns * room];
        Self { len, room, kept: zeros.clone(), behind: zeros }
    }

    /// Takes one column's fine row apart.
    #[inline(always)]
    pub(super) fn take<S: Simd>(&mut self, pieces: &[Piece], column: usize, fine: &[f32]) {
        let kept = &mut self.kept[column * self.room..][..self.room];
        let behind = &mut self.behind[column * self.room..][..self.room];
        for piece in pieces {
            let [own, next, at] = piece.places();
            let (own, next) = (&fine[own..own + BLOCK], &fine[next..next + BLOCK]);
            if piece.paired {
                copy::<S>(&mut kept[at..at + BLOCK], own);
                copy::<S>(&mut behind[at..at + BLOCK], next);
            } else {
                collect(&mut kept[at..at + 2 * BLOCK], own, next);
            }
        }
    }

    /// Puts one column's fine row together.
    #[inline(always)]
    pub(super) fn put<S: Simd>(&self, pieces: &[Piece], column: usize, fine: &mut [f32]) {
        let kept = &self.kept[column * self.room..][..self.room];
        let behind = &self.behind[column * self.room..][..self.room];
        for piece in pieces {
            let [own, next, at] = piece.places();
            if piece.paired {
                copy::<S>(&mut fine[own..own + BLOCK], &kept[at..at + BLOCK]);
                copy::<S>(&mut fine[next..next + BLOCK], &behind[at..at + BLOCK]);
            } else {
                let mut halves = [[0.0; BLOCK]; 2];
                let [first, second] = &mut halves;
                deal(&kept[at..at + 2 * BLOCK], first, second);
                copy::<S>(&mut fine[own..own + BLOCK], first);
                copy::<S>(&mut fine[next..next + BLOCK], second);
            }
        }
    }

    /// Adds to the kept nodes what they get of the eliminated ones, and deals the sums out to even and odd nodes.
    #[inline(always)]
    pub(super) fn restrict<S: Simd>(
        &self,
        simd: S,
        shares: RowShares<'_>,
        column: usize,
        [even, odd]: [&mut [f32]; 2],
    ) {
        let n = self.len;
        let own = column * self.room + BLOCK;
        let kept = &self.kept[own..own + n];
        let next = [&shares.previous[BLOCK..][..n], &self.behind[own..own + n]];
        let previous = [&shares.next[BLOCK - 1..][..n], &self.behind[own - 1..own - 1 + n]];
        let (even, odd) = (&mut even[..n / 2], &mut odd[..n / 2]);
        // As arrays: chunks of two slices at once would be a call, with two divisions.
        let blocks = even.as_chunks_mut::<BLOCK>().0.iter_mut().zip(odd.as_chunks_mut::<BLOCK>().0);
        for (number, (even, odd)) in blocks.enumerate() {
            let (here, mut sums) = (number * 2 * BLOCK..(number + 1) * 2 * BLOCK, [0.0; 2 * BLOCK]);
            let next = [&next[0][here.clone()], &next[1][here.clone()]];
            let previous = [&previous[0][here.clone()], &previous[1][here.clone()]];
            gather(simd, &mut sums, &kept[here], next, previous);
            deal(&sums, even, odd);
        }
    }

    /// Takes the kept nodes, even and odd ones, with a block of each more than are in the row.
    #[inline(always)]
    pub(super) fn fill(&mut self, column: usize, even: &[f32], odd: &[f32]) {
        let own = column * self.room + BLOCK;
        collect(&mut self.kept[own..own + self.len + 2 * BLOCK], even, odd);
    }

    /// Interpolates the eliminated nodes. The kept node behind the last has no share in anything.
    #[inline(always)]
    pub(super) fn interpolate<S: Simd>(&mut self, simd: S, shares: RowShares<'_>, column: usize) {
        let n = self.len;
        let own = column * self.room + BLOCK;
        let previous = [&shares.previous[BLOCK..][..n], &self.kept[own..own + n]];
        let next = [&shares.next[BLOCK..][..n], &self.kept[own + 1..own + 1 + n]];
        combine(simd, &mut self.behind[own..own + n], previous, next);
    }
}

impl Piece {
    /// Of the first node and of the one behind it in a fine row, and of the first in pairs: small numbers, of which it is
    /// plain that a block more is no overflow.
    #[inline(always)]
    fn places(self) -> [usize; 3] {
        [self.own as usize, self.next as usize, self.kept as usize]
    }
}

/// Takes apart a row of which some nodes are kept. A piece of pairs may end with a node that has no eliminated one behind
/// it.
pub(super) fn pieces(kept: &[bool]) -> Vec<Piece> {
    let half = half_row(kept.len());
    let mut pieces: Vec<Piece> = Vec::new();
    let (mut room, mut previous_is_paired) = (0, false);
    for (coarse, fine) in (0..kept.len()).filter(|&node| kept[node]).enumerate() {
        let paired = kept.get(fine + 1) == Some(&false);
        let goes_on = match pieces.last() {
            Some(last) if last.paired => previous_is_paired,
            _ => !paired,
        };
        if room == 0 || !goes_on {
            let (own, next) = (place_in_halves(fine, half) as u32, place_in_halves(fine + 1, half) as u32);
            pieces.push(Piece { own, next, kept: place_in_pairs(coarse) as u32, paired });
            room = if paired { BLOCK } else { 2 * BLOCK };
        }
        room -= 1;
        previous_is_paired = paired;
    }
    pieces
}

/// Room for pairs of so many nodes: a block to spare before them, and three behind.
pub(super) fn room_for_pairs(nodes: usize) -> usize {
    nodes.next_multiple_of(2 * BLOCK) + 4 * BLOCK
}

/// Where a kept node is, and the eliminated one behind it.
#[inline(always)]
pub(super) fn place_in_pairs(coarse: usize) -> usize {
    BLOCK + coarse
}

#[cfg(test)]
mod tests {
    use super::*;
    use pulp::Scalar;

    #[test]
    fn rows_are_taken_apart_and_put_together() {
        for pattern in 0..1_u32 << 10 {
            // No two neighbours are eliminated, nor the first or last node.
            let mut kept = vec![true; 41];
            for node in 1..kept.len() - 1 {
                kept[node] = !kept[node - 1] || pattern >> (node * 7 % 11).min(9) & 1 == 0;
            }
            let (half, pieces) = (half_row(kept.len()), pieces(&kept));
            let nodes: Vec<usize> = (0..kept.len()).filter(|&node| kept[node]).collect();
            let mut row = vec![0.0; 2 * half];
            (0..kept.len()).for_each(|node| row[place_in_halves(node, half)] = node as f32);
            let mut pairs = Pairs::zeros(nodes.len(), 1);
            pairs.take::<Scalar>(&pieces, 0, &row);
            for (coarse, &fine) in nodes.iter().enumerate() {
                assert_eq!(pairs.kept[place_in_pairs(coarse)], fine as f32, "{pattern}");
                if kept.get(fine + 1) == Some(&false) {
                    assert_eq!(pairs.behind[place_in_pairs(coarse)], (fine + 1) as f32, "{pattern}");
                }
            }
            row.fill(f32::NAN);
            pairs.put::<Scalar>(&pieces, 0, &mut row);
            let put: Vec<f32> = (0..kept.len()).map(|node| row[place_in_halves(node, half)]).collect();
            assert!(put.iter().enumerate().all(|(node, &value)| value == node as f32), "{pattern}");
        }
    }
}
