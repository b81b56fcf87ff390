//! The parameters of a measurement, and which of them no converter could have.

use crate::capacitance::CapacitanceMatrix;

/// No capacitance of a sensor, nor any error of one, comes near.
pub const LARGEST_FARADS: f64 = 1.0;

/// Relative errors beyond this are no errors of a converter.
const LARGEST_RELATIVE: f64 = 10.0;

/// Conversions lag behind by at most so many scans.
const MOST_SCANS: f64 = 1e5;

/// Jitter that is larger than so many times its scale does not occur: that has a probability of 1e-15.
const JITTERS: f64 = 8.0;

/// All that is wrong with a measurement. The default has no channels and no errors.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeasurementModel {
    /// Where all randomness comes from.
    pub seed: u64,
    /// The channels in the order in which they are converted.
    pub channels: Vec<ChannelModel>,
    /// Time of one conversion; they follow each other.
    pub seconds_per_channel: f64,
    /// What channels see of each other.
    pub crosstalk: Vec<Crosstalk>,
    /// Pick-up from the mains.
    pub mains: Mains,
    /// What temperature does.
    pub temperature: Influence,
    /// What humidity does.
    pub humidity: Influence,
    /// The converter; without one values are neither rounded nor limited.
    pub converter: Option<Converter>,
    /// Scans without objects whose mean is taken for the offset; 0: none.
    pub calibration_scans: u32,
}

/// One channel: which capacitance it measures and its own errors.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ChannelModel {
    /// Row of the Maxwell matrix.
    pub row: usize,
    /// Column of the Maxwell matrix.
    pub column: usize,
    /// Relative error of the gain.
    pub gain: f64,
    /// Standard deviation of a further such error, which is drawn once.
    pub gain_spread: f64,
    /// Error of the offset.
    pub offset_farads: f64,
    /// Standard deviation of a further such error, which is drawn once.
    pub offset_spread_farads: f64,
    /// White noise of a reading, root mean square.
    pub white_noise_farads: f64,
    /// Root of the one-sided spectral density of the 1/f drift at 1 Hz, in F/√Hz.
    pub drift_farads: f64,
    /// How much older than the scan the capacitance is.
    pub delay_seconds: f64,
    /// Scale of a random further delay, the magnitude of a normal variable.
    pub jitter_seconds: f64,
    /// The offset DAC.
    pub dac: OffsetDac,
    /// Reads nothing but a converter's zero.
    pub dead: bool,
}

/// A capacitance that is subtracted before conversion and added again to what is told.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OffsetDac {
    /// One step in farads; 0: there is none.
    pub farads_per_step: f64,
    /// Number of the largest setting.
    pub largest: u32,
    /// The setting; `None` for the largest that subtracts no more than there is without objects.
    pub setting: Option<u32>,
    /// Standard deviation of the relative error of what is subtracted, which is drawn once.
    pub gain_spread: f64,
}

/// A part of what one channel sees that another one sees, too.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Crosstalk {
    /// Index of the channel that is seen.
    pub from: usize,
    /// Index of the channel that sees it.
    pub to: usize,
    /// How much of it.
    pub factor: f64,
}

/// A sine that is added to all channels at the times of their conversions; being sampled, it appears at the alias of its
/// frequency.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mains {
    /// Amplitude.
    pub farads: f64,
    /// Frequency.
    pub hertz: f64,
    /// Time over which a conversion takes the mean.
    pub integration_seconds: f64,
}

/// Something of the surroundings that begins to change at time 0, by `change (1 - exp(-t / seconds))` of its own unit (kelvin, or
/// per cent of relative humidity).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Influence {
    /// By how much it changes in the end.
    pub change: f64,
    /// Time constant; 0: at once.
    pub seconds: f64,
    /// Relative change of the gain per unit.
    pub gain: f64,
    /// Change of the offset in farads per unit.
    pub offset_farads: f64,
}

/// From capacitance to codes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Converter {
    /// Least significant bit.
    pub farads_per_code: f64,
    /// Number of bits of a code.
    pub bits: u32,
    /// Code at no capacitance beyond the DAC's.
    pub zero: f64,
}

