//! Device profiles: all that is known of a converter and of the firmware that reads it.
//!
//! A profile turns what a board sends into capacitance, and simulated capacitance into what a board would send.
//! [`built_in`] names those that come with the program; every one of them is a TOML file like those of users.

mod built_in;
mod file;
mod transfer;
mod word;

pub use built_in::{built_in, built_in_names};
pub use file::ProfileError;
pub use transfer::{Charge, Linear, OffsetDac, Resonator, Transfer};
pub use word::{Code, Coding, Word};

use crate::stream::{MOST_CHANNELS, StreamFormat, Value};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A converter with its firmware.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct DeviceProfile {
    /// What it is called by.
    pub name: String,
    /// What it is.
    pub title: String,
    /// Number of channels; 0 if the stream says it.
    pub channels: usize,
    /// What values mean after the transfer.
    pub meaning: Meaning,
    /// The converter's word; without it the stream carries numbers of their own, such as picofarads in decimals.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub word: Option<Word>,
    /// Bits of the stream's status, by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub status: BTreeMap<String, u32>,
    /// Decimals that firmware prints, where there is no word.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub decimals: u8,
    /// From results, or from the stream's own numbers, to capacitance.
    pub transfer: Transfer,
    /// When channels are measured.
    pub scan: Scan,
    /// How far values can be trusted.
    #[serde(default)]
    pub noise: Noise,
    /// Values, after the transfer, at or beyond which something is wrong with them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub suspicious: Vec<Suspicious>,
    /// The bytes.
    pub stream: StreamFormat,
}

fn is_zero(number: &u8) -> bool {
    *number == 0
}

/// What values are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Meaning {
    /// Capacitance in farads.
    Absolute,
    /// Change of capacitance, in farads of typical gain, from an unknown beginning.
    Relative,
    /// Bare counts.
    Counts,
}

/// When channels are measured: one after the other, each as long.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Scan {
    /// Time of one channel in seconds.
    pub seconds_per_channel: f64,
}

/// How far values can be trusted, in farads, or in counts where values are counts. 0 where nothing is known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct Noise {
    /// White noise of a value, root mean square.
    pub rms: f64,
    /// Largest error of the offset.
    pub offset: f64,
    /// Largest relative error of the gain.
    pub gain: f64,
    /// Relative change of the gain per kelvin.
    pub gain_per_kelvin: f64,
}

/// Values that firmware is known to print in error.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Suspicious {
    /// From here.
    pub from: f64,
    /// To here, inclusive.
    pub to: f64,
}

/// A value and what is to be said of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reading {
    /// In farads or counts, as [`Meaning`] says; `None` if the stream has none, or nothing finite comes of it.
    pub value: Option<f64>,
    /// At the converter's lower rail: the result may be below.
    pub below_range: bool,
    /// At the converter's upper rail: the result may be above.
    pub above_range: bool,
    /// In a range where something is known to be wrong.
    pub suspicious: bool,
    /// The converter's own flags, as the bits of its word.
    pub flags: u32,
}

impl Reading {
    /// Whether there is a value and nothing is to be said against it.
    pub fn is_sound(&self) -> bool {
        self.value.is_some() && !self.below_range && !self.above_range && !self.suspicious && self.flags == 0
    }
}

impl DeviceProfile {
    /// What a value of the stream means.
    pub fn reading(&self, channel: usize, value: Value) -> Reading {
        let Value::Number(number) = value else { return Reading::default() };
        let mut reading = Reading::default();
        let result = match &self.word {
            None => number,
            Some(word) => {
                let Some(code) = word.decode(number) else { return reading };
                [reading.below_range, reading.above_range] = code.at_rail;
                reading.flags = code.flags;
                code.result as f64
            }
        };
        reading.value = self.transfer.forward(channel, result);
        let within =
            |value: f64| self.suspicious.iter().any(|range| (range.from..=range.to).contains(&value));
        reading.suspicious = reading.value.is_some_and(within);
        reading
    }

