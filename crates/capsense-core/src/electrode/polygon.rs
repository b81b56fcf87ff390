//! Closed contours of straight sides: even-odd membership, crossings, nearest points, corners, and what is wrong with them.

use glam::DVec2;

/// A contour encloses nothing when its area is below this part of the square of its longest side.
const NO_AREA: f64 = 1e-12;

/// The sides of a contour, the last of which leads back to the first corner.
pub(super) fn sides(contour: &[DVec2]) -> impl Iterator<Item = [DVec2; 2]> {
    (0..contour.len()).map(|k| [contour[k], contour[(k + 1) % contour.len()]])
}

/// Whether an odd number of contours surrounds a point: a ray towards +x meets them an odd number of times.
pub(super) fn surround(contours: &[Vec<DVec2>], point: DVec2) -> bool {
    let crossings = contours
        .iter()
        .flat_map(|contour| sides(contour))
        .filter(|[p, q]| (p.y > point.y) != (q.y > point.y))
        .filter(|[p, q]| point.x < p.x + (point.y - p.y) / (q.y - p.y) * (q.x - p.x))
        .count();
    crossings % 2 == 1
}

/// Parameter along `from + t·step`, t in [0, 1], at which it meets the segment `p + s·side`, s in [0, 1].
pub(super) fn crossing(from: DVec2, step: DVec2, p: DVec2, side: DVec2) -> Option<f64> {
    let across = step.perp_dot(side);
    let t = (p - from).perp_dot(side) / across;
    let s = (p - from).perp_dot(step) / across;
    // Parallel segments divide by zero; NaN and infinity fail both tests.
    ((0.0..=1.0).contains(&t) && (-1e-12..=1.0 + 1e-12).contains(&s)).then_some(t)
}

/// The point of a side that is nearest to a point.
pub(super) fn nearest([p, q]: [DVec2; 2], point: DVec2) -> DVec2 {
    let along = (point - p).dot(q - p) / (q - p).length_squared();
    // A side between two corners in one place has no direction.
    if along.is_finite() { p.lerp(q, along.clamp(0.0, 1.0)) } else { p }
}

/// What contours surround: those that an odd number of others surrounds are holes.
pub(super) fn area(contours: &[Vec<DVec2>]) -> f64 {
    let area = |index: usize| {
        let area = signed_area(&contours[index]).abs();
        if is_hole(contours, index) { -area } else { area }
    };
    (0..contours.len()).map(area).sum()
}

/// Whether an odd number of other contours surrounds one. They do not cross: one corner of it tells.
fn is_hole(contours: &[Vec<DVec2>], index: usize) -> bool {
    let Some(&corner) = contours[index].first() else { return false };
    let others = contours.iter().enumerate().filter(|(other, _)| *other != index);
    let around = others.filter(|(_, other)| surround(std::slice::from_ref(*other), corner)).count();
    !around.is_multiple_of(2)
}

/// Area of a contour, positive when it runs counter-clockwise.
pub(super) fn signed_area(contour: &[DVec2]) -> f64 {
    // Relative to a corner, so that a contour far from the origin keeps its digits.
    let origin = contour.first().copied().unwrap_or_default();
    0.5 * sides(contour).map(|[p, q]| (p - origin).perp_dot(q - origin)).sum::<f64>()
}

/// The corners of which the contours surround less than half, where the cosine between the two sides is above a number.
pub(super) fn convex_corners(contours: &[Vec<DVec2>], sharpest: f64) -> Vec<DVec2> {
    let mut convex = Vec::new();
    for (index, contour) in contours.iter().enumerate() {
        if contour.is_empty() {
            continue;
        }
        let inward = if is_hole(contours, index) { -signed_area(contour) } else { signed_area(contour) };
        let before = contour.iter().cycle().skip(contour.len() - 1);
        convex.extend(before.zip(sides(contour)).filter_map(|(&before, [p, after])| {
            let (a, b) = ((before - p).normalize_or_zero(), (after - p).normalize_or_zero());
            (a.dot(b) > sharpest && b.perp_dot(a) * inward > 0.0).then_some(p)
        }));
    }
    convex
}

