//! Moving the fields and applying K, plane by plane.

use super::LatticeSolver;
use super::hierarchy::Hierarchy;
use super::increment::{Following, Increment};
use super::layout::{Coloured, Layout};
use super::level::{Level, Slab};
use super::links::ObjectLinks;
use super::parts::{Part, Parts, cut_both, cut_planes};
use super::potentials::Potentials;
use super::precision::{Leaking, Network};
use super::prolongation::Behind;
use super::sums::{Equations, Fields, Nodes, PIECE, Sums};
use crate::instructions::EightLanes;
use crate::solver::operator::State;
use crate::workers::Workers;
use pulp::{Simd, WithSimd};

impl LatticeSolver {
    /// Moves the fields by the step, after z was added to β times it, and evaluates them. Nothing follows what is no step.
    pub(super) fn walk(&mut self, beta: Option<&[f64]>, is_step: bool) {
        let Level { stencil, b, x: z, charges, .. } = &mut self.hierarchy.levels[0];
        let inverse = &stencil.centre;
        let surroundings = Surroundings {
            layout: self.layout,
            of_nodes: self.of_nodes,
            links: &self.links,
            scale: &self.scale,
            parts: &self.parts,
            workers: &self.workers,
            arch: self.arch,
        };
        let increment = is_step.then_some((&mut self.increment, charges));
        let vectors = Vectors { z, beta, p: &mut self.p, r: b, increment, states: &mut self.state_of_planes };
        match &mut self.potentials {
            Potentials::Single { x, leak, sums } => {
                surroundings.walk(Leaking { stencil, leak }, inverse, vectors, x, sums);
            }
            Potentials::Double { x, stencil, sums, .. } => {
                let vectors = Vectors { increment: None, ..vectors };
                surroundings.walk(&**stencil, inverse, vectors, x, sums);
            }
        }
        self.add_states();
        if is_step {
            self.add_up_increment();
        }
    }

    /// The second half of a cycle, and a step by the correction of the length `scale` on its way out. Nothing where the
    /// two must be apart: returns whether it was done.
    pub(super) fn ascend_and_walk(&mut self) -> bool {
        if self.hierarchy.transfers.is_empty() || !self.is_single() {
            return false;
        }
        self.catch_up();
        let Potentials::Single { x, leak, sums } = &mut self.potentials else { return false };
        let (leak, active) = (&*leak, &*self.active);
        self.hierarchy.ascend_coarse(&self.workers, self.arch, active);
        let Hierarchy { levels, transfers, .. } = &mut self.hierarchy;
        let (Some(transfer), [finest, coarse, ..]) = (transfers.first_mut(), &mut levels[..]) else {
            return false;
        };
        let mut charges = std::mem::take(&mut finest.charges);
        for (phase, parts) in self.parts.phases().into_iter().enumerate() {
            let states = cut_planes(parts, &mut self.state_of_planes);
            let mut following = self.increment.follow(parts, &mut charges);
            let of_movement = cut_both(parts, x).zip(states).zip(&mut *sums);
            let slabs = finest.slabs(phase, active).zip(of_movement);
            let slabs = slabs.map(|(slab, ((x, states), sums))| {
                let equations = Equations {
                    network: Leaking { stencil: slab.stencil, leak },
                    of_nodes: self.of_nodes,
                    layout: self.layout,
                    inverse: &slab.stencil.centre,
                    links: &self.links,
                };
                let part = slab.part;
                let increment = following.next();
                (slab, Movement { part, equations, scale: &self.scale, x, increment, states, sums })
            });
            transfer.prolong_before(&self.workers, self.arch, slabs, coarse);
        }
        finest.charges = charges;
        self.add_states();
        self.add_up_increment();
        true
    }

    /// The state from those of planes.
    fn add_states(&mut self) {
        self.state.clear();
        self.state_of_planes[self.layout.planes()].iter().for_each(|plane| self.state.add(plane));
        self.of_free.copy_from_slice(&self.state.energies);
        self.add_held();
    }
}

