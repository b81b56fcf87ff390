//! This project's own frames, for firmware that can choose: a sample with a sequence number, the board's clock and a
//! CRC-16, in consistent overhead byte stuffing (Cheshire and Baker, 1999), so that a zero byte ends each frame and
//! appears nowhere else.
//!
//! Before stuffing, little-endian: version (1 byte, 1), number of the board (1 byte), sequence (4 bytes), board's clock
//! in microseconds (8 bytes), status (1 byte), values (4 bytes each, two's complement), CRC-16/IBM-3740 of all that
//! (2 bytes).

use super::checksum::Checksum;
use super::{Header, MOST_CHANNELS, Sample, Step, Value};
use serde::{Deserialize, Serialize};
use std::time::Duration;

const VERSION: u8 = 1;
const HEADER: usize = 15;
const VALUE: usize = 4;
const CHECKSUM: Checksum = Checksum::Crc16Ibm3740;
const MOST_PLAIN: usize = HEADER + VALUE * MOST_CHANNELS + 2;

/// Stuffing adds one byte to every 254 begun; then comes the zero.
const MOST_STUFFED: usize = MOST_PLAIN + MOST_PLAIN.div_ceil(254) + 1;

/// COBS frames of version 1.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct CobsFormat {
    /// Number of the board, where several share a line: frames of others are passed over. `None` takes all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub board: Option<u8>,
    /// How many values a frame has; `None` for any number.
    #[serde(skip)]
    pub channels: Option<usize>,
}

impl CobsFormat {
    pub(super) fn encode(&self, sample: &Sample<'_>, bytes: &mut Vec<u8>) {
        let mut plain = Vec::with_capacity(MOST_PLAIN);
        plain.extend([VERSION, self.board.unwrap_or(0)]);
        plain.extend(sample.sequence.unwrap_or(0).to_le_bytes());
        let microseconds = sample.device_time.unwrap_or_default().as_micros();
        plain.extend(u64::try_from(microseconds).unwrap_or(u64::MAX).to_le_bytes());
        plain.push(sample.status as u8);
        for value in sample.values.iter().take(MOST_CHANNELS) {
            plain.extend(word(*value).to_le_bytes());
        }
        plain.extend((CHECKSUM.of(&plain) as u16).to_le_bytes());
        bytes.extend(cobs::encode_vec(&plain));
        bytes.push(0);
    }
}

/// The low 32 bits of a value; what is missing is zero.
fn word(value: Value) -> u32 {
    match value {
        Value::Number(number) => number as i64 as u32,
        Value::Missing | Value::Invalid => 0,
    }
}

#[derive(Clone, Debug)]
pub(super) struct CobsFraming {
    format: CobsFormat,
    plain: Vec<u8>,
    /// Within something too long for a frame: nothing is looked for before the next zero.
    skipping: bool,
}

impl CobsFraming {
    pub(super) fn new(format: &CobsFormat) -> Self {
        Self { format: format.clone(), plain: Vec::with_capacity(MOST_STUFFED), skipping: false }
    }

    pub(super) fn next(&mut self, bytes: &[u8], scanned: usize, values: &mut Vec<Value>) -> Step {
        let limit = if self.skipping { bytes.len() } else { bytes.len().min(MOST_STUFFED) };
        let zero = memchr::memchr(0, &bytes[scanned.min(limit)..limit]).map(|at| at + scanned.min(limit));
        match zero {
            Some(at) if std::mem::take(&mut self.skipping) => Step::Discard(at + 1),
            Some(at) => match self.frame(&bytes[..at], values) {
                Some(header) => Step::Sample { length: at + 1, header },
                None => Step::Discard(at + 1),
            },
            None if self.skipping || limit == MOST_STUFFED => {
                self.skipping = true;
                Step::Discard(limit)
            }
            None => Step::Incomplete,
        }
    }

    fn frame(&mut self, stuffed: &[u8], values: &mut Vec<Value>) -> Option<Header> {
        self.plain.clear();
        self.plain.extend_from_slice(stuffed);
        let length = cobs::decode_in_place(&mut self.plain).ok()?;
        let (covered, checksum) = self.plain.get(..length)?.split_last_chunk::<2>()?;
        if CHECKSUM.of(covered) != u32::from(u16::from_le_bytes(*checksum)) {
            return None;
        }
        let (head, body) = covered.split_first_chunk::<HEADER>()?;
        let [version, board, s0, s1, s2, s3, clock @ .., status] = *head;
        let (words, rest) = body.as_chunks::<VALUE>();
        let expected = self.format.channels.is_none_or(|channels| channels == words.len());
        let ours = self.format.board.is_none_or(|ours| ours == board);
        if version != VERSION || !ours || !expected || !rest.is_empty() || words.len() > MOST_CHANNELS {
            return None;
        }
        values.clear();
        values.extend(words.iter().map(|word| Value::Number(i32::from_le_bytes(*word).into())));
        Some(Header {
            sequence: Some(u32::from_le_bytes([s0, s1, s2, s3])),
            device_time: Some(Duration::from_micros(u64::from_le_bytes(clock))),
            status: status.into(),
            ..Header::default()
        })
    }
}
