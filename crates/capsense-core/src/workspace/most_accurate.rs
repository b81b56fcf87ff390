//! The most accurate of the meshes of at most so many tetrahedra.
//!
//! Which spacing suits electrodes cannot be told from their edges: what bars change of three stripes' capacitances is off by half as
//! much on a lattice of 33,264 tetrahedra as on one of 39,744, and of two rows of patches by a third as much on 25,704 as on the
//! usual 25,920. So some sizes and gradings ([`SensorDesign::varied_lattices`]) are tried, in a race in which most are given up
//! after a few places.

use super::choice::{FINER, expected_ratio};
use super::comparison::Comparison;
use super::{Probes, WorkspaceError, electrode_bounds, top};
use crate::geometry::Shape;
use crate::sensor::{MeshKind, Sensor, SensorDesign, SensorError};
use glam::{DVec2, DVec3};
use std::ops::RangeInclusive;

/// Where there may be fewer or more tetrahedra, the usual mesh is taken: with fewer, cells are as large as the gaps below bodies; with
/// more, comparing takes many seconds.
pub(super) const COMPARED: RangeInclusive<usize> = 12_000..=250_000;

/// How many sizes of the usual mesh are tried, and by which factor they follow each other. With ten, of 60,000 tetrahedra 45,360 are taken for a sensor
/// of five electrodes, on which plates and balls are off by half as much, but a hand by twice as much.
const SIZES: i32 = 3;
pub(super) const SMALLER: f64 = 0.917_004_043_204_671_2;

/// How many times as many tetrahedra the lattice has that others are compared with, up to so many; above that, [`FINER`] times as
/// many.
const MUCH_FINER: usize = 16;
const LARGE: usize = 1_200_000;

/// Places that follow each other are so many apart in the lists of the bodies'.
const STRIDE: usize = 4;

/// After so many places a mesh is given up whose squared errors until then add up to so many times those of the best, or of the usual
/// one less what [`CLEARLY`] takes off.
const PATIENT: usize = 4;
const HOPEFUL: f64 = 1.3;

/// Another mesh than the usual one is taken where its error is below this part of that one's: what is better at these places need not be
/// better where nobody looks.
const CLEARLY: f64 = 0.8;

/// Errors are compared of changes that are this exact, relative to them.
const EXACT: f64 = 0.03;

/// What suits plates need not suit bodies that are no wider than some cells, so there are balls, too.
const BALLS: [Ball; 2] = [
    Ball {
        radius: 0.4,
        gaps: [0.2, 0.4, 0.7, 1.1],
        aside: [DVec2::new(0.1, 0.05), DVec2::new(-0.3, 0.2), DVec2::new(0.2, -0.35), DVec2::new(0.0, 0.15)],
    },
    Ball {
        radius: 0.2,
        gaps: [0.15, 0.3, 0.5, 0.2],
        aside: [DVec2::new(0.25, 0.1), DVec2::new(-0.1, -0.2), DVec2::new(-0.3, 0.1), DVec2::new(0.05, 0.3)],
    },
];

/// How long that side counts for at most, in parts of the room above the electrodes.
const LONGEST: f64 = 0.5;

/// The sensor on the most accurate mesh of at most so many tetrahedra, of some that are tried: by C and its changes that the plate
/// of [`Probes::around`] and two balls make, grounded and floating, the square mean over all places, compared with a lattice of four
/// to sixteen times as many. Its links at rims weigh what suits it best, each electrode's more or less by one factor. It is the usual mesh where no other is
/// clearly better, and that mesh with its own links, [`Sensor::generated`], where nothing can be told and
/// where there may be fewer than 12,000 or more than 250,000 tetrahedra. Threads are all cores where there is no number; the choice
/// does not depend on them.
///
/// # Errors
/// As [`Sensor::generated`].
///
/// # Example
/// ```
/// use capsense_core::electrode::{Electrode, Outline};
/// use capsense_core::geometry::Aabb;
/// use capsense_core::glam::{DVec2, DVec3};
/// use capsense_core::sensor::{MeshKind, SensorDesign, Wall};
/// use capsense_core::workspace::most_accurate;
///
/// # fn main() -> Result<(), capsense_core::sensor::SensorError> {
/// let outline = Outline::Rectangle { center: DVec2::ZERO, size: DVec2::new(0.1, 0.03) };
/// let design = SensorDesign {
///     domain: Aabb { min: DVec3::new(-0.25, -0.25, -0.05), max: DVec3::new(0.25, 0.25, 0.45) },
///     electrodes: vec![Electrode { name: "E1".into(), outline, z: 0.0 }],
///     substrate: None,
///     wall: Wall::Grounded,
/// };
/// let sensor = most_accurate(&design, MeshKind::Lattice, 12_000, None)?;
/// assert!(sensor.mesh().tets().len() <= 12_000);
/// # Ok(())
/// # }
/// ```
pub fn most_accurate(
    design: &SensorDesign,
    kind: MeshKind,
    max_tets: usize,
    threads: Option<usize>,
) -> Result<Sensor, SensorError> {
    let usual = Sensor::generated(design, kind, max_tets)?;
    if !COMPARED.contains(&max_tets) {
        return Ok(usual);
    }
    let smaller = (1..SIZES).map_while(|size| {
        // None where these are too few for the electrodes.
        Sensor::generated(design, kind, (max_tets as f64 * SMALLER.powi(size)) as usize).ok()
    });
    let best = compared(design, max_tets, threads).and_then(|comparison| {
        let varied = match kind {
            MeshKind::Lattice => design.varied_lattices(max_tets)?,
            MeshKind::Bisection => Vec::new(),
        };
        let varied = varied.iter().filter(|lattice| usual.lattice() != Some(lattice));
        let varied = varied.filter_map(|lattice| Sensor::on_lattice(design, lattice).ok());
        best(&comparison, usual.clone(), smaller.chain(varied))
    });
    // Where nothing can be told, the usual one is taken.
    Ok(best.unwrap_or(usual))
}

