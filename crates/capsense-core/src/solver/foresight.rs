//! What the first half of a cycle tells of the capacitances, before any field has moved.
//!
//! With fields X whose residuals are R, the capacitances are XᵀKX - RᵀK⁻¹R, and the way down of a cycle tells RᵀMR, M the
//! preconditioner. How much of K⁻¹ is in M depends little on the frame: solves that went on to the end have shown it. So
//! capacitances are known as soon as what is not known of that ratio does not matter, and fields need not follow a scene
//! step by step: they do so when more has gathered than can be foreseen.
//!
//! Of what the sweep on the finest level tells, more or less all is to come; of what coarser levels tell, which see errors that
//! they know by smoother ones, as little as 0.7 or more than twice as much, depending on the mesh. So the ratio is taken for
//! linear in the share of the finest level, and both ends of it are learned: Bayesian linear regression (Bishop, Pattern
//! Recognition and Machine Learning, 2006, section 3.3), which also tells how much is known of shares that were not seen yet.

use super::energy_error::{LARGE_CHANGE, is_large};

/// The first cycle meets what the scene did, later ones what the steps before them left over.
const KINDS: usize = 3;

/// What ratios are taken for before any was seen, where all is told by the finest level and where all is told by coarser ones, and
/// their standard deviation.
const USUAL: f64 = 1.1;
const UNKNOWN: f64 = 0.8;

/// Variance of ratios about what is expected, before any was seen, and the least that counts while they are learned.
const VARIANCE: f64 = 0.01;
const LEAST_VARIANCE: f64 = 1e-3;

/// A ratio is known to so many of its standard deviations, and no better than to a part of it.
const CAUTION: [f64; KINDS] = [3.0, 4.5, 4.5];
const LEAST: [f64; KINDS] = [0.06, 0.45, 0.45];

/// What a ratio weighs once another was seen.
const FADING: f64 = 0.9;

/// So many ratios at least, as far as they have not faded, must have been seen.
const ENOUGH: f64 = 3.3;

/// Ratios are seen when there is much to shed. Where less is told than usual, more of it may be in directions that cycles
/// tell little of: the error grows with this power of how much less it is, up to a factor.
const GROWTH: [f64; KINDS] = [1.0, 0.5, 0.5];
const MOST_UNUSUAL: [f64; KINDS] = [2.0, 3.0, 3.0];

/// So many solves in a row may do without a step: of directions that the preconditioner knows badly a cycle tells little,
/// however much gathers there. More of them may if what is not known is below this part of what is allowed.
const IN_A_ROW: usize = 3;
const MOST_IN_A_ROW: usize = 5;
const FAR_BELOW: f64 = 0.3;

/// A solve shows a ratio if the rest that is only estimated is no more than this part of what was shed.
const KNOWN: f64 = 0.1;

/// What is left of the energy in relation to what a cycle tells.
#[derive(Clone, Debug)]
pub(super) struct Foresight {
    columns: usize,
    /// Those that were seen of each column after no step, one, or more.
    ratios: Vec<Seen>,
    /// In the solve under way: for each kind of cycle what it told of each column, and what has been shed since.
    told: Vec<Told>,
    shed: Vec<f64>,
    /// What is to be taken from the energies of all pairs of columns in the end, and how exact that makes those of single
    /// ones, in relation to them, where it was foreseen.
    corrections: Vec<f64>,
    errors: Vec<Option<f64>>,
    /// Solves since one that took a step.
    since_step: usize,
}

/// What a cycle tells of the energy of one column, and the finest level's part of it.
#[derive(Clone, Copy, Debug, Default)]
struct Told {
    gain: f64,
    of_finest: f64,
}

/// RᵀMR of all pairs of columns, and the finest level's part of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gains<'a> {
    pub(super) all: &'a [f64],
    pub(super) of_finest: &'a [f64],
}

/// The ratios that were seen, with shares s = (f, 1 - f) of the finest and of coarser levels.
#[derive(Clone, Copy, Debug)]
struct Seen {
    weight: f64,
    /// About what was expected of them.
    variance: f64,
    /// Σ s sᵀ as (ff, fc, cc), and Σ ratio s.
    shares: [f64; 3],
    ratios: [f64; 2],
    /// The mean logarithm of what cycles told.
    size: f64,
}

/// The parts of what the finest and coarser levels tell that are to come, and by how much the whole may be more or less in
/// relation to what is told.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Expected {
    ratios: [f64; 2],
    error: f64,
}

impl Told {
    fn shares(self) -> [f64; 2] {
        let finest = self.of_finest / self.gain;
        [finest, 1.0 - finest]
    }
}

