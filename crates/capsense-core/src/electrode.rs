//! Planar electrodes: outlines, the mesh nodes they own, and the mesh edges they cut.

use glam::{DVec2, DVec3};

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
}

/// Points closer to an outline than this part of its size count as on it.
const ON_OUTLINE: f64 = 1e-9;

impl Outline {
    /// Smallest and largest x and y.
    pub fn bounds(&self) -> [DVec2; 2] {
        match self {
            Self::Rectangle { center, size } => [*center - 0.5 * *size, *center + 0.5 * *size],
            Self::Disk { center, radius } => [*center - *radius, *center + *radius],
            Self::Polygon(corners) => corners
                .iter()
                .fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[low, high], &c| [low.min(c), high.max(c)]),
        }
    }

    /// Whether a point lies inside or on the outline.
    pub fn contains(&self, point: DVec2) -> bool {
        let [low, high] = self.bounds();
        let slack = ON_OUTLINE * (high - low).max_element();
        match self {
            Self::Rectangle { .. } => point.cmpge(low - slack).all() && point.cmple(high + slack).all(),
            Self::Disk { center, radius } => point.distance(*center) <= radius + slack,
            Self::Polygon(corners) => polygon_contains(corners, point, slack),
        }
    }

    /// The part of the segment from a point outside to a point inside that lies outside, in [0, 1].
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
            Self::Polygon(corners) => polygon_sides(corners)
                .filter_map(|[p, q]| crossing(outside, step, p, q - p))
                .fold(1.0, f64::min),
        };
        part.clamp(0.0, 1.0)
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
            Self::Polygon(corners) => polygon_defect(corners),
            Self::Rectangle { .. } | Self::Disk { .. } => None,
        }
    }
}

fn polygon_sides(corners: &[DVec2]) -> impl Iterator<Item = [DVec2; 2]> {
    (0..corners.len()).map(|k| [corners[k], corners[(k + 1) % corners.len()]])
}

/// Parameter along `from + t·step`, t in [0, 1], at which it meets the segment `p + s·side`, s in [0, 1].
fn crossing(from: DVec2, step: DVec2, p: DVec2, side: DVec2) -> Option<f64> {
    let across = step.perp_dot(side);
    let t = (p - from).perp_dot(side) / across;
    let s = (p - from).perp_dot(step) / across;
    // Parallel segments divide by zero; NaN and infinity fail both tests.
    ((0.0..=1.0).contains(&t) && (-1e-12..=1.0 + 1e-12).contains(&s)).then_some(t)
}

fn polygon_contains(corners: &[DVec2], point: DVec2, slack: f64) -> bool {
    let on_side = polygon_sides(corners).any(|[p, q]| {
        let along = ((point - p).dot(q - p) / (q - p).length_squared()).clamp(0.0, 1.0);
        point.distance(p.lerp(q, along)) <= slack
    });
    let crossings = polygon_sides(corners)
        .filter(|[p, q]| (p.y > point.y) != (q.y > point.y))
        .filter(|[p, q]| point.x < p.x + (point.y - p.y) / (q.y - p.y) * (q.x - p.x))
        .count();
    on_side || crossings % 2 == 1
}

fn polygon_defect(corners: &[DVec2]) -> Option<&'static str> {
    if corners.len() < 3 {
        return Some("has fewer than three corners");
    }
    if !corners.iter().all(|corner| corner.is_finite()) {
        return Some("is not finite");
    }
    let doubled_area: f64 = polygon_sides(corners).map(|[p, q]| p.perp_dot(q)).sum();
    let scale = polygon_sides(corners).map(|[p, q]| p.distance(q)).fold(0.0, f64::max);
    if doubled_area.abs() <= 1e-12 * scale * scale {
        return Some("has no area");
    }
    let sides: Vec<_> = polygon_sides(corners).collect();
    let neighbours = |i: usize, j: usize| j == i + 1 || (i == 0 && j == sides.len() - 1);
    let crossed = (0..sides.len()).any(|i| {
        (i + 1..sides.len()).any(|j| {
            let ([a, b], [p, q]) = (sides[i], sides[j]);
            !neighbours(i, j) && crossing(a, b - a, p, q - p).is_some()
        })
    });
    crossed.then_some("crosses itself")
}

/// A thin electrode parallel to the sensing surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Electrode {
    /// Unique name.
    pub name: String,
    /// Outline in x and y.
    pub outline: Outline,
    /// Height in the sensor frame.
    pub z: f64,
}

impl Electrode {
    /// Whether a mesh node belongs to the electrode; `flat` is how far from its plane a node may lie.
    pub fn owns(&self, node: DVec3, flat: f64) -> bool {
        (node.z - self.z).abs() <= flat && self.outline.contains(node.truncate())
    }
}
