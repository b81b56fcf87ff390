//! Incomplete Cholesky factors without fill: K ≈ L D Lᵀ with L on the pattern of K.

use super::rows::Rows;
use crate::solver::workers::vectorised;

/// A pivot below this part of the diagonal would blow the factors up; the diagonal takes its place.
const SMALLEST_PIVOT: f64 = 1e-3;

/// Marks a column that the row at hand does not have.
const NONE: u32 = u32::MAX;

/// The factors. L has ones on its diagonal, which are not stored.
#[derive(Clone, Debug)]
pub(super) struct IncompleteCholesky {
    offsets: Vec<u32>,
    /// In increasing order in each row.
    columns: Vec<u32>,
    values: Vec<f32>,
    pivots: Vec<f64>,
    /// Zero where the potential is fixed.
    inverse_pivots: Vec<f32>,
    /// Where the row at hand has each column.
    place: Vec<u32>,
    /// L D of the row at hand.
    scaled: Vec<f64>,
}

impl IncompleteCholesky {
    pub(super) fn new(rows: &Rows) -> Self {
        let (mut offsets, mut columns): (Vec<u32>, Vec<u32>) = (vec![0], Vec::new());
        for row in 0..rows.len() {
            let start = columns.len();
            columns.extend(rows.row(row).0.iter().filter(|&&column| (column as usize) < row));
            columns[start..].sort_unstable();
            offsets.push(columns.len() as u32);
        }
        Self {
            offsets,
            values: vec![0.0; columns.len()],
            columns,
            pivots: vec![0.0; rows.len()],
            inverse_pivots: vec![0.0; rows.len()],
            place: vec![NONE; rows.len()],
            scaled: Vec::new(),
        }
    }

    /// Factorises from the first changed row on; what comes before does not depend on it.
    pub(super) fn refresh(&mut self, rows: &Rows) {
        let first = rows.changed().iter().min().map_or(rows.len(), |&row| row as usize);
        (first..rows.len()).for_each(|row| self.factorise_row(rows, row));
    }

    fn factorise_row(&mut self, rows: &Rows, row: usize) {
        let own = self.entries(row);
        let fixed = rows.fixed();
        self.scaled.clear();
        self.scaled.resize(own.len(), 0.0);
        for (&column, at) in self.columns[own.clone()].iter().zip(0..) {
            self.place[column as usize] = at;
        }
        let (columns, weights) = rows.row(row);
        for (&column, &weight) in columns.iter().zip(weights) {
            if (column as usize) < row && !fixed[row] && !fixed[column as usize] {
                self.scaled[self.place[column as usize] as usize] = -weight;
            }
        }
        let mut pivot = rows.diagonal()[row];
        for at in 0..own.len() {
            let column = self.columns[own.start + at] as usize;
            for entry in self.entries(column) {
                let shared = self.place[self.columns[entry] as usize];
                if shared != NONE {
                    self.scaled[at] -= self.scaled[shared as usize] * f64::from(self.values[entry]);
                }
            }
            let value = self.scaled[at] / self.pivots[column];
            pivot -= self.scaled[at] * value;
            self.values[own.start + at] = value as f32;
        }
        for &column in &self.columns[own] {
            self.place[column as usize] = NONE;
        }
        let diagonal = rows.diagonal()[row];
        self.pivots[row] = if pivot > SMALLEST_PIVOT * diagonal { pivot } else { diagonal };
        self.inverse_pivots[row] = if fixed[row] { 0.0 } else { (1.0 / self.pivots[row]) as f32 };
    }

    #[inline(always)]
    fn entries(&self, row: usize) -> std::ops::Range<usize> {
        self.offsets[row] as usize..self.offsets[row + 1] as usize
    }

    /// z = (L D Lᵀ)⁻¹ (-kx), and the columns' zᵀ(-kx).
    pub(super) fn apply<const L: usize>(&self, kx: &[[f64; L]], z: &mut [[f32; L]]) -> [f64; L] {
        vectorised(
            #[inline(always)]
            || self.substitute(kx, z),
        )
    }

    #[inline(always)]
    fn substitute<const L: usize>(&self, kx: &[[f64; L]], z: &mut [[f32; L]]) -> [f64; L] {
        for row in 0..z.len() {
            let mut sum = kx[row].map(|kx| -kx as f32);
            let entries = self.entries(row);
            for (&column, &value) in self.columns[entries.clone()].iter().zip(&self.values[entries]) {
                let z = &z[column as usize];
                for lane in 0..L {
                    sum[lane] -= value * z[lane];
                }
            }
            z[row] = sum;
        }
        for (z, &inverse) in z.iter_mut().zip(&self.inverse_pivots) {
            *z = z.map(|z| inverse * z);
        }
        let mut products = [0.0; L];
        for row in (0..z.len()).rev() {
            let here = z[row];
            let entries = self.entries(row);
            for (&column, &value) in self.columns[entries.clone()].iter().zip(&self.values[entries]) {
                let z = &mut z[column as usize];
                for lane in 0..L {
                    z[lane] -= value * here[lane];
                }
            }
            for lane in 0..L {
                products[lane] -= kx[row][lane] * f64::from(here[lane]);
            }
        }
        products
    }
}
