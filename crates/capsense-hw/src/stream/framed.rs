//! Frames between markers: a start, a length that is fixed or told, a checksum, an end; each may be absent.
//!
//! What fails a test is passed over by one byte only, so that a frame behind a damaged one is found wherever it begins:
//! skipping the length that a damaged frame claims loses several times as many. Frames without a checksum are believed
//! only where another or the end of the stream follows, or behind one that was.

use super::checksum::Checksum;
use super::decoder::Start;
use super::{FormatError, Header, MOST_CHANNELS, Sample, Step, Value, after_start, before_end, hex};
use serde::{Deserialize, Serialize};

/// Longest frame, in bytes.
const MOST_FRAME: usize = 4096;

/// Frames between markers.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct FramedFormat {
    /// Bytes that each frame begins with.
    #[serde(default, with = "hex", skip_serializing_if = "Vec::is_empty")]
    pub start: Vec<u8>,
    /// Bytes that each frame ends with.
    #[serde(default, with = "hex", skip_serializing_if = "Vec::is_empty")]
    pub end: Vec<u8>,
    /// How long a frame is.
    pub length: FrameLength,
    /// The checksum before the end marker.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub checksum: Option<TrailingChecksum>,
    /// Where the values are.
    pub values: ValueBlock,
    /// Where status bits are.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub status: Option<Field>,
    /// Where the count of samples is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sequence: Option<Field>,
    /// How many values a frame has; `None` for any number.
    #[serde(skip)]
    pub channels: Option<usize>,
}

/// How long a frame is, from the first byte of its start to the last of its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum FrameLength {
    /// So many bytes.
    Fixed(usize),
    /// A number in the frame, and so many bytes more.
    Told {
        /// Where the number is.
        field: Field,
        /// What it does not count.
        plus: usize,
    },
}

/// An unsigned number in a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Field {
    /// Bytes of the frame before it.
    pub offset: usize,
    /// Its width; unsigned.
    pub number: NumberType,
    /// Order of its bytes.
    #[serde(default)]
    pub order: ByteOrder,
}

/// Order of bytes in a number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ByteOrder {
    /// The least significant first.
    #[default]
    Little,
    /// The most significant first.
    Big,
}

/// Types of numbers in frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs, reason = "the names say it")]
pub enum NumberType {
    U8,
    I8,
    U16,
    I16,
    U24,
    I24,
    U32,
    I32,
    F32,
}

/// A checksum before the end marker.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct TrailingChecksum {
    /// Which.
    pub kind: Checksum,
    /// Order of its bytes.
    #[serde(default)]
    pub order: ByteOrder,
    /// Bytes at the front of the frame that it does not cover.
    #[serde(default)]
    pub from: usize,
}

/// Values one after the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct ValueBlock {
    /// Bytes of the frame before the first.
    pub offset: usize,
    /// Type of each.
    pub number: NumberType,
    /// Order of its bytes.
    #[serde(default)]
    pub order: ByteOrder,
}

impl NumberType {
    /// Number of its bytes.
    pub fn size(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U24 | Self::I24 => 3,
            Self::U32 | Self::I32 | Self::F32 => 4,
        }
    }

    fn signed(self) -> bool {
        matches!(self, Self::I8 | Self::I16 | Self::I24 | Self::I32)
    }

    fn value(self, bits: u32) -> Value {
        match self {
            Self::F32 => {
                let number = f64::from(f32::from_bits(bits));
                if number.is_finite() { Value::Number(number) } else { Value::Invalid }
            }
            _ if self.signed() => {
                let unused = 32 - 8 * self.size();
                Value::Number(f64::from(((bits << unused) as i32) >> unused))
            }
            _ => Value::Number(f64::from(bits)),
        }
    }

    /// The low bits of a value; what is missing is zero, or not a number where there is such a thing.
    fn bits(self, value: Value) -> u32 {
        match (self, value) {
            (Self::F32, Value::Number(number)) => (number as f32).to_bits(),
            (Self::F32, _) => f32::NAN.to_bits(),
            (_, Value::Number(number)) => number as i64 as u32,
            (_, Value::Missing | Value::Invalid) => 0,
        }
    }
}

