//! 1/f noise as a sum of relaxations, each a stationary Gaussian process with an exponential correlation.
//!
//! A relaxation of variance v and time τ has the one-sided spectrum 4 v τ / (1 + (2π f τ)²). Spread evenly over ln τ they sum to
//! v / (f ln r), with r the ratio of neighbouring times (van der Ziel, 1950). So v = ln r gives the spectrum 1/f. With r = 4 it
//! undulates by 2 sech(π² / ln r) = 0.3 %. Sampled, each is x' = a x + sqrt((1 - a²) v) n, a = exp(-Δt/τ), which is exact.

use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Ratio of neighbouring relaxation times.
const RATIO: f64 = 4.0;

/// The shortest relaxation time in scans. What faster ones would add is folded down by sampling: with this one the spectrum is right
/// to 3 % up to a tenth of the scan rate, and 7 % above at a fifth.
const SHORTEST: f64 = 0.5;

/// The longest relaxation time in seconds, about a day: below 1/(2π) of its inverse the spectrum is flat.
const LONGEST: f64 = 1e5;

/// How relaxations go on from scan to scan.
#[derive(Clone, Debug)]
pub(super) struct Spectrum {
    /// What is kept of a value, and how much of new randomness is added.
    steps: Vec<[f64; 2]>,
}

impl Spectrum {
    pub(super) fn new(scan_rate: f64) -> Self {
        let interval = 1.0 / scan_rate;
        let shortest = SHORTEST * interval;
        let count = 1 + ((LONGEST / shortest).ln() / RATIO.ln()).ceil().clamp(0.0, 64.0) as u32;
        let step = |index| {
            let keep = (-interval / (shortest * RATIO.powi(index as i32))).exp();
            [keep, ((1.0 - keep * keep) * RATIO.ln()).sqrt()]
        };
        Self { steps: (0..count).map(step).collect() }
    }

    /// Relaxations that have always been there.
    pub(super) fn begin(&self, random: &mut ChaCha8Rng) -> Vec<f64> {
        let sigma = RATIO.ln().sqrt();
        self.steps.iter().map(|_| sigma * normal(random)).collect()
    }

    /// The next value of unit spectrum: 1/Hz at 1 Hz.
    pub(super) fn next(&self, relaxations: &mut [f64], random: &mut ChaCha8Rng) -> f64 {
        for (value, [keep, new]) in relaxations.iter_mut().zip(&self.steps) {
            *value = keep * *value + new * normal(random);
        }
        relaxations.iter().sum()
    }
}

fn normal(random: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(random)
}
