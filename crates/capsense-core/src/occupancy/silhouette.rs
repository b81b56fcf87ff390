//! Edges of a lattice of whose dual face a conductor covers a part: where its silhouette, seen along the edge, passes.
//!
//! The field along an edge is that of a box around it, up to half-way to its neighbours. A conductor that the edge meets
//! need not be met by all of the box, and one that passes beside the edge may be met by a part of it. Were the edge alone
//! to tell, then all of the box would change at once when a wall along the edge passes it, and the capacitance with it.
//! So where a part f of the box meets the conductor, edges are what the edge rule makes of them to this part, and to the
//! other what they are without it. f is told by lines along the middles of the box's sides, and where one of them meets
//! the conductor and the edge does not, or the other way round, by the place of the wall between the two.
//!
//! Where the edge itself passes by, its end is at a distance d from the wall, and no part of it shall be pinned to a face
//! that is nearly in its own plane. There the field at a distance z from that face is taken along the shortest way, of
//! which the edge has the cosine squared z²/(z² + d²), and likewise for what fills only the last l of the edge. So all is
//! continuous when faces pass the planes of nodes, walls pass edges, and edges of boxes run along nodes.

use super::coupling::{EdgeRule, SMALLEST_PART};
use super::{Coupling, NO_OBJECT, Scene, Span};
use crate::geometry::Aabb;
use crate::mesh::{Edges, Lattice};
use glam::DVec3;

/// The box around an edge of a lattice.
struct Tube {
    from: DVec3,
    to: DVec3,
    length: f64,
    /// The planes of nodes before and behind the edge.
    beyond: [f64; 2],
    axis: usize,
    /// From the edge to the middles of the box's sides: two across each of two axes.
    sides: [[Option<DVec3>; 2]; 2],
}

/// What a conductor beside an edge makes of it.
#[derive(Clone, Copy, Default)]
struct Beside {
    /// The part of the box that the conductor takes from the edge.
    taken: f64,
    links: [f64; 2],
}

fn cosine_squared(along: f64, across: f64) -> f64 {
    if along > 0.0 { along * along / (along * along + across * across) } else { 0.0 }
}

impl Tube {
    fn of(lattice: &Lattice, edge: usize) -> Option<Self> {
        let (node, axis) = (edge / 3, edge % 3);
        let place = lattice.node_place(node);
        let planes = lattice.axes();
        let from = DVec3::from_array(std::array::from_fn(|axis| planes[axis][place[axis]]));
        let mut to = from;
        to[axis] = *planes[axis].get(place[axis] + 1)?;
        let neighbour = |axis: usize, index: Option<usize>| index.and_then(|i| planes[axis].get(i)).copied();
        let before = neighbour(axis, place[axis].checked_sub(1)).unwrap_or(from[axis]);
        let behind = neighbour(axis, Some(place[axis] + 2)).unwrap_or(to[axis]);
        let sides = [(axis + 1) % 3, (axis + 2) % 3].map(|across| {
            [place[across].checked_sub(1), Some(place[across] + 1)].map(|index| {
                neighbour(across, index).map(|plane| {
                    let mut side = DVec3::ZERO;
                    side[across] = 0.5 * (plane - from[across]);
                    side
                })
            })
        });
        Some(Self { from, to, length: to[axis] - from[axis], beyond: [before, behind], axis, sides })
    }

    fn bounds(&self) -> Aabb {
        let mut bounds = Aabb { min: self.from, max: self.to };
        for side in self.sides.iter().flatten().flatten() {
            bounds = Aabb { min: bounds.min.min(self.from + side), max: bounds.max.max(self.to + side) };
        }
        bounds
    }

    fn middle_of(&self, span: Span) -> DVec3 {
        self.from.lerp(self.to, 0.5 * (span.enter + span.exit))
    }

    /// The line along the middle of a side, on to the next planes of nodes.
    fn extended(&self, side: DVec3) -> [DVec3; 2] {
        let (mut a, mut b) = (self.from + side, self.to + side);
        (a[self.axis], b[self.axis]) = (self.beyond[0], self.beyond[1]);
        [a, b]
    }

    /// The mean over both sides across an axis.
    fn mean<T>(sides: [Option<DVec3>; 2], mut of: impl FnMut(DVec3, f64) -> T, mut add: impl FnMut(T, f64)) {
        let lengths = sides.map(|side| side.map_or(0.0, |side| side.abs().max_element()));
        for (side, length) in sides.into_iter().zip(lengths) {
            if let Some(side) = side {
                add(of(side, length), length / (lengths[0] + lengths[1]));
            }
        }
    }
}

