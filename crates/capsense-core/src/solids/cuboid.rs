//! Tells whether a closed surface of triangles is that of a box: as such it has edges whose field is known.

use glam::{DAffine3, DMat3, DVec3, Vec3Swizzles};

/// Corners are in a face if they are nearer to it than this part of the box's shortest edge: files often have single precision.
const FLAT: f64 = 1e-5;

/// A box as triangles give it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cuboid {
    /// Half its edge lengths, in metres.
    pub(super) half: DVec3,
    /// From the frame about its middle, along its edges, to that of the triangles.
    pub(super) place: DAffine3,
}

impl Cuboid {
    /// The box that has a closed surface, however often its faces are cut.
    pub(super) fn of(triangles: &[[DVec3; 3]]) -> Option<Self> {
        let axes = axes(triangles)?;
        let turned = axes.transpose();
        let corners = || triangles.iter().flatten().map(|corner| turned * *corner);
        let (min, max) = (corners().reduce(DVec3::min)?, corners().reduce(DVec3::max)?);
        let (size, middle) = (max - min, 0.5 * (min + max));
        let flat = FLAT * size.min_element();
        let is_in_face = |corners: [DVec3; 3]| {
            (0..3).any(|axis| {
                [min, max].iter().any(|face| corners.iter().all(|at| (at[axis] - face[axis]).abs() <= flat))
            })
        };
        // Closed, in the faces of a box, and as large as these are: each is covered once, whichever way round triangles are listed.
        let area: f64 = triangles.iter().map(|[a, b, c]| 0.5 * (*b - *a).cross(*c - *a).length()).sum();
        let of_box = 2.0 * (size * size.yzx()).element_sum();
        let is_whole = (area / of_box - 1.0).abs() < 10.0 * FLAT;
        let is_cuboid = is_whole && triangles.iter().all(|corners| is_in_face(corners.map(|at| turned * at)));
        is_cuboid
            .then(|| Self { half: 0.5 * size, place: DAffine3::from_mat3_translation(axes, axes * middle) })
    }
}

/// The normals of the largest triangle, of the largest across it, and the direction across both; none where the second is not
/// across the first.
fn axes(triangles: &[[DVec3; 3]]) -> Option<DMat3> {
    let largest = |across: DVec3| {
        let normals = triangles.iter().map(|[a, b, c]| (*b - *a).cross(*c - *a));
        let normals = normals.filter(|normal| normal.dot(across).abs() <= 0.5 * normal.length());
        let normal =
            normals.reduce(
                |best, normal| {
                    if normal.length_squared() > best.length_squared() { normal } else { best }
                },
            );
        normal?.try_normalize()
    };
    let first = largest(DVec3::ZERO)?;
    let second = largest(first)?;
    let second = (second - second.dot(first) * first).try_normalize()?;
    Some(DMat3::from_cols(first, second, first.cross(second)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DQuat, DVec2};

    /// A prism over a polygon that starts at a corner from which all of it is seen, between two heights.
    fn prism(polygon: &[DVec2], low: f64, high: f64) -> Vec<[DVec3; 3]> {
        let at = |k: usize, z: f64| polygon[k % polygon.len()].extend(z);
        let mut triangles = Vec::new();
        for k in 1..polygon.len() - 1 {
            triangles.push([at(0, low), at(k + 1, low), at(k, low)]);
            triangles.push([at(0, high), at(k, high), at(k + 1, high)]);
        }
        for k in 0..polygon.len() {
            triangles.push([at(k, low), at(k + 1, low), at(k + 1, high)]);
            triangles.push([at(k, low), at(k + 1, high), at(k, high)]);
        }
        triangles
    }

    fn points(places: &[[f64; 2]]) -> Vec<DVec2> {
        places.iter().copied().map(DVec2::from_array).collect()
    }

    #[test]
    fn boxes_are_found_wherever_they_are_and_however_their_faces_are_cut() {
        // The second has a corner more in one of its edges.
        let rectangle = points(&[[0.0, 0.0], [0.15, 0.0], [0.15, 0.1], [0.0, 0.1]]);
        let cut = points(&[[0.0, 0.0], [0.05, 0.0], [0.15, 0.0], [0.15, 0.1], [0.0, 0.1]]);
        let turned = DAffine3::from_rotation_translation(
            DQuat::from_rotation_z(0.4) * DQuat::from_rotation_x(1.1),
            DVec3::new(0.3, -0.2, 0.1),
        );
        for polygon in [rectangle, cut] {
            for pose in [DAffine3::IDENTITY, turned] {
                // As files in single precision have them.
                let moved = |at: DVec3| pose.transform_point3(at).as_vec3().as_dvec3();
                let triangles: Vec<_> =
                    prism(&polygon, -0.01, 0.01).iter().map(|corners| corners.map(moved)).collect();
                let found = Cuboid::of(&triangles).unwrap();
                let mut sizes = (2.0 * found.half).to_array();
                sizes.sort_by(f64::total_cmp);
                for (size, expected) in sizes.into_iter().zip([0.02, 0.1, 0.15]) {
                    assert!((size - expected).abs() < 1e-7, "{found:?}");
                }
                let middle = pose.transform_point3(DVec3::new(0.075, 0.05, 0.0));
                assert!((found.place.translation - middle).length() < 1e-7, "{found:?}");
                assert!((found.place.matrix3.determinant() - 1.0).abs() < 1e-12);
                // All corners of the triangles are on the box.
                for corner in triangles.iter().flatten() {
                    let local = found.place.inverse().transform_point3(*corner).abs() / found.half;
                    assert!((local.max_element() - 1.0).abs() < 1e-5, "{local}");
                }
            }
        }
    }

    #[test]
    fn what_is_no_box_is_none() {
        let slanted = points(&[[0.0, 0.0], [0.1, 0.0], [0.101, 0.1], [0.0, 0.1]]);
        let hexagon: Vec<DVec2> = (0..6).map(|k| DVec2::from_angle(f64::from(k))).collect();
        // Of an L all triangles but two are in faces of the box around it, of a notch with a corner in the middle all but few.
        let angle = points(&[[0.0, 0.0], [0.1, 0.0], [0.1, 0.05], [0.05, 0.05], [0.05, 0.1], [0.0, 0.1]]);
        for polygon in [slanted, hexagon, angle] {
            assert!(Cuboid::of(&prism(&polygon, 0.0, 0.03)).is_none(), "{polygon:?}");
        }
        let mut dented =
            prism(&points(&[[0.0, 0.0], [0.1, 0.0], [0.1, 0.1], [0.05, 0.1], [0.0, 0.1]]), 0.0, 0.03);
        for corner in dented.iter_mut().flatten().filter(|corner| corner.x == 0.05) {
            corner.y = 0.0999;
        }
        assert!(Cuboid::of(&dented).is_none());
        assert!(
            Cuboid::of(&[[DVec3::ZERO, DVec3::X, DVec3::Y], [DVec3::ZERO, DVec3::Y, DVec3::X]]).is_none()
        );
    }
}
