//! The shaders, compiled for what each kind of part needs: which sides are drawn, what hides what.

use super::gpu::{BodyState, Globals, stride};
use eframe::wgpu;
use std::num::NonZeroU64;

/// The format of the scene's own picture: colours as on the screen.
pub(super) const PICTURE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
/// The format of its depths.
pub(super) const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// How a part is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Triangles that hide what is behind them.
    Faces,
    /// Triangles through which one sees.
    Glass,
    /// The same, seen from behind alone.
    Walls,
    /// Line segments.
    Lines,
    /// Triangles with values.
    Slice,
    /// A body's triangles that face away, and those that face the viewer.
    FarSide,
    NearSide,
}

impl Kind {
    const ALL: [Self; 7] =
        [Self::Faces, Self::Glass, Self::Walls, Self::Lines, Self::Slice, Self::FarSide, Self::NearSide];

    /// Entry points of the vertex and the fragment stage.
    fn entry_points(self) -> [&'static str; 2] {
        match self {
            Self::Faces | Self::Glass | Self::Walls => ["face_vertex", "face_fragment"],
            Self::Lines => ["line_vertex", "line_fragment"],
            Self::Slice => ["slice_vertex", "slice_fragment"],
            Self::FarSide | Self::NearSide => ["body_vertex", "body_fragment"],
        }
    }

    fn attributes(self) -> &'static [wgpu::VertexAttribute] {
        const FACE: [wgpu::VertexAttribute; 3] =
            wgpu::vertex_attr_array![0 => Float32x3, 1 => Snorm8x4, 2 => Unorm8x4];
        const LINE: [wgpu::VertexAttribute; 4] =
            wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32, 2 => Float32x3, 3 => Unorm8x4];
        const SLICE: [wgpu::VertexAttribute; 2] = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32];
        const BODY: [wgpu::VertexAttribute; 2] = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3];
        match self {
            Self::Faces | Self::Glass | Self::Walls => &FACE,
            Self::Lines => &LINE,
            Self::Slice => &SLICE,
            Self::FarSide | Self::NearSide => &BODY,
        }
    }

    fn hides(self) -> bool {
        self == Self::Faces
    }

    fn cull_mode(self) -> Option<wgpu::Face> {
        match self {
            Self::Walls | Self::FarSide => Some(wgpu::Face::Front),
            Self::NearSide => Some(wgpu::Face::Back),
            _ => None,
        }
    }
}

/// All pipelines and what they are bound to.
#[derive(Debug)]
pub(super) struct Pipelines {
    pub(super) samples: u32,
    pub(super) globals_layout: wgpu::BindGroupLayout,
    pub(super) body_layout: wgpu::BindGroupLayout,
    pub(super) blit_layout: wgpu::BindGroupLayout,
    pub(super) blit: wgpu::RenderPipeline,
    of_kinds: [wgpu::RenderPipeline; Kind::ALL.len()],
}

impl Pipelines {
    pub(super) fn new(device: &wgpu::Device, window: wgpu::TextureFormat, samples: u32) -> Self {
        let globals_layout = uniform_layout(device, "scene globals", size_of::<Globals>(), false);
        let body_layout = uniform_layout(device, "body", size_of::<BodyState>(), true);
        let shader = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("scene"),
            source: wgpu::ShaderSource::Wgsl(include_str!("scene.wgsl").into()),
        });
        let layout = |groups: &[Option<&wgpu::BindGroupLayout>]| {
            device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some("scene"),
                bind_group_layouts: groups,
                immediate_size: 0,
            })
        };
        let scene_layout = layout(&[Some(&globals_layout)]);
        let bodies_layout = layout(&[Some(&globals_layout), Some(&body_layout)]);
        let of_kinds = Kind::ALL.map(|kind| {
            let layout =
                if matches!(kind, Kind::FarSide | Kind::NearSide) { &bodies_layout } else { &scene_layout };
            pipeline(device, &shader, layout, kind, samples)
        });
        let blit_layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("scene picture"),
            entries: &[wgpu::BindGroupLayoutEntry {
                binding: 0,
                visibility: wgpu::ShaderStages::FRAGMENT,
                ty: wgpu::BindingType::Texture {
                    sample_type: wgpu::TextureSampleType::Float { filterable: false },
                    view_dimension: wgpu::TextureViewDimension::D2,
                    multisampled: false,
                },
                count: None,
            }],
        });
        let blit = blit_pipeline(device, &layout(&[Some(&blit_layout)]), window);
        Self { samples, globals_layout, body_layout, blit_layout, blit, of_kinds }
    }

    pub(super) fn of(&self, kind: Kind) -> &wgpu::RenderPipeline {
        &self.of_kinds[kind as usize]
    }
}

