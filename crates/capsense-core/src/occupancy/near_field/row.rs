//! Rows of nodes by a box: which of its edges is nearest to each node, and the share that this edge has in the node's links.
//!
//! The same as one node at a time, but without branches, so that several nodes are one instruction: along a row of the lattice
//! only x differs.

use super::angles::{RightAngles, distances_of_box};
use super::star::RowCells;
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

    /// The edge that is nearest to a node, and its share.
    #[inline]
    pub(super) fn at(&self, node: usize, angles: &RightAngles, half: DVec3) -> Option<(RightAngle, f64)> {
        let share = self.share[node];
        (share > 0.0).then(|| {
            let local = DVec3::from_array([0, 1, 2].map(|axis: usize| self.local[axis][node]));
            (angles.of_box(half, local, self.axis[node] as usize, self.inside[node]), share)
        })
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
        let NearestEdges { local, axis, inside, share } = nearest;
        let (x, [y, z]) = (row.x, row.across);
        let turn = &angles.object_from_sensor;
        let origin = angles.sensor_from_object.translation;
        let start = turn.y_axis * (y.at - origin.y) + turn.z_axis * (z.at - origin.z);
        // How long cells are along the axes of the box.
        let lengths = turn.y_axis.abs() * y.narrowest + turn.z_axis.abs() * z.narrowest;
        let along = turn.x_axis.abs();
        let [local_x, local_y, local_z] = local;
        let count = x.at.len().min(RUN);
        let x = x.slice(0..count);
        for node in 0..count {
            let point = start + turn.x_axis * (x.at[node] - origin.x);
            let [outside, squared] = distances_of_box(half, point);
            let is_x = squared.x <= squared.y && squared.x <= squared.z;
            let is_y = !is_x && squared.y <= squared.z;
            let of_axis = |of: DVec3| {
                let of_y_or_z = if is_y { of.y } else { of.z };
                if is_x { of.x } else { of_y_or_z }
            };
            let from = half.copysign(point) - point;
            let from = DVec3::new(
                if is_x { 0.0 } else { from.x },
                if is_y { 0.0 } else { from.y },
                if is_x || is_y { from.z } else { 0.0 },
            );
            // Across the rows of the rotation, which takes the box's frame to the sensor's.
            let to_edge = [turn.x_axis.dot(from), turn.y_axis.dot(from), turn.z_axis.dot(from)];
            let cells = [x.at(node).cells_to(to_edge[0]), y.cells_to(to_edge[1]), z.cells_to(to_edge[2])];
            let larger = |a: f64, b: f64| if a > b { a } else { b };
            let smaller = |a: f64, b: f64| if a < b { a } else { b };
            let farthest = larger(larger(cells[0], cells[1]), cells[2]);
            let part = smooth(larger(smaller((FAR - farthest) / (FAR - NEAR), 1.0), 0.0));
            let length = of_axis(lengths + along * x.narrowest[node]);
            let of_inside = -of_axis(outside);
            local_x[node] = point.x;
            local_y[node] = point.y;
            local_z[node] = point.z;
            axis[node] = of_axis(DVec3::new(0.0, 1.0, 2.0));
            inside[node] = of_inside;
            share[node] = part * larger(smaller(of_inside / length, 1.0), 0.0);
        }
    }
}
