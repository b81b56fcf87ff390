//! Draws the scene with the window's graphics device into a picture of its own, which has depth, and copies that into the
//! window. Buffers are uploaded when what is in them changes, and the picture is drawn anew when anything does.

use super::buffers::{BodyVertex, FaceVertex, Line, SliceVertex};
use super::colour_map::STOPS;
use super::pipelines::{DEPTH_FORMAT, Kind, PICTURE_FORMAT, Pipelines};
use bytemuck::{NoUninit, Pod, Zeroable};
use eframe::egui_wgpu::{CallbackResources, CallbackTrait, ScreenDescriptor};
use eframe::wgpu;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// What is drawn, in this order: bodies behind the slice before it, the others last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    Electrodes,
    Section,
    Occupied,
    Walls,
    Board,
    Outlines,
    CutEdges,
    Changed,
    Slice,
}

impl Part {
    pub(super) const COUNT: usize = 9;

    const ALL: [Self; Self::COUNT] = [
        Self::Electrodes,
        Self::Section,
        Self::Occupied,
        Self::Walls,
        Self::Board,
        Self::Outlines,
        Self::CutEdges,
        Self::Changed,
        Self::Slice,
    ];

    fn kind(self) -> Kind {
        match self {
            Self::Electrodes | Self::Section | Self::Occupied => Kind::Faces,
            Self::Slice => Kind::Slice,
            Self::Walls => Kind::Walls,
            Self::Board | Self::Changed => Kind::Glass,
            Self::Outlines | Self::CutEdges => Kind::Lines,
        }
    }
}

/// Vertices of which it is known when they were made.
#[derive(Clone, Debug, Default)]
pub(super) struct Vertices {
    bytes: Arc<Vec<u8>>,
    count: u32,
    /// Differs between any two; 0 when there are none.
    version: u64,
}

/// Numbers vertices; all views share the buffers of one device.
static VERSIONS: AtomicU64 = AtomicU64::new(1);

impl Vertices {
    pub(super) fn is_empty(&self) -> bool {
        self.count == 0
    }

    pub(super) fn new<T: NoUninit>(vertices: &[T]) -> Self {
        if vertices.is_empty() {
            return Self::default();
        }
        Self {
            bytes: Arc::new(bytemuck::cast_slice(vertices).to_vec()),
            count: vertices.len() as u32,
            version: VERSIONS.fetch_add(1, Ordering::Relaxed),
        }
    }
}

/// As in the shader.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Globals {
    pub(super) clip_from_sensor: [[f32; 4]; 4],
    pub(super) eye: [f32; 4],
    pub(super) forward: [f32; 4],
    pub(super) picture: [f32; 4],
    pub(super) scale: [f32; 4],
    pub(super) wire: [f32; 4],
    pub(super) map: [[f32; 4]; STOPS],
}

/// As in the shader.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct BodyState {
    pub(super) sensor_from_body: [[f32; 4]; 4],
    pub(super) colour: [f32; 4],
    pub(super) state: [f32; 4],
}

/// A body to be drawn.
#[derive(Clone, Debug)]
pub(super) struct Body {
    pub(super) vertices: Vertices,
    pub(super) state: BodyState,
}

/// All that one picture is made of.
#[derive(Clone, Debug)]
pub(super) struct Picture {
    /// In pixels.
    pub(super) size: [u32; 2],
    pub(super) background: [f32; 4],
    pub(super) globals: Globals,
    pub(super) parts: [Vertices; Part::COUNT],
    /// The farthest first, but those behind the slice before all others.
    pub(super) bodies: Vec<Body>,
    /// How many are behind the slice.
    pub(super) behind: usize,
}

impl CallbackTrait for Picture {
    fn prepare(
        &self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        _screen: &ScreenDescriptor,
        encoder: &mut wgpu::CommandEncoder,
        resources: &mut CallbackResources,
    ) -> Vec<wgpu::CommandBuffer> {
        if let Some(gpu) = resources.get_mut::<Gpu>() {
            gpu.draw(device, queue, encoder, self);
        }
        Vec::new()
    }

    fn paint(
        &self,
        _info: egui::PaintCallbackInfo,
        pass: &mut wgpu::RenderPass<'static>,
        resources: &CallbackResources,
    ) {
        if let Some(gpu) = resources.get::<Gpu>() {
            gpu.blit(pass);
        }
    }
}

/// From one body's uniforms to the next; what all devices can do.
const BODY_STRIDE: u64 = 256;

/// A buffer that grows.
#[derive(Debug, Default)]
struct Growing {
    buffer: Option<wgpu::Buffer>,
    version: u64,
}

