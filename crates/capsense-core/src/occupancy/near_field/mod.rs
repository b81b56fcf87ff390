//! Nodes of a lattice near conductors whose field is known: that of a wedge at an edge, and in front of what is round.
//!
//! Around a right angle of a conductor the potential is u = r^(2/3) sin(2θ/3) (Van Bladel, *Singular Electromagnetic Fields
//! and Sources*), which no mesh of a scene's size resolves. So a node near such an edge is linked to the conductor by as
//! much as makes u satisfy the equation of this node: over its neighbours Q that the conductor does not cut off,
//!
//! link(P) u(P) = Σ w(P, Q) (u(Q) - u(P)).
//!
//! Then u is a solution on the lattice, wherever the edge lies between nodes, and a wall that passes a line of nodes changes
//! the network but not this field. In front of a flat face, u being the distance, the link is what the edge rule makes
//! of it. A link may be slightly negative, where u bends more than the lattice can. Around one edge u > 0 and (K u)(P) = 0 at
//! all nodes with a link, so K is an M-matrix; what shares and several edges make of it, `tests/suite/wedge.rs` looks at. A stick much
//! narrower than cells may have hardly any other links; there the negative ones are left out.
//!
//! In front of round conductors, spheres, capsules and sides of cylinders, u is what falls as surfaces at a distance grow ([`round`]). Where
//! cells are too large for rims, ends of cylinders that are no disks are round, too ([`cylinder`]).
//!
//! So many cells from an edge that nothing is known of it ([`Cells::far`]) and a cell from any other object, the edge rule takes over, in shares. At ends of
//! edges it does on meshes that are no lattices; on these the field is that of all edges that are about as near ([`box_field`]).

mod angles;
mod at_pose;
mod between;
mod box_field;
mod cells;
mod changed;
mod cylinder;
mod end_table;
mod ends;
mod field;
mod link;
mod look;
mod nodes_anew;
mod round;
mod row;
mod share;
mod star;

pub use angles::{RightAngled, RightAngles};
pub(crate) use at_pose::span_in_box;
pub use ends::may_change_weights;
pub(super) use ends::{MORE_PLANES, PlateEnds};
pub(super) use field::Places;
pub use field::RightAngle;
pub use round::Round;
pub(super) use round::RoundNear;
pub(super) use share::{Cells, part_within};
use share::{Extent, share_of, share_of_round, smooth};
pub(super) use star::{FAR_OFF_LATTICE, grown, grown_more};

use super::coupling::Coupling;
use super::index_set::IndexSet;
use super::{NO_OBJECT, Scene, Surfaces};
use crate::geometry::Aabb;
use crate::instructions::widest;
use crate::mesh::Edges;
use crate::sensor::FREE;
use crate::workers::Workers;
use box_field::within;
use cells::RowCells;
pub(crate) use cells::either;
use cylinder::Side;
use glam::DVec3;
use link::Unlinked;
use look::Look;
use nodes_anew::{NodesAnew, Room};
use row::{FindNearest, NearestEdges};
pub(crate) use row::{larger, smaller};
use star::{FAR, StarsInRow};
pub(super) use star::{Row, Star, Stars};

/// Up to so many cells from an edge, the field is that of a wedge alone.
const NEAR: f64 = 1.0;

/// Cells do not resolve conductors at all that are no broader than this part of an edge.
const LEFT_OUT: f64 = 0.25;

/// They do those as broad as this part; in between, in proportion.
const KEPT: f64 = 0.75;

/// So many tasks for each thread, as some take longer and some threads come later.
const TASKS_OF_A_THREAD: usize = 4;

/// The axis along which each node's own edge carries its link.
const CARRIER: usize = 0;

/// What [`Star::sides`] tells of a node with all six edges.
const ALL_SIDES: u8 = 0b11_11_11;

/// What a node near an edge of a conductor makes of its edges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct AtWedge {
    /// The conductor, or [`NO_OBJECT`].
    object: u16,
    /// How much of the node's links to conductors is what the wedge makes of them.
    share: f32,
    /// That share, as a factor of the weight of the edge that leads upwards along [`CARRIER`].
    link: f64,
    /// The potential of the node itself, or what it is taken for where the node is all but in the conductor.
    potential: f64,
    /// Whether the field is that of one wedge alone: the edge rule has no share in it, and the conductor is so thick that no edge of
    /// the mesh has both ends before it and meets it.
    is_all: bool,
    /// Whether that is not so, and a conductor has an edge among the cells around.
    is_beside: bool,
    /// How much of the share is an edge's, whose the potential is if it has any; the rest is that of what is round.
    of_edge: f32,
}

