//! Kernels against their twins, and both against the processor's solver. All of it runs on a software adapter, too.

use super::GpuFields;
use super::plan::Plan;
use super::twin_fields::TwinFields;
use crate::error::RenderError;
use capsense_core::batch::Batch;
use capsense_core::electrode::{Electrode, Outline};
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::material::{Connection, Material, RelativePermittivity};
use capsense_core::occupancy::Interface;
use capsense_core::sensor::{Sensor, SensorDesign, Wall};
use capsense_core::simulator::{Simulator, SimulatorError};
use capsense_core::solids::Solids;
use capsense_core::solver::{
    Changes, Feed, Preconditioner, RemoteFields, RemoteSolution, SolveError, SolverOptions,
};
use glam::{DQuat, DVec2, DVec3};
use proptest::prelude::*;
use std::sync::{Arc, Mutex};

const GROUNDED: Material = Material::Conductor(Connection::Grounded);
const FLOATING: Material = Material::Conductor(Connection::Floating);

/// Errors of capacitances that are asked for, and that any may have.
const OPTIONS: SolverOptions = SolverOptions {
    tolerance: 1e-5,
    change_tolerance: None,
    preconditioner: Preconditioner::Multigrid,
    max_iterations: 1000,
    threads: Some(1),
};
const ERROR: f64 = 1e-5;

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

fn above(height: f64) -> Pose {
    Pose { translation: DVec3::new(0.0, 0.0, height), rotation: DQuat::from_rotation_z(0.3) }
}

fn with_remote(sensor: &Sensor, materials: &[Material], fields: Box<dyn RemoteFields>) -> Simulator {
    Simulator::with_remote(sensor.clone(), materials.to_vec(), OPTIONS, Interface::EdgeCut, fields).unwrap()
}

/// On a device of its own.
fn on_gpu(sensor: &Sensor, materials: &[Material]) -> (Simulator, GpuFields) {
    let problem = Simulator::remote_problem(sensor, materials).unwrap();
    let gpu = GpuFields::new(&problem, 1, true).unwrap();
    (with_remote(sensor, materials, gpu.scene(0, problem.columns).unwrap()), gpu)
}

/// The largest difference of capacitances in relation to self-capacitances.
fn difference(a: &Simulator, b: &Simulator) -> f64 {
    let [a, b] = [a, b].map(Simulator::capacitance);
    let entries = (0..a.size()).flat_map(|i| (0..a.size()).map(move |j| (i, j)));
    entries
        .map(|(i, j)| (a.get(i, j) - b.get(i, j)).abs() / (b.get(i, i) * b.get(j, j)).sqrt())
        .fold(0.0, f64::max)
}

/// In one workgroup, with a field of a floating body, and in many.
#[test]
fn devices_and_twins_compute_what_the_processors_solver_does() {
    for (tets, material) in [(24_000, GROUNDED), (24_000, FLOATING), (75_000, GROUNDED)] {
        let sensor = sensor(tets);
        let exact = SolverOptions { tolerance: 1e-10, ..OPTIONS };
        let problem = Simulator::remote_problem(&sensor, &[material]).unwrap();
        let twin = Box::new(TwinFields::new(Plan::new(&problem).unwrap()));
        let mut all = [on_gpu(&sensor, &[material]).0, with_remote(&sensor, &[material], twin)];
        let mut expected = Simulator::new(sensor.clone(), vec![material], exact).unwrap();
        let mut solids = Solids::new(&[bar()]).unwrap();
        for frame in 0..5 {
            solids.place(&[above(0.12 - 0.001 * f64::from(frame))]).unwrap();
            let _ = expected.step(&solids).unwrap();
            for ours in &mut all {
                let report = ours.step(&solids).unwrap();
                let worst = difference(ours, &expected);
                println!("{tets} tetrahedra, {material:?}, frame {frame}: {worst:.1e} {:?}", report.solve);
                assert!(worst < ERROR, "{tets} {material:?}, frame {frame}: {worst:e} {report:?}");
                assert!(report.solve.relative_error <= 1.1 * OPTIONS.tolerance, "{report:?}");
            }
        }
    }
}

