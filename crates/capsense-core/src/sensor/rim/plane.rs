//! The nodes of a mesh in the plane of a thin electrode, near its outline.
//!
//! With edges that weigh w and lead along e, Σ w (e·n)² = 2V around a node of dual volume V, whatever the unit vector n in
//! the plane, and Σ w |e·n| is what flows through the dual cell's surface in a field along n. Their ratio is the distance
//! between rows of nodes as flux counts it: on a lattice of cells a and b long exactly 1/(|n_x|/a + |n_y|/b). A node's
//! length along the rim is its area over that.

use super::place::{Place, Places};
use crate::electrode::Electrode;
use crate::mesh::{EdgeShare, TetMesh};
use glam::{DVec2, DVec3};
use std::collections::{BTreeMap, BTreeSet};

/// How many edges from one that the outline cuts a node may be that the rim makes neither held nor free.
const RINGS: usize = 4;

/// Nodes closer to the outline than this part of an edge lie on it.
const ON_OUTLINE: f64 = 1e-6;

/// A node of the plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlaneNode {
    pub(super) place: Place,
    /// Distance between rows of nodes along the rim, metres.
    pub(super) rows: f64,
    /// A third of the triangles at the node times the mean relative permittivity of both sides; half of that where
    /// there are elements on one side only, as the link carries the field of one side.
    pub(super) dielectric_area: f64,
    /// How much of a convex corner lies at the node, from 0 to 1.
    pub(super) corner: f64,
}

/// A plane that the mesh has triangles in, as an electrode's outline sees it.
#[derive(Clone, Debug, Default)]
pub(super) struct Plane {
    /// Nodes far inside.
    pub(super) held: Vec<u32>,
    /// Nodes near the outline.
    pub(super) near: BTreeMap<u32, PlaneNode>,
    /// Nodes of edges that the outline cuts.
    pub(super) cut: BTreeSet<u32>,
}

/// A triangle in the plane, and which element it belongs to.
struct Face {
    nodes: [u32; 3],
    element: usize,
}

impl Plane {
    /// `flat` is how far from the electrode's plane a node may lie. None where the outline cuts no edges, or none but
    /// those that end on it.
    pub(super) fn of(mesh: &TetMesh, electrode: &Electrode, places: &Places<'_>, flat: f64) -> Option<Self> {
        let nodes = mesh.nodes();
        let in_plane: Vec<bool> = nodes.iter().map(|node| (node.z - electrode.z).abs() <= flat).collect();
        let mut faces = faces_in_plane(mesh, &in_plane);
        let inside: BTreeSet<u32> = (0..)
            .zip(nodes)
            .filter(|(_, node)| electrode.owns(**node, flat))
            .map(|(index, _)| index)
            .collect();
        let cut = cut_nodes(&faces, &inside);
        let near = grown(&faces, &cut);
        let held = inside.difference(&near).copied().collect();
        faces.retain(|face| face.nodes.iter().any(|node| near.contains(node)));
        let edges = edges_in_plane(mesh, &in_plane, &near);
        let areas = dielectric_areas(mesh, &faces);
        let corners = at_corners(mesh, &faces, places);
        let mut plane = Self { held, near: BTreeMap::new(), cut };
        let mut follows = true;
        for (node, edges) in edges {
            let longest = edges.iter().map(|(step, _)| step.length()).fold(0.0, f64::max);
            let place = places.at(nodes[node as usize].truncate(), ON_OUTLINE * longest);
            let dielectric_area = areas.get(&node).copied().unwrap_or(0.0);
            let rows = rows(&edges, place.normal).unwrap_or(longest);
            let corner = corners.get(&node).copied().unwrap_or(0.0);
            plane.near.insert(node, PlaneNode { place, rows, dielectric_area, corner });
            follows &= !(inside.contains(&node) && plane.cut.contains(&node)) || place.distance == 0.0;
        }
        (!follows).then_some(plane)
    }

    /// A node's share of the area of a triangle on one side of the plane.
    pub(super) fn share_of_face([a, b, c]: [DVec3; 3]) -> f64 {
        (b - a).cross(c - a).length() / 12.0
    }

    /// Distance between rows of nodes at the outline, on average.
    pub(super) fn mean_rows(&self) -> Option<f64> {
        let at_cut = self.cut.iter().filter_map(|node| self.near.get(node));
        let (sum, count) = at_cut.fold((0.0, 0.0), |(sum, count), node| (sum + node.rows, count + 1.0));
        (count > 0.0).then(|| sum / count)
    }
}

