//! The complex amplitude of a sine in samples: I = 2 ⟨v sin⟩, Q = 2 ⟨v cos⟩, over a whole number of cycles.
//!
//! Over whole cycles the reference is orthogonal to a constant and to every other whole number of cycles, so offsets and
//! harmonics below the sampling frequency leave no trace. White noise of one-sided density e² leaves e²/T in I and in Q after a time T.

use num_complex::Complex64;
use std::f64::consts::TAU;

/// Longest waveform, in samples.
const MOST_SAMPLES: usize = 1 << 24;

/// A waveform that cannot be demodulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LockInError {
    /// Less than one cycle, or no more than two samples a cycle.
    #[error("{cycles} cycles in {samples} samples: there must be whole cycles of more than two samples")]
    Cycles {
        /// Number of cycles.
        cycles: usize,
        /// Number of samples.
        samples: usize,
    },
    /// More samples than are ever needed.
    #[error("{0} samples; at most {MOST_SAMPLES}")]
    Samples(usize),
}

/// Demodulates waveforms of a fixed number of samples and cycles. The amplitude of sin(ωt + φ) is exp(jφ).
#[derive(Clone, Debug, PartialEq)]
pub struct LockIn {
    /// sin and cos of the reference at each sample.
    reference: Vec<[f64; 2]>,
}

impl LockIn {
    /// For so many samples of so many whole cycles.
    ///
    /// # Errors
    /// When there are not whole cycles of more than two samples.
    pub fn new(samples: usize, cycles: usize) -> Result<Self, LockInError> {
        if samples > MOST_SAMPLES {
            return Err(LockInError::Samples(samples));
        }
        if cycles == 0 || 2 * cycles >= samples {
            return Err(LockInError::Cycles { cycles, samples });
        }
        let reference = |sample: usize| {
            // Whole cycles are taken off first: the angle is then exact for any length.
            let part = (sample * cycles % samples) as f64 / samples as f64;
            let (sin, cos) = (TAU * part).sin_cos();
            [sin, cos]
        };
        Ok(Self { reference: (0..samples).map(reference).collect() })
    }

    /// Number of samples of a waveform.
    pub fn samples(&self) -> usize {
        self.reference.len()
    }

    /// The complex amplitude I + jQ; `None` if the waveform has another length.
    pub fn amplitude(&self, waveform: &[f64]) -> Option<Complex64> {
        if waveform.len() != self.samples() {
            return None;
        }
        let mut sums = [0.0; 2];
        for (value, [sin, cos]) in waveform.iter().zip(&self.reference) {
            sums[0] += value * sin;
            sums[1] += value * cos;
        }
        let [i, q] = sums.map(|sum| 2.0 * sum / self.samples() as f64);
        Some(Complex64::new(i, q))
    }

    /// One amplitude after the other from a longer recording; what is left at the end is too short.
    pub fn amplitudes(&self, waveform: &[f64]) -> impl Iterator<Item = Complex64> {
        waveform.chunks_exact(self.samples()).filter_map(|piece| self.amplitude(piece))
    }

    /// The waveform of an amplitude.
    pub fn waveform(&self, amplitude: Complex64) -> Vec<f64> {
        self.reference.iter().map(|[sin, cos]| amplitude.re * sin + amplitude.im * cos).collect()
    }
}
