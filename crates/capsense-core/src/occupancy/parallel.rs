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
//! At an electrode, layers along it are in series, not in parallel: the field that an edge along the electrode's plane carries leaves
//! the electrode across them. There quarters count by the harmonic mean of their lines, and bodies closer to an electrode than the
//! first cell is high are not told to touch it. Measured, with where the rule ceases to be the better one: `docs/interface.md`.
//!
//! Of strong dielectrics, only edges that lie exactly in a flat face are taken along lines: without, all the box of such an
//! edge would be outside, and a body that stands on electrodes would miss half of the field along its face.

use super::coupling::{EdgeRule, past_one};
use super::scene::is_electrode;
use super::{Frame, LayersWithin, NO_OBJECT, Scene, Side, Span, Surfaces};
use crate::geometry::Aabb;
use crate::material::Material;
use crate::mesh::{Edges, Lattice};
use glam::DVec3;

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

/// Where lines pass a quarter, in parts of half its widths from its middle. Along either axis each is at a place of its own,
/// so that a face across an axis is known to an eighth of the quarter's width, and places along one axis tell nothing of those
/// along the other.
const PLACES: [[f64; 2]; 4] = [[-0.75, -0.25], [-0.25, 0.75], [0.25, -0.75], [0.75, 0.25]];

/// Electrodes are across this axis.
const ELECTRODE_NORMAL: usize = 2;

/// Edges nearer to a face than this part of the lattice's size lie in it: far above rounding, far below any spacing.
const IN_FACE: f64 = 1e-9;

fn in_face_distance(lattice: &Lattice) -> f64 {
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

/// A dielectric that is the only one in a quarter.
struct OnlyBody<'a> {
    surfaces: &'a dyn Surfaces,
    object: usize,
    /// Its permittivity over that of the background.
    ratio: f64,
    frame: Frame,
    /// Between which depths its surfaces are seen in all of the quarter, if they are seen along z.
    layers: Option<LayersWithin>,
}

impl OnlyBody<'_> {
    /// What multiplies the weight of a line.
    #[inline]
    fn through(&self, [from, to]: [DVec3; 2]) -> f64 {
        let heights = [from.z.min(to.z), from.z.max(to.z)];
        let span = match self.layers.and_then(|layers| layers.side_of(heights)) {
            Some(Side::Outside) => None,
            Some(Side::Inside) => Some(Span::WHOLE),
            None => {
                self.surfaces.span_in_frame(self.object, self.frame.point(from), self.frame.point(to))
            }
        };
        span.map_or(1.0, |span| past_one(span, self.ratio))
    }
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
        let quarters = quarters(lattice, edge);
        let is_beside_electrode = self.is_beside_electrode(edge)?;
        // Of quarters that are alike nothing is summed up: rounding must not tell whether lines were looked at one by one.
        let (mut sum, mut whole, mut least, mut most) = (0.0, 0.0, f64::INFINITY, 0.0_f64);
        for (middle, offset, share) in quarters {
            let through = match self.filling(&around(middle, offset)) {
                Filling::None => [1.0; PLACES.len()],
                Filling::Even(object) => [self.through_weak(object, edge)?; PLACES.len()],
                Filling::Part(object, layers) => {
                    let body = self.only_body(object, edge, layers);
                    let through = lines(middle, offset, edge % 3).map(|line| body.through(line));
                    if through != [1.0; PLACES.len()] && !is_weak(&self.materials[object]) {
                        return None;
                    }
                    through
                }
                Filling::Parts => {
                    let mut through = [1.0; PLACES.len()];
                    for (through, line) in through.iter_mut().zip(lines(middle, offset, edge % 3)) {
                        *through = self.through_several(edge, line, spans, breaks)?;
                    }
                    through
                }
            };
            least = through.into_iter().fold(least, f64::min);
            most = through.into_iter().fold(most, f64::max);
            whole += share;
            let count = PLACES.len() as f64;
            sum += share
                * match is_beside_electrode {
                    true => count / through.into_iter().map(f64::recip).sum::<f64>(),
                    false => through.into_iter().sum::<f64>() / count,
                };
        }
        match least == most {
            true => (most != 1.0).then_some(most),
            false => Some(sum / whole),
        }
    }

    /// What multiplies the weight of a line that several dielectrics may be on; `None` where strong ones are.
    fn through_several(
        &self,
        edge: usize,
        line: [DVec3; 2],
        spans: &mut Vec<(u16, Span)>,
        breaks: &mut Vec<f64>,
    ) -> Option<f64> {
        self.find_spans_between(line, spans);
        spans.retain(|(object, _)| !self.is_conductor(usize::from(*object)));
        let are_weak = self.are_weak(spans);
        let background = self.mesh.permittivity.at(edge);
        let rule = EdgeRule { owners: [NO_OBJECT; 2], spans, materials: self.materials, background };
        are_weak.then(|| rule.coupling(breaks).through)
    }

    /// Whether all that is met are weak dielectrics.
    fn are_weak(&self, spans: &[(u16, Span)]) -> bool {
        spans.iter().all(|(object, _)| is_weak(&self.materials[usize::from(*object)]))
    }

    /// What multiplies the weight of an edge in a weak dielectric; `None` for all other objects.
    fn through_weak(&self, object: usize, edge: usize) -> Option<f64> {
        is_weak(&self.materials[object]).then(|| past_one(Span::WHOLE, self.ratio(object, edge)))
    }

    /// The permittivity of a dielectric over that of the background at an edge.
    fn ratio(&self, object: usize, edge: usize) -> f64 {
        match self.materials[object] {
            Material::Dielectric(permittivity) => permittivity.value() / self.mesh.permittivity.at(edge),
            Material::Conductor(_) => f64::INFINITY,
        }
    }

    fn only_body(&self, object: usize, edge: usize, layers: Option<LayersWithin>) -> OnlyBody<'_> {
        OnlyBody {
            surfaces: self.surfaces,
            object,
            ratio: self.ratio(object, edge),
            frame: self.surfaces.frame(object),
            layers,
        }
    }

    /// What is soon seen of how dielectrics fill a box.
    fn filling(&self, bounds: &Aabb) -> Filling {
        let (middle, half) = (0.5 * (bounds.min + bounds.max), 0.5 * bounds.size());
        let mut filling = Filling::None;
        for object in 0..self.bounds.len() {
            if self.is_conductor(object) || !self.bounds[object].intersects(bounds) {
                continue;
            }
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
        for (_, offset, share) in quarters(lattice, edge) {
            let mut beside = DVec3::ZERO;
            across.into_iter().for_each(|axis| beside[axis] = distance.copysign(offset[axis]));
            self.find_spans_between([from + beside, to + beside], spans);
            if spans.iter().any(|(object, _)| self.is_conductor(usize::from(*object))) {
                return None;
            }
            lies_in_one |= spans.iter().any(|(object, _)| !is_met(usize::from(*object)));
            let background = self.mesh.permittivity.at(edge);
            let rule = EdgeRule { owners: [NO_OBJECT; 2], spans, materials: self.materials, background };
            sum += share * rule.coupling(breaks).through;
            whole += share;
        }
        lies_in_one.then(|| sum / whole)
    }
}

