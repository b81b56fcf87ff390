//! One level of the lattice hierarchy: a 7-point network in single precision, and red-black Gauss-Seidel on it.
//!
//! Nodes are coloured like a chess board, so no two of one colour are neighbours: their order does not matter, and the
//! result is the same however the work is divided.

use crate::stiffness::LANES;

/// Potentials, residuals or corrections of several terminals at one node.
pub(super) type Lanes = [f32; LANES];

/// A 7-point network. All arrays are padded by one plane at either end, where weights are zero, so that every row has
/// four neighbouring rows in them.
#[derive(Clone, Debug)]
pub(super) struct Level {
    /// Number of nodes along each axis.
    pub(super) counts: [usize; 3],
    /// Weight to the next node along each axis; zero at the last.
    pub(super) weight: [Vec<f32>; 3],
    /// Weight to fixed potentials that are no nodes of this level.
    pub(super) leak: Vec<f32>,
    /// Inverse of the diagonal; zero where the potential is fixed.
    pub(super) inverse: Vec<f32>,
    /// Right-hand side, correction and residual.
    pub(super) b: Vec<Lanes>,
    pub(super) x: Vec<Lanes>,
    pub(super) r: Vec<Lanes>,
}

/// Nodes whose three indices have an even sum are red.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Colour {
    Red,
    Black,
}

/// What a row of nodes along x is coupled to: weights and the neighbours in the rows beside it.
struct Surroundings<'a> {
    along: &'a [f32],
    along_before: &'a [f32],
    across: [(&'a [f32], &'a [Lanes]); 4],
}

impl Surroundings<'_> {
    /// Σ w x over the six neighbours of a node.
    #[inline(always)]
    fn sum(&self, x: &[Lanes], i: usize) -> Lanes {
        let before = if i == 0 { [0.0; LANES] } else { x[i - 1] };
        let after = if i + 1 < x.len() { x[i + 1] } else { [0.0; LANES] };
        let [(wa, a), (wb, b), (wc, c), (wd, d)] = self.across;
        let (along_before, along) = (self.along_before[i], self.along[i]);
        let (wa, wb, wc, wd) = (wa[i], wb[i], wc[i], wd[i]);
        let (a, b, c, d) = (&a[i], &b[i], &c[i], &d[i]);
        std::array::from_fn(|lane| {
            (along_before * before[lane] + along * after[lane])
                + (wa * a[lane] + wb * b[lane])
                + (wc * c[lane] + wd * d[lane])
        })
    }
}

impl Level {
    pub(super) fn new(counts: [usize; 3]) -> Self {
        let padded = counts[0] * counts[1] * (counts[2] + 2);
        let zeros = || vec![0.0; padded];
        let vectors = || vec![[0.0; LANES]; padded];
        Self {
            counts,
            weight: [zeros(), zeros(), zeros()],
            leak: zeros(),
            inverse: zeros(),
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

    /// Sum of the weights around a node.
    pub(super) fn diagonal(&self, at: usize) -> f32 {
        let strides = self.strides();
        let weights = (0..3).map(|axis| self.weight[axis][at] + self.weight[axis][at - strides[axis]]);
        weights.sum::<f32>() + self.leak[at]
    }

    /// x = one sweep on K x = b from zero, and r = b - K x after it: red nodes see no neighbours, and what black ones
    /// add is all that is left over at the red ones.
    pub(super) fn smooth_from_zero(&mut self) {
        for ((x, b), inverse) in self.x.iter_mut().zip(&self.b).zip(&self.inverse) {
            *x = b.map(|b| inverse * b);
        }
        self.relax(Colour::Black);
        self.residual_of_red();
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
        let nx = self.counts[0];
        for (row, start) in self.rows(colour) {
            let [_, sy, sz] = self.strides();
            let (before, rest) = self.x.split_at_mut(row);
            let (x, after) = rest.split_at_mut(nx);
            let beside = [&before[row - sy..], &after[sy - nx..], &before[row - sz..], &after[sz - nx..]];
            let around = surroundings(&self.weight, row, [sy, sz], beside, nx);
            let (b, inverse) = (&self.b[row..][..nx], &self.inverse[row..][..nx]);
            let mut i = start;
            while i < nx {
                let sum = around.sum(x, i);
                x[i] = std::array::from_fn(|lane| inverse[i] * (b[i][lane] + sum[lane]));
                i += 2;
            }
        }
    }

    fn residual_of_red(&mut self) {
        let nx = self.counts[0];
        for (row, start) in self.rows(Colour::Red) {
            let [_, sy, sz] = self.strides();
            let x = &self.x;
            let beside = [&x[row - sy..], &x[row + sy..], &x[row - sz..], &x[row + sz..]];
            let around = surroundings(&self.weight, row, [sy, sz], beside, nx);
            let (x, r) = (&x[row..][..nx], &mut self.r[row..][..nx]);
            r.fill([0.0; LANES]);
            let mut i = start;
            while i < nx {
                r[i] = around.sum(x, i);
                i += 2;
            }
        }
    }

    /// Where each row starts, and its first node of a colour.
    fn rows(&self, colour: Colour) -> impl Iterator<Item = (usize, usize)> + use<> {
        let [nx, ny, _] = self.counts;
        let first = usize::from(colour == Colour::Black);
        self.nodes().step_by(nx).enumerate().map(move |(row, at)| (at, (row % ny + row / ny + first) % 2))
    }
}

fn surroundings<'a>(
    weight: &'a [Vec<f32>; 3],
    row: usize,
    [sy, sz]: [usize; 2],
    beside: [&'a [Lanes]; 4],
    nx: usize,
) -> Surroundings<'a> {
    let of = |axis: usize, before: usize| &weight[axis][row - before..][..nx];
    let weights = [of(1, sy), of(1, 0), of(2, sz), of(2, 0)];
    Surroundings {
        along: of(0, 0),
        along_before: of(0, 1),
        across: std::array::from_fn(|side| (weights[side], &beside[side][..nx])),
    }
}
