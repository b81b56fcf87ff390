//! What the commands for hardware share: the profile that the user names, and which errors are the user's.

use super::BadInput;
use capsense_hw::profile::DeviceProfile;
use capsense_hw::recording::RecordingError;
use std::time::Duration;

/// How long a pseudo-terminal keeps the last bytes for whoever reads them.
pub(super) const LINGER: Duration = Duration::from_secs(2);

/// The built-in profile of a name, or that of a file.
pub(super) fn find_profile(name: &str) -> anyhow::Result<DeviceProfile> {
    DeviceProfile::find(name).map_err(|error| BadInput(error.to_string()).into())
}

/// An error as the exit code wants it: what is wrong with a file that the user named is bad input.
pub(super) fn told(error: RecordingError) -> anyhow::Error {
    match error {
        RecordingError::Damaged { .. }
        | RecordingError::Foreign { .. }
        | RecordingError::Profile(_)
        | RecordingError::Format(_) => BadInput(error.to_string()).into(),
        error => error.into(),
    }
}
