//! The method of the paper, a frame at a time.
//!
//! 1. [`CentroidOccupancy`] finds the elements that another material fills.
//! 2. [`AccumulatedStiffness`] adds their changes and is converted to compressed rows.
//! 3. Rows and columns of ground and electrodes are eliminated.
//! 4. Conjugate gradients without preconditioner start from zero, for one electrode after another.
//! 5. The charges are K φ summed over the nodes of each electrode, K before the elimination.

use super::compressed_rows::CompressedRows;
use super::conjugate_gradients::{ConjugateGradients, dot};
use super::{AccumulatedStiffness, BaselineError, BaselineReport, CentroidOccupancy, CgOptions, Precision};
use crate::capacitance::CapacitanceMatrix;
use crate::material::RelativePermittivity;
use crate::occupancy::{DepthLayers, Surfaces};
use crate::sensor::{FREE, Sensor, Terminal};
use crate::units::VACUUM_PERMITTIVITY;
use nalgebra_sparse::CsrMatrix;

/// The relative permittivity that stands for steel.
pub const STEEL: f64 = 1e5;

/// Stands in for the number of a node that is not free.
const ELIMINATED: u32 = u32::MAX;

/// The paper's method; `T` is the precision in which K accumulates. The iteration is in `f64` for both.
#[derive(Clone, Debug)]
pub struct PaperMethod<T> {
    terminals: Vec<Terminal>,
    of_objects: Vec<f64>,
    options: CgOptions,
    occupancy: CentroidOccupancy,
    stiffness: AccumulatedStiffness<T>,
    /// The number of each free node among the free nodes, [`ELIMINATED`] for the others.
    free_index: Vec<u32>,
    cg: ConjugateGradients,
    capacitance: CapacitanceMatrix,
}

impl<T: Precision> PaperMethod<T> {
    /// Assembles the empty scene. What a lattice or an electrode's outline is to the simulator does not matter here:
    /// there are elements, and nodes with a terminal.
    pub fn new(sensor: &Sensor, objects: &[RelativePermittivity], options: CgOptions) -> Self {
        let sensor = sensor.clone().with_rims_held();
        let mut free = 0..;
        let number = |&terminal: &Terminal| match terminal {
            FREE => free.next().unwrap_or(ELIMINATED),
            _ => ELIMINATED,
        };
        Self {
            free_index: sensor.owners().iter().map(number).collect(),
            terminals: sensor.owners().to_vec(),
            of_objects: objects.iter().map(|permittivity| permittivity.value()).collect(),
            options,
            occupancy: CentroidOccupancy::new(sensor.mesh()),
            stiffness: AccumulatedStiffness::new(sensor.mesh()),
            cg: ConjugateGradients::default(),
            capacitance: CapacitanceMatrix::zeros(sensor.electrode_names().len()),
        }
    }

    /// One frame: [`PaperMethod::update`], then [`PaperMethod::solve`].
    ///
    /// # Errors
    /// As these two.
    pub fn step(&mut self, depth: &DepthLayers) -> Result<BaselineReport, BaselineError> {
        let changed = self.update(depth)?;
        let iterations = self.solve()?;
        Ok(BaselineReport { changed, iterations })
    }

    /// Takes over where the objects are now and returns how many elements that changed.
    ///
    /// # Errors
    /// When the depth image is invalid or shows another number of objects.
    pub fn update(&mut self, depth: &DepthLayers) -> Result<usize, BaselineError> {
        depth.validate()?;
        if depth.objects() != self.of_objects.len() {
            return Err(BaselineError::ObjectCount { seen: depth.objects(), known: self.of_objects.len() });
        }
        self.occupancy.update(depth, &self.of_objects);
        for &element in self.occupancy.changed() {
            let element = element as usize;
            self.stiffness.set_permittivity(element, self.occupancy.permittivity()[element]);
        }
        Ok(self.occupancy.changed().len())
    }

