//! Dielectrics on a lattice: the edge rule along parallel lines.
//!
//! An edge of a lattice carries the field of a box around it, up to half-way to its neighbours. The edge alone tells what is in
//! series along it, but a dielectric lets the field pass along its surface as well, where what is beside each other adds up. So the edge's box is
//! taken as sixteen lines side by side, four in each quarter of the box that lies in one of the cells around the edge: along each
//! line the parts are capacitors in series, and the lines are parallel capacitors, each with its share of the cross-section.
//! This lies between the harmonic and the arithmetic mean over the box, and where the surface is normal to the edge, or along
//! it, it is the right one of these. One line a quarter would do for cells small against the body; where they are not, it takes faces
//! to be up to a quarter of a cell from where they are. A line stands for a bar that is a quarter of the quarter thick along either axis, and
//! solids tell what of these bars they fill ([`super::Bars`]), so that nothing jumps as a face passes a line.
//!
//! Quarters that are seen as a whole to be in a body or beside all need not be looked at line by line: the lines would tell the
//! same, to the bit, so that nobody has to look again when a quarter is seen as a whole no more.
//!
//! At an electrode, layers along it are in series, not in parallel: the field that an edge along the electrode's plane carries leaves
//! the electrode across them. There quarters count by the harmonic mean of their lines, and bodies closer to an electrode than the
//! first cell is high are not told to touch it. Measured, with where the rule ceases to be the better one: `docs/interface.md`.
//!
//! A quarter lies in one cell, and what a body there takes the place of is the background of that cell: around edges in the faces of a
//! board it is not the same in all four.
//!
//! What is different for strong dielectrics is in [`strong`]. Those that a camera sees are left to the edge rule and to
//! [`super::camera_wall`].

mod around;
mod lines;
mod one_face;
mod strong;

use super::coupling::EdgeRule;
use super::scene::is_electrode;
use super::{Fill, LayersWithin, NO_OBJECT, Scene, Side, Span, either, of_bars, smaller};
use crate::geometry::Aabb;
use crate::instructions::vectorised_by_eight;
use crate::material::Material;
use crate::mesh::Edges;
use around::{Around, QUARTERS, Quarter, Quarters};
use lines::{InFrame, LINES, Lines, Met};
use strong::PassedBy;

/// Dielectrics below this relative permittivity are weak.
pub(super) const WEAK: f64 = 10.0;

/// How far beside an edge of a lattice dielectrics count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Beside {
    /// Nowhere: only what is on the edge.
    #[default]
    Nowhere,
    /// Up to half-way to the next edges.
    HalfWay,
    /// Up to the next edges.
    ToNext,
}

/// How far beside edges these materials count.
pub(super) fn reach(edges: &Edges, materials: &[Material], are_exact: bool) -> Beside {
    let of_material = |material: &Material| match is_lined(material, are_exact) {
        true if is_weak(material) => Beside::HalfWay,
        true => Beside::ToNext,
        false => Beside::Nowhere,
    };
    let is_lattice = matches!(edges, Edges::Lattice(_));
    materials.iter().filter(|_| is_lattice).map(of_material).max().unwrap_or_default()
}

pub(super) fn is_weak(material: &Material) -> bool {
    matches!(material, Material::Dielectric(permittivity) if permittivity.value() < WEAK)
}

/// Whether a body of a material is taken along lines, if its surface is known exactly or not.
pub(super) fn is_lined(material: &Material, is_exact: bool) -> bool {
    is_weak(material) || is_exact && matches!(material, Material::Dielectric(_))
}

/// Electrodes are across this axis.
const ELECTRODE_NORMAL: usize = 2;

/// How dielectrics fill a part of space.
enum Filling {
    /// Not at all.
    None,
    /// This one fills all of it, as others may, and none a part.
    Even(usize),
    /// This one fills a part, perhaps, and no other is in it. Between which depths its surfaces are, if they are seen along z.
    Part(usize, Option<LayersWithin>),
    /// Several do.
    Parts,
}

/// Which dielectrics may be in a box.
enum Near {
    None,
    /// This one alone.
    One(usize),
    Several,
}

/// How what is side by side in an edge's box adds up: by weights, or beside electrodes by their reciprocals.
#[derive(Clone, Copy)]
struct SideBySide {
    are_in_series: bool,
}

