//! The smallest mesh whose estimated error of ΔC is below a tolerance.
//!
//! Lattices that grow tell how many tetrahedra it may take. Sizes from a third of that number up are then tried one after the
//! other, a fifth more each time: as edges of electrodes must be in lattice planes, some sizes are much better than others.
//! Cost is counted in tetrahedra, so the choice is the same on every machine.

use super::{Change, Probes};
use crate::sensor::{MeshKind, Sensor, SensorDesign, SensorError};
use crate::simulator::SimulatorError;
use crate::solids::SolidError;
use glam::DVec3;
use std::collections::BTreeMap;

/// Tetrahedra of the first lattice.
const FIRST: usize = 4_000;

/// How many times as many tetrahedra the lattice has at least that others are compared with.
const FINER: f64 = 4.0;

/// Tetrahedra of the finest lattice that others are compared with: it needs about 2 GB.
const FINEST: usize = 8_000_000;

/// Where it seems to take so many, none of the lattices that may follow will do.
const HOPELESS: f64 = 1e9;

/// By which factors that lattice may grow from one to the next.
const STEPS: [f64; 2] = [2.0, 8.0];

/// Errors are N to this power.
const ORDER: f64 = -2.0 / 3.0;

/// The size first tried in parts of the one foreseen, and by which factor sizes follow each other.
const TRIED_FIRST: f64 = 1.0 / 3.0;
const TRIED_NEXT: f64 = 1.189_207_115_002_721;

/// Why no mesh can be chosen.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WorkspaceError {
    /// A tolerance that is not between zero and one.
    #[error("tolerance {0} is not between 0 and 1")]
    Tolerance(f64),
    /// There is no place for the plate.
    #[error("there is no place at which to estimate errors")]
    NoPlace,
    /// The plate covers an electrode or a part of it.
    #[error("a plate of which the centre is at {0} m touches an electrode")]
    Touches(DVec3),
    /// No electrode feels the plate.
    #[error("no electrode feels a plate of which the centre is at {0} m")]
    NotFelt(DVec3),
    /// Not even the finest mesh whose error can be estimated is exact enough.
    #[error(
        "no mesh of up to {tets} tetrahedra, as far as errors can be estimated, has an error of ΔC below {tolerance}: \
         that of the finest is about {reached:.1e}"
    )]
    OutOfReach {
        /// What was asked for.
        tolerance: f64,
        /// About the error of the finest mesh of which it can be estimated.
        reached: f64,
        /// How many tetrahedra that has.
        tets: usize,
    },
    /// The sensor cannot be meshed.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// The plate is no solid.
    #[error(transparent)]
    Plate(#[from] SolidError),
    /// The plate cannot be computed.
    #[error(transparent)]
    Simulator(#[from] SimulatorError),
}

/// What a mesh is wanted for.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshRequest {
    /// The largest relative error of ΔC over the workspace, as in [`ChangeError::of_all`](super::ChangeError).
    pub tolerance: f64,
    /// What the mesh is made of.
    pub kind: MeshKind,
    /// Where errors are estimated.
    pub probes: Probes,
    /// Threads for the estimates, all cores where there is no number. The choice does not depend on it.
    pub threads: Option<usize>,
}

/// A mesh that meets a tolerance.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshChoice {
    /// The sensor on that mesh.
    pub sensor: Sensor,
    /// How many tetrahedra were allowed: [`Sensor::generated`] makes the same mesh of it.
    pub allowed: usize,
    /// The estimated error of ΔC, the largest of all probes.
    pub error: f64,
    /// Tetrahedra of the lattice that it was compared with.
    pub compared_with: usize,
}

impl MeshRequest {
    /// The smallest mesh that is exact enough, of a tolerance and a kind: for the plate around the sensor, on all cores.
    pub fn new(design: &SensorDesign, tolerance: f64, kind: MeshKind) -> Self {
        Self { tolerance, kind, probes: Probes::around(design), threads: None }
    }

    /// Looks for the smallest mesh whose estimated error is below the tolerance.
    ///
    /// # Errors
    /// When the request or the design is invalid, the plate touches an electrode or is felt by none, or no mesh whose error
    /// can be estimated is exact enough.
    pub fn choose(&self, design: &SensorDesign) -> Result<MeshChoice, WorkspaceError> {
        if !(self.tolerance > 0.0 && self.tolerance < 1.0) {
            return Err(WorkspaceError::Tolerance(self.tolerance));
        }
        if self.probes.places.is_empty() {
            return Err(WorkspaceError::NoPlace);
        }
        let mut search = Search { request: self, design, tried: BTreeMap::new() };
        let mut coarser = search.first()?;
        let mut reference = search.finer_than(&coarser, STEPS[1])?;
        loop {
            let foreseen = search.foreseen(&coarser, &reference)?;
            let is_finest = reference.allowed == FINEST;
            let most = reference.tets as f64 / FINER;
            if (foreseen <= most || is_finest)
                && let Some(choice) = search.smallest(foreseen.min(most), &reference)?
            {
                return Ok(choice);
            }
            if is_finest || foreseen > HOPELESS {
                return Err(self.out_of_reach(foreseen));
            }
            let wanted = 1.25 * FINER * foreseen / reference.tets as f64;
            let finer = search.finer_than(&reference, wanted.clamp(STEPS[0], STEPS[1]))?;
            coarser = std::mem::replace(&mut reference, finer);
        }
    }

