//! A box at its pose: which part of a segment it holds, and where its edges are.
//!
//! What is asked of boxes at most edges and nodes, without a call through [`Surfaces`](super::super::Surfaces).

use super::super::{Frame, Span};
use super::angles::{RightAngled, RightAngles};
use super::row::{larger, smaller};
use crate::geometry::Aabb;
use glam::{DAffine3, DVec3, Vec3Swizzles};

/// The part of a segment from `a` to `b`, in the frame of a box about the origin, that is in the box, given by half its edge
/// lengths. Ends in the box are ends of the part, whatever rounding does: differences and quotients are monotonic.
#[inline(always)]
pub(crate) fn span_in_box(half: DVec3, a: DVec3, b: DVec3) -> Option<Span> {
    // Both before one face or in it: otherwise no zero is divided by zero below.
    if (a.min(b).cmpge(half) | a.max(b).cmple(-half)).any() {
        return None;
    }
    let along = b - a;
    let leaving = half.copysign(along);
    let (first, last) = ((-leaving - a) / along, (leaving - a) / along);
    let enter = larger(larger(larger(first.x, first.y), first.z), 0.0);
    let exit = smaller(smaller(smaller(last.x, last.y), last.z), 1.0);
    let is_met = enter < exit || [a, b].into_iter().any(|end| end.abs().cmplt(half).all());
    is_met.then(|| Span { enter: smaller(enter, 1.0), exit: larger(exit, smaller(enter, 1.0)) })
}

impl RightAngles {
    /// The frame of the solid.
    #[inline]
    pub(in super::super) fn frame(&self) -> Frame {
        Frame { origin: self.sensor_from_object.translation, object_from_sensor: self.object_from_sensor }
    }

    /// The part of a segment of the sensor frame that is in a box of such half edge lengths at this pose.
    #[inline(always)]
    pub(in super::super) fn span_in_box(&self, half: DVec3, a: DVec3, b: DVec3) -> Option<Span> {
        let local = |point: DVec3| self.object_from_sensor * (point - self.sensor_from_object.translation);
        span_in_box(half, local(a), local(b))
    }

    /// Whether an edge of the solid is in a box of the sensor frame; `None` where its edges are round.
    pub fn has_straight_edge_in(&self, bounds: &Aabb) -> Option<bool> {
        match self.solid {
            RightAngled::Box(half) => Some(self.has_edge_of_box_in(half, bounds)),
            RightAngled::Cylinder { .. } => None,
        }
    }

    #[inline(always)]
    pub(in super::super) fn has_edge_of_box_in(&self, size: DVec3, bounds: &Aabb) -> bool {
        let (middle, half) = (0.5 * (bounds.min + bounds.max), 0.5 * bounds.size());
        let turn = &self.object_from_sensor;
        let centre = *turn * (middle - self.sensor_from_object.translation);
        let reach = turn.x_axis.abs() * half.x + turn.y_axis.abs() * half.y + turn.z_axis.abs() * half.z;
        // At which faces the box is, on either side.
        let high = (centre - size).abs().cmple(reach).bitmask();
        let low = (centre + size).abs().cmple(reach).bitmask();
        let faces = low | high;
        if faces & (faces - u32::from(faces != 0)) == 0 || !(centre.abs() - size).cmple(reach).all() {
            return false;
        }
        if low & high == 0 && faces != 7 {
            // That of the only two faces: the most frequent case.
            return self.is_edge_of_box_in(
                size,
                (!faces & 7).trailing_zeros() as usize,
                high,
                [middle, half],
            );
        }
        let sides = [low, high];
        for axis in 0..3 {
            let [first, second] = [(axis + 1) % 3, (axis + 2) % 3];
            for corner in 0..4 {
                let [at_first, at_second] = [corner & 1, corner >> 1];
                if sides[at_first] >> first & sides[at_second] >> second & 1 == 0 {
                    continue;
                }
                let at_high = (at_first << first | at_second << second) as u32;
                if self.is_edge_of_box_in(size, axis, at_high, [middle, half]) {
                    return true;
                }
            }
        }
        false
    }

    /// Whether the edge of the solid along an axis that is at the high ends of some of the other axes is in a box, given by its
    /// middle and half its size.
    #[inline(always)]
    fn is_edge_of_box_in(&self, size: DVec3, axis: usize, at_high: u32, [middle, half]: [DVec3; 2]) -> bool {
        let sign = |axis: u32| if at_high >> axis & 1 == 0 { -1.0 } else { 1.0 };
        let mut place = size * DVec3::new(sign(0), sign(1), sign(2));
        place[axis] = 0.0;
        let DAffine3 { matrix3: turned, translation } = &self.sensor_from_object;
        is_segment_in(*turned * place + *translation - middle, size[axis] * turned.col(axis), half)
    }
}

