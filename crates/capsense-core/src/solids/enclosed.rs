//! What a closed surface of triangles encloses.
//!
//! A point is inside if a ray along z leaves through an odd number of triangles. The signs that decide are exact
//! (Shewchuk's adaptive predicates), and whether the ray passes an edge to its left or to its right is asked of the
//! edge, not of the triangle. So a ray through an edge or a corner is counted once, as it should. A segment crosses a
//! triangle if it meets any point of it, its rim included, so that no crossing is missed; where it only touches, the
//! middles of the parts before and behind tell that nothing was entered.
//!
//! Triangles are found through the `bvh` crate's tree, flattened to boxes that each know where to go on when they are
//! missed.

use super::surface_tree::SurfaceTree;
use crate::geometry::Aabb;
use crate::occupancy::Span;
use bvh::aabb::Bounded;
use bvh::bounding_hierarchy::BHShape;
use bvh::bvh::Bvh;
use glam::{DVec2, DVec3};
use robust::{Coord, Coord3D, orient2d, orient3d};
use std::cell::Cell;
use std::collections::BTreeMap;

/// Points nearer to the surface than this part of its size are on it, and so outside.
const ON_SURFACE: f64 = 1e-12;

/// Cosine of the angle by which a surface turns abruptly: 45 degrees.
const ABRUPT: f64 = 0.707;

/// Parts of a segment shorter than this are taken for rounding.
const NO_LENGTH: f64 = 1e-9;

/// A box of the tree, and the triangle, or the edge, in it if it holds but one.
#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: Aabb,
    leaf: Option<u32>,
    exit: u32,
}

/// The volume in a closed surface of triangles.
#[derive(Clone, Debug)]
pub(super) struct Enclosed {
    triangles: Vec<[DVec3; 3]>,
    nodes: Vec<Node>,
    /// Boxes around the edges at which the surface turns abruptly.
    edges: Vec<Node>,
    bounds: Aabb,
    /// Distance from the surface at which points are on it, in metres.
    thickness: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    Inside,
    OnSurface,
    Outside,
}

impl Enclosed {
    pub(super) fn new(triangles: Vec<[DVec3; 3]>) -> Self {
        let bounds = Aabb::around(triangles.iter().flatten().copied());
        let nodes = tree(triangles.iter().map(|corners| Aabb::around(*corners)));
        let edges = tree(abrupt_edges(&triangles).into_iter().map(Aabb::around));
        let thickness = ON_SURFACE * bounds.size().length();
        Self { triangles, nodes, edges, bounds, thickness }
    }

    pub(super) fn bounds(&self) -> Aabb {
        self.bounds
    }

    pub(super) fn surface_tree(&self) -> SurfaceTree {
        SurfaceTree::of_boxes(self.nodes.iter().map(|node| (node.bounds, node.exit)))
    }

    pub(super) fn contains(&self, point: DVec3) -> bool {
        self.place(point) == Place::Inside
    }

    /// Whether the surface may turn abruptly in a box of half size `half` about a point.
    pub(super) fn has_edge_near(&self, centre: DVec3, half: DVec3) -> bool {
        let wanted = Aabb { min: centre - half, max: centre + half };
        let found = Cell::new(false);
        for_leaves(&self.edges, |bounds| !found.get() && bounds.intersects(&wanted), |_| found.set(true));
        found.get()
    }

    /// The part of a segment from where it first enters to where it last leaves.
    pub(super) fn span(&self, a: DVec3, b: DVec3) -> Option<Span> {
        let segment = Segment { a, b };
        let from = self.place(a);
        let Some([first, last]) = self.crossings(&segment) else {
            // Nothing is crossed, so all of it is in one place, and one that rounding moves onto the surface tells not.
            let all = match (from, self.place(b)) {
                (Place::Inside, _) | (_, Place::Inside) => true,
                (Place::Outside, _) | (_, Place::Outside) => false,
                (Place::OnSurface, Place::OnSurface) => self.contains(a.midpoint(b)),
            };
            return all.then_some(Span { enter: 0.0, exit: 1.0 });
        };
        let to = self.place(b);
        let enter = match from {
            Place::Inside => 0.0,
            _ => self.first_entry(&segment, [from, to], [first, last])?,
        };
        let exit = match to {
            Place::Inside => 1.0,
            _ => 1.0 - self.first_entry(&segment.reversed(), [to, from], [1.0 - last, 1.0 - first])?,
        };
        Some(Span { enter, exit: exit.max(enter) })
    }