impl ByteOrder {
    fn read(self, bytes: &[u8]) -> u32 {
        let join = |number: u32, byte: &u8| number << 8 | u32::from(*byte);
        match self {
            Self::Little => bytes.iter().rev().fold(0, join),
            Self::Big => bytes.iter().fold(0, join),
        }
    }

    fn write(self, number: u32, bytes: &mut [u8]) {
        let size = bytes.len();
        for (at, byte) in bytes.iter_mut().enumerate() {
            let place = match self {
                Self::Little => at,
                Self::Big => size - 1 - at,
            };
            *byte = (number >> (8 * place)) as u8;
        }
    }
}

impl Field {
    fn end(&self) -> usize {
        self.offset.saturating_add(self.number.size())
    }

    fn read(&self, frame: &[u8]) -> Option<u32> {
        frame.get(self.offset..self.end()).map(|bytes| self.order.read(bytes))
    }

    fn write(&self, number: u32, frame: &mut [u8]) {
        if let Some(bytes) = frame.get_mut(self.offset..self.end()) {
            self.order.write(number, bytes);
        }
    }
}

impl FramedFormat {
    pub(super) fn check(&self) -> Result<(), FormatError> {
        if self.start.is_empty() && self.end.is_empty() {
            return Err(FormatError::new("start", "a frame needs a start or an end"));
        }
        if matches!(self.length, FrameLength::Told { .. })
            && (self.checksum.is_none() || self.start.is_empty())
        {
            return Err(FormatError::new("length", "a told length needs a start and a checksum"));
        }
        if !(self.start.len()..MOST_FRAME).contains(&self.values.offset) {
            return Err(FormatError::new("values", "must lie behind the start"));
        }
        let values = self.values.offset + self.values.number.size() * self.channels.unwrap_or(1);
        let fields = [self.status, self.sequence].into_iter().flatten().map(|field| field.end());
        let covered = self.checksum.map_or(0, |checksum| checksum.from);
        let body = fields.chain([values, covered]).max().unwrap_or(0);
        let least = body.saturating_add(self.trailer());
        match self.length {
            FrameLength::Fixed(length) if length > MOST_FRAME => {
                Err(FormatError::new("length", format!("must not be above {MOST_FRAME}")))
            }
            FrameLength::Fixed(length) if length < least => Err(FormatError::new(
                "length",
                format!("must be at least {least}, to hold all that is in the frame"),
            )),
            FrameLength::Told { field, plus } if field.end() > body || plus > MOST_FRAME => {
                Err(FormatError::new("length", "the number must lie before the end of the shortest frame"))
            }
            _ if least > MOST_FRAME => {
                Err(FormatError::new("values", format!("the frame must not be longer than {MOST_FRAME}")))
            }
            _ => Ok(()),
        }
    }

    /// Bytes after the values: checksum and end marker.
    fn trailer(&self) -> usize {
        self.checksum.map_or(0, |checksum| checksum.kind.size()) + self.end.len()
    }

    pub(super) fn encode(&self, sample: &Sample<'_>, bytes: &mut Vec<u8>) {
        let size = self.values.number.size();
        let length = match self.length {
            FrameLength::Fixed(length) => length,
            FrameLength::Told { .. } => self.values.offset + size * sample.values.len() + self.trailer(),
        };
        let first = bytes.len();
        bytes.resize(first + length, 0);
        let frame = &mut bytes[first..];
        frame[..self.start.len()].copy_from_slice(&self.start);
        frame[length - self.end.len()..].copy_from_slice(&self.end);
        if let FrameLength::Told { field, plus } = self.length {
            field.write(length.saturating_sub(plus) as u32, frame);
        }
        if let Some(status) = self.status {
            status.write(sample.status, frame);
        }
        if let Some(sequence) = self.sequence {
            sequence.write(sample.sequence.unwrap_or(0), frame);
        }
        let places = frame[self.values.offset..length - self.trailer()].chunks_exact_mut(size);
        for (place, value) in places.zip(sample.values) {
            self.values.order.write(self.values.number.bits(*value), place);
        }
        if let Some(checksum) = self.checksum {
            let (covered, rest) = frame.split_at_mut(length - self.trailer());
            let sum = checksum.kind.of(&covered[checksum.from..]);
            checksum.order.write(sum, &mut rest[..checksum.kind.size()]);
        }
    }

