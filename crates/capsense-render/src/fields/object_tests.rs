//! Objects found by kernels against those that the processor finds in the same depth image.

use super::finder::{Camera, Objects};
use super::gpu::GpuFields;
use crate::error::RenderError;
use crate::gpu::{GpuOptions, GpuRenderer};
use capsense_core::batch::Batch;
use capsense_core::capacitance::CapacitanceMatrix;
use capsense_core::electrode::{Electrode, Outline};
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::material::{Connection, Material, RelativePermittivity};
use capsense_core::occupancy::{DepthLayers, Interface, NO_OBJECT, OrthographicView};
use capsense_core::sensor::{FREE, Sensor, SensorDesign, Substrate, Wall};
use capsense_core::simulator::{Simulator, SimulatorError, StepReport};
use capsense_core::solver::{Preconditioner, SolverOptions};
use glam::{DQuat, DVec2, DVec3};
use proptest::prelude::*;

const GROUNDED: Material = Material::Conductor(Connection::Grounded);
const FLOATING: Material = Material::Conductor(Connection::Floating);
const TIED: Material = Material::Conductor(Connection::Capacitance(1e-12));

/// Errors of capacitances that are asked for, and that any may have.
const OPTIONS: SolverOptions = SolverOptions {
    tolerance: 1e-5,
    change_tolerance: None,
    preconditioner: Preconditioner::Multigrid,
    max_iterations: 1000,
    threads: Some(1),
};
const ERROR: f64 = 1e-5;

const DOMAIN: Aabb = Aabb { min: DVec3::new(-0.3, -0.3, -0.2), max: DVec3::new(0.3, 0.3, 0.4) };

fn dielectric(permittivity: f64) -> Material {
    Material::Dielectric(RelativePermittivity::new(permittivity).unwrap())
}

/// Two stripes and a disk, whose rim cuts edges, in a box of 0.6 m.
fn sensor(tets: usize, substrate: bool, wall: Wall) -> Sensor {
    let stripe = |x: f64, name: &str| Electrode {
        name: name.into(),
        outline: Outline::Rectangle { center: DVec2::new(x, 0.0), size: DVec2::new(0.04, 0.2) },
        z: 0.0,
    };
    let disk = Outline::Disk { center: DVec2::new(0.081, 0.0), radius: 0.037 };
    let disk = Electrode { name: "E3".into(), outline: disk, z: 0.0 };
    let electrodes = vec![stripe(-0.06, "E1"), stripe(0.0, "E2"), disk];
    let board = Substrate {
        thickness: 0.02,
        relative_permittivity: RelativePermittivity::new(4.4).unwrap(),
        size: DVec2::splat(0.4),
        grounded_back: false,
    };
    let substrate = substrate.then_some(board);
    let design = SensorDesign { domain: DOMAIN, electrodes, substrate, wall };
    Sensor::on_lattice(&design, &design.lattice(tets).unwrap()).unwrap()
}

/// The same scene with objects found on the device and on the processor, in images by the same camera.
struct Both {
    gpu: GpuFields,
    ours: Simulator,
    expected: Simulator,
    renderer: GpuRenderer,
    back_fill: bool,
    layers: DepthLayers,
}

fn with_camera(sensor: &Sensor, camera: Camera, objects: &Objects) -> (GpuFields, Simulator) {
    let problem = Simulator::remote_problem(sensor, &objects.materials).unwrap();
    let gpu =
        GpuFields::with_camera((&problem, sensor), camera, std::slice::from_ref(objects), true).unwrap();
    let simulator = simulator_on(sensor, &gpu, 0, &objects.materials);
    (gpu, simulator)
}

fn simulator_on(sensor: &Sensor, gpu: &GpuFields, scene: usize, materials: &[Material]) -> Simulator {
    let columns = Simulator::remote_problem(sensor, materials).unwrap().columns;
    let fields = gpu.scene(scene, columns).unwrap();
    Simulator::with_remote(sensor.clone(), materials.to_vec(), OPTIONS, Interface::EdgeCut, fields).unwrap()
}

