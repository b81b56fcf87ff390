//! What a node asks of its neighbours when its link is to be found.

use super::link::{NEIGHBOURS, Unlinked};
use super::star::{Star, Stars};
use super::{AtWedge, RoundNear};
use crate::occupancy::Scene;

/// What nodes are looked at with.
#[derive(Clone, Copy)]
pub(super) struct Look<'a> {
    pub(super) scene: &'a Scene<'a>,
    pub(super) stars: &'a Stars,
    /// The conductors that hold nodes.
    pub(super) conductors: &'a [u16],
}

impl Look<'_> {
    /// The way to a neighbour of a node, negative if below, and the area of the dual face of the edge to it over its length; zero
    /// if there is none, or a conductor holds it.
    #[inline(always)]
    pub(super) fn way_and_weight(&self, star: &Star<'_>, number: usize, object: u16) -> (f64, f64) {
        let (axis, side) = (number / 2, number % 2);
        let (node, step) = star.step(axis, side);
        let is_held = self.conductors[node] == object;
        (step, if is_held { 0.0 } else { star.area(axis) * star.inverse(axis, side) })
    }

    /// Whether an object is between two nodes.
    pub(super) fn is_between(&self, object: u16, node: usize, other: usize) -> bool {
        let [from, to] = [node, other].map(|node| self.scene.mesh.nodes[node]);
        self.scene.surfaces.span(object.into(), from, to).is_some()
    }

    /// What a node makes of a round surface.
    pub(super) fn linked_to_round(&self, star: &Star<'_>, round: &RoundNear, unlinked: &Unlinked) -> AtWedge {
        let potential = |node: usize| round.potential(self.scene.mesh.nodes[node]);
        let (mut weights, mut potentials) = ([[0.0]; NEIGHBOURS], [[0.0]; NEIGHBOURS]);
        for number in 0..NEIGHBOURS {
            let (_, weight) = self.way_and_weight(star, number, unlinked.at.object);
            if weight != 0.0 {
                let node = self.stars.neighbour_of(star.node, number);
                if !self.is_between(unlinked.at.object, star.node, node) {
                    (weights[number], potentials[number]) = ([weight], [potential(node)]);
                }
            }
        }
        unlinked.linked(potential(star.node), &weights, &potentials)
    }
}
