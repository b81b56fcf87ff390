//! Recordings as tables: one row a sample, one or two columns a channel.

use super::{Decoded, RecordingError, RecordingReader, Samples};
use crate::profile::{DeviceProfile, Meaning};
use crate::stream::Value;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// What was exported.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExportReport {
    /// Number of samples.
    pub samples: u64,
    /// Number of channels.
    pub channels: usize,
}

/// The samples of a recording and how many channels a row has.
pub(super) fn open(
    recording: &Path,
    profile: Option<&DeviceProfile>,
) -> Result<(Samples, usize), RecordingError> {
    let samples = || Samples::new(RecordingReader::open(recording)?, profile.cloned());
    let first = samples()?;
    let mut channels = first.profile().channels;
    if channels == 0 {
        for sample in first {
            channels = channels.max(sample?.values.len());
        }
    }
    Ok((samples()?, channels))
}

/// What a channel's value is called, after the channel's name: farads, a change in farads; counts have no second column.
pub(super) fn value_suffix(meaning: Meaning) -> Option<&'static str> {
    match meaning {
        Meaning::Absolute => Some("F"),
        Meaning::Relative => Some("change_F"),
        Meaning::Counts => None,
    }
}

/// Raw number and value of a channel in a row.
pub(super) fn cell(profile: &DeviceProfile, sample: &Decoded, channel: usize) -> [Option<f64>; 2] {
    let value = sample.values.get(channel).copied().unwrap_or_default();
    let raw = match value {
        Value::Number(number) => Some(number),
        Value::Missing | Value::Invalid => None,
    };
    [raw, profile.reading(channel, value).value]
}

/// Words for all that is to be said against the values of a row, with spaces between.
pub(super) fn flags(profile: &DeviceProfile, sample: &Decoded) -> String {
    let remarks = sample
        .values
        .iter()
        .enumerate()
        .flat_map(|(channel, value)| profile.remarks(channel, *value, &profile.reading(channel, *value)));
    let status = profile.status_names(sample.status).map(str::to_owned);
    status.chain(remarks).collect::<Vec<_>>().join(" ")
}

/// The samples of a recording as lines of CSV: `time_s,device_time_s,sequence,status`, then `C1_raw,C1_F` and so on, then `flags`.
/// Cells without a value are empty.
#[derive(Clone, Debug)]
pub struct CsvTable {
    profile: DeviceProfile,
    channels: usize,
}

impl CsvTable {
    /// The table and the samples of a recording. With a profile the bytes are decoded by it in place of the recording's own.
    ///
    /// # Errors
    /// When the recording cannot be read.
    pub fn open(
        recording: &Path,
        profile: Option<&DeviceProfile>,
    ) -> Result<(Self, Samples), RecordingError> {
        let (samples, channels) = open(recording, profile)?;
        Ok((Self { profile: samples.profile().clone(), channels }, samples))
    }

    /// The first line, with its end.
    pub fn header(&self) -> String {
        let suffix = value_suffix(self.profile.meaning);
        let mut line = String::from("time_s,device_time_s,sequence,status");
        for channel in 1..=self.channels {
            line += &format!(",C{channel}_raw");
            line += &suffix.map(|suffix| format!(",C{channel}_{suffix}")).unwrap_or_default();
        }
        line + ",flags\n"
    }

    /// The line of a sample, with its end.
    pub fn row(&self, sample: &Decoded) -> String {
        let text = |number: Option<f64>| number.map(|number| number.to_string()).unwrap_or_default();
        let device_time = text(sample.device_time.map(|time| time.as_secs_f64()));
        let sequence = sample.sequence.map(|count| count.to_string()).unwrap_or_default();
        let mut line = format!("{},{device_time},{sequence},{}", sample.time.as_secs_f64(), sample.status);
        for channel in 0..self.channels {
            let [raw, value] = cell(&self.profile, sample, channel);
            line += &format!(",{}", text(raw));
            if value_suffix(self.profile.meaning).is_some() {
                line += &value.map(|value| format!(",{value:e}")).unwrap_or_else(|| ",".to_owned());
            }
        }
        line + &format!(",{}\n", flags(&self.profile, sample))
    }
}

/// Writes a recording as a [`CsvTable`].
///
/// # Errors
/// When the recording cannot be read or the file cannot be written.
pub fn export_csv(
    recording: &Path,
    profile: Option<&DeviceProfile>,
    out: &Path,
) -> Result<ExportReport, RecordingError> {
    let (table, samples) = CsvTable::open(recording, profile)?;
    let mut file = BufWriter::new(File::create(out).map_err(RecordingError::file(out))?);
    let mut write = |line: String| file.write_all(line.as_bytes()).map_err(RecordingError::file(out));
    let mut report = ExportReport { samples: 0, channels: table.channels };
    write(table.header())?;
    for sample in samples {
        write(table.row(&sample?))?;
        report.samples += 1;
    }
    file.flush().map_err(RecordingError::file(out))?;
    Ok(report)
}