/// After several frames: networks of all levels and the fields, value by value. Rounding differs where a driver fuses
/// products and sums.
#[test]
fn kernels_leave_what_their_twins_leave() {
    for tets in [9_000, 75_000] {
        let sensor = sensor(tets);
        let problem = Simulator::remote_problem(&sensor, &[FLOATING]).unwrap();
        let twin = TwinFields::new(Plan::new(&problem).unwrap());
        let shared = twin.twin.clone();
        let (mut on_gpu, gpu) = on_gpu(&sensor, &[FLOATING]);
        let mut on_twin = with_remote(&sensor, &[FLOATING], Box::new(twin));
        let mut solids = Solids::new(&[bar()]).unwrap();
        for height in [0.05, 0.052, 0.054] {
            solids.place(&[above(height)]).unwrap();
            let reports = [&mut on_gpu, &mut on_twin].map(|simulator| simulator.step(&solids).unwrap().solve);
            assert_eq!(reports[0].iterations, reports[1].iterations);
        }
        let [networks, vectors] = gpu.buffers_of(0);
        let twin = shared.lock().unwrap();
        let apart = |(a, b): (&f32, &f32)| (a - b).abs() / a.abs().max(b.abs()).max(1e-3);
        let worst = networks.iter().zip(&twin.networks).map(apart).fold(0.0, f32::max);
        assert!(worst < 1e-4, "{tets}: networks {worst:e}");
        let potentials = twin.plan.potential as usize..twin.plan.steps[0] as usize;
        let (ours, theirs) = (&vectors[potentials.clone()], &twin.vectors[potentials]);
        let worst = ours.iter().zip(theirs).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(worst < 1e-5 && ours.contains(&1.0), "{tets}: potentials {worst:e}");
    }
}

/// Kinds of objects, and where they are: near and far, beside each other and within each other.
fn scenes() -> impl Strategy<Value = Vec<[(usize, usize, [f64; 4]); 2]>> {
    let place = [-0.15..0.15, -0.15..0.15, 0.03..0.3, 0.0..3.0];
    let object = (0..4_usize, 0..3_usize, place);
    prop::collection::vec([object.clone(), object], 3)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]

    /// Bodies of all kinds jump from frame to frame.
    #[test]
    fn random_scenes_have_the_capacitances_of_the_processors_solver(frames in scenes()) {
        let plastic = Material::Dielectric(RelativePermittivity::new(3.0).unwrap());
        let flesh = Material::Dielectric(RelativePermittivity::new(80.0).unwrap());
        let tied = Material::Conductor(Connection::Capacitance(1e-12));
        let sensor = sensor(9_000);
        let materials = frames[0].map(|(material, ..)| [GROUNDED, tied, plastic, flesh][material]);
        let shapes = frames[0].map(|(_, shape, _)| {
            [bar(), Shape::Sphere { radius: 0.03 }, Shape::Capsule { radius: 0.02, length: 0.1 }][shape].clone()
        });
        let (mut ours, _gpu) = on_gpu(&sensor, &materials);
        let exact = SolverOptions { tolerance: 1e-10, ..OPTIONS };
        let mut expected = Simulator::new(sensor, materials.to_vec(), exact).unwrap();
        let mut solids = Solids::new(&shapes).unwrap();
        for frame in &frames {
            let poses = frame.map(|(_, _, [x, y, z, turn])| Pose {
                translation: DVec3::new(x, y, z),
                rotation: DQuat::from_rotation_y(turn),
            });
            solids.place(&poses).unwrap();
            let _ = expected.step(&solids).unwrap();
            let report = ours.step(&solids).unwrap();
            let worst = difference(&ours, &expected);
            // What touches an electrode leaves small differences of large numbers: that is told, as an estimate.
            let told = report.solve.relative_error.max(ERROR);
            prop_assert!(worst < told, "{worst:e} {report:?}");
            prop_assert!(told < 1.2 * ERROR || !ours.contacts().is_empty(), "{report:?}");
        }
    }
}

/// Scenes of different materials, some of which need a column more than others, and one without an object near.
#[test]
fn scenes_of_a_batch_have_the_bits_of_each_alone() {
    for tets in [9_000, 75_000] {
        let sensor = sensor(tets);
        let materials = [GROUNDED, FLOATING, GROUNDED];
        let starts = [0.05, 0.08, 0.2];
        let problems = materials.map(|material| Simulator::remote_problem(&sensor, &[material]).unwrap());
        let most = problems.iter().max_by_key(|problem| problem.columns).unwrap();
        let together = GpuFields::new(most, 3, true).unwrap();
        let of_batch = |scene: usize| {
            let fields = together.scene(scene, problems[scene].columns).unwrap();
            with_remote(&sensor, &[materials[scene]], fields)
        };
        let mut batch = Batch::new((0..3).map(of_batch).collect());
        let mut scenes = vec![Solids::new(&[bar()]).unwrap(); 3];
        let _ = together.take_traffic();
        let mut in_batch = Vec::new();
        for frame in 0..3 {
            for (solids, start) in scenes.iter_mut().zip(starts) {
                solids.place(&[above(start + 0.002 * f64::from(frame))]).unwrap();
            }
            let reports = batch.step(&scenes);
            let launches: Vec<usize> =
                reports.iter().map(|report| report.as_ref().unwrap().solve.launches).collect();
            let taken = together.take_traffic().launches;
            // The same launches computed all of them. In the first frame nothing is known of the floating body's field yet.
            assert!(frame == 0 || launches == [taken; 3], "{launches:?} {taken}");
            in_batch.push(batch.simulators().iter().map(|one| one.capacitance().clone()).collect::<Vec<_>>());
        }
        for scene in 0..3 {
            let alone = GpuFields::new(most, 1, true).unwrap();
            let mut simulator =
                with_remote(&sensor, &[materials[scene]], alone.scene(0, problems[scene].columns).unwrap());
            for (frame, in_batch) in in_batch.iter().enumerate() {
                scenes[scene].place(&[above(starts[scene] + 0.002 * frame as f64)]).unwrap();
                let _ = simulator.step(&scenes[scene]).unwrap();
                assert_eq!(&in_batch[scene], simulator.capacitance(), "{tets}: scene {scene}, frame {frame}");
            }
        }
    }
}

