//! CapSense: what a capacitive proximity sensor measures while objects move near it, in real time and with a known
//! error.
//!
//! A [`Scene`] is read from a file, a [`Pipeline`] computes it frame by frame. The mathematics are in
//! [`capsense_core`], the depth camera in [`capsense_render`].
//!
//! ```
//! use capsense::{Pipeline, Scene};
//! use std::path::Path;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let text = r#"
//!     mesh.generate = { elements = 5000 }
//!     [[sensor.electrode]]
//!     name = "E1"
//!     rectangle = { center = [0.0, 0.0], size = [0.1, 0.1] }
//!     [[object]]
//!     name = "ball"
//!     sphere = { radius = 0.05 }
//!     material = { conductor = "grounded" }
//!     position = [0.0, 0.0, 0.08]
//! "#;
//! let scene = Scene::parse("ball.toml", text, Path::new("."))?;
//! let mut pipeline = Pipeline::new(&scene)?;
//! let frame = pipeline.frame(0)?;
//! let alone = pipeline.simulator().base().get(0, 0);
//! assert!(frame.capacitance.get(0, 0) > alone, "a grounded ball nearby adds to the self-capacitance");
//! # Ok(())
//! # }
//! ```

#![forbid(unsafe_code)]

pub mod curve_table;
pub mod device;
pub mod error_bars;
pub mod evidence;
mod eye;
pub mod frame_table;
pub mod gmsh;
pub mod motion;
pub mod pipeline;
pub mod run_folder;
pub mod scene;
pub mod series;

pub use capsense_core as core;
pub use capsense_render as render;
pub use device::Device;
pub use error_bars::ErrorEstimator;
pub use pipeline::{Frame, Pipeline, PipelineError};
pub use scene::{Scene, SceneError};

/// Compiles and runs the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
