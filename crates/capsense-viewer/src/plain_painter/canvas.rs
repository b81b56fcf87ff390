//! What the plain painter keeps on the graphics device: its pipeline, textures, and the triangles of a frame.

use eframe::egui_wgpu::ScreenDescriptor;
use eframe::wgpu;
use egui::epaint::{ImageData, ImageDelta, Mesh, Vertex, WHITE_UV};
use egui::{Rect, TextureFilter, TextureId, TextureOptions, TextureWrapMode};
use std::collections::HashMap;
use std::ops::Range;

/// What becomes of a texture.
pub(super) enum TextureChange {
    Set(TextureId, ImageDelta),
    Free(TextureId),
}

/// A buffer that grows.
#[derive(Debug)]
struct Growing {
    buffer: Option<wgpu::Buffer>,
    usage: wgpu::BufferUsages,
}

impl Growing {
    fn write(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, bytes: &[u8]) {
        let size = bytes.len() as u64;
        if self.buffer.as_ref().is_none_or(|buffer| buffer.size() < size) {
            self.buffer = Some(device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("plain"),
                size: size.next_power_of_two().max(1 << 16),
                usage: self.usage | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }));
        }
        if let Some(buffer) = &self.buffer {
            queue.write_buffer(buffer, 0, bytes);
        }
    }
}

/// Triangles of one texture within a rectangle.
#[derive(Debug, PartialEq)]
struct Draw {
    /// In pixels: left, top, width, height.
    scissor: [u32; 4],
    texture: TextureId,
    first_vertex: i32,
    runs: Vec<(Ink, Range<u32>)>,
}

/// How triangles are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ink {
    /// Textured, and mixed with what is there.
    Mixed = 0,
    /// In colours that hide what is there: a software driver takes a fraction of the time for a pixel.
    Opaque = 1,
}

/// Of opaque triangles only those of more square points than this are drawn as such: to change pipelines costs as much as some
/// thousand pixels.
const LARGE: f32 = 3000.0;

/// What is drawn after one another.
#[derive(Debug)]
struct Uploaded {
    vertices: Growing,
    indices: Growing,
    draws: Vec<Draw>,
}

#[derive(Debug)]
struct Texture {
    texture: wgpu::Texture,
    group: wgpu::BindGroup,
}

/// What stays on the device from frame to frame.
#[derive(Debug)]
pub(super) struct Canvas {
    /// By [`Ink`].
    pipelines: [wgpu::RenderPipeline; 2],
    locals: wgpu::Buffer,
    locals_group: wgpu::BindGroup,
    texture_layout: wgpu::BindGroupLayout,
    textures: HashMap<TextureId, Texture>,
    batches: Vec<Uploaded>,
    /// Working storage.
    vertices: Vec<Vertex>,
    indices: Vec<u32>,
}

