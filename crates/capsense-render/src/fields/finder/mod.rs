//! Objects found on the device: drawn by a depth camera into a buffer that kernels read, which make rows of K of it.
//!
//! Poses go in; depths, what holds nodes and what is left of edges never leave the device. The kernels are in `depth_layers.wgsl`,
//! `edge_rule.wgsl` and `occupancy.wgsl`; their twins are the processor's own `capsense_core::occupancy` and
//! `capsense_core::stiffness`.

mod placed;
mod tables;

use super::memory::Reserve;
use super::solids::{EdgeTrees, SOLID_WORDS, is_found};
use crate::adapter::Adapter;
use crate::error::RenderError;
use crate::gpu::{Drawing, GpuDevice, Tile};
use crate::scene::{RenderScene, SceneObject, check_view};
use bytemuck::{Pod, Zeroable};
use capsense_core::geometry::{Pose, Shape};
use capsense_core::material::Material;
use capsense_core::occupancy::{Contact, OrthographicView};
use capsense_core::sensor::Sensor;
use capsense_core::solids::Solids;
use capsense_core::solver::Found;
use placed::{COMMON_WORDS, DRAWN_WORDS, Placed, Shapes, of_solid};
use tables::Tables;
pub(super) use tables::in_two;

/// A scene has at most so many objects: each edge keeps account of all.
pub(super) const MOST_OBJECTS: usize = 16;

/// Buffers that a kernel has at its hands, those of fields along with those of objects.
const STORAGE_BUFFERS: u32 = 11;

/// Neighbouring depths further apart than this many pixel widths belong to different surfaces: as the processor has it.
const JUMP_IN_PIXELS: f64 = 4.0;

/// A scene's flags before those of contacts: columns whose object is there, and the number of edges that changed.
const FLAGS: usize = 2;

/// The depth camera that objects are seen by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// What it sees: all of the sensor's domain, along +z.
    pub view: OrthographicView,
    /// Whether it sees one layer only, so that everything behind it counts as filled.
    pub back_fill: bool,
}

/// The objects of one scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Objects {
    /// Their shapes.
    pub shapes: Vec<Shape>,
    /// What each is made of.
    pub materials: Vec<Material>,
}

/// What the kernels must know when they are compiled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Finding {
    /// No scene has more objects.
    pub(super) objects: usize,
    /// Whether a scene has a dielectric that is taken along lines, and whether it has one of these that is not weak.
    pub(super) has_lines: bool,
    pub(super) has_strong: bool,
    /// Whether objects are solids, rather than what a camera sees.
    pub(super) is_exact: bool,
}

/// The camera as the kernels have it.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct CameraUniform {
    size: [u32; 2],
    pixels_per_metre: [f32; 2],
    depths: [f32; 2],
    jump: f32,
    back_fill: u32,
}

/// How objects are known.
#[derive(Debug)]
enum Source {
    /// By a camera.
    Camera(Box<Seen>),
    /// As solids.
    Exact,
}

/// A camera, and what draws what it sees: nothing where no scene has an object.
#[derive(Debug)]
struct Seen {
    gpu: GpuDevice,
    camera: Camera,
    drawing: Option<Drawing>,
}

/// What finds the objects of some scenes.
#[derive(Debug)]
pub(super) struct Finder {
    source: Source,
    scenes: Vec<Placed>,
    electrodes: usize,
    axes: [Vec<f64>; 3],
    /// Depths, or trees of edges.
    sources: wgpu::Buffer,
    pub(super) flags: wgpu::Buffer,
    pub(super) flags_len: usize,
    pub(super) layout: wgpu::BindGroupLayout,
    pub(super) group: wgpu::BindGroup,
}

impl Finding {
    pub(super) fn of(scenes: &[Objects], is_exact: bool) -> Self {
        let mut permittivities = scenes.iter().flat_map(|scene| &scene.materials).filter_map(|of| match of {
            Material::Dielectric(permittivity) => Some(permittivity.value()),
            Material::Conductor(_) => None,
        });
        let strongest = permittivities.clone().fold(0.0, f64::max);
        Self {
            objects: scenes.iter().map(|scene| scene.shapes.len()).max().unwrap_or(0).max(1),
            has_lines: permittivities.any(|permittivity| is_exact || permittivity < WEAK),
            has_strong: is_exact && strongest >= WEAK,
            is_exact,
        }
    }