impl Both {
    fn new(sensor: &Sensor, camera: Camera, objects: &Objects) -> Self {
        let (gpu, ours) = with_camera(sensor, camera, objects);
        let exact = SolverOptions { tolerance: 1e-10, ..OPTIONS };
        let expected = Simulator::new(sensor.clone(), objects.materials.clone(), exact).unwrap();
        let renderer = GpuRenderer::new(GpuOptions::default(), camera.view, &objects.shapes).unwrap();
        let layers = DepthLayers::empty(camera.view, objects.shapes.len());
        Self { gpu, ours, expected, renderer, back_fill: camera.back_fill, layers }
    }

    /// Has both see the objects, and returns how far capacitances are apart, and what was told of it.
    fn step(&mut self, poses: &[Pose]) -> (f64, f64) {
        self.renderer.render(poses, &mut self.layers).unwrap();
        if self.back_fill {
            self.layers.back_fill();
        }
        let expected = self.expected.step(&self.layers).unwrap();
        assert!(self.gpu.place(0, poses).unwrap());
        let report = self.ours.step_elsewhere().unwrap();
        assert_eq!(self.ours.contacts(), self.expected.contacts());
        let edges = [report.changed_edges, expected.changed_edges].map(|edges| edges as f64);
        assert!((edges[0] - edges[1]).abs() <= 2.0 + 0.02 * edges[1], "{edges:?} edges changed");
        (difference(self.ours.capacitance(), self.expected.capacitance()), report.solve.relative_error)
    }

    /// How far rows of K are apart.
    fn rows_apart(&self) -> RowsApart {
        let [networks, vectors] = self.gpu.buffers_of(0);
        let plan = self.gpu.plan();
        let grid = plan.grids[0];
        let (matrix, sensor) = (self.expected.matrix(), self.expected.sensor());
        let (weights, csr) = (matrix.network().weights(), matrix.to_csr());
        let strides = sensor.lattice().unwrap().strides();
        let value = |array: usize, node: usize| {
            f64::from(networks[grid.at as usize + array * grid.stride as usize + node])
        };
        let entry = |row: usize, column: usize| {
            let row = csr.row(row);
            let found = row.col_indices().iter().position(|&other| other == column);
            found.map_or(0.0, |at| -row.values()[at])
        };
        let mut apart = RowsApart::default();
        for (node, &conductor) in self.expected.occupancy().conductors().iter().enumerate() {
            let is_held = conductor != NO_OBJECT || sensor.terminals()[node] != FREE;
            apart.others += usize::from((value(3, node) > 1e29) != is_held);
            let base = (0..3).map(|axis| weights[3 * node + axis]).fold(1e-6, f64::max);
            let leak = f64::from(vectors[plan.leak as usize + node]);
            let other = matrix.link_weight(node);
            // A link is known as well as its length is.
            apart.note((leak - other).abs() / (base + other.abs()) / (1.0 + leak.abs() / base));
            for (axis, stride) in strides.into_iter().enumerate() {
                if weights[3 * node + axis] > 0.0 {
                    let other = entry(node, node + stride);
                    apart.note((value(axis, node) - other).abs() / other.max(base));
                }
            }
        }
        apart
    }
}

/// How far rows of K are apart, in relation to weights of the empty scene: the worst value, how many are off by more than
/// rounding makes of surfaces that edges do not graze, of how many, and how many nodes others hold.
#[derive(Clone, Copy, Debug, Default)]
struct RowsApart {
    worst: f64,
    rough: usize,
    values: usize,
    others: usize,
}

impl RowsApart {
    fn note(&mut self, apart: f64) {
        self.worst = self.worst.max(apart);
        self.rough += usize::from(apart > 5e-6);
        self.values += 1;
    }

    fn check(&self) {
        println!("{self:?}");
        assert!(self.worst < 5e-4 && 1000 * self.rough < self.values && self.others == 0, "{self:?}");
    }
}

