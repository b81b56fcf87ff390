//! What the occupancy asks of surfaces, however they are known.

use super::crossing::span_behind;
use super::{Bars, Earlier, Fill, InvalidDepth, Regions, RightAngles, Round};
use crate::geometry::Aabb;
use glam::{DMat3, DVec3};

/// The part of a segment from a (0) to b (1) that lies in an object: first entry and last exit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Where the segment first enters, in [0, 1].
    pub enter: f64,
    /// Where it last leaves, in [enter, 1].
    pub exit: f64,
}

impl Span {
    /// All of a segment.
    pub const WHOLE: Self = Self { enter: 0.0, exit: 1.0 };
}

/// The frame in which an object rests, by its origin in the sensor frame, in metres, and a rotation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Where it is in the sensor frame.
    pub origin: DVec3,
    /// How it is turned.
    pub object_from_sensor: DMat3,
}

impl Frame {
    /// The sensor frame itself.
    pub const SENSOR: Self = Self { origin: DVec3::ZERO, object_from_sensor: DMat3::IDENTITY };

    /// A point of the sensor frame in this one.
    #[inline]
    pub fn point(&self, point: DVec3) -> DVec3 {
        self.object_from_sensor * (point - self.origin)
    }

    /// Half the size, along the axes of this frame, of a box that holds one of the sensor frame, given by half its size there.
    #[inline]
    pub fn half_size_of(&self, half: DVec3) -> DVec3 {
        let turned = &self.object_from_sensor;
        turned.x_axis.abs() * half.x + turned.y_axis.abs() * half.y + turned.z_axis.abs() * half.z
    }
}

/// Where something lies as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// In an object.
    Inside,
    /// Beside it.
    Outside,
}

/// Between which depths front and back of an object are in a part of its image, with all that rounding does to them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LayersWithin {
    /// The nearest and the farthest front.
    pub front: [f64; 2],
    /// The nearest and the farthest back.
    pub back: [f64; 2],
}

impl LayersWithin {
    /// On which side of the surfaces all that is between two depths certainly is.
    #[inline]
    pub fn side_of(&self, [low, high]: [f64; 2]) -> Option<Side> {
        if high < self.front[0] || low > self.back[1] {
            Some(Side::Outside)
        } else if low > self.front[1] && high < self.back[0] {
            Some(Side::Inside)
        } else {
            None
        }
    }
}

/// A wall along z at which a segment enters an object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LayerWall {
    /// Where on the segment, in parts of it.
    pub enter: f64,
    /// How steeply the steepest of the faces that end there rises or falls behind it; zero if all go on straight across z.
    pub slope: f64,
}

/// Where the way along a segment across z first leads past an object before or behind it, as who looks along z sees it: what is the
/// same at all depths at which the segment may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LayerWay {
    /// From where to where on the segment, in parts of it, faces are taken as straight lines.
    pub part: [f64; 2],
    /// Front and back of the object where that starts and where it ends.
    pub faces: [[f64; 2]; 2],
    /// The object's front and back as seen there, and by the next ray on the way unless that misses it.
    pub seen: [f32; 2],
    /// What the next ray sees.
    pub behind: Option<[f32; 2]>,
    /// How far apart these rays are.
    pub spacing: f64,
}

impl LayerWay {
    /// What of that part is in the object at a depth.
    #[inline]
    pub fn span_at(&self, z: f64) -> Option<Span> {
        span_behind(self.faces, [z; 2], self.part)
    }

    /// The wall where such a span starts, if the object is met as soon as the part starts: where faces rise or fall into the way, there
    /// is none. Of the faces, those between two depths count.
    #[inline]
    pub fn wall_before(&self, span: Span, depths: [f64; 2]) -> Option<LayerWall> {
        let enter = self.part[0];
        (span.enter == enter).then(|| LayerWall { enter, slope: self.rise(depths) / self.spacing })
    }

    /// How much faces between two depths rise or fall up to the next ray; zero where that misses the object.
    #[inline]
    fn rise(&self, [low, high]: [f64; 2]) -> f64 {
        let Some(behind) = self.behind else { return 0.0 };
        let rise = |side: usize| {
            let (here, there) = (f64::from(self.seen[side]), f64::from(behind[side]));
            if low < here && here < high { (there - here).abs() } else { 0.0 }
        };
        rise(0).max(rise(1))
    }
}

/// Where objects are: answers for points and segments in the sensor frame, which several threads may ask for at once.
pub trait Surfaces: Sync {
    /// Number of objects.
    fn objects(&self) -> usize;

