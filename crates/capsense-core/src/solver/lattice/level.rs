//! One level of the lattice hierarchy: a 7-point network in single precision, and red-black Gauss-Seidel on it.
//!
//! Nodes are coloured like a chess board, so no two of one colour are neighbours: their order does not matter, and the
//! result is the same however the work is divided.

use crate::stiffness::{LANES, Lane32};

/// A 7-point network. All arrays are padded by one plane at either end. Edges that would lead out of the lattice have the
/// weight zero, so nodes need not know whether they are at its end.
#[derive(Clone, Debug)]
pub(super) struct Level {
    /// Number of nodes along each axis.
    pub(super) counts: [usize; 3],
    pub(super) stencil: Vec<Stencil>,
    /// Weight to fixed potentials that are no nodes of this level.
    pub(super) leak: Vec<f32>,
    /// Right-hand side, correction and residual. The residual is that of red nodes; at black ones it is zero.
    pub(super) b: Vec<Lane32>,
    pub(super) x: Vec<Lane32>,
    pub(super) r: Vec<Lane32>,
}

/// What a node is coupled by.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Stencil {
    /// Weight to the next node along each axis.
    pub(super) next: [f32; 3],
    /// Inverse of the diagonal; zero where the potential is fixed.
    pub(super) inverse: f32,
}

/// Nodes whose three indices have an even sum are red.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Colour {
    Red,
    Black,
}

impl Level {
    pub(super) fn new(counts: [usize; 3]) -> Self {
        let padded = counts[0] * counts[1] * (counts[2] + 2);
        let vectors = || vec![[0.0; LANES]; padded];
        Self {
            counts,
            stencil: vec![Stencil::default(); padded],
            leak: vec![0.0; padded],
            b: vectors(),
            x: vectors(),
            r: vectors(),
        }
    }

    /// Distance in the arrays between neighbours along each axis.
    pub(super) fn strides(&self) -> [usize; 3] {
        [1, self.counts[0], self.counts[0] * self.counts[1]]
    }

    /// Place of a node in the arrays.
    pub(super) fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        ((k + 1) * self.counts[1] + j) * self.counts[0] + i
    }

    /// Places of all nodes in the arrays, in their order.
    pub(super) fn nodes(&self) -> std::ops::Range<usize> {
        let plane = self.counts[0] * self.counts[1];
        plane..plane * (self.counts[2] + 1)
    }

    /// Weight from a node to the next along an axis.
    pub(super) fn weight(&self, axis: usize, at: usize) -> f32 {
        self.stencil[at].next[axis]
    }

    /// Sum of the weights around a node.
    pub(super) fn diagonal(&self, at: usize) -> f32 {
        let strides = self.strides();
        let weights = (0..3).map(|axis| self.weight(axis, at) + self.weight(axis, at - strides[axis]));
        weights.sum::<f32>() + self.leak[at]
    }

    /// Sets the inverse of the diagonal, or fixes the potential.
    pub(super) fn set_inverse(&mut self, at: usize, fixed: bool) {
        let diagonal = self.diagonal(at);
        self.stencil[at].inverse = if fixed || diagonal == 0.0 { 0.0 } else { 1.0 / diagonal };
    }

    pub(super) fn is_fixed(&self, at: usize) -> bool {
        self.stencil[at].inverse == 0.0
    }

    /// x = one sweep on K x = b from zero, and r = b - K x after it: red nodes see no neighbours, and what black ones
    /// add is all that is left over at the red ones.
    pub(super) fn smooth_from_zero(&mut self) {
        for row in self.rows(Colour::Red) {
            for at in row.step_by(2) {
                let inverse = self.stencil[at].inverse;
                self.x[at] = self.b[at].map(|b| inverse * b);
            }
        }
        self.relax(Colour::Black);
        let [_, sy, sz] = self.strides();
        for row in self.rows(Colour::Red) {
            for at in row.step_by(2) {
                self.r[at] = neighbours(&self.stencil, &self.x, at, sy, sz);
            }
        }
    }

    /// One sweep on K x = b in the order that makes it, after [`Level::smooth_from_zero`], a symmetric smoother.
    pub(super) fn smooth(&mut self) {
        self.relax(Colour::Black);
        self.relax(Colour::Red);
    }

    /// Two sweeps on K x = b, symmetric by themselves.
    pub(super) fn smooth_both_ways(&mut self) {
        self.relax(Colour::Red);
        self.smooth();
    }

    /// Solves the equations of all nodes of one colour.
    fn relax(&mut self, colour: Colour) {
        let [_, sy, sz] = self.strides();
        for row in self.rows(colour) {
            for at in row.step_by(2) {
                let sum = neighbours(&self.stencil, &self.x, at, sy, sz);
                let (inverse, b) = (self.stencil[at].inverse, self.b[at]);
                self.x[at] = std::array::from_fn(|lane| inverse * (b[lane] + sum[lane]));
            }
        }
    }

    /// Each row from its first node of a colour to its end.
    fn rows(&self, colour: Colour) -> impl Iterator<Item = std::ops::Range<usize>> + use<> {
        let [nx, ny, _] = self.counts;
        let first = usize::from(colour == Colour::Black);
        let rows = self.nodes().step_by(nx).enumerate();
        rows.map(move |(row, at)| at + (row % ny + row / ny + first) % 2..at + nx)
    }
}

/// Σ w x over the six neighbours of a node.
#[inline(always)]
fn neighbours(stencil: &[Stencil], x: &[Lane32], at: usize, sy: usize, sz: usize) -> Lane32 {
    let [east, north, up] = stencil[at].next;
    let (west, south, down) = (stencil[at - 1].next[0], stencil[at - sy].next[1], stencil[at - sz].next[2]);
    let (xe, xw, xn, xs) = (&x[at + 1], &x[at - 1], &x[at + sy], &x[at - sy]);
    let (xu, xd) = (&x[at + sz], &x[at - sz]);
    std::array::from_fn(|lane| {
        (west * xw[lane] + east * xe[lane])
            + (south * xs[lane] + north * xn[lane])
            + (down * xd[lane] + up * xu[lane])
    })
}
