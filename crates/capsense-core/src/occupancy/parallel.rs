//! Weak dielectrics on a lattice: the edge rule along parallel lines.
//!
//! An edge of a lattice carries the field of a box around it, up to half-way to its neighbours. The field of a strongly
//! polarisable body is normal to its surface, and the edge alone tells what is in series along it. A weak body lets most
//! of the field pass along its surface as well, where what is beside each other adds up. So there the edge's box is
//! taken as sixteen lines side by side, four in each quarter of the box that lies in one of the cells around the edge: along each
//! line the parts are capacitors in series, and the lines are parallel capacitors, each with its share of the cross-section.
//! This lies between the harmonic and the arithmetic mean over the box, and where the surface is normal to the edge, or along
//! it, it is the right one of these. One line a quarter would do for cells small against the body; where they are not, it takes faces
//! to be up to a quarter of a cell from where they are.
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
//! Of strong dielectrics, only edges that lie exactly in a flat face are taken along lines: without, all the box of such an
//! edge would be outside, and a body that stands on electrodes would miss half of the field along its face.

mod quarter;

use super::coupling::{EdgeRule, past_one};
use super::scene::is_electrode;
use super::{LayersWithin, NO_OBJECT, Scene, Side, Span, Surfaces};
use crate::geometry::Aabb;
use crate::material::Material;
use crate::mesh::{Edges, Lattice};
use glam::DVec3;
use quarter::{BodyLines, LINES, Quarter, quarters};

/// Dielectrics below this relative permittivity are weak.
pub(super) const WEAK: f64 = 10.0;

/// Whether the rule is of use for some object.
pub(super) fn is_of_use(edges: &Edges, materials: &[Material]) -> bool {
    matches!(edges, Edges::Lattice(_)) && materials.iter().any(is_weak)
}

pub(super) fn is_weak(material: &Material) -> bool {
    matches!(material, Material::Dielectric(permittivity) if permittivity.value() < WEAK)
}

/// Whether a face of some strong dielectric may hold edges of a lattice.
pub(super) fn may_hold_edges(edges: &Edges, materials: &[Material], surfaces: &dyn Surfaces) -> bool {
    let is_strong = |material: &Material| matches!(material, Material::Dielectric(_)) && !is_weak(material);
    matches!(edges, Edges::Lattice(_)) && surfaces.are_exact() && materials.iter().any(is_strong)
}

/// Electrodes are across this axis.
const ELECTRODE_NORMAL: usize = 2;

/// Edges nearer to a face than this part of the lattice's size lie in it: far above rounding, far below any spacing.
const IN_FACE: f64 = 1e-9;

pub(super) fn in_face_distance(lattice: &Lattice) -> f64 {
    let size = |planes: &Vec<f64>| planes[planes.len() - 1] - planes[0];
    IN_FACE * lattice.axes().iter().map(size).fold(0.0, f64::max)
}

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

