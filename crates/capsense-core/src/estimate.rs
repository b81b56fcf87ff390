//! How far the mesh is from resolving the field: an estimate of the discretisation error of each capacitance.
//!
//! The adjoint of C_st is the field φ_t, so the error of C_st is about
//! Σ_e ∫_e ε (G∇φ_s - ∇φ_s)·(G∇φ_t - ∇φ_t), where G is the gradient recovered by averaging over the elements around each
//! node (Zienkiewicz and Zhu 1987).

use crate::capacitance::CapacitanceMatrix;
use crate::mesh::{TetMesh, signed_volume};
use crate::stiffness::barycentric_gradients;
use crate::units::VACUUM_PERMITTIVITY;
use glam::DVec3;

/// Estimates C_h - C in farads for the fields of all terminals. `potential(column, node)` is the field of terminal
/// `column`; elements for which `inside(element)` holds lie in a conductor and have no field.
pub fn discretisation_error(
    mesh: &TetMesh,
    columns: usize,
    potential: impl Fn(usize, usize) -> f64,
    inside: impl Fn(usize) -> bool,
) -> CapacitanceMatrix {
    let elements: Vec<usize> = (0..mesh.tets().len()).filter(|&element| !inside(element)).collect();
    let gradients: Vec<Vec<DVec3>> = (0..columns)
        .map(|column| element_gradients(mesh, &elements, |node| potential(column, node)))
        .collect();
    let recovered: Vec<Vec<DVec3>> = gradients.iter().map(|g| nodal_average(mesh, &elements, g)).collect();
    let mut error = CapacitanceMatrix::zeros(columns);
    for s in 0..columns {
        for t in s..columns {
            let sum: f64 = elements
                .iter()
                .enumerate()
                .map(|(index, &element)| {
                    let weight =
                        mesh.relative_permittivity().at(element) * signed_volume(mesh.corners(element));
                    let gap = |c: usize| {
                        mesh.tets()[element].map(|node| recovered[c][node as usize] - gradients[c][index])
                    };
                    weight * mean_product(gap(s), gap(t))
                })
                .sum();
            error.set(s, t, VACUUM_PERMITTIVITY * sum);
        }
    }
    error
}

fn element_gradients(mesh: &TetMesh, elements: &[usize], potential: impl Fn(usize) -> f64) -> Vec<DVec3> {
    elements
        .iter()
        .map(|&element| {
            let gradients = barycentric_gradients(mesh.corners(element));
            let tet = mesh.tets()[element];
            gradients.iter().zip(tet).map(|(g, node)| potential(node as usize) * *g).sum()
        })
        .collect()
}

/// At each node the mean of the gradients around it, weighted with the volumes of their elements.
fn nodal_average(mesh: &TetMesh, elements: &[usize], gradients: &[DVec3]) -> Vec<DVec3> {
    let mut sums = vec![(DVec3::ZERO, 0.0); mesh.nodes().len()];
    for (&element, &gradient) in elements.iter().zip(gradients) {
        let volume = signed_volume(mesh.corners(element));
        for node in mesh.tets()[element] {
            let (sum, total) = &mut sums[node as usize];
            *sum += volume * gradient;
            *total += volume;
        }
    }
    sums.into_iter().map(|(sum, total)| if total > 0.0 { sum / total } else { DVec3::ZERO }).collect()
}

/// Mean over a tetrahedron of the product of two fields that are linear in it, from their values at the corners:
/// (Σ a_i·b_i + Σ a_i · Σ b_i) / 20.
fn mean_product(a: [DVec3; 4], b: [DVec3; 4]) -> f64 {
    let diagonal: f64 = a.iter().zip(&b).map(|(a, b)| a.dot(*b)).sum();
    let sum = |v: [DVec3; 4]| v.into_iter().sum::<DVec3>();
    (diagonal + sum(a).dot(sum(b))) / 20.0
}
