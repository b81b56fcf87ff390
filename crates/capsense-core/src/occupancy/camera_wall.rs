//! Edges of a lattice across a depth camera's rays past the wall of a body that conducts or polarises strongly, where its image ends
//! or jumps: one end's ray meets the body between the planes beside, the other's does not. Where surfaces slant or bend, the edge rule
//! by itself is of second order, and stays: a wall counts the less the more the faces that end there rise or fall behind it.
//!
//! The field along an edge is that of its dual face, up to half-way to the planes before and behind. The camera knows how much of
//! that the body fills: from its front to its back, where it is seen. To this part the edge ends at the wall, to the rest it is
//! what it is without. Were the edge alone to tell, all of the dual face would change at once when a face passes the plane of the
//! edge, and the capacitance with it.
//!
//! Where a face lies before or behind the plane, the end under it is free. What is filled of the dual face leads past the edge between face
//! and wall to the body, along the shortest way, and the less the nearer the wall is to that end in relation to the face. No edge of
//! the lattice leads there, so it goes by the end under the face: that has a share s of the other end's potential in the field around a
//! right angle, r^(2/3) sin(2θ/3), so a link g is g / (1 - s) between the ends, and a tap of g / s from there on, through the face,
//! beside what the edge along the rays is. In that field this is the same, and where fields differ a little from it the energy is of
//! second order. Nothing is asked of what holds the body, so strong dielectrics become floating conductors as their permittivity grows.
//!
//! What a part of the dual face that is not filled carries is between the other end and the space under the face. The potential
//! there is neither zero, as that of an end which the body holds, nor soon that of an end which it just released. So what it is half-way
//! to the face in that field, in relation to that at the other end, is taken from the link.
//!
//! At its own edges a body collects more than the part of a dual face that meets it would, so it is taken to reach further by
//! [`FRINGE`]. This is [`super::silhouette`] for who knows where surfaces are along one axis alone.

use super::coupling::SMALLEST_PART;
use super::near_field::Places;
use super::parallel::{is_weak, up_to_planes};
use super::{Coupling, EdgeGeometry, NO_OBJECT, Scene, Span, Surfaces};
use crate::geometry::Aabb;
use crate::material::Material;
use crate::mesh::{Edges, Lattice};
use crate::sensor::FREE;
use glam::DVec3;

/// Cameras look along this axis.
const RAYS: usize = 2;

/// How much further than it does a body is taken to reach along the rays, in parts of the longer one of the edge and of the
/// height of its dual face; no more than half of that. `tests/fringe.rs` tells what it is to the field around a right angle. In the mean
/// over all places in a cell more would be right, but with more, responses to narrow bodies have more and larger kinks.
const FRINGE: f64 = 0.2;

/// A face that rises or falls by this much, or more, from the pixel at a wall to the next one slants: there is no wall. With half of
/// it the wall counts in full.
const STEEPEST: f64 = 0.15;

/// No more of the other end's potential is at the end under a face.
const LARGEST_SHARE: f64 = 0.9;

/// Whether the rule is of use.
pub(super) fn is_of_use(edges: &Edges, materials: &[Material], surfaces: &dyn Surfaces) -> bool {
    let are_strong = materials.iter().any(|material| !is_weak(material));
    surfaces.has_layers() && matches!(edges, Edges::Lattice(_)) && are_strong
}

/// Visits the edges across the rays whose dual faces touch a box, and perhaps others near it; some of them several times.
pub(super) fn for_dual_faces_near(mesh: &EdgeGeometry<'_>, region: &Aabb, mut visit: impl FnMut(usize)) {
    let around = up_to_planes(mesh.edges, region, RAYS..RAYS + 1);
    mesh.edges.for_edges_near(mesh.nodes, &around, |edge, _| {
        if edge % 3 != RAYS {
            visit(edge);
        }
    });
}

/// How far the dual face of an edge reaches along the rays: half-way to the planes beside its own.
struct DualFace {
    plane: f64,
    planes: [f64; 2],
    ends: [f64; 2],
}

/// Where a body is along the ray through one end of an edge, from its front to its back, between the planes beside.
struct Layer {
    object: usize,
    end: usize,
    faces: [f64; 2],
}

/// How far the wall of a body is from the end of an edge outside of it, and from that behind it, in metres.
struct Wall {
    outside: f64,
    behind: f64,
    /// How much of the edge it counts for.
    abruptness: f64,
}

/// What a wall leaves of an edge.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Past {
    /// What multiplies the edge's weight.
    through: f64,
    /// What is added, in parts of that weight, between the end under a face and the body.
    tap: f64,
    /// How much of both counts.
    abruptness: f64,
}

impl Wall {
    fn length(&self) -> f64 {
        self.outside + self.behind
    }
}

