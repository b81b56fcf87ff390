//! Everything in double precision, plane by plane: moving the fields, applying K, and products of vectors.

use super::LatticeSolver;
use super::layout::{BLACK, BLOCK, Coloured, Layout, RED};
use super::level::Level;
use super::parts::{Part, cut_both, cut_planes};
use super::stencil::Stencil;
use super::sums::{Equations, Fields, Sums, add_mixed_products, total};
use crate::solver::operator::State;
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
    /// Moves the fields by the step, after z was added to β times it, and evaluates them.
    pub(super) fn walk(&mut self, beta: Option<&[f64]>) {
        let Self { layout, x, p, scale, sums, .. } = self;
        let Level { stencil: Stencil { centre: inverse, .. }, b, x: z, .. } = &mut self.hierarchy.levels[0];
        let (z, scale) = (&*z, &**scale);
        let layout = *layout;
        let equations = Equations { stencil: &self.stencil, layout, inverse, links: &self.links };
        for parts in self.parts.phases() {
            let vectors = cut_both(parts, x).zip(cut_both(parts, p)).zip(cut_both(parts, b));
            let states = cut_planes(parts, &mut self.state_of_planes);
            let tasks = parts.iter().zip(vectors).zip(states).zip(&mut *sums).map(
                |(((part, ((x, p), r)), states), sums)| Walk {
                    part,
                    equations,
                    step: Step { z, beta, scale },
                    x,
                    p,
                    r,
                    states,
                    sums,
                },
            );
            self.workers.for_each(tasks, |task| self.arch.dispatch(task));
        }
        self.state.clear();
        self.state_of_planes[layout.planes()].iter().for_each(|plane| self.state.add(plane));
        let columns = self.columns;
        self.links.add_margin(columns, &mut self.state.energies);
        for t in 0..columns {
            for s in 0..t {
                self.state.energies[t * columns + s] = self.state.energies[s * columns + t];
            }
        }
    }

    /// Products of z with something, for the active columns.
    pub(super) fn multiply_correction(&mut self, with: Factor) {
        let finest = &self.hierarchy.levels[0];
        let (layout, active, p, diagonal) = (self.layout, &*self.active, &self.p, &self.stencil.centre);
        let slabs = &self.parts.slabs;
        let products = cut_planes(slabs, &mut self.products_of_planes);
        let tasks = slabs.iter().zip(products).map(|(part, products)| Products {
            part,
            with,
            layout,
            finest,
            diagonal,
            p,
            active,
            products,
        });
        self.workers.for_each(tasks, |task| self.arch.dispatch(task));
        for products in &mut self.products {
            products.fill(0.0);
        }
        for plane in &self.products_of_planes[layout.planes()] {
            for (sums, products) in self.products.iter_mut().zip(plane) {
                active.iter().for_each(|&column| sums[column] += products[column]);
            }
        }
    }
}

/// How one thread moves and evaluates fields. A plane is evaluated one step after it was moved.
struct Walk<'a> {
    part: &'a Part,
    equations: Equations<'a>,
    step: Step<'a>,
    x: [&'a mut [f64]; 2],
    p: [&'a mut [f32]; 2],
    r: [&'a mut [f32]; 2],
    states: &'a mut [State],
    sums: &'a mut Sums,
}

/// How fields move: p = z + β p, if there is a β, and x += scale p.
#[derive(Clone, Copy)]
struct Step<'a> {
    z: &'a Coloured<f32>,
    beta: Option<&'a [f64]>,
    scale: &'a [f64],
}

impl WithSimd for Walk<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        for step in self.part.steps(2) {
            if let Some(k) = self.part.plane(0, step) {
                if let Some(beta) = self.step.beta {
                    self.turn_step(k, beta);
                }
                self.move_fields(k);
            }
            if let Some(k) = self.part.plane(1, step) {
                let Self { part, equations, x: [red, black], p: [p_red, p_black], r, states, sums, .. } =
                    &mut self;
                let fields = Fields { start: part.places.start, x: [red, black], p: [p_red, p_black] };
                let state = &mut states[k - part.planes.start];
                sums.evaluate(simd, equations, &fields, r, k, state);
            }
        }
    }
}

