//! What decoders promise of any stream, for every built-in profile and for frames of every checksum.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test")]

mod support;

use capsense_hw::profile::{built_in, built_in_names};
use capsense_hw::stream::checksum::Checksum;
use capsense_hw::stream::{
    ByteOrder, Encoder, Field, FrameLength, FramedFormat, NumberType, Sample, Start, StreamFormat,
    TrailingChecksum, Value, ValueBlock,
};
use proptest::prelude::*;
use std::time::Duration;
use support::{Kind, Told, check, decode};

/// Sync, length, checksum: what boards with binary protocols of their own send.
fn checked(kind: Checksum, start: &[u8], channels: Option<usize>) -> StreamFormat {
    StreamFormat::Framed(FramedFormat {
        start: start.to_vec(),
        end: Vec::new(),
        length: FrameLength::Told {
            field: Field { offset: start.len(), number: NumberType::U8, order: ByteOrder::Little },
            plus: start.len() + 1,
        },
        checksum: Some(TrailingChecksum { kind, order: ByteOrder::Big, from: start.len() }),
        values: ValueBlock { offset: start.len() + 2, number: NumberType::I24, order: ByteOrder::Big },
        status: None,
        sequence: Some(Field { offset: start.len() + 1, number: NumberType::U8, order: ByteOrder::Little }),
        channels,
    })
}

/// Formats of all kinds by number.
fn format(number: usize) -> StreamFormat {
    let names = built_in_names();
    let kinds =
        [Checksum::Crc8Smbus, Checksum::Crc16Modbus, Checksum::Crc32IsoHdlc, Checksum::Xor8, Checksum::Sum8];
    match number.checked_sub(names.len()) {
        None => built_in(names[number]).unwrap().stream,
        Some(other) => checked(kinds[other % kinds.len()], &[0xAA], [None, Some(3)][other / kinds.len() % 2]),
    }
}

fn formats() -> impl Strategy<Value = StreamFormat> {
    (0..built_in_names().len() + 10).prop_map(format)
}

/// Integers of 12 bits by channel: every format can say them.
fn samples(channels: usize, seeds: &[u16]) -> Vec<Vec<Value>> {
    let value =
        |seed: u16, channel: usize| Value::Number(f64::from(seed.wrapping_mul(31 + channel as u16) >> 5));
    seeds.iter().map(|seed| (0..channels).map(|channel| value(*seed, channel)).collect()).collect()
}

/// The bytes of samples, and where each sample's end.
fn stream(format: &StreamFormat, samples: &[Vec<Value>]) -> (Vec<u8>, Vec<usize>) {
    let encoder = Encoder::new(format).unwrap();
    let (mut bytes, mut ends) = (Vec::new(), Vec::new());
    for (sequence, values) in samples.iter().enumerate() {
        let device_time = Some(Duration::from_millis(10 * sequence as u64));
        let sample = Sample { values, sequence: Some(sequence as u32), device_time, status: 0 };
        encoder.encode(&sample, &mut bytes);
        ends.push(bytes.len());
    }
    (bytes, ends)
}

/// Bytes that look like a stream more often than by chance: pieces of a true one, noise, and marks of formats.
fn rough_stream(format: &StreamFormat) -> impl Strategy<Value = Vec<u8>> + use<> {
    let (bytes, _) = stream(format, &samples(format.channels().unwrap_or(3), &[1, 500, 65_535, 7, 222]));
    let length = bytes.len();
    let piece =
        (0..length, 1..length).prop_map(move |(from, count)| bytes[from..length.min(from + count)].to_vec());
    let marks: [&[u8]; 9] =
        [b"\n", b"\r\n", b"12,", b"ERROR", &[0], &[0xAA, 5], &[0x02, 0xFE], &[0xDE, 0], &[0x4C]];
    let part = prop_oneof![
        4 => piece,
        2 => prop::collection::vec(any::<u8>(), 0..40),
        2 => prop::sample::select(marks.to_vec()).prop_map(<[u8]>::to_vec),
        1 => (any::<u8>(), 1usize..6000).prop_map(|(byte, count)| vec![byte; count]),
    ];
    prop::collection::vec(part, 0..12).prop_map(|parts| parts.concat())
}

