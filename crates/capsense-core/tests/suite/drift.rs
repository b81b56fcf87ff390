//! What thousands of accumulated updates do to K when a body of very high permittivity moves about, and that the
//! simulator's own K has no memory. The figures of `docs/performance.md` are those of the first test at other frame
//! counts; it prints its own with `--nocapture`.

use crate::common::{bar, depth_of_boxes, stripes_sensor};
use capsense_core::baseline::{
    AccumulatedStiffness, BaselineError, CgOptions, PaperMethod, Precision, STEEL,
};
use capsense_core::geometry::Aabb;
use capsense_core::glam::DVec3;
use capsense_core::material::{Material, RelativePermittivity};
use capsense_core::occupancy::DepthLayers;
use capsense_core::sensor::Sensor;
use capsense_core::simulator::Simulator;
use capsense_core::solver::SolverOptions;

const FRAMES: u32 = 3000;

fn steel() -> RelativePermittivity {
    RelativePermittivity::new(STEEL).unwrap()
}

/// A bar on a winding way, about 1 mm a frame.
fn wandering_bar(frame: u32) -> DepthLayers {
    let time = 1e-3 * f64::from(frame);
    let away = DVec3::new((9.0 * time).sin(), (11.3 * time).cos(), 0.4 * (23.0 * time).sin());
    let low = DVec3::new(-0.075, -0.075, 0.06) + 0.1 * away;
    depth_of_boxes([64, 64], &[Aabb { min: low, max: low + DVec3::new(0.15, 0.15, 0.02) }])
}

fn no_bar() -> DepthLayers {
    depth_of_boxes([64, 64], &[bar(2.0, 0.0)])
}

/// Lets the bar wander and leave. Returns the method as it then is, the number of elements updated, and the largest
/// relative deviation of a diagonal entry of K from that of a fresh assembly.
fn drift<T: Precision>(sensor: &Sensor, frames: u32) -> (PaperMethod<T>, usize, f64) {
    let mut paper = PaperMethod::<T>::new(sensor, &[steel()], CgOptions::PAPER);
    let mut updates = 0;
    for depth in (1..=frames).map(wandering_bar).chain([no_bar()]) {
        updates += paper.update(&depth).unwrap();
    }
    let fresh = AccumulatedStiffness::<f64>::new(sensor.mesh()).to_csr();
    let drifted = paper.to_csr();
    let diagonal = |row| {
        let value: f64 = drifted.get_entry(row, row).unwrap().into_value().into();
        (value / fresh.get_entry(row, row).unwrap().into_value() - 1.0).abs()
    };
    let deviation = (0..fresh.nrows()).map(diagonal).fold(0.0, f64::max);
    println!("{frames} frames, {updates} updates in {}: {deviation:e}", std::any::type_name::<T>());
    (paper, updates, deviation)
}

#[test]
fn accumulated_updates_drift() {
    let sensor = stripes_sensor(20_000);
    let (mut single, updates, deviation) = drift::<f32>(&sensor, FRAMES);
    assert!(updates > 100_000 && deviation > 0.05, "{deviation}");
    let error = single.solve().unwrap_err();
    assert!(matches!(error, BaselineError::Indefinite { curvature, .. } if curvature < 0.0), "{error}");

    let (mut double, updates_of_double, deviation) = drift::<f64>(&sensor, FRAMES);
    assert_eq!(updates, updates_of_double);
    assert!(deviation > 1e-11 && deviation < 3e-9, "{deviation}");
    let _ = double.solve().unwrap();
    let mut fresh = PaperMethod::<f64>::new(&sensor, &[steel()], CgOptions::PAPER);
    let _ = fresh.step(&no_bar()).unwrap();
    let error = double.capacitance().get(0, 0) / fresh.capacitance().get(0, 0) - 1.0;
    assert!(error.abs() < 1e-9, "{error}");
}

#[test]
fn one_pass_of_a_body_is_enough_in_single_precision() {
    let (mut single, _, deviation) = drift::<f32>(&stripes_sensor(20_000), 10);
    assert!(deviation > 1e-3, "{deviation}");
    assert!(single.solve().is_ok(), "not yet indefinite");
}

#[test]
fn the_simulators_matrix_has_no_memory() {
    let new = || {
        let materials = vec![Material::Dielectric(steel())];
        Simulator::new(stripes_sensor(20_000), materials, SolverOptions::default()).unwrap()
    };
    let (mut simulator, fresh) = (new(), new());
    for frame in 1..=FRAMES {
        let _ = simulator.update(&wandering_bar(frame)).unwrap();
    }
    assert_ne!(simulator.matrix().to_csr(), fresh.matrix().to_csr(), "the bar is there");
    let mut other = new();
    let _ = other.update(&wandering_bar(FRAMES)).unwrap();
    assert_eq!(simulator.matrix().to_csr(), other.matrix().to_csr());
    let _ = simulator.update(&no_bar()).unwrap();
    assert_eq!(simulator.matrix().to_csr(), fresh.matrix().to_csr());
}
