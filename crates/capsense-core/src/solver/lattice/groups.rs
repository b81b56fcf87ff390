//! Columns of single nodes, four of them side by side.
//!
//! Vectors have their columns far apart, for whole planes are worked on in each. Where nodes are worked on one by one, columns
//! are what can be computed at once.

use super::layout::Layout;
use glam::Vec4;
use std::ops::Range;

/// So many columns are one group.
pub(super) const GROUP: usize = 4;

/// Some columns. Where there are too few, the last stands for those that are missing too: it is computed several times with
/// the same result, which takes less than to look how many there are.
#[derive(Clone, Debug)]
pub(super) struct Group {
    columns: [usize; GROUP],
    /// How far they are behind the first of all.
    shifts: [usize; GROUP],
}

impl Group {
    /// All groups of the columns of a layout.
    pub(super) fn all(layout: &Layout) -> Vec<Self> {
        let group = |first: usize| {
            let columns = [0, 1, 2, 3].map(|column| (first + column).min(layout.columns - 1));
            Self { columns, shifts: columns.map(|column| layout.in_column(column, 0)) }
        };
        (0..layout.columns).step_by(GROUP).map(group).collect()
    }

    /// Its columns, each once.
    pub(super) fn columns(&self) -> Range<usize> {
        self.columns[0]..self.columns[GROUP - 1] + 1
    }

    /// Something of each column.
    #[inline(always)]
    pub(super) fn of_columns(&self, of: impl Fn(usize) -> f32) -> Vec4 {
        let [a, b, c, d] = self.columns;
        Vec4::new(of(a), of(b), of(c), of(d))
    }

    /// What a node has in a vector, where it is at such a place in the first column of all.
    #[inline(always)]
    pub(super) fn gather<T: Copy>(&self, of: &[T], first: usize) -> [T; GROUP] {
        let [a, b, c, d] = self.shifts;
        [of[first + a], of[first + b], of[first + c], of[first + d]]
    }

    /// Where a node is in each column, if it is at such a place in the first of all.
    pub(super) fn places(&self, first: usize) -> impl Iterator<Item = usize> {
        self.shifts.into_iter().take(self.columns().len()).map(move |shift| first + shift)
    }

    /// The opposite of [`Group::gather`].
    #[inline(always)]
    pub(super) fn scatter(&self, to: &mut [f32], first: usize, values: Vec4) {
        for (shift, value) in self.shifts.into_iter().zip(values.to_array()) {
            to[first + shift] = value;
        }
    }
}
