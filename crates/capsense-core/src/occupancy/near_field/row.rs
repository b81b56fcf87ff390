//! Rows of nodes by a box: which of its edges is nearest to each node, and the share that this edge has in the node's links.
//!
//! The same as is found for one node at a time. Along a row of the lattice only x differs, and what
//! depends on y and z is computed once.

use super::angles::{RightAngles, distances_of_box, inside_of};
use super::star::{RowCells, TOGETHER, either};
use super::{FAR, NEAR, RightAngle, smooth};
use crate::occupancy::index_set::RUN;
use glam::DVec3;

/// What the nodes of a piece of a row make of a box, were there nothing else.
#[derive(Clone, Debug)]
pub(super) struct NearestEdges {
    /// Where the nodes are in the box's frame.
    local: [[f64; RUN]; 3],
    /// The axis of that frame along which the nearest edge is, as a number.
    axis: [f64; RUN],
    /// How far the place nearest to the node is from the edge's end.
    inside: [f64; RUN],
    share: [f64; RUN],
}

impl NearestEdges {
    pub(super) const NONE: Self =
        Self { local: [[0.0; RUN]; 3], axis: [0.0; RUN], inside: [0.0; RUN], share: [0.0; RUN] };

    /// Of no node is any edge near.
    pub(super) fn clear(&mut self) {
        self.share.fill(0.0);
    }

    /// The share of the edge that is nearest to a node.
    #[inline]
    pub(super) fn share(&self, node: usize) -> f64 {
        self.share[node]
    }

    /// The edge that is nearest to a node, and how far the node is before either face.
    #[inline(always)]
    pub(super) fn angle(&self, node: usize, angles: &RightAngles, half: DVec3) -> (RightAngle, [f64; 2]) {
        let local = DVec3::from_array([0, 1, 2].map(|axis: usize| self.local[axis][node]));
        let axis = self.axis[node] as usize;
        let outside = local.abs() - half;
        let before = [(axis + 1) % 3, (axis + 2) % 3].map(|across| outside[across]);
        (angles.of_box(half, local, axis, self.inside[node]), before)
    }
}

/// Finds the nearest edges of a box with the widest instructions of this machine, none of which fuses or reorders.
pub(super) struct FindNearest<'a> {
    pub(super) angles: &'a RightAngles,
    /// Half the box's edge lengths.
    pub(super) half: DVec3,
    pub(super) row: RowCells<'a>,
    pub(super) nearest: &'a mut NearestEdges,
}

impl pulp::NullaryFnOnce for FindNearest<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { angles, half, row, nearest } = self;
        let [y, z] = row.across;
        let turn = &angles.object_from_sensor;
        let origin = angles.sensor_from_object.translation;
        let start = turn.y_axis * (y.at - origin.y) + turn.z_axis * (z.at - origin.z);
        // How long cells are along the axes of the box.
        let lengths = turn.y_axis.abs() * y.narrowest + turn.z_axis.abs() * z.narrowest;
        let along = turn.x_axis.abs();
        for (group, x) in row.groups().enumerate() {
            let nodes = group * TOGETHER..(group + 1) * TOGETHER;
            let (mut local, mut found) = ([[0.0; TOGETHER]; 3], [[0.0; TOGETHER]; 3]);
            for node in 0..TOGETHER {
                let x = x.at(node);
                let point = start + turn.x_axis * (x.at - origin.x);
                let [outside, squared] = distances_of_box(half, point);
                let is_x = (squared.x <= squared.y) & (squared.x <= squared.z);
                let is_y = !is_x & (squared.y <= squared.z);
                let of_axis = |of: DVec3| either(is_x, of.x, either(is_y, of.y, of.z));
                let from = half.copysign(point) - point;
                let from = DVec3::new(
                    either(is_x, 0.0, from.x),
                    either(is_y, 0.0, from.y),
                    either(is_x | is_y, from.z, 0.0),
                );
                // Across the rows of the rotation, which takes the box's frame to the sensor's.
                let ways = [turn.x_axis.dot(from), turn.y_axis.dot(from), turn.z_axis.dot(from)];
                let cells = [x.cells_to(ways[0]), y.cells_to(ways[1]), z.cells_to(ways[2])];
                let farthest = larger(larger(cells[0], cells[1]), cells[2]);
                let part = smooth(larger(smaller((FAR - farthest) / (FAR - NEAR), 1.0), 0.0));
                let length = of_axis(lengths + along * x.narrowest);
                let inside = inside_of(-of_axis(outside), squared);
                (local[0][node], local[1][node], local[2][node]) = (point.x, point.y, point.z);
                found[0][node] = of_axis(DVec3::new(0.0, 1.0, 2.0));
                found[1][node] = inside;
                found[2][node] = part * larger(smaller(inside / length, 1.0), 0.0);
            }
            for (all, new) in nearest.local.iter_mut().zip(&local) {
                all[nodes.clone()].copy_from_slice(new);
            }
            let [axis, inside, share] = found;
            nearest.axis[nodes.clone()].copy_from_slice(&axis);
            nearest.inside[nodes.clone()].copy_from_slice(&inside);
            nearest.share[nodes].copy_from_slice(&share);
        }
    }
}

