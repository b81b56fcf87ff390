//! The main path of a frame: occupancy, stiffness, solve, capacitance.

use crate::capacitance::{CapacitanceMatrix, own_potential};
use crate::estimate::discretisation_error;
use crate::material::{Connection, Material};
use crate::occupancy::{Contact, EdgeGeometry, InvalidDepth, NO_OBJECT, Occupancy, Surfaces};
use crate::sensor::{FREE, Sensor, Terminal};
use crate::solver::{Pcg, Preconditioner, SolveError, SolveReport, SolverOptions};
use crate::stiffness::{EdgeNetwork, LANES, Lane, StiffnessMatrix};
use crate::units::VACUUM_PERMITTIVITY;

/// Why a frame cannot be computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SimulatorError {
    /// The objects seen are not those that were announced.
    #[error("{seen} objects are seen, but the simulator knows the materials of {known}")]
    ObjectCount {
        /// Number of objects seen.
        seen: usize,
        /// Number of materials.
        known: usize,
    },
    /// More objects and electrodes than terminals can be numbered.
    #[error("{0} objects are more than can be numbered")]
    TooManyObjects(usize),
    /// A capacitance to ground that is negative or not finite.
    #[error("object {object} has a capacitance to ground of {farads} F; it must be finite and not negative")]
    CapacitanceToGround {
        /// Index of the object.
        object: usize,
        /// The value given.
        farads: f64,
    },
    /// A tolerance that is not between zero and one.
    #[error("tolerance {0} is not between 0 and 1")]
    Tolerance(f64),
    /// The depth image is no picture of surfaces.
    #[error(transparent)]
    Depth(#[from] InvalidDepth),
    /// The field could not be solved for.
    #[error(transparent)]
    Solve(#[from] SolveError),
}

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
/// use capsense_core::sensor::{Sensor, SensorDesign};
/// use capsense_core::simulator::Simulator;
/// use capsense_core::{geometry::Aabb, glam::{DVec2, DVec3}, solver::SolverOptions};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let domain = Aabb { min: DVec3::new(-0.1, -0.1, -0.1), max: DVec3::splat(0.1) };
/// let outline = Outline::Rectangle { center: DVec2::ZERO, size: DVec2::splat(0.04) };
/// let electrodes = vec![Electrode { name: "E1".into(), outline, z: 0.0 }];
/// let design = SensorDesign { domain, electrodes, substrate: None };
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
    options: SolverOptions,
    matrix: StiffnessMatrix,
    occupancy: Occupancy,
    fields: Fields,
    /// Over the columns of the fields and ground, no object released yet; and the same with all released.
    held: CapacitanceMatrix,
    released: CapacitanceMatrix,
    base: CapacitanceMatrix,
    capacitance: CapacitanceMatrix,
}

/// The potential of every row with one terminal at 1 V and all others at 0 V, one column for each terminal that needs
/// one: electrodes, then objects that find their own potential.
#[derive(Clone, Debug)]
struct Fields {
    terminals: Vec<Terminal>,
    /// Terminal of each row, [`FREE`] where the potential is unknown.
    row_terminals: Vec<Terminal>,
    fixed: Vec<bool>,
    /// For each object: how many nodes it holds, whether a link leads to it, and whether it had either when last seen.
    nodes_held: Vec<u32>,
    linked: Vec<bool>,
    present: Vec<bool>,
    /// Columns in groups of [`LANES`].
    potentials: Vec<Vec<Lane>>,
    charges: Vec<Vec<Lane>>,
    pcg: Pcg,
}

impl Simulator {
    /// Assembles the stiffness matrix and solves the empty scene.
    ///
    /// # Errors
    /// When the options or a material's values are out of range, or the empty scene cannot be solved.
    pub fn new(
        sensor: Sensor,
        materials: Vec<Material>,
        options: SolverOptions,
    ) -> Result<Self, SimulatorError> {
        check(&sensor, &materials, &options)?;
        let network = EdgeNetwork::of_sensor(&sensor);
        let nodes = sensor.mesh().nodes().len();
        let occupancy = Occupancy::empty(nodes, network.edges().len());
        let matrix = StiffnessMatrix::new(network, nodes, materials.len());
        let mut fields = Fields::new(&sensor, &materials, options.preconditioner);
        fields.refresh(&matrix, &[]);
        let electrodes = CapacitanceMatrix::zeros(sensor.electrode_names().len());
        let terminals = CapacitanceMatrix::zeros(fields.terminals.len() + 1);
        let mut simulator = Self {
            held: terminals.clone(),
            released: terminals,
            base: electrodes.clone(),
            capacitance: electrodes,
            sensor,
            materials,
            options,
            matrix,
            occupancy,
            fields,
        };
        let _ = simulator.solve()?;
        simulator.base = simulator.capacitance.clone();
        Ok(simulator)
    }

