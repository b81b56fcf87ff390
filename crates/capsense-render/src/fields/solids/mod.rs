//! Solids and lattices as the kernels know them: what `solids.wgsl` and the files after it read.
//!
//! Points are told to kernels in two parts, so that what is near an object is told from its origin as exactly as single precision
//! tells small numbers: a plane of nodes that holds a face is told from one that is beside it by a ten-millionth of the
//! object.

#[cfg(test)]
mod stand_alone;
#[cfg(test)]
mod tests;

use capsense_core::mesh::Lattice;
use capsense_core::occupancy::{RightAngled, Surfaces};
use capsense_core::sensor::{FREE, GROUND, Terminal};
use capsense_core::solids::Solids;
use glam::DVec3;

const BOX: u32 = 0;
const CAPSULE: u32 = 1;
const CYLINDER: u32 = 2;

/// The first of three bits of an object's kind: whether a flat face is across an axis of the sensor frame.
const FACE_ACROSS_X: u32 = 0x100;

/// Marks of nodes: whether a terminal has it, whether an electrode, and whether the background is the same on all its edges.
pub(super) const OF_SENSOR: u32 = 1;
pub(super) const OF_ELECTRODE: u32 = 2;
pub(super) const HOMOGENEOUS: u32 = 4;

/// Words of a solid at a pose: its size, kind, origin in two parts, and axes in the sensor frame, as `solids.wgsl` has them.
pub(super) const SOLID_WORDS: usize = 21;

/// Numbers of a box around a piece of a rim: its middle, half its size, and the number of the box after it and all within it.
const BOX_NUMBERS: usize = 7;

/// The trees of edges of some solids, which stay as they are, and where each begins and ends.
#[derive(Clone, Debug, Default)]
pub(super) struct EdgeTrees {
    pub(super) numbers: Vec<f32>,
    /// Places of the first number of a tree and of the first behind it.
    ranges: Vec<[u32; 2]>,
}

impl EdgeTrees {
    /// `None` if one of the objects is not a box, a sphere, a capsule or a cylinder.
    pub(super) fn of(solids: &Solids) -> Option<Self> {
        let mut trees = Self::default();
        for object in 0..solids.objects() {
            let first = trees.numbers.len();
            if kind_and_size(solids, object)?.0 == CYLINDER {
                for (bounds, exit) in solids.boxes_around_edges(object) {
                    trees.numbers.extend((0.5 * (bounds.min + bounds.max)).as_vec3().to_array());
                    trees.numbers.extend((0.5 * bounds.size()).as_vec3().to_array());
                    // As a number: as bits it would be one so small that devices take it for zero.
                    trees.numbers.push((first + BOX_NUMBERS * exit as usize) as f32);
                }
            }
            trees.ranges.push([first, trees.numbers.len()].map(|at| at as u32));
        }
        Some(trees)
    }

    /// Adds where the solids are to what kernels are told, each by [`SOLID_WORDS`].
    pub(super) fn tell(&self, solids: &Solids, object: usize, words: &mut Vec<u32>) {
        let Some((kind, size)) = kind_and_size(solids, object) else { return };
        let frame = solids.frame(object);
        let [x, y, z] = frame.origin.to_array().map(in_two);
        let faces = (0..3).filter(|&axis| solids.has_face_across(object, axis));
        let kind = faces.fold(kind, |kind, axis| kind | FACE_ACROSS_X << axis);
        words.extend(size.as_vec3().to_array().map(f32::to_bits));
        words.push(kind);
        words.extend([x[0], y[0], z[0], x[1], y[1], z[1]].map(f32::to_bits));
        words.extend(self.ranges[object]);
        let axes = frame.object_from_sensor.transpose().to_cols_array();
        words.extend(axes.map(|component| (component as f32).to_bits()));
    }
}

fn kind_and_size(solids: &Solids, object: usize) -> Option<(u32, DVec3)> {
    match (solids.right_angles(object).map(|angles| angles.solid), solids.roundness(object)) {
        (Some(RightAngled::Box(half)), _) => Some((BOX, half)),
        (Some(RightAngled::Cylinder { radius, half_length }), _) => {
            Some((CYLINDER, DVec3::new(radius, radius, half_length)))
        }
        (None, Some(round)) => Some((CAPSULE, DVec3::new(round.radius, round.radius, round.half.length()))),
        (None, None) => None,
    }
}

/// A number as the sum of two in single precision.
fn in_two(x: f64) -> [f32; 2] {
    let first = x as f32;
    [first, (x - f64::from(first)) as f32]
}

/// The planes of a lattice, those across x first: where they are, in two parts, and how far the next one is.
pub(super) fn planes(lattice: &Lattice) -> Vec<[f32; 4]> {
    let of_axis = |planes: &Vec<f64>| {
        let planes = planes.clone();
        (0..planes.len()).map(move |index| {
            let [at, rest] = in_two(planes[index]);
            let way = planes.get(index + 1).map_or(0.0, |next| next - planes[index]);
            [at, rest, way as f32, 0.0]
        })
    };
    lattice.axes().iter().flat_map(of_axis).collect()
}

/// What kernels are told of each node. `background` is the relative permittivity around each edge.
pub(super) fn marks(lattice: &Lattice, owners: &[Terminal], background: impl Fn(usize) -> f64) -> Vec<u32> {
    let (counts, strides) = (lattice.node_counts(), lattice.strides());
    let mark = |node: usize| {
        let place = lattice.node_place(node);
        let edges = (0..3).flat_map(|axis| {
            let below = (place[axis] > 0).then(|| 3 * (node - strides[axis]) + axis);
            let above = (place[axis] + 1 < counts[axis]).then_some(3 * node + axis);
            [below, above].into_iter().flatten()
        });
        let mut around = edges.map(&background);
        let first = around.next().unwrap_or(1.0);
        let mut mark = if around.all(|other| other == first) { HOMOGENEOUS } else { 0 };
        if owners[node] != FREE {
            mark |= OF_SENSOR;
        }
        if owners[node] != FREE && owners[node] != GROUND {
            mark |= OF_ELECTRODE;
        }
        mark
    };
    (0..owners.len()).map(mark).collect()
}

/// The functions for so many solids at most; what they read, and the kernels, come after them.
pub(super) fn source(most_objects: usize) -> String {
    let files = [
        include_str!("solids.wgsl"),
        include_str!("near_field.wgsl"),
        include_str!("../edge_rule.wgsl"),
        include_str!("silhouette.wgsl"),
        include_str!("edges_of_solids.wgsl"),
    ];
    format!("const OBJECTS: u32 = {most_objects}u;\n") + &files.join("\n")
}
