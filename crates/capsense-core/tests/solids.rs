//! Solids answer for points and segments as their definitions say, on meshes of triangles as on the shapes themselves, and
//! what is found to have changed is all that did.

#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use approx::assert_abs_diff_eq;
use capsense_core::electrode::{Electrode, Outline};
use capsense_core::geometry::{Aabb, Pose, Shape, TriangleMesh};
use capsense_core::glam::DVec2;
use capsense_core::glam::{BVec3, DQuat, DVec3};
use capsense_core::material::{Connection, Material};
use capsense_core::mesh::Lattice;
use capsense_core::occupancy::{Earlier, EdgeGeometry, Occupancy, Regions, Span, Surfaces};
use capsense_core::sensor::{Sensor, SensorDesign};
use capsense_core::simulator::Simulator;
use capsense_core::solids::{BadEdges, SolidError, Solids};
use capsense_core::stiffness::{EdgeNetwork, StiffnessMatrix};
use capsense_core::units::VACUUM_PERMITTIVITY;
use common::{Dice, bar, conductor, depth_of_boxes, dielectric, stripes_sensor, to, without_lattice};
use proptest::prelude::*;
use std::sync::{Arc, LazyLock};

const SIZE: DVec3 = DVec3::new(0.15, 0.1, 0.03);
const RADIUS: f64 = 0.04;
const LENGTH: f64 = 0.09;

fn convex() -> [Shape; 4] {
    [
        Shape::Box { size: SIZE },
        Shape::Sphere { radius: RADIUS },
        Shape::Capsule { radius: RADIUS, length: LENGTH },
        Shape::Cylinder { radius: RADIUS, length: LENGTH },
    ]
}

/// By how much a point is inside, in metres, as the shapes are defined.
fn depth_inside(shape: &Shape, p: DVec3) -> f64 {
    match *shape {
        Shape::Box { size } => (0.5 * size - p.abs()).min_element(),
        Shape::Sphere { radius } => radius - p.length(),
        Shape::Capsule { radius, length } => {
            radius - p.distance(DVec3::Z * p.z.clamp(-0.5 * length, 0.5 * length))
        }
        Shape::Cylinder { radius, length } => (radius - p.x.hypot(p.y)).min(0.5 * length - p.z.abs()),
        Shape::Mesh(_) => unreachable!("meshes are compared with these"),
    }
}

