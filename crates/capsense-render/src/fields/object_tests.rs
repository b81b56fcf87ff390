//! Objects found by kernels against those that the processor finds in the same depth image.

use super::finder::{Camera, Objects};
use super::gpu::GpuFields;
use crate::gpu::{GpuOptions, GpuRenderer};
use capsense_core::capacitance::CapacitanceMatrix;
use capsense_core::electrode::{Electrode, Outline};
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::material::{Connection, Material, RelativePermittivity};
use capsense_core::occupancy::{DepthLayers, Interface, NO_OBJECT, OrthographicView};
use capsense_core::sensor::{Sensor, SensorDesign, Substrate, Wall};
use capsense_core::simulator::Simulator;
use capsense_core::solver::{Preconditioner, SolverOptions};
use glam::{DQuat, DVec2, DVec3};

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

    /// The largest differences of rows of K, in relation to the diagonal of the empty scene, links to be as precise as where
    /// surfaces are; and how many nodes are held by others.
    fn rows_apart(&self) -> (f64, usize) {
        let [networks, vectors] = self.gpu.buffers_of(0);
        let plan = self.gpu.plan();
        let (grid, nodes) = (plan.grids[0], plan.nodes());
        let matrix = self.expected.matrix();
        let network = matrix.network();
        let sensor = self.expected.sensor();
        let csr = matrix.to_csr();
        let strides = sensor.lattice().unwrap().strides();
        let entry = |row: usize, column: usize| {
            let row = csr.row(row);
            let found = row.col_indices().iter().position(|&other| other == column);
            found.map_or(0.0, |at| -row.values()[at])
        };
        let mut worst = 0.0_f64;
        let mut others = 0;
        for node in 0..nodes {
            let base = (0..3).map(|axis| network.weights()[3 * node + axis]).fold(0.0, f64::max);
            let [ours, theirs] = [0, 1].map(|side| match side {
                0 => networks[grid.at as usize + 3 * grid.stride as usize + node] > 1e29,
                _ => {
                    let is_held = self.expected.occupancy().conductors()[node] != NO_OBJECT;
                    is_held || sensor.terminals()[node] != capsense_core::sensor::FREE
                }
            });
            others += usize::from(ours != theirs);
            let leak = f64::from(vectors[plan.leak as usize + node]);
            let other = matrix.link_weight(node);
            // A link of length θ is known as well as θ is.
            let slack = 1.0 + leak.abs() / base.max(1e-12);
            if base > 0.0 {
                worst = worst.max((leak - other).abs() / (base + other.abs()) / slack);
            }
            for (axis, stride) in strides.into_iter().enumerate() {
                let weight = f64::from(networks[grid.at as usize + axis * grid.stride as usize + node]);
                if network.weights()[3 * node + axis] > 0.0 {
                    let other = entry(node, node + stride);
                    worst = worst.max((weight - other).abs() / weight.max(other).max(base));
                }
            }
        }
        (worst, others)
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
            let (worst, others) = both.rows_apart();
            println!(
                "{materials:?}, frame {frame}: C {apart:.1e}, rows {worst:.1e}, {others} held by others"
            );
            assert!(worst < 2e-5 && others == 0, "{materials:?}, frame {frame}: {worst:e}, {others}");
            assert!(apart < ERROR && told <= 1.2 * OPTIONS.tolerance, "{apart:e} {told:e}");
        }
    }
}