/// A parameter that no converter could have.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{key}: {message}")]
pub struct MeasurementError {
    /// The parameter, as it is called in the table `[measurement]` of a scene file.
    pub key: &'static str,
    /// What is wrong with it.
    pub message: String,
}

impl ChannelModel {
    /// What the channel sees of a Maxwell matrix: mutual capacitances are minus its entries.
    pub(super) fn seen(&self, capacitance: &CapacitanceMatrix) -> f64 {
        self.sign() * capacitance.get(self.row, self.column)
    }

    pub(super) fn sign(&self) -> f64 {
        if self.row == self.column { 1.0 } else { -1.0 }
    }

    fn longest_delay(&self) -> f64 {
        self.delay_seconds + JITTERS * self.jitter_seconds
    }
}

impl OffsetDac {
    /// What it is taken to subtract where there is `base` without objects.
    pub(super) fn farads(&self, base: f64) -> f64 {
        if self.farads_per_step == 0.0 {
            return 0.0;
        }
        let fitting = || (base / self.farads_per_step).floor().clamp(0.0, f64::from(self.largest));
        self.setting.map_or_else(fitting, f64::from) * self.farads_per_step
    }
}

impl Converter {
    /// The code of a capacitance, rounded and limited.
    pub(super) fn code(&self, farads: f64) -> u32 {
        let largest = ((1u64 << self.bits) - 1) as f64;
        (self.zero + farads / self.farads_per_code).round().clamp(0.0, largest) as u32
    }

    /// The capacitance that a code stands for.
    pub(super) fn farads(&self, code: u32) -> f64 {
        (f64::from(code) - self.zero) * self.farads_per_code
    }
}

impl Influence {
    /// The change at a time, in its own unit.
    fn at(&self, time_s: f64) -> f64 {
        if time_s < 0.0 {
            0.0
        } else if self.seconds == 0.0 {
            self.change
        } else {
            -self.change * (-time_s / self.seconds).exp_m1()
        }
    }

    fn check(&self, key: &'static str) -> Result<(), MeasurementError> {
        within(key, "change", self.change, 1e6)?;
        within(key, "seconds", self.seconds, f64::MAX)?;
        not_negative(key, "seconds", self.seconds)?;
        within(key, "gain", self.gain, LARGEST_RELATIVE)?;
        within(key, "offset", self.offset_farads, LARGEST_FARADS)
    }
}

impl MeasurementModel {
    /// What surroundings do to gain and offset at a time.
    pub(super) fn influences(&self, time_s: f64) -> [f64; 2] {
        let [t, h] = [&self.temperature, &self.humidity].map(|influence| influence.at(time_s));
        [
            self.temperature.gain * t + self.humidity.gain * h,
            self.temperature.offset_farads * t + self.humidity.offset_farads * h,
        ]
    }

    /// By how much the earliest conversion can lag behind its scan, in seconds.
    pub(super) fn longest_lag(&self) -> f64 {
        let longest = self.channels.iter().map(ChannelModel::longest_delay).fold(0.0, f64::max);
        longest + self.seconds_per_channel * self.channels.len().saturating_sub(1) as f64
    }