impl Canvas {
    /// Compiles the shader. `window` is the format that the window is drawn in.
    pub(super) fn new(device: &wgpu::Device, window: wgpu::TextureFormat) -> Self {
        let locals = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("plain locals"),
            size: 16,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let uniform = wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Uniform,
            has_dynamic_offset: false,
            min_binding_size: wgpu::BufferSize::new(16),
        };
        let picture = wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Float { filterable: true },
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        };
        let sampler = wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering);
        let locals_layout = layout(device, wgpu::ShaderStages::VERTEX, &[uniform]);
        let texture_layout = layout(device, wgpu::ShaderStages::FRAGMENT, &[picture, sampler]);
        let locals_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("plain locals"),
            layout: &locals_layout,
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: locals.as_entire_binding() }],
        });
        let layouts = [Some(&locals_layout), Some(&texture_layout)];
        Self {
            pipelines: [Ink::Mixed, Ink::Opaque].map(|ink| pipeline(device, &layouts, window, ink)),
            locals,
            locals_group,
            texture_layout,
            textures: HashMap::new(),
            batches: Vec::new(),
            vertices: Vec::new(),
            indices: Vec::new(),
        }
    }

    pub(super) fn change_textures(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        changes: Vec<TextureChange>,
    ) {
        for change in changes {
            match change {
                TextureChange::Free(id) => drop(self.textures.remove(&id)),
                TextureChange::Set(id, delta) => {
                    let ImageData::Color(image) = &delta.image;
                    if delta.pos.is_none() {
                        let texture = self.texture(device, image.size, delta.options);
                        self.textures.insert(id, texture);
                    }
                    if let Some(texture) = self.textures.get(&id) {
                        let at = delta.pos.unwrap_or_default();
                        write(queue, &texture.texture, at, image);
                    }
                }
            }
        }
    }

    fn texture(&self, device: &wgpu::Device, size: [usize; 2], options: TextureOptions) -> Texture {
        let [width, height] = size.map(|side| side as u32);
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("plain"),
            size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba8Unorm,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let filter = |filter: TextureFilter| match filter {
            TextureFilter::Nearest => wgpu::FilterMode::Nearest,
            TextureFilter::Linear => wgpu::FilterMode::Linear,
        };
        let address = match options.wrap_mode {
            TextureWrapMode::ClampToEdge => wgpu::AddressMode::ClampToEdge,
            TextureWrapMode::Repeat => wgpu::AddressMode::Repeat,
            TextureWrapMode::MirroredRepeat => wgpu::AddressMode::MirrorRepeat,
        };
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("plain"),
            mag_filter: filter(options.magnification),
            min_filter: filter(options.minification),
            address_mode_u: address,
            address_mode_v: address,
            ..Default::default()
        });
        let view = texture.create_view(&Default::default());
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("plain"),
            layout: &self.texture_layout,
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&view) },
                wgpu::BindGroupEntry { binding: 1, resource: wgpu::BindingResource::Sampler(&sampler) },
            ],
        });
        Texture { texture, group }
    }

    /// Takes the triangles of a batch, each mesh with the rectangle that it is seen in, in points.
    pub(super) fn upload(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        index: usize,
        meshes: &[(Rect, Mesh)],
        screen: &ScreenDescriptor,
    ) {
        let per_point = screen.pixels_per_point;
        let [width, height] = screen.size_in_pixels.map(|side| side as f32 / per_point);
        queue.write_buffer(&self.locals, 0, bytemuck::bytes_of(&[width, height, 0.0, 0.0]));
        self.vertices.clear();
        self.indices.clear();
        while self.batches.len() <= index {
            self.batches.push(Uploaded {
                vertices: Growing { buffer: None, usage: wgpu::BufferUsages::VERTEX },
                indices: Growing { buffer: None, usage: wgpu::BufferUsages::INDEX },
                draws: Vec::new(),
            });
        }
        let batch = &mut self.batches[index];
        batch.draws.clear();
        for (clip, mesh) in meshes {
            let first = self.indices.len() as u32;
            batch.draws.push(Draw {
                scissor: scissor(*clip, per_point, screen.size_in_pixels),
                texture: mesh.texture_id,
                first_vertex: self.vertices.len() as i32,
                runs: runs(mesh, first),
            });
            self.vertices.extend_from_slice(&mesh.vertices);
            self.indices.extend_from_slice(&mesh.indices);
        }
        batch.vertices.write(device, queue, bytemuck::cast_slice(&self.vertices));
        batch.indices.write(device, queue, bytemuck::cast_slice(&self.indices));
    }

    /// Draws a batch in a window of so many pixels.
    pub(super) fn paint(
        &self,
        pass: &mut wgpu::RenderPass<'static>,
        index: usize,
        [width, height]: [u32; 2],
    ) {
        let Some(batch) = self.batches.get(index) else { return };
        let (Some(vertices), Some(indices)) = (&batch.vertices.buffer, &batch.indices.buffer) else {
            return;
        };
        pass.set_viewport(0.0, 0.0, width as f32, height as f32, 0.0, 1.0);
        let mut ink = Ink::Mixed;
        pass.set_pipeline(&self.pipelines[ink as usize]);
        pass.set_bind_group(0, &self.locals_group, &[]);
        pass.set_vertex_buffer(0, vertices.slice(..));
        pass.set_index_buffer(indices.slice(..), wgpu::IndexFormat::Uint32);
        for draw in &batch.draws {
            let [x, y, width, height] = draw.scissor;
            if let (Some(texture), true) = (self.textures.get(&draw.texture), width > 0 && height > 0) {
                pass.set_scissor_rect(x, y, width, height);
                pass.set_bind_group(1, &texture.group, &[]);
                for (of_run, indices) in &draw.runs {
                    if ink != *of_run {
                        ink = *of_run;
                        pass.set_pipeline(&self.pipelines[ink as usize]);
                    }
                    pass.draw_indexed(indices.clone(), draw.first_vertex, 0..1);
                }
            }
        }
    }
}

