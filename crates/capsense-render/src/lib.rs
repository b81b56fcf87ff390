//! Orthographic depth layers of CapSense scenes, drawn on the GPU or by the CPU.
//!
//! [`mesh_file`] loads object surfaces, [`mod@tessellate`] turns every [`Shape`](capsense_core::geometry::Shape) into
//! triangles, [`scene`] keeps them ready for drawing, [`gpu`] and [`cpu`] draw them, and [`DepthRenderer`] chooses
//! between the two. The result is the same on both paths:
//! [`DepthLayers`](capsense_core::occupancy::DepthLayers) with a front and a back surface for every object.

#![forbid(unsafe_code)]

mod adapter;
mod atlas;
pub mod cpu;
mod error;
pub mod fields;
pub mod gpu;
pub mod mesh_file;
mod renderer;
pub mod scene;
pub mod tessellate;

pub use cpu::CpuRenderer;
pub use error::RenderError;
pub use gpu::{GpuOptions, GpuRenderer};
pub use mesh_file::{MeshFileError, load_mesh};
pub use renderer::{Backend, DepthRenderer};
pub use scene::{RenderScene, SceneObject};
pub use tessellate::{TessellateError, tessellate};
