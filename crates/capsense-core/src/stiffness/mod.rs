//! The stiffness matrix K of the potential, over all nodes and one more row for each electrode and each object.
//!
//! K is the Laplacian of the weighted edges, kept uneliminated: what is held at a fixed potential is a partition of
//! the rows, never an edit of K. The sparsity pattern is that of the mesh's edges and never changes. Links to
//! conductors that lie between nodes couple a node's row to the object's row and are kept beside the pattern.
//! Values are recomputed from base weights and factors, not accumulated, so K after any number of frames equals K
//! built afresh.

mod csr;
mod lattice;
mod network;
mod rim;

pub use network::{EdgeNetwork, barycentric_gradients};

use crate::mesh::Edges;
use crate::occupancy::{IndexList, Occupancy};
use csr::CsrValues;
use lattice::LatticeValues;
use nalgebra_sparse::CsrMatrix;
use rim::RimWeights;

/// A field or its charges at one row, for up to [`LANES`] terminals at once, as [`StiffnessMatrix::apply`] takes them.
pub type Lane = [f64; LANES];

/// Number of columns that are multiplied together.
pub const LANES: usize = 4;

/// The stiffness matrix. Rows 0..nodes are nodes, then come those of the network's electrodes, then objects, as many as
/// vectors have.
#[derive(Clone, Debug)]
pub struct StiffnessMatrix {
    network: EdgeNetwork,
    nodes: usize,
    values: Values,
    links: Vec<WeightedLink>,
    rim: RimWeights,
    /// Sum of the weights of each node's links.
    link_sums: Vec<f64>,
    /// Nodes whose links are to be summed up anew.
    relinked: IndexList,
    /// Nodes in whose rows the last update changed values.
    changed_rows: IndexList,
}

/// The current weights, stored as the mesh allows.
#[derive(Clone, Debug)]
enum Values {
    Lattice(LatticeValues),
    Csr(CsrValues),
}

/// A capacitance between a node's row and that of an electrode or an object.
#[derive(Clone, Copy, Debug, PartialEq)]
struct WeightedLink {
    node: u32,
    body_row: u32,
    weight: f64,
}

impl StiffnessMatrix {
    /// Builds the matrix of a network without objects; that of a lattice is kept without indices.
    pub fn new(network: EdgeNetwork, nodes: usize) -> Self {
        match network.edges() {
            Edges::Lattice(lattice) => {
                let values = LatticeValues::new(lattice, network.weights().len());
                Self::with_values(network, nodes, Values::Lattice(values))
            }
            Edges::List(_) => Self::in_rows(network, nodes),
        }
    }

    /// Builds the matrix in compressed rows, whatever the network.
    pub fn in_rows(network: EdgeNetwork, nodes: usize) -> Self {
        let values = CsrValues::new(network.edges(), network.weights(), nodes);
        Self::with_values(network, nodes, Values::Csr(values))
    }

    fn with_values(network: EdgeNetwork, nodes: usize, values: Values) -> Self {
        let mut matrix = Self {
            rim: RimWeights::new(network.rim()),
            network,
            nodes,
            values,
            links: Vec::new(),
            link_sums: vec![0.0; nodes],
            relinked: IndexList::below(nodes),
            changed_rows: IndexList::below(nodes),
        };
        (0..nodes).for_each(|node| matrix.changed_rows.insert(node));
        for link in matrix.rim.links() {
            matrix.link_sums[link.node as usize] += link.weight;
        }
        matrix.push_rim_links();
        matrix.refresh_diagonal();
        matrix
    }

    /// Forgets that all rows are new, and what room that took: far fewer change from now on.
    pub(crate) fn settle(&mut self) {
        self.changed_rows.release();
    }

