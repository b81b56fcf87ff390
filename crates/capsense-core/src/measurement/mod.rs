//! What a converter makes of capacitances: errors of its front end, noise, and counts.
//!
//! A [`Measurement`] takes the true Maxwell matrix scan by scan and gives a [`Reading`] of each channel. A channel sees C_ii of
//! an electrode, or the mutual capacitance -C_ij of two, at the time of its own conversion. Then
//!
//! ```text
//! a    = (1 + g + g_T ΔT + g_H ΔH) (C + Σ x C_other - dac (1 + e)) + o + o_T ΔT + o_H ΔH + drift + mains + noise
//! code = clamp(round(zero + a / LSB))
//! ```
//!
//! Without any error the reading has the bits of the true value. Same seed, same scans: same readings, and each channel's
//! noises come from streams of their own, so they do not depend on which other channels or errors there are.

mod drift;
mod history;
mod model;
mod streams;

pub use model::{
    ChannelModel, Converter, Crosstalk, Influence, LARGEST_FARADS, Mains, MeasurementError, MeasurementModel,
    OffsetDac,
};

use crate::capacitance::CapacitanceMatrix;
use drift::Spectrum;
use history::History;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal, Uniform};
use std::f64::consts::{PI, TAU};
use streams::{Purpose, stream};

/// What a channel reads in one scan.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// The converter's code; `None` without a converter. Codes grow with the capacitance that the channel sees.
    pub raw: Option<u32>,
    /// Entry of the Maxwell matrix in farads as the code tells it, after offset calibration where there is one.
    pub farads: f64,
    /// The same before the converter rounds and limits it, and not calibrated: what another converter would see.
    pub analogue_farads: f64,
}

/// Converters in front of a sensor, with their state.
#[derive(Clone, Debug)]
pub struct Measurement {
    model: MeasurementModel,
    /// Time from one scan to the next.
    scan_seconds: f64,
    channels: Vec<Channel>,
    /// Amplitude after integration, and phase.
    mains: (f64, f64),
    spectrum: Spectrum,
    history: History,
    /// What each channel sees, when, and what it sees of others.
    seen: Vec<f64>,
    times: Vec<f64>,
    crossed: Vec<f64>,
    readings: Vec<Reading>,
}

/// One channel's own errors and random streams.
#[derive(Clone, Debug)]
struct Channel {
    gain: f64,
    offset: f64,
    /// What the offset DAC is taken to subtract, and what it does subtract.
    dac: [f64; 2],
    /// Added to readings by calibration; `None` until then.
    calibration: Option<f64>,
    white: ChaCha8Rng,
    jitter: ChaCha8Rng,
    drift_stream: ChaCha8Rng,
    drift: Vec<f64>,
}

impl Measurement {
    /// Converters for a sensor that is scanned `scan_rate` times a second. `base` is what it has without objects: offset DACs are
    /// set by it, and the offsets calibrated against it with as many scans as the model says, at times before zero.
    ///
    /// # Errors
    /// When the model is not one of a converter, or names a channel that the matrix does not have.
    pub fn new(
        model: &MeasurementModel,
        scan_rate: f64,
        base: &CapacitanceMatrix,
    ) -> Result<Self, MeasurementError> {
        model.check(scan_rate, base.size())?;
        let spectrum = Spectrum::new(scan_rate);
        let channels: Vec<Channel> =
            model.channels.iter().map(|channel| Channel::new(model, channel, &spectrum, base)).collect();
        let Mains { farads, hertz, integration_seconds } = model.mains;
        // Mean of a sine over the integration: the sinc function.
        let angle = PI * hertz * integration_seconds;
        let passed = if angle == 0.0 { 1.0 } else { angle.sin() / angle };
        let phase = Uniform::new(0.0, TAU).map_or(0.0, |phase| phase.sample(&mut stream(model.seed, None)));
        let count = channels.len();
        let mut measurement = Self {
            scan_seconds: 1.0 / scan_rate,
            mains: (farads * passed, phase - angle),
            history: History::new(count, model.longest_lag() * scan_rate),
            seen: vec![0.0; count],
            times: vec![0.0; count],
            crossed: vec![0.0; count],
            readings: vec![Reading::default(); count],
            model: model.clone(),
            channels,
            spectrum,
        };
        measurement.calibrate(base);
        Ok(measurement)
    }

    /// Reads every channel. `time_s` is when the scan ends, in seconds; times must increase. Readings are in the order of
    /// [`MeasurementModel::channels`].
    ///
    /// # Panics
    /// When the matrix has not the size of that without objects.
    pub fn measure(&mut self, time_s: f64, capacitance: &CapacitanceMatrix) -> &[Reading] {
        let seen = self.model.channels.iter().map(|channel| channel.seen(capacitance));
        self.history.push(time_s, seen);
        self.convert(time_s);
        for index in 0..self.channels.len() {
            self.readings[index] = self.read(index, time_s);
        }
        &self.readings
    }