fn numbers(told: &[Told]) -> Vec<Vec<Value>> {
    let values = |event: &Told| match &event.kind {
        Kind::Sample { values, .. } => Some(values.clone()),
        _ => None,
    };
    told.iter().filter_map(values).collect()
}

/// How many of the samples did not arrive.
fn lost(samples: &[Vec<Value>], told: &[Vec<Value>]) -> usize {
    samples.iter().filter(|sample| !told.contains(sample)).count()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn any_bytes_in_any_pieces(
        (format, bytes) in formats().prop_flat_map(|format| (Just(format.clone()), rough_stream(&format))),
        boundary: bool,
        pieces in prop::collection::vec(1usize..200, 1..5),
    ) {
        let start = if boundary { Start::Boundary } else { Start::Anywhere };
        check(&format, start, &bytes, &pieces);
        check(&format, start, &bytes, &[1]);
    }

    /// A board's samples arrive, every one.
    #[test]
    fn what_is_sent_arrives(format in formats(), seeds in prop::collection::vec(any::<u16>(), 2..20)) {
        let samples = samples(format.channels().unwrap_or(3), &seeds);
        let (bytes, _) = stream(&format, &samples);
        let told = numbers(&decode(&format, Start::Boundary, &bytes, &[]));
        let one_a_line = told.len() > samples.len();
        if one_a_line {
            let whole: Vec<Vec<Value>> = told.chunks(told[0].len()).map(merged).collect();
            prop_assert_eq!(whole, samples);
        } else {
            prop_assert_eq!(told, samples);
        }
    }

    /// Frames with checksums: a damaged byte costs at most two of them, and no other frame comes out.
    #[test]
    fn a_damaged_byte_costs_two_frames(
        own: bool,
        seeds in prop::collection::vec(any::<u16>(), 1..12),
        at in any::<prop::sample::Index>(),
        damage in 1u8..,
    ) {
        let format =
            if own { format(0) } else { checked(Checksum::Crc16Ibm3740, &[0xA5, 0x5A], Some(5)) };
        let samples = samples(5, &seeds);
        let (mut bytes, _) = stream(&format, &samples);
        let at = at.index(bytes.len());
        bytes[at] ^= damage;
        let told = numbers(&decode(&format, Start::Boundary, &bytes, &[]));
        prop_assert!(told.iter().all(|values| samples.contains(values)), "a frame that nobody sent");
        prop_assert!(told.len() + 2 >= samples.len() && lost(&samples, &told) <= 2);
    }

    /// Without a checksum the damaged frame itself may come out, but no more than two are lost.
    #[test]
    fn a_damaged_byte_costs_two_frames_without_a_checksum(
        name in prop::sample::select(vec!["fdc2214-evm", "marker-u16", "marker-memory", "trailer-i16", "text", "grid-252"]),
        boundary: bool,
        seeds in prop::collection::vec(any::<u16>(), 1..12),
        at in any::<prop::sample::Index>(),
        damage in 1u8..,
    ) {
        let start = if boundary { Start::Boundary } else { Start::Anywhere };
        let format = built_in(name).unwrap().stream;
        let samples = samples(format.channels().unwrap_or(3), &seeds);
        let (mut bytes, _) = stream(&format, &samples);
        let undamaged = numbers(&decode(&format, start, &bytes, &[]));
        let at = at.index(bytes.len());
        bytes[at] ^= damage;
        let told = numbers(&decode(&format, start, &bytes, &[]));
        prop_assert!(lost(&undamaged, &told) <= 2, "{} of {}", lost(&undamaged, &told), undamaged.len());
    }

    /// Lost bytes are noticed, and everything behind them is found again.
    #[test]
    fn lost_bytes_cost_two_frames(
        own: bool,
        seeds in prop::collection::vec(any::<u16>(), 1..12),
        at in any::<prop::sample::Index>(),
        count in 1usize..20,
    ) {
        let format =
            if own { format(0) } else { checked(Checksum::Crc16Ibm3740, &[0xA5, 0x5A], Some(5)) };
        let samples = samples(5, &seeds);
        let (mut bytes, _) = stream(&format, &samples);
        let at = at.index(bytes.len());
        bytes.drain(at..bytes.len().min(at + count));
        let told = numbers(&decode(&format, Start::Boundary, &bytes, &[]));
        prop_assert!(told.iter().all(|values| samples.contains(values)));
        prop_assert!(told.len() + 2 >= samples.len());
    }
}

