//! The right angles at which faces of boxes and cylinders meet, at a pose: what surfaces tell of their edges once, so that
//! it need not be asked for at every node.

use super::cells::either;
use super::row::{larger, smaller};
use super::{RightAngle, Round};
use glam::{DAffine3, DMat3, DVec3};

/// A solid about the origin, faces of which meet at right angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RightAngled {
    /// A box, by half its edge lengths in metres.
    Box(DVec3),
    /// A cylinder along z with flat ends, in metres.
    Cylinder {
        /// Its radius.
        radius: f64,
        /// Half its length.
        half_length: f64,
    },
}

/// The right angles of a solid at a pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RightAngles {
    /// The solid in its own frame.
    pub solid: RightAngled,
    /// Where its frame is in that of the sensor: a rotation and a translation.
    pub sensor_from_object: DAffine3,
    /// The inverse of the rotation.
    pub object_from_sensor: DMat3,
}

impl RightAngles {
    /// The edge that is nearest to a point of the sensor frame; `None` where that is all of a rim.
    #[inline(always)]
    pub fn nearest(&self, point: DVec3) -> Option<RightAngle> {
        let local = self.object_from_sensor * (point - self.sensor_from_object.translation);
        match self.solid {
            RightAngled::Box(half) => Some(self.nearest_of_box(half, local)),
            RightAngled::Cylinder { radius, half_length } => self.rim(radius, half_length, local),
        }
    }

    /// The side of a cylinder, from end to end.
    #[inline]
    pub(super) fn side(&self) -> Option<Round> {
        let RightAngled::Cylinder { radius, half_length } = self.solid else { return None };
        let DAffine3 { matrix3: turn, translation: centre } = self.sensor_from_object;
        Some(Round { centre, half: half_length * turn.z_axis, radius })
    }

    #[inline(always)]
    fn nearest_of_box(&self, half: DVec3, local: DVec3) -> RightAngle {
        let [outside, squared] = distances_of_box(half, local);
        let axis = axis_of(squared);
        self.of_box(half, local, axis, inside_of(-outside[axis], squared.to_array()))
    }

    /// Of the four edges of a box along an axis, that which is nearest to a point of the box's frame; the place on it is so far
    /// from its end.
    #[inline(always)]
    pub(super) fn of_box(&self, half: DVec3, local: DVec3, axis: usize, inside: f64) -> RightAngle {
        let turn = &self.sensor_from_object.matrix3;
        let side = DVec3::ONE.copysign(local);
        let mut place = half.copysign(local);
        let (thickness, normals) = match axis {
            0 => {
                place.x = local.x;
                ([half.y, half.z], [turn.y_axis * side.y, turn.z_axis * side.z])
            }
            1 => {
                place.y = local.y;
                ([half.z, half.x], [turn.z_axis * side.z, turn.x_axis * side.x])
            }
            _ => {
                place.z = local.z;
                ([half.x, half.y], [turn.x_axis * side.x, turn.y_axis * side.y])
            }
        };
        RightAngle {
            place: self.sensor_from_object.transform_point3(place),
            normals,
            inside,
            radius: f64::INFINITY,
            thickness: thickness.map(|half| 2.0 * half),
            breadth: 2.0 * (half.element_sum() - half.min_element() - half.max_element()),
        }
    }

    #[inline]
    fn rim(&self, radius: f64, half_length: f64, local: DVec3) -> Option<RightAngle> {
        let outwards = local.truncate().try_normalize()?;
        let turn = &self.sensor_from_object.matrix3;
        let place = (radius * outwards).extend(half_length.copysign(local.z));
        Some(RightAngle {
            place: self.sensor_from_object.transform_point3(place),
            normals: [*turn * outwards.extend(0.0), *turn * (DVec3::Z * 1.0_f64.copysign(local.z))],
            inside: f64::INFINITY,
            radius,
            thickness: [2.0 * radius, 2.0 * half_length],
            breadth: 2.0 * radius,
        })
    }
}

/// The axis along which the nearest edge is.
#[inline(always)]
fn axis_of(squared: DVec3) -> usize {
    if squared.x <= squared.y && squared.x <= squared.z {
        0
    } else if squared.y <= squared.z {
        1
    } else {
        2
    }
}

/// How far a place on the nearest edge is from where another is the nearest, which is at its ends for places beyond all faces, and
/// on bisectors of edges for others: `before_end` is how far it is from the edge's end, `squared` are the squares of the distances
/// from the nearest edges along each axis.
#[inline(always)]
fn inside_of(before_end: f64, squared: [f64; 3]) -> f64 {
    let [x, y, z] = squared;
    let [low, high] = [smaller(x, y), larger(x, y)];
    let nearest = smaller(low, z);
    let second = larger(low, smaller(high, z));
    let to_bisector = (second - nearest) / before_end;
    either(before_end > 0.0, smaller(before_end, to_bisector), before_end)
}

/// How far a point of a box's frame is before its faces, along each axis, and the squares of its distances from the nearest
/// edges along each.
#[inline(always)]
fn distances_of_box(half: DVec3, local: DVec3) -> [DVec3; 2] {
    let outside = local.abs() - half;
    let squared = outside * outside;
    let beyond = outside.max(DVec3::ZERO);
    [outside, DVec3::splat(squared.element_sum()) - squared + beyond * beyond]
}
