//! Object surfaces ready for drawing, and where they lie in a frame.

use crate::error::RenderError;
use crate::tessellate::tessellate;
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::occupancy::OrthographicView;
use glam::{DMat3, DVec3, Vec3};

/// The surface of one object. Positions are relative to the middle of its bounding box, so that single precision
/// serves meshes that lie far from their origin too.
#[derive(Clone, Debug)]
pub struct SceneObject {
    centre: DVec3,
    half_size: DVec3,
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

impl SceneObject {
    /// Middle of the bounding box in the object's frame, metres.
    pub fn centre(&self) -> DVec3 {
        self.centre
    }

    /// Vertices relative to [`centre`](Self::centre), metres.
    pub fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    /// Indices of the corners of each triangle.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// A box in the sensor frame that holds the object at a pose.
    pub fn bounds(&self, pose: &Pose) -> Aabb {
        let rotation = DMat3::from_quat(pose.rotation);
        let centre = pose.sensor_from_object(self.centre);
        let half = rotation.x_axis.abs() * self.half_size.x
            + rotation.y_axis.abs() * self.half_size.y
            + rotation.z_axis.abs() * self.half_size.z;
        Aabb { min: centre - half, max: centre + half }
    }
}

/// The surfaces of all objects, tessellated once.
#[derive(Clone, Debug)]
pub struct RenderScene {
    objects: Vec<SceneObject>,
}

impl RenderScene {
    /// Tessellates the objects' shapes.
    ///
    /// # Errors
    /// [`RenderError::Shape`] when a shape has an impossible length.
    pub fn new(shapes: &[Shape]) -> Result<Self, RenderError> {
        let objects = shapes.iter().enumerate().map(|(object, shape)| {
            let mesh = tessellate(shape).map_err(|source| RenderError::Shape { object, source })?;
            let bounds = Aabb::around(mesh.vertices().iter().copied());
            let centre = 0.5 * bounds.min + 0.5 * bounds.max;
            Ok(SceneObject {
                centre,
                half_size: 0.5 * bounds.size(),
                positions: mesh.vertices().iter().map(|v| (v - centre).as_vec3()).collect(),
                triangles: mesh.triangles().to_vec(),
            })
        });
        Ok(Self { objects: objects.collect::<Result<_, _>>()? })
    }

    /// The objects in their order.
    pub fn objects(&self) -> &[SceneObject] {
        &self.objects
    }

    /// Checks that there is one valid pose per object.
    pub(crate) fn check_poses(&self, poses: &[Pose]) -> Result<(), RenderError> {
        check_poses(poses, self.objects.len())
    }
}

/// Checks that there is one valid pose for each of so many objects.
pub(crate) fn check_poses(poses: &[Pose], objects: usize) -> Result<(), RenderError> {
    if poses.len() != objects {
        return Err(RenderError::PoseCount { poses: poses.len(), objects });
    }
    match poses.iter().position(|pose| !pose.is_valid()) {
        Some(object) => Err(RenderError::InvalidPose { object }),
        None => Ok(()),
    }
}

/// Checks that a view has pixels and a domain of positive, finite size.
pub(crate) fn check_view(view: &OrthographicView) -> Result<(), RenderError> {
    let size = view.domain.size();
    let finite = view.domain.min.is_finite() && view.domain.max.is_finite();
    if view.width > 0 && view.height > 0 && finite && size.min_element() > 0.0 {
        Ok(())
    } else {
        Err(RenderError::InvalidView { width: view.width, height: view.height, size: size.to_array() })
    }
}

/// Cuts one object's layers to the domain's range of z: a pixel whose object lies entirely outside of it is a miss.
pub(crate) fn clamp_pixel(front: &mut f32, back: &mut f32, near: f32, far: f32) {
    if *back < near || *front > far {
        *front = f32::INFINITY;
        *back = f32::NEG_INFINITY;
    } else {
        *front = front.max(near);
        *back = back.min(far);
    }
}
