//! Nodes of a lattice near an edge of a conductor, where the field is that of a wedge.
//!
//! Around a right angle of a conductor the potential is u = r^(2/3) sin(2θ/3) (Van Bladel, *Singular Electromagnetic Fields
//! and Sources*), which no mesh of a scene's size resolves. So a node near such an edge is linked to the conductor by as
//! much as makes u satisfy the equation of this node: over its neighbours Q that the conductor does not cut off,
//!
//! link(P) u(P) = Σ w(P, Q) (u(Q) - u(P)).
//!
//! Then u is a solution on the lattice, wherever the edge lies between nodes, and a wall that passes a line of nodes changes
//! the network but not this field. In front of a flat face, u being the distance, the link is what the edge rule makes
//! of it. A link may be slightly negative, where u bends more than the lattice can: all nodes with one have u > 0 and
//! (K u)(P) = 0, so K stays an M-matrix.
//!
//! Two cells from an edge, at its ends, and a cell from any other object, the edge rule takes over, in shares.

use super::coupling::{Coupling, SMALLEST_PART};
use super::{NO_OBJECT, Scene};
use crate::geometry::Aabb;
use crate::mesh::{Edges, Lattice};
use crate::sensor::FREE;
use glam::DVec3;

/// Up to so many cells from an edge, the field is that of a wedge alone.
const NEAR: f64 = 1.0;
/// So many cells from an edge, nothing is known of it.
const FAR: f64 = 2.0;
/// Planes of nodes on either side of an edge that may be as near as that.
const PLANES: usize = 2;

/// The axis along which each node's own edge carries its link.
const CARRIER: usize = 0;

/// A right angle at which two faces of an object meet, seen from a point near it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RightAngle {
    /// The nearest place on the edge, or on the line through it.
    pub place: DVec3,
    /// Outward unit normals of the two faces.
    pub normals: [DVec3; 2],
    /// How far the place is from the edge's nearest end; negative beyond.
    pub inside: f64,
    /// The radius of the circle, about an axis against the first normal, that the edge is part of.
    pub radius: f64,
    /// How thick the object is behind the faces, at least across one of them.
    pub thickness: f64,
}

impl RightAngle {
    /// Where a point is: how far before either face, and along the edge.
    fn coordinates(&self, point: DVec3) -> [f64; 3] {
        let from = point - self.place;
        [self.normals[0].dot(from), self.normals[1].dot(from), self.along().dot(from)]
    }

    /// The direction of the edge.
    fn along(&self) -> DVec3 {
        self.normals[0].cross(self.normals[1])
    }
}

/// Points around a node: itself, then its neighbours, and one more that makes the number even.
const POINTS: usize = 8;

/// Coordinates of points by a right angle, one array for each.
#[derive(Clone, Copy, Default)]
struct Places([[f64; POINTS]; 3]);

impl Places {
    fn set(&mut self, point: usize, place: [f64; 3]) {
        (0..3).for_each(|coordinate| self.0[coordinate][point] = place[coordinate]);
    }

    /// Whether no straight way between two of the points passes the object: a face is behind both of them.
    fn see_each_other(&self, a: usize, b: usize) -> bool {
        let [p, q, _] = &self.0;
        p[a] >= 0.0 && p[b] >= 0.0 || q[a] >= 0.0 && q[b] >= 0.0
    }

    /// r^(2/3) sin(2θ/3) at the points, θ from one face to the other; zero in the object. Loops without branches, so that
    /// several points are one instruction.
    fn potentials(&self, radius: f64) -> [f64; POINTS] {
        let [p, q, along] = &self.0;
        let bend = 0.5 / radius;
        let (mut before, mut squared, mut roots) = ([0.0; POINTS], [0.0; POINTS], [0.0; POINTS]);
        for point in 0..POINTS {
            before[point] = p[point] + bend * along[point] * along[point];
            squared[point] = before[point] * before[point] + q[point] * q[point] + f64::MIN_POSITIVE;
        }
        for point in 0..POINTS {
            roots[point] = about_cube_root(squared[point]);
        }
        let mut potentials = [0.0; POINTS];
        for point in 0..POINTS {
            let (p, q, squared) = (before[point], q[point], squared[point]);
            // From the bisector outside, angles are φ = θ - 3π/4.
            let third = cosine_of_third(std::f64::consts::FRAC_1_SQRT_2 * (p + q) / squared.sqrt());
            let potential = better_cube_root(squared, roots[point]) * (2.0 * third * third - 1.0);
            potentials[point] = if p > 0.0 || q > 0.0 { potential } else { 0.0 };
        }
        potentials
    }
}

