//! What converters make of capacitances: statistics of the noises, and effects that have a closed form.

use capsense_core::capacitance::CapacitanceMatrix;
use capsense_core::measurement::{
    ChannelModel, Converter, Crosstalk, Influence, Mains, Measurement, MeasurementModel, OffsetDac, Reading,
};
use std::f64::consts::{LN_2, TAU};

const RATE: f64 = 100.0;

/// Two electrodes: self-capacitances of 10 and 20 pF, mutual 3 pF.
fn base() -> CapacitanceMatrix {
    matrix(10e-12, -3e-12, 20e-12)
}

fn matrix(first: f64, between: f64, second: f64) -> CapacitanceMatrix {
    CapacitanceMatrix::from_upper(2, |row, column| match (row, column) {
        (0, 0) => first,
        (1, 1) => second,
        _ => between,
    })
}

/// Channels (1, 1), (1, 2), (2, 2), each changed by `edit`.
fn model(edit: impl Fn(&mut ChannelModel)) -> MeasurementModel {
    let channels = [(0, 0), (0, 1), (1, 1)].map(|(row, column)| {
        let mut channel = ChannelModel { row, column, ..ChannelModel::default() };
        edit(&mut channel);
        channel
    });
    MeasurementModel { seed: 7, channels: channels.to_vec(), ..MeasurementModel::default() }
}

/// Readings of so many scans, while the capacitances follow time.
fn scans(model: &MeasurementModel, count: usize, at: impl Fn(f64) -> CapacitanceMatrix) -> Vec<Vec<Reading>> {
    let mut measurement = Measurement::new(model, RATE, &base()).unwrap();
    let times = (0..count).map(|scan| scan as f64 / RATE);
    times.map(|time| measurement.measure(time, &at(time)).to_vec()).collect()
}

/// Errors of one channel in resting surroundings, in farads.
fn errors(model: &MeasurementModel, count: usize, channel: usize) -> Vec<f64> {
    let ChannelModel { row, column, .. } = model.channels[channel];
    let truth = base().get(row, column);
    scans(model, count, |_| base()).iter().map(|readings| readings[channel].farads - truth).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let [of_a, of_b] = [mean(a), mean(b)];
    let product = |x: &[f64], y: &[f64], mx: f64, my: f64| -> f64 {
        x.iter().zip(y).map(|(x, y)| (x - mx) * (y - my)).sum()
    };
    product(a, b, of_a, of_b) / (product(a, a, of_a, of_a) * product(b, b, of_b, of_b)).sqrt()
}

/// Square of the amplitude spectrum at a frequency, as the power of a sine of that amplitude: A²/2.
fn power(values: &[f64], hertz: f64) -> f64 {
    let part = |phase: f64| -> f64 {
        let terms = values.iter().enumerate();
        terms.map(|(n, x)| x * (TAU * hertz * n as f64 / RATE + phase).cos()).sum::<f64>()
    };
    2.0 * (part(0.0).powi(2) + part(-TAU / 4.0).powi(2)) / (values.len() as f64).powi(2)
}

/// Allan variance with means over so many samples.
fn allan_variance(values: &[f64], over: usize) -> f64 {
    let means: Vec<f64> = values.chunks_exact(over).map(mean).collect();
    let squares: Vec<f64> = means.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).collect();
    0.5 * mean(&squares)
}

fn assert_near(value: f64, expected: f64, error: f64) {
    assert!((value - expected).abs() <= error, "{value:e} is not {expected:e} to {error:e}");
}

#[test]
fn without_errors_readings_have_the_bits_of_the_truth() {
    for (scan, readings) in
        scans(&model(|_| {}), 50, |time| matrix(1e-11 + time, -time / 3.0, 2e-11)).iter().enumerate()
    {
        let time = scan as f64 / RATE;
        let truth = [1e-11 + time, -time / 3.0, 2e-11];
        for (reading, truth) in readings.iter().zip(truth) {
            assert_eq!([reading.farads, reading.analogue_farads], [truth; 2]);
            assert_eq!(reading.raw, None);
        }
    }
}

