//! An allocator that counts how often it is asked for memory and how much is in use, for tests of what allocates nothing and
//! of what is kept.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicIsize, AtomicUsize, Ordering};

/// Allocations so far, on all threads: in a program of one test, so that no other is counted.
pub(crate) static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

/// Bytes that are allocated now, on all threads.
#[allow(dead_code, reason = "not all tests that count ask for it")]
pub(crate) static BYTES: AtomicIsize = AtomicIsize::new(0);

/// The system's allocator, and how often it was asked for memory.
struct Counting;

// SAFETY: every call goes to the system's allocator as it is, which keeps the contract; counting allocates nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        BYTES.fetch_add(layout.size() as isize, Ordering::Relaxed);
        // SAFETY: the caller's promise on `layout` is the one that this needs.
        unsafe { System.alloc(layout) }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        BYTES.fetch_add(size as isize - layout.size() as isize, Ordering::Relaxed);
        // SAFETY: `block` came from `alloc` above, and so from the system's allocator, with this layout.
        unsafe { System.realloc(block, layout, size) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        BYTES.fetch_sub(layout.size() as isize, Ordering::Relaxed);
        // SAFETY: `block` came from `alloc` above, and so from the system's allocator, with this layout.
        unsafe { System.dealloc(block, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;