/// The largest difference of capacitances in relation to self-capacitances.
fn difference(a: &CapacitanceMatrix, b: &CapacitanceMatrix) -> f64 {
    let entries = (0..a.size()).flat_map(|i| (0..a.size()).map(move |j| (i, j)));
    entries
        .map(|(i, j)| (a.get(i, j) - b.get(i, j)).abs() / (b.get(i, i) * b.get(j, j)).sqrt())
        .fold(0.0, f64::max)
}

fn shapes() -> [Shape; 4] {
    [
        Shape::Box { size: DVec3::new(0.15, 0.05, 0.05) },
        Shape::Sphere { radius: 0.04 },
        Shape::Capsule { radius: 0.02, length: 0.1 },
        Shape::Cylinder { radius: 0.03, length: 0.12 },
    ]
}

fn pose([x, y, z]: [f64; 3], axis: DVec3, turn: f64) -> Pose {
    let rotation = DQuat::from_axis_angle(axis.normalize(), turn);
    Pose { translation: DVec3::new(x, y, z), rotation }
}

/// Images of any size, with and without what is behind surfaces; conductors, strong and weak dielectrics, within and beside each
/// other; boards and open walls.
#[test]
fn rows_are_those_of_the_processor() {
    let all = [
        (vec![GROUNDED], false, Wall::Grounded, (48, 37), false),
        (vec![FLOATING, dielectric(80.0)], true, Wall::Grounded, (33, 64), false),
        (vec![dielectric(3.0), TIED], true, Wall::Open, (96, 80), true),
        (vec![dielectric(3.0), dielectric(5.0), dielectric(40.0)], false, Wall::Open, (61, 61), false),
    ];
    for (materials, substrate, wall, (width, height), back_fill) in all {
        let sensor = sensor(9_000, substrate, wall);
        let shapes = shapes()[..materials.len()].to_vec();
        let camera = Camera { view: OrthographicView { domain: DOMAIN, width, height }, back_fill };
        let mut both = Both::new(&sensor, camera, &Objects { shapes, materials: materials.clone() });
        for frame in 0..4 {
            let at = |object: usize| {
                let step = 0.013 * f64::from(frame) + 0.07 * object as f64;
                pose([0.021 + step, 0.011 - step, 0.0713 + 0.6 * step], DVec3::new(1.0, 0.5, 2.0), 0.7 * step)
            };
            let poses: Vec<Pose> = (0..materials.len()).map(at).collect();
            let (apart, told) = both.step(&poses);
            println!("{materials:?}, frame {frame}: C {apart:.1e}");
            both.rows_apart().check();
            assert!(apart < ERROR && told <= 1.2 * OPTIONS.tolerance, "{apart:e} {told:e}");
        }
    }
}

/// Many workgroups, floating bodies and those tied to ground, objects that come, go, and touch electrodes.
#[test]
fn objects_come_and_go_and_touch() {
    let sensor = sensor(75_000, false, Wall::Grounded);
    let materials = vec![FLOATING, GROUNDED];
    let view = OrthographicView { domain: DOMAIN, width: 80, height: 64 };
    let objects = Objects { shapes: shapes()[..2].to_vec(), materials };
    let mut both = Both::new(&sensor, Camera { view, back_fill: false }, &objects);
    let away = pose([0.0, 0.0, 3.0], DVec3::X, 0.1);
    let bar = |height: f64| pose([0.01, 0.02, height], DVec3::new(1.0, 2.0, 30.0), 0.3);
    let ball = |height: f64| pose([0.071, 0.013, height], DVec3::X, 0.0);
    let frames = [
        ([away, away], 0),
        ([bar(0.08), away], 0),
        ([bar(0.079), ball(0.0611)], 0),
        ([bar(0.2), ball(0.0303)], 1),
        ([away, ball(0.062)], 0),
    ];
    for (frame, (poses, contacts)) in frames.into_iter().enumerate() {
        let (apart, told) = both.step(&poses);
        let of_bar = both.gpu.potentials(0, 3);
        let is_away = poses[0] == away;
        assert_eq!(of_bar.iter().all(|volts| *volts == 0.0), is_away, "frame {frame}");
        assert_eq!(both.ours.contacts().len(), contacts, "frame {frame}");
        // Gaps of no width are the mesh's, and single precision knows them as parts of an edge.
        let allowed = if contacts > 0 { 1e-4 } else { ERROR };
        assert!(apart < allowed && (contacts > 0 || told <= 1.2 * ERROR), "{frame}: {apart:e} {told:e}");
        println!("frame {frame}: C {apart:.1e}");
        both.rows_apart().check();
    }
    assert!(!both.gpu.place(0, &frames_end()).unwrap(), "nothing moved");
    let report = both.ours.solve().unwrap();
    assert!(report.skipped && report.launches == 0, "{report:?}");
}

