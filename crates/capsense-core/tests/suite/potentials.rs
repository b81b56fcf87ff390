//! Potentials of nodes with isolated objects at their own.

use capsense_core::electrode::{Electrode, Outline};
use capsense_core::geometry::Aabb;
use capsense_core::material::{Connection, Material};
use capsense_core::occupancy::{DepthLayers, OrthographicView};
use capsense_core::sensor::{FREE, Sensor, SensorDesign, Wall};
use capsense_core::simulator::Simulator;
use capsense_core::solver::SolverOptions;
use glam::{DVec2, DVec3};

/// Two plates above two electrodes, the first tied to ground through a capacitance, the other floating.
fn solved(to_ground: f64) -> Simulator {
    let domain = Aabb { min: DVec3::splat(-0.1), max: DVec3::splat(0.1) };
    let electrode = |name: &str, x: f64| Electrode {
        name: name.to_owned(),
        outline: Outline::Rectangle { center: DVec2::new(x, 0.0), size: DVec2::new(0.04, 0.06) },
        z: 0.0,
    };
    let electrodes = vec![electrode("A", -0.03), electrode("B", 0.03)];
    let design = SensorDesign { domain, electrodes, substrate: None, wall: Wall::Grounded };
    let sensor = Sensor::on_lattice(&design, &design.lattice(20_000).unwrap()).unwrap();
    let objects = [Connection::Capacitance(to_ground), Connection::Floating].map(Material::Conductor);
    let options = SolverOptions { tolerance: 1e-9, ..SolverOptions::default() };
    let mut simulator = Simulator::new(sensor, objects.to_vec(), options).unwrap();
    let view = OrthographicView { domain, width: 20, height: 20 };
    let mut depth = DepthLayers::empty(view, 2);
    for (object, columns) in [(0, 4..9), (1, 11..17)] {
        let (front, back) = depth.layer_mut(object);
        for pixel in (6..14).flat_map(|row| columns.clone().map(move |column| 20 * row + column)) {
            (front[pixel], back[pixel]) = (0.03, 0.05);
        }
    }
    let report = simulator.step(&depth).unwrap();
    assert!(report.solve.relative_error < 1e-8);
    simulator
}

/// The potential of an object, which all nodes that it holds have.
fn potential_of(simulator: &Simulator, object: u16, electrode: usize) -> f64 {
    let mut potentials = vec![7.0];
    simulator.potentials(electrode, &mut potentials).unwrap();
    assert_eq!(potentials.len(), simulator.sensor().mesh().nodes().len());
    let held = simulator.occupancy().conductors().iter().zip(&potentials);
    let held: Vec<f64> = held.filter(|(holder, _)| **holder == object).map(|(_, &volts)| volts).collect();
    assert!(held.iter().all(|volts| (volts - held[0]).abs() < 1e-7), "{held:?}");
    held[0]
}

/// C_st = K_st - k_s k_t/(k + C_g), so that dC_st/dC_g = V_s V_t with the object's potentials V_s = -k_s/(k + C_g): what
/// capacitances say of potentials, without a look at any field.
#[test]
fn potentials_of_objects_are_those_that_capacitances_ask_for() {
    let (farads, step) = (1e-12, 1e-14);
    let here = solved(farads);
    let [less, more] = [farads - step, farads + step].map(solved);
    let volts = [0, 1].map(|electrode| potential_of(&here, 0, electrode));
    assert!(volts[0] > volts[1] && volts[1] > 0.01 && volts[0] < 0.9, "{volts:?}");
    for (s, t) in [(0, 0), (0, 1), (1, 1)] {
        let slope = (more.capacitance().get(s, t) - less.capacitance().get(s, t)) / (2.0 * step);
        let expected = volts[s] * volts[t];
        assert!((slope / expected - 1.0).abs() < 1e-3, "C_{s}{t}: {slope} {expected}");
    }
    // What floats is nearer to the other electrode, and a larger capacitance to ground pulls at it, too.
    let floating = potential_of(&here, 1, 1);
    assert!(floating > volts[1], "{floating}");
    assert!(potential_of(&solved(1e-10), 1, 1) < floating);
}

#[test]
fn terminals_have_their_potentials_and_all_others_lie_between() {
    let simulator = solved(1e-12);
    let mut potentials = Vec::new();
    simulator.potentials(1, &mut potentials).unwrap();
    for (&terminal, &volts) in simulator.sensor().terminals().iter().zip(&potentials) {
        match terminal {
            FREE => assert!((-1e-6..=1.0 + 1e-6).contains(&volts), "{volts}"),
            2 => assert_eq!(volts, 1.0),
            _ => assert_eq!(volts, 0.0),
        }
    }
}
