//! The most accurate of the meshes of at most so many tetrahedra.
//!
//! As edges of electrodes must be in lattice planes, a smaller mesh may be better than a larger one: what bars change of three
//! stripes' capacitances is off by half as much on a lattice of 33,264 tetrahedra as on one of 39,744. So some sizes are tried, as
//! where the smallest mesh for a tolerance is looked for ([`super::choice`]).

use super::choice::{FINER, expected_ratio};
use super::{Change, Probed, Probes, WorkspaceError, electrode_bounds, top};
use crate::geometry::Shape;
use crate::material::Connection;
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

/// How many times as many tetrahedra the lattice has that others are compared with, up to so many; above that, as many times as where
/// a tolerance is asked for.
const MUCH_FINER: usize = 8;
const LARGE: usize = 1_200_000;

/// For how many changes C without bodies counts.
const OF_EMPTY: usize = 4;

/// A smaller mesh is taken where its error is below this part of that of all larger ones: where nobody looks, more tetrahedra are
/// better.
const CLEARLY: f64 = 0.8;

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
    let usual = Sensor::generated(design, kind, max_tets)?;
    if !COMPARED.contains(&max_tets) {
        return Ok(usual);
    }
    let smaller = (1..SIZES).map_while(|size| {
        // None where these are too few for the electrodes.
        Sensor::generated(design, kind, (max_tets as f64 * SMALLER.powi(size)) as usize).ok()
    });
    let varied = match kind {
        MeshKind::Lattice => design.lattices(max_tets)?,
        MeshKind::Bisection => Vec::new(),
    };
    let varied = varied.iter().skip(1).filter_map(|lattice| Sensor::on_lattice(design, lattice).ok());
    let best = Comparison::new(design, max_tets, threads)
        .and_then(|comparison| comparison.best(&usual, smaller.chain(varied)));
    // Where nothing can be told, the usual one is taken.
    Ok(best.ok().flatten().unwrap_or(usual))
}

/// What meshes are compared by.
struct Comparison {
    bodies: Vec<Shape>,
    /// Bodies by their index, where they are put, and what they change there, grounded and floating.
    places: Vec<(usize, DVec3, [Change; 2])>,
    /// C without them.
    empty: Change,
    /// Tetrahedra of the lattice on which these are exact.
    tets: usize,
    threads: Option<usize>,
}

impl Comparison {
    fn new(design: &SensorDesign, max_tets: usize, threads: Option<usize>) -> Result<Self, WorkspaceError> {
        let finer = (MUCH_FINER * max_tets).min(LARGE).max((FINER * max_tets as f64) as usize);
        let finer = Sensor::generated(design, MeshKind::Lattice, finer)?;
        let tets = finer.mesh().tets().len();
        let plate = Probes::around(design);
        let (ball, of_ball) = ball(design, RADIUS, GAPS, ASIDE);
        let (small, of_small) = ball_small(design);
        let bodies = vec![Shape::Box { size: plate.plate }, ball, small];
        let mut probed = Probed::new(finer, &bodies, Connection::Floating, EXACT, threads)?;
        let places = plate.places.into_iter().map(|place| (0, place));
        let places = places.chain(of_ball.into_iter().map(|place| (1, place)));
        let places = places.chain(of_small.into_iter().map(|place| (2, place)));
        let places = places
            .map(|(body, place)| Ok((body, place, probed.changes(body, place)?)))
            .collect::<Result<_, WorkspaceError>>()?;
        Ok(Self { bodies, places, empty: probed.empty(), tets, threads })
    }

    /// The best of some meshes, of which the first has an error already; none where that is not clearly worse.
    fn best(
        &self,
        first: &Sensor,
        others: impl Iterator<Item = Sensor>,
    ) -> Result<Option<Sensor>, WorkspaceError> {
        let mut least = CLEARLY * self.error(first, f64::INFINITY)?;
        let mut best = None;
        for sensor in others {
            if let Ok(error) = self.error(&sensor, least)
                && error < least
            {
                (least, best) = (error, Some(sensor));
            }
        }
        Ok(best)
    }

    /// The square mean of the errors of a mesh with the bodies at all places, grounded and floating, and without them, or one that is no
    /// less than some bound.
    fn error(&self, sensor: &Sensor, bound: f64) -> Result<f64, WorkspaceError> {
        let left = expected_ratio(sensor.mesh().tets().len(), self.tets).unwrap_or(1.0);
        let mut probed =
            Probed::new(sensor.clone(), &self.bodies, Connection::Floating, EXACT, self.threads)?;
        let share = 1.0 / (OF_EMPTY + 2 * self.places.len()) as f64;
        let squared = |ours: &Change, exact: &Change| {
            ours.error(exact).map_or(0.0, |error| share * (error.of_all / (1.0 - left)).powi(2))
        };
        let mut mean = OF_EMPTY as f64 * squared(&probed.empty(), &self.empty);
        for (body, place, exact) in &self.places {
            let changes = probed.changes(*body, *place)?;
            mean += changes.iter().zip(exact).map(|(ours, exact)| squared(ours, exact)).sum::<f64>();
            if mean >= bound * bound {
                return Ok(bound);
            }
        }
        Ok(mean.sqrt())
    }
}

/// A ball, and where its centre is put.
fn ball_small(design: &SensorDesign) -> (Shape, Vec<DVec3>) {
    ball(
        design,
        0.2,
        [0.15, 0.3, 0.5, 0.2],
        [DVec2::new(0.25, 0.1), DVec2::new(-0.1, -0.2), DVec2::new(-0.3, 0.1), DVec2::new(0.05, 0.3)],
    )
}

fn ball(design: &SensorDesign, radius: f64, gaps: [f64; 4], aside: [DVec2; 4]) -> (Shape, Vec<DVec3>) {
    let ((low, high), top) = (electrode_bounds(design), top(design));
    let side = (high - low).max_element().min(LONGEST * (design.domain.max.z - top));
    let places = gaps
        .into_iter()
        .zip(aside)
        .map(|(gap, aside)| (0.5 * (low + high) + side * aside).extend(top + (gap + radius) * side));
    (Shape::Sphere { radius: radius * side }, places.collect())
}