/// What meshes of so many tetrahedra are compared by.
fn compared(
    design: &SensorDesign,
    max_tets: usize,
    threads: Option<usize>,
) -> Result<Comparison, WorkspaceError> {
    let finer = (MUCH_FINER * max_tets).min(LARGE).max((FINER * max_tets as f64) as usize);
    let finer = Sensor::generated(design, MeshKind::Lattice, finer)?;
    let (bodies, places) = bodies_and_places(design);
    let all = places.len();
    Comparison::new(finer, bodies, places, all, EXACT, threads)
}

/// The best of some meshes, the first where none is clearly better, with links that weigh what suits it best.
fn best(
    comparison: &Comparison,
    first: Sensor,
    others: impl Iterator<Item = Sensor>,
) -> Result<Sensor, WorkspaceError> {
    let none = vec![f64::INFINITY; comparison.places.len() + 1];
    let Some(errors) = errors(comparison, &first, &none)? else { return Ok(first) };
    let mut least: Vec<f64> = errors.into_iter().map(|error| CLEARLY * CLEARLY * error).collect();
    let mut best = first;
    for sensor in others {
        // What cannot be compared is not taken.
        if let Ok(Some(errors)) = self::errors(comparison, &sensor, &least) {
            (least, best) = (errors, sensor);
        }
    }
    comparison.balanced(best)
}

/// Sums of squared errors of a mesh without bodies and with the first of them, one place more each time, as they will be with links
/// that weigh what suits it best; none as soon as it seems that they will end above those of another mesh.
fn errors(
    comparison: &Comparison,
    sensor: &Sensor,
    others: &[f64],
) -> Result<Option<Vec<f64>>, WorkspaceError> {
    let Some(ratio) = expected_ratio(sensor.mesh().tets().len(), comparison.tets) else { return Ok(None) };
    let end = others[others.len() - 1];
    let mut sums = Vec::with_capacity(others.len());
    let balance = comparison.balance(sensor, |balance| {
        let sum = balance.left() / (1.0 - ratio).powi(2);
        let is_hopeful = sums.len() < PATIENT || sum < HOPEFUL * others[sums.len()];
        sums.push(sum);
        sum < end && is_hopeful
    })?;
    Ok(balance.map(|_| sums))
}

/// The plate and the balls, and where each is put, in an order in which all of them, near and far, are among any that follow each other.
fn bodies_and_places(design: &SensorDesign) -> (Vec<Shape>, Vec<(usize, DVec3)>) {
    let Probes { plate, places } = Probes::around(design);
    let mut bodies = vec![Shape::Box { size: plate }];
    let mut all: Vec<(usize, DVec3)> = places.into_iter().map(|place| (0, place)).collect();
    for ball in BALLS {
        let (ball, places) = ball.places(design);
        all.extend(places.into_iter().map(|place| (bodies.len(), place)));
        bodies.push(ball);
    }
    let in_turn = (0..STRIDE).flat_map(|first| all.iter().copied().skip(first).step_by(STRIDE));
    (bodies, in_turn.collect())
}

/// A ball, and where it is put: lengths in parts of the electrodes' longer side.
struct Ball {
    radius: f64,
    /// Below it, at its places.
    gaps: [f64; 4],
    /// How far these are from the middle of the electrodes.
    aside: [DVec2; 4],
}

impl Ball {
    fn places(&self, design: &SensorDesign) -> (Shape, Vec<DVec3>) {
        let ((low, high), top) = (electrode_bounds(design), top(design));
        let side = (high - low).max_element().min(LONGEST * (design.domain.max.z - top));
        let places =
            self.gaps.iter().zip(self.aside).map(|(gap, aside)| {
                (0.5 * (low + high) + side * aside).extend(top + (gap + self.radius) * side)
            });
        (Shape::Sphere { radius: self.radius * side }, places.collect())
    }
}
