//! How much of a node's links is what the field of a conductor makes of them: distances in cells, and extents.

use super::{NEAR, RightAngle, RoundNear};
use glam::DVec3;

/// By how much thicker than edges of a mesh a conductor must be, so that what is behind it does not matter before it. With nothing to
/// spare, steps of a bar of 20 mm sideways differed by up to 0.12 of themselves, with a tenth or a quarter by 0.07.
const SPARE: f64 = 1.1;

/// How large a conductor is where a field of it is known.
pub(super) trait Extent {
    /// Whether no edge of a mesh, of these lengths along the axes, can have both its ends before the conductor and meet it, with
    /// something to spare.
    fn is_thicker_than(&self, lengths: DVec3) -> bool;

    /// The middle one of the conductor's extents.
    fn breadth(&self) -> f64;
}

impl Extent for RightAngle {
    #[inline]
    fn is_thicker_than(&self, lengths: DVec3) -> bool {
        is_thicker(&self.normals, &self.thickness, lengths)
    }

    fn breadth(&self) -> f64 {
        self.breadth
    }
}

impl Extent for RoundNear {
    fn is_thicker_than(&self, lengths: DVec3) -> bool {
        SPARE * lengths.max_element() <= self.diameter()
    }

    fn breadth(&self) -> f64 {
        self.diameter()
    }
}

/// Whether a conductor is so thick behind either of two faces of these normals.
#[inline]
pub(super) fn is_thicker(normals: &[DVec3; 2], thickness: &[f64; 2], lengths: DVec3) -> bool {
    (0..2).all(|face| SPARE * (normals[face] * lengths).abs().max_element() <= thickness[face])
}

/// Distances from a node, counted in cells of the mesh around it.
pub(in super::super) trait Cells {
    /// So many cells from an edge of a conductor, nothing is known of it.
    fn far(&self) -> f64;

    /// Cells to a point, parts of them counted; [`Cells::far`] stands for all that is farther.
    fn cells_to(&self, point: DVec3) -> f64;

    /// Whether it is soon seen that a point is no more than [`NEAR`] cells away.
    fn is_next(&self, _point: DVec3) -> bool {
        false
    }

    /// How far along each axis a point less than [`Cells::far`] cells away may be, in metres.
    fn reach(&self) -> DVec3;

    /// The size of a cell in a direction, in metres.
    fn size_along(&self, direction: DVec3) -> f64;

    /// The largest such size across an axis, a unit vector.
    fn size_across(&self, axis: DVec3) -> f64;

    /// How much a place on a conductor counts: nothing outside the mesh, as what is left there of the links around it is slightly
    /// negative ones alone, and all of it a cell within. An edge may lead out of the mesh `along` a unit vector.
    fn within(&self, place: DVec3, along: DVec3) -> f64;
}

/// What [`Cells::within`] makes of how many cells a place is within the mesh along each axis.
#[inline]
pub(in super::super) fn part_within(cells: DVec3, along: DVec3) -> f64 {
    (1.0 - (1.0 - cells) * (1.0 - along * along)).min_element()
}

/// How much of a node's links is what a right angle makes of them, if there is nothing else.
#[inline(always)]
pub(super) fn share_of(cells: &impl Cells, angle: &RightAngle) -> f64 {
    let part = part_at(cells, angle.place);
    if part <= 0.0 {
        return 0.0;
    }
    let size = cells.size_along(angle.along());
    // Most are far from ends, and most edges straight: no divisions for these.
    let from_ends = if angle.inside >= size { 1.0 } else { (angle.inside / size).max(0.0) };
    let of_rim = if angle.radius == f64::INFINITY { 1.0 } else { part_of_rim(cells, angle, size) };
    part * from_ends * of_rim * cells.within(angle.place, angle.along())
}

/// How much is known of a rim where cells are so large at most.
pub(super) fn known_within(radius: f64, largest: f64) -> f64 {
    (radius / largest - 1.0).clamp(0.0, 1.0)
}

/// How much a round edge counts where a cell along it has such a size: what is known of it holds within its radius, so nothing of it
/// where a cell is as large in any direction, and all of it where that is twice as large.
fn part_of_rim(cells: &impl Cells, angle: &RightAngle, size: f64) -> f64 {
    let largest = angle.normals.iter().map(|normal| cells.size_along(*normal)).fold(size, f64::max);
    known_within(angle.radius, largest)
}

/// How much of a node's links is what a round surface makes of them whose nearest place that is, if there is nothing else.
pub(super) fn share_of_round(cells: &impl Cells, place: DVec3) -> f64 {
    part_at(cells, place) * cells.within(place, DVec3::ZERO)
}

/// How much of a node's links the field around a place of a surface has: all of it up to [`NEAR`] cells, nothing
/// from [`Cells::far`] on.
#[inline(always)]
pub(super) fn part_at(cells: &impl Cells, place: DVec3) -> f64 {
    if cells.is_next(place) {
        return 1.0;
    }
    smooth(((cells.far() - cells.cells_to(place)) / (cells.far() - NEAR)).min(1.0))
}

/// From zero to one without kinks.
#[inline(always)]
pub(super) fn smooth(part: f64) -> f64 {
    part * part * (3.0 - 2.0 * part)
}
