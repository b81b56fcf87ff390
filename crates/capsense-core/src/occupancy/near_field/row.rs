//! Rows of nodes by a box: which of its edges is nearest to each node, whether others are about as near, and the share that they have in the
//! node's links.
//!
//! Along a row of the lattice only x differs, and what
//! depends on y and z is computed once.

use super::angles::RightAngles;
use super::box_field::{of_length, parts};
use super::cells::{PlaneCells, RowCells, TOGETHER, either};
use super::share::is_thicker;
use super::{Extent, FAR, NEAR, smooth};
use crate::occupancy::index_set::RUN;
use glam::DVec3;

/// What the nodes of a piece of a row make of a box, were there nothing else.
#[derive(Clone, Debug)]
pub(super) struct NearestEdges {
    /// The box's edges, by the numbers below.
    edges: BoxEdges,
    /// The number of the nearest edge.
    edge: [f64; RUN],
    /// How far the node is before either of its faces.
    before: [[f64; RUN]; 2],
    share: [f64; RUN],
    /// A bit for each node: whether an edge may be among the cells around it, and whether others are as near as the nearest.
    may_be_beside: u64,
    by_corner: u64,
}

impl NearestEdges {
    pub(super) const NONE: Self = Self {
        edges: BoxEdges::NONE,
        edge: [0.0; RUN],
        before: [[0.0; RUN]; 2],
        share: [0.0; RUN],
        may_be_beside: 0,
        by_corner: 0,
    };

    /// Takes the box whose edges are looked for from now on.
    pub(super) fn start(&mut self, angles: &RightAngles, half: DVec3) {
        self.edges = BoxEdges::of(angles, half);
    }

    /// Of no node is any edge near.
    pub(super) fn clear(&mut self) {
        self.share.fill(0.0);
        (self.may_be_beside, self.by_corner) = (0, 0);
    }

    /// The share of the edges that are nearest to a node.
    #[inline]
    pub(super) fn share(&self, node: usize) -> f64 {
        self.share[node]
    }

    /// Makes that share a part of what it is.
    pub(super) fn take_part(&mut self, node: usize, part: f64) {
        self.share[node] *= part;
    }

    /// Around which nodes an edge may be among the cells: a bit for each, and any for those behind the last.
    #[inline]
    pub(super) fn may_be_beside(&self) -> u64 {
        self.may_be_beside
    }

    /// Whether other edges have a part in the field at a node.
    #[inline]
    pub(super) fn is_by_corner(&self, node: usize) -> bool {
        self.by_corner >> node & 1 != 0
    }

    /// The edge that is nearest to a node, and how far the node is before either face.
    #[inline]
    pub(super) fn edge(&self, node: usize) -> (&BoxEdge, [f64; 2]) {
        // Bits that the sum of a small whole number and this one ends with are that number.
        const WHOLE: f64 = 4_503_599_627_370_496.0;
        let number = (self.edge[node] + WHOLE).to_bits() as usize % EDGES;
        (&self.edges.0[number], [self.before[0][node], self.before[1][node]])
    }
}

/// So many numbers are for edges of a box; the last four are of none.
const EDGES: usize = 16;

/// An edge of a box, wherever along it.
#[derive(Clone, Copy, Debug)]
pub(super) struct BoxEdge {
    /// Outward unit normals of the two faces.
    pub(super) normals: [DVec3; 2],
    /// How thick the box is behind either face.
    thickness: [f64; 2],
    /// The middle one of its extents.
    breadth: f64,
}

impl Extent for BoxEdge {
    #[inline]
    fn is_thicker_than(&self, lengths: DVec3) -> bool {
        is_thicker(&self.normals, &self.thickness, lengths)
    }

    #[inline]
    fn breadth(&self) -> f64 {
        self.breadth
    }
}

/// The edges of a box: four times the axis that they are along, one more where the first of the next two coordinates is
/// negative, and two more where the second is.
#[derive(Clone, Debug)]
struct BoxEdges([BoxEdge; EDGES]);

impl BoxEdges {
    const NONE: Self =
        Self([BoxEdge { normals: [DVec3::ZERO; 2], thickness: [0.0; 2], breadth: 0.0 }; EDGES]);

