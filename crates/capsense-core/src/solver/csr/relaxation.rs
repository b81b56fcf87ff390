//! Relaxation around the rows that changed: each takes the potential that its neighbours ask for, one after the other.
//!
//! Where a body comes or goes there is far too much energy in very few rows (`solver::lattice::relaxation`). Taken away where
//! it is, it needs no step of all fields. A row that is relaxed pushes what it has too much on to its neighbours, so those of
//! them that have too much then come next (after Southwell, Relaxation Methods in Engineering Science, Oxford 1940).
//!
//! Each turn depends on those before, so one thread has them all, while another does what does not depend on them. Measured with two
//! threads that share the rows, and those at the border between their regions last: no faster, as it leaves what is done
//! meanwhile to one of them.

use super::change::{Ahead, ChangeProducts};
use super::columns::{Columns, add, add_products, add_raise};
use super::rows::Rows;
use crate::workers::Workers;

/// How many rows have a turn, for each that changed.
const TURNS: usize = 6;

/// Rows are left as they are where as many as changed would together take no more than this part of any column's energy.
const LEAST_GAIN: f64 = 3e-5;

/// Where more than one row in so many has changed, the fields are another scene's.
const FEW: usize = 4;

/// Rows that were relaxed since fields took their last step.
#[derive(Clone, Debug)]
pub(super) struct Relaxed<const L: usize> {
    /// Each as often as it was, and by how much; no more than there are rows. What is beyond them a change lacks.
    rows: Vec<(u32, [f64; L])>,
    /// Whether each row has a turn to come.
    waits: Vec<bool>,
    /// Whether each is in the list since a frame began.
    is_listed: Vec<bool>,
    turns: Turns<L>,
}

/// Rows in the order of their turns, and what these made of them.
#[derive(Clone, Debug)]
struct Turns<const L: usize> {
    queue: Vec<u32>,
    /// Rows that had a turn, with their potentials before.
    listed: Vec<(u32, [f64; L])>,
    /// What the energies and the change's products with K x are more.
    energies: [[f64; L]; L],
    with_fields: [[f64; L]; L],
}

/// What turns follow from.
struct Rule<'a, const L: usize> {
    rows: &'a Rows,
    ahead: Ahead<'a, L>,
    /// What a row may take of each column's energy without a turn.
    allowed: [f64; L],
}

impl<const L: usize> Turns<L> {
    /// Room for as many as so many changed rows have.
    fn new(changed: usize) -> Self {
        Self {
            queue: Vec::with_capacity(TURNS * changed),
            listed: Vec::with_capacity(changed),
            energies: [[0.0; L]; L],
            with_fields: [[0.0; L]; L],
        }
    }

    fn clear(&mut self) {
        self.queue.clear();
        self.listed.clear();
        (self.energies, self.with_fields) = ([[0.0; L]; L], [[0.0; L]; L]);
    }
}

impl<const L: usize> Rule<'_, L> {
    fn residual(&self, row: usize, kx: &[f64; L]) -> [f64; L] {
        self.ahead.charge(kx, row).map(|charge| -charge)
    }

    /// Whether a row has too much energy to be left as it is.
    fn has_turn(&self, row: usize, kx: &[f64; L]) -> bool {
        let of_lanes = self.residual(row, kx).into_iter().zip(&self.allowed);
        let diagonal = self.rows.diagonal()[row];
        !self.rows.fixed()[row]
            && of_lanes.fold(false, |any, (r, allowed)| any | (r * r > allowed * diagonal))
    }
}

impl<const L: usize> Relaxed<L> {
    /// None yet, of so many.
    pub(super) fn new(rows: usize) -> Self {
        let changed = rows / FEW;
        Self {
            rows: Vec::with_capacity(rows),
            waits: vec![false; rows],
            is_listed: vec![false; rows],
            turns: Turns::new(changed),
        }
    }

    /// How many there are.
    #[cfg(test)]
    pub(super) fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether all turns were had.
    #[cfg(test)]
    pub(super) fn is_done(&self) -> bool {
        !self.waits.contains(&true) && !self.is_listed.contains(&true)
    }