    /// Length of the frame that begins here: `None` if the bytes do not reach as far as the number that tells it.
    fn length(&self, bytes: &[u8]) -> Option<usize> {
        match self.length {
            FrameLength::Fixed(length) => Some(length),
            FrameLength::Told { field, plus } => {
                field.read(bytes).map(|told| (told as usize).saturating_add(plus))
            }
        }
    }

    /// How many values lie in a frame of a length, if it is one.
    fn count(&self, length: usize) -> Option<usize> {
        let room = length.checked_sub(self.values.offset + self.trailer())?;
        let told = matches!(self.length, FrameLength::Told { .. });
        let count = match self.channels {
            Some(channels) if !told => channels,
            _ if room.is_multiple_of(self.values.number.size()) => room / self.values.number.size(),
            _ => return None,
        };
        let expected = self.channels.is_none_or(|channels| channels == count);
        (expected && (1..=MOST_CHANNELS).contains(&count)).then_some(count)
    }

    /// Whether these bytes, of a frame's length, have its markers and checksum.
    fn holds(&self, frame: &[u8]) -> bool {
        let Some((body, trailer)) = frame.split_at_checked(frame.len().wrapping_sub(self.trailer())) else {
            return false;
        };
        let sound = |checksum: TrailingChecksum| {
            let sum = checksum.order.read(&trailer[..checksum.kind.size()]);
            body.get(checksum.from..).is_some_and(|covered| checksum.kind.of(covered) == sum)
        };
        after_start(frame, &self.start).is_some()
            && before_end(frame, &self.end).is_some()
            && self.checksum.is_none_or(sound)
    }
}

/// Finds frames in a stream.
#[derive(Clone, Debug)]
pub(super) struct Framing {
    format: FramedFormat,
    /// The bytes before these were a frame, or a frame is known to begin here.
    locked: bool,
}

impl Framing {
    pub(super) fn new(format: &FramedFormat, start: Start) -> Self {
        Self { format: format.clone(), locked: start == Start::Boundary }
    }

    /// `at_end` says that nothing follows the bytes.
    pub(super) fn next(&mut self, bytes: &[u8], at_end: bool, values: &mut Vec<Value>) -> Step {
        let format = &self.format;
        if let Some(away) = away(&format.start, bytes) {
            self.locked = false;
            return Step::Discard(away);
        }
        let Some(length) = format.length(bytes) else { return Step::Incomplete };
        let Some(count) = format.count(length).filter(|_| length <= MOST_FRAME) else {
            self.locked = false;
            return Step::Discard(1);
        };
        let Some((frame, behind)) = bytes.split_at_checked(length) else { return Step::Incomplete };
        if !format.holds(frame) {
            self.locked = false;
            return Step::Discard(1);
        }
        if format.checksum.is_none() && !self.locked {
            // Without a checksum all frames have one length.
            match behind.get(..length) {
                None if at_end && behind.is_empty() => {}
                None => return Step::Incomplete,
                Some(next) if !format.holds(next) => return Step::Discard(1),
                Some(_) => {}
            }
        }
        self.locked = true;
        values.clear();
        let places = frame[format.values.offset..].chunks_exact(format.values.number.size()).take(count);
        values.extend(places.map(|place| format.values.number.value(format.values.order.read(place))));
        let header = Header {
            sequence: format.sequence.and_then(|field| field.read(frame)),
            last_count: format.sequence.map_or(u32::MAX, |field| u32::MAX >> (32 - 8 * field.number.size())),
            status: format.status.and_then(|field| field.read(frame)).unwrap_or(0),
            ..Header::default()
        };
        Step::Sample { length, header }
    }
}

/// How far away the next place is at which the start may begin; `None` if here.
fn away(start: &[u8], bytes: &[u8]) -> Option<usize> {
    let first = *start.first()?;
    let known = bytes.len().min(start.len());
    if bytes[..known] == start[..known] {
        return None;
    }
    Some(memchr::memchr(first, &bytes[1..]).map_or(bytes.len(), |at| at + 1))
}
