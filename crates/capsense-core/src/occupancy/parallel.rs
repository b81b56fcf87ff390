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

use super::coupling::EdgeRule;
use super::scene::is_electrode;
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
    /// Some fill all of it, the others nothing.
    Even,
    /// Perhaps in part.
    Uneven,
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
        let background = self.mesh.permittivity.at(edge);
        let quarters = quarters(lattice, edge);
        let boxes = quarters.clone().map(|(middle, offset, _)| around(middle, offset));
        let all = boxes.reduce(|a, b| Aabb { min: a.min.min(b.min), max: a.max.max(b.max) })?;
        match self.filling(&all) {
            Filling::None => return None,
            Filling::Even => {
                spans.clear();
                spans.extend_from_slice(on_edge);
                let rule = EdgeRule { owners, spans, materials: self.materials, background };
                return Some(rule.coupling(breaks).through);
            }
            Filling::Uneven => {}
        }
        let is_beside_electrode = self.is_beside_electrode(edge)?;
        let (mut sum, mut whole, mut is_met) = (0.0, 0.0, false);
        for (middle, offset, share) in quarters {
            whole += share;
            let places = match self.filling(&around(middle, offset)) {
                Filling::None => {
                    sum += share;
                    continue;
                }
                Filling::Even => &PLACES[..1],
                Filling::Uneven => &PLACES[..],
            };
            let (mut parallel, mut series) = (0.0, 0.0);
            for &place in places {
                let shift = DVec3::from_array(place_across(edge % 3, place)) * offset;
                self.find_spans_between(middle.map(|end| end + shift), spans);
                spans.retain(|(object, _)| !self.is_conductor(usize::from(*object)));
                if !spans.iter().all(is_weak) {
                    return None;
                }
                is_met |= !spans.is_empty();
                let rule = EdgeRule { owners, spans, materials: self.materials, background };
                let through = rule.coupling(breaks).through;
                (parallel, series) = (parallel + through, series + 1.0 / through);
            }
            let count = places.len() as f64;
            sum += share * if is_beside_electrode { count / series } else { parallel / count };
        }
        (is_met && whole > 0.0).then(|| sum / whole)
    }

    /// What is soon seen of how dielectrics fill a box.
    fn filling(&self, bounds: &Aabb) -> Filling {
        let (middle, half) = (0.5 * (bounds.min + bounds.max), 0.5 * bounds.size());
        let mut filling = Filling::None;
        for object in 0..self.bounds.len() {
            if self.is_conductor(object) || !self.bounds[object].intersects(bounds) {
                continue;
            }
            let frame = self.surfaces.frame(object);
            let (middle, half) = (frame.point(middle), frame.half_size_of(half));
            if self.surfaces.holds(object, middle, half) {
                filling = Filling::Even;
            } else if !self.surfaces.misses(object, middle, half) {
                return Filling::Uneven;
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

/// A place in a quarter as parts of half its widths, along the two axes across an edge, as a vector in the sensor frame.
fn place_across(axis: usize, place: [f64; 2]) -> [f64; 3] {
    let mut across = [0.0; 3];
    (across[(axis + 1) % 3], across[(axis + 2) % 3]) = (place[0], place[1]);
    across
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
