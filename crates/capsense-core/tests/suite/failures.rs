//! Every failure is a value that says what happened, and the next good frame is right.

use crate::common::{
    bar, both, conductor, depth_of_boxes, dielectric, oracle, relative_error, stripes_sensor, three_stripes,
    to,
};
use capsense_core::geometry::Aabb;
use capsense_core::glam::{DVec2, DVec3};
use capsense_core::material::{Connection, Material, RelativePermittivity};
use capsense_core::mesh::{InvalidAxis, Lattice, MeshError};
use capsense_core::occupancy::DepthLayers;
use capsense_core::sensor::{ElectrodeNodes, Sensor, SensorDesign, SensorError, Substrate};
use capsense_core::simulator::{Simulator, SimulatorError};
use capsense_core::solver::{Preconditioner, SolveError, SolverOptions};

fn seen(boxes: &[Aabb]) -> DepthLayers {
    depth_of_boxes([32, 32], boxes)
}

/// Large enough that many nodes are inside.
fn block() -> Aabb {
    Aabb { min: DVec3::new(-0.2, -0.2, 0.02), max: DVec3::new(0.2, 0.2, 0.3) }
}

fn solve_error(simulator: &mut Simulator, depth: &DepthLayers) -> SolveError {
    let before = simulator.capacitance().clone();
    let SimulatorError::Solve(error) = simulator.step(depth).unwrap_err() else { panic!("another error") };
    assert_eq!(simulator.capacitance(), &before, "that of the last good frame");
    error
}

/// What a frame gives after a failure is what the oracle says.
fn assert_recovers(simulator: &mut Simulator, materials: &[Material], depth: &DepthLayers, tolerance: f64) {
    let report = simulator.step(depth).unwrap();
    assert!(report.solve.relative_error <= tolerance);
    let mut truth = oracle(simulator.sensor(), materials);
    let _ = truth.step(depth).unwrap();
    let error = relative_error(simulator.capacitance(), truth.capacitance());
    assert!(error <= tolerance, "{error:e}");
}

#[test]
fn too_few_iterations_are_told_with_the_error_they_leave() {
    let materials = [dielectric(1e5)];
    let (hard, easy) = (seen(&[block()]), seen(&[bar(2.0, 0.0)]));
    for sensor in both(stripes_sensor(5_000)) {
        let options = |max_iterations| SolverOptions {
            preconditioner: Preconditioner::Jacobi,
            max_iterations,
            ..to(1e-6)
        };
        let build = |most| Simulator::new(sensor.clone(), materials.to_vec(), options(most));
        // No more than the empty scene needs from the start.
        let most = (1..).find(|&most| build(most).is_ok()).unwrap();
        let SimulatorError::Solve(error) = build(most - 1).unwrap_err() else { panic!("another error") };
        assert!(matches!(error, SolveError::NotConverged { iterations, .. } if iterations == most - 1));
        // Before the first step, nothing is known.
        let unknown = SolveError::NotConverged { iterations: 0, relative_error: 1.0, tolerance: 1e-8 };
        assert_eq!(build(0).unwrap_err(), SimulatorError::Solve(unknown));
        let mut simulator = build(most).unwrap();
        let SolveError::NotConverged { iterations, relative_error, tolerance } =
            solve_error(&mut simulator, &hard)
        else {
            panic!("another error")
        };
        assert_eq!((iterations, tolerance), (most, 1e-6));
        assert!(relative_error > tolerance && relative_error.is_finite(), "{relative_error:e}");
        assert_recovers(&mut simulator, &materials, &easy, 1e-6);
    }
}

/// A dielectric object of such strength is refused; a board may have any.
#[test]
fn numbers_that_overflow_are_told() {
    let board = Substrate {
        thickness: 0.02,
        relative_permittivity: RelativePermittivity::new(1e300).unwrap(),
        size: DVec2::splat(0.3),
        grounded_back: false,
    };
    let design = SensorDesign { substrate: Some(board), ..three_stripes() };
    for sensor in both(Sensor::on_lattice(&design, &design.lattice(6_000).unwrap()).unwrap()) {
        let error = Simulator::new(sensor, vec![], to(1e-6)).unwrap_err();
        let SimulatorError::Solve(error) = error else { panic!("{error}") };
        assert!(matches!(error, SolveError::NonFinite { column: 0..3, .. }), "{error}");
    }
}

