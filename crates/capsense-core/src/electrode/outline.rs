//! Outlines of planar electrodes: what lies inside, where a line enters, and where the rim runs.

use super::polygon;
use glam::DVec2;
use std::f64::consts::{PI, TAU};

/// The outline of a planar electrode, metres.
#[derive(Clone, Debug, PartialEq)]
pub enum Outline {
    /// Sides parallel to x and y.
    Rectangle {
        /// Centre.
        center: DVec2,
        /// Edge lengths.
        size: DVec2,
    },
    /// A circle.
    Disk {
        /// Centre.
        center: DVec2,
        /// Radius.
        radius: f64,
    },
    /// A simple polygon, in either orientation.
    Polygon(Vec<DVec2>),
    /// Simple polygons that neither cross nor touch, in either orientation: islands, holes in them, islands in those.
    /// Inside is what an odd number of them surrounds.
    Contours(Vec<Vec<DVec2>>),
}

/// Points closer to an outline than this part of its size count as on it.
const ON_OUTLINE: f64 = 1e-9;

/// A side that leaves an axis by less than this part of its length is parallel to it. Planes of one outline that are
/// closer than this part of its size are one.
const PARALLEL: f64 = 1e-6;

impl Outline {
    /// Smallest and largest x and y.
    pub fn bounds(&self) -> [DVec2; 2] {
        match self {
            Self::Rectangle { center, size } => [*center - 0.5 * *size, *center + 0.5 * *size],
            Self::Disk { center, radius } => [*center - *radius, *center + *radius],
            Self::Polygon(_) | Self::Contours(_) => self
                .contours()
                .iter()
                .flatten()
                .fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[low, high], &c| [low.min(c), high.max(c)]),
        }
    }

    /// Whether a point lies inside or on the outline.
    pub fn contains(&self, point: DVec2) -> bool {
        let [low, high] = self.bounds();
        let slack = ON_OUTLINE * (high - low).max_element();
        let in_bounds = point.cmpge(low - slack).all() && point.cmple(high + slack).all();
        match self {
            Self::Rectangle { .. } => in_bounds,
            Self::Disk { center, radius } => point.distance(*center) <= radius + slack,
            Self::Polygon(_) | Self::Contours(_) => {
                in_bounds
                    && (polygon::surround(self.contours(), point) || self.distance_to_rim(point) <= slack)
            }
        }
    }

    /// The part, in [0, 1], of the segment from a point outside to a point inside before it first meets the outline.
    pub fn outside_part(&self, outside: DVec2, inside: DVec2) -> f64 {
        let step = inside - outside;
        let part = match self {
            Self::Rectangle { center, size } => (0..2)
                .filter(|&axis| step[axis] != 0.0)
                .map(|axis| {
                    let wall = center[axis] - 0.5 * size[axis].copysign(step[axis]);
                    (wall - outside[axis]) / step[axis]
                })
                .fold(0.0, f64::max),
            Self::Disk { center, radius } => {
                let from = outside - *center;
                let (a, b, c) =
                    (step.length_squared(), from.dot(step), from.length_squared() - radius * radius);
                (-b - (b * b - a * c).max(0.0).sqrt()) / a
            }
            Self::Polygon(_) | Self::Contours(_) => self
                .sides()
                .filter_map(|[p, q]| polygon::crossing(outside, step, p, q - p))
                .fold(1.0, f64::min),
        };
        part.clamp(0.0, 1.0)
    }

    /// Distance from a point to the nearest point of the outline, metres; never negative.
    pub fn distance_to_rim(&self, point: DVec2) -> f64 {
        match self {
            Self::Disk { center, radius } => (point.distance(*center) - radius).abs(),
            _ => self.sides().map(|side| polygon::distance(side, point)).fold(f64::INFINITY, f64::min),
        }
    }

    /// Length of the outline, holes included, metres.
    pub fn perimeter(&self) -> f64 {
        match self {
            Self::Disk { radius, .. } => TAU * radius,
            _ => self.sides().map(|[p, q]| p.distance(q)).sum(),
        }
    }

    /// Length of the outline inside a rectangle with sides parallel to x and y, metres. A side along an edge of the
    /// rectangle counts half: the other half is the neighbouring rectangle's, so that tiles add up to the perimeter.
    pub fn rim_length_within(&self, low: DVec2, high: DVec2) -> f64 {
        match self {
            Self::Disk { center, radius } => arcs_within(*radius, low - *center, high - *center),
            _ => self.sides().map(|side| polygon::length_within(side, low, high)).sum(),
        }
    }

    /// Coordinates along an axis (0: x, 1: y) of the sides perpendicular to it, ascending: planes that a lattice
    /// should have.
    pub fn axis_planes(&self, axis: usize) -> Vec<f64> {
        let [low, high] = self.bounds();
        let perpendicular = |[p, q]: &[DVec2; 2]| parallel_to(1 - axis, *p, *q);
        let mut planes: Vec<f64> = match self {
            Self::Rectangle { .. } => vec![low[axis], high[axis]],
            _ => self.sides().filter(perpendicular).map(|[p, q]| 0.5 * (p[axis] + q[axis])).collect(),
        };
        planes.sort_by(f64::total_cmp);
        let slack = PARALLEL * (high - low).max_element();
        planes.dedup_by(|next, kept| *next - *kept <= slack);
        planes
    }

    /// Intervals along an axis (0: x, 1: y) in which the outline is curved or oblique, ascending and apart: a lattice
    /// should be fine all through them.
    pub fn fine_intervals(&self, axis: usize) -> Vec<[f64; 2]> {
        let [low, high] = self.bounds();
        let slack = PARALLEL * (high - low).max_element();
        let mut spans: Vec<[f64; 2]> = match self {
            Self::Disk { .. } => vec![[low[axis], high[axis]]],
            _ => self
                .sides()
                .filter(|[p, q]| !parallel_to(0, *p, *q) && !parallel_to(1, *p, *q))
                .map(|[p, q]| [p[axis].min(q[axis]), p[axis].max(q[axis])])
                .collect(),
        };
        spans.sort_by(|a, b| a[0].total_cmp(&b[0]));
        spans.dedup_by(|next, kept| {
            let joined = next[0] - kept[1] <= slack;
            if joined {
                kept[1] = kept[1].max(next[1]);
            }
            joined
        });
        spans
    }

    /// Why the outline encloses no usable area, if it does not.
    pub fn defect(&self) -> Option<&'static str> {
        match self {
            Self::Rectangle { center, size } if !(center.is_finite() && size.is_finite()) => {
                Some("is not finite")
            }
            Self::Rectangle { size, .. } if size.min_element() <= 0.0 => Some("has no area"),
            Self::Disk { center, radius } if !(center.is_finite() && radius.is_finite()) => {
                Some("is not finite")
            }
            Self::Disk { radius, .. } if *radius <= 0.0 => Some("has no area"),
            Self::Rectangle { .. } | Self::Disk { .. } => None,
            Self::Polygon(_) | Self::Contours(_) => polygon::defect(self.contours()),
        }
    }

    /// The polygons it is given by; none where it is given by lengths.
    fn contours(&self) -> &[Vec<DVec2>] {
        match self {
            Self::Rectangle { .. } | Self::Disk { .. } => &[],
            Self::Polygon(corners) => std::slice::from_ref(corners),
            Self::Contours(contours) => contours,
        }
    }

    /// Its straight sides; a disk has none.
    fn sides(&self) -> impl Iterator<Item = [DVec2; 2]> {
        let rectangle = matches!(self, Self::Rectangle { .. }).then(|| {
            let [low, high] = self.bounds();
            let corners = [low, DVec2::new(high.x, low.y), high, DVec2::new(low.x, high.y)];
            std::array::from_fn::<_, 4, _>(|k| [corners[k], corners[(k + 1) % 4]])
        });
        let of_contours = self.contours().iter().flat_map(|contour| polygon::sides(contour));
        rectangle.into_iter().flatten().chain(of_contours)
    }
}

