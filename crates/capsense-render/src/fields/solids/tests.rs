//! Kernels against the occupancy of the processor, edge by edge. On a software adapter, too.

use super::{EdgeTrees, marks, planes, source};
use crate::adapter::Adapter;
use bytemuck::{Pod, Zeroable};
use capsense_core::electrode::{Electrode, Outline};
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::material::{Connection, Material, RelativePermittivity};
use capsense_core::occupancy::{Coupling, EdgeGeometry, Occupancy};
use capsense_core::sensor::{Sensor, SensorDesign, Wall};
use capsense_core::solids::Solids;
use capsense_core::stiffness::EdgeNetwork;
use glam::{DQuat, DVec2, DVec3};
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
}

/// The kernels for some scene on one lattice.
struct Finder {
    adapter: Adapter,
    network: EdgeNetwork,
    sensor: Sensor,
    module: Vec<(usize, wgpu::ShaderModule)>,
}

struct Found {
    conductors: Vec<u32>,
    wedges: Vec<[u32; 4]>,
    couplings: Vec<Coupling>,
}

impl Finder {
    fn new(sensor: Sensor) -> Self {
        let adapter = Adapter::open("capsense solids", true, NEEDS).unwrap();
        Self { adapter, network: EdgeNetwork::of_sensor(&sensor), sensor, module: Vec::new() }
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
        if !self.module.iter().any(|(count, _)| *count == objects) {
            let source = wgpu::ShaderSource::Wgsl(stand_alone(objects).into());
            let descriptor = wgpu::ShaderModuleDescriptor { label: None, source };
            self.module.push((objects, self.adapter.device.create_shader_module(descriptor)));
        }
        let (_, module) = self.module.iter().find(|(count, _)| *count == objects).unwrap();
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
        let told_counts = Told { counts, nodes: nodes as u32 };
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
        for entry in ["find_conductors", "find_wedges", "find_couplings"] {
            let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: None,
                bind_group_layouts: &[Some(&layout)],
                immediate_size: 0,
            });
            let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: None,
                layout: Some(&pipeline_layout),
                module,
                entry_point: Some(entry),
                compilation_options: Default::default(),
                cache: None,
            });
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&pipeline);
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

const GROUNDED: Material = Material::Conductor(Connection::Grounded);

fn dielectric(permittivity: f64) -> Material {
    Material::Dielectric(RelativePermittivity::new(permittivity).unwrap())
}

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

/// Errors of couplings of more than this count as found otherwise, not rounded otherwise.
const ROUNDED: f64 = 1e-3;

/// The largest error of what is left of an edge, in parts of its weight or of the link, among all but those found otherwise,
/// and how many these are, and of how many.
fn compare(finder: &mut Finder, solids: &Solids, materials: &[Material]) -> (f64, usize, usize) {
    let expected = finder.expected(solids, materials);
    let found = finder.found(solids, materials);
    let of_core = expected.conductors().iter().map(|&object| u32::from(object));
    let moved = of_core.zip(&found.conductors).filter(|(a, b)| a != *b).count();
    let (mut worst, mut otherwise, mut changed) = (0.0_f64, moved, 0);
    for (edge, (ours, theirs)) in found.couplings.iter().zip(expected.couplings()).enumerate() {
        if *theirs != Coupling::PLAIN {
            changed += 1;
        }
        let pair = |a: f64, b: f64| (a - b).abs() / b.abs().max(1.0);
        let error = pair(ours.through, theirs.through)
            .max(pair(ours.factor[0], theirs.factor[0]))
            .max(pair(ours.factor[1], theirs.factor[1]));
        if error > ROUNDED || error.is_nan() || ours.object != theirs.object && error > 1e-5 {
            otherwise += 1;
            if otherwise < 6 {
                let star = finder.sensor.lattice().unwrap().node_place(edge / 3);
                println!("edge {edge} axis {} at {star:?}: {ours:?} {theirs:?}", edge % 3);
            }
        } else {
            worst = worst.max(error);
        }
    }
    (worst, otherwise, changed)
}

#[test]
fn prints() {
    let mut finder = Finder::new(sensor(24_000));
    let turned = DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -0.3, 0.9);
    let shapes = [
        Shape::Box { size: DVec3::new(0.15, 0.15, 0.02) },
        Shape::Box { size: DVec3::new(0.15, 0.05, 0.05) },
        Shape::Sphere { radius: 0.05 },
        Shape::Capsule { radius: 0.03, length: 0.1 },
        Shape::Cylinder { radius: 0.03, length: 0.1 },
    ];
    for shape in shapes {
        for rotation in [DQuat::IDENTITY, turned] {
            for material in [GROUNDED, dielectric(4.0), dielectric(80.0)] {
                for height in [0.02, 0.05, 0.1, 0.2] {
                    let mut solids = Solids::new(&[shape.clone()]).unwrap();
                    let translation = DVec3::new(0.013, -0.021, 0.03 + height);
                    solids.place(&[Pose { translation, rotation }]).unwrap();
                    let found = compare(&mut finder, &solids, &[material]);
                    println!("{shape:?} {material:?} {} {height}: {found:?}", rotation == DQuat::IDENTITY);
                }
            }
        }
    }
}
