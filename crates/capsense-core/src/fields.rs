//! The fields of all terminals: which rows are held at which potential, the potentials of the others, and the energies
//! that are the Maxwell matrix.

use crate::capacitance::{CapacitanceMatrix, own_potential};
use crate::material::Material;
use crate::occupancy::{Coupling, NO_OBJECT, Occupancy};
use crate::sensor::{FREE, Sensor, Terminal};
use crate::solver::{
    EdgeFields, FieldSolver, Found, Preconditioner, RemoteFields, SolveError, SolveReport, SolverOptions,
};
use crate::stiffness::StiffnessMatrix;
use crate::units::VACUUM_PERMITTIVITY;
use crate::workers::{Awake, Workers};

/// After so many edges it is looked at again whether the bounds still are of use.
const EDGES_BETWEEN_LOOKS: usize = 8;

/// The potential of every row with one terminal at 1 V and all others at 0 V, one column for each terminal that needs
/// one: electrodes, then objects that find their own potential.
#[derive(Clone, Debug)]
pub(crate) struct Fields {
    terminals: Vec<Terminal>,
    /// Terminal of each row, [`FREE`] where the potential is unknown.
    row_terminals: Vec<Terminal>,
    fixed: Vec<bool>,
    /// For each object: how many nodes it holds, whether a link leads to it, and whether it had either when last seen.
    nodes_held: Vec<u32>,
    linked: Vec<bool>,
    present: Vec<bool>,
    solver: FieldSolver,
    /// Nodes that the solver has not been told of yet: those whose row changed or that a conductor took or left. Each is
    /// there once.
    changed: Vec<u32>,
    is_changed: Vec<bool>,
    /// Working storage: all columns on an edge before and after a change.
    on_edge: [Vec<EdgeFields>; 2],
}

impl Fields {
    pub(crate) fn new(
        sensor: &Sensor,
        materials: &[Material],
        matrix: &StiffnessMatrix,
        options: &SolverOptions,
        remote: Option<Box<dyn RemoteFields>>,
    ) -> Self {
        let electrodes = sensor.electrode_names().len() as Terminal;
        let objects = electrodes + 1..electrodes + 1 + materials.len() as Terminal;
        let released =
            objects.clone().zip(materials).filter(|(_, material)| own_potential(material).is_some());
        let terminals: Vec<Terminal> = (1..=electrodes).chain(released.map(|(object, _)| object)).collect();
        let to_ground: Vec<f64> =
            materials.iter().filter_map(own_potential).map(|farads| farads / VACUUM_PERMITTIVITY).collect();
        let bodies = sensor.held_rows().chain(objects);
        let row_terminals: Vec<Terminal> = sensor.terminals().iter().copied().chain(bodies).collect();
        let fixed: Vec<bool> = row_terminals.iter().map(|&terminal| terminal != FREE).collect();
        let mut fields = Self {
            solver: FieldSolver::new(matrix, &fixed, terminals.len(), &to_ground, options, remote),
            fixed,
            nodes_held: vec![0; materials.len()],
            linked: vec![false; materials.len()],
            present: vec![false; materials.len()],
            terminals,
            is_changed: vec![false; row_terminals.len()],
            row_terminals,
            changed: Vec::new(),
            on_edge: [Vec::new(), Vec::new()],
        };
        let permittivities = materials.iter().filter_map(|material| match material {
            Material::Dielectric(permittivity) => Some(permittivity.value()),
            Material::Conductor(_) => None,
        });
        fields.solver.expect_permittivity(permittivities.fold(1.0, f64::max));
        fields.reset();
        fields
    }

    /// Wakes the threads that share the work.
    pub(crate) fn wake(&self) -> Awake {
        self.solver.workers().wake()
    }

    /// The threads that share the work.
    pub(crate) fn workers(&self) -> &Workers {
        self.solver.workers()
    }

    /// Free rows at 0 V, fixed rows at their potentials.
    pub(crate) fn reset(&mut self) {
        for row in 0..self.row_terminals.len() {
            self.hold(row, 0.0);
        }
        self.solver.forget_residual();
    }