fn uniform_layout(
    device: &wgpu::Device,
    label: &str,
    size: usize,
    has_dynamic_offset: bool,
) -> wgpu::BindGroupLayout {
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some(label),
        entries: &[wgpu::BindGroupLayoutEntry {
            binding: 0,
            visibility: wgpu::ShaderStages::VERTEX_FRAGMENT,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Uniform,
                has_dynamic_offset,
                min_binding_size: NonZeroU64::new(size as u64),
            },
            count: None,
        }],
    })
}

fn pipeline(
    device: &wgpu::Device,
    shader: &wgpu::ShaderModule,
    layout: &wgpu::PipelineLayout,
    kind: Kind,
    samples: u32,
) -> wgpu::RenderPipeline {
    let [vertex, fragment] = kind.entry_points();
    let (step_mode, topology) = match kind {
        Kind::Lines => (wgpu::VertexStepMode::Instance, wgpu::PrimitiveTopology::TriangleStrip),
        _ => (wgpu::VertexStepMode::Vertex, wgpu::PrimitiveTopology::TriangleList),
    };
    let buffer =
        wgpu::VertexBufferLayout { array_stride: stride(kind), step_mode, attributes: kind.attributes() };
    // Sheets and lines in the plane of a slice, or on a board, are in front of it.
    let bias = match kind {
        Kind::Slice | Kind::Glass => wgpu::DepthBiasState { constant: 8, slope_scale: 2.0, clamp: 0.0 },
        _ => wgpu::DepthBiasState::default(),
    };
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("scene"),
        layout: Some(layout),
        vertex: wgpu::VertexState {
            module: shader,
            entry_point: Some(vertex),
            compilation_options: Default::default(),
            buffers: &[Some(buffer)],
        },
        primitive: wgpu::PrimitiveState { topology, cull_mode: kind.cull_mode(), ..Default::default() },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH_FORMAT,
            depth_write_enabled: Some(kind.hides()),
            depth_compare: Some(wgpu::CompareFunction::LessEqual),
            stencil: Default::default(),
            bias,
        }),
        multisample: wgpu::MultisampleState { count: samples, ..Default::default() },
        fragment: Some(wgpu::FragmentState {
            module: shader,
            entry_point: Some(fragment),
            compilation_options: Default::default(),
            targets: &[Some(wgpu::ColorTargetState {
                format: PICTURE_FORMAT,
                blend: Some(wgpu::BlendState::PREMULTIPLIED_ALPHA_BLENDING),
                write_mask: wgpu::ColorWrites::ALL,
            })],
        }),
        multiview_mask: None,
        cache: None,
    })
}

fn blit_pipeline(
    device: &wgpu::Device,
    layout: &wgpu::PipelineLayout,
    window: wgpu::TextureFormat,
) -> wgpu::RenderPipeline {
    let shader = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("scene picture"),
        source: wgpu::ShaderSource::Wgsl(include_str!("blit.wgsl").into()),
    });
    let fragment = if window.is_srgb() { "blit_fragment_linear" } else { "blit_fragment" };
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("scene picture"),
        layout: Some(layout),
        vertex: wgpu::VertexState {
            module: &shader,
            entry_point: Some("blit_vertex"),
            compilation_options: Default::default(),
            buffers: &[],
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
                blend: Some(wgpu::BlendState::PREMULTIPLIED_ALPHA_BLENDING),
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

    fn entry_points(source: &str) -> Vec<String> {
        let module = naga::front::wgsl::parse_str(source).unwrap();
        let mut validator = naga::valid::Validator::new(
            naga::valid::ValidationFlags::all(),
            naga::valid::Capabilities::empty(),
        );
        validator.validate(&module).unwrap();
        module.entry_points.iter().map(|entry| entry.name.clone()).collect()
    }

    /// Needs no GPU: the shaders are valid WGSL and have the entry points that the pipelines name.
    #[test]
    fn the_shaders_are_valid() {
        let scene = entry_points(include_str!("scene.wgsl"));
        for kind in Kind::ALL {
            for name in kind.entry_points() {
                assert!(scene.iter().any(|entry| entry == name), "{name}");
            }
        }
        let blit = entry_points(include_str!("blit.wgsl"));
        assert_eq!(blit, ["blit_vertex", "blit_fragment", "blit_fragment_linear"]);
    }

    #[test]
    fn kinds_are_numbered_in_their_order() {
        for (index, kind) in Kind::ALL.into_iter().enumerate() {
            assert_eq!(kind as usize, index);
        }
    }
}