/// What walks need but do not change.
#[derive(Clone, Copy)]
struct Surroundings<'a> {
    layout: Layout,
    of_nodes: Layout,
    links: &'a ObjectLinks,
    scale: &'a [f64],
    parts: &'a Parts,
    workers: &'a Workers,
    arch: EightLanes,
}

/// The vectors of a walk but for the potentials.
struct Vectors<'a> {
    z: &'a Coloured<f32>,
    beta: Option<&'a [f64]>,
    p: &'a mut Coloured<f32>,
    r: &'a mut Coloured<f32>,
    /// The last change of the fields and its charges, if they are to follow.
    increment: Option<(&'a mut Increment, &'a mut Coloured<f32>)>,
    states: &'a mut [State],
}

impl Surroundings<'_> {
    fn walk<K: Network>(
        self,
        network: K,
        inverse: &Coloured<f32>,
        vectors: Vectors<'_>,
        x: &mut Coloured<K::Value>,
        sums: &mut [Sums<K::Value>],
    ) {
        let Self { layout, of_nodes, links, scale, .. } = self;
        let equations = Equations { network, of_nodes, layout, inverse, links };
        let Vectors { z, beta, p, r, mut increment, states } = vectors;
        for parts in self.parts.phases() {
            let mut following =
                increment.as_mut().map(|(increment, charges)| increment.follow(parts, charges));
            let cut = cut_both(parts, x).zip(cut_both(parts, p)).zip(cut_both(parts, r));
            let tasks = parts.iter().zip(cut).zip(cut_planes(parts, states)).zip(&mut *sums).map(
                |(((part, ((x, p), r)), states), sums)| {
                    let increment = following.as_mut().and_then(Iterator::next);
                    let movement = Movement { part, equations, scale, x, increment, states, sums };
                    Walk { movement, z, beta, p, r }
                },
            );
            self.workers.for_each(tasks, |task| self.arch.dispatch(task));
        }
    }
}

/// How one thread moves fields by a step and evaluates them.
pub(super) struct Movement<'a, K: Network> {
    pub(super) part: &'a Part,
    pub(super) equations: Equations<'a, K>,
    /// The length of the step in each column.
    pub(super) scale: &'a [f64],
    pub(super) x: [&'a mut [K::Value]; 2],
    pub(super) increment: Option<Following<'a>>,
    pub(super) states: &'a mut [State],
    pub(super) sums: &'a mut Sums<K::Value>,
}

impl<K: Network> Movement<'_, K> {
    /// x += scale p.
    #[inline(always)]
    fn advance(&mut self, p: &[f32], nodes: &Nodes) {
        let layout = self.equations.layout;
        for (column, &scale) in self.scale.iter().enumerate() {
            let at = nodes.within(&layout, column);
            let x = &mut self.x[nodes.colour][at.start..at.end];
            if scale != 0.0 {
                K::advance(x, scale, &p[at.start..at.end]);
            }
            if let Some(increment) = &self.increment {
                increment.advance::<K>(x, column, nodes.colour, at);
            }
        }
    }

    /// r = -K x in a piece of a plane, and sums with it.
    #[inline(always)]
    fn evaluate<S: Simd>(&mut self, simd: S, p: [&[f32]; 2], r: &mut [f32], nodes: &Nodes, k: usize) {
        let layout = &self.equations.layout;
        if let Some(increment) = &mut self.increment {
            increment.add_step(layout, nodes, (p[nodes.colour], self.scale), r);
        }
        let [red, black] = &self.x;
        let fields = Fields { x: [red, black], p };
        self.sums.evaluate(simd, &self.equations, &fields, r, nodes);
        if let Some(increment) = &mut self.increment {
            increment.add_up(simd, layout, nodes, r, k - self.part.planes.start);
        }
    }

    /// One of the pieces of plane k.
    #[inline(always)]
    fn piece(&self, k: usize, piece: [usize; 2]) -> Option<Nodes> {
        let layouts = [&self.equations.of_nodes, &self.equations.layout];
        Nodes::piece(layouts, k, self.part.places.start, piece)
    }

    fn pieces(&self) -> usize {
        2 * self.equations.of_nodes.plane.div_ceil(PIECE)
    }

    #[inline(always)]
    fn start(&mut self, k: usize) {
        self.sums.start();
        self.states[k - self.part.planes.start].clear();
        if let Some(increment) = &mut self.increment {
            increment.start(k - self.part.planes.start);
        }
    }

    #[inline(always)]
    fn finish(&mut self, k: usize) {
        self.sums.hand_over(&mut self.states[k - self.part.planes.start]);
    }
}