/// Whether a side has a direction, and it is that of an axis.
fn parallel_to(axis: usize, p: DVec2, q: DVec2) -> bool {
    let length = p.distance(q);
    length > 0.0 && (q[1 - axis] - p[1 - axis]).abs() <= PARALLEL * length
}

/// Length of those parts of a circle around the origin that lie in a rectangle.
fn arcs_within(radius: f64, low: DVec2, high: DVec2) -> f64 {
    // Between neighbouring angles at which the circle meets one of the four lines it is all in or all out.
    let mut angles = [0.0; 10];
    angles[9] = TAU;
    for (side, wall) in [low, high].into_iter().enumerate() {
        let [from_x, from_y] = [(wall.x / radius).acos(), (wall.y / radius).asin()];
        for (k, angle) in [from_x, TAU - from_x, from_y.rem_euclid(TAU), PI - from_y].into_iter().enumerate()
        {
            // A line that misses the circle gives NaN; the angle stays 0.
            angles[1 + 4 * side + k] = if angle.is_nan() { 0.0 } else { angle };
        }
    }
    angles.sort_by(f64::total_cmp);
    let inside = |pair: &&[f64]| {
        let (y, x) = (0.5 * (pair[0] + pair[1])).sin_cos();
        let middle = radius * DVec2::new(x, y);
        middle.cmpge(low).all() && middle.cmple(high).all()
    };
    angles.windows(2).filter(inside).map(|pair| radius * (pair[1] - pair[0])).sum()
}
