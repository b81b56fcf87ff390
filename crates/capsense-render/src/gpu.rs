//! Depth layers drawn through wgpu.
//!
//! Every object has a tile of its own in one `Depth32Float` atlas, drawn twice: once keeping the nearest depth, once
//! the farthest. Both are copied to one buffer and mapped. Depth 0..1 spans the object's own extent in z and a little
//! more, so nothing is clipped there, and depth resolution does not suffer from other objects being far away. What lies
//! beside the domain is clipped by the tile; what lies before or behind it is cut off after reading back.
//!
//! Nothing is allocated per frame but what wgpu needs for a command buffer.

mod device;

use crate::atlas::Atlas;
use crate::cpu::prepare;
use crate::error::RenderError;
use crate::scene::{RenderScene, SceneObject, check_view, clamp_pixel};
use capsense_core::geometry::{Pose, Shape};
use capsense_core::occupancy::{DepthLayers, OrthographicView};
use device::{GpuDevice, Rows};
use glam::{DMat3, DVec3};
use std::time::Duration;

/// A frame that takes longer than this counts as a driver that hangs.
const FRAME_TIMEOUT: Duration = Duration::from_secs(60);

/// Widens an object's range of depth on both sides, so that rounding clips nothing: a part of the range, and metres.
const DEPTH_MARGIN: (f64, f64) = (1e-3, 1e-6);

/// How a [`GpuRenderer`] uses the machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GpuOptions {
    /// Whether a software implementation of Vulkan will do when there is no GPU.
    pub allow_software: bool,
    /// Largest edge of the depth atlas in pixels; `None`: as large as the adapter allows. More objects than fit take
    /// several passes.
    pub max_atlas_dimension: Option<u32>,
}

impl Default for GpuOptions {
    fn default() -> Self {
        Self { allow_software: true, max_atlas_dimension: None }
    }
}

/// Draws depth layers with a graphics adapter.
#[derive(Debug)]
pub struct GpuRenderer {
    gpu: GpuDevice,
    options: GpuOptions,
    view: OrthographicView,
    scene: RenderScene,
    /// `None` when there are no objects.
    resources: Option<Resources>,
    frames: Vec<ObjectFrame>,
    rows: Vec<Rows>,
}

/// Buffers and textures for one scene and view.
#[derive(Debug)]
struct Resources {
    atlas: Atlas,
    depth: wgpu::Texture,
    depth_view: wgpu::TextureView,
    vertices: wgpu::Buffer,
    indices: wgpu::Buffer,
    rows: wgpu::Buffer,
    readback: wgpu::Buffer,
    /// First index, end of the indices and first vertex of each object.
    draws: Vec<(u32, u32, i32)>,
}

/// How one object is drawn in the present frame.
#[derive(Clone, Copy, Debug)]
struct ObjectFrame {
    visible: bool,
    /// z in metres at depth 0.
    near: f64,
    /// z at depth 1 less z at depth 0, metres.
    range: f64,
}

impl GpuRenderer {
    /// Opens a device and uploads the tessellated shapes.
    ///
    /// # Errors
    /// When there is no adapter or it cannot be opened, the image or the meshes exceed its limits, the driver fails,
    /// the view is empty, or a shape has an impossible length.
    pub fn new(options: GpuOptions, view: OrthographicView, shapes: &[Shape]) -> Result<Self, RenderError> {
        check_view(&view)?;
        let scene = RenderScene::new(shapes)?;
        let gpu = GpuDevice::open(&options)?;
        let resources = Resources::new(&gpu, &options, &view, &scene)?;
        Ok(Self { gpu, options, view, scene, resources, frames: Vec::new(), rows: Vec::new() })
    }