/// A mesh's triangles in their order, where its indices begin at `first`.
fn runs(mesh: &Mesh, first: u32) -> Vec<(Ink, Range<u32>)> {
    let mut runs: Vec<(Ink, Range<u32>)> = Vec::new();
    for (corners, at) in mesh.indices.as_chunks::<3>().0.iter().zip((first..).step_by(3)) {
        let ink = ink_of(corners.map(|corner| mesh.vertices[corner as usize]));
        match runs.last_mut() {
            Some((last, indices)) if *last == ink => indices.end = at + 3,
            _ => runs.push((ink, at..at + 3)),
        }
    }
    runs
}

fn ink_of(corners: [Vertex; 3]) -> Ink {
    let is_plain = |vertex: &Vertex| vertex.uv == WHITE_UV && vertex.color.is_opaque();
    let [a, b, c] = corners.map(|vertex| vertex.pos);
    let [u, v] = [b - a, c - a];
    let is_large = (u.x * v.y - u.y * v.x).abs() > 2.0 * LARGE;
    if is_large && corners.iter().all(is_plain) { Ink::Opaque } else { Ink::Mixed }
}

/// The pixels of a rectangle in points, as far as they are in the window: left, top, width, height.
fn scissor(clip: Rect, pixels_per_point: f32, [width, height]: [u32; 2]) -> [u32; 4] {
    let pixel = |at: f32, end: u32| ((at * pixels_per_point).round() as u32).min(end);
    let [left, top] = [pixel(clip.min.x, width), pixel(clip.min.y, height)];
    let [right, bottom] = [pixel(clip.max.x, width), pixel(clip.max.y, height)];
    [left, top, right.saturating_sub(left), bottom.saturating_sub(top)]
}

fn write(queue: &wgpu::Queue, texture: &wgpu::Texture, at: [usize; 2], image: &egui::ColorImage) {
    let [x, y] = at.map(|place| place as u32);
    let [width, height] = image.size.map(|side| side as u32);
    queue.write_texture(
        wgpu::TexelCopyTextureInfo {
            texture,
            mip_level: 0,
            origin: wgpu::Origin3d { x, y, z: 0 },
            aspect: wgpu::TextureAspect::All,
        },
        bytemuck::cast_slice(&image.pixels),
        wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(4 * width),
            rows_per_image: Some(height),
        },
        wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
    );
}

fn layout(
    device: &wgpu::Device,
    visibility: wgpu::ShaderStages,
    types: &[wgpu::BindingType],
) -> wgpu::BindGroupLayout {
    let entries: Vec<_> = (0..)
        .zip(types)
        .map(|(binding, &ty)| wgpu::BindGroupLayoutEntry { binding, visibility, ty, count: None })
        .collect();
    let label = Some("plain");
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label, entries: &entries })
}

