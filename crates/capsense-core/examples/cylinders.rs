//! What cylinders over three stripes change of C on eight million tetrahedra, and how far the test `cylinder`'s references are from it.

#![allow(clippy::unwrap_used, dead_code)]

#[path = "../tests/suite/common/mod.rs"]
mod common;
#[path = "../tests/suite/cylinder.rs"]
mod cylinder;

/// Tetrahedra at most.
const FINEST: usize = 7_800_000;

fn main() {
    let errors = cylinder::largest_errors(FINEST);
    println!("at most {:.4} and {:.4} % off, grounded and floating", 100.0 * errors[0], 100.0 * errors[1]);
}