    fn of(angles: &RightAngles, half: DVec3) -> Self {
        let turn = &angles.sensor_from_object.matrix3;
        let breadth = 2.0 * (half.element_sum() - half.min_element() - half.max_element());
        Self(std::array::from_fn(|edge| {
            let (axis, corner) = (edge / 4 % 3, edge % 4);
            let across = [(axis + 1) % 3, (axis + 2) % 3];
            let side = [0, 1].map(|face| if corner >> face & 1 == 0 { 1.0 } else { -1.0 });
            BoxEdge {
                normals: [0, 1].map(|face: usize| turn.col(across[face]) * side[face]),
                thickness: across.map(|across| 2.0 * half[across]),
                breadth,
            }
        }))
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

/// What is around edges is looked at with this much more around, so that rounding hides none.
const MORE: f64 = 1.0 + 1e-9;

impl pulp::NullaryFnOnce for FindNearest<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { angles, half, row, nearest } = self;
        let by_box = RowByBox::of(angles, half, &row);
        (nearest.may_be_beside, nearest.by_corner) = (0, 0);
        for group in 0..row.groups() {
            by_box.find(&row, group, nearest);
        }
    }
}

/// A row of the lattice in the frame of a box.
struct RowByBox {
    /// The box's frame from the sensor's: the columns of the rotation, and where x is zero.
    turn: [DVec3; 3],
    origin: f64,
    /// Half the box's edge lengths.
    half: DVec3,
    /// The row at the box's x, and the middles of the cells around its nodes there.
    start: DVec3,
    middle: DVec3,
    /// Of cells across the row, along the axes of the box: their sizes, and how far the cells around nodes reach.
    lengths: DVec3,
    reach: DVec3,
}

impl RowByBox {
    #[inline(always)]
    fn of(angles: &RightAngles, half: DVec3, row: &RowCells<'_>) -> Self {
        let [y, z] = row.across;
        let turn = &angles.object_from_sensor;
        let origin = angles.sensor_from_object.translation;
        let start = turn.y_axis * (y.at - origin.y) + turn.z_axis * (z.at - origin.z);
        let across = |of_y: f64, of_z: f64| turn.y_axis.abs() * of_y + turn.z_axis.abs() * of_z;
        Self {
            turn: [turn.x_axis, turn.y_axis, turn.z_axis],
            origin: origin.x,
            half,
            start,
            middle: start + turn.y_axis * (0.5 * y.skew) + turn.z_axis * (0.5 * z.skew),
            lengths: across(y.narrowest, z.narrowest),
            reach: across(MORE * y.width, MORE * z.width),
        }
    }

    /// So far along x from where the row is at some place.
    #[inline(always)]
    fn along(&self, start: DVec3, way: f64) -> [f64; 3] {
        let turn = &self.turn[0];
        [start.x + turn.x * way, start.y + turn.y * way, start.z + turn.z * way]
    }

    #[inline(always)]
    fn outside(&self, point: [f64; 3]) -> [f64; 3] {
        let half = &self.half;
        [point[0].abs() - half.x, point[1].abs() - half.y, point[2].abs() - half.z]
    }

    /// What of the row across and what along x reaches along the axes of the box.
    #[inline(always)]
    fn with_x(&self, across: DVec3, of_x: f64) -> [f64; 3] {
        let turn = &self.turn[0];
        [across.x + turn.x.abs() * of_x, across.y + turn.y.abs() * of_x, across.z + turn.z.abs() * of_x]
    }

    /// Whether any edge may be among the cells around a node.
    #[inline(always)]
    fn may_be_beside(&self, x: &PlaneCells) -> bool {
        let outside = self.outside(self.along(self.middle, x.at - self.origin + 0.5 * x.skew));
        may_be_near(outside, self.with_x(self.reach, MORE * x.width))
    }

