//! Recordings: what a board sent, byte by byte, with what was made of it, in MCAP files that survive being cut off.
//!
//! | topic | encoding | one message is |
//! |---|---|---|
//! | `/recording` | JSON | the [`Header`], first in the file |
//! | `/raw` | bytes | what one read of the port gave |
//! | `/sample` | JSON | a sample as it was decoded, for other programs |
//! | `/text` | JSON | a line that is no sample |
//! | `/note` | JSON | a [`Note`]: what was lost, and when the board came and went |
//!
//! Times of messages are nanoseconds since 1970: one look at the calendar clock when the recording began, plus a
//! monotonic clock. The bytes are what counts: [`Samples`] decodes them anew, with the recording's profile or a better
//! one.

mod export;
mod parquet_file;
mod reader;
mod recover;
mod samples;
mod writer;

pub use export::{CsvTable, ExportReport, export_csv};
pub use parquet_file::export_parquet;
pub use reader::{Entry, RecordingReader};
pub use recover::{RecoveryReport, recover};
pub use samples::{Decoded, Samples};
pub use writer::RecordingWriter;

use crate::profile::{DeviceProfile, ProfileError};
use crate::stream::FormatError;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

const RECORDING: &str = "/recording";
const RAW: &str = "/raw";
const SAMPLE: &str = "/sample";
const TEXT: &str = "/text";
const NOTE: &str = "/note";

/// Why a recording cannot be written or read.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The file cannot be opened, read or written.
    #[error("{}: {error}", path.display())]
    File {
        /// Path of the file.
        path: PathBuf,
        /// What the operating system says.
        error: std::io::Error,
    },
    /// The file is cut off, damaged, or no MCAP file.
    #[error("{}: {error} (`capsense recover` saves what is before that)", path.display())]
    Damaged {
        /// Path of the file.
        path: PathBuf,
        /// What the reader says.
        error: mcap::McapError,
    },
    /// The file is an MCAP file, but not one of ours.
    #[error("{}: not a recording of CapSense: {message}", path.display())]
    Foreign {
        /// Path of the file.
        path: PathBuf,
        /// What is not as it should be.
        message: String,
    },
    /// The file cannot be written.
    #[error("{}: {error}", path.display())]
    Mcap {
        /// Path of the file.
        path: PathBuf,
        /// What the writer says.
        error: mcap::McapError,
    },
    /// The Parquet file cannot be written.
    #[error("{}: {error}", path.display())]
    Parquet {
        /// Path of the file.
        path: PathBuf,
        /// What the writer says.
        error: parquet::errors::ParquetError,
    },
    /// The profile is wrong.
    #[error(transparent)]
    Profile(#[from] ProfileError),
    /// The profile's stream is wrong.
    #[error("stream: {0}")]
    Format(#[from] FormatError),
}

impl RecordingError {
    fn file(path: &Path) -> impl Fn(std::io::Error) -> Self + use<> {
        let path = path.to_owned();
        move |error| Self::File { path: path.clone(), error }
    }

    fn mcap(path: &Path) -> impl Fn(mcap::McapError) -> Self + use<> {
        let path = path.to_owned();
        move |error| match error {
            mcap::McapError::Io(error) => Self::File { path: path.clone(), error },
            error => Self::Mcap { path: path.clone(), error },
        }
    }
}

/// Where a recording comes from.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub struct Header {
    /// Version of this layout.
    pub version: u32,
    /// The port that was read.
    pub port: String,
    /// Nanoseconds from 1970 to the beginning of the recording, by the calendar clock.
    pub unix_nanoseconds: u64,
    /// The device profile as a TOML file.
    pub profile: String,
}

impl Header {
    /// A header of this version.
    ///
    /// # Errors
    /// When the profile cannot be written as TOML.
    pub fn new(port: &str, unix_nanoseconds: u64, profile: &DeviceProfile) -> Result<Self, RecordingError> {
        Ok(Self { version: 1, port: port.to_owned(), unix_nanoseconds, profile: profile.to_toml()? })
    }

    /// The device profile.
    ///
    /// # Errors
    /// When this version cannot read it.
    pub fn device_profile(&self) -> Result<DeviceProfile, RecordingError> {
        Ok(DeviceProfile::parse("profile of the recording", &self.profile)?)
    }
}

/// What happened beside samples and lines.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
pub enum Note {
    /// The port was opened.
    Connected,
    /// The port was lost: what comes next need not begin with a line or frame.
    Disconnected {
        /// What the operating system said.
        reason: String,
    },
    /// Bytes were read and could not be written in time.
    Dropped {
        /// How many.
        bytes: u64,
    },
    /// Bytes belonged to nothing.
    PassedOver {
        /// How many.
        bytes: u64,
    },
    /// The board's own count jumped.
    Gap {
        /// How many samples are missing; `None` where the board began to count anew.
        samples: Option<u32>,
    },
}