/// An object that leaves the domain: its column holds nothing any more, from the first frame on.
#[test]
fn a_floating_body_that_leaves_is_forgotten() {
    let (mut simulator, gpu) = on_gpu(&sensor(9_000), &[FLOATING]);
    let mut solids = Solids::new(&[bar()]).unwrap();
    for height in [0.05, 2.0, 2.1, 0.05, 2.0] {
        solids.place(&[above(height)]).unwrap();
        let _ = simulator.step(&solids).unwrap();
        let (now, base) = (simulator.capacitance().get(1, 1), simulator.base().get(1, 1));
        assert_eq!((now / base - 1.0).abs() < ERROR, height > 1.0, "{height}: {now:e} {base:e}");
        let of_body = gpu.potentials(0, 3);
        assert_eq!(of_body.iter().all(|volts| *volts == 0.0), height > 1.0, "{height}");
    }
}

/// Frames that are updated but not solved, and a solve of another scene in between.
#[test]
fn the_last_update_is_what_is_solved() {
    let sensor = sensor(9_000);
    let problem = Simulator::remote_problem(&sensor, &[GROUNDED]).unwrap();
    let gpu = GpuFields::new(&problem, 2, true).unwrap();
    let [mut ours, mut other] =
        [0, 1].map(|scene| with_remote(&sensor, &[GROUNDED], gpu.scene(scene, 3).unwrap()));
    let mut expected = Simulator::new(sensor, vec![GROUNDED], OPTIONS).unwrap();
    let mut solids = Solids::new(&[bar()]).unwrap();
    for (first, second) in [(0.05, 0.06), (0.1, 0.04)] {
        solids.place(&[above(first)]).unwrap();
        let _ = ours.update(&solids).unwrap();
        let _ = other.update(&solids).unwrap();
        ours.announce_solve();
        let _ = other.solve().unwrap();
        solids.place(&[above(second)]).unwrap();
        let _ = ours.update(&solids).unwrap();
        let _ = ours.solve().unwrap();
        let _ = expected.step(&solids).unwrap();
        assert!(difference(&ours, &expected) < ERROR && difference(&other, &expected) > 10.0 * ERROR);
        let again = ours.solve().unwrap();
        assert!(again.skipped && again.launches == 0, "{again:?}");
    }
}

/// Too few iterations are no result, and the next frame is none the worse for it.
#[test]
fn a_solve_that_ends_early_is_told_and_forgotten() {
    let sensor = sensor(9_000);
    let problem = Simulator::remote_problem(&sensor, &[GROUNDED]).unwrap();
    for max_iterations in [0, 1] {
        let gpu = GpuFields::new(&problem, 1, true).unwrap();
        let options = SolverOptions { max_iterations, ..OPTIONS };
        let fields = gpu.scene(0, 3).unwrap();
        let error =
            Simulator::with_remote(sensor.clone(), vec![GROUNDED], options, Interface::EdgeCut, fields)
                .unwrap_err();
        assert!(matches!(error, SimulatorError::Solve(SolveError::NotConverged { .. })), "{error:?}");
    }
    let gpu = GpuFields::new(&problem, 1, true).unwrap();
    let poisoned = Arc::new(Mutex::new(false));
    let fields = Poisoned { fields: gpu.scene(0, 3).unwrap(), poisoned: poisoned.clone() };
    let mut simulator = with_remote(&sensor, &[GROUNDED], Box::new(fields));
    let mut expected = Simulator::new(sensor, vec![GROUNDED], OPTIONS).unwrap();
    let mut solids = Solids::new(&[bar()]).unwrap();
    solids.place(&[above(0.05)]).unwrap();
    let _ = expected.step(&solids).unwrap();
    *poisoned.lock().unwrap() = true;
    let error = simulator.step(&solids).unwrap_err();
    assert!(matches!(error, SimulatorError::Solve(SolveError::NonFinite { .. })), "{error:?}");
    *poisoned.lock().unwrap() = false;
    let _ = simulator.step(&solids).unwrap();
    assert!(difference(&simulator, &expected) < ERROR);
}

