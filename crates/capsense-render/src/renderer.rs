//! One renderer for whatever the machine has.

use crate::cpu::CpuRenderer;
use crate::error::RenderError;
use crate::gpu::{GpuOptions, GpuRenderer};
use capsense_core::geometry::{Pose, Shape};
use capsense_core::occupancy::{DepthLayers, OrthographicView};

/// What draws the depth layers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Backend {
    /// A real GPU if there is one that works, else the CPU rasteriser.
    ///
    /// A software implementation of Vulkan is never chosen, as the CPU rasteriser is faster. Medians of a release
    /// build (`examples/time_backends.rs`) on two shared x86-64 cores, CPU rasteriser against lavapipe (Mesa 22.3):
    ///
    /// | scene | pixels | CPU | lavapipe | ratio |
    /// |---|---|---|---|---|
    /// | box, 12 triangles | 64x64 | 0.008 ms | 0.27 to 0.35 ms | 34 to 43 |
    /// | ball, 2048 | 64x64 | 0.10 to 0.13 ms | 0.6 to 1.2 ms | 6.5 to 9 |
    /// | mesh, 8192 | 64x64 | 0.28 to 0.34 ms | 2.2 to 2.6 ms | 8 |
    /// | mesh, 8192 | 256x256 | 0.76 to 0.97 ms | 6 to 9 ms | 8 to 9 |
    #[default]
    Auto,
    /// Vulkan: a real GPU, else a software implementation.
    Gpu,
    /// The CPU rasteriser.
    Cpu,
}

/// Draws the depth layers of a scene, frame after frame.
#[derive(Debug)]
pub struct DepthRenderer {
    inner: Inner,
}

#[derive(Debug)]
enum Inner {
    Gpu(Box<GpuRenderer>),
    Cpu(CpuRenderer),
}

impl DepthRenderer {
    /// Makes a renderer for a view of some shapes.
    ///
    /// # Errors
    /// When the view is empty or a shape has an impossible length; with [`Backend::Gpu`] also when there is no adapter,
    /// or it does not work or suffice.
    pub fn new(backend: Backend, view: OrthographicView, shapes: &[Shape]) -> Result<Self, RenderError> {
        let gpu = |allow_software| {
            GpuRenderer::new(GpuOptions { allow_software, ..Default::default() }, view, shapes)
        };
        let cpu = || CpuRenderer::new(view, shapes).map(Inner::Cpu);
        let inner = match backend {
            Backend::Cpu => cpu()?,
            Backend::Gpu => Inner::Gpu(Box::new(gpu(true)?)),
            // Errors that the CPU rasteriser shares come back from there.
            Backend::Auto => match gpu(false) {
                Ok(renderer) => Inner::Gpu(Box::new(renderer)),
                Err(_) => cpu()?,
            },
        };
        Ok(Self { inner })
    }

    /// Exchanges view and shapes; cheaper than a new renderer, as a graphics device stays open. On an error everything
    /// stays as it was.
    ///
    /// # Errors
    /// As [`DepthRenderer::new`].
    pub fn set_scene(&mut self, view: OrthographicView, shapes: &[Shape]) -> Result<(), RenderError> {
        match &mut self.inner {
            Inner::Gpu(renderer) => renderer.set_scene(view, shapes),
            Inner::Cpu(renderer) => {
                *renderer = CpuRenderer::new(view, shapes)?;
                Ok(())
            }
        }
    }

    /// Draws one frame: `poses[k]` is where object k stands. Layers of another view or number of objects are replaced.
    ///
    /// # Errors
    /// When there is not one valid pose per object, or the graphics driver fails.
    pub fn render(&mut self, poses: &[Pose], out: &mut DepthLayers) -> Result<(), RenderError> {
        match &mut self.inner {
            Inner::Gpu(renderer) => renderer.render(poses, out),
            Inner::Cpu(renderer) => renderer.render(poses, out),
        }
    }

    /// What the frames show.
    pub fn view(&self) -> &OrthographicView {
        match &self.inner {
            Inner::Gpu(renderer) => renderer.view(),
            Inner::Cpu(renderer) => renderer.view(),
        }
    }

    /// What draws: the name of the graphics adapter, or `CPU rasteriser`.
    pub fn description(&self) -> &str {
        match &self.inner {
            Inner::Gpu(renderer) => renderer.description(),
            Inner::Cpu(_) => "CPU rasteriser",
        }
    }

    /// Whether a graphics adapter draws, be it a real one or a software one.
    pub fn uses_graphics_adapter(&self) -> bool {
        matches!(self.inner, Inner::Gpu(_))
    }
}
