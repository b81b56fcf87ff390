//! Which nodes lie in which object, and how much of each mesh edge.

mod depth;

pub use depth::{DepthLayers, InvalidDepth, OrthographicView};

use crate::geometry::Aabb;
use glam::DVec3;

/// The part of a segment from a (0) to b (1) that lies in an object: first entry and last exit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Where the segment first enters, in [0, 1].
    pub enter: f64,
    /// Where it last leaves, in [enter, 1].
    pub exit: f64,
}

/// Where objects are: answers for points and segments in the sensor frame.
pub trait Surfaces {
    /// Number of objects.
    fn objects(&self) -> usize;

    /// A box outside of which the object certainly is not; [`Aabb::EMPTY`] when it is not seen at all.
    fn bounds(&self, object: usize) -> Aabb;

    /// Whether a point lies inside an object.
    fn contains(&self, object: usize, point: DVec3) -> bool;

    /// The part of the segment from `a` to `b` that lies in an object; `None` when it passes by.
    fn span(&self, object: usize, a: DVec3, b: DVec3) -> Option<Span>;
}
