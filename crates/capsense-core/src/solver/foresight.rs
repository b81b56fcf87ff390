//! What the first half of a cycle tells of the capacitances, before any field has moved.
//!
//! With fields X whose residuals are R, the capacitances are XᵀKX - RᵀK⁻¹R, and the way down of a cycle tells RᵀMR, M the
//! preconditioner. How much of K⁻¹ is in M depends little on the frame: solves that went on to the end have shown it. So
//! capacitances are known as soon as what is not known of that ratio does not matter, and fields need not follow a scene
//! step by step: they do so when more has gathered than can be foreseen.

/// The first cycle meets what the scene did, later ones what the steps before them left over.
const KINDS: usize = 3;

/// A ratio is known to so many of its standard deviations, and no better than to a part of it.
const CAUTION: [f64; KINDS] = [2.5, 4.0, 4.0];
const LEAST: [f64; KINDS] = [0.05, 0.4, 0.4];

/// What a ratio weighs once another was seen.
const FADING: f64 = 0.9;

/// So many ratios at least, as far as they have not faded, must have been seen.
const ENOUGH: f64 = 2.5;

/// A solve shows a ratio if the rest that is only estimated is no more than this part of what was shed.
const KNOWN: f64 = 0.1;

/// What is left of the energy in relation to what a cycle tells.
#[derive(Clone, Debug)]
pub(super) struct Foresight {
    columns: usize,
    /// Those that were seen of each column after no step, one, or more.
    ratios: Vec<Seen>,
    /// In the solve under way: for each kind of cycle what it told of each column, and what has been shed since.
    told: Vec<f64>,
    shed: Vec<f64>,
}

/// Moments of the ratios that were seen.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    weight: f64,
    mean: f64,
    variance: f64,
    /// The mean of what cycles told.
    told: f64,
}

/// The part of what a cycle tells that is to come, and by how much it may be more or less.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Expected {
    pub(super) ratio: f64,
    pub(super) error: f64,
}

impl Foresight {
    pub(super) fn new(columns: usize) -> Self {
        let zeros = vec![0.0; KINDS * columns];
        Self { columns, ratios: vec![Seen::default(); KINDS * columns], told: zeros.clone(), shed: zeros }
    }

    /// Begins a solve.
    pub(super) fn start(&mut self) {
        self.told.fill(0.0);
        self.shed.fill(0.0);
    }

    /// What to expect of a column's cycle after so many steps; `None` when none like it was seen.
    pub(super) fn expected(&self, steps: usize, column: usize, told: f64) -> Option<Expected> {
        let kind = steps.min(KINDS - 1);
        let Seen { weight, mean, variance, told: usual } = self.ratios[kind * self.columns + column];
        let unusual = if told < usual { (usual / told).sqrt() } else { 1.0 };
        let error = unusual * (CAUTION[kind] * variance.sqrt()).max(LEAST[kind] * mean);
        (weight >= ENOUGH).then_some(Expected { ratio: mean, error })
    }

    /// Takes what a cycle after so many steps tells of one column.
    pub(super) fn note(&mut self, steps: usize, column: usize, told: f64) {
        if steps < KINDS {
            self.told[steps * self.columns + column] = told;
        }
    }

    /// A step after so many others has shed so much of a column's energy.
    pub(super) fn shed(&mut self, steps: usize, column: usize, energy: f64) {
        for kind in 0..KINDS.min(steps + 1) {
            self.shed[kind * self.columns + column] += energy;
        }
    }

    /// One column is done: so much is left of its energy, known to so much.
    pub(super) fn finish(&mut self, column: usize, energy: f64, rest: f64, error: f64) {
        for kind in 0..KINDS {
            let at = kind * self.columns + column;
            let (told, shed) = (self.told[at], self.shed[at]);
            if told > 0.0 && shed > 0.0 && error <= KNOWN * shed && told <= 3e-2 * energy {
                self.learn(at, told, (shed + rest) / told);
            }
        }
    }

    fn learn(&mut self, at: usize, told: f64, ratio: f64) {
        let Seen { weight, mean, variance, told: usual } = &mut self.ratios[at];
        *weight = FADING * *weight + 1.0;
        let away = ratio - *mean;
        let part = 1.0 / *weight;
        *mean += part * away;
        *usual += part * (told - *usual);
        *variance = (1.0 - part) * (*variance + part * away * away);
    }
}
