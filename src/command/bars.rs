//! Error bars of the frames that have them. Where they cannot be told, a run goes on without.

use super::text::percentile;
use capsense::core::capacitance::CapacitanceMatrix;
use capsense::core::estimate::ErrorBars;
use capsense::run_folder::MeshSize;
use capsense::{ErrorEstimator, Frame, Pipeline, PipelineError, Scene};
use serde::Serialize;
use std::time::Instant;

/// Error bars so far.
pub(super) struct BarLog {
    estimator: Option<ErrorEstimator>,
    warning: Option<String>,
    told: Vec<(usize, ErrorBars)>,
    setup_ms: f64,
    frame_ms: Vec<f64>,
}

/// What `report.json` says of error bars.
#[derive(Serialize)]
pub(super) struct BarReport<'a> {
    /// They are told in each so many frames.
    every: usize,
    /// What the mesh of the run is compared with.
    mesh: MeshSize,
    milliseconds: BarTimes,
    frames: Vec<FrameBars<'a>>,
}

#[derive(Serialize)]
struct BarTimes {
    setup: f64,
    median: f64,
}

#[derive(Serialize)]
struct FrameBars<'a> {
    frame: usize,
    error_farads: Vec<&'a [f64]>,
    change_error_farads: Vec<&'a [f64]>,
}

impl BarLog {
    pub(super) fn new(scene: &Scene, pipeline: &Pipeline) -> Self {
        let started = Instant::now();
        let mut log =
            Self { estimator: None, warning: None, told: Vec::new(), setup_ms: 0.0, frame_ms: Vec::new() };
        match ErrorEstimator::new(scene, pipeline) {
            Ok(Some(estimator)) => log.estimator = Some(estimator),
            Ok(None) => log.warning = Some(warning(scene, "the mesh is too large to be halved")),
            Err(error) => log.give_up(scene, &error),
        }
        log.setup_ms = started.elapsed().as_secs_f64() * 1e3;
        log
    }

    /// Notes the bars of the frame computed last, if they are due.
    pub(super) fn note(&mut self, scene: &Scene, pipeline: &mut Pipeline, frame: &Frame) {
        if self.estimator.as_ref().is_some_and(|estimator| estimator.is_due(frame.index)) {
            self.tell(scene, pipeline, frame);
        }
    }

    /// Notes them whether they are due or not.
    pub(super) fn tell(&mut self, scene: &Scene, pipeline: &mut Pipeline, frame: &Frame) {
        let Some(estimator) = &mut self.estimator else { return };
        let started = Instant::now();
        match estimator.estimate(pipeline, frame) {
            Ok(bars) => self.told.push((frame.index, bars)),
            Err(error) => self.give_up(scene, &error),
        }
        self.frame_ms.push(started.elapsed().as_secs_f64() * 1e3);
    }

    fn give_up(&mut self, scene: &Scene, error: &PipelineError) {
        self.warning = Some(warning(scene, &error.to_string()));
        self.estimator = None;
    }

    /// Why there are none, or no more.
    pub(super) fn warning(&self) -> Option<&String> {
        self.warning.as_ref()
    }

    /// The bars told last.
    pub(super) fn last(&self) -> Option<&ErrorBars> {
        self.told.last().map(|(_, bars)| bars)
    }

    /// The largest half-width that one entry of a kind had in any frame, in farads.
    pub(super) fn largest(
        &self,
        of: impl Fn(&ErrorBars) -> &CapacitanceMatrix,
        row: usize,
        column: usize,
    ) -> Option<f64> {
        self.told.iter().map(|(_, bars)| of(bars).get(row, column)).reduce(f64::max)
    }

    /// One line about where they are from.
    pub(super) fn summary(&self) -> Option<String> {
        let estimator = self.estimator.as_ref()?;
        Some(format!(
            "Errors: the largest error bars, told once in {} frames, {} in all, on a mesh of {} tetrahedra; \
             nine of ten errors are smaller\n",
            estimator.every(),
            self.told.len(),
            estimator.mesh().tets().len()
        ))
    }

    /// What the report says.
    pub(super) fn report(&self) -> Option<BarReport<'_>> {
        let estimator = self.estimator.as_ref()?;
        Some(BarReport {
            every: estimator.every(),
            mesh: MeshSize::of(estimator.mesh()),
            milliseconds: BarTimes { setup: self.setup_ms, median: percentile(&self.frame_ms, 0.5) },
            frames: self.told.iter().map(FrameBars::new).collect(),
        })
    }
}

impl<'a> FrameBars<'a> {
    fn new((frame, bars): &'a (usize, ErrorBars)) -> Self {
        Self {
            frame: *frame,
            error_farads: bars.capacitance.rows().collect(),
            change_error_farads: bars.change.rows().collect(),
        }
    }
}

fn warning(scene: &Scene, reason: &str) -> String {
    format!("{}: no error bars: {reason}", scene.source.file())
}
