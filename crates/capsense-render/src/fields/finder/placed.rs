//! Where the objects of one scene are, and what kernels are told of it.

use super::super::solids::EdgeTrees;
use super::Camera;
use super::tables::in_two;
use crate::error::RenderError;
use crate::gpu::{Drawing, ObjectFrame, Rows, Tile};
use crate::scene::{SceneObject, check_poses};
use crate::tessellate::TessellateError;
use capsense_core::geometry::{Aabb, Pose};
use capsense_core::material::{Connection, Material};
use capsense_core::occupancy::Surfaces;
use capsense_core::solids::{SolidError, Solids};
use capsense_core::solver::HELD_AT_ZERO;

/// Words of an object: what it is and between which planes.
pub(in super::super) const COMMON_WORDS: usize = 9;
/// What `depth_layers.wgsl` needs of it behind these.
pub(in super::super) const DRAWN_WORDS: usize = 7;

/// Bits of its first word.
const IS_SEEN: u32 = 1;
const IS_CONDUCTOR: u32 = 2;

/// Objects are nowhere outside of their pixels, and in depth no more than rounding off their bounds, in metres.
const MARGIN: f64 = 1e-6;

/// The shapes of a scene's objects.
#[derive(Debug)]
pub(super) enum Shapes {
    /// The number of each object's mesh, and the mesh.
    Drawn(Vec<(usize, SceneObject)>),
    /// Solids, and the trees of their edges.
    Exact(Solids, EdgeTrees),
}

impl Shapes {
    fn count(&self) -> usize {
        match self {
            Self::Drawn(meshes) => meshes.len(),
            Self::Exact(solids, _) => solids.objects(),
        }
    }
}

/// One scene.
#[derive(Debug)]
pub(super) struct Placed {
    /// The number of its first object among those of all scenes.
    pub(super) first: usize,
    shapes: Shapes,
    pub(super) materials: Vec<Material>,
    /// The column in which each conductor is at 1 V, or that it is held at zero.
    holders: Vec<u32>,
    poses: Vec<Pose>,
    visible: Vec<bool>,
    was_placed: bool,
    /// Whether objects were placed since the simulator last took over that they were.
    is_news: bool,
    /// Whether it took that over and they were not found there yet.
    pub(super) is_due: bool,
    pub(super) was_due: bool,
}

impl Placed {
    pub(super) fn new(first: usize, shapes: Shapes, materials: Vec<Material>, electrodes: usize) -> Self {
        let mut next = electrodes as u32;
        let holders = materials.iter().map(|material| match material {
            Material::Conductor(Connection::Floating | Connection::Capacitance(_)) => {
                next += 1;
                next - 1
            }
            Material::Conductor(Connection::Grounded) | Material::Dielectric(_) => HELD_AT_ZERO,
        });
        let holders = holders.collect();
        let visible = vec![false; shapes.count()];
        Self {
            first,
            shapes,
            materials,
            holders,
            poses: Vec::new(),
            visible,
            was_placed: false,
            is_news: false,
            is_due: false,
            was_due: false,
        }
    }

    pub(super) fn objects(&self) -> usize {
        self.shapes.count()
    }

    /// A bit for each column that an object has.
    pub(super) fn columns(&self, electrodes: usize) -> u32 {
        let own = self.holders.iter().filter(|&&holder| holder >= electrodes as u32 && holder < 32);
        own.fold(0, |bits, holder| bits | 1 << holder)
    }

    /// Takes over poses and returns whether they are news.
    pub(super) fn place(&mut self, poses: &[Pose]) -> Result<bool, RenderError> {
        check_poses(poses, self.shapes.count())?;
        if self.was_placed && self.poses == poses {
            return Ok(false);
        }
        if let Shapes::Exact(solids, _) = &mut self.shapes {
            solids.place(poses).map_err(of_solid)?;
        }
        self.poses.clear();
        self.poses.extend_from_slice(poses);
        (self.is_news, self.was_placed) = (true, true);
        Ok(true)
    }

    /// Has the next solve find objects that were placed since this was last called, and returns whether any were.
    pub(super) fn take(&mut self) -> bool {
        let is_news = std::mem::take(&mut self.is_news);
        self.is_due |= is_news;
        self.was_due |= is_news;
        is_news
    }

    /// Adds the objects' words, and returns how they are drawn.
    pub(super) fn tell_drawn(
        &mut self,
        camera: &Camera,
        drawing: &Drawing,
        axes: &[Vec<f64>; 3],
        words: &mut Vec<u32>,
    ) -> Vec<Rows> {
        let Shapes::Drawn(meshes) = &self.shapes else { return Vec::new() };
        let mut all_rows = Vec::with_capacity(meshes.len());
        for (object, ((_, mesh), pose)) in meshes.iter().zip(&self.poses).enumerate() {
            let (frame, rows) = ObjectFrame::new(&camera.view, mesh, pose);
            all_rows.push(rows);
            self.visible[object] = frame.visible;
            let seen = if frame.visible { IS_SEEN } else { 0 };
            words.extend(self.common_words(object, seen, axes, &within(camera, mesh.bounds(pose))));
            let [front, back, pitch] = places_of(drawing, self.first + object);
            let [high, low] = in_two(frame.near).map(f32::to_bits);
            words.extend([front, back, pitch, high, low, (frame.range as f32).to_bits(), 0]);
        }
        all_rows
    }