impl Gains<'_> {
    /// Of one pair.
    fn of(&self, at: usize) -> Told {
        Told { gain: self.all[at], of_finest: self.of_finest[at] }
    }
}

impl Expected {
    /// What is to come of what is told.
    fn to_come(self, Told { gain, of_finest }: Told) -> f64 {
        let [finest, coarse] = self.ratios;
        finest * of_finest + coarse * (gain - of_finest)
    }
}

impl Default for Seen {
    fn default() -> Self {
        Self { weight: 0.0, variance: VARIANCE, shares: [0.0; 3], ratios: [0.0; 2], size: 0.0 }
    }
}

impl Seen {
    /// Both ratios, and the variance of what they make with some shares that is not of single frames.
    fn fit(&self, [finest, coarse]: [f64; 2]) -> ([f64; 2], f64) {
        let variance = self.variance.max(LEAST_VARIANCE);
        let known = 1.0 / (UNKNOWN * UNKNOWN);
        let [ff, fc, cc] = self.shares.map(|sum| sum / variance);
        let [ff, cc] = [ff + known, cc + known];
        let determinant = ff * cc - fc * fc;
        let [of_finest, of_coarse] = self.ratios.map(|sum| sum / variance);
        let [of_finest, of_coarse] = [of_finest + USUAL * known, of_coarse + USUAL * known];
        let ratios = [
            (cc * of_finest - fc * of_coarse) / determinant,
            (ff * of_coarse - fc * of_finest) / determinant,
        ];
        let spread = cc * finest * finest - 2.0 * fc * finest * coarse + ff * coarse * coarse;
        (ratios, spread / determinant)
    }

    fn learn(&mut self, told: Told, ratio: f64) {
        let shares = told.shares();
        let [finest, coarse] = shares;
        let (ratios, _) = self.fit(shares);
        let away = ratio - (ratios[0] * finest + ratios[1] * coarse);
        let is_first = self.weight == 0.0;
        self.weight = FADING * self.weight + 1.0;
        let part = 1.0 / self.weight;
        if !is_first {
            self.variance = (1.0 - part) * (self.variance + part * away * away);
        }
        let products = [finest * finest, finest * coarse, coarse * coarse];
        self.shares.iter_mut().zip(products).for_each(|(sum, product)| *sum = FADING * *sum + product);
        self.ratios.iter_mut().zip(shares).for_each(|(sum, share)| *sum = FADING * *sum + ratio * share);
        self.size += part * (told.gain.ln() - self.size);
    }
}

impl Foresight {
    pub(super) fn new(columns: usize) -> Self {
        Self {
            columns,
            ratios: vec![Seen::default(); KINDS * columns],
            told: vec![Told::default(); KINDS * columns],
            shed: vec![0.0; KINDS * columns],
            corrections: vec![0.0; columns * columns],
            errors: vec![None; columns],
            since_step: 0,
        }
    }

    /// Begins a solve.
    pub(super) fn start(&mut self) {
        self.told.fill(Told::default());
        self.shed.fill(0.0);
        self.corrections.fill(0.0);
        self.errors.fill(None);
    }

    /// Takes what a cycle after so many steps tells: RᵀMR, all pairs of columns.
    pub(super) fn note(&mut self, steps: usize, gains: Gains<'_>) {
        if steps < KINDS {
            let told = self.told[steps * self.columns..].iter_mut().take(self.columns);
            told.enumerate().for_each(|(column, told)| *told = gains.of(column * (self.columns + 1)));
        }
    }

    /// Whether what a cycle after so many steps has told of the active columns is enough; then it is taken over. `energies`
    /// are those of the fields, and `allowed` gives the relative error that is allowed of a column's.
    pub(super) fn is_enough(
        &mut self,
        steps: usize,
        active: &[bool],
        gains: Gains<'_>,
        energies: &[f64],
        allowed: impl Fn(usize, f64) -> f64,
    ) -> bool {
        let part = match self.since_step {
            _ if steps > 0 => 1.0,
            ..IN_A_ROW => 1.0,
            IN_A_ROW..MOST_IN_A_ROW => FAR_BELOW,
            _ => return false,
        };
        let columns = self.columns;
        let columns_active = || (0..columns).filter(|&column| active[column]);
        for column in columns_active() {
            let own = column * columns + column;
            let told = gains.of(own);
            let Some(expected) = self.expected(steps, column, told) else { return false };
            let left = energies[own] - expected.to_come(told);
            let error = expected.error * told.gain / left;
            let is_exact = error <= part * allowed(column, left);
            if is_large(energies[own] - left, energies[own]) || !is_exact {
                return false;
            }
        }
        for s in columns_active() {
            let told = gains.of(s * columns + s);
            let Some(of_s) = self.expected(steps, s, told) else { return false };
            for t in columns_active() {
                let told = gains.of(t * columns + t);
                let Some(of_t) = self.expected(steps, t, told) else { return false };
                let of_pair = gains.of(s * columns + t);
                self.corrections[s * columns + t] =
                    f64::midpoint(of_s.to_come(of_pair), of_t.to_come(of_pair));
            }
            let own = s * columns + s;
            self.errors[s] = Some(of_s.error * told.gain / (energies[own] - self.corrections[own]));
        }
        true
    }

