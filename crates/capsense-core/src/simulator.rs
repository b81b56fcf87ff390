//! The main path of a frame: occupancy, stiffness, solve, capacitance.

mod elsewhere;
mod refusal;
#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;

use crate::capacitance::{CapacitanceMatrix, own_potential};
use crate::estimate::{Capacitances, ErrorBars};
use crate::fields::Fields;
use crate::material::Material;
use crate::occupancy::{Contact, EdgeGeometry, Interface, Occupancy, Surfaces, may_be_immersed, unresolved};
use crate::sensor::Sensor;
use crate::solver::{CONTRAST, Preconditioner, RemoteFields, SolveReport, SolverOptions};
use crate::stiffness::{EdgeNetwork, StiffnessMatrix};
pub use refusal::SimulatorError;

/// Largest relative error of the self-capacitances of the empty scene.
const TOLERANCE_AT_REST: f64 = 1e-8;

/// What a frame took.
#[must_use]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepReport {
    /// Number of edges whose coupling or ends changed.
    pub changed_edges: usize,
    /// What the solver reached.
    pub solve: SolveReport,
}

/// A sensor in a scene: from where the objects are to the capacitance matrix over the electrodes.
///
/// Objects are part of the result, not of the matrix: grounded ones are at 0 V, floating ones carry no net charge,
/// ones tied to ground through a capacitance C_g carry -C_g V.
///
/// # Example
/// A grounded plate 20 mm above a square electrode, seen by a depth camera of 32 by 32 pixels:
/// ```
/// use capsense_core::electrode::{Electrode, Outline};
/// use capsense_core::material::{Connection, Material};
/// use capsense_core::occupancy::{DepthLayers, OrthographicView};
/// use capsense_core::sensor::{Sensor, SensorDesign, Wall};
/// use capsense_core::simulator::Simulator;
/// use capsense_core::{geometry::Aabb, glam::{DVec2, DVec3}, solver::SolverOptions};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let domain = Aabb { min: DVec3::new(-0.1, -0.1, -0.1), max: DVec3::splat(0.1) };
/// let outline = Outline::Rectangle { center: DVec2::ZERO, size: DVec2::splat(0.04) };
/// let electrodes = vec![Electrode { name: "E1".into(), outline, z: 0.0 }];
/// let design = SensorDesign { domain, electrodes, substrate: None, wall: Wall::Grounded };
/// let sensor = Sensor::on_lattice(&design, &design.lattice(10_000)?)?;
/// let plate = Material::Conductor(Connection::Grounded);
/// let mut simulator = Simulator::new(sensor, vec![plate], SolverOptions::default())?;
///
/// let mut depth = DepthLayers::empty(OrthographicView { domain, width: 32, height: 32 }, 1);
/// let (front, back) = depth.layer_mut(0);
/// front.fill(0.02);
/// back.fill(0.03);
/// let report = simulator.step(&depth)?;
/// assert!(report.solve.relative_error < 1e-4);
/// let change = simulator.capacitance().get(0, 0) - simulator.base().get(0, 0);
/// assert!(change > 0.0, "{change} F");
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Simulator {
    sensor: Sensor,
    materials: Vec<Material>,
    interface: Interface,
    options: SolverOptions,
    matrix: StiffnessMatrix,
    occupancy: Occupancy,
    fields: Fields,
    /// Over the columns of the fields and ground, of which gaps alone tell, no object released yet; and the same with all released.
    held: CapacitanceMatrix,
    released: CapacitanceMatrix,
    base: CapacitanceMatrix,
    capacitance: CapacitanceMatrix,
    /// Whether occupancy and matrix are not those of the last frame, as a device found its objects.
    is_unseen: bool,
}

impl Simulator {
    /// Assembles the stiffness matrix and solves the empty scene. Surfaces of objects will cut mesh edges.
    ///
    /// # Errors
    /// When the options or a material's values are out of range, or the empty scene cannot be solved.
    pub fn new(
        sensor: Sensor,
        materials: Vec<Material>,
        options: SolverOptions,
    ) -> Result<Self, SimulatorError> {
        Self::with_interface(sensor, materials, options, Interface::EdgeCut)
    }

    /// The same with another interface model.
    ///
    /// # Errors
    /// As [`Simulator::new`].
    pub fn with_interface(
        sensor: Sensor,
        materials: Vec<Material>,
        options: SolverOptions,
        interface: Interface,
    ) -> Result<Self, SimulatorError> {
        Self::build(sensor, materials, options, interface, None)
    }

