//! What is left of a frame does not depend on the frames before it, bit for bit, and what is said to have changed is
//! what changed.

use crate::common::updater::Updater;
use crate::common::{
    DOMAIN, Dice, FLOATING, GROUNDED, bar, depth_of_boxes, dielectric, rectangle, stripes_sensor,
    without_lattice,
};
use capsense_core::geometry::Aabb;
use capsense_core::glam::{DVec2, DVec3};
use capsense_core::mesh::Lattice;
use capsense_core::occupancy::{Contact, DepthLayers, NO_OBJECT, OrthographicView, Span, Surfaces};
use capsense_core::sensor::{Sensor, SensorDesign, Wall};
use capsense_core::simulator::{Simulator, SimulatorError};
use capsense_core::solver::SolverOptions;
use proptest::prelude::*;
use std::sync::LazyLock;

/// The same sensor on a lattice and on a mesh that is not known to be one.
static MESHES: LazyLock<[Sensor; 2]> = LazyLock::new(|| {
    let lattice = stripes_sensor(6_000);
    [without_lattice(&lattice), lattice]
});

/// Fills a layer with a ball, or with what is cut out of it by a tilted plane.
fn draw_ball(depth: &mut DepthLayers, object: usize, centre: DVec3, radius: f64, tilt: f64) {
    let view = *depth.view();
    let (front, back) = depth.layer_mut(object);
    for (pixel, (front, back)) in front.iter_mut().zip(back).enumerate() {
        let from_centre = view.pixel_centre(pixel % view.width, pixel / view.width) - centre.truncate();
        let half = (radius * radius - from_centre.length_squared()).max(0.0).sqrt();
        let (low, high) = (centre.z - half.min(tilt * from_centre.x.abs()), centre.z + half);
        (*front, *back) =
            if half > 0.0 { (low as f32, high as f32) } else { (f32::INFINITY, f32::NEG_INFINITY) };
    }
}

/// Changes what one object looks like: it stays, vanishes, fills the view, jumps or is struck by noise.
fn change_at_random(depth: &mut DepthLayers, object: usize, dice: &mut Dice) {
    let misses = |(front, back): (&mut [f32], &mut [f32])| {
        front.fill(f32::INFINITY);
        back.fill(f32::NEG_INFINITY);
    };
    match dice.below(8) {
        0 => {}
        1 => misses(depth.layer_mut(object)),
        2 => {
            let (front, back) = depth.layer_mut(object);
            front.fill(dice.between(-0.1, 0.2) as f32);
            back.fill(dice.between(0.2, 0.5) as f32);
        }
        3 | 4 => {
            let (front, back) = depth.layer_mut(object);
            for _ in 0..=dice.below(6) {
                let pixel = dice.below(front.len());
                let (a, b) = (dice.between(-0.1, 0.3) as f32, dice.between(-0.1, 0.3) as f32);
                (front[pixel], back[pixel]) =
                    if a <= b { (a, b) } else { (f32::INFINITY, f32::NEG_INFINITY) };
            }
        }
        5 => {
            let step = dice.between(-2e-3, 2e-3) as f32;
            let (front, back) = depth.layer_mut(object);
            front.iter_mut().chain(back).for_each(|z| *z += step);
        }
        _ => {
            let (centre, tilt) = (dice.point(), 2.0 * dice.next());
            draw_ball(depth, object, centre, 0.02 + 0.1 * centre.x.abs(), tilt);
        }
    }
}

/// Balls without a depth image.
struct Balls(Vec<(DVec3, f64)>);

impl Surfaces for Balls {
    fn objects(&self) -> usize {
        self.0.len()
    }

    fn bounds(&self, object: usize) -> Aabb {
        let (centre, radius) = self.0[object];
        Aabb { min: centre - radius, max: centre + radius }
    }

    fn contains(&self, object: usize, point: DVec3) -> bool {
        let (centre, radius) = self.0[object];
        point.distance_squared(centre) < radius * radius * (1.0 - 1e-9)
    }