fn frames_end() -> [Pose; 2] {
    [pose([0.0, 0.0, 3.0], DVec3::X, 0.1), pose([0.071, 0.013, 0.062], DVec3::X, 0.0)]
}

/// Kinds of objects, and where they are in three frames: near and far, beside each other and within each other.
type Thrown = [(usize, usize, [[f64; 4]; 3]); 2];

fn scenes() -> impl Strategy<Value = Vec<Thrown>> {
    let place = [-0.15..0.15, -0.15..0.15, 0.05..0.3, 0.0..3.0];
    let object = (0..4_usize, 0..4_usize, [place.clone(), place.clone(), place]);
    prop::collection::vec([object.clone(), object], 4)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3))]

    /// Four scenes at once, of bodies of all kinds that jump from frame to frame.
    #[test]
    fn random_scenes_have_the_capacitances_of_the_processors_solver(thrown in scenes()) {
        let sensor = sensor(9_000, false, Wall::Grounded);
        let camera = Camera { view: OrthographicView { domain: DOMAIN, width: 60, height: 50 }, back_fill: false };
        let objects: Vec<Objects> = thrown.iter().map(|scene| Objects {
            shapes: scene.iter().map(|(_, shape, _)| shapes()[*shape].clone()).collect(),
            materials: scene.iter().map(|(kind, ..)| [GROUNDED, TIED, dielectric(3.0), dielectric(80.0)][*kind]).collect(),
        }).collect();
        let (gpu, mut batch) = batch_of(&sensor, camera, &objects);
        let exact = SolverOptions { tolerance: 1e-10, ..OPTIONS };
        let mut expected: Vec<(Simulator, GpuRenderer)> = objects.iter().map(|objects| {
            let simulator = Simulator::new(sensor.clone(), objects.materials.clone(), exact).unwrap();
            (simulator, GpuRenderer::new(GpuOptions::default(), camera.view, &objects.shapes).unwrap())
        }).collect();
        for frame in 0..3 {
            let poses = |scene: &Thrown| scene.map(|(_, _, at)| {
                let [x, y, z, turn] = at[frame];
                pose([x, y, z], DVec3::new(0.3, 1.0, 0.2), turn)
            });
            for (scene, thrown) in thrown.iter().enumerate() {
                gpu.place(scene, &poses(thrown)).unwrap();
            }
            let reports = batch.step_elsewhere();
            for (scene, report) in reports.into_iter().enumerate() {
                let (expected, renderer) = &mut expected[scene];
                let mut layers = DepthLayers::empty(camera.view, 2);
                renderer.render(&poses(&thrown[scene]), &mut layers).unwrap();
                let _ = expected.step(&layers).unwrap();
                let ours = &batch.simulators()[scene];
                let apart = difference(ours.capacitance(), expected.capacitance());
                let told = report.unwrap().solve.relative_error.max(ERROR);
                prop_assert!(apart < told, "{apart:e} {told:e} in frame {frame} of {:?}", thrown[scene]);
                // Through a narrow gap electrodes have more than the 3 to 7 pF of all else.
                let narrow = (0..3).any(|i| ours.capacitance().get(i, i) > 2e-11);
                prop_assert!(told < 1.2 * ERROR || narrow || !ours.contacts().is_empty(), "{told:e}");
                prop_assert_eq!(ours.contacts(), expected.contacts());
            }
        }
    }
}

