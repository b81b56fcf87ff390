//! Potentials in single or in double precision, with the K that they are multiplied with.

use super::layout::Coloured;
use super::stencil::{Columns, Row, Stencil};
use pulp::Simd;
use std::ops::Range;

/// K in one precision.
///
/// Energies are quadratic in errors of the potentials, so rounding these to single precision leaves an error of C far below
/// a tolerance of 1e-6; and residuals that are computed from differences of potentials are exact to the rounding of these.
pub(super) trait Network: Copy + Send + Sync {
    /// What potentials and charges are stored in.
    type Value: Copy + Default + Into<f64> + Send + Sync;

    /// y = K x for successive nodes of one colour, in every column.
    #[expect(clippy::too_many_arguments, reason = "an inner loop has no time to unpack a structure")]
    fn apply<S: Simd>(
        self,
        simd: S,
        y: &mut [Self::Value],
        x: &[Self::Value],
        around: [&[Self::Value]; 6],
        colour: usize,
        places: Range<usize>,
        columns: Columns,
    );

    /// The row of one node.
    fn row(self, colour: usize, at: usize) -> Row<Self::Value>;

    /// The same for it in one column.
    fn charge(row: &Row<Self::Value>, x: Self::Value, around: [Self::Value; 6]) -> Self::Value;

    /// A charge with what a link to a potential takes from it.
    fn linked(charge: Self::Value, weight: f64, potential: f64) -> Self::Value;

    /// x += scale p.
    fn advance(x: &mut [Self::Value], scale: f64, p: &[f32]);

    /// to = from.
    fn round(to: &mut [f32], from: &[Self::Value]);
}

/// In single precision.
#[derive(Clone, Copy)]
pub(super) struct Leaking<'a> {
    pub(super) stencil: &'a Stencil<f32>,
    /// Weight of the links of each node.
    pub(super) leak: &'a Coloured<f32>,
}

impl Network for &Stencil<f64> {
    type Value = f64;

    #[inline(always)]
    fn apply<S: Simd>(
        self,
        simd: S,
        y: &mut [f64],
        x: &[f64],
        around: [&[f64]; 6],
        colour: usize,
        places: Range<usize>,
        columns: Columns,
    ) {
        self.piece(colour, places).apply(simd, y, x, around, columns);
    }

    fn row(self, colour: usize, at: usize) -> Row<f64> {
        Row { weights: self.weights(colour, at), centre: self.centre[colour][at] }
    }

    fn charge(row: &Row<f64>, x: f64, around: [f64; 6]) -> f64 {
        row.charge(x, around)
    }

    fn linked(charge: f64, weight: f64, potential: f64) -> f64 {
        charge - weight * potential
    }

    #[inline(always)]
    fn advance(x: &mut [f64], scale: f64, p: &[f32]) {
        x.iter_mut().zip(p).for_each(|(x, p)| *x += scale * f64::from(*p));
    }

    #[inline(always)]
    fn round(to: &mut [f32], from: &[f64]) {
        to.iter_mut().zip(from).for_each(|(to, from)| *to = *from as f32);
    }
}

impl Network for Leaking<'_> {
    type Value = f32;

    #[inline(always)]
    fn apply<S: Simd>(
        self,
        simd: S,
        y: &mut [f32],
        x: &[f32],
        around: [&[f32]; 6],
        colour: usize,
        places: Range<usize>,
        columns: Columns,
    ) {
        let leak = &self.leak[colour][places.start..places.end];
        self.stencil.piece(colour, places).apply_leaking(simd, y, [x, leak], around, columns);
    }

    fn row(self, colour: usize, at: usize) -> Row<f32> {
        Row { weights: self.stencil.weights(colour, at), centre: self.leak[colour][at] }
    }

    fn charge(row: &Row<f32>, x: f32, around: [f32; 6]) -> f32 {
        row.charge(x, around)
    }

    fn linked(charge: f32, weight: f64, potential: f64) -> f32 {
        charge - (weight * potential) as f32
    }

    #[inline(always)]
    fn advance(x: &mut [f32], scale: f64, p: &[f32]) {
        let scale = scale as f32;
        x.iter_mut().zip(p).for_each(|(x, p)| *x += scale * *p);
    }

    #[inline(always)]
    fn round(to: &mut [f32], from: &[f32]) {
        to.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
    }
}
