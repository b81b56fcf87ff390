//! The program, scenes and what is told of accuracy, from end to end.
//!
//! One program, as linking one for each file takes minutes: `cargo test --test suite scene_parser::` runs the tests of
//! `scene_parser.rs`.

#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

mod common;

mod accuracy;
mod assets;
mod chart;
mod command;
mod compare;
mod device;
mod electrode_stl;
mod error_bars;
mod gmsh_interop;
mod gmsh_mended;
mod gmsh_read;
mod gmsh_refusals;
mod gmsh_scene;
mod gmsh_write;
mod measurement;
mod readme;
mod scene_errors;
mod scene_file_errors;
mod scene_parser;
mod scene_write;
mod section_v;
mod solids;
mod stress;

// What `examples/accuracy` measures.
#[allow(dead_code)]
#[path = "../../examples/accuracy/bars.rs"]
mod bars;
#[allow(dead_code)]
#[path = "../../examples/accuracy/cases.rs"]
mod cases;
#[allow(dead_code)]
#[path = "../../examples/accuracy/continuity.rs"]
mod continuity;
#[allow(dead_code)]
#[path = "../../examples/accuracy/ends.rs"]
mod ends;
#[allow(dead_code)]
#[path = "../../examples/accuracy/fitted.rs"]
mod fitted;
#[allow(dead_code)]
#[path = "../../examples/accuracy/measure.rs"]
mod measure;
#[allow(dead_code)]
#[path = "../../examples/accuracy/plates.rs"]
mod plates;
#[allow(dead_code)]
#[path = "../../examples/accuracy/plot.rs"]
mod plot;
#[allow(dead_code)]
#[path = "../../examples/accuracy/references.rs"]
mod references;
#[allow(dead_code)]
#[path = "../../examples/accuracy/rims.rs"]
mod rims;
#[allow(dead_code)]
#[path = "../../examples/accuracy/section.rs"]
mod section;
#[allow(dead_code)]
#[path = "../../examples/accuracy/statistics.rs"]
mod statistics;
