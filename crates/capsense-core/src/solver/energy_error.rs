//! How much of the energy, and so of each terminal's self-capacitance, the iteration still has to shed.
//!
//! Step k of the conjugate gradients lowers the energy φᵀKφ of a column by the drop d_k = α_k (r_k·z_k), Hestenes and
//! Stiefel 1952; the drops still to come are the error (Strakoš and Tichý 2002). What is still to come after a step, in
//! relation to its drop, is much the same in all solves with one preconditioner. So solves that are long enough to show
//! it teach what to expect of those that stop after a step or two. A bound from the condition number would be safe
//! without experience, but ten to fifty times too large: errors of a warm start are not the worst for the preconditioner.

#[cfg(test)]
mod tests;

/// How many steps are remembered, and how many slow convergence is judged by.
const REMEMBERED: usize = 32;
const WINDOW: usize = 12;

/// What solves have shown may fall short by this factor.
const CAUTION: f64 = 3.5;

/// The first solves, and every so many after them, are made long enough to learn from.
const FIRST_TO_LEARN: u32 = 4;
const LEARN_EVERY: u32 = 16;

/// As many motions are learned from after a change that was none: the scene may have become another.
const TO_LEARN_AFTER_CHANGE: u32 = 1;

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
const SMALL_MOTION: f64 = 6e-3;

/// After a larger change even two drops tell too little of how fast they will fall.
pub(super) const LARGE_CHANGE: f64 = 3e-2;

/// So many times as much as drops tell may be left then.
const CAUTION_AFTER_LARGE_CHANGE: f64 = 4.0;

/// A step so many times longer than those learned from goes along a direction that the preconditioner knows badly. So
/// much, in relation to its drop, may then be left. With 1.2 a bar that comes closer needs a second step twice as often.
const LONG: f64 = 1.5;
const LEFT_AFTER_LONG: f64 = 10.0;

/// A solve of more steps than these is one of slow convergence, in which directions that are known worse still show late. Then
/// a smaller factor is enough.
const USUAL_STEPS: usize = 5;
const LONG_THEN: f64 = 1.2;

/// A step that hardly drops less than the one before is taken to have so many more ahead.
const SLOWEST: f64 = 0.95;

/// A solve of more steps is a slow one, whose drops come and go. As many of its last steps as are this part of all must not
/// have dropped more than is allowed. Measured on lattices with cells beside others of a thousandth of their size: without
/// it errors were up to twenty times what they were told to be.
const SLOW: usize = 48;
const LATELY: usize = 6;

/// Sums of drops that are kept of a slow solve.
const SAMPLES: usize = 32;

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
    /// The longest step of each kind; it fades too.
    lengths: [f64; KINDS_OF_STEPS],
    solves: u32,
    /// How many motions are still to be learned from since a change that was none.
    to_learn: u32,
}

/// Energies and steps of all columns in one solve, and what solves before it have shown.
#[derive(Clone, Debug)]
pub(super) struct EnergyError {
    rule: ErrorRule,
    /// The remembered steps of each column in turn.
    steps: Vec<Step>,
    /// How many steps each column has taken; those that are done take no more.
    taken: Vec<usize>,
    /// What each column has dropped.
    courses: Vec<Course>,
    count: usize,
    /// Whether the first step of some column was too large for a motion.
    is_large: bool,
    /// Whether it was so large that drops tell little.
    is_very_large: bool,
    /// How many steps there were when one after the first was long, in any column: what is left of columns that took no more
    /// is along the direction that this one went.
    long_at: usize,
}

/// What one column did in one iteration.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Step {
    /// By how much a step of the best length lowers the energy, how much less this one did, and what it was lowered to.
    pub(super) drop: f64,
    pub(super) excess: f64,
    pub(super) energy: f64,
    /// The length of the best step, of which 1 is right for a perfect preconditioner.
    pub(super) length: f64,
}

/// The sum of all drops after every so many steps, of any number of them: when there is no more room, every other one is
/// dropped.
#[derive(Clone, Copy, Debug)]
struct Course {
    steps: usize,
    sum: f64,
    every: usize,
    samples: [f64; SAMPLES],
}

impl Default for Course {
    fn default() -> Self {
        Self { steps: 0, sum: 0.0, every: 1, samples: [0.0; SAMPLES] }
    }
}

impl Course {
    fn note(&mut self, drop: f64) {
        self.steps += 1;
        self.sum += drop;
        if !self.steps.is_multiple_of(self.every) {
            return;
        }
        self.samples[self.steps / self.every - 1] = self.sum;
        if self.steps == SAMPLES * self.every {
            for sample in 0..SAMPLES / 2 {
                self.samples[sample] = self.samples[2 * sample + 1];
            }
            self.every *= 2;
        }
    }

    /// What the last steps dropped, a sixth of all or a few more; nothing where the solve is not slow.
    fn lately(&self) -> f64 {
        if self.steps <= SLOW {
            return 0.0;
        }
        let before = (self.steps - self.steps / LATELY) / self.every;
        self.sum - self.samples[before - 1]
    }
}