    fn build(
        sensor: Sensor,
        materials: Vec<Material>,
        options: SolverOptions,
        interface: Interface,
        remote: Option<Box<dyn RemoteFields>>,
    ) -> Result<Self, SimulatorError> {
        refusal::check(&sensor, &materials, &options)?;
        let nodes = sensor.mesh().nodes().len();
        let (network, occupancy) = nothing_there(&sensor, &materials, interface);
        // Only multigrid has an operator of its own for lattices.
        let mut matrix = match options.preconditioner {
            Preconditioner::Multigrid => StiffnessMatrix::new(network, nodes),
            _ => StiffnessMatrix::in_rows(network, nodes),
        };
        let mut fields = Fields::new(&sensor, &materials, &matrix, &options, remote);
        fields.note_changes(&matrix, &[]);
        fields.refresh(&matrix, &occupancy, false, &options);
        fields.settle();
        matrix.settle();
        let electrodes = CapacitanceMatrix::zeros(sensor.electrode_names().len());
        let terminals = CapacitanceMatrix::zeros(fields.columns() + 1);
        let mut simulator = Self {
            held: terminals.clone(),
            released: terminals,
            base: electrodes.clone(),
            capacitance: electrodes,
            sensor,
            materials,
            interface,
            options,
            matrix,
            occupancy,
            fields,
            is_unseen: false,
        };
        // More steps than needed show the condition number, from which errors are told in all frames that follow.
        simulator.options.tolerance = options.tolerance.min(TOLERANCE_AT_REST);
        let _ = simulator.solve()?;
        simulator.options = options;
        simulator.base = simulator.capacitance.clone();
        simulator.fields.remember_base(&simulator.matrix, &options);
        Ok(simulator)
    }

    /// One frame: [`Simulator::update`], then [`Simulator::solve`].
    ///
    /// # Errors
    /// As these two.
    ///
    /// # Example
    /// From electrodes, a mesh and a pose to a capacitance matrix: a grounded bar, known as a solid, passes 20 mm above two
    /// electrodes.
    /// ```
    /// use capsense_core::{electrode::{Electrode, Outline}, geometry::{Aabb, Pose, Shape}, glam::{DVec2, DVec3}};
    /// use capsense_core::{material::{Connection, Material}, sensor::{Sensor, SensorDesign, Wall}};
    /// use capsense_core::{simulator::Simulator, solids::Solids, solver::SolverOptions};
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let domain = Aabb { min: DVec3::new(-0.2, -0.2, -0.1), max: DVec3::new(0.2, 0.2, 0.3) };
    /// let electrode = |name: &str, x: f64| {
    ///     let outline = Outline::Rectangle { center: DVec2::new(x, 0.0), size: DVec2::splat(0.04) };
    ///     Electrode { name: name.into(), outline, z: 0.0 }
    /// };
    /// let electrodes = vec![electrode("left", -0.03), electrode("right", 0.03)];
    /// let design = SensorDesign { domain, electrodes, substrate: None, wall: Wall::Grounded };
    /// let sensor = Sensor::on_lattice(&design, &design.lattice(10_000)?)?;
    /// let bar = Material::Conductor(Connection::Grounded);
    /// let mut simulator = Simulator::new(sensor, vec![bar], SolverOptions::default())?;
    /// let mut solids = Solids::new(&[Shape::Box { size: DVec3::new(0.03, 0.1, 0.02) }])?;
    /// for x in [-0.03, 0.0, 0.03] {
    ///     solids.place(&[Pose::at(DVec3::new(x, 0.0, 0.03))])?;
    ///     let report = simulator.step(&solids)?;
    ///     println!("{x} m: {:?} F, {} iterations", simulator.capacitance(), report.solve.iterations);
    /// }
    /// # let change = |entry| simulator.capacitance().get(entry, entry) - simulator.base().get(entry, entry);
    /// # assert!(change(1) > 2.0 * change(0) && change(0) > 0.0);
    /// # Ok(())
    /// # }
    /// ```
    pub fn step(&mut self, surfaces: &impl Surfaces) -> Result<StepReport, SimulatorError> {
        let _awake = self.fields.wake();
        let changed_edges = self.update(surfaces)?;
        let solve = self.solve()?;
        Ok(StepReport { changed_edges, solve })
    }

