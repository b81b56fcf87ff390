//! Where a point is with respect to the outline of an electrode.

use crate::electrode::Outline;
use glam::DVec2;

/// The nearest point of an outline, seen from a point in its plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    /// How far outside the point is, in metres; negative inside.
    pub(super) distance: f64,
    /// Unit vector out of the electrode across the rim.
    pub(super) normal: DVec2,
    /// The nearest corner that the electrode fills less than half of.
    pub(super) corner: Option<Corner>,
}

/// A corner, seen from a point in its plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Corner {
    /// Where the point is from the corner.
    pub(super) from: DVec2,
    /// Unit vectors out of the electrode across its two sides.
    pub(super) normals: [DVec2; 2],
}

/// An outline and what need be found out of it only once.
#[derive(Clone, Debug)]
pub(super) struct Places<'a> {
    outline: &'a Outline,
    /// Seen from the origin.
    convex_corners: Vec<Corner>,
}

impl<'a> Places<'a> {
    pub(super) fn of(outline: &'a Outline) -> Self {
        let corners = outline.convex_corners();
        let seen = corners.into_iter().filter_map(|corner| {
            let of_side = |[p, q]: [DVec2; 2]| match (p == corner, q == corner) {
                (true, false) => (q - p).try_normalize(),
                (false, true) => (p - q).try_normalize(),
                _ => None,
            };
            let mut along = outline.sides().filter_map(of_side);
            let (first, second) = (along.next()?, along.next()?);
            let away = |side: DVec2, other: DVec2| side.perp() * -side.perp().dot(other).signum();
            Some(Corner { from: -corner, normals: [away(first, second), away(second, first)] })
        });
        Self { outline, convex_corners: seen.collect() }
    }

    /// The corners that the electrode fills less than half of.
    pub(super) fn convex_corners(&self) -> impl Iterator<Item = DVec2> {
        self.convex_corners.iter().map(|corner| -corner.from)
    }

    /// Looks for the nearest point of the outline. Points within `slack` of it lie on it.
    pub(super) fn at(&self, point: DVec2, slack: f64) -> Place {
        let (distance, normal) = match self.outline {
            Outline::Disk { center, radius } => {
                let from = point - *center;
                (from.length() - radius, from.try_normalize().unwrap_or(DVec2::X))
            }
            _ => self.across_nearest_side(point, slack),
        };
        let seen = self.convex_corners.iter().map(|corner| Corner { from: point + corner.from, ..*corner });
        let corner = seen.min_by(|a, b| a.from.length_squared().total_cmp(&b.from.length_squared()));
        Place { distance, normal, corner }
    }

    /// Distance and normal of a polygon.
    fn across_nearest_side(&self, point: DVec2, slack: f64) -> (f64, DVec2) {
        let Some(nearest) = self.outline.nearest_side(point) else {
            return (f64::INFINITY, DVec2::X);
        };
        if nearest.distance > slack {
            let outward = (point - nearest.foot) / nearest.distance;
            return match self.outline.contains(point) {
                true => (-nearest.distance, -outward),
                false => (nearest.distance, outward),
            };
        }
        // On the rim, the side itself tells what is across.
        let [p, q] = nearest.side;
        let across = (q - p).try_normalize().unwrap_or(DVec2::X).perp();
        let is_inward = self.outline.contains(point + across * (1e3 * slack));
        (0.0, if is_inward { -across } else { across })
    }
}
