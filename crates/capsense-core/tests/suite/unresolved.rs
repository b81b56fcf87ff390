//! Bodies that the mesh is too coarse for are told, because error bars do not know them: those that are told are wrong, and
//! those that are not are within reason.

use crate::common::{FLOATING, GROUNDED, both, dielectric, on_three_meshes, stripes_sensor, to};
use capsense_core::geometry::{Pose, Shape};
use capsense_core::glam::{DQuat, DVec3};
use capsense_core::material::Material;
use capsense_core::occupancy::Interface;
use capsense_core::sensor::Sensor;
use capsense_core::simulator::Simulator;
use capsense_core::solids::Solids;

const INTERFACES: [Interface; 3] = [Interface::EdgeCut, Interface::Centroid, Interface::VolumeFraction];

fn plate(thickness: f64, at: DVec3, degrees: f64) -> Solids {
    let size = DVec3::new(0.3, 0.3, thickness);
    let mut solids = Solids::new(&[Shape::Box { size }]).unwrap();
    let rotation = DQuat::from_rotation_x(degrees.to_radians());
    solids.place(&[Pose { translation: at, rotation }]).unwrap();
    solids
}

fn is_unresolved(sensor: &Sensor, interface: Interface, material: Material, solids: &Solids) -> bool {
    let simulator = Simulator::with_interface(sensor.clone(), vec![material], to(1e-4), interface).unwrap();
    simulator.unresolved(solids) == [0]
}

#[test]
fn plates_thinner_than_cells_are_told_where_they_are_lost() {
    for sensor in both(stripes_sensor(9_000)) {
        let heights: Vec<f64> = sensor.mesh().nodes().iter().map(|node| node.z).collect();
        let on_nodes = heights.into_iter().filter(|z| *z > 0.03).fold(f64::INFINITY, f64::min);
        for (z, degrees) in [(0.0437, 0.0), (0.06, 20.0), (on_nodes, 0.0)] {
            for interface in INTERFACES {
                for (material, is_lost) in [
                    (dielectric(80.0), true),
                    (GROUNDED, interface != Interface::EdgeCut),
                    (FLOATING, interface != Interface::EdgeCut),
                ] {
                    let case = format!("{interface:?} {material:?} at {z}, {degrees} degrees");
                    let told = |thickness, z| {
                        let solids = plate(thickness, DVec3::new(0.0, 0.0, z), degrees);
                        is_unresolved(&sensor, interface, material, &solids)
                    };
                    assert_eq!(told(1e-3, z), is_lost, "{case}");
                    assert!(degrees > 0.0 || !told(0.3, 0.2), "thick, {case}");
                    assert!(!told(1e-3, 2.0), "out of the domain, {case}");
                }
            }
        }
    }
}

/// What a mesh sees of a body follows from its nodes, not from how often its edges are looked at.
#[test]
fn plates_as_thick_as_cells_are_told_alike_on_and_off_lattices() {
    let sensors = both(stripes_sensor(9_000));
    let mut told = 0;
    for thickness in [0.005, 0.01, 0.02, 0.04, 0.06] {
        for interface in INTERFACES {
            for material in [dielectric(80.0), GROUNDED] {
                let solids = plate(thickness, DVec3::new(0.0, 0.0, 0.0437), 0.0);
                let [off_lattice, lattice] =
                    [0, 1].map(|k| is_unresolved(&sensors[k], interface, material, &solids));
                assert_eq!(off_lattice, lattice, "{interface:?} {material:?}, {thickness} m");
                told += usize::from(lattice);
            }
        }
    }
    assert!((6..24).contains(&told), "{told} of 30");
}

/// Flat elements have edges that weigh anything.
#[test]
fn slivers_do_not_make_bodies_thin() {
    let [_, slivers, lattice] = on_three_meshes(&stripes_sensor(9_000));
    for thickness in [0.001, 0.005, 0.02, 0.04, 0.06, 0.1] {
        for interface in INTERFACES {
            for material in [dielectric(80.0), GROUNDED] {
                let solids = plate(thickness, DVec3::new(0.0, 0.0, 0.0437), 0.0);
                let [of_slivers, of_lattice] =
                    [&slivers, &lattice].map(|sensor| is_unresolved(sensor, interface, material, &solids));
                assert_eq!(of_slivers, of_lattice, "{interface:?} {material:?}, {thickness} m");
            }
        }
    }
}

/// Lines beside edges of a lattice see weak ones, however thin.
#[test]
fn weak_plates_are_lost_off_lattices_alone() {
    let solids = plate(1e-3, DVec3::new(0.0, 0.0, 0.0437), 0.0);
    let [off_lattice, lattice] = both(stripes_sensor(9_000))
        .map(|sensor| is_unresolved(&sensor, Interface::EdgeCut, dielectric(3.0), &solids));
    assert!(off_lattice && !lattice);
}

#[test]
fn specks_between_edges_are_told_whatever_they_are() {
    let sensor = stripes_sensor(9_000);
    let element = sensor.mesh().tets().len() / 2;
    let mut solids = Solids::new(&[Shape::Sphere { radius: 1e-5 }]).unwrap();
    solids.place(&[Pose::at(sensor.mesh().centroid(element))]).unwrap();
    for interface in INTERFACES {
        for material in [GROUNDED, FLOATING, dielectric(80.0)] {
            assert!(is_unresolved(&sensor, interface, material, &solids), "{interface:?} {material:?}");
        }
    }
}

/// What couples two conductors across a gap without nodes is known (`tests/suite/gaps.rs`).
#[test]
fn conductors_close_to_each_other_are_not_told_of() {
    let size = DVec3::new(0.1, 0.1, 2e-3);
    let mut solids = Solids::new(&[Shape::Box { size }, Shape::Box { size }]).unwrap();
    for sensor in both(stripes_sensor(20_000)) {
        for gap in [2e-3, 0.08] {
            let poses = [0.1, 0.1 + size.z + gap].map(|z| Pose::at(DVec3::new(0.0, 0.0, z)));
            solids.place(&poses).unwrap();
            let simulator = Simulator::new(sensor.clone(), vec![FLOATING, GROUNDED], to(1e-4)).unwrap();
            assert_eq!(simulator.unresolved(&solids), [0; 0], "{gap}");
        }
    }
}
