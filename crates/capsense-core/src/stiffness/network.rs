//! Linear elements as a network: one weight for each mesh edge.
//!
//! With P1 elements the stiffness matrix is a graph Laplacian of the weights
//! w_ij = -Σ_e ε_e ∫_e ∇λ_i·∇λ_j, relative permittivity times length, in metres. Edges without a weight, such as the
//! diagonals of Kuhn tetrahedra, are left out.

use crate::mesh::{TetMesh, signed_volume};
use crate::occupancy::SMALLEST_PART;
use crate::sensor::Sensor;
use glam::DVec3;

/// Weights below this part of the sum of their elements' contributions are rounding errors of zero.
const CANCELLED: f64 = 1e-12;

/// The edges of a mesh that carry a weight, ordered by their first, then their second node.
#[derive(Clone, Debug, PartialEq)]
pub struct EdgeNetwork {
    ends: Vec<[u32; 2]>,
    weights: Vec<f64>,
    permittivity: Vec<f64>,
}

/// What one element adds to one edge.
struct Contribution {
    ends: [u32; 2],
    /// Without permittivity.
    vacuum: f64,
    weight: f64,
    /// Size of the factors that made the weight.
    magnitude: f64,
}

impl EdgeNetwork {
    /// Assembles the network of a mesh.
    pub fn assemble(mesh: &TetMesh) -> Self {
        let mut contributions = Vec::with_capacity(6 * mesh.tets().len());
        for (element, (tet, &permittivity)) in
            mesh.tets().iter().zip(mesh.relative_permittivity()).enumerate()
        {
            let corners = mesh.corners(element);
            let volume = signed_volume(corners);
            let gradients = barycentric_gradients(corners);
            for i in 0..4 {
                for j in i + 1..4 {
                    let vacuum = -volume * gradients[i].dot(gradients[j]);
                    contributions.push(Contribution {
                        ends: [tet[i].min(tet[j]), tet[i].max(tet[j])],
                        vacuum,
                        weight: permittivity * vacuum,
                        magnitude: permittivity * volume * gradients[i].length() * gradients[j].length(),
                    });
                }
            }
        }
        // Stable, so that each edge is summed in the order of its elements on every run.
        contributions.sort_by_key(|c| c.ends);
        let mut network = Self { ends: Vec::new(), weights: Vec::new(), permittivity: Vec::new() };
        for of_edge in contributions.chunk_by(|a, b| a.ends == b.ends) {
            let sum = |part: fn(&Contribution) -> f64| of_edge.iter().map(part).sum::<f64>();
            let (weight, vacuum) = (sum(|c| c.weight), sum(|c| c.vacuum));
            if weight.abs() > CANCELLED * sum(|c| c.magnitude) {
                let ratio = weight / vacuum;
                network.ends.push(of_edge[0].ends);
                network.weights.push(weight);
                network.permittivity.push(if ratio.is_finite() && ratio > 0.0 { ratio } else { 1.0 });
            }
        }
        network
    }

    /// Assembles the network of a sensor: edges that cross the outline of a thin electrode in its plane are as long as
    /// their part outside.
    pub fn of_sensor(sensor: &Sensor) -> Self {
        let mut network = Self::assemble(sensor.mesh());
        for (ends, weight) in network.ends.iter().zip(&mut network.weights) {
            if let Some(outside) = sensor.outside_part_of_edge(*ends)
                && *weight > 0.0
            {
                *weight /= outside.max(SMALLEST_PART);
            }
        }
        network
    }

    /// The two nodes of each edge, the smaller first.
    pub fn ends(&self) -> &[[u32; 2]] {
        &self.ends
    }

    /// Weight of each edge in metres (times relative permittivity). Unstructured meshes have some negative ones.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Mean relative permittivity of the background around each edge.
    pub fn permittivity(&self) -> &[f64] {
        &self.permittivity
    }
}

/// Gradients of the four barycentric coordinates of a tetrahedron, 1/m.
pub fn barycentric_gradients([a, b, c, d]: [DVec3; 4]) -> [DVec3; 4] {
    let (u, v, w) = (b - a, c - a, d - a);
    let determinant = u.cross(v).dot(w);
    let of_b = v.cross(w) / determinant;
    let of_c = w.cross(u) / determinant;
    let of_d = u.cross(v) / determinant;
    [-(of_b + of_c + of_d), of_b, of_c, of_d]
}
