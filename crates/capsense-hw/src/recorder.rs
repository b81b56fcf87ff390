//! From a port to a recording: takes what the reading thread gives, decodes it, writes both.

use crate::port_reader::{PortEvent, PortNews, PortReader};
use crate::profile::DeviceProfile;
use crate::recording::{Note, RecordingError, RecordingWriter};
use crate::stream::{Decoder, Event, Start};
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

/// Records a port until told to stop. `go_on` sees the counters at least every 50 ms and says whether to go on.
///
/// # Errors
/// When the recording cannot be written; the port may come and go.
pub fn record(
    mut reader: PortReader,
    profile: &DeviceProfile,
    mut writer: RecordingWriter,
    mut go_on: impl FnMut(&Counters) -> bool,
) -> Result<Counters, RecordingError> {
    let begun = std::time::Instant::now();
    let mut session = Session {
        decoder: Decoder::new(&profile.stream, Start::Anywhere)?,
        profile,
        counters: Counters::default(),
        writer: &mut writer,
    };
    while go_on(&session.counters) {
        match reader.next(PATIENCE) {
            Some(event) => session.take(event)?,
            None => session.counters.time = session.counters.time.max(begun.elapsed()),
        }
        session.writer.tick(session.counters.time)?;
    }
    let dropped = reader.stop();
    while let Some(event) = reader.next(Duration::ZERO) {
        session.take(event)?;
    }
    session.dropped(dropped)?;
    session.end_of_stream()?;
    let counters = session.counters;
    writer.finish()?;
    Ok(counters)
}

struct Session<'a> {
    decoder: Decoder,
    profile: &'a DeviceProfile,
    counters: Counters,
    writer: &'a mut RecordingWriter,
}

impl Session<'_> {
    fn take(&mut self, event: PortEvent) -> Result<(), RecordingError> {
        self.counters.time = event.time;
        self.dropped(event.dropped)?;
        match event.what {
            PortNews::Connected => self.writer.note(event.time, &Note::Connected),
            PortNews::Disconnected(reason) => {
                self.counters.disconnections += 1;
                self.end_of_stream()?;
                self.writer.note(event.time, &Note::Disconnected { reason })
            }
            PortNews::Bytes(bytes) => {
                self.counters.bytes += bytes.len() as u64;
                self.writer.raw(event.time, &bytes)?;
                self.decode(|decoder, events| decoder.push(&bytes, event.time, events))
            }
        }
    }

    /// Counts bytes that are missing here, and says so in the recording.
    fn dropped(&mut self, bytes: u64) -> Result<(), RecordingError> {
        if bytes == 0 {
            return Ok(());
        }
        self.counters.dropped += bytes;
        self.end_of_stream()?;
        self.writer.note(self.counters.time, &Note::Dropped { bytes })
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
        work: impl FnOnce(&mut Decoder, &mut dyn FnMut(crate::stream::Stamped<'_>)),
    ) -> Result<(), RecordingError> {
        let Self { decoder, counters, writer, .. } = self;
        let mut result = Ok(());
        work(decoder, &mut |stamped| {
            match stamped.event {
                Event::Sample(_) => counters.samples += 1,
                Event::Text(_) => counters.lines += 1,
                Event::Resync => counters.passed_over += stamped.length,
                Event::Gap(missing) => counters.missing += u64::from(missing.unwrap_or(0)),
            }
            if result.is_ok() {
                result = writer.event(&stamped);
            }
        });
        result
    }
}
