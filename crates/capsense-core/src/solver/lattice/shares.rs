//! What eliminated nodes take from their neighbours along the axis of a stage.

use super::between::half_row;
use super::layout::{BLOCK, Layout, RED};
use super::pairs::{place_in_pairs, room_for_pairs};
use super::rows::{copy_every_second, deal_piece};
use std::ops::Range;

/// A number for every eliminated node. Across x it stands where the coarse node before is, with zeros where none is eliminated;
/// across y and z, rows and planes that are kept have no place.
#[derive(Clone, Debug)]
pub(super) struct Shares {
    /// Number of nodes along x.
    nodes: usize,
    /// What each row of a plane, and each plane, is among those that have numbers.
    numbered: [Vec<u32>; 2],
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
    /// For stages across y: each eliminated row's even nodes and, at a distance, odd ones.
    Halves(usize, Vec<f32>),
    /// For stages across x, no other.
    Pairs,
}

impl Shares {
    /// Zeros, for a stage from so many nodes that keeps those planes across an axis for which `kept` holds; `layout` is that of
    /// the level that the stage starts from.
    pub(super) fn zeros(fine: [usize; 3], axis: usize, kept: &[bool], layout: &Layout) -> Self {
        let coarse = kept.iter().filter(|kept| **kept).count();
        let before = |plane: usize| kept[..plane].iter().filter(|kept| !**kept).count();
        let numbered = [1, 2].map(|across| {
            let rows = 0..fine[across];
            rows.map(|row| if across == axis { before(row) as u32 } else { row as u32 }).collect()
        });
        let nx = fine[0];
        let [ny, nz] = [1, 2].map(|across| if across == axis { kept.len() - coarse } else { fine[across] });
        let half = half_row(nx);
        let arranged = match axis {
            2 => Arranged::Red(*layout, vec![0.0; layout.len()]),
            1 => Arranged::Halves(half, vec![0.0; ny * nz * 2 * half]),
            _ => Arranged::Pairs,
        };
        let (first, row) = match axis {
            0 => (place_in_pairs(0), room_for_pairs(coarse)),
            _ => (0, nx.next_multiple_of(BLOCK)),
        };
        let (strides, values) = ([1, row, row * ny], vec![0.0; row * ny * (nz + 2)]);
        Self { nodes: nx, numbered, first, strides, values, arranged }
    }

    /// Zeros everywhere.
    pub(super) fn clear(&mut self) {
        self.values.fill(0.0);
        if let Arranged::Red(_, arranged) | Arranged::Halves(_, arranged) = &mut self.arranged {
            arranged.fill(0.0);
        }
    }

    /// Place of a node's number, which must be in a row that has some.
    #[inline(always)]
    pub(super) fn place(&self, [i, j, k]: [usize; 3]) -> usize {
        let [j, k] = self.row_of(j, k);
        self.first + i + j * self.strides[1] + (k + 1) * self.strides[2]
    }

    /// What row (j, k) of the fine network is among those that are here.
    #[inline(always)]
    fn row_of(&self, j: usize, k: usize) -> [usize; 2] {
        let [along_y, along_z] = &self.numbered;
        [along_y[j] as usize, along_z[k] as usize]
    }

    /// Where row (j, k) is among the halves of rows, whose length is given.
    #[inline(always)]
    fn place_in_rows(&self, half: usize, j: usize, k: usize) -> usize {
        let ([j, k], rows) = (self.row_of(j, k), self.strides[2] / self.strides[1]);
        (k * rows + j) * 2 * half
    }

    /// Hands some nodes of row (j, k), in whole blocks, on to the kernels.
    #[inline(always)]
    pub(super) fn arrange(&mut self, nodes: &Range<usize>, j: usize, k: usize) {
        let Range { start, end } = *nodes;
        let row = self.place([0, j, k]);
        let in_rows = match &self.arranged {
            Arranged::Halves(half, _) => self.place_in_rows(*half, j, k),
            _ => 0,
        };
        match &mut self.arranged {
            Arranged::Red(layout, arranged) => {
                let first = (j + k) % 2;
                let row = &self.values[row..][start + first..end.min(self.nodes)];
                let (RED, place) = layout.place([start + first, j, k]) else { return };
                copy_every_second(&mut arranged[place..][..row.len().div_ceil(2)], row);
            }
            Arranged::Halves(half, arranged) => {
                let even = in_rows + BLOCK + start / 2;
                let n = (end - start) / 2;
                let (to_even, to_odd) = arranged[even..even + *half + n].split_at_mut(*half);
                deal_piece(&self.values[row + start..row + end], &mut to_even[..n], to_odd);
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
            Arranged::Halves(half, values) => &values[self.place_in_rows(*half, j, k)..][..2 * half],
            Arranged::Pairs => &self.values[j * row + (k + 1) * plane..][..row],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Eliminated rows have places of their own, and kernels find there what was put in.
    #[test]
    fn eliminated_rows_stand_apart() {
        let (fine, eliminated) = ([19, 9, 10], [1, 4, 6]);
        let kept: Vec<bool> = (0..fine[1]).map(|row| !eliminated.contains(&row)).collect();
        let mut shares = Shares::zeros(fine, 1, &kept, &Layout::new(fine, [0, 0]));
        let rows = || (0..fine[2]).flat_map(|k| eliminated.map(|j| (j, k)));
        let number = |i: usize, j: usize, k: usize| (i + 100 * j + 1000 * k) as f32;
        for (j, k) in rows() {
            let at = shares.place([0, j, k]);
            (0..fine[0]).for_each(|i| shares.values[at + i] = number(i, j, k));
            shares.arrange(&(0..fine[0].next_multiple_of(BLOCK)), j, k);
        }
        let half = half_row(fine[0]);
        for (j, k) in rows() {
            for i in 0..fine[0] {
                let at = [0, half][i % 2] + BLOCK + i / 2;
                assert_eq!(shares.row(j, k)[at], number(i, j, k), "{i} {j} {k}");
            }
        }
        let plane = fine[0].next_multiple_of(BLOCK) * eliminated.len();
        assert_eq!(shares.values.len(), plane * (fine[2] + 2));
    }
}
