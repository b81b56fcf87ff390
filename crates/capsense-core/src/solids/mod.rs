//! Solid objects with exact surfaces: boxes, spheres, capsules, cylinders and closed triangle meshes at given poses.
//!
//! The other source of geometry beside the depth camera. It sees all sides of an object, at any size of mesh cell, and
//! silhouettes have no pixels. Points and segments are taken to the object's frame, where the answers have closed forms
//! (`convex`) or come from the triangles (`enclosed`), unless these are a box (`cuboid`). What may differ from one frame to the next follows from the
//! poses alone (`surface_tree`).

mod bars;
mod convex;
mod cuboid;
mod enclosed;
mod surface_tree;
mod weld;

pub use weld::BadEdges;

use crate::geometry::{Aabb, Pose, Shape};
use crate::occupancy::{
    Bars, Earlier, Fill, Frame, Regions, RightAngles, Round, Side, Span, Surfaces, span_in_box,
};
use convex::Convex;
use cuboid::Cuboid;
use enclosed::Enclosed;
use glam::{DAffine3, DMat3, DQuat, DVec3};
use std::sync::Arc;
use surface_tree::{SurfaceTree, placed};

/// No length is less, in metres: of shorter ones products are too small to be numbers.
const LEAST_LENGTH: f64 = 1e-100;

/// Why objects cannot be solids, or not stand where they should.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SolidError {
    /// A length that is not finite and greater than zero, or of which the square is as good as zero.
    #[error(
        "object {object} has the length {length} m; lengths must be finite and at least {LEAST_LENGTH:e} m"
    )]
    Length {
        /// Index of the object.
        object: usize,
        /// The length given.
        length: f64,
    },
    /// A triangle mesh that does not enclose a volume.
    #[error("the mesh of object {object} is not watertight: {edges}")]
    NotWatertight {
        /// Index of the object.
        object: usize,
        /// How many edges are to blame.
        edges: BadEdges,
    },
    /// Not one pose for each object.
    #[error("{poses} poses for {objects} objects")]
    PoseCount {
        /// Number of poses given.
        poses: usize,
        /// Number of objects.
        objects: usize,
    },
    /// A pose that is not finite or whose rotation is not of unit length.
    #[error("the pose of object {0} is not finite or not of unit length")]
    Pose(usize),
}

#[derive(Clone, Debug)]
enum Body {
    Convex(Convex),
    Enclosed(Box<Enclosed>),
}

/// A solid in its own frame, which is that of its shape but for boxes that were given as triangles.
#[derive(Clone, Debug)]
struct Solid {
    body: Body,
    bounds: Aabb,
    surface: SurfaceTree,
    /// The same of the lines where the surface turns abruptly; for triangles, of all of it.
    edges: SurfaceTree,
    /// Whether it looks the same however it is turned.
    is_ball: bool,
    /// Where it is in the frame of its shape, if that is another.
    place: Option<DAffine3>,
}

/// A solid in the sensor frame.
#[derive(Clone, Copy, Debug)]
struct Placed {
    sensor_from_object: DAffine3,
    object_from_sensor: DMat3,
    bounds: Aabb,
}

/// Solid objects at poses. A point on a surface, or nearer to it than rounding can tell, is outside.
///
/// # Example
/// ```
/// use capsense_core::geometry::{Pose, Shape};
/// use capsense_core::glam::DVec3;
/// use capsense_core::occupancy::{Span, Surfaces};
/// use capsense_core::solids::Solids;
///
/// # fn main() -> Result<(), capsense_core::solids::SolidError> {
/// let mut solids = Solids::new(&[Shape::Sphere { radius: 0.1 }])?;
/// solids.place(&[Pose::at(DVec3::new(0.0, 0.0, 0.5))])?;
/// assert!(solids.contains(0, DVec3::new(0.0, 0.05, 0.5)));
/// let upwards = solids.span(0, DVec3::ZERO, DVec3::Z);
/// assert!(upwards.is_some_and(|Span { enter, exit }| (enter - 0.4).abs() + (exit - 0.6).abs() < 1e-9));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Solids {
    solids: Arc<[Solid]>,
    /// The same for all clones, and for no others.
    identity: Arc<()>,
    placed: Vec<Placed>,
}