fn dielectric_areas(mesh: &TetMesh, faces: &[Face]) -> BTreeMap<u32, f64> {
    let mut areas = BTreeMap::new();
    for face in faces {
        let share = Plane::share_of_face(face.nodes.map(|node| mesh.nodes()[node as usize]));
        for node in face.nodes {
            *areas.entry(node).or_insert(0.0) += share * mesh.relative_permittivity().at(face.element);
        }
    }
    areas
}

fn faces_in_plane(mesh: &TetMesh, in_plane: &[bool]) -> Vec<Face> {
    let mut faces = Vec::new();
    for (element, tet) in mesh.tets().iter().enumerate() {
        for skipped in 0..4 {
            let nodes = [1, 2, 3].map(|k| tet[(skipped + k) % 4]);
            if nodes.iter().all(|&node| in_plane[node as usize]) {
                faces.push(Face { nodes, element });
            }
        }
    }
    faces
}

fn cut_nodes(faces: &[Face], inside: &BTreeSet<u32>) -> BTreeSet<u32> {
    let mut cut = BTreeSet::new();
    for face in faces {
        let is_inside = face.nodes.map(|node| inside.contains(&node));
        if is_inside.contains(&true) && is_inside.contains(&false) {
            cut.extend(face.nodes);
        }
    }
    cut
}

/// Some nodes and all that are few edges in the plane from them.
fn grown(faces: &[Face], nodes: &BTreeSet<u32>) -> BTreeSet<u32> {
    let mut near = nodes.clone();
    for _ in 0..RINGS {
        let beside = faces.iter().filter(|face| face.nodes.iter().any(|node| near.contains(node)));
        let more: Vec<u32> = beside.flat_map(|face| face.nodes).collect();
        near.extend(more);
    }
    near
}

/// The edges in the plane at some nodes: where they lead, and what they weigh in vacuum.
fn edges_in_plane(
    mesh: &TetMesh,
    in_plane: &[bool],
    near: &BTreeSet<u32>,
) -> BTreeMap<u32, Vec<(DVec2, f64)>> {
    let mut weights: BTreeMap<[u32; 2], f64> = BTreeMap::new();
    for (element, tet) in mesh.tets().iter().enumerate() {
        if tet.iter().filter(|&&node| in_plane[node as usize]).count() < 2
            || !tet.iter().any(|n| near.contains(n))
        {
            continue;
        }
        for share in EdgeShare::of_element(mesh.corners(element)) {
            let [a, b] = share.corners.map(|corner| tet[corner]);
            if in_plane[a as usize] && in_plane[b as usize] {
                *weights.entry([a.min(b), a.max(b)]).or_default() += share.weight;
            }
        }
    }
    let mut edges: BTreeMap<u32, Vec<(DVec2, f64)>> = BTreeMap::new();
    for ([a, b], weight) in weights {
        let step = (mesh.nodes()[b as usize] - mesh.nodes()[a as usize]).truncate();
        for node in [a, b].into_iter().filter(|node| near.contains(node)) {
            edges.entry(node).or_default().push((step, weight));
        }
    }
    edges
}

/// Distance between rows; edges that carry nothing, as diagonals of Kuhn tetrahedra, or less do not count.
fn rows(edges: &[(DVec2, f64)], normal: DVec2) -> Option<f64> {
    let positive = edges.iter().filter(|(_, weight)| *weight > 0.0);
    let (squares, sum) = positive.fold((0.0, 0.0), |(squares, sum), (step, weight)| {
        let across = step.dot(normal).abs();
        (squares + weight * across * across, sum + weight * across)
    });
    let rows = squares / sum;
    (rows.is_finite() && rows > 0.0).then_some(rows)
}

/// How much of a corner lies at the nodes of the triangle around it: its barycentric coordinates.
fn at_corners(mesh: &TetMesh, faces: &[Face], places: &Places<'_>) -> BTreeMap<u32, f64> {
    let mut parts: BTreeMap<u32, f64> = BTreeMap::new();
    for face in faces {
        let [a, b, c] = face.nodes.map(|node| DVec3::truncate(mesh.nodes()[node as usize]));
        let double_area = (b - a).perp_dot(c - a);
        for corner in places.convex_corners() {
            let of = [
                (b - corner).perp_dot(c - corner),
                (c - corner).perp_dot(a - corner),
                (a - corner).perp_dot(b - corner),
            ];
            let of = of.map(|part| part / double_area);
            if of.iter().all(|part| *part >= -ON_OUTLINE) {
                for (node, part) in face.nodes.into_iter().zip(of) {
                    let known = parts.entry(node).or_default();
                    *known = known.max(part.clamp(0.0, 1.0));
                }
            }
        }
    }
    parts
}
