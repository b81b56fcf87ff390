//! The rims of thin electrodes: where the outline lies between mesh nodes, and what a mesh cannot resolve of the field
//! there.
//!
//! At the rim of a thin electrode the potential grows with the root of the distance. Linear elements with nodes held at
//! the rim make the electrode look larger than it is, by a fixed part of the size of their cells. So nodes at the rim are
//! not held but linked to their electrode, by the weight with which the far field of the discrete rim is that of a rim
//! in its true place.

mod cut;
mod half_plane;
mod lattice;
mod place;
mod plane;
mod relax;
mod sheet;
mod side;
mod stack;
mod tube;

pub(super) use cut::rim_of_cut;
pub(super) use lattice::{Ground, rim_on_lattice};
pub(super) use sheet::rims_of_sheets;

/// A weight between a free node at the rim of an electrode and the electrode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RimLink {
    /// The node.
    pub node: u32,
    /// Index of the electrode.
    pub electrode: u16,
    /// Metres times the relative permittivity around the node.
    pub weight: f64,
    /// Whether the node lies within the outline or on it.
    pub inside: bool,
}

/// What an electrode makes of the nodes at its rim.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Rim {
    /// Nodes that are at the potential of the electrode.
    pub(super) held: Vec<u32>,
    /// Nodes that are linked to it.
    pub(super) linked: Vec<Linked>,
}

/// A node at a rim.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Linked {
    pub(super) node: u32,
    pub(super) weight: f64,
    /// Whether it lies within the outline or on it.
    pub(super) inside: bool,
}
