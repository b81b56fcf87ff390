//! From a scene to its capacitances, frame after frame. The main path is [`Pipeline::frame`].

use crate::scene::{Scene, SceneError, SceneObject};
use capsense_core::capacitance::CapacitanceMatrix;
use capsense_core::geometry::{Pose, Shape};
use capsense_core::occupancy::DepthLayers;
use capsense_core::simulator::{Simulator, SimulatorError};
use capsense_core::solver::SolveReport;
use capsense_render::{Backend, DepthRenderer, RenderError};
use serde::Serialize;
use std::time::{Duration, Instant};

/// Why a scene cannot be simulated.
#[derive(Debug, thiserror::Error)]
pub enum PipelineError {
    /// The scene is at fault.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The objects cannot be drawn.
    #[error("cannot draw the scene: {0}")]
    Render(#[from] RenderError),
    /// The field cannot be computed.
    #[error(transparent)]
    Simulator(#[from] SimulatorError),
}

/// How long the parts of a frame took, in milliseconds of wall-clock time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Milliseconds {
    /// Drawing the objects: where are they?
    pub geometry: f64,
    /// Occupancy and stiffness: what did they change?
    pub update: f64,
    /// Field and capacitances.
    pub solve: f64,
    /// All of it.
    pub total: f64,
}

/// What was measured in one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Number of the frame, from zero.
    pub index: usize,
    /// Scene time in seconds.
    pub time_s: f64,
    /// The Maxwell matrix over the electrodes, objects already terminated.
    pub capacitance: CapacitanceMatrix,
    /// Number of mesh edges that objects changed since the frame before.
    pub changed_edges: usize,
    /// What the solver reached.
    pub solve: SolveReport,
    /// Where the time went.
    pub milliseconds: Milliseconds,
}

/// A scene made ready to run.
#[derive(Debug)]
pub struct Pipeline {
    objects: Vec<SceneObject>,
    frame_rate: f64,
    back_fill: bool,
    renderer: DepthRenderer,
    poses: Vec<Pose>,
    layers: DepthLayers,
    simulator: Simulator,
}

impl Pipeline {
    /// Meshes the sensor, opens the renderer and solves the scene without objects.
    ///
    /// # Errors
    /// When the mesh cannot resolve the sensor, the objects cannot be drawn, or the solver fails.
    pub fn new(scene: &Scene) -> Result<Self, PipelineError> {
        let materials = scene.objects.iter().map(|object| object.material).collect();
        let simulator =
            Simulator::with_interface(scene.build_sensor()?, materials, scene.solver, scene.interface)?;
        let shapes: Vec<Shape> = scene.objects.iter().map(|object| object.shape.clone()).collect();
        Ok(Self {
            renderer: DepthRenderer::new(Backend::Auto, scene.view, &shapes)?,
            poses: Vec::with_capacity(scene.objects.len()),
            layers: DepthLayers::empty(scene.view, scene.objects.len()),
            objects: scene.objects.clone(),
            frame_rate: scene.frame_rate,
            back_fill: scene.back_fill,
            simulator,
        })
    }

    /// Computes one frame: the objects move, the camera sees them, the mesh feels it, the field settles.
    ///
    /// The field of the frame computed before is the solver's first guess.
    ///
    /// # Errors
    /// When the renderer or the solver fails.
    pub fn frame(&mut self, index: usize) -> Result<Frame, PipelineError> {
        let time_s = index as f64 / self.frame_rate;
        let started = Instant::now();
        self.poses.clear();
        self.poses.extend(self.objects.iter().map(|object| object.motion.pose_at(time_s)));
        self.renderer.render(&self.poses, &mut self.layers)?;
        if self.back_fill {
            self.layers.back_fill();
        }
        let seen = Instant::now();
        let changed_edges = self.simulator.update(&self.layers)?;
        let updated = Instant::now();
        let solve = self.simulator.solve()?;
        let solved = Instant::now();
        Ok(Frame {
            index,
            time_s,
            capacitance: self.simulator.capacitance().clone(),
            changed_edges,
            solve,
            milliseconds: Milliseconds {
                geometry: milliseconds(seen - started),
                update: milliseconds(updated - seen),
                solve: milliseconds(solved - updated),
                total: milliseconds(solved - started),
            },
        })
    }

    /// The simulator in the state of the last frame.
    pub fn simulator(&self) -> &Simulator {
        &self.simulator
    }

    /// What the camera saw in the last frame.
    pub fn layers(&self) -> &DepthLayers {
        &self.layers
    }

    /// What draws the objects.
    pub fn renderer(&self) -> &str {
        self.renderer.description()
    }
}

fn milliseconds(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1e3
}
