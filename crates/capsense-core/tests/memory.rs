//! What a simulator keeps once frames have been solved, the mesh included: so many bytes a tetrahedron and no more.

#![allow(clippy::unwrap_used, missing_docs)]

#[path = "suite/common/allocations.rs"]
mod allocations;
#[path = "suite/common/mod.rs"]
mod common;

use allocations::BYTES;
use capsense_core::electrode::{Electrode, Outline};
use capsense_core::geometry::Aabb;
use capsense_core::glam::{DVec2, DVec3};
use capsense_core::material::Connection;
use capsense_core::sensor::{Sensor, SensorDesign, Wall};
use capsense_core::simulator::Simulator;
use capsense_core::solver::SolverOptions;
use common::{bar, conductor, depth_of_boxes, with_moved_nodes};
use std::sync::atomic::Ordering;

/// Most bytes a tetrahedron: on lattices of so many, and on any mesh. The fewer there are the more rows of a lattice are rounded up.
const ON_LATTICES: [(usize, f64); 2] = [(10_000, 121.0), (30_000, 90.0)];
const ON_ANY_MESH: f64 = 500.0;

/// Three electrodes, on a mesh that a scene of so many tetrahedra at most would have.
fn sensor(tets: usize) -> Sensor {
    let electrode = |y| {
        let outline = Outline::Rectangle { center: DVec2::new(0.0, y), size: DVec2::new(0.1, 0.02) };
        Electrode { name: format!("E{y}"), outline, z: 0.0 }
    };
    let design = SensorDesign {
        domain: Aabb { min: DVec3::new(-0.25, -0.25, -0.05), max: DVec3::new(0.25, 0.25, 0.45) },
        electrodes: [-0.03, 0.0, 0.03].map(electrode).to_vec(),
        substrate: None,
        wall: Wall::Grounded,
    };
    Sensor::on_lattice(&design, &design.lattice(tets).unwrap()).unwrap()
}

/// Bytes a tetrahedron of a simulator that has seen a bar come nearer for five frames.
fn bytes(sensor: impl FnOnce() -> Sensor) -> f64 {
    let before = BYTES.load(Ordering::Relaxed);
    let options = SolverOptions { threads: Some(1), ..SolverOptions::default() };
    let mut simulator = Simulator::new(sensor(), vec![conductor(Connection::Grounded)], options).unwrap();
    for frame in 0..5 {
        let seen = depth_of_boxes([64, 64], &[bar(0.11 - 1e-3 * f64::from(frame), 0.0)]);
        let _ = simulator.step(&seen).unwrap();
    }
    let after = BYTES.load(Ordering::Relaxed);
    (after - before) as f64 / simulator.sensor().mesh().tets().len() as f64
}

#[test]
fn a_simulator_keeps_so_many_bytes_a_tetrahedron() {
    for (tets, most) in ON_LATTICES {
        let on_lattice = bytes(|| sensor(tets));
        eprintln!("bytes a tetrahedron on a lattice of {tets}: {on_lattice:.1}");
        assert!(on_lattice < most, "{tets}: {on_lattice}");
    }
    let plain = bytes(|| sensor(30_000).off_lattice());
    // With edges that a lattice has not, and tables of elements with obtuse angles.
    let moved = bytes(|| with_moved_nodes(&sensor(30_000)));
    eprintln!("bytes a tetrahedron of other meshes: {plain:.1} and {moved:.1}");
    assert!(plain < ON_ANY_MESH && moved < ON_ANY_MESH, "{plain} {moved}");
}