    /// Sets one row in all columns: 1 V where the column's terminal holds it, 0 V where another does, else `free`.
    fn hold(&mut self, row: usize, free: f64) {
        let holder = self.row_terminals[row];
        self.fixed[row] = holder != FREE;
        for (column, &terminal) in self.terminals.iter().enumerate() {
            let value = if holder == FREE { free } else { f64::from(u8::from(holder == terminal)) };
            self.solver.set_potential(column, row, value);
        }
    }

    /// Bounds what the changes of a frame do, before conductors move. Gives up as soon as the bounds are too far apart to
    /// be of use, or when a conductor releases a node, because its charge then has nowhere to go, or when a negative weight
    /// changes, along which no current can be led.
    pub(crate) fn bracket(
        &mut self,
        matrix: &StiffnessMatrix,
        occupancy: &Occupancy,
        electrodes: usize,
        options: &SolverOptions,
    ) {
        // What a node draws through a link of its own is on no edge.
        let is_lost = |node: &u32| {
            occupancy.conductors()[*node as usize] == NO_OBJECT || matrix.has_link_of_its_own(*node)
        };
        if !self.solver.bracket_is_open(options) || occupancy.changed_nodes().iter().any(is_lost) {
            self.solver.bracket_mut().is_lost = true;
            return;
        }
        self.solver.bracket_mut().start_changes();
        let [mut before, mut after] = std::mem::take(&mut self.on_edge);
        let mut is_lost = false;
        for (count, &(edge, replaced)) in occupancy.replaced_couplings().iter().enumerate() {
            is_lost = count % EDGES_BETWEEN_LOOKS == 0 && !self.solver.bracket_is_open(options);
            if is_lost {
                break;
            }
            let weight = matrix.network().weights()[edge as usize];
            if weight <= 0.0 {
                is_lost = occupancy.scales_negative_weights();
                if is_lost {
                    break;
                }
                continue;
            }
            let ends = matrix.network().edges().ends_of_existing(edge as usize).map(|node| node as usize);
            let holders = ends.map(|node| match occupancy.conductors()[node] {
                NO_OBJECT => self.row_terminals[node],
                object => electrodes as Terminal + 1 + object,
            });
            self.see_coupling(&replaced, electrodes, &mut before);
            self.see_coupling(occupancy.coupling(edge as usize), electrodes, &mut after);
            for end in 0..2 {
                self.solver.for_potentials(ends[end], &self.fixed, |column, potential| {
                    let held = || f64::from(u8::from(holders[end] == self.terminals[column]));
                    before[column].ends[end] = potential;
                    after[column].ends[end] = if holders[end] == FREE { potential } else { held() };
                });
            }
            let free = holders.map(|holder| holder == FREE);
            self.solver.bracket_mut().change(weight, &before, &after, free);
        }
        self.on_edge = [before, after];
        if is_lost {
            self.lose_bracket();
        } else {
            self.solver.bracket_mut().finish_changes();
        }
    }

    /// What all columns see of an edge with some coupling, but for the potentials of its ends.
    fn see_coupling(&self, coupling: &Coupling, electrodes: usize, columns: &mut Vec<EdgeFields>) {
        columns.clear();
        columns.extend(self.terminals.iter().map(|&terminal| {
            let of_object = |object: u16| match object {
                NO_OBJECT => 0.0,
                object => f64::from(u8::from(electrodes as Terminal + 1 + object == terminal)),
            };
            EdgeFields {
                through: coupling.through,
                links: coupling.factor,
                ends: [0.0; 2],
                objects: coupling.object.map(of_object),
            }
        }));
    }

    /// Nothing is known of what the changes of a frame do.
    pub(crate) fn lose_bracket(&mut self) {
        self.solver.bracket_mut().is_lost = true;
    }

