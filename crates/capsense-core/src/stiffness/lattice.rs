//! The stiffness matrix of a lattice: the network and what multiplies the weights of few of its edges, no indices.

use super::{LANES, Lane};
use crate::few::Few;
use crate::mesh::Lattice;

/// What multiplies the weights of the network's edges, which methods are given.
#[derive(Clone, Debug)]
pub(super) struct LatticeValues {
    lattice: Lattice,
    factors: Few<f64>,
}

impl LatticeValues {
    /// The network itself.
    pub(super) fn new(lattice: &Lattice, edges: usize) -> Self {
        Self { lattice: lattice.clone(), factors: Few::of(edges, 1.0) }
    }

    /// Gives an edge another factor. Returns whether it has another weight than before.
    pub(super) fn scale(&mut self, network: &[f64], edge: usize, factor: f64) -> bool {
        let before = self.factors.set(edge, (factor != 1.0).then_some(factor));
        (network[edge] * before).to_bits() != (network[edge] * factor).to_bits()
    }

    /// The weight of an edge.
    #[inline]
    pub(super) fn weight(&self, network: &[f64], edge: usize) -> f64 {
        network[edge] * self.factors.get(edge)
    }

    /// The weights to the next nodes along all axes. Edges that do not exist weigh nothing.
    #[inline]
    pub(super) fn weights_from(&self, network: &[f64], node: usize) -> [f64; 3] {
        let factors = self.factors.successive::<3>(3 * node);
        let weights = &network[3 * node..3 * node + 3];
        [0, 1, 2].map(|axis| weights[axis] * factors[axis])
    }

    /// The neighbours of a node and the weights to them.
    pub(super) fn row(&self, network: &[f64], node: usize) -> impl Iterator<Item = (usize, f64)> {
        let (strides, place) = (self.lattice.strides(), self.lattice.node_place(node));
        let last = self.lattice.node_counts().map(|count| count - 1);
        (0..3).flat_map(move |axis| {
            let before = (place[axis] > 0).then(|| node - strides[axis]);
            let after = (place[axis] < last[axis]).then(|| node + strides[axis]);
            let before = before.map(|other| (other, self.weight(network, 3 * other + axis)));
            before.into_iter().chain(after.map(|other| (other, self.weight(network, 3 * node + axis))))
        })
    }

    /// Sum of the weights around a node. Edges that do not exist weigh nothing.
    pub(super) fn diagonal(&self, network: &[f64], node: usize) -> f64 {
        let strides = self.lattice.strides();
        let along = |axis: usize| {
            let before = node.checked_sub(strides[axis]).map(|other| self.weight(network, 3 * other + axis));
            self.weight(network, 3 * node + axis) + before.unwrap_or(0.0)
        };
        (0..3).map(along).sum()
    }

    /// y = K x, and the columns' xᵀy.
    pub(super) fn apply<T: Copy + Into<f64>>(
        &self,
        network: &[f64],
        x: &[[T; LANES]],
        y: &mut [Lane],
    ) -> Lane {
        let nodes = self.lattice.node_counts().iter().product();
        let mut products = [0.0; LANES];
        for (node, y) in y[..nodes].iter_mut().enumerate() {
            let here = x[node].map(Into::<f64>::into);
            *y = [0.0; LANES];
            for (other, weight) in self.row(network, node) {
                let there = x[other].map(Into::<f64>::into);
                (0..LANES).for_each(|lane| y[lane] += weight * (here[lane] - there[lane]));
            }
            (0..LANES).for_each(|lane| products[lane] += here[lane] * y[lane]);
        }
        products
    }
}
