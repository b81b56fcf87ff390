//! Tells whether a closed surface of triangles is that of a box: as such it has edges whose field is known.

use glam::{DAffine3, DMat3, DVec3};

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
        let mut areas = [0.0; 6];
        for [a, b, c] in triangles.iter().map(|corners| corners.map(|at| turned * at)) {
            let is_in = |face: &usize| {
                let (axis, at) = (face / 2, if face.is_multiple_of(2) { min } else { max });
                [a, b, c].iter().all(|corner| (corner[axis] - at[axis]).abs() <= flat)
            };
            areas[(0..6).find(is_in)?] += 0.5 * (b - a).cross(c - a).length();
        }
        // Closed, in the faces of a box and as large as each of these: all are covered, whichever way round triangles are listed.
        let is_covered = |(face, area): (usize, f64)| {
            let of_face = size[(face / 2 + 1) % 3] * size[(face / 2 + 2) % 3];
            (area / of_face - 1.0).abs() < 10.0 * FLAT
        };
        let is_cuboid = areas.into_iter().enumerate().all(is_covered);
        is_cuboid
            .then(|| Self { half: 0.5 * size, place: DAffine3::from_mat3_translation(axes, axes * middle) })
    }
}

/// Normals of triangles within this angle, in radians, are one: of small triangles, single precision leaves that much.
const SAME_NORMAL: f64 = 0.02;

/// The mean normal of the triangles that are as the largest one, of those that are as the largest across it, and the direction across
/// both.
fn axes(triangles: &[[DVec3; 3]]) -> Option<DMat3> {
    let normals = || triangles.iter().map(|[a, b, c]| (*b - *a).cross(*c - *a));
    let mean = |across: DVec3| {
        let across = normals().filter(|normal| normal.dot(across).abs() <= 0.5 * normal.length());
        let longer = |a: DVec3, b: DVec3| if b.length_squared() > a.length_squared() { b } else { a };
        let largest = across.reduce(longer)?.try_normalize()?;
        let alike = normals().filter(|normal| normal.cross(largest).length() < SAME_NORMAL * normal.length());
        alike.map(|normal| normal * normal.dot(largest).signum()).sum::<DVec3>().try_normalize()
    };
    let first = mean(DVec3::ZERO)?;
    let second = mean(first)?;
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
    fn faces_may_be_cut_often() {
        let turn = DMat3::from_quat(DQuat::from_rotation_z(0.4) * DQuat::from_rotation_x(1.1));
        let (size, cells) = (DVec3::new(0.15, 0.15, 0.02), 80);
        let mut triangles = Vec::new();
        for (face, end) in (0..3).flat_map(|face| [(face, 0.0), (face, 1.0)]) {
            let at = |i: i32, j: i32| {
                let mut place = DVec3::splat(end);
                place[(face + 1) % 3] = f64::from(i) / f64::from(cells);
                place[(face + 2) % 3] = f64::from(j) / f64::from(cells);
                (turn * (place * size)).as_vec3().as_dvec3()
            };
            for (i, j) in (0..cells).flat_map(|i| (0..cells).map(move |j| (i, j))) {
                triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
        assert!(Cuboid::of(&triangles).is_some());
    }

    #[test]
    fn what_is_no_box_is_none() {
        let slanted = points(&[[0.0, 0.0], [0.1, 0.0], [0.101, 0.1], [0.0, 0.1]]);
        let hexagon: Vec<DVec2> = (0..6).map(|k| DVec2::from_angle(f64::from(k))).collect();
        // Of an L all triangles but four are in faces of the box around it.
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
        // Three faces of a cube, each twice: closed, and as large as all six.
        let cube = prism(&points(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]), 0.0, 1.0);
        let at_origin = |corners: &&[DVec3; 3]| (0..3).any(|axis| corners.iter().all(|at| at[axis] == 0.0));
        let half: Vec<_> = cube.iter().filter(at_origin).copied().collect();
        assert_eq!(half.len(), 6);
        assert!(Cuboid::of(&[&half[..], &half[..]].concat()).is_none());
        assert!(
            Cuboid::of(&[[DVec3::ZERO, DVec3::X, DVec3::Y], [DVec3::ZERO, DVec3::Y, DVec3::X]]).is_none()
        );
    }
}
