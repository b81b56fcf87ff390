//! Simulators whose fields are elsewhere, on a graphics device say, which may find the objects, too.

use super::{Simulator, SimulatorError, StepReport, may_float, nothing_there, refusal};
use crate::capacitance::own_potential;
use crate::material::Material;
use crate::occupancy::{Interface, Surfaces};
use crate::sensor::{FREE, Sensor};
use crate::solver::{NetworkProblem, RemoteFields, RemoteProblem, SolverOptions};
use crate::stiffness::StiffnessMatrix;

/// The part of the tolerance that is asked of fields elsewhere where there are strong dielectrics: what the potential of such
/// a body as a whole has ahead shows late, and nothing but iterations finds it there.
const STRONG_ON_DEVICE: f64 = 0.1;

impl Simulator {
    /// What fields elsewhere are made for where the mesh is a lattice.
    ///
    /// # Errors
    /// When the sensor's mesh is no lattice.
    pub fn remote_problem(sensor: &Sensor, materials: &[Material]) -> Result<RemoteProblem, SimulatorError> {
        let columns = columns(sensor, materials);
        let lattice = sensor.lattice().ok_or(SimulatorError::NotForDevice("the mesh is no lattice"))?;
        Ok(RemoteProblem { lattice: lattice.clone(), columns })
    }

    /// What fields elsewhere are made for where it is none. It assembles the matrix of the empty scene.
    ///
    /// # Errors
    /// When the sensor's mesh is a lattice.
    pub fn network_problem(
        sensor: &Sensor,
        materials: &[Material],
        interface: Interface,
    ) -> Result<NetworkProblem, SimulatorError> {
        if sensor.lattice().is_some() {
            return Err(SimulatorError::NotForDevice("the mesh is a lattice, which has a solver of its own"));
        }
        let (network, _) = nothing_there(sensor, materials, interface);
        let matrix = StiffnessMatrix::new(network, sensor.mesh().nodes().len());
        let fixed: Vec<bool> = sensor.terminals().iter().map(|&terminal| terminal != FREE).collect();
        Ok(NetworkProblem::new(&matrix, &fixed, columns(sensor, materials)))
    }

    /// [`Simulator::with_interface`] with fields that are solved for elsewhere: on what [`Simulator::remote_problem`] or
    /// [`Simulator::network_problem`] tells of this sensor and these materials.
    ///
    /// # Errors
    /// As [`Simulator::new`], and when the fields are not made for the sensor's mesh and these materials, the
    /// preconditioner is not multigrid, a dielectric is more polarisable or a tolerance finer than single precision allows, or what has
    /// the fields finds objects of other materials by itself.
    pub fn with_remote(
        sensor: Sensor,
        materials: Vec<Material>,
        options: SolverOptions,
        interface: Interface,
        remote: Box<dyn RemoteFields>,
    ) -> Result<Self, SimulatorError> {
        let strong = if materials.iter().any(may_float) { STRONG_ON_DEVICE } else { 1.0 };
        let options = SolverOptions { tolerance: strong * options.tolerance, ..options };
        refusal::check_remote(&materials, &options)?;
        let shape = [sensor.mesh().nodes().len(), columns(&sensor, &materials)];
        if shape != remote.shape() || sensor.lattice().is_none() != remote.is_of_network() {
            return Err(SimulatorError::NotForDevice(
                "its fields were made for another mesh or other objects",
            ));
        }
        if remote.finds().is_some_and(|found| found != materials || interface != Interface::EdgeCut) {
            return Err(SimulatorError::NotForDevice(
                "it finds objects of other materials, and that as surfaces that cut edges",
            ));
        }
        Self::build(sensor, materials, options, interface, Some(remote))
    }

    /// What stands for [`Simulator::update`] where the device that has the fields finds the objects by itself
    /// ([`RemoteFields::finds`]): takes over that they were placed anew, if they were. What they change is found when it is solved
    /// for.
    ///
    /// # Errors
    /// When the fields are not on such a device.
    pub fn update_elsewhere(&mut self) -> Result<(), SimulatorError> {
        if self.fields.found().is_none() {
            return Err(SimulatorError::NotForDevice("objects are not found where the fields are"));
        }
        self.is_unseen |= self.fields.take_placed_elsewhere();
        Ok(())
    }

    /// One frame where the device that has the fields finds the objects: [`Simulator::update_elsewhere`], then
    /// [`Simulator::solve`].
    ///
    /// # Errors
    /// As these two.
    pub fn step_elsewhere(&mut self) -> Result<StepReport, SimulatorError> {
        self.update_elsewhere()?;
        let solve = self.solve()?;
        Ok(StepReport { changed_edges: self.changed_edges(), solve })
    }

    /// Finds here, too, where objects are that a device found, for who looks at [`Simulator::occupancy`],
    /// [`Simulator::matrix`] or [`Simulator::capacitance_to_ground`], which otherwise are of an earlier frame. Nothing else
    /// depends on it. Where objects are found here anyway, there is nothing to do.
    ///
    /// # Errors
    /// When the depth image is invalid or shows another number of objects.
    pub fn look(&mut self, surfaces: &impl Surfaces) -> Result<(), SimulatorError> {
        if std::mem::replace(&mut self.is_unseen, false) {
            self.find(surfaces).inspect_err(|_| self.is_unseen = true)?;
            self.matrix.update(&self.occupancy);
            self.fields.move_conductors(&self.occupancy, self.sensor.electrode_names().len());
        }
        Ok(())
    }

    /// Tells fields that are elsewhere, see [`Simulator::with_remote`], that [`Simulator::solve`] will be called next: those of
    /// other simulators on the same device can then be computed by the same launches.
    pub fn announce_solve(&mut self) {
        self.fields.announce(&self.options);
    }
}

/// Number of fields: one for each electrode and for each object that finds its own potential.
fn columns(sensor: &Sensor, materials: &[Material]) -> usize {
    sensor.electrode_names().len() + materials.iter().filter_map(own_potential).count()
}
