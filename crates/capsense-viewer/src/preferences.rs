//! What is remembered from one start to the next, beside the window's place and the sizes of its panels.

use crate::history::TimeAxis;
use crate::quantity::{Quantity, Unit};
use serde::{Deserialize, Serialize};

/// Light or dark.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Theme {
    /// As the desktop has it.
    #[default]
    System,
    /// Light ink on dark ground.
    Dark,
    /// Dark ink on light ground.
    Light,
}

/// Which panels are open.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Panels {
    /// Objects, simulation and what the 3D view shows.
    pub scene: bool,
    /// Curves.
    pub curves: bool,
    /// Matrix, performance and measurements.
    pub data: bool,
}

impl Default for Panels {
    fn default() -> Self {
        Self { scene: true, curves: true, data: true }
    }
}

/// How curves are shown.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct CurvePreferences {
    /// C or its change.
    pub quantity: Quantity,
    /// Unit of the axis.
    pub unit: Unit,
    /// Time of the axis.
    pub axis: TimeAxis,
    /// Each curve from its least value at 0 to its greatest at 1.
    pub normalised: bool,
    /// What the scene's converters read beside the true values.
    pub as_read: bool,
    /// Seconds that a scrolling axis shows.
    pub window_s: f64,
}

impl Default for CurvePreferences {
    fn default() -> Self {
        Self {
            quantity: Quantity::default(),
            unit: Unit::default(),
            axis: TimeAxis::Scene,
            normalised: false,
            as_read: true,
            window_s: 20.0,
        }
    }
}

/// All that is remembered.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Preferences {
    /// Light or dark.
    pub theme: Theme,
    /// Which panels are open.
    pub panels: Panels,
    /// How curves are shown.
    pub curves: CurvePreferences,
    /// Whether error bars are told whenever nothing moves.
    pub bars_at_rest: bool,
}
