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
pub(super) const FAR: usize = 2;

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
}

impl RightAngle {
    /// r^(2/3) sin(2θ/3) at a point, θ from one face to the other; zero in the object.
    fn potential(&self, point: DVec3) -> f64 {
        let from = point - self.place;
        let along = self.normals[0].cross(self.normals[1]).dot(from);
        let [p, q] =
            [self.normals[0].dot(from) + 0.5 * along * along / self.radius, self.normals[1].dot(from)];
        if p <= 0.0 && q <= 0.0 {
            return 0.0;
        }
        let squared = p * p + q * q;
        // From the bisector outside, angles are φ = θ - 3π/4.
        let cosine = std::f64::consts::FRAC_1_SQRT_2 * (p + q) / squared.sqrt();
        let third = cosine_of_third(cosine);
        squared.cbrt() * (2.0 * third * third - 1.0)
    }
}

/// cos(φ/3) from cos φ, for |φ| up to 3π/4, by Newton's method on 4c³ - 3c = cos φ.
fn cosine_of_third(cosine: f64) -> f64 {
    // The parabola through the values at 0, π/2 and 3π/4.
    let mut c = 0.8660 + cosine * (0.1871 - 0.0531 * cosine);
    for _ in 0..2 {
        let squared = c * c;
        c -= (c * (4.0 * squared - 3.0) - cosine) / (12.0 * squared - 3.0);
    }
    c
}

/// What a node near an edge of a conductor makes of its edges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct AtWedge {
    /// The conductor, or [`NO_OBJECT`].
    object: u16,
    /// How much of the node's links to conductors is what the wedge makes of them.
    share: f32,
    /// That share, as a factor of the weight of the node's edge along the first axis.
    link: f64,
}

impl AtWedge {
    pub(super) const NONE: Self = Self { object: NO_OBJECT, share: 0.0, link: 0.0 };

    /// Whether the edge rule has no share in what an end of an edge is linked to.
    fn is_all(&self, owner: u16) -> bool {
        self.share >= 1.0 || owner != NO_OBJECT
    }

    fn is(&self, other: &Self) -> bool {
        let bits = |at: &Self| (at.object, at.share.to_bits(), at.link.to_bits());
        bits(self) == bits(other)
    }
}

/// What all nodes make of edges of conductors.
#[derive(Clone, Debug, Default)]
pub(super) struct Wedges {
    /// Empty before the first exact surface.
    at: Vec<AtWedge>,
    /// The frame in which each node was last looked at; regions overlap.
    seen: Vec<u8>,
    /// Nodes of which it changed.
    changed: Vec<u32>,
}

impl Wedges {
    /// Looks at the nodes near some regions, outside of which nothing changed. `conductors` are those that hold nodes.
    pub(super) fn update(&mut self, scene: &Scene<'_>, regions: &[Aabb], conductors: &[u16], frame: u8) {
        self.changed.clear();
        if self.at.is_empty() && scene.has_silhouettes {
            self.at.resize(conductors.len(), AtWedge::NONE);
            self.seen.resize(conductors.len(), 0);
        }
        if self.at.is_empty() {
            return;
        }
        let Self { at, seen, changed } = self;
        for region in regions {
            let near = grown(scene.mesh.edges, region);
            scene.mesh.edges.for_nodes_near(scene.mesh.nodes, &near, |node| {
                if std::mem::replace(&mut seen[node], frame) != frame {
                    let now = scene.at_wedge(node, conductors);
                    if !std::mem::replace(&mut at[node], now).is(&now) {
                        changed.push(node as u32);
                    }
                }
            });
        }
    }

    /// After 255 frames, numbers come again.
    pub(super) fn forget_frames(&mut self) {
        self.seen.fill(0);
    }

    /// Nodes of which the last update changed what they make of edges.
    pub(super) fn changed(&self) -> &[u32] {
        &self.changed
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
    for cells in 0..FAR {
        let next = if upwards { at + 1 } else { at.wrapping_sub(1) };
        let plane = planes.get(next).copied().unwrap_or_else(|| {
            let last = if upwards { at - 1 } else { at + 1 };
            2.0 * planes[at] - planes[last]
        });
        let part = (coordinate - planes[at]) / (plane - planes[at]);
        if part <= 1.0 || next >= planes.len() {
            return (cells as f64 + part).min(FAR as f64);
        }
        at = next;
    }
    FAR as f64
}

/// A region with all that is less than [`FAR`] cells away.
pub(super) fn grown(edges: &Edges, region: &Aabb) -> Aabb {
    let Edges::Lattice(lattice) = edges else { return *region };
    let mut grown = *region;
    for (axis, planes) in lattice.axes().iter().enumerate() {
        let first = planes.partition_point(|&plane| plane < region.min[axis]).saturating_sub(FAR);
        let last = planes.partition_point(|&plane| plane <= region.max[axis]) + FAR;
        grown.min[axis] = planes[first].min(region.min[axis]);
        grown.max[axis] = planes[last.min(planes.len()) - 1].max(region.max[axis]);
    }
    grown
}

impl Scene<'_> {
    /// What an edge of a conductor near a node makes of it. `conductors` are those that hold nodes.
    fn at_wedge(&self, node: usize, conductors: &[u16]) -> AtWedge {
        let Edges::Lattice(lattice) = self.mesh.edges else { return AtWedge::NONE };
        if self.mesh.terminals[node] != FREE || conductors[node] != NO_OBJECT {
            return AtWedge::NONE;
        }
        let star = Star { lattice, node, place: lattice.node_place(node) };
        let Some((object, angle, share)) = self.nearest_edge(&star) else { return AtWedge::NONE };
        let (Some((_, first)), true) = (star.neighbour(0, true), self.is_homogeneous(&star)) else {
            return AtWedge::NONE;
        };
        let link =
            share * self.link(&star, object, &angle, conductors) * first / star.width(1) / star.width(2);
        AtWedge { object: object as u16, share: share as f32, link }
    }