/// The larger of two numbers; simpler than [`f64::max`], as neither is NaN.
#[inline(always)]
pub(super) fn larger(a: f64, b: f64) -> f64 {
    either(a > b, a, b)
}

#[inline(always)]
pub(super) fn smaller(a: f64, b: f64) -> f64 {
    either(a < b, a, b)
}

#[cfg(test)]
mod tests {
    use super::super::star::{Row, Stars};
    use super::super::{RightAngled, share_of};
    use super::*;
    use crate::mesh::Lattice;
    use glam::{DAffine3, DQuat};
    use pulp::NullaryFnOnce;

    /// Rows of more nodes than are one instruction, and of fewer, on cells of all sizes.
    #[test]
    fn rows_find_what_nodes_find() {
        let planes = |count: u32, growth: f64| {
            (0..count).map(|plane| 0.3 * f64::from(plane).powf(growth) - 1.0).collect::<Vec<_>>()
        };
        let lattice = Lattice::new([planes(11, 1.0), planes(6, 1.2), planes(7, 0.9)]).unwrap();
        let stars = Stars::of(&lattice);
        let turn = DQuat::from_rotation_z(0.4) * DQuat::from_rotation_x(0.3);
        let half = DVec3::new(0.7, 0.4, 0.5);
        for rotation in [DQuat::IDENTITY, turn] {
            let sensor_from_object =
                DAffine3::from_rotation_translation(rotation, DVec3::new(0.31, 0.1, -0.2));
            let object_from_sensor = sensor_from_object.matrix3.transpose();
            let angles =
                RightAngles { solid: RightAngled::Box(half), sensor_from_object, object_from_sensor };
            let mut near = 0;
            let mut next = 0;
            while next < 11 * 6 * 7 {
                let mut nearest = NearestEdges::NONE;
                let row = stars.in_row(next..next + 40, &mut Row::default());
                let found = FindNearest { angles: &angles, half, row: row.cells(), nearest: &mut nearest };
                found.call();
                for (number, star) in row.each().enumerate() {
                    let expected = angles.nearest(star.place()).unwrap();
                    let share = share_of(&star, &expected);
                    assert!((nearest.share(number) - share).abs() < 1e-12, "{next} {number} {share}");
                    if share > 0.0 {
                        near += 1;
                        let (angle, before) = nearest.angle(number, &angles, half);
                        assert!(angle.place.distance(expected.place) < 1e-12);
                        let exact = expected.before(star.place());
                        assert!((before[0] - exact[0]).abs().max((before[1] - exact[1]).abs()) < 1e-12);
                    }
                }
                next = row.nodes.end;
            }
            assert!(near > 100, "{near}");
        }
    }
}
