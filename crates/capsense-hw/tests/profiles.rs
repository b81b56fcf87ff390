//! Profiles against data sheets, and there and back.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test")]

use capsense_hw::profile::{DeviceProfile, Meaning, Reading, Resonator, Transfer, built_in, built_in_names};
use capsense_hw::stream::Value;
use proptest::prelude::*;

fn profile(name: &str) -> DeviceProfile {
    built_in(name).unwrap()
}

fn value(profile: &DeviceProfile, channel: usize, raw: u32) -> f64 {
    profile.reading(channel, Value::Number(raw.into())).value.unwrap()
}

fn assert_near(value: f64, expected: f64, error: f64) {
    assert!((value - expected).abs() <= error, "{value} is not {expected} to {error}");
}

/// From a vendor's forum: setting 17 and code 2224, then setting 25 and code 40000, are 11.78 pF apart.
#[test]
fn ad7147_golden_vector() {
    let mut profile = profile("ad7147");
    let mut with_setting = |setting, code| {
        let Transfer::Linear(linear) = &mut profile.transfer else { panic!("not linear") };
        linear.dac.as_mut().unwrap().channels = vec![setting];
        value(&profile, 0, code)
    };
    let change = with_setting(25, 40_000) - with_setting(17, 2_224);
    assert_near(change, 11.78e-12, 0.005e-12);
    assert_eq!(profile.meaning, Meaning::Relative);
}

#[test]
fn ad7746_golden_vector() {
    assert_near(value(&profile("ad7746"), 0, 0x7A_4572), -0.183_319e-12, 1e-18);
}

#[test]
fn fdc1004_golden_vector() {
    assert_near(value(&profile("fdc1004"), 0, 0x59_1B38), 11.1383e-12, 1e-16);
}

/// From the data sheet: 992 of 4096 at a divider of 2 and 2.4 MHz.
#[test]
fn fdc2112_golden_vector() {
    let mut resonator = resonator("fdc2112");
    resonator.reference_hertz = 2.4e6;
    resonator.input_divider = vec![1.0, 2.0];
    assert_eq!(resonator.frequency(1, 992.0), 1_162_500.0);
    assert_eq!(resonator.frequency(0, 992.0), 581_250.0);
    assert_eq!(resonator.frequency(3, 992.0), 1_162_500.0);
    resonator.offset = vec![0, 1 << 12];
    assert_eq!(resonator.frequency(1, 992.0), 1_162_500.0 + 2.0 * 2.4e6 / 16.0);
}

fn resonator(name: &str) -> Resonator {
    match profile(name).transfer {
        Transfer::Resonator(resonator) => resonator,
        other => panic!("{other:?}"),
    }
}

/// The vendor's board, 18 µH and 33 pF, swings at 6.53 MHz; what its sketch prints is near this.
#[test]
fn fdc2214_without_an_electrode_reads_the_boards_frequency() {
    let profile = profile("fdc2214");
    let Value::Number(code) = profile.raw(0, 0.0) else { panic!("no code") };
    let hertz = resonator("fdc2214").frequency(0, code);
    assert_near(hertz, 6.530e6, 0.002e6);
    assert_near(code, 43_823_473.0, 5e3);
    assert!(value(&profile, 0, code as u32 - 1000) > 0.0, "more capacitance is a lower frequency");
}

/// 16 µA for 0.5 µs into 5 pF are 1.6 V: 496 of 1023 at 3.3 V.
#[test]
fn mpr121_measures_a_voltage() {
    assert_eq!(profile("mpr121").raw(0, 5e-12), Value::Number(496.0));
    assert_near(value(&profile("mpr121"), 0, 496), 5e-12, 0.01e-12);
}

#[test]
fn touch_read_counts_fifty_a_picofarad() {
    assert_near(value(&profile("teensy"), 0, 850), 17e-12, 1e-18);
    assert_eq!(profile("teensy").meaning, Meaning::Relative);
}

#[test]
fn offset_dacs_shift_by_their_step_or_by_what_was_measured() {
    let mut fdc1004 = profile("fdc1004");
    let Transfer::Linear(linear) = &mut fdc1004.transfer else { panic!("not linear") };
    let dac = linear.dac.as_mut().unwrap();
    dac.channels = vec![0, 4];
    assert_near(value(&fdc1004, 1, 0), 12.5e-12, 1e-24);
    assert_eq!(value(&fdc1004, 0, 0), 0.0);
    let Transfer::Linear(linear) = &mut fdc1004.transfer else { panic!("not linear") };
    linear.dac.as_mut().unwrap().measured = (0..32).map(|setting| f64::from(setting) * 3e-12).collect();
    assert_near(value(&fdc1004, 1, 0), 12e-12, 1e-24);
    assert_eq!(fdc1004.raw(1, 12e-12), Value::Number(0.0));
}

