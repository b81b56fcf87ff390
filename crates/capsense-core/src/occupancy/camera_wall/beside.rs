//! Where a body that a camera sees has a wall along the rays beside an edge, and what that leaves of the edge.

use super::dual_face::{DualFace, Past, Wall};
use super::layers::Layer;
use super::ways::{EdgeAcross, Ways};
use crate::material::Material;
use crate::occupancy::parallel::is_weak;
use crate::occupancy::{LayerWay, SMALLEST_PART, Scene};
use glam::DVec3;

/// A face that rises or falls by this much, or more, from the pixel at a wall to the next one slants: there is no wall. With half of
/// it the wall counts in full.
const STEEPEST: f64 = 0.15;

/// What the wall of a body leaves of an edge across the rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BesideWall {
    pub(super) object: u16,
    /// The end of the edge whose ray meets the body, and whether it is under or behind that, not between its faces.
    pub(super) end: u8,
    pub(super) is_under: bool,
    pub(super) past: Past,
}

impl Scene<'_> {
    /// What the wall of a body leaves of an edge across the rays, if it has one where it is along the ray through one end.
    pub(super) fn beside_wall(
        &self,
        ways: &mut Ways,
        face: &DualFace,
        edge: EdgeAcross,
        layer: &Layer,
    ) -> Option<BesideWall> {
        let past = self.past(ways, edge, face, layer)?;
        let is_under = face.distance_to(layer.faces) > 0.0;
        Some(BesideWall { object: layer.object as u16, end: layer.end as u8, is_under, past })
    }

    /// How much less field there is in an object than around an edge, in parts of the latter; `None` if it is weak, or has more.
    fn contrast(&self, object: usize, edge: usize) -> Option<f64> {
        match &self.materials[object] {
            Material::Conductor(_) => Some(1.0),
            material if is_weak(material) => None,
            Material::Dielectric(permittivity) => {
                Some(1.0 - self.mesh.permittivity.at(edge) / permittivity.value())
                    .filter(|&contrast| contrast > 0.0)
            }
        }
    }

    /// What is left of an edge whose one end's ray meets a body.
    fn past(&self, ways: &mut Ways, edge: EdgeAcross, face: &DualFace, layer: &Layer) -> Option<Past> {
        let &Layer { object, end, faces } = layer;
        let contrast = self.contrast(object, edge.number)?;
        // In a dielectric without nodes nothing is there for taps to lead to.
        if !self.is_conductor(object) && face.distance_to(faces) > 0.0 && face.is_around(faces) {
            return None;
        }
        let ends = self.mesh.edges.ends_of_existing(edge.number);
        let points = [ends[1 - end], ends[end]].map(|node| self.mesh.nodes[node as usize]);
        let way = ways.of(edge.pair(), layer, || self.surfaces.way_between(object, points[0], points[1]));
        Some(face.past(&self.wall_between(object, way, face, faces, points)?, faces, contrast))
    }

    /// Where the wall is, half-way between the faces, from the first point to the second.
    fn wall_between(
        &self,
        object: usize,
        way: Option<&LayerWay>,
        face: &DualFace,
        faces: [f64; 2],
        points: [DVec3; 2],
    ) -> Option<Wall> {
        let middle = 0.5 * (faces[0] + faces[1]);
        let [from, to] = points.map(|point| DVec3 { z: middle, ..point });
        let found = match way.and_then(|way| Some((way, way.span_at(middle)?))) {
            Some((way, span)) => way.wall_before(span, face.planes)?,
            None => self.surfaces.wall_between(object, from, to, face.planes)?,
        };
        let outside = found.enter.max(SMALLEST_PART);
        let abruptness = (2.0 - 2.0 / STEEPEST * found.slope).clamp(0.0, 1.0);
        // At the end behind it, rounding tells whether there is a wall.
        if outside > 1.0 - SMALLEST_PART || abruptness == 0.0 {
            return None;
        }
        let length = from.distance(to);
        Some(Wall { outside: outside * length, behind: (1.0 - outside) * length, abruptness })
    }
}
