//! Edges of a lattice of whose dual face a conductor covers a part: where its silhouette, seen along the edge, passes.
//!
//! The field along an edge is that of a box around it, up to half-way to its neighbours. A conductor that the edge meets
//! need not be met by all of the box, and one that passes beside the edge may be met by a part of it. Were the edge alone
//! to tell, then all of the box would change at once when a wall along the edge passes it, and the capacitance with it.
//! So where a part f of the box meets the conductor, edges are what the edge rule makes of them to this part, and to the
//! other what they are without it. f is told by rays across the edge to the middles of the box's sides.
//!
//! Where the edge itself passes by, its ends are linked to what of the conductor is beside it, along the shortest way from
//! each end. A face links an end below it only up to half an edge behind a wall, where links to the next end fade in. So
//! all is continuous when faces pass the planes of nodes, walls pass edges, and edges of boxes run along nodes.
//!
//! At its own edges a conductor collects more than the part of a box that meets it would: the field there grows with
//! r^(-1/3) at a right angle. So it is taken to reach further by [`FRINGE`].
//!
//! Boxes and cylinders tell where their edges are, and within cells smaller than themselves [`super::near_field`] does better.
//! This is for triangle meshes, for thin bodies, and where edges end.
//!
//! All this is for walls along the edge, which end a face abruptly. Where a face merely slants or bends, the edge rule by
//! itself is of second order, and stays. What tells the two apart is whether the conductor is as wide at the face as it is
//! deeper inside. Where a conductor has no edge near, nothing is asked.

use super::coupling::{EdgeRule, SMALLEST_PART};
use super::near_field::{Star, larger, smaller, span_in_box};
use super::{Coupling, Frame, NO_OBJECT, Scene, Span, Surfaces};
use crate::geometry::Aabb;
use glam::{DMat3, DVec3};

/// How much further than it does a conductor is taken to reach across an edge, in parts of the longer one of the edge and
/// of the way to the next node across. With it the energy of the field r^(2/3) sin(2θ/3) around a right angle is right in
/// the mean over all places of the angle's vertex in a cell, which `tests/suite/fringe.rs` holds triangle meshes to: in a prototype cells one,
/// two and three times as long as wide asked for 0.10, 0.08 and 0.07. A sheet much thinner than a cell asked for 0.1 to 0.3.
const FRINGE: f64 = 0.09;

/// An edge ends at a face of a dielectric as a whole if so much of it is outside.
const OUTSIDE: f64 = 0.25;

/// One of the two axes across an edge.
#[derive(Clone, Copy)]
struct Across {
    axis: usize,
    /// The width of the box below and above the edge; zero at the wall.
    widths: [f64; 2],
    /// How much further than it does a conductor is taken to reach.
    fringe: f64,
}

/// The box around an edge of a lattice.
struct Tube {
    from: DVec3,
    to: DVec3,
    length: f64,
    across: [Across; 2],
}

/// A conductor in its own frame.
trait Body {
    /// The part of a way from a point that is in it.
    fn span(&self, from: DVec3, way: DVec3) -> Option<Span>;

    /// Whether it is soon seen that it misses all of a box about a point, of some half size.
    fn misses(&self, middle: DVec3, half: DVec3) -> bool;
}

/// Any body.
struct AnyBody<'a> {
    surfaces: &'a dyn Surfaces,
    object: usize,
}

impl Body for AnyBody<'_> {
    fn span(&self, from: DVec3, way: DVec3) -> Option<Span> {
        self.surfaces.span_in_frame(self.object, from, from + way)
    }

    fn misses(&self, middle: DVec3, half: DVec3) -> bool {
        self.surfaces.misses(self.object, middle, half)
    }
}

/// A box about the origin, by half its edge lengths: the body that is asked for most, and soonest told.
struct BoxBody(DVec3);

impl Body for BoxBody {
    #[inline(always)]
    fn span(&self, from: DVec3, way: DVec3) -> Option<Span> {
        span_in_box(self.0, from, from + way)
    }

    #[inline(always)]
    fn misses(&self, middle: DVec3, half: DVec3) -> bool {
        (middle.abs() - half).cmpge(self.0).any()
    }
}

/// The box around an edge in the frame of a body: the edge's start, the way along it, and the axes across it.
struct Framed<'a, B> {
    tube: &'a Tube,
    body: B,
    from: DVec3,
    way: DVec3,
    across: [DVec3; 2],
}

/// What a conductor beside an edge makes of it.
#[derive(Clone, Copy, Default)]
struct Beside {
    /// The part of the box that the conductor takes from the edge.
    taken: f64,
    links: [f64; 2],
}

/// The same for one end, if all of the box were covered.
struct EndBeside {
    taken: f64,
    link: f64,
}

