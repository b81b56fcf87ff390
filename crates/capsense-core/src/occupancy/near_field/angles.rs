//! The right angles at which faces of boxes and cylinders meet, at a pose: what surfaces tell of their edges once, so that
//! it need not be asked for at every node.

use super::RightAngle;
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
    /// Its pose, a rotation and a translation.
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

    #[inline(always)]
    fn nearest_of_box(&self, half: DVec3, local: DVec3) -> RightAngle {
        let outside = local.abs() - half;
        let squared = outside * outside;
        let beyond = outside.max(DVec3::ZERO);
        // For edges along each axis.
        let distances = DVec3::splat(squared.element_sum()) - squared + beyond * beyond;
        let corner = half.copysign(local);
        let turn = &self.sensor_from_object.matrix3;
        let side = DVec3::ONE.copysign(local);
        let nearest = distances.min_element();
        let second = distances.element_sum() - nearest - distances.max_element();
        let (place, inside, across, normals) = if distances.x <= distances.y && distances.x <= distances.z {
            let place = DVec3::new(local.x, corner.y, corner.z);
            (place, -outside.x, half.y.min(half.z), [turn.y_axis * side.y, turn.z_axis * side.z])
        } else if distances.y <= distances.z {
            let place = DVec3::new(corner.x, local.y, corner.z);
            (place, -outside.y, half.z.min(half.x), [turn.z_axis * side.z, turn.x_axis * side.x])
        } else {
            let place = DVec3::new(corner.x, corner.y, local.z);
            (place, -outside.z, half.x.min(half.y), [turn.x_axis * side.x, turn.y_axis * side.y])
        };
        RightAngle {
            place: self.sensor_from_object.transform_point3(place),
            normals,
            inside: if inside > 0.0 { inside.min((second - nearest) / inside) } else { inside },
            radius: f64::INFINITY,
            thickness: 2.0 * across,
            breadth: 2.0 * (half.element_sum() - half.min_element() - half.max_element()),
        }
    }

    fn rim(&self, radius: f64, half_length: f64, local: DVec3) -> Option<RightAngle> {
        let outwards = local.truncate().try_normalize()?;
        let turn = &self.sensor_from_object.matrix3;
        let place = (radius * outwards).extend(half_length.copysign(local.z));
        Some(RightAngle {
            place: self.sensor_from_object.transform_point3(place),
            normals: [*turn * outwards.extend(0.0), *turn * (DVec3::Z * 1.0_f64.copysign(local.z))],
            inside: f64::INFINITY,
            radius,
            thickness: 2.0 * radius.min(half_length),
            breadth: 2.0 * radius,
        })
    }
}