fn batch_of(sensor: &Sensor, camera: Camera, objects: &[Objects]) -> (GpuFields, Batch) {
    let problem = |objects: &Objects| Simulator::remote_problem(sensor, &objects.materials).unwrap();
    let most = objects.iter().map(problem).max_by_key(|problem| problem.columns).unwrap();
    let gpu = GpuFields::with_camera((&most, sensor), camera, objects, true).unwrap();
    let of_scene =
        |(scene, objects): (usize, &Objects)| simulator_on(sensor, &gpu, scene, &objects.materials);
    let simulators = objects.iter().enumerate().map(of_scene).collect();
    (gpu, Batch::new(simulators))
}

/// Scenes of different objects and numbers of them, one of which is not placed in each frame.
#[test]
fn scenes_of_a_batch_have_the_bits_of_each_alone() {
    for tets in [9_000, 75_000] {
        let sensor = sensor(tets, false, Wall::Grounded);
        let camera =
            Camera { view: OrthographicView { domain: DOMAIN, width: 40, height: 50 }, back_fill: true };
        let of = |shapes: &[Shape], materials: &[Material]| Objects {
            shapes: shapes.to_vec(),
            materials: materials.to_vec(),
        };
        let objects = [
            of(&shapes()[..1], &[GROUNDED]),
            of(&shapes()[1..3], &[FLOATING, dielectric(3.0)]),
            of(&shapes()[1..2], &[TIED]),
        ];
        let poses = |scene: usize, frame: usize| -> Vec<Pose> {
            let at = |object: usize| {
                let height = 0.06 + 0.03 * scene as f64 + 0.002 * frame as f64 + 0.08 * object as f64;
                pose([0.02 * scene as f64, 0.01, height], DVec3::new(1.0, 0.3, 0.5), 0.4)
            };
            (0..objects[scene].shapes.len()).map(at).collect()
        };
        let (gpu, mut batch) = batch_of(&sensor, camera, &objects);
        let mut together = Vec::new();
        for frame in 0..2 {
            (0..3).for_each(|scene| assert!(gpu.place(scene, &poses(scene, frame)).unwrap()));
            let reports = batch.step_elsewhere();
            assert!(reports.iter().all(Result::is_ok), "{reports:?}");
            let capacitances = batch.simulators().iter().map(|one| one.capacitance().clone());
            together.push(capacitances.collect::<Vec<_>>());
        }
        // A touch is told of the scene that it is in; the others were not placed again, and nothing of them is computed.
        assert!(gpu.place(2, &[pose([0.0, 0.0, 0.03], DVec3::X, 0.0)]).unwrap());
        let reports: Vec<_> = batch.step_elsewhere().into_iter().map(Result::unwrap).collect();
        assert!(reports[2].changed_edges > 0 && !reports[2].solve.skipped, "{reports:?}");
        let is_idle = |report: &StepReport| report.changed_edges == 0 && report.solve.skipped;
        assert!(reports[..2].iter().all(is_idle), "{reports:?}");
        let touched: Vec<usize> = batch.simulators().iter().map(|one| one.contacts().len()).collect();
        assert_eq!(touched, [0, 0, 1], "{tets}");
        for (scene, objects) in objects.iter().enumerate() {
            let (gpu, mut alone) = with_camera(&sensor, camera, objects);
            for (frame, together) in together.iter().enumerate() {
                gpu.place(0, &poses(scene, frame)).unwrap();
                let _ = alone.step_elsewhere().unwrap();
                assert_eq!(alone.capacitance(), &together[scene], "{tets}: scene {scene}, frame {frame}");
            }
        }
    }
}