    /// The start of the first part of a segment, cut at all crossings, that is inside. Given are the places of its ends
    /// and its first and last crossing.
    fn first_entry(&self, segment: &Segment, ends: [Place; 2], [first, last]: [f64; 2]) -> Option<f64> {
        let mut start = 0.0;
        while start < 1.0 {
            let (before_first, behind_last) = (start < first - NO_LENGTH, start >= last - NO_LENGTH);
            let end = match (before_first, behind_last) {
                (true, _) => first,
                (false, true) => 1.0,
                (false, false) => self.next_crossing(segment, start + NO_LENGTH).unwrap_or(1.0),
            };
            // The outer parts are where their ends are, unless these are within rounding of the surface.
            let is_inside = if before_first && ends[0] != Place::OnSurface {
                ends[0] == Place::Inside
            } else if behind_last && start < 1.0 - NO_LENGTH && ends[1] != Place::OnSurface {
                ends[1] == Place::Inside
            } else {
                self.contains(segment.at(0.5 * (start + end)))
            };
            if is_inside && (end - start > NO_LENGTH || end == 1.0) {
                return Some(start);
            }
            start = end;
        }
        None
    }

    /// The first and the last crossing.
    fn crossings(&self, segment: &Segment) -> Option<[f64; 2]> {
        let mut found: Option<[f64; 2]> = None;
        self.for_triangles(
            |bounds| segment.meets(bounds, self.thickness),
            |corners| {
                if let Some(t) = segment.crossing(corners) {
                    found = Some(found.map_or([t, t], |[first, last]| [first.min(t), last.max(t)]));
                }
            },
        );
        found
    }

    /// The first crossing at or behind a place.
    fn next_crossing(&self, segment: &Segment, from: f64) -> Option<f64> {
        let mut found: Option<f64> = None;
        self.for_triangles(
            |bounds| segment.meets(bounds, self.thickness),
            |corners| {
                if let Some(t) = segment.crossing(corners).filter(|&t| t >= from) {
                    found = Some(found.map_or(t, |first| first.min(t)));
                }
            },
        );
        found
    }

    fn place(&self, point: DVec3) -> Place {
        let (low, high) = (point - self.thickness, point + self.thickness);
        if !self.bounds.intersects(&Aabb { min: low, max: high }) {
            return Place::Outside;
        }
        let (mut is_inside, mut is_near) = (false, false);
        self.for_triangles(
            |bounds| bounds.max.cmpge(low).all() && bounds.min.truncate().cmple(high.truncate()).all(),
            |corners| {
                let lowest = corners[0].z.min(corners[1].z).min(corners[2].z);
                is_near |= lowest <= high.z && distance(point, corners) <= self.thickness;
                is_inside ^= is_below(point, corners);
            },
        );
        match (is_near, is_inside) {
            (true, _) => Place::OnSurface,
            (false, true) => Place::Inside,
            (false, false) => Place::Outside,
        }
    }

    /// Visits the triangles whose boxes are wanted.
    #[inline]
    fn for_triangles(&self, wanted: impl FnMut(&Aabb) -> bool, mut visit: impl FnMut(&[DVec3; 3])) {
        for_leaves(&self.nodes, wanted, |triangle| visit(&self.triangles[triangle as usize]));
    }
}

/// Visits the leaves of a tree whose boxes, and those around them, are wanted.
#[inline]
fn for_leaves(nodes: &[Node], mut wanted: impl FnMut(&Aabb) -> bool, mut visit: impl FnMut(u32)) {
    let mut at = 0;
    while let Some(node) = nodes.get(at) {
        if !wanted(&node.bounds) {
            at = node.exit as usize;
            continue;
        }
        if let Some(leaf) = node.leaf {
            visit(leaf);
        }
        at += 1;
    }
}

/// The edges of a closed surface at which it turns by more than [`ABRUPT`].
fn abrupt_edges(triangles: &[[DVec3; 3]]) -> Vec<[DVec3; 2]> {
    let mut normals = BTreeMap::new();
    let mut found = Vec::new();
    for &[a, b, c] in triangles {
        let normal = (b - a).cross(c - a).normalize_or_zero();
        for [from, to] in [[a, b], [b, c], [c, a]] {
            // The other triangle has the edge the other way round.
            let key = |from: DVec3, to: DVec3| [from, to].map(|end| end.to_array().map(f64::to_bits));
            match normals.remove(&key(to, from)) {
                Some(other) if normal.dot(other) < ABRUPT => found.push([from, to]),
                Some(_) => {}
                None => drop(normals.insert(key(from, to), normal)),
            }
        }
    }
    found
}

/// Whether the ray from a point along +z leaves through a triangle.
fn is_below(point: DVec3, corners: &[DVec3; 3]) -> bool {
    let [a, b, c] = corners.map(DVec3::truncate);
    let p = point.truncate();
    // An edge counts if it lies to the right of the point. Ends as high as the point count as below.
    let is_passed = |from: DVec2, to: DVec2| {
        let (low, high) = if from.y <= to.y { (from, to) } else { (to, from) };
        low.y <= p.y && p.y < high.y && orient2d(flat(low), flat(high), flat(p)) > 0.0
    };
    if !(is_passed(a, b) ^ is_passed(b, c) ^ is_passed(c, a)) {
        return false;
    }
    let turn = orient2d(flat(a), flat(b), flat(c));
    let below = orient3d(solid(corners[0]), solid(corners[1]), solid(corners[2]), solid(point));
    if turn > 0.0 { below > 0.0 } else { below < 0.0 }
}

