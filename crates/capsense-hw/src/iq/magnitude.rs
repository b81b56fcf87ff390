//! Capacitance from the magnitude |H| alone, as it is done where phases are not measured.
//!
//! All three take it that nothing leaks and the input has no capacitance: |H| = x / √(1 + x²), x = ωR_S C. How far off they are is in
//! docs/hardware.md. A magnitude is never below zero: noise of deviation σ in I and in Q makes it σ √(π/2) where there is nothing, so
//! means of magnitudes of weak signals are too large, and those of I and Q are not.

use std::f64::consts::TAU;

/// The inverse of |H|: C = 1 / (ωR_S √(|H|⁻² - 1)). Exact without leak and input capacitance.
pub fn exact_farads(hertz: f64, shunt_ohms: f64, magnitude: f64) -> f64 {
    1.0 / (TAU * hertz * shunt_ohms * (magnitude.powi(-2) - 1.0).sqrt())
}

/// The formula of the paper, C = 1 / (ωR_S (|H|⁻¹ - 1)), in which magnitudes add up as if both were resistors: too large by
/// √(1 + x²) + x - 1, nearly x.
pub fn paper_farads(hertz: f64, shunt_ohms: f64, magnitude: f64) -> f64 {
    1.0 / (TAU * hertz * shunt_ohms * (magnitude.recip() - 1.0))
}

/// C = |H| / (ωR_S): too small by 1 - 1/√(1 + x²), nearly x²/2.
pub fn linear_farads(hertz: f64, shunt_ohms: f64, magnitude: f64) -> f64 {
    magnitude / (TAU * hertz * shunt_ohms)
}
