//! What tells where the surfaces of a scene's objects are.

use crate::pipeline::PipelineError;
use crate::scene::{Geometry, Scene};
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::glam::{DMat3, DVec2, DVec3};
use capsense_core::occupancy::{DepthLayers, Surfaces};
use capsense_core::solids::Solids;
use capsense_render::fields::GpuFields;
use capsense_render::{Backend, DepthRenderer, RenderError};

/// One of four ways.
#[derive(Debug)]
pub(crate) enum Eye {
    Camera(Box<Camera>),
    Solids(Solids),
    /// A depth camera on the device that has the fields.
    Device(Box<DeviceEye>),
    /// Solids that the device that has the fields finds, and the same for who asks here.
    SolidsOnDevice(GpuFields, Solids),
}

/// A depth camera and what it saw last.
#[derive(Debug)]
pub(crate) struct Camera {
    renderer: DepthRenderer,
    back_fill: bool,
    pub(crate) layers: DepthLayers,
}

/// Objects that are found on a device, and what a camera here would see of them, for who asks.
#[derive(Debug)]
pub(crate) struct DeviceEye {
    gpu: GpuFields,
    description: String,
    shapes: Vec<Shape>,
    back_fill: bool,
    /// Made when it is asked for.
    renderer: Option<DepthRenderer>,
    layers: DepthLayers,
    poses: Vec<Pose>,
    /// Whether the layers are those of the poses.
    is_drawn: bool,
}

impl Eye {
    /// That of a scene, on the device of its fields if this finds objects.
    pub(crate) fn of(scene: &Scene, gpu: Option<&GpuFields>) -> Result<Self, RenderError> {
        let shapes: Vec<Shape> = scene.objects.iter().map(|object| object.shape.clone()).collect();
        let layers = DepthLayers::empty(scene.view, shapes.len());
        let back_fill = scene.back_fill;
        Ok(match (&scene.geometry, gpu.filter(|gpu| gpu.finds_objects())) {
            (Geometry::Solids(solids), None) => Self::Solids(solids.clone()),
            (Geometry::Solids(solids), Some(gpu)) => Self::SolidsOnDevice(gpu.clone(), solids.clone()),
            (Geometry::Camera, None) => {
                let renderer = DepthRenderer::new(Backend::Auto, scene.view, &shapes)?;
                Self::Camera(Box::new(Camera { renderer, back_fill, layers }))
            }
            (Geometry::Camera, Some(gpu)) => Self::Device(Box::new(DeviceEye {
                gpu: gpu.clone(),
                description: gpu.description(),
                shapes,
                back_fill,
                renderer: None,
                layers,
                poses: Vec::new(),
                is_drawn: true,
            })),
        })
    }

    /// Sees the objects where they are now.
    pub(crate) fn look(&mut self, poses: &[Pose]) -> Result<(), PipelineError> {
        match self {
            Self::Camera(camera) => {
                camera.renderer.render(poses, &mut camera.layers)?;
                if camera.back_fill {
                    camera.layers.back_fill();
                }
            }
            Self::Solids(solids) => solids.place(poses)?,
            Self::Device(device) => device.place(poses)?,
            Self::SolidsOnDevice(gpu, solids) => {
                solids.place(poses)?;
                gpu.place(0, poses)?;
            }
        }
        Ok(())
    }

    /// Whether the device that has the fields finds the objects.
    pub(crate) fn is_on_device(&self) -> bool {
        matches!(self, Self::Device(_) | Self::SolidsOnDevice(..))
    }

    /// What draws the objects; exact solids are not drawn.
    pub(crate) fn description(&self) -> &str {
        match self {
            Self::Camera(camera) => camera.renderer.description(),
            Self::Solids(_) | Self::SolidsOnDevice(..) => "exact solids",
            Self::Device(device) => &device.description,
        }
    }
}

impl DeviceEye {
    fn place(&mut self, poses: &[Pose]) -> Result<(), RenderError> {
        if self.gpu.place(0, poses)? {
            self.poses.clear();
            self.poses.extend_from_slice(poses);
            self.is_drawn = false;
        }
        Ok(())
    }

    /// What the camera sees, drawn here if that was not done since objects moved.
    pub(crate) fn look(&mut self) -> Result<&DepthLayers, RenderError> {
        if !self.is_drawn {
            let renderer = match &mut self.renderer {
                Some(renderer) => renderer,
                // Pixels at silhouettes are those of the device.
                empty => empty.insert(DepthRenderer::new(Backend::Gpu, *self.layers.view(), &self.shapes)?),
            };
            renderer.render(&self.poses, &mut self.layers)?;
            if self.back_fill {
                self.layers.back_fill();
            }
            self.is_drawn = true;
        }
        Ok(&self.layers)
    }

    /// What was drawn here last.
    pub(crate) fn layers(&self) -> &DepthLayers {
        &self.layers
    }
}

/// Whether a body in a camera's view falls between its rays, or may in another frame: whether no pixel shows it, or it is narrower
/// than one.
pub(crate) fn is_missed(layers: &DepthLayers, object: usize, shape: &Shape, pose: &Pose) -> bool {
    let own = extent(shape);
    let rotation = DMat3::from_quat(pose.rotation);
    let half = 0.5 * own.size();
    let half =
        rotation.x_axis.abs() * half.x + rotation.y_axis.abs() * half.y + rotation.z_axis.abs() * half.z;
    let centre = pose.sensor_from_object(0.5 * (own.min + own.max));
    let (bounds, view) = (Aabb { min: centre - half, max: centre + half }, layers.view());
    let size = view.domain.size();
    let pixel = DVec2::new(size.x / view.width as f64, size.y / view.height as f64);
    let is_shown = layers.bounds(object).intersects(&view.domain);
    bounds.intersects(&view.domain) && (!is_shown || bounds.size().truncate().cmplt(pixel).any())
}

/// A box in its own frame that a shape fits into.
fn extent(shape: &Shape) -> Aabb {
    let half = match shape {
        Shape::Box { size } => 0.5 * *size,
        Shape::Sphere { radius } => DVec3::splat(*radius),
        Shape::Capsule { radius, length } => DVec3::new(*radius, *radius, 0.5 * length + radius),
        Shape::Cylinder { radius, length } => DVec3::new(*radius, *radius, 0.5 * length),
        Shape::Mesh(mesh) => return Aabb::around(mesh.vertices().iter().copied()),
    };
    Aabb { min: -half, max: half }
}

#[cfg(test)]
mod tests {
    use super::*;
    use capsense_core::occupancy::OrthographicView;

    #[test]
    fn bodies_narrower_than_a_pixel_are_missed() {
        let domain = Aabb { min: DVec3::splat(-0.5), max: DVec3::splat(0.5) };
        let mut layers = DepthLayers::empty(OrthographicView { domain, width: 10, height: 20 }, 1);
        let rod = |radius| Shape::Cylinder { radius, length: 0.4 };
        let upright = Pose::at(DVec3::ZERO);
        assert!(is_missed(&layers, 0, &rod(0.2), &upright), "no pixel shows it");
        assert!(!is_missed(&layers, 0, &rod(0.2), &Pose::at(2.0 * DVec3::X)), "it is out of view");
        let (front, back) = layers.layer_mut(0);
        front.fill(-0.2);
        back.fill(0.2);
        assert!(!is_missed(&layers, 0, &rod(0.2), &upright));
        assert!(is_missed(&layers, 0, &rod(0.04), &upright));
    }
}