impl Tube {
    /// That around the edge from a node along an axis.
    #[inline(always)]
    fn of(star: &Star<'_>, axis: usize) -> Option<Self> {
        let (from, [_, length]) = (star.place(), star.ways(axis));
        if length == 0.0 {
            return None;
        }
        let mut to = from;
        to[axis] = star.next(axis);
        let across = |axis: usize| {
            let widths = star.ways(axis).map(|way| 0.5 * way);
            // No further than to the next node: up to there what changed is looked for.
            let most = 0.5 * star.narrowest(axis);
            Across { axis, widths, fringe: smaller(FRINGE * larger(length, star.width(axis)), most) }
        };
        Some(Self { from, to, length, across: [across((axis + 1) % 3), across((axis + 2) % 3)] })
    }

    /// All from where a conductor reaches the box.
    #[inline(always)]
    fn bounds(&self) -> Aabb {
        let (mut min, mut max) = (self.from, self.to);
        for Across { axis, widths, fringe } in self.across {
            min[axis] -= widths[0] + fringe;
            max[axis] += widths[1] + fringe;
        }
        Aabb { min, max }
    }

    /// The same in the frame of an object.
    #[inline(always)]
    fn in_frame<B: Body>(&self, body: B, frame: &Frame) -> Framed<'_, B> {
        let Self { from, length, across, .. } = self;
        let DMat3 { x_axis, y_axis, z_axis } = frame.object_from_sensor;
        // The axes in a cycle, of which each is across the one before.
        let (along, across) = match across[0].axis {
            1 => (x_axis, [y_axis, z_axis]),
            2 => (y_axis, [z_axis, x_axis]),
            _ => (z_axis, [x_axis, y_axis]),
        };
        Framed { tube: self, body, from: frame.point(*from), way: along * *length, across }
    }

    /// What a conductor beside the edge makes of one end of it. `gaps` are the parts of the edge between this end and the
    /// conductor, and between that and the other end; `away` is how far the wall is, in parts of the box's width on that side.
    #[inline(always)]
    fn link_beside(&self, gaps: [f64; 2], distance: f64, away: f64) -> EndBeside {
        let over = |along: f64| {
            let along = along * self.length;
            let way = (distance * distance + along * along).sqrt();
            self.length / way.max(SMALLEST_PART * self.length)
        };
        let [gap, _] = gaps;
        if gap > 0.0 {
            // As the wall comes to the edge, this becomes what the edge rule makes of it.
            let near = |part: f64| if part < 1.0 { part / (part + (1.0 - part) * away) } else { 1.0 };
            let fading = near(2.0 * (1.0 - gap));
            EndBeside { taken: fading * near(4.0 * gap), link: fading * over(gap) }
        } else {
            let length = 1.0 - gaps[1];
            EndBeside { taken: 0.0, link: (1.0 - 2.0 * length).max(0.0) * over(length) }
        }
    }
}

