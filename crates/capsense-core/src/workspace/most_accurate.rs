//! The most accurate of the meshes of at most so many tetrahedra.
//!
//! As edges of electrodes must be in lattice planes, a smaller mesh may be better than a larger one: what bars change of three
//! stripes' capacitances is off by half as much on a lattice of 33,264 tetrahedra as on one of 39,744. So some sizes are tried, as
//! where the smallest mesh for a tolerance is looked for ([`super::choice`]).

use super::choice::{FINER, expected_ratio};
use super::{Change, Probed, Probes, WorkspaceError, electrode_bounds, top};
use crate::geometry::Shape;
use crate::sensor::{MeshKind, Sensor, SensorDesign, SensorError};
use glam::{DVec2, DVec3};
use std::ops::RangeInclusive;

/// Where there may be fewer or more tetrahedra, the largest mesh is taken: with fewer, cells are as large as the gaps below bodies; with
/// more, errors hardly go up and down, and comparing takes seconds.
const COMPARED: RangeInclusive<usize> = 10_000..=250_000;

/// How many sizes are tried, and by which factor they follow each other. With ten, of 60,000 tetrahedra 45,360 are taken for a sensor
/// of five electrodes, on which plates and balls are off by half as much, but a hand by twice as much.
const SIZES: i32 = 3;
const SMALLER: f64 = 0.917_004_043_204_671_2;

/// A smaller mesh is taken where its error is below this part of that of all larger ones: where nobody looks, more tetrahedra are
/// better.
const CLEARLY: f64 = 0.9;

/// Errors are compared of changes that are this exact, relative to them.
const EXACT: f64 = 0.003;

/// What suits plates need not suit bodies that are no wider than some cells, so there is a ball, too: its radius, the gaps below it
/// and how far it is from the middle of the electrodes, in parts of their side.
const RADIUS: f64 = 0.4;
const GAPS: [f64; 4] = [0.2, 0.4, 0.7, 1.1];
const ASIDE: [DVec2; 4] =
    [DVec2::new(0.1, 0.05), DVec2::new(-0.3, 0.2), DVec2::new(0.2, -0.35), DVec2::new(0.0, 0.15)];

/// How long that side counts for at most, in parts of the room above the electrodes.
const LONGEST: f64 = 0.5;

/// The sensor on the most accurate mesh of at most so many tetrahedra, of some that are tried: by the changes of C that the plate
/// of [`Probes::around`] and a ball make, the square mean over all places, compared with a lattice of four times as many. The
/// largest mesh where that cannot be told, and where there may be fewer than 10,000 or more than 250,000 tetrahedra. Threads are all
/// cores where there is no number; the choice does not depend on them.
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
    let largest = Sensor::generated(design, kind, max_tets)?;
    if !COMPARED.contains(&max_tets) {
        return Ok(largest);
    }
    let comparison = Comparison::new(design, max_tets, threads);
    let best = comparison.and_then(|comparison| comparison.best(design, kind, max_tets, &largest));
    // Where nothing can be told, more tetrahedra are better.
    Ok(best.ok().flatten().unwrap_or(largest))
}

/// What meshes are compared by.
struct Comparison {
    bodies: Vec<Body>,
    /// Tetrahedra of the lattice on which their changes are exact.
    tets: usize,
    threads: Option<usize>,
}

/// A body, its places, and what it changes there.
struct Body {
    shape: Shape,
    places: Vec<DVec3>,
    exact: Vec<Change>,
}

impl Comparison {
    fn new(design: &SensorDesign, max_tets: usize, threads: Option<usize>) -> Result<Self, WorkspaceError> {
        let finer = Sensor::generated(design, MeshKind::Lattice, (FINER * max_tets as f64) as usize)?;
        let tets = finer.mesh().tets().len();
        let Probes { plate, places } = Probes::around(design);
        let bodies = [(Shape::Box { size: plate }, places), ball(design)].map(|(shape, places)| {
            let mut probed = Probed::new(finer.clone(), shape.clone(), EXACT, threads)?;
            let exact = places.iter().map(|&place| probed.change(place)).collect::<Result<_, _>>()?;
            Ok(Body { shape, places, exact })
        });
        let bodies = bodies.into_iter().collect::<Result<_, WorkspaceError>>()?;
        Ok(Self { bodies, tets, threads })
    }

    /// The best of some meshes, the largest of which is there; none where that is no worse.
    fn best(
        &self,
        design: &SensorDesign,
        kind: MeshKind,
        max_tets: usize,
        largest: &Sensor,
    ) -> Result<Option<Sensor>, WorkspaceError> {
        let mut least = self.error(largest, f64::INFINITY)?;
        let (mut best, mut tried) = (None, vec![largest.mesh().tets().len()]);
        for size in 1..SIZES {
            let allowed = (max_tets as f64 * SMALLER.powi(size)) as usize;
            // Too few for the electrodes.
            let Ok(sensor) = Sensor::generated(design, kind, allowed) else { break };
            let (tets, bound) = (sensor.mesh().tets().len(), CLEARLY * least);
            if tried.contains(&tets) {
                continue;
            }
            tried.push(tets);
            if let Ok(error) = self.error(&sensor, bound)
                && error < bound
            {
                (least, best) = (error, Some(sensor));
            }
        }
        Ok(best)
    }

    /// The square mean of the errors of a mesh with the bodies at all places, or one that is no less than some bound.
    fn error(&self, sensor: &Sensor, bound: f64) -> Result<f64, WorkspaceError> {
        let left = expected_ratio(sensor.mesh().tets().len(), self.tets).unwrap_or(1.0);
        let mut mean = 0.0;
        for Body { shape, places, exact } in &self.bodies {
            let mut probed = Probed::new(sensor.clone(), shape.clone(), EXACT, self.threads)?;
            for (&place, exact) in places.iter().zip(exact) {
                let error = probed.change(place)?.error(exact).ok_or(WorkspaceError::NotFelt(place))?;
                mean += (error.of_all / (1.0 - left)).powi(2) / (self.bodies.len() * places.len()) as f64;
                if mean >= bound * bound {
                    return Ok(bound);
                }
            }
        }
        Ok(mean.sqrt())
    }
}

/// A ball, and where its centre is put.
fn ball(design: &SensorDesign) -> (Shape, Vec<DVec3>) {
    let ((low, high), top) = (electrode_bounds(design), top(design));
    let side = (high - low).max_element().min(LONGEST * (design.domain.max.z - top));
    let places = GAPS
        .into_iter()
        .zip(ASIDE)
        .map(|(gap, aside)| (0.5 * (low + high) + side * aside).extend(top + (gap + RADIUS) * side));
    (Shape::Sphere { radius: RADIUS * side }, places.collect())
}
