//! Where bodies are along the rays through the nodes of a lattice.

use super::dual_face::DualFace;
use super::{RAYS, TASKS_OF_A_THREAD};
use crate::mesh::{Lattice, Planes};
use crate::occupancy::crossing::span_behind;
use crate::occupancy::index_set::IndexSet;
use crate::occupancy::{Scene, Span};
use crate::workers::Workers;
use std::ops::Range;

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
    objects: usize,
    /// Column by column those of all objects.
    faces: Vec<[f64; 2]>,
    /// Working storage: columns where something may differ.
    near: IndexSet,
}

impl RayLayers {
    /// Moves to the next frame, in which answers differ in boxes that some planes touch; threads share the columns.
    pub(super) fn update(
        &mut self,
        workers: &Workers,
        scene: &Scene<'_>,
        lattice: &Lattice,
        regions: &[Planes],
    ) {
        let (columns, objects) = (lattice.strides()[RAYS], scene.bounds.len());
        if self.objects != objects {
            self.near = IndexSet::below(columns);
            self.faces.clear();
            self.faces.resize(columns * objects, MISSED);
            self.objects = objects;
        }
        for [x, y, _] in regions {
            lattice.for_rows_of(&[x.clone(), y.clone(), 0..1], |columns| self.near.insert_all(columns));
        }
        let Self { faces, near, .. } = self;
        let (mut rest, mut next) = (&mut faces[..], 0);
        let parts = IndexSet::cut([near], workers.tasks(TASKS_OF_A_THREAD)).map(|part| {
            let first = std::mem::replace(&mut next, part.end().min(columns));
            let of_part = rest.split_off_mut(..(next - first) * objects).unwrap_or_default();
            (part, first, of_part)
        });
        workers.for_each(parts, |(part, first, of_part)| {
            part.drain_runs(|run| {
                let of_run = of_part[(run.start - first) * objects..].chunks_exact_mut(objects.max(1));
                for (of_column, column) in of_run.zip(run) {
                    for (object, faces) in of_column.iter_mut().enumerate() {
                        let found = scene.surfaces.layer_at(object, scene.mesh.nodes[column]);
                        *faces = found.unwrap_or(MISSED);
                    }
                }
            });
        });
    }

    /// Forgets all.
    pub(super) fn clear(&mut self) {
        self.faces.clear();
        self.objects = 0;
    }

    /// Those of all objects along the ray through a column of nodes, each with its number.
    #[inline]
    fn along(&self, column: usize) -> impl Iterator<Item = (usize, &[f64; 2])> {
        self.faces[column * self.objects..][..self.objects].iter().enumerate()
    }

    /// Collects the objects on an edge along the ray through a column of nodes, in the order in which they are listed, as if the edge
    /// had been asked for each.
    #[inline]
    pub(super) fn find_spans(&self, column: usize, depths: [f64; 2], spans: &mut Vec<(u16, Span)>) {
        spans.clear();
        for (object, &faces) in self.along(column) {
            let span = span_behind([faces; 2], depths, [0.0, 1.0]);
            spans.extend(span.map(|span| (object as u16, span)));
        }
    }

    /// From which of some successive columns, no more than a word has bits, edges along x and along y lead to one along whose ray other
    /// objects are between the planes beside. Edges lead on along x from the last of them, and along y from all, only if told so.
    #[inline]
    pub(super) fn differing(
        &self,
        face: &DualFace,
        columns: Range<usize>,
        leads_on: [bool; RAYS],
        row: usize,
    ) -> [u64; RAYS] {
        let (last, behind) = (columns.len() - 1, columns.end..columns.end + 1);
        let of_next_row = columns.start + row..columns.end + row;
        let mut differing = [0; RAYS];
        for object in 0..self.objects {
            let own = self.met(face, object, columns.clone());
            let next = if leads_on[0] { self.met(face, object, behind.clone()) } else { own >> last };
            differing[0] |= own ^ (own >> 1 | next << last);
            if leads_on[1] {
                differing[1] |= own ^ self.met(face, object, of_next_row.clone());
            }
        }
        differing
    }

    /// Along the rays through which of some successive columns an object is between the planes beside: bits, the lowest for the first.
    #[inline]
    fn met(&self, face: &DualFace, object: usize, columns: Range<usize>) -> u64 {
        let (mut met, mut at) = (0, columns.start * self.objects + object);
        for bit in 0..columns.len() {
            met |= u64::from(face.has_between_planes(self.faces[at])) << bit;
            at += self.objects;
        }
        met
    }

    /// The object that is between the planes beside along one of two rays alone, if it is the only one there.
    #[inline]
    pub(super) fn only_one(&self, face: &DualFace, columns: [usize; 2]) -> Option<Layer> {
        let mut only = None;
        for ((object, &first), (_, &second)) in self.along(columns[0]).zip(self.along(columns[1])) {
            let are_met = [first, second].map(|faces| face.has_between_planes(faces));
            if are_met == [false; 2] {
                continue;
            }
            if are_met == [true; 2] || only.is_some() {
                return None;
            }
            only = Some(if are_met[0] { (object, 0, first) } else { (object, 1, second) });
        }
        let (object, end, faces) = only?;
        Some(Layer { object, end, faces: face.clipped(faces) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Aabb;
    use glam::DVec3;

    /// Wherever an object is alone along one of two rays, the edge between them is marked, in rows of any length and from any column on.
    #[test]
    fn no_edge_is_passed_over_that_one_object_is_beside() {
        const COUNTS: [usize; 2] = [130, 4];
        const RUNS: [usize; 5] = [1, 2, 13, 63, 64];
        let domain = Aabb { min: DVec3::ZERO, max: DVec3::splat(1.0) };
        let lattice = Lattice::uniform(domain, [COUNTS[0] - 1, COUNTS[1] - 1, 4]).unwrap();
        let mut state = 1_u64;
        let mut noise = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / (1_u64 << 24) as f64
        };
        let mut found = 0;
        for objects in [1, 2, 3, 70] {
            let mut faces_of = |_| if noise() < 0.7 { MISSED } else { [noise(), 0.5 + noise()] };
            let faces = (0..COUNTS[0] * COUNTS[1] * objects).map(&mut faces_of).collect();
            let layers = RayLayers { objects, faces, near: IndexSet::default() };
            let faces_and_rows = (0..5).flat_map(|plane| (0..COUNTS[1]).map(move |row| (plane, row)));
            for (plane, row) in faces_and_rows {
                let face = DualFace::at(&lattice, plane);
                let runs = (0..COUNTS[0]).flat_map(|first| RUNS.map(|length| (first, first + length)));
                for (first, end) in runs.filter(|&(_, end)| end <= COUNTS[0]) {
                    let columns = row * COUNTS[0] + first..row * COUNTS[0] + end;
                    let leads_on = [end < COUNTS[0], row + 1 < COUNTS[1]];
                    let marked = layers.differing(&face, columns.clone(), leads_on, COUNTS[0]);
                    for (bit, column) in columns.enumerate() {
                        let beyond = [first + bit + 1 < COUNTS[0], row + 1 < COUNTS[1]];
                        for axis in (0..RAYS).filter(|&axis| beyond[axis]) {
                            let only = layers.only_one(&face, [column, column + [1, COUNTS[0]][axis]]);
                            let is_marked = marked[axis] >> bit & 1 != 0;
                            assert!(is_marked || only.is_none(), "{objects} {plane} {column} {axis}");
                            found += usize::from(only.is_some());
                        }
                    }
                }
            }
        }
        assert!(found > 1000, "{found}");
    }
}
