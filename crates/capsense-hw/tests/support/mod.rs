//! What every decoder promises, checked on any bytes: for the property tests, and for the fuzz targets.

use capsense_hw::stream::{Decoder, Event, Start, StreamFormat, Value};
use std::time::Duration;

/// An event with all that it says.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Told {
    pub(crate) offset: u64,
    pub(crate) length: u64,
    pub(crate) kind: Kind,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Kind {
    Sample { values: Vec<Value>, sequence: Option<u32>, device_time: Option<Duration>, status: u32 },
    Text(Vec<u8>),
    Resync,
    Gap(Option<u32>),
}

/// Decodes a stream in pieces of these lengths, which are used again and again; what is left comes at once.
pub(crate) fn decode(format: &StreamFormat, start: Start, bytes: &[u8], pieces: &[usize]) -> Vec<Told> {
    let mut decoder = Decoder::new(format, start).expect("a format that a board could send");
    let mut told = Vec::new();
    let mut note = |stamped: capsense_hw::stream::Stamped<'_>| {
        let kind = match stamped.event {
            Event::Sample(sample) => Kind::Sample {
                values: sample.values.to_vec(),
                sequence: sample.sequence,
                device_time: sample.device_time,
                status: sample.status,
            },
            Event::Text(line) => Kind::Text(line.to_vec()),
            Event::Resync => Kind::Resync,
            Event::Gap(missing) => Kind::Gap(missing),
        };
        told.push(Told { offset: stamped.offset, length: stamped.length, kind });
    };
    let mut rest = bytes;
    for piece in pieces.iter().cycle().take(bytes.len()) {
        let (now, later) = rest.split_at((*piece).min(rest.len()));
        decoder.push(now, Duration::ZERO, &mut note);
        rest = later;
    }
    decoder.push(rest, Duration::ZERO, &mut note);
    decoder.finish(Duration::ZERO, &mut note);
    told
}

/// The spans tile the stream, values are finite and as many as the format says.
pub(crate) fn assert_promises(format: &StreamFormat, bytes: &[u8], told: &[Told]) {
    let mut end = 0;
    for event in told {
        assert_eq!(event.offset, end, "{event:?} does not begin where the one before ends");
        end += event.length;
        match &event.kind {
            Kind::Gap(_) => assert_eq!(event.length, 0),
            Kind::Sample { values, .. } => {
                assert!(format.channels().unwrap_or(values.len()) == values.len() && !values.is_empty());
                let finite = |value: &Value| !matches!(value, Value::Number(number) if !number.is_finite());
                assert!(values.iter().all(finite) && event.length > 0);
            }
            Kind::Text(line) => assert!((line.len() as u64) < event.length && !line.contains(&b'\n')),
            Kind::Resync => assert!((1..=80 * 1024).contains(&event.length)),
        }
    }
    assert_eq!(end, bytes.len() as u64, "bytes are left");
}

/// All of it: promises are kept, and the same events come of any pieces.
pub(crate) fn check(format: &StreamFormat, start: Start, bytes: &[u8], pieces: &[usize]) {
    let whole = decode(format, start, bytes, &[]);
    assert_promises(format, bytes, &whole);
    assert_eq!(decode(format, start, bytes, pieces), whole, "in pieces of {pieces:?}");
}
