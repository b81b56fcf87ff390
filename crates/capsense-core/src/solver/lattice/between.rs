//! Planes and rows between two levels, as the stages of a transfer leave them.

use super::layout::{BLOCK, Layout};
use std::ops::Range;

/// A plane of a level, apart by whether i + j is even or odd, places as in the level but for the plane's shift.
#[derive(Clone, Debug)]
pub(super) struct ThickPlane {
    pub(super) len: usize,
    pub(super) values: [Vec<f32>; 2],
}

/// A plane with the rows of the coarse level, but all nodes along x: even ones in one piece, then odd ones.
#[derive(Clone, Debug)]
pub(super) struct ThinPlane {
    pub(super) half: usize,
    columns: usize,
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

    /// The part and the start of row j's nodes of one parity.
    #[inline(always)]
    pub(super) fn row(&self, layout: &Layout, j: usize, parity: usize, column: usize) -> (usize, usize) {
        ((parity + j) % 2, column * self.len + BLOCK + (parity + j) / 2 + j * layout.row)
    }

    /// Row j's nodes of one parity, and some more to fill blocks.
    #[inline(always)]
    pub(super) fn half_row(
        &self,
        layout: &Layout,
        j: usize,
        parity: usize,
        column: usize,
        half: usize,
    ) -> &[f32] {
        let (part, start) = self.row(layout, j, parity, column);
        &self.values[part][start..start + half]
    }
}

impl ThinPlane {
    pub(super) fn clear(&mut self) {
        self.values.fill(0.0);
    }

    /// For vectors of a level with so many coarse rows.
    pub(super) fn zeros(layout: &Layout, rows: usize) -> Self {
        let (half, columns) = (half_row(layout.counts[0]), layout.columns);
        Self { half, columns, values: vec![0.0; rows * columns * 2 * half] }
    }

    /// Where a node is in a row. There is room behind the last.
    #[inline(always)]
    pub(super) fn place(&self, node: usize) -> usize {
        place_in_halves(node, self.half)
    }

    /// Where the node before another is. There is room before the first.
    #[inline(always)]
    pub(super) fn place_before(&self, node: usize) -> usize {
        if node.is_multiple_of(2) { self.place(node + 1) - 1 } else { self.place(node - 1) }
    }

    /// A row: even nodes, then odd ones.
    #[inline(always)]
    pub(super) fn row(&self, j: usize, column: usize) -> &[f32] {
        &self.values[(j * self.columns + column) * 2 * self.half..][..2 * self.half]
    }

    #[inline(always)]
    pub(super) fn row_mut(&mut self, j: usize, column: usize) -> &mut [f32] {
        &mut self.values[(j * self.columns + column) * 2 * self.half..][..2 * self.half]
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
