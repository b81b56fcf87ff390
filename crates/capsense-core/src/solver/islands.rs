//! Bodies of very high permittivity that nothing holds at a potential.
//!
//! Inside such a body the potential is nearly constant and nearly free to move: one direction of very low energy for
//! each body, which neither smoothing nor a hierarchy built for air finds quickly, and which an iteration that never met
//! it cannot report. Adding the exact solution in that direction, 1 (1ᵀK1)⁻¹ 1ᵀ with 1 the body's indicator, to a
//! preconditioner takes it out of the spectrum (Nicolaides 1987). A body within another one that is far weaker, or beside
//! it, is an island in an island and has such a direction of its own: 1 less its part along the directions of the islands
//! around it, in the scalar product of K, so that solutions along both may be added.

use crate::occupancy::{IndexList, Occupancy};
use crate::stiffness::StiffnessMatrix;
use std::ops::Range;

/// Edges whose weight is raised by at least this factor hold an island together. Measured at 200k tetrahedra with a body
/// of 80 that moves 1 mm a frame: with 10, a frame takes 3 iterations on average and 8 at most; with 200, as if there were
/// no islands, 4 and 10, and errors are told too small in some frames.
pub(crate) const CONTRAST: f64 = 10.0;

/// A body in one that it is so many times stronger than is an island of its own in that, and so on.
const NESTED: f64 = 100.0;

/// Of stronger couplings, K in double precision does not know what is around them.
const STRONGEST: f64 = 1e14;

/// The islands of one frame.
#[derive(Clone, Debug)]
pub(super) struct Islands {
    /// From which contrast on edges hold a body together that gets a direction.
    least_contrast: f64,
    islands: Vec<Island>,
    /// The nodes of all islands, each one's in increasing order, and what each has around it.
    nodes: Vec<u32>,
    around: Vec<Part>,
    /// Edges that hold islands together, and whether each edge of the mesh is one.
    strong: IndexList,
    is_strong: Vec<bool>,
    /// The nodes joined so far, and one that each node of the mesh is joined to: itself outside of islands.
    members: IndexList,
    parent: Vec<u32>,
    /// Of the islands found last, each node after the one that it is joined to, and weights that lead out of one of them.
    joined: Vec<[u32; 2]>,
    outward: Vec<Outward>,
    /// How far to go along the direction of each island, and dᵀr in one column after the other.
    along: Vec<f64>,
    of_columns: Vec<f64>,
}

/// Nodes that are joined by strong edges.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Island {
    /// Which of all nodes. The first is the one that the others are joined to.
    nodes: Range<usize>,
    /// Which of all parts: of the islands around it, from the outermost on.
    around: Range<usize>,
    /// dᵀKd of its direction d.
    stiffness: f64,
}

/// How much of an island's indicator lies along the direction of one around it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Part {
    island: usize,
    part: f64,
}

/// A weight that leads out of an island, and the node that it leads to if that is none of an object.
#[derive(Clone, Copy, Debug)]
struct Outward {
    to: Option<u32>,
    weight: f64,
}

/// Of a direction that is so little of the island's indicator, nothing but rounding is left.
const SAME: f64 = 1e-6;

