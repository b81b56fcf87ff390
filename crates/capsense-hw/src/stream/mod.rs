//! Byte streams of measuring boards: what they carry, and the formats they come in.
//!
//! [`Decoder`] turns bytes into [`Event`]s, [`Encoder`] turns samples into the bytes a board would send. Neither reads, waits or looks at a clock. One file owns one format: lines of text, frames between
//! markers, and COBS frames with a checksum.

pub mod checksum;
mod cobs;
mod decoder;
mod framed;
mod hex;
mod line;
mod number;
mod text;

pub use self::cobs::CobsFormat;
pub use decoder::{Decoder, Start};
pub use framed::{ByteOrder, Field, FrameLength, FramedFormat, NumberType, TrailingChecksum, ValueBlock};
pub use text::{Column, LineLayout, TextFormat};

use serde::{Deserialize, Serialize};
use std::time::Duration;

/// Most channels that one sample can have.
pub const MOST_CHANNELS: usize = 256;

/// What a board sent for one channel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Value {
    /// A finite number, not yet interpreted: a converter's word, or the number that firmware printed.
    Number(f64),
    /// Nothing: an empty field, a channel that is not in this line, or the number that stands for nothing.
    #[default]
    Missing,
    /// Something that is no number: a word for an error, `nan`, digits that make no sense.
    Invalid,
}

/// One sample of all channels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample<'a> {
    /// Values by channel.
    pub values: &'a [Value],
    /// The board's own count of samples, where it sends one.
    pub sequence: Option<u32>,
    /// The board's own clock, where it sends it.
    pub device_time: Option<Duration>,
    /// Status bits as the board sends them; 0 where it sends none.
    pub status: u32,
}

/// What bytes turned out to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event<'a> {
    /// A sample.
    Sample(Sample<'a>),
    /// A line that is no sample, such as a banner or a header, without its end.
    Text(&'a [u8]),
    /// Bytes that belong to nothing and were passed over.
    Resync,
    /// Samples are missing before the next one: how many, or `None` where the board began to count anew.
    Gap(Option<u32>),
}

/// An event with its time and its bytes.
///
/// The spans of all events of a stream tile it: each begins where the one before ends, and only [`Event::Gap`] has
/// none of the bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stamped<'a> {
    /// When the last byte of the event was read, as told to [`Decoder::push`].
    pub host_time: Duration,
    /// Number of bytes of the stream before the event.
    pub offset: u64,
    /// Number of bytes of the event.
    pub length: u64,
    /// What these bytes are.
    pub event: Event<'a>,
}

/// How samples are written into bytes.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum StreamFormat {
    /// Lines of text.
    Text(TextFormat),
    /// Frames between markers, of fixed or of told length, with or without a checksum.
    Framed(FramedFormat),
    /// This project's own: COBS frames with a CRC-16, a sequence number and the board's clock.
    Cobs(CobsFormat),
}

/// A format that no board could send: a key below its table, and why.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{key}: {message}")]
pub struct FormatError {
    /// The key.
    pub key: &'static str,
    /// What is wrong with it.
    pub message: String,
}

impl FormatError {
    fn new(key: &'static str, message: impl Into<String>) -> Self {
        Self { key, message: message.into() }
    }
}

impl StreamFormat {
    /// Number of values in a sample; `None` for any number.
    pub fn channels(&self) -> Option<usize> {
        match self {
            Self::Text(format) => format.channels,
            Self::Framed(format) => format.channels,
            Self::Cobs(format) => format.channels,
        }
    }

    /// Tells the format how many values a sample has; `None` for any number.
    pub fn set_channels(&mut self, channels: Option<usize>) {
        match self {
            Self::Text(format) => format.channels = channels,
            Self::Framed(format) => format.channels = channels,
            Self::Cobs(format) => format.channels = channels,
        }
    }

    /// Whether a board could send this.
    ///
    /// # Errors
    /// What is wrong first.
    pub fn check(&self) -> Result<(), FormatError> {
        if self.channels().is_some_and(|channels| !(1..=MOST_CHANNELS).contains(&channels)) {
            return Err(FormatError::new("channels", format!("must be from 1 to {MOST_CHANNELS}")));
        }
        match self {
            Self::Text(format) => format.check(),
            Self::Framed(format) => format.check(),
            Self::Cobs(_) => Ok(()),
        }
    }
}

/// Writes samples as a board would send them.
#[derive(Clone, Debug)]
pub struct Encoder(StreamFormat);

impl Encoder {
    /// An encoder of a format.
    ///
    /// # Errors
    /// When no board could send the format.
    pub fn new(format: &StreamFormat) -> Result<Self, FormatError> {
        format.check()?;
        Ok(Self(format.clone()))
    }

    /// Appends the bytes of a sample.
    ///
    /// [`Value::Missing`] and [`Value::Invalid`] are written as zero where a format has no other way to say them. Values
    /// beyond the format's number of channels are left out.
    pub fn encode(&self, sample: &Sample<'_>, bytes: &mut Vec<u8>) {
        let most = self.0.channels().unwrap_or(MOST_CHANNELS).min(sample.values.len());
        let sample = Sample { values: &sample.values[..most], ..*sample };
        match &self.0 {
            StreamFormat::Text(format) => format.encode(&sample, bytes),
            StreamFormat::Framed(format) => format.encode(&sample, bytes),
            StreamFormat::Cobs(format) => format.encode(&sample, bytes),
        }
    }
}

/// What comes after a start that bytes must have. An empty one has no memory: to compare with it took most of the time of a
/// short line or frame, as masked loads from where nothing is are slow.
fn after_start<'a>(bytes: &'a [u8], start: &[u8]) -> Option<&'a [u8]> {
    if start.is_empty() { Some(bytes) } else { bytes.strip_prefix(start) }
}

/// What comes before an end that bytes must have.
fn before_end<'a>(bytes: &'a [u8], end: &[u8]) -> Option<&'a [u8]> {
    if end.is_empty() { Some(bytes) } else { bytes.strip_suffix(end) }
}

/// What the bytes at hand begin with.
#[derive(Clone, Debug, PartialEq)]
enum Step {
    /// More bytes could change the answer.
    Incomplete,
    /// So many bytes belong to nothing.
    Discard(usize),
    /// A line of so many bytes, of which the first `shown` are its text.
    Text { length: usize, shown: usize },
    /// A sample of so many bytes; its values are in the scratch space.
    Sample { length: usize, header: Header },
}

/// What a sample has beside its values.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Header {
    sequence: Option<u32>,
    /// The largest count, after which the board begins again at 0.
    last_count: u32,
    device_time: Option<Duration>,
    status: u32,
}

impl Default for Header {
    fn default() -> Self {
        Self { sequence: None, last_count: u32::MAX, device_time: None, status: 0 }
    }
}
