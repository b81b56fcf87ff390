//! Applying K in double precision to one plane, and all sums that are wanted of it.
//!
//! Sums are taken over the places of a block first, then over the blocks' places in a fixed order, then over planes.

use super::layout::{BLACK, BLOCK, Coloured, RED};
use super::stencil::Stencil;
use super::{ObjectLink, ObjectLinks};
use crate::solver::operator::State;
use pulp::Simd;
use std::ops::Range;

/// Longest piece of a plane that is worked on at once, so that it stays in the first-level cache for all columns.
const PIECE: usize = 32 * BLOCK;

/// One number for each place in a block.
type Partial = [f64; BLOCK];

/// Sums over a plane, and the storage they are taken with.
#[derive(Clone, Debug)]
pub(super) struct Sums {
    columns: usize,
    /// K x of one piece, all columns.
    y: Vec<f64>,
    held: Vec<f64>,
    /// xᵀKx for all pairs s <= t of columns.
    energies: Vec<Partial>,
    /// rᵀp, Σ r², and Σ (Kx)² over rows at 1 V.
    along: Vec<Partial>,
    residual: Vec<Partial>,
    charge: Vec<Partial>,
}

/// What a plane is evaluated with.
pub(super) struct Evaluated<'a> {
    pub(super) stencil: &'a Stencil<f64>,
    /// Zero where the potential is fixed.
    pub(super) inverse: &'a Coloured<f32>,
    pub(super) links: &'a ObjectLinks,
    pub(super) x: &'a Coloured<f64>,
    pub(super) p: &'a Coloured<f32>,
}

impl Sums {
    pub(super) fn new(columns: usize) -> Self {
        let partial = |count| vec![[0.0; BLOCK]; count];
        Self {
            columns,
            y: vec![0.0; columns * PIECE],
            held: vec![0.0; PIECE],
            energies: partial(columns * (columns + 1) / 2),
            along: partial(columns),
            residual: partial(columns),
            charge: partial(columns),
        }
    }

    /// r = -K x on the free nodes of plane k; adds its part to the sums of `state`.
    #[inline(always)]
    pub(super) fn evaluate<S: Simd>(
        &mut self,
        simd: S,
        of: &Evaluated<'_>,
        r: &mut Coloured<f32>,
        k: usize,
        state: &mut State,
    ) {
        for partial in [&mut self.energies, &mut self.along, &mut self.residual, &mut self.charge] {
            partial.fill([0.0; BLOCK]);
        }
        let plane = of.stencil.layout.plane(k);
        for colour in [RED, BLACK] {
            for start in (plane.start..plane.end).step_by(PIECE) {
                let places = start..(start + PIECE).min(plane.end);
                self.apply(simd, of, colour, &places);
                for link in of.links.between(colour, &places) {
                    self.apply_link(of, link, places.start, state);
                }
                self.add_piece(simd, of, &mut r[colour], colour, &places);
            }
        }
        self.hand_over(state);
    }

    /// y = K x, all columns.
    #[inline(always)]
    fn apply<S: Simd>(&mut self, simd: S, of: &Evaluated<'_>, colour: usize, places: &Range<usize>) {
        let len = of.stencil.layout.len();
        let stencil = of.stencil.piece(colour, places.start..places.end);
        for (column, y) in self.y.chunks_exact_mut(PIECE).enumerate() {
            let x = &of.x[colour][column * len + places.start..column * len + places.end];
            stencil.apply(
                simd,
                &mut y[..places.len()],
                x,
                &of.x[1 - colour][column * len..(column + 1) * len],
            );
        }
    }

    /// The charges at both ends of a link; what the node has of it is on the diagonal.
    fn apply_link(&mut self, of: &Evaluated<'_>, link: &ObjectLink, start: usize, state: &mut State) {
        let (columns, len) = (self.columns, of.stencil.layout.len());
        let potentials = &of.links.potentials[link.object * columns..][..columns];
        for (t, &at_object) in potentials.iter().enumerate() {
            self.y[t * PIECE + link.at - start] -= link.weight * at_object;
            let on_object = link.weight * (at_object - of.x[link.colour][t * len + link.at]);
            for (s, &potential) in potentials.iter().enumerate() {
                state.energies[s * columns + t] += potential * on_object;
            }
        }
    }

