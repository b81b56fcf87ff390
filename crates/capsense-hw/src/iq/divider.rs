//! The divider that turns the current between two electrodes into a voltage.
//!
//! The admittance Y = G + jωC leads from the driven electrode to the input, from where the shunt R_S and the input's own
//! capacitance C_p lead to ground, Y_S = 1/R_S + jωC_p. What flows in flows out: (V_TX - V) Y = V Y_S. With H = V / V_TX
//!
//! ```text
//! H = Y / (Y + Y_S),    Y = Y_S H / (1 - H),    C = Im Y / ω,    G = Re Y
//! ```

use num_complex::Complex64;
use std::f64::consts::TAU;

/// What lies between two electrodes: a capacitance and a leak.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Admittance {
    /// Capacitance in farads.
    pub farads: f64,
    /// Conductance in siemens.
    pub siemens: f64,
}

/// The input of a receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Divider {
    /// Shunt R_S in ohms.
    pub shunt_ohms: f64,
    /// Capacitance C_p from the input to ground, in farads.
    pub input_farads: f64,
}

impl Divider {
    /// Y_S in siemens.
    fn shunt(&self, hertz: f64) -> Complex64 {
        Complex64::new(1.0 / self.shunt_ohms, TAU * hertz * self.input_farads)
    }

    /// The ratio H of the voltages at the input and at the driven electrode.
    pub fn ratio(&self, hertz: f64, between: Admittance) -> Complex64 {
        let between = Complex64::new(between.siemens, TAU * hertz * between.farads);
        between / (between + self.shunt(hertz))
    }

    /// What lies between the electrodes at a ratio H; `None` where nothing finite comes of it, as at H = 1.
    pub fn admittance(&self, hertz: f64, ratio: Complex64) -> Option<Admittance> {
        let between = self.shunt(hertz) * ratio / (Complex64::ONE - ratio);
        let told = Admittance { farads: between.im / (TAU * hertz), siemens: between.re };
        (told.farads.is_finite() && told.siemens.is_finite()).then_some(told)
    }
}
