//! Planar electrodes: the mesh nodes they own, and the mesh edges they cut.
//!
//! An [`Outline`] is given by lengths or corners, or is taken from triangles by [`Sheet::of_surface`].

mod outline;
mod polygon;
mod sheet;

pub use outline::Outline;
pub(crate) use outline::join_near;
pub use sheet::{Sheet, SheetError};

use glam::DVec3;

/// A thin electrode parallel to the sensing surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Electrode {
    /// Unique name.
    pub name: String,
    /// Outline in x and y.
    pub outline: Outline,
    /// Height in the sensor frame.
    pub z: f64,
}

impl Electrode {
    /// Whether a mesh node belongs to the electrode; `flat` is how far from its plane a node may lie.
    pub fn owns(&self, node: DVec3, flat: f64) -> bool {
        (node.z - self.z).abs() <= flat && self.outline.contains(node.truncate())
    }
}
