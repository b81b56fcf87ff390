//! Applying K in double precision to one plane, and all sums that are wanted of it.
//!
//! The energies xᵀKx have two parts. Here is that of free rows, where Kx is -r, which is small, so products with it may be
//! rounded: with an error δ left of the energy they amount to about √δ of it, and their rounding to less than 1e-8 √δ.
//! That of what is held at 1 V is in `held`.
//!
//! Sums are taken over the places of a block first, then over the blocks' places in a fixed order, then over planes.

use super::layout::{BLOCK, Coloured, Layout};
use super::links::{ObjectLink, ObjectLinks};
use super::precision::Network;
use super::stencil::Columns;
use crate::solver::operator::State;
use pulp::Simd;
use std::ops::Range;

/// Longest piece of a plane that is worked on at once, so that it stays in the first-level cache for all columns.
pub(super) const PIECE: usize = 32 * BLOCK;

/// One number for each place in a block.
pub(super) type Partial = [f64; BLOCK];

/// Sums over a plane, and the storage they are taken with.
#[derive(Clone, Debug)]
pub(super) struct Sums<T> {
    columns: usize,
    /// K x of one piece, with columns as far apart as in vectors; and x in single precision.
    y: Vec<T>,
    rounded: Vec<f32>,
    /// xᵀr for all pairs s <= t of columns.
    products: Vec<Partial>,
    /// rᵀp after the step, and Σ r².
    along: Vec<Partial>,
    residual: Vec<Partial>,
}

/// What planes are evaluated with.
#[derive(Clone, Copy)]
pub(super) struct Equations<'a, K> {
    pub(super) network: K,
    pub(super) of_nodes: Layout,
    /// That of the vectors.
    pub(super) layout: Layout,
    /// Zero where the potential is fixed.
    pub(super) inverse: &'a Coloured<f32>,
    pub(super) links: &'a ObjectLinks,
}

impl<K> Equations<'_, K> {
    #[inline(always)]
    pub(super) fn inverse(&self, nodes: &Nodes) -> &[f32] {
        &self.inverse[nodes.colour][nodes.places.start..nodes.places.end]
    }
}

