//! Rows in which K x is not what K and x say, and what becomes of K x and of sums over it when they are computed anew. Threads
//! share the rows.

use super::change::ChangeProducts;
use super::columns::{Columns, add, add_change, evaluate_strip};
use super::increment::Increment;
use super::rows::{ROWS_OF_A_TASK, Rows};
use crate::instructions::vectorised_by_eight;
use crate::occupancy::IndexList;
use crate::workers::Workers;

/// A list of rows.
#[derive(Clone, Debug)]
pub(super) struct Stale<const L: usize> {
    rows: IndexList,
    /// What each task changes: sums are made by task and added in the order of the rows.
    partial: Vec<Changed<L>>,
}

/// What computing rows anew changes: XᵀKX, and the products of the change that is followed.
#[derive(Clone, Copy, Debug)]
struct Changed<const L: usize> {
    energies: [[f64; L]; L],
    products: ChangeProducts<L>,
}

impl<const L: usize> Default for Changed<L> {
    fn default() -> Self {
        Self { energies: [[0.0; L]; L], products: ChangeProducts::default() }
    }
}

impl<const L: usize> Changed<L> {
    fn add(&mut self, other: &Self) {
        self.energies.iter_mut().zip(&other.energies).for_each(|(sum, other)| add(sum, other));
        self.products.add(&other.products);
    }
}

impl<const L: usize> Stale<L> {
    /// None, of so many rows.
    pub(super) fn below(rows: usize) -> Self {
        Self { rows: IndexList::below(rows), partial: Vec::new() }
    }

    pub(super) fn insert(&mut self, row: u32) {
        self.rows.insert(row as usize);
    }

    pub(super) fn clear(&mut self) {
        self.rows.clear();
    }

    pub(super) fn len(&self) -> usize {
        self.rows.numbers().len()
    }

    /// Puts them in order, before they are evaluated.
    pub(super) fn sort(&mut self) {
        self.rows.sort();
    }

    /// Computes K x at these rows and at all objects, the charges of the change that is followed, and the sums over both.
    pub(super) fn evaluate(
        &mut self,
        rows: &Rows,
        columns: &mut Columns<L>,
        increment: &mut Increment<L>,
        workers: &Workers,
    ) {
        let Self { rows: stale, partial } = self;
        let stale = stale.numbers();
        partial.clear();
        partial.resize(stale.len().div_ceil(ROWS_OF_A_TASK), Changed::default());
        let (fields, mut charges) = increment.followed();
        let (x, mut kx) = columns.parts();
        let (x, objects) = x.split_at(rows.len());
        let mut first = 0;
        let tasks = stale.chunks(ROWS_OF_A_TASK).zip(partial.iter_mut()).map(|(stale, changed)| {
            let end = stale[stale.len() - 1] as usize + 1;
            let count = end - std::mem::replace(&mut first, end);
            let kx = kx.split_off_mut(..count).unwrap_or_default();
            let q = charges.split_off_mut(..count).unwrap_or_default();
            (stale, changed, end - count, kx, q)
        });
        workers.for_each(tasks, |(stale, changed, first, kx, q)| {
            vectorised_by_eight(
                #[inline(always)]
                || {
                    for row in stale.iter().map(|&row| row as usize) {
                        let at = row - first;
                        let before = kx[at];
                        evaluate_strip(rows, x, 0, objects, &mut kx[at..=at], row);
                        add_change(&mut changed.energies, &x[row], &before, &kx[at]);
                        if let Some(q) = q.get_mut(at) {
                            changed.products.add_row(&fields[row].map(|d| -d), q, &before);
                            *q = rows.product(row, fields, 0);
                            changed.products.add_row(&fields[row], q, &kx[at]);
                        }
                    }
                },
            );
        });
        let mut sum = Changed::default();
        partial.iter().for_each(|changed| sum.add(changed));
        increment.add_products(&sum.products);
        columns.add_energies(&sum.energies);
        columns.refresh_objects(rows);
    }
}
