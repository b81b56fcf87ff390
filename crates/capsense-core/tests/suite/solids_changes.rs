//! What is found to have changed when solids move is all that did.

use crate::common::shapes::{LENGTH, RADIUS, SIZE, all_shapes, at, pose, rotation};
use crate::common::updater::Updater;
use crate::common::{
    Dice, bar, conductor, depth_of_boxes, dielectric, stripes_sensor, three_stripes, with_moved_nodes,
    without_lattice,
};
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::glam::{DQuat, DVec3};
use capsense_core::material::Connection;
use capsense_core::mesh::Lattice;
use capsense_core::occupancy::{Earlier, Regions, Surfaces};
use capsense_core::sensor::Sensor;
use capsense_core::solids::Solids;
use proptest::prelude::*;
use std::sync::LazyLock;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

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

/// Whether an edge of a bar is beside a node must not be told from so far away that nobody looks again when it moves: cells
/// are several times as wide as high, and a box around them that is turned like the bar is much higher.
#[test]
fn a_tilted_bar_leaves_no_trace() {
    let sensor = stripes_sensor(30_000);
    let mut solids = Solids::new(&[Shape::Box { size: DVec3::new(0.15, 0.15, 0.02) }]).unwrap();
    let mut updater = Updater::new(&sensor, &[conductor(Connection::Grounded)]);
    let turn = DQuat::from_rotation_x(0.3) * DQuat::from_rotation_z(0.35);
    for millimetres in 0..60 {
        let place = DVec3::new(0.0, 0.0, 0.12 - 1e-3 * f64::from(millimetres));
        solids.place(&[Pose { rotation: turn, ..Pose::at(place) }]).unwrap();
        updater.step_checked(&solids);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Solids that rest, creep, turn, jump and leave, on a lattice, on lists of edges, and the camera in between.
    #[test]
    fn moves_leave_no_trace(seed in any::<u64>()) {
        static MESHES: LazyLock<[Sensor; 3]> = LazyLock::new(|| {
            let lattice = stripes_sensor(6_000);
            [without_lattice(&lattice), with_moved_nodes(&lattice), lattice]
        });
        let mut dice = Dice(seed);
        let with_conductors =
            [dielectric(4.0), conductor(Connection::Grounded), conductor(Connection::Floating)];
        let dielectrics = [dielectric(4.0), dielectric(2.5), dielectric(30.0)];
        let strong = [dielectric(80.0), dielectric(30.0), dielectric(1e4)];
        // A conductor alone: elements do not scale their negative weights then.
        let materials = [&with_conductors[..], &dielectrics, &strong, &with_conductors[1..2]][dice.below(4)];
        let shapes = all_shapes();
        let shapes: Vec<_> = materials.iter().map(|_| shapes[dice.below(shapes.len())].clone()).collect();
        let mut solids = Solids::new(&shapes).unwrap();
        let mut poses = vec![Pose::IDENTITY; shapes.len()];
        let mut updaters = MESHES.each_ref().map(|sensor| Updater::new(sensor, materials));
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
            let image = (dice.below(6) == 0).then(|| depth_of_boxes([24, 24], &vec![bar(0.05, 0.0); shapes.len()]));
            for updater in &mut updaters {
                let surfaces: &dyn Surfaces = image.as_ref().map_or(&solids, |image| image);
                updater.step_checked(surfaces);
            }
        }
    }
}

/// Moving along its own faces a bar cuts the edges beside them as before, but near its ends the field there is another.
#[test]
fn a_bar_that_slides_leaves_no_trace() {
    let mut bar = Solids::new(&[Shape::Box { size: DVec3::new(0.15, 0.15, 0.02) }]).unwrap();
    let upwards = (0..60).map(|k| DVec3::new(0.0, 0.0, 0.03 + 0.0005 * f64::from(k)));
    let sideways = (0..60).map(|k| DVec3::new(0.0, 0.01 + 0.0005 * f64::from(k), 0.045));
    let sensor = stripes_sensor(30_000);
    let mut updater = Updater::new(&sensor, &[conductor(Connection::Grounded)]);
    for translation in upwards.chain(sideways) {
        bar.place(&[Pose::at(translation)]).unwrap();
        updater.step_checked(&bar);
    }
}

