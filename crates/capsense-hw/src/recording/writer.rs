//! Writes recordings so that little is lost when the program is killed: whole chunks, five times a second, into a file
//! that gets its name when it is complete.

use super::{Header, NOTE, Note, RAW, RECORDING, RecordingError, SAMPLE, TEXT};
use crate::profile::{DeviceProfile, Reading};
use crate::stream::{Event, Sample, Stamped, Value};
use mcap::records::MessageHeader;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// A chunk is written when the first message in it is so old.
const LONGEST_CHUNK: Duration = Duration::from_millis(200);

/// A chunk is written when it has so many bytes.
const LARGEST_CHUNK: u64 = 256 * 1024;

/// Writes one recording.
///
/// Until [`finish`](Self::finish) the file's name ends in `.partial`; it is never changed but at its end. If the program
/// ends before, what was told until 200 ms before is in it, and [`recover`](super::recover) makes a recording of it.
pub struct RecordingWriter {
    path: PathBuf,
    partial: PathBuf,
    file: mcap::Writer<BufWriter<File>>,
    topics: Topics,
    profile: DeviceProfile,
    anchor: u64,
    count: u32,
    /// Time of the first message that is not in the file yet.
    waiting_since: Option<Duration>,
}

struct Topics {
    raw: u16,
    sample: u16,
    text: u16,
    note: u16,
}

/// A sample for other programs.
#[derive(Serialize)]
struct SampleMessage<'a> {
    time_s: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    sequence: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    device_time_s: Option<f64>,
    status: Vec<&'a str>,
    raw: Vec<Option<f64>>,
    value: Vec<Option<f64>>,
    flags: Vec<String>,
}

/// What [`SampleMessage`] looks like to others.
const SAMPLE_SCHEMA: &str = r#"{"type":"object","title":"capsense.Sample","properties":{
"time_s":{"type":"number"},"sequence":{"type":"integer"},"device_time_s":{"type":"number"},
"status":{"type":"array","items":{"type":"string"}},
"raw":{"type":"array","items":{"type":["number","null"]}},
"value":{"type":"array","items":{"type":["number","null"]}},
"flags":{"type":"array","items":{"type":"string"}}}}"#;

const ANY_SCHEMA: &str = r#"{"type":"object"}"#;

impl RecordingWriter {
    /// Begins a recording that will be at `path`.
    ///
    /// # Errors
    /// When there is a file of this name, or it cannot be written.
    pub fn create(path: &Path, header: &Header) -> Result<Self, RecordingError> {
        let profile = header.device_profile()?;
        let (partial, mut file) = create_partial(path, ".partial")?;
        let mut add = |topic: &str, encoding: &str, schema: Option<(&str, &str)>| {
            let schema = match schema {
                Some((name, text)) => file.add_schema(name, "jsonschema", text.as_bytes())?,
                None => 0,
            };
            file.add_channel(schema, topic, encoding, &BTreeMap::new())
        };
        let mut topics = || {
            let recording = add(RECORDING, "json", Some(("capsense.Recording", ANY_SCHEMA)))?;
            let topics = Topics {
                raw: add(RAW, "application/octet-stream", None)?,
                sample: add(SAMPLE, "json", Some(("capsense.Sample", SAMPLE_SCHEMA)))?,
                text: add(TEXT, "json", Some(("capsense.Text", ANY_SCHEMA)))?,
                note: add(NOTE, "json", Some(("capsense.Note", ANY_SCHEMA)))?,
            };
            Ok((recording, topics))
        };
        let (recording, topics) = topics().map_err(RecordingError::mcap(&partial))?;
        let mut writer = Self {
            path: path.to_owned(),
            partial,
            file,
            topics,
            profile,
            anchor: header.unix_nanoseconds,
            count: 0,
            waiting_since: None,
        };
        writer.write_json(recording, Duration::ZERO, header)?;
        writer.flush()?;
        Ok(writer)
    }

