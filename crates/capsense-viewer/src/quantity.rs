//! In which quantity and unit capacitances are shown.

use serde::{Deserialize, Serialize};

/// Which quantity is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Quantity {
    /// The entry of the Maxwell matrix itself.
    Absolute,
    /// Its change by the objects.
    #[default]
    Change,
}

impl Quantity {
    /// Its symbol.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Absolute => "C",
            Self::Change => "ΔC",
        }
    }
}

/// The unit in which it is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Unit {
    /// 1e-15 F.
    #[default]
    Femtofarad,
    /// 1e-12 F.
    Picofarad,
}

impl Unit {
    /// Its symbol.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Femtofarad => "fF",
            Self::Picofarad => "pF",
        }
    }

    /// How many of them a farad is.
    pub fn per_farad(self) -> f64 {
        match self {
            Self::Femtofarad => 1e15,
            Self::Picofarad => 1e12,
        }
    }

    /// A value in farads as it is read off: to 10 aF in either unit.
    pub fn text(self, farads: f64) -> String {
        let decimals = match self {
            Self::Femtofarad => 2,
            Self::Picofarad => 5,
        };
        format!("{:+.decimals$}", farads * self.per_farad())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_units_show_the_same_digits() {
        assert_eq!(Unit::Femtofarad.text(-1.234_56e-12), "-1234.56");
        assert_eq!(Unit::Picofarad.text(-1.234_56e-12), "-1.23456");
    }
}
