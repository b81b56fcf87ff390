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
//! elements do, so the finer lattice itself is off by a known part of the difference.

mod change;
mod choice;
mod most_accurate;

pub use change::{Change, ChangeError};
pub use choice::{MeshChoice, MeshRequest, WorkspaceError};
pub use most_accurate::most_accurate;

use crate::capacitance::CapacitanceMatrix;
use crate::geometry::{Pose, Shape};
use crate::material::{Connection, Material};
use crate::sensor::{Sensor, SensorDesign};
use crate::simulator::Simulator;
use crate::solids::Solids;
use crate::solver::SolverOptions;
use glam::{DVec2, DVec3};

/// Sides of the plate in parts of the larger side of all electrodes together, and in parts of the domain at most.
const PLATE: f64 = 1.5;
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

/// What the solver may leave of C, in relation to the tolerance of ΔC: bodies far away change C by a thousandth, and which lattice
/// others are compared with follows from errors to the third digit. With 3e-5, solves that went a little further chose one of 3.75 instead of
/// 3.70 million tetrahedra, on which one place is off by 0.8 %, and so 213,528 instead of 119,808 for 1 %.
const SOLVED: f64 = 3e-6;

/// What it leaves of C at least.
const FINEST_SOLVED: f64 = 1e-10;

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
        let side = (PLATE * (high - low).max_element()).min(LARGEST_PLATE * room);
        DVec3::new(side, side, THICKNESS * side)
    }
}

/// A sensor with one of some conducting bodies near it.
pub(crate) struct Probed {
    simulator: Simulator,
    bodies: Vec<Solids>,
}

impl Probed {
    /// Solves so exactly that it can be told whether the sensor's mesh meets a tolerance of ΔC.
    pub(crate) fn new(
        sensor: Sensor,
        bodies: &[Shape],
        connection: Connection,
        tolerance: f64,
        threads: Option<usize>,
    ) -> Result<Self, WorkspaceError> {
        let tolerance = (SOLVED * tolerance).max(FINEST_SOLVED);
        let options = SolverOptions { tolerance, threads, ..SolverOptions::default() };
        Ok(Self {
            simulator: Simulator::new(sensor, vec![Material::Conductor(connection)], options)?,
            bodies: bodies
                .iter()
                .map(|body| Solids::new(std::slice::from_ref(body)))
                .collect::<Result<_, _>>()?,
        })
    }

    /// What a body changes of C with its centre at a place, by its connection.
    pub(crate) fn change(&mut self, body: usize, place: DVec3) -> Result<Change, WorkspaceError> {
        self.step(body, place)?;
        Ok(Change::between(self.simulator.base(), self.simulator.capacitance()))
    }

    /// What it changes grounded, though it floats, and what it changes floating.
    pub(crate) fn changes(&mut self, body: usize, place: DVec3) -> Result<[Change; 2], WorkspaceError> {
        self.step(body, place)?;
        let with_body = [self.simulator.with_objects_held(), self.simulator.capacitance()];
        Ok(with_body.map(|with_body| Change::between(self.simulator.base(), with_body)))
    }

    fn step(&mut self, body: usize, place: DVec3) -> Result<(), WorkspaceError> {
        self.bodies[body].place(&[Pose::at(place)])?;
        let _ = self.simulator.step(&self.bodies[body])?;
        if !self.simulator.contacts().is_empty() {
            return Err(WorkspaceError::Touches(place));
        }
        Ok(())
    }

    /// C without the bodies, as a change from nothing.
    pub(crate) fn empty(&self) -> Change {
        let empty = self.simulator.base();
        Change::between(&CapacitanceMatrix::zeros(empty.size()), empty)
    }

    /// The sensor again.
    pub(crate) fn into_sensor(self) -> Sensor {
        self.simulator.sensor().clone()
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
