//! Reads recordings message by message; never more than one chunk is in memory.

use super::{Header, NOTE, Note, RAW, RECORDING, RecordingError};
use mcap::Message;
use mcap::sans_io::LinearReaderOptions;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// No record of a recording is longer; one that claims to be is damage.
const LONGEST_RECORD: usize = 64 * 1024 * 1024;

/// Reads a recording from its beginning.
pub struct RecordingReader {
    path: PathBuf,
    messages: mcap::io::MessageReader<BufReader<File>>,
    header: Header,
}

/// What a recording holds of the port.
#[derive(Clone, Debug, PartialEq)]
pub enum Entry {
    /// What one read gave, and when.
    Raw(Duration, Vec<u8>),
    /// What happened, and when.
    Note(Duration, Note),
}

/// Messages of a file, which must be whole unless `cut` says that it need not be.
pub(super) fn messages(
    path: &Path,
    cut: bool,
) -> Result<mcap::io::MessageReader<BufReader<File>>, RecordingError> {
    let file = File::open(path).map_err(RecordingError::file(path))?;
    let options = LinearReaderOptions::default()
        .with_record_length_limit(LONGEST_RECORD)
        .with_skip_end_magic(cut)
        .with_validate_chunk_crcs(true);
    Ok(mcap::io::MessageReader::new_with_options(BufReader::new(file), options))
}

impl RecordingReader {
    /// Opens a recording.
    ///
    /// # Errors
    /// When it cannot be read, or is none.
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        let mut messages = messages(path, false)?;
        let foreign = |message: String| RecordingError::Foreign { path: path.to_owned(), message };
        let first = match messages.next() {
            Some(Ok(message)) if message.channel.topic == RECORDING => message,
            Some(Err(error)) => return Err(damaged(path, error)),
            Some(Ok(_)) | None => return Err(foreign(format!("it does not begin with {RECORDING}"))),
        };
        let header: Header =
            serde_json::from_slice(&first.data).map_err(|error| foreign(error.to_string()))?;
        if header.version != 1 {
            return Err(foreign(format!("version {} is not known", header.version)));
        }
        Ok(Self { path: path.to_owned(), messages, header })
    }

    /// Where the recording comes from.
    pub fn header(&self) -> &Header {
        &self.header
    }

    fn entry(&self, message: &Message<'_>) -> Result<Option<Entry>, RecordingError> {
        let time = Duration::from_nanos(message.log_time.saturating_sub(self.header.unix_nanoseconds));
        match message.channel.topic.as_str() {
            RAW => Ok(Some(Entry::Raw(time, message.data.to_vec()))),
            NOTE => match serde_json::from_slice(&message.data) {
                Ok(note) => Ok(Some(Entry::Note(time, note))),
                Err(error) => {
                    let message = format!("a note that is none: {error}");
                    Err(RecordingError::Foreign { path: self.path.clone(), message })
                }
            },
            _ => Ok(None),
        }
    }
}

impl Iterator for RecordingReader {
    type Item = Result<Entry, RecordingError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let entry = match self.messages.next()? {
                Ok(message) => self.entry(&message),
                Err(error) => Err(damaged(&self.path, error)),
            };
            match entry {
                Ok(None) => {}
                Ok(Some(entry)) => return Some(Ok(entry)),
                Err(error) => return Some(Err(error)),
            }
        }
    }
}

fn damaged(path: &Path, error: mcap::McapError) -> RecordingError {
    match error {
        mcap::McapError::Io(error) => RecordingError::File { path: path.to_owned(), error },
        error => RecordingError::Damaged { path: path.to_owned(), error },
    }
}
