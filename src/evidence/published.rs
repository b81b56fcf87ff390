//! Figures that others have published.

use super::stage::flat;
use capsense_core::geometry::Pose;

/// Time of a frame in the paper of Schöffmann, Erickson and Zangl (IEEE RA-L 2022), read off its Fig. 8: tetrahedra, and
/// milliseconds on an i7 at 3.4 GHz, three electrodes. It tells no errors.
pub const PAPER_TIMES: [(usize, f64); 4] = [(7_000, 12.0), (20_000, 50.0), (30_000, 105.0), (48_000, 240.0)];

/// What the bar changes of C, computed by a program of another kind: hp spectral elements that follow every face, good to
/// 0.1 to 0.25 %. The same values are in `examples/accuracy/references.csv`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpectralChange {
    /// Metres between the electrodes' plane and the bar, which is straight and over the middle electrode.
    pub gap: f64,
    /// Changes of C11, C12, C13 and C22 in farads.
    pub farads: [f64; 4],
}

/// All of them.
pub const SPECTRAL: [SpectralChange; 2] = [
    SpectralChange { gap: 0.02, farads: [560.83e-15, 253.47e-15, 98.39e-15, 398.95e-15] },
    SpectralChange { gap: 0.05, farads: [113.32e-15, 72.23e-15, 55.94e-15, 68.84e-15] },
];

/// Where the entries of [`SpectralChange`] are in the upper triangle of three electrodes, row by row.
pub const SPECTRAL_ENTRIES: [usize; 4] = [0, 1, 2, 3];

impl SpectralChange {
    /// Where the bar is, of a thickness in metres.
    pub fn pose(&self, thickness: f64) -> Pose {
        flat(0.0, self.gap + 0.5 * thickness)
    }
}