/// Twelve triangles around a box, outwards.
fn box_triangles(min: DVec3, max: DVec3) -> Vec<[DVec3; 3]> {
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
fn mesh_of(triangles: &[[DVec3; 3]]) -> Shape {
    let corners = (0..triangles.len() as u32).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    Shape::Mesh(Arc::new(TriangleMesh::new(triangles.as_flattened().to_vec(), corners).unwrap()))
}

fn box_mesh(size: DVec3) -> Shape {
    mesh_of(&box_triangles(-0.5 * size, 0.5 * size))
}

/// An octahedron halved again and again, its corners on a sphere.
fn sphere_triangles(radius: f64, halvings: usize) -> Vec<[DVec3; 3]> {
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

fn at(shapes: &[Shape], poses: &[Pose]) -> Solids {
    let mut solids = Solids::new(shapes).unwrap();
    solids.place(poses).unwrap();
    solids
}

fn assert_same_span(a: Option<Span>, b: Option<Span>, slack: f64, what: &str) {
    match (a, b) {
        (Some(a), Some(b)) => {
            let differs = (a.enter - b.enter).abs().max((a.exit - b.exit).abs());
            assert!(differs <= slack, "{what}: {a:?} {b:?}");
        }
        (None, None) => {}
        (a, b) => assert!(a.or(b).is_some_and(|s| s.exit - s.enter <= slack), "{what}: {a:?} {b:?}"),
    }
}

/// Ends that are inside begin or end the span, and it lies in order on the segment.
fn assert_consistent(solids: &Solids, object: usize, a: DVec3, b: DVec3) {
    let span = solids.span(object, a, b);
    if let Some(Span { enter, exit }) = span {
        assert!(0.0 <= enter && enter <= exit && exit <= 1.0, "{span:?}");
    }
    if solids.contains(object, a) {
        assert_eq!(span.map(|s| s.enter), Some(0.0));
    }
    if solids.contains(object, b) {
        assert_eq!(span.map(|s| s.exit), Some(1.0));
    }
}

fn rotation(axis: [f64; 3], angle: f64) -> DQuat {
    DVec3::from(axis).try_normalize().map_or(DQuat::IDENTITY, |axis| DQuat::from_axis_angle(axis, angle))
}

prop_compose! {
    fn pose()(
        axis in prop::array::uniform3(-1.0..1.0),
        angle in -4.0..4.0,
        translation in prop::array::uniform3(-0.05..0.05),
    ) -> Pose {
        Pose { rotation: rotation(axis, angle), translation: DVec3::from(translation) }
    }
}

prop_compose! {
    fn point()(point in prop::array::uniform3(-0.15..0.15)) -> DVec3 {
        DVec3::from(point)
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    /// Every shape against many points along the segment, taken from the shape's definition.
    #[test]
    fn spans_hold_the_points_inside(pose in pose(), a in point(), b in point()) {
        const SAMPLES: usize = 500;
        for shape in convex() {
            let solids = at(std::slice::from_ref(&shape), &[pose]);
            let depth = |t: f64| depth_inside(&shape, pose.object_from_sensor(a.lerp(b, t)));
            let inside: Vec<f64> = (0..=SAMPLES)
                .map(|k| k as f64 / SAMPLES as f64)
                .filter(|&t| depth(t) > 1e-9)
                .collect();
            for (end, t) in [(a, 0.0), (b, 1.0)] {
                prop_assert_eq!(solids.contains(0, end), depth(t) > 0.0);
            }
            assert_consistent(&solids, 0, a, b);
            let step = 1.0 / SAMPLES as f64;
            match (solids.span(0, a, b), inside.first().zip(inside.last())) {
                (Some(span), Some((first, last))) => {
                    prop_assert!((first - step..=first + 1e-7).contains(&span.enter), "{:?} {:?}", shape, span);
                    prop_assert!((last - 1e-7..=last + step).contains(&span.exit), "{:?} {:?}", shape, span);
                    for end in [span.enter, span.exit].into_iter().filter(|t| *t > 0.0 && *t < 1.0) {
                        prop_assert!(depth(end).abs() < 1e-10, "{:?}: {} off", shape, depth(end));
                    }
                }
                (None, None) => {}
                (span, _) => prop_assert!(span.is_some_and(|s| s.exit - s.enter < step), "{:?} {:?}", shape, span),
            }
        }
    }

    /// Boxes as triangles, listed either way round or in a mixture, answer as boxes.
    #[test]
    fn a_box_of_triangles_is_a_box(pose in pose(), a in point(), b in point(), turned in any::<u16>()) {
        let mut triangles = box_triangles(-0.5 * SIZE, 0.5 * SIZE);
        for (k, corners) in triangles.iter_mut().enumerate() {
            if turned & (1 << k) != 0 {
                corners.swap(0, 1);
            }
        }
        let solids = at(&[Shape::Box { size: SIZE }, mesh_of(&triangles)], &[pose; 2]);
        for end in [a, b] {
            prop_assert_eq!(solids.contains(0, end), solids.contains(1, end));
        }
        assert_consistent(&solids, 1, a, b);
        assert_same_span(solids.span(0, a, b), solids.span(1, a, b), 1e-9, "box");
    }

    /// A surface may come in parts: spans reach from the first entry to the last exit.
    #[test]
    fn spans_bridge_what_lies_between(a in point(), b in point()) {
        let boxes = [
            (DVec3::new(-0.1, -0.05, -0.02), DVec3::new(-0.02, 0.05, 0.03)),
            (DVec3::new(0.01, -0.06, -0.03), DVec3::new(0.07, 0.02, 0.05)),
        ];
        let both: Vec<_> = boxes.iter().flat_map(|&(min, max)| box_triangles(min, max)).collect();
        let parts = boxes.map(|(min, max)| Shape::Box { size: max - min });
        let mut shapes = parts.to_vec();
        shapes.push(mesh_of(&both));
        let centres = boxes.map(|(min, max)| Pose::at(0.5 * (min + max)));
        let solids = at(&shapes, &[centres[0], centres[1], Pose::IDENTITY]);
        let spans = [0, 1].map(|object| solids.span(object, a, b));
        let expected = spans.into_iter().flatten().reduce(|one, other| Span {
            enter: one.enter.min(other.enter),
            exit: one.exit.max(other.exit),
        });
        assert_same_span(expected, solids.span(2, a, b), 1e-9, "two boxes");
        assert_consistent(&solids, 2, a, b);
    }

    /// A fine ball of triangles lies within its sphere, by less than the height of its facets.
    #[test]
    fn a_ball_of_triangles_is_nearly_a_sphere(pose in pose(), a in point(), b in point()) {
        static BALL: LazyLock<Shape> = LazyLock::new(|| mesh_of(&sphere_triangles(RADIUS, 4)));
        // Facets reach this far below the sphere.
        let lowest = RADIUS * (1.0 - 5e-3);
        let shapes = [Shape::Sphere { radius: RADIUS }, BALL.clone(), Shape::Sphere { radius: lowest }];
        let solids = at(&shapes, &[pose; 3]);
        let [outer, ball, inner] = [0, 1, 2].map(|object| solids.span(object, a, b));
        if let Some(inner) = inner {
            let ball = ball.unwrap();
            prop_assert!(ball.enter <= inner.enter && inner.exit <= ball.exit, "{:?} {:?}", ball, inner);
        }
        if let Some(ball) = ball {
            let outer = outer.unwrap();
            prop_assert!(outer.enter <= ball.enter + 1e-12 && ball.exit <= outer.exit + 1e-12, "{:?} {:?}", outer, ball);
        }
        assert_consistent(&solids, 1, a, b);
    }

    /// Shifts along the axes, one or two of them, leave faces in their planes, however often the solid is turned by a
    /// right angle or about the third axis. Grid points lie in faces and planes; some segments pass rims closely.
    #[test]
    fn regions_hold_all_that_differs_when_faces_slide(
        seed in any::<u64>(), turns in 0..4_usize, axis in 0..3_usize, yaw in -4.0..4.0, spacing in 0.002..0.05,
    ) {
        let mut dice = Dice(seed);
        let right_angle = std::f64::consts::FRAC_PI_2;
        let about = [DVec3::X, DVec3::Y, DVec3::Z][axis];
        let angle = if dice.below(2) == 0 { turns as f64 * right_angle } else { yaw };
        // Exactly a half turn too, which leaves faces across axes.
        let half_turns = [DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0), DQuat::from_xyzw(0.0, 1.0, 0.0, 0.0), DQuat::IDENTITY];
        let rotation = DQuat::from_axis_angle(about, angle) * half_turns[dice.below(3)];
        let before = Pose { rotation, translation: 0.01 * DVec3::new(1.0, -2.0, 3.0) };
        let mut shift = DVec3::ZERO;
        for _ in 0..=dice.below(2) {
            shift[dice.below(3)] = dice.between(-5e-3, 5e-3);
        }
        let now = Pose { translation: before.translation + shift, ..before };
        for shape in all_shapes() {
            let earlier = at(std::slice::from_ref(&shape), &[before]);
            let mut later = earlier.clone();
            later.place(&[now]).unwrap();
            assert_regions_hold(&shape, [&earlier, &later], spacing, &mut dice, |dice| {
                // A point of the surface, a rim or outside in the solid's frame, and one near it or far away.
                let half = 0.5 * SIZE.max(DVec3::new(2.0 * RADIUS, 2.0 * RADIUS, LENGTH));
                let mut place = || half * DVec3::from_array([0; 3].map(|_| [-1.0, 0.0, 0.5, 1.0, 1.1][dice.below(5)]));
                let (a, b) = (before.sensor_from_object(place()), before.sensor_from_object(place()));
                let jitter = 10.0_f64.powf(dice.between(-14.0, -1.0));
                (a + jitter * dice.point(), b + jitter * dice.point())
            })?;
        }
    }

    /// What differs after a move lies in the regions, on any kind of shape.
    #[test]
    fn regions_hold_all_that_differs(seed in any::<u64>(), before in pose(), small in any::<bool>(), spacing in 0.002..0.05) {
        let mut dice = Dice(seed);
        let reach = if small { 2e-3 } else { 0.1 };
        let shift = DVec3::new(dice.between(-reach, reach), dice.between(-reach, reach), dice.between(-reach, reach));
        let turn = rotation([dice.next(), dice.next(), dice.next()], dice.between(-10.0, 10.0) * reach);
        let now = Pose { rotation: turn * before.rotation, translation: before.translation + shift };
        for shape in all_shapes() {
            let earlier = at(std::slice::from_ref(&shape), &[before]);
            let mut later = earlier.clone();
            later.place(&[now]).unwrap();
            assert_regions_hold(&shape, [&earlier, &later], spacing, &mut dice, |dice| {
                let (a, b) = (0.5 * dice.point(), 0.5 * dice.point());
                (a, if dice.below(2) == 0 { b } else { a + 0.05 * (b - a) })
            })?;
        }
    }
}

/// All that differs between two frames of an object, of many segments and their ends, is in the regions found.
fn assert_regions_hold(
    shape: &Shape,
    [earlier, later]: [&Solids; 2],
    spacing: f64,
    dice: &mut Dice,
    mut segment: impl FnMut(&mut Dice) -> (DVec3, DVec3),
) -> Result<(), TestCaseError> {
    let (mut memory, mut regions) = (Earlier::default(), Regions::for_spacing(spacing));
    prop_assert!(!earlier.find_changes(&mut memory, &mut regions), "nothing to compare with");
    prop_assert!(later.find_changes(&mut memory, &mut regions));
    for _ in 0..200 {
        let (a, b) = segment(dice);
        let differs = earlier.contains(0, a) != later.contains(0, a);
        prop_assert!(!differs || regions.boxes().iter().any(|region| region.contains(a)), "{shape:?} at {a}");
        let bits = |solids: &Solids| solids.span(0, a, b).map(|s| [s.enter.to_bits(), s.exit.to_bits()]);
        let around = Aabb { min: a.min(b), max: a.max(b) };
        let differs = bits(earlier) != bits(later);
        let is_told = regions.boxes().iter().any(|region| region.intersects(&around));
        prop_assert!(!differs || is_told, "{shape:?} {a} {b}");
    }
    // The same place again.
    let mut nothing = Regions::for_spacing(spacing);
    prop_assert!(later.find_changes(&mut memory, &mut nothing) && nothing.boxes().is_empty());
    Ok(())
}

/// All convex shapes, a box and a ball of triangles.
fn all_shapes() -> Vec<Shape> {
    let mut shapes = convex().to_vec();
    shapes.extend([box_mesh(SIZE), mesh_of(&sphere_triangles(RADIUS, 2))]);
    shapes
}

/// All segments between the points of a grid on which faces, edges and corners of the box lie: through corners, along
/// edges, in faces, from face to face.
#[test]
fn segments_through_edges_and_in_faces_are_told_alike() {
    let side = DVec3::splat(2.0);
    for scale in [1.0, 0.1] {
        let solids = at(&[Shape::Box { size: scale * side }, box_mesh(scale * side)], &[Pose::IDENTITY; 2]);
        let coordinate = |k: usize| scale * [-2.0, -1.0, -0.25, 1.0, 1.5][k % 5];
        let point = |k: usize| DVec3::new(coordinate(k), coordinate(k / 5), coordinate(k / 25));
        for a in (0..125).map(point) {
            let inside = a.abs().max_element() < 0.999 * scale;
            assert_eq!([0, 1].map(|object| solids.contains(object, a)), [inside; 2], "{a}");
            for b in (0..125).map(point) {
                let spans = [0, 1].map(|object| solids.span(object, a, b));
                assert_same_span(spans[0], spans[1], 1e-9, &format!("{a} {b}"));
                assert_eq!(spans[0].is_some(), spans[1].is_some(), "{a} {b}: {spans:?}");
                let backwards = solids.span(1, b, a);
                let turned = backwards.map(|s| Span { enter: 1.0 - s.exit, exit: 1.0 - s.enter });
                assert_same_span(spans[1], turned, 1e-9, &format!("{a} {b} backwards"));
            }
        }
    }
}

/// Along z, these points see corners and edges of the octahedron that the ball was made of, each once.
#[test]
fn rays_through_corners_and_edges_are_counted_once() {
    let solids = Solids::new(&[mesh_of(&sphere_triangles(1.0, 3))]).unwrap();
    let coordinates = [-1.25, -0.5, -0.3, 0.0, 0.1, 0.5, 1.25];
    for (x, y) in coordinates.into_iter().flat_map(|x| coordinates.map(|y| (x, y))) {
        for z in coordinates {
            let point = DVec3::new(x, y, z);
            assert_eq!(solids.contains(0, point), point.length() < 0.99, "{point}");
        }
    }
}

/// A face in a plane of nodes holds none of them, on either side, wherever the bar stands in the mesh.
#[test]
fn opposite_faces_are_alike() {
    let size = DVec3::new(0.15, 0.15, 0.02);
    for height in [0.05, 0.06, 0.07, 0.1, 0.3] {
        for rotation in
            [DQuat::IDENTITY, DQuat::from_rotation_z(0.35), DQuat::from_rotation_x(std::f64::consts::PI)]
        {
            let pose = Pose { rotation, ..Pose::at(DVec3::new(0.0, 0.0, height)) };
            let solids = at(&[Shape::Box { size }, box_mesh(size)], &[pose; 2]);
            for k in 0..40 {
                let (x, y) = (0.003 * f64::from(k % 7) - 0.01, 0.004 * f64::from(k / 7) - 0.01);
                for face in [-0.01, 0.01] {
                    let on_face = DVec3::new(x, y, height + face);
                    assert_eq!(
                        [0, 1].map(|object| solids.contains(object, on_face)),
                        [false; 2],
                        "{on_face}"
                    );
                    let inwards = on_face - face * DVec3::Z;
                    for object in [0, 1] {
                        let Span { enter, exit } = solids.span(object, on_face, inwards).unwrap();
                        assert!(enter < 1e-9 && exit == 1.0, "{enter} {exit}");
                    }
                }
            }
        }
    }
}

#[test]
fn a_ball_does_not_feel_turns() {
    let shapes = [Shape::Sphere { radius: RADIUS }];
    let earlier = at(&shapes, &[Pose::at(DVec3::X)]);
    let mut turned = earlier.clone();
    turned.place(&[Pose { rotation: rotation([1.0, 2.0, 3.0], 0.7), ..Pose::at(DVec3::X) }]).unwrap();
    let (mut memory, mut regions) = (Earlier::default(), Regions::for_spacing(0.01));
    let _ = earlier.find_changes(&mut memory, &mut regions);
    assert!(turned.find_changes(&mut memory, &mut regions) && regions.boxes().is_empty());
}

fn refusal(triangles: &[[DVec3; 3]]) -> BadEdges {
    match Solids::new(&[Shape::Sphere { radius: 1.0 }, mesh_of(triangles)]) {
        Err(SolidError::NotWatertight { object: 1, edges }) => edges,
        other => unreachable!("{other:?}"),
    }
}

#[test]
fn open_surfaces_are_refused_with_a_count() {
    let closed = box_triangles(DVec3::ZERO, DVec3::ONE);
    let bad = |open, crowded, reversed| BadEdges { open, crowded, reversed };
    assert_eq!(refusal(&closed[1..]), bad(3, 0, 0));
    assert_eq!(refusal(&closed[2..]), bad(4, 0, 0), "a whole face");
    let mut turned = closed.clone();
    turned[5].swap(1, 2);
    assert!(Solids::new(&[mesh_of(&turned)]).is_ok(), "closed all the same");
    assert_eq!(refusal(&turned[2..]), bad(4, 0, 3));
    let fin = [closed[0][0], closed[0][1], DVec3::splat(3.0)];
    assert_eq!(refusal(&[closed.as_slice(), &[fin]].concat()), bad(2, 1, 0));
    let message = Solids::new(&[mesh_of(&closed[1..])]).unwrap_err().to_string();
    assert!(message.contains("not watertight: 3 open edges"), "{message}");
    let flat = [DVec3::ZERO, DVec3::ZERO, DVec3::X];
    assert_eq!(refusal(&[flat]), bad(0, 0, 0));
}

/// As files have them: corners in single precision, each rounded in its own way, and triangles without area.
#[test]
fn corners_that_nearly_coincide_are_welded() {
    let mut dice = Dice(3);
    let mut triangles = sphere_triangles(0.1, 3);
    for corner in triangles.as_flattened_mut() {
        *corner = DVec3::from(corner.as_vec3()) + 5e-8 * (dice.point() - 0.1);
    }
    let [a, b, _] = triangles[7];
    triangles.push([a, b, b]);
    let solids = Solids::new(&[mesh_of(&triangles)]).unwrap();
    assert!(solids.contains(0, DVec3::splat(0.05)) && !solids.contains(0, DVec3::splat(0.06)));
    triangles.remove(100);
    assert_eq!(refusal(&triangles).open, 3);
}

#[test]
fn impossible_lengths_and_poses_are_refused() {
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        for shape in [
            Shape::Box { size: DVec3::new(1.0, bad, 1.0) },
            Shape::Sphere { radius: bad },
            Shape::Capsule { radius: 1.0, length: bad },
            Shape::Cylinder { radius: bad, length: 1.0 },
        ] {
            assert!(matches!(Solids::new(&[shape]), Err(SolidError::Length { object: 0, .. })));
        }
    }
    let mut solids = at(&convex()[..2], &[Pose::at(DVec3::X); 2]);
    assert_eq!(solids.place(&[Pose::IDENTITY]), Err(SolidError::PoseCount { poses: 1, objects: 2 }));
    for bad in
        [Pose::at(DVec3::NAN), Pose { rotation: DQuat::from_xyzw(0.0, 0.0, 0.0, 2.0), ..Pose::IDENTITY }]
    {
        assert_eq!(solids.place(&[Pose::IDENTITY, bad]), Err(SolidError::Pose(1)));
        assert!(solids.contains(0, DVec3::X), "as before");
    }
}

#[test]
fn bounds_hold_the_solid() {
    let turned = Pose { rotation: rotation([1.0, 2.0, 3.0], 1.0), translation: DVec3::new(1.0, 2.0, 3.0) };
    for shape in all_shapes() {
        let solids = at(std::slice::from_ref(&shape), &[turned]);
        let (bounds, mut dice) = (solids.bounds(0), Dice(1));
        let centre = turned.translation;
        for _ in 0..2000 {
            let p = centre + dice.point();
            assert!(!solids.contains(0, p) || bounds.contains(p), "{shape:?}");
        }
        assert!(bounds.size().max_element() < 3.5 * shape.bounding_radius());
    }
    assert_abs_diff_eq!(
        at(&[Shape::Sphere { radius: 0.1 }], &[turned]).bounds(0).size().x,
        0.2,
        epsilon = 1e-8
    );
}

/// The part of a simulator that comes before the solver.
#[derive(Clone)]
struct Updater<'a> {
    sensor: &'a Sensor,
    network: EdgeNetwork,
    occupancy: Occupancy,
    matrix: StiffnessMatrix,
}

