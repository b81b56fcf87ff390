//! Two cycles on a coarse level, combined for the least energy.
//!
//! One cycle with piecewise constant corrections loses quality with every level. Two, joined as two steps of conjugate
//! gradients, do not (the K-cycle of Notay and Vassilevski 2008), and on a coarse level they cost little.

use super::level::{Level, Vectors};
use crate::solver::workers::vectorised;

/// What must outlive the second cycle: the first correction and K times it.
#[derive(Clone, Debug, Default)]
pub(super) struct Krylov<const L: usize> {
    first: Vec<[f32; L]>,
    k_first: Vec<[f32; L]>,
}

impl<const L: usize> Krylov<L> {
    pub(super) fn new(rows: usize) -> Self {
        Self { first: vec![[0.0; L]; rows], k_first: vec![[0.0; L]; rows] }
    }

    /// x = approximately K⁻¹ b by two runs of a cycle that does the same less well. Leaves the residual of the first in b.
    pub(super) fn solve(
        &mut self,
        level: &Level,
        levels: &mut [Vectors<L>],
        cycle: impl Fn(&mut [Vectors<L>]),
    ) {
        cycle(levels);
        let Vectors { x, b, .. } = &mut levels[0];
        std::mem::swap(x, &mut self.first);
        let (length, curvature) = vectorised(
            #[inline(always)]
            || self.take_first(level, b),
        );
        cycle(levels);
        let Vectors { x, b, .. } = &mut levels[0];
        vectorised(
            #[inline(always)]
            || self.join(level, x, b, &length, &curvature),
        );
    }

    /// The length of the first correction and its curvature; b becomes the residual after it.
    #[inline(always)]
    fn take_first(&mut self, level: &Level, b: &mut [[f32; L]]) -> ([f64; L], [f64; L]) {
        let (mut along, mut curvature, mut length) = ([0.0; L], [0.0; L], [0.0; L]);
        for (row, k_first) in self.k_first.iter_mut().enumerate() {
            *k_first = level.product(row, &self.first);
            add_products(&mut along, &self.first[row], &b[row]);
            add_products(&mut curvature, &self.first[row], k_first);
        }
        for lane in 0..L {
            length[lane] = quotient(along[lane], curvature[lane]);
        }
        for (b, k_first) in b.iter_mut().zip(&self.k_first) {
            for lane in 0..L {
                b[lane] -= length[lane] as f32 * k_first[lane];
            }
        }
        (length, curvature)
    }

    /// The second correction x becomes the best combination of both.
    #[inline(always)]
    fn join(
        &self,
        level: &Level,
        x: &mut [[f32; L]],
        b: &[[f32; L]],
        length: &[f64; L],
        curvature: &[f64; L],
    ) {
        let (mut mixed, mut own, mut along) = ([0.0; L], [0.0; L], [0.0; L]);
        for (row, b) in b.iter().enumerate() {
            let k_second = level.product(row, x);
            add_products(&mut own, &x[row], &k_second);
            add_products(&mut mixed, &x[row], &self.k_first[row]);
            add_products(&mut along, &x[row], b);
        }
        let (mut of_first, mut of_second) = ([0.0; L], [0.0; L]);
        for lane in 0..L {
            let independent = own[lane] - quotient(mixed[lane] * mixed[lane], curvature[lane]);
            let second = quotient(along[lane], independent);
            of_first[lane] = (length[lane] - quotient(mixed[lane] * second, curvature[lane])) as f32;
            of_second[lane] = second as f32;
        }
        for (x, first) in x.iter_mut().zip(&self.first) {
            for lane in 0..L {
                x[lane] = of_first[lane] * first[lane] + of_second[lane] * x[lane];
            }
        }
    }
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
