//! What fields will change by, as far as the last change tells, as on lattices (`solver::lattice::increment`): with d, the
//! change from one step to the next, and q = K d, the energy of x + c d is least at c = rᵀd / dᵀq, column by column (Fischer,
//! Comput. Methods Appl. Mech. Engrg. 163, 1998, with one vector). Nothing is moved for that: the products follow the rows that
//! change, the way down of a cycle starts from r - c q, and fields follow when they take a step.

use super::change::{Ahead, Change, ChangeProducts, Charges};
use super::columns::{Columns, add};
use super::relaxation::Relaxed;
use super::rows::Rows;
use crate::solver::worth::{self, Worth};
use crate::workers::Workers;

/// The last change of a group of columns.
#[derive(Clone, Debug)]
pub(super) struct Increment<const L: usize> {
    /// d, zero at rows that are fixed, and q.
    pub(super) fields: Vec<[f64; L]>,
    pub(super) charges: Vec<[f64; L]>,
    products: ChangeProducts<L>,
    /// Whether there was a change.
    is_known: bool,
    /// How far the fields are ahead along it, and how far they were led before the first step of the solve under way.
    ahead: [f64; L],
    led: [f64; L],
    /// Whether the solve under way has taken a step, and by how much being ahead lowered the energies before.
    has_moved: bool,
    gained: f64,
    worth: Worth,
    follows: bool,
    /// What rows were relaxed by since the last step: a part of the change that ends with the next one.
    pub(super) relaxed: Relaxed<L>,
}

impl<const L: usize> Increment<L> {
    /// None yet, at so many nodes.
    pub(super) fn new(nodes: usize) -> Self {
        Self {
            fields: vec![[0.0; L]; nodes],
            charges: vec![[0.0; L]; nodes],
            products: ChangeProducts::default(),
            is_known: false,
            ahead: [0.0; L],
            led: [0.0; L],
            has_moved: false,
            gained: 0.0,
            worth: Worth::default(),
            follows: false,
            relaxed: Relaxed::new(nodes),
        }
    }

    /// Forgets the last change, and all that is no number.
    pub(super) fn forget(&mut self) {
        self.fields.fill([0.0; L]);
        self.charges.fill([0.0; L]);
        self.products = ChangeProducts::default();
        (self.ahead, self.led) = ([0.0; L], [0.0; L]);
        self.is_known = false;
        self.relaxed.clear();
    }

    /// K x of fields, where they are ahead.
    pub(super) fn charges_of<'a>(&'a self, columns: &'a Columns<L>) -> Charges<'a, L> {
        let is_ahead = self.ahead != [0.0; L];
        let ahead = is_ahead.then_some(Ahead { charges: &self.charges, lengths: self.ahead });
        Charges { kx: &columns.kx, ahead }
    }

    /// By how much the potentials of a row are ahead.
    pub(super) fn lead_of(&self, row: usize) -> [f64; L] {
        self.fields.get(row).map_or([0.0; L], |d| times(&self.ahead, d))
    }

    /// The potential of a row was set that has such charges. Returns whether that changes q at its neighbours.
    pub(super) fn hold(&mut self, row: usize, lane: usize, kx: &[f64; L]) -> bool {
        let Some(fields) = self.fields.get_mut(row) else { return false };
        let mut gone = [0.0; L];
        gone[lane] = -std::mem::take(&mut fields[lane]);
        if gone[lane] == 0.0 {
            return false;
        }
        self.products.add_row(&gone, &self.charges[row], kx);
        true
    }

    /// d and q, to be computed anew where K changed; q is empty where there was no change.
    pub(super) fn followed(&mut self) -> (&[[f64; L]], &mut [[f64; L]]) {
        (&self.fields, if self.is_known { &mut self.charges } else { &mut [] })
    }

    /// Adds to the products what followed from that.
    pub(super) fn add_products(&mut self, more: &ChangeProducts<L>) {
        self.products.add(more);
    }