    /// The channels in the order of readings.
    pub fn channels(&self) -> &[ChannelModel] {
        &self.model.channels
    }

    /// What the offset DAC of each channel is taken to subtract, in farads.
    pub fn dac_farads(&self) -> impl Iterator<Item = f64> {
        self.channels.iter().map(|channel| channel.dac[0])
    }

    /// Measures the sensor without objects and notes how far the mean of each channel's readings is off.
    fn calibrate(&mut self, base: &CapacitanceMatrix) {
        let scans = self.model.calibration_scans;
        if scans == 0 {
            return;
        }
        let mut sums = vec![0.0; self.channels.len()];
        for scan in (1..=scans).rev() {
            let readings = self.measure(-f64::from(scan) * self.scan_seconds, base);
            sums.iter_mut().zip(readings).for_each(|(sum, reading)| *sum += reading.farads);
        }
        for ((channel, model), sum) in self.channels.iter_mut().zip(&self.model.channels).zip(sums) {
            channel.calibration = Some(base.get(model.row, model.column) - sum / f64::from(scans));
        }
        self.history.clear();
    }

    /// When each channel's conversion is, and what it then sees. The channels' conversions follow each other, the last one ends
    /// with the scan.
    fn convert(&mut self, time_s: f64) {
        let count = self.channels.len();
        for (index, (channel, model)) in self.channels.iter_mut().zip(&self.model.channels).enumerate() {
            let behind = (count - 1 - index) as f64 * self.model.seconds_per_channel;
            let late = if model.jitter_seconds > 0.0 {
                let normal: f64 = StandardNormal.sample(&mut channel.jitter);
                model.jitter_seconds * normal.abs()
            } else {
                0.0
            };
            self.times[index] = time_s - behind - model.delay_seconds - late;
            self.seen[index] = self.history.value(index, self.times[index]);
        }
        self.crossed.fill(0.0);
        for path in &self.model.crosstalk {
            self.crossed[path.to] += path.factor * self.seen[path.from];
        }
    }

    fn read(&mut self, index: usize, time_s: f64) -> Reading {
        let model = &self.model.channels[index];
        let channel = &mut self.channels[index];
        let [taken, subtracted] = channel.dac;
        let analogue = if model.dead {
            0.0
        } else {
            let time = self.times[index];
            let [gains, offsets] = self.model.influences(time);
            let gain = 1.0 + (channel.gain + gains);
            let (amplitude, phase) = self.mains;
            let mains = amplitude * (TAU * self.model.mains.hertz * time + phase).sin();
            let added = channel.offset + offsets + mains + channel.noise(model, &self.spectrum);
            gain * (self.seen[index] + self.crossed[index] - subtracted) + added
        };
        debug_assert!(analogue.is_finite(), "channel {index} at {time_s} s");
        let (raw, told) = match &self.model.converter {
            None => (None, analogue),
            Some(converter) => {
                let code = converter.code(analogue);
                (Some(code), converter.farads(code))
            }
        };
        Reading {
            raw,
            farads: model.sign() * (told + taken) + channel.calibration.unwrap_or(0.0),
            analogue_farads: model.sign() * (analogue + taken),
        }
    }
}

impl Channel {
    fn new(
        model: &MeasurementModel,
        channel: &ChannelModel,
        spectrum: &Spectrum,
        base: &CapacitanceMatrix,
    ) -> Self {
        let stream = |purpose| stream(model.seed, Some((channel.row, channel.column, purpose)));
        let mut part = stream(Purpose::Part);
        let [of_gain, of_offset, of_dac]: [f64; 3] =
            std::array::from_fn(|_| StandardNormal.sample(&mut part));
        let taken = channel.dac.farads(channel.seen(base));
        let mut drift_stream = stream(Purpose::Drift);
        Self {
            gain: channel.gain + channel.gain_spread * of_gain,
            offset: channel.offset_farads + channel.offset_spread_farads * of_offset,
            dac: [taken, taken * (1.0 + channel.dac.gain_spread * of_dac)],
            calibration: None,
            white: stream(Purpose::White),
            jitter: stream(Purpose::Jitter),
            drift: spectrum.begin(&mut drift_stream),
            drift_stream,
        }
    }

    /// White noise and drift of the next scan, in farads.
    fn noise(&mut self, model: &ChannelModel, spectrum: &Spectrum) -> f64 {
        let mut sum = 0.0;
        if model.white_noise_farads > 0.0 {
            let normal: f64 = StandardNormal.sample(&mut self.white);
            sum += model.white_noise_farads * normal;
        }
        if model.drift_farads > 0.0 {
            sum += model.drift_farads * spectrum.next(&mut self.drift, &mut self.drift_stream);
        }
        sum
    }
}