    /// Nodes taken by a conductor get its potential; released nodes start from it.
    pub(crate) fn move_conductors(&mut self, occupancy: &Occupancy, electrodes: usize) {
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
    pub(crate) fn forget_absent_objects(&mut self, occupancy: &Occupancy, electrodes: usize) {
        if self.terminals.len() == electrodes {
            return;
        }
        self.linked.fill(false);
        for &edge in occupancy.linked_edges() {
            for (_, object, _) in occupancy.coupling(edge as usize).links() {
                self.linked[usize::from(object)] = true;
            }
        }
        for (column, &terminal) in self.terminals.iter().enumerate().skip(electrodes) {
            let object = usize::from(terminal) - electrodes - 1;
            let present = self.linked[object] || self.nodes_held[object] > 0;
            if self.present[object] && !present {
                let held = self.row_terminals.iter().map(|&holder| f64::from(u8::from(holder == terminal)));
                self.solver.empty_column(column, held);
            }
            self.present[object] = present;
        }
    }

    /// Number of terminals that have a field.
    pub(crate) fn columns(&self) -> usize {
        self.terminals.len()
    }

    /// The potential of a node in the field of one terminal.
    pub(crate) fn potential(&self, column: usize, node: usize) -> f64 {
        self.solver.potential(column, node, &self.fixed)
    }

    /// Notes which rows changed and which nodes a conductor took or left, with their neighbours: where a surface passes
    /// exactly through a node its edges keep their weights, but not the potential at their end.
    pub(crate) fn note_changes(&mut self, matrix: &StiffnessMatrix, moved: &[u32]) {
        let mut note = |node: usize| {
            if !std::mem::replace(&mut self.is_changed[node], true) {
                self.changed.push(node as u32);
            }
        };
        matrix.changed_rows().iter().chain(moved).for_each(|&node| note(node as usize));
        moved.iter().flat_map(|&node| matrix.row(node as usize)).for_each(|(neighbour, _)| note(neighbour));
    }

    /// Tells the solver of what was noted, unless none of it can matter. `islands` says whether there may be bodies of
    /// very high permittivity.
    pub(crate) fn refresh(
        &mut self,
        matrix: &StiffnessMatrix,
        occupancy: &Occupancy,
        islands: bool,
        options: &SolverOptions,
    ) {
        if !self.solver.must_solve(options) {
            return;
        }
        self.solver.refresh(matrix, occupancy, &self.fixed, &self.changed, options);
        if islands && !self.changed.is_empty() {
            self.solver.find_islands(matrix, occupancy, &self.fixed, &self.changed);
        }
        for node in self.changed.drain(..) {
            self.is_changed[node as usize] = false;
        }
    }

    /// Gives back the room that it took to be told of all rows: far fewer change from now on.
    pub(crate) fn settle(&mut self) {
        self.changed.shrink_to_fit();
        self.solver.settle();
    }

    /// Takes over that objects were placed anew that are found where fields are, and returns whether they were.
    pub(crate) fn take_placed_elsewhere(&mut self) -> bool {
        self.solver.take_placed_elsewhere()
    }

    /// What was found of objects where fields are, if they are found there.
    pub(crate) fn found(&self) -> Option<&Found> {
        self.solver.found()
    }

    /// Has the potentials of one column at hand.
    ///
    /// # Errors
    /// When they are on a device that fails.
    pub(crate) fn read(&self, column: usize) -> Result<(), SolveError> {
        self.solver.read(column)
    }

    /// Tells fields that are elsewhere of a solve to come.
    pub(crate) fn announce(&mut self, options: &SolverOptions) {
        self.solver.announce(options);
    }

    pub(crate) fn solve(
        &mut self,
        matrix: &StiffnessMatrix,
        options: &SolverOptions,
    ) -> Result<SolveReport, SolveError> {
        let report = self.solver.solve(matrix, options)?;
        debug_assert!(report.skipped || self.changed.is_empty(), "the solver was not told of all changes");
        Ok(report)
    }

    /// Takes the energies of the last solve for those of the empty scene. All that follow are solved for as exactly as
    /// `options` ask for.
    pub(crate) fn remember_base(&mut self, matrix: &StiffnessMatrix, options: &SolverOptions) {
        self.solver.remember_base();
        self.solver.choose_precision(matrix, options);
        if options.preconditioner == Preconditioner::Direct {
            self.solver.tabulate(matrix, &self.fixed);
        }
    }

    /// C_st = ε0 φ_sᵀ K φ_t over all rows, quadratically accurate in the fields' errors. The last row and column are
    /// left for ground: zero.
    pub(crate) fn maxwell(&self, all: &mut CapacitanceMatrix) {
        let columns = self.terminals.len();
        let energies = self.solver.energies();
        for (s, t) in (0..columns).flat_map(|s| (s..columns).map(move |t| (s, t))) {
            all.set(s, t, VACUUM_PERMITTIVITY * energies[s * columns + t]);
        }
        (0..all.size()).for_each(|terminal| all.set(terminal, columns, 0.0));
    }

    /// Adds what couples two objects across gaps without a node in them, of which no field knows. The last row and column are
    /// those of ground.
    pub(crate) fn add_gaps(
        &self,
        matrix: &StiffnessMatrix,
        occupancy: &Occupancy,
        electrodes: usize,
        all: &mut CapacitanceMatrix,
    ) {
        let ground = all.size() - 1;
        let column = |object: u16| {
            let terminal = electrodes as Terminal + 1 + object;
            self.terminals.iter().position(|other| *other == terminal).unwrap_or(ground)
        };
        for gap in occupancy.gaps() {
            let [a, b] = gap.objects.map(column);
            let base = matrix.network().weights()[gap.edge as usize];
            if a != b && base > 0.0 {
                let farads = VACUUM_PERMITTIVITY * base * gap.factor;
                all.set(a, a, all.get(a, a) + farads);
                all.set(b, b, all.get(b, b) + farads);
                all.set(a, b, all.get(a, b) - farads);
            }
        }
    }

    /// For each column the charge, in farads, on everything grounded.
    ///
    /// # Errors
    /// When potentials are on a device that fails.
    pub(crate) fn charges_on_ground(&self, matrix: &StiffnessMatrix) -> Result<Vec<f64>, SolveError> {
        (0..self.terminals.len()).try_for_each(|column| self.read(column))?;
        let grounded = |row: usize| {
            let holder = self.row_terminals[row];
            holder != FREE && !self.terminals.contains(&holder)
        };
        let mut charges = vec![0.0; self.terminals.len()];
        matrix.for_each_weight(|[a, b], weight| {
            let onto = f64::from(u8::from(grounded(a))) - f64::from(u8::from(grounded(b)));
            if onto != 0.0 {
                for (column, charge) in charges.iter_mut().enumerate() {
                    let difference = self.potential(column, a) - self.potential(column, b);
                    *charge += VACUUM_PERMITTIVITY * onto * weight * difference;
                }
            }
        });
        Ok(charges)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::electrode::{Electrode, Outline};
    use crate::geometry::Aabb;
    use crate::sensor::{SensorDesign, Wall};
    use crate::stiffness::EdgeNetwork;
    use glam::{DVec2, DVec3};

    /// A surface exactly in a plane of nodes leaves the weights of edges that end there as they are. The residual beyond is
    /// another none the less; without it a frame was off by eleven times its tolerance.
    #[test]
    fn the_solver_is_told_of_the_neighbours_of_nodes_that_a_conductor_takes() {
        let outline = Outline::Rectangle { center: DVec2::ZERO, size: DVec2::splat(0.2) };
        let design = SensorDesign {
            domain: Aabb { min: DVec3::splat(-0.5), max: DVec3::splat(0.5) },
            electrodes: vec![Electrode { name: "E".to_owned(), outline, z: 0.0 }],
            substrate: None,
            wall: Wall::Grounded,
        };
        let sensor = Sensor::on_lattice(&design, &design.lattice(3_000).unwrap()).unwrap();
        let mut matrix = StiffnessMatrix::new(EdgeNetwork::of_sensor(&sensor), sensor.mesh().nodes().len());
        let mut fields = Fields::new(&sensor, &[], &matrix, &SolverOptions::default(), None);
        matrix.update(&Occupancy::empty(matrix.nodes(), matrix.network().edges().len()));
        assert!(matrix.changed_rows().is_empty());
        let node = sensor.terminals().iter().position(|terminal| *terminal == FREE).unwrap();
        fields.note_changes(&matrix, &[node as u32]);
        let mut told: Vec<usize> = fields.changed.iter().map(|node| *node as usize).collect();
        let mut around: Vec<usize> = matrix.row(node).map(|(other, _)| other).chain([node]).collect();
        told.sort_unstable();
        around.sort_unstable();
        assert_eq!(told, around);
    }
}
