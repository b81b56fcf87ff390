//! A change that fields are led on by: what a step makes of it, and what is where fields are ahead along it.

use super::columns::{add, add_products};
use std::ops::Range;

/// DᵀKX and DᵀKD of a change D of the fields.
#[derive(Clone, Copy, Debug)]
pub(super) struct ChangeProducts<const L: usize> {
    pub(super) with_fields: [[f64; L]; L],
    pub(super) own: [[f64; L]; L],
}

impl<const L: usize> Default for ChangeProducts<L> {
    fn default() -> Self {
        Self { with_fields: [[0.0; L]; L], own: [[0.0; L]; L] }
    }
}

impl<const L: usize> ChangeProducts<L> {
    /// Takes in one row of D, K D and K X.
    #[inline(always)]
    pub(super) fn add_row(&mut self, d: &[f64; L], q: &[f64; L], kx: &[f64; L]) {
        add_products(&mut self.with_fields, d, kx);
        add_products(&mut self.own, d, q);
    }

    pub(super) fn add(&mut self, other: &Self) {
        self.with_fields.iter_mut().zip(&other.with_fields).for_each(|(sum, other)| add(sum, other));
        self.own.iter_mut().zip(&other.own).for_each(|(sum, other)| add(sum, other));
    }
}

/// The last change of the fields, and how a step takes it along.
pub(super) struct Change<'a, const L: usize> {
    /// d, or nothing where fields are not led on and steps not followed.
    pub(super) fields: &'a mut [[f64; L]],
    /// q = K d, or nothing where steps are not followed.
    pub(super) charges: &'a mut [[f64; L]],
    /// How far fields are led along it.
    pub(super) lead: [f64; L],
    /// What of it the next change has beside all that fields move by.
    pub(super) rest: [f64; L],
}

impl<const L: usize> Change<'_, L> {
    /// Fields stand, and no step is followed.
    pub(super) fn none() -> Self {
        Change { fields: &mut [], charges: &mut [], lead: [0.0; L], rest: [0.0; L] }
    }

    pub(super) fn is_followed(&self) -> bool {
        !self.charges.is_empty()
    }

    /// Cuts it into slabs of a number of rows.
    pub(super) fn cut(&mut self, size: usize) -> impl Iterator<Item = Change<'_, L>> {
        let (lead, rest) = (self.lead, self.rest);
        let vectors = slabs(self.fields, size).zip(slabs(self.charges, size));
        vectors.map(move |(fields, charges)| Change { fields, charges, lead, rest })
    }

    /// Before K x of some rows is computed.
    #[inline(always)]
    pub(super) fn take_charges(&mut self, rows: Range<usize>, kx: &[[f64; L]]) {
        if self.is_followed() {
            for (q, kx) in self.charges[rows].iter_mut().zip(kx) {
                (0..L).for_each(|lane| q[lane] = self.rest[lane] * q[lane] - kx[lane]);
            }
        }
    }

    /// And after.
    #[inline(always)]
    pub(super) fn give_charges(&mut self, rows: Range<usize>, kx: &[[f64; L]]) -> ChangeProducts<L> {
        let mut products = ChangeProducts::default();
        if self.is_followed() {
            let of_change = self.fields[rows.clone()].iter().zip(&mut self.charges[rows]);
            for ((d, q), kx) in of_change.zip(kx) {
                add(q, kx);
                products.add_row(d, q, kx);
            }
        }
        products
    }
}

/// Pieces of some size, and nothing, again and again, once all are given.
fn slabs<T>(mut of: &mut [T], size: usize) -> impl Iterator<Item = &mut [T]> {
    std::iter::repeat_with(move || {
        let size = size.min(of.len());
        let (slab, rest) = std::mem::take(&mut of).split_at_mut(size);
        of = rest;
        slab
    })
}

/// q, and how far fields are ahead along d.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ahead<'a, const L: usize> {
    pub(super) charges: &'a [[f64; L]],
    pub(super) lengths: [f64; L],
}

/// K x of fields, and where they are ahead of that.
#[derive(Clone, Copy, Debug)]
pub(super) struct Charges<'a, const L: usize> {
    pub(super) kx: &'a [[f64; L]],
    pub(super) ahead: Option<Ahead<'a, L>>,
}

impl<const L: usize> Ahead<'_, L> {
    /// K x of a row, where fields are ahead.
    #[inline(always)]
    pub(super) fn charge(&self, kx: &[f64; L], row: usize) -> [f64; L] {
        let (mut charge, q) = (*kx, &self.charges[row]);
        for lane in 0..L {
            charge[lane] += self.lengths[lane] * q[lane];
        }
        charge
    }
}

impl<const L: usize> Charges<'_, L> {
    /// Those of a row.
    pub(super) fn at(&self, row: usize) -> [f64; L] {
        let kx = self.kx[row];
        self.ahead.map_or(kx, |ahead| ahead.charge(&kx, row))
    }
}
