//! The simulator's own stiffness matrix, solved as a general library would: conjugate gradients with an incomplete
//! Cholesky factorisation, one column after another, started from the frame before.

use super::compressed_rows::CompressedRows;
use super::conjugate_gradients::{ConjugateGradients, dot};
use super::{BaselineError, BaselineReport, CgOptions};
use crate::capacitance::{CapacitanceMatrix, own_potential};
use crate::material::Material;
use crate::occupancy::{EdgeGeometry, Interface, NO_OBJECT, Occupancy, Surfaces};
use crate::sensor::{FREE, Sensor, Terminal};
use crate::simulator::nothing_there;
use crate::solver::IncompleteCholesky;
use crate::stiffness::{LANES, StiffnessMatrix};
use crate::units::VACUUM_PERMITTIVITY;

/// Preconditioned conjugate gradients on one level. Meant for sensors that are no lattice; on a lattice the matrix is
/// put into compressed rows anew for each frame.
#[derive(Clone, Debug)]
pub struct Ic0Method {
    sensor: Sensor,
    materials: Vec<Material>,
    options: CgOptions,
    occupancy: Occupancy,
    stiffness: StiffnessMatrix,
    /// K over the nodes; rows of fixed nodes are zero.
    matrix: CompressedRows,
    factors: IncompleteCholesky,
    /// Terminal of each row, nodes then objects.
    holders: Vec<Terminal>,
    fixed: Vec<bool>,
    /// Terminals that have a field: electrodes, then objects that find their own potential.
    terminals: Vec<Terminal>,
    /// For each of them the potential of every row.
    potentials: Vec<Vec<f64>>,
    cg: ConjugateGradients,
    capacitance: CapacitanceMatrix,
}

impl Ic0Method {
    /// Assembles the empty scene.
    ///
    /// # Errors
    /// When the matrix has more entries than can be numbered.
    pub fn new(sensor: Sensor, materials: Vec<Material>, options: CgOptions) -> Result<Self, BaselineError> {
        let nodes = sensor.mesh().nodes().len();
        let (network, occupancy) = nothing_there(&sensor, &materials, Interface::EdgeCut);
        let stiffness = StiffnessMatrix::in_rows(network, nodes);
        let csr = stiffness.to_csr();
        let electrodes = sensor.electrode_names().len();
        let objects = electrodes as Terminal + 1..;
        let released =
            objects.clone().zip(&materials).filter(|(_, material)| own_potential(material).is_some());
        let terminals: Vec<Terminal> =
            (1..=electrodes as Terminal).chain(released.map(|(object, _)| object)).collect();
        let bodies = sensor.held_rows().chain(objects.take(materials.len()));
        let holders: Vec<Terminal> = sensor.terminals().iter().copied().chain(bodies).collect();
        let mut method = Self {
            factors: IncompleteCholesky::new(csr.pattern())?,
            matrix: CompressedRows {
                offsets: csr.row_offsets().iter().map(|&offset| offset as u32).collect(),
                columns: csr.col_indices().iter().map(|&column| column as u32).collect(),
                values: Vec::new(),
            },
            fixed: holders.iter().map(|&holder| holder != FREE).collect(),
            potentials: vec![vec![0.0; holders.len()]; terminals.len()],
            holders,
            terminals,
            cg: ConjugateGradients::default(),
            capacitance: CapacitanceMatrix::zeros(electrodes),
            sensor,
            materials,
            options,
            occupancy,
            stiffness,
        };
        method.hold_conductors();
        method.refresh();
        Ok(method)
    }

    /// One frame: [`Ic0Method::update`], then [`Ic0Method::solve`].
    ///
    /// # Errors
    /// As these two.
    pub fn step(&mut self, surfaces: &impl Surfaces) -> Result<BaselineReport, BaselineError> {
        let changed = self.update(surfaces)?;
        let iterations = self.solve()?;
        Ok(BaselineReport { changed, iterations })
    }

    /// Takes over where the objects are now, factorises anew when that changed anything, and returns how many edges it
    /// changed.
    ///
    /// # Errors
    /// When the surfaces are invalid or of another number of objects.
    pub fn update(&mut self, surfaces: &impl Surfaces) -> Result<usize, BaselineError> {
        surfaces.validate()?;
        if surfaces.objects() != self.materials.len() {
            let (seen, known) = (surfaces.objects(), self.materials.len());
            return Err(BaselineError::ObjectCount { seen, known });
        }
        let mesh = EdgeGeometry {
            nodes: self.sensor.mesh().nodes(),
            terminals: self.sensor.owners(),
            edges: self.stiffness.network().edges(),
            permittivity: self.stiffness.network().permittivity(),
        };
        self.occupancy.update(mesh, &self.materials, surfaces);
        self.stiffness.update(&self.occupancy);
        if !(self.occupancy.changed_edges().is_empty() && self.occupancy.changed_nodes().is_empty()) {
            self.hold_conductors();
            self.refresh();
        }
        Ok(self.occupancy.changed_edges().len())
    }