    /// Exchanges view and shapes but keeps the device, which is what takes long to open. On an error everything stays.
    ///
    /// # Errors
    /// As [`GpuRenderer::new`].
    pub fn set_scene(&mut self, view: OrthographicView, shapes: &[Shape]) -> Result<(), RenderError> {
        check_view(&view)?;
        let scene = RenderScene::new(shapes)?;
        self.resources = Resources::new(&self.gpu, &self.options, &view, &scene)?;
        (self.view, self.scene) = (view, scene);
        Ok(())
    }

    /// What the frames show.
    pub fn view(&self) -> &OrthographicView {
        &self.view
    }

    /// Name of the adapter and its driver.
    pub fn description(&self) -> &str {
        &self.gpu.description
    }

    /// Whether the adapter is a software implementation running on the CPU.
    pub fn is_software(&self) -> bool {
        self.gpu.software
    }

    /// Draws one frame: `poses[k]` is where object k stands. Layers of another view or number of objects are replaced.
    ///
    /// # Errors
    /// When there is not one valid pose per object, or the driver fails.
    pub fn render(&mut self, poses: &[Pose], out: &mut DepthLayers) -> Result<(), RenderError> {
        self.scene.check_poses(poses)?;
        prepare(out, &self.view, poses.len());
        let Some(resources) = &self.resources else { return Ok(()) };
        self.frames.clear();
        self.rows.clear();
        for (object, pose) in self.scene.objects().iter().zip(poses) {
            let (frame, rows) = ObjectFrame::new(&self.view, object, pose);
            self.frames.push(frame);
            self.rows.push(rows);
        }
        self.gpu.queue.write_buffer(&resources.rows, 0, bytemuck::cast_slice(&self.rows));
        let capacity = resources.atlas.capacity();
        for (page, frames) in self.frames.chunks(capacity).enumerate() {
            if frames.iter().any(|frame| frame.visible) {
                let first = page * capacity;
                resources.draw_page(&self.gpu, &self.view, first, frames)?;
                resources.read_page(&self.gpu, first, frames, out)?;
            }
        }
        Ok(())
    }
}

impl ObjectFrame {
    /// The range of depth of an object at a pose, and the map from its vertices to clip coordinates.
    fn new(view: &OrthographicView, object: &SceneObject, pose: &Pose) -> (Self, Rows) {
        let bounds = object.bounds(pose);
        let margin = DEPTH_MARGIN.0 * bounds.size().z + DEPTH_MARGIN.1;
        let frame = Self {
            visible: bounds.intersects(&view.domain),
            near: bounds.min.z - margin,
            range: bounds.size().z + 2.0 * margin,
        };
        // x: domain.min..max to -1..1; y the same, but turned over, as row 0 is at the top; z: near..far to 0..1.
        let size = view.domain.size();
        let middle = 0.5 * (view.domain.min + view.domain.max);
        let origin = DVec3::new(middle.x, middle.y, frame.near);
        let scale = DVec3::new(2.0 / size.x, -2.0 / size.y, 1.0 / frame.range);
        let linear = DMat3::from_diagonal(scale) * DMat3::from_quat(pose.rotation);
        let offset = scale * (pose.sensor_from_object(object.centre()) - origin);
        let rows = [0, 1, 2].map(|row| linear.row(row).extend(offset[row]).as_vec4().to_array());
        (frame, rows)
    }
}