/// Objects that were placed before there was a simulator are none of its empty scene; where none were ever placed, frames are the
/// empty scene's; and what was not moved is not computed again.
#[test]
fn objects_are_found_once_the_simulator_took_over_where_they_are() {
    let sensor = sensor(9_000, false, Wall::Grounded);
    let camera =
        Camera { view: OrthographicView { domain: DOMAIN, width: 32, height: 32 }, back_fill: false };
    let objects = Objects { shapes: shapes()[..1].to_vec(), materials: vec![FLOATING] };
    let here = [pose([0.01, 0.0, 0.09], DVec3::X, 0.2)];
    let (gpu, mut after) = with_camera(&sensor, camera, &objects);
    let empty = after.step_elsewhere().unwrap();
    assert_eq!((after.capacitance(), empty.changed_edges), (after.base(), 0));
    assert!(gpu.place(0, &here).unwrap());
    let _ = after.step_elsewhere().unwrap();
    let problem = Simulator::remote_problem(&sensor, &objects.materials).unwrap();
    let gpu = GpuFields::with_camera((&problem, &sensor), camera, std::slice::from_ref(&objects), true);
    let gpu = gpu.unwrap();
    assert!(gpu.place(0, &here).unwrap());
    let mut before = simulator_on(&sensor, &gpu, 0, &objects.materials);
    assert_eq!(before.base(), after.base());
    assert!(before.step_elsewhere().unwrap().changed_edges > 0);
    assert_eq!(before.capacitance(), after.capacitance());
    let again = before.step_elsewhere().unwrap();
    assert_eq!((again.changed_edges, again.solve.skipped, again.solve.launches), (0, true, 0));
    assert_eq!(before.capacitance(), after.capacitance());
}

/// What is asked for in the wrong way or place is an error, never another number.
#[test]
fn what_does_not_fit_is_refused() {
    let sensor = sensor(9_000, false, Wall::Grounded);
    let camera =
        Camera { view: OrthographicView { domain: DOMAIN, width: 16, height: 16 }, back_fill: false };
    let objects = Objects { shapes: shapes()[..1].to_vec(), materials: vec![GROUNDED] };
    let (gpu, mut simulator) = with_camera(&sensor, camera, &objects);
    let layers = DepthLayers::empty(camera.view, 1);
    let error = simulator.update(&layers).unwrap_err();
    assert!(matches!(error, SimulatorError::NotForDevice(_)), "{error}");
    let here = pose([0.0, 0.0, 0.1], DVec3::X, 0.0);
    let bad = Pose { translation: DVec3::NAN, ..here };
    assert!(matches!(gpu.place(0, &[bad]).unwrap_err(), RenderError::InvalidPose { object: 0 }));
    assert!(matches!(gpu.place(0, &[]).unwrap_err(), RenderError::PoseCount { poses: 0, objects: 1 }));
    assert!(gpu.place(1, &[here]).is_err(), "there is no such scene");
    assert!(gpu.place(0, &[here]).unwrap() && !gpu.place(0, &[here]).unwrap());
    let _ = simulator.step_elsewhere().unwrap();
    let error = simulator.capacitance_to_ground().unwrap_err();
    assert!(error.to_string().contains("not looked at"), "{error}");
    let mut seen = layers;
    let mut renderer = GpuRenderer::new(GpuOptions::default(), camera.view, &objects.shapes).unwrap();
    renderer.render(&[here], &mut seen).unwrap();
    simulator.look(&seen).unwrap();
    let sum: f64 = simulator.capacitance().rows().next().unwrap().iter().sum();
    let ground = simulator.capacitance_to_ground().unwrap()[0];
    // Charges are linear in errors of potentials.
    assert!((sum + ground).abs() < 5e-3 * sum, "{sum:e} {ground:e}");
    let mut elsewhere = Simulator::new(sensor.clone(), vec![GROUNDED], OPTIONS).unwrap();
    assert!(matches!(elsewhere.update_elsewhere().unwrap_err(), SimulatorError::NotForDevice(_)));
    let problem = Simulator::remote_problem(&sensor, &[GROUNDED]).unwrap();
    let of = |objects: Objects| GpuFields::with_camera((&problem, &sensor), camera, &[objects], true);
    let crowd = Objects { shapes: vec![shapes()[0].clone(); 17], materials: vec![GROUNDED; 17] };
    let error = of(crowd).unwrap_err();
    assert!(matches!(error, RenderError::LimitExceeded { needed: 17, limit: 16, .. }), "{error}");
    let uneven = Objects { materials: vec![], ..objects.clone() };
    assert!(matches!(of(uneven).unwrap_err(), RenderError::PoseCount { .. }));
    // Of another material than the device was told.
    let fields = of(objects).unwrap().scene(0, 3).unwrap();
    let other = vec![dielectric(3.0)];
    let error = Simulator::with_remote(sensor, other, OPTIONS, Interface::EdgeCut, fields).unwrap_err();
    assert!(error.to_string().contains("other materials"), "{error}");
}

