//! One level of the aggregation hierarchy: a network of any shape in single precision, and Gauss-Seidel on it.

use crate::stiffness::{LANES, Lane32};
use std::ops::Range;

/// No aggregate, or no entry.
pub(super) const NONE: u32 = u32::MAX;

/// A network: for each node its neighbours, in increasing order, and the weights to them.
#[derive(Clone, Debug)]
pub(super) struct Level {
    offsets: Vec<u32>,
    pub(super) columns: Vec<u32>,
    pub(super) weights: Vec<f32>,
    /// Where in each row the neighbours with a higher number start.
    higher: Vec<u32>,
    /// Weight to what is at a fixed potential and no node of this level.
    pub(super) leak: Vec<f32>,
    /// Inverse of the diagonal; zero where the potential is fixed.
    pub(super) inverse: Vec<f32>,
    /// Right-hand side, correction and residual.
    pub(super) b: Vec<Lane32>,
    pub(super) x: Vec<Lane32>,
    pub(super) r: Vec<Lane32>,
}

impl Level {
    /// A network of so many nodes whose weights still are zero. `neighbours` lists each node's, in increasing order.
    pub(super) fn new(neighbours: impl ExactSizeIterator<Item = Vec<u32>>) -> Self {
        let nodes = neighbours.len();
        let (mut offsets, mut columns, mut higher) = (vec![0], Vec::new(), Vec::new());
        for (node, row) in neighbours.enumerate() {
            higher.push((columns.len() + row.partition_point(|&other| (other as usize) < node)) as u32);
            columns.extend(row);
            offsets.push(columns.len() as u32);
        }
        let vectors = || vec![[0.0; LANES]; nodes];
        Self {
            offsets,
            weights: vec![0.0; columns.len()],
            columns,
            higher,
            leak: vec![0.0; nodes],
            inverse: vec![0.0; nodes],
            b: vectors(),
            x: vectors(),
            r: vectors(),
        }
    }

    pub(super) fn nodes(&self) -> usize {
        self.inverse.len()
    }

    /// Where a node's neighbours are.
    pub(super) fn row(&self, node: usize) -> Range<usize> {
        self.offsets[node] as usize..self.offsets[node + 1] as usize
    }

    pub(super) fn is_free(&self, node: usize) -> bool {
        self.inverse[node] != 0.0
    }

    /// x = one forward sweep on K x = b from zero, and r = b - K x after it: only neighbours already visited count, and
    /// what those visited later add is all that is left over.
    pub(super) fn smooth_from_zero(&mut self) {
        for node in 0..self.nodes() {
            let lower = self.row(node).start..self.higher[node] as usize;
            let sum = self.neighbours(lower);
            self.x[node] = std::array::from_fn(|lane| self.inverse[node] * (self.b[node][lane] + sum[lane]));
        }
        for node in 0..self.nodes() {
            let higher = self.higher[node] as usize..self.row(node).end;
            self.r[node] = self.neighbours(higher);
        }
    }

    /// One backward sweep on K x = b.
    pub(super) fn smooth_backward(&mut self) {
        (0..self.nodes()).rev().for_each(|node| self.relax(node));
    }

    /// Two sweeps on K x = b, symmetric by themselves.
    pub(super) fn smooth_both_ways(&mut self) {
        (0..self.nodes()).for_each(|node| self.relax(node));
        self.smooth_backward();
    }

    fn relax(&mut self, node: usize) {
        let sum = self.neighbours(self.row(node));
        self.x[node] = std::array::from_fn(|lane| self.inverse[node] * (self.b[node][lane] + sum[lane]));
    }

    /// Σ w x over some entries.
    #[inline]
    fn neighbours(&self, entries: Range<usize>) -> Lane32 {
        let mut sum = [0.0; LANES];
        for (&column, &weight) in self.columns[entries.clone()].iter().zip(&self.weights[entries]) {
            let x = &self.x[column as usize];
            for lane in 0..LANES {
                sum[lane] += weight * x[lane];
            }
        }
        sum
    }
}