    /// What is to be taken from the energies of the fields, all pairs of columns.
    pub(super) fn corrections(&self) -> &[f64] {
        &self.corrections
    }

    /// How exact that makes the energy of one column, in relation to it, if it was foreseen.
    pub(super) fn error(&self, column: usize) -> Option<f64> {
        self.errors[column]
    }

    /// What to expect of a column's cycle after so many steps; `None` when none like it was seen.
    fn expected(&self, steps: usize, column: usize, told: Told) -> Option<Expected> {
        let kind = steps.min(KINDS - 1);
        let seen = self.ratios[kind * self.columns + column];
        let shares = told.shares();
        let (ratios, variance) = seen.fit(shares);
        let unusual = (GROWTH[kind] * (seen.size - told.gain.ln())).exp().clamp(1.0, MOST_UNUSUAL[kind]);
        let ratio = ratios[0] * shares[0] + ratios[1] * shares[1];
        let error = unusual * (CAUTION[kind] * (seen.variance + variance).sqrt()).max(LEAST[kind] * ratio);
        (seen.weight >= ENOUGH).then_some(Expected { ratios, error })
    }

    /// A step after so many others has shed so much of a column's energy.
    pub(super) fn shed(&mut self, steps: usize, column: usize, energy: f64) {
        for kind in 0..KINDS.min(steps + 1) {
            self.shed[kind * self.columns + column] += energy;
        }
    }

