//! Physics, numerics and failures of the library, by its public functions.
//!
//! One program, as linking one for each file takes minutes: `cargo test -p capsense-core --test suite sphere:: -- --nocapture`
//! runs the tests of `sphere.rs` and shows what they print.

#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

mod common;

mod ball;
mod baseline;
mod benchmarks;
mod bisection;
mod board;
mod bodies;
mod camera_wall;
mod closed_forms;
mod continuity;
mod corners;
mod cut_rim;
mod cylinder;
mod depth;
mod drift;
mod faces;
mod failures;
mod fringe;
mod gaps;
mod generated;
mod green;
mod immersed;
mod incomplete_cholesky;
mod interface;
mod interface_values;
mod layered_box;
mod layers;
mod layouts;
mod leaving;
mod measurement;
mod node_links;
mod open_wall;
mod oracle;
mod order;
mod outline;
mod potentials;
mod rim;
mod robustness;
mod sensor;
mod sheet;
mod solids;
mod solids_changes;
mod solver;
mod sphere;
mod stripes;
mod strong;
mod unresolved;
mod update;
mod weak;
mod wedge;
mod workspace;
