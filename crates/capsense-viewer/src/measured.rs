//! Measured curves beside computed ones: recordings from files, and what a board sends now.
//!
//! A channel is compared with one entry of the Maxwell matrix, as gain · measured + offset over time + lag.

use capsense::series::{Curve, best_lag, common_axis, pearson};
use capsense_hw::recording::{RecordingReader, Samples};
use std::path::Path;

/// Columns of tables that are no channels.
const NO_CHANNELS: [&str; 12] = [
    "frame",
    "time_s",
    "t",
    "time",
    "device_time_s",
    "sequence",
    "status",
    "flags",
    "changed_edges",
    "iterations",
    "sample",
    "index",
];

/// Samples of a channel that is being measured are forgotten beyond so many, the oldest first.
const MOST_SAMPLES: usize = 200_000;

/// One measured channel.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// What it is called.
    pub name: String,
    /// Whether values are farads; else they are counts.
    pub is_farads: bool,
    /// Times in seconds, strictly increasing.
    pub times: Vec<f64>,
    /// Values, all finite.
    pub values: Vec<f64>,
    /// Whether it is drawn.
    pub is_shown: bool,
    /// The entry of the matrix that it is compared with: its place in the upper triangle.
    pub entry: usize,
    /// Farads of the entry per farad or count.
    pub gain: f64,
    /// Farads of the entry where the channel is 0.
    pub offset: f64,
}

impl Channel {
    /// An empty channel.
    pub fn new(name: String, is_farads: bool, entry: usize) -> Self {
        Self {
            name,
            is_farads,
            times: Vec::new(),
            values: Vec::new(),
            is_shown: true,
            entry,
            gain: 1.0,
            offset: 0.0,
        }
    }

    /// Takes a sample; what is not finite, or not later than the one before, is left out.
    pub fn push(&mut self, time_s: f64, value: f64) {
        let is_later = self.times.last().is_none_or(|last| time_s > *last);
        if !(is_later && time_s.is_finite() && value.is_finite()) {
            return;
        }
        if self.times.len() >= MOST_SAMPLES {
            self.times.drain(..MOST_SAMPLES / 10);
            self.values.drain(..MOST_SAMPLES / 10);
        }
        self.times.push(time_s);
        self.values.push(value);
    }

    /// Time and farads of the entry, as drawn.
    pub fn points(&self, lag_s: f64) -> Vec<[f64; 2]> {
        let values = self.values.iter().map(|value| self.gain * value + self.offset);
        self.times.iter().zip(values).map(|(time, value)| [time + lag_s, value]).collect()
    }

    fn curve(&self, lag_s: f64) -> Option<Curve> {
        Curve::new(self.times.iter().map(|time| time + lag_s).collect(), self.values.clone()).ok()
    }

    /// Pearson's r against a computed curve, where both are known and both move.
    pub fn pearson(&self, computed: &Curve, lag_s: f64) -> Option<f64> {
        let measured = self.curve(lag_s)?;
        let times = common_axis(computed, &measured).ok()?;
        pearson(&computed.resampled(&times), &measured.resampled(&times))
    }

    /// The lag at which it is most like a computed curve, near the one given.
    pub fn best_lag(&self, computed: &Curve, lag_s: f64) -> Option<f64> {
        let behind = best_lag(computed, &self.curve(lag_s)?).ok()??;
        Some(lag_s - behind.time)
    }

    /// Sets gain and offset so that the measured curve comes nearest to the computed one, in the mean square. Returns
    /// whether there is enough of both.
    pub fn calibrate(&mut self, computed: &Curve, lag_s: f64) -> bool {
        let fit = self.curve(lag_s).and_then(|measured| {
            let times = common_axis(computed, &measured).ok()?;
            line(&measured.resampled(&times), &computed.resampled(&times))
        });
        if let Some((gain, offset)) = fit {
            (self.gain, self.offset) = (gain, offset);
        }
        fit.is_some()
    }

    /// Sets the offset alone, so that the means are the same: for boards whose gain is known.
    pub fn align(&mut self, computed: &Curve, lag_s: f64) -> bool {
        let fit = self.curve(lag_s).and_then(|measured| {
            let times = common_axis(computed, &measured).ok()?;
            let count = times.len() as f64;
            let [computed, measured] =
                [computed, &measured].map(|curve| curve.resampled(&times).iter().sum::<f64>() / count);
            Some(computed - self.gain * measured)
        });
        if let Some(offset) = fit {
            self.offset = offset;
        }
        fit.is_some()
    }
}

