//! The 7-point network of a lattice in the layout of the solver, and the arithmetic on it.
//!
//! No multiplication is fused with an addition and all sums have a fixed order, so that results have the same bits on
//! every processor.

use super::layout::{Coloured, Layout};
use super::rows::single;
use pulp::Simd;
use std::ops::Range;

/// Weights to the next node along each axis, and one more number for each node: the diagonal, or its inverse with zero
/// where the potential is fixed.
#[derive(Clone, Debug)]
pub(super) struct Stencil<T> {
    pub(super) layout: Layout,
    pub(super) next: [Coloured<T>; 3],
    pub(super) centre: Coloured<T>,
}

/// The stencils of successive nodes of one colour.
pub(super) struct Piece<'a, T> {
    /// Weights to the six neighbours, along x, y and z, the previous and the next.
    weights: [&'a [T]; 6],
    centre: &'a [T],
}

/// Columns in which the same nodes are computed: how many there are, and how far apart, a whole number of blocks.
#[derive(Clone, Copy)]
pub(super) struct Columns {
    pub(super) count: usize,
    pub(super) stride: usize,
}

impl<T: Clone + Default> Stencil<T> {
    pub(super) fn new(layout: Layout) -> Self {
        let zeros = || layout.zeros();
        Self { layout, next: [zeros(), zeros(), zeros()], centre: zeros() }
    }

    /// The stencils of the nodes at some places of one colour.
    #[inline(always)]
    pub(super) fn piece(&self, colour: usize, places: Range<usize>) -> Piece<'_, T> {
        let [a, _, c, _, e, _] = self.layout.around(colour, places.start);
        let (n, own) = (places.len(), places.start);
        let [x, y, z] = &self.next;
        let other = 1 - colour;
        let weights = [
            &x[other][a..a + n],
            &x[colour][own..own + n],
            &y[other][c..c + n],
            &y[colour][own..own + n],
            &z[other][e..e + n],
            &z[colour][own..own + n],
        ];
        Piece { weights, centre: &self.centre[colour][own..own + n] }
    }
}

impl Piece<'_, f32> {
    /// x = D⁻¹ b.
    #[inline(always)]
    pub(super) fn scale<S: Simd>(&self, simd: S, x: &mut [f32], b: &[f32]) {
        let (x, b, inverse) = (S::as_mut_simd_f32s(x).0, single::<S>(b), single::<S>(self.centre));
        for ((x, b), inverse) in x.iter_mut().zip(b).zip(inverse) {
            *x = simd.mul_f32s(*inverse, *b);
        }
    }

    /// Solves the equations of the nodes: x = D⁻¹ (b + Σ w x).
    #[inline(always)]
    pub(super) fn relax<S: Simd>(&self, simd: S, x: &mut [f32], b: &[f32], around: [&[f32]; 6]) {
        let x = S::as_mut_simd_f32s(x).0;
        let n = x.len();
        let (b, inverse) = (&single::<S>(b)[..n], &single::<S>(self.centre)[..n]);
        let (w, v) = (six_single::<S>(self.weights, n), six_single::<S>(around, n));
        for i in 0..n {
            let sum = sum_of_six_single(simd, &w, &v, i);
            x[i] = simd.mul_f32s(inverse[i], simd.add_f32s(b[i], sum));
        }
    }

    /// The same, and the charges D x.
    #[inline(always)]
    pub(super) fn relax_with_charges<S: Simd>(
        &self,
        simd: S,
        x: &mut [f32],
        charges: &mut [f32],
        b: &[f32],
        around: [&[f32]; 6],
    ) {
        let x = S::as_mut_simd_f32s(x).0;
        let n = x.len();
        let charges = &mut S::as_mut_simd_f32s(charges).0[..n];
        let (b, inverse) = (&single::<S>(b)[..n], &single::<S>(self.centre)[..n]);
        let (w, v) = (six_single::<S>(self.weights, n), six_single::<S>(around, n));
        for i in 0..n {
            charges[i] = simd.add_f32s(b[i], sum_of_six_single(simd, &w, &v, i));
            x[i] = simd.mul_f32s(inverse[i], charges[i]);
        }
    }

    /// r = f Σ w x.
    #[inline(always)]
    pub(super) fn gather<S: Simd>(&self, simd: S, factor: f32, r: &mut [f32], around: [&[f32]; 6]) {
        let factor = simd.splat_f32s(factor);
        let r = S::as_mut_simd_f32s(r).0;
        let n = r.len();
        let (w, v) = (six_single::<S>(self.weights, n), six_single::<S>(around, n));
        for (i, r) in r.iter_mut().enumerate() {
            *r = simd.mul_f32s(factor, sum_of_six_single(simd, &w, &v, i));
        }
    }
}