    /// Words that kernels are told of an object.
    pub(super) fn object_words(&self) -> usize {
        COMMON_WORDS + if self.is_exact { SOLID_WORDS } else { DRAWN_WORDS }
    }

    /// Words that kernels keep of a node: what holds it and what its edges are like, and what a wedge of a conductor makes of it.
    pub(super) fn found_words(&self) -> usize {
        4 + if self.is_exact { 4 } else { 0 }
    }
}

/// Dielectrics below this relative permittivity are weak: as the processor has it.
const WEAK: f64 = 10.0;

impl Finder {
    /// Uploads shapes and tables, and reserves memory for depths.
    ///
    /// # Errors
    /// When there are too many objects or more is needed than the adapter has, or the driver fails.
    pub(super) fn new(
        adapter: &Adapter,
        sensor: &Sensor,
        camera: Option<Camera>,
        scenes: &[Objects],
    ) -> Result<Self, RenderError> {
        let finding = Finding::of(scenes, camera.is_none());
        let limit = |what, needed: usize, limit: u64| match needed as u64 > limit {
            true => Err(RenderError::LimitExceeded { what, needed: needed as u64, limit }),
            false => Ok(()),
        };
        let buffers = adapter.limits.max_storage_buffers_per_shader_stage;
        limit("the number of storage buffers of a kernel", STORAGE_BUFFERS as usize, buffers.into())?;
        limit("the number of objects", finding.objects, MOST_OBJECTS as u64)?;
        camera.iter().try_for_each(|camera| check_view(&camera.view))?;
        let nodes = sensor.mesh().nodes().len();
        let tables = Tables::new(sensor, camera.as_ref().map(|camera| &camera.view));
        let (Some(Tables { words, mut lattice }), Some(axes)) = (tables, sensor.lattice()) else {
            let (what, limit) = ("the number of values on the mesh", u64::from(u32::MAX));
            return Err(RenderError::LimitExceeded { what, needed: nodes as u64, limit });
        };
        let electrodes = sensor.electrode_names().len();
        let Prepared { source, scenes: placed, numbers, sources_len } = match camera {
            Some(camera) => drawn(adapter, camera, scenes, electrodes)?,
            None => exact(scenes, electrodes)?,
        };
        let flags_len = FLAGS + (finding.objects * electrodes).div_ceil(32);
        lattice.flags_len = flags_len as u32;
        use wgpu::BufferUsages as Usage;
        let storage = Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC;
        let reserve = Reserve { adapter };
        let tables = reserve.buffer("tables of the mesh", 4 * words.len() as u64, storage)?;
        let sources = reserve.buffer("depth layers", sources_len, storage)?;
        let found = reserve.buffer(
            "what objects hold",
            (4 * finding.found_words() * nodes * scenes.len()) as u64,
            storage,
        )?;
        let flags = reserve.buffer("flags", (4 * flags_len * scenes.len()) as u64, storage)?;
        let uniforms = Usage::UNIFORM | Usage::COPY_DST;
        let told = reserve.buffer("lattice", size_of_val(&lattice) as u64, uniforms)?;
        let seen = reserve.buffer("camera", size_of::<CameraUniform>() as u64, uniforms)?;
        adapter.queue.write_buffer(&tables, 0, bytemuck::cast_slice(&words));
        adapter.queue.write_buffer(&told, 0, bytemuck::bytes_of(&lattice));
        adapter.queue.write_buffer(&seen, 0, bytemuck::bytes_of(&uniform_of(camera.as_ref())));
        adapter.queue.write_buffer(&sources, 0, bytemuck::cast_slice(&numbers));
        let layout = bind_group_layout(&adapter.device);
        let buffers = [&told, &seen, &tables, &sources, &found, &flags];
        let group = bind_group(&adapter.device, &layout, buffers);
        adapter.faults.check("preparing to find objects")?;
        let axes = axes.axes().clone();
        Ok(Self { source, scenes: placed, electrodes, axes, sources, flags, flags_len, layout, group })
    }

    /// Whether objects are solids.
    pub(super) fn is_exact(&self) -> bool {
        matches!(self.source, Source::Exact)
    }

    /// What a scene's objects are made of.
    pub(super) fn materials(&self, scene: usize) -> Vec<Material> {
        self.scenes[scene].materials.clone()
    }