fn flat(point: DVec2) -> Coord<f64> {
    Coord { x: point.x, y: point.y }
}

fn solid(point: DVec3) -> Coord3D<f64> {
    Coord3D { x: point.x, y: point.y, z: point.z }
}

struct Segment {
    a: DVec3,
    b: DVec3,
}

impl Segment {
    fn reversed(&self) -> Self {
        Self { a: self.b, b: self.a }
    }

    fn at(&self, t: f64) -> DVec3 {
        self.a.lerp(self.b, t)
    }

    /// Whether the segment comes near a box: no plane across an axis, or along it and the segment, parts the two.
    #[inline]
    fn meets(&self, bounds: &Aabb, slack: f64) -> bool {
        let half_segment = 0.5 * (self.b - self.a);
        let half_box = 0.5 * (bounds.max - bounds.min) + slack;
        let apart = 0.5 * ((self.a - bounds.min) + (self.b - bounds.max));
        let reach = half_segment.abs();
        if !apart.abs().cmple(half_box + reach).all() {
            return false;
        }
        let across = apart.cross(half_segment).abs();
        let widths = DVec3::new(
            half_box.y * reach.z + half_box.z * reach.y,
            half_box.x * reach.z + half_box.z * reach.x,
            half_box.x * reach.y + half_box.y * reach.x,
        );
        across.cmple(widths).all()
    }

    /// Where the segment passes from one side of a triangle to the other, or meets its plane with an end; `None` where
    /// it lies in that plane.
    fn crossing(&self, corners: &[DVec3; 3]) -> Option<f64> {
        let [v0, v1, v2] = corners.map(solid);
        let (a, b) = (solid(self.a), solid(self.b));
        let (from, to) = (orient3d(v0, v1, v2, a), orient3d(v0, v1, v2, b));
        if (from > 0.0 && to > 0.0) || (from < 0.0 && to < 0.0) || (from == 0.0 && to == 0.0) {
            return None;
        }
        let sides = [orient3d(a, b, v0, v1), orient3d(a, b, v1, v2), orient3d(a, b, v2, v0)];
        let passes = sides.iter().all(|&side| side >= 0.0) || sides.iter().all(|&side| side <= 0.0);
        passes.then(|| from / (from - to))
    }
}

/// The distance of a point from a triangle (Ericson, Real-Time Collision Detection, 5.1.5).
fn distance(point: DVec3, &[a, b, c]: &[DVec3; 3]) -> f64 {
    let to_edge = |from: DVec3, to: DVec3| {
        let along = to - from;
        let t = ((point - from).dot(along) / along.length_squared()).clamp(0.0, 1.0);
        point.distance(from + t * along)
    };
    let to_edges = to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a));
    let normal = (b - a).cross(c - a);
    let is_over = |from: DVec3, to: DVec3| (to - from).cross(point - from).dot(normal) >= 0.0;
    if normal != DVec3::ZERO && is_over(a, b) && is_over(b, c) && is_over(c, a) {
        to_edges.min((point - a).dot(normal.normalize()).abs())
    } else {
        to_edges
    }
}

/// A box of a triangle or of an edge, for the tree.
struct Leaf {
    bounds: Aabb,
    node: usize,
}

impl Bounded<f64, 3> for Leaf {
    fn aabb(&self) -> bvh::aabb::Aabb<f64, 3> {
        bvh::aabb::Aabb::with_bounds(self.bounds.min.to_array().into(), self.bounds.max.to_array().into())
    }
}

impl BHShape<f64, 3> for Leaf {
    fn set_bh_node_index(&mut self, index: usize) {
        self.node = index;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

/// A tree over boxes.
fn tree(boxes: impl Iterator<Item = Aabb>) -> Vec<Node> {
    let mut leaves: Vec<Leaf> = boxes.map(|bounds| Leaf { bounds, node: 0 }).collect();
    if leaves.is_empty() {
        return Vec::new();
    }
    // A leaf comes without its box.
    Bvh::build(&mut leaves).flatten_custom(&|bounds: &bvh::aabb::Aabb<f64, 3>, entry, exit, shape: u32| {
        if entry == u32::MAX {
            return Node { bounds: leaves[shape as usize].bounds, leaf: Some(shape), exit };
        }
        let corner = |point: &[f64; 3]| DVec3::from_array(*point);
        let bounds =
            Aabb { min: corner(bounds.min.coords.as_ref()), max: corner(bounds.max.coords.as_ref()) };
        Node { bounds, leaf: None, exit }
    })
}