    /// Begins a solve: leads fields as far along the last change as lowers their energies most, and relaxes the rows that
    /// changed as they will be there. Returns whether that changes energies. Meanwhile another thread does what does not depend
    /// on it.
    pub(super) fn go_ahead(
        &mut self,
        rows: &Rows,
        columns: &mut Columns<L>,
        meanwhile: (&Workers, impl FnOnce() + Send),
    ) -> bool {
        self.has_moved = false;
        let before = self.ahead;
        self.lead(columns.energies());
        let Self { relaxed, products, charges, ahead, .. } = self;
        let ahead = Ahead { charges, lengths: *ahead };
        let has_relaxed = relaxed.relax(rows, columns, ahead, &mut products.with_fields, meanwhile);
        if has_relaxed {
            self.lead(columns.energies());
        }
        self.gained = -trace(&self.gain());
        has_relaxed || self.ahead != before
    }

    /// Finds how far fields of such energies are best led. Forgets a change whose products are no numbers.
    fn lead(&mut self, energies: &[[f64; L]; L]) {
        self.ahead = [0.0; L];
        let ChangeProducts { with_fields, own } = &self.products;
        if !with_fields.iter().chain(own).flatten().all(|product| product.is_finite()) {
            self.forget();
        } else if self.is_known {
            for (lane, ahead) in self.ahead.iter_mut().enumerate() {
                let (slope, curvature) = (-with_fields[lane][lane], own[lane][lane]);
                *ahead = worth::length(slope, curvature, energies[lane][lane], 0.0);
            }
        }
    }

    /// What being ahead changes the energies by.
    pub(super) fn gain(&self) -> [[f64; L]; L] {
        let ChangeProducts { with_fields, own } = &self.products;
        let ahead = &self.ahead;
        let of_pair = |s: usize, t: usize| {
            let linear = ahead[s] * with_fields[s][t] + ahead[t] * with_fields[t][s];
            linear + ahead[s] * ahead[t] * own[s][t]
        };
        std::array::from_fn(|s| std::array::from_fn(|t| of_pair(s, t)))
    }

    /// Learns what going ahead is worth from what a cycle tells that there is left to gain, of all pairs of columns.
    pub(super) fn note_gains(&mut self, left: &[[f64; L]; L]) {
        if self.is_known && !self.has_moved {
            self.worth.learn(self.gained, trace(left));
        }
    }

    /// Moves fields to where they are ahead, and their charges where they are of use still.
    pub(super) fn catch_up(&mut self, x: &mut [[f64; L]], kx: &mut [[f64; L]]) {
        if self.ahead == [0.0; L] {
            return;
        }
        let ahead = std::mem::replace(&mut self.ahead, [0.0; L]);
        add(&mut self.led, &ahead);
        let lead = |to: &mut [[f64; L]], along: &[[f64; L]]| {
            for (to, along) in to.iter_mut().zip(along) {
                (0..L).for_each(|lane| to[lane] += ahead[lane] * along[lane]);
            }
        };
        lead(x, &self.fields);
        lead(kx, &self.charges);
        let ChangeProducts { with_fields, own } = &mut self.products;
        for (with_fields, own) in with_fields.iter_mut().zip(own) {
            add(with_fields, &times(&ahead, own));
        }
    }

    /// Before a step.
    pub(super) fn start_step(&mut self) -> Change<'_, L> {
        let is_first = !std::mem::replace(&mut self.has_moved, true);
        if is_first {
            self.follows = self.worth.is_to_follow();
        }
        self.is_known = false;
        let lead = std::mem::replace(&mut self.ahead, [0.0; L]);
        let rest = if is_first { std::mem::replace(&mut self.led, [0.0; L]) } else { [1.0; L] };
        if !self.follows {
            self.relaxed.clear();
        }
        let leads = lead != [0.0; L];
        Change {
            fields: if self.follows || leads { &mut self.fields } else { &mut [] },
            charges: if self.follows { &mut self.charges } else { &mut [] },
            lead,
            rest,
        }
    }

    /// After it: takes its products with fields that have such charges.
    pub(super) fn end_step(&mut self, rows: &Rows, products: &ChangeProducts<L>, kx: &[[f64; L]]) {
        if !self.follows {
            return;
        }
        let Self { fields, charges, relaxed, .. } = self;
        self.products = *products;
        relaxed.hand_over(rows, [fields, charges], kx, &mut self.products);
        self.is_known = true;
    }
}

/// The sum over all columns of what each has of its own.
fn trace<const L: usize>(of: &[[f64; L]; L]) -> f64 {
    (0..L).map(|lane| of[lane][lane]).sum()
}

#[inline(always)]
fn times<const L: usize>(a: &[f64; L], b: &[f64; L]) -> [f64; L] {
    std::array::from_fn(|lane| a[lane] * b[lane])
}
