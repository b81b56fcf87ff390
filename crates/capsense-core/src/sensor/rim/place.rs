//! Where a point is with respect to the outline of an electrode.

use crate::electrode::Outline;
use glam::DVec2;

/// Polygons that stand for curves turn by less than at corners: the cosine between their sides is below this.
const SHARPEST_OF_CURVES: f64 = -0.5;

/// The nearest point of an outline, seen from a point in its plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    /// How far outside the point is, in metres; negative inside.
    pub(super) distance: f64,
    /// Unit vector out of the electrode across the rim.
    pub(super) normal: DVec2,
    /// From the nearest corner that the electrode fills less than half of.
    pub(super) from_corner: Option<DVec2>,
}

/// Looks for the nearest point of an outline. Points within `slack` of it lie on it.
pub(super) fn place(outline: &Outline, point: DVec2, slack: f64) -> Place {
    match outline {
        Outline::Rectangle { center, size } => {
            let [low, high] = [*center - 0.5 * *size, *center + 0.5 * *size];
            let corners = [low, DVec2::new(high.x, low.y), high, DVec2::new(low.x, high.y)];
            of_contours(outline, &[&corners], point, slack)
        }
        Outline::Polygon(corners) => of_contours(outline, &[corners], point, slack),
        Outline::Contours(contours) => {
            let contours: Vec<&[DVec2]> = contours.iter().map(Vec::as_slice).collect();
            of_contours(outline, &contours, point, slack)
        }
        Outline::Disk { center, radius } => {
            let from = point - *center;
            let normal = from.try_normalize().unwrap_or(DVec2::X);
            Place { distance: from.length() - radius, normal, from_corner: None }
        }
    }
}

fn of_contours(outline: &Outline, contours: &[&[DVec2]], point: DVec2, slack: f64) -> Place {
    let inside = outline.contains(point);
    let mut nearest = (f64::INFINITY, DVec2::X);
    let mut from_corner: Option<DVec2> = None;
    for contour in contours {
        for (index, &p) in contour.iter().enumerate() {
            let q = contour[(index + 1) % contour.len()];
            let along = ((point - p).dot(q - p) / (q - p).length_squared()).clamp(0.0, 1.0);
            let foot = p.lerp(q, along);
            let distance = point.distance(foot);
            if distance < nearest.0 {
                nearest = (distance, foot);
            }
            let before = contour[(index + contour.len() - 1) % contour.len()];
            let nearer = from_corner.is_none_or(|other| point.distance(p) < other.length());
            if nearer && is_convex(outline, before, p, q) {
                from_corner = Some(point - p);
            }
        }
    }
    let (distance, foot) = nearest;
    if distance > slack {
        let outward = if inside { foot - point } else { point - foot };
        let signed = if inside { -distance } else { distance };
        return Place { distance: signed, normal: outward / distance, from_corner };
    }
    // On the rim, the side itself tells what is across.
    let side = side_at(contours, point);
    let across = side.perp();
    let step = across * (1e3 * slack);
    let normal = if outline.contains(point + step) { -across } else { across };
    Place { distance: 0.0, normal, from_corner }
}

/// The direction of the side nearest to a point.
fn side_at(contours: &[&[DVec2]], point: DVec2) -> DVec2 {
    let sides = contours
        .iter()
        .flat_map(|contour| (0..contour.len()).map(|k| [contour[k], contour[(k + 1) % contour.len()]]));
    let distance = |[p, q]: [DVec2; 2]| {
        let along = ((point - p).dot(q - p) / (q - p).length_squared()).clamp(0.0, 1.0);
        point.distance(p.lerp(q, along))
    };
    let nearest = sides.min_by(|a, b| distance(*a).total_cmp(&distance(*b)));
    nearest.and_then(|[p, q]| (q - p).try_normalize()).unwrap_or(DVec2::X)
}

/// Whether the electrode fills less than half of the surroundings of a corner by a good part.
fn is_convex(outline: &Outline, before: DVec2, p: DVec2, after: DVec2) -> bool {
    let (a, b) = ((before - p).normalize_or_zero(), (after - p).normalize_or_zero());
    let reach = 1e-3 * before.distance(p).min(after.distance(p));
    a.dot(b) > SHARPEST_OF_CURVES && outline.contains(p + reach * (a + b).normalize_or_zero())
}
