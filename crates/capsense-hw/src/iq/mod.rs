//! Mutual capacitance by IQ demodulation: from sampled waveforms to farads and siemens.
//!
//! One electrode is driven with a sine. At another one, a divider turns what flows over into a voltage, which is amplified and
//! sampled. [`LockIn`] finds its complex amplitude, [`Calibration`] what the amplifier and cables made of it, [`Divider`] the
//! admittance between the electrodes. Nothing here is approximate; what the usual formulas for magnitudes leave out is in
//! [`magnitude`].
//!
//! ```
//! use capsense_hw::iq::{Admittance, Calibration, Complex64, Demodulator, Divider, LockIn};
//!
//! // 1 MHz sampled at 16 MHz for 1 ms; 1 V through 1 kΩ with 4 pF of input capacitance.
//! let lock_in = LockIn::new(16_000, 1_000)?;
//! let divider = Divider { shunt_ohms: 1e3, input_farads: 4e-12 };
//! let truth = Admittance { farads: 10e-12, siemens: 2e-7 };
//! let phasor = divider.ratio(1e6, truth);
//! let waveform = lock_in.waveform(phasor);
//! let full_scale = Calibration { full_scale: Complex64::new(1.0, 0.0), feedthrough: Complex64::ZERO };
//! let demodulator = Demodulator { hertz: 1e6, lock_in, divider, channels: vec![full_scale] };
//! let told = demodulator.measure(0, &waveform).expect("a waveform of the right length");
//! assert!((told.farads - truth.farads).abs() < 1e-24 && (told.siemens - truth.siemens).abs() < 1e-15);
//! # Ok::<(), capsense_hw::iq::LockInError>(())
//! ```

mod divider;
mod lock_in;
pub mod magnitude;

pub use divider::{Admittance, Divider};
pub use lock_in::{LockIn, LockInError};
pub use num_complex::Complex64;

/// What lies between a divider's ratio and the amplitude of a channel's samples: amplitude = feedthrough + full scale · H.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    /// Amplitude at H = 1: driving voltage times gain, turned by the phases of amplifier, cables and sampling.
    pub full_scale: Complex64,
    /// Amplitude with nothing between the electrodes.
    pub feedthrough: Complex64,
}

impl Calibration {
    /// From the amplitudes with nothing between the electrodes and with a known admittance; `None` if they do not differ.
    pub fn from_reference(
        divider: &Divider,
        hertz: f64,
        open: Complex64,
        reference: (Admittance, Complex64),
    ) -> Option<Self> {
        let full_scale = (reference.1 - open) / divider.ratio(hertz, reference.0);
        let usable = full_scale.is_finite() && full_scale != Complex64::ZERO && open.is_finite();
        usable.then_some(Self { full_scale, feedthrough: open })
    }

    /// The divider's ratio H.
    pub fn ratio(&self, amplitude: Complex64) -> Complex64 {
        (amplitude - self.feedthrough) / self.full_scale
    }
}

/// All of it, for the channels of a board.
#[derive(Clone, Debug)]
pub struct Demodulator {
    /// Frequency of the driving sine.
    pub hertz: f64,
    /// How waveforms are sampled.
    pub lock_in: LockIn,
    /// What turns current into voltage.
    pub divider: Divider,
    /// Calibration of each channel.
    pub channels: Vec<Calibration>,
}

impl Demodulator {
    /// The admittance that a channel's waveform tells; `None` for an unknown channel, a waveform of another length, or where
    /// nothing finite comes of it.
    pub fn measure(&self, channel: usize, waveform: &[f64]) -> Option<Admittance> {
        let amplitude = self.lock_in.amplitude(waveform)?;
        self.divider.admittance(self.hertz, self.channels.get(channel)?.ratio(amplitude))
    }
}