/// Ends of floating plates change weights as far as two cells away, as long as plates are level and nothing else is near.
#[test]
fn floating_plates_leave_no_trace() {
    let plate = |height| Shape::Box { size: DVec3::new(0.15, 0.12, height) };
    let mut solids = Solids::new(&[plate(0.02), plate(0.01)]).unwrap();
    let sensor = stripes_sensor(10_000);
    let mut updater =
        Updater::new(&sensor, &[conductor(Connection::Floating), conductor(Connection::Capacitance(1e-12))]);
    let away = Pose::at(DVec3::new(0.0, 0.0, 3.0));
    let rises = (0..40).map(|k| Pose::at(DVec3::new(0.0, 0.01, 0.1 + 0.0015 * f64::from(k))));
    let slides = (0..30).map(|k| Pose::at(DVec3::new(0.002 * f64::from(k), 0.01, 0.16)));
    let turns = (0..20).map(|k| Pose {
        rotation: DQuat::from_rotation_z(0.1 * f64::from(k)),
        ..Pose::at(DVec3::new(0.06, 0.01, 0.16))
    });
    let tilts = (0..30).map(|k| Pose {
        rotation: DQuat::from_rotation_y(0.003 * f64::from(k)),
        ..Pose::at(DVec3::new(0.03, 0.01, 0.16))
    });
    let stands = std::iter::once(Pose {
        rotation: DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2),
        ..Pose::at(DVec3::new(0.0, 0.01, 0.16))
    });
    for pose in rises.chain(slides).chain(turns).chain(tilts).chain(stands) {
        solids.place(&[pose, away]).unwrap();
        updater.step_checked(&solids);
    }
    // One passes the other, which stands still, and leaves.
    let still = Pose::at(DVec3::new(0.0, 0.0, 0.15));
    let passes =
        (0..40).map(|k| Pose::at(DVec3::new(0.0, 0.005 * f64::from(k) - 0.1, 0.3 - 0.005 * f64::from(k))));
    for pose in passes.chain([away]) {
        solids.place(&[still, pose]).unwrap();
        updater.step_checked(&solids);
    }
}

/// What the ends of a floating plate change of weights does not jump as it moves, turns and rises past columns and rows of nodes.
#[test]
fn what_floating_plates_change_does_not_jump() {
    let mut plate = Solids::new(&[Shape::Box { size: DVec3::new(0.15, 0.14, 0.015) }]).unwrap();
    let sensor = stripes_sensor(20_000);
    let updater = |connection| Updater::new(&sensor, &[conductor(connection)]);
    let slide = |k: f64| Pose::at(DVec3::new(0.2 * k - 0.06, 0.03 * k, 0.14 + 0.03 * k));
    let turn = |k: f64| Pose { rotation: DQuat::from_rotation_z(k), ..slide(0.3 + 0.1 * k) };
    let leave = |k: f64| Pose::at(DVec3::new(0.02, 0.1 + 0.25 * k, 0.15));
    let (mut floating, mut grounded) = (updater(Connection::Floating), updater(Connection::Grounded));
    for way in [&slide as &dyn Fn(f64) -> Pose, &turn, &leave] {
        let (mut before, mut most_changed) = (Vec::<f64>::new(), 0.0_f64);
        for frame in 0..800 {
            plate.place(&[way(1.25e-3 * f64::from(frame))]).unwrap();
            floating.step(&plate);
            grounded.step(&plate);
            let pairs = floating.occupancy.couplings().zip(grounded.occupancy.couplings());
            let parts = pairs.map(|(floating, grounded)| match grounded.through > 0.0 {
                true => floating.through / grounded.through,
                false => 1.0,
            });
            let parts: Vec<f64> = parts.collect();
            for (edge, (before, now)) in before.iter().zip(&parts).enumerate() {
                assert!((now - before).abs() < 0.12, "{frame} {edge}: {before} {now}");
                most_changed = most_changed.max((now - 1.0).abs());
            }
            before = parts;
        }
        assert!(most_changed > 0.2, "{most_changed}");
    }
}

