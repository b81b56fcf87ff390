//! Two cycles on a coarse level, combined for the least energy.
//!
//! One cycle with piecewise constant corrections loses quality with every level. Two, joined as two steps of conjugate
//! gradients, do not (the K-cycle of Notay and Vassilevski 2008), and on a coarse level they cost little.

use super::level::{Level, Vectors};
use crate::solver::workers::vectorised;

/// What must outlive the second cycle.
#[derive(Clone, Debug, Default)]
pub(super) struct Krylov<const L: usize> {
    /// The right-hand side, later the residual after the first correction.
    r: Vec<[f32; L]>,
    /// The first correction and K times it.
    first: Vec<[f32; L]>,
    k_first: Vec<[f32; L]>,
    k_second: Vec<[f32; L]>,
}

impl<const L: usize> Krylov<L> {
    pub(super) fn new(rows: usize) -> Self {
        let zeros = || vec![[0.0; L]; rows];
        Self { r: zeros(), first: zeros(), k_first: zeros(), k_second: zeros() }
    }

    /// b = approximately K⁻¹ b by two runs of a cycle that does the same less well.
    pub(super) fn solve(
        &mut self,
        level: &Level,
        levels: &mut [Vectors<L>],
        cycle: impl Fn(&mut [Vectors<L>]),
    ) {
        self.r.copy_from_slice(&levels[0].b);
        cycle(levels);
        self.first.copy_from_slice(&levels[0].b);
        let (curvature, along) = vectorised(
            #[inline(always)]
            || {
                level.product(&self.first, &mut self.k_first);
                (dot(&self.first, &self.k_first), dot(&self.first, &self.r))
            },
        );
        let length: [f64; L] = std::array::from_fn(|lane| quotient(along[lane], curvature[lane]));
        let part = length.map(|length| length as f32);
        for ((r, k), b) in self.r.iter_mut().zip(&self.k_first).zip(&mut levels[0].b) {
            for lane in 0..L {
                r[lane] -= part[lane] * k[lane];
            }
            *b = *r;
        }
        cycle(levels);
        let second = &mut levels[0].b;
        let (mixed, own, along) = vectorised(
            #[inline(always)]
            || {
                level.product(second, &mut self.k_second);
                (dot(second, &self.k_first), dot(second, &self.k_second), dot(second, &self.r))
            },
        );
        let of_second: [f64; L] = std::array::from_fn(|lane| {
            quotient(along[lane], own[lane] - quotient(mixed[lane] * mixed[lane], curvature[lane]))
        });
        let of_first: [f32; L] = std::array::from_fn(|lane| {
            (length[lane] - quotient(mixed[lane] * of_second[lane], curvature[lane])) as f32
        });
        for (second, first) in second.iter_mut().zip(&self.first) {
            for lane in 0..L {
                second[lane] = of_first[lane] * first[lane] + of_second[lane] as f32 * second[lane];
            }
        }
    }
}

/// Zero where there is no curvature, and so nothing to be gained.
fn quotient(along: f64, curvature: f64) -> f64 {
    if curvature > 0.0 { along / curvature } else { 0.0 }
}

#[inline(always)]
fn dot<const L: usize>(a: &[[f32; L]], b: &[[f32; L]]) -> [f64; L] {
    let mut sums = [0.0; L];
    for (a, b) in a.iter().zip(b) {
        for lane in 0..L {
            sums[lane] += f64::from(a[lane] * b[lane]);
        }
    }
    sums
}
