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

/// A row in one column.
#[derive(Clone, Debug)]
pub(super) struct Pairs {
    /// Number of kept nodes, in whole blocks for each parity.
    len: usize,
    kept: Vec<f32>,
    behind: Vec<f32>,
    /// What has been gathered, before it is dealt out.
    sums: Vec<f32>,
}

/// The shares of a row's eliminated nodes in the values of the nodes before and behind them.
#[derive(Clone, Copy)]
pub(super) struct RowShares<'a> {
    previous: &'a [f32],
    next: &'a [f32],
}

/// Successive nodes that are copied together: a block of kept nodes, each with an eliminated one behind it, or two blocks
/// of which none has. A piece may have fewer nodes, and what is copied too much is overwritten by the pieces behind it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    /// Where the first node and the one behind it are in a fine row, and where the first is in pairs.
    own: usize,
    next: usize,
    kept: usize,
    paired: bool,
}

impl<'a> RowShares<'a> {
    /// Those of row (j, k) of a stage across x.
    #[inline(always)]
    pub(super) fn of(stage: &'a Stage, j: usize, k: usize) -> Self {
        Self { previous: stage.previous.row(j, k), next: stage.next.row(j, k) }
    }
}

impl Pairs {
    pub(super) fn clear(&mut self) {
        for values in [&mut self.kept, &mut self.behind, &mut self.sums] {
            values.fill(0.0);
        }
    }

    /// For rows of so many kept nodes.
    pub(super) fn zeros(nodes: usize) -> Self {
        let zeros = vec![0.0; room_for_pairs(nodes)];
        let len = nodes.next_multiple_of(2 * BLOCK);
        Self { len, kept: zeros.clone(), behind: zeros.clone(), sums: zeros }
    }

    /// Takes a fine row apart.
    #[inline(always)]
    pub(super) fn take<S: Simd>(&mut self, pieces: &[Piece], fine: &[f32]) {
        for &Piece { own, next, kept, paired } in pieces {
            let (own, next) = (&fine[own..own + BLOCK], &fine[next..next + BLOCK]);
            if paired {
                copy::<S>(&mut self.kept[kept..kept + BLOCK], own);
                copy::<S>(&mut self.behind[kept..kept + BLOCK], next);
            } else {
                collect(&mut self.kept[kept..kept + 2 * BLOCK], own, next);
            }
        }
    }

    /// Puts a fine row together.
    #[inline(always)]
    pub(super) fn put<S: Simd>(&self, pieces: &[Piece], fine: &mut [f32]) {
        for &Piece { own, next, kept, paired } in pieces {
            if paired {
                copy::<S>(&mut fine[own..own + BLOCK], &self.kept[kept..kept + BLOCK]);
                copy::<S>(&mut fine[next..next + BLOCK], &self.behind[kept..kept + BLOCK]);
            } else {
                let mut halves = [[0.0; BLOCK]; 2];
                let [first, second] = &mut halves;
                deal(&self.kept[kept..kept + 2 * BLOCK], first, second);
                copy::<S>(&mut fine[own..own + BLOCK], first);
                copy::<S>(&mut fine[next..next + BLOCK], second);
            }
        }
    }

    /// Adds to the kept nodes what they get of the eliminated ones, and deals the sums out to even and odd nodes.
    #[inline(always)]
    pub(super) fn restrict<S: Simd>(
        &mut self,
        simd: S,
        shares: RowShares<'_>,
        even: &mut [f32],
        odd: &mut [f32],
    ) {
        let (own, before) = (BLOCK..BLOCK + self.len, BLOCK - 1..BLOCK - 1 + self.len);
        let sums = &mut self.sums[..self.len];
        let next = [&shares.previous[own.clone()], &self.behind[own.clone()]];
        let previous = [&shares.next[before.clone()], &self.behind[before]];
        gather(simd, sums, &self.kept[own], next, previous);
        deal(sums, even, odd);
    }

    /// Takes the kept nodes, even and odd ones, and interpolates the eliminated ones. There must be a block of each more
    /// than are in the row; the node behind the last has no share in anything.
    #[inline(always)]
    pub(super) fn interpolate<S: Simd>(&mut self, simd: S, shares: RowShares<'_>, even: &[f32], odd: &[f32]) {
        let (own, after) = (BLOCK..BLOCK + self.len, BLOCK + 1..BLOCK + 1 + self.len);
        collect(&mut self.kept[BLOCK..][..self.len + 2 * BLOCK], even, odd);
        let previous = [&shares.previous[own.clone()], &self.kept[own.clone()]];
        let next = [&shares.next[own.clone()], &self.kept[after]];
        combine(simd, &mut self.behind[own], previous, next);
    }
}

/// Takes apart a row of which some nodes are kept.
pub(super) fn pieces(kept: &[bool]) -> Vec<Piece> {
    let half = half_row(kept.len());
    let mut pieces: Vec<Piece> = Vec::new();
    let mut room = 0;
    for (coarse, fine) in (0..kept.len()).filter(|&node| kept[node]).enumerate() {
        let paired = kept.get(fine + 1) == Some(&false);
        if room == 0 || pieces.last().is_none_or(|last| last.paired != paired) {
            let (own, next) = (place_in_halves(fine, half), place_in_halves(fine + 1, half));
            pieces.push(Piece { own, next, kept: place_in_pairs(coarse), paired });
            room = if paired { BLOCK } else { 2 * BLOCK };
        }
        room -= 1;
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