    /// One loop over the nodes of a group, all in plain numbers: of these a compiler makes instructions for several nodes.
    #[inline(always)]
    fn find(&self, row: &RowCells<'_>, group: usize, nearest: &mut NearestEdges) {
        let nodes = group * TOGETHER..(group + 1) * TOGETHER;
        let x = row.group(group);
        let (mut edge, mut found) = ([0.0; TOGETHER], [[0.0; TOGETHER]; 3]);
        let (mut may_be_beside, mut by_corner) = (0, 0);
        for node in 0..TOGETHER {
            let x = x.at(node);
            let point = self.along(self.start, x.at - self.origin);
            let outside = self.outside(point);
            let is_x = (outside[0] <= outside[1]) & (outside[0] <= outside[2]);
            let is_z = !is_x & (outside[2] < outside[1]);
            let of_axis = |x: f64, y: f64, z: f64| either(is_x, x, either(is_z, z, y));
            let sizes = self.with_x(self.lengths, x.narrowest);
            let parts = parts(outside, sizes);
            let all = parts[0] + parts[1] + parts[2];
            let missing = self.missing([&x, row.across[0], row.across[1]], point, (outside, sizes), parts);
            // Of the two faces that meet at the edge.
            let before =
                [of_axis(outside[1], outside[2], outside[0]), of_axis(outside[2], outside[0], outside[1])];
            let is_negative =
                [of_axis(point[1], point[2], point[0]) < 0.0, of_axis(point[2], point[0], point[1]) < 0.0];
            edge[node] =
                of_axis(0.0, 4.0, 8.0) + either(is_negative[0], 1.0, 0.0) + either(is_negative[1], 2.0, 0.0);
            found[0][node] = before[0];
            found[1][node] = before[1];
            // Of edges that all have theirs, all of it, however numbers are rounded.
            found[2][node] = 1.0 - missing / all;
            may_be_beside |= u64::from(self.may_be_beside(&x)) << node;
            by_corner |= u64::from(all > 1.0) << node;
        }
        let [first, second, share] = found;
        nearest.may_be_beside |= may_be_beside << nodes.start;
        nearest.by_corner |= by_corner << nodes.start;
        nearest.edge[nodes.clone()].copy_from_slice(&edge);
        nearest.before[0][nodes.clone()].copy_from_slice(&first);
        nearest.before[1][nodes.clone()].copy_from_slice(&second);
        nearest.share[nodes].copy_from_slice(&share);
    }

    /// What edges that count as these parts do not have of a node's links, being far away or short.
    #[inline(always)]
    fn missing(
        &self,
        [x, y, z]: [&PlaneCells; 3],
        point: [f64; 3],
        (outside, sizes): ([f64; 3], [f64; 3]),
        parts: [f64; 3],
    ) -> f64 {
        let (half, [turn_x, turn_y, turn_z]) = (&self.half, &self.turn);
        // To the faces, and along edges to where they end.
        let to_faces = [
            half.x.copysign(point[0]) - point[0],
            half.y.copysign(point[1]) - point[1],
            half.z.copysign(point[2]) - point[2],
        ];
        let [half_x, half_y, half_z] = half.to_array();
        let near = |from: [f64; 3]| {
            // Across the rows of the rotation, which takes the box's frame to the sensor's.
            let ways = [
                turn_x.x * from[0] + turn_x.y * from[1] + turn_x.z * from[2],
                turn_y.x * from[0] + turn_y.y * from[1] + turn_y.z * from[2],
                turn_z.x * from[0] + turn_z.y * from[1] + turn_z.z * from[2],
            ];
            let cells = [x.cells_to(ways[0]), y.cells_to(ways[1]), z.cells_to(ways[2])];
            let farthest = larger(larger(cells[0], cells[1]), cells[2]);
            smooth(larger(smaller((FAR - farthest) / (FAR - NEAR), 1.0), 0.0))
        };
        // One after the other: a loop over axes is not compiled to vectors, and takes nearly three times as many instructions.
        let along = |outside: f64, to_face: f64| either(outside > 0.0, to_face, 0.0);
        let near_x = near([along(outside[0], to_faces[0]), to_faces[1], to_faces[2]]);
        let near_y = near([to_faces[0], along(outside[1], to_faces[1]), to_faces[2]]);
        let near_z = near([to_faces[0], to_faces[1], along(outside[2], to_faces[2])]);
        let missing_of =
            |part: f64, near: f64, half: f64, size: f64| part * (1.0 - near * of_length(half, size));
        missing_of(parts[0], near_x, half_x, sizes[0])
            + missing_of(parts[1], near_y, half_y, sizes[1])
            + missing_of(parts[2], near_z, half_z, sizes[2])
    }
}

/// Whether an edge of a box may be near, of what is so far before its faces along each axis and reaches so far.
#[inline(always)]
fn may_be_near(outside: [f64; 3], reach: [f64; 3]) -> bool {
    let [x, y, z] = [0, 1, 2].map(|axis: usize| outside[axis].abs() <= reach[axis]);
    let is_beyond = (outside[0] > reach[0]) | (outside[1] > reach[1]) | (outside[2] > reach[2]);
    !is_beyond & ((x & y) | (y & z) | (z & x))
}

/// The larger of two numbers; simpler than [`f64::max`], as neither is NaN.
#[inline(always)]
pub(crate) fn larger(a: f64, b: f64) -> f64 {
    either(a > b, a, b)
}

#[inline(always)]
pub(crate) fn smaller(a: f64, b: f64) -> f64 {
    either(a < b, a, b)
}