impl SideBySide {
    /// What is added up of a weight, or the weight of such a sum.
    #[inline]
    fn counted(self, through: f64) -> f64 {
        if self.are_in_series { 1.0 / through } else { through }
    }

    /// What multiplies the weight of a quarter of whose lines a dielectric of some permittivity over the background's fills this.
    #[inline(always)]
    fn through_filled(self, fill: &Fill, ratio: f64, passed_by: PassedBy) -> f64 {
        let are_lines_alone = passed_by.are_lines_alone();
        let of_lines = of_bars(
            #[inline(always)]
            |line| {
                let (part, length) = (fill.part[line], fill.exit[line] - fill.enter[line]);
                let mut through = over_length(length, ratio);
                if !are_lines_alone {
                    through = passed_by.of_length(length).through_any(through);
                }
                (1.0 - part) + part * self.counted(through)
            },
        );
        self.counted(mean(of_lines))
    }
}

/// An edge that several dielectrics may be near, or some that a camera sees, and working storage.
struct Look<'a> {
    around: &'a Around,
    on_edge: &'a [(u16, Span)],
    lines: SideBySide,
    spans: &'a mut Vec<(u16, Span)>,
    breaks: &'a mut Vec<f64>,
}

/// What multiplies the weight of a line of which a dielectric fills so long a part, of such a permittivity over the background's.
#[inline(always)]
fn over_length(length: f64, ratio: f64) -> f64 {
    1.0 / ((1.0 - length) + length / ratio)
}

/// What lines tell of an edge.
#[derive(Clone, Copy, Debug)]
pub(super) struct ByLines {
    /// What multiplies its weight.
    pub(super) through: f64,
    /// Whether a dielectric on it is known to have no edge in the box around it, even one that reaches up to the next edges.
    pub(super) is_far_from_edges: bool,
}

impl ByLines {
    fn new(through: f64) -> Self {
        Self { through, is_far_from_edges: false }
    }
}

/// Of equal numbers exactly what they are.
#[inline(always)]
fn mean([a, b, c, d]: [f64; LINES]) -> f64 {
    0.25 * ((a + b) + (c + d))
}

