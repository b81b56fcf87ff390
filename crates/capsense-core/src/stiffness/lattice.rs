//! The stiffness matrix of a lattice: three weights a node, no indices.

use super::{LANES, Lane};
use crate::mesh::Lattice;

/// The weights to the next node along each axis.
#[derive(Clone, Debug)]
pub(super) struct LatticeValues {
    lattice: Lattice,
    /// Zero at the last node of a row. One more row and plane of zeros stand before the first node.
    weight: [Vec<f64>; 3],
}

impl LatticeValues {
    /// Weights by edge number.
    pub(super) fn new(lattice: &Lattice, weights: &[f64]) -> Self {
        let padded = lattice.strides()[2] + weights.len() / 3;
        let weight = std::array::from_fn(|_| vec![0.0; padded]);
        let mut values = Self { lattice: lattice.clone(), weight };
        for (edge, &weight) in weights.iter().enumerate() {
            values.set_weight(edge, weight);
        }
        values
    }

    fn padding(&self) -> usize {
        self.lattice.strides()[2]
    }

    pub(super) fn set_weight(&mut self, edge: usize, weight: f64) {
        let at = self.padding() + edge / 3;
        self.weight[edge % 3][at] = weight;
    }

    pub(super) fn weight(&self, node: usize, axis: usize) -> f64 {
        self.weight[axis][self.padding() + node]
    }

    /// The neighbours of a node and the weights to them.
    pub(super) fn row(&self, node: usize) -> impl Iterator<Item = (usize, f64)> {
        let (strides, place) = (self.lattice.strides(), self.lattice.node_place(node));
        let last = self.lattice.node_counts().map(|count| count - 1);
        (0..3).flat_map(move |axis| {
            let before = (place[axis] > 0).then(|| node - strides[axis]);
            let after = (place[axis] < last[axis]).then(|| node + strides[axis]);
            let before = before.map(|other| (other, self.weight(other, axis)));
            before.into_iter().chain(after.map(|other| (other, self.weight(node, axis))))
        })
    }

    /// Sum of the weights around a node.
    pub(super) fn diagonal(&self, node: usize) -> f64 {
        let at = self.padding() + node;
        let strides = self.lattice.strides();
        (0..3).map(|axis| self.weight[axis][at] + self.weight[axis][at - strides[axis]]).sum()
    }

    /// y = K x, and the columns' xᵀy.
    pub(super) fn apply<T: Copy + Into<f64>>(&self, x: &[[T; LANES]], y: &mut [Lane]) -> Lane {
        let [nx, ny, nz] = self.lattice.node_counts();
        let (nodes, plane) = (nx * ny * nz, nx * ny);
        let mut products = [0.0; LANES];
        for row in (0..nodes).step_by(nx) {
            let here = &x[row..row + nx];
            // Outermost rows have themselves for neighbours, with weight zero.
            let beside = |at: Option<usize>| at.and_then(|at| x.get(at..at + nx)).unwrap_or(here);
            let weights =
                |axis: usize, before: usize| &self.weight[axis][self.padding() + row - before..][..nx];
            let stencil = RowStencil {
                across: [
                    (weights(1, nx), beside(row.checked_sub(nx))),
                    (weights(1, 0), beside(Some(row + nx))),
                    (weights(2, plane), beside(row.checked_sub(plane))),
                    (weights(2, 0), beside(Some(row + plane))),
                ],
                along: weights(0, 0),
            };
            stencil.apply(here, &mut y[row..row + nx], &mut products);
        }
        products
    }
}

/// One row of nodes along x with the weights and values around it.
struct RowStencil<'a, T> {
    across: [(&'a [f64], &'a [[T; LANES]]); 4],
    along: &'a [f64],
}

impl<T: Copy + Into<f64>> RowStencil<'_, T> {
    #[inline]
    fn apply(&self, x: &[[T; LANES]], y: &mut [Lane], products: &mut Lane) {
        let nx = x.len();
        let [(wa, a), (wb, b), (wc, c), (wd, d)] = self.across;
        let (wa, wb, wc, wd) = (&wa[..nx], &wb[..nx], &wc[..nx], &wd[..nx]);
        let (a, b, c, d) = (&a[..nx], &b[..nx], &c[..nx], &d[..nx]);
        let (along, y) = (&self.along[..nx], &mut y[..nx]);
        let double = |lanes: &[T; LANES]| lanes.map(Into::<f64>::into);
        // The current through the edge from the node before.
        let mut current = [0.0; LANES];
        let mut here = double(&x[0]);
        for i in 0..nx {
            let next = if i + 1 < nx { double(&x[i + 1]) } else { here };
            let (a, b, c, d) = (double(&a[i]), double(&b[i]), double(&c[i]), double(&d[i]));
            for lane in 0..LANES {
                let v = here[lane];
                let onward = along[i] * (v - next[lane]);
                let sum = (wa[i] * (v - a[lane]) + wb[i] * (v - b[lane]))
                    + (wc[i] * (v - c[lane]) + wd[i] * (v - d[lane]))
                    + (onward - current[lane]);
                current[lane] = onward;
                y[i][lane] = sum;
                products[lane] += v * sum;
            }
            here = next;
        }
    }
}
