//! The window without a window: drawn by the graphics device into a picture.

use crate::app::ViewerApp;
use crate::export::{PngError, write_png};
use crate::preferences::Preferences;
use crate::session::Bars;
use crate::start::Start;
use egui_wgpu::wgpu;
use egui_wgpu::{RenderState, ScreenDescriptor, WgpuConfiguration, WgpuSetup};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// How long the scene may take.
const PATIENCE: Duration = Duration::from_secs(600);

/// Frames after which layout has settled.
const SETTLE: usize = 6;

/// What to draw.
#[derive(Clone, Debug)]
pub struct Request {
    /// Where to.
    pub out: PathBuf,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// All frames up to this one are computed.
    pub frame: usize,
    /// Whether error bars are told.
    pub bars: bool,
    /// How the window is.
    pub preferences: Preferences,
}

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
pub enum ScreenshotError {
    /// Nothing can draw.
    #[error("no graphics adapter can draw: {0}")]
    NoAdapter(String),
    /// The picture cannot be fetched.
    #[error("the picture cannot be fetched from the graphics device: {0}")]
    Device(String),
    /// The scene failed, or took too long.
    #[error("{0}")]
    Scene(String),
    /// The frame is not in the scene.
    #[error("the scene has frames 0 to {last}, and so no frame {frame}")]
    Frame {
        /// The frame asked for.
        frame: usize,
        /// The last one.
        last: usize,
    },
    /// There is no thread for the simulator.
    #[error("no thread can be started: {0}")]
    Thread(#[from] std::io::Error),
    /// The file cannot be written.
    #[error(transparent)]
    Png(#[from] PngError),
}

/// Draws a scene and writes the picture.
///
/// # Errors
/// When there is no graphics adapter, the scene fails, or the file cannot be written.
pub fn take(start: Start, request: &Request) -> Result<(), ScreenshotError> {
    let state = render_state()?;
    let ctx = egui::Context::default();
    let mut app = ViewerApp::new(&ctx, Some(&state), start, request.preferences.clone())?;
    let mut canvas = Canvas { ctx, state, size: request.size, begun: Instant::now() };
    canvas.until(&mut app, |app| app.session.is_settled() && app.session.last.is_some())?;
    let frames = app.session.transport.frames();
    if request.frame >= frames {
        return Err(ScreenshotError::Frame { frame: request.frame, last: frames - 1 });
    }
    app.session.history.clear();
    app.session.run(0..request.frame + 1);
    let computed = |app: &ViewerApp| {
        app.session.is_settled() && app.session.history.last().is_some_and(|last| last.frame == request.frame)
    };
    canvas.until(&mut app, computed)?;
    if request.bars {
        app.session.tell_bars();
        canvas.until(&mut app, |app| !matches!(app.session.bars, Bars::Unknown))?;
    }
    for _ in 0..SETTLE {
        canvas.frame(&mut app)?;
    }
    let pixels = canvas.frame(&mut app)?;
    Ok(write_png(&request.out, &pixels, request.size)?)
}

fn render_state() -> Result<RenderState, ScreenshotError> {
    let setup = WgpuSetup::without_display_handle();
    let instance = pollster::block_on(setup.new_instance());
    let configuration = WgpuConfiguration { wgpu_setup: setup, ..Default::default() };
    let options = egui_wgpu::RendererOptions::default();
    pollster::block_on(RenderState::create(&configuration, &instance, None, options))
        .map_err(|error| ScreenshotError::NoAdapter(error.to_string()))
}

/// What stands in for the window.
struct Canvas {
    ctx: egui::Context,
    state: RenderState,
    size: [u32; 2],
    begun: Instant,
}

impl Canvas {
    /// Draws frames until something is so.
    fn until(
        &mut self,
        app: &mut ViewerApp,
        is_done: impl Fn(&ViewerApp) -> bool,
    ) -> Result<(), ScreenshotError> {
        while !is_done(app) {
            self.frame(app)?;
            let error = app.session.message.as_ref().filter(|message| message.severity.is_failure());
            if let Some(message) = error {
                return Err(ScreenshotError::Scene(message.text.clone()));
            }
            if self.begun.elapsed() > PATIENCE {
                return Err(ScreenshotError::Scene("the scene took too long".to_owned()));
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        Ok(())
    }

    /// Draws one frame and returns its pixels.
    fn frame(&mut self, app: &mut ViewerApp) -> Result<Vec<u8>, ScreenshotError> {
        let [width, height] = self.size;
        let rect = egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(width as f32, height as f32));
        let input = egui::RawInput {
            screen_rect: Some(rect),
            time: Some(self.begun.elapsed().as_secs_f64()),
            focused: true,
            ..Default::default()
        };
        let mut output = self.ctx.run_ui(input, |ui| app.show(ui));
        let deltas = std::mem::take(&mut output.textures_delta);
        let shapes = std::mem::take(&mut output.shapes);
        let pixels = self.draw(&output, shapes, deltas);
        output.drop_without_applying_deltas();
        pixels
    }

    fn draw(
        &self,
        output: &egui::FullOutput,
        shapes: Vec<egui::epaint::ClippedShape>,
        mut deltas: egui::TexturesDelta,
    ) -> Result<Vec<u8>, ScreenshotError> {
        let RenderState { device, queue, target_format, .. } = &self.state;
        let mut renderer = self.state.renderer.write();
        for (id, pieces) in deltas.set.drain() {
            for piece in pieces {
                renderer.update_texture(device, queue, id, &piece);
            }
        }
        let screen =
            ScreenDescriptor { pixels_per_point: output.pixels_per_point, size_in_pixels: self.size };
        let triangles = self.ctx.tessellate(shapes, output.pixels_per_point);
        let mut encoder =
            device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("picture") });
        let before = renderer.update_buffers(device, queue, &mut encoder, &triangles, &screen);
        let texture = target(device, self.size, *target_format);
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        {
            let attachment = wgpu::RenderPassColorAttachment {
                view: &view,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                    store: wgpu::StoreOp::Store,
                },
                depth_slice: None,
            };
            let mut pass = encoder
                .begin_render_pass(&wgpu::RenderPassDescriptor {
                    label: Some("picture"),
                    color_attachments: &[Some(attachment)],
                    ..Default::default()
                })
                .forget_lifetime();
            renderer.render(&mut pass, &triangles, &screen);
        }
        let pixels = fetch(device, queue, encoder, before, &texture)?;
        for id in deltas.free.drain() {
            renderer.free_texture(&id);
        }
        Ok(in_order(pixels, *target_format))
    }
}