impl Resources {
    fn new(
        gpu: &GpuDevice,
        options: &GpuOptions,
        view: &OrthographicView,
        scene: &RenderScene,
    ) -> Result<Option<Self>, RenderError> {
        let device_limit = gpu.limits.max_texture_dimension_2d;
        let max_dimension =
            options.max_atlas_dimension.map_or(device_limit, |wanted| wanted.min(device_limit));
        let objects = scene.objects();
        let atlas =
            Atlas::new((view.width, view.height), objects.len(), max_dimension, gpu.limits.max_buffer_size)?;
        if objects.is_empty() {
            return Ok(None);
        }
        let (mut vertices, mut indices, mut draws) = (Vec::new(), Vec::new(), Vec::new());
        for object in objects {
            let (first, base) = (indices.len(), vertices.len());
            vertices.extend_from_slice(object.positions());
            indices.extend(object.triangles().iter().flatten().copied());
            let too_many = |_| RenderError::LimitExceeded {
                what: "the number of triangle corners",
                needed: indices.len() as u64,
                limit: i32::MAX as u64,
            };
            let first = u32::try_from(first).map_err(too_many)?;
            let end = u32::try_from(indices.len()).map_err(too_many)?;
            draws.push((first, end, i32::try_from(base).map_err(too_many)?));
        }
        let (vertices, indices) = (bytemuck::cast_slice(&vertices), bytemuck::cast_slice(&indices));
        let rows_bytes = (objects.len() * size_of::<Rows>()) as u64;
        use wgpu::BufferUsages as Usage;
        let depth = depth_texture(gpu, &atlas);
        let resources = Self {
            atlas,
            depth_view: depth.create_view(&Default::default()),
            depth,
            vertices: buffer(gpu, "vertices", vertices.len() as u64, Usage::VERTEX | Usage::COPY_DST)?,
            indices: buffer(gpu, "indices", indices.len() as u64, Usage::INDEX | Usage::COPY_DST)?,
            rows: buffer(gpu, "clip_from_object", rows_bytes, Usage::VERTEX | Usage::COPY_DST)?,
            readback: buffer(gpu, "readback", atlas.buffer_bytes(), Usage::COPY_DST | Usage::MAP_READ)?,
            draws,
        };
        gpu.faults.check("reserving graphics memory")?;
        gpu.queue.write_buffer(&resources.vertices, 0, vertices);
        gpu.queue.write_buffer(&resources.indices, 0, indices);
        gpu.faults.check("uploading meshes")?;
        Ok(Some(resources))
    }