    /// Takes over where the objects are now and returns how many edges that changed.
    ///
    /// # Errors
    /// When the depth image is invalid or shows another number of objects. The frame before stays in force.
    pub fn update(&mut self, surfaces: &impl Surfaces) -> Result<usize, SimulatorError> {
        if self.fields.found().is_some() {
            return Err(SimulatorError::NotForDevice("it finds the objects by itself"));
        }
        let _awake = self.fields.wake();
        self.find(surfaces)?;
        self.fields.bracket(
            &self.matrix,
            &self.occupancy,
            self.sensor.electrode_names().len(),
            &self.options,
        );
        self.matrix.update(&self.occupancy);
        if self.matrix.rim_changed() {
            self.fields.lose_bracket();
        }
        self.fields.move_conductors(&self.occupancy, self.sensor.electrode_names().len());
        self.fields.forget_absent_objects(&self.occupancy, self.sensor.electrode_names().len());
        self.fields.note_changes(&self.matrix, self.occupancy.changed_nodes());
        let islands = self.materials.iter().any(may_float);
        self.fields.refresh(&self.matrix, &self.occupancy, islands, &self.options);
        Ok(self.occupancy.changed_edges().len())
    }

    fn find(&mut self, surfaces: &impl Surfaces) -> Result<(), SimulatorError> {
        surfaces.validate()?;
        if surfaces.objects() != self.materials.len() {
            return Err(SimulatorError::ObjectCount {
                seen: surfaces.objects(),
                known: self.materials.len(),
            });
        }
        let mesh = EdgeGeometry {
            nodes: self.sensor.mesh().nodes(),
            terminals: self.sensor.owners(),
            edges: self.matrix.network().edges(),
            permittivity: self.matrix.network().permittivity(),
        };
        self.occupancy.update_with(self.fields.workers(), mesh, &self.materials, surfaces);
        Ok(())
    }

    /// Solves for the fields, starting from those of the frame before, and evaluates the capacitance matrix.
    ///
    /// # Errors
    /// When the solver fails; [`Simulator::capacitance`] then still is that of the frame before, and the next solve
    /// starts from zero.
    pub fn solve(&mut self) -> Result<SolveReport, SimulatorError> {
        let _awake = self.fields.wake();
        let report = self.fields.solve(&self.matrix, &self.options).inspect_err(|_| self.fields.reset())?;
        self.fields.maxwell(&mut self.held);
        self.add_gaps();
        self.released.copy_leading(&self.held);
        for (object, to_ground) in released_objects(&self.materials, self.capacitance.size()) {
            self.released.release(object, to_ground);
        }
        self.capacitance.copy_leading(&self.released);
        if cfg!(debug_assertions) && self.contacts().is_empty() {
            self.assert_maxwell();
        }
        Ok(report)
    }

    /// Where a device finds the objects, gaps between them are not known here.
    fn add_gaps(&mut self) {
        if self.fields.found().is_none() {
            let electrodes = self.sensor.electrode_names().len();
            self.fields.add_gaps(&self.matrix, &self.occupancy, electrodes, &mut self.held);
        }
    }

    /// What every Maxwell matrix satisfies, up to what the iteration may leave of the matrix before objects were
    /// released. The signs hold where no weight of an edge is negative; meshes from elsewhere may have obtuse angles.
    fn assert_maxwell(&self) {
        let c = &self.capacitance;
        let slack =
            |i, j| (1e-6 + self.options.tolerance) * (self.held.get(i, i) * self.held.get(j, j)).sqrt();
        for i in 0..c.size() {
            assert!(c.get(i, i) > 0.0, "C_{i}{i} is not positive: {c:?}");
            let mut row_sum = c.get(i, i);
            let mut row_slack = slack(i, i);
            for j in (0..c.size()).filter(|&j| j != i) {
                assert!(c.get(i, j).to_bits() == c.get(j, i).to_bits(), "not symmetric: {c:?}");
                assert!(
                    self.sensor.lattice().is_none() || c.get(i, j) <= slack(i, j),
                    "C_{i}{j} is positive: {c:?}"
                );
                row_sum += c.get(i, j);
                row_slack += slack(i, j);
            }
            assert!(
                self.sensor.lattice().is_none() || row_sum >= -row_slack,
                "row {i} sums to {row_sum}: {c:?}"
            );
        }
    }

    /// The Maxwell capacitance matrix over the electrodes in the last frame solved.
    pub fn capacitance(&self) -> &CapacitanceMatrix {
        &self.capacitance
    }

    /// The same with all objects at 0 V: over the electrodes, those objects that find their own potential, and ground, of which
    /// gaps alone tell.
    pub(crate) fn with_objects_held(&self) -> &CapacitanceMatrix {
        &self.held
    }

