//! IQ demodulation against closed forms, there and back, and with noise.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test")]

use capsense_hw::iq::{
    Admittance, Calibration, Complex64, Demodulator, Divider, LockIn, LockInError, magnitude,
};
use proptest::prelude::*;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::{PI, TAU};

const MEGAHERTZ: f64 = 1e6;

/// 1 kΩ, and an input without capacitance.
const PLAIN: Divider = Divider { shunt_ohms: 1e3, input_farads: 0.0 };

fn capacitor(farads: f64) -> Admittance {
    Admittance { farads, siemens: 0.0 }
}

fn assert_near(value: f64, expected: f64, error: f64) {
    assert!((value - expected).abs() <= error, "{value:e} is not {expected:e} to {error:e}");
}

/// x = ωR_S C, H = jx / (1 + jx).
#[test]
fn the_divider_of_a_capacitor_and_a_resistor() {
    let x = TAU * MEGAHERTZ * 1e3 * 10e-12;
    let ratio = PLAIN.ratio(MEGAHERTZ, capacitor(10e-12));
    assert_near(ratio.norm(), x / x.hypot(1.0), 1e-15);
    assert_near(ratio.arg(), PI / 2.0 - x.atan(), 1e-15);
    assert_near(ratio.norm(), 0.062_708_2, 5e-8);
}

/// A divider of two capacitors, at a frequency at which the resistor does not matter: C / (C + C_p).
#[test]
fn the_divider_of_two_capacitors() {
    let divider = Divider { shunt_ohms: 1e9, input_farads: 30e-12 };
    let ratio = divider.ratio(MEGAHERTZ, capacitor(10e-12));
    assert_near(ratio.re, 0.25, 1e-5);
    assert_near(ratio.im, 0.0, 1e-5);
}

/// What is stated in docs/hardware.md: 1 kΩ and 1 MHz.
#[test]
fn formulas_of_magnitudes_are_off_as_stated() {
    let told = |divider: Divider, between: Admittance| {
        let size = divider.ratio(MEGAHERTZ, between).norm();
        [magnitude::exact_farads, magnitude::paper_farads, magnitude::linear_farads]
            .map(|formula| 100.0 * (formula(MEGAHERTZ, divider.shunt_ohms, size) / between.farads - 1.0))
    };
    let loaded = Divider { input_farads: 4e-12, ..PLAIN };
    let leaky = Admittance { farads: 1e-12, siemens: 2e-6 };
    for (divider, between, expected) in [
        (PLAIN, capacitor(1e-12), [0.0, 0.630, -0.002]),
        (PLAIN, capacitor(10e-12), [0.0, 6.480, -0.197]),
        (PLAIN, capacitor(50e-12), [0.0, 36.235, -4.597]),
        (loaded, capacitor(1e-12), [-0.047, 0.582, -0.049]),
        (loaded, capacitor(10e-12), [-0.189, 6.267, -0.385]),
        (PLAIN, leaky, [4.735, 5.426, 4.732]),
    ] {
        for (error, expected) in told(divider, between).into_iter().zip(expected) {
            assert_near(error, expected, 6e-4);
        }
        let x: f64 = TAU * MEGAHERTZ * divider.shunt_ohms * between.farads;
        if divider == PLAIN && between.siemens == 0.0 {
            assert_near(told(divider, between)[1], 100.0 * (x.hypot(1.0) + x - 1.0), 1e-9);
            assert_near(told(divider, between)[2], 100.0 * (1.0 / x.hypot(1.0) - 1.0), 1e-9);
        }
        let back = divider.admittance(MEGAHERTZ, divider.ratio(MEGAHERTZ, between)).unwrap();
        assert_near(back.farads, between.farads, 1e-26);
        assert_near(back.siemens, between.siemens, 1e-17);
    }
}

/// Offsets, harmonics and other whole numbers of cycles leave nothing.
#[test]
fn whole_cycles_are_orthogonal_to_all_else() {
    let lock_in = LockIn::new(1000, 30).unwrap();
    let amplitude = Complex64::from_polar(0.7, 0.3);
    let others = (0..1000).map(|n| {
        let angle = TAU * f64::from(n) / 1000.0;
        0.5 + 2.0 * (29.0 * angle).sin() + (60.0 * angle + 1.0).sin() + 0.3 * (90.0 * angle).cos()
    });
    let waveform: Vec<f64> =
        lock_in.waveform(amplitude).iter().zip(others).map(|(v, other)| v + other).collect();
    let told = lock_in.amplitude(&waveform).unwrap();
    assert!((told - amplitude).norm() < 1e-14, "{told}");
    let sine: Vec<f64> = (0..1000).map(|n| 0.7 * (TAU * 0.03 * f64::from(n) + 0.3).sin()).collect();
    assert!((lock_in.amplitude(&sine).unwrap() - amplitude).norm() < 1e-13);
    assert_eq!(lock_in.amplitude(&waveform[1..]), None);
    let three = [waveform.as_slice(), &waveform, &waveform, &waveform[5..]].concat();
    assert_eq!(lock_in.amplitudes(&three).collect::<Vec<_>>(), [told; 3]);
}

#[test]
fn waveforms_without_whole_cycles_are_refused() {
    for (samples, cycles) in [(100, 0), (100, 50), (0, 0), (10, 11)] {
        assert_eq!(LockIn::new(samples, cycles).unwrap_err(), LockInError::Cycles { cycles, samples });
    }
    assert_eq!(LockIn::new(1 << 25, 5).unwrap_err(), LockInError::Samples(1 << 25));
}