/// Fields with a feed that is no number, as long as that is wanted.
#[derive(Debug)]
struct Poisoned {
    fields: Box<dyn RemoteFields>,
    poisoned: Arc<Mutex<bool>>,
}

impl RemoteFields for Poisoned {
    fn update(&mut self, changes: Changes<'_>) -> Result<(), SolveError> {
        self.fields.update(changes)
    }

    fn solve(&mut self, allowed: Option<&[f64]>, most: usize) -> Result<RemoteSolution, SolveError> {
        let charge = if *self.poisoned.lock().unwrap() { f32::NAN } else { 0.0 };
        let feeds = [Feed { node: 300, column: 1, charge }];
        self.fields.update(Changes { feeds: &feeds, ..Changes::default() })?;
        self.fields.solve(allowed, most)
    }

    fn shape(&self) -> [usize; 2] {
        self.fields.shape()
    }

    fn potentials(&self, column: usize) -> Result<Vec<f32>, SolveError> {
        self.fields.potentials(column)
    }

    fn duplicate(&self) -> Result<Box<dyn RemoteFields>, SolveError> {
        self.fields.duplicate()
    }
}

#[test]
fn potentials_come_back() {
    let sensor = sensor(9_000);
    let (simulator, _gpu) = on_gpu(&sensor, &[]);
    let expected = Simulator::new(sensor, vec![], OPTIONS).unwrap();
    let [mut ours, mut theirs] = [Vec::new(), Vec::new()];
    simulator.potentials(1, &mut ours).unwrap();
    expected.potentials(1, &mut theirs).unwrap();
    let worst = ours.iter().zip(&theirs).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(worst < 2e-3 && ours.contains(&1.0), "{worst:e}");
}

/// Each failure has its type, and says what was asked for and what there is.
#[test]
fn what_a_device_cannot_take_is_refused() {
    let problem = Simulator::remote_problem(&sensor(9_000), &[GROUNDED]).unwrap();
    let gpu = GpuFields::new(&problem, 1, true).unwrap();
    let most = gpu.most_scenes();
    if most < 60_000 {
        let error = GpuFields::new(&problem, most + 1, true).unwrap_err();
        assert!(
            matches!(error, RenderError::LimitExceeded { needed, limit, .. } if needed > limit),
            "{error}"
        );
    }
    assert!(gpu.scene(1, 3).is_none() && gpu.scene(0, 4).is_none());
    assert!(gpu.scene(0, 3).is_some() && gpu.scene(0, 3).is_none(), "fields are given out once");
    let error = GpuFields::new(&problem, 70_000_000, true).unwrap_err();
    assert!(matches!(error, RenderError::LimitExceeded { what: "the number of scenes", .. }), "{error}");
    let sensor = sensor(9_000);
    let strong = Material::Dielectric(RelativePermittivity::new(1e7).unwrap());
    let fields = || GpuFields::new(&problem, 1, true).unwrap().scene(0, 3).unwrap();
    let refused = |materials: Vec<Material>, options| {
        Simulator::with_remote(sensor.clone(), materials, options, Interface::EdgeCut, fields()).unwrap_err()
    };
    let error = refused(vec![strong], OPTIONS);
    assert!(matches!(error, SimulatorError::PermittivityForDevice { object: 0, .. }), "{error}");
    let ic0 = SolverOptions { preconditioner: Preconditioner::Ic0, ..OPTIONS };
    let fine = SolverOptions { tolerance: 1e-8, ..OPTIONS };
    let of_change = SolverOptions { change_tolerance: Some(1e-2), ..OPTIONS };
    for options in [ic0, fine, of_change] {
        let error = refused(vec![GROUNDED], options);
        assert!(matches!(error, SimulatorError::NotForDevice(_)), "{error}");
    }
    let error = refused(vec![FLOATING], OPTIONS);
    assert!(error.to_string().contains("made for another mesh"), "{error}");
}

#[test]
fn a_lost_device_is_told_of_and_no_number_comes_of_it() {
    let (mut simulator, gpu) = on_gpu(&sensor(9_000), &[GROUNDED]);
    let mut solids = Solids::new(&[bar()]).unwrap();
    solids.place(&[above(0.1)]).unwrap();
    let _ = simulator.step(&solids).unwrap();
    let before = simulator.capacitance().clone();
    gpu.destroy();
    solids.place(&[above(0.05)]).unwrap();
    let error = simulator.step(&solids).unwrap_err();
    assert!(matches!(error, SimulatorError::Solve(SolveError::Device { .. })), "{error:?}");
    assert_eq!(simulator.capacitance(), &before);
}
