//! What fields will change by, as far as the last change tells: bodies that move steadily change them alike from frame to
//! frame.
//!
//! With d, the last change of the fields X, and its charges q = K d, the energy of X + c d is least at c = rᵀd / dᵀq, column
//! by column: Fischer, Comput. Methods Appl. Mech. Engrg. 163 (1998), with one vector. Nothing is moved for that. The sums
//! below follow the rows that change, so c and all energies are known at once, and the way down of a cycle starts from
//! r - c q; fields follow when they take a step. Then d becomes all that they changed by since the step before: c d, what nodes
//! were relaxed by in between, and the step.

use super::LatticeSolver;
use super::layout::{BLOCK, Coloured, Layout};
use super::level::Level;
use super::parts::{Part, cut_both, cut_planes};
use super::potentials::Potentials;
use super::precision::Network;
use super::refreshed::OfColumn;
use super::relaxed::{Followed, RelaxedNodes};
use super::rows::{add_product, subtract, subtract_product};
use super::sums::{Nodes, products, total};
use crate::solver::worth::{self, Worth};
use pulp::Simd;
use std::ops::Range;

/// The last change of the fields.
#[derive(Clone, Debug)]
pub(super) struct Increment {
    /// d, zero where the potential is fixed.
    pub(super) fields: Coloured<f32>,
    /// Whether the sums are those of it.
    pub(super) is_known: bool,
    pub(super) sums: Sums,
    sums_of_planes: Vec<Sums>,
    /// What the energies and Σ r² of the state have in them of c d.
    energies: Vec<f64>,
    residual: Vec<f64>,
    /// Whether the fields have taken a step since they were ahead; how far they were, for the next step to catch up with,
    /// and what d is multiplied with before the step is added to it.
    pub(super) has_moved: bool,
    lead: Vec<f32>,
    kept: Vec<f32>,
    /// What going ahead has gained lately, and whether the steps under way are followed.
    worth: Worth,
    follows: bool,
    /// What nodes were relaxed by since the last step.
    pub(super) relaxed: RelaxedNodes,
}

/// Products of a change with residuals and charges.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Sums<T = f64> {
    columns: usize,
    /// Σ d_s r_t, and Σ d_s q_t for s <= t.
    with_residuals: Vec<T>,
    with_charges: Vec<T>,
    /// Σ r q and Σ q² of each column.
    crossed: Vec<T>,
    squares: Vec<T>,
}

impl<T: Clone + Default> Sums<T> {
    pub(super) fn new(columns: usize) -> Self {
        let (square, column) = (vec![T::default(); columns * columns], vec![T::default(); columns]);
        Self {
            columns,
            with_residuals: square.clone(),
            with_charges: square,
            crossed: column.clone(),
            squares: column,
        }
    }

    fn all(&mut self) -> impl Iterator<Item = &mut T> {
        let Self { with_residuals, with_charges, crossed, squares, .. } = self;
        with_residuals.iter_mut().chain(with_charges).chain(crossed).chain(squares)
    }

    pub(super) fn clear(&mut self) {
        self.all().for_each(|sum| *sum = T::default());
    }
}

impl Sums {
    pub(super) fn add(&mut self, other: &mut Self) {
        self.all().zip(other.all()).for_each(|(sum, part)| *sum += *part);
    }

    /// Adds what is there of some blocks, and leaves nothing of it.
    #[inline(always)]
    pub(super) fn take(&mut self, of_blocks: &mut Sums<[f32; BLOCK]>) {
        for (sum, part) in self.all().zip(of_blocks.all()) {
            *sum += total(part);
            *part = [0.0; BLOCK];
        }
    }

    /// What a node of one column had in them, before its d is zero.
    pub(super) fn remove(&mut self, column: usize, d: f64, of_node: impl Fn(usize) -> [f64; 2]) {
        for t in 0..self.columns {
            let [residual, charge] = of_node(t);
            self.with_residuals[column * self.columns + t] -= d * residual;
            if column <= t {
                self.with_charges[column * self.columns + t] -= d * charge;
            }
        }
    }

