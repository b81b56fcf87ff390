//! The simulated board, the recorder and the export together: what comes out is what was simulated, to half a step of the
//! board's converter.

#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

mod common;

use capsense::{Pipeline, Scene};
use capsense_hw::PseudoPort;
use capsense_hw::profile::built_in;
use capsense_hw::recording::{RecordingReader, Samples, recover};
use capsense_hw::stream::{Encoder, Sample, Value};
use common::{SCENE, capsense};
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

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
        .args(["device", "scene.toml", "--port", "pty", "--repeat", "--device", device])
        .current_dir(folder)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
    (Board(child), line.trim().to_owned())
}

#[test]
fn a_simulated_board_is_recorded_and_exported() {
    let folder = tempfile::tempdir().unwrap();
    let scene_file = folder.path().join("scene.toml");
    std::fs::write(&scene_file, SCENE.replace("frame_rate = 10.0", "frame_rate = 100.0")).unwrap();
    let scene = Scene::load(&scene_file).unwrap();
    let mut pipeline = Pipeline::new(&scene).unwrap();
    let frames: Vec<_> = (0..scene.frames).map(|index| pipeline.frame(index).unwrap().capacitance).collect();
    for (device, raw_step) in [("generic", 1.0), ("fdc1004", 1.0)] {
        let (board, port) = board(folder.path(), device);
        let (file, table) = (format!("{device}.mcap"), format!("{device}.csv"));
        let arguments = ["record", "--port", &port, "--device", device, "--seconds", "2", "--out", &file];
        let outcome = capsense(folder.path(), &arguments);
        assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
        drop(board);
        let outcome = capsense(folder.path(), &["export", &file, "--out", &table]);
        assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);

        let profile = built_in(device).unwrap();
        let entries: Vec<(usize, usize)> =
            if profile.channels == 0 { vec![(0, 0), (0, 1), (1, 1)] } else { vec![(0, 0), (1, 1)] };
        let mut reader = csv::Reader::from_path(folder.path().join(&table)).unwrap();
        let mut rows = 0;
        for row in reader.records() {
            let row = row.unwrap();
            let sequence: usize = row[2].parse().unwrap();
            for (channel, (i, j)) in entries.iter().enumerate() {
                let raw: f64 = row[4 + 2 * channel].parse().unwrap();
                let simulated = profile.raw(channel, frames[sequence % frames.len()].get(*i, *j));
                let Value::Number(expected) = simulated else { panic!("no raw value") };
                // A frame's field begins from the one before it, so a repeated scene is the same only to its tolerance.
                let tolerance = raw_step + 2e-4 * expected.abs();
                assert!((raw - expected).abs() <= tolerance, "{device}: {raw} is not {expected}");
            }
            rows += 1;
        }
        assert!(rows >= 20, "{device}: only {rows} samples");
    }
}

/// Sends numbered samples until told to stop, and tells when each went out.
fn numbered_samples(mut port: PseudoPort, stop: &AtomicBool) -> Vec<Instant> {
    let encoder = Encoder::new(&built_in("generic").unwrap().stream).unwrap();
    let mut sent = Vec::new();
    while !stop.load(Ordering::Relaxed) {
        let mut bytes = Vec::new();
        let count = sent.len() as u32;
        let values = [Value::Number(count.into())];
        encoder.encode(&Sample { values: &values, sequence: Some(count), ..Sample::default() }, &mut bytes);
        if port.send(&bytes).unwrap() {
            sent.push(Instant::now());
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    sent
}

/// Killed at any moment, the recorder leaves a file from which a true and unbroken recording is made.
#[test]
fn a_recorder_that_is_killed_leaves_a_recording() {
    let folder = tempfile::tempdir().unwrap();
    let (mut worst, mut kept) = (Duration::ZERO, 0);
    for kill in 0..50 {
        let port = PseudoPort::open().unwrap();
        let (path, file) = (port.path().to_owned(), format!("{kill}.mcap"));
        let partial = folder.path().join(format!("{file}.partial"));
        let stop = AtomicBool::new(false);
        let (sent, killed) = std::thread::scope(|scope| {
            let sender = scope.spawn(|| numbered_samples(port, &stop));
            let mut recorder = Command::new(env!("CARGO_BIN_EXE_capsense"))
                .args(["record", "--quiet", "--port", &path, "--out", &file])
                .current_dir(folder.path())
                .spawn()
                .unwrap();
            while !partial.exists() {
                std::thread::sleep(Duration::from_millis(1));
            }
            std::thread::sleep(Duration::from_millis(220 + 37 * kill % 250));
            recorder.kill().unwrap();
            let killed = Instant::now();
            recorder.wait().unwrap();
            stop.store(true, Ordering::Relaxed);
            (sender.join().unwrap(), killed)
        });
        let whole = folder.path().join(&file);
        if recover(&partial, &whole).is_err() {
            // Killed before its first chunk was written: nothing had been told yet.
            assert!(std::fs::metadata(&partial).unwrap().len() < 5000);
            continue;
        }
        let samples = Samples::new(RecordingReader::open(&whole).unwrap(), None).unwrap();
        let counts: Vec<u32> = samples.map(|sample| sample.unwrap().sequence.unwrap()).collect();
        assert!(counts.is_sorted() && counts.windows(2).all(|pair| pair[1] == pair[0] + 1), "{counts:?}");
        if let Some(last) = counts.last() {
            worst = worst.max(killed.saturating_duration_since(sent[*last as usize]));
            kept += 1;
        }
    }
    println!("{kept} of 50 recordings have samples; at most {worst:?} before the kill is lost");
    assert!(kept >= 25);
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
        (&["replay", "a.mcap", "--speed", "0"], "a.mcap"),
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
