//! Any bytes into frames of any layout. The first bytes say which; formats that are refused are of no interest.

#![no_main]

#[path = "../../crates/capsense-hw/tests/support/mod.rs"]
mod support;

use capsense_hw::stream::checksum::Checksum;
use capsense_hw::stream::{
    ByteOrder, Field, FrameLength, FramedFormat, NumberType, Start, StreamFormat, TrailingChecksum,
    ValueBlock,
};

const NUMBERS: [NumberType; 4] = [NumberType::U8, NumberType::I16, NumberType::U24, NumberType::F32];
const CHECKSUMS: [Checksum; 4] =
    [Checksum::Xor8, Checksum::Crc8Smbus, Checksum::Crc16Modbus, Checksum::Crc32IsoHdlc];

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let [marks, length, kinds, values, told, cut, bytes @ ..] = data else { return };
    let order = if kinds & 1 == 0 { ByteOrder::Little } else { ByteOrder::Big };
    let field = |at: u8| Field { offset: usize::from(at & 15), number: NumberType::U8, order };
    let format = StreamFormat::Framed(FramedFormat {
        start: vec![0xAA; usize::from(marks & 3)],
        end: vec![0x55; usize::from(marks >> 2 & 3)],
        length: if length & 1 == 0 {
            FrameLength::Fixed(usize::from(length >> 1))
        } else {
            FrameLength::Told { field: field(*told), plus: usize::from(length >> 1) }
        },
        checksum: (kinds & 2 != 0).then(|| TrailingChecksum {
            kind: CHECKSUMS[usize::from(kinds >> 2 & 3)],
            order,
            from: usize::from(marks >> 4),
        }),
        values: ValueBlock {
            offset: usize::from(values >> 3),
            number: NUMBERS[usize::from(kinds >> 4 & 3)],
            order,
        },
        status: (kinds & 64 != 0).then(|| field(told >> 4)),
        sequence: (kinds & 128 != 0).then(|| field(told >> 4)),
        channels: (values & 7 != 0).then_some(usize::from(values & 7)),
    });
    if format.check().is_ok() {
        support::check(&format, Start::Anywhere, bytes, &[1 + usize::from(*cut)]);
    }
});
