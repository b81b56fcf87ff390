//! Makes a recording of one that was cut off.

use super::reader::messages;
use super::writer::{create_partial, finish_partial};
use super::{RECORDING, RecordingError};
use std::path::Path;

/// What was saved.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecoveryReport {
    /// Number of messages.
    pub messages: u64,
    /// Why there are no more; `None` if the recording was whole.
    pub cut_off: Option<String>,
}

/// Copies all whole chunks of a recording, which may be cut off at any byte, to a new one.
///
/// # Errors
/// When not even the recording's header is there, or a file cannot be read or written.
pub fn recover(from: &Path, to: &Path) -> Result<RecoveryReport, RecordingError> {
    let mut messages = messages(from, true)?.peekable();
    let begins = messages
        .peek()
        .is_some_and(|first| matches!(first, Ok(message) if message.channel.topic == RECORDING));
    if !begins {
        let message = "there is no whole chunk with its header".to_owned();
        return Err(RecordingError::Foreign { path: from.to_owned(), message });
    }
    // Not the name of a recording that is cut off: most often that is the one to recover.
    let (partial, mut file) = create_partial(to, ".recovering")?;
    let mut report = RecoveryReport { messages: 0, cut_off: None };
    for message in messages {
        match message {
            Ok(message) => {
                file.write(&message).map_err(RecordingError::mcap(&partial))?;
                report.messages += 1;
            }
            Err(error) => {
                report.cut_off = Some(error.to_string());
                break;
            }
        }
    }
    finish_partial(&mut file, &partial, to)?;
    Ok(report)
}