/// The corners where the cosine between the two sides is above a number.
pub(super) fn sharp_corners(contours: &[Vec<DVec2>], sharpest: f64) -> Vec<DVec2> {
    let corners = contours.iter().flat_map(|contour| {
        let before = contour.iter().cycle().skip(contour.len().saturating_sub(1));
        before.zip(sides(contour)).map(|(&before, [p, after])| [before, p, after])
    });
    corners
        .filter(|[before, p, after]| {
            (*before - *p).normalize_or_zero().dot((*after - *p).normalize_or_zero()) > sharpest
        })
        .map(|[_, p, _]| p)
        .collect()
}

/// Why some contours are no outline, if they are none.
pub(super) fn defect(contours: &[Vec<DVec2>]) -> Option<&'static str> {
    if contours.is_empty() || contours.iter().any(|contour| contour.len() < 3) {
        return Some("has fewer than three corners");
    }
    if !contours.iter().flatten().all(|corner| corner.is_finite()) {
        return Some("is not finite");
    }
    let no_area = |contour: &Vec<DVec2>| {
        let longest = sides(contour).map(|[p, q]| p.distance(q)).fold(0.0, f64::max);
        let area = signed_area(contour).abs();
        !area.is_finite() || area <= NO_AREA * longest * longest
    };
    if contours.iter().any(no_area) {
        return Some("has no area");
    }
    sides_cross(contours).then_some("crosses itself")
}

/// Whether any two sides meet that are not neighbours.
fn sides_cross(contours: &[Vec<DVec2>]) -> bool {
    struct Side {
        ends: [DVec2; 2],
        contour: usize,
        place: usize,
    }
    let mut all: Vec<Side> = (0..contours.len())
        .flat_map(|contour| {
            sides(&contours[contour]).enumerate().map(move |(place, ends)| Side { ends, contour, place })
        })
        .collect();
    let low = |side: &Side| side.ends[0].min(side.ends[1]);
    let high = |side: &Side| side.ends[0].max(side.ends[1]);
    let neighbours = |a: &Side, b: &Side| {
        let last = contours[a.contour].len() - 1;
        let apart = a.place.abs_diff(b.place);
        a.contour == b.contour && (apart <= 1 || apart == last)
    };
    // From left to right, so that each side is only compared with those that begin before it ends.
    all.sort_by(|a, b| low(a).x.total_cmp(&low(b).x));
    all.iter().enumerate().any(|(index, a)| {
        let beside = all[index + 1..].iter().take_while(|b| low(b).x <= high(a).x);
        beside.filter(|b| low(b).y <= high(a).y && low(a).y <= high(b).y).any(|b| {
            let ([p, q], [r, s]) = (a.ends, b.ends);
            !neighbours(a, b) && crossing(p, q - p, r, s - r).is_some()
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn points<const N: usize>(corners: [[f64; 2]; N]) -> Vec<DVec2> {
        corners.map(DVec2::from).to_vec()
    }

    /// An L with a hole in which an island lies, a triangle, and an octagon that may stand for a disk.
    #[test]
    fn convex_corners_are_those_of_what_is_filled() {
        let ell = points([[0.0, 0.0], [9.0, 0.0], [9.0, 4.0], [4.0, 4.0], [4.0, 9.0], [0.0, 9.0]]);
        let hole = points([[1.0, 1.0], [3.0, 1.0], [3.0, 3.0], [1.0, 3.0]]);
        let island = points([[1.5, 1.5], [2.5, 1.5], [2.0, 2.5]]);
        let octagon = (0..8).map(|k| DVec2::X * 20.0 + DVec2::from_angle(0.3 + f64::from(k) * 0.25 * PI));
        let mut contours = vec![ell.clone(), hole, island.clone(), octagon.collect()];
        let mut expected = ell;
        expected.remove(3);
        expected.extend(island);
        let sorted = |mut corners: Vec<DVec2>| {
            corners.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
            corners
        };
        let expected = sorted(expected);
        for turned in 0..16 {
            assert_eq!(sorted(convex_corners(&contours, -0.5)), expected, "{turned}");
            contours.rotate_left(1);
            contours[turned % 3].reverse();
        }
    }
}
