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
/// ones. Columns are as far apart as in thick planes.
#[derive(Clone, Debug)]
pub(super) struct HalfRows {
    /// Distance between the pieces.
    half: usize,
    pub(super) columns: HalfColumns,
    values: Vec<f32>,
}

/// How the nodes of one parity in a row are spread over all columns.
#[derive(Clone, Copy, Debug)]
pub(super) struct HalfColumns {
    /// Number of nodes in each column, in whole blocks.
    len: usize,
    /// Distance between columns.
    distance: usize,
    /// From the first node in the first column to the last in the last.
    pub(super) span: usize,
}

impl ThickPlane {
    pub(super) fn clear(&mut self) {
        self.values.iter_mut().for_each(|values| values.fill(0.0));
    }

    /// For vectors of a level.
    pub(super) fn zeros(layout: &Layout) -> Self {
        let Layout { counts, columns, plane, .. } = layout;
        let len = (plane / columns + 4 * BLOCK + counts[0]).max(2 * half_row(counts[0]));
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

    /// Row j's nodes of one parity in all columns, as [`HalfRows::nodes`] has them.
    #[inline(always)]
    pub(super) fn nodes(&self, layout: &Layout, j: usize, parity: usize, span: usize) -> &[f32] {
        let (part, start) = self.row(layout, j, parity);
        &self.values[part][start..start + span]
    }

    #[inline(always)]
    pub(super) fn nodes_mut(&mut self, layout: &Layout, j: usize, parity: usize, span: usize) -> &mut [f32] {
        let (part, start) = self.row(layout, j, parity);
        &mut self.values[part][start..start + span]
    }
}

impl HalfRows {
    pub(super) fn clear(&mut self) {
        self.values.fill(0.0);
    }

    /// For vectors of a level.
    pub(super) fn zeros(layout: &Layout, thick: &ThickPlane) -> Self {
        let (half, distance) = (half_row(layout.counts[0]), thick.len);
        let len = half - 3 * BLOCK;
        let span = (layout.columns - 1) * distance + len;
        let columns = HalfColumns { len, distance, span };
        Self { half, columns, values: vec![0.0; layout.columns * distance] }
    }

    /// Where the nodes of one parity are in a column's row, and in the shares of that row.
    #[inline(always)]
    pub(super) fn places(&self, parity: usize) -> Range<usize> {
        let start = parity * self.half + BLOCK;
        start..start + self.columns.len
    }

    /// The nodes of one parity from those of the first column to those of the last.
    #[inline(always)]
    pub(super) fn nodes(&self, parity: usize) -> &[f32] {
        &self.values[parity * self.half + BLOCK..][..self.columns.span]
    }

    #[inline(always)]
    pub(super) fn nodes_mut(&mut self, parity: usize) -> &mut [f32] {
        &mut self.values[parity * self.half + BLOCK..][..self.columns.span]
    }

    /// One column's row.
    #[inline(always)]
    pub(super) fn row(&self, column: usize) -> &[f32] {
        &self.values[column * self.columns.distance..][..2 * self.half]
    }

    #[inline(always)]
    pub(super) fn row_mut(&mut self, column: usize) -> &mut [f32] {
        &mut self.values[column * self.columns.distance..][..2 * self.half]
    }
}

impl HalfColumns {
    /// Where the nodes of one column are.
    #[inline(always)]
    pub(super) fn places(self, column: usize) -> Range<usize> {
        let start = column * self.distance;
        start..start + self.len
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