/// Slope and intercept of the line through points (x, y) that is nearest in the mean square of y; `None` where x does not
/// move.
fn line(x: &[f64], y: &[f64]) -> Option<(f64, f64)> {
    let count = x.len() as f64;
    let mean = |values: &[f64]| values.iter().sum::<f64>() / count;
    let (middle_x, middle_y) = (mean(x), mean(y));
    let square: f64 = x.iter().map(|x| (x - middle_x).powi(2)).sum();
    let product: f64 = x.iter().zip(y).map(|(x, y)| (x - middle_x) * (y - middle_y)).sum();
    let gain = product / square;
    let offset = middle_y - gain * middle_x;
    (square > 0.0 && gain.is_finite() && offset.is_finite()).then_some((gain, offset))
}

/// A recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// Name of the file.
    pub name: String,
    /// Its channels.
    pub channels: Vec<Channel>,
    /// What is added to its times, in seconds.
    pub lag_s: f64,
}

impl Measured {
    /// Reads a recording: `.mcap`, or a table as `capsense run` and `capsense export` write it, or any with a column of
    /// time. `electrodes` are those of the scene that it is compared with.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn load(path: &Path, electrodes: &[String]) -> Result<Self, String> {
        let is_mcap = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("mcap"));
        let mut channels = if is_mcap { from_mcap(path, electrodes)? } else { from_csv(path, electrodes)? };
        channels.retain(|channel| channel.times.len() > 1);
        if channels.is_empty() {
            return Err(format!("{}: no channel in it has two samples", path.display()));
        }
        // Times begin with the recording.
        let first = channels.iter().map(|channel| channel.times[0]).fold(f64::INFINITY, f64::min);
        for channel in &mut channels {
            channel.times.iter_mut().for_each(|time| *time -= first);
        }
        let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        Ok(Self { name, channels, lag_s: 0.0 })
    }
}

/// The place of an entry in the upper triangle.
pub fn entry_of(row: usize, column: usize, electrodes: usize) -> usize {
    let (row, column) = (row.min(column), row.max(column));
    row * electrodes - row * (row + 1) / 2 + column
}

/// The entry that a channel most likely measures: that of its name, or else the self-capacitance of the electrode with its
/// number.
fn likely_entry(name: &str, index: usize, electrodes: &[String]) -> usize {
    let count = electrodes.len();
    for (row, first) in electrodes.iter().enumerate() {
        for (column, second) in electrodes.iter().enumerate().skip(row) {
            if name == format!("C_{first}_{second}_F") {
                return entry_of(row, column, count);
            }
        }
    }
    let electrode = index.min(count.saturating_sub(1));
    entry_of(electrode, electrode, count)
}

fn from_mcap(path: &Path, electrodes: &[String]) -> Result<Vec<Channel>, String> {
    let reader = RecordingReader::open(path).map_err(|error| error.to_string())?;
    let samples = Samples::new(reader, None).map_err(|error| error.to_string())?;
    let profile = samples.profile().clone();
    let is_farads = profile.meaning != capsense_hw::profile::Meaning::Counts;
    let mut channels: Vec<Channel> = Vec::new();
    for sample in samples {
        let sample = sample.map_err(|error| error.to_string())?;
        for (index, value) in sample.values.iter().enumerate() {
            if channels.len() <= index {
                let entry = likely_entry("", index, electrodes);
                channels.push(Channel::new(format!("C{}", index + 1), is_farads, entry));
            }
            if let Some(value) = profile.reading(index, *value).value {
                channels[index].push(sample.time.as_secs_f64(), value);
            }
        }
    }
    Ok(channels)
}

fn from_csv(path: &Path, electrodes: &[String]) -> Result<Vec<Channel>, String> {
    let failed = |error: csv::Error| format!("{}: {error}", path.display());
    let mut reader =
        csv::ReaderBuilder::new().trim(csv::Trim::All).flexible(true).from_path(path).map_err(failed)?;
    let header = reader.headers().map_err(failed)?.clone();
    let names: Vec<&str> = header.iter().map(|name| name.trim_start_matches('\u{feff}')).collect();
    let time = names
        .iter()
        .position(|name| matches!(*name, "time_s" | "t" | "time"))
        .ok_or_else(|| format!("{}, line 1: no column is called time_s, time or t", path.display()))?;
    let has_farads = names.iter().any(|name| unit(name).is_some());
    let is_channel = |name: &&str| match has_farads {
        true => unit(name).is_some(),
        false => !NO_CHANNELS.contains(name) && !name.ends_with("_ms"),
    };
    let columns: Vec<usize> = (0..names.len()).filter(|&column| is_channel(&names[column])).collect();
    let mut channels: Vec<Channel> = columns
        .iter()
        .enumerate()
        .map(|(index, &column)| {
            let name = names[column];
            Channel::new(name.to_owned(), has_farads, likely_entry(name, index, electrodes))
        })
        .collect();
    for record in reader.records() {
        let record = record.map_err(failed)?;
        let number = |column: usize| record.get(column).and_then(|text| text.parse::<f64>().ok());
        // Cells without a number are gaps, as boards leave them.
        let Some(time) = number(time) else { continue };
        for (channel, &column) in channels.iter_mut().zip(&columns) {
            if let Some(value) = number(column) {
                channel.push(time, value * unit(names[column]).unwrap_or(1.0));
            }
        }
    }
    Ok(channels)
}

