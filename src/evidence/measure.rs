//! One setting measured: the bar goes its way, frames are timed, C is compared.
//!
//! A frame is all from the bar's pose to C: seeing it, update and solve. Spread is what frames differ by: near the electrodes
//! more changes, and many frames need no step of an iteration.

use super::EvidenceError;
use super::clock::{Clock, Took};
use super::reference::Reference;
use super::setting::{Method, Setting};
use super::stage::{COMPARED, Stage};
use super::table::Row;
use crate::device::Device;
use crate::motion::Motion;
use crate::pipeline::Pipeline;
use crate::scene::{Geometry, GeometrySource, Scene};
use capsense_core::baseline::{CgOptions, PaperMethod};
use capsense_core::capacitance::CapacitanceMatrix;
use capsense_core::geometry::Pose;
use capsense_core::material::RelativePermittivity;
use capsense_core::occupancy::DepthLayers;
use capsense_core::sensor::Sensor;
use capsense_core::solids::Solids;
use capsense_core::solver::SolverOptions;
use capsense_core::workspace::Change;
use capsense_render::{Backend, DepthRenderer};

/// What stands for steel in the paper's method: its camera's red channel of 8 bits holds the permittivity. Filled to the grounded
/// wall, the bar is nearly a grounded conductor.
pub const PERMITTIVITY_OF_STEEL: f64 = 80.0;

/// Iterations after which the paper's method gives up.
const MOST_ITERATIONS: usize = 200_000;

/// What all methods have in common.
trait Frames {
    /// Computes the frame of a number, which the bar is in at a pose.
    fn frame(&mut self, index: usize, pose: &Pose) -> Result<(), EvidenceError>;
    /// What the bar changes of C in that frame.
    fn change(&self) -> Change;
}

impl Frames for Pipeline {
    fn frame(&mut self, index: usize, _: &Pose) -> Result<(), EvidenceError> {
        Pipeline::frame(self, index)?;
        Ok(())
    }

    fn change(&self) -> Change {
        Change::between(self.simulator().base(), self.simulator().capacitance())
    }
}

/// The paper's method and its camera.
struct Paper {
    method: PaperMethod<f64>,
    base: CapacitanceMatrix,
    renderer: DepthRenderer,
    depth: DepthLayers,
}

impl Paper {
    fn new(stage: &Stage, sensor: &Sensor, tolerance: f64) -> Result<Self, EvidenceError> {
        let steel = RelativePermittivity::new(PERMITTIVITY_OF_STEEL).ok_or(EvidenceError::Stage)?;
        let options = CgOptions { relative_residual: tolerance, max_iterations: MOST_ITERATIONS };
        let mut method = PaperMethod::new(sensor, &[steel], options);
        let depth = DepthLayers::empty(stage.scene.view, 1);
        let _ = method.step(&depth)?;
        let shapes = std::slice::from_ref(stage.shape());
        let renderer = DepthRenderer::new(Backend::Auto, stage.scene.view, shapes)?;
        Ok(Self { base: method.capacitance().clone(), method, renderer, depth })
    }
}

impl Frames for Paper {
    fn frame(&mut self, _: usize, pose: &Pose) -> Result<(), EvidenceError> {
        self.renderer.render(&[*pose], &mut self.depth)?;
        self.depth.back_fill();
        let _ = self.method.step(&self.depth)?;
        Ok(())
    }

    fn change(&self) -> Change {
        Change::between(&self.base, self.method.capacitance())
    }
}

/// Measures a setting; none when `stop` says so between two frames. What a setting cannot do is a row that says why.
///
/// # Errors
/// When the reference lacks a pose.
pub fn measure(
    stage: &Stage,
    setting: &Setting,
    reference: &Reference,
    stop: &dyn Fn() -> bool,
) -> Result<Option<Row>, EvidenceError> {
    match run(stage, setting, reference, stop) {
        Err(error @ (EvidenceError::NoReference(_) | EvidenceError::Stage | EvidenceError::Scene(_))) => {
            Err(error)
        }
        Err(failure) => Ok(Some(Row { failure: Some(failure.to_string()), ..Row::of(setting) })),
        Ok(row) => Ok(row),
    }
}

