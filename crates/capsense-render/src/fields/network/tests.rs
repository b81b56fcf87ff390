//! Kernels against their twins, both against the processor's solver, and networks against its matrix. All of it runs on a
//! software adapter, too.

use super::GpuNetwork;
use super::twin_fields::TwinFields;
use crate::error::RenderError;
use crate::fields::GpuFields;
use capsense_core::electrode::{Electrode, Outline};
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::material::{Connection, Material, RelativePermittivity};
use capsense_core::mesh::TetMesh;
use capsense_core::occupancy::Interface;
use capsense_core::sensor::{ElectrodeNodes, FREE, GROUND, MeshKind, Sensor, SensorDesign, Wall};
use capsense_core::simulator::{Simulator, SimulatorError};
use capsense_core::solids::Solids;
use capsense_core::solver::{
    NO_AGGREGATE, NetworkProblem, Preconditioner, RemoteFields, SolveError, SolverOptions,
};
use glam::{DQuat, DVec2, DVec3};
use proptest::prelude::*;

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
const EXACT: SolverOptions = SolverOptions { tolerance: 1e-10, ..OPTIONS };
const ERROR: f64 = 1e-5;

/// One workgroup takes coarse levels of so many rows: as in earnest, and so few that others have a kernel for each step.
const TAILS: [u32; 2] = [2048, 60];

/// Three stripes in a box of 0.6 m.
fn design() -> SensorDesign {
    let domain = Aabb { min: DVec3::new(-0.3, -0.3, -0.2), max: DVec3::new(0.3, 0.3, 0.4) };
    let stripe = |x: f64, name: &str| Electrode {
        name: name.into(),
        outline: Outline::Rectangle { center: DVec2::new(x, 0.0), size: DVec2::new(0.04, 0.2) },
        z: 0.0,
    };
    let electrodes = vec![stripe(-0.06, "E1"), stripe(0.0, "E2"), stripe(0.06, "E3")];
    SensorDesign { domain, electrodes, substrate: None, wall: Wall::Grounded }
}

fn bisected(tets: usize) -> Sensor {
    Sensor::generated(&design(), MeshKind::Bisection, tets).unwrap()
}

/// Free nodes of a lattice moved by up to a fifth of the way to the next one, as a mesher would place them: many edges then weigh
/// less than nothing.
fn irregular(tets: usize) -> Sensor {
    let sensor = Sensor::on_lattice(&design(), &design().lattice(tets).unwrap()).unwrap();
    let mesh = sensor.mesh();
    let mut narrowest = vec![f64::INFINITY; mesh.nodes().len()];
    for tet in mesh.tets().iter() {
        let pairs = tet.iter().flat_map(|&a| tet.iter().map(move |&b| [a as usize, b as usize]));
        for [a, b] in pairs.filter(|[a, b]| a != b) {
            narrowest[a] = narrowest[a].min(mesh.nodes()[a].distance(mesh.nodes()[b]));
        }
    }
    let mut dice = 5_u64;
    let mut between = || {
        dice = dice.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        0.4 * ((dice >> 11) as f64 / (1_u64 << 53) as f64 - 0.5)
    };
    let mut moved = |node: usize| {
        let to = DVec3::new(between(), between(), between());
        let by = if sensor.owners()[node] == FREE { narrowest[node] } else { 0.0 };
        mesh.nodes()[node] + by * to
    };
    let nodes = (0..narrowest.len()).map(&mut moved).collect();
    let nodes_of = |terminal: u16| -> Vec<u32> {
        (0..).zip(sensor.owners()).filter(|(_, owner)| **owner == terminal).map(|(node, _)| node).collect()
    };
    let names = sensor.electrode_names().iter().cloned().zip(1..);
    let electrodes = names.map(|(name, terminal)| (name, ElectrodeNodes::Nodes(nodes_of(terminal))));
    let mesh = TetMesh::new(nodes, mesh.tets().to_vec()).unwrap();
    Sensor::on_mesh(mesh, &nodes_of(GROUND), electrodes.collect()).unwrap()
}

fn bar() -> Shape {
    Shape::Box { size: DVec3::new(0.15, 0.05, 0.05) }
}

fn above(height: f64) -> Pose {
    Pose { translation: DVec3::new(0.0, 0.0, height), rotation: DQuat::from_rotation_z(0.3) }
}

fn problem(sensor: &Sensor, materials: &[Material]) -> NetworkProblem {
    Simulator::network_problem(sensor, materials, Interface::EdgeCut).unwrap()
}

fn with_remote(sensor: &Sensor, materials: &[Material], fields: Box<dyn RemoteFields>) -> Simulator {
    Simulator::with_remote(sensor.clone(), materials.to_vec(), OPTIONS, Interface::EdgeCut, fields).unwrap()
}

