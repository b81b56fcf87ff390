//! How much of the energy, and so of each terminal's self-capacitance, the iteration still has to shed.
//!
//! Step k of the conjugate gradients lowers the energy φᵀKφ of a column by the drop d_k = α_k (r_k·z_k), Hestenes and
//! Stiefel 1952; the drops still to come are the error (Strakoš and Tichý 2002). What is still to come after a step, in
//! relation to its drop, is much the same in all solves with one preconditioner. So solves that are long enough to show
//! it teach what to expect of those that stop after a step or two. A bound from the condition number would be safe
//! without experience, but ten to fifty times too large: errors of a warm start are not the worst for the preconditioner.

/// How many steps are remembered, and how many slow convergence is judged by.
const REMEMBERED: usize = 32;
const WINDOW: usize = 12;

/// What solves have shown may fall short by this factor.
const CAUTION: f64 = 3.0;

/// The first solves, and every so many after them, are made long enough to learn from.
const FIRST_TO_LEARN: u32 = 4;
const LEARN_EVERY: u32 = 16;

/// Steps that a solve takes at least to learn from, and the part of the tolerance that it goes on to: slow directions of
/// little energy show late. More than so many it does not take for that.
const LEARNING_STEPS: std::ops::Range<usize> = 3..8;
const LEARNING_TOLERANCE: f64 = 0.03;

/// What remains of the largest share seen so far when a solve was made to learn from.
const FADING: f64 = 0.8;

/// The first step meets what the scene did, later ones what the steps before them left over.
const KINDS_OF_STEPS: usize = 3;

/// Two drops tell a share well enough if the unknown rest is no more than this part of it.
const KNOWN: f64 = 0.5;

/// A first step that drops more than this part of the energy is not after a motion like others: a second one must show
/// how fast the drops fall.
const SMALL_MOTION: f64 = 3e-3;

/// A step that hardly drops less than the one before is taken to have so many more ahead.
const SLOWEST: f64 = 0.95;

/// How the error is told from the steps taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ErrorRule {
    /// Slow, uneven convergence: the sum of the last drops is the error before them, and an upper estimate of the error
    /// now when as many steps at least halve it.
    Window,
    /// Fast, even convergence: from the last drop and what steps of its kind left to do in other solves.
    Experience(Experience),
}

/// What solves have shown.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Experience {
    /// Of each kind of step the largest share that was left after it, in relation to its drop; it fades.
    shares: [Option<f64>; KINDS_OF_STEPS],
    solves: u32,
}

/// Energies and steps of all columns in one solve, and what solves before it have shown.
#[derive(Clone, Debug)]
pub(super) struct EnergyError {
    rule: ErrorRule,
    /// The remembered steps of each column in turn.
    steps: Vec<Step>,
    /// How many steps each column has taken; those that are done take no more.
    taken: Vec<usize>,
    count: usize,
}

/// What one column did in one iteration.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Step {
    /// By how much a step of the best length lowers the energy, how much less this one did, and what it was lowered to.
    pub(super) drop: f64,
    pub(super) excess: f64,
    pub(super) energy: f64,
}

impl EnergyError {
    pub(super) fn new(rule: ErrorRule, columns: usize) -> Self {
        let steps = vec![Step::default(); REMEMBERED * columns];
        Self { rule, steps, taken: vec![0; columns], count: 0 }
    }

    /// Begins a solve.
    pub(super) fn start(&mut self) {
        self.steps.fill(Step::default());
        self.taken.fill(0);
        self.count = 0;
    }

    /// Takes one column's part in the iteration under way.
    pub(super) fn record(&mut self, column: usize, step: Step) {
        self.steps[column * REMEMBERED + self.count % REMEMBERED] = step;
        self.taken[column] = self.count + 1;
    }

    /// A column has no residual left: there is no error, whatever its steps.
    pub(super) fn settle(&mut self, column: usize) {
        self.steps[column * REMEMBERED..][..REMEMBERED].fill(Step::default());
        self.taken[column] = 0;
    }

    /// All columns have taken their steps.
    pub(super) fn advance(&mut self) {
        self.count += 1;
    }