/// cos(φ/3) from cos φ, for |φ| up to 3π/4, by Newton's method on 4c³ - 3c = cos φ; wrong by less than 3e-8.
#[inline(always)]
fn cosine_of_third(cosine: f64) -> f64 {
    // The parabola through the values at 0, π/2 and 3π/4.
    let mut c = 0.8660 + cosine * (0.1871 - 0.0531 * cosine);
    for _ in 0..2 {
        let squared = c * c;
        c -= (c * (4.0 * squared - 3.0) - cosine) / (12.0 * squared - 3.0);
    }
    c
}

/// The cube root of a positive number to within 5 %: a third of its exponent.
#[inline(always)]
fn about_cube_root(x: f64) -> f64 {
    // Two thirds of the exponent's offset, 1023 · 2⁵², less what makes the largest error smallest.
    const OFFSET: u64 = 0x2a9f_7893_0000_0000;
    f64::from_bits(x.to_bits() / 3 + OFFSET)
}

/// The cube root from a guess that is within 5 % of it, to about twelve digits by two steps of Halley's method. That of the
/// standard library is exact to the last bit and takes several times as long.
#[inline(always)]
fn better_cube_root(x: f64, mut root: f64) -> f64 {
    for _ in 0..2 {
        let cube = root * root * root;
        root *= (cube + 2.0 * x) / (2.0 * cube + x);
    }
    root
}

/// What a node near an edge of a conductor makes of its edges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct AtWedge {
    /// The conductor, or [`NO_OBJECT`].
    object: u16,
    /// How much of the node's links to conductors is what the wedge makes of them.
    share: f32,
    /// That share, as a factor of the weight of the edge that leads upwards along [`CARRIER`].
    link: f64,
    /// Whether the field is that of one wedge alone: the edge rule has no share in it, and the conductor is thicker than
    /// edges are long, so that nothing is behind it.
    is_all: bool,
    /// Whether that is not so, and a conductor has an edge among the cells around.
    is_beside: bool,
}

impl AtWedge {
    const NONE: Self = Self { object: NO_OBJECT, share: 0.0, link: 0.0, is_all: false, is_beside: false };

    /// Whether nothing but the wedge, or the conductor that holds it, matters at this end of an edge.
    fn is_all_to(&self, owner: u16) -> bool {
        self.is_all || owner != NO_OBJECT
    }
}

/// What all nodes make of edges of conductors.
#[derive(Clone, Debug, Default)]
pub(super) struct Wedges {
    /// Empty before the first exact surface.
    at: Vec<AtWedge>,
    /// The frame in which each node was last looked at; regions overlap.
    seen: Vec<u8>,
    /// Nodes whose share in their links changed.
    reshared: Vec<u32>,
    /// Nodes of which their links alone changed.
    relinked: Vec<u32>,
}

impl Wedges {
    /// Looks at the nodes near some regions, outside of which nothing changed. `conductors` are those that hold nodes.
    pub(super) fn update(&mut self, scene: &Scene<'_>, regions: &[Aabb], conductors: &[u16], frame: u8) {
        self.reshared.clear();
        self.relinked.clear();
        if self.at.is_empty() && scene.has_silhouettes {
            self.at.resize(conductors.len(), AtWedge::NONE);
            self.seen.resize(conductors.len(), 0);
        }
        if self.at.is_empty() {
            return;
        }
        let Self { at, seen, reshared, relinked } = self;
        for region in regions {
            let near = grown(scene.mesh.edges, region);
            scene.mesh.edges.for_nodes_near(scene.mesh.nodes, &near, |node| {
                if std::mem::replace(&mut seen[node], frame) != frame {
                    let now = scene.at_wedge(node, conductors);
                    let before = std::mem::replace(&mut at[node], now);
                    if before.share.to_bits() != now.share.to_bits() {
                        reshared.push(node as u32);
                    } else if before.link.to_bits() != now.link.to_bits() || before.object != now.object {
                        relinked.push(node as u32);
                    }
                }
            });
        }
    }

    /// After 255 frames, numbers come again.
    pub(super) fn forget_frames(&mut self) {
        self.seen.fill(0);
    }

    /// Whether no edge of a conductor was ever looked for.
    pub(super) fn are_none(&self) -> bool {
        self.at.is_empty()
    }

