//! The edges of a mesh, numbered, and those near a box.

use super::Lattice;
use super::bins::Bins;
use crate::geometry::Aabb;
use glam::DVec3;
use std::ops::Range;

/// Numbered edges.
#[derive(Clone, Debug, PartialEq)]
pub enum Edges {
    /// The edges along the axes of a lattice: edge 3 n + a leads from node n to the next one along axis a. At the last
    /// node of a row there is none.
    Lattice(Lattice),
    /// Any edges.
    List(Box<EdgeList>),
}

/// Edges in any order, the smaller node of each first.
#[derive(Clone, Debug, PartialEq)]
pub struct EdgeList {
    ends: Vec<[u32; 2]>,
    /// The edges at node n are `at_node[starts[n]..starts[n + 1]]`, in increasing order.
    at_node: Vec<u32>,
    starts: Vec<u32>,
    /// The length of the longest, in metres.
    longest: f64,
    edge_bins: Bins,
    node_bins: Bins,
}

impl EdgeList {
    /// Takes edges between nodes at these positions.
    pub fn new(ends: Vec<[u32; 2]>, nodes: &[DVec3]) -> Self {
        let mut starts = vec![0; nodes.len() + 1];
        for &node in ends.as_flattened() {
            starts[node as usize + 1] += 1;
        }
        for node in 0..nodes.len() {
            starts[node + 1] += starts[node];
        }
        let mut next: Vec<u32> = starts.clone();
        let mut at_node = vec![0; 2 * ends.len()];
        for (edge, ends) in ends.iter().enumerate() {
            for &node in ends {
                at_node[next[node as usize] as usize] = edge as u32;
                next[node as usize] += 1;
            }
        }
        let edge_bins = Bins::new(ends.len(), |edge| around(ends[edge], nodes));
        let node_bins = Bins::new(nodes.len(), |node| Aabb { min: nodes[node], max: nodes[node] });
        let lengths =
            ends.iter().map(|ends| ends.map(|node| nodes[node as usize])).map(|[a, b]| a.distance(b));
        let longest = lengths.fold(0.0, f64::max);
        Self { ends, at_node, starts, longest, edge_bins, node_bins }
    }

    /// The length of the longest edge, in metres.
    pub(crate) fn longest(&self) -> f64 {
        self.longest
    }

    /// The edges at a node and which of their ends it is, in increasing order.
    fn at(&self, node: usize) -> impl Iterator<Item = (usize, usize)> {
        let edges = self.starts[node] as usize..self.starts[node + 1] as usize;
        self.at_node[edges].iter().map(move |&edge| {
            let edge = edge as usize;
            (edge, usize::from(self.ends[edge][1] as usize == node))
        })
    }
}

impl Edges {
    /// One more than the highest number of an edge.
    pub fn len(&self) -> usize {
        match self {
            Self::Lattice(lattice) => 3 * lattice.node_counts().into_iter().product::<usize>(),
            Self::List(list) => list.ends.len(),
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
                let place = lattice.node_place(node)[axis];
                (place + 1 < lattice.node_counts()[axis]).then(|| self.ends_of_existing(edge))
            }
            Self::List(list) => Some(list.ends[edge]),
        }
    }

    /// The two nodes of an edge that is known to exist, without the divisions that find out.
    pub fn ends_of_existing(&self, edge: usize) -> [u32; 2] {
        match self {
            Self::Lattice(lattice) => {
                let node = edge / 3;
                [node as u32, (node + lattice.strides()[edge % 3]) as u32]
            }
            Self::List(list) => list.ends[edge],
        }
    }

    /// Visits the edges at a node and which of their ends it is, always in the same order. On a lattice, some that do
    /// not exist may be among them.
    pub fn for_edges_at(&self, node: usize, mut visit: impl FnMut(usize, usize)) {
        match self {
            Self::Lattice(lattice) => {
                for (axis, stride) in lattice.strides().into_iter().enumerate() {
                    if let Some(before) = node.checked_sub(stride) {
                        visit(3 * before + axis, 1);
                    }
                    visit(3 * node + axis, 0);
                }
            }
            Self::List(list) => list.at(node).for_each(|(edge, end)| visit(edge, end)),
        }
    }

    /// The edge between two nodes.
    pub(crate) fn between(&self, [a, b]: [u32; 2]) -> Option<usize> {
        let mut found = None;
        self.for_edges_at(a as usize, |edge, _| {
            if self.ends(edge).is_some_and(|ends| ends.contains(&b)) {
                found = Some(edge);
            }
        });
        found
    }

    /// Visits the nodes in a box, each once.
    pub fn for_nodes_near(&self, nodes: &[DVec3], bounds: &Aabb, mut visit: impl FnMut(usize)) {
        match self {
            Self::Lattice(lattice) => lattice.for_rows_within(bounds, |row| row.for_each(&mut visit)),
            Self::List(list) => list.node_bins.for_boxes_near(bounds, |node| {
                if bounds.contains(nodes[node as usize]) {
                    visit(node as usize);
                }
            }),
        }
    }

    /// Visits all edges that touch a box, and perhaps others near it; some of them several times.
    pub fn for_edges_near(&self, nodes: &[DVec3], bounds: &Aabb, mut visit: impl FnMut(usize, [u32; 2])) {
        match self {
            Self::Lattice(lattice) => for_lattice_edges(lattice, &lattice.planes_within(bounds), visit),
            Self::List(list) => list.edge_bins.for_boxes_near(bounds, |edge| {
                let ends = list.ends[edge as usize];
                if bounds.intersects(&around(ends, nodes)) {
                    visit(edge as usize, ends);
                }
            }),
        }
    }
}

