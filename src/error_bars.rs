//! Error bars beside capacitances: some frames are computed once more, on a mesh with all spacings halved.
//!
//! The halved mesh has eight times as many elements, so it is asked for one frame in many ([`ErrorEstimator::every`]), and a pipeline
//! without it is as fast as if there were none. On it surfaces cut edges, whatever the scene's interface model. Where links at
//! rims weigh what suits the mesh, these frames are computed on the mesh with links that do not, too ([`unweighed_sensor`]). Bars tell of
//! the mesh and of the unfinished iteration, not of what a camera's pixels leave out, nor of materials and places that are not as the
//! scene says.

use crate::pipeline::{Frame, Pipeline, PipelineError};
use crate::scene::{Scene, SceneSensor};
use capsense_core::estimate::{ErrorBars, HalvedMesh, halved_lattice};
use capsense_core::glam::DVec3;
use capsense_core::mesh::TetMesh;
use capsense_core::occupancy::Interface;
use capsense_core::sensor::{ElectrodeNodes, GROUND, Sensor, SensorDesign, SensorError, Terminal, Wall};
use capsense_core::simulator::Simulator;
use capsense_core::solver::{Preconditioner, SolverOptions};

/// The part of a run's time that the halved mesh may take, once it is made.
const SHARE: f64 = 0.2;

/// What a frame costs per node on the halved mesh, at most, in what it costs on the mesh: bodies have moved far since it was
/// asked last, and less of it is in the processor's caches. Measured: docs/validation.md.
const COST_OF_NODE: f64 = 8.0;

/// Errors that the iteration leaves on the halved mesh, in those that it may leave on the mesh.
const TOLERANCE: f64 = 0.1;

/// Parts that a tetrahedron has in the halved mesh.
const PARTS: usize = 8;

/// Largest numbers of tetrahedra of halved meshes. `capsense solve` of the largest lattice, which is the largest that a tolerance chooses,
/// needs 1.8 GB with four electrodes; other meshes need several times as much for each tetrahedron.
const MOST_TETS: usize = 8_000_000;
const MOST_TETS_OF_LATTICES: usize = 16_000_000;

/// Tells error bars of the frames of a scene.
#[derive(Debug)]
pub struct ErrorEstimator {
    halved: Simulator,
    /// On the mesh itself, where links at its rims are weighed, with links that are not.
    unweighed: Option<Simulator>,
    every: usize,
    /// The first frame that they are told in.
    first: usize,
}

impl ErrorEstimator {
    /// Halves the mesh of a pipeline and solves the scene without objects on it. `None` where the halved mesh would have
    /// more than eight million tetrahedra, or as a lattice more than sixteen.
    ///
    /// # Errors
    /// When the halved mesh is no mesh of the sensor, or the solver fails on it or on the mesh with other links.
    pub fn new(scene: &Scene, pipeline: &Pipeline) -> Result<Option<Self>, PipelineError> {
        let sensor = pipeline.simulator().sensor();
        if !may_be_halved(sensor.lattice().is_some(), sensor.mesh().tets().len()) {
            return Ok(None);
        }
        let halved = halved_sensor(scene, sensor).map_err(PipelineError::Halved)?;
        let unweighed = unweighed_sensor(scene, sensor).map_err(PipelineError::Halved)?;
        let nodes = |sensor: &Sensor| sensor.mesh().nodes().len() as f64;
        let more = nodes(&halved) + unweighed.as_ref().map_or(0.0, nodes);
        let materials: Vec<_> = scene.objects.iter().map(|object| object.material).collect();
        let options = SolverOptions {
            tolerance: TOLERANCE * scene.solver.tolerance,
            change_tolerance: scene.solver.change_tolerance.map(|tolerance| TOLERANCE * tolerance),
            preconditioner: Preconditioner::Multigrid,
            ..scene.solver
        };
        let every = (COST_OF_NODE * more / nodes(sensor) / SHARE).ceil() as usize;
        let simulator =
            |sensor, interface| Simulator::with_interface(sensor, materials.clone(), options, interface);
        Ok(Some(Self {
            halved: simulator(halved, Interface::EdgeCut)?,
            unweighed: unweighed.map(|unweighed| simulator(unweighed, scene.interface)).transpose()?,
            every,
            first: every.min(scene.frames) / 2,
        }))
    }

    /// In each how many frames bars are to be told for them to take less than a fifth of a run. It follows from the sizes of the
    /// meshes alone.
    pub fn every(&self) -> usize {
        self.every
    }

    /// Whether bars are to be told in a frame: in the middle of each so many, or of a run that is shorter.
    pub fn is_due(&self, frame: usize) -> bool {
        frame % self.every == self.first
    }