    /// Takes over what changed in the occupancy. Only changed rows are touched.
    pub fn update(&mut self, occupancy: &Occupancy) {
        self.changed_rows.clear();
        self.rim.start_update();
        for &(edge, before) in occupancy.replaced_couplings() {
            let edge = edge as usize;
            let base = self.network.weights()[edge];
            // For the edge rule negative weights are no capacitors; they are left as they are.
            if base > 0.0 || occupancy.scales_negative_weights() {
                let ends = self.network.edges().ends_of_existing(edge);
                let now = occupancy.coupling(edge);
                self.scale(edge, ends, now.through);
                for (end, node) in ends.into_iter().enumerate() {
                    if now.factor[end] != 0.0 || self.link_sums[node as usize] != 0.0 {
                        self.relinked.insert(node as usize);
                    }
                    // A link may lead to another object and weigh the same, and several may weigh the same together.
                    let [was, is] = [&before, now].map(|of| (of.object[end], of.factor[end].to_bits()));
                    if was != is {
                        self.changed_rows.insert(node as usize);
                    }
                }
            }
        }
        self.sum_links(occupancy);
        if !occupancy.changed_edges().is_empty() {
            self.collect_links(occupancy);
        }
        self.refresh_diagonal();
    }

    /// Gives an edge so many times the weight that it has in the network.
    fn scale(&mut self, edge: usize, ends: [u32; 2], factor: f64) {
        let network = self.network.weights();
        let is_changed = match &mut self.values {
            Values::Lattice(values) => values.scale(network, edge, factor),
            Values::Csr(values) => values.set_weight(edge, network[edge] * factor),
        };
        if is_changed {
            ends.into_iter().for_each(|node| self.changed_rows.insert(node as usize));
        }
    }

    /// The weight of an edge now.
    fn weight(&self, edge: usize) -> f64 {
        match &self.values {
            Values::Lattice(values) => values.weight(self.network.weights(), edge),
            Values::Csr(values) => values.weight(edge),
        }
    }

    /// Sums up the links at nodes anew, always in the same order.
    fn sum_links(&mut self, occupancy: &Occupancy) {
        let (edges, weights) = (self.network.edges(), self.network.weights());
        let scales_negative = occupancy.scales_negative_weights();
        for &node in self.relinked.numbers() {
            let mut sum = self.rim.update(node, &self.network, occupancy);
            edges.for_edges_at(node as usize, |edge, end| {
                if weights[edge] > 0.0 || scales_negative {
                    sum += weights[edge] * occupancy.coupling(edge).factor[end];
                }
            });
            if f64::to_bits(sum) != self.link_sums[node as usize].to_bits() {
                self.link_sums[node as usize] = sum;
                self.changed_rows.insert(node as usize);
            }
        }
        self.relinked.clear();
    }

    fn collect_links(&mut self, occupancy: &Occupancy) {
        self.links.clear();
        self.push_rim_links();
        let first_object = self.nodes + self.network.held_rows();
        for &edge in occupancy.linked_edges() {
            let base = self.network.weights()[edge as usize];
            if base > 0.0 || occupancy.scales_negative_weights() {
                let ends = self.network.edges().ends_of_existing(edge as usize);
                for (end, object, factor) in occupancy.coupling(edge as usize).links() {
                    let body_row = first_object as u32 + u32::from(object);
                    self.links.push(WeightedLink { node: ends[end], body_row, weight: base * factor });
                }
            }
        }
    }

    fn push_rim_links(&mut self) {
        let first_electrode = self.nodes as u32;
        self.links.extend(self.rim.links().iter().map(|link| WeightedLink {
            node: link.node,
            body_row: first_electrode + u32::from(link.electrode),
            weight: link.weight,
        }));
    }