impl Islands {
    /// None yet, of bodies of at least a contrast.
    pub(super) fn from_contrast(least_contrast: f64) -> Self {
        Self {
            least_contrast,
            islands: Vec::new(),
            nodes: Vec::new(),
            around: Vec::new(),
            strong: IndexList::below(0),
            is_strong: Vec::new(),
            members: IndexList::below(0),
            parent: Vec::new(),
            joined: Vec::new(),
            outward: Vec::new(),
            along: Vec::new(),
            of_columns: Vec::new(),
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.islands.is_empty()
    }

    /// Finds the connected sets of free nodes that strong edges hold together. `changed` holds the nodes whose row or
    /// state changed since the last time.
    pub(super) fn find(
        &mut self,
        matrix: &StiffnessMatrix,
        occupancy: &Occupancy,
        fixed: &[bool],
        changed: &[u32],
    ) {
        self.find_strong_edges(matrix, occupancy, fixed, changed);
        if self.parent.is_empty() {
            self.parent.extend(0..matrix.nodes() as u32);
            self.members = IndexList::below(matrix.nodes());
        }
        self.islands.clear();
        self.nodes.clear();
        self.around.clear();
        let mut contrast = self.least_contrast;
        while contrast < STRONGEST && self.join(matrix, occupancy, contrast) {
            self.collect(matrix, occupancy);
            contrast *= NESTED;
        }
    }

    /// Joins the nodes of edges of some strength. Returns whether there are any.
    fn join(&mut self, matrix: &StiffnessMatrix, occupancy: &Occupancy, contrast: f64) -> bool {
        for &node in self.members.numbers() {
            self.parent[node as usize] = node;
        }
        self.members.clear();
        for &edge in self.strong.numbers() {
            if occupancy.contrast(edge as usize) < contrast {
                continue;
            }
            let [a, b] = matrix.network().edges().ends_of_existing(edge as usize);
            [a, b].into_iter().for_each(|node| self.members.insert(node as usize));
            let (a, b) = (root(&mut self.parent, a), root(&mut self.parent, b));
            self.parent[a.max(b) as usize] = a.min(b);
        }
        self.members.sort();
        !self.members.numbers().is_empty()
    }

    /// The nodes of each island, in the order of their smallest ones.
    #[cfg(test)]
    pub(super) fn nodes(&self) -> impl Iterator<Item = &[u32]> {
        self.islands.iter().map(|island| &self.nodes[island.nodes.clone()])
    }

    /// All that is known of the islands.
    #[cfg(test)]
    pub(super) fn islands(&self) -> (&[Island], &[u32], &[Part]) {
        (&self.islands, &self.nodes, &self.around)
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
        if is_strong.is_empty() {
            is_strong.resize(edges.len(), false);
            *strong = IndexList::below(edges.len());
        }
        let are_free = |ends: [u32; 2]| ends.iter().all(|&node| !fixed[node as usize]);
        let (mut are_more, mut are_less) = (false, false);
        for &node in changed {
            edges.for_edges_at(node as usize, |edge, _| {
                let is_strong_now =
                    occupancy.contrast(edge) >= self.least_contrast && edges.ends(edge).is_some_and(are_free);
                if is_strong_now != is_strong[edge] {
                    is_strong[edge] = is_strong_now;
                    (are_more, are_less) = (are_more || is_strong_now, are_less || !is_strong_now);
                    if is_strong_now {
                        strong.insert(edge);
                    }
                }
            });
        }
        if are_less {
            strong.retain(|edge| is_strong[edge]);
        }
        if are_more {
            strong.sort();
        }
    }

    /// Adds the islands that were joined; some are in islands that are there already, held together by weaker edges.
    fn collect(&mut self, matrix: &StiffnessMatrix, occupancy: &Occupancy) {
        let weaker = self.islands.len();
        let mut joined = std::mem::take(&mut self.joined);
        joined.clear();
        joined.extend(self.members.numbers().iter().map(|&node| [root(&mut self.parent, node), node]));
        joined.sort_unstable();
        for island in joined.chunk_by(|a, b| a[0] == b[0]) {
            let first = self.nodes.len();
            self.nodes.extend(island.iter().map(|[_, node]| node));
            self.find_outward(first, matrix, occupancy);
            if !self.add(first, weaker) {
                self.nodes.truncate(first);
            }
        }
        self.joined = joined;
    }

    /// Finds the weights that lead out of the nodes from the first one on.
    fn find_outward(&mut self, first: usize, matrix: &StiffnessMatrix, occupancy: &Occupancy) {
        let Self { nodes, parent, outward, .. } = self;
        let (nodes, network) = (&nodes[first..], matrix.network());
        outward.clear();
        for &node in nodes {
            match matrix.link_weight(node as usize) {
                0.0 => {}
                weight => outward.push(Outward { to: None, weight }),
            }
            network.edges().for_edges_at(node as usize, |edge, end| {
                let base = network.weights()[edge];
                if base == 0.0 {
                    // On a lattice, there may be no such edge.
                    return;
                }
                let other = network.edges().ends_of_existing(edge)[1 - end];
                if root(parent, other) != nodes[0] {
                    let is_scaled = base > 0.0 || occupancy.scales_negative_weights();
                    let weight = if is_scaled { base * occupancy.coupling(edge).through } else { base };
                    outward.push(Outward { to: Some(other), weight });
                }
            });
        }
    }

    /// Adds an island of the nodes from the first one on, within the innermost of so many weaker ones that it is in. Returns whether it
    /// has a direction of its own; if not, it is not added.
    fn add(&mut self, first: usize, weaker: usize) -> bool {
        let Self { islands, nodes, around, outward, .. } = self;
        let own: f64 = outward.iter().map(|outward| outward.weight).sum();
        let (begin, mut stiffness) = (around.len(), own);
        let innermost = islands[..weaker].iter().rposition(|island| island.holds(nodes, nodes[first]));
        let further = innermost.map_or(0..0, |index| islands[index].around.clone());
        // The islands around that one, then it itself.
        for index in further.map(Some).chain([None]) {
            let Some(index) = index.map(|part| around[part].island).or(innermost) else { break };
            let other = &islands[index];
            let leaves = |to: Option<u32>| to.is_none_or(|node| !other.holds(nodes, node));
            let with_indicator: f64 =
                outward.iter().filter(|outward| leaves(outward.to)).map(|outward| outward.weight).sum();
            // 1ᵀKd, as the other direction d is its indicator less its part along those around it.
            let along = around[other.around.clone()].iter().zip(&around[begin..]);
            let product = along.fold(with_indicator, |product, (of_other, own)| {
                product - of_other.part * own.part * islands[of_other.island].stiffness
            });
            around.push(Part { island: index, part: product / other.stiffness });
            stiffness -= product * product / other.stiffness;
        }
        let has_direction = stiffness > SAME * own;
        if has_direction {
            islands.push(Island { nodes: first..nodes.len(), around: begin..around.len(), stiffness });
        } else {
            around.truncate(begin);
        }
        has_direction
    }

    /// Adds to RᵀMR, of pairs s <= t of the active columns, what the directions of all islands gain. `r` reads r at a node
    /// in a column.
    pub(super) fn add_gains(
        &mut self,
        r: impl Fn(u32, usize) -> f64,
        active: &[usize],
        columns: usize,
        gains: &mut [f64],
    ) {
        self.of_columns.clear();
        for &column in active {
            self.find_along(|node| r(node, column));
            self.of_columns.extend_from_slice(&self.along);
        }
        let of_columns = self.of_columns.chunks_exact(self.islands.len());
        for (index, (&t, of_t)) in active.iter().zip(of_columns.clone()).enumerate() {
            for (&s, of_s) in active[..=index].iter().zip(of_columns.clone()) {
                let products = self.islands.iter().zip(of_s.iter().zip(of_t));
                gains[s * columns + t] +=
                    products.map(|(island, (s, t))| s * t / island.stiffness).sum::<f64>();
            }
        }
    }

    /// dᵀr of the direction d of every island.
    fn find_along(&mut self, r: impl Fn(u32) -> f64) {
        let Self { islands, nodes, around, along, .. } = self;
        along.clear();
        for island in &*islands {
            let within: f64 = nodes[island.nodes.clone()].iter().map(|&node| r(node)).sum();
            let parts = &around[island.around.clone()];
            along.push(parts.iter().fold(within, |sum, of| sum - of.part * along[of.island]));
        }
    }

    /// Adds d (dᵀr)/(dᵀKd) for the direction d of every island to one column's z. `r` reads r at a node; `raise` adds to z
    /// at a node.
    pub(super) fn correct(&mut self, r: impl Fn(u32) -> f64, mut raise: impl FnMut(u32, f64)) {
        self.find_along(r);
        let Self { islands, nodes, around, along, .. } = self;
        // From dᵀr to how far to go along d, and from there, the innermost first, to how far along 1.
        along.iter_mut().zip(&*islands).for_each(|(along, island)| *along /= island.stiffness);
        for (index, island) in islands.iter().enumerate().rev() {
            let shift = along[index];
            around[island.around.clone()].iter().for_each(|of| along[of.island] -= of.part * shift);
            nodes[island.nodes.clone()].iter().for_each(|&node| raise(node, shift));
        }
    }
}

impl Island {
    /// Whether a node is one of its own, of the nodes of all islands.
    fn holds(&self, nodes: &[u32], node: u32) -> bool {
        nodes[self.nodes.clone()].binary_search(&node).is_ok()
    }
}

fn root(parent: &mut [u32], mut node: u32) -> u32 {
    while parent[node as usize] != node {
        parent[node as usize] = parent[parent[node as usize] as usize];
        node = parent[node as usize];
    }
    node
}
