//! Kernels against the occupancy of the processor, edge by edge. On a software adapter, too.

use super::{EdgeTrees, marks, planes, source};
use crate::adapter::Adapter;
use bytemuck::{Pod, Zeroable};
use capsense_core::electrode::{Electrode, Outline};
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::material::{Connection, Material, RelativePermittivity};
use capsense_core::occupancy::{Coupling, EdgeGeometry, NO_OBJECT, Occupancy};
use capsense_core::sensor::{Sensor, SensorDesign, Substrate, Wall};
use capsense_core::solids::Solids;
use capsense_core::stiffness::EdgeNetwork;
use glam::{DQuat, DVec2, DVec3};
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use wgpu::util::DeviceExt;

const NEEDS: (wgpu::DownlevelFlags, &str) =
    (wgpu::DownlevelFlags::COMPUTE_SHADERS, "it has no compute shaders");

fn stand_alone(objects: usize) -> String {
    source(objects) + include_str!("stand_alone.wgsl")
}

/// Needs no GPU: the functions are valid WGSL for any number of objects.
#[test]
fn the_functions_are_valid() {
    for objects in [1, 2, 7] {
        let module = naga::front::wgsl::parse_str(&stand_alone(objects))
            .map_err(|error| error.emit_to_string(&stand_alone(objects)))
            .unwrap_or_else(|error| panic!("{error}"));
        let flags = naga::valid::ValidationFlags::all();
        let mut validator = naga::valid::Validator::new(flags, naga::valid::Capabilities::empty());
        validator.validate(&module).unwrap();
    }
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Told {
    counts: [u32; 3],
    nodes: u32,
    objects: u32,
    padding: [u32; 3],
}

/// The kernels for some scene on one lattice.
struct Finder {
    adapter: Adapter,
    network: EdgeNetwork,
    sensor: Sensor,
    /// For so many objects.
    pipelines: Vec<(usize, Vec<wgpu::ComputePipeline>)>,
}

struct Found {
    conductors: Vec<u32>,
    wedges: Vec<[u32; 4]>,
    couplings: Vec<Coupling>,
}

impl Finder {
    fn new(sensor: Sensor) -> Self {
        let adapter = Adapter::open("capsense solids", true, NEEDS).unwrap();
        Self { adapter, network: EdgeNetwork::of_sensor(&sensor), sensor, pipelines: Vec::new() }
    }

    fn geometry(&self) -> EdgeGeometry<'_> {
        EdgeGeometry {
            nodes: self.sensor.mesh().nodes(),
            terminals: self.sensor.owners(),
            edges: self.network.edges(),
            permittivity: self.network.permittivity(),
        }
    }

    fn expected(&self, solids: &Solids, materials: &[Material]) -> Occupancy {
        let mut occupancy = Occupancy::empty(self.sensor.mesh().nodes().len(), self.network.edges().len());
        occupancy.update(self.geometry(), materials, solids);
        occupancy
    }

    fn found(&mut self, solids: &Solids, materials: &[Material]) -> Found {
        let objects = materials.len();
        if !self.pipelines.iter().any(|(count, _)| *count == objects) {
            let start = std::time::Instant::now();
            let pipelines = self.pipelines_for(objects);
            println!("compiled {:?}", start.elapsed());
            self.pipelines.push((objects, pipelines));
        }
        let (_, pipelines) = self.pipelines.iter().find(|(count, _)| *count == objects).unwrap();
        let device = &self.adapter.device;
        let lattice = self.sensor.lattice().unwrap();
        let nodes = self.sensor.mesh().nodes().len();
        let trees = EdgeTrees::of(solids).unwrap();
        let mut boxes = trees.boxes.clone();
        boxes.resize(boxes.len().max(1), Zeroable::zeroed());
        let placed: Vec<_> = trees.place(solids).collect();
        let permittivity = self.network.permittivity();
        let backgrounds: Vec<f32> = permittivity.iter().map(|value| value as f32).collect();
        let of_material = |material: &Material| match material {
            Material::Conductor(_) => [0_u32, 0],
            Material::Dielectric(permittivity) => [1, (permittivity.value() as f32).to_bits()],
        };
        let told: Vec<[u32; 2]> = materials.iter().map(of_material).collect();
        let marks = marks(lattice, self.sensor.owners(), |edge| permittivity.at(edge));
        let input = |contents: &[u8], usage| {
            device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: None, contents, usage })
        };
        let storage = wgpu::BufferUsages::STORAGE;
        let counts = lattice.node_counts().map(|count| count as u32);
        let told_counts =
            Told { counts, nodes: nodes as u32, objects: objects as u32, padding: [0; 3] };
        let buffers = [
            input(bytemuck::bytes_of(&told_counts), wgpu::BufferUsages::UNIFORM),
            input(bytemuck::cast_slice(&planes(lattice)), storage),
            input(bytemuck::cast_slice(&marks), storage),
            input(bytemuck::cast_slice(&backgrounds), storage),
            input(bytemuck::cast_slice(&placed), storage),
            input(bytemuck::cast_slice(&told), storage),
            input(bytemuck::cast_slice(&boxes), storage),
            self.output(4 * nodes),
            self.output(16 * nodes),
            self.output(48 * nodes),
        ];
        let layout = self.layout();
        let entries: Vec<_> = (0..)
            .zip(&buffers)
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &layout,
            entries: &entries,
        });
        let mut encoder = device.create_command_encoder(&Default::default());
        for pipeline in pipelines {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups(nodes.div_ceil(64) as u32, 1, 1);
        }
        self.adapter.queue.submit([encoder.finish()]);
        self.adapter.faults.check("finding solids").unwrap();
        let words = self.read(&buffers[9]);
        let couplings = words.chunks_exact(4).map(|words| Coupling {
            through: f64::from(f32::from_bits(words[0])),
            factor: [1, 2].map(|at| f64::from(f32::from_bits(words[at]))),
            object: [words[3] as u16, (words[3] >> 16) as u16],
        });
        let wedges = self.read(&buffers[8]);
        Found {
            conductors: self.read(&buffers[7]),
            wedges: wedges.chunks_exact(4).map(|words| [words[0], words[1], words[2], words[3]]).collect(),
            couplings: couplings.collect(),
        }
    }

    fn pipelines_for(&self, objects: usize) -> Vec<wgpu::ComputePipeline> {
        let device = &self.adapter.device;
        let source = wgpu::ShaderSource::Wgsl(stand_alone(objects).into());
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source });
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: None,
            bind_group_layouts: &[Some(&self.layout())],
            immediate_size: 0,
        });
        let pipeline = |entry| {
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: None,
                layout: Some(&layout),
                module: &module,
                entry_point: Some(entry),
                compilation_options: Default::default(),
                cache: None,
            })
        };
        ["find_conductors", "find_wedges", "find_couplings"].map(pipeline).into()
    }

    fn layout(&self) -> wgpu::BindGroupLayout {
        let entry = |binding: u32| {
            let ty = match binding {
                0 => wgpu::BufferBindingType::Uniform,
                _ => wgpu::BufferBindingType::Storage { read_only: binding < 7 },
            };
            wgpu::BindGroupLayoutEntry {
                binding,
                visibility: wgpu::ShaderStages::COMPUTE,
                ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
                count: None,
            }
        };
        let entries: Vec<_> = (0..10).map(entry).collect();
        let descriptor = wgpu::BindGroupLayoutDescriptor { label: None, entries: &entries };
        self.adapter.device.create_bind_group_layout(&descriptor)
    }

    fn output(&self, size: usize) -> wgpu::Buffer {
        self.adapter.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: size as u64,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        })
    }

    fn read(&self, buffer: &wgpu::Buffer) -> Vec<u32> {
        let Adapter { device, queue, .. } = &self.adapter;
        let staging = device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: buffer.size(),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let mut encoder = device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, buffer.size());
        queue.submit([encoder.finish()]);
        staging.map_async(wgpu::MapMode::Read, .., |result| result.unwrap());
        device.poll(wgpu::PollType::Wait { submission_index: None, timeout: None }).unwrap();
        bytemuck::cast_slice(&staging.slice(..).get_mapped_range().unwrap()).to_vec()
    }
}