    /// Visits the edges that the last update may have changed, and tells whether they carry a link that it changed. Others
    /// only change if they are not plain.
    pub(super) fn for_changed_edges(&self, edges: &Edges, mut visit: impl FnMut(usize, [u32; 2], bool)) {
        for &node in &self.relinked {
            let edge = 3 * node as usize + CARRIER;
            visit(edge, edges.ends_of_existing(edge), true);
        }
        for &node in &self.reshared {
            edges.for_edges_at(node as usize, |edge, _| {
                if let Some(ends) = edges.ends(edge) {
                    visit(edge, ends, edge == 3 * node as usize + CARRIER);
                }
            });
        }
    }

    /// Whether walls of conductors may pass beside an edge that is not all between wedges.
    pub(super) fn may_be_beside(&self, ends: [u32; 2], owners: [u16; 2]) -> bool {
        let at = |end: usize| self.at.get(ends[end] as usize).filter(|at| !at.is_all_to(owners[end]));
        // All that is beside an edge is among the cells around either of its ends.
        [0, 1].into_iter().filter_map(at).map(|at| at.is_beside).reduce(|a, b| a && b).unwrap_or(false)
    }

    /// What the ends of an edge make of it, if one is near an edge of a conductor.
    pub(super) fn between(&self, ends: [u32; 2]) -> Option<[&AtWedge; 2]> {
        let [a, b] = [self.at.get(ends[0] as usize)?, self.at.get(ends[1] as usize)?];
        (a.share > 0.0 || b.share > 0.0).then_some([a, b])
    }
}

/// A node of the lattice and its neighbours.
struct Star<'a> {
    lattice: &'a Lattice,
    node: usize,
    place: [usize; 3],
}