    /// Whether there could be such converters, for a matrix of `size` electrodes and so many scans a second.
    ///
    /// # Errors
    /// What is wrong first.
    pub fn check(&self, scan_rate: f64, size: usize) -> Result<(), MeasurementError> {
        if !(scan_rate.is_finite() && scan_rate > 0.0) {
            return wrong("seconds_per_channel", format!("there must be scans, not {scan_rate} a second"));
        }
        within("seconds_per_channel", "", self.seconds_per_channel, 1e6)?;
        not_negative("seconds_per_channel", "", self.seconds_per_channel)?;
        for channel in &self.channels {
            if channel.row >= size || channel.column >= size {
                let message = format!("there is no entry ({}, {})", channel.row, channel.column);
                return wrong("channels", message);
            }
            channel.check()?;
        }
        if self.seconds_per_channel * self.channels.len() as f64 * scan_rate > 1.0 + 1e-9 {
            let message = format!(
                "the conversions of {} channels do not fit into a scan of {} s",
                self.channels.len(),
                1.0 / scan_rate
            );
            return wrong("seconds_per_channel", message);
        }
        if self.longest_lag() * scan_rate > MOST_SCANS {
            return wrong("delay", format!("must be below {MOST_SCANS} scans"));
        }
        for path in &self.crosstalk {
            within("crosstalk", "", path.factor, LARGEST_RELATIVE)?;
            if path.from == path.to || path.from.max(path.to) >= self.channels.len() {
                return wrong("crosstalk", format!("must be 0 from channel {} to itself", path.to + 1));
            }
        }
        within("mains", "amplitude", self.mains.farads, LARGEST_FARADS)?;
        for (name, value) in
            [("frequency", self.mains.hertz), ("integration", self.mains.integration_seconds)]
        {
            within("mains", name, value, 1e9)?;
            not_negative("mains", name, value)?;
        }
        self.temperature.check("temperature")?;
        self.humidity.check("humidity")?;
        self.converter.as_ref().map_or(Ok(()), Converter::check)
    }
}

impl ChannelModel {
    fn check(&self) -> Result<(), MeasurementError> {
        within("gain", "", self.gain, LARGEST_RELATIVE)?;
        within("offset", "", self.offset_farads, LARGEST_FARADS)?;
        for (key, value, largest) in [
            ("gain_spread", self.gain_spread, LARGEST_RELATIVE),
            ("offset_spread", self.offset_spread_farads, LARGEST_FARADS),
            ("white_noise", self.white_noise_farads, LARGEST_FARADS),
            ("drift", self.drift_farads, LARGEST_FARADS),
            ("delay", self.delay_seconds, 1e6),
            ("jitter", self.jitter_seconds, 1e6),
        ] {
            within(key, "", value, largest)?;
            not_negative(key, "", value)?;
        }
        for (name, value, largest) in [
            ("step", self.dac.farads_per_step, LARGEST_FARADS),
            ("spread", self.dac.gain_spread, LARGEST_RELATIVE),
        ] {
            within("offset_dac", name, value, largest)?;
            not_negative("offset_dac", name, value)?;
        }
        if self.dac.setting.is_some_and(|setting| setting > self.dac.largest) {
            return wrong("offset_dac", format!("settings must not be above {}", self.dac.largest));
        }
        Ok(())
    }
}

impl Converter {
    fn check(&self) -> Result<(), MeasurementError> {
        if !(1e-24..=LARGEST_FARADS).contains(&self.farads_per_code) {
            let message = format!("step must be from 1e-24 to 1 F, but is {}", self.farads_per_code);
            return wrong("converter", message);
        }
        if !(1..=32).contains(&self.bits) {
            return wrong("converter", format!("bits must be from 1 to 32, but are {}", self.bits));
        }
        let largest = ((1u64 << self.bits) - 1) as f64;
        if !(0.0..=largest).contains(&self.zero) {
            let message = format!("zero must be a code, from 0 to {largest}, but is {}", self.zero);
            return wrong("converter", message);
        }
        Ok(())
    }
}

fn wrong<T>(key: &'static str, message: String) -> Result<T, MeasurementError> {
    Err(MeasurementError { key, message })
}

/// Finite and no larger than anything that makes sense; NaN is neither.
fn within(key: &'static str, name: &str, value: f64, largest: f64) -> Result<(), MeasurementError> {
    if value.abs() <= largest {
        Ok(())
    } else {
        wrong(key, format!("{} must be from -{largest:e} to {largest:e}, but is {value}", named(name)))
    }
}

fn not_negative(key: &'static str, name: &str, value: f64) -> Result<(), MeasurementError> {
    if value >= 0.0 {
        Ok(())
    } else {
        wrong(key, format!("{} must not be negative, but is {value}", named(name)))
    }
}

fn named(name: &str) -> &str {
    if name.is_empty() { "it" } else { name }
}