    /// The edge of a conductor that is nearest to a node, and its share in the node's links.
    fn nearest_edge(&self, star: &Star<'_>) -> Option<(usize, RightAngle, f64)> {
        let point = self.mesh.nodes[star.node];
        let mut found = None;
        let mut share = 1.0_f64;
        for (object, bounds) in self.bounds.iter().enumerate() {
            let cells = star.cells_to(point.clamp(bounds.min, bounds.max));
            if cells >= FAR as f64 {
                continue;
            }
            if found.is_none() && self.is_conductor(object) {
                let near = self.surfaces.right_angle_near(object, point);
                found = near
                    .map(|angle| (object, angle, share_of(star, &angle)))
                    .filter(|&(_, _, own)| own > 0.0);
                if let Some((_, _, own)) = found {
                    share = share.min(own);
                    continue;
                }
            }
            share = share.min((cells - NEAR).max(0.0));
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
        let own = angle.potential(point);
        let widths = [star.width(0), star.width(1), star.width(2)];
        let (mut sum, mut of_weights, mut highest) = (0.0, 0.0, own);
        for axis in 0..3 {
            let area = widths[(axis + 1) % 3] * widths[(axis + 2) % 3];
            for upwards in [false, true] {
                let Some((neighbour, distance)) = star.neighbour(axis, upwards) else { continue };
                let to = self.mesh.nodes[neighbour];
                let is_cut = usize::from(conductors[neighbour]) == object
                    || self.surfaces.span(object, point, to).is_some();
                if !is_cut {
                    let (weight, potential) = (area / distance, angle.potential(to));
                    sum += weight * potential;
                    of_weights += weight;
                    highest = highest.max(potential);
                }
            }
        }
        sum / own.max(SMALLEST_PART * highest) - of_weights
    }

    /// Whether nothing but the edge itself and wedges at its ends matter for what is left of it.
    pub(super) fn is_between_wedges(ends: Option<[&AtWedge; 2]>, owners: [u16; 2]) -> bool {
        ends.is_some_and(|[a, b]| a.is_all(owners[0]) && b.is_all(owners[1]))
    }

    /// What is left of an edge of the lattice if nodes near edges of conductors are at its ends. `cut` is what surfaces on
    /// the edge make of it, `covered` what walls make of it as well.
    pub(super) fn between_wedges(
        ends: [&AtWedge; 2],
        axis: usize,
        owners: [u16; 2],
        cut: Coupling,
        covered: Coupling,
    ) -> Coupling {
        let shares = [0, 1].map(|end: usize| f64::from(ends[end].share));
        let share = shares[0].max(shares[1]);
        let through = if owners == [NO_OBJECT; 2] {
            share * cut.through + (1.0 - share) * covered.through
        } else {
            (1.0 - share) * covered.through
        };
        let mut coupling = Coupling { through, ..covered };
        for end in 0..2 {
            coupling.factor[end] *= 1.0 - shares[end];
            if coupling.factor[end] == 0.0 {
                coupling.object[end] = NO_OBJECT;
            }
        }
        if axis == 0 && ends[0].link != 0.0 {
            coupling.object[0] = ends[0].object;
            coupling.factor[0] += ends[0].link;
        }
        coupling
    }
}

/// How much of a node's links is what a right angle makes of them, if there is nothing else.
fn share_of(star: &Star<'_>, angle: &RightAngle) -> f64 {
    let along = angle.normals[0].cross(angle.normals[1]).abs();
    let narrowest = |axis: usize| {
        let way = |upwards| star.neighbour(axis, upwards).map_or(f64::INFINITY, |(_, way)| way);
        way(false).min(way(true))
    };
    let cell = along.x * narrowest(0) + along.y * narrowest(1) + along.z * narrowest(2);
    let from_ends = (angle.inside / cell).clamp(0.0, 1.0);
    let is_straight = (angle.radius / cell - 1.0).clamp(0.0, 1.0);
    let part = ((FAR as f64 - star.cells_to(angle.place)) / (FAR as f64 - NEAR)).clamp(0.0, 1.0);
    part * part * (3.0 - 2.0 * part) * from_ends * is_straight
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_4, SQRT_2};

    #[test]
    fn the_potential_is_that_of_a_wedge() {
        let angle = RightAngle {
            place: DVec3::new(0.1, -0.2, 0.3),
            normals: [DVec3::X, DVec3::Z],
            inside: 1.0,
            radius: f64::INFINITY,
        };
        for step in 0..=60 {
            // From the face across x, around the edge, to the face across z.
            let theta = 6.0 * FRAC_PI_4 * f64::from(step) / 60.0;
            for r in [1e-6, 0.02, 3.0_f64] {
                let (sine, cosine) = theta.sin_cos();
                let point = angle.place + r * DVec3::new(sine, 5.0, -cosine);
                let expected = r.powf(2.0 / 3.0) * (2.0 / 3.0 * theta).sin();
                let found = angle.potential(point);
                assert!(
                    (found - expected).abs() < 1e-9 * r.powf(2.0 / 3.0),
                    "{theta} {r}: {found} {expected}"
                );
            }
        }
        assert_eq!(angle.potential(angle.place - DVec3::new(SQRT_2, 0.0, 0.5)), 0.0);
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
