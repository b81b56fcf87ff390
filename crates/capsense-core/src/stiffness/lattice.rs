//! The stiffness matrix of a lattice: three weights a node, no indices.

use super::{LANES, Lane};
use crate::mesh::Lattice;

/// The weights to the next node along each axis.
#[derive(Clone, Debug)]
pub(super) struct LatticeValues {
    counts: [usize; 3],
    /// Zero at the last node of a row. One more row and plane of zeros stand before the first node.
    weight: [Vec<f64>; 3],
    /// A row of zeros, the neighbours of the outermost rows.
    outside: Vec<Lane>,
}

impl LatticeValues {
    /// Weights by edge number.
    pub(super) fn new(lattice: &Lattice, weights: &[f64]) -> Self {
        let counts = lattice.node_counts();
        let padding = counts[0] * counts[1];
        let mut values = Self {
            counts,
            weight: std::array::from_fn(|_| vec![0.0; padding + weights.len() / 3]),
            outside: vec![[0.0; LANES]; counts[0]],
        };
        for (edge, &weight) in weights.iter().enumerate() {
            values.set_weight(edge, weight);
        }
        values
    }

    fn padding(&self) -> usize {
        self.counts[0] * self.counts[1]
    }

    fn strides(&self) -> [usize; 3] {
        [1, self.counts[0], self.counts[0] * self.counts[1]]
    }

    pub(super) fn set_weight(&mut self, edge: usize, weight: f64) {
        let at = self.padding() + edge / 3;
        self.weight[edge % 3][at] = weight;
    }

    pub(super) fn weight(&self, node: usize, axis: usize) -> f64 {
        self.weight[axis][self.padding() + node]
    }

    /// Sum of the weights around a node.
    pub(super) fn diagonal(&self, node: usize) -> f64 {
        let at = self.padding() + node;
        let strides = self.strides();
        (0..3).map(|axis| self.weight[axis][at] + self.weight[axis][at - strides[axis]]).sum()
    }

    /// y = K x, and the columns' xᵀy.
    pub(super) fn apply(&self, x: &[Lane], y: &mut [Lane]) -> Lane {
        let [nx, ny, nz] = self.counts;
        let (nodes, plane) = (nx * ny * nz, nx * ny);
        let mut products = [0.0; LANES];
        for row in (0..nodes).step_by(nx) {
            let neighbour = |at: Option<usize>| match at {
                Some(at) if at < nodes => &x[at..at + nx],
                _ => &self.outside[..],
            };
            let weights =
                |axis: usize, before: usize| &self.weight[axis][self.padding() + row - before..][..nx];
            let stencil = RowStencil {
                across: [
                    (weights(1, nx), neighbour(row.checked_sub(nx))),
                    (weights(1, 0), neighbour(Some(row + nx))),
                    (weights(2, plane), neighbour(row.checked_sub(plane))),
                    (weights(2, 0), neighbour(Some(row + plane))),
                ],
                along: weights(0, 0),
            };
            stencil.apply(&x[row..row + nx], &mut y[row..row + nx], &mut products);
        }
        products
    }
}

/// One row of nodes along x with the weights and values around it.
struct RowStencil<'a> {
    across: [(&'a [f64], &'a [Lane]); 4],
    along: &'a [f64],
}

impl RowStencil<'_> {
    #[inline]
    fn apply(&self, x: &[Lane], y: &mut [Lane], products: &mut Lane) {
        let nx = x.len();
        let [(wa, a), (wb, b), (wc, c), (wd, d)] = self.across;
        let (wa, wb, wc, wd) = (&wa[..nx], &wb[..nx], &wc[..nx], &wd[..nx]);
        let (a, b, c, d) = (&a[..nx], &b[..nx], &c[..nx], &d[..nx]);
        let (along, y) = (&self.along[..nx], &mut y[..nx]);
        // The current through the edge from the node before.
        let mut current = [0.0; LANES];
        for i in 0..nx {
            let here = x[i];
            let next = if i + 1 < nx { x[i + 1] } else { here };
            for lane in 0..LANES {
                let v = here[lane];
                let onward = along[i] * (v - next[lane]);
                let sum = (wa[i] * (v - a[i][lane]) + wb[i] * (v - b[i][lane]))
                    + (wc[i] * (v - c[i][lane]) + wd[i] * (v - d[i][lane]))
                    + (onward - current[lane]);
                current[lane] = onward;
                y[i][lane] = sum;
                products[lane] += v * sum;
            }
        }
    }
}
