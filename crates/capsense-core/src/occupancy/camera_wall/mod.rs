//! Edges of a lattice across a depth camera's rays past the wall of a body that conducts or polarises strongly, where its image ends
//! or jumps: one end's ray meets the body between the planes beside, the other's does not. Where surfaces slant or bend, the edge rule
//! by itself is of second order, and stays: a wall counts the less the more the faces that end there rise or fall behind it.
//!
//! The field along an edge is that of its dual face, up to half-way to the planes before and behind. The camera knows how much of
//! that the body fills: from its front to its back, where it is seen. To this part the edge ends at the wall, to the rest it is
//! what it is without. Were the edge alone to tell, all of the dual face would change at once when a face passes the plane of the
//! edge, and the capacitance with it.
//!
//! Where a face lies before or behind the plane, the end under it is free. What is filled of the dual face leads past the edge between face
//! and wall to the body, along the shortest way, and the less the nearer the wall is to that end in relation to the face. No edge of
//! the lattice leads there, so it goes by the end under the face: that has a share s of the other end's potential in the field around a
//! right angle, r^(2/3) sin(2θ/3), so a link g is g / (1 - s) between the ends, and a tap of g / s from there on, through the face,
//! beside what the edge along the rays is. In that field this is the same, and where fields differ a little from it the energy is of
//! second order. Nothing is asked of what holds the body, so strong dielectrics become floating conductors as their permittivity grows.
//!
//! What a part of the dual face that is not filled carries is between the other end and the space under the face. The potential
//! there is neither zero, as that of an end which the body holds, nor soon that of an end which it just released. So what it is half-way
//! to the face in that field, in relation to that at the other end, is taken from the link.
//!
//! At its own edges a body collects more than the part of a dual face that meets it would, so it is taken to reach further by
//! [`FRINGE`]. This is [`super::silhouette`] for who knows where surfaces are along one axis alone.

mod beside;
mod dual_face;
mod layers;
mod walls;
mod ways;

use super::coupling::SMALLEST_PART;
use super::index_set::IndexSet;
use super::parallel::is_weak;
use super::{Coupling, NO_OBJECT, Scene, Span, Surfaces};
use crate::material::Material;
use crate::mesh::{Edges, Lattice, Planes};
use crate::sensor::FREE;
use crate::workers::Workers;
use beside::BesideWall;
use dual_face::DualFace;
use layers::RayLayers;
use std::ops::Range;
use walls::Walls;
pub(super) use walls::{Cut, OnEdge};
use ways::{EdgeAcross, Ways};

/// Cameras look along this axis.
pub(super) const RAYS: usize = 2;

/// So many tasks for each thread, as some take longer and some threads come later.
const TASKS_OF_A_THREAD: usize = 4;

/// Whether the rule is of use.
pub(super) fn is_of_use(edges: &Edges, materials: &[Material], surfaces: &dyn Surfaces) -> bool {
    let are_strong = materials.iter().any(|material| !is_weak(material));
    surfaces.has_layers() && matches!(edges, Edges::Lattice(_)) && are_strong
}

/// What walls leave of the edges across a camera's rays, for each edge beside one.
#[derive(Clone, Debug, Default)]
pub(super) struct CameraWalls {
    of_edges: Walls,
    layers: RayLayers,
    /// Working storage: nodes beside which something may differ, and what was found there.
    near: IndexSet,
    found: Vec<Found>,
}

/// What a task found: edges of which walls leave something else than before, and those to be coupled anew for that.
#[derive(Clone, Debug, Default)]
struct Found {
    ways: Ways,
    walls: Vec<(u32, Option<BesideWall>)>,
    anew: Vec<usize>,
}

impl CameraWalls {
    /// None, on a mesh of so many nodes and edges.
    pub(super) fn below(nodes: usize, edges: usize) -> Self {
        Self { of_edges: Walls::below(edges), near: IndexSet::below(nodes), ..Self::default() }
    }

