//! From bytes, in whatever pieces they come, to events: buffering, counting of what is passed over, gaps.
//!
//! Formats only say what the bytes at hand begin with ([`Step`]). An answer other than "incomplete" must not depend on
//! what follows; so the events do not depend on how the stream was cut into pieces.

use super::cobs::CobsFraming;
use super::framed::Framing;
use super::text::Lines;
use super::{Event, FormatError, Header, MOST_CHANNELS, Sample, Stamped, Step, StreamFormat, Value};
use std::time::Duration;

/// Bytes that are looked at together. No format needs more than a quarter of them to know what they begin with.
const BUFFER: usize = 64 * 1024;

/// A longer run of passed-over bytes is reported in parts.
const LONGEST_RUN: u64 = 64 * 1024;

/// Whether the first byte of a stream begins a line or frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Start {
    /// It may be in the middle of one, as when a port is opened while the board talks. What may be cut is passed over.
    #[default]
    Anywhere,
    /// It does, as in the output of an [`Encoder`](super::Encoder).
    Boundary,
}

/// Turns the bytes of a stream into events, without reading or waiting.
///
/// Whatever the bytes are: it never fails, needs a fixed amount of memory and time linear in their number, and every
/// byte belongs to exactly one event. The events do not depend on how the bytes are cut into pieces.
///
/// ```
/// use capsense_hw::stream::{Decoder, Event, Start, StreamFormat, TextFormat};
/// use std::time::Duration;
///
/// let mut decoder = Decoder::new(&StreamFormat::Text(TextFormat::default()), Start::Boundary)?;
/// let mut lines = Vec::new();
/// for piece in [&b"12,1"[..], b"3\nhello\n"] {
///     decoder.push(piece, Duration::ZERO, &mut |stamped| {
///         lines.push(match stamped.event {
///             Event::Sample(sample) => format!("{:?}", sample.values),
///             other => format!("{other:?}"),
///         });
///     });
/// }
/// assert_eq!(lines[0], "[Number(12.0), Number(13.0)]");
/// assert_eq!(lines.len(), 2);
/// # Ok::<(), capsense_hw::stream::FormatError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Decoder {
    format: Format,
    buffer: Vec<u8>,
    /// Bytes at the front of the buffer that are known to be incomplete.
    scanned: usize,
    /// Bytes of the stream before the buffer.
    offset: u64,
    /// Bytes before the current position that belong to nothing and are not reported yet.
    run: u64,
    values: Vec<Value>,
    last_sequence: Option<u32>,
}

#[derive(Clone, Debug)]
enum Format {
    Text(Box<Lines>),
    Framed(Framing),
    Cobs(CobsFraming),
}

impl Format {
    fn next(&mut self, bytes: &[u8], scanned: usize, at_end: bool, values: &mut Vec<Value>) -> Step {
        match self {
            Self::Text(lines) => lines.next(bytes, scanned, values),
            Self::Framed(framing) => framing.next(bytes, at_end, values),
            Self::Cobs(framing) => framing.next(bytes, scanned, values),
        }
    }
}

impl Decoder {
    /// A decoder at the start of a stream.
    ///
    /// # Errors
    /// When no board could send the format.
    pub fn new(format: &StreamFormat, start: Start) -> Result<Self, FormatError> {
        format.check()?;
        Ok(Self {
            format: match format {
                StreamFormat::Text(text) => Format::Text(Box::new(Lines::new(text, start))),
                StreamFormat::Framed(framed) => Format::Framed(Framing::new(framed, start)),
                StreamFormat::Cobs(cobs) => Format::Cobs(CobsFraming::new(cobs)),
            },
            buffer: Vec::with_capacity(BUFFER),
            scanned: 0,
            offset: 0,
            run: 0,
            values: Vec::with_capacity(MOST_CHANNELS),
            last_sequence: None,
        })
    }

    /// Takes the next bytes of the stream and tells what they complete. `host_time` is when they were read.
    pub fn push(
        &mut self,
        mut bytes: &[u8],
        host_time: Duration,
        events: &mut (impl FnMut(Stamped<'_>) + ?Sized),
    ) {
        while !bytes.is_empty() {
            let (now, later) = bytes.split_at(bytes.len().min(BUFFER - self.buffer.len()));
            self.buffer.extend_from_slice(now);
            self.decode(host_time, false, events);
            bytes = later;
        }
    }

    /// Ends the stream: what is still incomplete stays so. The decoder may not be used for another stream.
    pub fn finish(&mut self, host_time: Duration, events: &mut (impl FnMut(Stamped<'_>) + ?Sized)) {
        self.decode(host_time, true, events);
        report_run(&mut self.run, self.offset, host_time, events);
    }

    fn decode(&mut self, host_time: Duration, at_end: bool, events: &mut (impl FnMut(Stamped<'_>) + ?Sized)) {
        let mut at = 0;
        while at < self.buffer.len() {
            let bytes = &self.buffer[at..];
            let offset = self.offset + at as u64;
            match self.format.next(bytes, self.scanned, at_end, &mut self.values) {
                Step::Incomplete if !at_end => {
                    self.scanned = bytes.len();
                    break;
                }
                Step::Incomplete => {
                    self.scanned = bytes.len() - 1;
                    self.run += 1;
                    at += 1;
                    continue;
                }
                Step::Discard(length) => {
                    self.run += length as u64;
                    at += length;
                    while self.run >= LONGEST_RUN {
                        let end = self.offset + at as u64;
                        let event = Event::Resync;
                        events(Stamped { host_time, offset: end - self.run, length: LONGEST_RUN, event });
                        self.run -= LONGEST_RUN;
                    }
                }
                Step::Text { length, shown } => {
                    report_run(&mut self.run, offset, host_time, events);
                    let event = Event::Text(&bytes[..shown]);
                    events(Stamped { host_time, offset, length: length as u64, event });
                    at += length;
                }
                Step::Sample { length, header } => {
                    report_run(&mut self.run, offset, host_time, events);
                    if let Some(gap) = gap(&mut self.last_sequence, &header) {
                        events(Stamped { host_time, offset, length: 0, event: Event::Gap(gap) });
                    }
                    let Header { sequence, device_time, status, .. } = header;
                    let sample = Sample { values: &self.values, sequence, device_time, status };
                    let event = Event::Sample(sample);
                    events(Stamped { host_time, offset, length: length as u64, event });
                    at += length;
                }
            }
            self.scanned = 0;
        }
        self.buffer.drain(..at);
        self.offset += at as u64;
    }
}

fn report_run(run: &mut u64, end: u64, host_time: Duration, events: &mut (impl FnMut(Stamped<'_>) + ?Sized)) {
    let length = std::mem::take(run);
    if length > 0 {
        events(Stamped { host_time, offset: end - length, length, event: Event::Resync });
    }
}

/// What lies between the last sample and this one, if not nothing. A gap of more than half of all counts is taken for a
/// board that counts anew.
fn gap(last: &mut Option<u32>, header: &Header) -> Option<Option<u32>> {
    let sequence = header.sequence?;
    let missing = sequence.wrapping_sub(last.replace(sequence)?).wrapping_sub(1) & header.last_count;
    match missing {
        0 => None,
        _ if missing <= header.last_count / 2 => Some(Some(missing)),
        _ => Some(None),
    }
}