    /// One frame: [`Simulator::update`], then [`Simulator::solve`].
    ///
    /// # Errors
    /// As these two.
    pub fn step(&mut self, surfaces: &impl Surfaces) -> Result<StepReport, SimulatorError> {
        let changed_edges = self.update(surfaces)?;
        let solve = self.solve()?;
        Ok(StepReport { changed_edges, solve })
    }

    /// Takes over where the objects are now and returns how many edges that changed.
    ///
    /// # Errors
    /// When the depth image is invalid or shows another number of objects. The frame before stays in force.
    pub fn update(&mut self, surfaces: &impl Surfaces) -> Result<usize, SimulatorError> {
        surfaces.validate()?;
        if surfaces.objects() != self.materials.len() {
            return Err(SimulatorError::ObjectCount {
                seen: surfaces.objects(),
                known: self.materials.len(),
            });
        }
        let mesh = EdgeGeometry {
            nodes: self.sensor.mesh().nodes(),
            terminals: self.sensor.terminals(),
            edges: self.matrix.network().edges(),
            permittivity: self.matrix.network().permittivity(),
        };
        self.occupancy.update(mesh, &self.materials, surfaces);
        self.matrix.update(&self.occupancy);
        self.fields.move_conductors(&self.occupancy, self.sensor.electrode_names().len());
        self.fields.forget_absent_objects(&self.occupancy, self.sensor.electrode_names().len());
        self.fields.refresh(&self.matrix, self.occupancy.changed_nodes());
        Ok(self.occupancy.changed_edges().len())
    }

