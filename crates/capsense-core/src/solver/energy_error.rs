//! How much of the energy, and so of each terminal's self-capacitance, the iteration still has to shed.
//!
//! Step k of the conjugate gradients lowers the energy φᵀKφ of a column by the drop d_k = α_k (r_k·z_k), Hestenes and
//! Stiefel 1952; the drops still to come are the error (Strakoš and Tichý 2002). A step is at least as good as one of
//! steepest descent, which leaves at most the part ρ² of the error with ρ = (κ-1)/(κ+1) and κ the condition number of
//! the preconditioned matrix. So after the step the error is at most d_k ρ²/(1-ρ²).

/// How many steps are remembered.
const REMEMBERED: usize = 12;

/// What a short iteration shows of κ - 1 may fall short by this factor.
const CAUTION: f64 = 2.5;

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

/// Energies and steps of all columns in one solve, and what solves before it have shown.
#[derive(Clone, Debug)]
pub(super) struct EnergyError {
    rule: ErrorRule,
    columns: usize,
    /// The remembered steps of each column in turn.
    steps: Vec<Step>,
    /// How many steps each column has taken; those that are done take no more.
    taken: Vec<usize>,
    count: usize,
    /// Whether all lengths so far were computed: only then do steps show the spectrum.
    exact: bool,
    /// The condition number that this solve has shown so far, with caution.
    shown: f64,
}

/// What one column did in one iteration.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Step {
    /// The best length of the step and the r·z before it.
    pub(super) alpha: f64,
    pub(super) rz: f64,
    /// By how much a step of the best length lowers the energy, how much less this one did, and what it was lowered to.
    pub(super) drop: f64,
    pub(super) excess: f64,
    pub(super) energy: f64,
}

impl EnergyError {
    pub(super) fn new(rule: ErrorRule, columns: usize) -> Self {
        let steps = vec![Step::default(); REMEMBERED * columns];
        Self { rule, columns, steps, taken: vec![0; columns], count: 0, exact: true, shown: 1.0 }
    }

    /// Begins a solve.
    pub(super) fn start(&mut self) {
        self.steps.fill(Step::default());
        self.taken.fill(0);
        (self.count, self.exact, self.shown) = (0, true, 1.0);
    }

    /// Takes one column's part in the iteration under way.
    pub(super) fn record(&mut self, column: usize, step: Step) {
        self.steps[column * REMEMBERED + self.count % REMEMBERED] = step;
        self.taken[column] = self.count + 1;
    }

    /// All columns have taken their steps.
    pub(super) fn advance(&mut self, exact: bool) {
        self.count += 1;
        self.exact &= exact;
        if let ErrorRule::Spectrum { condition, .. } = &mut self.rule
            && self.exact
            && (2..=REMEMBERED).contains(&self.count)
        {
            let columns = self.steps.chunks_exact(REMEMBERED);
            let seen = columns.filter_map(|steps| condition_number(&steps[..self.count])).fold(1.0, f64::max);
            self.shown = 1.0 + CAUTION * (seen - 1.0);
            *condition = Some(condition.unwrap_or(1.0).max(self.shown));
        }
    }

    /// Whether one column's estimated relative error is below a tolerance.
    pub(super) fn is_below(&self, column: usize, tolerance: f64) -> bool {
        let enough = !self.is_learning() || self.count >= LEARNING_STEPS;
        enough && self.relative(column).is_some_and(|relative| relative <= tolerance)
    }

    /// Whether this solve is to show the condition number.
    pub(super) fn is_learning(&self) -> bool {
        match self.rule {
            ErrorRule::Window => true,
            ErrorRule::Spectrum { condition, solves } => {
                condition.is_none() || solves.is_multiple_of(LEARN_EVERY)
            }
        }
    }

    /// Estimated relative error of one column's energy; `None` while there is too little to tell from. A column that
    /// never took a step had no residual.
    pub(super) fn relative(&self, column: usize) -> Option<f64> {
        let steps = &self.steps[column * REMEMBERED..][..REMEMBERED];
        let taken = self.taken[column];
        let last = steps[taken.saturating_sub(1) % REMEMBERED];
        if last.energy <= 0.0 {
            return Some(0.0);
        }
        let to_come = match self.rule {
            ErrorRule::Window if taken < REMEMBERED => return None,
            ErrorRule::Window => steps.iter().map(|step| step.drop).sum::<f64>(),
            ErrorRule::Spectrum { condition, .. } => {
                let condition = condition?;
                let left = ((condition - 1.0) / (condition + 1.0)).powi(2);
                last.drop * left / (1.0 - left)
            }
        };
        Some((to_come + last.excess) / last.energy)
    }