impl Walk<'_> {
    /// p = z + β p.
    #[inline(always)]
    fn turn_step(&mut self, k: usize, beta: &[f64]) {
        for colour in [RED, BLACK] {
            for (column, &beta) in beta.iter().enumerate() {
                let places = self.equations.layout.plane_of(column, k);
                let p = &mut self.p[colour][self.part.within(&places)];
                let z = &self.step.z[colour][places];
                p.iter_mut().zip(z).for_each(|(p, z)| *p = z + beta as f32 * *p);
            }
        }
    }

    /// x += p.
    #[inline(always)]
    fn move_fields(&mut self, k: usize) {
        for colour in [RED, BLACK] {
            for (column, &scale) in self.step.scale.iter().enumerate() {
                if scale == 0.0 {
                    continue;
                }
                let at = self.part.within(&self.equations.layout.plane_of(column, k));
                let p = &self.p[colour][at.start..at.end];
                self.x[colour][at].iter_mut().zip(p).for_each(|(x, p)| *x += scale * f64::from(*p));
            }
        }
    }
}

/// How one thread multiplies its planes of z, which is in the finest level.
struct Products<'a> {
    part: &'a Part,
    with: Factor,
    layout: Layout,
    finest: &'a Level,
    /// That of K.
    diagonal: &'a Coloured<f64>,
    p: &'a Coloured<f32>,
    active: &'a [usize],
    products: &'a mut [[Vec<f64>; 2]],
}

impl WithSimd for Products<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let len = if matches!(self.with, Factor::Charges) { self.finest.stencil.layout.plane } else { 0 };
        let mut charges = vec![0.0; len];
        for step in self.part.steps(1) {
            let Some(k) = self.part.plane(0, step) else { continue };
            match self.with {
                Factor::Residual => self.with_residual(k),
                Factor::Charges => self.with_charges(simd, k, &mut charges),
            }
        }
    }
}

impl Products<'_> {
    /// rᵀz.
    #[inline(always)]
    fn with_residual(&mut self, k: usize) {
        let [products, _] = &mut self.products[k - self.part.planes.start];
        for &column in self.active {
            let mut sum = [0.0; BLOCK];
            for colour in [RED, BLACK] {
                let at = self.layout.plane_of(column, k);
                let (r, z) = (&self.finest.b[colour][at.start..at.end], &self.finest.x[colour][at]);
                sum = add_mixed_products(sum, r, z);
            }
            products[column] = total(&sum);
        }
    }

    /// zᵀKz and zᵀKp, in single precision: lengths of steps need not be exact.
    #[inline(always)]
    fn with_charges<S: Simd>(&mut self, simd: S, k: usize, charges: &mut [f32]) {
        let Level { stencil, x: z, .. } = self.finest;
        let places = stencil.layout.plane(k);
        let charges = &mut charges[..places.len()];
        let [of_z, of_p] = &mut self.products[k - self.part.planes.start];
        for &column in self.active {
            let at = self.layout.plane_of(column, k);
            let mut sums = [[0.0; BLOCK]; 2];
            for colour in [RED, BLACK] {
                let own = &z[colour][at.start..at.end];
                let around = self.layout.neighbours(colour, at.start, at.len(), &z[1 - colour]);
                let piece = stencil.piece(colour, places.start..places.end);
                piece.gather(simd, 1.0, charges, around);
                let diagonal = &self.diagonal[colour][places.start..places.end];
                for ((kz, z), diagonal) in charges.iter_mut().zip(own).zip(diagonal) {
                    *kz = (diagonal * f64::from(*z) - f64::from(*kz)) as f32;
                }
                sums[0] = add_mixed_products(sums[0], charges, own);
                sums[1] = add_mixed_products(sums[1], charges, &self.p[colour][at.start..at.end]);
            }
            of_z[column] = total(&sums[0]);
            of_p[column] = total(&sums[1]);
        }
    }
}
