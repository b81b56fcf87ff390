//! Bodies of very high permittivity that nothing holds at a potential.
//!
//! Inside such a body the potential is nearly constant and nearly free to move: one direction of very low energy for
//! each body, which neither smoothing nor a hierarchy built for air finds quickly, and which an iteration that never met
//! it cannot report. Adding the exact solution in that direction, 1 (1ᵀK1)⁻¹ 1ᵀ with 1 the body's indicator, to a
//! preconditioner takes it out of the spectrum (Nicolaides 1987). A body within another one that is far weaker, or beside
//! it, has such a direction of its own.

use crate::occupancy::Occupancy;
use crate::stiffness::StiffnessMatrix;

/// Edges whose weight is raised by at least this factor hold an island together. Measured at 200k tetrahedra with a body
/// of 80 that moves 1 mm a frame: with 10, a frame takes 3 iterations on average and 8 at most; with 200, as if there were
/// no islands, 4 and 10, and errors are told too small in some frames.
pub(crate) const CONTRAST: f64 = 10.0;

/// A body in one that it is so many times stronger than is an island of its own in that, and so on.
const NESTED: f64 = 100.0;

/// The islands of one frame.
#[derive(Clone, Debug, Default)]
pub(super) struct Islands {
    islands: Vec<Island>,
    /// Edges that hold islands together, and whether each edge of the mesh is one.
    strong: Vec<u32>,
    is_strong: Vec<bool>,
    /// The nodes joined so far, and for each node of the mesh one that it is joined to: itself outside of islands.
    members: Vec<u32>,
    parent: Vec<u32>,
}

/// Nodes that are joined by strong edges.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Island {
    /// The node that the others are joined to.
    root: u32,
    nodes: Vec<u32>,
    /// 1ᵀK1: the sum of the weights that lead out.
    stiffness: f64,
}

impl Islands {
    /// Finds the connected sets of free nodes that strong edges hold together. `changed` holds the nodes whose row or
    /// state changed since the last time.
    pub(super) fn is_empty(&self) -> bool {
        self.islands.is_empty()
    }

    pub(super) fn find(
        &mut self,
        matrix: &StiffnessMatrix,
        occupancy: &Occupancy,
        fixed: &[bool],
        changed: &[u32],
    ) {
        self.find_strong_edges(matrix, occupancy, fixed, changed);
        self.parent.extend(self.parent.len() as u32..matrix.nodes() as u32);
        self.islands.clear();
        let (mut contrast, mut outer) = (CONTRAST, 0);
        while self.join(matrix, occupancy, contrast) {
            let found = self.islands.len();
            self.collect(matrix, occupancy, outer);
            (contrast, outer) = (NESTED * contrast, found);
        }
    }

    /// Joins the nodes of edges of some strength. Returns whether there are any.
    fn join(&mut self, matrix: &StiffnessMatrix, occupancy: &Occupancy, contrast: f64) -> bool {
        for node in self.members.drain(..) {
            self.parent[node as usize] = node;
        }
        for &edge in &self.strong {
            if occupancy.couplings()[edge as usize].through < contrast {
                continue;
            }
            let [a, b] = matrix.network().edges().ends_of_existing(edge as usize);
            self.members.extend([a, b]);
            let (a, b) = (root(&mut self.parent, a), root(&mut self.parent, b));
            self.parent[a.max(b) as usize] = a.min(b);
        }
        self.members.sort_unstable();
        self.members.dedup();
        !self.members.is_empty()
    }

    /// The islands found last, in the order of their smallest nodes.
    #[cfg(test)]
    pub(super) fn islands(&self) -> &[Island] {
        &self.islands
    }

    fn find_strong_edges(
        &mut self,
        matrix: &StiffnessMatrix,
        occupancy: &Occupancy,
        fixed: &[bool],
        changed: &[u32],
    ) {
        let Self { strong, is_strong, .. } = self;
        let edges = matrix.network().edges();
        is_strong.resize(edges.len(), false);
        let are_free = |ends: [u32; 2]| ends.iter().all(|&node| !fixed[node as usize]);
        for &node in changed {
            edges.for_edges_at(node as usize, |edge, _| {
                let is_strong_now =
                    occupancy.couplings()[edge].through >= CONTRAST && edges.ends(edge).is_some_and(are_free);
                if is_strong_now && !is_strong[edge] {
                    strong.push(edge as u32);
                }
                is_strong[edge] = is_strong_now;
            });
        }
        strong.retain(|&edge| is_strong[edge as usize]);
        strong.sort_unstable();
        // An edge that was strong, was not and is again has been listed twice.
        strong.dedup();
    }

    /// Adds the islands that were joined, but for those that are there from `outer` on, held together by weaker edges.
    fn collect(&mut self, matrix: &StiffnessMatrix, occupancy: &Occupancy, outer: usize) {
        let Self { islands, members, parent, .. } = self;
        let first = islands.len();
        let network = matrix.network();
        for &node in &*members {
            // The smallest node of an island is its root, and comes first.
            let root_of_node = root(parent, node);
            if root_of_node == node {
                islands.push(Island { root: node, nodes: Vec::new(), stiffness: 0.0 });
            }
            let Ok(island) = islands[first..].binary_search_by_key(&root_of_node, |island| island.root)
            else {
                continue;
            };
            let Island { nodes, stiffness, .. } = &mut islands[first + island];
            nodes.push(node);
            *stiffness += matrix.link_weight(node as usize);
            network.edges().for_edges_at(node as usize, |edge, end| {
                let Some(ends) = network.edges().ends(edge) else { return };
                if root(parent, ends[1 - end]) != root_of_node {
                    let base = network.weights()[edge];
                    *stiffness += if base > 0.0 { base * occupancy.couplings()[edge].through } else { base };
                }
            });
        }
        let inner = islands.split_off(first);
        let is_new = |island: &Island| {
            islands[outer..]
                .iter()
                .all(|other| (other.root, other.nodes.len()) != (island.root, island.nodes.len()))
        };
        let inner: Vec<_> =
            inner.into_iter().filter(|island| island.stiffness > 0.0 && is_new(island)).collect();
        islands.extend(inner);
    }

    /// Adds 1 (1ᵀr)/(1ᵀK1) of every island to one column's z and returns what that adds to r·z. `r` reads r at a node;
    /// `raise` adds to z at a node and returns what was added after rounding.
    pub(super) fn correct(&self, r: impl Fn(u32) -> f64, mut raise: impl FnMut(u32, f64) -> f64) -> f64 {
        let mut product = 0.0;
        for island in &self.islands {
            let shift = island.nodes.iter().map(|&node| r(node)).sum::<f64>() / island.stiffness;
            product += island.nodes.iter().map(|&node| r(node) * raise(node, shift)).sum::<f64>();
        }
        product
    }
}

fn root(parent: &mut [u32], mut node: u32) -> u32 {
    while parent[node as usize] != node {
        parent[node as usize] = parent[parent[node as usize] as usize];
        node = parent[node as usize];
    }
    node
}
