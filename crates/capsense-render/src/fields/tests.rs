//! Kernels against their twins, and both against the processor's solver.

use super::GpuFields;
use super::plan::Plan;
use super::twin::TwinFields;
use capsense_core::electrode::{Electrode, Outline};
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::material::{Connection, Material};
use capsense_core::occupancy::Interface;
use capsense_core::sensor::{Sensor, SensorDesign, Wall};
use capsense_core::simulator::Simulator;
use capsense_core::solids::Solids;
use capsense_core::solver::SolverOptions;
use glam::{DQuat, DVec2, DVec3};

/// Three stripes in a box of 0.6 m.
fn sensor(tets: usize) -> Sensor {
    let domain = Aabb { min: DVec3::new(-0.3, -0.3, -0.2), max: DVec3::new(0.3, 0.3, 0.4) };
    let stripe = |x: f64, name: &str| Electrode {
        name: name.into(),
        outline: Outline::Rectangle { center: DVec2::new(x, 0.0), size: DVec2::new(0.04, 0.2) },
        z: 0.0,
    };
    let electrodes = vec![stripe(-0.06, "E1"), stripe(0.0, "E2"), stripe(0.06, "E3")];
    let design = SensorDesign { domain, electrodes, substrate: None, wall: Wall::Grounded };
    Sensor::on_lattice(&design, &design.lattice(tets).unwrap()).unwrap()
}

fn bar() -> Shape {
    Shape::Box { size: DVec3::new(0.15, 0.05, 0.05) }
}

const GROUNDED: Material = Material::Conductor(Connection::Grounded);
const FLOATING: Material = Material::Conductor(Connection::Floating);

/// The largest difference of capacitances in relation to self-capacitances.
fn difference(a: &Simulator, b: &Simulator) -> f64 {
    let [a, b] = [a, b].map(Simulator::capacitance);
    let entries = (0..a.size()).flat_map(|i| (0..a.size()).map(move |j| (i, j)));
    entries
        .map(|(i, j)| (a.get(i, j) - b.get(i, j)).abs() / (b.get(i, i) * b.get(j, j)).sqrt())
        .fold(0.0, f64::max)
}

#[test]
fn devices_and_twins_compute_what_the_processors_solver_does() {
    for (tets, material) in [(24_000, GROUNDED), (24_000, FLOATING), (200_000, GROUNDED)] {
        let sensor = sensor(tets);
        let options = SolverOptions { tolerance: 1e-5, ..SolverOptions::default() };
        let exact = SolverOptions { tolerance: 1e-10, ..options };
        let problem = Simulator::remote_problem(&sensor, &[material]).unwrap();
        let gpu = GpuFields::new(&problem, 1, true).unwrap();
        let twin = Box::new(TwinFields::new(Plan::new(&problem).unwrap()));
        let remote = |fields| {
            Simulator::with_remote(sensor.clone(), vec![material], options, Interface::EdgeCut, fields)
                .unwrap()
        };
        let mut all = [remote(gpu.scene(0)), remote(twin)];
        let mut expected = Simulator::new(sensor.clone(), vec![material], exact).unwrap();
        let mut solids = Solids::new(&[bar()]).unwrap();
        for frame in 0..8 {
            let height = 0.12 - 0.001 * f64::from(frame);
            let rotation = DQuat::from_rotation_z(0.3);
            solids.place(&[Pose { translation: DVec3::new(0.0, 0.0, height), rotation }]).unwrap();
            let _ = expected.step(&solids).unwrap();
            for ours in &mut all {
                let t = std::time::Instant::now();
                let report = ours.step(&solids).unwrap();
                let worst = difference(ours, &expected);
                println!("{frame}: {:?} worst {worst:e} {:?}", report.solve, t.elapsed());
                assert!(worst < 1e-5);
            }
        }
        println!("{:?}", gpu.take_traffic());
    }
}