    /// Moves to the next frame, in which answers differ in boxes that some planes touch. What becomes of edges there is yet to be found.
    pub(super) fn start(&mut self, workers: &Workers, scene: &Scene<'_>, regions: &[Planes]) {
        let Edges::Lattice(lattice) = scene.mesh.edges else { return };
        if scene.has_camera_walls {
            self.layers.update(workers, scene, lattice, regions);
            for planes in regions {
                // Of edges across the rays that touch a box, the first ends are before it.
                let starts = lattice.up_to_next(planes, [true; 3], [false, false, true]);
                lattice.for_rows_of(&starts, |nodes| self.near.insert_all(nodes));
            }
        }
    }

    /// Has threads find out what becomes of these edges. Visits those that are to be coupled anew as other walls are beside them, if that
    /// matters to them.
    pub(super) fn finish(
        &mut self,
        workers: &Workers,
        scene: &Scene<'_>,
        matters: impl Fn(usize) -> bool + Sync,
        mut visit: impl FnMut(usize),
    ) {
        let Edges::Lattice(lattice) = scene.mesh.edges else { return };
        let Self { of_edges, layers, near, found } = self;
        if !scene.has_camera_walls {
            layers.clear();
            of_edges.drain(|edge, wall| {
                for_edges_of(lattice, edge, [Some(wall), None], |edge| {
                    if matters(edge) {
                        visit(edge)
                    }
                });
            });
            return;
        }
        found.resize_with(workers.tasks(TASKS_OF_A_THREAD), Found::default);
        let tasks = IndexSet::cut([near], found.len()).zip(&mut *found);
        let of_edges_before = &*of_edges;
        workers.for_each(tasks, |(part, Found { ways, walls, anew })| {
            ways.start(lattice.strides()[RAYS]);
            part.drain_runs(|nodes| {
                for_edges_beside(lattice, (layers, of_edges_before), nodes, |across, face| {
                    let edge = across.number;
                    let layer = layers.only_one(face, across.columns);
                    let before = of_edges_before.get(edge);
                    let now = layer.and_then(|layer| scene.beside_wall(ways, face, across, &layer));
                    if before != now.as_ref() {
                        walls.push((edge as u32, now));
                        let beside = [before, now.as_ref()];
                        for_edges_of(lattice, edge, beside, |edge| {
                            anew.extend(matters(edge).then_some(edge))
                        });
                    }
                });
            });
        });
        of_edges.take(found.iter_mut().flat_map(|found| found.walls.drain(..)));
        found.iter_mut().flat_map(|found| found.anew.drain(..)).for_each(visit);
    }

    /// Collects the objects that an edge passes through, in the order in which they are listed. What is on the rays is known.
    #[inline]
    pub(super) fn find_spans(
        &self,
        scene: &Scene<'_>,
        (edge, ends): (usize, [u32; 2]),
        spans: &mut Vec<(u16, Span)>,
    ) {
        match scene.mesh.edges {
            Edges::Lattice(lattice) if scene.has_camera_walls && edge % 3 == RAYS => {
                let depths = ends.map(|node| scene.mesh.nodes[node as usize].z);
                let column = ends[0] % lattice.strides()[RAYS] as u32;
                self.layers.find_spans(column as usize, depths, spans);
            }
            _ => scene.find_spans(ends, spans),
        }
    }

    /// What is kept of how surfaces cut an edge across the rays when they last may have cut it another way.
    #[inline]
    pub(super) fn cut_before(&self, scene: &Scene<'_>, edge: usize) -> Option<&Cut> {
        // What lines tell of an edge is not kept.
        if scene.has_camera_walls && !scene.has_lines { self.of_edges.cut(edge) } else { None }
    }

    /// How surfaces cut an edge, if that is to be kept: across the rays beside a wall, for what the wall leaves may soon be another though
    /// surfaces cut the edge as before. What touches an electrode is looked for anew.
    #[inline]
    pub(super) fn cut_to_keep(
        &self,
        scene: &Scene<'_>,
        (edge, ends): (usize, [u32; 2]),
        spans: &[(u16, Span)],
        coupling: Coupling,
    ) -> Option<Cut> {
        let is_kept = edge % 3 != RAYS && self.of_edges.may_have(edge) && !scene.is_at_electrode(ends);
        is_kept.then(|| Cut { coupling, edge: edge as u32, on_edge: OnEdge::of(spans) })
    }

