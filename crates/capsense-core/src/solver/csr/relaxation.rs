//! Relaxation around the rows that changed: each takes the potential that its neighbours ask for, one after the other.
//!
//! Where a body comes or goes there is far too much energy in very few rows (`solver::lattice::relaxation`). Taken away where
//! it is, it needs no step of all fields. A row that is relaxed pushes what it has too much on to its neighbours, so those of
//! them that have too much then come next (after Southwell, Relaxation Methods in Engineering Science, Oxford 1940).

use super::change::{Ahead, ChangeProducts};
use super::columns::{Columns, add, add_products, add_raise};
use super::rows::Rows;

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
    /// Rows in the order of their turns, and whether each has one to come.
    queue: Vec<u32>,
    waits: Vec<bool>,
    /// Whether each is in the list since a frame began.
    is_listed: Vec<bool>,
}

impl<const L: usize> Relaxed<L> {
    /// None yet, of so many.
    pub(super) fn new(rows: usize) -> Self {
        Self {
            rows: Vec::with_capacity(rows),
            queue: Vec::with_capacity(rows / FEW * TURNS),
            waits: vec![false; rows],
            is_listed: vec![false; rows],
        }
    }

    /// How many there are.
    #[cfg(test)]
    pub(super) fn len(&self) -> usize {
        self.rows.len()
    }

    /// Forgets them.
    pub(super) fn clear(&mut self) {
        self.rows.clear();
    }

    /// Relaxes free rows from those on that changed last, as they are where fields are ahead. Follows the products of the
    /// change that they are led on by with K x. Returns whether any row was relaxed.
    pub(super) fn relax(
        &mut self,
        rows: &Rows,
        columns: &mut Columns<L>,
        ahead: Ahead<'_, L>,
        with_fields: &mut [[f64; L]; L],
    ) -> bool {
        let changed = rows.changed();
        if changed.is_empty() || FEW * changed.len() > rows.len() {
            return false;
        }
        let least = LEAST_GAIN / changed.len() as f64;
        let allowed = columns.own_energies().map(|energy| least * energy);
        let residual =
            |columns: &Columns<L>, row: usize| ahead.charge(&columns.kx[row], row).map(|charge| -charge);
        let has_turn = |columns: &Columns<L>, row: usize| {
            let of_lanes = residual(columns, row).into_iter().zip(&allowed);
            let diagonal = rows.diagonal()[row];
            !rows.fixed()[row] && of_lanes.fold(false, |any, (r, allowed)| any | (r * r > allowed * diagonal))
        };
        let listed_before = self.rows.len();
        let mut has_moved = false;
        self.queue.clear();
        changed.iter().for_each(|&row| self.enter(row));
        let most = TURNS * changed.len();
        let mut turn = 0;
        while let Some(&row) = self.queue.get(turn) {
            let row = row as usize;
            turn += 1;
            self.waits[row] = false;
            if !has_turn(columns, row) {
                continue;
            }
            self.list(row, &columns.x[row]);
            let inverse = rows.diagonal()[row].recip();
            let by = residual(columns, row).map(|residual| residual * inverse);
            columns.raise(rows, row, &by);
            add_products(with_fields, &ahead.charges[row], &by);
            has_moved = true;
            for &other in rows.row(row).0 {
                if self.queue.len() < most && !self.waits[other as usize] && has_turn(columns, other as usize)
                {
                    self.enter(other);
                }
            }
        }
        self.compare(listed_before, columns);
        if has_moved {
            columns.evaluate_objects(rows);
        }
        has_moved
    }

    /// The last one to have a turn.
    fn enter(&mut self, row: u32) {
        self.waits[row as usize] = true;
        self.queue.push(row);
    }

    /// Notes what the potential of a row is before it is relaxed for the first time.
    fn list(&mut self, row: usize, before: &[f64; L]) {
        if self.rows.len() < self.is_listed.len() && !std::mem::replace(&mut self.is_listed[row], true) {
            self.rows.push((row as u32, *before));
        }
    }

    /// Makes of potentials before, from some on, by how much they are others now.
    fn compare(&mut self, from: usize, columns: &Columns<L>) {
        for (row, by) in &mut self.rows[from..] {
            let now = &columns.x[*row as usize];
            self.is_listed[*row as usize] = false;
            (0..L).for_each(|lane| by[lane] = now[lane] - by[lane]);
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
