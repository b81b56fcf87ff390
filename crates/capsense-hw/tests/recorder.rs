//! The recorder at a pseudo-terminal, which a board in a thread writes to.

#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test")]

use capsense_hw::profile::{DeviceProfile, built_in};
use capsense_hw::recording::{Header, RecordingReader, RecordingWriter, Samples};
use capsense_hw::stream::{Encoder, Sample, Value};
use capsense_hw::{Counters, PortNews, PortReader, PseudoPort, record};
use serialport::{SerialPort, TTYPort};
use std::io::Write;
use std::path::Path;
use std::time::Duration;

const SAMPLES: u32 = 2000;

fn values(profile: &DeviceProfile, sample: u32) -> Vec<Value> {
    (0..4).map(|channel| profile.raw(channel, f64::from(sample + channel as u32) * 1e-15)).collect()
}

/// A board that sends its samples as fast as they are taken.
fn board(profile: DeviceProfile, mut port: TTYPort) -> std::thread::JoinHandle<TTYPort> {
    std::thread::spawn(move || {
        port.set_timeout(Duration::from_secs(20)).unwrap();
        let encoder = Encoder::new(&profile.stream).unwrap();
        for sequence in 0..SAMPLES {
            let mut bytes = Vec::new();
            let sample =
                Sample { values: &values(&profile, sequence), sequence: Some(sequence), ..Sample::default() };
            encoder.encode(&sample, &mut bytes);
            port.write_all(&bytes).unwrap();
        }
        port
    })
}

fn recorded(path: &Path, profile: &DeviceProfile, board_port: TTYPort, host_port: &str) -> Counters {
    let header = Header::new(host_port, 1_800_000_000_000_000_000, profile).unwrap();
    let writer = RecordingWriter::create(path, &header).unwrap();
    let reader = PortReader::open(host_port, 115_200, 4096).unwrap();
    let board = board(profile.clone(), board_port);
    let enough = u64::from(SAMPLES);
    let counters = record(reader, profile, writer, |counters| {
        counters.samples < enough && counters.time < Duration::from_secs(60)
    });
    drop(board.join().unwrap());
    counters.unwrap()
}

#[test]
fn every_sample_of_a_board_is_in_the_recording() {
    for name in ["fdc2214", "fdc2214-evm"] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        let profile = built_in(name).unwrap();
        let (board_port, host_side) = TTYPort::pair().unwrap();
        let host_port = host_side.name().unwrap();
        // A second opening of a port is refused; the terminal stays as long as the board has its side.
        drop(host_side);
        let counters = recorded(&path, &profile, board_port, &host_port);
        assert_eq!((counters.samples, counters.dropped, counters.missing), (SAMPLES.into(), 0, 0), "{name}");
        assert_eq!((counters.passed_over, counters.loss()), (0, 0.0), "{name}");
        let samples = Samples::new(RecordingReader::open(&path).unwrap(), None).unwrap();
        let samples: Vec<Vec<Value>> = samples.map(|sample| sample.unwrap().values).collect();
        let sent: Vec<Vec<Value>> = (0..SAMPLES).map(|sequence| values(&profile, sequence)).collect();
        assert!(samples == sent, "{name}");
    }
}

/// Nobody reads: what has no room is refused whole. What was accepted arrives whole.
#[test]
fn a_pseudo_port_sends_all_or_nothing() {
    let mut port = PseudoPort::open().unwrap();
    let line = [b'x'; 99].iter().chain(b"\n").copied().collect::<Vec<u8>>();
    let mut accepted = 0;
    while port.send(&line).unwrap() {
        accepted += 1;
        assert!(accepted < 100_000, "a terminal without end");
    }
    let reader = PortReader::open(port.path(), 115_200, 4096).unwrap();
    let mut read = Vec::new();
    while read.len() < accepted * line.len() {
        port.send(&[]).unwrap();
        if let PortNews::Bytes(bytes) = reader.next(Duration::from_secs(20)).unwrap().what {
            read.extend(bytes);
        }
    }
    assert!(read == line.repeat(accepted));
}