impl Piece<'_, f32> {
    /// y = λ x + Σ w (x - x') in every column, x' around x. The stencil is read once for all of them. Of differences, for
    /// the diagonal in single precision would not be the sum of the weights.
    #[inline(always)]
    pub(super) fn apply_leaking<S: Simd>(
        &self,
        simd: S,
        y: &mut [f32],
        [x, leak]: [&[f32]; 2],
        around: [&[f32]; 6],
        columns: Columns,
    ) {
        let y = S::as_mut_simd_f32s(y).0;
        let span = y.len();
        let (x, v) = (&single::<S>(x)[..span], six_single::<S>(around, span));
        let leak = single::<S>(leak);
        let w = six_single::<S>(self.weights, leak.len());
        let stride = columns.stride / S::F32_LANES;
        for i in 0..leak.len() {
            let (w, leak) = ([w[0][i], w[1][i], w[2][i], w[3][i], w[4][i], w[5][i]], leak[i]);
            let mut at = i;
            for _ in 0..columns.count {
                let own = x[at];
                let west = simd.mul_f32s(w[0], simd.sub_f32s(own, v[0][at]));
                let along_x = simd.add_f32s(west, simd.mul_f32s(w[1], simd.sub_f32s(own, v[1][at])));
                let south = simd.mul_f32s(w[2], simd.sub_f32s(own, v[2][at]));
                let along_y = simd.add_f32s(south, simd.mul_f32s(w[3], simd.sub_f32s(own, v[3][at])));
                let down = simd.mul_f32s(w[4], simd.sub_f32s(own, v[4][at]));
                let along_z = simd.add_f32s(down, simd.mul_f32s(w[5], simd.sub_f32s(own, v[5][at])));
                let across = simd.add_f32s(along_y, along_z);
                y[at] = simd.add_f32s(simd.mul_f32s(leak, own), simd.add_f32s(along_x, across));
                at += stride;
            }
        }
    }
}

impl Piece<'_, f64> {
    /// y = D x - Σ w x in every column. The stencil is read once for all of them.
    #[inline(always)]
    pub(super) fn apply<S: Simd>(
        &self,
        simd: S,
        y: &mut [f64],
        x: &[f64],
        around: [&[f64]; 6],
        columns: Columns,
    ) {
        let y = S::as_mut_simd_f64s(y).0;
        let span = y.len();
        let (x, v) = (&double::<S>(x)[..span], six_double::<S>(around, span));
        let diagonal = double::<S>(self.centre);
        let w = six_double::<S>(self.weights, diagonal.len());
        let stride = columns.stride / S::F64_LANES;
        for i in 0..diagonal.len() {
            let (w, diagonal) = ([w[0][i], w[1][i], w[2][i], w[3][i], w[4][i], w[5][i]], diagonal[i]);
            let mut at = i;
            for _ in 0..columns.count {
                let v = [v[0][at], v[1][at], v[2][at], v[3][at], v[4][at], v[5][at]];
                let sum = sum_of_six_double(simd, w, v);
                y[at] = simd.sub_f64s(simd.mul_f64s(diagonal, x[at]), sum);
                at += stride;
            }
        }
    }
}

// The two precisions are written out, as there is no name for both in the vector library; and so are the six neighbours,
// because a closure or a mapped array may become a call, which is compiled without the processor's extensions.

#[inline(always)]
fn double<S: Simd>(slice: &[f64]) -> &[S::f64s] {
    S::as_simd_f64s(slice).0
}