#[cfg(test)]
mod tests {
    use super::super::share::part_at;
    use super::super::star::{Row, Star, Stars};
    use super::super::{Cells, RightAngle, RightAngled};
    use super::*;
    use crate::mesh::Lattice;
    use glam::{DAffine3, DQuat};
    use pulp::NullaryFnOnce;

    /// The edge of a box that is nearest to a node, the share of all that are as near, and whether others are.
    fn seen_alone(star: &Star<'_>, angles: &RightAngles, half: DVec3) -> (RightAngle, f64, bool) {
        let local = angles.object_from_sensor * (star.place() - angles.sensor_from_object.translation);
        let outside = local.abs() - half;
        let axes = [0, 1, 2].map(|axis| angles.sensor_from_object.matrix3.col(axis));
        let sizes = axes.map(|axis| star.size_along(axis));
        let behind = outside - outside.min_element();
        let parts = (1.0 - behind / (0.2 * DVec3::from_array(sizes))).max(DVec3::ZERO);
        let shares = [0, 1, 2].map(|axis: usize| {
            let mut place = half.copysign(local);
            place[axis] = local[axis].clamp(-half[axis], half[axis]);
            let place = angles.sensor_from_object.transform_point3(place);
            part_at(star, place) * of_length(half[axis], sizes[axis])
        });
        let nearest = (0..3).min_by(|&a, &b| outside[a].total_cmp(&outside[b])).unwrap();
        let share = parts.dot(DVec3::from_array(shares)) / parts.element_sum();
        (angles.of_box(half, local, nearest, 0.0), share, parts.cmpgt(DVec3::ZERO).bitmask().count_ones() > 1)
    }

    /// Rows of more nodes than are one instruction, and of fewer, on cells of all sizes.
    #[test]
    fn rows_find_what_nodes_find() {
        let planes = |count: u32, growth: f64| {
            (0..count).map(|plane| 0.3 * f64::from(plane).powf(growth) - 1.0).collect::<Vec<_>>()
        };
        let lattice = Lattice::new([planes(11, 1.0), planes(6, 1.2), planes(7, 0.9)]).unwrap();
        let stars = Stars::of(&lattice, true);
        let turn = DQuat::from_rotation_z(0.4) * DQuat::from_rotation_x(0.3);
        let half = DVec3::new(0.7, 0.4, 0.5);
        for rotation in [DQuat::IDENTITY, turn] {
            let sensor_from_object =
                DAffine3::from_rotation_translation(rotation, DVec3::new(0.31, 0.1, -0.2));
            let object_from_sensor = sensor_from_object.matrix3.transpose();
            let angles =
                RightAngles { solid: RightAngled::Box(half), sensor_from_object, object_from_sensor };
            let (mut near, mut by_corner, mut beside, mut told) = (0, 0, 0, 0);
            let mut next = 0;
            while next < 11 * 6 * 7 {
                let mut nearest = NearestEdges::NONE;
                let row = stars.in_row(next..next + 40, &mut Row::default());
                nearest.start(&angles, half);
                let found = FindNearest { angles: &angles, half, row: row.cells(), nearest: &mut nearest };
                found.call();
                for (number, star) in row.each().enumerate() {
                    let (expected, share, is_by_corner) = seen_alone(&star, &angles, half);
                    assert_eq!(nearest.is_by_corner(number), is_by_corner, "{next} {number}");
                    assert!((nearest.share(number) - share).abs() < 1e-12, "{next} {number} {share}");
                    let is_beside = angles.has_edge_of_box_in(half, &star.bounds());
                    let may_be_beside = nearest.may_be_beside() >> number & 1 != 0;
                    assert!(may_be_beside || !is_beside, "{next} {number}");
                    beside += usize::from(is_beside);
                    told += usize::from(may_be_beside);
                    if share > 0.0 {
                        near += 1;
                        by_corner += usize::from(is_by_corner);
                        let (edge, before) = nearest.edge(number);
                        assert_eq!(edge.normals, expected.normals);
                        assert_eq!((edge.thickness, edge.breadth), (expected.thickness, expected.breadth));
                        let exact = expected.before(star.place());
                        assert!((before[0] - exact[0]).abs().max((before[1] - exact[1]).abs()) < 1e-12);
                    }
                }
                next = row.nodes.end;
            }
            assert!(near > 100 && (10..near - 10).contains(&by_corner), "{near} {by_corner}");
            assert!(beside > 50 && told < 2 * beside, "{told} of {beside}");
        }
    }
}
