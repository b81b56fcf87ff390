//! What lies beyond the outer wall of the simulated space: ground, or space without end.
//!
//! Far from all charges the potential is that of their sum, q/r, and of their dipole moment. On a sphere around them both
//! satisfy ∂φ/∂r = -φ/r + (r/2) Δ_s φ, with the Laplacian on the sphere: the condition of second order of Bayliss, Gunzburger
//! and Turkel (1982). Its energy, ∫ φ²/r + (r/2) |∇_s φ|², is that of links from the wall to ground and of edges along the wall.
//! So an open wall needs no more nodes, and K stays symmetric and positive definite.
//!
//! Walls are no spheres. With u = 1/r and the normal n, links weigh -∂u/∂n / u, edges what a sheet of the conductance r/2
//! would make of them, and each edge takes so much from the links at its ends that u satisfies all equations: what is left is
//! w u_i u_j (φ_i/u_i - φ_j/u_j)². Near the middle of large faces links may weigh slightly less than nothing.

use super::{FREE, GROUND, Terminal};
use crate::geometry::Aabb;
use crate::mesh::TetMesh;
use glam::DVec3;

/// Conductance along the wall in parts of r: with it dipoles pass as charges do.
const ALONG: f64 = 0.5;

/// What an edge weighs less than this part of its face's other edges is rounding, as along diagonals of rectangles.
const ROUNDING: f64 = 1e-9;

/// What lies beyond the outer wall of the simulated space.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wall {
    /// Ground: the wall is at 0 V.
    #[default]
    Grounded,
    /// Empty space without end. Its potential is taken for that of a charge and a dipole at the sensor.
    Open,
}

/// What stands for the space beyond an open wall.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct OpenWall {
    /// Nodes and the weights of their links to ground, in metres times relative permittivity, in increasing order.
    pub(crate) links: Vec<(u32, f64)>,
    /// In increasing order.
    pub(crate) edges: Vec<WallEdge>,
}

/// What an open wall adds to the network along one of its edges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct WallEdge {
    /// The lower first.
    pub(crate) ends: [u32; 2],
    /// What is added to the edge's weight.
    pub(crate) weight: f64,
    /// What is added to the links of its ends.
    pub(crate) links: [f64; 2],
}

/// A face of the wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct WallFace {
    /// In increasing order.
    nodes: [u32; 3],
    /// The corner of its tetrahedron that is not on it.
    within: u32,
    /// Relative permittivity of its tetrahedron.
    permittivity: f64,
}

/// The faces between nodes of the wall that belong to one tetrahedron only.
pub(super) fn outer_faces(mesh: &TetMesh, is_on_wall: &[bool]) -> Vec<WallFace> {
    let mut faces = Vec::new();
    for (element, tet) in mesh.tets().iter().enumerate() {
        for (corner, &within) in tet.iter().enumerate() {
            let mut nodes = [1, 2, 3].map(|step| tet[(corner + step) % 4]);
            if nodes.iter().all(|&node| is_on_wall[node as usize]) {
                nodes.sort_unstable();
                faces.push(WallFace {
                    nodes,
                    within,
                    permittivity: mesh.relative_permittivity().at(element),
                });
            }
        }
    }
    faces.sort_unstable_by_key(|face| (face.nodes, face.within));
    let alone = faces.chunk_by(|a, b| a.nodes == b.nodes).filter(|same| same.len() == 1);
    alone.map(|same| same[0]).collect()
}

/// Those of connected surfaces that reach the box around the mesh: not those around holes in it.
pub(super) fn reaching_out(mesh: &TetMesh, faces: Vec<WallFace>, slack: f64) -> Vec<WallFace> {
    let Aabb { min, max } = mesh.bounds();
    let on_box = |node: u32| {
        let place = mesh.nodes()[node as usize];
        (place - min).min_element() <= slack || (max - place).min_element() <= slack
    };
    let mut reached = vec![false; mesh.nodes().len()];
    let mut rest: Vec<WallFace> = Vec::new();
    let mut outer = Vec::new();
    let mut left = faces;
    // Each round goes over the faces once in either direction, so that few are needed.
    loop {
        let before = left.len();
        for _ in 0..2 {
            for face in left.drain(..).rev() {
                if face.nodes.iter().any(|&node| reached[node as usize] || on_box(node)) {
                    face.nodes.iter().for_each(|&node| reached[node as usize] = true);
                    outer.push(face);
                } else {
                    rest.push(face);
                }
            }
            std::mem::swap(&mut left, &mut rest);
        }
        if left.len() == before {
            outer.sort_unstable_by_key(|face| face.nodes);
            return outer;
        }
    }
}

