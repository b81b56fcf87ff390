//! What eliminated nodes take from their neighbours along the axis of a stage.

use super::between::half_row;
use super::layout::{BLOCK, Layout, RED};
use super::pairs::{place_in_pairs, room_for_pairs};
use super::rows::copy_every_second;
use std::ops::Range;

/// A number for every eliminated node, zero for others. Across x it stands where the coarse node before is, else where the
/// node is in the fine network.
#[derive(Clone, Debug)]
pub(super) struct Shares {
    /// Number of nodes along x, and of rows in a plane.
    counts: [usize; 2],
    /// The place of the first node in its row, and the distance between neighbours along each axis.
    first: usize,
    pub(super) strides: [usize; 3],
    /// Padded by one plane at either end.
    pub(super) values: Vec<f32>,
    arranged: Arranged,
}

/// The same as the kernels want it.
#[derive(Clone, Debug)]
enum Arranged {
    /// For stages across z: red nodes in the layout of the level.
    Red(Layout, Vec<f32>),
    /// For stages across y: each row's even nodes and, at a distance, odd ones.
    Halves(usize, Vec<f32>),
    /// For stages across x, no other.
    Pairs,
}

impl Shares {
    /// Zeros, for a stage from so many nodes to so many; `layout` is that of the level that the stage starts from.
    pub(super) fn zeros(fine: [usize; 3], coarse: [usize; 3], axis: usize, layout: &Layout) -> Self {
        let [nx, ny, nz] = fine;
        let half = half_row(nx);
        let arranged = match axis {
            2 => Arranged::Red(*layout, vec![0.0; layout.len()]),
            1 => Arranged::Halves(half, vec![0.0; ny * nz * 2 * half]),
            _ => Arranged::Pairs,
        };
        let (first, row) = match axis {
            0 => (place_in_pairs(0), room_for_pairs(coarse[0])),
            _ => (0, nx.next_multiple_of(BLOCK)),
        };
        let (strides, values) = ([1, row, row * ny], vec![0.0; row * ny * (nz + 2)]);
        Self { counts: [nx, ny], first, strides, values, arranged }
    }

    /// Zeros everywhere.
    pub(super) fn clear(&mut self) {
        self.values.fill(0.0);
        if let Arranged::Red(_, arranged) | Arranged::Halves(_, arranged) = &mut self.arranged {
            arranged.fill(0.0);
        }
    }

    /// Place of a node's number.
    #[inline(always)]
    pub(super) fn place(&self, [i, j, k]: [usize; 3]) -> usize {
        self.first + i + j * self.strides[1] + (k + 1) * self.strides[2]
    }

    /// Hands some nodes of row (j, k), in whole blocks, on to the kernels.
    #[inline(always)]
    pub(super) fn arrange(&mut self, nodes: &Range<usize>, j: usize, k: usize) {
        let Range { start, end } = *nodes;
        let row = self.place([0, j, k]);
        match &mut self.arranged {
            Arranged::Red(layout, arranged) => {
                let first = (j + k) % 2;
                let row = &self.values[row..][start + first..end.min(self.counts[0])];
                let (RED, place) = layout.place([start + first, j, k]) else { return };
                copy_every_second(&mut arranged[place..][..row.len().div_ceil(2)], row);
            }
            Arranged::Halves(half, arranged) => {
                let even = (k * self.counts[1] + j) * 2 * *half + BLOCK + start / 2;
                let (row, n) = (&self.values[row..], (end - start) / 2);
                copy_every_second(&mut arranged[even..][..n], &row[start..end]);
                copy_every_second(&mut arranged[even + *half..][..n], &row[start + 1..end]);
            }
            Arranged::Pairs => {}
        }
    }

    /// Those of some red nodes.
    #[inline(always)]
    pub(super) fn red(&self, places: Range<usize>) -> &[f32] {
        match &self.arranged {
            Arranged::Red(_, values) => &values[places],
            _ => &[],
        }
    }

    /// Those of row (j, k).
    #[inline(always)]
    pub(super) fn row(&self, j: usize, k: usize) -> &[f32] {
        let [_, row, plane] = self.strides;
        match &self.arranged {
            Arranged::Red(..) => &[],
            Arranged::Halves(half, values) => &values[(k * self.counts[1] + j) * 2 * half..][..2 * half],
            Arranged::Pairs => &self.values[j * row + (k + 1) * plane..][..row],
        }
    }
}