    /// Σ d_s r_t is another.
    pub(super) fn add_with_residual(&mut self, [s, t]: [usize; 2], change: f64) {
        self.with_residuals[s * self.columns + t] += change;
    }

    /// Σ r q of a column is another.
    pub(super) fn add_crossed(&mut self, column: usize, change: f64) {
        self.crossed[column] += change;
    }

    /// How far a column should go, nowhere if that gains next to nothing of its energy.
    fn length(&self, column: usize, energy: f64) -> f64 {
        let own = column * self.columns + column;
        let (slope, curvature) = (self.with_residuals[own], self.with_charges[own]);
        worth::length(slope, curvature, energy, 0.0)
    }

    /// By how much the energy of a pair s <= t of columns is another once both have gone so far.
    fn energy(&self, [s, t]: [usize; 2], lengths: &[f32]) -> f64 {
        let (of_s, of_t) = (f64::from(lengths[s]), f64::from(lengths[t]));
        let with_residuals = |s: usize, t: usize| self.with_residuals[s * self.columns + t];
        let curved = of_s * of_t * self.with_charges[s * self.columns + t];
        curved - of_s * with_residuals(s, t) - of_t * with_residuals(t, s)
    }
}

impl Sums<[f32; BLOCK]> {
    /// The residuals and charges of a block are others.
    #[inline(always)]
    pub(super) fn change<S: Simd>(&mut self, simd: S, of_block: &[OfColumn]) {
        let columns = of_block.len();
        for (t, of_t) in of_block.iter().enumerate() {
            let ([r_before, r], [q_before, q]) = (&of_t.residual, &of_t.charge);
            let (mut residual, mut charge) = (*r, *q);
            subtract(simd, &mut residual, r_before);
            subtract(simd, &mut charge, q_before);
            add_product(simd, &mut self.crossed[t], r, q);
            subtract_product(simd, &mut self.crossed[t], r_before, q_before);
            add_product(simd, &mut self.squares[t], q, q);
            subtract_product(simd, &mut self.squares[t], q_before, q_before);
            for (s, of_s) in of_block.iter().enumerate() {
                add_product(simd, &mut self.with_residuals[s * columns + t], &of_s.increment, &residual);
                if s <= t {
                    add_product(simd, &mut self.with_charges[s * columns + t], &of_s.increment, &charge);
                }
            }
        }
    }
}

impl Increment {
    pub(super) fn new(layout: &Layout) -> Self {
        let columns = layout.columns;
        Self {
            fields: layout.zeros(),
            is_known: false,
            sums: Sums::new(columns),
            sums_of_planes: vec![Sums::new(columns); layout.counts[2]],
            energies: vec![0.0; columns * columns],
            residual: vec![0.0; columns],
            has_moved: false,
            lead: vec![0.0; columns],
            kept: vec![0.0; columns],
            worth: Worth::default(),
            follows: false,
            relaxed: RelaxedNodes::new(layout),
        }
    }

    /// What threads that share the planes let follow a step; nothing where it is not to.
    pub(super) fn follow<'a>(
        &'a mut self,
        parts: &'a [Part],
        charges: &'a mut Coloured<f32>,
    ) -> impl Iterator<Item = Following<'a>> {
        let Self { fields, sums_of_planes, lead, kept, follows, .. } = self;
        let parts = if *follows { parts } else { &[] };
        let (lead, kept) = (&**lead, &**kept);
        let vectors = cut_both(parts, fields).zip(cut_both(parts, charges));
        vectors.zip(cut_planes(parts, sums_of_planes)).map(move |((fields, charges), sums)| Following {
            lead,
            kept,
            fields,
            charges,
            sums,
        })
    }

    /// Learns whether going ahead is worth it: from what it gained as a part of what there was to gain, `gains` being what a
    /// cycle tells of the rest, all pairs of columns.
    pub(super) fn note_gains(&mut self, gains: &[f64]) {
        if self.has_moved || !self.is_known {
            return;
        }
        let own = |of: &[f64]| of.iter().step_by(self.sums.columns + 1).sum::<f64>();
        self.worth.learn(-own(&self.energies), own(gains));
    }

    /// How far a column with such an energy would go if it went now.
    pub(super) fn length(&self, column: usize, energy: f64) -> f64 {
        if self.is_known { self.sums.length(column, energy) } else { 0.0 }
    }

    /// The state's energies were computed anew, without it.
    pub(super) fn forget_energies(&mut self) {
        self.energies.fill(0.0);
    }
}

