//! The functions of solids by themselves, in kernels of their own, for tests.

use super::super::finder::in_two;
use super::{EdgeTrees, SOLID_WORDS, source};
use crate::adapter::Adapter;
use bytemuck::{Pod, Zeroable};
use capsense_core::material::Material;
use capsense_core::mesh::Lattice;
use capsense_core::occupancy::{Coupling, EdgeGeometry, Occupancy, Surfaces};
use capsense_core::sensor::{FREE, GROUND, Sensor, Terminal};
use capsense_core::solids::Solids;
use capsense_core::stiffness::EdgeNetwork;
use wgpu::util::DeviceExt;

const NEEDS: (wgpu::DownlevelFlags, &str) =
    (wgpu::DownlevelFlags::COMPUTE_SHADERS, "it has no compute shaders");

/// As many objects as scenes have here at most.
const MOST_OBJECTS: usize = 3;

const THREADS: u32 = 64;

/// Bindings: the first is a uniform, those before this one are read, all from it on are written.
const FIRST_WRITTEN: u32 = 7;

pub(super) fn stand_alone(most_objects: usize) -> String {
    let constants = format!(
        "const SOLID_WORDS: u32 = {SOLID_WORDS}u;\nconst OBJECTS: u32 = {most_objects}u;
const IS_EXACT: bool = true;\nconst HAS_STRONG: bool = true;\n"
    );
    constants + &source() + include_str!("../edge_rule.wgsl") + include_str!("stand_alone.wgsl")
}

/// Marks of nodes: whether a terminal has it, whether an electrode, and whether the background is the same on all its edges.
const OF_SENSOR: u32 = 1;
const OF_ELECTRODE: u32 = 2;
const HOMOGENEOUS: u32 = 4;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Told {
    counts: [u32; 3],
    /// Of nodes, or of segments.
    threads: u32,
    objects: u32,
    padding: [u32; 3],
}

/// The kernels for any scene on one lattice.
pub(super) struct Finder {
    adapter: Adapter,
    pub(super) network: EdgeNetwork,
    pub(super) sensor: Sensor,
    layout: wgpu::BindGroupLayout,
    segments: wgpu::ComputePipeline,
    steps: [wgpu::ComputePipeline; 3],
}

/// What kernels find of nodes and edges.
pub(super) struct Found {
    pub(super) conductors: Vec<u32>,
    pub(super) couplings: Vec<Coupling>,
}

