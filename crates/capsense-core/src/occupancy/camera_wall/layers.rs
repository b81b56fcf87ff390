//! Where bodies are along the rays through the nodes of a lattice.

use super::RAYS;
use super::dual_face::DualFace;
use crate::mesh::{Lattice, Planes};
use crate::occupancy::crossing::span_behind;
use crate::occupancy::index_set::IndexSet;
use crate::occupancy::{Scene, Span};

/// The faces of a body that a ray misses.
const MISSED: [f64; 2] = [f64::INFINITY, f64::NEG_INFINITY];

/// Where a body is along the ray through one end of an edge, from its front to its back, between the planes beside.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layer {
    pub(super) object: usize,
    pub(super) end: usize,
    pub(super) faces: [f64; 2],
}

/// Front and back of each object along the rays through each column of nodes: one ray is met by the edges of all planes.
#[derive(Clone, Debug, Default)]
pub(super) struct RayLayers {
    /// For each object, of each column.
    faces: Vec<Vec<[f64; 2]>>,
    /// Working storage: columns where something may differ.
    near: IndexSet,
}

impl RayLayers {
    /// Moves to the next frame, in which answers differ in boxes that some planes touch.
    pub(super) fn update(&mut self, scene: &Scene<'_>, lattice: &Lattice, regions: &[Planes]) {
        let columns = lattice.strides()[RAYS];
        if self.faces.len() != scene.bounds.len() {
            self.near = IndexSet::below(columns);
            self.faces.clear();
            self.faces.resize(scene.bounds.len(), vec![MISSED; columns]);
        }
        for [x, y, _] in regions {
            lattice.for_rows_of(&[x.clone(), y.clone(), 0..1], |columns| self.near.insert_all(columns));
        }
        let Self { faces, near, .. } = self;
        near.drain(|column| {
            for (object, faces) in faces.iter_mut().enumerate() {
                let found = scene.surfaces.layer_at(object, scene.mesh.nodes[column]);
                faces[column] = found.unwrap_or(MISSED);
            }
        });
    }

    /// Forgets all.
    pub(super) fn clear(&mut self) {
        self.faces.clear();
    }

    /// Collects the objects on an edge along the ray through a column of nodes, in the order in which they are listed, as if the edge
    /// had been asked for each.
    #[inline]
    pub(super) fn find_spans(&self, column: usize, depths: [f64; 2], spans: &mut Vec<(u16, Span)>) {
        spans.clear();
        for (object, faces) in self.faces.iter().enumerate() {
            let span = span_behind([faces[column]; 2], depths, [0.0, 1.0]);
            spans.extend(span.map(|span| (object as u16, span)));
        }
    }

    /// The object that is between the planes beside along one of two rays alone, if it is the only one there.
    #[inline]
    pub(super) fn only_one(&self, face: &DualFace, columns: [usize; 2]) -> Option<Layer> {
        let mut only = None;
        for (object, faces) in self.faces.iter().enumerate() {
            let are_met = columns.map(|column| face.has_between_planes(faces[column]));
            if are_met == [false; 2] {
                continue;
            }
            if are_met == [true; 2] || only.is_some() {
                return None;
            }
            only = Some((object, usize::from(are_met[1])));
        }
        let (object, end) = only?;
        Some(Layer { object, end, faces: face.clipped(self.faces[object][columns[end]]) })
    }
}