/// Farads of one unit of a column, by the end of its name.
fn unit(name: &str) -> Option<f64> {
    [("_F", 1.0), ("_pF", 1e-12), ("_fF", 1e-15)]
        .into_iter()
        .find(|(suffix, _)| name.ends_with(suffix))
        .map(|(_, farads)| farads)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn electrodes() -> Vec<String> {
        ["E1", "E2", "E3"].map(str::to_owned).to_vec()
    }

    fn table(text: &str) -> Result<Measured, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.csv");
        std::fs::write(&path, text).unwrap();
        Measured::load(&path, &electrodes())
    }

    #[test]
    fn entries_are_numbered_row_by_row() {
        let all: Vec<usize> =
            capsense::core::capacitance::upper_triangle(4).map(|(a, b)| entry_of(a, b, 4)).collect();
        assert_eq!(all, (0..10).collect::<Vec<_>>());
        assert_eq!(entry_of(3, 1, 4), entry_of(1, 3, 4));
    }

    #[test]
    fn tables_of_a_run_find_their_entries_and_times_begin_at_zero() {
        let run = table("frame,time_s,C_E1_E1_F,C_E2_E3_F,solve_ms\n0,5.0,1e-12,2e-12,9\n1,5.5,3e-12,,9\n2,6,4e-12,5e-12,9\n").unwrap();
        let entries: Vec<usize> = run.channels.iter().map(|channel| channel.entry).collect();
        assert_eq!(entries, [0, 4]);
        assert_eq!(run.channels[0].times, [0.0, 0.5, 1.0]);
        assert_eq!(run.channels[1].values, [2e-12, 5e-12], "an empty cell is a gap");
    }

    #[test]
    fn counts_are_channels_where_there_are_no_farads() {
        let counts = table("t,left,right\n0,100,3\n1,200,nan\n1,900,3\n2,300,4\n").unwrap();
        assert_eq!(counts.channels[0].values, [100.0, 200.0, 300.0], "time must go on");
        assert!(!counts.channels[0].is_farads);
        assert_eq!(counts.channels[1].entry, 3, "the second channel is of the second electrode");
        assert!(table("a,b\n1,2\n").unwrap_err().contains("time_s"));
        assert!(table("t,a\n0,1\n").unwrap_err().contains("two samples"));
    }

    #[test]
    fn calibration_finds_gain_and_offset() {
        let times: Vec<f64> = (0..50).map(|k| 0.1 * f64::from(k)).collect();
        let truth: Vec<f64> = times.iter().map(|t| 1e-13 * (2.0 * t).sin() + 4e-12).collect();
        let computed = Curve::new(times.clone(), truth.clone()).unwrap();
        let mut channel = Channel::new("C1".into(), false, 0);
        for (time, value) in times.iter().zip(&truth) {
            channel.push(time - 0.5, (value - 3e-12) / 2e-16);
        }
        assert!(channel.pearson(&computed, 0.5).unwrap() > 0.999_999);
        assert!(channel.pearson(&computed, 0.0).unwrap() < 0.9, "the lag matters");
        let lag_s = channel.best_lag(&computed, 0.0).unwrap();
        assert!((lag_s - 0.5).abs() < 0.1, "{lag_s}");
        assert!(channel.calibrate(&computed, 0.5));
        assert!((channel.gain / 2e-16 - 1.0).abs() < 1e-6, "{}", channel.gain);
        assert!((channel.offset / 3e-12 - 1.0).abs() < 1e-6, "{}", channel.offset);
        channel.offset = 0.0;
        assert!(channel.align(&computed, 0.5));
        assert!((channel.offset / 3e-12 - 1.0).abs() < 1e-3, "{}", channel.offset);
        let mut still = Channel::new("C1".into(), false, 0);
        still.push(0.0, 1.0);
        still.push(1.0, 1.0);
        assert!(!still.calibrate(&computed, 0.0), "what does not move tells nothing of a gain");
    }
}
