//! Whole frames of solids on the device, poses in and capacitances out, against the processor's.

use super::super::finder::Objects;
use super::super::gpu::GpuFields;
use super::tests::{GROUNDED, any_object, dice, dielectric, sensor};
use crate::error::RenderError;
use capsense_core::batch::Batch;
use capsense_core::capacitance::CapacitanceMatrix;
use capsense_core::geometry::{Pose, Shape, TriangleMesh};
use capsense_core::material::{Connection, Material};
use capsense_core::occupancy::Interface;
use capsense_core::sensor::Sensor;
use capsense_core::simulator::Simulator;
use capsense_core::solids::Solids;
use capsense_core::solver::{Preconditioner, SolverOptions};
use glam::{DQuat, DVec3};
use proptest::strategy::{Strategy, ValueTree};
use std::sync::Arc;

const FLOATING: Material = Material::Conductor(Connection::Floating);
const TIED: Material = Material::Conductor(Connection::Capacitance(1e-12));

/// Errors of capacitances that are asked for, and that any may have.
const OPTIONS: SolverOptions = SolverOptions {
    tolerance: 1e-5,
    change_tolerance: None,
    preconditioner: Preconditioner::Multigrid,
    max_iterations: 1000,
    threads: Some(1),
};
const ERROR: f64 = 1e-5;

fn on_device(sensor: &Sensor, gpu: &GpuFields, scene: usize, materials: &[Material]) -> Simulator {
    let columns = Simulator::remote_problem(sensor, materials).unwrap().columns;
    let fields = gpu.scene(scene, columns).unwrap();
    Simulator::with_remote(sensor.clone(), materials.to_vec(), OPTIONS, Interface::EdgeCut, fields).unwrap()
}

/// The largest difference of capacitances in relation to self-capacitances.
fn difference(a: &CapacitanceMatrix, b: &CapacitanceMatrix) -> f64 {
    let entries = (0..a.size()).flat_map(|i| (0..a.size()).map(move |j| (i, j)));
    entries
        .map(|(i, j)| (a.get(i, j) - b.get(i, j)).abs() / (b.get(i, i) * b.get(j, j)).sqrt())
        .fold(0.0, f64::max)
}

/// Objects of any shape that are anywhere in each frame, also where they overlap or touch electrodes.
#[test]
fn capacitances_of_any_solids_are_those_of_the_processor() {
    let all = [
        vec![GROUNDED],
        vec![FLOATING, dielectric(3.0)],
        vec![TIED, GROUNDED],
        vec![dielectric(80.0), dielectric(4.0), FLOATING],
    ];
    let mut dice = dice();
    for (number, materials) in all.into_iter().enumerate() {
        let is_large = number == 0;
        let sensor = sensor(if is_large { 75_000 } else { 9_000 }, number % 2 == 1);
        let mut throw = || any_object().new_tree(&mut dice).unwrap().current();
        let shapes: Vec<Shape> = materials.iter().map(|_| throw().0).collect();
        let problem = Simulator::remote_problem(&sensor, &materials).unwrap();
        let objects = Objects { shapes: shapes.clone(), materials: materials.clone() };
        let gpu = GpuFields::with_solids((&problem, &sensor), &[objects], true).unwrap();
        let mut ours = on_device(&sensor, &gpu, 0, &materials);
        let exact = SolverOptions { tolerance: 1e-10, ..OPTIONS };
        let mut expected = Simulator::new(sensor, materials.clone(), exact).unwrap();
        let mut solids = Solids::new(&shapes).unwrap();
        for frame in 0..5 {
            let poses: Vec<Pose> = materials.iter().map(|_| throw().1).collect();
            solids.place(&poses).unwrap();
            let theirs = expected.step(&solids).unwrap();
            assert!(gpu.place(0, &poses).unwrap());
            let report = ours.step_elsewhere().unwrap();
            assert_eq!(ours.contacts(), expected.contacts(), "{shapes:?} {poses:?}");
            let edges = [report.changed_edges, theirs.changed_edges].map(|edges| edges as f64);
            assert!((edges[0] - edges[1]).abs() <= 2.0 + 0.02 * edges[1], "{edges:?} edges changed");
            let apart = difference(ours.capacitance(), expected.capacitance());
            let moved = difference(expected.capacitance(), expected.base());
            println!("{materials:?}, frame {frame}: {apart:.1e} of {moved:.1e}, {:?}", report.solve);
            // What touches an electrode has capacitances of a gap that is none.
            let most = if ours.contacts().is_empty() { ERROR } else { 1e-3 };
            assert!(apart < most, "{shapes:?} {poses:?}: {apart:e}, {report:?}");
        }
    }
}