    /// Of no more edges it may be kept how surfaces cut them.
    pub(super) fn most_cuts(&self) -> usize {
        self.of_edges.places()
    }

    /// Keeps how surfaces cut some edges.
    pub(super) fn keep(&mut self, cuts: impl Iterator<Item = Cut>) {
        cuts.for_each(|cut| self.of_edges.keep(cut));
    }

    /// Corrects what the edge rule makes of an edge for walls of a body that are along the rays: beside an edge across these, and around
    /// an end of one along them. `on_edge` are the spans of the edge, `held` tells the conductors that hold nodes. Where other objects
    /// are as well, the edge rule stays.
    #[inline]
    pub(super) fn correct(
        &self,
        scene: &Scene<'_>,
        (edge, ends): (usize, [u32; 2]),
        held: &[u16],
        on_edge: &[(u16, Span)],
        cut: Coupling,
    ) -> Coupling {
        match (edge % 3 == RAYS, on_edge) {
            (false, _) => self.past_wall(scene, (edge, ends), OnEdge::of(on_edge), cut),
            (true, &[(object, span)]) => {
                self.under_walls(scene, (edge, ends), held, (object.into(), span), cut)
            }
            (true, _) => cut,
        }
    }

    /// An edge across the rays.
    #[inline]
    pub(super) fn past_wall(
        &self,
        scene: &Scene<'_>,
        (edge, ends): (usize, [u32; 2]),
        on_edge: OnEdge,
        cut: Coupling,
    ) -> Coupling {
        let Some(beside) = self.of_edges.get(edge) else { return cut };
        let is_alone = match on_edge {
            OnEdge::Nothing => true,
            // Where the end is under a face, but the body is on the edge, surfaces slant.
            OnEdge::One(object) => !beside.is_under && object == beside.object,
            OnEdge::Several => false,
        };
        // An electrode in the body is linked to it as before.
        if !is_alone || scene.mesh.terminals[ends[usize::from(beside.end)] as usize] != FREE {
            return cut;
        }
        let past = &beside.past;
        Coupling::only_through(cut.through + past.abruptness * (past.through - cut.through))
    }

    /// An edge along the rays through the face of a body, and perhaps through that behind it: taps of edges past walls beside its ends
    /// are beside what is left of it.
    fn under_walls(
        &self,
        scene: &Scene<'_>,
        (edge, ends): (usize, [u32; 2]),
        held: &[u16],
        (object, span): (usize, Span),
        cut: Coupling,
    ) -> Coupling {
        // By how much the link from an end is more, and the rest of the edge shorter.
        let under = |end: usize, gap: f64| {
            let [node, behind] = [ends[end] as usize, ends[1 - end] as usize];
            if gap <= 0.0 || held[node] != NO_OBJECT || scene.mesh.terminals[node] != FREE {
                return [1.0, 0.0];
            }
            let gap = if scene.is_conductor(object) { gap.max(SMALLEST_PART) } else { gap };
            let more = gap * self.taps(scene, edge, [node, behind], held, object);
            if usize::from(cut.object[end]) == object {
                [1.0 + more, 0.0]
            } else {
                [1.0, gap * more / (1.0 + more)]
            }
        };
        let [[first, shorter], [second, also_shorter]] = [under(0, span.enter), under(1, 1.0 - span.exit)];
        let shorter = shorter + also_shorter;
        let is_shorter = shorter > 0.0 && shorter * cut.through < 1.0;
        let through = if is_shorter { cut.through / (1.0 - shorter * cut.through) } else { cut.through };
        Coupling { through, factor: [first * cut.factor[0], second * cut.factor[1]], object: cut.object }
    }

