//! What was computed, as curves: live over the time of the session, and over the time of the scene's trajectories.
//!
//! The table that is exported is that of `capsense run`, so that `capsense compare` and this viewer read it again.

use crate::worker::Computed;
use capsense::core::capacitance::CapacitanceMatrix;
use capsense::core::measurement::{MeasurementModel, Reading};
use capsense::core::solver::SolveReport;
use capsense::pipeline::Milliseconds;
use std::collections::BTreeMap;
use std::fmt::Write as _;

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

/// Indices of the upper triangle, row by row.
pub fn pairs(electrodes: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..electrodes).flat_map(move |row| (row..electrodes).map(move |column| (row, column)))
}

/// The upper triangle of a matrix, row by row.
pub fn upper_triangle(matrix: &CapacitanceMatrix) -> Vec<f64> {
    pairs(matrix.size()).map(|(row, column)| matrix.get(row, column)).collect()
}

/// All that was computed of a sensor.
#[derive(Clone, Debug, Default)]
pub struct History {
    electrodes: Vec<String>,
    base: Vec<f64>,
    /// The entries that converters read, and whether they tell codes.
    channels: Vec<[usize; 2]>,
    has_codes: bool,
    session: Vec<Sample>,
    scene: BTreeMap<usize, Sample>,
}

impl History {
    /// Curves of these electrodes, whose capacitances without objects are `base`. Those of the session go on if electrodes
    /// and channels are the same.
    pub fn begin(
        &mut self,
        electrodes: &[String],
        base: &CapacitanceMatrix,
        converters: Option<&MeasurementModel>,
    ) {
        let channels = converters.iter().flat_map(|model| &model.channels);
        let channels: Vec<_> = channels.map(|channel| [channel.row, channel.column]).collect();
        if self.electrodes != electrodes || self.channels != channels {
            self.session.clear();
            self.electrodes = electrodes.to_vec();
            self.channels = channels;
        }
        self.has_codes = converters.is_some_and(|model| model.converter.is_some());
        self.scene.clear();
        self.base = upper_triangle(base);
    }

    /// Takes a frame that was computed at a time of the session, in seconds.
    pub fn push(&mut self, computed: &Computed, session_s: f64) {
        let frame = &computed.frame;
        let sample = Sample {
            frame: frame.index,
            time_s: frame.time_s,
            farads: upper_triangle(&frame.capacitance),
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
        !self.channels.is_empty()
    }

    /// What converters read over a time axis, one curve for each channel.
    pub fn readings(&self, axis: TimeAxis) -> Vec<Overlay> {
        let samples = self.samples(axis);
        let curve = |(channel, &[row, column]): (usize, &[usize; 2])| {
            let [first, second] = [row.min(column), row.max(column)];
            let point = |sample: &&Sample| Some([sample.time_s, sample.readings.get(channel)?.farads]);
            Overlay {
                name: format!("{}–{}, as read", self.electrodes[row], self.electrodes[column]),
                entry: pairs(self.electrodes.len()).take_while(|pair| *pair != (first, second)).count(),
                points: samples.iter().filter_map(point).collect(),
            }
        };
        self.channels.iter().enumerate().map(curve).collect()
    }

    /// Samples in the order in which they were computed.
    pub fn session(&self) -> &[Sample] {
        &self.session
    }

    /// The table of `capsense run` over a time axis.
    pub fn to_csv(&self, axis: TimeAxis) -> String {
        let mut text = "frame,time_s".to_owned();
        for (row, column) in pairs(self.electrodes.len()) {
            let _ = write!(text, ",C_{}_{}_F", self.electrodes[row], self.electrodes[column]);
        }
        text += ",changed_edges,iterations,geometry_ms,update_ms,solve_ms";
        for [row, column] in &self.channels {
            let name = format!("{}_{}", self.electrodes[*row], self.electrodes[*column]);
            let raw = if self.has_codes { format!(",raw_{name}") } else { String::new() };
            let _ = write!(text, "{raw},measured_{name}_F");
        }
        text.push('\n');
        for (index, sample) in self.samples(axis).into_iter().enumerate() {
            // Over the session, frames of the scene come in any order; rows are numbered then.
            let frame = if axis == TimeAxis::Session { index } else { sample.frame };
            let _ = write!(text, "{frame},{}", sample.time_s);
            for farads in &sample.farads {
                let _ = write!(text, ",{farads:e}");
            }
            let Milliseconds { geometry, update, solve, .. } = sample.milliseconds;
            let (edges, iterations) = (sample.changed_edges, sample.solve.iterations);
            let _ = write!(text, ",{edges},{iterations},{geometry},{update},{solve}");
            for reading in &sample.readings {
                let raw = reading.raw.map_or_else(String::new, |code| format!(",{code}"));
                let _ = write!(text, "{raw},{:e}", reading.farads);
            }
            text.push('\n');
        }
        text
    }
}
