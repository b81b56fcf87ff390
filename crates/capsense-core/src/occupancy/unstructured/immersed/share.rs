//! How far an element counts as immersed, rather than by the edge rule: less and less, without a step, the stronger the body and the nearer
//! other objects are.

use crate::geometry::Aabb;
use glam::DVec3;

/// Up to this ratio of permittivities, or its inverse, elements are immersed.
const WEAK: f64 = 4.0;

/// From this ratio on they are not.
pub(super) const STRONG: f64 = 10.0;

/// Other objects count from as many of an element's longest edges away.
pub(super) const REACH: f64 = 1.0;

/// By the ratio of the permittivities in the body and beside it.
pub(super) fn of_ratio(ratio: f64) -> f64 {
    let ratio = f64::max(ratio, ratio.recip());
    ((STRONG - ratio) / (STRONG - WEAK)).clamp(0.0, 1.0)
}

/// By how far other objects are, given by their bounds, from an element with a longest edge.
pub(super) fn of_others(around: &Aabb, longest: f64, others: impl Iterator<Item = Aabb>) -> f64 {
    let nearest = others.map(|bounds| gap(around, &bounds)).fold(f64::INFINITY, f64::min);
    (nearest / (REACH * longest)).min(1.0)
}

/// How far two boxes are from each other.
pub(super) fn gap(a: &Aabb, b: &Aabb) -> f64 {
    (a.min - b.max).max(b.min - a.max).max(DVec3::ZERO).length()
}
