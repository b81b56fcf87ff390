//! Links beside edges of boxes and cylinders, some of them negative, leave a matrix and capacitances as they must be.

#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use capsense_core::geometry::{Pose, Shape};
use capsense_core::glam::DVec3;
use capsense_core::material::Connection;
use capsense_core::mesh::Lattice;
use capsense_core::sensor::Sensor;
use capsense_core::simulator::Simulator;
use common::shapes::{at, rotation};
use common::{Dice, conductor, oracle, relative_error, stripes_sensor, three_stripes, to};
use proptest::prelude::*;
use std::sync::LazyLock;

/// Cells up to eight times as long as wide or high.
fn stretched() -> Sensor {
    let design = three_stripes();
    let axis = |axis: usize, cells: usize| -> Vec<f64> {
        let (low, high) = (design.domain.min[axis], design.domain.max[axis]);
        (0..=cells).map(|k| low + (high - low) * k as f64 / cells as f64).collect()
    };
    Sensor::on_lattice(&design, &Lattice::new([axis(0, 40), axis(1, 50), axis(2, 10)]).unwrap()).unwrap()
}

static SENSORS: LazyLock<[Sensor; 2]> = LazyLock::new(|| [stripes_sensor(12_000), stretched()]);

fn shape(dice: &mut Dice) -> Shape {
    let length = |dice: &mut Dice| 0.2 * 10_f64.powf(dice.between(-1.7, 0.0));
    if dice.below(4) == 0 {
        Shape::Cylinder { radius: 0.5 * length(dice), length: length(dice) }
    } else {
        Shape::Box { size: DVec3::new(length(dice), length(dice), length(dice)) }
    }
}

fn pose(dice: &mut Dice) -> Pose {
    let translation =
        DVec3::new(dice.between(-0.12, 0.12), dice.between(-0.12, 0.12), dice.between(0.01, 0.2));
    if dice.below(2) == 0 {
        return Pose::at(translation);
    }
    let axis = [dice.between(-1.0, 1.0), dice.between(-1.0, 1.0), dice.between(-1.0, 1.0)];
    Pose { rotation: rotation(axis, dice.between(0.0, 3.0)), ..Pose::at(translation) }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn capacitances_are_those_of_conductors(seed in any::<u64>()) {
        let mut dice = Dice(seed);
        let sensor = &SENSORS[dice.below(2)];
        let materials = [Connection::Grounded, Connection::Floating].map(conductor);
        let solids = at(&[shape(&mut dice), shape(&mut dice)], &[pose(&mut dice), pose(&mut dice)]);
        let mut exact = oracle(sensor, &materials);
        let _ = exact.step(&solids).unwrap();
        let mut simulator = Simulator::new(sensor.clone(), materials.to_vec(), to(1e-6)).unwrap();
        let _ = simulator.step(&solids).unwrap();
        let c = simulator.capacitance();
        let error = relative_error(c, exact.capacitance());
        // How exact a tolerance is kept is for `oracle` to say. A floating body that touches an electrode is at its potential
        // but for what single precision makes of links a thousand times as strong as all others.
        let allowed = if simulator.contacts().is_empty() { 1e-5 } else { 1e-4 };
        prop_assert!(error < allowed, "{error:e}");
        for s in 0..3 {
            let row: f64 = (0..3).map(|t| c.get(s, t)).sum();
            prop_assert!(row >= -1e-6 * c.get(s, s), "row {s}: {row:e}");
            for t in (0..3).filter(|&t| t != s) {
                prop_assert!(c.get(s, t) <= 1e-6 * c.get(s, s) && c.get(s, t) == c.get(t, s));
            }
        }
    }
}