    #[inline(always)]
    fn add_piece<S: Simd>(
        &mut self,
        simd: S,
        of: &Evaluated<'_>,
        r: &mut [f32],
        colour: usize,
        places: &Range<usize>,
    ) {
        let len = of.stencil.layout.len();
        let part = |column: usize| column * len + places.start..column * len + places.end;
        let inverse = &of.inverse[colour][places.start..places.end];
        let n = places.len();
        let mut pair = 0;
        for t in 0..self.columns {
            let y = &mut self.y[t * PIECE..t * PIECE + n];
            for s in 0..=t {
                self.energies[pair] = add_products(simd, self.energies[pair], &of.x[colour][part(s)], y);
                pair += 1;
            }
            let held = &mut self.held[..n];
            split(y, held, inverse, &of.x[colour][part(t)]);
            r[part(t)].iter_mut().zip(&*y).for_each(|(r, y)| *r = -*y as f32);
            self.along[t] = add_mixed_products(self.along[t], &of.p[colour][part(t)], y);
            self.residual[t] = add_products(simd, self.residual[t], y, y);
            self.charge[t] = add_products(simd, self.charge[t], held, held);
        }
    }

    /// Adds the plane's sums to those of all planes.
    fn hand_over(&self, state: &mut State) {
        let mut pair = 0;
        for t in 0..self.columns {
            for s in 0..=t {
                state.energies[s * self.columns + t] += total(&self.energies[pair]);
                pair += 1;
            }
            // Charges are minus residuals.
            state.along[t] -= total(&self.along[t]);
            state.residual[t] += total(&self.residual[t]);
            state.charge[t] += total(&self.charge[t]);
        }
    }
}

/// Splits charges in those of free nodes, which stay, and those of nodes that a terminal holds at 1 V.
#[inline(always)]
fn split(charge: &mut [f64], held: &mut [f64], inverse: &[f32], x: &[f64]) {
    for (((charge, held), inverse), x) in charge.iter_mut().zip(held).zip(inverse).zip(x) {
        let free = f64::from(u8::from(*inverse != 0.0));
        *held = *charge * *x * (1.0 - free);
        *charge *= free;
    }
}

/// The sum with a b added.
#[inline(always)]
fn add_products<S: Simd>(simd: S, mut sum: Partial, a: &[f64], b: &[f64]) -> Partial {
    let sums = S::as_mut_simd_f64s(&mut sum).0;
    let (a, b) = (S::as_simd_f64s(a).0, S::as_simd_f64s(b).0);
    let mut local = [simd.splat_f64s(0.0); BLOCK];
    local[..sums.len()].copy_from_slice(sums);
    for (a, b) in a.chunks_exact(sums.len()).zip(b.chunks_exact(sums.len())) {
        for (part, sum) in local[..sums.len()].iter_mut().enumerate() {
            *sum = simd.add_f64s(*sum, simd.mul_f64s(a[part], b[part]));
        }
    }
    sums.copy_from_slice(&local[..sums.len()]);
    sum
}

/// The sum with a b added, in whatever precision these are.
#[inline(always)]
pub(super) fn add_mixed_products<B: Copy + Into<f64>>(mut sum: Partial, a: &[f32], b: &[B]) -> Partial {
    let (a, b) = (a.as_chunks::<BLOCK>().0, b.as_chunks::<BLOCK>().0);
    for (a, b) in a.iter().zip(b) {
        for node in 0..BLOCK {
            sum[node] += f64::from(a[node]) * b[node].into();
        }
    }
    sum
}

pub(super) fn total(partial: &Partial) -> f64 {
    let [a, b, c, d, e, f, g, h] = *partial;
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}
