//! The table `[measurement]` of a scene file: what is read, what is refused, and what `capsense run` and `capsense device` make of it.

use crate::common::{SCENE, capsense, line_of};
use capsense::Scene;
use capsense::core::measurement::{
    ChannelModel, Converter, Crosstalk, Influence, Mains, MeasurementModel, OffsetDac,
};
use std::collections::BTreeMap;
use std::path::Path;

/// [`SCENE`] with more at its end.
fn scene(measurement: &str) -> String {
    format!("{SCENE}\n{measurement}")
}

fn model(measurement: &str) -> MeasurementModel {
    let scene = Scene::parse("scene.toml", &scene(measurement), Path::new("")).unwrap();
    scene.measurement.unwrap()
}

#[test]
fn every_key_is_read() {
    assert_eq!(Scene::parse("scene.toml", SCENE, Path::new("")).unwrap().measurement, None);
    let plain = model("[measurement]");
    let entries: Vec<(usize, usize)> = plain.channels.iter().map(|c| (c.row, c.column)).collect();
    assert_eq!(entries, [(0, 0), (0, 1), (1, 1)]);
    assert!(
        plain
            .channels
            .iter()
            .all(|c| *c == ChannelModel { row: c.row, column: c.column, ..Default::default() })
    );
    assert_eq!(MeasurementModel { channels: vec![], ..plain }, MeasurementModel::default());

    let told = model(
        r#"
        [measurement]
        seed = 12
        channels = [["E2", "E1"], ["E2", "E2"]]
        dead = [["E1", "E2"]]
        seconds_per_channel = 0.02
        gain = [0.01, -0.02]
        gain_spread = 0.03
        offset = 1e-15
        offset_spread = 2e-15
        white_noise = 3e-16
        drift = 4e-17
        delay = 5
        jitter = [0.6, 0]
        crosstalk = [[0, 0.5], [0, 0]]
        mains = { amplitude = 7e-15, frequency = 50, integration = 0.02 }
        temperature = { change = 10, seconds = 60, gain = 1e-4, offset = 2e-16 }
        humidity = { change = -20, offset = 3e-16 }
        offset_dac = { step = 3e-12, largest = 31, setting = [4, 5], spread = 0.1 }
        converter = { step = 1e-18, bits = 24, zero = 8388608 }
        calibration_scans = 100
        "#,
    );
    let channel = |column, gain, jitter_seconds, setting, dead| ChannelModel {
        row: if dead { 0 } else { 1 },
        column,
        gain,
        gain_spread: 0.03,
        offset_farads: 1e-15,
        offset_spread_farads: 2e-15,
        white_noise_farads: 3e-16,
        drift_farads: 4e-17,
        delay_seconds: 5.0,
        jitter_seconds,
        dac: OffsetDac { farads_per_step: 3e-12, largest: 31, setting: Some(setting), gain_spread: 0.1 },
        dead,
    };
    let expected = MeasurementModel {
        seed: 12,
        channels: vec![channel(1, 0.01, 0.6, 4, true), channel(1, -0.02, 0.0, 5, false)],
        seconds_per_channel: 0.02,
        crosstalk: vec![Crosstalk { from: 1, to: 0, factor: 0.5 }],
        mains: Mains { farads: 7e-15, hertz: 50.0, integration_seconds: 0.02 },
        temperature: Influence { change: 10.0, seconds: 60.0, gain: 1e-4, offset_farads: 2e-16 },
        humidity: Influence { change: -20.0, seconds: 0.0, gain: 0.0, offset_farads: 3e-16 },
        converter: Some(Converter { farads_per_code: 1e-18, bits: 24, zero: 8_388_608.0 }),
        calibration_scans: 100,
    };
    assert_eq!(told, expected);

    let pairs: Vec<(usize, usize)> =
        model("[measurement]\ncrosstalk = 0.01").crosstalk.iter().map(|path| (path.from, path.to)).collect();
    assert_eq!(pairs, [(0, 1), (1, 0), (1, 2), (2, 1)], "neighbours see each other");
    assert_eq!(model("[measurement.offset_dac]\nstep = 1e-12\nlargest = 3").channels[0].dac.setting, None);
}