    /// Whether one column's estimated relative error is below a tolerance.
    pub(super) fn is_below(&self, column: usize, tolerance: f64) -> bool {
        match self.rule {
            ErrorRule::Experience(_) if self.is_learning() && self.count < LEARNING_STEPS.end => {
                self.count >= LEARNING_STEPS.start
                    && self.is_estimated_below(column, LEARNING_TOLERANCE * tolerance)
            }
            _ => self.is_estimated_below(column, tolerance),
        }
    }

    /// The same, however few steps there were.
    pub(super) fn is_estimated_below(&self, column: usize, tolerance: f64) -> bool {
        self.relative(column).is_some_and(|relative| relative <= tolerance)
    }

    /// Learns anew, after a solve that failed. What solves before it have shown is not worse for that.
    pub(super) fn forget(&mut self) {
        if let ErrorRule::Experience(experience) = &mut self.rule {
            experience.solves = 0;
        }
    }

    /// Whether this solve is one to learn from.
    pub(super) fn is_learning(&self) -> bool {
        match self.rule {
            ErrorRule::Window => true,
            ErrorRule::Experience(Experience { solves, .. }) => {
                solves < FIRST_TO_LEARN || solves.is_multiple_of(LEARN_EVERY)
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
            ErrorRule::Window if taken < WINDOW => return None,
            ErrorRule::Window => {
                (taken - WINDOW..taken).map(|step| steps[step % REMEMBERED].drop).sum::<f64>()
            }
            ErrorRule::Experience(experience) => {
                if taken < 2 && last.drop > SMALL_MOTION * last.energy {
                    return None;
                }
                let expected = experience.share(taken.saturating_sub(1)).map(|share| CAUTION * share);
                last.drop * larger(expected, trend(steps, taken))?
            }
        };
        Some((to_come + last.excess) / last.energy)
    }

    /// Ends a solve.
    pub(super) fn finish(&mut self) {
        let fading = if self.is_learning() { FADING } else { 1.0 };
        if let ErrorRule::Experience(experience) = &mut self.rule {
            experience.solves = experience.solves.saturating_add(1);
            let mut seen = [None; KINDS_OF_STEPS];
            for (steps, &taken) in self.steps.chunks_exact(REMEMBERED).zip(&self.taken) {
                experience.look_at(steps, taken, &mut seen);
            }
            experience.learn(seen, fading);
        }
    }
}

impl Experience {
    /// The share that is left after a step, counted from zero. Steps of a kind that was not seen yet are taken for such
    /// as come before them.
    fn share(&self, step: usize) -> Option<f64> {
        let kinds = &self.shares[..=step.min(KINDS_OF_STEPS - 1)];
        kinds.iter().rev().find_map(|share| *share)
    }

    /// Raises the shares seen in this solve to those of one column.
    fn look_at(&self, steps: &[Step], taken: usize, seen: &mut [Option<f64>; KINDS_OF_STEPS]) {
        let Some(last) = larger(self.share(taken.saturating_sub(1)), trend(steps, taken)) else { return };
        let drop = |step: usize| steps[step % REMEMBERED].drop;
        let rest = last * drop(taken.saturating_sub(1));
        let mut later = 0.0;
        for step in (taken.saturating_sub(REMEMBERED)..taken.saturating_sub(1)).rev() {
            later += drop(step + 1);
            if rest <= KNOWN * later && drop(step) > 0.0 {
                let kind = &mut seen[step.min(KINDS_OF_STEPS - 1)];
                *kind = larger(*kind, Some((later + rest) / drop(step)));
            }
        }
    }

    fn learn(&mut self, seen: [Option<f64>; KINDS_OF_STEPS], fading: f64) {
        for (share, seen) in self.shares.iter_mut().zip(seen) {
            if seen.is_some() {
                *share = larger(share.map(|share| fading * share), seen);
            }
        }
    }
}

/// The larger of what is known.
fn larger(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.max(b)),
        _ => a.or(b),
    }
}

