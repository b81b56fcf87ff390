//! Evidence from real runs: how fast and how exact each method is on the same moving bar, and where it fails ([`stress`]).
//!
//! [`stage`] is what all methods are measured on, [`reference`](mod@reference) what their capacitances are compared with,
//! [`setting`] how a method can be set, [`ladder`] which settings are measured, [`measure`](mod@measure) the measurement of one, [`table`]
//! the results of all and [`pareto`] those that nothing beats; [`chart`] and [`timing`] draw them. [`published`] is what others have published.

pub mod chart;
pub mod clock;
pub mod ladder;
pub mod measure;
pub mod pareto;
mod plot;
pub mod published;
pub mod reference;
pub mod setting;
pub mod stage;
pub mod stress;
pub mod table;
pub mod timing;

use crate::pipeline::PipelineError;
use crate::scene::SceneError;
use capsense_core::baseline::BaselineError;
use capsense_core::mesh::InvalidAxis;
use capsense_core::sensor::SensorError;
use capsense_core::simulator::SimulatorError;
use capsense_core::solids::SolidError;
use capsense_core::workspace::WorkspaceError;
use capsense_render::RenderError;

/// Why there is no measurement.
#[derive(Debug, thiserror::Error)]
pub enum EvidenceError {
    /// The built-in scene is not what it was.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The built-in scene has another sensor or other objects than methods are measured with.
    #[error("the built-in scene is not one bar near electrodes on a generated mesh")]
    Stage,
    /// A frame cannot be computed.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    /// The sensor cannot be meshed.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// There is no mesh of the error that was asked for.
    #[error(transparent)]
    Workspace(#[from] WorkspaceError),
    /// A lattice has impossible coordinates.
    #[error(transparent)]
    Lattice(#[from] InvalidAxis),
    /// The simulator fails.
    #[error(transparent)]
    Simulator(#[from] SimulatorError),
    /// The bar cannot stand where it should.
    #[error(transparent)]
    Solid(#[from] SolidError),
    /// The bar cannot be drawn.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// The paper's method fails.
    #[error(transparent)]
    Baseline(#[from] BaselineError),
    /// A change of C has no reference to be compared with.
    #[error("there is no reference for pose {0}, or no electrode feels it")]
    NoReference(usize),
}
