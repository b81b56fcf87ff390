//! How much of the energy, and so of each terminal's self-capacitance, the iteration still has to shed.
//!
//! Step k of the conjugate gradients lowers the energy φᵀKφ of a column by the drop d_k = α_k (r_k·z_k), Hestenes and
//! Stiefel 1952; the drops still to come are the error (Strakoš and Tichý 2002).

use crate::stiffness::{LANES, Lane};

/// How many drops are summed up where they fall slowly and unevenly.
const WINDOW: usize = 12;

/// Drops may fall more slowly than they have fallen before by this factor.
const CAUTION: f64 = 2.0;

/// How the drops to come are told from those that were.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ErrorRule {
    /// Slow, uneven convergence: the sum of the last [`WINDOW`] drops is the error before them, and an upper estimate
    /// of the error now when as many iterations at least halve it.
    Window,
    /// Fast, even convergence: drops fall as a geometric series. Keeps the largest ratio of successive drops that was
    /// seen, over the solves of many frames.
    Ratio(Option<f64>),
}

/// Energies and drops of all columns.
#[derive(Clone, Debug)]
pub(super) struct EnergyError {
    rule: ErrorRule,
    pub(super) energy: Lane,
    drops: [Lane; WINDOW],
    count: usize,
}

impl EnergyError {
    pub(super) fn new(rule: ErrorRule, energy: Lane) -> Self {
        Self { rule, energy, drops: [[0.0; LANES]; WINDOW], count: 0 }
    }

    /// Takes the drops of one more iteration.
    pub(super) fn record(&mut self, drops: Lane) {
        let last = self.last();
        if let (ErrorRule::Ratio(seen), true) = (&mut self.rule, self.count > 0) {
            for lane in 0..LANES {
                if last[lane] > 0.0 && drops[lane] > 0.0 {
                    *seen = Some(seen.unwrap_or(0.0).max(drops[lane] / last[lane]));
                }
            }
        }
        for lane in 0..LANES {
            self.energy[lane] -= drops[lane];
        }
        self.drops[self.count % WINDOW] = drops;
        self.count += 1;
    }

    fn last(&self) -> Lane {
        self.drops[(self.count + WINDOW - 1) % WINDOW]
    }

    /// Estimated relative error of one column's energy; `None` while there is too little to tell from.
    pub(super) fn relative(&self, lane: usize) -> Option<f64> {
        if self.energy[lane] <= 0.0 {
            return Some(0.0);
        }
        let to_come = match self.rule {
            ErrorRule::Window if self.count < WINDOW => return None,
            ErrorRule::Window => self.drops.iter().map(|drop| drop[lane]).sum::<f64>(),
            ErrorRule::Ratio(ratio) => {
                let ratio = (CAUTION * ratio?).min(0.95);
                self.last()[lane] * ratio / (1.0 - ratio)
            }
        };
        (self.count > 0).then_some(to_come / self.energy[lane])
    }

    /// The largest estimate over all columns.
    pub(super) fn worst(&self) -> f64 {
        (0..LANES).map(|lane| self.relative(lane).unwrap_or(1.0)).fold(0.0, f64::max)
    }

    /// What was learnt for the next solve.
    pub(super) fn rule(&self) -> ErrorRule {
        self.rule
    }
}
