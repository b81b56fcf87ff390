//! Many scenes at once, for learning and sweeps: what differs between them is where objects are, and what they are made of.

use crate::occupancy::Surfaces;
use crate::simulator::{Simulator, SimulatorError, StepReport};
use rayon::prelude::*;

/// Simulators that go through frames together, on all cores.
///
/// Each keeps its own fields, so a scene's capacitances have the bits that its simulator alone would find. Simulators that
/// share a device ([`Simulator::with_remote`]) are solved for by the same launches.
///
/// # Example
/// ```
/// use capsense_core::batch::Batch;
/// # use capsense_core::electrode::{Electrode, Outline};
/// # use capsense_core::geometry::{Aabb, Pose, Shape};
/// # use capsense_core::material::{Connection, Material};
/// # use capsense_core::sensor::{Sensor, SensorDesign, Wall};
/// use capsense_core::simulator::Simulator;
/// use capsense_core::solids::Solids;
/// use capsense_core::solver::SolverOptions;
/// # use capsense_core::glam::{DQuat, DVec2, DVec3};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let domain = Aabb { min: DVec3::new(-0.1, -0.1, -0.1), max: DVec3::splat(0.1) };
/// # let outline = Outline::Rectangle { center: DVec2::ZERO, size: DVec2::splat(0.04) };
/// # let electrodes = vec![Electrode { name: "E1".into(), outline, z: 0.0 }];
/// # let design = SensorDesign { domain, electrodes, substrate: None, wall: Wall::Grounded };
/// # let sensor = Sensor::on_lattice(&design, &design.lattice(5_000)?)?;
/// let ball = Material::Conductor(Connection::Grounded);
/// let options = SolverOptions { threads: Some(1), ..SolverOptions::default() };
/// let simulator = Simulator::new(sensor, vec![ball], options)?;
/// let mut batch = Batch::new(vec![simulator; 4]);
/// let mut scenes = vec![Solids::new(&[Shape::Sphere { radius: 0.01 }])?; 4];
/// for (scene, solids) in scenes.iter_mut().enumerate() {
///     let translation = DVec3::new(0.0, 0.0, 0.03 + 0.01 * scene as f64);
///     solids.place(&[Pose { translation, rotation: DQuat::IDENTITY }])?;
/// }
/// for report in batch.step(&scenes) {
///     assert!(report?.solve.relative_error < 1e-4);
/// }
/// let of_scene = |scene: usize| batch.simulators()[scene].capacitance().get(0, 0);
/// assert!(of_scene(0) > of_scene(3));
/// # Ok(())
/// # }
/// ```
#[derive(Debug, Default)]
pub struct Batch {
    simulators: Vec<Simulator>,
}

impl Batch {
    /// Takes one simulator for each scene. Scenes are shared out to all cores, so let each have one thread.
    pub fn new(simulators: Vec<Simulator>) -> Self {
        Self { simulators }
    }

    /// One frame of every scene: [`Simulator::step`] with the surfaces of the same number. Scenes without surfaces stay as
    /// they are, and have no report. A scene that fails does not hold up the others.
    pub fn step<S: Surfaces + Sync>(&mut self, surfaces: &[S]) -> Vec<Result<StepReport, SimulatorError>> {
        let count = surfaces.len().min(self.simulators.len());
        self.step_all(count, |scene, simulator| simulator.update(&surfaces[scene]).map(|_| ()))
    }

    /// One frame of every scene whose objects are found where the fields are: [`Simulator::step_elsewhere`]. A scene that fails
    /// does not hold up the others.
    pub fn step_elsewhere(&mut self) -> Vec<Result<StepReport, SimulatorError>> {
        self.step_all(self.simulators.len(), |_, simulator| simulator.update_elsewhere())
    }

    fn step_all(
        &mut self,
        count: usize,
        update: impl Fn(usize, &mut Simulator) -> Result<(), SimulatorError> + Sync,
    ) -> Vec<Result<StepReport, SimulatorError>> {
        let simulators = &mut self.simulators[..count];
        let updated: Vec<Result<(), SimulatorError>> = simulators
            .par_iter_mut()
            .enumerate()
            .map(|(scene, simulator)| {
                update(scene, simulator)?;
                simulator.announce_solve();
                Ok(())
            })
            .collect();
        let solved = simulators.par_iter_mut().zip(updated).map(|(simulator, updated)| {
            updated?;
            let solve = simulator.solve()?;
            Ok(StepReport { changed_edges: simulator.changed_edges(), solve })
        });
        solved.collect()
    }

    /// The simulators one by one again.
    pub fn into_simulators(self) -> Vec<Simulator> {
        self.simulators
    }

    /// The simulators, in the state of the last frame.
    pub fn simulators(&self) -> &[Simulator] {
        &self.simulators
    }
}
