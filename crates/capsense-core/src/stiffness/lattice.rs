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
        let nodes = self.lattice.node_counts().iter().product();
        let mut products = [0.0; LANES];
        for (node, y) in y[..nodes].iter_mut().enumerate() {
            let here = x[node].map(Into::<f64>::into);
            *y = [0.0; LANES];
            for (other, weight) in self.row(node) {
                let there = x[other].map(Into::<f64>::into);
                (0..LANES).for_each(|lane| y[lane] += weight * (here[lane] - there[lane]));
            }
            (0..LANES).for_each(|lane| products[lane] += here[lane] * y[lane]);
        }
        products
    }
}