impl<'a> Updater<'a> {
    fn new(sensor: &'a Sensor) -> Self {
        let network = EdgeNetwork::of_sensor(sensor);
        let nodes = sensor.mesh().nodes().len();
        let occupancy = Occupancy::empty(nodes, network.edges().len());
        Self { sensor, occupancy, matrix: StiffnessMatrix::new(network.clone(), nodes), network }
    }

    fn step(&mut self, materials: &[Material], surfaces: &dyn Surfaces) {
        let mesh = EdgeGeometry {
            nodes: self.sensor.mesh().nodes(),
            terminals: self.sensor.terminals(),
            edges: self.network.edges(),
            permittivity: self.network.permittivity(),
        };
        self.occupancy.update(mesh, materials, surfaces);
        self.matrix.update(&self.occupancy);
    }

    /// Everything that a frame leaves, numbers in bits.
    fn assert_is(&self, other: &Self) {
        let bits = |updater: &Self| -> Vec<_> {
            let couplings = updater.occupancy.couplings().iter();
            couplings.map(|c| (c.through.to_bits(), c.factor.map(f64::to_bits), c.object)).collect()
        };
        let lists = |updater: &Self| {
            let occupancy = &updater.occupancy;
            let matrix: Vec<_> = updater.matrix.to_csr().values().iter().map(|k| k.to_bits()).collect();
            (
                occupancy.conductors().to_vec(),
                occupancy.linked_edges().to_vec(),
                occupancy.contacts().to_vec(),
                matrix,
            )
        };
        assert!(bits(self) == bits(other), "couplings differ from a fresh build");
        assert!(lists(self) == lists(other), "nodes, links, contacts or values differ from a fresh build");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Solids that rest, creep, turn, jump and leave, on a lattice and on a list of edges, and the camera in between.
    #[test]
    fn moves_leave_no_trace(seed in any::<u64>()) {
        static MESHES: LazyLock<[Sensor; 2]> = LazyLock::new(|| {
            let lattice = stripes_sensor(6_000);
            [without_lattice(&lattice), lattice]
        });
        let mut dice = Dice(seed);
        let shapes = all_shapes();
        let shapes: Vec<_> = (0..3).map(|_| shapes[dice.below(shapes.len())].clone()).collect();
        let materials = [dielectric(4.0), conductor(Connection::Grounded), conductor(Connection::Floating)];
        let mut solids = Solids::new(&shapes).unwrap();
        let mut poses = vec![Pose::IDENTITY; 3];
        let mut updaters = MESHES.each_ref().map(Updater::new);
        for _ in 0..8 {
            for pose in &mut poses {
                let step = match dice.below(4) {
                    0 => continue,
                    1 => 1e-3,
                    2 => 2e-2,
                    _ => 0.5,
                };
                pose.translation += step * (dice.point() - DVec3::Z * 0.12);
                if dice.below(2) == 0 {
                    let axis = [dice.next(), dice.next(), dice.next()];
                    pose.rotation = (rotation(axis, 5.0 * step) * pose.rotation).normalize();
                }
            }
            solids.place(&poses).unwrap();
            let image = (dice.below(6) == 0).then(|| depth_of_boxes([24, 24], &[bar(0.05, 0.0); 3]));
            for updater in &mut updaters {
                let surfaces: &dyn Surfaces = image.as_ref().map_or(&solids, |image| image);
                updater.step(&materials, surfaces);
                let mut fresh = Updater::new(updater.sensor);
                fresh.step(&materials, surfaces);
                updater.assert_is(&fresh);
            }
        }
    }
}

#[test]
fn solids_at_rest_change_nothing() {
    let sensor = stripes_sensor(6_000);
    let mut updater = Updater::new(&sensor);
    let materials = [conductor(Connection::Grounded); 6];
    let poses: Vec<_> = (0..6).map(|k| Pose::at(DVec3::new(0.0, 0.0, 0.05 + 0.03 * f64::from(k)))).collect();
    let solids = at(&all_shapes(), &poses);
    updater.step(&materials, &solids);
    assert!(!updater.occupancy.changed_edges().is_empty());
    updater.step(&materials, &solids.clone());
    assert!(updater.occupancy.changed_edges().is_empty());
}

/// A ball in the middle of a grounded cube of 1 m, its capacitance to all around it in farads, from what a little
/// electrode near the wall sees of it: C_ee falls by C_es² / (C_ss + C_g) where it is tied to ground through C_g, as
/// against grounded, so that two values of C_g tell C_ss.
fn ball_in_a_cube(radius: f64, cells: usize) -> f64 {
    let cube = Aabb { min: DVec3::splat(-0.5), max: DVec3::splat(0.5) };
    let lattice = Lattice::uniform(cube, [cells; 3]).unwrap();
    let step = 1.0 / cells as f64;
    let electrode = Outline::Rectangle { center: DVec2::ZERO, size: DVec2::splat(0.2) };
    let electrodes = vec![Electrode { name: "E".into(), outline: electrode, z: -0.5 + 2.0 * step }];
    let sensor =
        Sensor::on_lattice(&SensorDesign { domain: cube, electrodes, substrate: None }, &lattice).unwrap();
    let solids = Solids::new(&[Shape::Sphere { radius }]).unwrap();
    let tied = 1e-10;
    let [grounded, floating, capacitor] =
        [Connection::Grounded, Connection::Floating, Connection::Capacitance(tied)].map(|connection| {
            let mut simulator =
                Simulator::new(sensor.clone(), vec![conductor(connection)], to(1e-11)).unwrap();
            let _ = simulator.step(&solids).unwrap();
            simulator.capacitance().get(0, 0)
        });
    assert!(floating < capacitor && capacitor < grounded, "{floating} {capacitor} {grounded}");
    tied / ((grounded - floating) / (grounded - capacitor) - 1.0)
}

/// C / 4πε0 in metres of a ball of radius 0.25 m in the middle of a grounded cube of 1 m, from a solution that uses none
/// of this code; its residual is 4e-14.
const BALL_IN_A_CUBE: f64 = 0.443_980_442_323;

#[test]
fn a_ball_in_a_grounded_cube_has_its_capacitance() {
    let exact = 4.0 * std::f64::consts::PI * VACUUM_PERMITTIVITY * BALL_IN_A_CUBE;
    let errors = [10, 20, 40].map(|cells| ball_in_a_cube(0.25, cells) / exact - 1.0);
    assert!(errors[2].abs() < 8e-3, "{errors:?}");
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!(order > 1.5, "order {order} from {errors:?}");
    }
}
