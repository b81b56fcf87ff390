//! Moving the fields and applying K in double precision, and products of vectors in single, plane by plane.

use super::LatticeSolver;
use super::layout::Coloured;
use super::level::Level;
use super::parts::{Part, cut_both, cut_planes};
use super::stencil::Stencil;
use super::sums::{Equations, Fields, Nodes, PIECE, Sums, products, total};
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
        let (planes, active, p) = (self.layout.planes(), &*self.active, &self.p);
        let slabs = &self.parts.slabs;
        let products = cut_planes(slabs, &mut self.products_of_planes);
        let tasks = slabs.iter().zip(products).zip(&mut self.sums).map(|((part, products), sums)| Products {
            part,
            with,
            finest,
            p,
            active,
            products,
            charges: &mut sums.rounded,
        });
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

/// How one thread moves and evaluates fields.
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
        // A plane is evaluated two steps after it was moved, so that both can go on piece by piece: while one waits for
        // memory, the other computes.
        for step in self.part.steps(3) {
            let [moved, evaluated] = [self.part.plane(0, step), self.part.plane(2, step)];
            self.sums.start();
            if let Some(k) = evaluated {
                self.states[k - self.part.planes.start].clear();
            }
            let pieces = self.equations.stencil.layout.plane.div_ceil(PIECE);
            for piece in 0..2 * pieces {
                let piece = [piece % 2, piece / 2];
                if let Some(k) = moved {
                    self.move_piece(k, piece);
                }
                if let Some(k) = evaluated {
                    self.evaluate(simd, k, piece);
                }
            }
            if let Some(k) = evaluated {
                self.sums.hand_over(&mut self.states[k - self.part.planes.start]);
            }
        }
    }
}

impl Walk<'_> {
    /// p = z + β p, x += p.
    #[inline(always)]
    fn move_piece(&mut self, k: usize, piece: [usize; 2]) {
        let layout = self.equations.layout;
        let base = self.part.places.start;
        let Some(nodes) = Nodes::piece([&self.equations.stencil.layout, &layout], k, base, piece) else {
            return;
        };
        let (x, p) = (&mut *self.x[nodes.colour], &mut *self.p[nodes.colour]);
        let Step { z, beta, scale } = self.step;
        for column in 0..layout.columns {
            let at = nodes.within(&layout, column);
            let (x, p) = (&mut x[at.start..at.end], &mut p[at.start..at.end]);
            if let Some(beta) = beta {
                let (beta, z) = (beta[column] as f32, &z[nodes.colour][base + at.start..base + at.end]);
                p.iter_mut().zip(z).for_each(|(p, z)| *p = z + beta * *p);
            }
            let scale = scale[column];
            if scale != 0.0 {
                x.iter_mut().zip(p).for_each(|(x, p)| *x += scale * f64::from(*p));
            }
        }
    }

    /// Evaluates a piece of a plane.
    #[inline(always)]
    fn evaluate<S: Simd>(&mut self, simd: S, k: usize, piece: [usize; 2]) {
        let Self { part, equations, x: [red, black], p: [p_red, p_black], r, states, sums, .. } = self;
        let layouts = [&equations.stencil.layout, &equations.layout];
        let Some(nodes) = Nodes::piece(layouts, k, part.places.start, piece) else { return };
        let fields = Fields { x: [red, black], p: [p_red, p_black] };
        let state = &mut states[k - part.planes.start];
        sums.evaluate(simd, equations, &fields, r[nodes.colour], &nodes, state);
    }
}

/// How one thread multiplies its planes of z, which is in the finest level. In single precision: lengths of steps need
/// not be exact.
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