/// Scenes thrown by dice.
const CASES: usize = 60;

const GROUNDED: Material = Material::Conductor(Connection::Grounded);

fn dielectric(permittivity: f64) -> Material {
    Material::Dielectric(RelativePermittivity::new(permittivity).unwrap())
}

/// Three stripes in a box of 0.6 m.
fn sensor(tets: usize, on_board: bool) -> Sensor {
    let domain = Aabb { min: DVec3::new(-0.3, -0.3, -0.2), max: DVec3::new(0.3, 0.3, 0.4) };
    let stripe = |x: f64, name: &str| Electrode {
        name: name.into(),
        outline: Outline::Rectangle { center: DVec2::new(x, 0.0), size: DVec2::new(0.04, 0.2) },
        z: 0.0,
    };
    let electrodes = vec![stripe(-0.06, "E1"), stripe(0.0, "E2"), stripe(0.06, "E3")];
    let board = Substrate {
        thickness: 0.02,
        relative_permittivity: RelativePermittivity::new(4.4).unwrap(),
        size: DVec2::new(0.3, 0.3),
        grounded_back: false,
    };
    let substrate = on_board.then_some(board);
    let design = SensorDesign { domain, electrodes, substrate, wall: Wall::Grounded };
    Sensor::on_lattice(&design, &design.lattice(tets).unwrap()).unwrap()
}

/// A row of the stiffness matrix: the weights to the next nodes, and the sum of those of its links.
fn rows_of(network: &EdgeNetwork, nodes: usize, couplings: &[Coupling]) -> Vec<[f64; 4]> {
    let mut rows = vec![[0.0; 4]; nodes];
    for (edge, (coupling, weight)) in couplings.iter().zip(network.weights()).enumerate() {
        let Some(ends) = network.edges().ends(edge) else { continue };
        rows[edge / 3][edge % 3] = weight * coupling.through;
        for (end, node) in ends.into_iter().enumerate() {
            rows[node as usize][3] += weight * coupling.factor[end];
        }
    }
    rows
}

