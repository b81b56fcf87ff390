//! Nested boxes around the pieces of a surface, and from them the space in which a moved solid may answer differently.
//!
//! Think of a solid that deforms linearly from one pose to the next. A point that is inside at one end and outside at the
//! other is passed by the surface on the way, so it lies in the convex hull of some piece's places at both ends. Boxes
//! around these hulls therefore hold everything that may differ, and also both surfaces themselves: no segment beyond
//! them is cut in either pose.
//!
//! # Faces that slide within themselves
//! When a box or a cylinder is shifted along one of its faces, that face stays in its plane, and only what passes the
//! other surfaces can change. Their boxes suffice, bit for bit, where *coordinates of the solid's frame are kept*: where
//! the components of the pose's translation that differ are multiplied by exactly zero in those coordinates, they are the
//! same numbers for every point, but for the sign of a zero, which nothing in `convex` depends on. Then the part K of a
//! line that is within the kept faces is the same in bits. What the line has within the other surfaces, O, may differ.
//! The answer follows from where the ends are and from the later start and the earlier end of K and O in [0, 1].
//!
//! Take a segment that stays out of the boxes around the other surfaces. Where it is in K it is between the planes of the
//! kept faces, where the other surfaces are complete: it cannot come from their inside to their outside without
//! touching them, nor can they have passed it during the move, so that all of K in [0, 1] is inside them in both poses or
//! outside in both. Boxes are larger than their surfaces by far more than rounding moves a crossing ([`MARGIN`]), so
//! this holds of numbers as it does of points:
//! - Inside: O reaches beyond K on both sides, or beyond the segment. What is chosen from both is the bits of K, or the
//!   segment's end.
//! - Outside: O and K have nothing in common on the segment; in both poses it passes by.
//!
//! An end is in the solid if it is within K and O, of which the same is true. The boxes hold the rims of the faces that
//! are left out. Nodes near a cylinder know more of it than what is inside, so of its faces none is. A capsule's surfaces touch each other without an angle, so that no margin parts the crossings of one
//! from those of another, and triangles are not told from their planes' distances: of these no face is left out.

use super::convex::Patch;
use crate::geometry::Aabb;
use glam::{BVec3, DAffine3, DVec3};

/// Pieces are not halved below this part of the solid's diameter.
const FINEST: f64 = 1.0 / 40.0;

/// Boxes are larger than what they hold by this part of the lengths at hand, so that rounding leaves nothing outside.
const MARGIN: f64 = 1e-9;

/// What is good enough for a mesh, in its mean spacings; near electrodes it is several times finer. Chosen by measurement
/// on lattices of 30,000 and 1,000,000 tetrahedra: smaller boxes cost more than they save.
const SMALL: f64 = 1.0;
const LONG: f64 = 16.0;
/// Around edges, all nodes within two cells of a box are visited, so that it pays to follow edges more closely.
const LONG_AT_EDGES: f64 = 3.0;
const THIN: f64 = 0.3;

/// A box in the solid's frame around a piece of its surface.
#[derive(Clone, Copy, Debug)]
struct Node {
    centre: DVec3,
    half: DVec3,
    /// The coordinates that tell where the piece is crossed; all of them if they are not told apart.
    made_of: BVec3,
    /// The node that comes after this one and all within it; a leaf's is its successor.
    exit: u32,
}

/// Boxes in boxes, each before those within it.
#[derive(Clone, Debug, Default)]
pub(super) struct SurfaceTree {
    nodes: Vec<Node>,
}

impl SurfaceTree {
    /// Halves pieces of a convex solid's surface again and again. With each come the coordinates that tell where it is
    /// crossed.
    pub(super) fn of_patches(patches: Vec<(Patch, BVec3)>) -> Self {
        let mut tree = Self::default();
        let around = patches.iter().flat_map(|(patch, _)| patch.bounds());
        let finest = FINEST * Aabb::around(around).size().length();
        // A stack of patches, and of nodes whose exits are known once all above them on the stack are done.
        enum Task {
            Add(Patch, BVec3),
            Close(usize),
        }
        let mut tasks: Vec<Task> =
            patches.into_iter().map(|(patch, made_of)| Task::Add(patch, made_of)).collect();
        while let Some(task) = tasks.pop() {
            match task {
                Task::Add(patch, made_of) => {
                    let [min, max] = patch.bounds();
                    let node = tree.push(Aabb { min, max }, made_of);
                    if (max - min).max_element() > finest {
                        tasks.push(Task::Close(node));
                        tasks.extend(patch.halves().map(|half| Task::Add(half, made_of)));
                    }
                }
                Task::Close(node) => tree.nodes[node].exit = tree.nodes.len() as u32,
            }
        }
        tree.nodes.shrink_to_fit();
        tree
    }

    /// Takes boxes in the order of the tree, each with the number of the one after it and all within it.
    pub(super) fn of_boxes(boxes: impl IntoIterator<Item = (Aabb, u32)>) -> Self {
        let mut tree = Self::default();
        for (bounds, exit) in boxes {
            let node = tree.push(bounds, BVec3::TRUE);
            tree.nodes[node].exit = exit;
        }
        tree
    }

