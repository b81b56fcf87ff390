//! What all methods are measured on: the built-in scene, and a way of its bar past the electrodes and towards them.
//!
//! The bar moves 1 mm a frame, 20 mm at a time. It is turned about the sensor's axis: parallel to the camera's pixels, which are 8 mm
//! wide, it would be seen in another place in every eighth frame only, and frames in between would cost nothing.

use super::EvidenceError;
use super::published::SPECTRAL;
use crate::scene::{Scene, SceneSensor};
use capsense_core::geometry::{Pose, Shape};
use capsense_core::glam::{DQuat, DVec3};
use capsense_core::material::Material;
use capsense_core::sensor::SensorDesign;
use std::ops::Range;

/// Metres that the bar moves from frame to frame.
pub const STEP: f64 = 1e-3;

/// By how much the bar is turned about the sensor's axis, in radians.
pub const YAW: f64 = 0.35;

/// Columns and rows of the depth camera.
pub const PIXELS: usize = 64;

/// Frames of one segment of the way.
pub const FRAMES: usize = 21;

/// The frames of a segment in which C is compared with the reference.
pub const COMPARED: [usize; 3] = [6, 13, 20];

/// One part of the bar's way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Gap between the electrodes' plane and the bar in the first frame, metres.
    pub gap: f64,
    /// Place of the bar's centre along y in the first frame, metres.
    pub aside: f64,
    /// The way from frame to frame, metres.
    pub step: DVec3,
}

const fn sideways(gap: f64, aside: f64) -> Segment {
    Segment { gap, aside, step: DVec3::new(0.0, STEP, 0.0) }
}

const fn towards(gap: f64) -> Segment {
    Segment { gap, aside: 0.0, step: DVec3::new(0.0, 0.0, -STEP) }
}

/// The whole way: sideways at four heights, and towards the electrodes from four heights down by 20 mm.
pub const SEGMENTS: [Segment; 8] = [
    sideways(0.02, -0.06),
    sideways(0.05, -0.01),
    sideways(0.1, 0.02),
    sideways(0.2, 0.04),
    towards(0.2),
    towards(0.12),
    towards(0.07),
    towards(0.04),
];

/// How many frames of each segment are run: all of them, or few where they take long.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Patience {
    /// All frames, three of which are compared.
    All,
    /// Seven frames, one of which is compared.
    Some,
    /// Two frames, one of which is compared.
    Little,
}

impl Patience {
    /// The frames of a segment that are run; the bar jumps to the first.
    pub fn frames(self) -> Range<usize> {
        match self {
            Self::All => 0..FRAMES,
            Self::Some => 0..COMPARED[0] + 1,
            Self::Little => COMPARED[0] - 1..COMPARED[0] + 1,
        }
    }
}

/// The sensor, the bar and its way.
#[derive(Clone, Debug)]
pub struct Stage {
    /// The built-in scene, whose mesh and methods do not count.
    pub scene: Scene,
    /// Its sensor.
    pub design: SensorDesign,
    /// Where its bar goes.
    pub segments: Vec<Segment>,
    thickness: f64,
}

impl Stage {
    /// The built-in scene with the bar on some way.
    ///
    /// # Errors
    /// When the built-in scene is not one box near electrodes on a generated mesh.
    pub fn new(segments: &[Segment]) -> Result<Self, EvidenceError> {
        let mut scene = Scene::built_in()?;
        (scene.view.width, scene.view.height) = (PIXELS, PIXELS);
        let (SceneSensor::Generated { design, .. }, [object]) = (&scene.sensor, scene.objects.as_slice())
        else {
            return Err(EvidenceError::Stage);
        };
        let Shape::Box { size } = object.shape else { return Err(EvidenceError::Stage) };
        Ok(Self { design: design.clone(), segments: segments.to_vec(), thickness: size.z, scene })
    }

    /// The bar's shape.
    pub fn shape(&self) -> &Shape {
        &self.scene.objects[0].shape
    }

    /// What the bar is made of.
    pub fn material(&self) -> Material {
        self.scene.objects[0].material
    }

    /// Where the bar is in a frame of a segment.
    pub fn pose(&self, segment: usize, frame: usize) -> Pose {
        let Segment { gap, aside, step } = self.segments[segment];
        let start = DVec3::new(0.0, aside, gap + 0.5 * self.thickness);
        Pose { translation: start + frame as f64 * step, rotation: DQuat::from_rotation_z(YAW) }
    }

    /// All poses in which C is compared, segment by segment.
    pub fn compared(&self) -> Vec<Pose> {
        let segments = 0..self.segments.len();
        segments.flat_map(|segment| COMPARED.map(|frame| self.pose(segment, frame))).collect()
    }

    /// The poses of which others have published C.
    pub fn published(&self) -> Vec<Pose> {
        SPECTRAL.iter().map(|change| change.pose(self.thickness)).collect()
    }
}

/// A straight bar with its centre at a place along y and at a height, metres.
pub(super) fn flat(y: f64, z: f64) -> Pose {
    Pose::at(DVec3::new(0.0, y, z))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn the_bar_moves_a_millimetre_a_frame_and_never_touches() {
        let stage = Stage::new(&SEGMENTS).unwrap();
        for segment in 0..SEGMENTS.len() {
            for frame in 0..FRAMES {
                let pose = stage.pose(segment, frame);
                assert!(pose.translation.z - 0.01 >= 0.02 - 1e-12, "{segment} {frame}");
                if frame > 0 {
                    let moved = pose.translation.distance(stage.pose(segment, frame - 1).translation);
                    assert!((moved - STEP).abs() < 1e-15, "{segment} {frame}: {moved}");
                }
            }
        }
        assert_eq!(stage.compared().len(), COMPARED.len() * SEGMENTS.len());
    }

    #[test]
    fn each_patience_meets_compared_frames_and_moves() {
        for patience in [Patience::All, Patience::Some, Patience::Little] {
            let frames = patience.frames();
            assert!(frames.len() >= 2 && frames.end <= FRAMES);
            assert!(COMPARED.iter().any(|frame| frames.contains(frame) && *frame > frames.start));
        }
    }
}