#[test]
fn rails_flags_and_known_errors_are_told() {
    let ad7147 = profile("ad7147");
    assert!(ad7147.reading(0, Value::Number(0.0)).below_range);
    assert!(ad7147.reading(0, Value::Number(65_535.0)).above_range);
    assert_eq!(ad7147.raw(0, 1.0), Value::Number(65_535.0));
    assert_eq!(ad7147.raw(0, -1.0), Value::Number(0.0));

    let fdc2214 = profile("fdc2214");
    let flagged = fdc2214.reading(0, Value::Number(f64::from(0x2000_0000 | 43_000_000)));
    assert_eq!(flagged.value, fdc2214.reading(0, Value::Number(43e6)).value);
    assert_eq!(fdc2214.flag_names(flagged.flags).collect::<Vec<_>>(), ["watchdog"]);
    assert!(!flagged.is_sound());

    let fdc2112 = profile("fdc2112");
    let under = fdc2112.reading(0, Value::Number(0.0));
    assert_eq!((under.value, under.below_range), (None, true));
    assert!(fdc2112.reading(0, Value::Number(4095.0)).above_range);

    let labelled = profile("fdc1004-labelled");
    assert!(labelled.reading(0, Value::Number(31.99)).suspicious);
    assert!(labelled.reading(0, Value::Number(3.4)).is_sound());

    let ad7746 = profile("ad7746");
    assert_eq!(ad7746.status_names(0x08).collect::<Vec<_>>(), ["excitation-error"]);
}

#[test]
fn nothing_comes_of_nothing() {
    for name in built_in_names() {
        for value in [Value::Missing, Value::Invalid] {
            assert_eq!(profile(name).reading(0, value), Reading::default());
        }
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(profile(name).raw(0, value), Value::Invalid);
        }
    }
}

fn anything() -> impl Strategy<Value = f64> {
    prop_oneof![any::<f64>(), any::<u32>().prop_map(f64::from), -1e-10..1e-10, Just(0.0)]
}

proptest! {
    /// A word becomes a capacitance, and that capacitance the word.
    #[test]
    fn words_come_back(name in prop::sample::select(built_in_names()), channel in 0usize..16, bits in any::<u32>()) {
        let profile = profile(name);
        let raw = match &profile.word {
            Some(word) => word.encode(word.decode(f64::from(bits >> (32 - u32::from(word.bits)))).unwrap().result),
            None => f64::from(bits) / 10f64.powi(profile.decimals.into()),
        };
        if let Some(value) = profile.reading(channel, Value::Number(raw)).value {
            prop_assert_eq!(profile.raw(channel, value), Value::Number(raw));
        }
    }

    /// A capacitance within the range comes back to within half a step.
    #[test]
    fn capacitances_come_back(name in prop::sample::select(built_in_names()), picofarads in 0.01..3.9) {
        let profile = profile(name);
        let value = if profile.meaning == Meaning::Counts { f64::round(picofarads * 100.0) } else { picofarads * 1e-12 };
        let raw = profile.raw(0, value);
        let back = profile.reading(0, raw);
        let Value::Number(number) = raw else { panic!("no raw value of {value}") };
        if back.is_sound() {
            let step = if profile.word.is_some() { 1.0 } else { 10f64.powi(-i32::from(profile.decimals)) };
            let neighbours = [number - step, number + step];
            let neighbours = neighbours.map(|raw| profile.reading(0, Value::Number(raw)).value.unwrap());
            let widest = neighbours.iter().map(|other| (other - back.value.unwrap()).abs()).fold(0.0, f64::max);
            prop_assert!((back.value.unwrap() - value).abs() <= 0.51 * widest);
        }
    }

    /// No number makes a profile panic or lets anything through that is not finite.
    #[test]
    fn readings_are_finite(name in prop::sample::select(built_in_names()), channel: usize, number in anything()) {
        let profile = profile(name);
        let value = profile.reading(channel, Value::Number(number)).value;
        prop_assert!(value.is_none_or(f64::is_finite));
        if let Value::Number(raw) = profile.raw(channel, number) {
            prop_assert!(raw.is_finite());
        }
    }
}
