//! The stiffness matrix of any mesh in compressed rows.

use super::{LANES, Lane};
use crate::mesh::Edges;
use nalgebra_sparse::{CooMatrix, CsrMatrix};

/// Values over the pattern of a list of edges, and where each edge stands in them.
#[derive(Clone, Debug)]
pub(super) struct CsrValues {
    matrix: CsrMatrix<f64>,
    /// Where the two entries of each edge are.
    slots: Vec<[u32; 2]>,
    diagonal: Vec<u32>,
}

impl CsrValues {
    /// Weights along the edges; the diagonal still is zero.
    pub(super) fn new(edges: &Edges, weights: &[f64], nodes: usize) -> Self {
        let mut pattern = CooMatrix::new(nodes, nodes);
        for row in 0..nodes {
            pattern.push(row, row, 0.0);
        }
        for (edge, &weight) in weights.iter().enumerate() {
            if let Some([a, b]) = edges.ends(edge) {
                pattern.push(a as usize, b as usize, -weight);
                pattern.push(b as usize, a as usize, -weight);
            }
        }
        // A clone has no room to spare, of which there may be as much as is used.
        let matrix = CsrMatrix::from(&pattern).clone();
        let slot = |row: u32, column: u32| {
            let before = matrix.row_offsets()[row as usize];
            let row = matrix.row(row as usize);
            (before + row.col_indices().partition_point(|&c| c < column as usize)) as u32
        };
        let slots = (0..weights.len())
            .map(|edge| edges.ends(edge).map_or([0; 2], |[a, b]| [slot(a, b), slot(b, a)]))
            .collect();
        let diagonal = (0..nodes as u32).map(|row| slot(row, row)).collect();
        Self { matrix, slots, diagonal }
    }

    pub(super) fn matrix(&self) -> &CsrMatrix<f64> {
        &self.matrix
    }

    pub(super) fn weight(&self, edge: usize) -> f64 {
        -self.matrix.values()[self.slots[edge][0] as usize]
    }

    /// Gives an edge a weight. Returns whether it is another than before.
    pub(super) fn set_weight(&mut self, edge: usize, weight: f64) -> bool {
        if self.weight(edge).to_bits() == weight.to_bits() {
            return false;
        }
        for slot in self.slots[edge] {
            self.matrix.values_mut()[slot as usize] = -weight;
        }
        true
    }

    /// The diagonal becomes minus the sum of the row's other entries, plus `more`.
    pub(super) fn refresh_diagonal(&mut self, row: usize, more: f64) {
        let range = self.matrix.row_offsets()[row]..self.matrix.row_offsets()[row + 1];
        let diagonal = self.diagonal[row] as usize;
        let values = self.matrix.values_mut();
        values[diagonal] = 0.0;
        values[diagonal] = more - values[range].iter().sum::<f64>();
    }

    pub(super) fn diagonal(&self, row: usize) -> f64 {
        self.matrix.values()[self.diagonal[row] as usize]
    }

    /// The neighbours of a node and the weights to them.
    pub(super) fn row(&self, node: usize) -> impl Iterator<Item = (usize, f64)> {
        let (offsets, columns, values) = self.matrix.csr_data();
        let entries = offsets[node]..offsets[node + 1];
        let row = columns[entries.clone()].iter().zip(&values[entries]);
        row.filter(move |(column, _)| **column != node).map(|(&column, &value)| (column, -value))
    }

    /// y = K x, and the columns' xᵀy.
    pub(super) fn apply<T: Copy + Into<f64>>(&self, x: &[[T; LANES]], y: &mut [Lane]) -> Lane {
        let (offsets, columns, values) = self.matrix.csr_data();
        let mut products = [0.0; LANES];
        for (row, y) in y[..self.matrix.nrows()].iter_mut().enumerate() {
            let entries = offsets[row]..offsets[row + 1];
            let mut sum = [0.0; LANES];
            for (&column, &value) in columns[entries.clone()].iter().zip(&values[entries]) {
                let x = &x[column];
                for lane in 0..LANES {
                    sum[lane] += value * x[lane].into();
                }
            }
            for lane in 0..LANES {
                products[lane] += sum[lane] * x[row][lane].into();
            }
            *y = sum;
        }
        products
    }
}