/// A step by p, after z was added to β times it if there is a β.
pub(super) struct Walk<'a, K: Network> {
    pub(super) movement: Movement<'a, K>,
    pub(super) z: &'a Coloured<f32>,
    pub(super) beta: Option<&'a [f64]>,
    pub(super) p: [&'a mut [f32]; 2],
    pub(super) r: [&'a mut [f32]; 2],
}

impl<K: Network> WithSimd for Walk<'_, K> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        // A plane is evaluated two steps after it was moved, so that both can go on piece by piece: while one waits for
        // memory, the other computes.
        let part = self.movement.part;
        for step in part.steps(3) {
            let [moved, evaluated] = [part.plane(0, step), part.plane(2, step)];
            if let Some(k) = evaluated {
                self.movement.start(k);
            }
            for piece in 0..self.movement.pieces() {
                let piece = [piece % 2, piece / 2];
                if let Some(nodes) = moved.and_then(|k| self.movement.piece(k, piece)) {
                    self.move_piece(&nodes);
                }
                let Some(k) = evaluated else { continue };
                if let Some(nodes) = self.movement.piece(k, piece) {
                    let Self { movement, p: [red, black], r, .. } = &mut self;
                    movement.evaluate(simd, [red, black], r[nodes.colour], &nodes, k);
                }
            }
            if let Some(k) = evaluated {
                self.movement.finish(k);
            }
        }
    }
}

impl<K: Network> Walk<'_, K> {
    /// p = z + β p, x += scale p.
    #[inline(always)]
    fn move_piece(&mut self, nodes: &Nodes) {
        let Self { movement, z, beta, p, .. } = self;
        let p = &mut *p[nodes.colour];
        if let Some(beta) = beta {
            let base = movement.part.places.start;
            for (column, &beta) in beta.iter().enumerate() {
                let at = nodes.within(&movement.equations.layout, column);
                let z = &z[nodes.colour][base + at.start..base + at.end];
                let beta = beta as f32;
                p[at.start..at.end].iter_mut().zip(z).for_each(|(p, z)| *p = z + beta * *p);
            }
        }
        movement.advance(p, nodes);
    }
}

/// A step by a correction goes behind the sweep that finishes it.
impl<K: Network> Behind for Movement<'_, K> {
    const STAGES: usize = 1;

    #[inline(always)]
    fn follow<S: Simd>(&mut self, simd: S, slab: &mut Slab<'_>, stage: usize, step: usize) {
        if let Some(k) = self.part.plane(stage, step) {
            for piece in 0..self.pieces() {
                if let Some(nodes) = self.piece(k, [piece % 2, piece / 2]) {
                    self.advance(slab.x[nodes.colour], &nodes);
                }
            }
        }
        if let Some(k) = self.part.plane(stage + 1, step) {
            self.start(k);
            for piece in 0..self.pieces() {
                if let Some(nodes) = self.piece(k, [piece % 2, piece / 2]) {
                    let Slab { x: [red, black], b, .. } = &mut *slab;
                    self.evaluate(simd, [red, black], b[nodes.colour], &nodes, k);
                }
            }
            self.finish(k);
        }
    }
}
