//! From a scene to its capacitances, frame after frame. The main path is [`Pipeline::frame`].

use crate::device::{self, Device, Graphics, Placed};
use crate::eye::{Eye, is_missed};
use crate::scene::{Scene, SceneError, SceneObject};
use capsense_core::capacitance::CapacitanceMatrix;
use capsense_core::geometry::Pose;
use capsense_core::occupancy::DepthLayers;
use capsense_core::sensor::{Sensor, SensorError};
use capsense_core::simulator::{Simulator, SimulatorError};
use capsense_core::solids::SolidError;
use capsense_core::solver::SolveReport;
use capsense_render::RenderError;
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
    /// The objects cannot stand where they should.
    #[error(transparent)]
    Solid(#[from] SolidError),
    /// The field cannot be computed.
    #[error(transparent)]
    Simulator(#[from] SimulatorError),
    /// There is no graphics adapter to compute fields on, or it does not suffice.
    #[error("cannot compute fields on a graphics device: {0}")]
    Device(RenderError),
    /// The mesh cannot be halved to tell errors.
    #[error("cannot halve the mesh to tell errors: {0}")]
    Halved(SensorError),
}

/// How long the parts of a frame took, in milliseconds of wall-clock time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Milliseconds {
    /// Placing the objects and, by the camera, drawing them: where are they?
    pub geometry: f64,
    /// Occupancy and stiffness: what did they change?
    pub update: f64,
    /// Field and capacitances.
    pub solve: f64,
    /// All of it.
    pub total: f64,
}

/// So many frames tell which device is faster.
const FRAMES_TO_COMPARE: usize = 9;

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
    poses: Vec<Pose>,
    eye: Eye,
    simulator: Simulator,
    /// What the fields are on, if not on the processor.
    gpu: Option<Graphics>,
}

impl Pipeline {
    /// Meshes the sensor, opens the camera's renderer if there is a camera, and solves the scene without objects.
    ///
    /// # Errors
    /// When the mesh cannot resolve the sensor, the objects cannot be drawn, or the solver fails.
    pub fn new(scene: &Scene) -> Result<Self, PipelineError> {
        Self::with_sensor(scene, scene.build_sensor()?)
    }

    /// The same on another mesh than the scene asks for, or on one that was chosen before.
    ///
    /// # Errors
    /// When the objects cannot be drawn, or the solver fails.
    pub fn with_sensor(scene: &Scene, sensor: Sensor) -> Result<Self, PipelineError> {
        match scene.device {
            Device::Cpu => Self::of(scene, device::on_cpu(scene, sensor)?),
            Device::Gpu => Self::of(scene, device::on_gpu(scene, sensor, true)?),
            Device::Auto => {
                let cpu = Self::of(scene, device::on_cpu(scene, sensor.clone())?)?;
                // Whatever keeps a device from it, there is a processor.
                match device::on_gpu(scene, sensor, false).and_then(|gpu| Self::of(scene, gpu)) {
                    Ok(gpu) => Self::faster(scene, cpu, gpu),
                    Err(_) => Ok(cpu),
                }
            }
        }
    }

    /// The one of two that takes less time for the scene's first frames, as it was before them.
    fn faster(scene: &Scene, mut cpu: Self, mut gpu: Self) -> Result<Self, PipelineError> {
        let on_cpu = cpu.time_of_first_frames(scene.frames)?;
        let is_faster = gpu.time_of_first_frames(scene.frames).is_ok_and(|on_gpu| on_gpu < on_cpu);
        let sensor = cpu.simulator.sensor().clone();
        drop(gpu);
        if is_faster && let Ok(again) = device::on_gpu(scene, sensor.clone(), false) {
            return Self::of(scene, again);
        }
        Self::of(scene, device::on_cpu(scene, sensor)?)
    }

    /// The median time of the first frames of so many, in milliseconds.
    fn time_of_first_frames(&mut self, frames: usize) -> Result<f64, PipelineError> {
        let mut times = Vec::with_capacity(FRAMES_TO_COMPARE);
        for index in 0..FRAMES_TO_COMPARE.min(frames) {
            // Where objects are found by a graphics adapter, they are drawn while it solves.
            times.push(self.frame(index)?.milliseconds.total);
        }
        times.sort_by(f64::total_cmp);
        Ok(times.get(times.len() / 2).copied().unwrap_or(0.0))
    }

    fn of(scene: &Scene, placed: Placed) -> Result<Self, PipelineError> {
        let Placed { simulator, gpu } = placed;
        let eye = Eye::of(scene, gpu.as_ref().and_then(Graphics::lattice))?;
        let poses = Vec::with_capacity(scene.objects.len());
        Ok(Self { objects: scene.objects.clone(), frame_rate: scene.frame_rate, poses, eye, simulator, gpu })
    }

    /// Computes one frame: the objects move, they are seen, the mesh feels it, the field settles.
    ///
    /// The field of the frame computed before is the solver's first guess.
    ///
    /// # Errors
    /// When the renderer or the solver fails.
    pub fn frame(&mut self, index: usize) -> Result<Frame, PipelineError> {
        self.frame_holding(index, &[])
    }

