//! What kernels are bound to, and how they are made from their source.

use super::launch::Launch;

/// Launches are told apart by their place in a uniform buffer.
pub(super) const LAUNCH_STRIDE: u64 = 256;

/// What kernels read and write.
#[derive(Debug)]
pub(super) struct Buffers {
    pub(super) maps: wgpu::Buffer,
    pub(super) networks: wgpu::Buffer,
    pub(super) vectors: wgpu::Buffer,
    pub(super) holders: wgpu::Buffer,
    pub(super) scratch: wgpu::Buffer,
    pub(super) changes: wgpu::Buffer,
    pub(super) results: wgpu::Buffer,
}

/// Two uniform buffers, then storage: which of it kernels write to.
const WRITTEN: [bool; 7] = [false, true, true, true, true, false, true];

/// Two uniforms, the first of them a launch's, and the buffers.
pub(super) fn bind_group_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let uniforms = [true, false].map(|has_dynamic_offset| wgpu::BindingType::Buffer {
        ty: wgpu::BufferBindingType::Uniform,
        has_dynamic_offset,
        min_binding_size: None,
    });
    let storage = WRITTEN.map(|written| wgpu::BindingType::Buffer {
        ty: wgpu::BufferBindingType::Storage { read_only: !written },
        has_dynamic_offset: false,
        min_binding_size: None,
    });
    let entry = |(binding, ty): (usize, wgpu::BindingType)| wgpu::BindGroupLayoutEntry {
        binding: binding as u32,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty,
        count: None,
    };
    let entries: Vec<_> = uniforms.into_iter().chain(storage).enumerate().map(entry).collect();
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("fields"),
        entries: &entries,
    })
}

/// What kernels are bound to.
pub(super) fn bind_group(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    launches: &wgpu::Buffer,
    uniform: &wgpu::Buffer,
    buffers: &Buffers,
) -> wgpu::BindGroup {
    let launch = wgpu::BufferBinding {
        buffer: launches,
        offset: 0,
        size: wgpu::BufferSize::new(size_of::<Launch>() as u64),
    };
    let Buffers { maps, networks, vectors, holders, scratch, changes, results } = buffers;
    let storage = [uniform, maps, networks, vectors, holders, scratch, changes, results];
    let resources = storage.map(wgpu::Buffer::as_entire_binding);
    let resources = std::iter::once(wgpu::BindingResource::Buffer(launch)).chain(resources);
    let entries: Vec<_> = resources
        .enumerate()
        .map(|(binding, resource)| wgpu::BindGroupEntry { binding: binding as u32, resource })
        .collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some("fields"), layout, entries: &entries })
}

/// The kernels of these entry points.
pub(super) fn pipelines(
    device: &wgpu::Device,
    layouts: [Option<&wgpu::BindGroupLayout>; 2],
    entries: &[&str],
    source: &str,
) -> Vec<wgpu::ComputePipeline> {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("fields"),
        source: wgpu::ShaderSource::Wgsl(source.into()),
    });
    let count = layouts.iter().flatten().count();
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("fields"),
        bind_group_layouts: &layouts[..count],
        immediate_size: 0,
    });
    let pipeline = |entry: &&str| {
        device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(entry),
            layout: Some(&layout),
            module: &module,
            entry_point: Some(entry),
            compilation_options: Default::default(),
            cache: None,
        })
    };
    entries.iter().map(pipeline).collect()
}