    /// The potential of a node, in volts, with one of the electrodes or objects of [`Simulator::with_objects_held`] at 1 V and all
    /// others at 0 V, as the last solve on the processor left the field.
    pub(crate) fn potential_with_objects_held(&self, column: usize, node: usize) -> f64 {
        self.fields.potential(column, node)
    }

    /// Entries of the Maxwell matrix between each electrode and ground with all that is grounded: farads, negative.
    /// They are charges on the ground, not the negated row sums of [`Simulator::capacitance`], and so a check on
    /// them. A capacitance from an object to ground is not part of it.
    ///
    /// # Errors
    /// When the fields are on a device that fails, or that found the objects and nobody called [`Simulator::look`] since.
    pub fn capacitance_to_ground(&self) -> Result<Vec<f64>, SimulatorError> {
        if self.is_unseen {
            return Err(SimulatorError::NotForDevice("its objects were not looked at on the processor"));
        }
        let mut all = self.held.clone();
        let ground = all.size() - 1;
        for (column, charge) in self.fields.charges_on_ground(&self.matrix)?.into_iter().enumerate() {
            all.set(column, ground, all.get(column, ground) + charge);
        }
        for (object, to_ground) in released_objects(&self.materials, self.capacitance.size()) {
            all.release(object, to_ground);
        }
        Ok((0..self.capacitance.size()).map(|electrode| all.get(electrode, ground)).collect())
    }

    /// The potential of each node, in volts, with one electrode at 1 V and the others at 0 V, as the last solve left the
    /// field: what `potentials` holds afterwards. Objects that find their own potential have it, by
    /// [`Simulator::capacitance`]'s rule for them.
    ///
    /// # Errors
    /// When the fields are on a device that fails; then `potentials` stays as it is.
    ///
    /// # Panics
    /// When there is no such electrode.
    pub fn potentials(&self, electrode: usize, potentials: &mut Vec<f64>) -> Result<(), SimulatorError> {
        let electrodes = self.capacitance.size();
        assert!(electrode < electrodes, "electrode {electrode} of {electrodes}");
        let mut shown =
            released_objects(&self.materials, electrodes).map(|(object, _)| object).chain([electrode]);
        shown.try_for_each(|column| self.fields.read(column))?;
        let objects: Vec<(usize, f64)> = released_objects(&self.materials, electrodes)
            .map(|(object, to_ground)| {
                // With all others released, the charge that the electrode's volt leaves on an object is its own to undo.
                let mut left = self.held.clone();
                for (other, to_ground) in released_objects(&self.materials, electrodes) {
                    if other != object {
                        left.release(other, to_ground);
                    }
                }
                let pivot = left.get(object, object) + to_ground;
                (object, if pivot > 0.0 { -left.get(object, electrode) / pivot } else { 0.0 })
            })
            .collect();
        potentials.clear();
        potentials.extend((0..self.sensor.mesh().nodes().len()).map(|node| {
            let of_objects =
                objects.iter().map(|&(object, volts)| volts * self.fields.potential(object, node));
            self.fields.potential(electrode, node) + of_objects.sum::<f64>()
        }));
        Ok(())
    }

    /// The Maxwell capacitance matrix of the empty scene.
    pub fn base(&self) -> &CapacitanceMatrix {
        &self.base
    }

    /// Error bars of [`Simulator::capacitance`] and of its change from [`Simulator::base`]: from the mesh, as `halved` shows
    /// the same scene in the same frame on a mesh with all spacings halved, and from the unfinished iteration. Where links at
    /// this sensor's rims weigh what suits its mesh ([`workspace`](crate::workspace)), `unweighed` is to show the
    /// same on the mesh with links that do not ([`Sensor::on_lattice`]). Whatever this
    /// simulator's interface model, surfaces are to cut edges on the halved mesh ([`Interface::EdgeCut`]): the other models fill
    /// whole elements, and would be wrong by nearly as much there.
    ///
    /// # Panics
    /// When another simulator has another number of electrodes.
    pub fn error_bars(
        &self,
        unweighed: Option<&Simulator>,
        halved: &Simulator,
        report: &SolveReport,
    ) -> ErrorBars {
        let [own, unweighed, halved] = [self, unweighed.unwrap_or(self), halved]
            .map(|of| Capacitances { capacitance: &of.capacitance, base: &of.base });
        ErrorBars::between(own, unweighed, halved, report.relative_error)
    }