/// Some planes of a lattice across each axis: those that touch a box.
pub(crate) type Planes = [Range<usize>; 3];

/// The smallest box around an edge.
fn around(ends: [u32; 2], nodes: &[DVec3]) -> Aabb {
    let [a, b] = ends.map(|node| nodes[node as usize]);
    Aabb { min: a.min(b), max: a.max(b) }
}

impl Lattice {
    /// Visits the nodes in a box, those next to each other along x together.
    pub(crate) fn for_rows_within(&self, bounds: &Aabb, visit: impl FnMut(Range<usize>)) {
        self.for_rows_of(&self.planes_within(bounds), visit);
    }

    /// The same where some planes across each axis meet.
    pub(crate) fn for_rows_of(&self, [x, y, z]: &Planes, mut visit: impl FnMut(Range<usize>)) {
        for k in z.clone() {
            for j in y.clone() {
                let row = self.node_index([0, j, k]);
                visit(row + x.start..row + x.end);
            }
        }
    }

    /// The planes across each axis that touch a box.
    pub(crate) fn planes_within(&self, bounds: &Aabb) -> Planes {
        std::array::from_fn(|axis| {
            let planes = &self.axes()[axis];
            let (low, high) = (bounds.min[axis], bounds.max[axis]);
            let from = planes.partition_point(|&plane| plane < low);
            // Most boxes are touched by few.
            from..from + planes[from..].iter().take_while(|&&plane| plane <= high).count()
        })
    }

    /// The planes across each axis that reach some part of a box, given those that touch it. From each plane it is told how far it
    /// reaches of the way to the next.
    fn planes_reaching(&self, bounds: &Aabb, touching: &Planes, reach: impl Fn(f64) -> f64) -> Planes {
        std::array::from_fn(|axis| {
            let (planes, Range { start, end }) = (&self.axes()[axis], touching[axis].clone());
            let gap = |plane: usize| planes[plane] - planes[plane - 1];
            let reaches_on = (1..planes.len()).contains(&start)
                && bounds.min[axis] <= planes[start - 1] + reach(gap(start));
            let reaches_back =
                (1..planes.len()).contains(&end) && bounds.max[axis] >= planes[end] - reach(gap(end));
            start - usize::from(reaches_on)..end + usize::from(reaches_back)
        })
    }

    /// Visits all edges that reach some part of a box, each once, given the planes that touch it. Of each way to the next edge
    /// beside, it is told how far edges reach.
    pub(crate) fn for_edges_reaching(
        &self,
        bounds: &Aabb,
        touching: &Planes,
        reach: impl Fn(f64) -> f64,
        mut visit: impl FnMut(usize),
    ) {
        let beside = self.planes_reaching(bounds, touching, reach);
        for axis in 0..3 {
            let mut nodes = beside.clone();
            let Range { start, end } = touching[axis];
            nodes[axis] = start.saturating_sub(1)..end.min(self.node_counts()[axis] - 1);
            self.for_rows_of(&nodes, |row| row.for_each(|node| visit(3 * node + axis)));
        }
    }

    /// The same, or where the box lies between two, up to the next planes before and behind it across some axes.
    pub(crate) fn up_to_next(&self, planes: &Planes, before: [bool; 3], behind: [bool; 3]) -> Planes {
        std::array::from_fn(|axis| {
            let Range { start, end } = planes[axis];
            let first = start.saturating_sub(usize::from(before[axis]));
            first..(end + usize::from(behind[axis])).min(self.axes()[axis].len())
        })
    }
}