    /// Takes over where a scene's objects are, and returns whether that is news.
    ///
    /// # Errors
    /// When there is not one valid pose for each object.
    pub(super) fn place(&mut self, scene: usize, poses: &[Pose]) -> Result<bool, RenderError> {
        self.scenes[scene].place(poses)
    }

    /// Has the next solve find a scene's objects if they were placed since this was last called, and returns whether they were.
    pub(super) fn take_placed(&mut self, scene: usize) -> bool {
        self.scenes[scene].take()
    }

    /// Whether an object has a column, which is to be empty where the object is nowhere.
    pub(super) fn has_columns(&self) -> bool {
        self.scenes.iter().any(|placed| placed.columns(self.electrodes) != 0)
    }

    /// Whether a scene's objects are to be found by the next solve.
    pub(super) fn is_due(&self, scene: usize) -> bool {
        self.scenes[scene].is_due
    }

    /// Adds a scene's objects to what kernels are told of a frame, and its words of the header: number of objects and where they
    /// stand, whether they are to be found anew, columns that objects have, and whether they were ever found.
    pub(super) fn tell(&mut self, scene: usize, is_solved: bool, words: &mut Vec<u32>) -> [u32; 5] {
        let at = words.len() as u32;
        let placed = &mut self.scenes[scene];
        let is_due = is_solved && placed.is_due;
        if is_due {
            match &self.source {
                Source::Camera(seen) => {
                    if let Some(drawing) = &seen.drawing {
                        let mut rows = placed.tell_drawn(&seen.camera, drawing, &self.axes, words);
                        drawing.place(&seen.gpu, placed.first, &mut rows);
                    }
                }
                Source::Exact => placed.tell_exact(&self.axes, words),
            }
        }
        let columns = placed.columns(self.electrodes);
        [placed.objects() as u32, at, u32::from(is_due), columns, u32::from(placed.was_due)]
    }

    /// Draws the objects of all scenes that were told of as placed anew.
    pub(super) fn draw(&self, told: &[bool], encoder: &mut wgpu::CommandEncoder) {
        let Source::Camera(seen) = &self.source else { return };
        let Seen { gpu, camera, drawing: Some(drawing) } = &**seen else { return };
        let due = self.scenes.iter().zip(told).filter(|(_, told)| **told);
        let mut tiles: Vec<Tile> = due.flat_map(|(placed, _)| placed.tiles()).collect();
        tiles.sort_unstable_by_key(|tile| tile.tile);
        let capacity = drawing.atlas.capacity();
        for page in tiles.chunk_by(|a, b| a.tile / capacity == b.tile / capacity) {
            let number = page[0].tile / capacity;
            let on_page = page.iter().map(|tile| Tile { tile: tile.tile % capacity, ..*tile });
            let at = number as u64 * drawing.atlas.buffer_bytes();
            drawing.draw_page(gpu, encoder, &camera.view, on_page, (&self.sources, at));
        }
    }

    /// What the kernels found in a scene whose objects were placed anew.
    pub(super) fn take_found(&mut self, scene: usize, flags: &[u32]) -> Found {
        self.scenes[scene].is_due = false;
        let of_bit = |bit: usize| Contact { object: bit / self.electrodes, electrode: bit % self.electrodes };
        let bits = 0..self.scenes[scene].objects() * self.electrodes;
        let is_set = |bit: &usize| flags[FLAGS + bit / 32] >> (bit % 32) & 1 == 1;
        Found { changed_edges: flags[1] as usize, contacts: bits.filter(is_set).map(of_bit).collect() }
    }
}

/// How objects are known, the scenes, and what kernels are told of shapes once: numbers, and for how many bytes there is to be
/// room.
struct Prepared {
    source: Source,
    scenes: Vec<Placed>,
    numbers: Vec<f32>,
    sources_len: u64,
}

fn drawn(
    adapter: &Adapter,
    camera: Camera,
    scenes: &[Objects],
    electrodes: usize,
) -> Result<Prepared, RenderError> {
    let gpu = GpuDevice::of(adapter.clone())?;
    let (meshes, scenes) = meshes(scenes, electrodes)?;
    let count = scenes.iter().map(Placed::objects).sum();
    let drawing = Drawing::new(&gpu, None, &camera.view, &meshes, count)?;
    let pages = drawing.as_ref().map_or(0, |drawing| count.div_ceil(drawing.atlas.capacity()) as u64);
    let sources_len = drawing.as_ref().map_or(4, |drawing| pages * drawing.atlas.buffer_bytes());
    Ok(Prepared {
        source: Source::Camera(Box::new(Seen { gpu, camera, drawing })),
        scenes,
        numbers: Vec::new(),
        sources_len,
    })
}