    /// The sensor.
    pub fn sensor(&self) -> &Sensor {
        &self.sensor
    }

    /// The preconditioner in use.
    pub fn preconditioner(&self) -> Preconditioner {
        self.options.preconditioner
    }

    /// The stiffness matrix of the last frame, or of the last [`Simulator::look`] where a device finds objects.
    pub fn matrix(&self) -> &StiffnessMatrix {
        &self.matrix
    }

    /// Conducting objects that touch or cover electrodes in the last frame, in increasing order. The capacitances of
    /// what touches are then not those of any sensor, but artefacts of the mesh.
    pub fn contacts(&self) -> &[Contact] {
        self.fields.found().map_or(self.occupancy.contacts(), |found| &found.contacts)
    }

    /// Number of edges whose coupling or ends changed in the last frame.
    pub fn changed_edges(&self) -> usize {
        self.fields.found().map_or(self.occupancy.changed_edges().len(), |found| found.changed_edges)
    }

    /// Objects that the mesh is too coarse for, in increasing order: strong dielectrics thinner than cells, bodies that fill
    /// no element where elements are filled, all that lie between edges, conductors on an edge between two
    /// others that hold its ends, and, where a device finds objects, conductors across whose gap edges lead. What they do is missing in the capacitances, and
    /// [`Simulator::error_bars`] may not show it, as the halved mesh hardly sees more. To be asked for now and then: it looks at
    /// all edges near objects, and allocates a list of them.
    pub fn unresolved(&self, surfaces: &impl Surfaces) -> Vec<usize> {
        let (weights, gaps_are_lost) = (self.matrix.network().weights(), self.fields.found().is_some());
        let how = (self.interface, gaps_are_lost);
        unresolved(self.edge_geometry(), weights, how, &self.materials, surfaces)
    }

    fn edge_geometry(&self) -> EdgeGeometry<'_> {
        EdgeGeometry {
            nodes: self.sensor.mesh().nodes(),
            terminals: self.sensor.owners(),
            edges: self.matrix.network().edges(),
            permittivity: self.matrix.network().permittivity(),
        }
    }

    /// What objects occupy in the last frame, or when [`Simulator::look`] was called last where a device finds them.
    pub fn occupancy(&self) -> &Occupancy {
        &self.occupancy
    }
}

/// The network of a sensor and what occupies it before anything does, with what `interface` needs for such objects.
pub(crate) fn nothing_there(
    sensor: &Sensor,
    materials: &[Material],
    interface: Interface,
) -> (EdgeNetwork, Occupancy) {
    let has_dielectrics = materials.iter().any(|material| matches!(material, Material::Dielectric(_)));
    let (mesh, nodes) = (sensor.mesh(), sensor.mesh().nodes().len());
    let is_of_conductors = interface == Interface::EdgeCut && !has_dielectrics;
    let network = match interface {
        Interface::EdgeCut if is_of_conductors => EdgeNetwork::of_sensor(sensor),
        Interface::EdgeCut => EdgeNetwork::of_sensor_with_all_edges(sensor),
        Interface::Centroid | Interface::VolumeFraction => EdgeNetwork::of_sensor_elements(sensor),
    };
    let occupancy = match is_of_conductors {
        true => Occupancy::empty(nodes, network.edges().len()),
        false => Occupancy::with_interface(interface, mesh, network.edges()),
    };
    // A single conductor alone scales no weights.
    let are_scaled = has_dielectrics || materials.len() > 1;
    let mut occupancy = occupancy.with_weights(mesh, network.edges(), network.weights(), are_scaled);
    if sensor.open_wall().is_some() {
        occupancy = occupancy.with_open_wall();
    }
    if has_dielectrics {
        occupancy = occupancy.with_background(mesh, network.edges());
    }
    if interface == Interface::EdgeCut && may_be_immersed(mesh, materials) {
        occupancy = occupancy.with_immersed_elements(mesh, network.edges());
    }
    (network, occupancy)
}

/// Whether a dielectric is so polarisable that it nearly is a floating conductor.
fn may_float(material: &Material) -> bool {
    matches!(material, Material::Dielectric(permittivity) if permittivity.value() >= CONTRAST)
}

/// Columns of the objects that find their own potential, which come after those of the electrodes, and the capacitance
/// of each to ground.
fn released_objects(materials: &[Material], electrodes: usize) -> impl Iterator<Item = (usize, f64)> {
    (electrodes..).zip(materials.iter().filter_map(own_potential))
}