/// What differs between device and processor.
#[derive(Debug, Default)]
struct Difference {
    /// Nodes that other conductors hold, and rows of which an entry differs by more than a thousandth of the row.
    moved: usize,
    otherwise: usize,
    /// The largest difference of entries of all other rows, in parts of the row.
    rounding: f64,
    /// Edges that objects change.
    changed: usize,
}

fn compare(finder: &mut Finder, solids: &Solids, materials: &[Material]) -> Difference {
    let expected = finder.expected(solids, materials);
    let found = finder.found(solids, materials);
    let of_core = expected.conductors().iter().map(|&object| u32::from(object));
    let nodes = expected.conductors().len();
    let empty =
        vec![Coupling { through: 1.0, factor: [0.0; 2], object: [u16::MAX; 2] }; found.couplings.len()];
    let [ours, theirs, without] = [&found.couplings, expected.couplings(), &empty]
        .map(|couplings| rows_of(&finder.network, nodes, couplings));
    let mut all = Difference {
        moved: of_core.zip(&found.conductors).filter(|(a, b)| a != *b).count(),
        changed: expected.couplings().iter().zip(&empty).filter(|(a, b)| a != b).count(),
        ..Difference::default()
    };
    let lattice = finder.sensor.lattice().unwrap();
    for node in (0..nodes).filter(|&node| expected.conductors()[node] == NO_OBJECT) {
        let place = lattice.node_place(node);
        let sum = |rows: &[[f64; 4]]| {
            let before = (0..3).filter(|&axis| place[axis] > 0);
            let before = before.map(|axis| rows[node - lattice.strides()[axis]][axis]);
            rows[node].iter().copied().chain(before).sum::<f64>()
        };
        let whole = sum(&theirs).max(sum(&without));
        let apart = |entry: usize| (ours[node][entry] - theirs[node][entry]).abs() / whole;
        let error = (0..4).map(apart).fold(0.0, |a: f64, b| if b.is_nan() { f64::NAN } else { a.max(b) });
        if error < 1e-3 {
            all.rounding = all.rounding.max(error);
        } else {
            all.otherwise += 1;
            if all.otherwise < 4 {
                println!("{place:?}: {:?} {:?} {whole}", ours[node], theirs[node]);
                println!("  wedge {:x?}", found.wedges[node]);
            }
        }
    }
    all
}

/// Shapes of all kinds, from thinner than cells to far larger, with edges in planes of nodes and turned.
fn any_object() -> impl Strategy<Value = (Shape, Pose, Material)> {
    let length = || prop_oneof![0.002..0.02, 0.02..0.2_f64];
    let shape = prop_oneof![
        [length(), length(), length()].prop_map(|size| Shape::Box { size: size.into() }),
        length().prop_map(|radius| Shape::Sphere { radius }),
        [length(), length()].prop_map(|[radius, length]| Shape::Capsule { radius, length }),
        [length(), length()].prop_map(|[radius, length]| Shape::Cylinder { radius, length }),
    ];
    let rotation = prop_oneof![
        Just(DQuat::IDENTITY),
        Just(DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2)),
        (0.0..6.0).prop_map(DQuat::from_rotation_z),
        [0.0..6.0, 0.0..6.0, 0.0..6.0].prop_map(|[x, y, z]| DQuat::from_euler(glam::EulerRot::XYZ, x, y, z)),
    ];
    let place = [-0.2..0.2, -0.2..0.2, -0.02..0.3];
    let material = prop_oneof![Just(GROUNDED), Just(dielectric(4.0)), Just(dielectric(80.0))];
    (shape, rotation, place, material).prop_map(|(shape, rotation, place, material)| {
        (shape, Pose { translation: place.into(), rotation }, material)
    })
}

#[test]
fn any_solids_make_of_rows_what_they_do_on_the_processor() {
    let mut finders = [sensor(9_000, false), sensor(40_000, true)].map(Finder::new);
    let mut runner =
        TestRunner::new_with_rng(Config::default(), TestRng::deterministic_rng(RngAlgorithm::ChaCha));
    let objects = prop::collection::vec(any_object(), 1..4);
    for case in 0..CASES {
        let objects = objects.new_tree(&mut runner).unwrap().current();
        let shapes: Vec<Shape> = objects.iter().map(|(shape, ..)| shape.clone()).collect();
        let poses: Vec<Pose> = objects.iter().map(|(_, pose, _)| *pose).collect();
        let materials: Vec<Material> = objects.iter().map(|(.., material)| *material).collect();
        let mut solids = Solids::new(&shapes).unwrap();
        solids.place(&poses).unwrap();
        let found = compare(&mut finders[case % 2], &solids, &materials);
        println!("{case}: {found:?}");
        if found.moved + found.otherwise > 0 {
            println!("{objects:?}");
        }
    }
}
