//! A decoder has all its memory from the beginning: whatever comes, and however much, it asks for no more.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test")]

#[path = "../../capsense-core/tests/suite/common/allocations.rs"]
mod allocations;
#[path = "support/boards.rs"]
mod boards;

use allocations::ALLOCATIONS;
use boards::streams;
use capsense_hw::profile::{built_in, built_in_names};
use capsense_hw::stream::{Decoder, Start};
use std::sync::atomic::Ordering;
use std::time::Duration;

#[test]
fn decoders_ask_for_no_memory() {
    for name in built_in_names() {
        let format = built_in(name).unwrap().stream;
        for (index, stream) in streams(name, 200_000).iter().enumerate() {
            let mut decoder = Decoder::new(&format, Start::Anywhere).unwrap();
            let mut events = 0;
            let before = ALLOCATIONS.load(Ordering::Relaxed);
            for piece in stream.chunks(4096) {
                decoder.push(piece, Duration::ZERO, &mut |_| events += 1);
            }
            decoder.finish(Duration::ZERO, &mut |_| events += 1);
            let asked = ALLOCATIONS.load(Ordering::Relaxed) - before;
            assert_eq!(asked, 0, "{name}: stream {index}");
            assert!(events > 0, "{name}: stream {index}");
        }
    }
}
