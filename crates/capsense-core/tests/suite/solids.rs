//! Solids answer for points and segments as their definitions say, on meshes of triangles as on the shapes themselves.

use crate::common::Dice;
use crate::common::shapes::{
    RADIUS, SIZE, all_shapes, at, box_mesh, box_triangles, convex, mesh_of, pose, rotation, sphere_triangles,
};
use approx::assert_abs_diff_eq;
use capsense_core::geometry::{Pose, Shape};
use capsense_core::glam::{DQuat, DVec3};
use capsense_core::occupancy::{Side, Span, Surfaces};
use capsense_core::solids::{BadEdges, SolidError, Solids};
use proptest::prelude::*;
use std::sync::LazyLock;

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

prop_compose! {
    fn point()(point in prop::array::uniform3(-0.15..0.15)) -> DVec3 {
        DVec3::from(point)
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    /// What is soon told of a box, along the axes of a solid, is so of all points in it; and of boxes far away or deep inside it is
    /// told.
    #[test]
    fn boxes_are_on_the_side_that_is_told(
        pose in pose(), middle in point(), half in prop::array::uniform3(1e-4..0.05), seed in any::<u64>(),
    ) {
        let (solids, mut dice) = (at(&all_shapes(), &[pose; 6]), Dice(seed));
        let half = DVec3::from_array(half);
        for object in 0..6 {
            let frame = solids.frame(object);
            let side = solids.side_of(object, middle, half);
            // The point nearest to the solid's middle, too.
            let places = (0..20).map(|_| DVec3::from_array([(); 3].map(|()| dice.between(-1.0, 1.0))));
            let nearest = DVec3::ZERO.clamp(middle - half, middle + half);
            for local in places.map(|part| middle + half * part).chain([nearest]) {
                let point = frame.origin + frame.object_from_sensor.transpose() * local;
                let told = if solids.contains(object, point) { Side::Inside } else { Side::Outside };
                prop_assert!(side.is_none_or(|side| side == told), "{} {:?} {}", object, side, point);
            }
        }
        let small = DVec3::splat(1e-3);
        for (object, shape) in all_shapes().iter().enumerate() {
            let is_convex = !matches!(shape, Shape::Mesh(_));
            let far = solids.side_of(object, DVec3::new(0.3, 0.2, 0.0), small);
            prop_assert_eq!(far, is_convex.then_some(Side::Outside));
            prop_assert_eq!(solids.side_of(object, DVec3::ZERO, small), is_convex.then_some(Side::Inside));
        }
    }

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

/// So the field around them is known; not of a box with a dent.
#[test]
fn triangles_around_a_box_have_its_edges() {
    let middle = DVec3::new(0.3, -0.1, 0.05);
    let triangles = box_triangles(middle - 0.5 * SIZE, middle + 0.5 * SIZE);
    let (mesh_pose, turn) = (Pose::at(DVec3::new(0.1, 0.2, 0.3)), rotation([1.0, 2.0, 3.0], 1.0));
    let mesh_pose = Pose { rotation: turn, ..mesh_pose };
    let box_pose = Pose { translation: mesh_pose.translation + turn * middle, ..mesh_pose };
    let of_mesh = at(&[mesh_of(&triangles)], &[mesh_pose]);
    let of_box = at(&convex()[..1], &[box_pose]);
    let (mut dice, mut beside_edges) = (Dice(5), 0);
    for _ in 0..500 {
        let [a, b] = [0.3 * dice.point(), dice.point()].map(|at| box_pose.translation + at);
        assert_same_span(of_mesh.span(0, a, b), of_box.span(0, a, b), 1e-9, "box");
        let edges = [&of_mesh, &of_box].map(|of| of.right_angles(0).unwrap().nearest(a).unwrap());
        // Beyond a corner three edges are as near, and rounding decides.
        if edges.iter().all(|edge| edge.inside > 1e-6) {
            let differs =
                edges[0].place.distance(edges[1].place).max((edges[0].inside - edges[1].inside).abs());
            assert!(differs < 1e-9, "{edges:?}");
            beside_edges += 1;
        }
    }
    assert!(beside_edges > 100);
    let dented = triangles.iter().map(|corners| {
        corners.map(|at| if at.cmpeq(middle + 0.5 * SIZE).all() { at - 0.01 * SIZE } else { at })
    });
    assert!(at(&[mesh_of(&dented.collect::<Vec<_>>())], &[mesh_pose]).right_angles(0).is_none());
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

/// Products of such lengths are no numbers; halving surfaces until they are small would not end.
#[test]
fn lengths_that_are_as_good_as_zero_are_refused() {
    for length in [1e-101, 1e-170, 1e-300] {
        for shape in [Shape::Box { size: DVec3::splat(length) }, Shape::Sphere { radius: length }] {
            assert_eq!(Solids::new(&[shape]).unwrap_err(), SolidError::Length { object: 0, length });
        }
    }
    assert!(
        Solids::new(&[Shape::Box { size: DVec3::splat(1e-99) }, Shape::Sphere { radius: 1e-99 }]).is_ok()
    );
}