/// Scenes of a batch have the bits that each has alone.
#[test]
fn solids_of_a_batch_have_the_bits_of_each_alone() {
    let sensor = sensor(9_000, false);
    let scene = |shape: Shape, material| Objects { shapes: vec![shape], materials: vec![material] };
    let scenes = [
        scene(Shape::Box { size: DVec3::new(0.15, 0.05, 0.05) }, GROUNDED),
        scene(Shape::Cylinder { radius: 0.03, length: 0.1 }, FLOATING),
        scene(Shape::Capsule { radius: 0.02, length: 0.1 }, dielectric(4.0)),
    ];
    let problem = Simulator::remote_problem(&sensor, &[FLOATING]).unwrap();
    let pose = |scene: usize, frame: usize| Pose {
        translation: DVec3::new(0.01 * scene as f64, 0.0, 0.09 - 0.01 * frame as f64),
        rotation: DQuat::from_rotation_x(0.2 + 0.1 * frame as f64),
    };
    let together = GpuFields::with_solids((&problem, &sensor), &scenes, true).unwrap();
    let of_batch = |scene: usize| on_device(&sensor, &together, scene, &scenes[scene].materials);
    let mut batch = Batch::new((0..3).map(of_batch).collect());
    let mut in_batch = Vec::new();
    for frame in 0..2 {
        (0..3).for_each(|scene| assert!(together.place(scene, &[pose(scene, frame)]).unwrap()));
        assert!(batch.step_elsewhere().into_iter().all(|report| report.is_ok()));
        in_batch.push(batch.simulators().iter().map(|one| one.capacitance().clone()).collect::<Vec<_>>());
    }
    for (scene, objects) in scenes.iter().enumerate() {
        let alone = GpuFields::with_solids((&problem, &sensor), std::slice::from_ref(objects), true).unwrap();
        let mut simulator = on_device(&sensor, &alone, 0, &objects.materials);
        for (frame, in_batch) in in_batch.iter().enumerate() {
            assert!(alone.place(0, &[pose(scene, frame)]).unwrap());
            let _ = simulator.step_elsewhere().unwrap();
            assert_eq!(&in_batch[scene], simulator.capacitance(), "scene {scene}, frame {frame}");
        }
    }
}

/// What is no box, sphere, capsule or cylinder is told before any frame, as are lengths that are none.
#[test]
fn other_shapes_are_refused() {
    let sensor = sensor(1_000, false);
    let problem = Simulator::remote_problem(&sensor, &[GROUNDED]).unwrap();
    let refused = |shape: Shape| {
        let objects = Objects { shapes: vec![shape], materials: vec![GROUNDED] };
        GpuFields::with_solids((&problem, &sensor), &[objects], true).unwrap_err()
    };
    let corners = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    let faces = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    let mesh = Arc::new(TriangleMesh::new(corners, faces).unwrap());
    assert_eq!(refused(Shape::Mesh(mesh)), RenderError::NotConvex { object: 0 });
    // Twelve triangles around a box are one.
    let corners =
        (0..8).map(|k| 0.1 * DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2)));
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let faces = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let mesh = Shape::Mesh(Arc::new(TriangleMesh::new(corners.collect(), faces).unwrap()));
    let objects = Objects { shapes: vec![mesh], materials: vec![GROUNDED] };
    assert!(GpuFields::with_solids((&problem, &sensor), &[objects], true).is_ok());
    let error = refused(Shape::Sphere { radius: -1.0 });
    assert!(matches!(error, RenderError::Shape { object: 0, .. }), "{error}");
}