impl AtWedge {
    const NONE: Self = Self {
        object: NO_OBJECT,
        share: 0.0,
        link: 0.0,
        potential: 1.0,
        is_all: false,
        is_beside: false,
        of_edge: 0.0,
    };

    /// Whether all but the link is the same in what edges see of it.
    fn has_share_of(&self, other: &Self) -> bool {
        let of = |at: &Self| (at.object, at.share.to_bits(), at.is_all);
        of(self) == of(other)
    }

    /// Whether walls of conductors may pass beside an edge of the node, as far as it knows.
    fn may_be_beside(&self, owner: u16) -> bool {
        self.is_beside || self.is_all_to(owner)
    }

    /// Whether nothing but the wedge, or the conductor that holds it, matters at this end of an edge.
    fn is_all_to(&self, owner: u16) -> bool {
        self.is_all || owner != NO_OBJECT
    }
}

/// What is known of the field around an object, were it a conductor.
#[derive(Clone, Copy, Debug)]
pub(super) enum KnownField {
    None,
    Edges(RightAngles),
    Round(Round),
}

impl KnownField {
    pub(super) fn around(surfaces: &dyn Surfaces, object: usize) -> Self {
        match (surfaces.right_angles(object), surfaces.roundness(object)) {
            (Some(angles), _) => Self::Edges(angles),
            (None, Some(round)) => Self::Round(round),
            (None, None) => Self::None,
        }
    }

    /// The right angles of a box, and half its edge lengths, if it is one.
    #[inline]
    pub(super) fn of_box(&self) -> Option<(&RightAngles, DVec3)> {
        match self {
            Self::Edges(angles) => match angles.solid {
                RightAngled::Box(half) => Some((angles, half)),
                RightAngled::Cylinder { .. } => None,
            },
            _ => None,
        }
    }
}

/// The field near a conductor.
#[derive(Clone, Copy, Debug)]
pub(super) enum Near {
    Edge(RightAngle),
    Round(RoundNear),
    /// The rim of a cylinder, that has such a part of the share, and its side.
    Cylinder(RightAngle, f32, RoundNear),
}

impl Near {
    /// The rim of a cylinder and its side, each with its share, of which the side has what the rim leaves; and the share of both.
    fn of_cylinder(rim: Option<(RightAngle, f64)>, (side, of_side): (RoundNear, f64)) -> Option<(Self, f64)> {
        match rim {
            Some((angle, of_rim)) if of_side == 0.0 || of_rim >= 1.0 => Some((Self::Edge(angle), of_rim)),
            Some((angle, of_rim)) if of_rim > 0.0 => {
                let share = of_rim + (1.0 - of_rim) * of_side;
                Some((Self::Cylinder(angle, (of_rim / share) as f32, side), share))
            }
            _ => (of_side > 0.0).then_some((Self::Round(side), of_side)),
        }
    }

    /// How much of the field is that of a round surface, and the diameter of that in metres.
    pub(super) fn of_round(&self) -> (f64, f64) {
        match self {
            Self::Edge(_) => (0.0, 0.0),
            Self::Round(round) => (1.0, round.diameter()),
            Self::Cylinder(_, of_edge, side) => (1.0 - f64::from(*of_edge), side.diameter()),
        }
    }
}

/// How well cells resolve a conductor that is such a part of an edge broad, on lattices of the longest one of a node: so much of
/// negative links is left beside it there.
#[inline]
pub(super) fn resolved(breadth: f64) -> f64 {
    ((breadth - LEFT_OUT) / (KEPT - LEFT_OUT)).clamp(0.0, 1.0)
}