/// Six slices as vectors, cut to one length so that it is checked once.
#[inline(always)]
fn six_single<S: Simd>([a, b, c, d, e, f]: [&[f32]; 6], n: usize) -> [&[S::f32s]; 6] {
    let [a, b, c] = [single::<S>(a), single::<S>(b), single::<S>(c)];
    let [d, e, f] = [single::<S>(d), single::<S>(e), single::<S>(f)];
    [&a[..n], &b[..n], &c[..n], &d[..n], &e[..n], &f[..n]]
}

#[inline(always)]
fn six_double<S: Simd>([a, b, c, d, e, f]: [&[f64]; 6], n: usize) -> [&[S::f64s]; 6] {
    let [a, b, c] = [double::<S>(a), double::<S>(b), double::<S>(c)];
    let [d, e, f] = [double::<S>(d), double::<S>(e), double::<S>(f)];
    [&a[..n], &b[..n], &c[..n], &d[..n], &e[..n], &f[..n]]
}

/// Σ w v over the six neighbours of a vector of nodes.
#[inline(always)]
fn sum_of_six_single<S: Simd>(simd: S, w: &[&[S::f32s]; 6], v: &[&[S::f32s]; 6], i: usize) -> S::f32s {
    let west = simd.mul_f32s(w[0][i], v[0][i]);
    let along_x = simd.add_f32s(west, simd.mul_f32s(w[1][i], v[1][i]));
    let south = simd.mul_f32s(w[2][i], v[2][i]);
    let along_y = simd.add_f32s(south, simd.mul_f32s(w[3][i], v[3][i]));
    let down = simd.mul_f32s(w[4][i], v[4][i]);
    let along_z = simd.add_f32s(down, simd.mul_f32s(w[5][i], v[5][i]));
    simd.add_f32s(simd.add_f32s(along_x, along_y), along_z)
}

#[inline(always)]
fn sum_of_six_double<S: Simd>(simd: S, w: [S::f64s; 6], v: [S::f64s; 6]) -> S::f64s {
    let along_x = simd.add_f64s(simd.mul_f64s(w[0], v[0]), simd.mul_f64s(w[1], v[1]));
    let along_y = simd.add_f64s(simd.mul_f64s(w[2], v[2]), simd.mul_f64s(w[3], v[3]));
    let along_z = simd.add_f64s(simd.mul_f64s(w[4], v[4]), simd.mul_f64s(w[5], v[5]));
    simd.add_f64s(simd.add_f64s(along_x, along_y), along_z)
}

/// The row of one node: weights to the six neighbours, as in a piece, and its diagonal in double precision, its leak in
/// single.
#[derive(Clone, Copy)]
pub(super) struct Row<T> {
    pub(super) weights: [T; 6],
    pub(super) centre: T,
}

impl Row<f64> {
    /// What [`Piece::apply`] gives.
    #[inline(always)]
    pub(super) fn charge(&self, x: f64, around: [f64; 6]) -> f64 {
        let Self { weights: [west, east, south, north, down, up], centre } = *self;
        let along_x = west * around[0] + east * around[1];
        let along_y = south * around[2] + north * around[3];
        let along_z = down * around[4] + up * around[5];
        centre * x - (along_x + along_y + along_z)
    }
}

impl Row<f32> {
    /// What [`Piece::apply_leaking`] gives.
    #[inline(always)]
    pub(super) fn charge(&self, x: f32, around: [f32; 6]) -> f32 {
        let Self { weights: [west, east, south, north, down, up], centre } = *self;
        let along_x = west * (x - around[0]) + east * (x - around[1]);
        let along_y = south * (x - around[2]) + north * (x - around[3]);
        let along_z = down * (x - around[4]) + up * (x - around[5]);
        centre * x + (along_x + (along_y + along_z))
    }
}

impl<T: Copy> Stencil<T> {
    /// The weights to the neighbours of one node, along x, y and z.
    pub(super) fn weights(&self, colour: usize, at: usize) -> [T; 6] {
        let [west, _, south, _, down, _] = self.layout.around(colour, at);
        let [x, y, z] = &self.next;
        let other = 1 - colour;
        [x[other][west], x[colour][at], y[other][south], y[colour][at], z[other][down], z[colour][at]]
    }
}