    /// Writes what one read of the port gave. `time` is since the beginning of the recording, by a monotonic clock.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn raw(&mut self, time: Duration, bytes: &[u8]) -> Result<(), RecordingError> {
        self.write(self.topics.raw, time, bytes)
    }

    /// Writes what bytes turned out to be.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn event(&mut self, stamped: &Stamped<'_>) -> Result<(), RecordingError> {
        let time = stamped.host_time;
        match stamped.event {
            Event::Sample(sample) => self.sample(time, &sample),
            Event::Text(line) => {
                let text = String::from_utf8_lossy(line);
                self.write_json(self.topics.text, time, &BTreeMap::from([("text", text)]))
            }
            Event::Resync => self.note(time, &Note::PassedOver { bytes: stamped.length }),
            Event::Gap(samples) => self.note(time, &Note::Gap { samples }),
        }
    }

    /// Writes what happened beside samples and lines.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn note(&mut self, time: Duration, note: &Note) -> Result<(), RecordingError> {
        self.write_json(self.topics.note, time, note)
    }

    /// Writes what has waited for so long that it may not be lost. To be called at least every 100 ms, also when
    /// nothing comes.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn tick(&mut self, now: Duration) -> Result<(), RecordingError> {
        match self.waiting_since {
            Some(since) if now.saturating_sub(since) >= LONGEST_CHUNK => self.flush(),
            _ => Ok(()),
        }
    }

    /// Completes the file and gives it its name.
    ///
    /// # Errors
    /// When the file cannot be written or renamed; what was written so far stays under the name that ends in `.partial`.
    pub fn finish(mut self) -> Result<PathBuf, RecordingError> {
        finish_partial(&mut self.file, &self.partial, &self.path)?;
        Ok(self.path)
    }

    fn flush(&mut self) -> Result<(), RecordingError> {
        self.waiting_since = None;
        self.file.flush().map_err(RecordingError::mcap(&self.partial))
    }

    fn sample(&mut self, time: Duration, sample: &Sample<'_>) -> Result<(), RecordingError> {
        let readings: Vec<Reading> =
            sample.values.iter().enumerate().map(|(at, value)| self.profile.reading(at, *value)).collect();
        let raw = |value: &Value| match value {
            Value::Number(number) => Some(*number),
            Value::Missing | Value::Invalid => None,
        };
        let described = sample.values.iter().zip(&readings).enumerate();
        let message = SampleMessage {
            time_s: time.as_secs_f64(),
            sequence: sample.sequence,
            device_time_s: sample.device_time.map(|time| time.as_secs_f64()),
            status: self.profile.status_names(sample.status).collect(),
            raw: sample.values.iter().map(raw).collect(),
            value: readings.iter().map(|reading| reading.value).collect(),
            flags: described
                .flat_map(|(at, (value, reading))| self.profile.remarks(at, *value, reading))
                .collect(),
        };
        let data = json(&message, &self.partial)?;
        self.write(self.topics.sample, time, &data)
    }

    fn write_json(
        &mut self,
        topic: u16,
        time: Duration,
        message: &impl Serialize,
    ) -> Result<(), RecordingError> {
        let data = json(message, &self.partial)?;
        self.write(topic, time, &data)
    }

    fn write(&mut self, channel_id: u16, time: Duration, data: &[u8]) -> Result<(), RecordingError> {
        self.tick(time)?;
        let nanoseconds = u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
        let log_time = self.anchor.saturating_add(nanoseconds);
        let header = MessageHeader { channel_id, sequence: self.count, log_time, publish_time: log_time };
        self.count = self.count.wrapping_add(1);
        self.waiting_since.get_or_insert(time);
        self.file.write_to_known_channel(&header, data).map_err(RecordingError::mcap(&self.partial))
    }
}

fn json(message: &impl Serialize, path: &Path) -> Result<Vec<u8>, RecordingError> {
    serde_json::to_vec(message)
        .map_err(|error| RecordingError::File { path: path.to_owned(), error: std::io::Error::other(error) })
}

/// Opens the file under the name it has until it is complete.
pub(super) fn create_partial(
    path: &Path,
    suffix: &str,
) -> Result<(PathBuf, mcap::Writer<BufWriter<File>>), RecordingError> {
    let mut partial = path.as_os_str().to_owned();
    partial.push(suffix);
    let partial = PathBuf::from(partial);
    if path.exists() {
        let error = std::io::Error::from(std::io::ErrorKind::AlreadyExists);
        return Err(RecordingError::File { path: path.to_owned(), error });
    }
    let file = File::create_new(&partial).map_err(RecordingError::file(&partial))?;
    // Without seeking a chunk is put together in memory and written at once.
    let options = mcap::WriteOptions::new()
        .compression(None)
        .profile("capsense")
        .library(concat!("capsense ", env!("CARGO_PKG_VERSION")))
        .chunk_size(Some(LARGEST_CHUNK))
        .disable_seeking(true);
    let writer = options.create(BufWriter::new(file)).map_err(RecordingError::mcap(&partial))?;
    Ok((partial, writer))
}

/// Completes a file and gives it its name.
pub(super) fn finish_partial(
    file: &mut mcap::Writer<BufWriter<File>>,
    partial: &Path,
    path: &Path,
) -> Result<(), RecordingError> {
    file.finish().map_err(RecordingError::mcap(partial))?;
    std::fs::rename(partial, path).map_err(RecordingError::file(path))
}