fn run(
    stage: &Stage,
    setting: &Setting,
    reference: &Reference,
    stop: &dyn Fn() -> bool,
) -> Result<Option<Row>, EvidenceError> {
    let sensor = setting.sensor(stage)?;
    let tets = sensor.mesh().tets().len();
    let places: Vec<Place> = places(stage, setting).collect();
    let mut method: Box<dyn Frames> = match setting.method {
        Method::Simulator => Box::new(Pipeline::with_sensor(&scene(stage, setting, &places)?, sensor)?),
        Method::Paper => Box::new(Paper::new(stage, &sensor, setting.tolerance)?),
    };
    let mut results = Results::default();
    for (index, place) in places.iter().enumerate() {
        if stop() {
            return Ok(None);
        }
        let (took, done) = Took::measured(|| method.frame(index, &place.pose));
        done?;
        if !place.is_jump {
            results.took.push(took);
        }
        if let Some(pose) = place.compared {
            results.errors.push(reference.error(pose, &method.change())?);
        }
    }
    let clock = match setting.device {
        Device::Cpu => Clock::for_threads(setting.threads),
        Device::Gpu | Device::Auto => Clock::Wall,
    };
    let row = results.into_row(Row::of(setting), clock);
    Ok(Some(Row { tets: Some(tets), ..row }))
}

/// Where the bar is in one frame.
struct Place {
    pose: Pose,
    /// Whether it was elsewhere in the frame before.
    is_jump: bool,
    /// The number of the pose among those that are compared.
    compared: Option<usize>,
}

fn places(stage: &Stage, setting: &Setting) -> impl Iterator<Item = Place> {
    let frames = setting.patience.frames();
    (0..stage.segments.len()).flat_map(move |segment| {
        let first = frames.start;
        frames.clone().map(move |frame| Place {
            pose: stage.pose(segment, frame),
            is_jump: frame == first,
            compared: COMPARED.iter().position(|f| *f == frame).map(|k| segment * COMPARED.len() + k),
        })
    })
}

/// The built-in scene with the bar at these places, a frame each.
fn scene(stage: &Stage, setting: &Setting, places: &[Place]) -> Result<Scene, EvidenceError> {
    let mut scene = stage.scene.clone();
    scene.interface = setting.interface;
    scene.geometry = match setting.geometry {
        GeometrySource::Camera => Geometry::Camera,
        GeometrySource::Solids => Geometry::Solids(Solids::new(std::slice::from_ref(stage.shape()))?),
    };
    scene.threads = setting.threads;
    scene.device = setting.device;
    scene.solver = SolverOptions {
        tolerance: setting.tolerance,
        preconditioner: setting.preconditioner,
        threads: Some(setting.threads),
        ..scene.solver
    };
    let at = |(index, place): (usize, &Place)| (index as f64 / scene.frame_rate, place.pose);
    let samples = places.iter().enumerate().map(at).collect();
    scene.objects[0].motion = Motion::sampled(samples).map_err(|_| EvidenceError::Stage)?;
    Ok(scene)
}

#[derive(Default)]
struct Results {
    took: Vec<Took>,
    /// Of the method and of the reference itself.
    errors: Vec<[capsense_core::workspace::ChangeError; 2]>,
}

impl Results {
    fn into_row(self, row: Row, clock: Clock) -> Row {
        let sorted = |clock| {
            let mut all: Vec<f64> = self.took.iter().map(|took| took.by(clock)).collect();
            all.sort_unstable_by(f64::total_cmp);
            all
        };
        let (all, wall) = (sorted(clock), sorted(Clock::Wall));
        let at = |sorted: &[f64], part: f64| {
            let value = sorted.get((part * sorted.len().saturating_sub(1) as f64).round() as usize);
            value.map(|value| rounded(*value, 5))
        };
        let mean = all.iter().sum::<f64>() / all.len().max(1) as f64;
        let poses = self.errors.len();
        let percent = |of: usize| {
            let squares: f64 = self.errors.iter().map(|errors| errors[of].of_all.powi(2)).sum();
            let largest = self.errors.iter().map(|errors| errors[of].largest).fold(0.0, f64::max);
            let is_known = poses > 0;
            [(squares / poses.max(1) as f64).sqrt(), largest]
                .map(|error| is_known.then(|| rounded(100.0 * error, 5)))
        };
        let [rms_error_percent, max_error_percent] = percent(0);
        let [reference_rms_percent, reference_max_percent] = percent(1);
        Row {
            clock: clock.name().to_owned(),
            frames: all.len(),
            median_ms: at(&all, 0.5),
            p10_ms: at(&all, 0.1),
            p90_ms: at(&all, 0.9),
            mean_ms: (!all.is_empty()).then(|| rounded(mean, 5)),
            wall_median_ms: at(&wall, 0.5),
            poses,
            rms_error_percent,
            max_error_percent,
            reference_rms_percent,
            reference_max_percent,
            ..row
        }
    }
}

/// A few decimals are enough for people.
fn rounded(value: f64, decimals: i32) -> f64 {
    let scale = 10f64.powi(decimals);
    (value * scale).round() / scale
}