/// Whether each node is on one of the faces.
pub(super) fn nodes_of(faces: &[WallFace], nodes: usize) -> Vec<bool> {
    let mut is_on_wall = vec![false; nodes];
    faces.iter().flat_map(|face| face.nodes).for_each(|node| is_on_wall[node as usize] = true);
    is_on_wall
}

impl OpenWall {
    /// Opens the wall around a sensor whose nodes are owned as given. All far fields are taken to come from the middle of its
    /// electrodes.
    pub(super) fn new(mesh: &TetMesh, owners: &[Terminal], faces: &[WallFace]) -> Self {
        let of_electrodes =
            owners.iter().zip(mesh.nodes()).filter(|(owner, _)| ![GROUND, FREE].contains(owner));
        let around = Aabb::around(of_electrodes.map(|(_, &place)| place));
        let middle = 0.5 * (around.min + around.max);
        let mut links = vec![0.0; mesh.nodes().len()];
        let mut edges = Vec::with_capacity(3 * faces.len());
        for face in faces {
            face.add(mesh.nodes(), middle, &mut links, &mut edges);
        }
        edges.sort_by_key(|edge| edge.ends);
        let is_on_wall = nodes_of(faces, mesh.nodes().len());
        let sum = |same: &[WallEdge]| {
            let weight = same.iter().map(|edge| edge.weight).sum::<f64>();
            let [a, b] = same[0].ends.map(|node| mesh.nodes()[node as usize].distance(middle));
            // u_i - u_j in parts of u_i, with u = 1/r.
            WallEdge { ends: same[0].ends, weight, links: [weight * (a / b - 1.0), weight * (b / a - 1.0)] }
        };
        Self {
            links: (0..).zip(links).filter(|&(node, _)| is_on_wall[node as usize]).collect(),
            edges: edges
                .chunk_by(|a, b| a.ends == b.ends)
                .map(sum)
                .filter(|edge| edge.weight > 0.0)
                .collect(),
        }
    }
}

impl WallFace {
    /// Adds the links of the face's nodes and its edges.
    fn add(&self, places: &[DVec3], middle: DVec3, links: &mut [f64], edges: &mut Vec<WallEdge>) {
        let corners = self.nodes.map(|node| places[node as usize] - middle);
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let inward = (places[self.within as usize] - middle - corners[0]).dot(normal);
        // Twice the area.
        let outward = if inward > 0.0 { -normal } else { normal };
        let double = outward.length();
        // Three points within integrate quadratic functions. Behind what overhangs no field leads outwards.
        for of_corner in 0..3 {
            let parts: [f64; 3] = std::array::from_fn(|c| if c == of_corner { 2.0 / 3.0 } else { 1.0 / 6.0 });
            let place: DVec3 = corners.iter().zip(parts).map(|(&corner, part)| part * corner).sum();
            let leaving = (outward.dot(place) / (6.0 * place.length_squared())).max(0.0);
            for (node, part) in self.nodes.into_iter().zip(parts) {
                links[node as usize] += self.permittivity * part * leaving;
            }
        }
        let sheet = ALONG * corners.iter().sum::<DVec3>().length() / 3.0;
        for opposite in 0..3 {
            let [a, b] = [1, 2].map(|step| (opposite + step) % 3);
            // Half the cotangent of the angle opposite of the edge.
            let weight =
                (corners[a] - corners[opposite]).dot(corners[b] - corners[opposite]) / (2.0 * double);
            if weight.abs() > ROUNDING {
                let ends = [self.nodes[a.min(b)], self.nodes[a.max(b)]];
                edges.push(WallEdge { ends, weight: self.permittivity * sheet * weight, links: [0.0; 2] });
            }
        }
    }
}