    /// The boxes in the solid's frame, as [`SurfaceTree::of_boxes`] takes them.
    pub(super) fn boxes(&self) -> impl ExactSizeIterator<Item = (Aabb, u32)> {
        let around = |node: &Node| Aabb { min: node.centre - node.half, max: node.centre + node.half };
        self.nodes.iter().map(move |node| (around(node), node.exit))
    }

    fn push(&mut self, bounds: Aabb, made_of: BVec3) -> usize {
        let (centre, half) = (0.5 * (bounds.min + bounds.max), 0.5 * bounds.size());
        self.nodes.push(Node { centre, half, made_of, exit: self.nodes.len() as u32 + 1 });
        self.nodes.len() - 1
    }

    /// Whether one of the smallest boxes, the solid at a pose, touches a box of the sensor frame.
    pub(super) fn is_in(&self, pose: &DAffine3, bounds: &Aabb) -> bool {
        let placement = Placement::new(pose);
        let mut at = 0;
        while let Some(node) = self.nodes.get(at) {
            let is_leaf = node.exit as usize == at + 1;
            let touches = placement.place(node).intersects(bounds);
            if touches && is_leaf {
                return true;
            }
            at = if touches { at + 1 } else { node.exit as usize };
        }
        false
    }

    /// Appends boxes in the sensor frame around all places at which a solid of this surface may answer differently after
    /// a move. They get smaller only until they are good enough for a mesh of some spacing.
    pub(super) fn append_regions(&self, poses: [&DAffine3; 2], spacing: f64, regions: &mut Vec<Aabb>) {
        self.append_boxes(poses, spacing, LONG, regions);
    }

    /// The same for lines where a surface turns abruptly.
    pub(super) fn append_regions_at_edges(
        &self,
        poses: [&DAffine3; 2],
        spacing: f64,
        regions: &mut Vec<Aabb>,
    ) {
        self.append_boxes(poses, spacing, LONG_AT_EDGES, regions);
    }

    fn append_boxes(&self, poses: [&DAffine3; 2], spacing: f64, long: f64, regions: &mut Vec<Aabb>) {
        let moved = !kept_coordinates(poses);
        let [before, now] = poses.map(Placement::new);
        let mut at = 0;
        while let Some(node) = self.nodes.get(at) {
            if !(node.made_of & moved).any() {
                at = node.exit as usize;
                continue;
            }
            let (a, b) = (before.place(node), now.place(node));
            let region = Aabb { min: a.min.min(b.min), max: a.max.max(b.max) };
            let is_leaf = node.exit as usize == at + 1;
            if is_leaf || is_good_enough(&region, spacing, long) {
                regions.push(region);
                at = node.exit as usize;
            } else {
                at += 1;
            }
        }
    }
}

/// Coordinates in the solid's frame that a move leaves alone for every point: the solid is not turned, and each component
/// of its place that differs is multiplied by zero in them. Never all, as a rotation has no column of zeros.
fn kept_coordinates([before, now]: [&DAffine3; 2]) -> BVec3 {
    let sensor_from_object = now.matrix3;
    if before.matrix3 != sensor_from_object {
        return BVec3::FALSE;
    }
    let differs = before.translation.cmpne(now.translation);
    let is_kept = |axis: usize| !(sensor_from_object.col(axis).cmpne(DVec3::ZERO) & differs).any();
    BVec3::from_array([0, 1, 2].map(is_kept))
}

/// Whether smaller boxes would save little: this one is small, or so thin that it mostly holds what must be visited.
fn is_good_enough(region: &Aabb, spacing: f64, long: f64) -> bool {
    let size = region.size();
    let longest = size.max_element();
    longest <= SMALL * spacing || (longest <= long * spacing && size.min_element() <= THIN * spacing)
}

/// A pose, and what it makes of the half sizes of boxes.
struct Placement<'a> {
    pose: &'a DAffine3,
    spread: [DVec3; 3],
    margin: f64,
}

impl<'a> Placement<'a> {
    fn new(pose: &'a DAffine3) -> Self {
        let axes = [pose.matrix3.x_axis, pose.matrix3.y_axis, pose.matrix3.z_axis];
        Self { pose, spread: axes.map(DVec3::abs), margin: MARGIN * pose.translation.length() }
    }

    fn place(&self, node: &Node) -> Aabb {
        let centre = self.pose.transform_point3(node.centre);
        let half = self.spread[0] * node.half.x + self.spread[1] * node.half.y + self.spread[2] * node.half.z;
        let half = half + self.margin + MARGIN * (node.centre.abs().max_element() + half.max_element());
        Aabb { min: centre - half, max: centre + half }
    }
}

/// The box in the sensor frame around a box in a solid's frame.
pub(super) fn placed(pose: &DAffine3, bounds: &Aabb) -> Aabb {
    let (centre, half) = (0.5 * (bounds.min + bounds.max), 0.5 * bounds.size());
    Placement::new(pose).place(&Node { centre, half, made_of: BVec3::TRUE, exit: 0 })
}