    /// What a board would send for a value in farads or counts, rounded and limited as its converter does;
    /// [`Value::Invalid`] if the value is not finite.
    pub fn raw(&self, channel: usize, value: f64) -> Value {
        if !value.is_finite() {
            return Value::Invalid;
        }
        let result = self.transfer.backward(channel, value);
        match (&self.word, result) {
            (Some(word), Some(result)) => Value::Number(word.encode(result.round() as i64)),
            // A circuit that cannot swing: the converter counts nothing.
            (Some(word), None) => Value::Number(word.encode(word.range()[0])),
            (None, Some(result)) => {
                let unit = 10f64.powi(self.decimals.into());
                let rounded = (result * unit).round() / unit;
                if rounded.is_finite() { Value::Number(rounded) } else { Value::Invalid }
            }
            (None, None) => Value::Invalid,
        }
    }

    /// Time from one sample of a channel to the next, in seconds, with the number of channels that a sample has.
    pub fn scan_seconds(&self, channels: usize) -> f64 {
        self.scan.seconds_per_channel * channels as f64
    }

    /// Names of the flags of a reading.
    pub fn flag_names(&self, flags: u32) -> impl Iterator<Item = &str> {
        let all = self.word.iter().flat_map(|word| &word.flags);
        all.filter(move |(_, bits)| flags & **bits != 0).map(|(name, _)| name.as_str())
    }

    /// Names of the bits of a sample's status.
    pub fn status_names(&self, status: u32) -> impl Iterator<Item = &str> {
        self.status.iter().filter(move |(_, bits)| status & **bits != 0).map(|(name, _)| name.as_str())
    }

    /// Words for what is to be said against a reading, each with its channel, counted from 1: `C3:above-range`.
    pub fn remarks(&self, channel: usize, value: Value, reading: &Reading) -> Vec<String> {
        let known = [
            (value == Value::Missing, "missing"),
            (value == Value::Invalid, "invalid"),
            (matches!(value, Value::Number(_)) && reading.value.is_none(), "no-value"),
            (reading.below_range, "below-range"),
            (reading.above_range, "above-range"),
            (reading.suspicious, "suspicious"),
        ];
        let words = known.into_iter().filter(|(holds, _)| *holds).map(|(_, word)| word);
        words.chain(self.flag_names(reading.flags)).map(|word| format!("C{}:{word}", channel + 1)).collect()
    }

    /// What is wrong with it: a dotted key, and why.
    fn check(&self) -> Result<(), (String, String)> {
        let owned = |(key, message): (&str, String)| (key.to_owned(), message);
        let wrong = |key: &str, message: &str| Err((key.to_owned(), message.to_owned()));
        if self.channels > MOST_CHANNELS {
            return wrong("channels", &format!("must not be above {MOST_CHANNELS}"));
        }
        if self.decimals > 15 {
            return wrong("decimals", "must not be above 15");
        }
        if (self.transfer == Transfer::Counts) != (self.meaning == Meaning::Counts) {
            return wrong("meaning", "must be `counts` where the transfer is, and only there");
        }
        self.word.as_ref().map_or(Ok(()), Word::check).map_err(owned)?;
        self.transfer.check().map_err(owned)?;
        let seconds = self.scan.seconds_per_channel;
        if !(seconds.is_finite() && seconds > 0.0) {
            return wrong("scan.seconds_per_channel", "must be above 0");
        }
        let Noise { rms, offset, gain, gain_per_kelvin } = self.noise;
        if [rms, offset, gain].iter().any(|size| !(size.is_finite() && *size >= 0.0))
            || !gain_per_kelvin.is_finite()
        {
            return wrong("noise", "must be finite, sizes not below 0");
        }
        let kind = match self.stream {
            StreamFormat::Text(_) => "text",
            StreamFormat::Framed(_) => "framed",
            StreamFormat::Cobs(_) => "cobs",
        };
        self.stream.check().map_err(|error| (format!("stream.{kind}.{}", error.key), error.message))
    }
}