    /// The same with some objects held where the scene does not have them: `held[k]` is the pose of object k in place of
    /// that of its motion. Objects beyond the end of the list are not held.
    ///
    /// # Errors
    /// As [`Pipeline::frame`], and when a pose is not valid.
    pub fn frame_holding(&mut self, index: usize, held: &[Option<Pose>]) -> Result<Frame, PipelineError> {
        let time_s = index as f64 / self.frame_rate;
        let started = Instant::now();
        self.poses.clear();
        let held = held.iter().copied().chain(std::iter::repeat(None));
        let pose_of = |(object, held): (&SceneObject, Option<Pose>)| {
            held.unwrap_or_else(|| object.motion.pose_at(time_s))
        };
        self.poses.extend(self.objects.iter().zip(held).map(pose_of));
        self.eye.look(&self.poses)?;
        let seen = Instant::now();
        match &self.eye {
            Eye::Camera(camera) => self.simulator.update(&camera.layers).map(|_| ())?,
            Eye::Solids(solids) => self.simulator.update(solids).map(|_| ())?,
            Eye::Device(_) | Eye::SolidsOnDevice(..) => self.simulator.update_elsewhere()?,
        }
        let updated = Instant::now();
        let solve = self.simulator.solve()?;
        let changed_edges = self.simulator.changed_edges();
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

    /// Has another simulator of the scene see what was seen in the last frame.
    pub(crate) fn show_to(&mut self, simulator: &mut Simulator) -> Result<(), PipelineError> {
        self.look()?;
        match &self.eye {
            Eye::Camera(camera) => simulator.update(&camera.layers)?,
            Eye::Solids(solids) | Eye::SolidsOnDevice(_, solids) => simulator.update(solids)?,
            Eye::Device(device) => simulator.update(device.layers())?,
        };
        Ok(())
    }

    /// Where a graphics adapter finds the objects, has the processor find those of the last frame, too: for who looks at
    /// [`Pipeline::layers`], or at the occupancy and the matrix of [`Pipeline::simulator`], which otherwise are of an earlier
    /// frame. It costs what it would without the adapter, and nothing where objects are found here anyway.
    ///
    /// # Errors
    /// When the objects cannot be drawn.
    pub fn look(&mut self) -> Result<(), PipelineError> {
        match &mut self.eye {
            Eye::Device(device) => self.simulator.look(device.look()?)?,
            Eye::SolidsOnDevice(_, solids) => self.simulator.look(solids)?,
            Eye::Camera(_) | Eye::Solids(_) => {}
        }
        Ok(())
    }

    /// Objects that the mesh is too coarse for in the last frame, as [`Simulator::unresolved`] tells.
    ///
    /// # Errors
    /// When the objects cannot be drawn.
    pub fn unresolved(&mut self) -> Result<Vec<usize>, PipelineError> {
        self.look()?;
        let layers = match &self.eye {
            Eye::Solids(solids) | Eye::SolidsOnDevice(_, solids) => {
                return Ok(self.simulator.unresolved(solids));
            }
            Eye::Camera(camera) => &camera.layers,
            Eye::Device(device) => device.layers(),
        };
        let mut unresolved = self.simulator.unresolved(layers);
        let unseen =
            (0..).zip(self.objects.iter().zip(&self.poses)).filter_map(|(number, (object, pose))| {
                is_missed(layers, number, &object.shape, pose).then_some(number)
            });
        unresolved.extend(unseen);
        unresolved.sort_unstable();
        unresolved.dedup();
        Ok(unresolved)
    }

    /// The simulator in the state of the last frame.
    pub fn simulator(&self) -> &Simulator {
        &self.simulator
    }

    /// What computes the fields: `CPU`, or the name of a graphics adapter.
    pub fn device(&self) -> String {
        self.gpu.as_ref().map_or_else(|| "CPU".to_owned(), Graphics::description)
    }

    /// Whether a graphics adapter computes the fields.
    pub fn is_on_gpu(&self) -> bool {
        self.gpu.is_some()
    }

    /// Whether a graphics adapter finds the objects, too: then the processor has nothing but poses to do with them.
    pub fn finds_objects_on_gpu(&self) -> bool {
        self.eye.is_on_device()
    }

    /// What the camera saw in the last frame, if there is one; where a graphics adapter finds the objects, when
    /// [`Pipeline::look`] was called last.
    pub fn layers(&self) -> Option<&DepthLayers> {
        match &self.eye {
            Eye::Camera(camera) => Some(&camera.layers),
            Eye::Device(device) => Some(device.layers()),
            Eye::Solids(_) | Eye::SolidsOnDevice(..) => None,
        }
    }

    /// Where the objects stood in the last frame, in the order of the scene; empty before the first.
    pub fn poses(&self) -> &[Pose] {
        &self.poses
    }

    /// What draws the objects; exact solids are not drawn.
    pub fn renderer(&self) -> &str {
        self.eye.description()
    }
}

fn milliseconds(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1e3
}