    /// The mesh with all spacings halved.
    pub fn mesh(&self) -> &TetMesh {
        self.halved.sensor().mesh()
    }

    /// Error bars of the frame that a pipeline computed last.
    ///
    /// # Errors
    /// When the solver fails on the halved mesh or on that with other links, or objects cannot be drawn for it.
    pub fn estimate(&mut self, pipeline: &mut Pipeline, frame: &Frame) -> Result<ErrorBars, PipelineError> {
        for simulator in [&mut self.halved].into_iter().chain(&mut self.unweighed) {
            pipeline.show_to(simulator)?;
            let _ = simulator.solve()?;
        }
        Ok(pipeline.simulator().error_bars(self.unweighed.as_ref(), &self.halved, &frame.solve))
    }
}

/// Whether a mesh of so many tetrahedra is small enough to be halved.
fn may_be_halved(is_lattice: bool, tets: usize) -> bool {
    tets.saturating_mul(PARTS) <= if is_lattice { MOST_TETS_OF_LATTICES } else { MOST_TETS }
}

/// The sensor of a scene, given on the scene's mesh, with links at rims that weigh what cells around them ask for, if these weigh what
/// suits the mesh instead.
///
/// # Errors
/// When the sensor cannot be made anew, as for one of another scene.
pub fn unweighed_sensor(scene: &Scene, sensor: &Sensor) -> Result<Option<Sensor>, SensorError> {
    match &scene.sensor {
        SceneSensor::Generated { design, .. } => unweighed(design, sensor),
        SceneSensor::Meshed { .. } => Ok(None),
    }
}

/// The same of a design.
///
/// # Errors
/// As [`unweighed_sensor`].
pub fn unweighed(design: &SensorDesign, sensor: &Sensor) -> Result<Option<Sensor>, SensorError> {
    let Some(lattice) = sensor.lattice() else { return Ok(None) };
    let unweighed = Sensor::on_lattice(design, lattice)?;
    Ok((unweighed.rim() != sensor.rim()).then_some(unweighed))
}

/// The sensor of a scene, given on the scene's mesh, on that with all spacings halved.
///
/// # Errors
/// When this is no mesh of the sensor.
pub fn halved_sensor(scene: &Scene, sensor: &Sensor) -> Result<Sensor, SensorError> {
    match (&scene.sensor, sensor.lattice()) {
        (SceneSensor::Generated { design, .. }, Some(lattice)) => {
            Sensor::on_lattice(design, &halved_lattice(lattice)?)
        }
        (SceneSensor::Generated { design, .. }, None) => {
            let nodes = (0..).zip(sensor.owners()).zip(sensor.mesh().nodes());
            let is_ground = |owner: Terminal, place: DVec3| owner == GROUND || design.is_on_wall(place);
            let ground: Vec<u32> = nodes
                .filter(|((_, owner), place)| is_ground(**owner, **place))
                .map(|((node, _), _)| node)
                .collect();
            let shape =
                |e: &capsense_core::electrode::Electrode| (e.name.clone(), ElectrodeNodes::Shape(e.clone()));
            let electrodes: Vec<_> = design.electrodes.iter().map(shape).collect();
            on_halved_mesh(scene.wall, sensor.mesh(), &ground, &electrodes)
        }
        (SceneSensor::Meshed { mesh, ground, electrodes }, _) => {
            on_halved_mesh(scene.wall, mesh, ground, electrodes)
        }
    }
}

fn on_halved_mesh(
    wall: Wall,
    mesh: &TetMesh,
    ground: &[u32],
    electrodes: &[(String, ElectrodeNodes)],
) -> Result<Sensor, SensorError> {
    let halved = HalvedMesh::new(mesh)?;
    let nodes_of = |nodes: &ElectrodeNodes| match nodes {
        ElectrodeNodes::Nodes(nodes) => ElectrodeNodes::Nodes(halved.nodes_on(nodes)),
        ElectrodeNodes::Shape(shape) => ElectrodeNodes::Shape(shape.clone()),
    };
    let electrodes = electrodes.iter().map(|(name, nodes)| (name.clone(), nodes_of(nodes))).collect();
    let ground = halved.nodes_on(ground);
    Sensor::on_mesh_within(wall, halved.into_mesh(), &ground, electrodes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_lattice_of_a_tolerance_may_be_halved() {
        for (is_lattice, most) in [(true, 2_000_000), (false, 1_000_000)] {
            assert!(may_be_halved(is_lattice, most) && !may_be_halved(is_lattice, most + 1));
        }
        assert!(!may_be_halved(true, usize::MAX));
    }
}
