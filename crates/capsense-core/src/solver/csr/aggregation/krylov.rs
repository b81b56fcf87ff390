//! Two cycles on a coarse level, combined for the least energy.
//!
//! One cycle with piecewise constant corrections loses quality with every level. Two, joined as two steps of conjugate
//! gradients, do not (the K-cycle of Notay and Vassilevski 2008), and on a coarse level they cost little.

use super::super::columns::add;
use super::level::{Level, Vectors};
use super::rows_of_task;
use crate::instructions::vectorised_by_eight;
use crate::workers::Workers;

/// What must outlive the second cycle: the first correction, K times it, and the right-hand side.
#[derive(Clone, Debug)]
pub(super) struct Krylov<const L: usize> {
    /// Number of rows that one task takes.
    of_task: usize,
    first: Vec<[f32; L]>,
    k_first: Vec<[f32; L]>,
    /// The residual of the first correction; during the second cycle the right-hand side, which it takes the place of.
    rest: Vec<[f32; L]>,
    /// Sums over the rows of each task.
    partial: Vec<[[f64; L]; 3]>,
}

impl<const L: usize> Krylov<L> {
    pub(super) fn new(rows: usize) -> Self {
        let zeros = || vec![[0.0; L]; rows];
        let of_task = rows_of_task(rows);
        let partial = vec![[[0.0; L]; 3]; rows.div_ceil(of_task)];
        Self { of_task, first: zeros(), k_first: zeros(), rest: zeros(), partial }
    }

    /// x = approximately K⁻¹ b by two runs of a cycle that does the same less well.
    pub(super) fn solve(
        &mut self,
        level: &Level,
        levels: &mut [Vectors<L>],
        workers: &Workers,
        cycle: impl Fn(&mut [Vectors<L>]),
    ) {
        cycle(levels);
        let Vectors { x, b, .. } = &mut levels[0];
        std::mem::swap(x, &mut self.first);
        let [along, curvature] = self.products_of_first(level, b, workers);
        let mut length = [0.0; L];
        for lane in 0..L {
            length[lane] = quotient(along[lane], curvature[lane]);
        }
        let of_task = self.of_task;
        let tasks = self.rest.chunks_mut(of_task).zip(b.chunks(of_task)).zip(self.k_first.chunks(of_task));
        workers.for_each(tasks, |((rest, b), k_first)| subtract(rest, b, &length, k_first));
        std::mem::swap(b, &mut self.rest);
        cycle(levels);
        let Vectors { x, b, .. } = &mut levels[0];
        std::mem::swap(b, &mut self.rest);
        let [mixed, own, along] = self.products_of_second(level, x, workers);
        let (mut of_first, mut of_second) = ([0.0; L], [0.0; L]);
        for lane in 0..L {
            let independent = own[lane] - quotient(mixed[lane] * mixed[lane], curvature[lane]);
            let second = quotient(along[lane], independent);
            of_first[lane] = (length[lane] - quotient(mixed[lane] * second, curvature[lane])) as f32;
            of_second[lane] = second as f32;
        }
        let tasks = x.chunks_mut(of_task).zip(self.first.chunks(of_task));
        workers.for_each(tasks, |(x, first)| combine(x, &of_second, first, &of_first));
    }

    /// K times the first correction; its products with b and with itself.
    fn products_of_first(&mut self, level: &Level, b: &[[f32; L]], workers: &Workers) -> [[f64; L]; 2] {
        let Self { of_task, first: x, k_first, partial, .. } = self;
        let tasks = k_first.chunks_mut(*of_task).zip(partial.iter_mut()).zip((0..).step_by(*of_task));
        workers.for_each(tasks, |((k_first, sums), from)| {
            vectorised_by_eight(
                #[inline(always)]
                || {
                    *sums = [[0.0; L]; 3];
                    for (k_first, row) in k_first.iter_mut().zip(from..) {
                        *k_first = level.product(row, x);
                        add_products(&mut sums[0], &x[row], &b[row]);
                        add_products(&mut sums[1], &x[row], k_first);
                    }
                },
            );
        });
        let [along, curvature, _] = total(partial);
        [along, curvature]
    }

    /// The products of the second correction with K times the first, K times itself, and the residual of the first.
    fn products_of_second(&mut self, level: &Level, x: &[[f32; L]], workers: &Workers) -> [[f64; L]; 3] {
        let Self { of_task, k_first, rest, partial, .. } = self;
        let (of_task, k_first, rest) = (*of_task, &*k_first, &*rest);
        let tasks = partial.iter_mut().zip((0..).step_by(of_task));
        workers.for_each(tasks, |(sums, from)| {
            vectorised_by_eight(
                #[inline(always)]
                || {
                    *sums = [[0.0; L]; 3];
                    for row in from..(from + of_task).min(x.len()) {
                        add_products(&mut sums[0], &x[row], &k_first[row]);
                        add_products(&mut sums[1], &x[row], &level.product(row, x));
                        add_products(&mut sums[2], &x[row], &rest[row]);
                    }
                },
            );
        });
        total(&self.partial)
    }
}

/// to = a - α b.
fn subtract<const L: usize>(to: &mut [[f32; L]], a: &[[f32; L]], alpha: &[f64; L], b: &[[f32; L]]) {
    let alpha = alpha.map(|alpha| alpha as f32);
    vectorised_by_eight(
        #[inline(always)]
        || {
            for ((to, a), b) in to.iter_mut().zip(a).zip(b) {
                for lane in 0..L {
                    to[lane] = a[lane] - alpha[lane] * b[lane];
                }
            }
        },
    );
}

/// a = α a + β b.
fn combine<const L: usize>(a: &mut [[f32; L]], alpha: &[f32; L], b: &[[f32; L]], beta: &[f32; L]) {
    vectorised_by_eight(
        #[inline(always)]
        || {
            for (a, b) in a.iter_mut().zip(b) {
                for lane in 0..L {
                    a[lane] = alpha[lane] * a[lane] + beta[lane] * b[lane];
                }
            }
        },
    );
}

/// The sums of all tasks, in the order of the rows.
fn total<const L: usize>(partial: &[[[f64; L]; 3]]) -> [[f64; L]; 3] {
    let mut sums = [[0.0; L]; 3];
    for part in partial {
        sums.iter_mut().zip(part).for_each(|(sum, part)| add(sum, part));
    }
    sums
}

/// Zero where there is no curvature, and so nothing to be gained.
fn quotient(along: f64, curvature: f64) -> f64 {
    if curvature > 0.0 { along / curvature } else { 0.0 }
}

#[inline(always)]
fn add_products<const L: usize>(sums: &mut [f64; L], a: &[f32; L], b: &[f32; L]) {
    for lane in 0..L {
        sums[lane] += f64::from(a[lane] * b[lane]);
    }
}