/// The lines in a quarter of the box around an edge along an axis, given by the line through its middle and the way there from the
/// edge.
fn lines(middle: [DVec3; 2], offset: DVec3, axis: usize) -> [[DVec3; 2]; PLACES.len()] {
    PLACES.map(|place| {
        let mut shift = DVec3::ZERO;
        for (part, across) in place.into_iter().zip([(axis + 1) % 3, (axis + 2) % 3]) {
            shift[across] = part * offset[across];
        }
        middle.map(|end| end + shift)
    })
}

/// The four quarters of the box around an edge, each in one of the cells around it: the line through its middle by its
/// ends, the way from the edge to that line, and the area of the cross-section in square metres. At the rim of the lattice
/// there are fewer than four.
fn quarters(lattice: &Lattice, edge: usize) -> impl Iterator<Item = ([DVec3; 2], DVec3, f64)> + Clone {
    let (node, axis) = (edge / 3, edge % 3);
    let place = lattice.node_place(node);
    let planes = lattice.axes();
    let from = DVec3::from_array(std::array::from_fn(|axis| planes[axis][place[axis]]));
    let to = planes[axis].get(place[axis] + 1).map(|&end| {
        let mut to = from;
        to[axis] = end;
        to
    });
    let across = [(axis + 1) % 3, (axis + 2) % 3];
    // The steps to the neighbours below and above, across the edge.
    let steps = across.map(|axis| {
        let to = |other: Option<usize>| {
            other.and_then(|other| planes[axis].get(other)).map(|plane| plane - from[axis])
        };
        [to(place[axis].checked_sub(1)), to(Some(place[axis] + 1))]
    });
    let pairs = [[0, 0], [0, 1], [1, 0], [1, 1]].map(|[first, second]| (steps[0][first], steps[1][second]));
    pairs.into_iter().filter_map(move |pair| {
        let ((Some(first), Some(second)), Some(to)) = (pair, to) else { return None };
        let mut offset = DVec3::ZERO;
        offset[across[0]] = 0.25 * first;
        offset[across[1]] = 0.25 * second;
        Some(([from + offset, to + offset], offset, 0.25 * (first * second).abs()))
    })
}

/// A quarter, given by the line through its middle and the way there from the edge.
fn around([from, to]: [DVec3; 2], offset: DVec3) -> Aabb {
    let half = offset.abs();
    Aabb { min: from.min(to) - half, max: from.max(to) + half }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn quarters_share_the_box_around_an_edge() {
        let axes = [vec![0.0, 1.0, 3.0], vec![0.0, 2.0, 3.0, 7.0], vec![0.0, 1.0, 5.0]];
        let lattice = Lattice::new(axes).unwrap();
        let edge = |place, axis| 3 * lattice.node_index(place) + axis;
        let found: Vec<_> = quarters(&lattice, edge([0, 2, 1], 0)).collect();
        let at = |x, y, z| DVec3::new(x, y, z);
        assert_eq!(found[0], ([at(0.0, 2.75, 0.75), at(1.0, 2.75, 0.75)], at(0.0, -0.25, -0.25), 0.25));
        assert_eq!(found[3], ([at(0.0, 4.0, 2.0), at(1.0, 4.0, 2.0)], at(0.0, 1.0, 1.0), 4.0));
        assert_eq!(found.iter().map(|(_, _, share)| share).sum::<f64>(), 2.5 * 2.5);
        let of_rim: Vec<_> = quarters(&lattice, edge([0, 0, 1], 2)).collect();
        assert_eq!(of_rim, [([at(0.25, 0.5, 1.0), at(0.25, 0.5, 5.0)], at(0.25, 0.5, 0.0), 0.5)]);
        assert_eq!(quarters(&lattice, edge([2, 0, 0], 0)).count(), 0, "there is no such edge");
    }
}