impl Star<'_> {
    /// The neighbour on a side of the node along an axis, and how far it is; none where the lattice ends.
    fn neighbour(&self, axis: usize, upwards: bool) -> Option<(usize, f64)> {
        let (planes, index) = (&self.lattice.axes()[axis], self.place[axis]);
        let stride = self.lattice.strides()[axis];
        if upwards {
            Some((self.node + stride, planes.get(index + 1)? - planes[index]))
        } else {
            Some((self.node - stride, planes[index] - planes[index.checked_sub(1)?]))
        }
    }

    /// Half of the way to the neighbours along an axis.
    fn width(&self, axis: usize) -> f64 {
        let way = |upwards| self.neighbour(axis, upwards).map_or(0.0, |(_, way)| way);
        0.5 * (way(false) + way(true))
    }

    /// The way to the nearer neighbour along an axis.
    fn narrowest(&self, axis: usize) -> f64 {
        let way = |upwards| self.neighbour(axis, upwards).map_or(f64::INFINITY, |(_, way)| way);
        way(false).min(way(true))
    }

    /// The way to the farthest neighbour.
    fn longest(&self) -> f64 {
        let way = |axis: usize, upwards| self.neighbour(axis, upwards).map_or(0.0, |(_, way)| way);
        [0, 1, 2].into_iter().fold(0.0, |longest, axis| way(axis, false).max(way(axis, true)).max(longest))
    }

    /// The box up to the neighbours, which holds all that is beside the node's edges.
    fn bounds(&self) -> Aabb {
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
    fn cells_to(&self, point: DVec3) -> f64 {
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
pub(super) fn grown(edges: &Edges, region: &Aabb) -> Aabb {
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

impl Scene<'_> {
    /// What an edge of a conductor near a node makes of it. `conductors` are those that hold nodes.
    fn at_wedge(&self, node: usize, conductors: &[u16]) -> AtWedge {
        let Edges::Lattice(lattice) = self.mesh.edges else { return AtWedge::NONE };
        if conductors[node] != NO_OBJECT {
            return AtWedge::NONE;
        }
        let star = Star { lattice, node, place: lattice.node_place(node) };
        let linked = if self.mesh.terminals[node] == FREE { self.linked(&star, conductors) } else { None };
        let at = linked.unwrap_or(AtWedge::NONE);
        let is_beside = !at.is_all && self.has_edges_in(&star.bounds());
        AtWedge { is_beside, ..at }
    }

    /// The link of a node that is near an edge of a conductor.
    fn linked(&self, star: &Star<'_>, conductors: &[u16]) -> Option<AtWedge> {
        let (object, angle, share) = self.nearest_edge(star)?;
        let (_, length) = star.neighbour(CARRIER, true).filter(|_| self.is_homogeneous(star))?;
        let area = star.width((CARRIER + 1) % 3) * star.width((CARRIER + 2) % 3);
        let link = share * self.link(star, object, &angle, conductors) * length / area;
        let is_all = share >= 1.0 && angle.thickness >= star.longest();
        Some(AtWedge { object: object as u16, share: share as f32, link, is_all, is_beside: false })
    }

    /// The edge of a conductor that is nearest to a node, and its share in the node's links.
    fn nearest_edge(&self, star: &Star<'_>) -> Option<(usize, RightAngle, f64)> {
        let point = self.mesh.nodes[star.node];
        let is_alone = self.bounds.len() == 1;
        let mut found = None;
        let mut share = 1.0_f64;
        for (object, bounds) in self.bounds.iter().enumerate() {
            let cells = if is_alone { 0.0 } else { star.cells_to(point.clamp(bounds.min, bounds.max)) };
            if cells >= FAR {
                continue;
            }
            let near = (found.is_none() && self.is_conductor(object))
                .then(|| self.surfaces.right_angle_near(object, point))
                .flatten()
                .map(|angle| (object, angle, share_of(star, &angle)));
            match near {
                Some((.., own)) if own > 0.0 => (found, share) = (near, share.min(own)),
                _ => share = share.min(((cells - NEAR) / (FAR - NEAR)).max(0.0)),
            }
        }
        found.filter(|_| share > 0.0).map(|(object, angle, _)| (object, angle, share))
    }

    /// Whether the background is the same all around a node.
    fn is_homogeneous(&self, star: &Star<'_>) -> bool {
        let mut all = None;
        let mut is_homogeneous = true;
        for axis in 0..3 {
            for upwards in [false, true] {
                if let Some((neighbour, _)) = star.neighbour(axis, upwards) {
                    let edge = 3 * star.node.min(neighbour) + axis;
                    let permittivity = self.mesh.permittivity.at(edge);
                    is_homogeneous &= *all.get_or_insert(permittivity) == permittivity;
                }
            }
        }
        is_homogeneous
    }

    /// Σ w (u(Q) - u(P)) / u(P), for weights that are areas over distances.
    fn link(&self, star: &Star<'_>, object: usize, angle: &RightAngle, conductors: &[u16]) -> f64 {
        let point = self.mesh.nodes[star.node];
        let own = angle.coordinates(point);
        let steps = [angle.normals[0], angle.normals[1], angle.along()];
        let widths = [star.width(0), star.width(1), star.width(2)];
        let mut places = Places::default();
        let mut weights = [0.0; POINTS];
        places.set(0, own);
        for neighbour in 1..POINTS - 1 {
            let (axis, upwards) = ((neighbour - 1) / 2, neighbour % 2 == 0);
            let Some((node, distance)) = star.neighbour(axis, upwards) else { continue };
            let step = if upwards { distance } else { -distance };
            for (of, along) in steps.iter().enumerate() {
                places.0[of][neighbour] = own[of] + step * along[axis];
            }
            let is_seen = places.see_each_other(0, neighbour)
                || self.surfaces.span(object, point, self.mesh.nodes[node]).is_none();
            if is_seen && usize::from(conductors[node]) != object {
                weights[neighbour] = widths[(axis + 1) % 3] * widths[(axis + 2) % 3] / distance;
            }
        }
        let potentials = places.potentials(angle.radius);
        let (mut sum, mut of_weights, mut highest) = (0.0, 0.0, potentials[0]);
        for (weight, potential) in weights.into_iter().zip(potentials) {
            sum += weight * potential;
            of_weights += weight;
            highest = f64::max(highest, potential);
        }
        sum / potentials[0].max(SMALLEST_PART * highest) - of_weights
    }

    /// Whether nothing but the edge itself and wedges at its ends matter for what is left of it.
    pub(super) fn is_between_wedges(ends: Option<[&AtWedge; 2]>, owners: [u16; 2]) -> bool {
        ends.is_some_and(|[a, b]| a.is_all_to(owners[0]) && b.is_all_to(owners[1]))
    }

    /// What is left of an edge of the lattice if nodes near edges of conductors are at its ends. `cut` is what surfaces on
    /// the edge make of it, `covered` what walls make of it as well.
    pub(super) fn between_wedges(
        &self,
        edge: usize,
        ends: [u32; 2],
        wedges: [&AtWedge; 2],
        owners: [u16; 2],
        cut: Coupling,
        covered: Coupling,
    ) -> Coupling {
        let is_free = owners == [NO_OBJECT; 2];
        let mut coupling = covered;
        if !is_free {
            // To a node in the conductor the edge itself is what others are linked by.
            coupling.through *= 1.0 - f64::from(wedges[0].share.max(wedges[1].share));
        }
        for end in 0..2 {
            let AtWedge { object, share, link, .. } = *wedges[end];
            coupling.factor[end] *= 1.0 - f64::from(share);
            if share > 0.0 {
                // The link was found for what surfaces on the edge make of it.
                if is_free && covered.through != cut.through {
                    let slope = self.slope_from(object, [ends[end], ends[1 - end]]);
                    coupling.factor[end] += f64::from(share) * (covered.through - cut.through) * slope;
                }
                if end == 0 && edge % 3 == CARRIER {
                    coupling.factor[end] += link;
                }
                coupling.object[end] = object;
            }
            if coupling.factor[end] == 0.0 {
                coupling.object[end] = NO_OBJECT;
            }
        }
        coupling
    }

    /// (u(Q) - u(P)) / u(P) for the field of a conductor's edge near a node P and its neighbour Q.
    fn slope_from(&self, object: u16, nodes: [u32; 2]) -> f64 {
        let [from, to] = nodes.map(|node| self.mesh.nodes[node as usize]);
        let Some(angle) = self.surfaces.right_angle_near(object.into(), from) else { return 0.0 };
        let mut places = Places::default();
        places.set(0, angle.coordinates(from));
        places.set(1, angle.coordinates(to));
        let [own, other, ..] = places.potentials(angle.radius);
        other / own.max(SMALLEST_PART * other) - 1.0
    }
}

/// How much of a node's links is what a right angle makes of them, if there is nothing else.
fn share_of(star: &Star<'_>, angle: &RightAngle) -> f64 {
    let part = ((FAR - star.cells_to(angle.place)) / (FAR - NEAR)).min(1.0);
    if part <= 0.0 {
        return 0.0;
    }
    let along = angle.along().abs();
    let cell = along.x * star.narrowest(0) + along.y * star.narrowest(1) + along.z * star.narrowest(2);
    let from_ends = (angle.inside / cell).clamp(0.0, 1.0);
    let is_straight = (angle.radius / cell - 1.0).clamp(0.0, 1.0);
    part * part * (3.0 - 2.0 * part) * from_ends * is_straight
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_4;

    #[test]
    fn the_potential_is_that_of_a_wedge() {
        let angle = RightAngle {
            place: DVec3::new(0.1, -0.2, 0.3),
            normals: [DVec3::X, DVec3::Z],
            inside: 1.0,
            radius: f64::INFINITY,
            thickness: 1.0,
        };
        for step in 0..=60 {
            // From the face across x, around the edge, to the face across z.
            let theta = 6.0 * FRAC_PI_4 * f64::from(step) / 60.0;
            for r in [1e-6, 0.02, 3.0_f64] {
                let (sine, cosine) = theta.sin_cos();
                let mut places = Places::default();
                places.set(0, angle.coordinates(angle.place + r * DVec3::new(sine, 5.0, -cosine)));
                places.set(1, angle.coordinates(angle.place - DVec3::new(r, 0.0, 0.5 * r)));
                let [found, within, at_edge, ..] = places.potentials(angle.radius);
                let expected = r.powf(2.0 / 3.0) * (2.0 / 3.0 * theta).sin();
                assert!(
                    (found - expected).abs() < 2e-7 * r.powf(2.0 / 3.0),
                    "{theta} {r}: {found} {expected}"
                );
                assert_eq!([within, at_edge], [0.0; 2]);
            }
        }
    }

    #[test]
    fn cube_roots_have_nine_digits() {
        for power in -60..60 {
            for part in 0..20 {
                let x = 2.0_f64.powi(power) * (1.0 + 0.05 * f64::from(part));
                let root = better_cube_root(x, about_cube_root(x));
                assert!((root / x.cbrt() - 1.0).abs() < 1e-9, "{x}");
            }
        }
    }

    #[test]
    fn cells_are_counted_in_parts() {
        let planes = [0.0, 1.0, 3.0, 7.0];
        let places =
            [(1, 2.0), (1, 5.0), (1, 0.25), (1, -0.5), (3, 2.0), (0, 2.0), (0, 0.0), (0, -0.25), (3, 20.0)];
        let cells = places.map(|(index, coordinate)| cells_to(&planes, index, coordinate));
        assert_eq!(cells, [0.5, 1.5, 0.75, 1.5, 1.5, 1.5, 0.0, 0.25, 2.0]);
    }
}
