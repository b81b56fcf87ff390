//! Dielectrics on a lattice: the edge rule along parallel lines.
//!
//! An edge of a lattice carries the field of a box around it, up to half-way to its neighbours. The edge alone tells what is in
//! series along it, but a dielectric lets the field pass along its surface as well, where what is beside each other adds up. So the edge's box is
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
//! What is different for strong dielectrics is in [`strong`]. Those that a camera sees are left to the edge rule and to
//! [`super::camera_wall`].

mod quarter;
mod strong;

use super::coupling::{EdgeRule, past_one};
use super::scene::is_electrode;
use super::{LayersWithin, NO_OBJECT, Scene, Side, Span};
use crate::geometry::Aabb;
use crate::material::Material;
use crate::mesh::Edges;
use quarter::{BodyLines, LINES, Quarter, quarters};
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

impl Scene<'_> {
    /// What multiplies the weight of an edge that dielectrics alone are near, all of which are taken along lines; `None` where nothing is, or others
    /// are, on the edge or along its lines. Conductors count where they are on the edge, which they end. `on_edge` are the spans of the edge,
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
        if owners != [NO_OBJECT; 2] || !self.are_lined(on_edge) {
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
                    let found = lines.spans();
                    let passed_by = self.passed_by(&lines, &found, on_edge, background);
                    let mut through = [1.0; LINES];
                    for (span, through) in found.into_iter().zip(&mut through) {
                        if let Some(span) = span {
                            *through =
                                passed_by.of_line(span).through(self.through(object, background, span)?);
                        }
                    }
                    through
                }
                Filling::Parts => self.through_several(background, &quarter, on_edge, spans, breaks)?,
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

    /// What multiplies the weights of the lines in a quarter that several dielectrics may be in; `None` where others than those taken along
    /// lines are on one of them.
    fn through_several(
        &self,
        background: f64,
        quarter: &Quarter,
        on_edge: &[(u16, Span)],
        spans: &mut Vec<(u16, Span)>,
        breaks: &mut Vec<f64>,
    ) -> Option<[f64; LINES]> {
        let bounds = quarter.bounds();
        let mut through = [1.0; LINES];
        for (line, through) in through.iter_mut().enumerate() {
            spans.clear();
            let mut passed_by = PassedBy::LINES_ALONE;
            for object in self.dielectrics_near(&bounds) {
                let lines = BodyLines::of(self.surfaces, object, quarter, None);
                if let Some(span) = lines.span(line) {
                    spans.push((object as u16, span));
                    let other = self.passed_by(&lines, &lines.spans(), on_edge, background);
                    passed_by = passed_by.and(other.of_line(span));
                }
            }
            if !self.are_lined(spans) {
                return None;
            }
            let rule = EdgeRule { owners: [NO_OBJECT; 2], spans, materials: self.materials, background };
            *through = passed_by.through(rule.coupling(breaks).through);
        }
        Some(through)
    }

    /// Dielectrics that may be in a box.
    fn dielectrics_near(&self, bounds: &Aabb) -> impl Iterator<Item = usize> {
        let is_near = |&object: &usize| !self.is_conductor(object) && self.bounds[object].intersects(bounds);
        (0..self.bounds.len()).filter(is_near)
    }

    /// Whether all that is met are dielectrics that are taken along lines.
    fn are_lined(&self, spans: &[(u16, Span)]) -> bool {
        spans.iter().all(|(object, _)| self.is_lined(usize::from(*object)))
    }

    fn is_lined(&self, object: usize) -> bool {
        is_lined(&self.materials[object], self.surfaces.are_exact())
    }

    /// What multiplies the weight of a line of which a dielectric alone fills a part; `None` for objects that are not taken along lines.
    #[inline]
    fn through(&self, object: usize, background: f64, span: Span) -> Option<f64> {
        match self.materials[object] {
            Material::Dielectric(permittivity) if self.is_lined(object) => {
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
}