#[test]
fn white_noise_has_its_variance_no_memory_and_no_company() {
    let sigma = 2e-16;
    let model = model(|channel| channel.white_noise_farads = sigma);
    let count = 40_000;
    let noises: Vec<Vec<f64>> = (0..3).map(|channel| errors(&model, count, channel)).collect();
    let free = 4.0 / (count as f64).sqrt();
    for (index, noise) in noises.iter().enumerate() {
        let variance = mean(&noise.iter().map(|x| x * x).collect::<Vec<_>>());
        assert_near(variance / sigma.powi(2), 1.0, 4.0 * (2.0 / count as f64).sqrt());
        assert_near(mean(noise) / sigma, 0.0, free);
        let kurtosis = mean(&noise.iter().map(|x| (x / sigma).powi(4)).collect::<Vec<_>>());
        assert_near(kurtosis, 3.0, 4.0 * (96.0 / count as f64).sqrt());
        assert_near(correlation(&noise[1..], &noise[..count - 1]), 0.0, free);
        assert_near(correlation(noise, &noises[(index + 1) % 3]), 0.0, free);
    }
}

/// White noise falls as the root of the averaging time; 1/f noise A²/f has the Allan variance 2 ln 2 A² at every time.
#[test]
fn drift_has_a_flat_allan_deviation_and_white_noise_has_not() {
    let amplitude = 5e-17;
    let drift = errors(&model(|channel| channel.drift_farads = amplitude), 400_000, 0);
    for (over, error) in [(10, 0.1), (100, 0.1), (1000, 0.25)] {
        let level = allan_variance(&drift, over) / (2.0 * LN_2 * amplitude.powi(2));
        assert_near(level, 1.0, error);
    }
    let white = errors(&model(|channel| channel.white_noise_farads = amplitude), 100_000, 0);
    for over in [1, 10, 100] {
        assert_near(allan_variance(&white, over) * over as f64 / amplitude.powi(2), 1.0, 0.15);
    }
}

/// Periodograms of 200 pieces of 40 s, around frequencies a decade apart: levels are known to 5 %.
#[test]
fn drift_has_a_spectrum_of_slope_minus_one() {
    let amplitude = 5e-17;
    let drift = errors(&model(|channel| channel.drift_farads = amplitude), 800_000, 2);
    let length = 4000;
    // Windowed, or what is below the lowest frequency would leak upwards; the window has a mean square of 3/2.
    let window = |n: usize| 1.0 - (TAU * n as f64 / length as f64).cos();
    let windowed = |piece: &[f64]| -> Vec<f64> {
        let mean = mean(piece);
        piece.iter().enumerate().map(|(n, x)| (x - mean) * window(n)).collect()
    };
    let pieces: Vec<Vec<f64>> = drift.chunks_exact(length).map(windowed).collect();
    let level = |hertz: f64| {
        let bins = (0..4).map(|bin| hertz + f64::from(bin) * RATE / length as f64);
        let of_bin = |hertz: f64| {
            let powers: Vec<f64> = pieces.iter().map(|piece| power(piece, hertz)).collect();
            hertz * mean(&powers) * length as f64 / RATE / 1.5
        };
        mean(&bins.map(of_bin).collect::<Vec<_>>())
    };
    for hertz in [0.1, 1.0, 10.0] {
        assert_near(level(hertz) / amplitude.powi(2), 1.0, 0.12);
    }
}

#[test]
fn a_converter_errs_by_half_a_step_and_stops_at_its_rails() {
    let converter = Converter { farads_per_code: 1e-15, bits: 16, zero: 32_768.0 };
    let model = MeasurementModel { converter: Some(converter), ..model(|_| {}) };
    let at = |time: f64| matrix(12.34e-12 + time * 7.7e-15, -time * 7.7e-15, 40e-12);
    let mut largest = 0.0f64;
    for (scan, readings) in scans(&model, 3000, at).iter().enumerate() {
        let truth = at(scan as f64 / RATE);
        largest = largest.max((readings[0].farads - truth.get(0, 0)).abs());
        assert_near(readings[1].farads, truth.get(0, 1), 0.500_001e-15);
        let mutual = 32_768.0 - truth.get(0, 1) / 1e-15;
        assert_near(f64::from(readings[1].raw.unwrap()), mutual, 0.500_001);
        assert_eq!(readings[2].raw, Some(65_535), "above the range");
        assert_near(readings[2].farads, 32.767e-12, 1e-20);
    }
    assert!((0.49e-15..=0.500_001e-15).contains(&largest), "{largest:e}");
}

