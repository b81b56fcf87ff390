//! The network of a mesh that is no lattice, for fields that are solved for elsewhere: which nodes are neighbours, and how
//! nodes form aggregates, level by level.

use super::csr::aggregated;
use crate::stiffness::StiffnessMatrix;

/// The aggregate of a row that is in none, as its potential is held in the empty scene, or nearly.
pub const NO_AGGREGATE: u32 = u32::MAX;

/// What is known of K and of the fields before any value of K is.
#[derive(Clone, Debug)]
pub struct NetworkProblem {
    /// Where the neighbours of each node begin, and in the end their number.
    pub offsets: Vec<u32>,
    /// The neighbours of all nodes, in the order in which [`NetworkRow`](super::NetworkRow) tells weights.
    pub neighbours: Vec<u32>,
    /// An order of the nodes in which neighbours are close together: the place of each.
    pub row_of_node: Vec<u32>,
    /// For each step to a coarser level the aggregate of each row of the finer one, in the order of `row_of_node`;
    /// [`NO_AGGREGATE`] for some. What is strongly coupled in the empty scene is in one aggregate.
    pub aggregates: Vec<Vec<u32>>,
    /// Number of fields: one for each electrode and for each object that finds its own potential.
    pub columns: usize,
}

impl NetworkProblem {
    /// Of the empty scene's matrix. `fixed` tells which nodes are held.
    pub(crate) fn new(matrix: &StiffnessMatrix, fixed: &[bool], columns: usize) -> Self {
        let mut offsets = vec![0];
        let mut neighbours = Vec::new();
        for node in 0..matrix.nodes() {
            neighbours.extend(matrix.row(node).map(|(other, _)| other as u32));
            offsets.push(neighbours.len() as u32);
        }
        let (row_of_node, aggregates) = aggregated(matrix, fixed);
        Self { offsets, neighbours, row_of_node, aggregates, columns }
    }

    /// Number of nodes.
    pub fn nodes(&self) -> usize {
        self.row_of_node.len()
    }

    /// The neighbours of a node.
    pub fn neighbours(&self, node: usize) -> &[u32] {
        &self.neighbours[self.offsets[node] as usize..self.offsets[node + 1] as usize]
    }
}
