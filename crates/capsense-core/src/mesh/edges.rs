//! The edges of a mesh, numbered, and those near a box.

use super::Lattice;
use crate::geometry::Aabb;
use glam::DVec3;
use std::ops::Range;

/// Numbered edges.
#[derive(Clone, Debug, PartialEq)]
pub enum Edges {
    /// The edges along the axes of a lattice: edge 3 n + a leads from node n to the next one along axis a. At the last
    /// node of a row there is none.
    Lattice(Lattice),
    /// Any edges, the smaller node first.
    List(Vec<[u32; 2]>),
}

impl Edges {
    /// One more than the highest number of an edge.
    pub fn len(&self) -> usize {
        match self {
            Self::Lattice(lattice) => 3 * lattice.node_counts().into_iter().product::<usize>(),
            Self::List(ends) => ends.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The two nodes of an edge, the smaller first; `None` where a lattice ends.
    pub fn ends(&self, edge: usize) -> Option<[u32; 2]> {
        match self {
            Self::Lattice(lattice) => {
                let (node, axis) = (edge / 3, edge % 3);
                let [nx, ny, nz] = lattice.node_counts();
                let place = [node % nx, node / nx % ny, node / (nx * ny)][axis];
                let stride = [1, nx, nx * ny][axis];
                (place + 1 < [nx, ny, nz][axis]).then(|| [node as u32, (node + stride) as u32])
            }
            Self::List(ends) => Some(ends[edge]),
        }
    }

    /// Visits at least all nodes in a box, in increasing order.
    pub fn for_nodes_near(&self, nodes: &[DVec3], bounds: &Aabb, mut visit: impl FnMut(usize)) {
        match self {
            Self::Lattice(lattice) => for_lattice_nodes(lattice, bounds, |node, _| visit(node)),
            Self::List(_) => (0..nodes.len()).filter(|&node| bounds.contains(nodes[node])).for_each(visit),
        }
    }

    /// Visits at least all edges that touch a box, in increasing order.
    pub fn for_edges_near(&self, nodes: &[DVec3], bounds: &Aabb, mut visit: impl FnMut(usize, [u32; 2])) {
        match self {
            Self::Lattice(lattice) => {
                let counts = lattice.node_counts();
                let strides = [1, counts[0], counts[0] * counts[1]];
                for_lattice_nodes(lattice, bounds, |node, at| {
                    for axis in 0..3 {
                        if at[axis] + 1 < counts[axis] {
                            visit(3 * node + axis, [node as u32, (node + strides[axis]) as u32]);
                        }
                    }
                });
            }
            Self::List(ends) => {
                for (edge, &ends) in ends.iter().enumerate() {
                    let [a, b] = ends.map(|node| nodes[node as usize]);
                    if bounds.intersects(&Aabb { min: a.min(b), max: a.max(b) }) {
                        visit(edge, ends);
                    }
                }
            }
        }
    }
}

/// All nodes of the cells that touch a box.
fn for_lattice_nodes(lattice: &Lattice, bounds: &Aabb, mut visit: impl FnMut(usize, [usize; 3])) {
    let range = |axis: usize| -> Range<usize> {
        let planes = &lattice.axes()[axis];
        let from = planes.partition_point(|&plane| plane < bounds.min[axis]).saturating_sub(1);
        let to = planes.partition_point(|&plane| plane <= bounds.max[axis]);
        from..(to + 1).min(planes.len())
    };
    let [x, y, z] = [range(0), range(1), range(2)];
    for k in z {
        for j in y.clone() {
            for i in x.clone() {
                visit(lattice.node_index([i, j, k]), [i, j, k]);
            }
        }
    }
}
