//! How fast what a bar changes of the three stripes converges as cells become smaller.

use crate::common::{FLOATING, GROUNDED, shapes, three_stripes, to};
use capsense_core::estimate::halved_lattice;
use capsense_core::geometry::{Pose, Shape};
use capsense_core::glam::{DQuat, DVec3};
use capsense_core::material::Material;
use capsense_core::sensor::Sensor;
use capsense_core::simulator::Simulator;

const BAR: Shape = Shape::Box { size: DVec3::new(0.15, 0.15, 0.02) };

/// Of the bar's lower face above the electrodes, in metres: several, as errors depend on where faces are between planes of nodes.
const HEIGHTS: [f64; 7] = [0.023, 0.031, 0.044, 0.058, 0.075, 0.097, 0.13];

/// What the bar changes of C at each height, in farads, row by row.
type Changes = Vec<[f64; 9]>;

/// Of the bar turned about z.
fn changes(sensor: &Sensor, material: Material, degrees: f64) -> Changes {
    let mut simulator = Simulator::new(sensor.clone(), vec![material], to(1e-6)).unwrap();
    let base = simulator.base().clone();
    let rotation = DQuat::from_rotation_z(degrees.to_radians());
    let at_height = |height: f64| {
        let pose = Pose { rotation, ..Pose::at(DVec3::new(0.0, 0.0, height + 0.01)) };
        let _ = simulator.step(&shapes::at(&[BAR], &[pose])).unwrap();
        let c = simulator.capacitance();
        std::array::from_fn(|entry| c.get(entry / 3, entry % 3) - base.get(entry / 3, entry % 3))
    };
    HEIGHTS.map(at_height).to_vec()
}

/// The root mean square over heights and entries of how two differ, entries being divided by √(ΔC_ii ΔC_jj) of `scale`.
fn difference(one: &Changes, other: &Changes, scale: &Changes) -> f64 {
    let squares = one.iter().zip(other).zip(scale).flat_map(|((one, other), scale)| {
        (0..9).map(move |entry| {
            let size = (scale[4 * (entry / 3)] * scale[4 * (entry % 3)]).sqrt();
            ((one[entry] - other[entry]) / size).powi(2)
        })
    });
    f64::sqrt(squares.sum::<f64>() / (9 * one.len()) as f64)
}

/// On lattices whose cells are halved twice, so that all their planes stay and only others are added.
#[test]
fn what_bars_change_converges_with_an_order_of_more_than_one_and_a_half() {
    let design = three_stripes();
    let coarse = design.lattice(16_000).unwrap();
    let medium = halved_lattice(&coarse).unwrap();
    let fine = halved_lattice(&medium).unwrap();
    let sensors = [coarse, medium, fine].map(|lattice| Sensor::on_lattice(&design, &lattice).unwrap());
    for (name, material) in [("grounded", GROUNDED), ("floating", FLOATING)] {
        for degrees in [0.0, 30.0] {
            let [coarse, medium, fine] = sensors.each_ref().map(|sensor| changes(sensor, material, degrees));
            let (first, second) = (difference(&coarse, &medium, &fine), difference(&medium, &fine, &fine));
            let order = (first / second).log2();
            println!("{name}, {degrees}°: {:.2} %, {:.2} %, order {order:.2}", 100.0 * first, 100.0 * second);
            assert!(order > 1.5, "{name} {degrees}: {first} {second} {order}");
        }
    }
}
