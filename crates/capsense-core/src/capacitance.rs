//! The Maxwell capacitance matrix, and what remains of it when objects are isolated or tied to ground.

use crate::material::{Connection, Material};

/// A symmetric capacitance matrix in farads: charges Q = C V on terminals at potentials V.
///
/// Diagonal entries are positive, the others negative or zero; the mutual capacitance of two electrodes is minus their
/// entry.
#[derive(Clone, Debug, PartialEq)]
pub struct CapacitanceMatrix {
    size: usize,
    farads: Vec<f64>,
}

/// Rows and columns of the upper triangle of a matrix, row by row.
pub fn upper_triangle(size: usize) -> impl Iterator<Item = (usize, usize)> + Clone {
    (0..size).flat_map(move |row| (row..size).map(move |column| (row, column)))
}

impl CapacitanceMatrix {
    /// All entries zero.
    pub fn zeros(size: usize) -> Self {
        Self { size, farads: vec![0.0; size * size] }
    }

    /// Entries of the upper triangle as `farads` tells them, and their mirror images.
    pub fn from_upper(size: usize, mut farads: impl FnMut(usize, usize) -> f64) -> Self {
        let mut matrix = Self::zeros(size);
        upper_triangle(size).for_each(|(row, column)| matrix.set(row, column, farads(row, column)));
        matrix
    }

    /// Entries of the upper triangle, row by row, in farads.
    pub fn upper(&self) -> Vec<f64> {
        upper_triangle(self.size).map(|(row, column)| self.get(row, column)).collect()
    }

    /// Number of terminals.
    pub fn size(&self) -> usize {
        self.size
    }

    /// One entry in farads.
    ///
    /// # Panics
    /// When an index is not below [`CapacitanceMatrix::size`].
    pub fn get(&self, row: usize, column: usize) -> f64 {
        assert!(row < self.size && column < self.size, "entry ({row}, {column}) of {}", self.size);
        self.farads[row * self.size + column]
    }

    /// Sets an entry and its mirror image.
    pub(crate) fn set(&mut self, row: usize, column: usize, farads: f64) {
        self.farads[row * self.size + column] = farads;
        self.farads[column * self.size + row] = farads;
    }

    /// The rows in order.
    pub fn rows(&self) -> impl ExactSizeIterator<Item = &[f64]> {
        // A matrix of no terminals has no rows; its chunks must still have a length.
        self.farads.chunks_exact(self.size.max(1))
    }

    /// By how much each entry exceeds that of another matrix.
    ///
    /// # Panics
    /// When the other has another size.
    #[must_use]
    pub fn minus(&self, other: &Self) -> Self {
        assert!(self.size == other.size, "{} terminals and {}", self.size, other.size);
        let farads = self.farads.iter().zip(&other.farads).map(|(a, b)| a - b).collect();
        Self { size: self.size, farads }
    }

    /// Takes over the leading entries of a matrix of at least this size: all its other terminals at 0 V.
    pub(crate) fn copy_leading(&mut self, from: &Self) {
        let size = self.size;
        for (row, from) in self.farads.chunks_exact_mut(size.max(1)).zip(from.rows()) {
            row.copy_from_slice(&from[..size]);
        }
    }

    /// Lets an object find its own potential: its net charge is zero (`to_ground` = 0), or that of a capacitance to
    /// ground, Q = -C_g V. Its row and column become zero, all others take the Schur complement.
    pub(crate) fn release(&mut self, object: usize, to_ground: f64) {
        let pivot = self.get(object, object) + to_ground;
        for s in (0..self.size).filter(|&s| s != object && pivot > 0.0) {
            let share = self.get(object, s) / pivot;
            for t in (s..self.size).filter(|&t| t != object) {
                self.set(s, t, self.get(s, t) - share * self.get(object, t));
            }
        }
        self.clear(object);
    }

    fn clear(&mut self, terminal: usize) {
        for t in 0..self.size {
            self.set(terminal, t, 0.0);
        }
    }
}

/// The capacitance to ground, in farads, of an object that finds its own potential; `None` for all others.
pub(crate) fn own_potential(material: &Material) -> Option<f64> {
    match material {
        Material::Conductor(Connection::Floating) => Some(0.0),
        Material::Conductor(Connection::Capacitance(farads)) => Some(*farads),
        Material::Conductor(Connection::Grounded) | Material::Dielectric(_) => None,
    }
}
