//! Physical constants and the units in which geometry files are written.
//!
//! Inside the program every quantity is in SI units: metres, farads, seconds, volts.

use std::fmt;
use std::str::FromStr;

/// Electric constant ε₀ in farads per metre (CODATA 2022). It enters once, when energies become farads.
pub const VACUUM_PERMITTIVITY: f64 = 8.854_187_818_8e-12;

/// The unit of length in which a geometry file is written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LengthUnit {
    /// 1 m.
    #[default]
    Metre,
    /// 10 mm.
    Centimetre,
    /// 1 mm.
    Millimetre,
}

impl LengthUnit {
    /// How many metres one unit is.
    pub fn metres(self) -> f64 {
        match self {
            Self::Metre => 1.0,
            Self::Centimetre => 1e-2,
            Self::Millimetre => 1e-3,
        }
    }
}

impl fmt::Display for LengthUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Metre => "m",
            Self::Centimetre => "cm",
            Self::Millimetre => "mm",
        })
    }
}

/// A unit that is none of `m`, `cm`, `mm`.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown unit of length `{0}`: expected `m`, `cm` or `mm`")]
pub struct UnknownUnit(pub String);

impl FromStr for LengthUnit {
    type Err = UnknownUnit;

    fn from_str(s: &str) -> Result<Self, UnknownUnit> {
        match s {
            "m" => Ok(Self::Metre),
            "cm" => Ok(Self::Centimetre),
            "mm" => Ok(Self::Millimetre),
            other => Err(UnknownUnit(other.to_owned())),
        }
    }
}