impl Finder {
    pub(super) fn new(sensor: Sensor) -> Self {
        let adapter = Adapter::open("capsense solids", true, NEEDS).unwrap();
        let device = &adapter.device;
        let layout = layout(device);
        let source = wgpu::ShaderSource::Wgsl(stand_alone(MOST_OBJECTS).into());
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source });
        let pipelines = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: None,
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pipeline = |entry| {
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: None,
                layout: Some(&pipelines),
                module: &module,
                entry_point: Some(entry),
                compilation_options: Default::default(),
                cache: None,
            })
        };
        let steps = ["find_conductors", "find_wedges", "find_couplings"].map(pipeline);
        let segments = pipeline("find_segments");
        Self { network: EdgeNetwork::of_sensor(&sensor), sensor, layout, segments, steps, adapter }
    }

    /// What the processor finds.
    pub(super) fn expected(&self, solids: &Solids, materials: &[Material]) -> Occupancy {
        let mut occupancy = Occupancy::empty(self.sensor.mesh().nodes().len(), self.network.edges().len());
        let mesh = EdgeGeometry {
            nodes: self.sensor.mesh().nodes(),
            terminals: self.sensor.owners(),
            edges: self.network.edges(),
            permittivity: self.network.permittivity(),
        };
        occupancy.update(mesh, materials, solids);
        occupancy
    }

    pub(super) fn found(&self, solids: &Solids, materials: &[Material]) -> Found {
        let nodes = self.sensor.mesh().nodes().len();
        let written = [vec![0; nodes], vec![0; 4 * nodes], vec![0; 12 * nodes]];
        let [conductors, _, words] = self.run(&self.steps, nodes, solids, materials, written);
        let couplings = words.chunks_exact(4).map(|words| Coupling {
            through: f64::from(f32::from_bits(words[0])),
            factor: [1, 2].map(|at| f64::from(f32::from_bits(words[at]))),
            object: [words[3] as u16, (words[3] >> 16) as u16],
        });
        Found { conductors, couplings: couplings.collect() }
    }

    /// The parts of segments that are in a solid, from where to where, and whether their starts are.
    pub(super) fn spans(&self, solid: &Solids, segments: &[[[f32; 3]; 2]]) -> Vec<([f32; 2], bool)> {
        let points = segments.as_flattened().iter().flat_map(|point| {
            let [x, y, z] = point.map(f32::to_bits);
            [x, y, z, 0]
        });
        let written = [vec![0], vec![0; 4], points.collect()];
        let steps = std::slice::from_ref(&self.segments);
        let [_, _, words] = self.run(steps, segments.len(), solid, &[], written);
        let span = |words: &[u32]| ([words[0], words[1]].map(f32::from_bits), words[2] == 1);
        words.chunks_exact(8).map(span).collect()
    }

    fn run(
        &self,
        steps: &[wgpu::ComputePipeline],
        threads: usize,
        solids: &Solids,
        materials: &[Material],
        written: [Vec<u32>; 3],
    ) -> [Vec<u32>; 3] {
        let device = &self.adapter.device;
        let lattice = self.sensor.lattice().unwrap();
        let mut numbers = Vec::new();
        let trees = EdgeTrees::new(solids, &mut numbers);
        // No binding is of nothing.
        numbers.resize(numbers.len().max(1), 0.0);
        let mut placed = Vec::new();
        (0..solids.objects()).for_each(|object| trees.tell(solids, object, &mut placed));
        let permittivity = self.network.permittivity();
        let background: Vec<f32> = permittivity.iter().map(|value| value as f32).collect();
        let of_material = |material: &Material| match material {
            Material::Conductor(_) => [0_u32, 0],
            Material::Dielectric(permittivity) => [1, (permittivity.value() as f32).to_bits()],
        };
        let mut made_of: Vec<[u32; 2]> = materials.iter().map(of_material).collect();
        made_of.resize(solids.objects(), [0; 2]);
        let marks = marks(lattice, self.sensor.owners(), |edge| permittivity.at(edge));
        let counts = lattice.node_counts().map(|count| count as u32);
        let told =
            Told { counts, threads: threads as u32, objects: solids.objects() as u32, padding: [0; 3] };
        let buffer = |contents: &[u8], usage| {
            device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: None, contents, usage })
        };
        let read = |contents: &[u8]| buffer(contents, wgpu::BufferUsages::STORAGE);
        let both = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let written = written.map(|words| buffer(bytemuck::cast_slice(&words), both));
        let told = buffer(bytemuck::bytes_of(&told), wgpu::BufferUsages::UNIFORM);
        let read = [
            read(bytemuck::cast_slice(&planes(&self.sensor, lattice))),
            read(bytemuck::cast_slice(&marks)),
            read(bytemuck::cast_slice(&background)),
            read(bytemuck::cast_slice(&placed)),
            read(bytemuck::cast_slice(&made_of)),
            read(bytemuck::cast_slice(&numbers)),
        ];
        let all = std::iter::once(&told).chain(&read).chain(&written);
        let entries: Vec<_> = (0..)
            .zip(all)
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let group = wgpu::BindGroupDescriptor { label: None, layout: &self.layout, entries: &entries };
        let group = device.create_bind_group(&group);
        let mut encoder = device.create_command_encoder(&Default::default());
        for pipeline in steps {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups((threads as u32).div_ceil(THREADS), 1, 1);
        }
        self.adapter.queue.submit([encoder.finish()]);
        self.adapter.faults.check("finding solids").unwrap();
        written.map(|buffer| self.read(&buffer))
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

fn layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let entry = |binding: u32| {
        let ty = match binding {
            0 => wgpu::BufferBindingType::Uniform,
            _ => wgpu::BufferBindingType::Storage { read_only: binding < FIRST_WRITTEN },
        };
        wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
            count: None,
        }
    };
    let entries: Vec<_> = (0..FIRST_WRITTEN + 3).map(entry).collect();
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries: &entries })
}

/// The planes of a lattice, those across x first: where they are, in two parts, how far the next one is, and what their dual
/// lengths are multiplied by.
fn planes(sensor: &Sensor, lattice: &Lattice) -> Vec<[f32; 4]> {
    let of_axis = |axis: usize| {
        let planes = &lattice.axes()[axis];
        (0..planes.len()).map(move |index| {
            let [at, rest] = in_two(planes[index]);
            let way = planes.get(index + 1).map_or(0.0, |next| next - planes[index]);
            let dual = sensor.dual_lengths(axis).map_or(1.0, |factors| factors[index]);
            [at, rest, way as f32, dual as f32]
        })
    };
    (0..3).flat_map(of_axis).collect()
}

/// What kernels are told of each node. `background` is the relative permittivity around each edge.
fn marks(lattice: &Lattice, owners: &[Terminal], background: impl Fn(usize) -> f64) -> Vec<u32> {
    let (counts, strides) = (lattice.node_counts(), lattice.strides());
    let mark = |node: usize| {
        let place = lattice.node_place(node);
        let edges = (0..3).flat_map(|axis| {
            let below = (place[axis] > 0).then(|| 3 * (node - strides[axis]) + axis);
            let above = (place[axis] + 1 < counts[axis]).then_some(3 * node + axis);
            [below, above].into_iter().flatten()
        });
        let mut around = edges.map(&background);
        let first = around.next().unwrap_or(1.0);
        let mut mark = if around.all(|other| other == first) { HOMOGENEOUS } else { 0 };
        if owners[node] != FREE {
            mark |= OF_SENSOR;
        }
        if owners[node] != FREE && owners[node] != GROUND {
            mark |= OF_ELECTRODE;
        }
        mark
    };
    (0..owners.len()).map(mark).collect()
}
