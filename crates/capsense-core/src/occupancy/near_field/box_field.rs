//! The field near the edges of a box, as a node of a lattice sees it.
//!
//! Around an edge it is that of a wedge. Near a corner, where several edges are about as near, it is the mean of theirs, as if each went on
//! without end: that satisfies Laplace's equation and does not jump as a node passes from one edge to the other. The field of a corner itself
//! is not known in closed form; links that leave it out made boxes larger or smaller by where corners are between nodes
//! (`docs/interface.md`, "Corners of boxes").
//!
//! Where cells grow away from a box, a lattice takes its edges to be further out, by about a tenth of what one cell is larger than the one
//! before, so edges are seen further in ([`UNEVEN`]).

use super::field::wedge_potentials;
use super::star::Star;
use super::{Cells, RightAngles, smooth};
use glam::DVec3;

/// Edges have a part in the field that are less than this much, in cells, from being the nearest one.
const MIXED: f64 = 0.2;

/// How much further in edges are seen from a cell away, in parts of what cells grow by from one to the next, along x and y. Of square plates in
/// cells that grow by factors of 1.2 to 1.6, capacitances to all else are then off by little more than in even cells
/// (`tests/suite/corners.rs` has those of 1.4). Along z, where cells grow upwards through all of a box, nothing is gained by it.
const UNEVEN: f64 = 0.15;

/// The field near a box, seen from a node.
pub(super) struct BoxField<'a> {
    angles: &'a RightAngles,
    half: DVec3,
    /// How far outside of each face the node is.
    outside: DVec3,
    /// How much further in faces seem a cell from them, and how large cells are, along each axis of the box.
    inwards: DVec3,
    sizes: DVec3,
    /// Along each axis of the box, on which side the node is.
    side: DVec3,
    /// The parts of the edges along each axis.
    parts: DVec3,
}

impl<'a> BoxField<'a> {
    /// Seen from a node.
    pub(super) fn seen_from(star: &Star<'_>, angles: &'a RightAngles, half: DVec3) -> Self {
        let own = Self::local(angles, star.place());
        let side = DVec3::ONE.copysign(own);
        let outside = own.abs() - half;
        let turn = &angles.sensor_from_object.matrix3;
        let axes = [0, 1, 2].map(|axis| turn.col(axis));
        let sizes = axes.map(|axis| star.size_along(axis));
        let inwards = DVec3::from_array([0, 1, 2].map(|axis: usize| inwards(star, axes[axis] * side[axis])));
        let all = DVec3::from_array(parts(outside.to_array(), sizes));
        let parts = all / all.element_sum();
        Self { angles, half, outside, inwards, sizes: DVec3::from_array(sizes), side, parts }
    }

    fn local(angles: &RightAngles, point: DVec3) -> DVec3 {
        angles.object_from_sensor * (point - angles.sensor_from_object.translation)
    }

    /// Whether no straight way from the node to a point passes the box: a face is behind both of them.
    pub(super) fn sees(&self, point: DVec3) -> bool {
        let before = Self::local(self.angles, point) * self.side - self.half;
        (before.cmpge(DVec3::ZERO) & self.outside.cmpge(DVec3::ZERO)).any()
    }

    /// The potential at a point.
    pub(super) fn potential(&self, point: DVec3) -> f64 {
        let outside = Self::local(self.angles, point) * self.side - self.half;
        let outside = outside + self.inwards * (outside.abs() / self.sizes).min(DVec3::ONE).map(smooth);
        let of_edge = |axis: usize| {
            let [potential] = wedge_potentials(&[outside[(axis + 1) % 3]], &[outside[(axis + 2) % 3]]);
            self.parts[axis] * potential
        };
        // Most nodes see one edge alone.
        (0..3).filter(|&axis| self.parts[axis] > 0.0).map(of_edge).sum()
    }
}

/// How much further in a face of a box seems from a node, a cell from that face, than it is; its outward normal being given. Less is it
/// nearer to the face, so that links are strong without bounds where a face comes to a node.
#[inline(always)]
pub(super) fn inwards(star: &Star<'_>, normal: DVec3) -> f64 {
    UNEVEN * (normal.x * normal.x.abs() * star.growth(0) + normal.y * normal.y.abs() * star.growth(1))
}

/// In which proportion edges along the axes of a box count for a point so far outside of its faces, where cells are so large along these:
/// those count that are all but the nearest, which are along the axis whose faces are the farthest outwards.
#[inline(always)]
pub(super) fn parts(outside: [f64; 3], sizes: [f64; 3]) -> [f64; 3] {
    let least = super::smaller(super::smaller(outside[0], outside[1]), outside[2]);
    let part = |axis: usize| super::larger(1.0 - (outside[axis] - least) / (MIXED * sizes[axis]), 0.0);
    [part(0), part(1), part(2)]
}

/// How much an edge counts that is twice as long as `half`, cells along it being of a size: all of it from two cells on. Where lengths are of
/// whole cells it is not for rounding to say whether it is all.
#[inline(always)]
pub(super) fn of_length(half: f64, size: f64) -> f64 {
    super::smaller((1.0 + 1e-6) * half / size, 1.0)
}

/// How much of what edges of a box have of a node's links is inside the lattice: the least of all edges, which count as their parts are to that
/// of the nearest one.
pub(super) fn within(star: &Star<'_>, angles: &RightAngles, half: DVec3) -> f64 {
    let field = BoxField::seen_from(star, angles, half);
    let local = BoxField::local(angles, star.place());
    let nearest = field.parts.max_element();
    (0..3).filter(|&axis| field.parts[axis] > 0.0).fold(1.0, |least, axis| {
        let mut place = half.copysign(local);
        place[axis] = local[axis].clamp(-half[axis], half[axis]);
        let along = angles.sensor_from_object.matrix3.col(axis);
        let inside = star.within(angles.sensor_from_object.transform_point3(place), along);
        least.min(1.0 - field.parts[axis] / nearest * (1.0 - inside))
    })
}

#[cfg(test)]
mod tests {
    use super::super::RightAngled;
    use super::super::star::{Row, Stars};
    use super::*;
    use crate::mesh::Lattice;
    use glam::{DAffine3, DQuat};

    /// A box that sticks out through a wall by a twentieth of a cell and slides along it, seen from a node a cell inside: of both its
    /// edges that are about as near, one is outside. As that one takes over, nothing jumps.
    #[test]
    fn edges_outside_count_less_and_less() {
        let planes = || (0..=12).map(f64::from).collect::<Vec<_>>();
        let lattice = Lattice::new([planes(), planes(), planes()]).unwrap();
        let stars = Stars::of(&lattice, true);
        let node = lattice.strides()[1] * 6 + lattice.strides()[2] * 6 + 11;
        let star = stars.at(node, &mut Row::default());
        let half = DVec3::splat(2.0);
        let inside: Vec<f64> = (0..=400)
            .map(|step| {
                let centre = DVec3::new(10.05, 6.5 + 0.004 * f64::from(step), 3.9);
                let sensor_from_object = DAffine3::from_rotation_translation(DQuat::IDENTITY, centre);
                let object_from_sensor = sensor_from_object.matrix3.transpose();
                within(
                    &star,
                    &RightAngles { solid: RightAngled::Box(half), sensor_from_object, object_from_sensor },
                    half,
                )
            })
            .collect();
        let steps = inside.windows(2).map(|pair| (pair[1] - pair[0]).abs());
        assert!(inside[0] < 0.01 && inside[400] > 0.99, "{} {}", inside[0], inside[400]);
        assert!(steps.fold(0.0, f64::max) < 0.05);
    }
}