    fn refresh_diagonal(&mut self) {
        if let Values::Csr(values) = &mut self.values {
            for &row in self.changed_rows.numbers() {
                values.refresh_diagonal(row as usize, self.link_sums[row as usize]);
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
            Values::Lattice(_) => {
                let edges = self.network.edges();
                let weights: Vec<f64> = (0..edges.len()).map(|edge| self.weight(edge)).collect();
                let mut csr = CsrValues::new(edges, &weights, self.nodes);
                (0..self.nodes).for_each(|row| csr.refresh_diagonal(row, self.link_sums[row]));
                csr.matrix().clone()
            }
        }
    }

    /// The diagonal entry of a node's row.
    pub fn diagonal(&self, node: usize) -> f64 {
        match &self.values {
            Values::Lattice(values) => values.diagonal(self.network.weights(), node) + self.link_sums[node],
            Values::Csr(values) => values.diagonal(node),
        }
    }

    /// The weight from a node of a lattice to the next one along an axis; zero on other meshes.
    pub(crate) fn lattice_weight(&self, node: usize, axis: usize) -> f64 {
        match &self.values {
            Values::Lattice(values) => values.weight(self.network.weights(), 3 * node + axis),
            Values::Csr(_) => 0.0,
        }
    }

    /// The same along all axes.
    #[inline]
    pub(crate) fn lattice_weights(&self, node: usize) -> [f64; 3] {
        match &self.values {
            Values::Lattice(values) => values.weights_from(self.network.weights(), node),
            Values::Csr(_) => [0.0; 3],
        }
    }

    /// The neighbours of a node and the weights to them, in an order that never changes.
    pub(crate) fn row(&self, node: usize) -> impl Iterator<Item = (usize, f64)> {
        let (of_lattice, of_csr) = match &self.values {
            Values::Lattice(values) => (Some(values.row(self.network.weights(), node)), None),
            Values::Csr(values) => (None, Some(values.row(node))),
        };
        of_lattice.into_iter().flatten().chain(of_csr.into_iter().flatten())
    }

    /// Links between a node's row and that of an electrode or an object: node, row of the other, weight.
    pub(crate) fn links(&self) -> impl Iterator<Item = (usize, usize, f64)> {
        self.links.iter().map(|link| (link.node as usize, link.body_row as usize, link.weight))
    }

    /// Sum of the weights of a node's links.
    pub fn link_weight(&self, node: usize) -> f64 {
        self.link_sums[node]
    }

    /// Whether a node has a link that is there in the empty scene too: to an electrode, or through an open wall.
    pub(crate) fn has_link_of_its_own(&self, node: u32) -> bool {
        self.rim.has_link(node)
    }

    /// Whether the last update changed the weight of a link between an electrode and its rim.
    pub(crate) fn rim_changed(&self) -> bool {
        self.rim.changed()
    }

    /// Visits the two rows and the weight of every edge and of every link.
    pub(crate) fn for_each_weight(&self, mut visit: impl FnMut([usize; 2], f64)) {
        for edge in 0..self.network.edges().len() {
            if let Some([a, b]) = self.network.edges().ends(edge) {
                visit([a as usize, b as usize], self.weight(edge));
            }
        }
        for link in &self.links {
            visit([link.node as usize, link.body_row as usize], link.weight);
        }
    }

    /// Whether this is the matrix of a lattice, without indices.
    pub(crate) fn is_lattice(&self) -> bool {
        matches!(self.values, Values::Lattice(_))
    }

    /// Nodes whose rows hold other values since the last update, on the diagonal or beside it; all of a new matrix,
    /// none of that of a new simulator.
    pub fn changed_rows(&self) -> &[u32] {
        self.changed_rows.numbers()
    }

    /// y = K x, all columns at once, and the columns' energies xᵀKx.
    pub fn apply<T: Copy + Into<f64>>(&self, x: &[[T; LANES]], y: &mut [Lane]) -> Lane {
        let mut energy = match &self.values {
            Values::Lattice(values) => values.apply(self.network.weights(), x, y),
            Values::Csr(values) => values.apply(x, y),
        };
        y[self.nodes..].fill([0.0; LANES]);
        for link in &self.links {
            let (node, body) = (link.node as usize, link.body_row as usize);
            // The node's own share stands on the diagonal of compressed rows; a lattice has no diagonal.
            let own = if matches!(self.values, Values::Lattice(_)) { 1.0 } else { 0.0 };
            for lane in 0..LANES {
                let (at_node, at_body) = (x[node][lane].into(), x[body][lane].into());
                let to_node = link.weight * (own * at_node - at_body);
                let to_body = link.weight * (at_body - at_node);
                y[node][lane] += to_node;
                y[body][lane] += to_body;
                energy[lane] += at_node * to_node + at_body * to_body;
            }
        }
        energy
    }
}
