//! The stiffness matrix K of the potential, over all nodes and one more row for each object.
//!
//! K is the Laplacian of the weighted edges, kept uneliminated: what is held at a fixed potential is a partition of
//! the rows, never an edit of K. The sparsity pattern is that of the mesh's edges and never changes. Links to
//! conductors that lie between nodes couple a node's row to the object's row and are kept beside the pattern.
//! Values are recomputed from base weights and factors, not accumulated, so K after any number of frames equals K
//! built afresh.

mod csr;
mod lattice;
mod network;

pub use network::{EdgeNetwork, barycentric_gradients};

use crate::mesh::Edges;
use crate::occupancy::Occupancy;
use csr::CsrValues;
use lattice::LatticeValues;
use nalgebra_sparse::CsrMatrix;

/// A right-hand side, field or residual at one row, for up to [`LANES`] terminals at once.
pub type Lane = [f64; LANES];

/// The same in single precision.
pub type Lane32 = [f32; LANES];

/// Number of columns that advance together.
pub const LANES: usize = 4;

/// The stiffness matrix. Rows 0..nodes are nodes, the rows after them objects, as many as vectors have.
#[derive(Clone, Debug)]
pub struct StiffnessMatrix {
    network: EdgeNetwork,
    nodes: usize,
    values: Values,
    links: Vec<WeightedLink>,
    /// Sum of the weights of each node's links.
    link_sums: Vec<f64>,
    dirty: Vec<bool>,
    /// Rows whose values the last update recomputed.
    changed_rows: Vec<u32>,
}

/// The current weights, stored as the mesh allows.
#[derive(Clone, Debug)]
enum Values {
    Lattice(LatticeValues),
    Csr(CsrValues),
}

/// A capacitance between a node's row and an object's row.
#[derive(Clone, Copy, Debug, PartialEq)]
struct WeightedLink {
    node: u32,
    object_row: u32,
    weight: f64,
}

impl StiffnessMatrix {
    /// Builds the matrix of a network without objects.
    pub fn new(network: EdgeNetwork, nodes: usize) -> Self {
        let values = match network.edges() {
            Edges::Lattice(lattice) => Values::Lattice(LatticeValues::new(lattice, network.weights())),
            edges @ Edges::List(_) => Values::Csr(CsrValues::new(edges, network.weights(), nodes)),
        };
        let mut matrix = Self {
            network,
            nodes,
            values,
            links: Vec::new(),
            link_sums: vec![0.0; nodes],
            dirty: vec![true; nodes],
            changed_rows: (0..nodes as u32).collect(),
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
            let base = self.network.weights()[edge];
            // Negative weights are no capacitors; they are left as they are.
            let weight = if base > 0.0 { base * occupancy.through()[edge] } else { base };
            match &mut self.values {
                Values::Lattice(values) => values.set_weight(edge, weight),
                Values::Csr(values) => values.set_weight(edge, weight),
            }
            for node in self.network.edges().ends(edge).into_iter().flatten() {
                self.mark(node);
            }
        }
        for link in occupancy.links() {
            let base = self.network.weights()[link.edge as usize];
            if base > 0.0 {
                let (weight, object_row) = (base * link.factor, self.nodes as u32 + u32::from(link.object));
                self.links.push(WeightedLink { node: link.node, object_row, weight });
                self.link_sums[link.node as usize] += weight;
                self.mark(link.node);
            }
        }
        self.refresh_diagonal();
    }

    fn mark(&mut self, row: u32) {
        if !std::mem::replace(&mut self.dirty[row as usize], true) {
            self.changed_rows.push(row);
        }
    }

    fn refresh_diagonal(&mut self) {
        for &row in &self.changed_rows {
            let row = row as usize;
            self.dirty[row] = false;
            if let Values::Csr(values) = &mut self.values {
                values.refresh_diagonal(row, self.link_sums[row]);
            }
        }
    }

    /// Number of node rows.
    pub fn nodes(&self) -> usize {
        self.nodes
    }

    /// The edges and their weights without objects.
    pub fn network(&self) -> &EdgeNetwork {
        &self.network
    }

    /// The part of the matrix over nodes, in metres times relative permittivity.
    pub fn to_csr(&self) -> CsrMatrix<f64> {
        match &self.values {
            Values::Csr(values) => values.matrix().clone(),
            Values::Lattice(values) => {
                let edges = self.network.edges();
                let weights: Vec<f64> = (0..edges.len()).map(|e| values.weight(e / 3, e % 3)).collect();
                let mut csr = CsrValues::new(edges, &weights, self.nodes);
                (0..self.nodes).for_each(|row| csr.refresh_diagonal(row, self.link_sums[row]));
                csr.matrix().clone()
            }
        }
    }

    /// The diagonal entry of a node's row.
    pub fn diagonal(&self, node: usize) -> f64 {
        match &self.values {
            Values::Lattice(values) => values.diagonal(node) + self.link_sums[node],
            Values::Csr(values) => values.diagonal(node),
        }
    }

    /// The weight from a node of a lattice to the next one along an axis; zero on other meshes.
    pub(crate) fn lattice_weight(&self, node: usize, axis: usize) -> f64 {
        match &self.values {
            Values::Lattice(values) => values.weight(node, axis),
            Values::Csr(_) => 0.0,
        }
    }

    /// The neighbours of a node and the weights to them, in an order that never changes.
    pub(crate) fn row(&self, node: usize) -> impl Iterator<Item = (usize, f64)> {
        let (of_lattice, of_csr) = match &self.values {
            Values::Lattice(values) => (Some(values.row(node)), None),
            Values::Csr(values) => (None, Some(values.row(node))),
        };
        of_lattice.into_iter().flatten().chain(of_csr.into_iter().flatten())
    }

    /// Links between a node's row and an object's: node, row of the object, weight.
    pub(crate) fn links(&self) -> impl Iterator<Item = (usize, usize, f64)> {
        self.links.iter().map(|link| (link.node as usize, link.object_row as usize, link.weight))
    }

    /// Sum of the weights of a node's links to objects.
    pub fn link_weight(&self, node: usize) -> f64 {
        self.link_sums[node]
    }

    /// Rows that the last update recomputed; all rows of a new matrix.
    pub fn changed_rows(&self) -> &[u32] {
        &self.changed_rows
    }

    /// y = K x, all columns at once, and the columns' energies xᵀKx.
    pub fn apply<T: Copy + Into<f64>>(&self, x: &[[T; LANES]], y: &mut [Lane]) -> Lane {
        let mut energy = match &self.values {
            Values::Lattice(values) => values.apply(x, y),
            Values::Csr(values) => values.apply(x, y),
        };
        y[self.nodes..].fill([0.0; LANES]);
        for link in &self.links {
            let (node, object) = (link.node as usize, link.object_row as usize);
            // The node's own share stands on the diagonal of compressed rows; a lattice has no diagonal.
            let own = if matches!(self.values, Values::Lattice(_)) { 1.0 } else { 0.0 };
            for lane in 0..LANES {
                let (at_node, at_object) = (x[node][lane].into(), x[object][lane].into());
                let to_node = link.weight * (own * at_node - at_object);
                let to_object = link.weight * (at_object - at_node);
                y[node][lane] += to_node;
                y[object][lane] += to_object;
                energy[lane] += at_node * to_node + at_object * to_object;
            }
        }
        energy
    }
}
