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
mod second_order;
mod sheet;
mod side;
mod stack;
mod tube;

use std::collections::HashMap;

pub(super) use cut::rim_of_cut;
pub(super) use lattice::{Ground, rim_on_lattice};
pub(super) use sheet::rims_of_sheets;

/// Links of a share closer to 1 weigh so much more than edges that the node is as good as held.
const LARGEST_SHARE: f64 = 0.999;

/// The share of a node on a convex corner between sides along a lattice, in parts of that of a straight rim: with it,
/// square plates of few cells have the capacitance that they have on fine lattices, whether cells are flat or high.
const CONVEX_CORNER: f64 = 0.766;

/// What a node at a rim is.
enum Link {
    Held,
    Weight(f64),
    None,
}

impl Link {
    /// Of a share in a node: from 0, of a free node, to 1, of one that is held. `weight` is that of a link for a half.
    fn of_share(share: f64, weight: f64) -> Self {
        if share >= LARGEST_SHARE {
            Self::Held
        } else if share > 0.0 {
            Self::Weight(weight * share / (1.0 - share))
        } else {
            Self::None
        }
    }
}

/// A weight between a free node at the rim of an electrode and the electrode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RimLink {
    /// The node.
    pub node: u32,
    /// Index of the electrode.
    pub electrode: u16,
    /// Metres times the relative permittivity around the node.
    pub weight: f64,
    /// What it is where edges have the weights of linear elements, on a lattice too.
    pub of_elements: f64,
    /// Whether the node lies within the outline or on it.
    pub inside: bool,
    /// The part of the node's cell in the plane of the electrode that this covers, below one. Zero where that is not known.
    pub covered: f64,
    /// How far rows of nodes along the rim are apart, in metres. Infinite where that is not known: cells there count as no higher than that.
    pub rows: f64,
}

/// An edge from a node at a rim straight out of the electrode, in its plane, and how many times as much it weighs as others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RimEdge {
    pub(crate) node: u32,
    pub(crate) outside: u32,
    pub(crate) factor: f64,
}

/// What an electrode makes of the nodes at its rim.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Rim {
    /// Nodes that are at the potential of the electrode.
    pub(super) held: Vec<u32>,
    /// Nodes that are linked to it.
    pub(super) linked: Vec<Linked>,
    /// Edges that weigh less, or more, for it.
    pub(super) edges: Vec<RimEdge>,
}

impl Rim {
    /// The same with links as they are in another rim of the same electrode, where edges have the weights of linear elements. Nodes that
    /// are not linked there keep theirs.
    pub(super) fn with_elements_of(mut self, other: &Self) -> Self {
        let of_nodes: HashMap<u32, f64> =
            other.linked.iter().map(|linked| (linked.node, linked.weight)).collect();
        for linked in &mut self.linked {
            linked.of_elements = of_nodes.get(&linked.node).copied().unwrap_or(linked.weight);
        }
        self
    }
}

/// A node at a rim.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Linked {
    pub(super) node: u32,
    pub(super) weight: f64,
    /// As in [`RimLink`].
    pub(super) of_elements: f64,
    /// Whether it lies within the outline or on it.
    pub(super) inside: bool,
    /// As in [`RimLink`].
    pub(super) covered: f64,
    pub(super) rows: f64,
}
