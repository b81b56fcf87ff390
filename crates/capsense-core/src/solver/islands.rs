//! Bodies of very high permittivity that nothing holds at a potential.
//!
//! Inside such a body the potential is nearly constant and nearly free to move: one direction of very low energy for
//! each body, which neither smoothing nor a hierarchy built for air finds quickly, and which an iteration that never met
//! it cannot report. Adding the exact solution in that direction, 1 (1ᵀK1)⁻¹ 1ᵀ with 1 the body's indicator, to a
//! preconditioner takes it out of the spectrum (Nicolaides 1987).

use crate::occupancy::Occupancy;
use crate::stiffness::StiffnessMatrix;

/// Edges whose weight is raised by at least this factor hold an island together.
pub(crate) const CONTRAST: f64 = 200.0;

/// The islands of one frame.
#[derive(Clone, Debug, Default)]
pub(super) struct Islands {
    islands: Vec<Island>,
    parent: Vec<u32>,
}

#[derive(Clone, Debug)]
struct Island {
    nodes: Vec<u32>,
    /// 1ᵀK1: the sum of the weights that lead out.
    stiffness: f64,
}

impl Islands {
    /// Finds the connected sets of free nodes that strong edges hold together.
    pub(super) fn find(&mut self, matrix: &StiffnessMatrix, occupancy: &Occupancy, fixed: &[bool]) {
        self.islands.clear();
        let strong = |edge: usize| occupancy.couplings()[edge].through >= CONTRAST;
        if !(0..occupancy.couplings().len()).any(strong) {
            return;
        }
        let edges = matrix.network().edges();
        self.parent.clear();
        self.parent.extend(0..matrix.nodes() as u32);
        for [a, b] in (0..edges.len()).filter(|&edge| strong(edge)).filter_map(|edge| edges.ends(edge)) {
            if !fixed[a as usize] && !fixed[b as usize] {
                let (a, b) = (root(&mut self.parent, a), root(&mut self.parent, b));
                self.parent[a.max(b) as usize] = a.min(b);
            }
        }
        self.collect(matrix, occupancy);
    }

    fn collect(&mut self, matrix: &StiffnessMatrix, occupancy: &Occupancy) {
        // Sets of one node need no help.
        let mut size = vec![0u32; self.parent.len()];
        let roots: Vec<u32> =
            (0..self.parent.len() as u32).map(|node| root(&mut self.parent, node)).collect();
        roots.iter().for_each(|&root| size[root as usize] += 1);
        let mut island_of_root = vec![u32::MAX; self.parent.len()];
        for (node, &root) in roots.iter().enumerate().filter(|(_, root)| size[**root as usize] > 1) {
            let island = &mut island_of_root[root as usize];
            if *island == u32::MAX {
                *island = self.islands.len() as u32;
                self.islands.push(Island { nodes: Vec::new(), stiffness: 0.0 });
            }
            let island = &mut self.islands[*island as usize];
            island.nodes.push(node as u32);
            island.stiffness += matrix.link_weight(node);
        }
        let network = matrix.network();
        for (edge, coupling) in occupancy.couplings().iter().enumerate() {
            let ends = network.edges().ends(edge).map(|ends| ends.map(|node| roots[node as usize]));
            if let Some([a, b]) = ends.filter(|[a, b]| a != b) {
                let base = network.weights()[edge];
                let weight = if base > 0.0 { base * coupling.through } else { base };
                for root in [a, b] {
                    if let Some(island) = self.islands.get_mut(island_of_root[root as usize] as usize) {
                        island.stiffness += weight;
                    }
                }
            }
        }
        self.islands.retain(|island| island.stiffness > 0.0);
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