#[test]
fn an_offset_dac_shifts_the_range_and_its_own_error_the_reading() {
    let converter = Converter { farads_per_code: 1e-16, bits: 16, zero: 0.0 };
    let dac = OffsetDac { farads_per_step: 3e-12, largest: 31, setting: None, gain_spread: 0.0 };
    let with = |dac| MeasurementModel { converter: Some(converter), ..model(|channel| channel.dac = dac) };
    let readings = &scans(&with(dac), 1, |_| base())[0];
    assert_eq!(readings[0].raw, Some(10_000), "three steps, 1 pF left");
    assert_near(readings[0].farads, 10e-12, 1e-24);
    assert_eq!(readings[1].raw, Some(0), "one step, nothing left of the mutual capacitance");
    let fixed = OffsetDac { setting: Some(2), ..dac };
    assert_eq!(scans(&with(fixed), 1, |_| base())[0][0].raw, Some(40_000));
    let inexact = with(OffsetDac { gain_spread: 0.01, ..fixed });
    let error = scans(&inexact, 1, |_| base())[0][0].farads - 10e-12;
    assert!((1e-15..3e-13).contains(&error.abs()), "of 6 pF some per cent: {error:e}");
}

#[test]
fn gain_and_offset_err_as_they_are_told_and_spread() {
    let told = model(|channel| (channel.gain, channel.offset_farads) = (0.02, -1e-14));
    assert_near(errors(&told, 1, 2)[0], 0.02 * 20e-12 - 1e-14, 1e-24);
    let spread = |seed| {
        let model = model(|channel| (channel.gain_spread, channel.offset_spread_farads) = (0.01, 0.0));
        let errors = errors(&MeasurementModel { seed, ..model }, 2, 0);
        assert_eq!(errors[0], errors[1], "drawn once");
        errors[0] / 10e-12
    };
    let gains: Vec<f64> = (0..400).map(spread).collect();
    let sigma = mean(&gains.iter().map(|gain| gain * gain).collect::<Vec<_>>()).sqrt();
    assert_near(sigma, 0.01, 0.0015);
    assert_near(mean(&gains), 0.0, 0.002);
}

#[test]
fn mains_appear_at_the_alias_of_the_scan() {
    let mains = |hertz, integration_seconds| {
        let mains = Mains { farads: 1e-15, hertz, integration_seconds };
        let model = MeasurementModel { mains, seconds_per_channel: 1e-3, ..model(|_| {}) };
        let errors: Vec<Vec<f64>> = (0..3).map(|channel| errors(&model, 1000, channel)).collect();
        errors
    };
    // 100 scans a second: 148 Hz is at 48 Hz, 230 Hz at 30 Hz.
    for (hertz, alias) in [(48.0, 48.0), (52.0, 48.0), (148.0, 48.0), (230.0, 30.0), (103.0, 3.0)] {
        let errors = &mains(hertz, 0.0)[2];
        assert_near(power(errors, alias), 0.5e-30, 1e-36);
        let all = mean(&errors.iter().map(|x| x * x).collect::<Vec<_>>());
        assert_near(all, 0.5e-30, 1e-36);
    }
    // The second channel is converted a millisecond later than the first: the phase of 230 Hz is 0.23 cycles on.
    let [first, second] = [0, 2].map(|channel| mains(230.0, 0.0)[channel].clone());
    let turned = (TAU * 0.23 * 2.0).cos();
    assert_near(correlation(&first, &second), turned, 1e-6);
    // Integration over whole periods lets nothing through, over half a period 2/π.
    assert_near(power(&mains(103.0, 10.0 / 103.0)[0], 3.0), 0.0, 1e-50);
    assert_near(power(&mains(103.0, 0.5 / 103.0)[0], 3.0) / 0.5e-30, (4.0 / TAU).powi(2), 1e-6);
}

