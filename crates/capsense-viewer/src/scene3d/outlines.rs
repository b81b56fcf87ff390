//! Outlines of electrodes as triangles and as lines.

use capsense_core::electrode::Outline;
use glam::DVec2;

/// Sides that a circle is drawn with.
const CIRCLE: usize = 72;

/// The closed polygons of an outline.
fn contours(outline: &Outline) -> Vec<Vec<DVec2>> {
    match outline {
        Outline::Rectangle { center, size } => {
            let corner = |x: f64, y: f64| *center + 0.5 * *size * DVec2::new(x, y);
            vec![vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)]]
        }
        Outline::Disk { center, radius } => {
            let angle = |k: usize| std::f64::consts::TAU * k as f64 / CIRCLE as f64;
            vec![(0..CIRCLE).map(|k| *center + *radius * DVec2::from_angle(angle(k))).collect()]
        }
        Outline::Polygon(corners) => vec![corners.clone()],
        Outline::Contours(contours) => contours.clone(),
    }
}

/// The sides of all polygons.
pub(super) fn border(outline: &Outline) -> Vec<[DVec2; 2]> {
    let sides = |corners: &Vec<DVec2>| {
        let next = corners.iter().cycle().skip(1);
        corners.iter().zip(next).map(|(a, b)| [*a, *b]).collect::<Vec<_>>()
    };
    contours(outline).iter().flat_map(sides).collect()
}

/// What lies inside, as triangles: between two heights at which there are corners, sides bound trapezoids, and inside is
/// what an odd number of sides has passed.
pub(super) fn triangles(outline: &Outline) -> Vec<[DVec2; 3]> {
    let sides = border(outline);
    let mut heights: Vec<f64> = sides.iter().map(|[a, _]| a.y).collect();
    heights.sort_by(f64::total_cmp);
    heights.dedup();
    let mut triangles = Vec::new();
    for band in heights.windows(2) {
        let (low, high) = (band[0], band[1]);
        let at = |[a, b]: [DVec2; 2], y: f64| DVec2::new(a.x + (b.x - a.x) * (y - a.y) / (b.y - a.y), y);
        let mut passed: Vec<[DVec2; 2]> = sides
            .iter()
            .filter(|[a, b]| a.y.min(b.y) <= low && a.y.max(b.y) >= high && a.y != b.y)
            .map(|&side| [at(side, low), at(side, high)])
            .collect();
        passed.sort_by(|a, b| (a[0].x + a[1].x).total_cmp(&(b[0].x + b[1].x)));
        for pair in passed.chunks_exact(2) {
            let ([a, d], [b, c]) = (pair[0], pair[1]);
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    triangles
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(triangles: &[[DVec2; 3]]) -> f64 {
        triangles.iter().map(|[a, b, c]| 0.5 * (*b - *a).perp_dot(*c - *a)).sum()
    }

    #[test]
    fn triangles_cover_what_is_inside_once() {
        let square = |low: f64, high: f64| {
            vec![DVec2::splat(low), DVec2::new(high, low), DVec2::splat(high), DVec2::new(low, high)]
        };
        let ell = [[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]].map(DVec2::from);
        let outlines = [
            (Outline::Rectangle { center: DVec2::new(1.0, 2.0), size: DVec2::new(2.0, 0.5) }, 1.0),
            (Outline::Polygon(ell.to_vec()), 4.0),
            (Outline::Contours(vec![square(-2.0, 2.0), square(-1.0, 1.0), square(-0.5, 0.5)]), 13.0),
        ];
        for (outline, expected) in outlines {
            let triangles = triangles(&outline);
            assert!((area(&triangles) - expected).abs() < 1e-12, "{outline:?}");
            for [a, b, c] in triangles {
                let middle = (a + b + c) / 3.0;
                assert!(outline.contains(middle), "{middle} of {outline:?}");
            }
        }
        let disk = Outline::Disk { center: DVec2::new(0.3, -0.1), radius: 2.0 };
        let part = area(&triangles(&disk)) / (4.0 * std::f64::consts::PI);
        assert!(part < 1.0 && part > 0.995, "{part}");
    }
}