impl Solids {
    /// Takes the shapes of objects, which stand at the origin until they are placed elsewhere.
    ///
    /// # Errors
    /// When a length is not finite and positive, or a triangle mesh is not watertight.
    pub fn new(shapes: &[Shape]) -> Result<Self, SolidError> {
        let solids = shapes.iter().enumerate().map(|(object, shape)| Solid::new(object, shape));
        let solids: Arc<[Solid]> = solids.collect::<Result<_, _>>()?;
        let placed = solids.iter().map(|solid| solid.at(&Pose::IDENTITY)).collect();
        Ok(Self { solids, identity: Arc::new(()), placed })
    }

    /// Moves all objects: `poses[k]` is where object k stands.
    ///
    /// # Errors
    /// When there is not one valid pose for each object; all then stay where they are.
    pub fn place(&mut self, poses: &[Pose]) -> Result<(), SolidError> {
        if poses.len() != self.solids.len() {
            return Err(SolidError::PoseCount { poses: poses.len(), objects: self.solids.len() });
        }
        if let Some(object) = poses.iter().position(|pose| !pose.is_valid()) {
            return Err(SolidError::Pose(object));
        }
        self.placed.clear();
        self.placed.extend(self.solids.iter().zip(poses).map(|(solid, pose)| solid.at(pose)));
        Ok(())
    }

    /// Nested boxes around the lines where the surface of an object turns abruptly, in the object's frame, each before those
    /// within it and with the number of the one after it and all within it: by these [`Surfaces::has_edge_in`] tells where edges
    /// of round faces are.
    ///
    /// # Panics
    /// When there is no such object.
    pub fn boxes_around_edges(&self, object: usize) -> impl ExactSizeIterator<Item = (Aabb, u32)> {
        self.solids[object].edges.boxes()
    }
}

impl Solid {
    fn new(object: usize, shape: &Shape) -> Result<Self, SolidError> {
        let positive = |length: f64| {
            if length >= LEAST_LENGTH && length.is_finite() {
                Ok(length)
            } else {
                Err(SolidError::Length { object, length })
            }
        };
        let mut place = None;
        let convex = match shape {
            Shape::Box { size } => {
                size.to_array().into_iter().try_for_each(|length| positive(length).map(|_| ()))?;
                Convex::Box(0.5 * *size)
            }
            Shape::Sphere { radius } => Convex::Capsule { radius: positive(*radius)?, half_length: 0.0 },
            Shape::Capsule { radius, length } => {
                Convex::Capsule { radius: positive(*radius)?, half_length: 0.5 * positive(*length)? }
            }
            Shape::Cylinder { radius, length } => {
                Convex::Cylinder { radius: positive(*radius)?, half_length: 0.5 * positive(*length)? }
            }
            Shape::Mesh(mesh) => {
                let triangles = weld::closed_surface(mesh)
                    .map_err(|edges| SolidError::NotWatertight { object, edges })?;
                match Cuboid::of(&triangles) {
                    Some(cuboid) => {
                        place = Some(cuboid.place);
                        Convex::Box(cuboid.half)
                    }
                    None => return Ok(Self::enclosed(Enclosed::new(triangles))),
                }
            }
        };
        let corners = convex.surface().into_iter().flat_map(|(patch, _)| patch.bounds());
        Ok(Self {
            body: Body::Convex(convex.shrunk()),
            bounds: Aabb::around(corners),
            surface: SurfaceTree::of_patches(convex.surface()),
            edges: SurfaceTree::of_patches(convex.edges()),
            is_ball: matches!(shape, Shape::Sphere { .. }),
            place,
        })
    }

