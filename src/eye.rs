//! What tells where the surfaces of a scene's objects are.

use crate::pipeline::PipelineError;
use crate::scene::{Geometry, Scene};
use capsense_core::geometry::{Pose, Shape};
use capsense_core::occupancy::DepthLayers;
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