/// All edges that touch a box, each once, in increasing order, by the planes that touch it.
pub(crate) fn for_lattice_edges(lattice: &Lattice, nodes: &Planes, mut visit: impl FnMut(usize, [u32; 2])) {
    let strides = lattice.strides();
    let counts = lattice.node_counts();
    // Along its axis, an edge touches the box if it starts before the box's end and ends after its start.
    let starts: [Range<usize>; 3] = std::array::from_fn(|axis| {
        nodes[axis].start.saturating_sub(1)..nodes[axis].end.min(counts[axis] - 1)
    });
    for k in starts[2].start..nodes[2].end {
        for j in starts[1].start..nodes[1].end {
            let (in_y, in_z) = (nodes[1].contains(&j), nodes[2].contains(&k));
            let reaches = [in_y && in_z, in_z && starts[1].contains(&j), in_y && starts[2].contains(&k)];
            if reaches == [false; 3] {
                continue;
            }
            let row = lattice.node_index([0, j, k]);
            for i in starts[0].start..nodes[0].end {
                let along = [starts[0].contains(&i), i >= nodes[0].start, i >= nodes[0].start];
                let node = row + i;
                for axis in 0..3 {
                    if reaches[axis] && along[axis] {
                        visit(3 * node + axis, [node as u32, (node + strides[axis]) as u32]);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// Against a look at all edges, each as a box that reaches up to half-way to the next, or only a little beside it.
    #[test]
    fn edges_that_reach_a_box_are_found() {
        let axes = [vec![0.0, 1.0, 3.0], vec![0.0, 2.0, 3.0, 7.0], vec![0.0, 1.0, 5.0]];
        let lattice = Lattice::new(axes).unwrap();
        let planes = lattice.axes();
        let regions = [
            ([0.6, 2.2, -1.0], [0.7, 2.3, 0.4]),
            ([1.0, 4.9, 2.9], [2.1, 5.1, 3.1]),
            ([-2.0, -2.0, -2.0], [-1.0, 9.0, 9.0]),
            ([2.9, 6.9, 4.9], [9.0, 9.0, 9.0]),
            ([1.05, 2.95, 0.5], [1.05, 2.95, 0.5]),
        ];
        for (min, max) in regions {
            let region = Aabb { min: min.into(), max: max.into() };
            for reach in [|way: f64| 0.5 * way, |_| 0.1] {
                let reaches = |edge: usize| {
                    let (place, axis) = (lattice.node_place(edge / 3), edge % 3);
                    (0..3).all(|across| {
                        let (planes, k) = (&planes[across], place[across]);
                        let below = k.checked_sub(1).map_or(0.0, |other| reach(planes[k] - planes[other]));
                        let above = planes.get(k + 1).map_or(0.0, |other| reach(other - planes[k]));
                        let ends = match across == axis {
                            true => planes.get(k + 1).map(|&end| [planes[k], end]),
                            false => Some([planes[k] - below, planes[k] + above]),
                        };
                        ends.is_some_and(|[from, to]| from <= max[across] && min[across] <= to)
                    })
                };
                let mut found = Vec::new();
                let touching = lattice.planes_within(&region);
                lattice.for_edges_reaching(&region, &touching, reach, |edge| found.push(edge));
                found.sort_unstable();
                let nodes = lattice.node_counts().into_iter().product::<usize>();
                let expected: Vec<_> = (0..3 * nodes).filter(|&edge| reaches(edge)).collect();
                assert_eq!(found, expected, "{min:?}");
            }
        }
    }

    #[test]
    fn planes_that_touch_a_box_and_the_next_ones() {
        let axes = [vec![0.0, 1.0, 3.0], vec![0.0, 2.0, 3.0, 7.0], vec![0.0, 1.0, 5.0]];
        let lattice = Lattice::new(axes).unwrap();
        let region = Aabb { min: DVec3::new(1.0, 2.5, -2.0), max: DVec3::new(1.0, 2.6, 9.0) };
        let planes = lattice.planes_within(&region);
        assert_eq!(planes, [1..2, 2..2, 0..3]);
        assert_eq!(lattice.up_to_next(&planes, [true; 3], [true; 3]), [0..3, 1..3, 0..3]);
        assert_eq!(lattice.up_to_next(&planes, [true; 3], [false; 3]), [0..2, 1..2, 0..3]);
    }
}