    /// Ends a solve of so many steps, and learns from it. `energies` are those of the fields in the end, `left` tells what
    /// part of its energy a column still has to shed at most, if that was not foreseen.
    pub(super) fn finish(&mut self, steps: usize, energies: &[f64], left: impl Fn(usize) -> f64) {
        if steps == 0 {
            self.since_step += 1;
            return;
        }
        self.since_step = 0;
        for column in 0..self.columns {
            let own = column * self.columns + column;
            let (rest, error) = match self.errors[column] {
                Some(error) => (self.corrections[own], error * energies[own]),
                None => [0.5 * left(column) * energies[own]; 2].into(),
            };
            for kind in 0..KINDS {
                let at = kind * self.columns + column;
                let (told, shed) = (self.told[at], self.shed[at]);
                let is_small = told.gain > 0.0 && told.gain <= LARGE_CHANGE * energies[own];
                if is_small && shed > 0.0 && error <= KNOWN * shed {
                    self.ratios[at].learn(told, (shed + rest) / told.gain);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cycle told so much, half of it on the finest level.
    fn half(gain: f64) -> Told {
        Told { gain, of_finest: 0.5 * gain }
    }

    /// After solves of one column in which a step after the first cycle shed these parts of what it told.
    fn seen(told: &[Told], ratios: &[f64]) -> Foresight {
        let mut foresight = Foresight::new(1);
        for (told, ratio) in told.iter().cycle().zip(ratios) {
            foresight.start();
            foresight.note(0, Gains { all: &[told.gain], of_finest: &[told.of_finest] });
            foresight.shed(0, 0, ratio * told.gain);
            foresight.finish(1, &[1.0], |_| 0.0);
        }
        foresight
    }

    /// The ratio that is expected after the first cycle.
    fn ratio(foresight: &Foresight, told: Told) -> f64 {
        foresight.expected(0, 0, told).unwrap().to_come(told) / told.gain
    }

    #[test]
    fn what_was_seen_is_expected_again() {
        let told = half(1e-3);
        assert_eq!(seen(&[told], &[1.4; 3]).expected(0, 0, told), None);
        let foresight = seen(&[told], &[1.4; 9]);
        let error = foresight.expected(0, 0, told).unwrap().error;
        assert!((ratio(&foresight, told) - 1.4).abs() < 0.01, "{}", ratio(&foresight, told));
        assert!((LEAST[0] * 1.4..0.3).contains(&error), "{error}");
        // Nothing was seen of cycles after a step.
        assert_eq!(foresight.expected(1, 0, told), None);
    }

    /// Where less is to come of what coarser levels tell, it shows in frames in which they tell different shares; and as long as
    /// it does not, other shares are known worse.
    #[test]
    fn levels_are_known_apart_once_their_shares_differ() {
        let told = [0.9, 0.5, 0.7, 0.4].map(|finest| Told { gain: 1e-3, of_finest: finest * 1e-3 });
        let ratios = told.map(|told| 1.1 * told.shares()[0] + 0.7 * told.shares()[1]);
        let foresight = seen(&told, &ratios.repeat(4));
        let coarse = Told { gain: 1e-3, of_finest: 0.0 };
        assert!((ratio(&foresight, coarse) - 0.7).abs() < 0.03, "{}", ratio(&foresight, coarse));
        let error = |told: &[Told]| seen(told, &[1.1; 8]).expected(0, 0, coarse).unwrap().error;
        assert!(error(&told[..1]) > 3.0 * error(&told), "{} {}", error(&told[..1]), error(&told));
    }

    #[test]
    fn the_less_alike_ratios_are_and_the_less_is_told_the_less_is_known() {
        let error =
            |ratios: &[f64], gain: f64| seen(&[half(1e-3)], ratios).expected(0, 0, half(gain)).unwrap().error;
        let apart = error(&[0.9, 1.3, 1.0, 1.4, 0.8], 1e-3);
        // Their standard deviation is 0.25 or so.
        assert!(apart > 0.5 && apart < 0.9, "{apart}");
        assert!((error(&[1.0; 5], 1e-3 / 1.5) / error(&[1.0; 5], 1e-3) - 1.5).abs() < 1e-9);
        assert!((error(&[1.0; 5], 1e-9) / error(&[1.0; 5], 1e-3) - MOST_UNUSUAL[0]).abs() < 1e-9);
    }

    /// Two columns, of which one may be done already.
    #[test]
    fn what_is_told_is_taken_from_the_energies_if_it_is_told_exactly_enough() {
        let mut foresight = Foresight::new(2);
        for _ in 0..9 {
            foresight.start();
            foresight.note(0, Gains { all: &[1e-3, 0.0, 0.0, 1e-3], of_finest: &[5e-4, 0.0, 0.0, 5e-4] });
            (0..2).for_each(|column| foresight.shed(0, column, USUAL * 1e-3));
            foresight.finish(1, &[1.0, 0.0, 0.0, 1.0], |_| 0.0);
        }
        let (gains, energies) = ([1e-3, -4e-4, -4e-4, 2e-3], [1.0, -0.3, -0.3, 1.0]);
        let of_finest = gains.map(|gain| 0.5 * gain);
        let mut look = |active: [bool; 2], allowed: f64| {
            foresight.start();
            let gains = Gains { all: &gains, of_finest: &of_finest };
            let enough = foresight.is_enough(0, &active, gains, &energies, |_, _| allowed);
            (enough, foresight.corrections().to_vec(), [0, 1].map(|column| foresight.error(column)))
        };
        let none = [0.0; 4].to_vec();
        assert_eq!(look([true; 2], 1e-5), (false, none, [None; 2]));
        let (enough, corrections, errors) = look([true; 2], 1e-3);
        let expected = gains.map(|gain| USUAL * gain);
        assert!(
            enough && corrections.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12),
            "{corrections:?}"
        );
        let least = LEAST[0] * USUAL * 2e-3;
        let error = errors[1].unwrap();
        assert!((least..5.0 * least).contains(&error), "{errors:?}");
        let (enough, corrections, errors) = look([true, false], 1e-3);
        assert!(enough && corrections[1..] == [0.0; 3] && errors[1].is_none(), "{corrections:?} {errors:?}");
        // Fields may not stand still for long, unless next to nothing is unknown, and never for ever.
        for frames in 0..=MOST_IN_A_ROW {
            let gains = Gains { all: &gains, of_finest: &of_finest };
            let mut enough =
                |times: f64| foresight.is_enough(0, &[true; 2], gains, &energies, |_, _| times * error);
            assert_eq!(enough(1.1), frames < IN_A_ROW, "{frames}");
            assert_eq!(enough(1.1 / FAR_BELOW), frames < MOST_IN_A_ROW, "{frames}");
            foresight.finish(0, &energies, |_| 0.0);
        }
    }

    /// After a jump the fields are another's, and a rest that is a guess would make the ratio one.
    #[test]
    fn jumps_and_solves_that_stopped_early_teach_nothing() {
        assert_eq!(seen(&[half(0.1)], &[1.2; 5]).expected(0, 0, half(0.1)), None);
        let mut foresight = Foresight::new(1);
        for _ in 0..5 {
            foresight.start();
            foresight.note(0, Gains { all: &[1e-3], of_finest: &[5e-4] });
            foresight.shed(0, 0, 1e-3);
            foresight.finish(1, &[1.0], |_| 4e-4);
        }
        assert_eq!(foresight.expected(0, 0, half(1e-3)), None);
    }
}