impl Scene<'_> {
    /// Corrects what the edge rule makes of an edge for the part of its box that meets the conductor. `on_edge` are the
    /// spans of the edge, `others` working storage.
    pub(super) fn at_silhouette(
        &self,
        edge: usize,
        owners: [u16; 2],
        on_edge: &[(u16, Span)],
        others: &mut Vec<(u16, Span)>,
        breaks: &mut Vec<f64>,
        cut: Coupling,
    ) -> Coupling {
        let Edges::Lattice(lattice) = self.mesh.edges else { return cut };
        if owners.iter().all(|&owner| owner != NO_OBJECT) {
            return cut;
        }
        let Some(tube) = Tube::of(lattice, edge) else { return cut };
        let mut conductors = on_edge.iter().filter(|(object, _)| self.is_conductor(usize::from(*object)));
        match (conductors.next(), conductors.next()) {
            (Some(&(object, span)), None) => {
                let part = self.part_covered(&tube, usize::from(object), span);
                if part >= 1.0 {
                    return cut;
                }
                others.clear();
                others.extend(on_edge.iter().filter(|(object, _)| !self.is_conductor(usize::from(*object))));
                let background = self.mesh.permittivity.at(edge);
                let rule =
                    EdgeRule { owners: [NO_OBJECT; 2], spans: others, materials: self.materials, background };
                blend(cut, part, rule.coupling(breaks).through)
            }
            (None, _) if on_edge.is_empty() && owners == [NO_OBJECT; 2] => self.beside(&tube, cut),
            _ => cut,
        }
    }

    /// The part of a box around an edge that meets the conductor which the edge meets.
    fn part_covered(&self, tube: &Tube, object: usize, span: Span) -> f64 {
        let across = tube.sides.map(|sides| {
            let mut part = 0.0;
            let of_side = |side, _| self.covered_up_to(tube, object, span, side);
            Tube::mean(sides, of_side, |covered, share| part += share * covered);
            part
        });
        across[0].min(across[1]).min(1.0)
    }

    /// How far a conductor that an edge meets reaches towards a side of its box, in [0, 1].
    fn covered_up_to(&self, tube: &Tube, object: usize, span: Span, side: DVec3) -> f64 {
        let [a, b] = tube.extended(side);
        // A slanted face leaves the box at its end, and still is all across the field.
        let slanted = self.surfaces.span(object, a, b).map_or(0.0, |span| {
            let place = |t: f64| a[tube.axis] + t * (b[tube.axis] - a[tube.axis]);
            let over = |gap: f64, room: f64| if gap > 0.0 { gap / room } else { 0.0 };
            let (start, end) = (tube.from[tube.axis], tube.to[tube.axis]);
            let behind = over(place(span.enter) - end, tube.beyond[1] - end);
            let before = over(start - place(span.exit), start - tube.beyond[0]);
            (1.0 - behind.max(before)).max(0.0)
        });
        if slanted >= 1.0 {
            return 1.0;
        }
        let middle = tube.middle_of(span);
        let reach = self.surfaces.span(object, middle, middle + side).map_or(0.0, |span| span.exit);
        slanted.max(reach)
    }

    /// What conductors beside an edge that meets no object make of it.
    fn beside(&self, tube: &Tube, plain: Coupling) -> Coupling {
        let bounds = tube.bounds();
        let mut near = (0..self.bounds.len())
            .filter(|&object| self.is_conductor(object) && self.bounds[object].intersects(&bounds));
        let (Some(object), None) = (near.next(), near.next()) else { return plain };
        let mut most = Beside::default();
        for sides in tube.sides {
            let mut sum = Beside::default();
            let of_side = |side, width| self.beside_towards(tube, object, side, width);
            Tube::mean(sides, of_side, |beside: Beside, share| {
                sum.taken += share * beside.taken;
                (0..2).for_each(|end| sum.links[end] += share * beside.links[end]);
            });
            most.taken = most.taken.max(sum.taken);
            (0..2).for_each(|end| most.links[end] = most.links[end].max(sum.links[end]));
        }
        if most.links == [0.0; 2] {
            return plain;
        }
        let object = most.links.map(|link| if link > 0.0 { object as u16 } else { NO_OBJECT });
        Coupling { through: plain.through * (1.0 - most.taken), factor: most.links, object }
    }

    fn beside_towards(&self, tube: &Tube, object: usize, side: DVec3, width: f64) -> Beside {
        let Some((span, across)) = self.probe(tube, object, side) else { return Beside::default() };
        let distance = across.enter * width;
        let covered = across.exit - across.enter;
        let part = covered * cosine_squared((span.exit - span.enter) * tube.length, distance);
        let parts = [span.enter, 1.0 - span.exit];
        let taken = parts.map(|gap| part * cosine_squared(gap * tube.length, distance));
        let links = [0, 1].map(|end| taken[end] / parts[end].max(SMALLEST_PART));
        Beside { taken: taken[0].max(taken[1]), links }
    }

    /// What a conductor fills of the box between an edge and a side of it: the part along the edge, and across it. One
    /// that is too thin to reach the side is found where it passes an end of the edge.
    fn probe(&self, tube: &Tube, object: usize, side: DVec3) -> Option<(Span, Span)> {
        if let Some(along) = self.surfaces.span(object, tube.from + side, tube.to + side) {
            let middle = tube.middle_of(along);
            return Some((along, self.surfaces.span(object, middle, middle + side)?));
        }
        [tube.from, tube.to].into_iter().find_map(|end| {
            let across = self.surfaces.span(object, end, end + side)?;
            let offset = 0.5 * (across.enter + across.exit) * side;
            Some((self.surfaces.span(object, tube.from + offset, tube.to + offset)?, across))
        })
    }
}

/// What the edge rule makes of an edge to a part, and to the rest what is along it without the conductor.
fn blend(cut: Coupling, part: f64, without: f64) -> Coupling {
    let factor = cut.factor.map(|factor| part * factor);
    let object = [0, 1].map(|end| if factor[end] > 0.0 { cut.object[end] } else { NO_OBJECT });
    Coupling { through: part * cut.through + (1.0 - part) * without, factor, object }
}
