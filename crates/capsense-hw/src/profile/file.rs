//! Profiles in TOML files. Unknown keys are errors; every complaint names file, line and key.

use super::DeviceProfile;
use std::path::{Path, PathBuf};
use toml::de::{DeTable, DeValue};

/// Why there is no profile.
#[derive(Debug, thiserror::Error)]
pub enum ProfileError {
    /// The file cannot be read.
    #[error("{}: cannot read the device profile: {error}", path.display())]
    Read {
        /// Path of the file.
        path: PathBuf,
        /// What the operating system says.
        error: std::io::Error,
    },
    /// Something in it is wrong.
    #[error("{file}:{line}: {}{message}", key.as_ref().map(|key| format!("{key}: ")).unwrap_or_default())]
    Invalid {
        /// The file as the user named it.
        file: String,
        /// Line in it, counted from one.
        line: usize,
        /// Dotted key, where the message does not name it.
        key: Option<String>,
        /// What is wrong.
        message: String,
    },
    /// There is no profile of this name and no such file.
    #[error("no device profile `{name}`: give a file (.toml) or one of {}", super::built_in_names().join(", "))]
    Unknown {
        /// The name.
        name: String,
    },
    /// A profile cannot be written as TOML.
    #[error("cannot write the device profile: {0}")]
    Write(#[from] toml::ser::Error),
}

impl DeviceProfile {
    /// The built-in profile of a name, or, if it ends in `.toml`, the profile in a file.
    ///
    /// # Errors
    /// When there is no such profile, or anything in its file is wrong.
    pub fn find(name: &str) -> Result<Self, ProfileError> {
        if name.ends_with(".toml") {
            return Self::load(Path::new(name));
        }
        super::built_in(name)
    }

    /// Reads a profile file.
    ///
    /// # Errors
    /// When it cannot be read or anything in it is wrong.
    pub fn load(path: &Path) -> Result<Self, ProfileError> {
        let read = std::fs::read_to_string(path);
        let text = read.map_err(|error| ProfileError::Read { path: path.to_owned(), error })?;
        Self::parse(&path.display().to_string(), &text)
    }

    /// Reads a profile; `file` is what complaints call it.
    ///
    /// # Errors
    /// When anything in it is wrong.
    pub fn parse(file: &str, text: &str) -> Result<Self, ProfileError> {
        let invalid = |line, key, message: &str| ProfileError::Invalid {
            file: file.to_owned(),
            line,
            key,
            message: message.split_whitespace().collect::<Vec<_>>().join(" "),
        };
        let mut profile: Self = toml::from_str(text).map_err(|error| {
            let at = error.span().map_or(0, |span| span.start);
            invalid(line_at(text, at), None, error.message())
        })?;
        profile.stream.set_channels((profile.channels > 0).then_some(profile.channels));
        match profile.check() {
            Ok(()) => Ok(profile),
            Err((key, message)) => Err(invalid(line_of(text, &key), Some(key), &message)),
        }
    }

    /// The profile as a TOML file, which [`parse`](Self::parse) reads back to the same.
    ///
    /// # Errors
    /// When TOML cannot say it.
    pub fn to_toml(&self) -> Result<String, ProfileError> {
        Ok(toml::to_string_pretty(self)?)
    }
}

/// The line, from one, of a byte.
fn line_at(text: &str, at: usize) -> usize {
    1 + text.bytes().take(at).filter(|byte| *byte == b'\n').count()
}

/// The line of a dotted key, or of the innermost table around it that the text has.
fn line_of(text: &str, key: &str) -> usize {
    let (table, _) = DeTable::parse_recoverable(text);
    let mut table = table.get_ref();
    let mut at = 0;
    for segment in key.split('.') {
        let Some((name, value)) = table.iter().find(|(name, _)| name.get_ref() == segment) else { break };
        at = name.span().start;
        match value.get_ref() {
            DeValue::Table(inner) => table = inner,
            _ => break,
        }
    }
    line_at(text, at)
}

#[cfg(test)]
mod tests {
    use super::super::built_in;
    use super::{DeviceProfile, ProfileError};

    fn complaint(edit: impl Fn(String) -> String) -> String {
        let text = edit(built_in("fdc2214").unwrap().to_toml().unwrap());
        DeviceProfile::parse("mine.toml", &text).unwrap_err().to_string()
    }

    #[test]
    fn complaints_name_file_line_and_key() {
        let line = |text: &str, key: &str| 1 + text.lines().position(|line| line.starts_with(key)).unwrap();
        let text = built_in("fdc2214").unwrap().to_toml().unwrap();
        let at = line(&text, "bits");
        assert_eq!(
            complaint(|text| text.replace("\nbits = 28", "\nbits = 33")),
            format!("mine.toml:{at}: word.bits: must be from 1 to 32")
        );
        let unknown = complaint(|text| text.replace("\nbits = 28", "\nbits = 28\nbitz = 3"));
        assert!(unknown.starts_with(&format!("mine.toml:{}: ", at + 1)), "{unknown}");
        assert!(unknown.contains("unknown field `bitz`"), "{unknown}");
        let missing = complaint(|text| text.replace("channels = 4", ""));
        assert!(missing.contains("missing field `channels`"), "{missing}");
    }

    #[test]
    fn values_without_sense_are_refused() {
        for (from, to, key) in [
            ("channels = 4", "channels = 257", "channels"),
            ("meaning = \"absolute\"", "meaning = \"counts\"", "meaning"),
            ("reference_hertz = 40000000.0", "reference_hertz = 0.0", "transfer.resonator.reference_hertz"),
            ("inductance_henries = ", "inductance_henries = -", "transfer.resonator.inductance_henries"),
            ("input_divider = [1.0]", "input_divider = []", "transfer.resonator.input_divider"),
            ("seconds_per_channel = ", "seconds_per_channel = -", "scan.seconds_per_channel"),
            ("rms = ", "rms = nan #", "noise"),
            ("amplitude = 268435456", "amplitude = 1", "word.flags"),
        ] {
            let text = complaint(|text| {
                assert!(text.contains(from), "`{from}` in\n{text}");
                text.replace(from, to)
            });
            assert!(text.contains(&format!(": {key}: ")), "{from}: {text}");
        }
    }

    #[test]
    fn names_and_files_that_do_not_exist_are_told() {
        let unknown = DeviceProfile::find("fdc9999").unwrap_err();
        assert!(matches!(unknown, ProfileError::Unknown { .. }));
        assert!(unknown.to_string().contains("fdc2214"), "{unknown}");
        assert!(matches!(DeviceProfile::find("no/such.toml"), Err(ProfileError::Read { .. })));
    }
}
