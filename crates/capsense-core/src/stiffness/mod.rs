//! The stiffness matrix K of the potential, over all nodes and one more row for each object.
//!
//! K is the Laplacian of the weighted edges, kept uneliminated: what is held at a fixed potential is a partition of
//! the rows, never an edit of K. The sparsity pattern is that of the mesh's edges and never changes. Links to
//! conductors that lie between nodes couple a node's row to the object's row and are kept beside the pattern.
//! Values are recomputed from base weights and factors, not accumulated, so K after any number of frames equals K
//! built afresh.

mod network;

pub use network::{EdgeNetwork, barycentric_gradients};

use crate::occupancy::Occupancy;
use nalgebra_sparse::{CooMatrix, CsrMatrix};

/// A right-hand side, field or residual at one row, for up to [`LANES`] terminals at once.
pub type Lane = [f64; LANES];

/// Number of columns that advance together.
pub const LANES: usize = 4;

/// The stiffness matrix. Rows 0..nodes are nodes, the rows after them objects.
#[derive(Clone, Debug)]
pub struct StiffnessMatrix {
    network: EdgeNetwork,
    objects: usize,
    csr: CsrMatrix<f64>,
    /// Where the two entries of each edge are in the values.
    slots: Vec<[u32; 2]>,
    diagonal_slots: Vec<u32>,
    links: Vec<WeightedLink>,
    /// Sum of the weights of each node's links.
    link_sums: Vec<f64>,
    dirty: Vec<bool>,
    /// Rows whose values the last update recomputed.
    changed_rows: Vec<u32>,
}

/// A capacitance between a node's row and an object's row.
#[derive(Clone, Copy, Debug, PartialEq)]
struct WeightedLink {
    node: u32,
    object_row: u32,
    weight: f64,
}

impl StiffnessMatrix {
    /// Builds the matrix of a network without objects; up to `objects` may come later.
    pub fn new(network: EdgeNetwork, nodes: usize, objects: usize) -> Self {
        let mut pattern = CooMatrix::new(nodes, nodes);
        for row in 0..nodes {
            pattern.push(row, row, 0.0);
        }
        for (ends, &weight) in network.ends().iter().zip(network.weights()) {
            let [a, b] = ends.map(|node| node as usize);
            pattern.push(a, b, -weight);
            pattern.push(b, a, -weight);
        }
        let csr = CsrMatrix::from(&pattern);
        let slot = |row: u32, column: u32| {
            let start = csr.row_offsets()[row as usize];
            let columns = csr.row(row as usize);
            (start + columns.col_indices().partition_point(|&c| c < column as usize)) as u32
        };
        let slots = network.ends().iter().map(|&[a, b]| [slot(a, b), slot(b, a)]).collect();
        let diagonal_slots = (0..nodes as u32).map(|row| slot(row, row)).collect();
        let mut matrix = Self {
            network,
            objects,
            slots,
            diagonal_slots,
            links: Vec::new(),
            link_sums: vec![0.0; nodes],
            dirty: vec![true; nodes],
            changed_rows: (0..nodes as u32).collect(),
            csr,
        };
        matrix.refresh_diagonal();
        matrix
    }

    /// Takes over what changed in the occupancy. Only changed rows are touched.
    pub fn update(&mut self, occupancy: &Occupancy) {
        self.changed_rows.clear();
        for index in 0..self.links.len() {
            let node = self.links[index].node;
            self.link_sums[node as usize] = 0.0;
            self.mark(node);
        }
        self.links.clear();
        for &edge in occupancy.changed_edges() {
            let edge = edge as usize;
            let weight = self.weight(edge, occupancy.through()[edge]);
            for slot in self.slots[edge] {
                self.csr.values_mut()[slot as usize] = -weight;
            }
            for node in self.network.ends()[edge] {
                self.mark(node);
            }
        }
        let nodes = self.nodes() as u32;
        for link in occupancy.links() {
            let base = self.network.weights()[link.edge as usize];
            // Negative weights are no capacitors; they are left as they are.
            if base > 0.0 {
                let (weight, object_row) = (base * link.factor, nodes + u32::from(link.object));
                self.links.push(WeightedLink { node: link.node, object_row, weight });
                self.link_sums[link.node as usize] += weight;
                self.mark(link.node);
            }
        }
        self.refresh_diagonal();
    }

    fn weight(&self, edge: usize, factor: f64) -> f64 {
        let base = self.network.weights()[edge];
        if base > 0.0 { base * factor } else { base }
    }

    fn mark(&mut self, row: u32) {
        if !std::mem::replace(&mut self.dirty[row as usize], true) {
            self.changed_rows.push(row);
        }
    }

    /// Each marked diagonal becomes minus the sum of its row's other entries, plus the node's links.
    fn refresh_diagonal(&mut self) {
        for &row in &self.changed_rows {
            let row = row as usize;
            let diagonal = self.diagonal_slots[row] as usize;
            let range = self.csr.row_offsets()[row]..self.csr.row_offsets()[row + 1];
            let values = self.csr.values_mut();
            values[diagonal] = 0.0;
            values[diagonal] = self.link_sums[row] - values[range].iter().sum::<f64>();
            self.dirty[row] = false;
        }
    }

    /// Number of node rows.
    pub fn nodes(&self) -> usize {
        self.csr.nrows()
    }

    /// Number of rows: nodes, then objects.
    pub fn rows(&self) -> usize {
        self.nodes() + self.objects
    }

    /// The edges and their weights without objects.
    pub fn network(&self) -> &EdgeNetwork {
        &self.network
    }

    /// The part of the matrix over nodes, in metres times relative permittivity.
    pub fn csr(&self) -> &CsrMatrix<f64> {
        &self.csr
    }

    /// The diagonal entry of a node's row.
    pub fn diagonal(&self, node: usize) -> f64 {
        self.csr.values()[self.diagonal_slots[node] as usize]
    }

    /// The weight that couples two nodes directly; zero when there is none.
    pub fn weight_between(&self, a: usize, b: usize) -> f64 {
        let (offsets, columns, values) = self.csr.csr_data();
        let row = offsets[a]..offsets[a + 1];
        columns[row.clone()].binary_search(&b).map_or(0.0, |at| -values[row.start + at])
    }

    /// Sum of the weights of a node's links to objects.
    pub fn link_weight(&self, node: usize) -> f64 {
        self.link_sums[node]
    }

    /// Rows that the last update recomputed; all rows of a new matrix.
    pub fn changed_rows(&self) -> &[u32] {
        &self.changed_rows
    }

    /// y = K x, all columns at once.
    pub fn apply(&self, x: &[Lane], y: &mut [Lane]) {
        let (offsets, columns, values) = self.csr.csr_data();
        for (row, y) in y[..self.csr.nrows()].iter_mut().enumerate() {
            let entries = offsets[row]..offsets[row + 1];
            let mut sum = [0.0; LANES];
            for (&column, &value) in columns[entries.clone()].iter().zip(&values[entries]) {
                let x = &x[column];
                for lane in 0..LANES {
                    sum[lane] += value * x[lane];
                }
            }
            *y = sum;
        }
        y[self.csr.nrows()..].fill([0.0; LANES]);
        for link in &self.links {
            let (node, object) = (link.node as usize, link.object_row as usize);
            for lane in 0..LANES {
                // The node's own share stands on the diagonal.
                y[node][lane] -= link.weight * x[object][lane];
                y[object][lane] += link.weight * (x[object][lane] - x[node][lane]);
            }
        }
    }
}
