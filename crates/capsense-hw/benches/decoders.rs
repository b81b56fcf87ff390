//! How many bytes a second each kind of decoder takes, in pieces of 4 KiB as a port gives them.

#![allow(clippy::unwrap_used, missing_docs)]

use capsense_hw::profile::built_in;
use capsense_hw::stream::{Decoder, Encoder, Event, Sample, Start, Value};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use std::time::Duration;

const BYTES: usize = 1 << 20;

fn stream(profile: &str) -> Vec<u8> {
    let profile = built_in(profile).unwrap();
    let channels = if profile.channels == 0 { 4 } else { profile.channels };
    let encoder = Encoder::new(&profile.stream).unwrap();
    let mut bytes = Vec::with_capacity(BYTES);
    for sequence in 0u32.. {
        let raw = |channel: usize| match &profile.word {
            Some(word) => {
                word.encode(i64::from(sequence.wrapping_mul(12_345) ^ channel as u32) & 0x7FFF_FFFF)
            }
            None => f64::from(sequence.wrapping_mul(12_345) >> 12) / 1e4,
        };
        let values: Vec<Value> = (0..channels).map(|channel| Value::Number(raw(channel))).collect();
        let device_time = Some(Duration::from_millis(sequence.into()));
        encoder.encode(
            &Sample { values: &values, sequence: Some(sequence), device_time, status: 0 },
            &mut bytes,
        );
        if bytes.len() >= BYTES {
            break;
        }
    }
    bytes
}

fn decoders(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("decoders");
    for name in [
        "generic",
        "fdc2214",
        "fdc2214-evm",
        "marker-u16",
        "fdc2214-sketch",
        "fdc1004-breakout",
        "grid-252",
        "plotter",
    ] {
        let format = built_in(name).unwrap().stream;
        let bytes = stream(name);
        group.throughput(Throughput::Bytes(bytes.len() as u64));
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                let mut decoder = Decoder::new(&format, Start::Boundary).unwrap();
                let mut sum = 0.0;
                for piece in bytes.chunks(4096) {
                    decoder.push(piece, Duration::ZERO, &mut |stamped| {
                        if let Event::Sample(sample) = stamped.event
                            && let Some(Value::Number(number)) = sample.values.first()
                        {
                            sum += number;
                        }
                    });
                }
                black_box(sum)
            });
        });
    }
    group.finish();
}

criterion_group!(benches, decoders);
criterion_main!(benches);
