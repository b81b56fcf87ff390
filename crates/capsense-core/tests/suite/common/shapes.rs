//! Solids of every kind, and meshes of triangles to compare them with.

use capsense_core::geometry::{Pose, Shape, TriangleMesh};
use capsense_core::glam::{BVec3, DQuat, DVec3};
use capsense_core::solids::Solids;
use proptest::prelude::*;
use std::sync::Arc;

pub const SIZE: DVec3 = DVec3::new(0.15, 0.1, 0.03);
pub const RADIUS: f64 = 0.04;
pub const LENGTH: f64 = 0.09;

pub fn convex() -> [Shape; 4] {
    [
        Shape::Box { size: SIZE },
        Shape::Sphere { radius: RADIUS },
        Shape::Capsule { radius: RADIUS, length: LENGTH },
        Shape::Cylinder { radius: RADIUS, length: LENGTH },
    ]
}

/// Twelve triangles around a box, outwards.
pub fn box_triangles(min: DVec3, max: DVec3) -> Vec<[DVec3; 3]> {
    let bits = |k: usize| BVec3::new(k & 1 != 0, k & 2 != 0, k & 4 != 0);
    let corner = |k: usize| DVec3::select(bits(k), max, min);
    // Faces by corners whose bits are x, y and z.
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    faces
        .into_iter()
        .flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]])
        .map(|triangle| triangle.map(corner))
        .collect()
}

/// Each triangle with vertices of its own, as in STL files.
pub fn mesh_of(triangles: &[[DVec3; 3]]) -> Shape {
    let corners = (0..triangles.len() as u32).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    Shape::Mesh(Arc::new(TriangleMesh::new(triangles.as_flattened().to_vec(), corners).unwrap()))
}

/// A box of triangles that is not taken for a box, as it has a hollow too small to matter.
pub fn box_mesh(size: DVec3) -> Shape {
    let mut triangles = box_triangles(-0.5 * size, 0.5 * size);
    let corner = |part: f64| size * (DVec3::new(0.31, -0.27, 0.23) + 1e-4 * part);
    triangles.extend(box_triangles(corner(0.0), corner(1.0)));
    mesh_of(&triangles)
}

/// An octahedron halved again and again, its corners on a sphere.
pub fn sphere_triangles(radius: f64, halvings: usize) -> Vec<[DVec3; 3]> {
    let mut triangles: Vec<[DVec3; 3]> = (0..8)
        .map(|k| {
            let sign = |bit: usize| if k & bit != 0 { -1.0 } else { 1.0 };
            [DVec3::X * sign(1), DVec3::Y * sign(2), DVec3::Z * sign(4)]
        })
        .collect();
    for _ in 0..halvings {
        triangles = triangles
            .into_iter()
            .flat_map(|[a, b, c]| {
                let [ab, bc, ca] = [a + b, b + c, c + a].map(DVec3::normalize);
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    triangles.into_iter().map(|corners| corners.map(|corner| radius * corner)).collect()
}

/// All convex shapes, a box and a ball of triangles.
pub fn all_shapes() -> Vec<Shape> {
    let mut shapes = convex().to_vec();
    shapes.extend([box_mesh(SIZE), mesh_of(&sphere_triangles(RADIUS, 2))]);
    shapes
}

pub fn at(shapes: &[Shape], poses: &[Pose]) -> Solids {
    let mut solids = Solids::new(shapes).unwrap();
    solids.place(poses).unwrap();
    solids
}

pub fn rotation(axis: [f64; 3], angle: f64) -> DQuat {
    DVec3::from(axis).try_normalize().map_or(DQuat::IDENTITY, |axis| DQuat::from_axis_angle(axis, angle))
}

prop_compose! {
    pub fn pose()(
        axis in prop::array::uniform3(-1.0..1.0),
        angle in -4.0..4.0,
        translation in prop::array::uniform3(-0.05..0.05),
    ) -> Pose {
        Pose { rotation: rotation(axis, angle), translation: DVec3::from(translation) }
    }
}
