//! The room in which bodies move near a sensor, and meshes that are as exact as was asked for all over it.
//!
//! How exact a mesh is tells a grounded plate, as an exact solid, at a few places from near to far and to the sides: its changes
//! of C, compared with those on a lattice of at least four times as many tetrahedra. In one pose the error is
//!
//! ```text
//! e² = mean over i <= j of (δΔC_ij)² / (ΔC_ii ΔC_jj)
//! ```
//!
//! and that of a mesh the largest of all probes. Errors fall with the number of tetrahedra N like N^(-2/3), as those of linear
//! elements do, so the finer lattice itself is off by a known part of the difference. The same differences tell what links at rims
//! should weigh on the mesh.

mod balance;
mod change;
mod choice;
mod comparison;
mod most_accurate;
mod probed;

pub use change::{Change, ChangeError};
pub use choice::{MeshChoice, MeshRequest, WorkspaceError};
pub use most_accurate::most_accurate;

use crate::sensor::SensorDesign;
use glam::{DVec2, DVec3};

/// Sides of the plate in parts of the larger side of all electrodes together, and in parts of the domain at most.
const PLATE_SIDE: f64 = 1.5;
const LARGEST_PLATE: f64 = 0.5;

/// Thickness of the plate in parts of its sides.
const THICKNESS: f64 = 2.0 / 15.0;

/// The gap below the nearest plate in parts of the electrodes' side, and below the farthest in parts of the room above them.
const NEAREST: f64 = 0.2;
const FARTHEST: f64 = 0.45;

/// How often the nearest gap fits into the farthest at least.
const RANGE: f64 = 4.0;

/// How far plates are to the sides, in parts of the electrodes' side.
const ASIDE: f64 = 0.6;

/// A grounded plate parallel to the electrodes, and the places where its centre is put.
#[derive(Clone, Debug, PartialEq)]
pub struct Probes {
    /// Edge lengths of the plate in metres.
    pub plate: DVec3,
    /// Places of its centre, metres.
    pub places: Vec<DVec3>,
}

impl Probes {
    /// Six heights over the middle of the electrodes, from a fifth of their side to nearly half of the room above them, and
    /// four places to the sides at lower heights.
    pub fn around(design: &SensorDesign) -> Self {
        let plate = Self::plate_of(design);
        let (low, high) = electrode_bounds(design);
        let side = (high - low).max_element();
        let top = top(design);
        let farthest = FARTHEST * (design.domain.max.z - top) - plate.z;
        let nearest = (NEAREST * side).min(farthest / RANGE);
        let gap = |step: f64| nearest * (farthest / nearest).powf(step / 3.0);
        let place = |step: f64, aside: DVec2| {
            (0.5 * (low + high) + ASIDE * side * aside).extend(top + gap(step) + 0.5 * plate.z)
        };
        let places = [
            (0.0, DVec2::ZERO),
            (0.6, DVec2::ZERO),
            (1.2, DVec2::ZERO),
            (1.8, DVec2::ZERO),
            (2.4, DVec2::ZERO),
            (3.0, DVec2::ZERO),
            (0.0, DVec2::Y),
            (1.0, DVec2::X),
            (1.0, DVec2::new(-0.7, -0.7)),
            (2.0, DVec2::new(0.7, 0.7)),
        ];
        Self { plate, places: places.into_iter().map(|(step, aside)| place(step, aside)).collect() }
    }

    /// The same plate with its centre at other places.
    pub fn at(design: &SensorDesign, places: Vec<DVec3>) -> Self {
        Self { plate: Self::plate_of(design), places }
    }

    /// The height of the plate's centre at which it would touch the uppermost electrode, metres.
    pub fn lowest(design: &SensorDesign) -> f64 {
        top(design) + 0.5 * Self::plate_of(design).z
    }

    fn plate_of(design: &SensorDesign) -> DVec3 {
        let (low, high) = electrode_bounds(design);
        let room = design.domain.size().truncate().min_element().min(design.domain.max.z - top(design));
        let side = (PLATE_SIDE * (high - low).max_element()).min(LARGEST_PLATE * room);
        DVec3::new(side, side, THICKNESS * side)
    }
}

/// The corners of the rectangle around all electrodes.
fn electrode_bounds(design: &SensorDesign) -> (DVec2, DVec2) {
    let corners = design.electrodes.iter().map(|electrode| electrode.outline.bounds());
    corners.fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), [a, b]| (low.min(a), high.max(b)))
}

/// The height of the uppermost electrode.
fn top(design: &SensorDesign) -> f64 {
    design.electrodes.iter().map(|electrode| electrode.z).fold(f64::NEG_INFINITY, f64::max)
}