impl LatticeSolver {
    /// Goes as far along the last change as lowers the energies most, without moving any field.
    pub(super) fn go_ahead(&mut self) {
        let columns = self.columns;
        self.increment.has_moved = false;
        let can = self.increment.is_known && self.is_single();
        let Self { increment, state, hierarchy, .. } = self;
        let Increment { sums, energies, residual, .. } = increment;
        let lengths = &mut hierarchy.levels[0].ahead;
        if !can || !sums.all().all(|sum| sum.is_finite()) {
            sums.clear();
        }
        for (column, length) in lengths.iter_mut().enumerate() {
            let own = column * columns + column;
            let stands = state.energies[own] - energies[own];
            *length = sums.length(column, stands) as f32;
        }
        for t in 0..columns {
            for s in 0..=t {
                let ahead = sums.energy([s, t], lengths);
                let change = ahead - std::mem::replace(&mut energies[s * columns + t], ahead);
                state.energies[s * columns + t] += change;
                state.energies[t * columns + s] = state.energies[s * columns + t];
            }
            let length = f64::from(lengths[t]);
            let ahead = length * (length * sums.squares[t] - 2.0 * sums.crossed[t]);
            state.residual[t] += ahead - std::mem::replace(&mut residual[t], ahead);
        }
    }

    /// Before a step: residuals become those of where the fields are ahead; the step takes the fields there on its way.
    pub(super) fn catch_up(&mut self) {
        let Self { increment, hierarchy, parts, potentials, workers, layout, of_nodes, .. } = self;
        if !increment.has_moved {
            increment.follows =
                matches!(potentials, Potentials::Single { .. }) && increment.worth.is_to_follow();
        }
        let Increment {
            fields, has_moved, lead, kept, energies, residual, is_known, follows, relaxed, ..
        } = increment;
        if std::mem::replace(has_moved, true) {
            lead.fill(0.0);
            kept.fill(1.0);
            return;
        }
        let Level { stencil, b, charges, ahead, .. } = &mut hierarchy.levels[0];
        let is_ahead = ahead.iter().any(|length| *length != 0.0);
        let move_ahead = |vectors: &mut Coloured<f32>, along: &Coloured<f32>, sign: f32| {
            let (slabs, lengths) = (&parts.slabs, &**ahead);
            let tasks = slabs.iter().zip(cut_both(slabs, vectors));
            workers.for_each(tasks, |(part, to)| add_planes(part, layout, to, (lengths, sign), along));
        };
        if is_ahead {
            move_ahead(b, charges, -1.0);
        }
        if let Potentials::Single { x, .. } = potentials
            && is_ahead
            && !*follows
        {
            move_ahead(x, fields, 1.0);
        }
        lead.copy_from_slice(ahead);
        kept.copy_from_slice(ahead);
        if let Potentials::Single { x, .. } = potentials
            && *follows
        {
            relaxed.hand_over(Followed {
                of_nodes,
                layout,
                stencil,
                kept,
                fields: x,
                change: fields,
                charges,
            });
        }
        relaxed.clear();
        ahead.fill(0.0);
        energies.fill(0.0);
        residual.fill(0.0);
        *is_known = false;
    }

