//! Outlines of planar electrodes: what lies inside, where a line enters, and where the rim and its corners are.

use super::polygon;
use glam::DVec2;

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

/// Polygons that stand for curves turn by less than at corners: the cosine between their sides is below this.
const SHARPEST_OF_CURVES: f64 = -0.5;

/// The side of an outline that is nearest to a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NearestSide {
    /// From the point to the side, metres.
    pub(crate) distance: f64,
    /// Its point that is nearest.
    pub(crate) foot: DVec2,
    /// Its ends.
    pub(crate) side: [DVec2; 2],
}

impl Outline {
    /// Its area in square metres.
    pub fn area(&self) -> f64 {
        match self {
            Self::Rectangle { size, .. } => size.x * size.y,
            Self::Disk { radius, .. } => std::f64::consts::PI * radius * radius,
            Self::Polygon(_) | Self::Contours(_) => polygon::area(self.contours()),
        }
    }

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
            _ => self.nearest_side(point).map_or(f64::INFINITY, |nearest| nearest.distance),
        }
    }

    /// The straight side that is nearest to a point, the first of several; a disk has none.
    pub(crate) fn nearest_side(&self, point: DVec2) -> Option<NearestSide> {
        let seen = self.sides().map(|side| {
            let foot = polygon::nearest(side, point);
            NearestSide { distance: point.distance(foot), foot, side }
        });
        seen.min_by(|a, b| a.distance.total_cmp(&b.distance))
    }

    /// The corners of which the electrode fills less than half, unless they are so blunt that they may stand for a curve.
    pub(crate) fn convex_corners(&self) -> Vec<DVec2> {
        match self {
            Self::Rectangle { .. } => self.corners_of_bounds().to_vec(),
            Self::Disk { .. } => Vec::new(),
            Self::Polygon(_) | Self::Contours(_) => {
                polygon::convex_corners(self.contours(), SHARPEST_OF_CURVES)
            }
        }
    }

    /// The corners, unless they are so blunt that they may stand for a curve.
    pub(crate) fn sharp_corners(&self) -> Vec<DVec2> {
        match self {
            Self::Rectangle { .. } | Self::Disk { .. } => self.convex_corners(),
            Self::Polygon(_) | Self::Contours(_) => {
                polygon::sharp_corners(self.contours(), SHARPEST_OF_CURVES)
            }
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
        join_near(&mut spans, slack);
        spans
    }

    /// Whether two outlines in one plane enclose a common area, or touch.
    pub fn meets(&self, other: &Self) -> bool {
        let ([low, high], [other_low, other_high]) = (self.bounds(), other.bounds());
        let slack = ON_OUTLINE * (high - low).max(other_high - other_low).max_element();
        if (low.cmpgt(other_high + slack) | other_low.cmpgt(high + slack)).any() {
            return false;
        }
        match (self, other) {
            (Self::Disk { center, radius }, other) | (other, Self::Disk { center, radius }) => {
                other.contains(*center) || other.distance_to_rim(*center) <= radius + slack
            }
            _ => {
                let cross =
                    |[p, q]: [DVec2; 2], [r, s]: [DVec2; 2]| polygon::crossing(p, q - p, r, s - r).is_some();
                self.sides().any(|[corner, _]| other.contains(corner))
                    || other.sides().any(|[corner, _]| self.contains(corner))
                    || self.sides().any(|side| other.sides().any(|other| cross(side, other)))
            }
        }
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

    /// How far one comes along x and y, there and back, on the way round the outline, in metres.
    pub(crate) fn rim_along_axes(&self) -> DVec2 {
        match self {
            Self::Disk { radius, .. } => DVec2::splat(4.0 * radius),
            _ => self.sides().map(|[p, q]| (q - p).abs()).sum(),
        }
    }

    fn corners_of_bounds(&self) -> [DVec2; 4] {
        let [low, high] = self.bounds();
        [low, DVec2::new(high.x, low.y), high, DVec2::new(low.x, high.y)]
    }

    /// Its straight sides; a disk has none.
    pub(crate) fn sides(&self) -> impl Iterator<Item = [DVec2; 2]> {
        let rectangle = matches!(self, Self::Rectangle { .. }).then(|| {
            let corners = self.corners_of_bounds();
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

/// Sorts intervals and joins those that overlap or are no farther apart than a gap.
pub(crate) fn join_near(intervals: &mut Vec<[f64; 2]>, gap: f64) {
    intervals.sort_by(|a, b| a[0].total_cmp(&b[0]));
    intervals.dedup_by(|next, kept| {
        let joined = next[0] - kept[1] <= gap;
        if joined {
            kept[1] = kept[1].max(next[1]);
        }
        joined
    });
}
