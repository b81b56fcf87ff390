//! A recording once more: as lines, as a table, at a pseudo-terminal, and after it was cut off.

#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

#[path = "suite/common/mod.rs"]
mod common;

use capsense_hw::profile::built_in;
use capsense_hw::recording::{Header, RecordingWriter};
use capsense_hw::stream::{Encoder, Sample, Value};
use common::capsense;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

const SAMPLES: u32 = 60;

/// A recording of one second of an FDC2214, `a.mcap` in a folder.
fn recording(folder: &Path) {
    let profile = built_in("fdc2214").unwrap();
    let header = Header::new("/dev/ttyTEST", 1_800_000_000_000_000_000, &profile).unwrap();
    let mut writer = RecordingWriter::create(&folder.join("a.mcap"), &header).unwrap();
    let encoder = Encoder::new(&profile.stream).unwrap();
    for sequence in 0..SAMPLES {
        let farads = |channel: u32| 1e-12 + f64::from(sequence + channel) * 1e-15;
        let values: Vec<Value> =
            (0..4).map(|channel| profile.raw(channel as usize, farads(channel))).collect();
        let mut bytes = Vec::new();
        let sample = Sample { values: &values, sequence: Some(sequence), ..Sample::default() };
        encoder.encode(&sample, &mut bytes);
        let time = Duration::from_secs(1) * sequence / SAMPLES;
        writer.raw(time, &bytes).unwrap();
        writer.tick(time).unwrap();
    }
    writer.finish().unwrap();
}

fn expect(folder: &Path, arguments: &[&str]) -> String {
    let outcome = capsense(folder, arguments);
    assert_eq!(outcome.code, Some(0), "{arguments:?}: {}", outcome.stderr);
    outcome.stdout
}

fn table(path: &Path) -> Vec<csv::StringRecord> {
    csv::Reader::from_path(path).unwrap().records().map(Result::unwrap).collect()
}

#[test]
fn lines_and_tables_are_those_of_the_export() {
    let folder = tempfile::tempdir().unwrap();
    recording(folder.path());
    expect(folder.path(), &["export", "a.mcap", "--out", "a.csv"]);
    let exported = std::fs::read_to_string(folder.path().join("a.csv")).unwrap();
    for speed in ["max", "5"] {
        let replayed = expect(folder.path(), &["replay", "a.mcap", "--to", "csv", "--speed", speed]);
        assert_eq!(replayed, exported);
    }
    let lines = expect(folder.path(), &["replay", "a.mcap", "--speed", "max"]);
    let rows = table(&folder.path().join("a.csv"));
    assert_eq!(rows.len(), SAMPLES as usize);
    for (line, row) in lines.lines().zip(&rows) {
        let values: Vec<&str> = line.split(',').collect();
        assert_eq!(values[1..], [&row[5], &row[7], &row[9], &row[11]]);
    }
}

/// A replay to a pseudo-terminal that goes on, and the path of that.
fn replayed(folder: &Path, speed: &str) -> (Child, String) {
    let mut replay = Command::new(env!("CARGO_BIN_EXE_capsense"))
        .args(["replay", "a.mcap", "--to", "pty", "--speed", speed])
        .current_dir(folder)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut port = String::new();
    BufReader::new(replay.stdout.take().unwrap()).read_line(&mut port).unwrap();
    (replay, port.trim().to_owned())
}

/// Every sample arrives at who reads the pseudo-terminal, the last one too, at whatever speed.
#[test]
fn a_replay_at_a_pseudo_terminal_is_recorded_whole() {
    let folder = tempfile::tempdir().unwrap();
    recording(folder.path());
    expect(folder.path(), &["export", "a.mcap", "--out", "a.csv"]);
    for speed in ["max", "1"] {
        let (mut replay, port) = replayed(folder.path(), speed);
        let file = format!("{speed}.mcap");
        let record = ["record", "--port", &port, "--device", "fdc2214", "--seconds", "2", "--out", &file];
        expect(folder.path(), &record);
        drop(replay.kill());
        replay.wait().unwrap();
        expect(folder.path(), &["export", &file, "--out", "again.csv"]);
        let [first, again] = ["a.csv", "again.csv"].map(|name| table(&folder.path().join(name)));
        let without_time =
            |row: &csv::StringRecord| row.iter().skip(1).map(str::to_owned).collect::<Vec<_>>();
        assert_eq!(
            again.iter().map(without_time).collect::<Vec<_>>(),
            first.iter().map(without_time).collect::<Vec<_>>(),
            "at speed {speed}"
        );
    }
}

/// The commands of docs/hardware.md, on what a killed recorder leaves.
#[test]
fn a_recording_cut_off_is_recovered_where_it_lies() {
    let folder = tempfile::tempdir().unwrap();
    recording(folder.path());
    let [whole, partial] = ["a.mcap", "a.mcap.partial"].map(|name| folder.path().join(name));
    let bytes = std::fs::read(&whole).unwrap();
    std::fs::write(&partial, &bytes[..bytes.len() * 2 / 3]).unwrap();
    std::fs::remove_file(&whole).unwrap();
    let outcome = capsense(folder.path(), &["export", "a.mcap.partial", "--out", "a.csv"]);
    assert_eq!(outcome.code, Some(2), "{}", outcome.stderr);
    assert!(outcome.stderr.contains("recover"), "{}", outcome.stderr);
    expect(folder.path(), &["recover", "a.mcap.partial", "--out", "a.mcap"]);
    expect(folder.path(), &["export", "a.mcap", "--out", "a.csv"]);
    let rows = table(&folder.path().join("a.csv")).len();
    assert!((10..SAMPLES as usize).contains(&rows), "{rows} samples");
}

/// Bytes that are none of the board's are lost: more than one per cent of them is a failure, unless it is allowed.
#[test]
fn a_recording_that_loses_too_much_fails() {
    let folder = tempfile::tempdir().unwrap();
    recording(folder.path());
    for (allowed, code) in [("0.01", 1), ("1", 0)] {
        let (mut replay, port) = replayed(folder.path(), "1");
        let file = format!("{allowed}.mcap");
        let record = ["record", "--port", &port, "--device", "marker-u16", "--seconds", "1.5"];
        let outcome =
            capsense(folder.path(), &[&record[..], &["--max-loss", allowed, "--out", &file]].concat());
        drop(replay.kill());
        replay.wait().unwrap();
        assert_eq!(outcome.code, Some(code), "{}{}", outcome.stdout, outcome.stderr);
        assert!(folder.path().join(&file).exists(), "what there is is kept");
    }
}
