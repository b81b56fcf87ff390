//! The weights of links between electrodes and the nodes at their rims, as dielectrics near them have it.

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
    /// the mean permittivity around the node does. Edges that end in a conductor tell nothing of it.
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
        let (mut sum, mut of_empty) = (0.0, 0.0);
        network.edges().for_edges_at(node as usize, |edge, _| {
            let weight = network.weights()[edge];
            let coupling = &occupancy.couplings()[edge];
            let Some(ends) = network.edges().ends(edge) else { return };
            let held = ends.into_iter().any(|end| occupancy.conductors()[end as usize] != NO_OBJECT);
            if weight > 0.0 && !coupling.is_linked() && !held {
                sum += weight * coupling.through;
                of_empty += weight;
            }
        });
        let ratio = if of_empty > 0.0 { sum / of_empty } else { 1.0 };
        let links = self.now[first..first + count].iter_mut().zip(&self.empty[first..]);
        links.fold(0.0, |total, (now, empty)| {
            let weight = empty.weight * ratio;
            self.changed |= weight.to_bits() != now.weight.to_bits();
            now.weight = weight;
            total + weight
        })
    }
}