#[test]
fn crosstalk_is_a_matrix() {
    let crosstalk = vec![
        Crosstalk { from: 0, to: 1, factor: 0.01 },
        Crosstalk { from: 2, to: 1, factor: 0.02 },
        Crosstalk { from: 1, to: 2, factor: -0.1 },
    ];
    let model = MeasurementModel { crosstalk, ..model(|_| {}) };
    let readings = &scans(&model, 1, |_| base())[0];
    assert_near(readings[0].farads, 10e-12, 0.0);
    assert_near(readings[1].farads, -(3e-12 + 0.01 * 10e-12 + 0.02 * 20e-12), 1e-24);
    assert_near(readings[2].farads, 20e-12 - 0.1 * 3e-12, 1e-24);
}

#[test]
fn delay_and_scan_shift_a_ramp() {
    let ramp = |time: f64| matrix(10e-12 + time * 1e-12, -3e-12, 20e-12 + time * 1e-12);
    let delayed =
        MeasurementModel { seconds_per_channel: 2e-3, ..model(|channel| channel.delay_seconds = 0.0137) };
    for (scan, readings) in scans(&delayed, 40, ramp).iter().enumerate().skip(3) {
        let time = scan as f64 / RATE;
        assert_near(readings[0].farads, ramp(time - 0.0137 - 0.004).get(0, 0), 1e-23);
        assert_near(readings[2].farads, ramp(time - 0.0137).get(1, 1), 1e-23);
    }
    let start = &scans(&delayed, 1, ramp)[0];
    assert_near(start[0].farads, 10e-12, 0.0);
}

/// On a ramp of 1 pF a second a jitter |n| of 1 ms is seen as a mean of √(2/π) fF, and a deviation of √(1 - 2/π) fF.
#[test]
fn jitter_is_noise_in_proportion_to_the_slope() {
    let jittery = model(|channel| channel.jitter_seconds = 1e-3);
    let ramp = |time: f64| matrix(10e-12 + time * 1e-12, -3e-12, 20e-12);
    let late: Vec<f64> = scans(&jittery, 20_000, ramp)
        .iter()
        .enumerate()
        .skip(2)
        .map(|(scan, readings)| (ramp(scan as f64 / RATE).get(0, 0) - readings[0].farads) / 1e-15)
        .collect();
    let expected = (4.0 / TAU).sqrt();
    assert_near(mean(&late), expected, 0.02);
    let variance = mean(&late.iter().map(|x| (x - mean(&late)).powi(2)).collect::<Vec<_>>());
    assert_near(variance, 1.0 - 4.0 / TAU, 0.02);
    assert!(late.iter().all(|late| *late > -1e-6), "never from the future");
}

#[test]
fn surroundings_change_gain_and_offset_with_their_time_constant() {
    let temperature = Influence { change: 10.0, seconds: 0.2, gain: -37.5e-6, offset_farads: 1e-15 };
    let humidity = Influence { change: 30.0, seconds: 0.0, gain: 0.0, offset_farads: 2e-16 };
    let model = MeasurementModel { temperature, humidity, calibration_scans: 4, ..model(|_| {}) };
    let errors = errors(&model, 100, 0);
    for (scan, error) in errors.iter().enumerate() {
        let warmed = 10.0 * (1.0 - (-(scan as f64) / RATE / 0.2).exp());
        let expected = warmed * (-37.5e-6 * 10e-12 + 1e-15) + 30.0 * 2e-16;
        assert_near(*error, expected, 1e-22);
    }
}

#[test]
fn a_dead_channel_is_constant_and_harms_no_other() {
    let noisy = |channel: &mut ChannelModel| channel.white_noise_farads = 1e-15;
    let converter = Some(Converter { farads_per_code: 1e-16, bits: 24, zero: 8_388_608.0 });
    let sound = MeasurementModel { converter, ..model(noisy) };
    let mut one_dead = sound.clone();
    one_dead.channels[1].dead = true;
    let [sound, one_dead] = [sound, one_dead].map(|model| scans(&model, 50, |_| base()));
    for (sound, one_dead) in sound.iter().zip(&one_dead) {
        assert_eq!(one_dead[1], Reading { raw: Some(8_388_608), farads: 0.0, analogue_farads: 0.0 });
        assert_eq!([one_dead[0], one_dead[2]], [sound[0], sound[2]]);
    }
}