    /// Tells what the finest mesh would reach, from how many tetrahedra it takes.
    fn out_of_reach(&self, foreseen: f64) -> WorkspaceError {
        let tets = (FINEST as f64 / FINER) as usize;
        let reached = self.tolerance * (tets as f64 / foreseen).powf(ORDER);
        WorkspaceError::OutOfReach { tolerance: self.tolerance, reached, tets }
    }
}

/// What the plate changes on one mesh.
struct Rung {
    allowed: usize,
    tets: usize,
    changes: Vec<Change>,
}

struct Search<'a> {
    request: &'a MeshRequest,
    design: &'a SensorDesign,
    /// Meshes of the kind wanted, by how many tetrahedra were allowed; none where they were too few for the electrodes.
    tried: BTreeMap<usize, Option<Rung>>,
}

impl Search<'_> {
    fn rung(&self, kind: MeshKind, allowed: usize) -> Result<Rung, WorkspaceError> {
        let sensor = Sensor::generated(self.design, kind, allowed)?;
        let MeshRequest { tolerance, probes, threads, .. } = self.request;
        let tets = sensor.mesh().tets().len();
        Ok(Rung { allowed, tets, changes: probes.changes(sensor, *tolerance, *threads)? })
    }

    /// The first lattice: the smallest that resolves the electrodes, where that is larger than usual.
    fn first(&self) -> Result<Rung, WorkspaceError> {
        let mut allowed = FIRST;
        loop {
            allowed = match self.rung(MeshKind::Lattice, allowed) {
                Err(WorkspaceError::Sensor(SensorError::TooFewElements { needed, .. }))
                    if (allowed + 1..=FINEST).contains(&needed) =>
                {
                    needed
                }
                Err(WorkspaceError::Sensor(SensorError::OwnsNoNode(_))) if 2 * allowed <= FINEST => {
                    2 * allowed
                }
                rung => return rung,
            };
        }
    }

    /// A lattice of so many times as many tetrahedra.
    fn finer_than(&self, rung: &Rung, times: f64) -> Result<Rung, WorkspaceError> {
        let allowed = FINEST.min((rung.allowed as f64 * times) as usize);
        self.rung(MeshKind::Lattice, allowed)
    }

    /// The estimated error of a mesh, the largest of all probes.
    fn error(&self, rung: &Rung, reference: &Rung) -> Result<f64, WorkspaceError> {
        let mut difference = 0.0f64;
        let places = &self.request.probes.places;
        for ((ours, theirs), place) in rung.changes.iter().zip(&reference.changes).zip(places) {
            let error = ours.error(theirs).ok_or(WorkspaceError::NotFelt(*place))?;
            difference = difference.max(error.of_all);
        }
        if rung.tets >= reference.tets {
            return Ok(f64::INFINITY);
        }
        let left = (reference.tets as f64 / rung.tets as f64).powf(ORDER);
        Ok(difference / (1.0 - left))
    }

    /// How many tetrahedra it takes if errors fall as they should from those of a lattice.
    fn foreseen(&self, rung: &Rung, reference: &Rung) -> Result<f64, WorkspaceError> {
        let ratio = self.error(rung, reference)? / self.request.tolerance;
        Ok(rung.tets as f64 * ratio.powf(-1.0 / ORDER))
    }

    /// The smallest mesh that is exact enough, of those from which the reference is far enough.
    fn smallest(&mut self, foreseen: f64, reference: &Rung) -> Result<Option<MeshChoice>, WorkspaceError> {
        let most = reference.tets as f64 / FINER;
        let first = (TRIED_FIRST * foreseen / FIRST as f64).log(TRIED_NEXT).floor().max(-8.0) as i32;
        for step in first.. {
            let allowed = (FIRST as f64 * TRIED_NEXT.powi(step)) as usize;
            if allowed as f64 > most {
                return Ok(None);
            }
            if !self.tried.contains_key(&allowed) {
                let rung = match self.rung(self.request.kind, allowed) {
                    // Too few for the electrodes.
                    Err(WorkspaceError::Sensor(_)) => None,
                    rung => Some(rung?),
                };
                self.tried.insert(allowed, rung);
            }
            let Some(Some(rung)) = self.tried.get(&allowed) else { continue };
            let error = self.error(rung, reference)?;
            if error < self.request.tolerance {
                let sensor = Sensor::generated(self.design, self.request.kind, allowed)?;
                return Ok(Some(MeshChoice { sensor, allowed, error, compared_with: reference.tets }));
            }
        }
        Ok(None)
    }
}
