//! Weak dielectrics on a lattice: the edge rule along parallel lines.
//!
//! An edge of a lattice carries the field of a box around it, up to half-way to its neighbours. The field of a strongly
//! polarisable body is normal to its surface, and the edge alone tells what is in series along it. A weak body lets most
//! of the field pass along its surface as well, where what is beside each other adds up. So there the edge's box is
//! taken as four lines side by side, one in each of the cells around the edge, through the middle of the quarter of the
//! box that lies in that cell: along each line the parts are capacitors in series, and the lines are parallel capacitors,
//! each with its quarter's share of the cross-section. This lies between the harmonic and the arithmetic mean over the
//! box, and where the surface is normal to the edge, or along it, it is the right one of these. Measured, with where it
//! ceases to be the better rule: `docs/interface.md`.
//!
//! Of strong dielectrics, only edges that lie exactly in a flat face are taken along lines: without, all the box of such an
//! edge would be outside, and a body that stands on electrodes would miss half of the field along its face.

use super::coupling::EdgeRule;
use super::{NO_OBJECT, Scene, Span, Surfaces};
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

fn is_weak(material: &Material) -> bool {
    matches!(material, Material::Dielectric(permittivity) if permittivity.value() < WEAK)
}

/// Whether a face of some strong dielectric may hold edges of a lattice.
pub(super) fn may_hold_edges(edges: &Edges, materials: &[Material], surfaces: &dyn Surfaces) -> bool {
    let is_strong = |material: &Material| matches!(material, Material::Dielectric(_)) && !is_weak(material);
    matches!(edges, Edges::Lattice(_)) && surfaces.are_exact() && materials.iter().any(is_strong)
}

/// Edges nearer to a face than this part of the lattice's size lie in it: far above rounding, far below any spacing.
const IN_FACE: f64 = 1e-9;

fn in_face_distance(lattice: &Lattice) -> f64 {
    let size = |planes: &Vec<f64>| planes[planes.len() - 1] - planes[0];
    IN_FACE * lattice.axes().iter().map(size).fold(0.0, f64::max)
}

/// A region up to the next planes of the lattice: edges whose lines touch the region touch this box.
pub(super) fn up_to_planes(edges: &Edges, region: &Aabb) -> Aabb {
    let Edges::Lattice(lattice) = edges else { return *region };
    let mut grown = *region;
    for (axis, planes) in lattice.axes().iter().enumerate() {
        let (low, high) = (region.min[axis], region.max[axis]);
        let below = planes.partition_point(|&plane| plane < low).checked_sub(1);
        grown.min[axis] = below.map_or(low, |below| planes[below]);
        let above = planes.partition_point(|&plane| plane <= high);
        grown.max[axis] = planes.get(above).copied().unwrap_or(high);
    }
    grown
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
        let is_weak = |&(object, _): &(u16, Span)| is_weak(&self.materials[usize::from(object)]);
        if owners != [NO_OBJECT; 2] || !on_edge.iter().all(is_weak) {
            return None;
        }
        let (mut sum, mut whole, mut is_met) = (0.0, 0.0, false);
        for (ends, share) in lines(lattice, edge) {
            self.find_spans_between(ends, spans);
            spans.retain(|(object, _)| !self.is_conductor(usize::from(*object)));
            if !spans.iter().all(is_weak) {
                return None;
            }
            is_met |= !spans.is_empty();
            let background = self.mesh.permittivity.at(edge);
            let rule = EdgeRule { owners, spans, materials: self.materials, background };
            sum += share * rule.coupling(breaks).through;
            whole += share;
        }
        (is_met && whole > 0.0).then(|| sum / whole)
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
        for ([start, _], share) in lines(lattice, edge) {
            let mut beside = DVec3::ZERO;
            across.into_iter().for_each(|axis| beside[axis] = distance.copysign((start - from)[axis]));
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

/// The lines that stand for an edge, by their ends, with the cross-section of each in square metres. At the rim of the
/// lattice there are fewer than four.
fn lines(lattice: &Lattice, edge: usize) -> impl Iterator<Item = ([DVec3; 2], f64)> {
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
        Some(([from + offset, to + offset], 0.25 * (first * second).abs()))
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn lines_share_the_box_around_an_edge() {
        let axes = [vec![0.0, 1.0, 3.0], vec![0.0, 2.0, 3.0, 7.0], vec![0.0, 1.0, 5.0]];
        let lattice = Lattice::new(axes).unwrap();
        let edge = |place, axis| 3 * lattice.node_index(place) + axis;
        let found: Vec<_> = lines(&lattice, edge([0, 2, 1], 0)).collect();
        let at = |x, y, z| DVec3::new(x, y, z);
        assert_eq!(found[0], ([at(0.0, 2.75, 0.75), at(1.0, 2.75, 0.75)], 0.25));
        assert_eq!(found[3], ([at(0.0, 4.0, 2.0), at(1.0, 4.0, 2.0)], 4.0));
        assert_eq!(found.iter().map(|(_, share)| share).sum::<f64>(), 2.5 * 2.5);
        let of_rim: Vec<_> = lines(&lattice, edge([0, 0, 1], 2)).collect();
        assert_eq!(of_rim, [([at(0.25, 0.5, 1.0), at(0.25, 0.5, 5.0)], 0.5)]);
        assert_eq!(lines(&lattice, edge([2, 0, 0], 0)).count(), 0, "there is no such edge");
    }

    #[test]
    fn boxes_grow_up_to_planes() {
        let axes = [vec![0.0, 1.0, 3.0], vec![0.0, 2.0, 3.0, 7.0], vec![0.0, 1.0, 5.0]];
        let edges = Edges::Lattice(Lattice::new(axes).unwrap());
        let region = Aabb { min: DVec3::new(1.0, 2.5, -2.0), max: DVec3::new(1.0, 2.6, 9.0) };
        let grown = up_to_planes(&edges, &region);
        assert_eq!(grown.min, DVec3::new(0.0, 2.0, -2.0));
        assert_eq!(grown.max, DVec3::new(3.0, 3.0, 9.0));
    }
}
