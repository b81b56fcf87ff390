//! Gmsh files that were changed at random: reading one never panics, and never takes much more memory than a sound file
//! of its length, whatever numbers stand in it. The only test here, because the memory of all threads is counted.

#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

#[path = "suite/common/mod.rs"]
mod common;

use capsense::gmsh;
use capsense::scene::mesh_warnings;
use capsense_core::units::LengthUnit;
use common::gmsh_cube::{NAMES, all_encodings, ascii_v2, sparse};
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The largest piece of memory that was asked for.
static LARGEST: AtomicUsize = AtomicUsize::new(0);

/// The system's allocator, watched.
struct Watched;

#[global_allocator]
static WATCHED: Watched = Watched;

// SAFETY: both functions hand their arguments on to the system's allocator unchanged and return what it returns; the
// default ones for zeroed and resized memory are made of these two.
unsafe impl GlobalAlloc for Watched {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        LARGEST.fetch_max(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of this trait, which is that of the system's allocator.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the pointer came from `alloc` above with this layout, and so from the system's allocator.
        unsafe { System.dealloc(pointer, layout) }
    }
}

/// Bytes in one piece that a file may take for each of its own: a node has an index, a place and marks.
const BYTES_A_BYTE: usize = 64;

/// What is done to a file at one place.
#[derive(Clone, Debug)]
enum Change {
    Byte(u8),
    /// Bits all set, as in counts that are as large as can be.
    Ones(usize),
    Remove(usize),
    Insert(Vec<u8>),
    /// The next number that is text is another.
    Number(u64),
    /// Other bytes of the same file.
    Copy(prop::sample::Index, usize),
    Truncate,
}

fn change() -> impl Strategy<Value = Change> {
    let words = [
        "$Nodes\n",
        "$EndNodes\n",
        "$Elements\n",
        "-1 ",
        "0 ",
        "99999999999999999999 ",
        "4294967295 ",
        "nan ",
        "\"",
    ];
    prop_oneof![
        4 => any::<u8>().prop_map(Change::Byte),
        1 => (1usize..9).prop_map(Change::Ones),
        1 => (1usize..40).prop_map(Change::Remove),
        1 => prop::collection::vec(any::<u8>(), 1..20).prop_map(Change::Insert),
        2 => prop::sample::select(words.to_vec()).prop_map(|word| Change::Insert(word.into())),
        2 => (any::<prop::sample::Index>(), 1usize..200).prop_map(|(from, length)| Change::Copy(from, length)),
        3 => prop_oneof![Just(99_999_999), 0..300u64, any::<u64>()].prop_map(Change::Number),
        1 => Just(Change::Truncate),
    ]
}

fn apply(bytes: &mut Vec<u8>, at: usize, change: Change) {
    let end = |length: usize| (at + length).min(bytes.len());
    match change {
        Change::Byte(value) => bytes[at] = value,
        Change::Ones(length) => {
            let end = end(length);
            bytes[at..end].fill(0xff);
        }
        Change::Remove(length) => {
            let end = end(length);
            bytes.drain(at..end);
        }
        Change::Insert(other) => {
            bytes.splice(at..at, other);
        }
        Change::Number(value) => {
            let is_space = |at: &usize| bytes[*at].is_ascii_whitespace();
            let start = (at..bytes.len()).find(is_space).map_or(at, |space| space + 1);
            let end = (start..bytes.len()).find(|at| !bytes[*at].is_ascii_digit()).unwrap_or(bytes.len());
            bytes.splice(start..end, value.to_string().into_bytes());
        }
        Change::Copy(from, length) => {
            let from = from.index(bytes.len());
            let piece = bytes[from..(from + length).min(bytes.len())].to_vec();
            bytes.splice(at..at, piece);
        }
        Change::Truncate => bytes.truncate(at),
    }
}

#[test]
fn changed_files_neither_panic_nor_take_absurd_memory() {
    let mut files: Vec<Vec<u8>> = all_encodings().into_iter().map(|(_, _, bytes)| bytes).collect();
    files.push(ascii_v2(NAMES, sparse).into_bytes());
    let changes = prop::collection::vec((any::<prop::sample::Index>(), change()), 1..5);
    let mut runner =
        TestRunner::new(Config { cases: 10_000, failure_persistence: None, ..Config::default() });
    let (read, refused) = (Cell::new(0), Cell::new(0));
    let outcome = runner.run(&(0..files.len(), changes), |(which, changes)| {
        let mut bytes = files[which].clone();
        for (index, change) in changes {
            if !bytes.is_empty() {
                let at = index.index(bytes.len());
                apply(&mut bytes, at, change);
            }
        }
        LARGEST.store(0, Ordering::Relaxed);
        let parsed = gmsh::parse(&bytes);
        let largest = LARGEST.load(Ordering::Relaxed);
        prop_assert!(largest <= BYTES_A_BYTE * bytes.len().max(64), "{largest} bytes for {}", bytes.len());
        match parsed {
            Ok(file) => {
                read.set(read.get() + 1);
                let _ = mesh_warnings(&file);
                if let Ok(mesh) = file.to_tet_mesh(LengthUnit::Metre) {
                    prop_assert_eq!(mesh.nodes().len(), file.nodes.len());
                    prop_assert_eq!(mesh.renumbered(&mesh.order_in_space()).nodes().len(), file.nodes.len());
                }
                for group in &file.groups {
                    let nodes = file.group_nodes(group).unwrap_or_default();
                    prop_assert!(nodes.iter().all(|&node| (node as usize) < file.nodes.len()));
                }
            }
            Err(error) => {
                refused.set(refused.get() + 1);
                prop_assert!(!error.to_string().is_empty());
            }
        }
        Ok(())
    });
    outcome.unwrap();
    let (read, refused) = (read.get(), refused.get());
    // Both ways are taken often.
    assert!(read > 100 && refused > 1000, "{read} read, {refused} refused");
}