    /// Draws the objects from `first` on into the atlas, both layers, and copies them to the readback buffer.
    fn draw_page(
        &self,
        gpu: &GpuDevice,
        view: &OrthographicView,
        first: usize,
        frames: &[ObjectFrame],
    ) -> Result<(), RenderError> {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        for (pipeline, clear, offset) in [(&gpu.front, 1.0, 0), (&gpu.back, 0.0, self.atlas.layer_bytes())] {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                    view: &self.depth_view,
                    depth_ops: Some(wgpu::Operations {
                        load: wgpu::LoadOp::Clear(clear),
                        store: wgpu::StoreOp::Store,
                    }),
                    stencil_ops: None,
                }),
                ..Default::default()
            });
            pass.set_pipeline(pipeline);
            pass.set_vertex_buffer(0, self.vertices.slice(..));
            pass.set_vertex_buffer(1, self.rows.slice(..));
            pass.set_index_buffer(self.indices.slice(..), wgpu::IndexFormat::Uint32);
            for (tile, _) in frames.iter().enumerate().filter(|(_, frame)| frame.visible) {
                let (x, y) = self.atlas.tile(tile);
                let (width, height) = (view.width as u32, view.height as u32);
                pass.set_viewport(x as f32, y as f32, width as f32, height as f32, 0.0, 1.0);
                pass.set_scissor_rect(x, y, width, height);
                let (start, end, base) = self.draws[first + tile];
                let instance = (first + tile) as u32;
                pass.draw_indexed(start..end, base, instance..instance + 1);
            }
            drop(pass);
            self.copy_layer(&mut encoder, offset);
        }
        gpu.queue.submit([encoder.finish()]);
        gpu.faults.check("drawing depth layers")
    }

    fn copy_layer(&self, encoder: &mut wgpu::CommandEncoder, offset: u64) {
        encoder.copy_texture_to_buffer(
            wgpu::TexelCopyTextureInfo {
                texture: &self.depth,
                mip_level: 0,
                origin: wgpu::Origin3d::ZERO,
                aspect: wgpu::TextureAspect::DepthOnly,
            },
            wgpu::TexelCopyBufferInfo {
                buffer: &self.readback,
                layout: wgpu::TexelCopyBufferLayout {
                    offset,
                    bytes_per_row: Some(self.atlas.row_bytes() as u32),
                    rows_per_image: None,
                },
            },
            self.depth.size(),
        );
    }

    /// Waits for a page and turns its depths into z.
    fn read_page(
        &self,
        gpu: &GpuDevice,
        first: usize,
        frames: &[ObjectFrame],
        out: &mut DepthLayers,
    ) -> Result<(), RenderError> {
        let failed = |reason: String| RenderError::Driver { doing: "reading depth layers back", reason };
        // Whether mapping succeeded is told by `get_mapped_range`.
        self.readback.map_async(wgpu::MapMode::Read, .., |_| {});
        let wait = wgpu::PollType::Wait { submission_index: None, timeout: Some(FRAME_TIMEOUT) };
        gpu.device.poll(wait).map_err(|error| failed(error.to_string()))?;
        gpu.faults.check("waiting for depth layers")?;
        let bytes = self.readback.slice(..).get_mapped_range().map_err(|error| failed(error.to_string()))?;
        let depths: &[f32] = bytemuck::try_cast_slice(&bytes).map_err(|error| failed(error.to_string()))?;
        let (fronts, backs) = depths.split_at(depths.len() / 2);
        let width = out.view().width;
        let domain = out.view().domain;
        let (near, far) = (domain.min.z as f32, domain.max.z as f32);
        let pitch = self.atlas.row_bytes() as usize / size_of::<f32>();
        for (tile, frame) in frames.iter().enumerate().filter(|(_, frame)| frame.visible) {
            let (x, y) = self.atlas.tile(tile);
            let z_at = |depth: f32| (frame.near + frame.range * f64::from(depth)) as f32;
            let (front, back) = out.layer_mut(first + tile);
            let rows = front.chunks_exact_mut(width).zip(back.chunks_exact_mut(width));
            for (row, (front, back)) in rows.enumerate() {
                let start = (y as usize + row) * pitch + x as usize;
                let source = fronts[start..start + width].iter().zip(&backs[start..start + width]);
                for ((front, back), (&nearest, &farthest)) in front.iter_mut().zip(back).zip(source) {
                    if nearest < 1.0 {
                        (*front, *back) = (z_at(nearest), z_at(farthest));
                        clamp_pixel(front, back, near, far);
                    }
                }
            }
        }
        drop(bytes);
        self.readback.unmap();
        Ok(())
    }
}

fn depth_texture(gpu: &GpuDevice, atlas: &Atlas) -> wgpu::Texture {
    let (width, height) = atlas.size();
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("depth atlas"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Depth32Float,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    })
}

fn buffer(
    gpu: &GpuDevice,
    label: &'static str,
    size: u64,
    usage: wgpu::BufferUsages,
) -> Result<wgpu::Buffer, RenderError> {
    let limit = gpu.limits.max_buffer_size;
    if size > limit {
        return Err(RenderError::LimitExceeded { what: label, needed: size, limit });
    }
    Ok(gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size,
        usage,
        mapped_at_creation: false,
    }))
}

#[cfg(test)]
mod tests {
    /// Needs no GPU: the shader is valid WGSL and has the entry point that the pipelines name.
    #[test]
    fn the_shader_is_valid() {
        let module = naga::front::wgsl::parse_str(include_str!("depth.wgsl")).unwrap();
        let mut validator = naga::valid::Validator::new(
            naga::valid::ValidationFlags::all(),
            naga::valid::Capabilities::empty(),
        );
        validator.validate(&module).unwrap();
        let entries: Vec<_> = module.entry_points.iter().map(|e| (e.name.as_str(), e.stage)).collect();
        assert_eq!(entries, [("project", naga::ShaderStage::Vertex)]);
    }
}
