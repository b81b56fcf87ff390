//! Relaxation around the rows that changed: each takes the potential that its neighbours ask for, one after the other.
//!
//! Where a body comes or goes there is far too much energy in very few rows (`solver::lattice::relaxation`). Taken away where
//! it is, it needs no step of all fields. A row that is relaxed pushes what it has too much on to its neighbours, so those of
//! them that have too much then come next (after Southwell, Relaxation Methods in Engineering Science, Oxford 1940).
//!
//! Rows of two regions do not see each other but at the border between these, so two threads share them, and rows at the border
//! come last. Where the border is depends on which rows changed, not on the threads.

use super::change::{Ahead, ChangeProducts};
use super::columns::{Columns, add, add_products, add_raise};
use super::rows::{Rows, STRIP};
use crate::workers::Workers;

/// How many rows have a turn, for each that changed.
const TURNS: usize = 6;

/// Rows are left as they are where as many as changed would together take no more than this part of any column's energy.
const LEAST_GAIN: f64 = 3e-5;

/// Where more than one row in so many has changed, the fields are another scene's.
const FEW: usize = 4;

/// Of the rows that changed, the first region has so many in eight: the thread that has the second one has something else to do.
const OF_FIRST_REGION: usize = 7;

/// Rows that were relaxed since fields took their last step.
#[derive(Clone, Debug)]
pub(super) struct Relaxed<const L: usize> {
    /// Each as often as it was, and by how much; no more than there are rows. What is beyond them a change lacks.
    rows: Vec<(u32, [f64; L])>,
    /// Whether each row has a turn to come.
    waits: Vec<bool>,
    /// Whether each is in a list since a frame began.
    is_listed: Vec<bool>,
    /// Of both regions, and of the border.
    turns: [Turns<L>; 3],
}

/// Rows in the order of their turns, and what these made of the region.
#[derive(Clone, Debug)]
struct Turns<const L: usize> {
    queue: Vec<u32>,
    /// Rows whose turn comes when both regions are done, as they are coupled to both.
    at_border: Vec<u32>,
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

/// Successive rows from `first` on.
struct Region<'a, const L: usize> {
    first: usize,
    x: &'a mut [[f64; L]],
    kx: &'a mut [[f64; L]],
    waits: &'a mut [bool],
    is_listed: &'a mut [bool],
}

/// How many of so many rows the first region has.
fn of_first_region(changed: usize) -> usize {
    (OF_FIRST_REGION * changed).div_ceil(8)
}

impl<const L: usize> Turns<L> {
    /// Room for as many as so many changed rows have.
    fn new(changed: usize) -> Self {
        Self {
            queue: Vec::with_capacity(TURNS * changed),
            at_border: Vec::new(),
            listed: Vec::with_capacity(changed),
            energies: [[0.0; L]; L],
            with_fields: [[0.0; L]; L],
        }
    }

