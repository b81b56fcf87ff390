//! The simulated board, the recorder and the export together: what comes out is what was simulated, to half a step of the
//! board's converter.

#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

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
