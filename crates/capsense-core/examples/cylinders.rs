//! What cylinders over three stripes, and bodies slimmer than cells, change of C on eight million tetrahedra, and how far the references of
//! the test `cylinder` are from it.

#![allow(clippy::unwrap_used, dead_code)]

#[path = "../tests/suite/common/mod.rs"]
mod common;
#[path = "../tests/suite/cylinder.rs"]
mod cylinder;

/// Tetrahedra at most.
const FINEST: usize = 7_800_000;

fn main() {
    for cases in [cylinder::WIDE, cylinder::SLIM] {
        let [grounded, floating] = cylinder::errors(&cases, FINEST).largest.map(|error| 100.0 * error);
        println!("at most {grounded:.4} and {floating:.4} % off, grounded and floating");
    }
}
