//! Decoders take time in proportion to what comes, in pieces of whatever size: nothing is looked at again and again.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test")]

#[path = "support/boards.rs"]
mod boards;

use boards::streams;
use capsense_hw::profile::{built_in, built_in_names};
use capsense_hw::stream::{Decoder, Start};
use std::time::{Duration, Instant};

const BYTES: usize = 10_000;

/// How many times as much comes the second time. What looks at all again for each piece takes the square of it.
const TIMES: usize = 8;

/// The shortest of several runs is the least disturbed one.
const RUNS: usize = 5;

fn shortest(name: &str, stream: &[u8], piece: usize) -> Duration {
    let format = built_in(name).unwrap().stream;
    let run = |_| {
        let mut decoder = Decoder::new(&format, Start::Anywhere).unwrap();
        let mut events = 0_usize;
        let started = Instant::now();
        for piece in stream.chunks(piece) {
            decoder.push(piece, Duration::ZERO, &mut |_| events += 1);
        }
        let took = started.elapsed();
        assert!(events <= stream.len());
        took
    };
    (0..RUNS).map(run).min().unwrap()
}

#[test]
fn eight_times_as_much_takes_eight_times_as_long() {
    for name in built_in_names() {
        let long = streams(name, TIMES * BYTES);
        for (index, (short, long)) in streams(name, BYTES).iter().zip(&long).enumerate() {
            for piece in [1, 4096] {
                let [short, long] = [short, long].map(|stream| shortest(name, stream, piece).as_secs_f64());
                let ratio = long / short.max(20e-6);
                assert!(
                    ratio < 4.0 * TIMES as f64,
                    "{name}, stream {index}, pieces of {piece}: {ratio} times as long"
                );
            }
        }
    }
}
