//! What fields will change by, as far as the last change tells, as on lattices (`solver::lattice::increment`): with d, the
//! change from one step to the next, and q = K d, the energy of x + c d is least at c = rᵀd / dᵀq, column by column (Fischer,
//! Comput. Methods Appl. Mech. Engrg. 163, 1998, with one vector). Products are summed over all rows and the fields moved, which
//! costs little beside half a cycle.

use super::columns::{Columns, add, add_products};
use super::relaxation::Relaxed;
use super::rows::{Rows, STRIP};
use crate::solver::worth::{self, Worth};
use crate::workers::{Workers, vectorised};

/// The last change of a group of columns.
#[derive(Clone, Debug)]
pub(super) struct Increment<const L: usize> {
    /// d, zero at rows that are fixed, and q.
    pub(super) fields: Vec<[f64; L]>,
    pub(super) charges: Vec<[f64; L]>,
    /// Whether there was a change.
    is_known: bool,
    /// How far the fields were led along it since the last step, and whether the solve under way has taken one.
    lead: [f64; L],
    has_moved: bool,
    /// By how much going ahead has lowered the energies in the solve under way, what it gains, and whether steps are followed.
    gained: f64,
    worth: Worth,
    follows: bool,
    /// What rows were relaxed by since the last step: a part of the change that ends with the next one.
    pub(super) relaxed: Relaxed<L>,
    /// xᵀK d and dᵀq of every strip, all pairs of columns.
    products: Vec<[[[f64; L]; L]; 2]>,
}

impl<const L: usize> Increment<L> {
    /// None yet, at so many nodes.
    pub(super) fn new(nodes: usize) -> Self {
        Self {
            fields: vec![[0.0; L]; nodes],
            charges: vec![[0.0; L]; nodes],
            is_known: false,
            lead: [0.0; L],
            has_moved: false,
            gained: 0.0,
            worth: Worth::default(),
            follows: false,
            relaxed: Relaxed::new(nodes),
            products: vec![[[[0.0; L]; L]; 2]; nodes.div_ceil(STRIP)],
        }
    }

    /// Forgets the last change, and all that is no number.
    pub(super) fn forget(&mut self) {
        self.fields.fill([0.0; L]);
        self.charges.fill([0.0; L]);
        self.lead = [0.0; L];
        self.is_known = false;
        self.relaxed.clear();
    }

    /// The potential of a row was set. Returns whether that changes q at its neighbours.
    pub(super) fn hold(&mut self, row: usize, lane: usize) -> bool {
        self.fields.get_mut(row).is_some_and(|fields| std::mem::take(&mut fields[lane]) != 0.0)
    }

    /// Recomputes q at some rows.
    pub(super) fn refresh(&mut self, rows: &Rows, some: &[u32]) {
        if self.is_known {
            for &row in some {
                self.charges[row as usize] = rows.product(row as usize, &self.fields, 0);
            }
        }
    }

    /// Begins a solve: leads the fields as far along the last change as lowers their energies most. Returns whether they moved.
    pub(super) fn go_ahead(&mut self, rows: &Rows, columns: &mut Columns<L>, workers: &Workers) -> bool {
        (self.has_moved, self.gained) = (false, 0.0);
        if !self.is_known {
            return false;
        }
        let [with_fields, own] = self.sum(columns, workers);
        if !with_fields.iter().chain(&own).flatten().all(|product| product.is_finite()) {
            self.forget();
            return false;
        }
        let (mut lengths, before) = ([0.0; L], trace(columns.energies()));
        for (lane, length) in lengths.iter_mut().enumerate() {
            let (slope, curvature) = (-with_fields[lane][lane], own[lane][lane]);
            let energy = columns.energies()[lane][lane];
            *length = worth::length(slope, curvature, energy, self.lead[lane]);
        }
        if lengths == [0.0; L] {
            return false;
        }
        add(&mut self.lead, &lengths);
        columns.lead(rows, [&self.fields, &self.charges], &lengths, [&with_fields, &own]);
        self.gained = before - trace(columns.energies());
        true
    }

    /// Then takes from the rows that changed what energy can be taken there. Returns whether any of them moved.
    pub(super) fn relax(&mut self, rows: &Rows, columns: &mut Columns<L>) -> bool {
        self.relaxed.relax(rows, columns)
    }

    /// Learns what going ahead is worth from what a cycle tells that there is left to gain, of all pairs of columns.
    pub(super) fn note_gains(&mut self, left: &[[f64; L]; L]) {
        if self.is_known && !self.has_moved {
            self.worth.learn(self.gained, trace(left));
        }
    }

    /// XᵀKD and DᵀKD.
    fn sum(&mut self, columns: &Columns<L>, workers: &Workers) -> [[[f64; L]; L]; 2] {
        let Self { fields, charges, products, .. } = self;
        let (fields, charges, kx) = (&**fields, &**charges, &*columns.kx);
        let size = products.len().div_ceil(workers.threads()).max(1);
        workers.for_each(products.chunks_mut(size).zip((0..).step_by(size * STRIP)), |(strips, first)| {
            vectorised(
                #[inline(always)]
                || {
                    for (products, from) in strips.iter_mut().zip((first..).step_by(STRIP)) {
                        *products = [[[0.0; L]; L]; 2];
                        let strip = from..(from + STRIP).min(fields.len());
                        let of_change = fields[strip.clone()].iter().zip(&charges[strip.clone()]);
                        for (kx, (d, q)) in kx[strip].iter().zip(of_change) {
                            add_products(&mut products[0], kx, d);
                            add_products(&mut products[1], d, q);
                        }
                    }
                },
            );
        });
        let mut sums = [[[0.0; L]; L]; 2];
        for strip in &*products {
            for (sum, part) in sums.iter_mut().flatten().flatten().zip(strip.iter().flatten().flatten()) {
                *sum += part;
            }
        }
        sums
    }

    /// Before a step: what is kept of the change, less the fields and K x as they are.
    pub(super) fn start_step(&mut self, rows: &Rows, columns: &Columns<L>) {
        let is_first = !std::mem::replace(&mut self.has_moved, true);
        if is_first {
            self.follows = self.worth.is_to_follow();
        }
        let kept = if is_first { self.lead } else { [1.0; L] };
        self.lead = [0.0; L];
        if !self.follows {
            self.is_known = false;
            self.relaxed.clear();
            return;
        }
        let take = |of: &mut [[f64; L]], from: &[[f64; L]]| {
            for (of, from) in of.iter_mut().zip(from) {
                (0..L).for_each(|lane| of[lane] = kept[lane] * of[lane] - from[lane]);
            }
        };
        take(&mut self.fields, &columns.x);
        take(&mut self.charges, &columns.kx);
        self.relaxed.hand_over(rows, &mut self.fields, &mut self.charges);
    }

    /// After it: and as they have become.
    pub(super) fn end_step(&mut self, columns: &Columns<L>) {
        if !self.follows {
            return;
        }
        let change =
            |of: &mut [[f64; L]], to: &[[f64; L]]| of.iter_mut().zip(to).for_each(|(of, to)| add(of, to));
        change(&mut self.fields, &columns.x);
        change(&mut self.charges, &columns.kx);
        self.is_known = true;
    }
}

/// The sum over all columns of what each has of its own.
fn trace<const L: usize>(of: &[[f64; L]; L]) -> f64 {
    (0..L).map(|lane| of[lane][lane]).sum()
}
