//! From a port to a recording: takes what the reading thread gives, decodes it, writes both.

use crate::port_reader::{PortEvent, PortNews, PortReader};
use crate::profile::DeviceProfile;
use crate::recording::{Note, RecordingError, RecordingWriter};
use crate::stream::{Decoder, Event, Stamped, Start};
use std::time::Duration;

/// How long to wait for the port before looking around.
const PATIENCE: Duration = Duration::from_millis(50);

/// What has come and gone so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Time since the beginning.
    pub time: Duration,
    /// Bytes that were recorded.
    pub bytes: u64,
    /// Samples among them.
    pub samples: u64,
    /// Lines that are no samples.
    pub lines: u64,
    /// Bytes that belonged to nothing.
    pub passed_over: u64,
    /// Samples that are missing by the board's own count.
    pub missing: u64,
    /// Bytes that were read and dropped.
    pub dropped: u64,
    /// How often the port was lost.
    pub disconnections: u64,
}

impl Counters {
    /// The part of all bytes that was dropped or belonged to nothing, from 0 to 1.
    pub fn loss(&self) -> f64 {
        let lost = (self.dropped + self.passed_over) as f64;
        lost / ((self.bytes + self.dropped) as f64).max(1.0)
    }
}

/// What a port says.
#[derive(Debug)]
pub enum Heard<'a> {
    /// It is there.
    Connected,
    /// It is gone, and waited for.
    Disconnected,
    /// The decoder found something in its bytes.
    Event(&'a Stamped<'a>),
}

/// Records a port until told to stop. `go_on` sees the counters at least every 50 ms and says whether to go on.
///
/// # Errors
/// When the recording cannot be written; the port may come and go.
pub fn record(
    reader: PortReader,
    profile: &DeviceProfile,
    writer: RecordingWriter,
    go_on: impl FnMut(&Counters) -> bool,
) -> Result<Counters, RecordingError> {
    receive(reader, profile, Some(writer), go_on, |_| ())
}

/// Listens to a port until told to stop, and records it if there is a recording: [`record`], for those who want to hear what
/// comes as well.
///
/// # Errors
/// When the recording cannot be written; the port may come and go.
pub fn receive(
    mut reader: PortReader,
    profile: &DeviceProfile,
    writer: Option<RecordingWriter>,
    mut go_on: impl FnMut(&Counters) -> bool,
    hear: impl FnMut(Heard<'_>),
) -> Result<Counters, RecordingError> {
    let begun = std::time::Instant::now();
    let mut session = Session {
        decoder: Decoder::new(&profile.stream, Start::Anywhere)?,
        profile,
        counters: Counters::default(),
        writer,
        hear,
    };
    while go_on(&session.counters) {
        match reader.next(PATIENCE) {
            Some(event) => session.take(event)?,
            None => session.counters.time = session.counters.time.max(begun.elapsed()),
        }
        if let Some(writer) = &mut session.writer {
            writer.tick(session.counters.time)?;
        }
    }
    let dropped = reader.stop();
    while let Some(event) = reader.next(Duration::ZERO) {
        session.take(event)?;
    }
    session.dropped(dropped)?;
    session.end_of_stream()?;
    if let Some(writer) = session.writer {
        writer.finish()?;
    }
    Ok(session.counters)
}

struct Session<'a, H> {
    decoder: Decoder,
    profile: &'a DeviceProfile,
    counters: Counters,
    writer: Option<RecordingWriter>,
    hear: H,
}

impl<H: FnMut(Heard<'_>)> Session<'_, H> {
    fn take(&mut self, event: PortEvent) -> Result<(), RecordingError> {
        self.counters.time = event.time;
        self.dropped(event.dropped)?;
        match event.what {
            PortNews::Connected => {
                (self.hear)(Heard::Connected);
                self.note(&Note::Connected)
            }
            PortNews::Disconnected(reason) => {
                self.counters.disconnections += 1;
                self.end_of_stream()?;
                (self.hear)(Heard::Disconnected);
                self.note(&Note::Disconnected { reason })
            }
            PortNews::Bytes(bytes) => {
                self.counters.bytes += bytes.len() as u64;
                if let Some(writer) = &mut self.writer {
                    writer.raw(event.time, &bytes)?;
                }
                self.decode(|decoder, events| decoder.push(&bytes, event.time, events))
            }
        }
    }

    fn note(&mut self, note: &Note) -> Result<(), RecordingError> {
        self.writer.as_mut().map_or(Ok(()), |writer| writer.note(self.counters.time, note))
    }

    /// Counts bytes that are missing here, and says so in the recording.
    fn dropped(&mut self, bytes: u64) -> Result<(), RecordingError> {
        if bytes == 0 {
            return Ok(());
        }
        self.counters.dropped += bytes;
        self.end_of_stream()?;
        self.note(&Note::Dropped { bytes })
    }

    /// What comes next does not continue what came before.
    fn end_of_stream(&mut self) -> Result<(), RecordingError> {
        let time = self.counters.time;
        self.decode(|decoder, events| decoder.finish(time, events))?;
        self.decoder = Decoder::new(&self.profile.stream, Start::Anywhere)?;
        Ok(())
    }

    fn decode(
        &mut self,
        work: impl FnOnce(&mut Decoder, &mut dyn FnMut(Stamped<'_>)),
    ) -> Result<(), RecordingError> {
        let Self { decoder, counters, writer, hear, .. } = self;
        let mut result = Ok(());
        work(decoder, &mut |stamped| {
            match stamped.event {
                Event::Sample(_) => counters.samples += 1,
                Event::Text(_) => counters.lines += 1,
                Event::Resync => counters.passed_over += stamped.length,
                Event::Gap(missing) => counters.missing += u64::from(missing.unwrap_or(0)),
            }
            hear(Heard::Event(&stamped));
            if let (Ok(()), Some(writer)) = (&result, writer.as_mut()) {
                result = writer.event(&stamped);
            }
        });
        result
    }
}