#[test]
fn calibration_takes_the_offset_and_leaves_the_gain_of_changes() {
    let noisy = |channel: &mut ChannelModel| {
        (channel.gain, channel.offset_farads, channel.white_noise_farads) = (0.05, 3e-13, 1e-15);
    };
    let calibrated = MeasurementModel { calibration_scans: 10_000, ..model(noisy) };
    let readings = scans(&calibrated, 10_000, |_| matrix(11e-12, -3e-12, 20e-12));
    let of = |channel: usize| mean(&readings.iter().map(|r| r[channel].farads).collect::<Vec<_>>());
    let error = 5.0 * 1e-15 * (2.0f64 / 10_000.0).sqrt();
    assert_near(of(0), 10e-12 + 1.05 * 1e-12, error);
    assert_near(of(1), -3e-12, error);
    let not = readings.iter().map(|r| r[0].analogue_farads).collect::<Vec<_>>();
    assert_near(mean(&not), 1.05 * 11e-12 + 3e-13, error);
}

/// A channel's noises are its own: the same whichever channels and errors there are beside them.
#[test]
fn the_seed_decides_and_streams_are_independent() {
    let noisy = |channel: &mut ChannelModel| {
        (channel.white_noise_farads, channel.jitter_seconds) = (1e-15, 1e-3);
    };
    let whole = model(noisy);
    let run = |model: &MeasurementModel| scans(model, 100, |_| base());
    assert_eq!(run(&whole), run(&whole));
    assert_ne!(run(&whole), run(&MeasurementModel { seed: 8, ..whole.clone() }));
    let mut alone = whole.clone();
    alone.channels.remove(0);
    for (whole, alone) in run(&whole).iter().zip(&run(&alone)) {
        assert_eq!(whole[1..], alone[..]);
    }
    let mut drifting = whole.clone();
    drifting.channels[0].drift_farads = 1e-16;
    drifting.channels[0].gain_spread = 0.1;
    for (whole, drifting) in run(&whole).iter().zip(&run(&drifting)) {
        assert_ne!(whole[0], drifting[0]);
        assert_eq!(whole[1..], drifting[1..]);
    }
}

/// Each parameter that makes no sense is refused by its name.
#[test]
fn nonsense_is_refused() {
    type Edit = fn(&mut MeasurementModel);
    let cases: [(&str, Edit); 16] = [
        ("channels", |model| model.channels[2].row = 2),
        ("gain", |model| model.channels[0].gain = f64::NAN),
        ("offset", |model| model.channels[0].offset_farads = f64::INFINITY),
        ("gain_spread", |model| model.channels[0].gain_spread = -0.1),
        ("white_noise", |model| model.channels[0].white_noise_farads = -1e-15),
        ("drift", |model| model.channels[0].drift_farads = 2.0),
        ("delay", |model| model.channels[0].delay_seconds = 1e5),
        ("jitter", |model| model.channels[0].jitter_seconds = -1.0),
        ("offset_dac", |model| model.channels[0].dac.setting = Some(1)),
        ("seconds_per_channel", |model| model.seconds_per_channel = 0.01),
        ("crosstalk", |model| model.crosstalk.push(Crosstalk { from: 1, to: 1, factor: 0.1 })),
        ("crosstalk", |model| model.crosstalk.push(Crosstalk { from: 3, to: 1, factor: 0.1 })),
        ("mains", |model| model.mains.hertz = -50.0),
        ("temperature", |model| model.temperature.seconds = f64::NAN),
        ("humidity", |model| model.humidity.gain = 11.0),
        ("converter", |model| {
            model.converter = Some(Converter { bits: 33, farads_per_code: 1e-15, zero: 0.0 })
        }),
    ];
    for (key, edit) in cases {
        let mut model = model(|_| {});
        edit(&mut model);
        assert_eq!(Measurement::new(&model, RATE, &base()).unwrap_err().key, key);
    }
    for rate in [0.0, f64::NAN, -1.0] {
        assert!(Measurement::new(&model(|_| {}), rate, &base()).is_err());
    }
}
