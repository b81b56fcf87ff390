//! Once storage has grown, a frame of one thread allocates nothing, neither taking it over nor solving it.

#![allow(clippy::unwrap_used, missing_docs)]

#[path = "suite/common/allocations.rs"]
mod allocations;
#[path = "suite/common/mod.rs"]
mod common;

use allocations::ALLOCATIONS;
use capsense_core::capacitance::CapacitanceMatrix;
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::glam::{DQuat, DVec3};
use capsense_core::material::{Connection, Material};
use capsense_core::measurement::{ChannelModel, Crosstalk, Measurement, MeasurementModel};
use capsense_core::occupancy::{DepthLayers, Surfaces};
use capsense_core::sensor::Sensor;
use capsense_core::simulator::Simulator;
use capsense_core::solids::Solids;
use capsense_core::solver::{Preconditioner, SolverOptions};
use common::{bar, conductor, depth_of_boxes, dielectric, stripes_sensor, with_moved_nodes};
use std::sync::atomic::Ordering;

/// Converters with all kinds of errors: a reading allocates nothing.
fn allocations_of_readings() -> usize {
    let base = CapacitanceMatrix::from_upper(2, |row, column| if row == column { 1e-11 } else { -1e-12 });
    let channels = [(0, 0), (0, 1), (1, 1)].map(|(row, column)| ChannelModel {
        row,
        column,
        white_noise_farads: 1e-16,
        drift_farads: 1e-16,
        delay_seconds: 0.03,
        jitter_seconds: 0.01,
        ..ChannelModel::default()
    });
    let crosstalk = vec![Crosstalk { from: 0, to: 1, factor: 0.1 }];
    let model = MeasurementModel { channels: channels.to_vec(), crosstalk, ..MeasurementModel::default() };
    let mut measurement = Measurement::new(&model, 100.0, &base).unwrap();
    let start = ALLOCATIONS.load(Ordering::Relaxed);
    for frame in 0..100 {
        assert_eq!(measurement.measure(f64::from(frame) / 100.0, &base).len(), 3);
    }
    ALLOCATIONS.load(Ordering::Relaxed) - start
}

/// There and back on a way of 20 mm, 1 mm a frame.
const FRAMES: usize = 40;

fn shift(frame: usize) -> f64 {
    let frame = frame % FRAMES;
    1e-3 * frame.min(FRAMES - frame) as f64
}

/// How often it is gone. What changed in frames that could not matter is taken over together, and which these are is another on each
/// way, so what has room on the first ways may grow once more on a later one.
const WAYS: usize = 9;

/// Goes the way several times and counts the allocations of updates, and those of solves, on the last.
fn allocations<S: Surfaces>(
    sensor: Sensor,
    preconditioner: Preconditioner,
    materials: &[Material],
    mut surfaces: impl FnMut(usize) -> S,
) -> [usize; 2] {
    let options = SolverOptions { preconditioner, threads: Some(1), ..SolverOptions::default() };
    let mut simulator = Simulator::new(sensor, materials.to_vec(), options).unwrap();
    let mut counts = [0; 2];
    for frame in 0..WAYS * FRAMES {
        let surfaces = surfaces(frame);
        let start = ALLOCATIONS.load(Ordering::Relaxed);
        simulator.update(&surfaces).unwrap();
        let updated = ALLOCATIONS.load(Ordering::Relaxed);
        let _ = simulator.solve().unwrap();
        let solved = ALLOCATIONS.load(Ordering::Relaxed);
        if frame >= (WAYS - 1) * FRAMES {
            counts = [counts[0] + updated - start, counts[1] + solved - updated];
        }
    }
    counts
}

#[test]
fn frames_allocate_nothing() {
    let grounded = conductor(Connection::Grounded);
    let camera = |frame: usize| -> DepthLayers {
        depth_of_boxes([64, 64], &[bar(0.05, shift(frame)), bar(0.1 + shift(frame), 0.0)])
    };
    let shapes = [
        Shape::Box { size: DVec3::new(0.15, 0.15, 0.02) },
        Shape::Cylinder { radius: 0.02, length: 0.05 },
        Shape::Sphere { radius: 0.03 },
    ];
    let mut solids = Solids::new(&shapes).unwrap();
    let mut of_solids = |frame: usize| {
        let at = |x: f64, z: f64| DVec3::new(x, shift(frame), z);
        let turned =
            Pose { rotation: DQuat::from_rotation_x(10.0 * shift(frame)), ..Pose::at(at(0.15, 0.1)) };
        solids.place(&[Pose::at(at(0.0, 0.05)), turned, Pose::at(at(0.0, 0.2 + shift(frame)))]).unwrap();
        solids.clone()
    };
    let lattice = || stripes_sensor(10_000);
    let by_camera = allocations(lattice(), Preconditioner::Multigrid, &[grounded, dielectric(4.0)], camera);
    let materials = [grounded, dielectric(4.0), conductor(Connection::Floating)];
    let by_solids = allocations(lattice(), Preconditioner::Multigrid, &materials, &mut of_solids);
    // Off the lattice, where elements are immersed.
    let moved = with_moved_nodes(&lattice());
    let by_solids_off_lattice = allocations(moved, Preconditioner::Multigrid, &materials, &mut of_solids);
    let off_lattice = with_moved_nodes(&lattice());
    let by_camera_off_lattice =
        allocations(off_lattice, Preconditioner::Multigrid, &[grounded, dielectric(4.0)], camera);
    assert_eq!([by_solids_off_lattice, by_camera_off_lattice], [[0; 2]; 2], "off the lattice");
    // Of such permittivity that the body has a direction of its own.
    let strong = [grounded, dielectric(1e6)];
    let large = |frame: usize| {
        let low = DVec3::new(-0.08, -0.08 + shift(frame), 0.1);
        depth_of_boxes([64, 64], &[bar(0.03, 0.0), Aabb { min: low, max: low + DVec3::splat(0.16) }])
    };
    let [on_lattice, off_lattice] = [lattice(), with_moved_nodes(&lattice())]
        .map(|sensor| allocations(sensor, Preconditioner::Multigrid, &strong, large));
    assert_eq!([on_lattice, off_lattice], [[0; 2]; 2], "strong dielectrics");
    // Small enough for the Green's function: what is dense is solved in the update.
    let small = |frame: usize| {
        let at = |x: f64, z: f64| {
            let low = DVec3::new(x, shift(frame), z);
            Aabb { min: low, max: low + DVec3::splat(0.06) }
        };
        depth_of_boxes([64, 64], &[at(-0.05, 0.05), at(0.05, 0.1)])
    };
    let exact = allocations(lattice(), Preconditioner::Direct, &[grounded, dielectric(4.0)], small);
    assert_eq!([by_camera, by_solids, exact], [[0; 2]; 3], "updates and solves");
    assert_eq!(allocations_of_readings(), 0, "readings");
}