/// The share that is left after the last step if drops go on to fall as they did with it.
fn trend(steps: &[Step], taken: usize) -> Option<f64> {
    let drop = |step: usize| steps[step % REMEMBERED].drop;
    let [before, last] = [drop(taken.checked_sub(2)?), drop(taken - 1)];
    let ratio = if last < SLOWEST * before { last / before } else { SLOWEST };
    Some(ratio / (1.0 - ratio))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Plain conjugate gradients on a diagonal matrix from the error (1, 1, ...) but for its first entries, recorded.
    fn solve(error: &mut EnergyError, eigenvalues: &[f64], first: &[f64], iterations: usize) -> f64 {
        let mut e = vec![1.0; eigenvalues.len()];
        e[..first.len()].copy_from_slice(first);
        let mut r: Vec<f64> = e.iter().zip(eigenvalues).map(|(e, k)| e * k).collect();
        let mut p = r.clone();
        let mut rr: f64 = r.iter().map(|r| r * r).sum();
        error.start();
        let mut left: f64 = e.iter().zip(eigenvalues).map(|(e, k)| e * e * k).sum();
        for _ in 0..iterations {
            let q: Vec<f64> = p.iter().zip(eigenvalues).map(|(p, k)| p * k).collect();
            let alpha = rr / p.iter().zip(&q).map(|(p, q)| p * q).sum::<f64>();
            left -= alpha * rr;
            error.record(0, Step { drop: alpha * rr, excess: 0.0, energy: 1e6 });
            error.advance();
            r.iter_mut().zip(&q).for_each(|(r, q)| *r -= alpha * q);
            let next: f64 = r.iter().map(|r| r * r).sum();
            p.iter_mut().zip(&r).for_each(|(p, r)| *p = r + next / rr * *p);
            rr = next;
        }
        left
    }

    fn fresh() -> EnergyError {
        EnergyError::new(ErrorRule::Experience(Experience::default()), 1)
    }

    fn eigenvalues() -> Vec<f64> {
        (0..30).map(|k| 1.0 + 0.05 * f64::from(k)).collect()
    }

    /// What one long solve shows holds for short ones from other errors.
    #[test]
    fn the_estimate_bounds_the_error() {
        let (mut error, eigenvalues) = (fresh(), eigenvalues());
        let _ = solve(&mut error, &eigenvalues, &[], 8);
        error.finish();
        for steps in 1..8 {
            let left = solve(&mut error, &eigenvalues, &[2.0, -3.0, 0.5], steps);
            let estimate = error.relative(0).unwrap() * 1e6;
            assert!(estimate >= left && estimate < 10.0 * left, "{steps}: {estimate:e} {left:e}");
        }
    }

    /// A direction of low energy in the preconditioned matrix, unlike all that was seen before, shows in the third step:
    /// drops no longer fall.
    #[test]
    fn slow_convergence_shows_however_good_the_experience() {
        let (mut error, mut eigenvalues) = (fresh(), eigenvalues());
        let _ = solve(&mut error, &eigenvalues, &[], 8);
        error.finish();
        eigenvalues[0] = 0.1;
        let left = solve(&mut error, &eigenvalues, &[10.0], 4);
        let estimate = error.relative(0).unwrap() * 1e6;
        assert!(estimate > 0.3 * left, "{estimate:e} {left:e}");
    }

    #[test]
    fn nothing_is_known_after_one_step_without_experience() {
        let mut error = fresh();
        let _ = solve(&mut error, &eigenvalues(), &[], 1);
        assert_eq!(error.relative(0), None);
        assert!(!error.is_below(0, 1.0));
    }

    #[test]
    fn what_was_seen_fades() {
        let (mut error, eigenvalues) = (fresh(), eigenvalues());
        let bad: Vec<f64> = eigenvalues.iter().map(|k| k * k * k).collect();
        let _ = solve(&mut error, &bad, &[], 8);
        error.finish();
        let share = |error: &EnergyError| match error.rule {
            ErrorRule::Experience(experience) => experience.share(0).unwrap(),
            ErrorRule::Window => f64::NAN,
        };
        let after_bad = share(&error);
        for _ in 0..200 {
            let _ = solve(&mut error, &eigenvalues, &[], 8);
            error.finish();
        }
        assert!(share(&error) < 0.5 * after_bad);
    }
}
