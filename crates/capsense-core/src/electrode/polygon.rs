//! Closed contours of straight sides: even-odd membership, crossings, distances, clipping, and what is wrong with them.

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

/// Distance from a point to a side.
pub(super) fn distance([p, q]: [DVec2; 2], point: DVec2) -> f64 {
    let along = (point - p).dot(q - p) / (q - p).length_squared();
    // A side between two corners in one place has no direction.
    let nearest = if along.is_finite() { p.lerp(q, along.clamp(0.0, 1.0)) } else { p };
    point.distance(nearest)
}

/// Length of a side inside a rectangle (Liang and Barsky's clipping); half of it where the side lies along an edge.
pub(super) fn length_within([p, q]: [DVec2; 2], low: DVec2, high: DVec2) -> f64 {
    let (mut enter, mut leave, mut share) = (0.0_f64, 1.0_f64, 1.0);
    for axis in 0..2 {
        let step = q[axis] - p[axis];
        if step != 0.0 {
            let (a, b) = ((low[axis] - p[axis]) / step, (high[axis] - p[axis]) / step);
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        } else if p[axis] < low[axis] || p[axis] > high[axis] {
            return 0.0;
        } else if p[axis] == low[axis] || p[axis] == high[axis] {
            share = 0.5;
        }
    }
    share * (leave - enter).max(0.0) * p.distance(q)
}

/// Area of a contour, positive when it runs counter-clockwise.
pub(super) fn signed_area(contour: &[DVec2]) -> f64 {
    // Relative to a corner, so that a contour far from the origin keeps its digits.
    let origin = contour.first().copied().unwrap_or_default();
    0.5 * sides(contour).map(|[p, q]| (p - origin).perp_dot(q - origin)).sum::<f64>()
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
