//! How far off capacitances are: told from those of the same scene on a mesh with all spacings halved.
//!
//! Errors of linear elements fall as a power p of the spacing, from p = 1 at rims of electrodes to p = 2 where fields are
//! smooth. Halving shows the part 1 - 2^-p of an error, whatever makes it: the field between nodes, rims, links, or where
//! surfaces cut edges. Interface models that fill whole elements are of first order and not even of that from one mesh to the
//! next: where a staircase stands in relation to the true surface is a matter of luck, and may be the same on both meshes. So on
//! the halved mesh surfaces cut edges, whatever the model; then all of what such a model makes wrong is in the difference.
//! Recovered gradients (Zienkiewicz and Zhu 1987) know of the first alone. They told errors of C four to
//! twenty times as large as they are, and coarser meshes were off by anything from a third to fourteen times:
//! `docs/validation.md`.

mod halved;

pub use halved::{HalvedMesh, halved_lattice};

use crate::capacitance::{CapacitanceMatrix, upper_triangle};

/// Half-width of an error bar, in what halving shows: 1/(1 - 2^-p) is 1.3 to 2. Measured: nine of ten errors then are within
/// their bars.
const WIDTH: f64 = 1.6;

/// Error bars in farads: nine of ten errors are smaller.
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorBars {
    /// Of each entry of the Maxwell matrix.
    pub capacitance: CapacitanceMatrix,
    /// Of its change by the objects, C - C_base, of which C and C_base share some errors.
    pub change: CapacitanceMatrix,
}

/// What one mesh says of a frame, in farads.
#[derive(Clone, Copy, Debug)]
pub struct Capacitances<'a> {
    /// The Maxwell matrix.
    pub capacitance: &'a CapacitanceMatrix,
    /// The same without objects.
    pub base: &'a CapacitanceMatrix,
}

impl ErrorBars {
    /// Compares what a mesh says of a frame with what the halved one does. `unfinished` is the error that the iteration may
    /// have left on the first, relative to the self-capacitances.
    ///
    /// # Panics
    /// When matrices have different sizes.
    pub fn between(coarse: Capacitances<'_>, halved: Capacitances<'_>, unfinished: f64) -> Self {
        let [change, of_halved] = [coarse, halved].map(|c| c.capacitance.minus(c.base));
        let mut bars = Self {
            capacitance: half_widths(coarse.capacitance, halved.capacitance),
            change: half_widths(&change, &of_halved),
        };
        for bars in [&mut bars.capacitance, &mut bars.change] {
            for (row, column) in upper_triangle(bars.size()) {
                let left = unfinished * scale(coarse.capacitance, row, column);
                bars.set(row, column, bars.get(row, column) + left);
            }
        }
        bars
    }
}

/// Each entry's own difference and the mean one of all entries, so that none that agree by chance has no error. Small entries
/// are less off than large ones, but more in relation to what they are: as the roots of entries.
fn half_widths(values: &CapacitanceMatrix, halved: &CapacitanceMatrix) -> CapacitanceMatrix {
    let differences = halved.minus(values);
    let size = |row, column| (values.get(row, column).abs() * scale(values, row, column)).sqrt();
    let entries = || upper_triangle(values.size());
    let all: f64 = entries().map(|(row, column)| size(row, column).powi(2)).sum();
    let off: f64 = entries().map(|(row, column)| differences.get(row, column).powi(2)).sum();
    // Without objects nothing changes, on any mesh.
    let mean = if all > 0.0 { (off / all).sqrt() } else { 0.0 };
    let mut bars = CapacitanceMatrix::zeros(values.size());
    for (row, column) in entries() {
        let own = differences.get(row, column);
        bars.set(row, column, WIDTH * own.hypot(mean * size(row, column)));
    }
    bars
}

/// √(C_ss C_tt), which no entry exceeds.
fn scale(values: &CapacitanceMatrix, row: usize, column: usize) -> f64 {
    (values.get(row, row) * values.get(column, column)).abs().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn matrix(size: usize, of: impl Fn(usize, usize) -> f64) -> CapacitanceMatrix {
        CapacitanceMatrix::from_upper(size, of)
    }

    #[test]
    fn bars_are_what_halving_shows_of_each_entry_and_of_all() {
        let [own, halved] = [[4.0, 9.0, -1.0], [4.2, 9.0, -1.0]].map(|values: [f64; 3]| {
            matrix(2, |row, column| if row == column { values[row] } else { values[2] })
        });
        let nothing = CapacitanceMatrix::zeros(2);
        let seen = |capacitance| Capacitances { capacitance, base: &nothing };
        let bars = ErrorBars::between(seen(&own), seen(&halved), 0.0).capacitance;
        // Sizes squared are 4 * 4, 9 * 9 and 1 * 6.
        let mean = 0.2 / f64::sqrt(16.0 + 81.0 + 6.0);
        for ((row, column), expected) in [
            ((0, 0), WIDTH * f64::hypot(0.2, 4.0 * mean)),
            ((1, 1), WIDTH * 9.0 * mean),
            ((0, 1), WIDTH * 6f64.sqrt() * mean),
        ] {
            assert!((bars.get(row, column) / expected - 1.0).abs() < 1e-12, "{row} {column}: {bars:?}");
        }
        let unfinished = ErrorBars::between(seen(&own), seen(&halved), 1e-2).capacitance.minus(&bars);
        assert!((unfinished.get(0, 1) / 0.06 - 1.0).abs() < 1e-12, "{unfinished:?}");
    }

    #[test]
    fn what_does_not_change_has_no_error() {
        let base = matrix(2, |row, column| if row == column { 2.0 } else { -1.0 });
        let seen = Capacitances { capacitance: &base, base: &base };
        let bars = ErrorBars::between(seen, seen, 0.0);
        assert!(
            bars.change.rows().chain(bars.capacitance.rows()).flatten().all(|bar| *bar == 0.0),
            "{bars:?}"
        );
    }
}
