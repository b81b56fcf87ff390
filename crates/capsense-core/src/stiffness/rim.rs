//! The weights of links between electrodes and the nodes at their rims, as dielectrics and conductors near them have it.
//!
//! A conductor close before an electrode makes plates of both, and what counts of a node at the rim is the part of its cell that the
//! electrode covers: of the capacitor G between node and conductor, as much belongs to the electrode. In series with a link L, this takes
//! G L / (G + L) there, so L has to be G s/(1 - s) for a part s. What the conductor adds to G when it comes closer than the next node, the
//! link is made heavier by. Where cells are higher than rows along the rim are apart there are no plates yet when it comes as near as that: the
//! link for a half-plane under a shield (`core::sensor::rim::half_plane`) is hardly another one than without the shield until it is as near as
//! rows are apart, so what counts is by how much the conductor is nearer than these. Of several rims at a node the closest rows count for
//! all. How far apart those along a sheet are is not known, so there it counts from the next node on, however high cells are.

use super::EdgeNetwork;
use crate::occupancy::{NO_OBJECT, Occupancy};
use crate::sensor::RimLink;
use std::ops::Range;

/// Links in the order of their nodes.
#[derive(Clone, Debug)]
pub(super) struct RimWeights {
    /// In the empty scene.
    empty: Vec<RimLink>,
    now: Vec<RimLink>,
    /// From the first node to behind the last.
    extent: Range<u32>,
    changed: bool,
}

impl RimWeights {
    pub(super) fn new(links: &[RimLink]) -> Self {
        let mut empty = links.to_vec();
        empty.sort_by_key(|link| (link.node, link.electrode));
        let extent = empty.first().zip(empty.last()).map_or(0..0, |(first, last)| first.node..last.node + 1);
        Self { now: empty.clone(), empty, extent, changed: false }
    }

    pub(super) fn links(&self) -> &[RimLink] {
        &self.now
    }

    pub(super) fn has_link(&self, node: u32) -> bool {
        self.empty.binary_search_by_key(&node, |link| link.node).is_ok()
    }

    pub(super) fn start_update(&mut self) {
        self.changed = false;
    }

    /// Whether a weight changed since.
    pub(super) fn changed(&self) -> bool {
        self.changed
    }

    /// Weighs the links of a node anew and returns their sum. A link stands for the field around the rim, so it grows as
    /// the mean permittivity around the node does, and is heavier where a conductor is close before the electrode.
    pub(super) fn update(&mut self, node: u32, network: &EdgeNetwork, occupancy: &Occupancy) -> f64 {
        // Most nodes are far from any rim.
        if !self.extent.contains(&node) {
            return 0.0;
        }
        let first = self.empty.partition_point(|link| link.node < node);
        let count = self.empty[first..].iter().take_while(|link| link.node == node).count();
        if count == 0 {
            return 0.0;
        }
        let links = &self.empty[first..first + count];
        let rows = links.iter().map(|link| link.rows).fold(f64::INFINITY, f64::min);
        let Around { permittivity, nearer } = Around::of(node, rows, network, occupancy);
        let links = self.now[first..first + count].iter_mut().zip(links);
        links.fold(0.0, |total, (now, empty)| {
            let weight = empty.weight * permittivity + nearer * (empty.covered / (1.0 - empty.covered));
            self.changed |= weight.to_bits() != now.weight.to_bits();
            now.weight = weight;
            total + weight
        })
    }
}

/// What is around a node at a rim.
struct Around {
    /// The mean permittivity in parts of that of the empty scene. Edges that end in a conductor tell nothing of it.
    permittivity: f64,
    /// By how much what leads to conductors before and behind the electrode weighs more than edges do, or what would lead as far as rows are
    /// apart.
    nearer: f64,
}

impl Around {
    fn of(node: u32, rows: f64, network: &EdgeNetwork, occupancy: &Occupancy) -> Self {
        let (mut sum, mut of_empty, mut nearer) = (0.0, 0.0, 0.0);
        network.edges().for_edges_at(node as usize, |edge, end| {
            let weight = network.weights()[edge];
            if weight <= 0.0 {
                return;
            }
            let coupling = occupancy.coupling(edge);
            let ends = network.edges().ends_of_existing(edge);
            let is_held = |end: u32| occupancy.conductors()[end as usize] != NO_OBJECT;
            if let Some(way) = network.way_out_of_plane(edge) {
                let through = if is_held(ends[1 - end]) { coupling.through } else { 0.0 };
                nearer += weight * (coupling.factor[end] + through - (way / rows).max(1.0)).max(0.0);
            }
            if !coupling.is_linked() && !ends.into_iter().any(is_held) {
                sum += weight * coupling.through;
                of_empty += weight;
            }
        });
        Self { permittivity: if of_empty > 0.0 { sum / of_empty } else { 1.0 }, nearer }
    }
}