impl EnergyError {
    pub(super) fn new(rule: ErrorRule, columns: usize) -> Self {
        let steps = vec![Step::default(); REMEMBERED * columns];
        let (taken, courses) = (vec![0; columns], vec![Course::default(); columns]);
        Self { rule, steps, taken, courses, count: 0, is_large: false, is_very_large: false, long_at: 0 }
    }

    /// Begins a solve.
    pub(super) fn start(&mut self) {
        self.steps.fill(Step::default());
        self.taken.fill(0);
        self.courses.fill(Course::default());
        self.count = 0;
        self.is_large = false;
        self.is_very_large = false;
        self.long_at = 0;
    }

    /// Takes one column's part in the iteration under way.
    pub(super) fn record(&mut self, column: usize, step: Step) {
        // A column that was done for a while and goes on took no steps meanwhile.
        for step in self.taken[column].max(self.count.saturating_sub(REMEMBERED))..self.count {
            self.steps[column * REMEMBERED + step % REMEMBERED] = Step::default();
        }
        self.steps[column * REMEMBERED + self.count % REMEMBERED] = step;
        self.taken[column] = self.count + 1;
        self.courses[column].note(step.drop);
        self.is_large |= self.count == 0 && is_large(step.drop, step.energy);
        self.is_very_large |= self.count == 0 && step.drop > LARGE_CHANGE * step.energy;
        if let ErrorRule::Experience(experience) = &self.rule
            && self.count > 0
            && experience.is_long(self.count, &step)
        {
            self.long_at = self.count + 1;
        }
    }

    /// A column has no residual left: there is no error, whatever its steps.
    pub(super) fn settle(&mut self, column: usize) {
        self.steps[column * REMEMBERED..][..REMEMBERED].fill(Step::default());
        self.taken[column] = 0;
        self.courses[column] = Course::default();
    }

    /// Whether a column has taken a step in this solve.
    pub(super) fn has_stepped(&self, column: usize) -> bool {
        self.taken[column] > 0
    }

    /// All columns have taken their steps.
    pub(super) fn advance(&mut self) {
        self.count += 1;
    }

    /// Whether one column's estimated relative error is below a tolerance.
    pub(super) fn is_below(&self, column: usize, tolerance: f64) -> bool {
        match self.rule {
            ErrorRule::Experience(experience)
                if experience.learns_from(self.is_large) && self.count < LEARNING_STEPS.end =>
            {
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

    /// Whether this solve is one to learn from, unless it turns out not to be after a motion.
    pub(super) fn is_learning(&self) -> bool {
        match self.rule {
            ErrorRule::Window => true,
            ErrorRule::Experience(experience) => experience.learns_from(false),
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
                let first = steps[0].drop / steps[0].energy;
                if taken < 2 && first > SMALL_MOTION || taken < 3 && first > LARGE_CHANGE {
                    return None;
                }
                let expected = experience.share(taken.saturating_sub(1)).map(|share| CAUTION * share);
                let is_long = taken <= self.long_at || experience.is_long(taken.saturating_sub(1), &last);
                let long = is_long.then_some(LEFT_AFTER_LONG);
                let caution = if self.is_very_large { CAUTION_AFTER_LARGE_CHANGE } else { 1.0 };
                last.drop * larger(long, Some(caution * larger(expected, trend(steps, taken))?))?
            }
        };
        Some((to_come.max(self.courses[column].lately()) + last.excess) / last.energy)
    }

    /// Ends a solve.
    pub(super) fn finish(&mut self) {
        if let ErrorRule::Experience(experience) = &mut self.rule {
            let fading = if experience.learns_from(self.is_large) { FADING } else { 1.0 };
            if fading < 1.0 {
                experience.learn_lengths(&self.steps, &self.taken);
            }
            experience.to_learn =
                if self.is_large { TO_LEARN_AFTER_CHANGE } else { experience.to_learn.saturating_sub(1) };
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
    fn learns_from(&self, is_large: bool) -> bool {
        let is_due = self.solves < FIRST_TO_LEARN || self.solves.is_multiple_of(LEARN_EVERY);
        is_due || self.to_learn > 0 && !is_large
    }

    fn is_long(&self, step: usize, last: &Step) -> bool {
        let factor = if step < USUAL_STEPS { LONG } else { LONG_THEN };
        last.length > factor * self.lengths[step.min(KINDS_OF_STEPS - 1)]
    }

    fn learn_lengths(&mut self, steps: &[Step], taken: &[usize]) {
        let mut seen = [0.0_f64; KINDS_OF_STEPS];
        for (steps, &taken) in steps.chunks_exact(REMEMBERED).zip(taken) {
            for (index, step) in steps[..taken.min(REMEMBERED)].iter().enumerate() {
                let kind = &mut seen[index.min(KINDS_OF_STEPS - 1)];
                *kind = kind.max(step.length);
            }
        }
        for (length, seen) in self.lengths.iter_mut().zip(seen) {
            if seen > 0.0 {
                *length = seen.max(FADING * *length);
            }
        }
    }

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

/// Whether the first step of a column drops more than one after a motion.
pub(super) fn is_large(drop: f64, energy: f64) -> bool {
    drop > SMALL_MOTION * energy
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