fn on_gpu(sensor: &Sensor, materials: &[Material], tail: u32) -> (Simulator, GpuNetwork) {
    let gpu = GpuNetwork::with_tail(problem(sensor, materials), true, tail).unwrap();
    (with_remote(sensor, materials, gpu.fields().unwrap()), gpu)
}

/// The largest difference of capacitances in relation to self-capacitances.
fn difference(a: &Simulator, b: &Simulator) -> f64 {
    let [a, b] = [a, b].map(Simulator::capacitance);
    let entries = (0..a.size()).flat_map(|i| (0..a.size()).map(move |j| (i, j)));
    entries
        .map(|(i, j)| (a.get(i, j) - b.get(i, j)).abs() / (b.get(i, i) * b.get(j, j)).sqrt())
        .fold(0.0, f64::max)
}

/// On a mesh with negative weights and on a bisected one, with a field of a floating body.
#[test]
fn networks_on_devices_and_twins_compute_what_the_processors_solver_does() {
    let meshes = [(irregular(24_000), GROUNDED), (irregular(24_000), FLOATING), (bisected(24_000), GROUNDED)];
    for ((sensor, material), tail) in meshes.into_iter().zip([TAILS[0], TAILS[1], TAILS[1]]) {
        let twin = Box::new(TwinFields::new(problem(&sensor, &[material])));
        let mut all = [on_gpu(&sensor, &[material], tail).0, with_remote(&sensor, &[material], twin)];
        let mut expected = Simulator::new(sensor.clone(), vec![material], EXACT).unwrap();
        let mut solids = Solids::new(&[bar()]).unwrap();
        for frame in 0..4 {
            solids.place(&[above(0.12 - 0.001 * f64::from(frame))]).unwrap();
            let _ = expected.step(&solids).unwrap();
            for ours in &mut all {
                let report = ours.step(&solids).unwrap();
                let worst = difference(ours, &expected);
                println!("{material:?}, frame {frame}: {worst:.1e} {:?}", report.solve);
                assert!(worst < ERROR, "{material:?}, frame {frame}: {worst:e} {report:?}");
                assert!(report.solve.relative_error <= 1.1 * OPTIONS.tolerance, "{report:?}");
            }
        }
    }
}

/// After several frames: networks of all levels and the fields, value by value. Rounding differs where a driver fuses
/// products and sums.
#[test]
fn kernels_of_networks_leave_what_their_twins_leave() {
    let sensor = irregular(24_000);
    for tail in TAILS {
        let twin = TwinFields::new(problem(&sensor, &[FLOATING]));
        let shared = twin.twin.clone();
        let (mut on_gpu, gpu) = on_gpu(&sensor, &[FLOATING], tail);
        let mut on_twin = with_remote(&sensor, &[FLOATING], Box::new(twin));
        let mut solids = Solids::new(&[bar()]).unwrap();
        for height in [0.05, 0.052, 0.054] {
            solids.place(&[above(height)]).unwrap();
            let reports = [&mut on_gpu, &mut on_twin].map(|simulator| simulator.step(&solids).unwrap().solve);
            assert_eq!(reports[0].iterations, reports[1].iterations);
        }
        let [networks, vectors] = gpu.buffers();
        let twin = shared.lock().unwrap();
        let apart = |(a, b): (&f32, &f32)| (a - b).abs() / a.abs().max(b.abs()).max(1e-3);
        let worst = networks.iter().zip(&twin.networks).map(apart).fold(0.0, f32::max);
        assert!(worst < 1e-4, "networks {worst:e}");
        let potentials = twin.plan.potential as usize..twin.plan.feed as usize;
        let (ours, theirs) = (&vectors[potentials.clone()], &twin.vectors[potentials]);
        let worst = ours.iter().zip(theirs).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(worst < 1e-5 && ours.contains(&1.0), "potentials {worst:e}");
    }
}

