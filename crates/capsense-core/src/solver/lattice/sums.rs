//! Applying K in double precision to one plane, and all sums that are wanted of it.
//!
//! Sums are taken over the places of a block first, then over the blocks' places in a fixed order, then over planes.

use super::layout::{BLACK, BLOCK, Coloured, Layout, RED};
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

/// What planes are evaluated with.
#[derive(Clone, Copy)]
pub(super) struct Equations<'a> {
    pub(super) stencil: &'a Stencil<f64>,
    /// That of the vectors.
    pub(super) layout: Layout,
    /// Zero where the potential is fixed.
    pub(super) inverse: &'a Coloured<f32>,
    pub(super) links: &'a ObjectLinks,
}

/// Some planes of the vectors, from some place on.
pub(super) struct Fields<'a> {
    pub(super) start: usize,
    pub(super) x: [&'a [f64]; 2],
    pub(super) p: [&'a [f32]; 2],
}

/// Successive nodes of one colour in a plane: their places, and where they are in the first column of vectors.
struct Nodes {
    colour: usize,
    places: Range<usize>,
    first: usize,
}

impl Nodes {
    /// Where they are in vectors.
    #[inline(always)]
    fn within(&self, layout: &Layout, column: usize) -> Range<usize> {
        let start = layout.in_column(column, self.first);
        start..start + self.places.len()
    }
}

impl Sums {
    pub(super) fn new(layout: &Layout) -> Self {
        let columns = layout.columns;
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

    /// r = -K x on the free nodes of plane k, and its part of the sums.
    #[inline(always)]
    pub(super) fn evaluate<S: Simd>(
        &mut self,
        simd: S,
        of: &Equations<'_>,
        fields: &Fields<'_>,
        r: &mut [&mut [f32]; 2],
        k: usize,
        state: &mut State,
    ) {
        state.clear();
        for partial in [&mut self.energies, &mut self.along, &mut self.residual, &mut self.charge] {
            partial.fill([0.0; BLOCK]);
        }
        let (plane, first) = (of.stencil.layout.plane(k), of.layout.plane(k).start - fields.start);
        for colour in [RED, BLACK] {
            for start in (0..plane.len()).step_by(PIECE) {
                let places = plane.start + start..(plane.start + start + PIECE).min(plane.end);
                let nodes = Nodes { colour, places, first: first + start };
                self.apply(simd, of, fields, &nodes);
                for link in of.links.between(colour, &nodes.places) {
                    self.apply_link(of, fields, link, &nodes, state);
                }
                self.add_piece(simd, of, fields, &mut *r[colour], &nodes);
            }
        }
        self.hand_over(state);
    }

    /// y = K x, all columns.
    #[inline(always)]
    fn apply<S: Simd>(&mut self, simd: S, of: &Equations<'_>, fields: &Fields<'_>, nodes: &Nodes) {
        let n = nodes.places.len();
        let stencil = of.stencil.piece(nodes.colour, nodes.places.start..nodes.places.end);
        for (column, y) in self.y.chunks_exact_mut(PIECE).enumerate() {
            let at = nodes.within(&of.layout, column);
            let around = of.layout.neighbours(nodes.colour, at.start, n, fields.x[1 - nodes.colour]);
            stencil.apply(simd, &mut y[..n], &fields.x[nodes.colour][at], around);
        }
    }

    /// The charges at both ends of a link; what the node has of it is on the diagonal.
    fn apply_link(
        &mut self,
        of: &Equations<'_>,
        fields: &Fields<'_>,
        link: &ObjectLink,
        nodes: &Nodes,
        state: &mut State,
    ) {
        let columns = self.columns;
        let potentials = &of.links.potentials[link.object * columns..][..columns];
        let node = link.at - nodes.places.start;
        for (t, &at_object) in potentials.iter().enumerate() {
            self.y[t * PIECE + node] -= link.weight * at_object;
            let at_node = fields.x[link.colour][nodes.within(&of.layout, t).start + node];
            let on_object = link.weight * (at_object - at_node);
            for (s, &potential) in potentials.iter().enumerate() {
                state.energies[s * columns + t] += potential * on_object;
            }
        }
    }

    #[inline(always)]
    fn add_piece<S: Simd>(
        &mut self,
        simd: S,
        of: &Equations<'_>,
        fields: &Fields<'_>,
        r: &mut [f32],
        nodes: &Nodes,
    ) {
        let inverse = &of.inverse[nodes.colour][nodes.places.start..nodes.places.end];
        let (x, p) = (fields.x[nodes.colour], fields.p[nodes.colour]);
        let n = nodes.places.len();
        let mut pair = 0;
        for t in 0..self.columns {
            let y = &mut self.y[t * PIECE..t * PIECE + n];
            for s in 0..=t {
                let x = &x[nodes.within(&of.layout, s)];
                self.energies[pair] = add_products(simd, self.energies[pair], x, y);
                pair += 1;
            }
            let (at, held) = (nodes.within(&of.layout, t), &mut self.held[..n]);
            split(y, held, inverse, &x[at.start..at.end]);
            r[at.start..at.end].iter_mut().zip(&*y).for_each(|(r, y)| *r = -*y as f32);
            self.along[t] = add_mixed_products(self.along[t], &p[at], y);
            self.residual[t] = add_products(simd, self.residual[t], y, y);
            self.charge[t] = add_products(simd, self.charge[t], held, held);
        }
    }

    /// Adds up the sums of the plane.
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