/// Lines of one channel each, put together.
fn merged(lines: &[Vec<Value>]) -> Vec<Value> {
    (0..lines.len()).map(|channel| lines[channel][channel]).collect()
}

/// A frame that claims to be long and is damaged does not take those behind it along.
#[test]
fn a_damaged_length_hides_nothing() {
    let format = checked(Checksum::Crc16Ibm3740, &[0xA5, 0x5A], None);
    let samples = samples(5, &[1, 2, 3, 4, 5, 6, 7, 8]);
    let (mut bytes, ends) = stream(&format, &samples);
    bytes[ends[1] + 2] = 0xFF;
    let told = decode(&format, Start::Anywhere, &bytes, &[3]);
    assert_eq!(numbers(&told).len(), 7);
    let passed_over: Vec<u64> = told.iter().filter(|t| t.kind == Kind::Resync).map(|t| t.length).collect();
    assert_eq!(passed_over, [(ends[2] - ends[1]) as u64]);
    assert!(told.iter().any(|event| event.kind == Kind::Gap(Some(1))));
}

/// Noise for as long as one likes is counted, in parts of a bounded size.
#[test]
fn long_noise_is_counted_in_parts() {
    let noise = vec![b'x'; 300_000];
    for name in ["text", "generic", "marker-u16"] {
        let format = built_in(name).unwrap().stream;
        check(&format, Start::Anywhere, &noise, &[70_000, 1]);
        let told = decode(&format, Start::Anywhere, &noise, &[]);
        assert!(told.len() >= 4 && told.iter().all(|event| event.kind == Kind::Resync), "{name}");
    }
}

#[test]
fn formats_that_no_board_could_send_are_refused() {
    let StreamFormat::Framed(sound) = checked(Checksum::Sum8, &[0xAA], Some(3)) else { panic!("not framed") };
    let refused = |edit: fn(&mut FramedFormat)| {
        let mut format = sound.clone();
        edit(&mut format);
        let format = StreamFormat::Framed(format);
        let error = Encoder::new(&format).unwrap_err();
        assert_eq!(capsense_hw::stream::Decoder::new(&format, Start::Anywhere).unwrap_err(), error);
        error.key
    };
    assert_eq!(refused(|format| format.start.clear()), "start");
    assert_eq!(refused(|format| format.length = FrameLength::Fixed(11)), "length");
    assert_eq!(refused(|format| format.length = FrameLength::Fixed(5000)), "length");
    assert_eq!(refused(|format| format.checksum = None), "length");
    assert_eq!(refused(|format| format.values.offset = 5000), "values");
    assert_eq!(refused(|format| format.values.offset = 0), "values");
    assert_eq!(refused(|format| format.channels = Some(257)), "channels");
    assert_eq!(refused(|format| format.channels = Some(0)), "channels");
    let hidden = Field { offset: usize::MAX, number: NumberType::U32, order: ByteOrder::Big };
    let mut format = sound.clone();
    format.sequence = Some(hidden);
    assert!(Encoder::new(&StreamFormat::Framed(format)).is_err());
}
