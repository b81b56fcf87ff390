//! Planes and rows between two levels, as the stages of a transfer leave them.

use super::layout::{BLOCK, Layout};
use std::ops::Range;

/// A plane of a level, apart by whether i + j is even or odd, places as in the level but for the plane's shift.
#[derive(Clone, Debug)]
pub(super) struct ThickPlane {
    pub(super) len: usize,
    pub(super) values: [Vec<f32>; 2],
}

/// A row of the coarse level along y and z, but with all nodes along x, in every column: even nodes in one piece, then odd
/// ones.
#[derive(Clone, Debug)]
pub(super) struct HalfRows {
    half: usize,
    values: Vec<f32>,
}

impl ThickPlane {
    pub(super) fn clear(&mut self) {
        self.values.iter_mut().for_each(|values| values.fill(0.0));
    }

    /// For vectors of a level.
    pub(super) fn zeros(layout: &Layout) -> Self {
        let Layout { counts, columns, plane, .. } = layout;
        let len = plane / columns + 4 * BLOCK + counts[0];
        Self { len, values: [vec![0.0; columns * len], vec![0.0; columns * len]] }
    }

    /// Which part the nodes of one colour in plane k are in, and where they are.
    #[inline(always)]
    pub(super) fn part(
        &self,
        layout: &Layout,
        colour: usize,
        k: usize,
        column: usize,
    ) -> (usize, Range<usize>) {
        let places = layout.plane(k);
        let start = column * self.len + BLOCK + places.start - layout.shift(colour, k);
        ((colour + k) % 2, start..start + places.len())
    }

    /// The part and the start of row j's nodes of one parity, in the first column; the others are `len` apart.
    #[inline(always)]
    pub(super) fn row(&self, layout: &Layout, j: usize, parity: usize) -> (usize, usize) {
        ((parity + j) % 2, BLOCK + (parity + j) / 2 + j * layout.row)
    }

    /// Row j's nodes of one parity in all columns, from those in the first column on.
    #[inline(always)]
    pub(super) fn half_rows(&self, layout: &Layout, j: usize, parity: usize) -> &[f32] {
        let (part, start) = self.row(layout, j, parity);
        &self.values[part][start..]
    }
}

impl HalfRows {
    pub(super) fn clear(&mut self) {
        self.values.fill(0.0);
    }

    /// For vectors of a level.
    pub(super) fn zeros(layout: &Layout) -> Self {
        let half = half_row(layout.counts[0]);
        Self { half, values: vec![0.0; layout.columns * 2 * half] }
    }

    /// Where the nodes of one parity are in a row, in whole blocks: in one column, and in shares.
    #[inline(always)]
    pub(super) fn nodes(&self, parity: usize) -> Range<usize> {
        let start = parity * self.half + BLOCK;
        start..start + self.half - 3 * BLOCK
    }

    /// One column's.
    #[inline(always)]
    pub(super) fn column(&self, column: usize) -> &[f32] {
        &self.values[column * 2 * self.half..][..2 * self.half]
    }

    #[inline(always)]
    pub(super) fn column_mut(&mut self, column: usize) -> &mut [f32] {
        &mut self.values[column * 2 * self.half..][..2 * self.half]
    }
}

/// Room for every second node of a row, in blocks: one to spare before them, and two behind.
pub(super) fn half_row(nodes: usize) -> usize {
    3 * BLOCK + nodes.div_ceil(2).next_multiple_of(BLOCK)
}

/// Where a node is in a row of even nodes and, behind these, odd ones.
#[inline(always)]
pub(super) fn place_in_halves(node: usize, half: usize) -> usize {
    node % 2 * half + node / 2 + BLOCK
}