/// What all nodes make of edges of conductors.
#[derive(Clone, Debug, Default)]
pub(super) struct Wedges {
    /// Empty before the first exact surface.
    at: Vec<AtWedge>,
    /// Whether there are conductors. If not, nodes make nothing of anything.
    has_conductors: bool,
    /// Whether ends of plates change weights.
    has_ends: bool,
    stars: Stars,
    /// Nodes that are to be looked at.
    nodes: IndexSet,
    /// Room for each task, with what it noted.
    rooms: Vec<Room>,
}

impl Wedges {
    /// Looks at the nodes near some regions, outside of which nothing changed. `conductors` are those that hold nodes.
    pub(super) fn update(
        &mut self,
        workers: &Workers,
        scene: &Scene<'_>,
        regions: &[Aabb],
        conductors: &[u16],
    ) {
        self.rooms.iter_mut().for_each(Room::forget);
        let Edges::Lattice(lattice) = scene.mesh.edges else { return };
        if self.at.is_empty() && scene.has_silhouettes {
            self.at.resize(conductors.len(), AtWedge::NONE);
            self.nodes = IndexSet::below(conductors.len());
            self.stars = Stars::of(lattice, scene.mesh.permittivity.is_uniform());
        }
        if self.at.is_empty() {
            return;
        }
        let had_conductors = std::mem::replace(&mut self.has_conductors, scene.has_conductors());
        if !had_conductors && !self.has_conductors {
            return;
        }
        let had_ends = std::mem::replace(&mut self.has_ends, scene.has_ends);
        let has_ends = had_ends || scene.has_ends;
        let Self { at, stars, nodes, rooms, .. } = self;
        for region in regions {
            let near = grown_more(scene.mesh.edges, region, if has_ends { MORE_PLANES } else { 0 });
            lattice.for_rows_within(&near, |row| nodes.insert_all(row));
        }
        let tasks = workers.tasks(TASKS_OF_A_THREAD);
        rooms.resize_with(tasks, Room::default);
        let look = Look { scene, stars, conductors };
        let (mut first, mut rest) = (0, &mut at[..]);
        let tasks = IndexSet::cut([nodes], tasks).zip(rooms).map(move |(part, room)| {
            let own = rest.split_off_mut(..(part.end() - first).min(rest.len())).unwrap_or_default();
            let nodes = NodesAnew { look, first, at: own, room, has_ends };
            first = part.end();
            (nodes, part)
        });
        workers.for_each(tasks, |(nodes, part)| nodes.look_at_all(part));
    }

    /// What is around a node of a lattice, of which [`Wedges::may_be_beside`] says that something is, best in the row of the
    /// one before.
    pub(super) fn star(&self, node: usize, row: &mut Row) -> Star<'_> {
        self.stars.at(node, row)
    }

    /// Whether there are any.
    #[inline]
    pub(super) fn has_any(&self) -> bool {
        self.has_conductors
    }

    /// Whether walls of conductors may pass beside an edge that is not all between wedges.
    pub(super) fn may_be_beside(&self, ends: [u32; 2], owners: [u16; 2]) -> bool {
        let (Some(a), Some(b)) = (self.at.get(ends[0] as usize), self.at.get(ends[1] as usize)) else {
            return false;
        };
        Self::are_beside([a, b], owners)
    }

    #[inline(always)]
    fn are_beside([a, b]: [&AtWedge; 2], owners: [u16; 2]) -> bool {
        let [is_all_a, is_all_b] = [a.is_all_to(owners[0]), b.is_all_to(owners[1])];
        // All that is beside an edge is among the cells around either of its ends.
        (a.is_beside || is_all_a) && (b.is_beside || is_all_b) && !(is_all_a && is_all_b)
    }

    /// All nodes and their neighbours.
    pub(super) fn stars(&self) -> &Stars {
        &self.stars
    }

    /// What is left of an edge with free ends that no object is on: the link that it carries. `None` where walls may pass
    /// beside it.
    #[inline]
    pub(super) fn link_alone(&self, edge: usize, ends: [u32; 2]) -> Option<Coupling> {
        let mut coupling = Coupling::PLAIN;
        if let (Some(from), Some(to)) = (self.at.get(ends[0] as usize), self.at.get(ends[1] as usize)) {
            if Self::are_beside([from, to], [NO_OBJECT; 2]) {
                return None;
            }
            if edge % 3 == CARRIER && from.share > 0.0 && from.link != 0.0 {
                (coupling.factor[0], coupling.object[0]) = (from.link, from.object);
            }
        }
        Some(coupling)
    }

    /// What the ends of an edge make of it, if one is near an edge of a conductor.
    pub(super) fn between(&self, ends: [u32; 2]) -> Option<[&AtWedge; 2]> {
        let [a, b] = [self.at.get(ends[0] as usize)?, self.at.get(ends[1] as usize)?];
        (a.share > 0.0 || b.share > 0.0).then_some([a, b])
    }
}