/// Some planes of the vectors.
pub(super) struct Fields<'a, T> {
    pub(super) x: [&'a [T]; 2],
    pub(super) p: [&'a [f32]; 2],
}

/// Successive nodes of one colour in a plane: their places, and where they are in the first column of vectors.
pub(super) struct Nodes {
    pub(super) colour: usize,
    pub(super) places: Range<usize>,
    pub(super) first: usize,
}

impl Nodes {
    /// One of the pieces of plane k, none where it has ended. Vectors begin at the place `base`.
    #[inline(always)]
    pub(super) fn piece(
        [of_nodes, layout]: [&Layout; 2],
        k: usize,
        base: usize,
        [colour, piece]: [usize; 2],
    ) -> Option<Self> {
        let (plane, in_vectors) = (of_nodes.plane(k), layout.plane(k).start - base);
        let start = piece * PIECE;
        let n = plane.len().checked_sub(start)?.min(PIECE);
        let at = plane.start + start;
        (n > 0).then(|| Self { colour, places: at..at + n, first: in_vectors + start })
    }

    /// Where they are in vectors.
    #[inline(always)]
    pub(super) fn within(&self, layout: &Layout, column: usize) -> Range<usize> {
        let start = layout.in_column(column, self.first);
        start..start + self.places.len()
    }
}

impl<T: Copy + Default + Into<f64>> Sums<T> {
    pub(super) fn new(layout: &Layout) -> Self {
        let columns = layout.columns;
        let partial = |count| vec![[0.0; BLOCK]; count];
        let pairs = columns * (columns + 1) / 2;
        Self {
            columns,
            y: vec![T::default(); layout.in_column(columns - 1, PIECE)],
            rounded: vec![0.0; columns * PIECE],
            products: partial(pairs),
            along: partial(columns),
            residual: partial(columns),
        }
    }

    /// Starts with a plane.
    #[inline(always)]
    pub(super) fn start(&mut self) {
        let Self { products, along, residual, .. } = self;
        for partial in [products, along, residual] {
            partial.fill([0.0; BLOCK]);
        }
    }

    /// r = -K x on the free nodes of a piece, and its part of the sums.
    #[inline(always)]
    pub(super) fn evaluate<S: Simd, K: Network<Value = T>>(
        &mut self,
        simd: S,
        of: &Equations<'_, K>,
        fields: &Fields<'_, T>,
        r: &mut [f32],
        nodes: &Nodes,
    ) {
        self.take_charges(simd, of, fields.x, nodes);
        self.add_piece(simd, of, fields, r, nodes);
    }

    /// y = K x, all columns, with what links to objects take.
    #[inline(always)]
    pub(super) fn take_charges<S: Simd, K: Network<Value = T>>(
        &mut self,
        simd: S,
        of: &Equations<'_, K>,
        x: [&[T]; 2],
        nodes: &Nodes,
    ) {
        self.apply(simd, of, x, nodes);
        for link in of.links.between(nodes.colour, &nodes.places) {
            self.apply_link(of, link, nodes);
        }
    }

    /// y = K x, all columns, all objects at 0 V.
    #[inline(always)]
    pub(super) fn apply<S: Simd, K: Network<Value = T>>(
        &mut self,
        simd: S,
        of: &Equations<'_, K>,
        x: [&[T]; 2],
        nodes: &Nodes,
    ) {
        let (colour, from) = (nodes.colour, nodes.first);
        let span = of.layout.in_column(self.columns - 1, nodes.places.len());
        let around = of.layout.neighbours(colour, from, span, x[1 - colour]);
        let columns = Columns { count: self.columns, stride: of.layout.in_column(1, 0) };
        let (y, x) = (&mut self.y[..span], &x[colour][from..from + span]);
        of.network.apply(simd, y, x, around, colour, nodes.places.start..nodes.places.end, columns);
    }

    /// The first of them in one column.
    #[inline(always)]
    pub(super) fn of_column(&self, layout: &Layout, column: usize, n: usize) -> &[T] {
        &self.y[layout.in_column(column, 0)..layout.in_column(column, n)]
    }

    /// What a link to an object takes from a charge; what the node itself has of it is on the diagonal.
    fn apply_link<K: Network<Value = T>>(&mut self, of: &Equations<'_, K>, link: &ObjectLink, nodes: &Nodes) {
        let potentials = &of.links.potentials[link.object * self.columns..][..self.columns];
        let node = link.at - nodes.places.start;
        for (column, &at_object) in potentials.iter().enumerate() {
            let charge = &mut self.y[of.layout.in_column(column, node)];
            *charge = K::linked(*charge, link.weight, at_object);
        }
    }

    #[inline(always)]
    fn add_piece<S: Simd, K: Network<Value = T>>(
        &mut self,
        simd: S,
        of: &Equations<'_, K>,
        fields: &Fields<'_, T>,
        r: &mut [f32],
        nodes: &Nodes,
    ) {
        let inverse = of.inverse(nodes);
        let (x, p) = (fields.x[nodes.colour], fields.p[nodes.colour]);
        let n = nodes.places.len();
        let mut pair = 0;
        for t in 0..self.columns {
            let at = nodes.within(&of.layout, t);
            let (r, p) = (&mut r[at.start..at.end], &p[at.start..at.end]);
            let rounded = &mut self.rounded[t * PIECE..t * PIECE + n];
            K::round(rounded, &x[at]);
            K::round(r, self.of_column(&of.layout, t, n));
            turn_into_residuals(simd, r, inverse);
            for s in 0..=t {
                add(&mut self.products[pair], products(simd, &self.rounded[s * PIECE..s * PIECE + n], r));
                pair += 1;
            }
            add(&mut self.along[t], products(simd, p, r));
            // In double precision, as squares are too small otherwise.
            self.residual[t] = add_mixed_products(self.residual[t], r, r);
        }
    }

    /// Adds up the sums of the plane.
    pub(super) fn hand_over(&self, state: &mut State) {
        let mut pair = 0;
        for t in 0..self.columns {
            for s in 0..=t {
                // Charges are minus residuals.
                state.energies[s * self.columns + t] -= total(&self.products[pair]);
                pair += 1;
            }
            state.along[t] += total(&self.along[t]);
            state.residual[t] += total(&self.residual[t]);
        }
    }
}

/// Turns charges into residuals: the other sign, and zero where the potential is fixed.
#[inline(always)]
pub(super) fn turn_into_residuals<S: Simd>(simd: S, r: &mut [f32], inverse: &[f32]) {
    let zero = simd.splat_f32s(0.0);
    for (r, inverse) in S::as_mut_simd_f32s(r).0.iter_mut().zip(S::as_simd_f32s(inverse).0) {
        let is_fixed = simd.equal_f32s(*inverse, zero);
        *r = simd.select_f32s(is_fixed, zero, simd.neg_f32s(*r));
    }
}

/// Makes charges zero where the potential is fixed.
#[inline(always)]
pub(super) fn hold<S: Simd>(simd: S, q: &mut [f32], inverse: &[f32]) {
    let zero = simd.splat_f32s(0.0);
    for (q, inverse) in S::as_mut_simd_f32s(q).0.iter_mut().zip(S::as_simd_f32s(inverse).0) {
        let is_fixed = simd.equal_f32s(*inverse, zero);
        *q = simd.select_f32s(is_fixed, zero, *q);
    }
}

/// a b, added up by place in a block. In single precision, so for pieces only. Every other block is added up apart, for
/// a sum need not wait for the one before.
#[inline(always)]
pub(super) fn products<S: Simd>(simd: S, a: &[f32], b: &[f32]) -> [f32; BLOCK] {
    let mut sum = [0.0; BLOCK];
    let sums = S::as_mut_simd_f32s(&mut sum).0;
    let block = sums.len();
    let (a, b) = (S::as_simd_f32s(a).0.chunks_exact(2 * block), S::as_simd_f32s(b).0.chunks_exact(2 * block));
    let mut local = [simd.splat_f32s(0.0); 2 * BLOCK];
    for (sum, (a, b)) in local.iter_mut().zip(a.remainder().iter().zip(b.remainder())) {
        *sum = simd.mul_f32s(*a, *b);
    }
    for (a, b) in a.zip(b) {
        for part in 0..2 * block {
            local[part] = simd.add_f32s(local[part], simd.mul_f32s(a[part], b[part]));
        }
    }
    for part in 0..block {
        sums[part] = simd.add_f32s(local[part], local[block + part]);
    }
    sum
}

#[inline(always)]
pub(super) fn add(sum: &mut Partial, part: [f32; BLOCK]) {
    sum.iter_mut().zip(part).for_each(|(sum, part)| *sum += f64::from(part));
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

#[inline(always)]
pub(super) fn total<T: Copy + Into<f64>>(partial: &[T; BLOCK]) -> f64 {
    let [a, b, c, d, e, f, g, h] = *partial;
    let (first, second) =
        ((a.into() + e.into()) + (c.into() + g.into()), (b.into() + f.into()) + (d.into() + h.into()));
    first + second
}