#[test]
fn what_makes_no_sense_is_refused_with_its_line() {
    for (line, key, says) in [
        ("noise = 1", "measurement.noise", "unknown field"),
        ("gain = \"high\"", "measurement.gain", "a number, or a list"),
        ("gain = [0.1, 0.2]", "measurement.gain", "2 numbers for 3 channels"),
        ("gain = nan", "measurement.gain", "NaN"),
        ("drift = -1e-15", "measurement.drift", "negative"),
        ("seed = -1", "measurement.seed", "negative"),
        ("channels = [[\"E1\", \"E3\"]]", "measurement.channels[0]", "`E3`"),
        ("channels = [[\"E1\", \"E2\"], [\"E2\", \"E1\"]]", "measurement.channels[1]", "twice"),
        ("channels = [[\"E1\"]]", "measurement.channels", "length 2"),
        ("channels = []\ndead = [[\"E1\", \"E2\"]]", "measurement.dead[0]", "not among"),
        ("seconds_per_channel = 0.05", "measurement.seconds_per_channel", "do not fit"),
        ("delay = 2e4", "measurement.delay", "scans"),
        ("crosstalk = [[0, 1], [1, 0]]", "measurement.crosstalk", "3 rows"),
        ("crosstalk = [[1, 0, 0], [0, 0, 0], [0, 0, 0]]", "measurement.crosstalk", "itself"),
        ("mains = { amplitude = 1e-15 }", "measurement.mains", "frequency"),
        ("mains = { amplitude = 1e-15, frequency = 50, phase = 1 }", "measurement.mains.phase", "unknown"),
        ("temperature = { change = 1, seconds = -1 }", "measurement.temperature", "seconds"),
        (
            "offset_dac = { step = 1e-12, largest = 3, setting = 4 }",
            "measurement.offset_dac.setting",
            "0 to 3",
        ),
        (
            "offset_dac = { step = 1e-12, largest = 3, setting = 0.5 }",
            "measurement.offset_dac.setting",
            "whole",
        ),
        ("converter = { step = 1e-15, bits = 33 }", "measurement.converter.bits", "1 to 32"),
        ("converter = { step = 0.0, bits = 16 }", "measurement.converter", "step"),
        ("converter = { step = 1e-15, bits = 4, zero = 16 }", "measurement.converter", "zero"),
        ("calibration_scans = -1", "measurement.calibration_scans", "0 to"),
    ] {
        let text = scene(&format!("[measurement]\n{line}\n"));
        let message = match Scene::parse("scene.toml", &text, Path::new("")) {
            Ok(_) => panic!("{line}: accepted"),
            Err(error) => error.to_string(),
        };
        let at = line_of(&text, line.lines().last().unwrap());
        assert!(message.starts_with(&format!("scene.toml:{at}: {key}: ")), "{line}: {message}");
        assert!(message.contains(says), "{line}: {message}");
    }
}

/// Columns of a table by name.
fn columns(path: &Path) -> BTreeMap<String, Vec<f64>> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    let names: Vec<String> = reader.headers().unwrap().iter().map(str::to_owned).collect();
    let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    let column = |at: usize| rows.iter().map(|row| row[at].parse().unwrap()).collect();
    names.iter().enumerate().map(|(at, name)| (name.clone(), column(at))).collect()
}

fn run(measurement: &str) -> BTreeMap<String, Vec<f64>> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("scene.toml"), scene(measurement)).unwrap();
    let outcome = capsense(folder.path(), &["run", "scene.toml", "--out", ".", "--quiet"]);
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    let report = std::fs::read_to_string(folder.path().join("report.json")).unwrap();
    assert_eq!(report.contains("\"measurement\""), !measurement.is_empty());
    columns(&folder.path().join("capacitance.csv"))
}

#[test]
fn a_run_has_raw_columns_beside_the_true_ones() {
    let bare = run("");
    let exact = run("[measurement]");
    let rough =
        run("[measurement]\nwhite_noise = 1e-16\nconverter = { step = 1e-15, bits = 20, zero = 100 }");
    for entry in ["E1_E1", "E1_E2", "E2_E2"] {
        let truth = format!("C_{entry}_F");
        let measured = format!("measured_{entry}_F");
        let raw = format!("raw_{entry}");
        assert_eq!(bare[&truth], exact[&truth]);
        assert_eq!(exact[&truth], exact[&measured], "no error: every bit");
        assert_eq!(bare[&truth], rough[&truth]);
        assert!(!bare.contains_key(&measured) && !exact.contains_key(&raw));
        for ((truth, measured), raw) in rough[&truth].iter().zip(&rough[&measured]).zip(&rough[&raw]) {
            assert!((measured - truth).abs() < 1.2e-15, "half a step and some of the noise");
            assert!(((raw - 100.0) * 1e-15 - measured.abs()).abs() < 1e-20);
        }
        assert!(rough[&truth] != rough[&measured]);
    }
}
