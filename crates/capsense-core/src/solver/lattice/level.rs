//! One level of the hierarchy: red-black Gauss-Seidel, fused so that the lattice is walked through once.

use super::layout::{BLACK, BLOCK, Coloured, Layout, RED};
use super::network::{Changed, Network, whole_blocks};
use super::parts::{Part, Parts, cut_both};
use super::rows::deal_piece;
use super::stencil::Stencil;
use crate::instructions::EightLanes;
use pulp::{Simd, WithSimd};

/// A level's network and vectors.
#[derive(Clone, Debug)]
pub(super) struct Level {
    pub(super) stencil: Stencil<f32>,
    /// That of the vectors.
    pub(super) layout: Layout,
    /// How threads share the planes.
    pub(super) parts: Parts,
    /// Right-hand side and correction.
    pub(super) b: Coloured<f32>,
    pub(super) x: Coloured<f32>,
    /// What the right-hand side is less by in each column: so many times these charges. Only the finest level has any.
    pub(super) ahead: Vec<f32>,
    pub(super) charges: Coloured<f32>,
    /// Room for a row of the network.
    inverse: Vec<f32>,
}

/// What one thread works on.
pub(super) struct Slab<'a> {
    pub(super) part: &'a Part,
    pub(super) stencil: &'a Stencil<f32>,
    pub(super) layout: Layout,
    pub(super) b: [&'a mut [f32]; 2],
    pub(super) x: [&'a mut [f32]; 2],
    pub(super) active: &'a [usize],
}

impl Level {
    /// Zeros; `layout` is that of one column.
    pub(super) fn new(layout: Layout, columns: usize, threads: usize) -> Self {
        let stencil = Stencil::new(layout);
        let layout = layout.with_columns(columns);
        Self {
            stencil,
            layout,
            parts: Parts::new(&layout, Parts::worthwhile(&layout, threads)),
            b: layout.zeros(),
            x: layout.zeros(),
            ahead: vec![0.0; columns],
            charges: Coloured::default(),
            inverse: vec![0.0; layout.counts[0].next_multiple_of(BLOCK)],
        }
    }

    /// Takes over the network where it changed.
    pub(super) fn refresh(&mut self, arch: EightLanes, network: &Network, changed: &Changed) {
        let Self { stencil, inverse, .. } = self;
        arch.dispatch(Refresh { stencil, inverse, network, changed });
    }

    /// The work of each thread in one phase.
    pub(super) fn slabs<'a>(
        &'a mut self,
        phase: usize,
        active: &'a [usize],
    ) -> impl Iterator<Item = Slab<'a>> {
        let Self { stencil, layout, parts, b, x, .. } = self;
        let (stencil, layout, parts) = (&*stencil, *layout, parts.phases()[phase]);
        let vectors = cut_both(parts, b).zip(cut_both(parts, x));
        parts.iter().zip(vectors).map(move |(part, (b, x))| Slab { part, stencil, layout, b, x, active })
    }

    /// Adds a part of bᵀx of all pairs s <= t of active columns to `products`.
    pub(super) fn add_products(&self, active: &[usize], part: f64, products: &mut [f64]) {
        let layout = &self.layout;
        for k in layout.planes() {
            let pairs = active
                .iter()
                .enumerate()
                .flat_map(|(index, t)| active[..=index].iter().map(move |s| (*s, *t)));
            for (s, t) in pairs {
                for (x, b) in self.x.iter().zip(&self.b) {
                    let (x, b) = (&x[layout.plane_of(s, k)], &b[layout.plane_of(t, k)]);
                    let product = x.iter().zip(b).map(|(x, b)| f64::from(x * b)).sum::<f64>();
                    products[s * layout.columns + t] += part * product;
                }
            }
        }
    }

    /// Some symmetric sweeps from zero, for a level that has no coarser one.
    pub(super) fn solve(&mut self, arch: EightLanes, sweeps: usize, active: &[usize]) {
        // Such a level is too small for several slabs.
        self.slabs(0, active).for_each(|slab| arch.dispatch(Solve(slab, sweeps)));
    }
}

