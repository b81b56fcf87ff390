//! The simulated board, the recorder and the export together: what comes out is what was simulated, to half a step of the
//! board's converter.

#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

#[path = "suite/common/mod.rs"]
mod common;

use capsense::{Pipeline, Scene};
use capsense_hw::profile::built_in;
use capsense_hw::stream::Value;
use common::{SCENE, capsense};
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

struct Board(Child);

impl Drop for Board {
    fn drop(&mut self) {
        // It may have ended by itself.
        drop(self.0.kill());
        drop(self.0.wait());
    }
}

/// Starts a simulated board and tells where it can be reached.
fn board(folder: &Path, device: &str) -> (Board, String) {
    let mut child = Command::new(env!("CARGO_BIN_EXE_capsense"))
        .args(["device", "scene.toml", "--port", "pty", "--device", device])
        .current_dir(folder)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
    (Board(child), line.trim().to_owned())
}

/// A scene of some seconds, so that no frame comes twice: a field begins from that of the frame before, so a repeated frame is the
/// same only to the tolerance of the solver.
fn long_scene() -> String {
    let scene =
        SCENE.replace("frame_rate = 10.0", "frame_rate = 50.0").replace("speed = 0.5", "speed = 0.04");
    assert!(scene.contains("50.0") && scene.contains("0.04"));
    scene
}

/// Records a simulated board for some seconds and exports: sequence number, then raw value and capacitance of each channel.
fn exported(folder: &Path, device: &str) -> Vec<(usize, Vec<[f64; 2]>)> {
    let (board, port) = board(folder, device);
    let (file, table) = (format!("{device}.mcap"), format!("{device}.csv"));
    let arguments = ["record", "--port", &port, "--device", device, "--seconds", "2", "--out", &file];
    let outcome = capsense(folder, &arguments);
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    drop(board);
    let outcome = capsense(folder, &["export", &file, "--out", &table]);
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    std::fs::remove_file(folder.join(&file)).unwrap();
    let mut reader = csv::Reader::from_path(folder.join(&table)).unwrap();
    let channels = (reader.headers().unwrap().len() - 5) / 2;
    let number = |row: &csv::StringRecord, column: usize| row[column].parse().unwrap_or(f64::NAN);
    let rows: Vec<(usize, Vec<[f64; 2]>)> = reader
        .records()
        .map(|row| {
            let row = row.unwrap();
            let values = (0..channels).map(|c| [number(&row, 4 + 2 * c), number(&row, 5 + 2 * c)]);
            (row[2].parse().unwrap(), values.collect())
        })
        .collect();
    assert!(rows.len() >= 20, "{device}: only {} samples", rows.len());
    rows
}

/// The raw value of every sample is, to the last bit, what the board's converter makes of the simulated capacitance, and the
/// exported one is off by no more than rounding to that.
#[test]
fn a_simulated_board_is_recorded_and_exported() {
    let folder = tempfile::tempdir().unwrap();
    let scene_file = folder.path().join("scene.toml");
    let converters = "measurement = { seed = 3, gain = 0.01, offset = 2e-14, white_noise = 1e-15 }";
    for (device, measurement) in [("generic", ""), ("fdc1004", ""), ("generic", converters)] {
        std::fs::write(&scene_file, format!("{measurement}\n{}", long_scene())).unwrap();
        let scene = Scene::load(&scene_file).unwrap();
        let mut pipeline = Pipeline::new(&scene).unwrap();
        let mut converters = scene.measurement(pipeline.simulator().base()).unwrap();
        let profile = built_in(device).unwrap();
        let entries: Vec<(usize, usize)> =
            if profile.channels == 0 { vec![(0, 0), (0, 1), (1, 1)] } else { vec![(0, 0), (1, 1)] };
        let rows = exported(folder.path(), device);
        let last = rows.last().unwrap().0;
        let simulated: Vec<Vec<f64>> = (0..=last)
            .map(|index| {
                let frame = pipeline.frame(index).unwrap();
                let truth = entries.iter().map(|(i, j)| frame.capacitance.get(*i, *j));
                match &mut converters {
                    None => truth.collect(),
                    Some(converters) => {
                        let time = index as f64 / scene.frame_rate;
                        let readings = converters.measure(time, &frame.capacitance);
                        readings.iter().map(|reading| reading.analogue_farads).collect()
                    }
                }
            })
            .collect();
        for (sequence, values) in rows {
            for (channel, (farads, [raw, told])) in simulated[sequence].iter().zip(values).enumerate() {
                assert_eq!(profile.raw(channel, *farads), Value::Number(raw), "{device}: sample {sequence}");
                let step = |raw| profile.reading(channel, Value::Number(raw)).value.unwrap();
                let half = 0.501 * (step(raw + 1.0) - step(raw)).abs();
                assert!((told - farads).abs() <= half, "{device}: {told} is not {farads}");
            }
        }
    }
}

#[test]
fn errors_of_the_user_have_exit_code_2() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.mcap"), "nothing").unwrap();
    std::fs::write(folder.path().join("bad.toml"), "name = 3").unwrap();
    for (arguments, told) in [
        (&["record", "--port", "x", "--device", "nonsense"][..], "nonsense"),
        (&["record", "--port", "x", "--device", "bad.toml"], "bad.toml:1"),
        (&["export", "a.mcap", "--out", "a.csv"], "a.mcap"),
        (&["export", "a.mcap", "--out", "a.txt"], "a.txt"),
        (&["recover", "a.mcap", "--out", "b.mcap"], "a.mcap"),
        (&["replay", "a.mcap", "--speed", "0"], "--speed 0"),
        (&["replay", "a.mcap", "--speed", "max"], "a.mcap"),
        (&["device", "--port", "pty", "--device", "text"], "counts"),
    ] {
        let outcome = capsense(folder.path(), arguments);
        assert_eq!(outcome.code, Some(2), "{arguments:?}: {}", outcome.stderr);
        assert!(outcome.stderr.contains(told), "{arguments:?}: {}", outcome.stderr);
    }
    let outcome = capsense(folder.path(), &["record", "--port", "no-such-port"]);
    assert_eq!(outcome.code, Some(1), "{}", outcome.stderr);
    assert!(!folder.path().join("recording.mcap.partial").exists());
}
