//! What the worker computed last, as far as it is drawn. Cheap to clone.

use capsense::{Pipeline, Scene};
use capsense_core::geometry::Pose;
use glam::{DQuat, DVec3};

/// Where a body is asked to stand.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyPose {
    /// What it is called.
    pub name: String,
    /// Its origin in the sensor frame, metres.
    pub position: DVec3,
    /// Its orientation, of unit length.
    pub rotation: DQuat,
}

impl BodyPose {
    /// A body at a pose.
    pub fn new(name: impl Into<String>, pose: &Pose) -> Self {
        Self { name: name.into(), position: pose.translation, rotation: pose.rotation }
    }

    /// Its pose.
    pub fn pose(&self) -> Pose {
        Pose { translation: self.position, rotation: self.rotation }
    }
}

/// What is drawn of one computed frame.
#[derive(Clone, Debug)]
pub struct Frame3d {}

/// Makes snapshots of a pipeline; what never changes is taken from it once.
#[derive(Debug)]
pub struct Frame3dBuilder {}

impl Frame3dBuilder {
    /// Takes what never changes in a scene: mesh, sensor and the surfaces of bodies.
    pub fn new(_scene: &Scene, _pipeline: &Pipeline) -> Self {
        Self {}
    }

    /// What the pipeline computed last.
    pub fn snapshot(&mut self, _pipeline: &Pipeline) -> Frame3d {
        Frame3d {}
    }
}
