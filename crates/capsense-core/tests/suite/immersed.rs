//! Elements that weak dielectrics cut, on meshes that are no lattice: what is left of a frame does not depend on those before it, nothing
//! jumps, and bodies with corners and thin ones are better than by edges alone. Spheres are in `tests/suite/sphere.rs`.

use crate::common::updater::Updater;
use crate::common::walled::{Body, Held, Rule, WalledBox};
use crate::common::{
    Dice, FLOATING, GROUNDED, depth_of_boxes, dielectric, stripes_sensor, to, with_moved_nodes,
};
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::glam::{DQuat, DVec3, EulerRot};
use capsense_core::material::Material;
use capsense_core::mesh::{Lattice, TetMesh};
use capsense_core::occupancy::Surfaces;
use capsense_core::sensor::Sensor;
use capsense_core::simulator::Simulator;
use capsense_core::solids::Solids;
use proptest::prelude::*;
use std::sync::LazyLock;

static SENSOR: LazyLock<Sensor> = LazyLock::new(|| with_moved_nodes(&stripes_sensor(6_000)));

fn turned() -> DQuat {
    DQuat::from_euler(EulerRot::XYZ, 0.4, 0.3, 0.5)
}

fn sphere() -> Shape {
    Shape::Sphere { radius: 0.03 }
}

fn block() -> Shape {
    Shape::Box { size: DVec3::new(0.08, 0.08, 0.04) }
}

fn sheet() -> Shape {
    Shape::Box { size: DVec3::new(0.15, 0.15, 0.005) }
}

fn any_pose(dice: &mut Dice) -> Pose {
    Pose { translation: dice.point(), rotation: DQuat::from_rotation_y(dice.between(-3.0, 3.0)) }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Weak bodies by themselves, together, and with conductors that come near; some of them stay where they are.
    #[test]
    fn frames_leave_no_trace(seed in any::<u64>()) {
        let mut dice = Dice(seed);
        let of: [[Material; 3]; 3] = [
            [dielectric(2.0), GROUNDED, FLOATING],
            [dielectric(3.0), dielectric(6.0), GROUNDED],
            [dielectric(0.5), dielectric(2.0), dielectric(30.0)],
        ];
        let mut updater = Updater::new(&SENSOR, &of[dice.below(3)]);
        let mut solids = Solids::new(&[block(), sphere(), sheet()]).unwrap();
        let mut poses = [(); 3].map(|()| any_pose(&mut dice));
        for _ in 0..8 {
            let moved = dice.below(3);
            poses[moved] = any_pose(&mut dice);
            solids.place(&poses).unwrap();
            updater.step_checked(&solids);
        }
        for _ in 0..3 {
            let boxes = [(); 3].map(|()| {
                let at = dice.point();
                Aabb { min: at, max: at + 0.05 }
            });
            updater.step_checked(&depth_of_boxes([31, 47], &boxes));
        }
    }
}

/// A conductor that comes near a weak body without touching what it cuts: elements of the body feel it, and forget it.
#[test]
fn what_comes_near_is_noticed() {
    let mut updater = Updater::new(&SENSOR, &[dielectric(2.0), GROUNDED]);
    let mut solids = Solids::new(&[block(), sphere()]).unwrap();
    let mut changed = 0;
    for step in 0..30 {
        let away = 0.2 - 5e-3 * f64::from(step);
        solids
            .place(&[Pose::at(DVec3::new(0.0, 0.0, 0.05)), Pose::at(DVec3::new(0.0, 0.0, 0.102 + away))])
            .unwrap();
        let before = updater.clone();
        updater.step_checked(&solids);
        let edges = updater.network.edges();
        let is_of_block = |edge: usize| {
            let [a, b] = edges.ends(edge).unwrap().map(|node| SENSOR.mesh().nodes()[node as usize]);
            solids.span(0, a, b).is_some() && solids.span(1, a, b).is_none()
        };
        let differs = |edge: usize| updater.occupancy.coupling(edge) != before.occupancy.coupling(edge);
        changed += (0..edges.len()).filter(|&edge| differs(edge) && is_of_block(edge)).count();
    }
    assert!(changed > 100, "{changed}");
}