    /// Solves for the fields, starting from those of the frame before, and evaluates the capacitance matrix.
    ///
    /// # Errors
    /// When the solver fails; [`Simulator::capacitance`] then still is that of the frame before, and the next solve
    /// starts from zero.
    pub fn solve(&mut self) -> Result<SolveReport, SimulatorError> {
        let report = self.fields.solve(&self.matrix, &self.options).inspect_err(|_| self.fields.reset())?;
        self.fields.maxwell(&mut self.held);
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

    /// Entries of the Maxwell matrix between each electrode and ground with all that is grounded: farads, negative.
    /// They are charges on the ground, not the negated row sums of [`Simulator::capacitance`], and so a check on
    /// them. A capacitance from an object to ground is not part of it.
    pub fn capacitance_to_ground(&self) -> Vec<f64> {
        let mut all = self.held.clone();
        let ground = all.size() - 1;
        for (column, charge) in self.fields.charges_on_ground().into_iter().enumerate() {
            all.set(column, ground, charge);
        }
        for (object, to_ground) in released_objects(&self.materials, self.capacitance.size()) {
            all.release(object, to_ground);
        }
        (0..self.capacitance.size()).map(|electrode| all.get(electrode, ground)).collect()
    }

    /// The Maxwell capacitance matrix of the empty scene.
    pub fn base(&self) -> &CapacitanceMatrix {
        &self.base
    }

    /// Estimated error of each entry of [`Simulator::capacitance`] in farads, from the mesh and from the unfinished
    /// iteration.
    pub fn error_estimate(&self, report: &SolveReport) -> CapacitanceMatrix {
        let columns = self.fields.terminals.len();
        let conductors = self.occupancy.conductors();
        let of_mesh = discretisation_error(
            self.sensor.mesh(),
            columns,
            |column, node| self.fields.potentials[column / LANES][node][column % LANES],
            |element| {
                let [first, others @ ..] = self.sensor.mesh().tets()[element].map(|n| conductors[n as usize]);
                first != NO_OBJECT && others.iter().all(|&other| other == first)
            },
        );
        let mut error = CapacitanceMatrix::zeros(columns + 1);
        for s in 0..columns {
            for t in s..columns {
                error.set(s, t, of_mesh.get(s, t));
            }
        }
        let mut all = self.held.clone();
        for (object, to_ground) in released_objects(&self.materials, self.capacitance.size()) {
            all.release_error(object, to_ground, &mut error);
            all.release(object, to_ground);
        }
        let capacitance = &self.capacitance;
        let mut bars = CapacitanceMatrix::zeros(capacitance.size());
        bars.copy_leading(&error);
        for s in 0..bars.size() {
            for t in s..bars.size() {
                let scale = (capacitance.get(s, s) * capacitance.get(t, t)).sqrt();
                bars.set(s, t, bars.get(s, t).abs() + report.relative_error * scale);
            }
        }
        bars
    }

    /// The sensor.
    pub fn sensor(&self) -> &Sensor {
        &self.sensor
    }

    /// The preconditioner in use: the one asked for, or the next best that the mesh allows.
    pub fn preconditioner(&self) -> Preconditioner {
        self.fields.pcg.preconditioner()
    }

    /// The stiffness matrix of the last frame.
    pub fn matrix(&self) -> &StiffnessMatrix {
        &self.matrix
    }

    /// Conducting objects that touch or cover electrodes in the last frame, in increasing order. The capacitances of
    /// what touches are then not those of any sensor, but artefacts of the mesh.
    pub fn contacts(&self) -> &[Contact] {
        self.occupancy.contacts()
    }

    /// What objects occupy in the last frame.
    pub fn occupancy(&self) -> &Occupancy {
        &self.occupancy
    }
}

/// Columns of the objects that find their own potential, which come after those of the electrodes, and the capacitance
/// of each to ground.
fn released_objects(materials: &[Material], electrodes: usize) -> impl Iterator<Item = (usize, f64)> {
    (electrodes..).zip(materials.iter().filter_map(own_potential))
}

fn check(sensor: &Sensor, materials: &[Material], options: &SolverOptions) -> Result<(), SimulatorError> {
    if !(options.tolerance > 0.0 && options.tolerance < 1.0) {
        return Err(SimulatorError::Tolerance(options.tolerance));
    }
    if sensor.electrode_names().len() + materials.len() >= usize::from(FREE) - 1 {
        return Err(SimulatorError::TooManyObjects(materials.len()));
    }
    for (object, material) in materials.iter().enumerate() {
        if let Material::Conductor(Connection::Capacitance(farads)) = *material
            && !(farads.is_finite() && farads >= 0.0)
        {
            return Err(SimulatorError::CapacitanceToGround { object, farads });
        }
    }
    Ok(())
}

impl Fields {
    fn new(sensor: &Sensor, materials: &[Material], preconditioner: Preconditioner) -> Self {
        let electrodes = sensor.electrode_names().len() as Terminal;
        let objects = electrodes + 1..electrodes + 1 + materials.len() as Terminal;
        let released =
            objects.clone().zip(materials).filter(|(_, material)| own_potential(material).is_some());
        let terminals: Vec<Terminal> = (1..=electrodes).chain(released.map(|(object, _)| object)).collect();
        let row_terminals: Vec<Terminal> = sensor.terminals().iter().copied().chain(objects).collect();
        let rows = row_terminals.len();
        let mut fields = Self {
            potentials: vec![vec![[0.0; LANES]; rows]; terminals.len().div_ceil(LANES)],
            charges: vec![vec![[0.0; LANES]; rows]; terminals.len().div_ceil(LANES)],
            fixed: row_terminals.iter().map(|&terminal| terminal != FREE).collect(),
            nodes_held: vec![0; materials.len()],
            linked: vec![false; materials.len()],
            present: vec![false; materials.len()],
            terminals,
            row_terminals,
            pcg: Pcg::new(rows, preconditioner, sensor.lattice()),
        };
        fields.reset();
        fields
    }

    /// Free rows at 0 V, fixed rows at their potentials.
    fn reset(&mut self) {
        for row in 0..self.row_terminals.len() {
            self.hold(row, 0.0);
        }
    }

    /// Sets one row in all columns: 1 V where the column's terminal holds it, 0 V where another does, else `free`.
    fn hold(&mut self, row: usize, free: f64) {
        let holder = self.row_terminals[row];
        self.fixed[row] = holder != FREE;
        for (column, &terminal) in self.terminals.iter().enumerate() {
            let value = if holder == FREE { free } else { f64::from(u8::from(holder == terminal)) };
            self.potentials[column / LANES][row][column % LANES] = value;
        }
    }