impl Scene<'_> {
    /// What multiplies the weight of an edge that weak dielectrics alone are near; `None` where nothing is, or others are, on
    /// the edge or along its lines. Conductors count where they are on the edge, which they end. `on_edge` are the spans of the edge,
    /// the others working storage.
    pub(super) fn along_lines(
        &self,
        edge: usize,
        owners: [u16; 2],
        on_edge: &[(u16, Span)],
        spans: &mut Vec<(u16, Span)>,
        breaks: &mut Vec<f64>,
    ) -> Option<f64> {
        let Edges::Lattice(lattice) = self.mesh.edges else { return None };
        if owners != [NO_OBJECT; 2] || !self.are_weak(on_edge) {
            return None;
        }
        let is_beside_electrode = self.is_beside_electrode(edge)?;
        let (mut sum, mut whole, mut is_met) = (0.0, 0.0, false);
        for quarter in quarters(lattice, edge) {
            let background = self.background_of(edge, &quarter);
            let through = match self.filling(&quarter.bounds()) {
                Filling::None => [1.0; LINES],
                Filling::Even(object) => [self.through(object, background, Span::WHOLE)?; LINES],
                Filling::Part(object, layers) => {
                    let lines = BodyLines::of(self.surfaces, object, &quarter, layers);
                    let mut through = [1.0; LINES];
                    for (line, through) in through.iter_mut().enumerate() {
                        if let Some(span) = lines.span(line) {
                            *through = self.through(object, background, span)?;
                        }
                    }
                    through
                }
                Filling::Parts => self.through_several(background, &quarter, spans, breaks)?,
            };
            is_met |= through != [1.0; LINES];
            let count = LINES as f64;
            let mean = if is_beside_electrode {
                count / through.into_iter().map(f64::recip).sum::<f64>()
            } else {
                through.into_iter().sum::<f64>() / count
            };
            let share = quarter.share * self.weight_of(background);
            (sum, whole) = (sum + share * mean, whole + share);
        }
        is_met.then(|| sum / whole)
    }

    /// The relative permittivity around a quarter without objects.
    fn background_of(&self, edge: usize, quarter: &Quarter) -> f64 {
        self.cells.map_or_else(|| self.mesh.permittivity.at(edge), |cells| cells.at(quarter.cell))
    }

    /// What a quarter with such a background weighs.
    fn weight_of(&self, background: f64) -> f64 {
        if self.cells.is_some() { background } else { 1.0 }
    }

    /// What multiplies the weights of the lines in a quarter that several dielectrics may be in; `None` where strong ones are on
    /// one of them.
    fn through_several(
        &self,
        background: f64,
        quarter: &Quarter,
        spans: &mut Vec<(u16, Span)>,
        breaks: &mut Vec<f64>,
    ) -> Option<[f64; LINES]> {
        let bounds = quarter.bounds();
        let mut through = [1.0; LINES];
        for (line, through) in through.iter_mut().enumerate() {
            spans.clear();
            for object in self.dielectrics_near(&bounds) {
                let span = BodyLines::of(self.surfaces, object, quarter, None).span(line);
                spans.extend(span.map(|span| (object as u16, span)));
            }
            if !self.are_weak(spans) {
                return None;
            }
            let rule = EdgeRule { owners: [NO_OBJECT; 2], spans, materials: self.materials, background };
            *through = rule.coupling(breaks).through;
        }
        Some(through)
    }

    /// Dielectrics that may be in a box.
    fn dielectrics_near(&self, bounds: &Aabb) -> impl Iterator<Item = usize> {
        let is_near = |&object: &usize| !self.is_conductor(object) && self.bounds[object].intersects(bounds);
        (0..self.bounds.len()).filter(is_near)
    }

    /// Whether all that is met are weak dielectrics.
    fn are_weak(&self, spans: &[(u16, Span)]) -> bool {
        spans.iter().all(|(object, _)| is_weak(&self.materials[usize::from(*object)]))
    }

    /// What multiplies the weight of a line of which a weak dielectric alone fills a part; `None` for all other objects.
    #[inline]
    fn through(&self, object: usize, background: f64, span: Span) -> Option<f64> {
        match self.materials[object] {
            Material::Dielectric(permittivity) if permittivity.value() < WEAK => {
                Some(past_one(span, permittivity.value() / background))
            }
            _ => None,
        }
    }

    /// What is soon seen of how dielectrics fill a box.
    fn filling(&self, bounds: &Aabb) -> Filling {
        let (middle, half) = (0.5 * (bounds.min + bounds.max), 0.5 * bounds.size());
        let mut filling = Filling::None;
        for object in self.dielectrics_near(bounds) {
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

    /// Whether an edge leads along an electrode or away from its rim; `None` if there is no such edge.
    fn is_beside_electrode(&self, edge: usize) -> Option<bool> {
        let ends = self.mesh.edges.ends(edge)?;
        let is_at_one = ends.into_iter().any(|node| is_electrode(self.mesh.terminals[node as usize]));
        Some(is_at_one && edge % 3 != ELECTRODE_NORMAL)
    }

    /// What multiplies the weight of an edge that lies in a face of a dielectric: the mean of what it would be a little to
    /// either side of it, since half of its box is on each; `None` for all other edges. Off such a face the edge rule
    /// goes on to take the edge as a whole.
    pub(super) fn in_face(
        &self,
        edge: usize,
        on_edge: &[(u16, Span)],
        spans: &mut Vec<(u16, Span)>,
        breaks: &mut Vec<f64>,
    ) -> Option<f64> {
        let Edges::Lattice(lattice) = self.mesh.edges else { return None };
        let is_met = |object: usize| on_edge.iter().any(|(met, _)| usize::from(*met) == object);
        let [from, to] = self.mesh.edges.ends(edge)?.map(|node| self.mesh.nodes[node as usize]);
        let distance = in_face_distance(lattice);
        let around = Aabb { min: from.min(to) - distance, max: from.max(to) + distance };
        let across = [(edge % 3 + 1) % 3, (edge % 3 + 2) % 3];
        let may_hold = |object: usize| {
            !self.is_conductor(object)
                && !is_met(object)
                && self.bounds[object].intersects(&around)
                && across.into_iter().any(|axis| self.surfaces.has_face_across(object, axis))
        };
        if !(0..self.bounds.len()).any(may_hold) {
            return None;
        }
        let (mut sum, mut whole, mut lies_in_one) = (0.0, 0.0, false);
        for quarter in quarters(lattice, edge) {
            let mut beside = DVec3::ZERO;
            across.into_iter().for_each(|axis| beside[axis] = distance.copysign(quarter.offset[axis]));
            self.find_spans_between([from + beside, to + beside], spans);
            if spans.iter().any(|(object, _)| self.is_conductor(usize::from(*object))) {
                return None;
            }
            lies_in_one |= spans.iter().any(|(object, _)| !is_met(usize::from(*object)));
            let background = self.background_of(edge, &quarter);
            let rule = EdgeRule { owners: [NO_OBJECT; 2], spans, materials: self.materials, background };
            let share = quarter.share * self.weight_of(background);
            sum += share * rule.coupling(breaks).through;
            whole += share;
        }
        lies_in_one.then(|| sum / whole)
    }
}