impl<B: Body> Framed<'_, B> {
    /// A point of a span of the edge.
    #[inline(always)]
    fn point_in(&self, span: Span, part: f64) -> DVec3 {
        self.from + (span.enter + part * (span.exit - span.enter)) * self.way
    }

    /// From the edge to the middle of a side of its box, that below (0) or above (1) along one of the axes across it; `None` at
    /// the wall.
    #[inline(always)]
    fn side(&self, across: usize, number: usize) -> Option<DVec3> {
        let width = self.tube.across[across].widths[number];
        let side = if number == 0 { -width } else { width } * self.across[across];
        (width > 0.0).then_some(side)
    }

    /// The part of a box around an edge that meets the conductor which the edge meets.
    #[inline(always)]
    fn part_covered(&self, span: Span) -> f64 {
        let mut least = 1.0_f64;
        for (number, across) in self.tube.across.iter().enumerate() {
            let mut covered = 0.0;
            for (side, width) in across.widths.into_iter().enumerate() {
                let Some(side) = self.side(number, side) else { continue };
                let reach = self.width_across(self.point_in(span, 0.5), side);
                let missing = (width * (1.0 - reach) - across.fringe).max(0.0);
                covered += width;
                if missing > 0.0 {
                    covered -= missing * self.abruptness(span, side, reach);
                }
            }
            least = least.min(covered / across.width());
        }
        least
    }

    /// How much of a ray a conductor fills.
    #[inline(always)]
    fn width_across(&self, from: DVec3, ray: DVec3) -> f64 {
        self.body.span(from, ray).map_or(0.0, |span| span.exit - span.enter)
    }

    /// Whether the face of a conductor ends at a wall along the edge: one if the conductor is as wide close to the face as
    /// in the `middle` of what the edge meets of it, zero if it is half as wide.
    #[inline(always)]
    fn abruptness(&self, span: Span, ray: DVec3, middle: f64) -> f64 {
        let mut narrowest = middle;
        for (is_face, part) in [(span.enter > 0.0, 0.1), (span.exit < 1.0, 0.9)] {
            if is_face {
                narrowest = narrowest.min(self.width_across(self.point_in(span, part), ray));
            }
        }
        if middle > 0.0 { (2.5 * narrowest / middle - 1.25).clamp(0.0, 1.0) } else { 1.0 }
    }

    /// What the conductor beside the edge makes of it.
    #[inline(always)]
    fn beside(&self) -> Beside {
        let mut most = Beside::default();
        for across in 0..2 {
            let mut sum = Beside::default();
            for number in 0..2 {
                let beside = self.beside_towards(across, number);
                sum.taken += beside.taken;
                (0..2).for_each(|end| sum.links[end] += beside.links[end]);
            }
            most.taken = most.taken.max(sum.taken.min(1.0));
            (0..2).for_each(|end| most.links[end] = most.links[end].max(sum.links[end]));
        }
        most
    }

    #[inline(always)]
    fn beside_towards(&self, number: usize, side: usize) -> Beside {
        let (tube, across) = (self.tube, &self.tube.across[number]);
        let Some(ray) = self.side(number, side) else { return Beside::default() };
        let width = across.widths[side];
        let reach = 1.0 + across.fringe / width;
        let ray = reach * ray;
        let (middle, half) = (self.from + 0.5 * (self.way + ray), 0.5 * (self.way.abs() + ray.abs()));
        if self.body.misses(middle, half) {
            return Beside::default();
        }
        let Some((span, found, middle)) = self.probe(ray) else { return Beside::default() };
        let place = |part: f64| part * reach * width;
        let distance = place(found.enter);
        // Near the edge the fringe fills some of the box behind it.
        let start = (distance - across.fringe).max(-across.widths[1 - side]);
        let covered = (place(found.exit).min(width) - start).max(0.0) / across.width();
        if covered == 0.0 {
            return Beside::default();
        }
        let part = covered * self.abruptness(span, ray, middle);
        let [before, behind] = [span.enter, 1.0 - span.exit];
        let away = (distance / width).clamp(0.0, 1.0);
        let from = tube.link_beside([before, behind], distance, away);
        let to = tube.link_beside([behind, before], distance, away);
        Beside { taken: part * from.taken.max(to.taken), links: [part * from.link, part * to.link] }
    }

    /// What a conductor fills of the box between an edge and a side of it: the part along the edge, and across it, and how
    /// much it fills of a ray in the middle of the former. One that is too thin to reach the side is found where it passes
    /// an end of the edge.
    #[inline(always)]
    fn probe(&self, ray: DVec3) -> Option<(Span, Span, f64)> {
        let &Framed { ref body, from, way, .. } = self;
        if let Some(along) = body.span(from + ray, way) {
            let across = body.span(self.point_in(along, 0.5), ray)?;
            return Some((along, across, across.exit - across.enter));
        }
        for end in [from, from + way] {
            let Some(across) = body.span(end, ray) else { continue };
            let offset = 0.5 * (across.enter + across.exit) * ray;
            if let Some(along) = body.span(from + offset, way) {
                return Some((along, across, self.width_across(self.point_in(along, 0.5), ray)));
            }
        }
        None
    }
}

impl Across {
    #[inline(always)]
    fn width(&self) -> f64 {
        self.widths[0] + self.widths[1]
    }
}