    /// Solves for the field of each electrode, evaluates the capacitance matrix, and returns the number of iterations
    /// of all electrodes together.
    ///
    /// # Errors
    /// When the residual is not reached, K has become indefinite, or a value is not finite;
    /// [`PaperMethod::capacitance`] then still is that of the frame before.
    pub fn solve(&mut self) -> Result<usize, BaselineError> {
        let matrix = self.stiffness.to_csr();
        let system = self.eliminate(&matrix);
        let electrodes = self.capacitance.size();
        let mut charges = vec![0.0; electrodes * electrodes];
        let mut iterations = 0;
        let mut x = vec![0.0; system.offsets.len() - 1];
        for (column, charges) in charges.chunks_exact_mut(electrodes).enumerate() {
            let terminal = column as Terminal + 1;
            self.set_right_hand_side(&matrix, terminal);
            let scale = dot(&self.cg.r, &self.cg.r).sqrt();
            x.fill(0.0);
            let identity = |r: &[f64], z: &mut [f64]| z.copy_from_slice(r);
            iterations += self.cg.solve(column, &system, identity, &mut x, scale, &self.options)?;
            self.add_charges(&matrix, terminal, &x, charges);
        }
        for s in 0..electrodes {
            for t in s..electrodes {
                let charge = 0.5 * (charges[s * electrodes + t] + charges[t * electrodes + s]);
                self.capacitance.set(s, t, VACUUM_PERMITTIVITY * charge);
            }
        }
        Ok(iterations)
    }

    /// The rows and columns of free nodes.
    fn eliminate(&self, matrix: &CsrMatrix<T>) -> CompressedRows {
        let (mut offsets, mut columns, mut values) = (vec![0], Vec::new(), Vec::new());
        for (row, &number) in matrix.row_iter().zip(&self.free_index) {
            if number != ELIMINATED {
                for (&column, &value) in row.col_indices().iter().zip(row.values()) {
                    if self.free_index[column] != ELIMINATED {
                        columns.push(self.free_index[column]);
                        values.push(value.into());
                    }
                }
                offsets.push(columns.len() as u32);
            }
        }
        CompressedRows { offsets, columns, values }
    }

    /// b_i = -Σ K_ij over the nodes j of the electrode at 1 V. It is the residual of the first guess, which is zero.
    fn set_right_hand_side(&mut self, matrix: &CsrMatrix<T>, terminal: Terminal) {
        self.cg.r.clear();
        for (row, &number) in matrix.row_iter().zip(&self.free_index) {
            if number != ELIMINATED {
                let entries = row.col_indices().iter().zip(row.values());
                let driven = entries.filter(|(column, _)| self.terminals[**column] == terminal);
                self.cg.r.push(-driven.map(|(_, &value)| value.into()).sum::<f64>());
            }
        }
    }

    /// Adds to each electrode's charge the rows of K φ over its nodes, with `terminal` at 1 V and `x` on free nodes.
    fn add_charges(&self, matrix: &CsrMatrix<T>, terminal: Terminal, x: &[f64], charges: &mut [f64]) {
        let potential = |node: usize| match self.free_index[node] {
            ELIMINATED => f64::from(u8::from(self.terminals[node] == terminal)),
            number => x[number as usize],
        };
        for (row, &holder) in matrix.row_iter().zip(&self.terminals) {
            let electrode = usize::from(holder).wrapping_sub(1);
            if let Some(charge) = charges.get_mut(electrode) {
                let entries = row.col_indices().iter().zip(row.values());
                *charge += entries.map(|(&column, &value)| value.into() * potential(column)).sum::<f64>();
            }
        }
    }

    /// The Maxwell capacitance matrix over the electrodes in the last frame solved, in farads, mean of both triangles;
    /// zero before the first.
    pub fn capacitance(&self) -> &CapacitanceMatrix {
        &self.capacitance
    }

    /// The accumulated stiffness matrix over all nodes in the last frame, in metres times relative permittivity.
    pub fn to_csr(&mut self) -> CsrMatrix<T> {
        self.stiffness.to_csr()
    }

    /// Relative permittivity of each element in the last frame, and which changed.
    pub fn occupancy(&self) -> &CentroidOccupancy {
        &self.occupancy
    }
}