    /// Takes the sums of planes, after a step.
    pub(super) fn add_up_increment(&mut self) {
        if !self.increment.follows {
            return;
        }
        let Increment { sums, sums_of_planes, is_known, .. } = &mut self.increment;
        sums.clear();
        sums_of_planes[self.layout.planes()].iter_mut().for_each(|plane| sums.add(plane));
        *is_known = sums.all().all(|sum| sum.is_finite());
    }

    /// Forgets the last change.
    pub(super) fn drop_increment(&mut self) {
        self.increment.is_known = false;
        self.increment.relaxed.clear();
        self.increment.energies.fill(0.0);
        self.increment.residual.fill(0.0);
        self.hierarchy.levels[0].ahead.fill(0.0);
    }
}

/// v += ±c u in the planes of a part, c another in each column.
fn add_planes(
    part: &Part,
    layout: &Layout,
    to: [&mut [f32]; 2],
    (lengths, sign): (&[f32], f32),
    along: &Coloured<f32>,
) {
    for (to, along) in to.into_iter().zip(along) {
        for k in part.steps(1) {
            for (column, &length) in lengths.iter().enumerate() {
                let at = layout.plane_of(column, k);
                let pairs = to[part.within(&at)].iter_mut().zip(&along[at]);
                pairs.for_each(|(to, along)| *to += sign * length * *along);
            }
        }
    }
}

/// How one thread lets the change of its planes follow a step.
pub(super) struct Following<'a> {
    /// How far the fields were ahead, and what is kept of their change.
    lead: &'a [f32],
    kept: &'a [f32],
    fields: [&'a mut [f32]; 2],
    charges: [&'a mut [f32]; 2],
    sums: &'a mut [Sums],
}

impl Following<'_> {
    /// Starts with a plane, counted from the first.
    pub(super) fn start(&mut self, plane: usize) {
        self.sums[plane].clear();
    }

    /// x += c d.
    #[inline(always)]
    pub(super) fn advance<K: Network>(
        &self,
        x: &mut [K::Value],
        column: usize,
        colour: usize,
        at: Range<usize>,
    ) {
        if self.lead[column] != 0.0 {
            K::advance(x, f64::from(self.lead[column]), &self.fields[colour][at]);
        }
    }

    /// d becomes what is kept of it and the step p of such a length, q what is kept of it and the residual before.
    #[inline(always)]
    pub(super) fn add_step(
        &mut self,
        layout: &Layout,
        nodes: &Nodes,
        (p, scale): (&[f32], &[f64]),
        r: &[f32],
    ) {
        for column in 0..layout.columns {
            let at = nodes.within(layout, column);
            let (kept, scale) = (self.kept[column], scale[column] as f32);
            let fields = &mut self.fields[nodes.colour][at.clone()];
            fields.iter_mut().zip(&p[at.clone()]).for_each(|(d, p)| *d = kept * *d + scale * *p);
            let charges = &mut self.charges[nodes.colour][at.clone()];
            charges.iter_mut().zip(&r[at]).for_each(|(q, r)| *q = kept * *q + *r);
        }
    }

    /// Takes the residual after the step from q, and sums.
    #[inline(always)]
    pub(super) fn add_up<S: Simd>(
        &mut self,
        simd: S,
        layout: &Layout,
        nodes: &Nodes,
        r: &[f32],
        plane: usize,
    ) {
        let (sums, columns) = (&mut self.sums[plane], layout.columns);
        for t in 0..columns {
            let at = nodes.within(layout, t);
            let (q, r) = (&mut self.charges[nodes.colour][at.clone()], &r[at]);
            subtract(simd, q, r);
            for s in 0..columns {
                let d = &self.fields[nodes.colour][nodes.within(layout, s)];
                sums.with_residuals[s * columns + t] += total(&products(simd, d, r));
                if s <= t {
                    sums.with_charges[s * columns + t] += total(&products(simd, d, q));
                }
            }
            sums.crossed[t] += total(&products(simd, q, r));
            sums.squares[t] += total(&products(simd, q, q));
        }
    }
}
