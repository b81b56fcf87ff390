//! Products of the correction with residuals and charges, in single precision: lengths of steps need not be exact.

use super::LatticeSolver;
use super::layout::Coloured;
use super::level::Level;
use super::parts::{Part, cut_planes};
use super::sums::{Nodes, PIECE, products, total};
use pulp::{Simd, WithSimd};

/// What the correction z is multiplied with.
#[derive(Clone, Copy)]
pub(super) enum Factor {
    /// r.
    Residual,
    /// Kz and, but for its factor, Kp.
    Charges,
}

impl LatticeSolver {
    /// Products of z with something, for the active columns.
    pub(super) fn multiply_correction(&mut self, with: Factor) {
        let finest = &self.hierarchy.levels[0];
        let (planes, active, p) = (self.layout.planes(), &*self.active, &self.p);
        let slabs = &self.parts.slabs;
        let products = cut_planes(slabs, &mut self.products_of_planes);
        let tasks = slabs
            .iter()
            .zip(products)
            .zip(&mut self.charges)
            .map(|((part, products), charges)| Products { part, with, finest, p, active, products, charges });
        self.workers.for_each(tasks, |task| self.arch.dispatch(task));
        for products in &mut self.products {
            products.fill(0.0);
        }
        for plane in &self.products_of_planes[planes] {
            for (sums, products) in self.products.iter_mut().zip(plane) {
                active.iter().for_each(|&column| sums[column] += products[column]);
            }
        }
    }
}

/// How one thread multiplies its planes of z, which is in the finest level.
struct Products<'a> {
    part: &'a Part,
    with: Factor,
    finest: &'a Level,
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
    /// rᵀz, or zᵀKz and zᵀKp, of one piece.
    #[inline(always)]
    fn multiply<S: Simd>(&mut self, simd: S, k: usize, piece: [usize; 2]) {
        let Level { stencil, layout, b: r, x: z, .. } = self.finest;
        let Some(nodes) = Nodes::piece([&stencil.layout, layout], k, 0, piece) else { return };
        let (colour, n) = (nodes.colour, nodes.places.len());
        let stencil = stencil.piece(colour, nodes.places.start..nodes.places.end);
        let [first, second] = &mut self.products[k - self.part.planes.start];
        for &column in self.active {
            let at = nodes.within(layout, column);
            let own = &z[colour][at.start..at.end];
            match self.with {
                Factor::Residual => first[column] += total(&products(simd, &r[colour][at], own)),
                Factor::Charges => {
                    let charges = &mut self.charges[..n];
                    let around = layout.neighbours(colour, at.start, n, &z[1 - colour]);
                    stencil.charges(simd, charges, own, around);
                    first[column] += total(&products(simd, charges, own));
                    second[column] += total(&products(simd, charges, &self.p[colour][at]));
                }
            }
        }
    }
}