impl Scene<'_> {
    /// Around which nodes of a piece of a row, of which it is known what boxes are near, a conductor may have an edge among the
    /// cells: a bit for each.
    fn may_be_beside(&self, row: &StarsInRow<'_>, nearest: &[NearestEdges]) -> u64 {
        let of_object = |object: usize| match self.fields[object].of_box() {
            Some(_) => nearest[object].may_be_beside(),
            None => u64::MAX,
        };
        let is_near = |object: &usize| self.is_conductor(*object) && row.reach(&self.bounds[*object]);
        (0..self.bounds.len()).filter(is_near).fold(0, |nodes, object| nodes | of_object(object))
    }

    /// Whether a conductor has an edge among the cells around a node of such a piece.
    #[inline(never)]
    fn is_beside(&self, star: &Star<'_>, number: usize, nearest: &[NearestEdges]) -> bool {
        (0..self.bounds.len()).any(|object| {
            let is_box = self.fields[object].of_box().is_some();
            self.is_conductor(object)
                && (!is_box || nearest[object].may_be_beside() >> number & 1 != 0)
                && self.has_edge_in(object, &star.bounds())
        })
    }

    /// Whether there is nothing but a box that is a conductor: the most frequent case.
    fn is_one_box(&self) -> bool {
        self.fields.len() == 1 && self.fields[0].of_box().is_some() && self.is_conductor(0)
    }

    /// Finds the nearest edges of all boxes that are conductors for a piece of a row.
    fn find_nearest_edges(&self, row: &RowCells<'_>, nearest: &mut [NearestEdges]) {
        for (object, nearest) in nearest.iter_mut().enumerate().take(self.bounds.len()) {
            let Some((angles, half)) = self.fields[object].of_box().filter(|_| self.is_conductor(object))
            else {
                continue;
            };
            let bounds = &self.bounds[object];
            let is_far = (0..2).any(|across| {
                let plane = row.across[across];
                let place = plane.at.clamp(bounds.min[1 + across], bounds.max[1 + across]);
                plane.cells_to(place - plane.at) >= FAR
            });
            if is_far {
                nearest.clear();
            } else {
                widest().dispatch(FindNearest { angles, half, row: *row, nearest });
            }
        }
    }

    /// Takes from the shares of edges that are outside the lattice, or all but outside.
    fn leave_out(&self, row: &StarsInRow<'_>, nearest: &mut [NearestEdges]) {
        for (object, nearest) in nearest.iter_mut().enumerate().take(self.bounds.len()) {
            let of_box = self.fields[object].of_box().filter(|_| self.is_conductor(object));
            let Some((angles, half)) = of_box.filter(|_| !row.is_within(&self.bounds[object])) else {
                continue;
            };
            for (number, star) in row.each().enumerate() {
                if nearest.share(number) > 0.0 {
                    nearest.take_part(number, within(&star, angles, half));
                }
            }
        }
    }

    /// Whether a node may have a link, and its links are known.
    #[inline]
    fn takes_link(&self, star: &Star<'_>) -> bool {
        let is_free = self.mesh.terminals[star.node] == FREE;
        // What stands for the space beyond an open wall is in the weights of its nodes.
        let is_inside = !self.has_open_wall || star.sides() == ALL_SIDES;
        is_free && is_inside && star.neighbour(CARRIER, true).is_some() && self.is_homogeneous(star)
    }

    /// A node near an edge of a conductor, or a round one, and what it makes of it, but for the link.
    #[inline(always)]
    fn unlinked(
        &self,
        star: &Star<'_>,
        (object, share): (usize, f64),
        near: &impl Extent,
        has_edges_beside: impl Fn() -> bool,
    ) -> Unlinked {
        let longest = star.longest();
        let is_all = share >= 1.0 && near.is_thicker_than(longest);
        // All of a share means that the edge is less than a cell away.
        let is_beside = !is_all && (share >= 1.0 || has_edges_beside());
        Unlinked {
            node: star.node,
            sides: star.sides(),
            at: AtWedge {
                object: object as u16,
                share: share as f32,
                is_all,
                is_beside,
                of_edge: 1.0,
                ..AtWedge::NONE
            },
            share,
            of_negative: resolved(near.breadth() * star.per_longest()),
            carrier: star.ways(CARRIER)[1] / star.area(CARRIER),
            besides: 0.0,
        }
    }

    /// The conductor whose nearest edge, or round surface, has a share in a node's links, and that share. `near` tells what it
    /// would be of each if there were nothing else.
    #[inline]
    pub(super) fn nearest(
        &self,
        node: usize,
        cells: &impl Cells,
        mut near: impl FnMut(usize) -> Option<f64>,
    ) -> Option<(usize, f64)> {
        let point = self.mesh.nodes[node];
        let is_alone = self.bounds.len() == 1;
        let mut found = None;
        let mut share = 1.0_f64;
        for (object, bounds) in self.bounds.iter().enumerate() {
            let away = if is_alone { 0.0 } else { cells.cells_to(point.clamp(bounds.min, bounds.max)) };
            if away >= cells.far() {
                continue;
            }
            let near = (found.is_none() && self.is_conductor(object)).then(|| near(object));
            match near.flatten() {
                Some(own) if own > 0.0 => (found, share) = (Some(object), share.min(own)),
                _ => share = share.min(((away - NEAR) / (cells.far() - NEAR)).max(0.0)),
            }
        }
        found.filter(|_| share > 0.0).map(|object| (object, share))
    }

    /// The same for a node of a piece of a row, of which it is known what boxes are near, and the field near the conductor if that
    /// is no box.
    #[inline]
    fn nearest_in_row(
        &self,
        star: &Star<'_>,
        number: usize,
        nearest: &[NearestEdges],
    ) -> Option<((usize, f64), Option<Near>)> {
        let is_box = |object: usize| self.fields[object].of_box().is_some();
        let mut near = None;
        let found = self.nearest(star.node, star, |object| {
            if is_box(object) {
                return Some(nearest[object].share(number));
            }
            let (seen, share) = self.near(object, star.node, star)?;
            near = Some(seen);
            Some(share)
        });
        // Others may have been seen before, without a share.
        found.map(|found| (found, near.filter(|_| !is_box(found.0))))
    }

    /// The field near a conductor, and its share if there is nothing else.
    #[inline]
    pub(super) fn near(&self, object: usize, node: usize, cells: &impl Cells) -> Option<(Near, f64)> {
        let point = self.mesh.nodes[node];
        match &self.fields[object] {
            KnownField::None => None,
            KnownField::Edges(angles) => {
                let is_near = |angle: &RightAngle| (angle.place - point).abs().cmple(cells.reach()).all();
                let edge = angles.nearest(point).filter(is_near);
                let edge = edge.map(|angle| (angle, share_of(cells, &angle)));
                match Side::of(angles, cells) {
                    None => edge.map(|(angle, share)| (Near::Edge(angle), share)),
                    Some(side) => Near::of_cylinder(edge, (side.seen_from(point), side.share(cells, point))),
                }
            }
            KnownField::Round(round) => {
                Some((Near::Round(round.seen_from(point)), share_of_round(cells, round.place(point))))
            }
        }
    }

    /// Whether the background is the same all around a node.
    #[inline]
    fn is_homogeneous(&self, star: &Star<'_>) -> bool {
        self.mesh.permittivity.is_uniform() || self.has_one_permittivity(star)
    }

    fn has_one_permittivity(&self, star: &Star<'_>) -> bool {
        let mut all = None;
        let mut is_homogeneous = true;
        for axis in 0..3 {
            for upwards in [false, true] {
                if let Some(neighbour) = star.neighbour(axis, upwards) {
                    let edge = 3 * star.node.min(neighbour) + axis;
                    let permittivity = self.mesh.permittivity.at(edge);
                    is_homogeneous &= *all.get_or_insert(permittivity) == permittivity;
                }
            }
        }
        is_homogeneous
    }
}