    /// Whether it has a round surface, before which the field is known.
    fn is_round(&self) -> bool {
        matches!(self.body, Body::Convex(Convex::Capsule { .. } | Convex::Cylinder { .. }))
    }

    fn enclosed(enclosed: Enclosed) -> Self {
        let (bounds, surface) = (enclosed.bounds(), enclosed.surface_tree());
        Self {
            body: Body::Enclosed(Box::new(enclosed)),
            bounds,
            edges: surface.clone(),
            surface,
            is_ball: false,
            place: None,
        }
    }

    /// The part of a segment of the solid's frame that is in the solid.
    #[inline]
    fn span(&self, a: DVec3, b: DVec3) -> Option<Span> {
        let convex = match &self.body {
            Body::Convex(Convex::Box(half)) => return span_in_box(*half, a, b),
            Body::Convex(convex) => convex,
            Body::Enclosed(enclosed) => return enclosed.span(a, b),
        };
        if convex.parts_by_face(a, b) {
            return None;
        }
        // An end that is inside starts or ends the span, whatever rounding makes of the interval.
        let (from, to) = (convex.contains(a), convex.contains(b));
        if from && to {
            return Some(Span { enter: 0.0, exit: 1.0 });
        }
        match convex.interval(a, b - a) {
            Some([enter, exit]) => {
                let enter = if from { 0.0 } else { enter.max(0.0) };
                let exit = if to { 1.0 } else { exit.min(1.0) };
                let is_met = enter < exit || from || to;
                is_met.then(|| Span { enter: enter.min(1.0), exit: exit.max(enter.min(1.0)) })
            }
            None if from => Some(Span { enter: 0.0, exit: 0.0 }),
            None if to => Some(Span { enter: 1.0, exit: 1.0 }),
            None => None,
        }
    }

    fn at(&self, pose: &Pose) -> Placed {
        let rotation = if self.is_ball { DQuat::IDENTITY } else { pose.rotation.normalize() };
        let sensor_from_shape = DAffine3::from_rotation_translation(rotation, pose.translation);
        let sensor_from_object = self.place.map_or(sensor_from_shape, |place| sensor_from_shape * place);
        Placed {
            sensor_from_object,
            object_from_sensor: sensor_from_object.matrix3.transpose(),
            bounds: placed(&sensor_from_object, &self.bounds),
        }
    }
}

impl Placed {
    #[inline]
    fn local(&self, point: DVec3) -> DVec3 {
        self.object_from_sensor * (point - self.sensor_from_object.translation)
    }
}

impl Surfaces for Solids {
    fn objects(&self) -> usize {
        self.solids.len()
    }

    fn bounds(&self, object: usize) -> Aabb {
        self.placed[object].bounds
    }

    fn contains(&self, object: usize, point: DVec3) -> bool {
        let local = self.placed[object].local(point);
        match &self.solids[object].body {
            Body::Convex(convex) => convex.contains(local),
            Body::Enclosed(enclosed) => enclosed.contains(local),
        }
    }

    fn span(&self, object: usize, a: DVec3, b: DVec3) -> Option<Span> {
        // No `map` over the two ends: it is not inlined and costs as much as the rest.
        let placed = &self.placed[object];
        self.solids[object].span(placed.local(a), placed.local(b))
    }

    fn frame(&self, object: usize) -> Frame {
        let Placed { sensor_from_object, object_from_sensor, .. } = self.placed[object];
        Frame { origin: sensor_from_object.translation, object_from_sensor }
    }

    fn span_in_frame(&self, object: usize, a: DVec3, b: DVec3) -> Option<Span> {
        self.solids[object].span(a, b)
    }

    fn fill_in_frame(&self, object: usize, within: [DVec3; 2], bars: &[Bars], fill: &mut [Fill]) {
        match &self.solids[object].body {
            Body::Convex(convex) => convex.fill(within, bars, fill),
            Body::Enclosed(enclosed) => {
                for (bars, fill) in bars.iter().zip(fill) {
                    *fill = Fill::over(bars.middle_lines().map(|[start, end]| enclosed.span(start, end)));
                }
            }
        }
    }

