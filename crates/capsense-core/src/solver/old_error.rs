//! How much of the energy, and so of each terminal's self-capacitance, the iteration still has to shed.
//!
//! Step k of the conjugate gradients lowers the energy φᵀKφ of a column by the drop d_k = α_k (r_k·z_k), Hestenes and
//! Stiefel 1952; the drops still to come are the error (Strakoš and Tichý 2002). A step is at least as good as one of
//! steepest descent, which leaves at most the part ρ² of the error with ρ = (κ-1)/(κ+1) and κ the condition number of
//! the preconditioned matrix. So after the step the error is at most d_k ρ²/(1-ρ²).

use crate::stiffness::{LANES, Lane};

/// How many steps are remembered.
const REMEMBERED: usize = 12;

/// What a short iteration shows of κ - 1 may fall short by this factor.
const CAUTION: f64 = 3.0;

/// Every so many solves the iteration is made long enough to show whether the condition number has changed.
const LEARN_EVERY: u32 = 16;

/// What remains of κ - 1 from earlier solves after one to learn from.
const FADING: f64 = 0.8;

/// Steps that a solve takes at least when it is to show the condition number.
const LEARNING_STEPS: usize = 3;

/// How the error is told from the steps taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ErrorRule {
    /// Slow, uneven convergence: the sum of the remembered drops is the error before them, and an upper estimate of the
    /// error now when as many steps at least halve it.
    Window,
    /// Fast, even convergence: from the last drop and the largest condition number that any solve has shown.
    Spectrum { condition: Option<f64>, solves: u32 },
}

/// Energies and steps of all columns in one solve.
#[derive(Clone, Debug)]
pub(super) struct EnergyError {
    rule: ErrorRule,
    energy: Lane,
    steps: [Step; REMEMBERED],
    count: usize,
    /// The condition number that this solve has shown so far, with caution.
    shown: f64,
}

/// The step lengths α and energy drops of one iteration.
#[derive(Clone, Copy, Debug, Default)]
struct Step {
    alpha: Lane,
    drop: Lane,
}

impl EnergyError {
    pub(super) fn new(rule: ErrorRule, energy: Lane) -> Self {
        Self { rule, energy, steps: [Step::default(); REMEMBERED], count: 0, shown: 1.0 }
    }

    /// Takes the step lengths and the r·z of one more iteration.
    pub(super) fn record(&mut self, alpha: Lane, rz: Lane) {
        let drop = std::array::from_fn(|lane| alpha[lane] * rz[lane]);
        for (energy, drop) in self.energy.iter_mut().zip(drop) {
            *energy -= drop;
        }
        self.steps[self.count % REMEMBERED] = Step { alpha, drop };
        self.count += 1;
        if let ErrorRule::Spectrum { condition, .. } = &mut self.rule
            && (2..=REMEMBERED).contains(&self.count)
        {
            let steps = &self.steps[..self.count];
            let seen = (0..LANES).filter_map(|lane| condition_number(steps, lane)).fold(1.0, f64::max);
            self.shown = 1.0 + CAUTION * (seen - 1.0);
            *condition = Some(condition.unwrap_or(1.0).max(self.shown));
        }
    }

    /// Whether one column's estimated relative error is below a tolerance.
    pub(super) fn is_below(&self, lane: usize, tolerance: f64) -> bool {
        let enough = !self.is_learning() || self.count >= LEARNING_STEPS;
        enough && self.relative(lane).is_some_and(|relative| relative <= tolerance)
    }

    fn is_learning(&self) -> bool {
        matches!(self.rule, ErrorRule::Spectrum { solves, .. } if solves.is_multiple_of(LEARN_EVERY))
    }

    /// Estimated relative error of one column's energy; `None` while there is too little to tell from.
    fn relative(&self, lane: usize) -> Option<f64> {
        if self.energy[lane] <= 0.0 {
            return Some(0.0);
        }
        let to_come = match self.rule {
            ErrorRule::Window if self.count < REMEMBERED => return None,
            ErrorRule::Window => self.steps.iter().map(|step| step.drop[lane]).sum::<f64>(),
            ErrorRule::Spectrum { condition, .. } => {
                let condition = condition?;
                let left = ((condition - 1.0) / (condition + 1.0)).powi(2);
                let last = self.steps[self.count.checked_sub(1)? % REMEMBERED];
                last.drop[lane] * left / (1.0 - left)
            }
        };
        Some(to_come / self.energy[lane])
    }

    /// The largest estimate over all columns; all of it where nothing can be told.
    pub(super) fn worst(&self) -> f64 {
        (0..LANES).map(|lane| self.relative(lane).unwrap_or(1.0)).fold(0.0, f64::max)
    }

    /// What was learnt, for the next solve. Solves that were made long enough to learn from let what earlier ones had
    /// shown fade, so that one bad scene does not burden all that follow.
    pub(super) fn rule(&self) -> ErrorRule {
        match self.rule {
            ErrorRule::Window => ErrorRule::Window,
            ErrorRule::Spectrum { condition, solves } => {
                let faded = |known: f64| (1.0 + FADING * (known - 1.0)).max(self.shown);
                let condition = if self.is_learning() { condition.map(faded) } else { condition };
                ErrorRule::Spectrum { condition, solves: solves.wrapping_add(1) }
            }
        }
    }
}

/// The condition number that the steps of one column show: the ratio of the extreme eigenvalues of the Lanczos matrix
/// with diagonal 1/α_k + β_{k-1}/α_{k-1} and off-diagonal √β_k/α_k, β_k the ratio of successive r·z.
fn condition_number(steps: &[Step], lane: usize) -> Option<f64> {
    let mut diagonal = [0.0; REMEMBERED];
    let mut off_diagonal = [0.0; REMEMBERED];
    let used = steps.iter().take_while(|step| step.alpha[lane] > 0.0 && step.drop[lane] > 0.0).count();
    if used < 2 {
        return None;
    }
    for k in 0..used {
        let alpha = steps[k].alpha[lane];
        diagonal[k] += 1.0 / alpha;
        if k + 1 < used {
            let next = &steps[k + 1];
            let beta = (next.drop[lane] / next.alpha[lane]) / (steps[k].drop[lane] / alpha);
            off_diagonal[k] = beta.sqrt() / alpha;
            diagonal[k + 1] += beta / alpha;
        }
    }
    let smallest = eigenvalue(&diagonal[..used], &off_diagonal, 1);
    let largest = eigenvalue(&diagonal[..used], &off_diagonal, used);
    Some(largest / smallest).filter(|ratio| ratio.is_finite() && *ratio >= 1.0)
}

/// The eigenvalue of a symmetric positive definite tridiagonal matrix that has `rank - 1` smaller ones, by bisection on
/// the number of negative pivots.
fn eigenvalue(diagonal: &[f64], off_diagonal: &[f64], rank: usize) -> f64 {
    let bound = diagonal.iter().sum::<f64>();
    let (mut low, mut high) = (0.0, bound);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        let (mut below, mut pivot) = (0, 1.0);
        for (k, diagonal) in diagonal.iter().enumerate() {
            let coupling = if k == 0 { 0.0 } else { off_diagonal[k - 1] * off_diagonal[k - 1] };
            pivot = diagonal - middle - coupling / pivot;
            below += usize::from(pivot < 0.0);
        }
        if below >= rank { high = middle } else { low = middle }
    }
    0.5 * (low + high)
}

