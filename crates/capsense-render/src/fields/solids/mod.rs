//! Solids as the kernels know them: what `solids.wgsl` and the files after it read.
//!
//! Points are told to kernels in two parts, so that what is near an object is told from its origin as exactly as single precision
//! tells small numbers: a plane of nodes that holds a face is told from one that is beside it by a ten-millionth of the
//! object.

#[cfg(test)]
mod scene_tests;
#[cfg(test)]
mod stand_alone;
#[cfg(test)]
mod tests;

use super::finder::in_two;
use capsense_core::occupancy::{RightAngled, Surfaces};
use capsense_core::solids::Solids;
use glam::DVec3;

const BOX: u32 = 0;
const CAPSULE: u32 = 1;
const CYLINDER: u32 = 2;

/// Words of a solid at a pose: its size, kind, origin in two parts, and axes in the sensor frame, as `solids.wgsl` has them.
pub(super) const SOLID_WORDS: usize = 21;

/// Numbers of a box around a piece of a rim: its middle, half its size, and the number of the box after it and all within it.
const BOX_NUMBERS: usize = 7;

/// Where the trees of edges of some solids are among numbers that kernels read.
#[derive(Clone, Debug, Default)]
pub(super) struct EdgeTrees {
    /// Places of the first number of a tree and of the first behind it.
    ranges: Vec<[u32; 2]>,
}

impl EdgeTrees {
    /// Appends trees to what kernels read.
    pub(super) fn new(solids: &Solids, numbers: &mut Vec<f32>) -> Self {
        let mut ranges = Vec::with_capacity(solids.objects());
        for object in 0..solids.objects() {
            let first = numbers.len();
            if matches!(kind_and_size(solids, object), Some((CYLINDER, _))) {
                for (bounds, exit) in solids.boxes_around_edges(object) {
                    numbers.extend((0.5 * (bounds.min + bounds.max)).as_vec3().to_array());
                    numbers.extend((0.5 * bounds.size()).as_vec3().to_array());
                    // As a number: as bits it would be one so small that devices take it for zero.
                    numbers.push((BOX_NUMBERS * exit as usize) as f32);
                }
            }
            ranges.push([first, numbers.len()].map(|at| at as u32));
        }
        Self { ranges }
    }

    /// Adds where the solids are to what kernels are told, each by [`SOLID_WORDS`].
    pub(super) fn tell(&self, solids: &Solids, object: usize, words: &mut Vec<u32>) {
        let Some((kind, size)) = kind_and_size(solids, object) else { return };
        let frame = solids.frame(object);
        let [x, y, z] = frame.origin.to_array().map(in_two);
        words.extend(size.as_vec3().to_array().map(f32::to_bits));
        words.push(kind);
        words.extend([x[0], y[0], z[0], x[1], y[1], z[1]].map(f32::to_bits));
        words.extend(self.ranges[object]);
        let axes = frame.object_from_sensor.transpose().to_cols_array();
        words.extend(axes.map(|component| (component as f32).to_bits()));
    }
}

/// Whether kernels know such a solid: triangles they do only if these are a box.
pub(super) fn is_found(solids: &Solids, object: usize) -> bool {
    kind_and_size(solids, object).is_some()
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

/// The functions of solids, behind what the edge rule asks of a geometry source.
pub(super) fn source() -> String {
    let files = [
        include_str!("solids.wgsl"),
        include_str!("bars.wgsl"),
        include_str!("../right_angle.wgsl"),
        include_str!("near_field.wgsl"),
        include_str!("round.wgsl"),
        include_str!("silhouette.wgsl"),
        include_str!("edges_of_solids.wgsl"),
    ];
    files.join("\n")
}