    /// Nodes in conductors get their potential; released nodes start from it.
    fn hold_conductors(&mut self) {
        let first_object = self.sensor.electrode_names().len() as Terminal + 1;
        for (node, (&at_rest, &object)) in
            self.sensor.terminals().iter().zip(self.occupancy.conductors()).enumerate()
        {
            self.holders[node] = if object == NO_OBJECT { at_rest } else { first_object + object };
        }
        for (row, &holder) in self.holders.iter().enumerate() {
            self.fixed[row] = holder != FREE;
            if holder != FREE {
                for (potentials, &terminal) in self.potentials.iter_mut().zip(&self.terminals) {
                    potentials[row] = f64::from(u8::from(holder == terminal));
                }
            }
        }
    }

    /// The numbers of the matrix and its factors.
    fn refresh(&mut self) {
        let csr = self.stiffness.to_csr();
        let nodes = csr.nrows();
        self.factors.refactor(csr.values(), &self.fixed[..nodes]);
        self.matrix.values.clear();
        self.matrix.values.extend_from_slice(csr.values());
        for (ends, &fixed) in self.matrix.offsets.windows(2).zip(&self.fixed) {
            if fixed {
                self.matrix.values[ends[0] as usize..ends[1] as usize].fill(0.0);
            }
        }
    }

    /// Solves for the fields, starting from those of the frame before, evaluates the capacitance matrix, and returns
    /// the number of iterations of all columns together.
    ///
    /// # Errors
    /// When the residual is not reached, the matrix is indefinite, or a value is not finite;
    /// [`Ic0Method::capacitance`] then still is that of the frame before, and the next solve starts from zero.
    pub fn solve(&mut self) -> Result<usize, BaselineError> {
        let iterations = self.solve_columns().inspect_err(|_| {
            let free = |row: usize| !self.fixed[row];
            for potentials in &mut self.potentials {
                (0..potentials.len()).filter(|&row| free(row)).for_each(|row| potentials[row] = 0.0);
            }
        })?;
        self.evaluate();
        Ok(iterations)
    }

    fn solve_columns(&mut self) -> Result<usize, BaselineError> {
        let held: Vec<Vec<f64>> = self
            .potentials
            .iter()
            .map(|of| of.iter().zip(&self.fixed).map(|(&v, &fixed)| if fixed { v } else { 0.0 }).collect())
            .collect();
        let right_hand_sides = self.charges(&held);
        let charges = self.charges(&self.potentials);
        let nodes = self.factors.rows();
        let mut iterations = 0;
        for (column, potentials) in self.potentials.iter_mut().enumerate() {
            let on_free = |charges: &[f64], r: &mut Vec<f64>| {
                let free = charges[..nodes].iter().zip(&self.fixed);
                r.clear();
                r.extend(free.map(|(&charge, &fixed)| if fixed { 0.0 } else { -charge }));
            };
            on_free(&right_hand_sides[column], &mut self.cg.r);
            let scale = dot(&self.cg.r, &self.cg.r).sqrt();
            if scale == 0.0 {
                // An object that is not there: its field is zero.
                potentials.copy_from_slice(&held[column]);
                continue;
            }
            on_free(&charges[column], &mut self.cg.r);
            let precondition =
                |r: &[f64], z: &mut [f64]| self.factors.solve(r.as_chunks::<1>().0, z.as_chunks_mut::<1>().0);
            let x = &mut potentials[..nodes];
            iterations += self.cg.solve(column, &self.matrix, precondition, x, scale, &self.options)?;
        }
        Ok(iterations)
    }

    /// K φ over all rows, for each column.
    fn charges(&self, potentials: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let rows = self.holders.len();
        let (mut x, mut y) = (vec![[0.0; LANES]; rows], vec![[0.0; LANES]; rows]);
        let mut charges = Vec::with_capacity(potentials.len());
        for group in potentials.chunks(LANES) {
            for (lane, column) in group.iter().enumerate() {
                x.iter_mut().zip(column).for_each(|(x, potential)| x[lane] = *potential);
            }
            self.stiffness.apply(&x, &mut y);
            charges.extend((0..group.len()).map(|lane| y.iter().map(|y| y[lane]).collect()));
        }
        charges
    }

    /// C_st = ε0 φ_sᵀ K φ_t over all rows, then without the objects that find their own potential.
    fn evaluate(&mut self) {
        let charges = self.charges(&self.potentials);
        let mut all = CapacitanceMatrix::zeros(self.terminals.len());
        for s in 0..self.terminals.len() {
            for t in s..self.terminals.len() {
                let energy = dot(&self.potentials[s], &charges[t]) + dot(&self.potentials[t], &charges[s]);
                all.set(s, t, 0.5 * VACUUM_PERMITTIVITY * energy);
            }
        }
        let released = self.materials.iter().filter_map(own_potential);
        for (object, to_ground) in (self.capacitance.size()..).zip(released) {
            all.release(object, to_ground);
        }
        self.capacitance.copy_leading(&all);
    }

    /// The Maxwell capacitance matrix over the electrodes in the last frame solved, in farads, objects already
    /// terminated; zero before the first.
    pub fn capacitance(&self) -> &CapacitanceMatrix {
        &self.capacitance
    }

    /// The stiffness matrix of the last frame.
    pub fn matrix(&self) -> &StiffnessMatrix {
        &self.stiffness
    }
}
