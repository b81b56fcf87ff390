//! The samples of a recording, decoded from its bytes.

use super::{Entry, Note, RecordingError, RecordingReader};
use crate::profile::DeviceProfile;
use crate::stream::{Decoder, Event, Start, Value};
use std::collections::VecDeque;
use std::time::Duration;

/// A sample with its own memory.
#[derive(Clone, Debug, PartialEq)]
pub struct Decoded {
    /// When its last byte was read, since the beginning of the recording.
    pub time: Duration,
    /// Values by channel.
    pub values: Vec<Value>,
    /// The board's own count of samples.
    pub sequence: Option<u32>,
    /// The board's own clock.
    pub device_time: Option<Duration>,
    /// Status bits.
    pub status: u32,
}

/// Decodes a recording's bytes into samples.
pub struct Samples {
    reader: RecordingReader,
    profile: DeviceProfile,
    decoder: Decoder,
    ready: VecDeque<Decoded>,
    time: Duration,
    ended: bool,
}

impl Samples {
    /// With a profile of one's own, or with that of the recording.
    ///
    /// # Errors
    /// When there is no sense in the profile.
    pub fn new(reader: RecordingReader, profile: Option<DeviceProfile>) -> Result<Self, RecordingError> {
        let profile = profile.map_or_else(|| reader.header().device_profile(), Ok)?;
        let decoder = Decoder::new(&profile.stream, Start::Anywhere)?;
        Ok(Self { reader, profile, decoder, ready: VecDeque::new(), time: Duration::ZERO, ended: false })
    }

    /// The profile that is used.
    pub fn profile(&self) -> &DeviceProfile {
        &self.profile
    }

    fn take(&mut self, entry: Option<Entry>) -> Result<(), RecordingError> {
        let ready = &mut self.ready;
        let mut keep = |stamped: crate::stream::Stamped<'_>| {
            if let Event::Sample(sample) = stamped.event {
                ready.push_back(Decoded {
                    time: stamped.host_time,
                    values: sample.values.to_vec(),
                    sequence: sample.sequence,
                    device_time: sample.device_time,
                    status: sample.status,
                });
            }
        };
        match entry {
            Some(Entry::Raw(time, bytes)) => {
                self.time = time;
                self.decoder.push(&bytes, time, &mut keep);
            }
            // What comes next does not continue what came before.
            Some(Entry::Note(time, Note::Disconnected { .. } | Note::Dropped { .. })) => {
                self.decoder.finish(time, &mut keep);
                self.decoder = Decoder::new(&self.profile.stream, Start::Anywhere)?;
            }
            Some(Entry::Note(..)) => {}
            None => {
                self.ended = true;
                self.decoder.finish(self.time, &mut keep);
            }
        }
        Ok(())
    }
}

impl Iterator for Samples {
    type Item = Result<Decoded, RecordingError>;

    fn next(&mut self) -> Option<Self::Item> {
        while self.ready.is_empty() && !self.ended {
            let entry = match self.reader.next().transpose() {
                Ok(entry) => entry,
                Err(error) => {
                    self.ended = true;
                    return Some(Err(error));
                }
            };
            if let Err(error) = self.take(entry) {
                return Some(Err(error));
            }
        }
        self.ready.pop_front().map(Ok)
    }
}
