//! A ball in a grounded cube, against a value that uses none of this code.

use crate::common::{conductor, to};
use capsense_core::electrode::{Electrode, Outline};
use capsense_core::geometry::{Aabb, Shape};
use capsense_core::glam::{DVec2, DVec3};
use capsense_core::material::Connection;
use capsense_core::mesh::Lattice;
use capsense_core::sensor::{Sensor, SensorDesign, Wall};
use capsense_core::simulator::Simulator;
use capsense_core::solids::Solids;
use capsense_core::units::VACUUM_PERMITTIVITY;

/// A ball in the middle of a grounded cube of 1 m, its capacitance to all around it in farads, from what a little
/// electrode near the wall sees of it: C_ee falls by C_es² / (C_ss + C_g) where it is tied to ground through C_g, as
/// against grounded, so that two values of C_g tell C_ss.
fn ball_in_a_cube(radius: f64, cells: usize) -> f64 {
    let cube = Aabb { min: DVec3::splat(-0.5), max: DVec3::splat(0.5) };
    let lattice = Lattice::uniform(cube, [cells; 3]).unwrap();
    let step = 1.0 / cells as f64;
    let electrode = Outline::Rectangle { center: DVec2::ZERO, size: DVec2::splat(0.2) };
    let electrodes = vec![Electrode { name: "E".into(), outline: electrode, z: -0.5 + 2.0 * step }];
    let sensor = Sensor::on_lattice(
        &SensorDesign { domain: cube, electrodes, substrate: None, wall: Wall::Grounded },
        &lattice,
    )
    .unwrap();
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