    fn clear(&mut self) {
        self.queue.clear();
        self.at_border.clear();
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

impl<'a, const L: usize> Region<'a, L> {
    /// All rows.
    fn of(
        rows: &Rows,
        columns: &'a mut Columns<L>,
        waits: &'a mut [bool],
        is_listed: &'a mut [bool],
    ) -> Self {
        let Columns { x, kx, .. } = columns;
        Region { first: 0, x: &mut x[..rows.len()], kx: &mut kx[..rows.len()], waits, is_listed }
    }

    /// The rows before one, and those from it on.
    fn split_at(self, row: usize) -> [Self; 2] {
        let at = row - self.first;
        let (x, kx) = (self.x.split_at_mut(at), self.kx.split_at_mut(at));
        let (waits, is_listed) = (self.waits.split_at_mut(at), self.is_listed.split_at_mut(at));
        [
            Region { first: self.first, x: x.0, kx: kx.0, waits: waits.0, is_listed: is_listed.0 },
            Region { first: row, x: x.1, kx: kx.1, waits: waits.1, is_listed: is_listed.1 },
        ]
    }

    /// Relaxes some rows, and neighbours of theirs while there are fewer than `most` turns.
    fn relax(mut self, rule: &Rule<'_, L>, turns: &mut Turns<L>, from: &[u32], most: usize) {
        let rows = rule.rows;
        from.iter().for_each(|&row| self.enter(rows, turns, row));
        let mut turn = 0;
        while let Some(&row) = turns.queue.get(turn) {
            let row = row as usize;
            let at = row - self.first;
            turn += 1;
            self.waits[at] = false;
            if !rule.has_turn(row, &self.kx[at]) {
                continue;
            }
            self.list(turns, row);
            let inverse = rows.diagonal()[row].recip();
            let by = rule.residual(row, &self.kx[at]).map(|residual| residual * inverse);
            add_raise(&mut turns.energies, &self.kx[at], rows.diagonal()[row], &by);
            add(&mut self.x[at], &by);
            rows.add_charges(row, &by, self.kx, self.first);
            add_products(&mut turns.with_fields, &rule.ahead.charges[row], &by);
            for &other in rows.row(row).0 {
                let at = other as usize - self.first;
                if turns.queue.len() < most && !self.waits[at] && rule.has_turn(other as usize, &self.kx[at])
                {
                    self.enter(rows, turns, other);
                }
            }
        }
    }

    /// The last one to have a turn, here or at the border.
    fn enter(&mut self, rows: &Rows, turns: &mut Turns<L>, row: u32) {
        self.waits[row as usize - self.first] = true;
        let region = self.first..self.first + self.x.len();
        let reach = rows.reach(row as usize / STRIP);
        let is_within = reach.start >= region.start && reach.end <= region.end
            || rows.row(row as usize).0.iter().all(|&other| region.contains(&(other as usize)));
        if is_within {
            turns.queue.push(row);
        } else {
            turns.at_border.push(row);
        }
    }

    /// Notes what the potential of a row is before it is relaxed for the first time.
    fn list(&mut self, turns: &mut Turns<L>, row: usize) {
        let at = row - self.first;
        if !std::mem::replace(&mut self.is_listed[at], true) {
            turns.listed.push((row as u32, self.x[at]));
        }
    }
}

impl<const L: usize> Relaxed<L> {
    /// None yet, of so many.
    pub(super) fn new(rows: usize) -> Self {
        let changed = rows / FEW;
        let of_first = of_first_region(changed);
        Self {
            rows: Vec::with_capacity(rows),
            waits: vec![false; rows],
            is_listed: vec![false; rows],
            // Few are at the border.
            turns: [of_first, changed - of_first, 0].map(Turns::new),
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
        let Self { waits, is_listed, turns, .. } = self;
        turns.iter_mut().for_each(Turns::clear);
        let [first, second, border] = turns;
        let (of_first, of_second) = changed.split_at(of_first_region(changed.len()));
        let cut = of_second.first().map_or(rows.len(), |&row| row as usize);
        let [below, above] = Region::of(rows, columns, waits, is_listed).split_at(cut);
        let relax_second = || {
            meanwhile();
            above.relax(&rule, second, of_second, TURNS * of_second.len());
        };
        workers.both(|| below.relax(&rule, first, of_first, TURNS * of_first.len()), relax_second);
        first.at_border.append(&mut second.at_border);
        let left = (TURNS * changed.len()).saturating_sub(first.queue.len() + second.queue.len());
        Region::of(rows, columns, waits, is_listed).relax(&rule, border, &first.at_border, left);
        let mut has_moved = false;
        for of in &self.turns {
            columns.add_energies(&of.energies);
            with_fields.iter_mut().zip(&of.with_fields).for_each(|(sum, more)| add(sum, more));
            has_moved |= !of.listed.is_empty();
        }
        self.compare(columns);
        if has_moved {
            columns.evaluate_objects(rows);
        }
        has_moved
    }

    /// Takes over by how much the potentials of rows in the lists are others now.
    fn compare(&mut self, columns: &Columns<L>) {
        for (row, before) in self.turns.iter_mut().flat_map(|turns| turns.listed.drain(..)) {
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
            rows.add_charges(row, &by, charges, 0);
        }
    }
}
