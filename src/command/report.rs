//! `report.json`: what was computed, how, how well and how fast.

use super::bars::{BarLog, BarReport};
use super::measured::MeasurementReport;
use super::text::percentile;
use capsense::pipeline::Milliseconds;
use capsense::run_folder::RunOrigin;
use capsense::scene::Geometry;
use capsense::{Frame, Pipeline, Scene};
use serde::Serialize;

/// Everything about a run except its curves.
#[derive(Serialize)]
pub(super) struct Report<'a> {
    version: &'static str,
    #[serde(flatten)]
    origin: RunOrigin,
    electrodes: &'a [String],
    objects: Vec<&'a str>,
    domain: Domain,
    method: Method<'a>,
    solver: Solver,
    frames: Frames,
    milliseconds: Timing,
    base_farads: Vec<&'a [f64]>,
    /// `null` where they cannot be told.
    error_bars: Option<BarReport<'a>>,
    /// Only where the scene has converters.
    #[serde(skip_serializing_if = "Option::is_none")]
    measurement: Option<MeasurementReport>,
    warnings: Vec<String>,
}

#[derive(Serialize)]
struct Domain {
    min: [f64; 3],
    max: [f64; 3],
}

#[derive(Serialize)]
struct Method<'a> {
    geometry: &'static str,
    interface: &'static str,
    /// Of the camera, if there is one.
    pixels: Option<[usize; 2]>,
    back_fill: bool,
    renderer: &'a str,
}

#[derive(Serialize)]
struct Solver {
    preconditioner: &'static str,
    /// `CPU`, or the name of the graphics adapter that computed the fields.
    device: String,
    /// What found the objects: `processor`, or `device` where that did it, too.
    objects: &'static str,
    /// Kernels that it launched for a frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    launches_median: Option<usize>,
    tolerance: f64,
    /// As asked for; 0: all cores.
    threads: usize,
    /// Frames that needed no solution because nothing that matters had changed; the others' iterations follow.
    frames_skipped: usize,
    iterations_median: usize,
    iterations_max: usize,
    relative_error_final: f64,
    relative_error_max: f64,
}

#[derive(Serialize)]
struct Frames {
    planned: usize,
    computed: usize,
    interrupted: bool,
    frame_rate: f64,
}

#[derive(Serialize)]
struct Timing {
    setup: f64,
    geometry: Spread,
    update: Spread,
    solve: Spread,
    total: Spread,
}

/// Median, 95th percentile and maximum over frames.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct Spread {
    pub(super) median: f64,
    pub(super) p95: f64,
    pub(super) max: f64,
}

impl Spread {
    /// Of one part of the frame time.
    pub(super) fn of(frames: &[Frame], part: impl Fn(&Milliseconds) -> f64) -> Self {
        let values: Vec<f64> = frames.iter().map(|frame| part(&frame.milliseconds)).collect();
        let at = |rank| percentile(&values, rank);
        Self { median: at(0.5), p95: at(0.95), max: at(1.0) }
    }
}

impl<'a> Report<'a> {
    /// Sums up a run; `setup` is the time in milliseconds until the first frame.
    pub(super) fn new(
        origin: RunOrigin,
        scene: &'a Scene,
        pipeline: &'a Pipeline,
        frames: &[Frame],
        setup: f64,
        interrupted: bool,
    ) -> Self {
        let has_camera = matches!(scene.geometry, Geometry::Camera);
        let solved = frames.iter().filter(|frame| !frame.solve.skipped);
        let iterations: Vec<usize> = solved.map(|frame| frame.solve.iterations).collect();
        let launches: Vec<usize> = frames.iter().map(|frame| frame.solve.launches).collect();
        let errors: Vec<f64> = frames.iter().map(|frame| frame.solve.relative_error).collect();
        Self {
            version: env!("CARGO_PKG_VERSION"),
            origin,
            electrodes: &scene.electrodes,
            objects: scene.objects.iter().map(|object| object.name.as_str()).collect(),
            domain: Domain { min: scene.domain.min.to_array(), max: scene.domain.max.to_array() },
            method: Method {
                geometry: if has_camera { "camera" } else { "solids" },
                interface: scene.interface.name(),
                pixels: has_camera.then_some([scene.view.width, scene.view.height]),
                back_fill: has_camera && scene.back_fill,
                renderer: pipeline.renderer(),
            },
            solver: Solver {
                preconditioner: pipeline.simulator().preconditioner().name(),
                device: pipeline.device(),
                objects: if pipeline.finds_objects_on_gpu() { "device" } else { "processor" },
                launches_median: pipeline.is_on_gpu().then(|| percentile(&launches, 0.5)),
                tolerance: scene.solver.tolerance,
                threads: scene.threads,
                frames_skipped: frames.len() - iterations.len(),
                iterations_median: percentile(&iterations, 0.5),
                iterations_max: percentile(&iterations, 1.0),
                relative_error_final: errors.last().copied().unwrap_or(0.0),
                relative_error_max: percentile(&errors, 1.0),
            },
            frames: Frames {
                planned: scene.frames,
                computed: frames.len(),
                interrupted,
                frame_rate: scene.frame_rate,
            },
            milliseconds: Timing {
                setup,
                geometry: Spread::of(frames, |took| took.geometry),
                update: Spread::of(frames, |took| took.update),
                solve: Spread::of(frames, |took| took.solve),
                total: Spread::of(frames, |took| took.total),
            },
            base_farads: pipeline.simulator().base().rows().collect(),
            error_bars: None,
            measurement: None,
            warnings: Vec::new(),
        }
    }

    /// Tells how exact the frames are.
    pub(super) fn with_error_bars(self, bars: &'a BarLog) -> Self {
        Self { error_bars: bars.report(), ..self }
    }

    /// Tells of the converters.
    pub(super) fn with_measurement(self, measurement: Option<MeasurementReport>) -> Self {
        Self { measurement, ..self }
    }

    /// Tells what is odd about the run but no error.
    pub(super) fn with_warnings(self, warnings: Vec<String>) -> Self {
        Self { warnings, ..self }
    }
}