    /// The largest estimate over all columns; all of it where nothing can be told.
    pub(super) fn worst(&self) -> f64 {
        (0..self.columns).map(|column| self.relative(column).unwrap_or(1.0)).fold(0.0, f64::max)
    }

    /// Ends a solve. Solves that were made long enough to learn from let what earlier ones had shown fade, so that one
    /// bad scene does not burden all that follow.
    pub(super) fn finish(&mut self) {
        let learning = self.is_learning();
        if let ErrorRule::Spectrum { condition, solves } = &mut self.rule {
            if let Some(known) = condition.filter(|_| learning && self.count >= LEARNING_STEPS) {
                *condition = Some((1.0 + FADING * (known - 1.0)).max(self.shown));
            }
            *solves = solves.wrapping_add(1);
        }
    }
}

/// The condition number that the steps of one column show: the ratio of the extreme eigenvalues of the Lanczos matrix
/// with diagonal 1/α_k + β_{k-1}/α_{k-1} and off-diagonal √β_k/α_k, β_k the ratio of successive r·z.
fn condition_number(steps: &[Step]) -> Option<f64> {
    let mut diagonal = [0.0; REMEMBERED];
    let mut off_diagonal = [0.0; REMEMBERED];
    let used = steps.iter().take_while(|step| step.alpha > 0.0 && step.rz > 0.0).count();
    if used < 2 {
        return None;
    }
    for k in 0..used {
        let alpha = steps[k].alpha;
        diagonal[k] += 1.0 / alpha;
        if k + 1 < used {
            let beta = steps[k + 1].rz / steps[k].rz;
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Plain conjugate gradients on a diagonal matrix, recorded.
    fn solve(eigenvalues: &[f64], iterations: usize) -> EnergyError {
        let mut error = EnergyError::new(ErrorRule::Spectrum { condition: None, solves: 1 }, 1);
        let mut r: Vec<f64> = vec![1.0; eigenvalues.len()];
        let mut p = r.clone();
        let mut rz: f64 = r.iter().map(|r| r * r).sum();
        let mut energy = 1e3;
        for _ in 0..iterations {
            let q: Vec<f64> = p.iter().zip(eigenvalues).map(|(p, e)| p * e).collect();
            let alpha = rz / p.iter().zip(&q).map(|(p, q)| p * q).sum::<f64>();
            energy -= alpha * rz;
            error.record(0, Step { alpha, rz, drop: alpha * rz, excess: 0.0, energy });
            error.advance(true);
            r.iter_mut().zip(&q).for_each(|(r, q)| *r -= alpha * q);
            let next: f64 = r.iter().map(|r| r * r).sum();
            p.iter_mut().zip(&r).for_each(|(p, r)| *p = r + next / rz * *p);
            rz = next;
        }
        error
    }

    #[test]
    fn the_condition_number_of_a_small_matrix_is_found() {
        let error = solve(&[1.0, 2.0, 3.0, 5.0], 4);
        let found = condition_number(&error.steps[..4]).unwrap();
        assert!((found - 5.0).abs() < 1e-9, "{found}");
    }

    /// The energy of the error is Σ r²/λ: with κ known, the estimate is an upper bound after every step.
    #[test]
    fn the_estimate_bounds_the_error() {
        let eigenvalues: Vec<f64> = (0..30).map(|k| 1.0 + 0.05 * f64::from(k)).collect();
        let mut previous = f64::INFINITY;
        for steps in 2..8 {
            let error = solve(&eigenvalues, steps);
            let total: f64 = eigenvalues.iter().map(|e| 1.0 / e).sum();
            let shed: f64 = error.steps[..steps].iter().map(|step| step.drop).sum();
            let (left, estimate) = (total - shed, error.relative(0).unwrap() * error.steps[steps - 1].energy);
            assert!(estimate >= 0.99 * left && estimate < 30.0 * left + 1e-12, "{steps}: {estimate} {left}");
            assert!(estimate < previous);
            previous = estimate;
        }
    }
}