/// The largest step of the sum of self-capacitances on a way in small steps, and the largest when the two steps that differ most are made in
/// 256 parts.
fn largest_steps(shape: &Shape, rotation: DQuat, along: DVec3) -> [f64; 2] {
    let mut simulator = Simulator::new(SENSOR.clone(), vec![dielectric(3.0)], to(1e-10)).unwrap();
    let mut solids = Solids::new(std::slice::from_ref(shape)).unwrap();
    let mut at = |way: f64| {
        solids
            .place(&[Pose { translation: DVec3::new(0.004, 0.003, 0.05) + way * along, rotation }])
            .unwrap();
        let _ = simulator.step(&solids).unwrap();
        (0..3).map(|e| simulator.capacitance().get(e, e)).sum::<f64>()
    };
    let mut steps = |from: f64, step: f64, count: u32| -> Vec<f64> {
        let values: Vec<f64> = (0..=count).map(|k| at(from + step * f64::from(k))).collect();
        values.windows(2).map(|pair| pair[1] - pair[0]).collect()
    };
    let largest = |steps: &[f64]| steps.iter().fold(0.0, |largest: f64, step| largest.max(step.abs()));
    const STEP: f64 = 0.5e-3;
    let coarse = steps(0.0, STEP, 120);
    let kinks = coarse.windows(2).map(|pair| (pair[1] - pair[0]).abs()).zip(0..);
    let (_, place) = kinks.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
    [largest(&coarse), largest(&steps(STEP * f64::from(place), STEP / 128.0, 256))]
}

/// A jump would be as large in a small step as in a large one. A 128th of a large step would be the least.
#[test]
fn weak_bodies_move_without_jumps() {
    let shapes = [("sphere", sphere()), ("block", block()), ("sheet", sheet())];
    for (name, shape) in &shapes {
        for rotation in [DQuat::IDENTITY, turned()] {
            for along in [DVec3::new(0.1, 1.0, 0.03), DVec3::new(0.03, 0.05, 1.0)] {
                let [coarse, fine] = largest_steps(shape, rotation, along);
                println!("{name}, {along}: {:.3}", fine / coarse);
                assert!(fine < 0.15 * coarse, "{name}, {along}: {coarse} {fine}");
            }
        }
    }
}

/// Cubes of 1/20, cut into tetrahedra, their inner nodes moved.
fn moved() -> TetMesh {
    let cube = Aabb { min: DVec3::splat(-0.5), max: DVec3::splat(0.5) };
    let mesh = Lattice::uniform(cube, [20; 3]).unwrap().to_tet_mesh().unwrap();
    let mut dice = Dice(3);
    let mut step = || dice.between(-0.007, 0.007);
    let nodes = mesh.nodes().iter().map(|&p| {
        let shift = DVec3::new(step(), step(), step());
        if p.abs().max_element() < 0.49 { p + shift } else { p }
    });
    TetMesh::new(nodes.collect(), mesh.tets().to_vec()).unwrap()
}

/// What a body adds to the energies of uniform fields along the axes.
fn added(space: &WalledBox) -> DVec3 {
    let along = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| move |p: DVec3| axis.dot(p));
    let problems = along.each_ref().map(|wall| Held { wall, bodies: &[0.0] });
    let solved = space.solve(&problems);
    DVec3::from_array([0, 1, 2].map(|axis| solved.energy(axis, axis) - 1.0))
}

/// Root mean squares of the errors in three fields, against a lattice of 48 cells a side.
#[test]
fn corners_and_thin_bodies_are_better_than_by_edges_alone() {
    let cube = Aabb { min: DVec3::splat(-0.5), max: DVec3::splat(0.5) };
    let (fine, mesh) = (Lattice::uniform(cube, [48; 3]).unwrap(), moved());
    let block = || Shape::Box { size: DVec3::new(12.0, 12.0, 8.0) / 48.0 };
    let plate = || Shape::Box { size: DVec3::new(16.0, 16.0, 4.0) / 48.0 };
    for (name, shape, rotation) in [
        ("block", block(), DQuat::IDENTITY),
        ("block, turned", block(), turned()),
        ("plate", plate(), DQuat::IDENTITY),
        ("plate, turned", plate(), turned()),
    ] {
        for permittivity in [2.0, 4.0] {
            let pose = Pose { translation: DVec3::new(0.013, -0.008, 0.011), rotation };
            let body = || [Body { shape: shape.clone(), pose, material: dielectric(permittivity) }];
            let truth = added(&WalledBox::new(&fine, &body(), Rule::AsSolids));
            let [alone, immersed] = [Rule::EdgesAlone, Rule::AsSolids].map(|rule| {
                let error = added(&WalledBox::on_mesh(&mesh, &body(), rule)) / truth - 1.0;
                100.0 * error.length() / f64::sqrt(3.0)
            });
            println!("| {name}, {permittivity} | {alone:.1} | {immersed:.1} |");
            let most = if permittivity < 4.0 { 0.7 * alone } else { 1.3 * alone };
            assert!(immersed < f64::min(5.0, most), "{name}, {permittivity}: {alone} {immersed}");
        }
    }
}
