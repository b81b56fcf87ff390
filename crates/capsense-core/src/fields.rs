//! The fields of all terminals: which rows are held at which potential, the potentials of the others, and the energies
//! that are the Maxwell matrix.

use crate::capacitance::{CapacitanceMatrix, own_potential};
use crate::material::Material;
use crate::occupancy::{NO_OBJECT, Occupancy};
use crate::sensor::{FREE, Sensor, Terminal};
use crate::solver::{Pcg, Preconditioner, SolveError, SolveReport, SolverOptions};
use crate::stiffness::{LANES, Lane, StiffnessMatrix};
use crate::units::VACUUM_PERMITTIVITY;

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
    /// Columns in groups of [`LANES`].
    potentials: Vec<Vec<Lane>>,
    charges: Vec<Vec<Lane>>,
    pcg: Pcg,
}

impl Fields {
    pub(crate) fn new(sensor: &Sensor, materials: &[Material], preconditioner: Preconditioner) -> Self {
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
    pub(crate) fn reset(&mut self) {
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
        self.linked.fill(false);
        for &edge in occupancy.linked_edges() {
            for (_, object, _) in occupancy.couplings()[edge as usize].links() {
                self.linked[usize::from(object)] = true;
            }
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

    /// Number of terminals that have a field.
    pub(crate) fn columns(&self) -> usize {
        self.terminals.len()
    }

    /// The potential of a node in the field of one terminal.
    pub(crate) fn potential(&self, column: usize, node: usize) -> f64 {
        self.potentials[column / LANES][node][column % LANES]
    }

    pub(crate) fn preconditioner(&self) -> Preconditioner {
        self.pcg.preconditioner()
    }

    pub(crate) fn find_islands(&mut self, matrix: &StiffnessMatrix, occupancy: &Occupancy) {
        self.pcg.find_islands(matrix, occupancy, &self.fixed);
    }

    /// Tells the preconditioner which rows changed and which nodes a conductor took or left.
    pub(crate) fn refresh(&mut self, matrix: &StiffnessMatrix, moved: &[u32]) {
        let changed = matrix.changed_rows().iter().chain(moved).copied();
        self.pcg.refresh(matrix, &self.fixed, changed);
    }

    pub(crate) fn solve(
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
    pub(crate) fn maxwell(&self, all: &mut CapacitanceMatrix) {
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
    pub(crate) fn charges_on_ground(&self) -> Vec<f64> {
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
