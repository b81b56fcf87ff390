//! A node of a lattice, its neighbours, and distances counted in cells.

use super::Cells;
use crate::geometry::Aabb;
use crate::mesh::{Edges, Lattice};
use glam::DVec3;
use std::ops::Range;

/// So many cells from an edge of a conductor, nothing is known of it.
pub(in super::super) const FAR: f64 = 2.0;
/// Planes of nodes on either side of an edge that may be nearer.
const PLANES: usize = FAR as usize;

/// A plane of nodes across an axis.
#[derive(Clone, Copy, Debug)]
struct Plane {
    /// How far the planes below and above are; zero where the lattice ends.
    ways: [f64; 2],
    /// Where they are, or this one where the lattice ends.
    next: [f64; 2],
    /// How far what is less than [`FAR`] cells away may be.
    reach: f64,
}

impl Plane {
    fn of(planes: &[f64], index: usize) -> Self {
        let at = planes[index];
        let next = [index.checked_sub(1), Some(index + 1)]
            .map(|next| next.and_then(|next| planes.get(next)).copied().unwrap_or(at));
        let [below, above] = [at - next[0], next[1] - at];
        // Behind the first and the last plane, cells are as those before it.
        let two_below = if index > 1 { at - planes[index - 2] } else { 2.0 * below.max(above) };
        let two_above = planes.get(index + 2).map_or(2.0 * below.max(above), |plane| plane - at);
        Self { ways: [below, above], next, reach: two_below.max(two_above) }
    }
}

/// The planes of a lattice, and the row of nodes that was asked for last.
#[derive(Clone, Debug, Default)]
pub(super) struct Stars {
    planes: [Vec<Plane>; 3],
    row: Range<usize>,
    place: [usize; 3],
}

impl Stars {
    pub(super) fn of(lattice: &Lattice) -> Self {
        let planes = lattice
            .axes()
            .each_ref()
            .map(|planes| (0..planes.len()).map(|index| Plane::of(planes, index)).collect());
        Self { planes, row: 0..0, place: [0; 3] }
    }

    /// A node of the lattice, best in the row of the one before.
    #[inline]
    pub(super) fn at<'a>(&mut self, lattice: &'a Lattice, node: usize) -> Star<'a> {
        if !self.row.contains(&node) {
            self.place = lattice.node_place(node);
            let start = node - self.place[0];
            self.row = start..start + lattice.node_counts()[0];
        }
        self.place[0] = node - self.row.start;
        let plane = |axis: usize| self.planes[axis][self.place[axis]];
        Star { lattice, node, place: self.place, planes: [plane(0), plane(1), plane(2)] }
    }
}

/// A node of the lattice and its neighbours.
pub(super) struct Star<'a> {
    lattice: &'a Lattice,
    pub(super) node: usize,
    place: [usize; 3],
    planes: [Plane; 3],
}

impl Star<'_> {
    /// The neighbour on a side of the node along an axis, and how far it is; none where the lattice ends.
    #[inline]
    pub(super) fn neighbour(&self, axis: usize, upwards: bool) -> Option<(usize, f64)> {
        let way = self.planes[axis].ways[usize::from(upwards)];
        let stride = self.lattice.strides()[axis];
        (way > 0.0).then(|| (if upwards { self.node + stride } else { self.node - stride }, way))
    }

    /// Which of the node's edges exist: a bit for that to the neighbour below along each axis and that above.
    pub(super) fn sides(&self) -> u8 {
        let mut sides = 0;
        for (axis, plane) in self.planes.iter().enumerate() {
            let [below, above] = plane.ways;
            sides |= (u8::from(below > 0.0) | u8::from(above > 0.0) << 1) << (2 * axis);
        }
        sides
    }

    /// Half of the way to the neighbours along an axis.
    pub(super) fn width(&self, axis: usize) -> f64 {
        let [below, above] = self.planes[axis].ways;
        0.5 * (below + above)
    }

    /// The way to the nearer neighbour along an axis.
    fn narrowest(&self, axis: usize) -> f64 {
        let [below, above] = self.planes[axis].ways;
        if below > 0.0 && above > 0.0 { below.min(above) } else { below.max(above) }
    }

    /// The way to the farthest neighbour.
    pub(super) fn longest(&self) -> f64 {
        self.planes.iter().fold(0.0, |longest: f64, plane| longest.max(plane.ways[0]).max(plane.ways[1]))
    }

    /// The box up to the neighbours, which holds all that is beside the node's edges.
    pub(super) fn bounds(&self) -> Aabb {
        let [x, y, z] = &self.planes;
        let corner = |side: usize| DVec3::new(x.next[side], y.next[side], z.next[side]);
        Aabb { min: corner(0), max: corner(1) }
    }
}

impl Cells for Star<'_> {
    /// Along the axis where there are most.
    fn cells_to(&self, point: DVec3) -> f64 {
        let mut most = 0.0_f64;
        for axis in 0..3 {
            most = most.max(cells_to(&self.lattice.axes()[axis], self.place[axis], point[axis]));
            if most >= FAR {
                break;
            }
        }
        most
    }

    fn reach(&self) -> DVec3 {
        let [x, y, z] = &self.planes;
        DVec3::new(x.reach, y.reach, z.reach)
    }

    fn size_along(&self, direction: DVec3) -> f64 {
        let along = direction.abs();
        along.x * self.narrowest(0) + along.y * self.narrowest(1) + along.z * self.narrowest(2)
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

/// A region with all that is less than [`FAR`] cells away, none of which is larger than edges are long.
pub(in super::super) fn grown(edges: &Edges, region: &Aabb) -> Aabb {
    let mut grown = *region;
    let lattice = match edges {
        Edges::Lattice(lattice) => lattice,
        Edges::List(list) => {
            let reach = FAR * list.longest();
            return Aabb { min: region.min - reach, max: region.max + reach };
        }
    };
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
