//! The networks that the hierarchy is computed on: nodes in their natural order, x fastest.

use super::layout::BLOCK;
use super::rows::single;
use pulp::Simd;
use std::ops::Range;

/// A 7-point network in single precision. Rows are padded to whole blocks, and all arrays by one plane before the first and
/// by what is picked together with the last row's last node; padding is zero. Edges that would lead out of the lattice have
/// the weight zero, so nodes need not know whether they are at its end.
#[derive(Clone, Debug, Default)]
pub(super) struct Network {
    /// Number of nodes along each axis.
    pub(super) counts: [usize; 3],
    /// Distance between neighbours along each axis.
    pub(super) strides: [usize; 3],
    /// Weight to the next node along each axis.
    pub(super) next: [Vec<f32>; 3],
    /// Weight to fixed potentials that are no nodes of this network; infinite where the node itself is fixed.
    pub(super) leak: Vec<f32>,
}

impl Network {
    pub(super) fn new(counts: [usize; 3]) -> Self {
        let [nx, ny, nz] = counts;
        let row = nx.next_multiple_of(BLOCK);
        let zeros = || vec![0.0; row * ny * (nz + 1) + 3 * BLOCK];
        Self { counts, strides: [1, row, row * ny], next: [zeros(), zeros(), zeros()], leak: zeros() }
    }

    /// Zeros, as a new one.
    pub(super) fn clear(&mut self) {
        self.next.iter_mut().for_each(|weights| weights.fill(0.0));
        self.leak.fill(0.0);
    }

    /// Place of a node.
    #[inline(always)]
    pub(super) fn index(&self, node: [usize; 3]) -> usize {
        place(self.strides, node)
    }

    /// Inverses of the diagonal for successive nodes, whole blocks; zero where the potential is fixed.
    #[inline(always)]
    pub(super) fn invert_diagonal<S: Simd>(&self, simd: S, at: usize, inverse: &mut [f32]) {
        let (inverse, zero, one) =
            (S::as_mut_simd_f32s(inverse).0, simd.splat_f32s(0.0), simd.splat_f32s(1.0));
        let n = inverse.len();
        let ([x, y, z], [_, row, plane]) = (&self.next, self.strides);
        let (x_next, x_previous) = (&single::<S>(&x[at..])[..n], &single::<S>(&x[at - 1..])[..n]);
        let (y_next, y_previous) = (&single::<S>(&y[at..])[..n], &single::<S>(&y[at - row..])[..n]);
        let (z_next, z_previous) = (&single::<S>(&z[at..])[..n], &single::<S>(&z[at - plane..])[..n]);
        let leak = &single::<S>(&self.leak[at..])[..n];
        for i in 0..n {
            let along_x = simd.add_f32s(x_next[i], x_previous[i]);
            let along_y = simd.add_f32s(y_next[i], y_previous[i]);
            let along_z = simd.add_f32s(z_next[i], z_previous[i]);
            let weights = simd.add_f32s(simd.add_f32s(along_x, along_y), along_z);
            let diagonal = simd.add_f32s(weights, leak[i]);
            let is_coupled = simd.greater_than_f32s(diagonal, zero);
            inverse[i] = simd.select_f32s(is_coupled, simd.div_f32s(one, diagonal), zero);
        }
    }
}

/// Nodes of a network that changed, as one interval in each row.
#[derive(Clone, Debug, Default)]
pub(super) struct Changed {
    counts: [usize; 3],
    intervals: Vec<Range<u32>>,
    rows: Vec<[u32; 2]>,
}

impl Changed {
    pub(super) fn nothing(counts: [usize; 3]) -> Self {
        Self { counts, intervals: vec![0..0; counts[1] * counts[2]], rows: Vec::new() }
    }

    pub(super) fn clear(&mut self) {
        let ny = self.counts[1];
        for [j, k] in self.rows.drain(..) {
            self.intervals[k as usize * ny + j as usize] = 0..0;
        }
    }

    /// Forgets all, and what room it took.
    pub(super) fn release(&mut self) {
        self.clear();
        self.rows = Vec::new();
    }

    /// Adds some nodes of row (j, k); those outside the network are ignored.
    pub(super) fn add(&mut self, nodes: Range<usize>, j: usize, k: usize) {
        let [nx, ny, nz] = self.counts;
        let (start, end) = (nodes.start as u32, nodes.end.min(nx) as u32);
        if j >= ny || k >= nz || start >= end {
            return;
        }
        let row = k * ny + j;
        let interval = &mut self.intervals[row];
        if interval.start >= interval.end {
            self.rows.push([j as u32, k as u32]);
            *interval = start..end;
        } else {
            *interval = interval.start.min(start)..interval.end.max(end);
        }
    }

    /// Adds all that others hold.
    pub(super) fn join(&mut self, others: &Self) {
        for row in 0..others.rows() {
            let (nodes, j, k) = others.row(row);
            self.add(nodes, j, k);
        }
    }

    /// Adds some nodes of the four rows beside row (j, k).
    pub(super) fn add_beside_row(&mut self, nodes: Range<usize>, j: usize, k: usize) {
        let (before_j, before_k) = (j.wrapping_sub(1), k.wrapping_sub(1));
        for (j, k) in [(j + 1, k), (before_j, k), (j, k + 1), (j, before_k)] {
            self.add(nodes.clone(), j, k);
        }
    }

    /// Puts the rows in the order in which they are in memory.
    pub(super) fn sort(&mut self) {
        self.rows.sort_unstable_by_key(|&[j, k]| (k, j));
    }

    /// In how many rows nodes changed. They are not visited by a closure, which would be a call in vectorised code.
    #[inline(always)]
    pub(super) fn rows(&self) -> usize {
        self.rows.len()
    }

    /// The changed nodes of such a row, j and k.
    #[inline(always)]
    pub(super) fn row(&self, number: usize) -> (Range<usize>, usize, usize) {
        let [j, k] = self.rows[number];
        let (j, k) = (j as usize, k as usize);
        let Range { start, end } = self.intervals[k * self.counts[1] + j];
        (start as usize..end as usize, j, k)
    }
}

/// Place of a node in a network with such distances between neighbours.
#[inline(always)]
pub(super) fn place(strides: [usize; 3], [i, j, k]: [usize; 3]) -> usize {
    i + j * strides[1] + (k + 1) * strides[2]
}

/// Some nodes of a row and those around them up to whole blocks.
#[inline(always)]
pub(super) fn whole_blocks(nodes: &Range<usize>) -> Range<usize> {
    nodes.start / BLOCK * BLOCK..nodes.end.next_multiple_of(BLOCK)
}