/// A scene that is many times in a batch has the same capacitances everywhere: depths are those of a tile of its own, also of faces
/// along the camera's rays.
#[test]
fn where_a_scene_is_in_a_batch_does_not_matter() {
    use proptest::strategy::ValueTree;
    use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
    let mut dice =
        TestRunner::new_with_rng(Config::default(), TestRng::deterministic_rng(RngAlgorithm::ChaCha));
    let sensor = sensor(9_000, false, Wall::Grounded);
    let camera =
        Camera { view: OrthographicView { domain: DOMAIN, width: 60, height: 50 }, back_fill: false };
    let objects = Objects { shapes: shapes()[2..].to_vec(), materials: vec![GROUNDED; 2] };
    let (gpu, mut batch) = batch_of(&sensor, camera, &vec![objects; 6]);
    // Depths of the first depended on the tile.
    let mut frames = vec![[
        [0.07454931592212814, 0.09970938646168676, 0.15478076761384388, 2.594659459772334],
        [0.03053088403317627, -0.003588593775222759, 0.052159225157190015, 0.6042490211585072],
    ]];
    for _ in 0..20 {
        let thrown = scenes().new_tree(&mut dice).unwrap().current();
        frames.push([thrown[0][0].2[0], thrown[0][1].2[0]]);
    }
    for frame in frames {
        let poses = frame.map(|[x, y, z, turn]| pose([x, y, z], DVec3::new(0.3, 1.0, 0.2), turn));
        for scene in 0..6 {
            gpu.place(scene, &poses).unwrap();
        }
        assert!(batch.step_elsewhere().iter().all(Result::is_ok));
        let first = batch.simulators()[0].capacitance();
        let apart: Vec<f64> =
            batch.simulators().iter().map(|one| difference(one.capacitance(), first)).collect();
        assert!(apart.iter().all(|apart| *apart == 0.0), "{apart:?} {frame:?}");
    }
}

/// A bar touches an electrode with one corner: what is left of gaps makes C four hundred times as large, and single precision knows
/// it to a few hundred-thousandths. This is told as an error of C, and of no other frame.
#[test]
fn what_rounding_makes_of_a_contact_is_told() {
    let sensor = sensor(9_000, false, Wall::Grounded);
    let camera =
        Camera { view: OrthographicView { domain: DOMAIN, width: 60, height: 50 }, back_fill: false };
    let objects = Objects { shapes: shapes()[..1].to_vec(), materials: vec![GROUNDED] };
    let mut both = Both::new(&sensor, camera, &objects);
    for touches in [false, true] {
        let place = if touches {
            [-0.0925055717338743, -0.07626012536760875, 0.05473576447549839]
        } else {
            [-0.12284708678432084, 0.03045739541048825, 0.18112400657668903]
        };
        let (apart, told) = both.step(&[pose(place, DVec3::new(0.3, 1.0, 0.2), 1.4441910542948198)]);
        let c = both.expected.capacitance();
        println!("C11 {:.2e}: {apart:.1e}, told {told:.1e}", c.get(0, 0));
        assert!(both.ours.contacts().is_empty() != touches && apart < told.max(ERROR), "{apart:e} {told:e}");
        assert_eq!(c.get(0, 0) > 1e-9, touches, "{:e}", c.get(0, 0));
        assert_eq!(told > 1.2 * ERROR, touches, "{told:e}");
        assert!(told < 1e-3, "{told:e}");
    }
}
