//! The paper's stiffness matrix: changes are added to what is there, K += Δε_e K_e.
//!
//! Each addition of Δε_e K_e leaves a rounding error of the size of the largest value that the entry ever had. When the
//! body is gone the entry is small again, the error is not: at a relative permittivity of 1e5 it costs five digits at
//! once, and errors add up from frame to frame. Measured at 20,000 elements with the bodies of `tests/suite/drift.rs`: in
//! `f32` diagonal entries are 4 % off after 1.7e3 element updates and 15 % after 1.1e5, where K has become indefinite;
//! in `f64` they are 7e-11 and 3e-10 off, and 2e-9 after 7.1e5. More figures in `docs/performance.md`.

use crate::mesh::{TetMesh, signed_volume};
use crate::stiffness::barycentric_gradients;
use nalgebra_sparse::na::RealField;
use nalgebra_sparse::{CooMatrix, CsrMatrix};

/// The floating-point numbers in which K accumulates: `f32` or `f64`.
pub trait Precision: RealField + Copy + Into<f64> {
    /// The nearest number of this precision.
    fn nearest(value: f64) -> Self;
}

impl Precision for f32 {
    fn nearest(value: f64) -> Self {
        value as f32
    }
}

impl Precision for f64 {
    fn nearest(value: f64) -> Self {
        value
    }
}

/// The stiffness matrix over all nodes of a mesh, in metres times relative permittivity, as accumulated triplets.
///
/// The implementation published with the paper accumulates in a dense array and compresses that for each frame. That
/// takes the square of the number of nodes; triplets (row, column, value), one for each entry that is not zero, are
/// kinder to it.
#[derive(Clone, Debug)]
pub struct AccumulatedStiffness<T> {
    triplets: CooMatrix<T>,
    values: Vec<T>,
    /// For each element its matrix K_e in vacuum, and where the entries stand among the triplets.
    elements: Vec<ElementMatrix<T>>,
    permittivity: Vec<f64>,
}

#[derive(Clone, Copy, Debug)]
struct ElementMatrix<T> {
    entries: [[T; 4]; 4],
    slots: [[u32; 4]; 4],
}

impl<T: Precision> AccumulatedStiffness<T> {
    /// Assembles a mesh from its elements' permittivities.
    pub fn new(mesh: &TetMesh) -> Self {
        let nodes = mesh.nodes().len();
        let pairs = |tet: [u32; 4]| tet.map(|row| tet.map(|column| (row, column)));
        let mut pattern: Vec<(u32, u32)> = mesh.tets().iter().flat_map(pairs).flatten().collect();
        pattern.sort_unstable();
        pattern.dedup();
        let mut row_starts = vec![0; nodes + 1];
        for &(row, _) in &pattern {
            row_starts[row as usize + 1] += 1;
        }
        for row in 0..nodes {
            row_starts[row + 1] += row_starts[row];
        }
        let slot = |(row, column): (u32, u32)| {
            let of_row = &pattern[row_starts[row as usize]..row_starts[row as usize + 1]];
            (row_starts[row as usize] + of_row.partition_point(|&(_, c)| c < column)) as u32
        };
        let elements = mesh.tets().iter().enumerate().map(|(element, tet)| {
            let slots = pairs(tet).map(|row| row.map(slot));
            ElementMatrix { entries: vacuum_matrix(mesh, element), slots }
        });
        let elements = elements.collect();
        let mut triplets = CooMatrix::new(nodes, nodes);
        for &(row, column) in &pattern {
            triplets.push(row as usize, column as usize, T::zero());
        }
        let values = vec![T::zero(); pattern.len()];
        let mut matrix = Self { triplets, values, elements, permittivity: vec![0.0; mesh.tets().len()] };
        for (element, permittivity) in mesh.relative_permittivity().iter().enumerate() {
            matrix.set_permittivity(element, permittivity);
        }
        matrix
    }

    /// K += (ε_new - ε_old) K_e.
    pub fn set_permittivity(&mut self, element: usize, relative_permittivity: f64) {
        let before = std::mem::replace(&mut self.permittivity[element], relative_permittivity);
        let change = T::nearest(relative_permittivity - before);
        let ElementMatrix { entries, slots } = &self.elements[element];
        for (slots, entries) in slots.iter().zip(entries) {
            for (&slot, &entry) in slots.iter().zip(entries) {
                self.values[slot as usize] += change * entry;
            }
        }
    }

    /// Converts the triplets to compressed rows.
    pub fn to_csr(&mut self) -> CsrMatrix<T> {
        for ((_, _, entry), value) in self.triplets.triplet_iter_mut().zip(&self.values) {
            *entry = *value;
        }
        CsrMatrix::from(&self.triplets)
    }
}

/// V ∇λ_i·∇λ_j: the stiffness matrix of an element in vacuum, in metres.
fn vacuum_matrix<T: Precision>(mesh: &TetMesh, element: usize) -> [[T; 4]; 4] {
    let corners = mesh.corners(element);
    let volume = signed_volume(corners);
    let gradients = barycentric_gradients(corners);
    gradients.map(|a| gradients.map(|b| T::nearest(volume * a.dot(b))))
}
