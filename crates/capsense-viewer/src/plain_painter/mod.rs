//! Draws the window's triangles where a software driver draws. egui's own shader can filter textures by itself, for tests,
//! and dither; software drivers compute both for every pixel and throw them away, which is most of what a frame takes
//! them. Here is the same without either.
//!
//! It steps in where egui hands its output to the window: what was drawn is cut into triangles, and paint callbacks, which
//! egui's painter has to call, go on as they are; what lies between two of them becomes one callback more (`Batch`).

mod canvas;

use canvas::{Canvas, TextureChange};
use eframe::egui_wgpu::{Callback, CallbackResources, CallbackTrait, RenderState, ScreenDescriptor};
use eframe::wgpu;
use egui::emath::TSTransform;
use egui::epaint::{ClippedPrimitive, ClippedShape, Mesh, Primitive};
use egui::{Context, FullOutput, Plugin, Rect, Shape, TextureId};
use std::sync::{Arc, Mutex, PoisonError};

/// Changes of textures that no frame has taken yet: a frame that is not drawn leaves them to the next.
type Pending = Arc<Mutex<Vec<TextureChange>>>;

/// Takes over what egui's painter would draw.
#[derive(Default)]
struct PlainPainter {
    pending: Pending,
    /// Textures that were still in use in the frame before.
    free: Vec<TextureId>,
}

/// Draws all that `ctx` shows without egui's shader from now on, if `state` is of a software driver. It must be called
/// before anything is shown.
pub fn install(ctx: &Context, state: &RenderState) {
    let is_software = state.adapter.get_info().device_type == wgpu::DeviceType::Cpu;
    // Windows that take linear colours are left to egui.
    if is_software && !state.target_format.is_srgb() {
        let canvas = Canvas::new(&state.device, state.target_format);
        state.renderer.write().callback_resources.insert(canvas);
        ctx.add_plugin(PlainPainter::default());
    }
}

impl Plugin for PlainPainter {
    fn debug_name(&self) -> &'static str {
        "plain painter"
    }

    fn output_hook(&mut self, ctx: &Context, output: &mut FullOutput) {
        let mut changes: Vec<TextureChange> = self.free.drain(..).map(TextureChange::Free).collect();
        let deltas = output.textures_delta.set.drain();
        changes.extend(
            deltas
                .flat_map(|(id, deltas)| deltas.into_iter().map(move |delta| TextureChange::Set(id, delta))),
        );
        self.free = output.textures_delta.free.drain().collect();
        self.pending.lock().unwrap_or_else(PoisonError::into_inner).append(&mut changes);
        let shapes = std::mem::take(&mut output.shapes);
        let primitives = ctx.tessellate(shapes, output.pixels_per_point);
        output.shapes = self.in_batches(primitives, ctx.viewport_rect());
    }
}

impl PlainPainter {
    /// Callbacks as they are, and one for all meshes between two of them.
    fn in_batches(&self, primitives: Vec<ClippedPrimitive>, window: Rect) -> Vec<ClippedShape> {
        let (mut shapes, mut meshes, mut batches) = (Vec::new(), Vec::new(), 0);
        let mut end_batch = |meshes: &mut Vec<(Rect, Mesh)>, shapes: &mut Vec<ClippedShape>| {
            if !meshes.is_empty() {
                let batch =
                    Batch { index: batches, meshes: std::mem::take(meshes), pending: self.pending.clone() };
                batches += 1;
                let shape = Shape::Callback(Callback::new_paint_callback(window, batch));
                shapes.push(clipped(window, shape));
            }
        };
        for ClippedPrimitive { clip_rect, primitive } in primitives {
            match primitive {
                Primitive::Mesh(mesh) => meshes.push((clip_rect, mesh)),
                Primitive::Callback(callback) => {
                    end_batch(&mut meshes, &mut shapes);
                    shapes.push(clipped(clip_rect, Shape::Callback(callback)));
                }
            }
        }
        end_batch(&mut meshes, &mut shapes);
        shapes
    }
}

fn clipped(clip_rect: Rect, shape: Shape) -> ClippedShape {
    ClippedShape { clip_rect, shape, transform_after_tessellation: TSTransform::IDENTITY }
}

/// Triangles that are drawn after one another.
struct Batch {
    /// How many others come before it in the frame.
    index: usize,
    meshes: Vec<(Rect, Mesh)>,
    pending: Pending,
}

impl CallbackTrait for Batch {
    fn prepare(
        &self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        screen: &ScreenDescriptor,
        _encoder: &mut wgpu::CommandEncoder,
        resources: &mut CallbackResources,
    ) -> Vec<wgpu::CommandBuffer> {
        if let Some(canvas) = resources.get_mut::<Canvas>() {
            let changes = std::mem::take(&mut *self.pending.lock().unwrap_or_else(PoisonError::into_inner));
            canvas.change_textures(device, queue, changes);
            canvas.upload(device, queue, self.index, &self.meshes, screen);
        }
        Vec::new()
    }

    fn paint(
        &self,
        info: egui::PaintCallbackInfo,
        pass: &mut wgpu::RenderPass<'static>,
        resources: &CallbackResources,
    ) {
        if let Some(canvas) = resources.get::<Canvas>() {
            canvas.paint(pass, self.index, info.screen_size_px);
        }
    }
}