fn pipeline(
    device: &wgpu::Device,
    bind_group_layouts: &[Option<&wgpu::BindGroupLayout>],
    window: wgpu::TextureFormat,
    ink: Ink,
) -> wgpu::RenderPipeline {
    const ATTRIBUTES: [wgpu::VertexAttribute; 3] =
        wgpu::vertex_attr_array![0 => Float32x2, 1 => Float32x2, 2 => Unorm8x4];
    let shader = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("plain"),
        source: wgpu::ShaderSource::Wgsl(include_str!("plain.wgsl").into()),
    });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("plain"),
        bind_group_layouts,
        immediate_size: 0,
    });
    let (fragment, blend) = match ink {
        Ink::Mixed => ("mixed_fragment", Some(wgpu::BlendState::PREMULTIPLIED_ALPHA_BLENDING)),
        Ink::Opaque => ("opaque_fragment", None),
    };
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("plain"),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &shader,
            entry_point: Some("plain_vertex"),
            compilation_options: Default::default(),
            buffers: &[Some(wgpu::VertexBufferLayout {
                array_stride: size_of::<Vertex>() as u64,
                step_mode: wgpu::VertexStepMode::Vertex,
                attributes: &ATTRIBUTES,
            })],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: None,
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &shader,
            entry_point: Some(fragment),
            compilation_options: Default::default(),
            targets: &[Some(wgpu::ColorTargetState {
                format: window,
                blend,
                write_mask: wgpu::ColorWrites::ALL,
            })],
        }),
        multiview_mask: None,
        cache: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use eframe::wgpu::naga;
    use egui::{Color32, pos2};

    /// Needs no GPU: the shader is valid WGSL and has the entry points that the pipelines name.
    #[test]
    fn the_shader_is_valid() {
        let module = naga::front::wgsl::parse_str(include_str!("plain.wgsl")).unwrap();
        let flags = naga::valid::ValidationFlags::all();
        naga::valid::Validator::new(flags, naga::valid::Capabilities::empty()).validate(&module).unwrap();
        let names: Vec<&str> = module.entry_points.iter().map(|entry| entry.name.as_str()).collect();
        assert_eq!(names, ["plain_vertex", "mixed_fragment", "opaque_fragment"]);
    }

    #[test]
    fn only_large_triangles_that_hide_all_behind_them_are_opaque_and_order_stays() {
        let square = |mesh: &mut Mesh, side: f32, colour: Color32| {
            mesh.add_colored_rect(Rect::from_min_max(pos2(3.0, 5.0), pos2(3.0 + side, 5.0 + side)), colour);
        };
        let mut mesh = Mesh::default();
        square(&mut mesh, 70.0, Color32::RED);
        square(&mut mesh, 80.0, Color32::RED);
        square(&mut mesh, 80.0, Color32::from_black_alpha(254));
        square(&mut mesh, 200.0, Color32::BLUE);
        square(&mut mesh, 200.0, Color32::GREEN);
        let all = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
        mesh.add_rect_with_uv(Rect::from_min_max(pos2(0.0, 0.0), pos2(300.0, 300.0)), all, Color32::WHITE);
        let expected = [
            (Ink::Mixed, 60..66),
            (Ink::Opaque, 66..72),
            (Ink::Mixed, 72..78),
            (Ink::Opaque, 78..90),
            (Ink::Mixed, 90..96),
        ];
        assert_eq!(runs(&mesh, 60), expected);
        assert!(runs(&Mesh::default(), 0).is_empty());
    }

    #[test]
    fn scissors_end_where_the_window_does() {
        let window = [800, 600];
        let clip = Rect::from_min_max(pos2(-5.0, 10.2), pos2(399.8, 1e9));
        assert_eq!(scissor(clip, 1.5, window), [0, 15, 600, 585]);
        assert_eq!(scissor(Rect::EVERYTHING, 1.0, window), [0, 0, 800, 600]);
        assert_eq!(scissor(Rect::NOTHING, 1.0, window), [800, 600, 0, 0]);
    }
}
