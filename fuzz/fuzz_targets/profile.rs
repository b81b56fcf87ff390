//! Any text as a profile file; what is accepted survives being written, and reads and writes any number.

#![no_main]

use capsense_hw::profile::DeviceProfile;
use capsense_hw::stream::{Decoder, Encoder, Sample, Start, Value};
use std::time::Duration;

libfuzzer_sys::fuzz_target!(|text: &str| {
    let Ok(profile) = DeviceProfile::parse("fuzzed.toml", text) else { return };
    let written = profile.to_toml().expect("a profile that can be written");
    assert_eq!(
        DeviceProfile::parse("again.toml", &written).expect("a profile that can be read again"),
        profile
    );
    let numbers = [0.0, 1.0, -1.0, 0.5e-12, 3e9, f64::MAX, f64::MIN_POSITIVE];
    let values: Vec<Value> = numbers.iter().map(|number| profile.raw(0, *number)).collect();
    for value in values.iter().chain(&numbers.map(Value::Number)) {
        assert!(profile.reading(1, *value).value.is_none_or(f64::is_finite));
    }
    let mut bytes = Vec::new();
    let encoder = Encoder::new(&profile.stream).expect("a format that was checked");
    encoder.encode(&Sample { values: &values, ..Sample::default() }, &mut bytes);
    let mut decoder = Decoder::new(&profile.stream, Start::Boundary).expect("a format that was checked");
    decoder.push(&bytes, Duration::ZERO, &mut |_| {});
    decoder.finish(Duration::ZERO, &mut |_| {});
});