impl Scene<'_> {
    /// Whether an object has an edge in a box.
    #[inline(always)]
    pub(super) fn has_edge_in(&self, object: usize, bounds: &Aabb) -> bool {
        match self.fields[object].of_box() {
            Some((angles, half)) => angles.has_edge_of_box_in(half, bounds),
            None => self.bounds[object].intersects(bounds) && self.surfaces.has_edge_in(object, bounds),
        }
    }

    /// Corrects what the edge rule makes of an edge for the part of its box that meets the conductor. `on_edge` are the
    /// spans of the edge, `star` what is around its first node, `others` working storage.
    #[inline(always)]
    pub(super) fn at_silhouette(
        &self,
        (edge, star): (usize, &Star<'_>),
        owners: [u16; 2],
        on_edge: &[(u16, Span)],
        others: &mut Vec<(u16, Span)>,
        breaks: &mut Vec<f64>,
        cut: Coupling,
    ) -> Coupling {
        if owners.iter().all(|&owner| owner != NO_OBJECT) {
            return cut;
        }
        let Some(tube) = Tube::of(star, edge % 3) else { return cut };
        let mut conductors = on_edge.iter().filter(|(object, _)| self.is_conductor(usize::from(*object)));
        match (conductors.next(), conductors.next()) {
            (Some(&(object, span)), None) if self.has_edge_in(object.into(), &tube.bounds()) => {
                let part = self.part_covered(&tube, object.into(), span);
                if part >= 1.0 {
                    return cut;
                }
                others.clear();
                // Mostly there is none, and the look for them is a call.
                if on_edge.len() > 1 {
                    let is_other = |(object, _): &&(u16, Span)| !self.is_conductor(usize::from(*object));
                    others.extend(on_edge.iter().filter(is_other));
                }
                let background = self.mesh.permittivity.at(edge);
                let rule =
                    EdgeRule { owners: [NO_OBJECT; 2], spans: others, materials: self.materials, background };
                blend(cut, part, rule.coupling(breaks).through)
            }
            (None, _) if on_edge.is_empty() && owners == [NO_OBJECT; 2] => self.beside(&tube, cut),
            _ => cut,
        }
    }

    /// What the edge rule makes of an edge to the part of its box that meets one of the dielectrics on it, and to the other what is along it
    /// without that one. `star` is what is around its first node, `others` and `breaks` working storage.
    #[inline(always)]
    pub(super) fn past_walls(
        &self,
        (edge, star): (usize, &Star<'_>),
        on_edge: &[(u16, Span)],
        number: usize,
        others: &mut Vec<(u16, Span)>,
        breaks: &mut Vec<f64>,
    ) -> f64 {
        let background = self.mesh.permittivity.at(edge);
        let mut through = |all_but: Option<usize>| {
            others.clear();
            let is_left = |(at, _): &(usize, _)| Some(*at) != all_but;
            others.extend(on_edge.iter().enumerate().filter(is_left).map(|(_, span)| *span));
            let rule =
                EdgeRule { owners: [NO_OBJECT; 2], spans: others, materials: self.materials, background };
            rule.coupling(breaks).through
        };
        let (cut, (object, span)) = (through(None), on_edge[number]);
        let has_edge = |tube: &Tube| self.has_edge_in(object.into(), &tube.bounds());
        let Some(mut tube) = Tube::of(star, edge % 3).filter(has_edge) else { return cut };
        // Fields are strong where faces end, not along walls within.
        let outside = ((1.0 - (span.exit - span.enter)) / OUTSIDE).min(1.0);
        tube.across.iter_mut().for_each(|across| across.fringe *= outside);
        let part = self.part_covered(&tube, object.into(), span);
        if part >= 1.0 { cut } else { part * cut + (1.0 - part) * through(Some(number)) }
    }

    /// The part of a box around an edge that meets the body which the edge meets.
    #[inline(always)]
    fn part_covered(&self, tube: &Tube, object: usize, span: Span) -> f64 {
        match self.fields[object].of_box() {
            Some((angles, half)) => tube.in_frame(BoxBody(half), &angles.frame()).part_covered(span),
            None => tube.in_frame(self.any_body(object), &self.surfaces.frame(object)).part_covered(span),
        }
    }

    fn any_body(&self, object: usize) -> AnyBody<'_> {
        AnyBody { surfaces: self.surfaces, object }
    }

    /// What conductors beside an edge that meets no object make of it.
    #[inline(always)]
    fn beside(&self, tube: &Tube, plain: Coupling) -> Coupling {
        let bounds = tube.bounds();
        let mut near = (0..self.bounds.len())
            .filter(|&object| self.is_conductor(object) && self.bounds[object].intersects(&bounds));
        let (Some(object), None) = (near.next(), near.next()) else { return plain };
        if !self.has_edge_in(object, &bounds) {
            return plain;
        }
        let most = match self.fields[object].of_box() {
            Some((angles, half)) => tube.in_frame(BoxBody(half), &angles.frame()).beside(),
            None => tube.in_frame(self.any_body(object), &self.surfaces.frame(object)).beside(),
        };
        if most.links == [0.0; 2] {
            return plain;
        }
        let object = most.links.map(|link| if link > 0.0 { object as u16 } else { NO_OBJECT });
        Coupling { through: plain.through * (1.0 - most.taken), factor: most.links, object }
    }
}

/// What the edge rule makes of an edge to a part, and to the rest what is along it without the conductor.
fn blend(cut: Coupling, part: f64, without: f64) -> Coupling {
    let scaled = cut.scaled(part);
    let object = [0, 1].map(|end| if scaled.factor[end] > 0.0 { cut.object[end] } else { NO_OBJECT });
    Coupling { through: scaled.through + (1.0 - part) * without, object, ..scaled }
}