/// Nodes beside a cylinder are looked at again wherever it goes, not those near its rims alone.
#[test]
fn a_cylinder_leaves_no_trace() {
    let mut cylinder = Solids::new(&[Shape::Cylinder { radius: 0.1, length: 0.1 }]).unwrap();
    for sensor in [stripes_sensor(60_000), stripes_sensor(20_000).off_lattice()] {
        let mut updater = Updater::new(&sensor, &[conductor(Connection::Grounded)]);
        for way in [DVec3::Z, DVec3::X, DVec3::new(0.3, 1.0, 0.5)] {
            for frame in 0..20 {
                let place = DVec3::new(0.01, 0.0, 0.14) + 5e-4 * f64::from(frame) * way;
                cylinder.place(&[Pose::at(place)]).unwrap();
                updater.step_checked(&cylinder);
            }
        }
    }
}

/// Nor does one whose ends are those of a capsule, of which nodes before them know how far they are from its axis: where cells are high, more
/// than two of them are between these and its rims.
#[test]
fn a_slim_cylinder_leaves_no_trace_as_it_slides_across_its_axis() {
    let mut cylinder = Solids::new(&[Shape::Cylinder { radius: 0.028, length: 0.1 }]).unwrap();
    let design = three_stripes();
    let axis = |axis: usize, cells: i32| -> Vec<f64> {
        let (low, high) = (design.domain.min[axis], design.domain.max[axis]);
        (0..=cells).map(|k| low + (high - low) * f64::from(k) / f64::from(cells)).collect()
    };
    let lattice = Lattice::new([axis(0, 150), axis(1, 150), axis(2, 10)]).unwrap();
    let sensor = Sensor::on_lattice(&design, &lattice).unwrap();
    let mut updater = Updater::new(&sensor, &[conductor(Connection::Grounded)]);
    for way in [DVec3::X, DVec3::Y] {
        for frame in 0..10 {
            cylinder.place(&[Pose::at(DVec3::new(0.0, 0.0, 0.142) + 5e-4 * f64::from(frame) * way)]).unwrap();
            updater.step_checked(&cylinder);
        }
    }
}

/// Faces of strong dielectrics come to lie in planes of nodes, leave them by less and by more than edges are wide, and come again.
#[test]
fn faces_in_planes_of_nodes_leave_no_trace() {
    let sensor = stripes_sensor(6_000);
    let size = DVec3::new(0.15, 0.15, 0.02);
    let mut solids = Solids::new(&[Shape::Box { size }]).unwrap();
    let mut updater = Updater::new(&sensor, &[dielectric(80.0)]);
    let heights = sensor.mesh().nodes().iter().map(|node| node.z).filter(|z| (0.01..0.2).contains(z));
    let mut heights: Vec<f64> = heights.collect();
    heights.sort_unstable_by(f64::total_cmp);
    heights.dedup();
    assert!(heights.len() > 2, "{heights:?}");
    for height in heights {
        for away in [0.0, 1e-12, -1e-10, 3e-10, 2e-9, -1e-3, 0.0, 2e-9, 0.0, -3e-10] {
            solids.place(&[Pose::at(DVec3::new(0.0, 0.0, height + away + 0.5 * size.z))]).unwrap();
            updater.step_checked(&solids);
        }
    }
}

#[test]
fn solids_at_rest_change_nothing() {
    let sensor = stripes_sensor(6_000);
    let materials = [conductor(Connection::Grounded); 6];
    let mut updater = Updater::new(&sensor, &materials);
    let poses: Vec<_> = (0..6).map(|k| Pose::at(DVec3::new(0.0, 0.0, 0.05 + 0.03 * f64::from(k)))).collect();
    let solids = at(&all_shapes(), &poses);
    updater.step(&solids);
    assert!(!updater.occupancy.changed_edges().is_empty());
    updater.step(&solids.clone());
    assert!(updater.occupancy.changed_edges().is_empty());
}
