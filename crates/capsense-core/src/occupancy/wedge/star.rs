//! A node of a lattice, its neighbours, and distances counted in cells.

use crate::geometry::Aabb;
use crate::mesh::{Edges, Lattice};
use glam::DVec3;
use std::ops::Range;

/// So many cells from an edge of a conductor, nothing is known of it.
pub(super) const FAR: f64 = 2.0;
/// Planes of nodes on either side of an edge that may be nearer.
const PLANES: usize = FAR as usize;

/// A node of the lattice and its neighbours.
pub(super) struct Star<'a> {
    lattice: &'a Lattice,
    pub(super) node: usize,
    place: [usize; 3],
    /// How far the neighbours below and above are along each axis; zero where the lattice ends.
    ways: [[f64; 2]; 3],
}

/// Finds the places of nodes, which mostly are in the row of the one before.
pub(super) struct Stars<'a> {
    lattice: &'a Lattice,
    row: Range<usize>,
    place: [usize; 3],
}

impl<'a> Stars<'a> {
    pub(super) fn of(lattice: &'a Lattice) -> Self {
        Self { lattice, row: 0..0, place: [0; 3] }
    }

    pub(super) fn at(&mut self, node: usize) -> Star<'a> {
        if !self.row.contains(&node) {
            self.place = self.lattice.node_place(node);
            let start = node - self.place[0];
            self.row = start..start + self.lattice.node_counts()[0];
        }
        self.place[0] = node - self.row.start;
        Star::new(self.lattice, node, self.place)
    }
}

impl<'a> Star<'a> {
    fn new(lattice: &'a Lattice, node: usize, place: [usize; 3]) -> Self {
        let ways = std::array::from_fn(|axis| {
            let (planes, index) = (&lattice.axes()[axis], place[axis]);
            let below = if index > 0 { planes[index] - planes[index - 1] } else { 0.0 };
            [below, planes.get(index + 1).map_or(0.0, |next| next - planes[index])]
        });
        Self { lattice, node, place, ways }
    }

    /// The neighbour on a side of the node along an axis, and how far it is; none where the lattice ends.
    #[inline]
    pub(super) fn neighbour(&self, axis: usize, upwards: bool) -> Option<(usize, f64)> {
        let way = self.ways[axis][usize::from(upwards)];
        let stride = self.lattice.strides()[axis];
        (way > 0.0).then(|| (if upwards { self.node + stride } else { self.node - stride }, way))
    }

    /// Which of the node's edges exist: a bit for that to the neighbour below along each axis and that above.
    pub(super) fn sides(&self) -> u8 {
        let exists = self.ways.as_flattened().iter().map(|&way| u8::from(way > 0.0));
        exists.enumerate().map(|(side, exists)| exists << side).sum()
    }

    /// Half of the way to the neighbours along an axis.
    pub(super) fn width(&self, axis: usize) -> f64 {
        0.5 * (self.ways[axis][0] + self.ways[axis][1])
    }

    /// The way to the nearer neighbour along an axis.
    pub(super) fn narrowest(&self, axis: usize) -> f64 {
        let [below, above] = self.ways[axis];
        if below > 0.0 && above > 0.0 { below.min(above) } else { below.max(above) }
    }

    /// The way to the farthest neighbour.
    pub(super) fn longest(&self) -> f64 {
        self.ways.as_flattened().iter().fold(0.0, |longest, way| way.max(longest))
    }

    /// How far a place less than [`FAR`] cells away may be along each axis.
    pub(super) fn reach(&self) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|axis| {
            let (planes, index) = (&self.lattice.axes()[axis], self.place[axis]);
            let [below, above] = self.ways[axis];
            let next_below = if index > 1 { planes[index - 1] - planes[index - 2] } else { below };
            let next_above = planes.get(index + 2).map_or(above, |next| next - planes[index + 1]);
            // Behind the first and the last plane, cells are as those before it.
            let two_below = if below > 0.0 { below + next_below } else { 2.0 * above };
            let two_above = if above > 0.0 { above + next_above } else { 2.0 * below };
            two_below.max(two_above)
        }))
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
        let mut most = 0.0_f64;
        for axis in 0..3 {
            most = most.max(cells_to(&self.lattice.axes()[axis], self.place[axis], point[axis]));
            if most >= FAR {
                break;
            }
        }
        most
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
