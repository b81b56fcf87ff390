//! When an iteration on the device ends: the rules that the kernel `advance` follows, and what the host learns for it.

/// What is left after a step, in relation to its drop, is told from the last two drops and may be so many times more.
pub(super) const CAUTION: f32 = 3.0;

/// Ratios of successive drops are taken to be within these.
pub(super) const LEAST_RATIO: f32 = 0.05;
pub(super) const MOST_RATIO: f32 = 0.95;

/// What the energy of one column may still fall by, at most, after a step that lowered it by `drop`. `before` is the drop
/// of the step before; after the first step of a solve nothing is known.
pub(super) fn to_come(drop: f32, before: Option<f32>) -> f32 {
    let Some(before) = before else { return f32::MAX };
    let ratio = if before > 0.0 { (drop / before).clamp(LEAST_RATIO, MOST_RATIO) } else { MOST_RATIO };
    CAUTION * drop * ratio / (1.0 - ratio)
}
