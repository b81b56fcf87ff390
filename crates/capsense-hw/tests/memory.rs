//! A decoder has all its memory from the beginning: whatever comes, and however much, it asks for no more.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test")]

#[path = "support/boards.rs"]
mod boards;

use boards::streams;
use capsense_hw::profile::{built_in, built_in_names};
use capsense_hw::stream::{Decoder, Start};
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

/// Allocations so far, on all threads: there is but one test, so that no other is counted.
static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

/// The system's allocator, and how often it was asked for memory.
struct Counting;

// SAFETY: every call goes to the system's allocator as it is, which keeps the contract; counting allocates nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's promise on `layout` is the one that this needs.
        unsafe { System.alloc(layout) }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: `block` came from `alloc` above, and so from the system's allocator, with this layout.
        unsafe { System.realloc(block, layout, size) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        // SAFETY: `block` came from `alloc` above, and so from the system's allocator, with this layout.
        unsafe { System.dealloc(block, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

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
