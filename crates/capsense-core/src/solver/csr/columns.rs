//! Fields of a few terminals side by side, and what an iteration does to them.

use super::rows::Rows;
use crate::solver::workers::{TASK_ROWS, Workers, vectorised};
use std::ops::Range;

/// Rows whose products are summed up while they still are in the first cache.
const STRIP: usize = 256;

/// One group of `L` columns. Rows of objects come after those of nodes.
#[derive(Clone, Debug)]
pub(super) struct Columns<const L: usize> {
    pub(super) x: Vec<[f64; L]>,
    /// K x, at all rows.
    pub(super) kx: Vec<[f64; L]>,
    /// The last step.
    p: Vec<[f32; L]>,
    /// For every task.
    partial: Vec<Sums<L>>,
}

/// Sums over rows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sums<const L: usize> {
    /// XᵀKX.
    pub(super) energies: [[f64; L]; L],
    /// (Kx)ᵀp.
    pub(super) along: [f64; L],
    /// Σ (Kx)² over free and fixed rows.
    pub(super) residual: [f64; L],
    pub(super) charge: [f64; L],
}

impl<const L: usize> Default for Sums<L> {
    fn default() -> Self {
        Self { energies: [[0.0; L]; L], along: [0.0; L], residual: [0.0; L], charge: [0.0; L] }
    }
}

impl<const L: usize> Sums<L> {
    /// Takes in one row.
    #[inline(always)]
    fn add_row(&mut self, x: &[f64; L], kx: &[f64; L], p: &[f32; L], fixed: bool) {
        for (energies, &x) in self.energies.iter_mut().zip(x) {
            for lane in 0..L {
                energies[lane] += x * kx[lane];
            }
        }
        for lane in 0..L {
            if fixed {
                // Of the rows that are fixed, those of the column's own terminal are at 1 V.
                self.charge[lane] += (x[lane] * kx[lane]).powi(2);
            } else {
                self.residual[lane] += kx[lane] * kx[lane];
            }
            self.along[lane] += kx[lane] * f64::from(p[lane]);
        }
    }

    fn add(&mut self, other: &Self) {
        for (sum, other) in self.energies.iter_mut().zip(&other.energies) {
            add(sum, other);
        }
        add(&mut self.along, &other.along);
        add(&mut self.residual, &other.residual);
        add(&mut self.charge, &other.charge);
    }
}

/// sum += other.
#[inline(always)]
pub(super) fn add<const L: usize>(sum: &mut [f64; L], other: &[f64; L]) {
    for lane in 0..L {
        sum[lane] += other[lane];
    }
}

impl<const L: usize> Columns<L> {
    /// Zeros for so many nodes and objects.
    pub(super) fn new(nodes: usize, objects: usize) -> Self {
        Self {
            x: vec![[0.0; L]; nodes + objects],
            kx: vec![[0.0; L]; nodes + objects],
            p: vec![[0.0; L]; nodes],
            partial: vec![Sums::default(); nodes.div_ceil(TASK_ROWS)],
        }
    }

    /// K x everywhere, and the sums over it.
    pub(super) fn evaluate(&mut self, rows: &Rows, workers: &Workers) -> Sums<L> {
        let Self { x, kx, p, partial } = self;
        let tasks =
            kx[..rows.len()].chunks_mut(TASK_ROWS).zip(partial.iter_mut()).zip((0..).step_by(TASK_ROWS));
        let (x, p) = (x.as_slice(), p.as_slice());
        workers.for_each(tasks, |((kx, sums), first)| {
            *sums = vectorised(
                #[inline(always)]
                || evaluate_task(rows, x, p, kx, first),
            );
        });
        self.evaluate_objects(rows);
        let mut sums = Sums::default();
        self.partial.iter().for_each(|partial| sums.add(partial));
        for (x, kx) in self.x.iter().zip(&self.kx).skip(rows.len()) {
            sums.add_row(x, kx, &[0.0; L], true);
        }
        sums
    }

    /// The charges on objects that links bring.
    fn evaluate_objects(&mut self, rows: &Rows) {
        self.kx[rows.len()..].fill([0.0; L]);
        for link in rows.links() {
            let (row, object) = (link.row as usize, link.object_row as usize);
            for lane in 0..L {
                self.kx[object][lane] += link.weight * (self.x[object][lane] - self.x[row][lane]);
            }
        }
    }