    /// Nodes taken by a conductor get its potential; released nodes start from it.
    fn move_conductors(&mut self, occupancy: &Occupancy, electrodes: usize) {
        let first_object = electrodes as Terminal + 1;
        for &node in occupancy.changed_nodes() {
            let node = node as usize;
            if self.row_terminals[node] != FREE {
                self.nodes_held[usize::from(self.row_terminals[node] - first_object)] -= 1;
            }
            match occupancy.conductors()[node] {
                NO_OBJECT => {
                    self.row_terminals[node] = FREE;
                    self.fixed[node] = false;
                }
                object => {
                    self.nodes_held[usize::from(object)] += 1;
                    self.row_terminals[node] = first_object + object;
                    self.hold(node, 0.0);
                }
            }
        }
    }

    /// An object without nodes and links has no field. Left to the iteration, its column would fade without end, as its
    /// error is measured against its own energy.
    fn forget_absent_objects(&mut self, occupancy: &Occupancy, electrodes: usize) {
        self.linked.fill(false);
        for link in occupancy.links() {
            self.linked[usize::from(link.object)] = true;
        }
        for (column, &terminal) in self.terminals.iter().enumerate().skip(electrodes) {
            let object = usize::from(terminal) - electrodes - 1;
            let present = self.linked[object] || self.nodes_held[object] > 0;
            if self.present[object] && !present {
                let lane = column % LANES;
                for (row, &holder) in self.potentials[column / LANES].iter_mut().zip(&self.row_terminals) {
                    row[lane] = f64::from(u8::from(holder == terminal));
                }
            }
            self.present[object] = present;
        }
    }

    /// Tells the preconditioner which rows changed and which nodes a conductor took or left.
    fn refresh(&mut self, matrix: &StiffnessMatrix, moved: &[u32]) {
        let changed = matrix.changed_rows().iter().chain(moved).copied();
        self.pcg.refresh(matrix, &self.fixed, changed);
    }

    fn solve(
        &mut self,
        matrix: &StiffnessMatrix,
        options: &SolverOptions,
    ) -> Result<SolveReport, SolveError> {
        let mut worst = SolveReport { iterations: 0, relative_error: 0.0, residual: 0.0 };
        for (x, kx) in self.potentials.iter_mut().zip(&mut self.charges) {
            let report = self.pcg.solve(matrix, &self.fixed, x, kx, options)?;
            worst = SolveReport {
                iterations: worst.iterations.max(report.iterations),
                relative_error: worst.relative_error.max(report.relative_error),
                residual: worst.residual.max(report.residual),
            };
        }
        Ok(worst)
    }

    /// C_st = ε0 φ_sᵀ K φ_t over all rows, quadratically accurate in the fields' errors. The last row and column are
    /// left for ground.
    fn maxwell(&self, all: &mut CapacitanceMatrix) {
        let columns = self.terminals.len();
        for (a, potentials) in self.potentials.iter().enumerate() {
            for (b, charges) in self.charges.iter().enumerate().skip(a) {
                let energies = products(potentials, charges);
                for (s, t) in (0..LANES).flat_map(|s| (0..LANES).map(move |t| (s, t))) {
                    let (row, column) = (a * LANES + s, b * LANES + t);
                    if row <= column && column < columns {
                        let mirrored = if a == b { energies[t][s] } else { energies[s][t] };
                        all.set(row, column, VACUUM_PERMITTIVITY * 0.5 * (energies[s][t] + mirrored));
                    }
                }
            }
        }
    }

    /// For each column the charge, in farads, on everything grounded.
    fn charges_on_ground(&self) -> Vec<f64> {
        let grounded = |holder: &Terminal| *holder != FREE && !self.terminals.contains(holder);
        let on_ground = |column: usize| -> f64 {
            let charges = self.charges[column / LANES].iter().map(|charge| charge[column % LANES]);
            let held = self.row_terminals.iter().zip(charges);
            held.filter(|(holder, _)| grounded(holder)).map(|(_, charge)| charge).sum()
        };
        (0..self.terminals.len()).map(|column| VACUUM_PERMITTIVITY * on_ground(column)).collect()
    }
}

/// aᵀb for all pairs of columns.
fn products(a: &[Lane], b: &[Lane]) -> [Lane; LANES] {
    let mut sums = [[0.0; LANES]; LANES];
    for (a, b) in a.iter().zip(b) {
        for s in 0..LANES {
            for t in 0..LANES {
                sums[s][t] += a[s] * b[t];
            }
        }
    }
    sums
}
