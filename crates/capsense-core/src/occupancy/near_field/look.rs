//! What a node asks of its neighbours when its link is to be found.

use super::box_field::BoxField;
use super::cells::either;
use super::link::{NEIGHBOURS, Unlinked};
use super::star::{Star, Stars};
use super::{AtWedge, RoundNear};
use crate::occupancy::Scene;
use glam::DVec3;

/// What nodes are looked at with.
#[derive(Clone, Copy)]
pub(super) struct Look<'a> {
    pub(super) scene: &'a Scene<'a>,
    pub(super) stars: &'a Stars,
    /// The conductors that hold nodes.
    pub(super) conductors: &'a [u16],
}

impl Look<'_> {
    /// The ways to the neighbours of a node, negative if below, and the areas of the dual faces of the edges to them over their
    /// lengths; zero if there is none, or a conductor holds it.
    #[inline(always)]
    pub(super) fn neighbours(&self, star: &Star<'_>, object: u16) -> [[f64; NEIGHBOURS]; 2] {
        let (mut steps, mut weights) = ([0.0; NEIGHBOURS], [0.0; NEIGHBOURS]);
        let has_ends = self.scene.has_ends;
        for axis in 0..3 {
            let area = star.area(axis);
            for side in 0..2 {
                let (node, step) = star.step(axis, side);
                let mut weight = area * star.inverse(axis, side);
                if has_ends && weight > 0.0 {
                    let below = if side == 0 { node } else { star.node };
                    weight *= self.scene.end_factor(3 * below + axis);
                }
                steps[2 * axis + side] = step;
                weights[2 * axis + side] = either(self.conductors[node] == object, 0.0, weight);
            }
        }
        [steps, weights]
    }

    /// Whether an object is between two nodes.
    pub(super) fn is_between(&self, object: u16, node: usize, other: usize) -> bool {
        let [from, to] = [node, other].map(|node| self.scene.mesh.nodes[node]);
        self.scene.span(object.into(), from, to).is_some()
    }

    /// What a node makes of a round surface.
    pub(super) fn linked_to_round(&self, star: &Star<'_>, round: &RoundNear, unlinked: &Unlinked) -> AtWedge {
        self.linked_by(star, unlinked, |point| round.potential(point), |_| false)
    }

    /// What a node makes of a box's edges.
    ///
    /// # Panics
    /// Where the object is no box.
    pub(super) fn linked_to_box(&self, star: &Star<'_>, unlinked: &Unlinked) -> AtWedge {
        let Some((angles, half)) = self.scene.fields[usize::from(unlinked.at.object)].of_box() else {
            unreachable!("only boxes have corners");
        };
        let field = BoxField::seen_from(star, angles, half);
        self.linked_by(star, unlinked, |point| field.potential(point), |point| field.sees(point))
    }

    /// What a node makes of a conductor whose potential is known around it. Of points that are seen nobody asks whether the conductor is
    /// between.
    fn linked_by(
        &self,
        star: &Star<'_>,
        unlinked: &Unlinked,
        potential: impl Fn(DVec3) -> f64,
        is_seen: impl Fn(DVec3) -> bool,
    ) -> AtWedge {
        let potential = |node: usize| potential(self.scene.mesh.nodes[node]);
        let (mut weights, mut potentials) = ([[0.0]; NEIGHBOURS], [[0.0]; NEIGHBOURS]);
        let [_, of_edges] = self.neighbours(star, unlinked.at.object);
        for (number, weight) in of_edges.into_iter().enumerate() {
            if weight != 0.0 {
                let node = self.stars.neighbour_of(star.node, number);
                let is_hidden = || self.is_between(unlinked.at.object, star.node, node);
                potentials[number] = [potential(node)];
                if is_seen(self.scene.mesh.nodes[node]) || !is_hidden() {
                    weights[number] = [weight];
                }
            }
        }
        unlinked.linked(potential(star.node), &weights, &potentials)
    }
}