    /// A box outside of which the object certainly is not; [`Aabb::EMPTY`] when it is not seen at all.
    fn bounds(&self, object: usize) -> Aabb;

    /// Whether a point lies inside an object.
    fn contains(&self, object: usize, point: DVec3) -> bool;

    /// The same, of all that was measured only by the measurement for that point: no interpolation between the pixels
    /// of a depth camera.
    fn contains_as_measured(&self, object: usize, point: DVec3) -> bool {
        self.contains(object, point)
    }

    /// The part of the segment from `a` to `b` that lies in an object; `None` when it passes by.
    fn span(&self, object: usize, a: DVec3, b: DVec3) -> Option<Span>;

    /// A frame of an object. Who asks for several spans next to each other takes what they are made of there once, and
    /// asks [`Surfaces::span_in_frame`].
    fn frame(&self, _object: usize) -> Frame {
        Frame::SENSOR
    }

    /// The part of a segment that lies in an object, both in the object's frame.
    fn span_in_frame(&self, object: usize, a: DVec3, b: DVec3) -> Option<Span> {
        self.span(object, a, b)
    }

    /// What of bars is in an object, all in the object's frame: the whole cross-section where nothing but the middle line is asked. All bars are
    /// in a box about a point, of some half size.
    fn fill_in_frame(&self, object: usize, _within: [DVec3; 2], bars: &[Bars], fill: &mut [Fill]) {
        for (bars, fill) in bars.iter().zip(fill) {
            *fill =
                Fill::over(bars.middle_lines().map(|[start, end]| self.span_in_frame(object, start, end)));
        }
    }

    /// Whether it is soon seen that an object certainly misses all of a box about a point, of some half size, along the axes
    /// of the object's frame.
    fn misses(&self, _object: usize, _middle: DVec3, _half: DVec3) -> bool {
        false
    }

    /// On which side of an object's surface all of such a box certainly is; `None` where that is not soon seen.
    fn side_of(&self, object: usize, middle: DVec3, half: DVec3) -> Option<Side> {
        self.misses(object, middle, half).then_some(Side::Outside)
    }

    /// Whether [`Surfaces::layer_at`] and [`Surfaces::wall_between`] tell where objects are.
    fn has_layers(&self) -> bool {
        false
    }

    /// From where to where along z an object is at x and y of a point, as who looks along z sees it; `None` where it is not.
    fn layer_at(&self, _object: usize, _point: DVec3) -> Option<[f64; 2]> {
        None
    }

    /// Between which depths front and back of an object are in all of a box of the sensor frame, as who looks along z sees them;
    /// `None` where that is not soon told.
    fn layers_within(&self, _object: usize, _bounds: &Aabb) -> Option<LayersWithin> {
        None
    }

    /// Where the segment from `a` to `b` first enters an object, if it does so at a wall along z: where its layer ends or jumps, rather
    /// than rises or falls. Of faces at the wall, those between two depths count.
    fn wall_between(&self, _object: usize, _a: DVec3, _b: DVec3, _depths: [f64; 2]) -> Option<LayerWall> {
        None
    }

    /// The first part of a segment at which [`Surfaces::wall_between`] would find walls, whatever the depth of both ends; `None` where that is
    /// to be asked for each depth. Where a depth has nothing of the object in that part, it is to be asked too.
    fn way_between(&self, _object: usize, _a: DVec3, _b: DVec3) -> Option<LayerWay> {
        None
    }

    /// Whether spans tell where surfaces are exactly enough to measure how far they reach across an edge.
    fn are_exact(&self) -> bool {
        false
    }

    /// Whether an object may have an edge, where its surface turns abruptly, in a box.
    fn has_edge_in(&self, _object: usize, _bounds: &Aabb) -> bool {
        true
    }

    /// Where faces of an object meet at right angles, if they do.
    fn right_angles(&self, _object: usize) -> Option<RightAngles> {
        None
    }

    /// How an object is rounded, if it has no edges.
    fn roundness(&self, _object: usize) -> Option<Round> {
        None
    }

    /// Finds where answers may differ from those of an earlier frame, and has `before` remember this one instead.
    /// Returns whether that can be told; if not, all that is within the bounds of either frame is looked at again.
    fn find_changes(&self, before: &mut Earlier, _regions: &mut Regions) -> bool {
        before.forget();
        false
    }

    /// Whether these answers can be trusted at all; called once before any of them.
    ///
    /// # Errors
    /// Says what is no surface.
    fn validate(&self) -> Result<(), InvalidDepth> {
        Ok(())
    }
}
