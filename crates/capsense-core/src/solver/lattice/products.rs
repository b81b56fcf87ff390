//! Products of the correction with charges, in single precision: lengths of steps need not be exact.

use super::LatticeSolver;
use super::layout::{BLOCK, Coloured};
use super::level::Level;
use super::parts::{Part, cut_planes};
use super::stencil::Columns;
use super::sums::{Nodes, PIECE, products, total};
use pulp::{Simd, WithSimd};

impl LatticeSolver {
    /// zᵀKz and, but for its factor, zᵀKp of the active columns.
    pub(super) fn find_curvatures(&mut self) {
        let finest = &self.hierarchy.levels[0];
        let (planes, active, p) = (self.layout.planes(), &*self.active, &self.p);
        let leak = self.potentials.leak();
        let slabs = &self.parts.slabs;
        let products = cut_planes(slabs, &mut self.curvatures_of_planes);
        let tasks = slabs
            .iter()
            .zip(products)
            .zip(&mut self.charges)
            .map(|((part, products), charges)| Products { part, finest, leak, p, active, products, charges });
        self.workers.for_each(tasks, |task| self.arch.dispatch(task));
        for products in &mut self.curvatures {
            products.fill(0.0);
        }
        for plane in &self.curvatures_of_planes[planes] {
            for (sums, products) in self.curvatures.iter_mut().zip(plane) {
                active.iter().for_each(|&column| sums[column] += products[column]);
            }
        }
    }
}

/// How one thread multiplies its planes of z, which is in the finest level.
struct Products<'a> {
    part: &'a Part,
    finest: &'a Level,
    leak: &'a Coloured<f32>,
    p: &'a Coloured<f32>,
    active: &'a [usize],
    products: &'a mut [[Vec<f64>; 2]],
    /// K z of a piece.
    charges: &'a mut [f32],
}

impl WithSimd for Products<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        for step in self.part.steps(1) {
            let Some(k) = self.part.plane(0, step) else { continue };
            let products = &mut self.products[k - self.part.planes.start];
            products.iter_mut().for_each(|products| products.fill(0.0));
            let pieces = self.finest.stencil.layout.plane.div_ceil(PIECE);
            for piece in 0..2 * pieces {
                self.multiply(simd, k, [piece % 2, piece / 2]);
            }
        }
    }
}

impl Products<'_> {
    /// Those of one piece. K z is taken of differences: in a body of high permittivity, where z is nearly constant, what
    /// is left of D z less its neighbours is rounding, and zᵀKz would not even be sure to be positive.
    #[inline(always)]
    fn multiply<S: Simd>(&mut self, simd: S, k: usize, piece: [usize; 2]) {
        let Level { stencil, layout, x: z, .. } = self.finest;
        let Some(nodes) = Nodes::piece([&stencil.layout, layout], k, 0, piece) else { return };
        let (colour, n) = (nodes.colour, nodes.places.len());
        let leak = &self.leak[colour][nodes.places.start..nodes.places.end];
        let stencil = stencil.piece(colour, nodes.places.start..nodes.places.end);
        let one_column = Columns { count: 1, stride: BLOCK };
        let [first, second] = &mut self.products[k - self.part.planes.start];
        for &column in self.active {
            let at = nodes.within(layout, column);
            let own = &z[colour][at.start..at.end];
            let charges = &mut self.charges[..n];
            let around = layout.neighbours(colour, at.start, n, &z[1 - colour]);
            stencil.apply_leaking(simd, charges, [own, leak], around, one_column);
            first[column] += total(&products(simd, charges, own));
            second[column] += total(&products(simd, charges, &self.p[colour][at]));
        }
    }
}
