//! How a method can be set: mesh, interface model, where surfaces come from, preconditioner, tolerance.

use super::EvidenceError;
use super::stage::{Patience, Stage};
use crate::device::Device;
use crate::scene::GeometrySource;
use capsense_core::occupancy::Interface;
use capsense_core::sensor::{MeshKind, Sensor};
use capsense_core::solver::Preconditioner;
use capsense_core::workspace::MeshRequest;

/// What computes the frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// [`crate::core::simulator::Simulator`].
    Simulator,
    /// [`crate::core::baseline::PaperMethod`]: one depth layer, filled to the wall; K in double precision.
    Paper,
}

/// The mesh, as it is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MeshPlan {
    /// The graded lattice of at most so many tetrahedra.
    Adapted(usize),
    /// The lattice of even spacing of at most so many; planes lie in the edges of electrodes all the same.
    Uniform(usize),
    /// A coarse lattice bisected around the electrodes, of at most so many.
    Bisected(usize),
    /// The smallest graded lattice for a relative error of ΔC.
    ForError(f64),
}

/// How K is stored, which decides what multigrid there is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Storage {
    /// Three weights a node, geometric multigrid; of lattices only, and for no other preconditioner.
    Lattice,
    /// Compressed rows, multigrid by aggregation.
    Csr,
}

/// One way to compute frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setting {
    /// What computes them.
    pub method: Method,
    /// On which mesh.
    pub mesh: MeshPlan,
    /// How K is stored.
    pub storage: Storage,
    /// What surfaces do to the mesh.
    pub interface: Interface,
    /// Where surfaces come from; the depth camera has 64 by 64 pixels.
    pub geometry: GeometrySource,
    /// What conjugate gradients are preconditioned with.
    pub preconditioner: Preconditioner,
    /// When the iteration stops: the relative error of C, and for the paper's method the relative residual.
    pub tolerance: f64,
    /// Where fields are computed.
    pub device: Device,
    /// Threads of the solver.
    pub threads: usize,
    /// How many frames are run.
    pub patience: Patience,
}

impl MeshPlan {
    /// Its name, and the number of tetrahedra or the error that was asked for.
    pub fn name(self) -> (&'static str, f64) {
        match self {
            Self::Adapted(tets) => ("adapted", tets as f64),
            Self::Uniform(tets) => ("uniform", tets as f64),
            Self::Bisected(tets) => ("bisected", tets as f64),
            Self::ForError(error) => ("adapted-for-error", error),
        }
    }
}

impl Method {
    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Simulator => "capsense",
            Self::Paper => "paper",
        }
    }
}

impl Storage {
    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Lattice => "lattice",
            Self::Csr => "csr",
        }
    }
}

impl Setting {
    /// What computes the frames, in tables.
    pub fn method_name(&self) -> &'static str {
        if self.device == Device::Gpu { "capsense, graphics device" } else { self.method.name() }
    }

    /// The sensor on the mesh that is asked for.
    ///
    /// # Errors
    /// When the mesh cannot resolve the electrodes, or none is as exact as was asked for.
    pub fn sensor(&self, stage: &Stage) -> Result<Sensor, EvidenceError> {
        let design = &stage.design;
        let sensor = match self.mesh {
            MeshPlan::Adapted(tets) => Sensor::generated(design, MeshKind::Lattice, tets)?,
            MeshPlan::Bisected(tets) => Sensor::generated(design, MeshKind::Bisection, tets)?,
            MeshPlan::Uniform(tets) => Sensor::on_lattice(design, &uniform(stage, tets)?)?,
            MeshPlan::ForError(error) => {
                MeshRequest::new(design, error, MeshKind::Lattice).choose(design)?.sensor
            }
        };
        Ok(match self.storage {
            Storage::Lattice => sensor,
            Storage::Csr => sensor.off_lattice(),
        })
    }
}

/// The finest lattice of even spacing with at most so many tetrahedra.
fn uniform(stage: &Stage, tets: usize) -> Result<capsense_core::mesh::Lattice, EvidenceError> {
    /// Halvings of the range of spacings, to a thousandth.
    const STEPS: usize = 14;
    let extent = stage.design.domain.size().max_element();
    let (mut fits, mut exceeds) = (extent, 1e-3 * extent);
    let mut best = stage.design.lattice_of_spacing(extent, 1.0)?;
    for _ in 0..STEPS {
        let middle = (fits * exceeds).sqrt();
        let lattice = stage.design.lattice_of_spacing(middle, 1.0)?;
        if lattice.tet_count() <= tets {
            (fits, best) = (middle, lattice);
        } else {
            exceeds = middle;
        }
    }
    Ok(best)
}