/// Amplifiers of different gain and phase, and feedthrough past the electrodes, are calibrated away with one known capacitor.
#[test]
fn a_known_capacitor_calibrates_each_channel() {
    let divider = Divider { shunt_ohms: 1.2e3, input_farads: 6e-12 };
    let lock_in = LockIn::new(160, 10).unwrap();
    let amplifiers = [
        (Complex64::from_polar(50.0, 0.4), Complex64::new(0.01, -0.02)),
        (Complex64::from_polar(48.0, -2.9), Complex64::new(-0.005, 0.03)),
    ];
    let waveform = |(gain, feedthrough): (Complex64, Complex64), between| {
        lock_in.waveform(gain * divider.ratio(MEGAHERTZ, between) + feedthrough)
    };
    let channels = amplifiers.map(|amplifier| {
        let [open, known] =
            [0.0, 4.7e-12].map(|farads| lock_in.amplitude(&waveform(amplifier, capacitor(farads))).unwrap());
        Calibration::from_reference(&divider, MEGAHERTZ, open, (capacitor(4.7e-12), known)).unwrap()
    });
    let demodulator =
        Demodulator { hertz: MEGAHERTZ, lock_in: lock_in.clone(), divider, channels: channels.to_vec() };
    let truth = Admittance { farads: 1.234e-12, siemens: 3e-7 };
    for (channel, amplifier) in amplifiers.into_iter().enumerate() {
        let told = demodulator.measure(channel, &waveform(amplifier, truth)).unwrap();
        assert_near(told.farads, truth.farads, 1e-25);
        assert_near(told.siemens, truth.siemens, 1e-18);
    }
    assert_eq!(demodulator.measure(2, &waveform(amplifiers[0], truth)), None);
    let open = Complex64::new(1.0, 0.0);
    assert_eq!(Calibration::from_reference(&divider, MEGAHERTZ, open, (truth, open)), None);
}

/// White noise of density e leaves σ_C = e / (√T ω R_S V_TX): 20 aF at 4 nV/√Hz, 1 ms and 1 V.
#[test]
fn noise_of_capacitance_is_that_of_the_closed_form() {
    let (rate, samples) = (4e6, 4000);
    let lock_in = LockIn::new(samples, 1000).unwrap();
    let volt = Calibration { full_scale: Complex64::new(1.0, 0.0), feedthrough: Complex64::ZERO };
    let demodulator =
        Demodulator { hertz: MEGAHERTZ, lock_in: lock_in.clone(), divider: PLAIN, channels: vec![volt] };
    let sigma = 4e-9 * f64::sqrt(rate / 2.0);
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let clean = lock_in.waveform(PLAIN.ratio(MEGAHERTZ, capacitor(1e-12)));
    let mut noisy = |clean: &[f64]| -> Vec<f64> {
        let normal = |random: &mut ChaCha8Rng| -> f64 { StandardNormal.sample(random) };
        clean.iter().map(|v| v + sigma * normal(&mut random)).collect()
    };
    let runs = 1500;
    let errors: Vec<f64> =
        (0..runs).map(|_| demodulator.measure(0, &noisy(&clean)).unwrap().farads - 1e-12).collect();
    let deviation = (errors.iter().map(|e| e * e).sum::<f64>() / f64::from(runs)).sqrt();
    let expected = 4e-9 / (f64::sqrt(1e-3) * TAU * MEGAHERTZ * 1e3);
    assert_near(expected, 20.1e-18, 0.1e-18);
    assert_near(deviation / expected, 1.0, 0.08);
    // Of nothing, I and Q have no mean, the magnitude has σ √(π/2).
    let silence = vec![0.0; samples];
    let amplitudes: Vec<Complex64> =
        (0..runs).map(|_| lock_in.amplitude(&noisy(&silence)).unwrap()).collect();
    let of_part = 4e-9 / f64::sqrt(1e-3);
    let mean = amplitudes.iter().sum::<Complex64>() / f64::from(runs);
    assert!(mean.norm() < 4.0 * of_part / f64::from(runs).sqrt(), "{mean}");
    let size = amplitudes.iter().map(|a| a.norm()).sum::<f64>() / f64::from(runs);
    assert_near(size / of_part, (PI / 2.0).sqrt(), 0.06);
}

proptest! {
    #[test]
    fn admittances_come_back(
        hertz in 1e4..1e7f64,
        shunt_ohms in 10.0..1e6f64,
        input in 0.0..1e-10f64,
        farads in -1e-11..1e-10f64,
        siemens in -1e-9..1e-4f64,
    ) {
        let divider = Divider { shunt_ohms, input_farads: input };
        let between = Admittance { farads, siemens };
        let ratio = divider.ratio(hertz, between);
        let back = divider.admittance(hertz, ratio).unwrap();
        // Where the admittance is far above the shunt's, H is near 1 and 1 - H keeps few digits.
        let scale = TAU * hertz * (farads.abs() + input) + siemens.abs() + 1.0 / shunt_ohms;
        let error = 1e-14 * scale * (scale * shunt_ohms).max(1.0);
        prop_assert!((back.siemens - siemens).abs() <= error);
        prop_assert!((back.farads - farads).abs() * TAU * hertz <= error);
    }

    #[test]
    fn nothing_infinite_comes_out(re in any::<f64>(), im in any::<f64>()) {
        let told = PLAIN.admittance(MEGAHERTZ, Complex64::new(re, im));
        prop_assert!(told.is_none_or(|told| told.farads.is_finite() && told.siemens.is_finite()));
    }
}
