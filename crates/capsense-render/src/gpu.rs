//! Depth layers drawn through wgpu.
//!
//! Every object has a tile of its own in one `Depth32Float` atlas, drawn twice: once keeping the nearest depth, once
//! the farthest. Both are copied to one buffer and mapped. Depth 0..1 spans the object's own extent in z and a little
//! more, so nothing is clipped there, and depth resolution does not suffer from other objects being far away. What lies
//! beside the domain is clipped by the tile; what lies before or behind it is cut off after reading back. An image has the same bits
//! in every tile (`depth.wgsl`).
//!
//! Nothing is allocated per frame but what wgpu needs for a command buffer.

mod device;
mod drawing;

use crate::cpu::prepare;
use crate::error::RenderError;
use crate::scene::{RenderScene, check_view, clamp_pixel};
use capsense_core::geometry::{Pose, Shape};
use capsense_core::occupancy::{DepthLayers, OrthographicView};
pub(crate) use device::{GpuDevice, NEEDS, Rows};
use drawing::buffer;
pub(crate) use drawing::{Drawing, ObjectFrame, Tile};
use std::time::Duration;

/// A frame that takes longer than this counts as a driver that hangs.
const FRAME_TIMEOUT: Duration = Duration::from_secs(60);

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

/// Meshes of one scene and view, and where their depths come back.
#[derive(Debug)]
struct Resources {
    drawing: Drawing,
    readback: wgpu::Buffer,
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
        resources.drawing.place(&self.gpu, 0, &mut self.rows);
        let capacity = resources.drawing.atlas.capacity();
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

impl Resources {
    fn new(
        gpu: &GpuDevice,
        options: &GpuOptions,
        view: &OrthographicView,
        scene: &RenderScene,
    ) -> Result<Option<Self>, RenderError> {
        let objects = scene.objects();
        let drawing = Drawing::new(gpu, options.max_atlas_dimension, view, objects, objects.len())?;
        let Some(drawing) = drawing else { return Ok(None) };
        let usage = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ;
        let readback = buffer(gpu, "readback", drawing.atlas.buffer_bytes(), usage)?;
        gpu.faults.check("reserving graphics memory")?;
        Ok(Some(Self { drawing, readback }))
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
        let visible = frames.iter().enumerate().filter(|(_, frame)| frame.visible);
        let tiles = visible.map(|(tile, _)| Tile { tile, mesh: first + tile, pose: first + tile });
        self.drawing.draw_page(gpu, &mut encoder, view, tiles, (&self.readback, 0));
        gpu.queue.submit([encoder.finish()]);
        gpu.faults.check("drawing depth layers")
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
        let pitch = self.drawing.atlas.row_bytes() as usize / size_of::<f32>();
        for (tile, frame) in frames.iter().enumerate().filter(|(_, frame)| frame.visible) {
            let (x, y) = self.drawing.atlas.tile(tile);
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
        let expected = [("project", naga::ShaderStage::Vertex), ("depth", naga::ShaderStage::Fragment)];
        assert_eq!(entries, expected);
    }
}