    /// As [`Columns::evaluate`] at some rows and at all objects only, and without sums.
    pub(super) fn evaluate_rows(&mut self, rows: &Rows, some: &[u32]) {
        let Self { x, kx, .. } = self;
        vectorised(
            #[inline(always)]
            || {
                for row in some.iter().map(|&row| row as usize) {
                    evaluate_strip(rows, x, &mut kx[row..=row], row);
                }
            },
        );
        self.evaluate_objects(rows);
    }

    /// p = a z + b p, x += p.
    pub(super) fn advance<Z: Copy + Into<f64> + Sync>(
        &mut self,
        z: &[[Z; L]],
        a: &[f64; L],
        b: &[f64; L],
        workers: &Workers,
    ) {
        let x = self.x.chunks_mut(TASK_ROWS);
        let tasks = x.zip(self.p.chunks_mut(TASK_ROWS)).zip(z.chunks(TASK_ROWS));
        workers.for_each(tasks, |((x, p), z)| {
            vectorised(
                #[inline(always)]
                || {
                    for ((x, p), z) in x.iter_mut().zip(p).zip(z) {
                        for lane in 0..L {
                            // A column that is done must not be touched, whatever stands in it.
                            let along = if a[lane] == 0.0 { 0.0 } else { a[lane] * z[lane].into() };
                            let before = if b[lane] == 0.0 { 0.0 } else { b[lane] * f64::from(p[lane]) };
                            x[lane] += along + before;
                            p[lane] = (along + before) as f32;
                        }
                    }
                },
            );
        });
    }

    /// zᵀKz and zᵀKp.
    pub(super) fn curvatures<Z: Copy + Into<f64> + Sync>(
        &mut self,
        rows: &Rows,
        z: &[[Z; L]],
        workers: &Workers,
    ) -> [[f64; L]; 2] {
        let p = self.p.as_slice();
        let tasks = self.partial.iter_mut().zip((0..rows.len()).step_by(TASK_ROWS));
        workers.for_each(tasks, |(sums, first)| {
            let range = first..(first + TASK_ROWS).min(rows.len());
            let [zz, zp] = vectorised(
                #[inline(always)]
                || curvatures_task(rows, z, p, range),
            );
            (sums.energies[0], sums.along) = (zz, zp);
        });
        let mut sums = [[0.0; L]; 2];
        for partial in &self.partial {
            add(&mut sums[0], &partial.energies[0]);
            add(&mut sums[1], &partial.along);
        }
        sums
    }
}

#[inline(always)]
fn evaluate_task<const L: usize>(
    rows: &Rows,
    x: &[[f64; L]],
    p: &[[f32; L]],
    kx: &mut [[f64; L]],
    first: usize,
) -> Sums<L> {
    let mut sums = Sums::default();
    for (kx, from) in kx.chunks_mut(STRIP).zip((first..).step_by(STRIP)) {
        evaluate_strip(rows, x, kx, from);
        let range = from..from + kx.len();
        let (x, p, fixed) = (&x[range.clone()], &p[range.clone()], &rows.fixed()[range]);
        for (((x, kx), p), &fixed) in x.iter().zip(&*kx).zip(p).zip(fixed) {
            sums.add_row(x, kx, p, fixed);
        }
    }
    sums
}

/// K x at consecutive rows.
#[inline(always)]
fn evaluate_strip<const L: usize>(rows: &Rows, x: &[[f64; L]], kx: &mut [[f64; L]], first: usize) {
    for (kx, row) in kx.iter_mut().zip(first..) {
        *kx = rows.product(row, x);
    }
    for link in rows.links_of(first..first + kx.len()) {
        let (kx, object) = (&mut kx[link.row as usize - first], &x[link.object_row as usize]);
        for lane in 0..L {
            kx[lane] -= link.weight * object[lane];
        }
    }
}

#[inline(always)]
fn curvatures_task<const L: usize, Z: Copy + Into<f64>>(
    rows: &Rows,
    z: &[[Z; L]],
    p: &[[f32; L]],
    range: Range<usize>,
) -> [[f64; L]; 2] {
    let mut sums = [[0.0; L]; 2];
    for row in range {
        let kz = rows.product(row, z);
        for lane in 0..L {
            sums[0][lane] += kz[lane] * z[row][lane].into();
            sums[1][lane] += kz[lane] * f64::from(p[row][lane]);
        }
    }
    sums
}
