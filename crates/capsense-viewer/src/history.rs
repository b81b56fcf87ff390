//! What was computed, as curves: live over the time of the session, and over the time of the scene's trajectories.
//!
//! The table that is exported is that of `capsense run`, so that `capsense compare` and this viewer read it again.

use crate::measured::entry_of;
use crate::worker::Computed;
use capsense::core::capacitance::CapacitanceMatrix;
use capsense::core::measurement::{ChannelModel, MeasurementModel, Reading};
use capsense::core::solver::SolveReport;
use capsense::frame_table::{FrameRow, frame_table};
use capsense::pipeline::Milliseconds;
use std::collections::BTreeMap;

/// Older samples of the session are forgotten.
const MOST_SAMPLES: usize = 50_000;

/// Which time curves are over.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub enum TimeAxis {
    /// Time since the program began: curves scroll.
    #[default]
    Session,
    /// Time of the trajectories, one sample a frame.
    Scene,
}

/// One computed frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// Number of the frame.
    pub frame: usize,
    /// Time in seconds on the axis that it is taken from.
    pub time_s: f64,
    /// Upper triangle of the Maxwell matrix, row by row, in farads.
    pub farads: Vec<f64>,
    /// What converters read, channel by channel.
    pub readings: Vec<Reading>,
    /// Edges of the mesh that changed.
    pub changed_edges: usize,
    /// What the solver did.
    pub solve: SolveReport,
    /// Where the time went.
    pub milliseconds: Milliseconds,
}

/// A dashed line beside the computed ones: its points and what it is drawn in.
#[derive(Clone, Debug)]
pub struct Overlay {
    /// What it is called.
    pub name: String,
    /// The entry of the matrix that it is compared with.
    pub entry: usize,
    /// Time in seconds and value in farads.
    pub points: Vec<[f64; 2]>,
}

/// All that was computed of a sensor.
#[derive(Clone, Debug, Default)]
pub struct History {
    electrodes: Vec<String>,
    base: Vec<f64>,
    converters: Option<MeasurementModel>,
    session: Vec<Sample>,
    scene: BTreeMap<usize, Sample>,
}

impl History {
    /// Curves of these electrodes, whose capacitances without objects are `base`. Those of the session go on if electrodes
    /// and converters are the same.
    pub fn begin(
        &mut self,
        electrodes: &[String],
        base: &CapacitanceMatrix,
        converters: Option<&MeasurementModel>,
    ) {
        if self.electrodes != electrodes || self.converters.as_ref() != converters {
            self.session.clear();
            self.electrodes = electrodes.to_vec();
            self.converters = converters.cloned();
        }
        self.scene.clear();
        self.base = base.upper();
    }

    /// Takes a frame that was computed at a time of the session, in seconds.
    pub fn push(&mut self, computed: &Computed, session_s: f64) {
        let frame = &computed.frame;
        let sample = Sample {
            frame: frame.index,
            time_s: frame.time_s,
            farads: frame.capacitance.upper(),
            readings: computed.readings.clone(),
            changed_edges: frame.changed_edges,
            solve: frame.solve,
            milliseconds: frame.milliseconds,
        };
        if self.session.len() >= MOST_SAMPLES {
            self.session.drain(..MOST_SAMPLES / 10);
        }
        // Frames of one batch come at the same moment; the clock that curves are over must go on all the same.
        let last = self.session.last().map_or(f64::NEG_INFINITY, |sample| sample.time_s);
        self.session.push(Sample { time_s: session_s.max(last + 1e-6), ..sample.clone() });
        self.scene.insert(sample.frame, sample);
    }

    /// Forgets the samples over the time of the scene: objects stand elsewhere now.
    pub fn clear_scene(&mut self) {
        self.scene.clear();
    }

    /// Forgets all samples.
    pub fn clear(&mut self) {
        self.session.clear();
        self.scene.clear();
    }

    /// Names of the electrodes.
    pub fn electrodes(&self) -> &[String] {
        &self.electrodes
    }

    /// Upper triangle without objects, in farads.
    pub fn base(&self) -> &[f64] {
        &self.base
    }

    /// Samples over a time axis, in order of time.
    pub fn samples(&self, axis: TimeAxis) -> Vec<&Sample> {
        match axis {
            TimeAxis::Session => self.session.iter().collect(),
            TimeAxis::Scene => self.scene.values().collect(),
        }
    }

    /// What was computed last, if anything was.
    pub fn last(&self) -> Option<&Sample> {
        self.session.last()
    }

    /// Whether converters read the sensor.
    pub fn has_converters(&self) -> bool {
        self.converters.is_some()
    }

    /// What converters read over a time axis, one curve for each channel.
    pub fn readings(&self, axis: TimeAxis) -> Vec<Overlay> {
        let samples = self.samples(axis);
        let channels = self.converters.iter().flat_map(|model| &model.channels);
        let curve = |(index, channel): (usize, &ChannelModel)| {
            let (row, column) = (channel.row, channel.column);
            let point = |sample: &&Sample| Some([sample.time_s, sample.readings.get(index)?.farads]);
            Overlay {
                name: format!("{}–{}, as read", self.electrodes[row], self.electrodes[column]),
                entry: entry_of(row, column, self.electrodes.len()),
                points: samples.iter().filter_map(point).collect(),
            }
        };
        channels.enumerate().map(curve).collect()
    }

    /// Samples in the order in which they were computed.
    pub fn session(&self) -> &[Sample] {
        &self.session
    }

    /// The table of `capsense run` over a time axis.
    ///
    /// # Errors
    /// When samples are of other electrodes or converters than the newest.
    pub fn to_csv(&self, axis: TimeAxis) -> Result<Vec<u8>, csv::Error> {
        let row = |(index, sample): (usize, &Sample)| FrameRow {
            // Over the session, frames of the scene come in any order; rows are numbered then.
            frame: if axis == TimeAxis::Session { index } else { sample.frame },
            time_s: sample.time_s,
            farads: sample.farads.clone(),
            changed_edges: sample.changed_edges,
            iterations: sample.solve.iterations,
            milliseconds: sample.milliseconds,
            readings: sample.readings.clone(),
        };
        let rows = self.samples(axis).into_iter().enumerate().map(row);
        frame_table(&self.electrodes, self.converters.as_ref(), rows)
    }
}