impl Scene<'_> {
    /// What multiplies the weight of an edge that dielectrics alone are near, all of which are taken along lines; `None` where nothing is, or others
    /// are, on the edge or along its lines. Conductors count where they are on the edge, which they end. `on_edge` are the spans of the edge,
    /// the others working storage.
    pub(super) fn along_lines(
        &self,
        (edge, ends): (usize, [u32; 2]),
        owners: [u16; 2],
        on_edge: &[(u16, Span)],
        spans: &mut Vec<(u16, Span)>,
        breaks: &mut Vec<f64>,
    ) -> Option<ByLines> {
        let Edges::Lattice(lattice) = self.mesh.edges else { return None };
        if owners != [NO_OBJECT; 2] || !self.are_lined(on_edge) {
            return None;
        }
        let around = Around::edge(lattice, edge)?;
        let lines = self.side_by_side(edge, ends);
        match self.only_dielectric_near(around.bounds()) {
            Near::None => None,
            Near::One(object) if self.has_silhouettes => {
                self.along_alone((edge, lines), &around, object, on_edge)
            }
            Near::One(_) | Near::Several => {
                let mut look = Look { around: &around, on_edge, lines, spans, breaks };
                let quarters = around.quarters();
                self.mean_over_quarters(edge, &quarters, |quarter, background| {
                    self.through_some(&mut look, &quarters[quarter], background)
                })
                .map(ByLines::new)
            }
        }
    }

    /// The same of an edge that one solid alone is near.
    fn along_alone(
        &self,
        (edge, lines): (usize, SideBySide),
        around: &Around,
        object: usize,
        on_edge: &[(u16, Span)],
    ) -> Option<ByLines> {
        let body = self.in_frame(object, around);
        let quarters = || around.quarters();
        let through = match body.met() {
            Met::Nothing => None,
            Met::Inside => {
                let through_all = |_, background| self.through_all(object, background, lines);
                self.mean_over_quarters(edge, &quarters(), through_all)
            }
            Met::Faces(faces) => self.along_faces((edge, lines), (&body, faces), &quarters(), on_edge),
            Met::Surfaces => self.along_any((edge, lines), &body, &quarters(), on_edge),
        };
        let through = through?;
        Some(ByLines { through, is_far_from_edges: !on_edge.is_empty() && body.is_far_from_edges(around) })
    }

    /// An edge in the frame of an object.
    #[inline(always)]
    fn in_frame(&self, object: usize, around: &Around) -> InFrame<'_> {
        match self.fields[object].of_box() {
            Some((angles, half)) => InFrame::of(self.surfaces, (object, &angles.frame(), Some(half)), around),
            None => InFrame::of(self.surfaces, (object, &self.surfaces.frame(object), None), around),
        }
    }

    /// The same, whichever surfaces the body has near the edge.
    fn along_any(
        &self,
        (edge, lines): (usize, SideBySide),
        body: &InFrame<'_>,
        quarters: &Quarters,
        on_edge: &[(u16, Span)],
    ) -> Option<f64> {
        let mut fill = [Fill::WHOLE; QUARTERS];
        body.fill(quarters, &mut fill);
        vectorised_by_eight(
            #[inline(always)]
            || {
                self.mean_over_quarters(
                    edge,
                    quarters,
                    #[inline(always)]
                    |quarter, background| {
                        let body = body.lines(&quarters[quarter], None);
                        self.through_one(&body, &fill[quarter], background, on_edge, lines)
                    },
                )
            },
        )
    }

    /// What multiplies the weight of an edge whose quarters with their background's permittivity have such weights; `None` where all of them
    /// are as without objects.
    #[inline(always)]
    fn mean_over_quarters(
        &self,
        edge: usize,
        quarters: &[Quarter],
        mut through: impl FnMut(usize, f64) -> Option<f64>,
    ) -> Option<f64> {
        let of_edge = if self.cells.is_none() { self.mesh.permittivity.at(edge) } else { 1.0 };
        let (mut sum, mut whole, mut is_met) = (0.0, 0.0, false);
        for (number, quarter) in quarters.iter().enumerate() {
            // The relative permittivity around it without objects, which is what it weighs where quarters may differ in it.
            let (background, weight) = match self.cells {
                Some(cells) => (cells.at(quarter.cell), cells.at(quarter.cell)),
                None => (of_edge, 1.0),
            };
            let through = through(number, background)?;
            is_met |= through != 1.0;
            let share = quarter.share * weight;
            (sum, whole) = (sum + share * through, whole + share);
        }
        is_met.then(|| sum / whole)
    }

    /// What multiplies the weight of a quarter that one dielectric may be in; `None` where it is, and is not taken along lines.
    #[inline(always)]
    fn through_one(
        &self,
        body: &Lines<'_>,
        fill: &Fill,
        background: f64,
        on_edge: &[(u16, Span)],
        lines: SideBySide,
    ) -> Option<f64> {
        if fill.part == Fill::NOTHING.part {
            return Some(1.0);
        }
        let ratio = self.ratio(body.object(), background)?;
        Some(lines.through_filled(fill, ratio, self.passed_by(body, fill, on_edge, background)))
    }

    /// The same of a quarter that it fills.
    #[inline]
    fn through_all(&self, object: usize, background: f64, lines: SideBySide) -> Option<f64> {
        let through = over_length(1.0, self.ratio(object, background)?);
        Some(lines.counted(lines.counted(through)))
    }

    /// The same of a quarter that several may be in, or one that a camera sees.
    fn through_some(&self, look: &mut Look<'_>, quarter: &Quarter, background: f64) -> Option<f64> {
        let Look { around, on_edge, lines, .. } = *look;
        match self.filling(&around.bounds_of(quarter)) {
            Filling::None => Some(1.0),
            Filling::Even(object) => self.through_all(object, background, lines),
            Filling::Part(object, layers) => {
                let body = self.in_frame(object, around);
                let body = body.lines(quarter, layers);
                let fill = body.fill();
                vectorised_by_eight(
                    #[inline(always)]
                    || self.through_one(&body, &fill, background, on_edge, lines),
                )
            }
            Filling::Parts => self.through_several(look, quarter, background),
        }
    }

    /// What multiplies the weight of a quarter that several dielectrics may be in; `None` where others than those taken along
    /// lines are on one of them.
    fn through_several(&self, look: &mut Look<'_>, quarter: &Quarter, background: f64) -> Option<f64> {
        let Look { around, on_edge, lines, ref mut spans, ref mut breaks } = *look;
        let bounds = around.bounds_of(quarter);
        let mut of_lines = [0.0; LINES];
        for (line, of_line) in of_lines.iter_mut().enumerate() {
            // What fills more of a line's cross-section is all around what fills less of it.
            let mut rest = 1.0;
            while rest > 0.0 {
                spans.clear();
                let (mut next, mut passed_by) = (0.0f64, PassedBy::LINES_ALONE);
                for object in self.dielectrics_near(bounds) {
                    let body = self.in_frame(object, around);
                    let body = body.lines(quarter, None);
                    let fill = body.fill();
                    let Some((part, span)) = fill.of(line) else { continue };
                    if part < rest {
                        next = next.max(part);
                        continue;
                    }
                    spans.push((object as u16, span));
                    let other = self.passed_by(&body, &fill, on_edge, background);
                    passed_by = passed_by.and(other.of_length(span.exit - span.enter));
                }
                if !self.are_lined(spans) {
                    return None;
                }
                let through = if let &[(object, Span { enter, exit })] = &spans[..] {
                    // As if it were alone, to the bit.
                    over_length(exit - enter, self.ratio(usize::from(object), background)?)
                } else {
                    let owners = [NO_OBJECT; 2];
                    EdgeRule { owners, spans, materials: self.materials, background }.coupling(breaks).through
                };
                *of_line += (rest - next) * lines.counted(passed_by.through(through));
                rest = next;
            }
        }
        Some(lines.counted(mean(of_lines)))
    }

    /// Dielectrics that may be in a box.
    fn dielectrics_near(&self, bounds: Aabb) -> impl Iterator<Item = usize> {
        let is_near =
            move |&object: &usize| !self.is_conductor(object) && self.bounds[object].intersects(&bounds);
        (0..self.bounds.len()).filter(is_near)
    }

    /// Whether one dielectric alone may be in a box, and which.
    #[inline]
    fn only_dielectric_near(&self, bounds: Aabb) -> Near {
        let mut near = Near::None;
        for (object, of_object) in self.bounds.iter().enumerate() {
            if of_object.intersects(&bounds) && !self.is_conductor(object) {
                match near {
                    Near::None => near = Near::One(object),
                    _ => return Near::Several,
                }
            }
        }
        near
    }

    /// Whether all that is met are dielectrics that are taken along lines.
    fn are_lined(&self, spans: &[(u16, Span)]) -> bool {
        spans.iter().all(|(object, _)| self.is_lined(usize::from(*object)))
    }

    fn is_lined(&self, object: usize) -> bool {
        // Lines are on lattices alone.
        is_lined(&self.materials[object], self.has_silhouettes)
    }

    /// The permittivity of a dielectric over the background's; `None` for objects that are not taken along lines.
    #[inline]
    fn ratio(&self, object: usize, background: f64) -> Option<f64> {
        match self.materials[object] {
            Material::Dielectric(permittivity) if self.is_lined(object) => {
                Some(permittivity.value() / background)
            }
            _ => None,
        }
    }

    /// What is soon seen of how dielectrics fill a box.
    fn filling(&self, bounds: &Aabb) -> Filling {
        let (middle, half) = (0.5 * (bounds.min + bounds.max), 0.5 * bounds.size());
        let mut filling = Filling::None;
        for object in self.dielectrics_near(*bounds) {
            let layers = self.surfaces.layers_within(object, bounds);
            let side = match layers {
                Some(layers) => layers.side_of([bounds.min.z, bounds.max.z]),
                None => {
                    let frame = self.surfaces.frame(object);
                    self.surfaces.side_of(object, frame.point(middle), frame.half_size_of(half))
                }
            };
            filling = match (side, filling) {
                (Some(Side::Outside), filling) => filling,
                (Some(Side::Inside), Filling::None) => Filling::Even(object),
                (Some(Side::Inside), Filling::Even(first)) => Filling::Even(first),
                (None, Filling::None) => Filling::Part(object, layers),
                _ => return Filling::Parts,
            }
        }
        filling
    }

    /// How lines beside an edge add up: in series if it leads along an electrode or away from its rim.
    #[inline]
    fn side_by_side(&self, edge: usize, ends: [u32; 2]) -> SideBySide {
        let is_at_one = ends.into_iter().any(|node| is_electrode(self.mesh.terminals[node as usize]));
        SideBySide { are_in_series: is_at_one && edge % 3 != ELECTRODE_NORMAL }
    }
}
