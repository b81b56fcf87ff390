//! The graphics device and its two pipelines.

use super::GpuOptions;
use crate::adapter::Adapter;
use crate::error::RenderError;
use bytemuck::{Pod, Zeroable};
use std::ops::Deref;

/// What an adapter must have to draw depths, and what it lacks if it has not.
pub(crate) const NEEDS: (wgpu::DownlevelFlags, &str) = (
    wgpu::DownlevelFlags::DEPTH_TEXTURE_AND_BUFFER_COPIES.union(wgpu::DownlevelFlags::VERTEX_STORAGE),
    "it cannot copy depth to a buffer, or has none for vertex shaders",
);

/// To what the shader rounds corners: so many parts of a pixel.
const PARTS: f32 = 256.0;

/// How an object is drawn, as the shader has it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct Rows {
    /// Three rows of an affine map.
    clip_from_object: [[f32; 4]; 3],
    /// Parts of a pixel in a unit of clip space, across and down.
    parts: [f32; 2],
    /// The middle of the object's tile in the atlas, in pixels.
    middle: [f32; 2],
}

impl Rows {
    /// Those of an image of some size in pixels.
    pub(super) fn new(clip_from_object: [[f32; 4]; 3], size: [usize; 2]) -> Self {
        let parts = size.map(|pixels| PARTS * 0.5 * pixels as f32);
        Self { clip_from_object, parts, middle: [0.0; 2] }
    }

    /// Has it drawn in the tile that begins at a pixel.
    pub(super) fn draw_at(&mut self, (x, y): (u32, u32)) {
        let [across, down] = self.parts.map(|parts| parts / PARTS);
        self.middle = [x as f32 + across, y as f32 + down];
    }
}

/// An open device with everything that does not depend on the scene.
#[derive(Debug)]
pub(crate) struct GpuDevice {
    pub(super) adapter: Adapter,
    /// Keeps what is nearest; starts at depth 1.
    pub(super) front: wgpu::RenderPipeline,
    /// Keeps what is farthest; starts at depth 0.
    pub(super) back: wgpu::RenderPipeline,
    pub(super) meshes: wgpu::BindGroupLayout,
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
        Self::of(Adapter::open("capsense depth", options.allow_software, NEEDS)?)
    }

    /// On a device that is open.
    ///
    /// # Errors
    /// When the driver fails.
    pub(crate) fn of(adapter: Adapter) -> Result<Self, RenderError> {
        let meshes = meshes_layout(&adapter.device);
        let front = pipeline(&adapter.device, &meshes, "front", wgpu::CompareFunction::Less);
        let back = pipeline(&adapter.device, &meshes, "back", wgpu::CompareFunction::Greater);
        adapter.faults.check("building the depth pipelines")?;
        Ok(Self { adapter, front, back, meshes })
    }
}

/// Vertices, and the corners of triangles.
fn meshes_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let entries = [0, 1].map(|binding| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::VERTEX,
        ty: wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Storage { read_only: true },
            has_dynamic_offset: false,
            min_binding_size: None,
        },
        count: None,
    });
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("meshes"),
        entries: &entries,
    })
}

fn pipeline(
    device: &wgpu::Device,
    meshes: &wgpu::BindGroupLayout,
    label: &str,
    keep: wgpu::CompareFunction,
) -> wgpu::RenderPipeline {
    let shader = device.create_shader_module(wgpu::include_wgsl!("../depth.wgsl"));
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(label),
        bind_group_layouts: &[Some(meshes)],
        immediate_size: 0,
    });
    let per_object = wgpu::VertexBufferLayout {
        array_stride: size_of::<Rows>() as u64,
        step_mode: wgpu::VertexStepMode::Instance,
        attributes: &wgpu::vertex_attr_array![0 => Float32x4, 1 => Float32x4, 2 => Float32x4, 3 => Float32x2, 4 => Float32x2],
    };
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(label),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &shader,
            entry_point: Some("project"),
            compilation_options: Default::default(),
            buffers: &[Some(per_object)],
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
        fragment: Some(wgpu::FragmentState {
            module: &shader,
            entry_point: Some("depth"),
            compilation_options: Default::default(),
            targets: &[],
        }),
        multiview_mask: None,
        cache: None,
    })
}