fn exact(scenes: &[Objects], electrodes: usize) -> Result<Prepared, RenderError> {
    let mut numbers = Vec::new();
    let mut placed = Vec::with_capacity(scenes.len());
    let mut first = 0;
    for Objects { shapes, materials } in scenes {
        check_materials(shapes, materials)?;
        let solids = Solids::new(shapes).map_err(of_solid)?;
        if let Some(object) = (0..shapes.len()).find(|&object| !is_found(&solids, object)) {
            return Err(RenderError::NotConvex { object });
        }
        let trees = EdgeTrees::new(&solids, &mut numbers);
        placed.push(Placed::new(first, Shapes::Exact(solids, trees), materials.clone(), electrodes));
        first += shapes.len();
    }
    let sources_len = 4 * numbers.len().max(1) as u64;
    Ok(Prepared { source: Source::Exact, scenes: placed, numbers, sources_len })
}

fn check_materials(shapes: &[Shape], materials: &[Material]) -> Result<(), RenderError> {
    if shapes.len() == materials.len() {
        return Ok(());
    }
    Err(RenderError::PoseCount { poses: materials.len(), objects: shapes.len() })
}

/// The meshes of all scenes, each once, and the scenes.
fn meshes(scenes: &[Objects], electrodes: usize) -> Result<(Vec<SceneObject>, Vec<Placed>), RenderError> {
    let (mut meshes, mut known): (Vec<SceneObject>, Vec<&Shape>) = (Vec::new(), Vec::new());
    let mut placed = Vec::with_capacity(scenes.len());
    let mut first = 0;
    for Objects { shapes, materials } in scenes {
        check_materials(shapes, materials)?;
        let mut of_scene = Vec::with_capacity(shapes.len());
        for (object, shape) in shapes.iter().enumerate() {
            let mesh = match known.iter().position(|known| *known == shape) {
                Some(mesh) => mesh,
                None => {
                    let drawn = RenderScene::new(std::slice::from_ref(shape));
                    let drawn = drawn.map_err(|error| error.of_object(object))?;
                    known.push(shape);
                    meshes.extend_from_slice(drawn.objects());
                    meshes.len() - 1
                }
            };
            of_scene.push((mesh, meshes[mesh].clone()));
        }
        placed.push(Placed::new(first, Shapes::Drawn(of_scene), materials.clone(), electrodes));
        first += shapes.len();
    }
    Ok((meshes, placed))
}

fn uniform_of(camera: Option<&Camera>) -> CameraUniform {
    let Some(Camera { view, back_fill }) = camera else { return CameraUniform::zeroed() };
    let pixel = view.pixel_size();
    CameraUniform {
        size: [view.width as u32, view.height as u32],
        pixels_per_metre: [(1.0 / pixel.x) as f32, (1.0 / pixel.y) as f32],
        depths: [view.domain.min.z as f32, view.domain.max.z as f32],
        jump: (JUMP_IN_PIXELS * pixel.max_element()) as f32,
        back_fill: u32::from(*back_fill),
    }
}

/// Two uniform buffers, then storage: which of it kernels write to.
const WRITTEN: [bool; 4] = [false, false, true, true];

fn bind_group_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    let uniforms = [buffer(wgpu::BufferBindingType::Uniform); 2];
    let storage = WRITTEN.map(|written| buffer(wgpu::BufferBindingType::Storage { read_only: !written }));
    let entry = |(binding, ty): (usize, wgpu::BindingType)| wgpu::BindGroupLayoutEntry {
        binding: binding as u32,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty,
        count: None,
    };
    let entries: Vec<_> = uniforms.into_iter().chain(storage).enumerate().map(entry).collect();
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("objects"),
        entries: &entries,
    })
}

fn bind_group(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    buffers: [&wgpu::Buffer; 6],
) -> wgpu::BindGroup {
    let entries: Vec<_> = buffers
        .into_iter()
        .enumerate()
        .map(|(binding, buffer)| wgpu::BindGroupEntry {
            binding: binding as u32,
            resource: buffer.as_entire_binding(),
        })
        .collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some("objects"), layout, entries: &entries })
}
