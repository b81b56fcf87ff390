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
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

const SAMPLES: u32 = 2000;

/// Bytes a second of the board that sends without pause.
const LOAD: f64 = 1e6;

fn values(profile: &DeviceProfile, sample: u32) -> Vec<Value> {
    (0..4).map(|channel| profile.raw(channel, f64::from(sample + channel as u32) * 1e-15)).collect()
}

/// A board that sends so many samples in pieces of some hundred bytes, no faster than so many bytes a second.
fn board(profile: DeviceProfile, mut port: TTYPort, samples: u32, rate: f64) -> JoinHandle<TTYPort> {
    std::thread::spawn(move || {
        port.set_timeout(Duration::from_secs(20)).unwrap();
        let encoder = Encoder::new(&profile.stream).unwrap();
        let begun = Instant::now();
        let (mut sent, mut bytes) = (0, Vec::new());
        for sequence in 0..samples {
            let values = values(&profile, sequence);
            let sample = Sample { values: &values, sequence: Some(sequence), ..Sample::default() };
            encoder.encode(&sample, &mut bytes);
            if bytes.len() >= 512 || sequence + 1 == samples {
                port.write_all(&bytes).unwrap();
                sent += bytes.len();
                bytes.clear();
                std::thread::sleep(
                    Duration::from_secs_f64(sent as f64 / rate).saturating_sub(begun.elapsed()),
                );
            }
        }
        port
    })
}

/// Records a board to its last sample, or for a time after which it must have failed.
fn recorded(path: &Path, profile: &DeviceProfile, samples: u32, rate: f64) -> Counters {
    let (board_port, host_side) = TTYPort::pair().unwrap();
    let host_port = host_side.name().unwrap();
    // A second opening of a port is refused; the terminal stays as long as the board has its side.
    drop(host_side);
    let header = Header::new(&host_port, 1_800_000_000_000_000_000, profile).unwrap();
    let writer = RecordingWriter::create(path, &header).unwrap();
    let reader = PortReader::open(&host_port, 115_200, 4096).unwrap();
    let board = board(profile.clone(), board_port, samples, rate);
    let enough = u64::from(samples);
    let patience = Duration::from_secs(60 + u64::from(samples) / 2000);
    let counters =
        record(reader, profile, writer, |counters| counters.samples < enough && counters.time < patience);
    drop(board.join().unwrap());
    counters.unwrap()
}

/// Whether a recording has all samples of a board, one after the other.
fn assert_whole(path: &Path, profile: &DeviceProfile, samples: u32) {
    let mut sequence = 0;
    for sample in Samples::new(RecordingReader::open(path).unwrap(), None).unwrap() {
        assert!(sample.unwrap().values == values(profile, sequence), "{}: sample {sequence}", profile.name);
        sequence += 1;
    }
    assert_eq!(sequence, samples, "{}", profile.name);
}

#[test]
fn every_sample_of_a_board_is_in_the_recording() {
    for name in ["fdc2214", "fdc2214-evm"] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        let profile = built_in(name).unwrap();
        let counters = recorded(&path, &profile, SAMPLES, f64::INFINITY);
        assert_eq!((counters.samples, counters.dropped, counters.missing), (SAMPLES.into(), 0, 0), "{name}");
        assert_eq!((counters.passed_over, counters.loss()), (0, 0.0), "{name}");
        assert_whole(&path, &profile, SAMPLES);
    }
}

/// A megabyte a second, for 5 s or as many as the environment says; see docs/hardware.md.
#[test]
fn nothing_of_a_megabyte_a_second_is_lost() {
    let seconds = std::env::var("CAPSENSE_LOAD_SECONDS").map_or(5.0, |text| text.parse::<f64>().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let profile = built_in("fdc2214").unwrap();
    let mut one = Vec::new();
    let sample = Sample { values: &values(&profile, 0), ..Sample::default() };
    Encoder::new(&profile.stream).unwrap().encode(&sample, &mut one);
    let samples = (seconds * LOAD / one.len() as f64) as u32;
    let begun = Instant::now();
    let counters = recorded(&path, &profile, samples, LOAD);
    let rate = counters.bytes as f64 / begun.elapsed().as_secs_f64();
    println!("{} bytes in {:.1} s: {:.3} MB/s", counters.bytes, begun.elapsed().as_secs_f64(), rate / 1e6);
    assert_eq!((counters.samples, counters.dropped, counters.missing), (samples.into(), 0, 0));
    assert_eq!((counters.passed_over, counters.disconnections), (0, 0));
    assert_whole(&path, &profile, samples);
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
