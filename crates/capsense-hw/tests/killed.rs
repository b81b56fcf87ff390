//! Fifty recorders are killed at different moments, and a true and unbroken recording is made of what each leaves.
//!
//! With `--record PORT FILE` this program is the recorder.

#![allow(clippy::unwrap_used)]

use capsense_hw::profile::built_in;
use capsense_hw::recording::{Header, RecordingReader, RecordingWriter, Samples, recover};
use capsense_hw::stream::{Encoder, Sample, Value};
use capsense_hw::{PortReader, PseudoPort, record};
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    match arguments.as_slice() {
        [_, word, port, file] if word == "--record" => record_until_killed(port, Path::new(file)),
        [_, word, ..] if word == "--list" => println!("killed: test"),
        _ if cfg!(unix) => kill_fifty(),
        _ => println!("there are no pseudo-terminals here"),
    }
}

fn record_until_killed(port: &str, file: &Path) {
    let profile = built_in("generic").unwrap();
    let header = Header::new(port, 0, &profile).unwrap();
    let writer = RecordingWriter::create(file, &header).unwrap();
    record(PortReader::open(port, 115_200, 4096).unwrap(), &profile, writer, |_| true).unwrap();
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

/// Starts a recorder, kills it, and tells when it was killed and when each sample was sent.
fn kill_one(file: &Path, partial: &Path, patience: Duration) -> (Vec<Instant>, Instant) {
    let port = PseudoPort::open().unwrap();
    let path = port.path().to_owned();
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let sender = scope.spawn(|| numbered_samples(port, &stop));
        let program = std::env::current_exe().unwrap();
        let mut recorder = Command::new(program).args(["--record", &path]).arg(file).spawn().unwrap();
        while !partial.exists() {
            std::thread::sleep(Duration::from_millis(1));
        }
        std::thread::sleep(patience);
        recorder.kill().unwrap();
        let killed = Instant::now();
        recorder.wait().unwrap();
        stop.store(true, Ordering::Relaxed);
        (sender.join().unwrap(), killed)
    })
}

fn kill_fifty() {
    let folder = tempfile::tempdir().unwrap();
    let (mut worst, mut kept) = (Duration::ZERO, 0);
    for kill in 0..50 {
        let cut_off = folder.path().join(format!("{kill}.mcap"));
        let partial = folder.path().join(format!("{kill}.mcap.partial"));
        let (sent, killed) = kill_one(&cut_off, &partial, Duration::from_millis(5 + 37 * kill % 400));
        let whole = folder.path().join(format!("{kill}_recovered.mcap"));
        if recover(&partial, &whole).is_err() {
            // Killed before the header was written: nothing had been read yet.
            assert!(std::fs::metadata(&partial).unwrap().len() < 5000);
            continue;
        }
        let samples = Samples::new(RecordingReader::open(&whole).unwrap(), None).unwrap();
        let counts: Vec<u32> = samples.map(|sample| sample.unwrap().sequence.unwrap()).collect();
        assert!(counts.windows(2).all(|pair| pair[1] == pair[0] + 1), "{counts:?}");
        if let Some(last) = counts.last() {
            worst = worst.max(killed.saturating_duration_since(sent[*last as usize]));
            kept += 1;
        }
    }
    println!("{kept} of 50 recordings have samples; of these at most {worst:?} before the kill is lost");
    assert!(kept >= 15, "too few recordings have samples to prove anything");
}
