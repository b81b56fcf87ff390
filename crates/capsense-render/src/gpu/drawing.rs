//! Meshes on a graphics device, and how their depths get into a buffer: the nearest and the farthest of each object.

use super::device::{GpuDevice, Rows};
use crate::atlas::Atlas;
use crate::error::RenderError;
use crate::scene::SceneObject;
use capsense_core::geometry::Pose;
use capsense_core::occupancy::OrthographicView;
use glam::{DMat3, DVec3};
use std::ops::Range;

/// Widens an object's range of depth on both sides, so that rounding clips nothing: a part of the range, and metres.
const DEPTH_MARGIN: (f64, f64) = (1e-3, 1e-6);

/// Meshes, and an atlas to draw them into.
#[derive(Debug)]
pub(crate) struct Drawing {
    pub(crate) atlas: Atlas,
    depth: wgpu::Texture,
    depth_view: wgpu::TextureView,
    meshes: wgpu::BindGroup,
    rows: wgpu::Buffer,
    /// The first of the corners of each mesh's triangles, and their end.
    draws: Vec<Range<u32>>,
}

/// What is drawn into a tile of the atlas: a mesh, and which of the poses it has, whose number on its page is the tile's.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tile {
    pub(crate) tile: usize,
    pub(crate) mesh: usize,
    pub(crate) pose: usize,
}

/// How one object is drawn in the present frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ObjectFrame {
    pub(crate) visible: bool,
    /// z in metres at depth 0.
    pub(crate) near: f64,
    /// z at depth 1 less z at depth 0, metres.
    pub(crate) range: f64,
}

impl ObjectFrame {
    /// The range of depth of an object at a pose, and the map from its vertices to clip coordinates.
    pub(crate) fn new(view: &OrthographicView, object: &SceneObject, pose: &Pose) -> (Self, Rows) {
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
        let row = |row| linear.row(row).extend(offset[row]).as_vec4().to_array();
        (frame, Rows::new([0, 1, 2].map(row), [view.width, view.height]))
    }
}

impl Drawing {
    /// Uploads meshes, and makes an atlas for so many of them at poses of their own, at most so large; `None` where there are
    /// none.
    ///
    /// # Errors
    /// When the image or the meshes exceed the adapter's limits, or the driver fails.
    pub(crate) fn new(
        gpu: &GpuDevice,
        max_atlas_dimension: Option<u32>,
        view: &OrthographicView,
        meshes: &[SceneObject],
        poses: usize,
    ) -> Result<Option<Self>, RenderError> {
        let device_limit = gpu.limits.max_texture_dimension_2d;
        let max_dimension = max_atlas_dimension.map_or(device_limit, |wanted| wanted.min(device_limit));
        let atlas = Atlas::new((view.width, view.height), poses, max_dimension, gpu.limits.max_buffer_size)?;
        if poses == 0 {
            return Ok(None);
        }
        let (mut vertices, mut corners, mut draws) = (Vec::new(), Vec::new(), Vec::new());
        for object in meshes {
            let (first, base) = (corners.len(), vertices.len());
            vertices.extend_from_slice(object.positions());
            let (needed, limit) = (corners.len() + 3 * object.triangles().len(), u64::from(u32::MAX));
            if needed.max(vertices.len()) as u64 > limit {
                let what = "the number of triangle corners";
                return Err(RenderError::LimitExceeded { what, needed: needed as u64, limit });
            }
            corners.extend(object.triangles().iter().flatten().map(|corner| corner + base as u32));
            draws.push(first as u32..corners.len() as u32);
        }
        let rows_bytes = (poses * size_of::<Rows>()) as u64;
        use wgpu::BufferUsages as Usage;
        let depth = depth_texture(gpu, &atlas);
        let [vertices, corners]: [&[u8]; 2] =
            [bytemuck::cast_slice(&vertices), bytemuck::cast_slice(&corners)];
        let buffers = [storage(gpu, "vertices", vertices)?, storage(gpu, "corners of triangles", corners)?];
        let entries = [0, 1].map(|number: usize| wgpu::BindGroupEntry {
            binding: number as u32,
            resource: buffers[number].as_entire_binding(),
        });
        let drawing = Self {
            atlas,
            depth_view: depth.create_view(&Default::default()),
            depth,
            meshes: gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("meshes"),
                layout: &gpu.meshes,
                entries: &entries,
            }),
            rows: buffer(gpu, "clip_from_object", rows_bytes, Usage::VERTEX | Usage::COPY_DST)?,
            draws,
        };
        gpu.faults.check("reserving graphics memory")?;
        Ok(Some(drawing))
    }

    /// Tells where objects are, from a number on.
    pub(crate) fn place(&self, gpu: &GpuDevice, first: usize, rows: &mut [Rows]) {
        for (object, rows) in rows.iter_mut().enumerate() {
            rows.draw_at(self.atlas.tile((first + object) % self.atlas.capacity()));
        }
        let offset = (first * size_of::<Rows>()) as u64;
        gpu.queue.write_buffer(&self.rows, offset, bytemuck::cast_slice(rows));
    }

    /// Draws objects into the atlas, both layers, and copies them to a buffer.
    pub(crate) fn draw_page(
        &self,
        gpu: &GpuDevice,
        encoder: &mut wgpu::CommandEncoder,
        view: &OrthographicView,
        tiles: impl Iterator<Item = Tile> + Clone,
        (target, at): (&wgpu::Buffer, u64),
    ) {
        let layers = [(&gpu.front, 1.0, at), (&gpu.back, 0.0, at + self.atlas.layer_bytes())];
        for (pipeline, clear, offset) in layers {
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
            pass.set_bind_group(0, &self.meshes, &[]);
            pass.set_vertex_buffer(0, self.rows.slice(..));
            for Tile { tile, mesh, pose } in tiles.clone() {
                let (x, y) = self.atlas.tile(tile);
                let (width, height) = (view.width as u32, view.height as u32);
                pass.set_viewport(x as f32, y as f32, width as f32, height as f32, 0.0, 1.0);
                pass.set_scissor_rect(x, y, width, height);
                let instance = pose as u32;
                pass.draw(self.draws[mesh].clone(), instance..instance + 1);
            }
            drop(pass);
            self.copy_layer(encoder, target, offset);
        }
    }

    fn copy_layer(&self, encoder: &mut wgpu::CommandEncoder, target: &wgpu::Buffer, offset: u64) {
        encoder.copy_texture_to_buffer(
            wgpu::TexelCopyTextureInfo {
                texture: &self.depth,
                mip_level: 0,
                origin: wgpu::Origin3d::ZERO,
                aspect: wgpu::TextureAspect::DepthOnly,
            },
            wgpu::TexelCopyBufferInfo {
                buffer: target,
                layout: wgpu::TexelCopyBufferLayout {
                    offset,
                    bytes_per_row: Some(self.atlas.row_bytes() as u32),
                    rows_per_image: None,
                },
            },
            self.depth.size(),
        );
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

/// A buffer of data that shaders read.
fn storage(gpu: &GpuDevice, label: &'static str, data: &[u8]) -> Result<wgpu::Buffer, RenderError> {
    let limit = gpu.limits.max_storage_buffer_binding_size;
    if data.len() as u64 > limit {
        return Err(RenderError::LimitExceeded { what: label, needed: data.len() as u64, limit });
    }
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
    // There is no binding of nothing.
    let buffer = buffer(gpu, label, (data.len() as u64).max(4), usage)?;
    gpu.queue.write_buffer(&buffer, 0, data);
    Ok(buffer)
}

pub(super) fn buffer(
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
