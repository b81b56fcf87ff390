//! What the steps of a curve are like that should fall smoothly.

use crate::continuity::Curve;

/// Relative change from one step to the next above which it counts.
const NOTABLE: f64 = 0.1;

/// Numbers about the steps of one curve.
pub(crate) struct Statistics {
    /// Number of steps.
    pub(crate) steps: usize,
    /// Steps with no response at all or one of the wrong sign.
    pub(crate) wrong: usize,
    /// The sum of all responses of the wrong sign, as a part of the total change.
    pub(crate) wrong_share: f64,
    /// The largest response, whatever its sign, in femtofarads.
    pub(crate) largest: f64,
    /// Largest difference between the responses of two steps, in relation to the smaller of the two.
    pub(crate) roughest: f64,
    /// How many such differences are above 10 %.
    pub(crate) notable: usize,
}

impl Statistics {
    /// The head of a Markdown table.
    pub(crate) const HEADING: &'static str = "| model | way | steps | zero or wrong sign | share of the change that goes the wrong way | largest step \
         [fF] | largest second difference / first difference beside it | above 10 % |\n\
         |---|---|---:|---:|---:|---:|---:|---:|";

    pub(crate) fn of(curve: &Curve) -> Self {
        let falls = curve.falls();
        let total: f64 = falls.iter().sum();
        let against: f64 = falls.iter().filter(|fall| **fall < 0.0).sum();
        let roughness: Vec<f64> = falls.windows(2).map(|pair| roughness(pair[0], pair[1])).collect();
        Self {
            steps: falls.len(),
            wrong: falls.iter().filter(|fall| **fall <= 0.0).count(),
            wrong_share: -against / total,
            largest: falls.iter().fold(0.0, |largest, fall| fall.abs().max(largest)),
            roughest: roughness.iter().copied().fold(0.0, f64::max),
            notable: roughness.iter().filter(|roughness| **roughness > NOTABLE).count(),
        }
    }

    /// A row of the table.
    pub(crate) fn row(&self, model: &str, way: &str) -> String {
        let Self { steps, wrong, wrong_share, largest, roughest, notable } = self;
        let share = 100.0 * wrong_share;
        let roughest = if roughest.is_finite() { format!("{roughest:.3}") } else { "∞".to_owned() };
        format!(
            "| {model} | {way} | {steps} | {wrong} | {share:.1} % | {largest:.2} | {roughest} | {notable} |"
        )
    }
}

/// Infinite beside a step that is not felt at all; two of these are even.
fn roughness(before: f64, after: f64) -> f64 {
    let difference = (after - before).abs();
    if difference == 0.0 { 0.0 } else { difference / before.abs().min(after.abs()) }
}