/// Work that is compiled once for each set of instructions that a processor may have. Not closures, which the compiler
/// may leave out of the function that has these instructions.
struct Solve<'a>(Slab<'a>, usize);
struct Refresh<'a> {
    stencil: &'a mut Stencil<f32>,
    /// Room for a row.
    inverse: &'a mut [f32],
    network: &'a Network,
    changed: &'a Changed,
}

impl WithSimd for Refresh<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { stencil, inverse, network, changed } = self;
        let ([x, y, z], layout) = (&mut stencil.next, stencil.layout);
        for row in 0..changed.rows() {
            let (nodes, j, k) = changed.row(row);
            let blocks = whole_blocks(&nodes);
            let at = network.index([blocks.start, j, k]);
            let inverse = &mut inverse[..blocks.len()];
            network.invert_diagonal(simd, at, inverse);
            let nodes = blocks.start..blocks.end.min(layout.counts[0]);
            let here = at..at + nodes.len();
            let places = [layout.place([nodes.start, j, k]), layout.place([nodes.start + 1, j, k])];
            deal_to(x, places, &network.next[0][here.clone()]);
            deal_to(y, places, &network.next[1][here.clone()]);
            deal_to(z, places, &network.next[2][here]);
            deal_to(&mut stencil.centre, places, &inverse[..nodes.len()]);
        }
    }
}

/// Deals a piece of a row to the colours and places of its first node and of its second.
#[inline(always)]
fn deal_to(to: &mut Coloured<f32>, [(first, at), (_, behind)]: [(usize, usize); 2], row: &[f32]) {
    let n = row.len();
    let [red, black] = to;
    let (to_first, to_second) = if first == RED { (red, black) } else { (black, red) };
    deal_piece(row, &mut to_first[at..at + n.div_ceil(2)], &mut to_second[behind..behind + n / 2]);
}

impl WithSimd for Solve<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self(mut slab, sweeps) = self;
        let planes = slab.layout.planes();
        for k in planes.start..planes.end {
            slab.scale_red(simd, k);
        }
        for sweep in 0..2 * sweeps {
            for k in planes.start..planes.end {
                slab.relax(simd, [BLACK, RED][sweep % 2], k);
            }
        }
    }
}

impl Slab<'_> {
    /// Once red nodes are corrected: black ones are relaxed, then red ones.
    #[inline(always)]
    pub(super) fn smooth_behind<S: Simd>(&mut self, simd: S, step: usize) {
        if let Some(k) = self.part.plane(1, step) {
            self.relax(simd, BLACK, k);
        }
        if let Some(k) = self.part.plane(2, step) {
            self.relax(simd, RED, k);
        }
    }

    /// x = D⁻¹ b at the red nodes of a plane.
    #[inline(always)]
    fn scale_red<S: Simd>(&mut self, simd: S, k: usize) {
        let stencil = self.stencil.piece(RED, self.stencil.layout.plane(k));
        for &column in self.active {
            let here = self.part.within(&self.layout.plane_of(column, k));
            stencil.scale(simd, &mut self.x[RED][here.clone()], &self.b[RED][here]);
        }
    }

    /// Solves the equations of one colour in a plane.
    #[inline(always)]
    fn relax<S: Simd>(&mut self, simd: S, colour: usize, k: usize) {
        let [red, black] = &mut self.x;
        let (own, other) = if colour == RED { (red, &*black) } else { (black, &*red) };
        let stencil = self.stencil.piece(colour, self.stencil.layout.plane(k));
        for &column in self.active {
            let here = self.part.within(&self.layout.plane_of(column, k));
            let around = self.layout.neighbours(colour, here.start, here.len(), other);
            stencil.relax(simd, &mut own[here.clone()], &self.b[colour][here], around);
        }
    }
}