impl Growing {
    /// Makes room for so many bytes; returns whether the buffer is another.
    fn reserve(&mut self, device: &wgpu::Device, bytes: u64, usage: wgpu::BufferUsages) -> bool {
        let is_large_enough = self.buffer.as_ref().is_some_and(|buffer| buffer.size() >= bytes);
        if !is_large_enough {
            self.buffer = Some(device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("scene"),
                size: bytes.next_power_of_two().max(4096),
                usage: usage | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }));
        }
        !is_large_enough
    }

    fn upload(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, vertices: &Vertices) {
        if vertices.version == self.version || vertices.count == 0 {
            return;
        }
        self.reserve(device, vertices.bytes.len() as u64, wgpu::BufferUsages::VERTEX);
        if let Some(buffer) = &self.buffer {
            queue.write_buffer(buffer, 0, &vertices.bytes);
        }
        self.version = vertices.version;
    }
}

/// What the picture is drawn into.
#[derive(Debug)]
struct Target {
    size: [u32; 2],
    colour: wgpu::TextureView,
    /// What several samples of a pixel are drawn into.
    samples: Option<wgpu::TextureView>,
    depth: wgpu::TextureView,
    blit: wgpu::BindGroup,
}

/// What stays on the graphics device from picture to picture.
#[derive(Debug)]
pub(super) struct Gpu {
    pipelines: Pipelines,
    globals: wgpu::Buffer,
    globals_group: wgpu::BindGroup,
    body_states: Growing,
    bodies_group: Option<wgpu::BindGroup>,
    parts: [Growing; Part::COUNT],
    bodies: Vec<Growing>,
    target: Option<Target>,
    drawn: Option<Drawn>,
}

/// What tells whether a picture differs from the one drawn last.
#[derive(Debug, PartialEq)]
struct Drawn {
    size: [u32; 2],
    background: [f32; 4],
    globals: Globals,
    versions: [u64; Part::COUNT],
    bodies: Vec<(u64, BodyState)>,
    behind: usize,
}

impl Drawn {
    fn of(picture: &Picture) -> Self {
        let bodies = picture.bodies.iter().map(|body| (body.vertices.version, body.state)).collect();
        let versions = picture.parts.each_ref().map(|part| part.version);
        let Picture { size, background, globals, behind, .. } = *picture;
        Self { size, background, globals, versions, bodies, behind }
    }
}