/// Whether a segment, given by its middle and the way from there to its end, meets a box of some half size about the origin:
/// neither one of the box's axes nor one across the segment parts them.
#[inline(always)]
fn is_segment_in(middle: DVec3, way: DVec3, half: DVec3) -> bool {
    let reach = way.abs();
    let across = half.zxy() * reach.yzx() + half.yzx() * reach.zxy();
    middle.abs().cmple(half + reach).all() && middle.cross(way).abs().cmple(across).all()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DAffine3, DQuat};

    #[test]
    fn parts_of_segments_start_and_end_where_ends_are_inside() {
        let half = DVec3::new(1.0, 2.0, 3.0);
        let span = |a: [f64; 3], b: [f64; 3]| {
            let span = span_in_box(half, DVec3::from_array(a), DVec3::from_array(b));
            span.map(|Span { enter, exit }| [enter, exit])
        };
        assert_eq!(span([-2.0, 0.5, 0.0], [2.0, 0.5, 0.0]), Some([0.25, 0.75]));
        assert_eq!(span([0.0, -0.0, 0.0], [0.0, 0.0, 6.0]), Some([0.0, 0.5]));
        assert_eq!(span([-0.5, 0.0, 0.0], [0.5, 0.0, 0.0]), Some([0.0, 1.0]));
        // Before a face, in it, past a corner, and short of a face.
        assert_eq!(span([1.5, 0.0, 0.0], [1.5, 1.0, 0.0]), None);
        assert_eq!(span([1.0, 0.0, 0.0], [1.0, 1.0, 0.0]), None);
        assert_eq!(span([0.0, 3.5, 0.0], [2.0, 1.5, 0.0]), None);
        assert_eq!(span([-3.0, 0.0, 0.0], [-1.5, 0.0, 0.0]), None);
        // An end that is inside by less than rounding makes of differences.
        let inside = 1.0 - f64::EPSILON;
        for far in [1e3, 7.3, 1.0 + 1e-13] {
            assert_eq!(span([far, 0.1, 0.2], [inside, 0.1, 0.3]).map(|[_, exit]| exit), Some(1.0));
            assert_eq!(span([-inside, 0.1, 0.2], [-far, 0.1, 0.3]).map(|[enter, _]| enter), Some(0.0));
        }
    }

    #[test]
    fn edges_are_in_boxes_that_hold_some_of_their_places() {
        let pose = DAffine3::from_rotation_translation(
            DQuat::from_rotation_z(0.4) * DQuat::from_rotation_x(0.3),
            DVec3::new(0.1, 0.2, -0.1),
        );
        for sensor_from_object in [DAffine3::IDENTITY, pose] {
            let half = DVec3::new(0.5, 0.25, 0.125);
            let angles = RightAngles {
                solid: RightAngled::Box(half),
                sensor_from_object,
                object_from_sensor: sensor_from_object.matrix3.transpose(),
            };
            let places: Vec<DVec3> = (0..3)
                .flat_map(|axis| {
                    (0..4).flat_map(move |corner| (0..=200).map(move |part| (axis, corner, part)))
                })
                .map(|(axis, corner, part)| {
                    let mut place = half;
                    place[axis] *= f64::from(part) / 100.0 - 1.0;
                    place[(axis + 1) % 3] *= if corner % 2 == 0 { 1.0 } else { -1.0 };
                    place[(axis + 2) % 3] *= if corner < 2 { 1.0 } else { -1.0 };
                    sensor_from_object.transform_point3(place)
                })
                .collect();
            let (mut met, mut free) = (0, 0);
            for number in 0..4000 {
                let at = |count: i32, factor: i32| f64::from(number * factor % count) / f64::from(count);
                let centre = 1.4 * DVec3::new(at(97, 31) - 0.5, at(89, 17) - 0.5, at(83, 7) - 0.5);
                let size = 0.02 + 0.2 * DVec3::new(at(7, 3), at(11, 5), at(13, 6));
                let bounds = Aabb { min: centre - size, max: centre + size };
                let is_in = angles.has_edge_of_box_in(half, &bounds);
                let more = Aabb { min: bounds.min - 0.005, max: bounds.max + 0.005 };
                assert!(is_in || !places.iter().any(|&place| bounds.contains(place)), "{number}");
                assert!(!is_in || places.iter().any(|&place| more.contains(place)), "{number}");
                *(if is_in { &mut met } else { &mut free }) += 1;
            }
            assert!(met > 300 && free > 300, "{met} {free}");
        }
    }
}
