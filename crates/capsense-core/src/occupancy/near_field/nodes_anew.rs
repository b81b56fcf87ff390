//! Nodes near conductors that are looked at anew: what they make of them follows from the scene alone, so threads share them.

use super::box_field::inwards;
use super::link::{LinkBatch, Unlinked};
use super::look::Look;
use super::row::NearestEdges;
use super::star::{Row, Star};
use super::{AtWedge, Cells, Near};
use crate::occupancy::NO_OBJECT;
use crate::occupancy::index_set::Part;
use std::ops::Range;

/// Successive nodes, and what they are looked at with.
pub(super) struct NodesAnew<'a> {
    pub(super) look: Look<'a>,
    /// The first of them.
    pub(super) first: usize,
    pub(super) at: &'a mut [AtWedge],
    pub(super) room: &'a mut Room,
    /// Whether ends of plates change weights, or did.
    pub(super) has_ends: bool,
}

/// One of the nodes of a piece of a row, and what these make of a box.
struct ByBox<'a> {
    nearest: &'a NearestEdges,
    number: usize,
}

/// Storage for one task.
#[derive(Clone, Debug, Default)]
pub(super) struct Room {
    /// What the nodes at hand make of each object, if it is a box.
    nearest: Vec<NearestEdges>,
    /// All nodes that were looked at are among these.
    pub(super) looked_at: Range<usize>,
    /// Nodes whose links changed.
    pub(super) relinked: Vec<u32>,
    /// Nodes whose share in the links of their edges changed, or that conductors have or had an edge beside, and which
    /// of their edges exist.
    pub(super) around: Vec<(u32, u8)>,
    /// Nodes of whose edges ends of plates may have changed weights, in the same way.
    pub(super) near_ends: Vec<(u32, u8)>,
}

impl Room {
    /// Forgets what was noted.
    pub(super) fn forget(&mut self) {
        self.relinked.clear();
        self.around.clear();
        self.near_ends.clear();
        self.looked_at = 0..0;
    }
}

