//! A node of a lattice, its neighbours, and distances counted in cells.

use crate::geometry::Aabb;
use crate::mesh::{Edges, Lattice};
use glam::DVec3;

/// So many cells from an edge of a conductor, nothing is known of it.
pub(super) const FAR: f64 = 2.0;
/// Planes of nodes on either side of an edge that may be nearer.
const PLANES: usize = 2;

/// A node of the lattice and its neighbours.
pub(super) struct Star<'a> {
    lattice: &'a Lattice,
    pub(super) node: usize,
    place: [usize; 3],
}

impl<'a> Star<'a> {
    pub(super) fn at(lattice: &'a Lattice, node: usize) -> Self {
        Self { lattice, node, place: lattice.node_place(node) }
    }

    /// The neighbour on a side of the node along an axis, and how far it is; none where the lattice ends.
    pub(super) fn neighbour(&self, axis: usize, upwards: bool) -> Option<(usize, f64)> {
        let (planes, index) = (&self.lattice.axes()[axis], self.place[axis]);
        let stride = self.lattice.strides()[axis];
        if upwards {
            Some((self.node + stride, planes.get(index + 1)? - planes[index]))
        } else {
            let way = planes[index] - planes[index.checked_sub(1)?];
            Some((self.node - stride, way))
        }
    }

    /// Half of the way to the neighbours along an axis.
    pub(super) fn width(&self, axis: usize) -> f64 {
        let way = |upwards| self.neighbour(axis, upwards).map_or(0.0, |(_, way)| way);
        0.5 * (way(false) + way(true))
    }

    /// The way to the nearer neighbour along an axis.
    pub(super) fn narrowest(&self, axis: usize) -> f64 {
        let way = |upwards| self.neighbour(axis, upwards).map_or(f64::INFINITY, |(_, way)| way);
        way(false).min(way(true))
    }

    /// The way to the farthest neighbour.
    pub(super) fn longest(&self) -> f64 {
        let way = |axis: usize, upwards| self.neighbour(axis, upwards).map_or(0.0, |(_, way)| way);
        [0, 1, 2].into_iter().fold(0.0, |longest, axis| way(axis, false).max(way(axis, true)).max(longest))
    }

    /// The box up to the neighbours, which holds all that is beside the node's edges.
    pub(super) fn bounds(&self) -> Aabb {
        let planes = |axis: usize, index: usize| {
            let planes = &self.lattice.axes()[axis];
            planes[index.min(planes.len() - 1)]
        };
        let [i, j, k] = self.place;
        let corner = |[i, j, k]: [usize; 3]| DVec3::new(planes(0, i), planes(1, j), planes(2, k));
        let below = [i, j, k].map(|index| index.saturating_sub(1));
        Aabb { min: corner(below), max: corner([i + 1, j + 1, k + 1]) }
    }

    /// Cells between the node and a point, along the axis where there are most; no more than [`FAR`].
    pub(super) fn cells_to(&self, point: DVec3) -> f64 {
        let along = |axis: usize| cells_to(&self.lattice.axes()[axis], self.place[axis], point[axis]);
        along(0).max(along(1)).max(along(2))
    }
}

/// Cells between a plane and a coordinate, parts of them counted; no more than [`FAR`]. Behind the last plane, cells are as
/// the last one.
fn cells_to(planes: &[f64], index: usize, coordinate: f64) -> f64 {
    let upwards = coordinate > planes[index];
    let mut at = index;
    for cells in 0..PLANES {
        let next = if upwards { at + 1 } else { at.wrapping_sub(1) };
        let plane = planes.get(next).copied().unwrap_or_else(|| {
            let last = if upwards { at - 1 } else { at + 1 };
            2.0 * planes[at] - planes[last]
        });
        let part = (coordinate - planes[at]) / (plane - planes[at]);
        if part <= 1.0 || next >= planes.len() {
            return (cells as f64 + part).min(FAR);
        }
        at = next;
    }
    FAR
}

/// A region with all that is less than [`FAR`] cells away.
pub(in super::super) fn grown(edges: &Edges, region: &Aabb) -> Aabb {
    let Edges::Lattice(lattice) = edges else { return *region };
    let mut grown = *region;
    for (axis, planes) in lattice.axes().iter().enumerate() {
        let first = planes.partition_point(|&plane| plane < region.min[axis]).saturating_sub(PLANES);
        let last = planes.partition_point(|&plane| plane <= region.max[axis]) + PLANES;
        grown.min[axis] = planes[first].min(region.min[axis]);
        grown.max[axis] = planes[last.min(planes.len()) - 1].max(region.max[axis]);
    }
    grown
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_counted_in_parts() {
        let planes = [0.0, 1.0, 3.0, 7.0];
        let places =
            [(1, 2.0), (1, 5.0), (1, 0.25), (1, -0.5), (3, 2.0), (0, 2.0), (0, 0.0), (0, -0.25), (3, 20.0)];
        let cells = places.map(|(index, coordinate)| cells_to(&planes, index, coordinate));
        assert_eq!(cells, [0.5, 1.5, 0.75, 1.5, 1.5, 1.5, 0.0, 0.25, 2.0]);
    }
}
