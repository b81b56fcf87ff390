//! Dielectrics beside a board: what they take the place of is what was there, above the board and in it.

use crate::common::{DOMAIN, depth_of_boxes, dielectric, rectangle, relative_error, to};
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::glam::{DVec2, DVec3};
use capsense_core::material::RelativePermittivity;
use capsense_core::occupancy::Surfaces;
use capsense_core::sensor::{MeshKind, Sensor, SensorDesign, Substrate, Wall};
use capsense_core::simulator::Simulator;
use capsense_core::solids::Solids;

const BOARD: f64 = 4.4;
const THICKNESS: f64 = 1.6e-3;

fn design(grounded_back: bool) -> SensorDesign {
    let board = Substrate {
        thickness: THICKNESS,
        relative_permittivity: RelativePermittivity::new(BOARD).unwrap(),
        size: DVec2::new(0.14, 0.12),
        grounded_back,
    };
    let electrodes =
        vec![rectangle("E1", [-0.03, 0.0], [0.02, 0.1]), rectangle("E2", [0.03, 0.0], [0.02, 0.1])];
    SensorDesign { domain: DOMAIN, electrodes, substrate: Some(board), wall: Wall::Grounded }
}

/// By how much a body changes the capacitances, relative to them.
fn change(sensor: &Sensor, permittivity: f64, surfaces: &impl Surfaces) -> f64 {
    let mut simulator = Simulator::new(sensor.clone(), vec![dielectric(permittivity)], to(1e-9)).unwrap();
    let _ = simulator.step(surfaces).unwrap();
    relative_error(simulator.capacitance(), simulator.base())
}

fn solid(bounds: &Aabb) -> Solids {
    let mut solids = Solids::new(&[Shape::Box { size: bounds.size() }]).unwrap();
    solids.place(&[Pose::at(0.5 * (bounds.min + bounds.max))]).unwrap();
    solids
}

#[test]
fn air_beside_a_board_changes_nothing() {
    for grounded_back in [false, true] {
        for tets in [12_000, 40_000] {
            let sensor = Sensor::generated(&design(grounded_back), MeshKind::Lattice, tets).unwrap();
            // On the board, just above it, within the first cell above it, and cells away.
            for (low, high) in [(0.0, 0.05), (1e-4, 0.05), (1e-3, 4e-3), (0.02, 0.05)] {
                let bounds = Aabb { min: DVec3::new(-0.05, -0.05, low), max: DVec3::new(0.05, 0.05, high) };
                let of_solid = change(&sensor, 1.0, &solid(&bounds));
                let of_camera = change(&sensor, 1.0, &depth_of_boxes([40, 40], &[bounds]));
                for change in [of_solid, of_camera] {
                    assert!(change < 1e-8, "{tets}, back {grounded_back}, {low} to {high}: {change:e}");
                }
            }
        }
    }
}

#[test]
fn a_body_as_the_board_in_its_place_changes_nothing() {
    let sensor = Sensor::generated(&design(false), MeshKind::Lattice, 20_000).unwrap();
    let bounds = Aabb { min: DVec3::new(-0.07, -0.06, -THICKNESS), max: DVec3::new(0.07, 0.06, 0.0) };
    let change = change(&sensor, BOARD, &solid(&bounds));
    assert!(change < 1e-8, "{change:e}");
}

/// A board given as an object does what the board does, on a fine lattice; of 40,000 tetrahedra, 29 % of that is missing
/// or too much.
#[test]
fn a_board_may_be_an_object() {
    let board = design(false);
    let lattice = board.lattice(640_000).unwrap();
    let with_board = Sensor::on_lattice(&board, &lattice).unwrap();
    let without = Sensor::on_lattice(&SensorDesign { substrate: None, ..board }, &lattice).unwrap();
    let bounds = Aabb { min: DVec3::new(-0.07, -0.06, -THICKNESS), max: DVec3::new(0.07, 0.06, 0.0) };
    let mut simulator = Simulator::new(without, vec![dielectric(BOARD)], to(1e-9)).unwrap();
    let _ = simulator.step(&solid(&bounds)).unwrap();
    let expected = Simulator::new(with_board, vec![], to(1e-9)).unwrap();
    let board_does = relative_error(simulator.base(), expected.base());
    let error = relative_error(simulator.capacitance(), expected.base()) / board_does;
    assert!(error < 0.04, "{error:e} of {board_does:e}");
}