    /// Adds the words of solids.
    pub(super) fn tell_exact(&self, axes: &[Vec<f64>; 3], words: &mut Vec<u32>) {
        let Shapes::Exact(solids, trees) = &self.shapes else { return };
        for object in 0..solids.objects() {
            words.extend(self.common_words(object, IS_SEEN, axes, &solids.bounds(object)));
            trees.tell(solids, object, words);
        }
    }

    fn common_words(
        &self,
        object: usize,
        seen: u32,
        axes: &[Vec<f64>; 3],
        bounds: &Aabb,
    ) -> [u32; COMMON_WORDS] {
        let (conducts, permittivity) = match self.materials[object] {
            Material::Conductor(_) => (IS_CONDUCTOR, 1.0),
            Material::Dielectric(permittivity) => (0, permittivity.value() as f32),
        };
        let [[a, b, c], [d, e, f]] = planes_around(axes, bounds);
        [seen | conducts, permittivity.to_bits(), self.holders[object], a, b, c, d, e, f]
    }

    /// What is drawn of the objects, each in its tile among those of all scenes.
    pub(super) fn tiles(&self) -> impl Iterator<Item = Tile> {
        let meshes = match &self.shapes {
            Shapes::Drawn(meshes) => &meshes[..],
            Shapes::Exact(..) => &[],
        };
        let visible = meshes.iter().zip(&self.visible).enumerate().filter(|(_, (_, visible))| **visible);
        visible.map(|(object, ((mesh, _), _))| {
            let tile = self.first + object;
            Tile { tile, mesh: *mesh, pose: tile }
        })
    }
}

/// What is wrong with a solid.
pub(super) fn of_solid(error: SolidError) -> RenderError {
    match error {
        SolidError::Length { object, length } => {
            let source = TessellateError::InvalidLength { shape: "solid", what: "length", value: length };
            RenderError::Shape { object, source }
        }
        SolidError::NotWatertight { object, .. } => RenderError::NotConvex { object },
        SolidError::PoseCount { poses, objects } => RenderError::PoseCount { poses, objects },
        SolidError::Pose(object) => RenderError::InvalidPose { object },
    }
}

/// Where in the buffer of depths an object's front and back begin, and the distance between rows.
fn places_of(drawing: &Drawing, tile: usize) -> [u32; 3] {
    let atlas = &drawing.atlas;
    let (page, tile) = (tile / atlas.capacity(), tile % atlas.capacity());
    let (x, y) = atlas.tile(tile);
    let pitch = atlas.row_bytes() / 4;
    let front = page as u64 * atlas.buffer_bytes() / 4 + u64::from(y) * pitch + u64::from(x);
    [front, front + atlas.layer_bytes() / 4, pitch].map(|at| at as u32)
}

/// All that the camera makes of an object within some bounds.
fn within(camera: &Camera, bounds: Aabb) -> Aabb {
    let pixel = camera.view.pixel_size().extend(MARGIN);
    let mut seen = Aabb { min: bounds.min - pixel, max: bounds.max + pixel };
    if camera.back_fill {
        seen.max.z = camera.view.domain.max.z + MARGIN;
    }
    seen
}

/// The last planes before some bounds, and the first ones behind them.
fn planes_around(axes: &[Vec<f64>; 3], bounds: &Aabb) -> [[u32; 3]; 2] {
    let mut planes = [[0; 3]; 2];
    for (axis, all) in axes.iter().enumerate() {
        planes[0][axis] = all.partition_point(|&plane| plane <= bounds.min[axis]).saturating_sub(1) as u32;
        planes[1][axis] = all.partition_point(|&plane| plane < bounds.max[axis]).min(all.len() - 1) as u32;
    }
    planes
}

#[cfg(test)]
mod tests {
    use super::*;
    use capsense_core::glam::DVec3;

    #[test]
    fn planes_enclose_bounds() {
        let axes = [vec![0.0, 1.0, 2.0, 3.0], vec![0.0, 1.0], vec![0.0, 0.5, 2.0]];
        let bounds = Aabb { min: DVec3::new(1.0, -1.0, 0.6), max: DVec3::new(1.5, 5.0, 0.7) };
        assert_eq!(planes_around(&axes, &bounds), [[1, 0, 1], [2, 1, 2]]);
    }
}