#[test]
fn what_no_simulator_can_be_made_of_is_told() {
    let build = |materials, options| Simulator::new(stripes_sensor(4_000), materials, options).unwrap_err();
    let grounded = conductor(Connection::Grounded);
    let many = usize::from(u16::MAX) - 4;
    assert_eq!(build(vec![grounded; many], to(1e-4)), SimulatorError::TooManyObjects(many));
    for tolerance in [0.0, 1.0, -1e-4, f64::INFINITY] {
        assert_eq!(build(vec![], to(tolerance)), SimulatorError::Tolerance(tolerance));
    }
    assert!(matches!(build(vec![], to(f64::NAN)), SimulatorError::Tolerance(t) if t.is_nan()));
    for farads in [-1e-15, f64::INFINITY] {
        let error = build(vec![grounded, conductor(Connection::Capacitance(farads))], to(1e-4));
        assert_eq!(error, SimulatorError::CapacitanceToGround { object: 1, farads });
    }
}

#[test]
fn another_number_of_objects_is_told_and_forgotten() {
    let materials = [conductor(Connection::Floating)];
    for sensor in both(stripes_sensor(4_000)) {
        let mut simulator = Simulator::new(sensor, materials.to_vec(), to(1e-6)).unwrap();
        for seen_boxes in [vec![], vec![bar(0.1, 0.0), bar(0.2, 0.0)]] {
            let error = simulator.step(&seen(&seen_boxes)).unwrap_err();
            assert_eq!(error, SimulatorError::ObjectCount { seen: seen_boxes.len(), known: 1 });
        }
        assert_recovers(&mut simulator, &materials, &seen(&[bar(0.05, 0.0)]), 1e-6);
    }
}

#[test]
fn a_depth_that_is_no_surface_is_told_and_forgotten() {
    let materials = [conductor(Connection::Grounded), conductor(Connection::Floating)];
    for sensor in both(stripes_sensor(4_000)) {
        let mut simulator = Simulator::new(sensor, materials.to_vec(), to(1e-6)).unwrap();
        let good = seen(&[bar(0.05, 0.0), bar(0.1, 0.0)]);
        for (front, back) in [(f32::NAN, 0.1), (0.1, f32::NAN), (0.2, 0.1)] {
            let mut broken = good.clone();
            let (fronts, backs) = broken.layer_mut(1);
            (fronts[32 * 9 + 4], backs[32 * 9 + 4]) = (front, back);
            let SimulatorError::Depth(told) = simulator.step(&broken).unwrap_err() else { panic!("other") };
            assert_eq!((told.object, told.column, told.row), (1, 4, 9));
            let bits = [told.front, told.back].map(f32::to_bits);
            assert_eq!(bits, [front, back].map(f32::to_bits));
            assert_recovers(&mut simulator, &materials, &good, 1e-6);
        }
    }
}

/// Differences of potentials within such a body are rounding, and become charges.
#[test]
fn permittivities_that_rounding_hides_are_told() {
    let sensor = stripes_sensor(4_000);
    let new = |permittivity, tolerance| {
        Simulator::new(sensor.clone(), vec![dielectric(4.0), dielectric(permittivity)], to(tolerance))
    };
    for (permittivity, tolerance) in [(1e12, 1e-6), (1e10, 1e-8), (1e7, 1e-12)] {
        let error = new(permittivity, tolerance).unwrap_err();
        let SimulatorError::Permittivity { object: 1, rounding, .. } = error else { panic!("{error}") };
        assert!(rounding > 3.0 * tolerance && error.to_string().contains("floating conductor"), "{error}");
        assert!(new(permittivity, rounding).is_ok());
    }
    for permittivity in [1e-3, 1e5] {
        let options = SolverOptions { preconditioner: Preconditioner::None, ..to(1e-6) };
        let error = Simulator::new(sensor.clone(), vec![dielectric(permittivity)], options).unwrap_err();
        assert_eq!(error, SimulatorError::Unpreconditioned { object: 0, permittivity });
    }
}

/// Those that need a mesh out of the ordinary; tests/suite/sensor.rs has the others.
#[test]
fn what_no_sensor_can_be_made_of_is_told() {
    let design = three_stripes();
    assert_eq!(
        design.lattice_of_spacing(-1.0, 1.3).unwrap_err(),
        SensorError::Lattice(InvalidAxis { axis: 0 })
    );
    let [x, y, _] = stripes_sensor(4_000).lattice().unwrap().axes().clone();
    let flat = Lattice::new([x, y, vec![-0.05, 0.0, f64::MIN_POSITIVE, 0.45]]).unwrap();
    let error = Sensor::on_lattice(&design, &flat).unwrap_err();
    assert!(matches!(error, SensorError::Mesh(MeshError::ZeroVolume { volume, .. }) if volume < 1e-100));
    let many = usize::from(u16::MAX / 2) + 1;
    let names = (0..many).map(|name| (name.to_string(), ElectrodeNodes::Nodes(vec![0])));
    let mesh = stripes_sensor(4_000).mesh().clone();
    let error = Sensor::on_mesh(mesh, &[], names.collect()).unwrap_err();
    assert_eq!(error, SensorError::TooManyElectrodes(many));
}
