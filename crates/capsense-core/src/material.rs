//! What objects are made of, and what holds the potential of a conductor.

/// A relative permittivity: finite and positive.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct RelativePermittivity(f64);

impl RelativePermittivity {
    /// Air and vacuum.
    pub const VACUUM: Self = Self(1.0);

    /// Takes a value that is finite and greater than zero; `None` otherwise.
    pub fn new(value: f64) -> Option<Self> {
        (value.is_finite() && value > 0.0).then_some(Self(value))
    }

    /// The pure number.
    pub fn value(self) -> f64 {
        self.0
    }
}

/// What holds the potential of a conducting object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Connection {
    /// At 0 V.
    Grounded,
    /// Isolated: no net charge.
    Floating,
    /// Tied to ground through a capacitance in farads (finite, not negative): Q = -C V.
    Capacitance(f64),
}

/// What an object is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Material {
    /// A perfect conductor, such as steel, or tissue at the frequencies of these sensors.
    Conductor(Connection),
    /// An insulator.
    Dielectric(RelativePermittivity),
}
