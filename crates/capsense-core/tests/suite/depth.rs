//! Where segments cross what a depth camera sees.

use crate::common::{DOMAIN, bar, depth_of_boxes};
use approx::assert_abs_diff_eq;
use capsense_core::geometry::Aabb;
use capsense_core::glam::DVec3;
use capsense_core::occupancy::{DepthLayers, OrthographicView, Span, Surfaces};
use proptest::prelude::*;

/// A slab between two tilted planes that fills the view.
fn slab(pixels: [usize; 2]) -> DepthLayers {
    let view = OrthographicView { domain: DOMAIN, width: pixels[0], height: pixels[1] };
    let mut depth = DepthLayers::empty(view, 1);
    let (front, back) = depth.layer_mut(0);
    for pixel in 0..pixels[0] * pixels[1] {
        let at = view.pixel_centre(pixel % pixels[0], pixel / pixels[0]);
        front[pixel] = (0.1 + 0.3 * at.x - 0.2 * at.y) as f32;
        back[pixel] = (0.2 + 0.3 * at.x - 0.2 * at.y) as f32;
    }
    depth
}

proptest! {
    /// Away from the image's border, bilinear interpolation finds the planes exactly.
    #[test]
    fn planes_are_met_where_they_are(
        x in -0.2..0.2, y in -0.2..0.2, dx in -0.04..0.04, dy in -0.04..0.04, z in -0.05..0.15, dz in 0.2..0.3,
    ) {
        let depth = slab([37, 53]);
        let (a, b) = (DVec3::new(x, y, z), DVec3::new(x + dx, y + dy, z + dz));
        let height = |p: DVec3| p.z - 0.3 * p.x + 0.2 * p.y;
        let (from, to) = (height(a), height(b));
        let at = |level: f64| ((level - from) / (to - from)).clamp(0.0, 1.0);
        let (enter, exit) = (at(0.1), at(0.2));
        match depth.span(0, a, b) {
            Some(span) => {
                assert_abs_diff_eq!(span.enter, enter, epsilon = 1e-5);
                assert_abs_diff_eq!(span.exit, exit, epsilon = 1e-5);
            }
            None => prop_assert!(exit - enter < 1e-5),
        }
        prop_assert_eq!(depth.contains(0, a), 0.1 < from && from < 0.2);
    }

    /// Spans lie in order, and a reversed segment sees the same part.
    #[test]
    fn spans_do_not_depend_on_direction(a in prop::array::uniform3(-0.2..0.2), b in prop::array::uniform3(-0.2..0.2)) {
        let depth = depth_of_boxes([33, 21], &[bar(0.01, 0.03)]);
        let (a, b) = (DVec3::from(a), DVec3::from(b));
        match (depth.span(0, a, b), depth.span(0, b, a)) {
            (Some(there), Some(back)) => {
                prop_assert!(0.0 <= there.enter && there.enter < there.exit && there.exit <= 1.0);
                assert_abs_diff_eq!(there.enter, 1.0 - back.exit, epsilon = 1e-6);
                assert_abs_diff_eq!(there.exit, 1.0 - back.enter, epsilon = 1e-6);
            }
            (None, None) => {}
            (there, back) => prop_assert!(there.or(back).is_some_and(|s| s.exit - s.enter < 1e-6)),
        }
    }
}

#[test]
fn a_silhouette_is_no_surface() {
    let depth = depth_of_boxes([50, 50], &[bar(0.1, 0.0)]);
    let beside = DVec3::new(0.1, 0.0, 0.0);
    // Passes the box at a distance, although it starts below and ends beside it.
    assert_eq!(depth.span(0, beside, beside + DVec3::new(0.0, 0.0, 0.3)), None);
    // Enters through the side wall, half way along.
    let Span { enter, exit } =
        depth.span(0, DVec3::new(0.1, 0.0, 0.11), DVec3::new(0.05, 0.0, 0.11)).unwrap();
    assert_abs_diff_eq!(enter, 0.5, epsilon = 0.101);
    assert_eq!(exit, 1.0);
}

#[test]
fn bounds_hold_every_pixel() {
    let solid = bar(0.1, 0.05);
    let bounds = depth_of_boxes([64, 48], &[solid]).bounds(0);
    let pixel = DVec3::new(0.5 / 64.0, 0.5 / 48.0, 2e-5);
    assert!(
        bounds.min.cmpge(solid.min - pixel).all() && bounds.max.cmple(solid.max + pixel).all(),
        "{bounds:?}"
    );
    assert!(
        bounds.min.cmple(solid.min + pixel).all() && bounds.max.cmpge(solid.max - pixel).all(),
        "{bounds:?}"
    );
    assert_eq!(depth_of_boxes([8, 8], &[bar(3.0, 3.0)]).bounds(0), Aabb::EMPTY);
}

#[test]
fn depths_that_are_no_surface_are_named() {
    let mut depth = depth_of_boxes([8, 4], &[bar(0.1, 0.0), bar(0.2, 0.0)]);
    assert_eq!(depth.validate(), Ok(()));
    depth.layer_mut(1).0[8 * 2 + 3] = f32::NAN;
    let error = depth.validate().unwrap_err();
    assert_eq!((error.object, error.column, error.row), (1, 3, 2));
    depth.layer_mut(1).0[8 * 2 + 3] = 0.4;
    depth.layer_mut(1).1[8 * 2 + 3] = 0.3;
    assert!(depth.validate().unwrap_err().to_string().contains("column 3, row 2"));
}

#[test]
fn the_nearest_object_is_visible_and_back_filling_reaches_the_wall() {
    let mut depth = depth_of_boxes([8, 8], &[bar(0.2, 0.0), bar(0.1, 0.1)]);
    let visible = depth.visible_objects();
    let at = |column: usize, row: usize| visible[row * 8 + column];
    assert_eq!((at(0, 0), at(4, 3), at(4, 5)), (None, Some(0), Some(1)));
    depth.back_fill();
    assert_abs_diff_eq!(depth.bounds(0).max.z, DOMAIN.max.z, epsilon = 1e-4);
    assert_abs_diff_eq!(depth.bounds(0).min.z, 0.2, epsilon = 1e-4);
}