impl Gpu {
    /// Compiles the shaders. `window` is the format that the window is drawn in.
    pub(super) fn new(device: &wgpu::Device, window: wgpu::TextureFormat, samples: u32) -> Self {
        let pipelines = Pipelines::new(device, window, samples);
        let globals = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("scene globals"),
            size: size_of::<Globals>() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let globals_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("scene globals"),
            layout: &pipelines.globals_layout,
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: globals.as_entire_binding() }],
        });
        Self {
            pipelines,
            globals,
            globals_group,
            body_states: Growing::default(),
            bodies_group: None,
            parts: Default::default(),
            bodies: Vec::new(),
            target: None,
            drawn: None,
        }
    }

    fn draw(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        encoder: &mut wgpu::CommandEncoder,
        picture: &Picture,
    ) {
        let drawn = Drawn::of(picture);
        if self.drawn.as_ref() == Some(&drawn) {
            return;
        }
        if self.target.as_ref().is_none_or(|target| target.size != picture.size) {
            self.target = Some(self.target(device, picture.size));
        }
        queue.write_buffer(&self.globals, 0, bytemuck::bytes_of(&picture.globals));
        for (buffer, vertices) in self.parts.iter_mut().zip(&picture.parts) {
            buffer.upload(device, queue, vertices);
        }
        self.upload_bodies(device, queue, &picture.bodies);
        self.encode(encoder, picture);
        self.drawn = Some(drawn);
    }

    fn upload_bodies(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, bodies: &[Body]) {
        // Bodies are sorted by depth, so each may stand in another place than before.
        for body in bodies {
            if !self.bodies.iter().any(|buffer| buffer.version == body.vertices.version) {
                let is_unused =
                    |buffer: &Growing| !bodies.iter().any(|body| body.vertices.version == buffer.version);
                let free = self.bodies.iter().position(is_unused).unwrap_or_else(|| {
                    self.bodies.push(Growing::default());
                    self.bodies.len() - 1
                });
                self.bodies[free].upload(device, queue, &body.vertices);
            }
        }
        let bytes = BODY_STRIDE * bodies.len() as u64;
        if bytes == 0 {
            return;
        }
        if self.body_states.reserve(device, bytes, wgpu::BufferUsages::UNIFORM) {
            self.bodies_group = self.body_states.buffer.as_ref().map(|buffer| {
                let size = std::num::NonZeroU64::new(size_of::<BodyState>() as u64);
                let resource = wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer, offset: 0, size });
                device.create_bind_group(&wgpu::BindGroupDescriptor {
                    label: Some("bodies"),
                    layout: &self.pipelines.body_layout,
                    entries: &[wgpu::BindGroupEntry { binding: 0, resource }],
                })
            });
        }
        if let Some(buffer) = &self.body_states.buffer {
            for (index, body) in (0..).zip(bodies) {
                queue.write_buffer(buffer, BODY_STRIDE * index, bytemuck::bytes_of(&body.state));
            }
        }
    }

    fn target(&self, device: &wgpu::Device, [width, height]: [u32; 2]) -> Target {
        let view = |format, sample_count, usage| {
            let texture = device.create_texture(&wgpu::TextureDescriptor {
                label: Some("scene"),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT | usage,
                view_formats: &[],
            });
            texture.create_view(&Default::default())
        };
        let samples = self.pipelines.samples;
        let none = wgpu::TextureUsages::empty();
        let colour = view(PICTURE_FORMAT, 1, wgpu::TextureUsages::TEXTURE_BINDING);
        let blit = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("scene picture"),
            layout: &self.pipelines.blit_layout,
            entries: &[wgpu::BindGroupEntry {
                binding: 0,
                resource: wgpu::BindingResource::TextureView(&colour),
            }],
        });
        Target {
            size: [width, height],
            samples: (samples > 1).then(|| view(PICTURE_FORMAT, samples, none)),
            depth: view(DEPTH_FORMAT, samples, none),
            colour,
            blit,
        }
    }

    fn encode(&self, encoder: &mut wgpu::CommandEncoder, picture: &Picture) {
        let Some(target) = &self.target else {
            return;
        };
        let [r, g, b, a] = picture.background.map(f64::from);
        let (view, resolve_target) = match &target.samples {
            Some(samples) => (samples, Some(&target.colour)),
            None => (&target.colour, None),
        };
        let store = if resolve_target.is_some() { wgpu::StoreOp::Discard } else { wgpu::StoreOp::Store };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("scene"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view,
                depth_slice: None,
                resolve_target,
                ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color { r, g, b, a }), store },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &target.depth,
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(1.0),
                    store: wgpu::StoreOp::Discard,
                }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        pass.set_bind_group(0, &self.globals_group, &[]);
        for part in Part::ALL {
            if part == Part::Slice {
                self.encode_bodies(&mut pass, &picture.bodies, 0..picture.behind);
            }
            let (vertices, buffer) = (&picture.parts[part as usize], &self.parts[part as usize].buffer);
            if let (Some(buffer), true) = (buffer, vertices.count > 0) {
                pass.set_pipeline(self.pipelines.of(part.kind()));
                pass.set_vertex_buffer(0, buffer.slice(..vertices.bytes.len() as u64));
                match part.kind() {
                    Kind::Lines => pass.draw(0..4, 0..vertices.count),
                    _ => pass.draw(0..vertices.count, 0..1),
                }
            }
        }
        self.encode_bodies(&mut pass, &picture.bodies, picture.behind..picture.bodies.len());
    }

    /// Of each body the far side, then the near one.
    fn encode_bodies(&self, pass: &mut wgpu::RenderPass<'_>, bodies: &[Body], some: Range<usize>) {
        let Some(group) = &self.bodies_group else {
            return;
        };
        for index in some {
            let body = &bodies[index];
            let buffer = self.bodies.iter().find(|buffer| buffer.version == body.vertices.version);
            let Some(buffer) = buffer.and_then(|buffer| buffer.buffer.as_ref()) else {
                continue;
            };
            pass.set_bind_group(1, group, &[index as u32 * BODY_STRIDE as u32]);
            pass.set_vertex_buffer(0, buffer.slice(..));
            for side in [Kind::FarSide, Kind::NearSide] {
                pass.set_pipeline(self.pipelines.of(side));
                pass.draw(0..body.vertices.count, 0..1);
            }
        }
    }

    fn blit(&self, pass: &mut wgpu::RenderPass<'static>) {
        if let Some(target) = &self.target {
            pass.set_pipeline(&self.pipelines.blit);
            pass.set_bind_group(0, &target.blit, &[]);
            pass.draw(0..3, 0..1);
        }
    }
}

/// Bytes from one vertex of a kind to the next.
pub(super) fn stride(kind: Kind) -> u64 {
    (match kind {
        Kind::Faces | Kind::Glass | Kind::Walls => size_of::<FaceVertex>(),
        Kind::Lines => size_of::<Line>(),
        Kind::Slice => size_of::<SliceVertex>(),
        Kind::FarSide | Kind::NearSide => size_of::<BodyVertex>(),
    }) as u64
}
