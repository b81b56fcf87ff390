//! The graphics device and its two pipelines.

use super::GpuOptions;
use crate::adapter::Adapter;
use crate::error::RenderError;
use std::ops::Deref;

/// Bytes of a vertex: three floats.
const VERTEX_BYTES: u64 = 12;

/// Three rows of an affine map, in which the shader finds them.
pub(crate) type Rows = [[f32; 4]; 3];

/// An open device with everything that does not depend on the scene.
#[derive(Debug)]
pub(crate) struct GpuDevice {
    pub(super) adapter: Adapter,
    /// Keeps what is nearest; starts at depth 1.
    pub(super) front: wgpu::RenderPipeline,
    /// Keeps what is farthest; starts at depth 0.
    pub(super) back: wgpu::RenderPipeline,
}

impl Deref for GpuDevice {
    type Target = Adapter;

    fn deref(&self) -> &Adapter {
        &self.adapter
    }
}

impl GpuDevice {
    /// Opens the fastest adapter: a discrete GPU, else an integrated one, else a software one if allowed.
    pub(super) fn open(options: &GpuOptions) -> Result<Self, RenderError> {
        let copies = wgpu::DownlevelFlags::DEPTH_TEXTURE_AND_BUFFER_COPIES;
        let needs = (copies, "it cannot copy depth to a buffer");
        Self::of(Adapter::open("capsense depth", options.allow_software, needs)?)
    }

    /// On a device that is open.
    ///
    /// # Errors
    /// When the driver fails.
    pub(crate) fn of(adapter: Adapter) -> Result<Self, RenderError> {
        let front = pipeline(&adapter.device, "front", wgpu::CompareFunction::Less);
        let back = pipeline(&adapter.device, "back", wgpu::CompareFunction::Greater);
        adapter.faults.check("building the depth pipelines")?;
        Ok(Self { adapter, front, back })
    }
}

fn pipeline(device: &wgpu::Device, label: &str, keep: wgpu::CompareFunction) -> wgpu::RenderPipeline {
    let shader = device.create_shader_module(wgpu::include_wgsl!("../depth.wgsl"));
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(label),
        bind_group_layouts: &[],
        immediate_size: 0,
    });
    let per_vertex = wgpu::VertexBufferLayout {
        array_stride: VERTEX_BYTES,
        step_mode: wgpu::VertexStepMode::Vertex,
        attributes: &wgpu::vertex_attr_array![0 => Float32x3],
    };
    let per_object = wgpu::VertexBufferLayout {
        array_stride: size_of::<Rows>() as u64,
        step_mode: wgpu::VertexStepMode::Instance,
        attributes: &wgpu::vertex_attr_array![1 => Float32x4, 2 => Float32x4, 3 => Float32x4],
    };
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(label),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &shader,
            entry_point: Some("project"),
            compilation_options: Default::default(),
            buffers: &[Some(per_vertex), Some(per_object)],
        },
        // No culling: meshes from files may be wound either way.
        primitive: wgpu::PrimitiveState { cull_mode: None, ..Default::default() },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: wgpu::TextureFormat::Depth32Float,
            depth_write_enabled: Some(true),
            depth_compare: Some(keep),
            stencil: Default::default(),
            bias: Default::default(),
        }),
        multisample: Default::default(),
        fragment: None,
        multiview_mask: None,
        cache: None,
    })
}
