//! How far off capacitances are: told from those of the same scene on a mesh with all spacings halved.
//!
//! Errors of linear elements fall as a power p of the spacing, from p = 1 at rims of electrodes to p = 2 where fields are
//! smooth. Halving shows the part 1 - 2^-p of an error, whatever makes it: the field between nodes, rims, links, or where
//! surfaces cut edges. Interface models that fill whole elements are of first order and not even of that from one mesh to the
//! next: where a staircase stands in relation to the true surface is a matter of luck, and may be the same on both meshes. So on
//! the halved mesh surfaces cut edges, whatever the model; then all of what such a model makes wrong is in the difference.
//! Links at rims that weigh what suits their mesh make C on it what it is on a finer one, often as fine as the halved mesh. What
//! that is off by itself, halving shows of the mesh with links that are not weighed so.
//! Recovered gradients (Zienkiewicz and Zhu 1987) know of the first alone. They told errors of C four to
//! twenty times as large as they are, and coarser meshes were off by anything from a third to fourteen times:
//! `docs/validation.md`.

mod halved;

pub use halved::{HalvedMesh, halved_lattice};

use crate::capacitance::{CapacitanceMatrix, upper_triangle};

/// What the halved mesh may be off by itself, in what halving shows: 1/(2^p - 1) is 0.3 to 1. Measured: nine of ten errors then are
/// within their bars.
const LEFT: f64 = 0.6;

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
    /// Compares what a mesh says of a frame with what the halved one does. `unweighed` is what the mesh says with links at rims that
    /// weigh what cells around them ask for: the same as `own`, unless these weigh what suits the mesh. `unfinished` is the error that the iteration may
    /// have left on the first, relative to the self-capacitances.
    ///
    /// # Panics
    /// When matrices have different sizes.
    pub fn between(
        own: Capacitances<'_>,
        unweighed: Capacitances<'_>,
        halved: Capacitances<'_>,
        unfinished: f64,
    ) -> Self {
        let [capacitance, change] = [
            [own, unweighed, halved].map(|of| of.capacitance.clone()),
            [own, unweighed, halved].map(|of| of.capacitance.minus(of.base)),
        ]
        .map(|[own_values, unweighed, halved]| {
            let [of_own, of_unweighed] = [&own_values, &unweighed].map(|values| shown(values, &halved));
            CapacitanceMatrix::from_upper(own_values.size(), |row, column| {
                let left =
                    LEFT * of_unweighed.get(row, column) + unfinished * scale(own.capacitance, row, column);
                of_own.get(row, column) + left
            })
        });
        Self { capacitance, change }
    }
}

/// What halving shows: each entry's own difference and the mean one of all entries, so that none that agree by chance has no error.
/// Small entries are less off than large ones, but more in relation to what they are: as the roots of entries.
fn shown(values: &CapacitanceMatrix, halved: &CapacitanceMatrix) -> CapacitanceMatrix {
    let differences = halved.minus(values);
    let size = |row, column| (values.get(row, column).abs() * scale(values, row, column)).sqrt();
    let entries = || upper_triangle(values.size());
    let all: f64 = entries().map(|(row, column)| size(row, column).powi(2)).sum();
    let off: f64 = entries().map(|(row, column)| differences.get(row, column).powi(2)).sum();
    // Without objects nothing changes, on any mesh.
    let mean = if all > 0.0 { (off / all).sqrt() } else { 0.0 };
    CapacitanceMatrix::from_upper(values.size(), |row, column| {
        differences.get(row, column).hypot(mean * size(row, column))
    })
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
        let between = |unfinished| ErrorBars::between(seen(&own), seen(&own), seen(&halved), unfinished);
        let bars = between(0.0).capacitance;
        // Sizes squared are 4 * 4, 9 * 9 and 1 * 6.
        let mean = 0.2 / f64::sqrt(16.0 + 81.0 + 6.0);
        for ((row, column), expected) in [
            ((0, 0), (1.0 + LEFT) * f64::hypot(0.2, 4.0 * mean)),
            ((1, 1), (1.0 + LEFT) * 9.0 * mean),
            ((0, 1), (1.0 + LEFT) * 6f64.sqrt() * mean),
        ] {
            assert!((bars.get(row, column) / expected - 1.0).abs() < 1e-12, "{row} {column}: {bars:?}");
        }
        let unfinished = between(1e-2).capacitance.minus(&bars);
        assert!((unfinished.get(0, 1) / 0.06 - 1.0).abs() < 1e-12, "{unfinished:?}");
    }

    /// Links may make a mesh say what the halved one does, which is off by itself.
    #[test]
    fn what_weighed_links_hide_others_show() {
        let [unweighed, halved] = [3.0, 4.0].map(|value| matrix(1, |_, _| value));
        let nothing = CapacitanceMatrix::zeros(1);
        let seen = |capacitance| Capacitances { capacitance, base: &nothing };
        let bars = ErrorBars::between(seen(&halved), seen(&unweighed), seen(&halved), 0.0);
        let expected = LEFT * 2f64.sqrt();
        assert!((bars.capacitance.get(0, 0) - expected).abs() < 1e-12, "{bars:?}");
        assert!((bars.change.get(0, 0) - expected).abs() < 1e-12, "{bars:?}");
    }

    #[test]
    fn what_does_not_change_has_no_error() {
        let base = matrix(2, |row, column| if row == column { 2.0 } else { -1.0 });
        let seen = Capacitances { capacitance: &base, base: &base };
        let bars = ErrorBars::between(seen, seen, seen, 0.0);
        assert!(
            bars.change.rows().chain(bars.capacitance.rows()).flatten().all(|bar| *bar == 0.0),
            "{bars:?}"
        );
    }
}