    fn span(&self, object: usize, a: DVec3, b: DVec3) -> Option<Span> {
        let (centre, radius) = self.0[object];
        let (along, from) = (b - a, a - centre);
        let half = along.dot(from) / along.length_squared();
        let outside = (from.length_squared() - radius * radius * (1.0 - 1e-9)) / along.length_squared();
        let root = (half * half - outside).max(0.0).sqrt();
        let (enter, exit) = ((-half - root).max(0.0), (-half + root).min(1.0));
        (enter < exit).then_some(Span { enter, exit })
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Three objects that overlap, appear and vanish, on a lattice and on a list, with pixels finer and coarser than
    /// the mesh.
    #[test]
    fn images_leave_no_trace(seed in any::<u64>(), width in 1..60usize, height in 1..60usize, fill in any::<bool>()) {
        let mut dice = Dice(seed);
        // Weak dielectrics are taken along lines beside an edge, alone or together.
        let dielectrics = [dielectric(4.0), dielectric(2.5), dielectric(30.0)];
        let materials = [[dielectric(4.0), GROUNDED, FLOATING], dielectrics][dice.below(2)];
        let mut updaters = MESHES.each_ref().map(|sensor| Updater::new(sensor, &materials));
        let mut depth = DepthLayers::empty(OrthographicView { domain: DOMAIN, width, height }, 3);
        for _ in 0..6 {
            (0..3).for_each(|object| change_at_random(&mut depth, object, &mut dice));
            let mut seen = depth.clone();
            if fill {
                seen.back_fill();
            }
            prop_assert_eq!(seen.validate(), Ok(()));
            updaters.iter_mut().for_each(|updater| updater.step_checked(&seen));
        }
    }

    /// Cameras that change, and surfaces without a camera.
    #[test]
    fn other_surfaces_leave_no_trace(seed in any::<u64>()) {
        let mut dice = Dice(seed);
        let materials = [GROUNDED, dielectric(30.0)];
        let mut updaters = MESHES.each_ref().map(|sensor| Updater::new(sensor, &materials));
        for frame in 0..6 {
            let balls: Vec<_> = (0..2).map(|_| (dice.point(), dice.between(0.01, 0.15))).collect();
            let (width, height) = (20 + 7 * (frame % 2), 31);
            let mut depth = DepthLayers::empty(OrthographicView { domain: DOMAIN, width, height }, 2);
            for (object, &(centre, radius)) in balls.iter().enumerate() {
                draw_ball(&mut depth, object, centre, radius, 1e9);
            }
            let without_image = dice.below(2) == 0;
            for updater in &mut updaters {
                if without_image {
                    updater.step_checked(&Balls(balls.clone()));
                } else {
                    updater.step_checked(&depth);
                }
            }
        }
    }
}

#[test]
fn other_materials_are_noticed_in_the_same_image() {
    let depth = depth_of_boxes([32, 32], &[bar(0.03, 0.0)]);
    for sensor in &*MESHES {
        let mut updater = Updater::new(sensor, &[GROUNDED]);
        for material in [GROUNDED, dielectric(3.0), dielectric(5.0), FLOATING] {
            updater.materials = vec![material];
            updater.step_checked(&depth);
        }
        updater.materials.clear();
        updater.step_checked(&Balls(Vec::new()));
    }
}

#[test]
fn a_bar_that_comes_near_changes_only_what_is_at_its_faces() {
    for sensor in &*MESHES {
        let mut updater = Updater::new(sensor, &[GROUNDED]);
        for step in 0..40 {
            updater.step_checked(&depth_of_boxes([64, 64], &[bar(0.05 - 1e-3 * f64::from(step), 0.0)]));
            updater.step_checked(&depth_of_boxes([64, 64], &[bar(0.05 - 1e-3 * f64::from(step), 0.0)]));
            assert!(updater.occupancy.changed_edges().is_empty() && updater.matrix.changed_rows().is_empty());
        }
    }
}

#[test]
fn jumps_and_short_visits_leave_no_trace() {
    let nowhere = bar(2.0, 0.0);
    for sensor in &*MESHES {
        let mut updater = Updater::new(sensor, &[GROUNDED, dielectric(80.0)]);
        for pair in [
            [nowhere, nowhere],
            [bar(0.02, -0.17), nowhere],
            [bar(0.4, 0.17), bar(0.02, -0.17)],
            [nowhere, nowhere],
            [bar(0.02, 0.0), bar(0.03, 0.01)],
            [nowhere, bar(0.03, 0.01)],
        ] {
            updater.step_checked(&depth_of_boxes([48, 33], &pair));
        }
    }
}

#[test]
fn everything_and_nothing_can_be_occupied() {
    let view = OrthographicView { domain: DOMAIN, width: 16, height: 9 };
    let empty = DepthLayers::empty(view, 1);
    let mut full = empty.clone();
    let (front, back) = full.layer_mut(0);
    front.fill(-1.0);
    back.fill(1.0);
    for sensor in &*MESHES {
        let mut updater = Updater::new(sensor, &[FLOATING]);
        for depth in [&empty, &full, &full, &empty] {
            updater.step_checked(depth);
        }
        updater.step_checked(&full);
        let held = updater.occupancy.conductors().iter().filter(|&&holder| holder != NO_OBJECT).count();
        assert_eq!(held, sensor.owners().iter().filter(|&&t| t == capsense_core::sensor::FREE).count());
        assert_eq!(updater.occupancy.contacts().len(), 3);
    }
}

#[test]
fn contacts_last_where_nothing_moves() {
    let all = |object| [0, 1, 2].map(|electrode| Contact { object, electrode });
    for sensor in &*MESHES {
        let mut updater = Updater::new(sensor, &[GROUNDED, FLOATING]);
        updater.step_checked(&depth_of_boxes([64, 64], &[bar(-0.005, 0.0), bar(0.1, 0.0)]));
        assert_eq!(updater.occupancy.contacts(), all(0));
        updater.step_checked(&depth_of_boxes([64, 64], &[bar(-0.005, 0.0), bar(0.2, 0.0)]));
        assert_eq!(updater.occupancy.contacts(), all(0), "the other moved");
        updater.step_checked(&depth_of_boxes([64, 64], &[bar(-0.005, 0.1), bar(0.2, 0.0)]));
        assert_eq!(updater.occupancy.contacts(), [Contact { object: 0, electrode: 2 }]);
        updater.step_checked(&depth_of_boxes([64, 64], &[bar(0.05, 0.1), bar(-0.005, 0.0)]));
        assert_eq!(updater.occupancy.contacts(), all(1));
    }
}

#[test]
fn a_refused_image_leaves_the_frame_before_in_force() {
    for sensor in &*MESHES {
        let fresh = Simulator::new(sensor.clone(), vec![GROUNDED], SolverOptions::default()).unwrap();
        let mut simulator = fresh.clone();
        let first = depth_of_boxes([32, 32], &[bar(0.05, 0.0)]);
        let _ = simulator.step(&first).unwrap();
        let (matrix, occupied) = (simulator.matrix().to_csr(), simulator.occupancy().clone());
        let mut broken = depth_of_boxes([32, 32], &[bar(0.03, 0.05)]);
        for (front, back) in [(f32::NAN, 0.1), (0.1, f32::NAN), (0.2, 0.1), (f32::INFINITY, 0.1)] {
            let (fronts, backs) = broken.layer_mut(0);
            (fronts[500], backs[500]) = (front, back);
            let error = simulator.step(&broken).unwrap_err();
            assert!(
                matches!(error, SimulatorError::Depth(ref depth) if depth.row == 15 && depth.column == 20)
            );
            assert_eq!(simulator.matrix().to_csr(), matrix);
            assert!(simulator.occupancy().couplings().eq(occupied.couplings()));
        }
        let next = depth_of_boxes([32, 32], &[bar(0.049, 0.0)]);
        let _ = simulator.step(&next).unwrap();
        let mut anew = fresh;
        let _ = anew.step(&next).unwrap();
        assert_eq!(simulator.matrix().to_csr(), anew.matrix().to_csr());
        assert!(simulator.occupancy().couplings().eq(anew.occupancy().couplings()));
    }
}

/// A square electrode in a lattice of 5 by 5 by 6 nodes.
fn tiny_sensor() -> Sensor {
    let electrodes = vec![rectangle("E1", [0.0, 0.0], [0.2, 0.2])];
    let design = SensorDesign { domain: DOMAIN, electrodes, substrate: None, wall: Wall::Grounded };
    let across = vec![-0.25, -0.1, 0.0, 0.1, 0.25];
    let up = vec![-0.05, 0.0, 0.05, 0.1, 0.2, 0.45];
    Sensor::on_lattice(&design, &Lattice::new([across.clone(), across, up]).unwrap()).unwrap()
}

/// In every frame one pixel of one of two objects is another.
fn a_million_frames_leave_no_trace(sensor: &Sensor) {
    let mut updater = Updater::new(sensor, &[GROUNDED, dielectric(50.0)]);
    let mut depth = DepthLayers::empty(OrthographicView { domain: DOMAIN, width: 5, height: 4 }, 2);
    let mut dice = Dice(7);
    for frame in 1..=1_000_000 {
        let (front, back) = depth.layer_mut(dice.below(2));
        let pixel = dice.below(front.len());
        let (a, b) = (dice.between(0.0, 0.2) as f32, dice.between(0.0, 0.2) as f32);
        (front[pixel], back[pixel]) = if a <= b { (a, b) } else { (f32::INFINITY, f32::NEG_INFINITY) };
        updater.step(&depth);
        if frame % 100_000 == 0 {
            assert!(updater.occupancy.linked_edges().len() > 10, "something is there");
            updater.assert_is_fresh(&depth);
        }
    }
}

#[test]
fn a_million_frames_leave_no_trace_on_a_lattice() {
    a_million_frames_leave_no_trace(&tiny_sensor());
}

#[test]
fn a_million_frames_leave_no_trace_on_a_list() {
    a_million_frames_leave_no_trace(&without_lattice(&tiny_sensor()));
}

#[test]
fn points_beyond_the_view_are_not_seen() {
    let view = OrthographicView { domain: DOMAIN, width: 8, height: 8 };
    let mut depth = DepthLayers::empty(view, 1);
    let (front, back) = depth.layer_mut(0);
    front.fill(0.0);
    back.fill(0.1);
    let rim = DVec2::splat(0.25);
    assert!(depth.contains(0, rim.extend(0.05)), "the rim is part of the image");
    assert!(!depth.contains(0, (rim * 1.01).extend(0.05)));
    let span = depth.span(0, DVec3::new(0.0, 0.0, 0.05), DVec3::new(0.5, 0.0, 0.05)).unwrap();
    assert!(span.enter == 0.0 && (span.exit - 0.5).abs() < 1e-3, "{span:?}");
}
