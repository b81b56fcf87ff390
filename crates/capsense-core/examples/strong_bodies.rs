//! What strong dielectrics over three stripes change of C on eight million tetrahedra, and how far the test `strong`'s references are from it.

#![allow(clippy::unwrap_used, dead_code)]

#[path = "../tests/suite/common/mod.rs"]
mod common;
#[path = "../tests/suite/strong.rs"]
mod strong;

/// Tetrahedra at most.
const FINEST: usize = 8_000_000;

fn main() {
    let [largest, mean] = strong::errors(FINEST);
    println!("at most {:.4} % off, {:.4} in the mean", 100.0 * largest, 100.0 * mean);
}