fn target(device: &wgpu::Device, [width, height]: [u32; 2], format: wgpu::TextureFormat) -> wgpu::Texture {
    device.create_texture(&wgpu::TextureDescriptor {
        label: Some("picture"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    })
}

/// Runs the commands and copies the picture to memory, row by row without padding.
fn fetch(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    mut encoder: wgpu::CommandEncoder,
    before: Vec<wgpu::CommandBuffer>,
    texture: &wgpu::Texture,
) -> Result<Vec<u8>, ScreenshotError> {
    let failed = |error: &dyn std::fmt::Display| ScreenshotError::Device(error.to_string());
    let row = 4 * texture.width();
    let padded = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("picture"),
        size: u64::from(padded) * u64::from(texture.height()),
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(padded), rows_per_image: None };
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        wgpu::TexelCopyBufferInfo { buffer: &buffer, layout },
        texture.size(),
    );
    queue.submit(before.into_iter().chain(std::iter::once(encoder.finish())));
    let slice = buffer.slice(..);
    let (sender, receiver) = std::sync::mpsc::channel();
    slice.map_async(wgpu::MapMode::Read, move |result| drop(sender.send(result)));
    device.poll(wgpu::PollType::wait_indefinitely()).map_err(|error| failed(&error))?;
    receiver.recv().map_err(|error| failed(&error))?.map_err(|error| failed(&error))?;
    let mapped = slice.get_mapped_range().map_err(|error| failed(&error))?;
    let rows = mapped.chunks_exact(padded as usize);
    Ok(rows.flat_map(|bytes| &bytes[..row as usize]).copied().collect())
}

/// Red first, opaque.
fn in_order(mut pixels: Vec<u8>, format: wgpu::TextureFormat) -> Vec<u8> {
    let is_blue_first =
        matches!(format, wgpu::TextureFormat::Bgra8Unorm | wgpu::TextureFormat::Bgra8UnormSrgb);
    for pixel in pixels.chunks_exact_mut(4) {
        if is_blue_first {
            pixel.swap(0, 2);
        }
        pixel[3] = 255;
    }
    pixels
}