/// Networks of all levels are Pᵀ K P, K the simulator's matrix on free nodes, P what gives members their aggregate's value: on
/// the finest level K itself. Tried on vectors that differ everywhere, with a body in the scene.
#[test]
fn coarse_networks_are_those_of_the_matrix() {
    let sensor = irregular(24_000);
    let twin = TwinFields::new(problem(&sensor, &[GROUNDED]));
    let problem = problem(&sensor, &[GROUNDED]);
    let shared = twin.twin.clone();
    let mut simulator = with_remote(&sensor, &[GROUNDED], Box::new(twin));
    let mut solids = Solids::new(&[bar()]).unwrap();
    solids.place(&[above(0.06)]).unwrap();
    let _ = simulator.step(&solids).unwrap();
    let matrix = simulator.matrix().to_csr();
    let mut twin = shared.lock().unwrap();
    let nodes = problem.nodes();
    // Of each node its row on the level.
    let mut row_of: Vec<u32> = problem.row_of_node.clone();
    let is_free: Vec<bool> = row_of.iter().map(|&row| twin.is_free(row as usize)).collect();
    assert!(twin.plan.levels.len() >= 3 && is_free.iter().filter(|free| !**free).count() > 100);
    for number in 0..twin.plan.levels.len() {
        let level = twin.plan.levels[number];
        if number > 0 {
            let aggregate = &problem.aggregates[number - 1];
            let above = |row: &mut u32| *row = aggregate.get(*row as usize).map_or(NO_AGGREGATE, |own| *own);
            row_of.iter_mut().for_each(above);
        }
        let value = |row: u32| (f64::from(row) * 0.7).sin();
        for row in 0..level.rows {
            let at = level.correction as usize + row as usize * twin.plan.columns;
            twin.vectors[at] = if number > 0 { value(row) as f32 } else { 0.0 };
        }
        for node in (0..nodes).filter(|&node| number == 0 && is_free[node]) {
            let at = level.correction as usize + row_of[node] as usize * twin.plan.columns;
            twin.vectors[at] = value(row_of[node]) as f32;
        }
        let fine = |node: usize| match is_free[node] && row_of[node] != NO_AGGREGATE {
            true => value(row_of[node]),
            false => 0.0,
        };
        let mut expected = vec![0.0; level.rows as usize];
        for node in (0..nodes).filter(|&node| is_free[node] && row_of[node] != NO_AGGREGATE) {
            let row = matrix.row(node);
            let entries = row.col_indices().iter().zip(row.values());
            let product = entries.filter(|(other, _)| **other < nodes).map(|(&other, k)| k * fine(other));
            expected[row_of[node] as usize] += product.sum::<f64>();
        }
        let size = expected.iter().fold(0.0, |size: f64, value| size.max(value.abs()));
        let mut worst = 0.0_f64;
        for (row, expected) in expected.iter().enumerate() {
            let found = f64::from(twin.product(&level, level.correction, row, 0));
            let is_unknown = twin.networks[level.inverse as usize + row] != 0.0;
            worst = worst.max(if is_unknown { (found - expected).abs() } else { 0.0 });
        }
        assert!(worst < 1e-5 * size, "level {number}: {worst:e} of {size:e}");
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
    fn random_scenes_on_any_mesh_have_the_capacitances_of_the_processors_solver(
        frames in scenes(),
        is_bisected in any::<bool>(),
    ) {
        let plastic = Material::Dielectric(RelativePermittivity::new(3.0).unwrap());
        let flesh = Material::Dielectric(RelativePermittivity::new(80.0).unwrap());
        let tied = Material::Conductor(Connection::Capacitance(1e-12));
        let sensor = if is_bisected { bisected(9_000) } else { irregular(9_000) };
        let materials = frames[0].map(|(material, ..)| [GROUNDED, tied, plastic, flesh][material]);
        let shapes = frames[0].map(|(_, shape, _)| {
            [bar(), Shape::Sphere { radius: 0.03 }, Shape::Capsule { radius: 0.02, length: 0.1 }][shape].clone()
        });
        let (mut ours, _gpu) = on_gpu(&sensor, &materials, TAILS[1]);
        let mut expected = Simulator::new(sensor, materials.to_vec(), EXACT).unwrap();
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

#[test]
fn networks_have_the_same_bits_in_every_run() {
    let sensor = irregular(24_000);
    let run = || {
        let (mut simulator, gpu) = on_gpu(&sensor, &[FLOATING], TAILS[1]);
        let mut solids = Solids::new(&[bar()]).unwrap();
        let frames = [0.05, 0.053, 0.08].map(|height| {
            solids.place(&[above(height)]).unwrap();
            let _ = simulator.step(&solids).unwrap();
            simulator.capacitance().clone()
        });
        let [networks, vectors] =
            gpu.buffers().map(|values| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>());
        (frames, networks, vectors)
    };
    assert!(run() == run());
}

/// A body that leaves the domain and comes back: what it held is free again, and its column holds nothing.
#[test]
fn a_floating_body_that_leaves_a_network_is_forgotten() {
    let sensor = irregular(9_000);
    let (mut simulator, gpu) = on_gpu(&sensor, &[FLOATING], TAILS[0]);
    let mut expected = Simulator::new(sensor, vec![FLOATING], EXACT).unwrap();
    let mut solids = Solids::new(&[bar()]).unwrap();
    let _ = gpu.take_traffic();
    for height in [0.05, 2.0, 2.1, 0.05, 2.0] {
        solids.place(&[above(height)]).unwrap();
        let report = simulator.step(&solids).unwrap();
        let _ = expected.step(&solids).unwrap();
        assert!(difference(&simulator, &expected) < ERROR, "{height}");
        let traffic = gpu.take_traffic();
        assert_eq!(traffic.launches, report.solve.launches);
        let of_body = gpu.potentials(3);
        assert_eq!(of_body.iter().all(|volts| *volts == 0.0), height > 1.0, "{height}");
    }
}

#[test]
fn potentials_of_a_network_come_back() {
    let sensor = bisected(9_000);
    let (simulator, _gpu) = on_gpu(&sensor, &[], TAILS[0]);
    let expected = Simulator::new(sensor, vec![], OPTIONS).unwrap();
    let [mut ours, mut theirs] = [Vec::new(), Vec::new()];
    simulator.potentials(1, &mut ours).unwrap();
    expected.potentials(1, &mut theirs).unwrap();
    let worst = ours.iter().zip(&theirs).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(worst < 2e-3 && ours.contains(&1.0), "{worst:e}");
}

/// Each failure has its type, and says what was asked for and what there is.
#[test]
fn what_a_device_cannot_take_of_a_network_is_refused() {
    let sensor = irregular(9_000);
    let few = problem(&sensor, &[GROUNDED]);
    let many = NetworkProblem { columns: 32, ..few.clone() };
    let error = GpuNetwork::new(many, true).unwrap_err();
    assert!(matches!(error, RenderError::LimitExceeded { needed: 32, limit: 31, .. }), "{error}");
    // More than 3 GB of vectors.
    let nodes = 3_000_000_u32;
    let large = NetworkProblem {
        offsets: vec![0; nodes as usize + 1],
        neighbours: Vec::new(),
        row_of_node: (0..nodes).collect(),
        aggregates: Vec::new(),
        columns: 31,
    };
    match GpuNetwork::new(large, true) {
        Err(RenderError::LimitExceeded { needed, limit, .. }) => assert!(needed > limit),
        Err(error) => assert!(matches!(error, RenderError::OutOfMemory { .. }), "{error}"),
        Ok(gpu) => assert!(!gpu.is_software(), "a software adapter takes no such buffers"),
    }
    let gpu = GpuNetwork::new(few.clone(), true).unwrap();
    assert!(gpu.fields().is_some() && gpu.fields().is_none(), "fields are given out once");
    let lattice = Sensor::on_lattice(&design(), &design().lattice(9_000).unwrap()).unwrap();
    let of_lattice = Simulator::remote_problem(&lattice, &[]).unwrap();
    let error = Simulator::network_problem(&lattice, &[], Interface::EdgeCut).unwrap_err();
    assert!(matches!(error, SimulatorError::NotForDevice(_)), "{error}");
    let refused = |sensor: &Sensor, materials: &[Material], fields| {
        let sensor = sensor.clone();
        Simulator::with_remote(sensor, materials.to_vec(), OPTIONS, Interface::EdgeCut, fields).unwrap_err()
    };
    // As many nodes and columns as there are, but of a lattice, of none, and of other couplings.
    let of_network = GpuNetwork::new(few.clone(), true).unwrap().fields().unwrap();
    let lattices = GpuFields::new(&of_lattice, 1, true).unwrap().scene(0, 3).unwrap();
    let other = NetworkProblem { offsets: vec![0; few.offsets.len()], neighbours: Vec::new(), ..few.clone() };
    let of_other = GpuNetwork::new(other, true).unwrap().fields().unwrap();
    assert_eq!([lattices.shape(), of_other.shape()], [of_network.shape(); 2]);
    for (sensor, fields) in [(&lattice, of_network), (&sensor, lattices), (&sensor, of_other)] {
        let error = refused(sensor, &[GROUNDED], fields);
        assert!(error.to_string().contains("made for another mesh"), "{error}");
    }
    let strong = Material::Dielectric(RelativePermittivity::new(1e7).unwrap());
    let error = refused(&sensor, &[strong], GpuNetwork::new(few, true).unwrap().fields().unwrap());
    assert!(matches!(error, SimulatorError::PermittivityForDevice { object: 0, .. }), "{error}");
}

/// Too few iterations are no result.
#[test]
fn a_solve_of_a_network_that_ends_early_is_told() {
    let sensor = irregular(9_000);
    for max_iterations in [0, 1] {
        let options = SolverOptions { max_iterations, ..OPTIONS };
        let fields = GpuNetwork::new(problem(&sensor, &[]), true).unwrap().fields().unwrap();
        let error = Simulator::with_remote(sensor.clone(), vec![], options, Interface::EdgeCut, fields);
        let error = error.unwrap_err();
        assert!(matches!(error, SimulatorError::Solve(SolveError::NotConverged { .. })), "{error:?}");
    }
}

#[test]
fn a_lost_device_of_a_network_is_told_of() {
    let (mut simulator, gpu) = on_gpu(&irregular(9_000), &[GROUNDED], TAILS[0]);
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