impl DualFace {
    /// That of edges in a plane of the lattice.
    fn at(lattice: &Lattice, number: usize) -> Self {
        let all = &lattice.axes()[RAYS];
        let plane = all[number];
        let planes = [number.saturating_sub(1), (number + 1).min(all.len() - 1)].map(|beside| all[beside]);
        Self { plane, planes, ends: planes.map(|beside| 0.5 * (plane + beside)) }
    }

    fn height(&self) -> f64 {
        self.ends[1] - self.ends[0]
    }

    /// What there is of a layer between the planes beside.
    fn clipped(&self, [front, back]: [f64; 2]) -> Option<[f64; 2]> {
        let faces = [front.max(self.planes[0]), back.min(self.planes[1])];
        (faces[0] < faces[1]).then_some(faces)
    }

    /// How far the plane is before the nearer one of two faces, or behind it; zero between them.
    fn distance_to(&self, faces: [f64; 2]) -> f64 {
        (faces[0] - self.plane).max(self.plane - faces[1]).max(0.0)
    }

    /// Whether a body with these faces ends on both sides before the planes beside.
    fn is_around(&self, faces: [f64; 2]) -> bool {
        faces[0] > self.planes[0] && faces[1] < self.planes[1]
    }

    /// The part of the dual face that a body with these faces is taken to fill.
    fn part_filled(&self, faces: [f64; 2], length: f64) -> f64 {
        let fringe = FRINGE * length.max(self.height());
        let low = faces[0] - fringe.min(self.plane - self.ends[0]);
        let high = faces[1] + fringe.min(self.ends[1] - self.plane);
        (high.min(self.ends[1]) - low.max(self.ends[0])).max(0.0) / self.height()
    }

    /// The part of the link past a wall that is less because of the potential under the faces.
    fn part_under(&self, faces: [f64; 2], wall: &Wall) -> f64 {
        let under = |side: usize, forwards: f64| {
            let depth = forwards * (faces[side] - self.ends[side]);
            if depth <= 0.0 {
                return 0.0;
            }
            let plane = forwards * (faces[side] - self.plane);
            let mut places = Places::<4>::ORIGIN;
            places.set(0, [wall.outside, plane, 0.0]);
            places.set(1, [-wall.behind, 0.5 * depth, 0.0]);
            places.set(2, [-wall.behind, plane, 0.0]);
            let [outside, half_way, behind, _] = places.potentials(f64::INFINITY);
            let more = (half_way - behind).clamp(0.0, outside.max(0.0));
            depth / self.height() * more / outside.max(f64::MIN_POSITIVE)
        };
        under(0, 1.0) + under(1, -1.0)
    }

    /// What the wall of a body with these faces leaves of an edge. `contrast` is one for a conductor, and zero for what is as the
    /// background.
    fn past(&self, wall: &Wall, faces: [f64; 2], contrast: f64) -> Past {
        let distance = self.distance_to(faces);
        let near = wall.behind * wall.behind / (wall.behind * wall.behind + distance * distance);
        let part = self.part_filled(faces, wall.length());
        let way = wall.outside.hypot(distance) / wall.length();
        let under = contrast * self.part_under(faces, wall);
        let link = (near * (part / (1.0 - contrast + contrast * way) - under)).max(0.0);
        let (through, abruptness) = (1.0 - near * part + link, wall.abruptness);
        if distance == 0.0 {
            return Past { through, tap: 0.0, abruptness };
        }
        let share = share_under(wall, distance.max(SMALLEST_PART * wall.length()));
        let tap = contrast * link / share;
        Past { through: through + contrast * link * share / (1.0 - share), tap, abruptness }
    }
}

/// The potential so far under a face behind a wall, in parts of that as far under it before the wall, around a right angle.
fn share_under(wall: &Wall, distance: f64) -> f64 {
    let mut places = Places::<4>::ORIGIN;
    places.set(0, [wall.outside, distance, 0.0]);
    places.set(1, [-wall.behind, distance, 0.0]);
    let [outside, behind, _, _] = places.potentials(f64::INFINITY);
    (behind / outside).clamp(SMALLEST_PART, LARGEST_SHARE)
}

/// Whether a conductor is known to be between the planes beside an edge along the rays through both of its ends: it holds both nodes
/// there in the edge's own plane or in the same one of those beside.
fn is_within(lattice: &Lattice, ends: [u32; 2], held: &[u16]) -> bool {
    let stride = lattice.strides()[RAYS];
    let holder = |node: Option<usize>| node.and_then(|node| held.get(node)).copied().unwrap_or(NO_OBJECT);
    let are_same = |[first, second]: [u16; 2]| first != NO_OBJECT && first == second;
    let nodes = ends.map(|node| node as usize);
    are_same(nodes.map(|node| holder(Some(node))))
        || are_same(nodes.map(|node| holder(node.checked_sub(stride))))
        || are_same(nodes.map(|node| holder(Some(node + stride))))
}