impl NodesAnew<'_> {
    /// Looks at some of the nodes.
    pub(super) fn look_at_all(mut self, part: Part<'_, 1>) {
        let scene = self.look.scene;
        let mut nearest = std::mem::take(&mut self.room.nearest);
        if nearest.len() < scene.bounds.len() {
            nearest.resize(scene.bounds.len(), NearestEdges::NONE);
        }
        for (nearest, field) in nearest.iter_mut().zip(scene.fields) {
            if let Some((angles, half)) = field.of_box() {
                nearest.start(angles, half);
            }
        }
        let (mut row, mut batch) = (Row::default(), LinkBatch::EMPTY);
        part.drain_runs(|mut run| {
            let before = &self.room.looked_at;
            let first = if Range::is_empty(before) { run.start } else { before.start };
            self.room.looked_at = first..run.end;
            while !run.is_empty() {
                run.start = self.look_at_row(run.clone(), &mut row, &mut nearest, &mut batch);
            }
        });
        self.link(&mut batch);
        self.room.nearest = nearest;
    }

    /// Looks at those of some nodes that are in the row of the first, and returns the one after them. Links are found once
    /// enough nodes wait for theirs.
    fn look_at_row(
        &mut self,
        nodes: Range<usize>,
        row: &mut Row,
        nearest: &mut [NearestEdges],
        batch: &mut LinkBatch,
    ) -> usize {
        let look = self.look;
        let Look { scene, stars, conductors } = look;
        let row = stars.in_row(nodes, row);
        scene.find_nearest_edges(&row.cells(), nearest);
        scene.leave_out(&row, nearest);
        let may_be_beside = scene.may_be_beside(&row, nearest);
        let is_one_box = scene.is_one_box();
        for (number, star) in row.each().enumerate() {
            let node = star.node;
            if !scene.has_silhouettes || conductors[node] != NO_OBJECT {
                if self.at[node - self.first] != AtWedge::NONE {
                    self.settle(node, star.sides(), AtWedge::NONE);
                }
                continue;
            }
            let is_beside = || may_be_beside >> number & 1 != 0 && scene.is_beside(&star, number, nearest);
            let found = if is_one_box {
                let share = nearest[0].share(number);
                (share > 0.0).then_some(((0, share), None))
            } else {
                scene.nearest_in_row(&star, number, nearest)
            };
            let found = found.filter(|_| scene.takes_link(&star));
            let Some(((object, share), near)) = found else {
                let is_beside = is_beside();
                if is_beside || self.at[node - self.first] != AtWedge::NONE {
                    self.settle(node, star.sides(), AtWedge { is_beside, ..AtWedge::NONE });
                }
                continue;
            };
            match near {
                None => {
                    let by_box = ByBox { nearest: &nearest[object], number };
                    self.take_by_box(&star, (object, share), by_box, is_beside, batch);
                }
                Some(near) => self.take_by_other(&star, (object, share), &near, is_beside, batch),
            }
            if batch.is_full() {
                self.link(batch);
            }
        }
        row.nodes.end
    }

    /// Takes a node near the edges of a box, of which the link is found later unless it is near a corner.
    #[inline(always)]
    fn take_by_box(
        &mut self,
        star: &Star<'_>,
        (object, share): (usize, f64),
        ByBox { nearest, number }: ByBox<'_>,
        is_beside: impl Fn() -> bool,
        batch: &mut LinkBatch,
    ) {
        let look = self.look;
        let (edge, before) = nearest.edge(number);
        let unlinked = look.scene.unlinked(star, (object, share), edge, is_beside);
        if nearest.is_by_corner(number) {
            let at = look.linked_to_box(star, &unlinked);
            self.settle(star.node, unlinked.sides, at);
            return;
        }
        batch.push(unlinked, before, &edge.normals, look.neighbours(star, object as u16));
        let moved = edge.normals.map(|normal| inwards(star, normal));
        batch.move_last(moved, edge.normals.map(|normal| star.size_along(normal)));
    }

    /// Takes a node near a cylinder or what is round, of which the link is found later where the former has a rim.
    fn take_by_other(
        &mut self,
        star: &Star<'_>,
        (object, share): (usize, f64),
        near: &Near,
        is_beside: impl Fn() -> bool,
        batch: &mut LinkBatch,
    ) {
        let look = self.look;
        let (angle, unlinked) = match near {
            Near::Edge(angle) => (angle, look.scene.unlinked(star, (object, share), angle, is_beside)),
            Near::Cylinder(angle, of_edge, side) => {
                let unlinked = look.scene.unlinked(star, (object, share), angle, is_beside);
                let of_side = look.linked_to_round(star, side, &unlinked).link;
                let besides = (1.0 - f64::from(*of_edge)) * of_side;
                (angle, Unlinked { at: AtWedge { of_edge: *of_edge, ..unlinked.at }, besides, ..unlinked })
            }
            Near::Round(round) => {
                let unlinked = look.scene.unlinked(star, (object, share), round, is_beside);
                let at = look.linked_to_round(star, round, &unlinked);
                self.settle(star.node, unlinked.sides, AtWedge { of_edge: 0.0, ..at });
                return;
            }
        };
        let before = angle.before(star.place());
        batch.push(unlinked, before, &angle.normals, look.neighbours(star, object as u16));
        batch.bend_last(angle);
    }

    /// Finds the links that are missing.
    fn link(&mut self, batch: &mut LinkBatch) {
        let look = self.look;
        let is_hidden = |unlinked: &Unlinked, number: usize| {
            look.is_between(unlinked.at.object, unlinked.node, look.stars.neighbour_of(unlinked.node, number))
        };
        batch.drain(is_hidden, |unlinked, at| self.settle(unlinked.node, unlinked.sides, at));
    }

    /// Notes what a node makes of edges of conductors, and what of that is new.
    #[inline(always)]
    fn settle(&mut self, node: usize, sides: u8, now: AtWedge) {
        let before = std::mem::replace(&mut self.at[node - self.first], now);
        let has_same_share = before.has_share_of(&now);
        if !has_same_share || before.link.to_bits() != now.link.to_bits() {
            self.room.relinked.push(node as u32);
        }
        if !has_same_share || before.is_beside || now.is_beside {
            self.room.around.push((node as u32, sides));
        }
        if self.has_ends && (before.share > 0.0 || now.share > 0.0) {
            self.room.near_ends.push((node as u32, sides));
        }
    }
}