    /// The taps of the edges across the rays at a node under the face of an object, in parts of the weight of the edge that leads through
    /// the face.
    fn taps(
        &self,
        scene: &Scene<'_>,
        edge: usize,
        [node, behind]: [usize; 2],
        held: &[u16],
        object: usize,
    ) -> f64 {
        let Edges::Lattice(lattice) = scene.mesh.edges else { return 0.0 };
        // What holds the next node behind the face reaches that one: there is no wall between.
        let reaches = |node: usize| held.get(node).is_some_and(|&holder| usize::from(holder) == object);
        let strides = &lattice.strides()[..RAYS];
        if strides.iter().all(|stride| reaches(behind.wrapping_sub(*stride)) && reaches(behind + stride)) {
            return 0.0;
        }
        let tap = |across: usize, end: usize| {
            let beside = self.of_edges.get(across)?;
            let is_of_face = (usize::from(beside.object), usize::from(beside.end)) == (object, end);
            is_of_face.then_some(beside.past.abruptness * beside.past.tap)
        };
        let permittivity = |edge| scene.mesh.permittivity.at(edge);
        let place = lattice.node_place(node);
        let mut sum = 0.0;
        for axis in 0..RAYS {
            let (planes, stride, at) = (&lattice.axes()[axis], lattice.strides()[axis], place[axis]);
            let ends = [at.saturating_sub(1), (at + 1).min(planes.len() - 1)];
            for (end, &to) in ends.iter().enumerate().filter(|(_, to)| **to != at) {
                let across = 3 * node.min(node + to * stride - at * stride) + axis;
                let Some(tap) = tap(across, 1 - end) else { continue };
                let length = (planes[to] - planes[at]).abs();
                let width = 0.5 * (planes[ends[1]] - planes[ends[0]]);
                let height = (scene.mesh.nodes[behind].z - scene.mesh.nodes[node].z).abs();
                let heights = DualFace::at(lattice, place[RAYS]).height() * height;
                sum += tap * permittivity(across) / permittivity(edge) * heights / (length * width);
            }
        }
        sum
    }
}

/// Visits the edges across the rays from some successive nodes, no more than a word has bits, that a wall may be or was beside, with their
/// dual faces: along one ray is an object that is not along the other, or the edge has a place among those beside walls.
#[inline]
fn for_edges_beside(
    lattice: &Lattice,
    (layers, of_edges): (&RayLayers, &Walls),
    mut nodes: Range<usize>,
    mut visit: impl FnMut(EdgeAcross, &DualFace),
) {
    let (strides, counts) = (lattice.strides(), lattice.node_counts());
    while !nodes.is_empty() {
        let place = lattice.node_place(nodes.start);
        let face = DualFace::at(lattice, place[RAYS]);
        let row_end = nodes.start + counts[0] - place[0];
        let of_row = nodes.start..nodes.end.min(row_end);
        let first_of_plane = place[RAYS] * strides[RAYS];
        let columns = of_row.start - first_of_plane..of_row.end - first_of_plane;
        let leads_on = [of_row.end < row_end, place[1] + 1 < counts[1]];
        // Bits of nodes, for their edges along x and along y.
        let mut marked = layers.differing(&face, columns, leads_on, strides[1]);
        if of_edges.may_have_any(3 * of_row.start..3 * of_row.end) {
            for (bit, node) in of_row.clone().enumerate() {
                for (axis, marked) in marked.iter_mut().enumerate() {
                    *marked |= u64::from(of_edges.may_have(3 * node + axis)) << bit;
                }
            }
        }
        let mut left = marked[0] | marked[1];
        while left != 0 {
            let bit = left.trailing_zeros();
            let node = of_row.start + bit as usize;
            for axis in (0..RAYS).filter(|&axis| marked[axis] >> bit & 1 != 0) {
                let column = node - first_of_plane;
                visit(
                    EdgeAcross { number: 3 * node + axis, columns: [column, column + strides[axis]] },
                    &face,
                );
            }
            left &= left - 1;
        }
        nodes.start = of_row.end;
    }
}

/// Visits an edge beside a wall, and those along the rays that taps of it may be beside, before or now.
fn for_edges_of(
    lattice: &Lattice,
    edge: usize,
    walls: [Option<&BesideWall>; 2],
    mut visit: impl FnMut(usize),
) {
    visit(edge);
    let has_tap = |end: u8| walls.iter().flatten().any(|wall| wall.end == end && wall.past.tap != 0.0);
    for end in [0, 1].into_iter().filter(|&end| has_tap(end)) {
        let across = lattice.strides()[edge % 3];
        let node = edge / 3 + usize::from(end) * across;
        let below = node.checked_sub(lattice.strides()[RAYS]);
        [Some(node), below].into_iter().flatten().for_each(|start| visit(3 * start + RAYS));
    }
}
