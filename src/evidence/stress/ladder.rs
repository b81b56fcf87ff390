//! The columns of the map: what methods are stressed with, at which levels.

use std::fmt;

/// What floats.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Afloat {
    /// One bar.
    One,
    /// Eight blocks.
    Eight,
    /// Two blocks one micrometre apart.
    NearlyTouching,
    /// One bar, tied to ground through so many farads.
    Tied(f64),
}

/// What parts of a mesh are connected to. E1 is in the first of two parts, E2 in the second, and so is a floating bar.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parts {
    /// Each has ground.
    Grounded,
    /// The second has its electrode alone.
    ElectrodeAlone,
    /// There is one part, with both electrodes and no ground.
    NoGround,
    /// The second has nothing.
    Nothing,
}

/// One column of the map: what breaks methods, and how much of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stress {
    /// Relative permittivity of a block.
    Permittivity(f64),
    /// Degrees of the flattest dihedral angles of a mesh.
    Sliver(f64),
    /// Metres between a grounded bar and the electrodes.
    Gap(f64),
    /// How much smaller cells are than those beside them.
    Jump(f64),
    /// Frames that a bar of ε = 1e5 has moved for.
    Frames(u32),
    /// The tolerance asked for.
    Tolerance(f64),
    /// Metres of thickness of a grounded plate.
    ThinConductor(f64),
    /// The same of a plate of ε = 80.
    ThinDielectric(f64),
    /// What floats.
    Floating(Afloat),
    /// Parts of the mesh without ground.
    Ungrounded(Parts),
}

impl Stress {
    /// All columns in their order.
    pub fn all() -> Vec<Self> {
        let mut all = Vec::new();
        all.extend([1e-6, 1e-3, 4.0, 80.0, 1e3, 1e6, 1e9, 1e12].map(Self::Permittivity));
        all.extend([1.0, 0.1, 1e-2, 1e-4, 1e-6, 1e-13].map(Self::Sliver));
        all.extend([1e-2, 1e-3, 1e-4, 1e-5, 1e-6].map(Self::Gap));
        all.extend([2.0, 10.0, 100.0, 1000.0].map(Self::Jump));
        all.extend([1, 30, 300, 3000].map(Self::Frames));
        all.extend([1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12].map(Self::Tolerance));
        all.extend([2e-2, 2e-3, 2e-4, 1e-6].map(Self::ThinConductor));
        all.extend([2e-2, 2e-3, 2e-4, 1e-6].map(Self::ThinDielectric));
        let afloat =
            [Afloat::One, Afloat::Eight, Afloat::NearlyTouching, Afloat::Tied(1e-18), Afloat::Tied(1.0)];
        all.extend(afloat.map(Self::Floating));
        let parts = [Parts::Grounded, Parts::ElectrodeAlone, Parts::NoGround, Parts::Nothing];
        all.extend(parts.map(Self::Ungrounded));
        all
    }

    /// What columns are grouped by.
    pub fn family(self) -> &'static str {
        match self {
            Self::Permittivity(_) => "permittivity",
            Self::Sliver(_) => "sliver angle",
            Self::Gap(_) => "gap to electrode",
            Self::Jump(_) => "size jump",
            Self::Frames(_) => "frames",
            Self::Tolerance(_) => "tolerance",
            Self::ThinConductor(_) => "thin, grounded",
            Self::ThinDielectric(_) => "thin, ε = 80",
            Self::Floating(_) => "floating",
            Self::Ungrounded(_) => "no ground",
        }
    }
}

/// The level within the family, as short as it can be.
impl fmt::Display for Stress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Permittivity(value) if (0.1..100.0).contains(&value) => write!(f, "{value}"),
            Self::Permittivity(value) | Self::Tolerance(value) => write!(f, "{value:e}"),
            Self::Sliver(degrees) if degrees >= 0.01 => write!(f, "{degrees}°"),
            Self::Sliver(degrees) => write!(f, "{degrees:e}°"),
            Self::Gap(metres) | Self::ThinConductor(metres) | Self::ThinDielectric(metres) => {
                match metres >= 1e-4 * (1.0 - 1e-9) {
                    true => write!(f, "{} mm", (metres * 1e7).round() / 1e4),
                    false => write!(f, "{} µm", (metres * 1e7).round() / 1e1),
                }
            }
            Self::Jump(ratio) => write!(f, "{ratio}"),
            Self::Frames(frames) => write!(f, "{frames}"),
            Self::Floating(Afloat::One) => f.write_str("1 bar"),
            Self::Floating(Afloat::Eight) => f.write_str("8 blocks"),
            Self::Floating(Afloat::NearlyTouching) => f.write_str("1 µm apart"),
            Self::Floating(Afloat::Tied(farads)) if farads < 1e-15 => {
                write!(f, "{} aF tied", farads * 1e18)
            }
            Self::Floating(Afloat::Tied(farads)) => write!(f, "{farads} F tied"),
            Self::Ungrounded(Parts::Grounded) => f.write_str("each has it"),
            Self::Ungrounded(Parts::ElectrodeAlone) => f.write_str("electrode"),
            Self::Ungrounded(Parts::NoGround) => f.write_str("nowhere"),
            Self::Ungrounded(Parts::Nothing) => f.write_str("nothing"),
        }
    }
}