impl Scene<'_> {
    /// Visits the edges that may be others than before although on themselves nothing is, where something is on the dual face of an
    /// edge across the rays. `held` tells the conductors that hold nodes.
    pub(super) fn for_edges_at_walls(
        &self,
        edge: usize,
        held: &[u16],
        couplings: &[Coupling],
        mut visit: impl FnMut(usize),
    ) {
        let Edges::Lattice(lattice) = self.mesh.edges else { return };
        let ends = self.mesh.edges.ends_of_existing(edge);
        let is_cut = |edge: usize| couplings[edge] != Coupling::PLAIN;
        let is_past = is_cut(edge)
            || !is_within(lattice, ends, held)
                && self.has_camera_walls
                && self.only_layer(&self.dual_face(lattice, ends[0]), ends).is_some();
        if is_past {
            visit(edge);
            let stride = lattice.strides()[RAYS];
            let starts =
                ends.into_iter().flat_map(|end| [Some(end as usize), (end as usize).checked_sub(stride)]);
            starts.flatten().map(|start| 3 * start + RAYS).filter(|&along| is_cut(along)).for_each(visit);
        }
    }

    /// Corrects what the edge rule makes of an edge for walls of a body that are along the rays: beside an edge across these, and around
    /// an end of one along them. `on_edge` are the spans of the edge, `held` tells the conductors that hold nodes. Where other objects
    /// are as well, the edge rule stays.
    pub(super) fn at_camera_wall(
        &self,
        (edge, ends): (usize, [u32; 2]),
        held: &[u16],
        on_edge: &[(u16, Span)],
        cut: Coupling,
    ) -> Coupling {
        let Edges::Lattice(lattice) = self.mesh.edges else { return cut };
        match (edge % 3 == RAYS, on_edge) {
            (false, _) if is_within(lattice, ends, held) => cut,
            (true, &[(object, span)]) => {
                self.under_walls(lattice, (edge, ends), held, (object.into(), span), cut)
            }
            (true, _) => cut,
            (false, _) => self.past_wall(lattice, (edge, ends), on_edge, cut),
        }
    }

    /// An edge across the rays.
    fn past_wall(
        &self,
        lattice: &Lattice,
        (edge, ends): (usize, [u32; 2]),
        on_edge: &[(u16, Span)],
        cut: Coupling,
    ) -> Coupling {
        let face = self.dual_face(lattice, ends[0]);
        let Some(layer) = self.only_layer(&face, ends) else { return cut };
        // Where the end is under a face, but the body is on the edge, surfaces slant.
        let is_alone = if face.distance_to(layer.faces) > 0.0 {
            on_edge.is_empty()
        } else {
            on_edge.iter().all(|&(other, _)| usize::from(other) == layer.object)
        };
        // An electrode in the body is linked to it as before.
        if !is_alone || self.mesh.terminals[ends[layer.end] as usize] != FREE {
            return cut;
        }
        let Some(past) = self.past(edge, &face, &layer, ends) else { return cut };
        Coupling::only_through(cut.through + past.abruptness * (past.through - cut.through))
    }

    /// An edge along the rays through the face of a body, and perhaps through that behind it: taps of edges past walls beside its ends
    /// are beside what is left of it.
    fn under_walls(
        &self,
        lattice: &Lattice,
        (edge, ends): (usize, [u32; 2]),
        held: &[u16],
        (object, span): (usize, Span),
        cut: Coupling,
    ) -> Coupling {
        let mut coupling = cut;
        let mut shorter = 0.0;
        for (end, gap) in [span.enter, 1.0 - span.exit].into_iter().enumerate() {
            let [node, behind] = [ends[end] as usize, ends[1 - end] as usize];
            if gap <= 0.0 || held[node] != NO_OBJECT || self.mesh.terminals[node] != FREE {
                continue;
            }
            let gap = if self.is_conductor(object) { gap.max(SMALLEST_PART) } else { gap };
            let more = gap * self.taps(lattice, edge, [node, behind], held, object);
            if usize::from(cut.object[end]) == object {
                coupling.factor[end] *= 1.0 + more;
            } else {
                shorter += gap * more / (1.0 + more);
            }
        }
        if shorter > 0.0 && shorter * cut.through < 1.0 {
            coupling.through = cut.through / (1.0 - shorter * cut.through);
        }
        coupling
    }

    /// The taps of the edges across the rays at a node under the face of an object, in parts of the weight of the edge that leads through
    /// the face.
    fn taps(
        &self,
        lattice: &Lattice,
        edge: usize,
        [node, behind]: [usize; 2],
        held: &[u16],
        object: usize,
    ) -> f64 {
        let face = self.dual_face(lattice, node as u32);
        let place = lattice.node_place(node);
        let height = (self.mesh.nodes[behind].z - self.mesh.nodes[node].z).abs();
        let permittivity = |edge| self.mesh.permittivity.at(edge);
        let mut sum = 0.0;
        for axis in 0..RAYS {
            let (planes, stride) = (&lattice.axes()[axis], lattice.strides()[axis]);
            let next = (place[axis] + 1).min(planes.len() - 1);
            let width = 0.5 * (planes[next] - planes[place[axis].saturating_sub(1)]);
            let below = (place[axis] > 0).then(|| [node - stride, behind.wrapping_sub(stride)]);
            let above = (next > place[axis]).then(|| [node + stride, behind + stride]);
            for [beside, beside_behind] in below.into_iter().chain(above) {
                // What reaches the next plane there is between the planes.
                if usize::from(held[beside_behind]) == object {
                    continue;
                }
                let (across, ends) = (3 * node.min(beside) + axis, [node as u32, beside as u32]);
                let layer =
                    self.only_layer(&face, ends).filter(|layer| (layer.object, layer.end) == (object, 0));
                let Some(past) = layer.and_then(|layer| self.past(across, &face, &layer, ends)) else {
                    continue;
                };
                let length = (planes[lattice.node_place(beside)[axis]] - planes[place[axis]]).abs();
                let weights =
                    permittivity(across) / permittivity(edge) * face.height() * height / (length * width);
                sum += past.abruptness * past.tap * weights;
            }
        }
        sum
    }

    fn dual_face(&self, lattice: &Lattice, node: u32) -> DualFace {
        DualFace::at(lattice, lattice.node_place(node as usize)[RAYS])
    }

    /// How much less field there is in an object than around an edge, in parts of the latter; `None` if it is weak, or has more.
    fn contrast(&self, object: usize, edge: usize) -> Option<f64> {
        match &self.materials[object] {
            Material::Conductor(_) => Some(1.0),
            material if is_weak(material) => None,
            Material::Dielectric(permittivity) => {
                Some(1.0 - self.mesh.permittivity.at(edge) / permittivity.value())
                    .filter(|&contrast| contrast > 0.0)
            }
        }
    }

    /// What is left of an edge whose one end's ray meets a body.
    fn past(&self, edge: usize, face: &DualFace, layer: &Layer, ends: [u32; 2]) -> Option<Past> {
        let &Layer { object, end, faces } = layer;
        let contrast = self.contrast(object, edge)?;
        // In a dielectric without nodes nothing is there for taps to lead to.
        if !self.is_conductor(object) && face.distance_to(faces) > 0.0 && face.is_around(faces) {
            return None;
        }
        let points = [ends[1 - end], ends[end]].map(|node| self.mesh.nodes[node as usize]);
        Some(face.past(&self.wall_between(object, face, faces, points)?, faces, contrast))
    }

    /// The object that is between the planes beside along the ray through one end of an edge alone, if it is the only one there.
    fn only_layer(&self, face: &DualFace, ends: [u32; 2]) -> Option<Layer> {
        let points = ends.map(|node| self.mesh.nodes[node as usize]);
        let [low, high] = face.planes;
        let around =
            Aabb { min: points[0].min(points[1]).with_z(low), max: points[0].max(points[1]).with_z(high) };
        let mut only = None;
        for object in (0..self.bounds.len()).filter(|&object| self.bounds[object].intersects(&around)) {
            let seen = points.map(|point| self.surfaces.layer_at(object, point));
            let (end, faces) = match seen.map(|faces| faces.and_then(|faces| face.clipped(faces))) {
                [None, None] => continue,
                [Some(faces), None] => (0, faces),
                [None, Some(faces)] => (1, faces),
                [Some(_), Some(_)] => return None,
            };
            let layer = Some(Layer { object, end, faces });
            if std::mem::replace(&mut only, layer).is_some() {
                return None;
            }
        }
        only
    }

    /// Where the wall is, half-way between the faces, from the first point to the second.
    fn wall_between(
        &self,
        object: usize,
        face: &DualFace,
        faces: [f64; 2],
        points: [DVec3; 2],
    ) -> Option<Wall> {
        let middle = 0.5 * (faces[0] + faces[1]);
        let [from, to] = points.map(|point| DVec3 { z: middle, ..point });
        let found = self.surfaces.wall_between(object, from, to, face.planes)?;
        let outside = found.enter.max(SMALLEST_PART);
        let abruptness = (2.0 - 2.0 / STEEPEST * found.slope).clamp(0.0, 1.0);
        // At the end behind it, rounding tells whether there is a wall.
        if outside > 1.0 - SMALLEST_PART || abruptness == 0.0 {
            return None;
        }
        let length = from.distance(to);
        Some(Wall { outside: outside * length, behind: (1.0 - outside) * length, abruptness })
    }
}