    fn misses(&self, object: usize, middle: DVec3, half: DVec3) -> bool {
        let Body::Convex(convex) = &self.solids[object].body else { return false };
        convex.is_beyond_face(middle, half)
    }

    fn side_of(&self, object: usize, middle: DVec3, half: DVec3) -> Option<Side> {
        let Body::Convex(convex) = &self.solids[object].body else { return None };
        convex.side_of(middle, half)
    }

    fn are_exact(&self) -> bool {
        true
    }

    fn has_edge_in(&self, object: usize, bounds: &Aabb) -> bool {
        if let Some(is_in) = self.right_angles(object).and_then(|angles| angles.has_straight_edge_in(bounds))
        {
            return is_in;
        }
        let placed = &self.placed[object];
        let centre = placed.local(0.5 * (bounds.min + bounds.max));
        let half = 0.5 * bounds.size();
        let turned = placed.object_from_sensor;
        let half = (0..3).map(|axis| turned.col(axis).abs() * half[axis]).sum();
        // A box that is turned against the solid is smaller than that around it in the solid's frame. All that is said
        // to be in it must be in what `find_changes` tells.
        let is_in = || self.solids[object].edges.is_in(&placed.sensor_from_object, bounds);
        match &self.solids[object].body {
            Body::Convex(convex) => convex.has_round_edge_near(centre, half) && is_in(),
            Body::Enclosed(enclosed) => enclosed.has_edge_near(centre, half) && is_in(),
        }
    }

    fn right_angles(&self, object: usize) -> Option<RightAngles> {
        let Body::Convex(convex) = &self.solids[object].body else { return None };
        let Placed { sensor_from_object, object_from_sensor, .. } = self.placed[object];
        Some(RightAngles { solid: convex.right_angled()?, sensor_from_object, object_from_sensor })
    }

    fn roundness(&self, object: usize) -> Option<Round> {
        let Body::Convex(Convex::Capsule { radius, half_length }) = self.solids[object].body else {
            return None;
        };
        let pose = &self.placed[object].sensor_from_object;
        Some(Round { centre: pose.translation, half: pose.matrix3 * (DVec3::Z * half_length), radius })
    }

    fn find_changes(&self, before: &mut Earlier, regions: &mut Regions) -> bool {
        let poses = || self.placed.iter().map(|placed| placed.sensor_from_object);
        let Some(earlier) = before.poses_of(&self.identity) else {
            before.remember_poses(&self.identity, poses());
            return false;
        };
        for (object, (now, earlier)) in poses().zip(earlier).enumerate() {
            let earlier = std::mem::replace(earlier, now);
            if earlier == now {
                continue;
            }
            let solid = &self.solids[object];
            let was_at = placed(&earlier, &solid.bounds);
            let (spacing, boxes) = regions.of_object(object);
            if moved_far(&earlier, &now, &solid.bounds) {
                boxes.extend([was_at, self.placed[object].bounds]);
                regions.around_edges().extend([was_at, self.placed[object].bounds]);
            } else {
                let first = boxes.len();
                solid.surface.append_regions([&earlier, &now], spacing, boxes);
                if solid.is_round() {
                    regions.are_around_edges(first);
                }
                solid.edges.append_regions_at_edges([&earlier, &now], spacing, regions.around_edges());
            }
        }
        true
    }
}

/// Whether a move is longer than a part of the solid, so that most of what is in it before or after is elsewhere.
fn moved_far(before: &DAffine3, now: &DAffine3, bounds: &Aabb) -> bool {
    let half = 0.5 * bounds.size();
    let centre = 0.5 * (bounds.min + bounds.max);
    let shift = now.transform_point3(centre).distance(before.transform_point3(centre));
    let turn = now.matrix3 - before.matrix3;
    let turned = (0..3).map(|axis| turn.col(axis).length() * half[axis]).sum::<f64>();
    shift + turned > half.min_element()
}