    /// Forgets them.
    pub(super) fn clear(&mut self) {
        self.rows.clear();
    }

    /// Relaxes free rows from those on that changed last, as they are where fields are ahead. Follows the products of the
    /// change that they are led on by with K x. Returns whether any row was relaxed. Meanwhile another thread does what does
    /// not depend on it.
    pub(super) fn relax(
        &mut self,
        rows: &Rows,
        columns: &mut Columns<L>,
        ahead: Ahead<'_, L>,
        with_fields: &mut [[f64; L]; L],
        (workers, meanwhile): (&Workers, impl FnOnce() + Send),
    ) -> bool {
        let changed = rows.changed();
        if changed.is_empty() || FEW * changed.len() > rows.len() {
            meanwhile();
            return false;
        }
        let least = LEAST_GAIN / changed.len() as f64;
        let rule = Rule { rows, ahead, allowed: columns.own_energies().map(|energy| least * energy) };
        self.turns.clear();
        workers.both(|| self.have_turns(&rule, columns, changed), meanwhile);
        columns.add_energies(&self.turns.energies);
        with_fields.iter_mut().zip(&self.turns.with_fields).for_each(|(sum, more)| add(sum, more));
        let has_moved = !self.turns.listed.is_empty();
        self.compare(columns);
        if has_moved {
            columns.evaluate_objects(rows);
        }
        has_moved
    }

    /// Relaxes some rows, and neighbours of theirs while not too many have had a turn.
    fn have_turns(&mut self, rule: &Rule<'_, L>, columns: &mut Columns<L>, changed: &[u32]) {
        let Self { waits, is_listed, turns, .. } = self;
        let Columns { x, kx, .. } = columns;
        let (rows, most) = (rule.rows, TURNS * changed.len());
        turns.queue.extend(changed);
        changed.iter().for_each(|&row| waits[row as usize] = true);
        let mut turn = 0;
        while let Some(&row) = turns.queue.get(turn) {
            let row = row as usize;
            turn += 1;
            waits[row] = false;
            if !rule.has_turn(row, &kx[row]) {
                continue;
            }
            if !std::mem::replace(&mut is_listed[row], true) {
                turns.listed.push((row as u32, x[row]));
            }
            let inverse = rows.diagonal()[row].recip();
            let by = rule.residual(row, &kx[row]).map(|residual| residual * inverse);
            add_raise(&mut turns.energies, &kx[row], rows.diagonal()[row], &by);
            add(&mut x[row], &by);
            rows.add_charges(row, &by, kx);
            add_products(&mut turns.with_fields, &rule.ahead.charges[row], &by);
            for &other in rows.row(row).0 {
                let at = other as usize;
                if turns.queue.len() < most && !waits[at] && rule.has_turn(at, &kx[at]) {
                    waits[at] = true;
                    turns.queue.push(other);
                }
            }
        }
    }

    /// Takes over by how much the potentials of rows in the lists are others now.
    fn compare(&mut self, columns: &Columns<L>) {
        for (row, before) in self.turns.listed.drain(..) {
            let now = &columns.x[row as usize];
            self.is_listed[row as usize] = false;
            if self.rows.len() < self.waits.len() {
                self.rows.push((row, std::array::from_fn(|lane| now[lane] - before[lane])));
            }
        }
    }

    /// Adds to a change of the fields, to its charges and to its products, what rows were relaxed by, and forgets them.
    pub(super) fn hand_over(
        &mut self,
        rows: &Rows,
        [fields, charges]: [&mut [[f64; L]]; 2],
        kx: &[[f64; L]],
        products: &mut ChangeProducts<L>,
    ) {
        for (row, by) in self.rows.drain(..) {
            let row = row as usize;
            if rows.fixed()[row] {
                // A conductor holds it by now.
                continue;
            }
            add_products(&mut products.with_fields, &by, &kx[row]);
            add_raise(&mut products.own, &charges[row], rows.diagonal()[row], &by);
            add(&mut fields[row], &by);
            rows.add_charges(row, &by, charges);
        }
    }
}
