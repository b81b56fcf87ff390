//! Depth layers against closed forms, on both paths; and what happens at the borders and with bad input.
#![allow(missing_docs, clippy::unwrap_used, clippy::panic)]

mod common;

use capsense_core::geometry::{Aabb, Pose, Shape, TriangleMesh};
use capsense_core::occupancy::{DepthLayers, OrthographicView, Surfaces};
use capsense_render::tessellate::CHORD_ERROR;
use capsense_render::{Backend, CpuRenderer, DepthRenderer, GpuOptions, GpuRenderer, RenderError};
use common::{DOMAIN, both, depth_rounding, made, near_silhouette, pose, view};
use glam::{DQuat, DVec3};
use proptest::prelude::*;
use std::sync::Arc;

const NAMES: [&str; 2] = ["GPU", "CPU"];

#[test]
fn a_slanted_plane_has_the_depth_of_its_equation() {
    // Larger than the domain, so that there are no silhouettes; no symmetry that would hide a flip.
    let z = |x: f64, y: f64| 0.2 + 0.4 * x - 0.25 * y;
    let corners = [(-0.3, -0.4), (0.35, -0.4), (0.35, 0.3), (-0.3, 0.3)];
    let vertices = corners.iter().map(|&(x, y)| DVec3::new(x, y, z(x, y))).collect();
    let mesh = TriangleMesh::new(vertices, vec![[0, 1, 2], [0, 3, 2]]).unwrap();
    for (width, height) in [(64, 64), (97, 61), (1, 1), (5, 300)] {
        let view = view(width, height);
        let all = both(view, &[Shape::Mesh(Arc::new(mesh.clone()))], &[Pose::IDENTITY]);
        // The plane falls by 0.47 m a metre.
        let tolerance = 1e-6 + 0.5 * depth_rounding() * view.pixel_size().max_element();
        for (name, layers) in NAMES.iter().zip(&all) {
            for pixel in 0..width * height {
                let centre = view.pixel_centre(pixel % width, pixel / width);
                let exact = z(centre.x, centre.y);
                for depth in [layers.front(0)[pixel], layers.back(0)[pixel]] {
                    let error = (f64::from(depth) - exact).abs();
                    assert!(
                        error <= tolerance,
                        "{name}, {width}x{height}, {centre}: {depth} instead of {exact}"
                    );
                }
            }
        }
    }
}

#[test]
fn a_sphere_is_round_within_the_chord_error() {
    let (radius, centre) = (0.11, DVec3::new(0.03, -0.05, 0.2));
    let view = view(97, 61);
    let all = both(view, &[Shape::Sphere { radius }], &[pose(centre.to_array(), [1.0, 2.0, 3.0], 50.0)]);
    for (name, layers) in NAMES.iter().zip(&all) {
        for pixel in 0..view.width * view.height {
            let at = view.pixel_centre(pixel % view.width, pixel / view.width);
            let beside = (at - centre.truncate()).length();
            let (front, back) = (f64::from(layers.front(0)[pixel]), f64::from(layers.back(0)[pixel]));
            if front.is_finite() {
                for z in [front, back] {
                    let error = ((at.extend(z) - centre).length() - radius).abs();
                    let rounding = depth_rounding() * view.pixel_size().max_element();
                    assert!(error <= CHORD_ERROR * radius + rounding + 1e-6, "{name} at {at}: {error} m off");
                }
                assert!(front <= centre.z + 1e-6 && back >= centre.z - 1e-6, "{name} at {at}");
                assert!(beside <= (1.0 + CHORD_ERROR) * radius, "{name} at {at}: should miss");
            } else {
                assert!(beside >= (1.0 - CHORD_ERROR) * radius - 1e-4, "{name} at {at}: should hit");
            }
        }
    }
}

/// Layers of one unrotated box given by its corners.
fn of_box(view: OrthographicView, min: [f64; 3], max: [f64; 3]) -> [DepthLayers; 2] {
    let (min, max) = (DVec3::from_array(min), DVec3::from_array(max));
    both(view, &[Shape::Box { size: max - min }], &[Pose::at(0.5 * (min + max))])
}

#[test]
fn layers_are_cut_to_the_domain() {
    let (near, far) = (DOMAIN.min.z as f32, DOMAIN.max.z as f32);
    // Extent in z, and the layers to be seen where the box is.
    for (low, high, expected) in [
        (-0.10, 0.00, Some((near, 0.0))),
        (0.40, 0.60, Some((0.40, far))),
        (-5.0, 50.0, Some((near, far))),
        (0.10, 0.12, Some((0.10, 0.12))),
        (-0.30, -0.06, None),
        (0.46, 0.80, None),
    ] {
        // The left half of the image and far beyond its border; no pixel centre lies on the edge.
        let all = of_box(view(16, 8), [-3.0, -0.5, low], [0.0, 0.5, high]);
        for (name, layers) in NAMES.iter().zip(&all) {
            for pixel in 0..16 * 8 {
                let seen = (layers.front(0)[pixel], layers.back(0)[pixel]);
                match expected {
                    Some((front, back)) if pixel % 16 < 8 => {
                        let error = (seen.0 - front).abs().max((seen.1 - back).abs());
                        // Depth has 24 bits of the object's extent of up to 55 m.
                        let tolerance = 1e-6 + 1e-7 * (high - low) as f32;
                        assert!(error <= tolerance, "{name}, {low}..{high}, pixel {pixel}: {seen:?}");
                    }
                    _ => assert_eq!(
                        seen,
                        (f32::INFINITY, f32::NEG_INFINITY),
                        "{name}, {low}..{high}, pixel {pixel}"
                    ),
                }
            }
        }
    }
}

#[test]
fn the_silhouette_is_where_the_sides_are() {
    // 16x8 pixels of 31.25 by 62.5 mm; edges a tenth of a pixel beside centres.
    let x = |column: f64| -0.25 + column * 0.03125;
    let y = |row: f64| -0.25 + row * 0.0625;
    let all = of_box(view(16, 8), [x(2.4), y(1.6), 0.1], [x(6.6), y(3.4), 0.2]);
    for (name, layers) in NAMES.iter().zip(&all) {
        for pixel in 0..16 * 8 {
            let inside = (2..=6).contains(&(pixel % 16)) && (2..=2).contains(&(pixel / 16));
            assert_eq!(layers.front(0)[pixel].is_finite(), inside, "{name}, pixel {pixel}");
        }
    }
}

#[test]
fn a_mesh_far_from_its_origin_is_as_sharp_as_any() {
    let away = DVec3::new(1000.0, -2000.0, 500.0);
    let (shape, at) =
        (Shape::Box { size: DVec3::splat(0.1) }, pose([0.02, 0.03, 0.2], [1.0, 1.0, 0.3], 35.0));
    let mesh = capsense_render::tessellate(&shape).unwrap();
    let vertices = mesh.vertices().iter().map(|&v| v + away).collect();
    let moved = Shape::Mesh(Arc::new(TriangleMesh::new(vertices, mesh.triangles().to_vec()).unwrap()));
    let moved_at = Pose { translation: at.translation - at.rotation * away, ..at };
    let view = view(40, 40);
    for (name, layers) in NAMES.iter().zip(&both(view, &[shape, moved], &[at, moved_at])) {
        for pixel in (0..40 * 40).filter(|&p| !near_silhouette(&view, layers.front(0), p)) {
            let error = (layers.front(0)[pixel] - layers.front(1)[pixel]).abs();
            let rounding = 4.0 * depth_rounding() * view.pixel_size().max_element();
            assert!(f64::from(error) <= 1e-6 + rounding, "{name}, pixel {pixel}: {error} m");
        }
    }
}

#[test]
fn a_flat_mesh_from_its_face_its_edge_and_between() {
    let square = |corners: [[f64; 3]; 4]| {
        let vertices = corners.map(DVec3::from_array).to_vec();
        Shape::Mesh(Arc::new(TriangleMesh::new(vertices, vec![[0, 1, 2], [0, 2, 3]]).unwrap()))
    };
    let face_on = square([[-0.1, -0.1, 0.0], [0.1, -0.1, 0.0], [0.1, 0.1, 0.0], [-0.1, 0.1, 0.0]]);
    let shapes = vec![face_on; 3];
    let turned = |degrees| pose([0.0, 0.0, 0.2], [0.0, 1.0, 0.0], degrees);
    for (name, layers) in NAMES.iter().zip(&both(view(32, 32), &shapes, &[0.0, 90.0, 45.0].map(turned))) {
        let centre = 16 * 32 + 16;
        assert!((layers.front(0)[centre] - 0.2).abs() < 1e-6, "{name}: {}", layers.front(0)[centre]);
        assert!((layers.back(0)[centre] - 0.2).abs() < 1e-6, "{name}");
        assert!(
            layers.front(1).iter().all(|z| z.is_infinite()),
            "{name}: a surface seen edge-on has no pixels"
        );
        // Tilted by 45 degrees it falls by 1 m a metre and is seen up to the ends of its extent in z.
        for pixel in 0..32 * 32 {
            let at = layers.view().pixel_centre(pixel % 32, pixel / 32);
            let inside = at.x.abs() < 0.1 * 0.5_f64.sqrt() && at.y.abs() < 0.1;
            let (front, back) = (layers.front(2)[pixel], layers.back(2)[pixel]);
            assert_eq!((front.is_finite(), back.is_finite()), (inside, inside), "{name} at {at}");
            if inside {
                let error = (f64::from(front) - (0.2 - at.x)).abs().max(f64::from(back - front));
                let rounding = depth_rounding() * layers.view().pixel_size().max_element();
                assert!(error < 1e-6 + rounding, "{name} at {at}: {front}, {back}");
            }
        }
    }
}

#[test]
fn a_renderer_can_move_to_another_thread() {
    fn is_send<T: Send>() {}
    is_send::<DepthRenderer>();
}

#[test]
fn an_empty_scene_has_no_layers() {
    for backend in [Backend::Auto, Backend::Gpu, Backend::Cpu] {
        let mut renderer = made(DepthRenderer::new(backend, view(64, 64), &[]));
        let mut layers = DepthLayers::empty(view(8, 8), 3);
        renderer.render(&[], &mut layers).unwrap();
        assert_eq!(layers, DepthLayers::empty(view(64, 64), 0));
    }
}

#[test]
fn a_renderer_takes_another_scene() {
    let sphere = Shape::Sphere { radius: 0.1 };
    let slab = Shape::Box { size: DVec3::new(0.3, 0.2, 0.1) };
    let at = Pose::at(DVec3::new(0.0, 0.05, 0.2));
    for backend in [Backend::Gpu, Backend::Cpu] {
        let mut renderer = made(DepthRenderer::new(backend, view(16, 16), std::slice::from_ref(&sphere)));
        let (mut layers, mut fresh) = (DepthLayers::empty(view(1, 1), 0), DepthLayers::empty(view(1, 1), 0));
        renderer.render(&[at], &mut layers).unwrap();
        for (shapes, view) in [
            (vec![slab.clone(), sphere.clone(), slab.clone()], view(97, 61)),
            (vec![], view(3, 3)),
            (vec![slab.clone()], view(64, 32)),
        ] {
            let poses = vec![at; shapes.len()];
            renderer.set_scene(view, &shapes).unwrap();
            renderer.render(&poses, &mut layers).unwrap();
            made(DepthRenderer::new(backend, view, &shapes)).render(&poses, &mut fresh).unwrap();
            assert_eq!(layers, fresh);
            assert_eq!(renderer.view(), &view);
        }
        let failed = renderer.set_scene(view(8, 8), &[Shape::Sphere { radius: 0.0 }]);
        assert!(matches!(failed, Err(RenderError::Shape { object: 0, .. })), "{failed:?}");
        renderer.render(&[at], &mut layers).unwrap();
        assert_eq!(layers, fresh, "a refused scene must leave the old one");
    }
}

#[test]
fn bad_input_is_refused() {
    let shapes = [Shape::Sphere { radius: 0.1 }, Shape::Sphere { radius: 0.1 }];
    for backend in [Backend::Auto, Backend::Gpu, Backend::Cpu] {
        let flat = Aabb { min: DOMAIN.min, max: DOMAIN.max.with_z(DOMAIN.min.z) };
        let endless = Aabb { min: DOMAIN.min, max: DOMAIN.max.with_x(f64::INFINITY) };
        for bad in [
            view(0, 4),
            view(4, 0),
            OrthographicView { domain: flat, ..view(4, 4) },
            OrthographicView { domain: endless, ..view(4, 4) },
            OrthographicView { domain: Aabb::EMPTY, ..view(4, 4) },
        ] {
            let error = DepthRenderer::new(backend, bad, &shapes).unwrap_err();
            assert!(matches!(error, RenderError::InvalidView { .. }), "{error}");
        }
        let mut renderer = made(DepthRenderer::new(backend, view(4, 4), &shapes));
        let mut layers = DepthLayers::empty(view(4, 4), 2);
        assert_eq!(
            renderer.render(&[Pose::IDENTITY], &mut layers),
            Err(RenderError::PoseCount { poses: 1, objects: 2 })
        );
        for bad in [
            Pose::at(DVec3::new(0.0, f64::NAN, 0.0)),
            Pose { rotation: DQuat::from_xyzw(0.0, 0.0, 0.0, 2.0), ..Pose::IDENTITY },
        ] {
            assert_eq!(
                renderer.render(&[Pose::IDENTITY, bad], &mut layers),
                Err(RenderError::InvalidPose { object: 1 })
            );
        }
    }
}

#[test]
fn an_image_beyond_the_adapter_is_refused_by_the_gpu_and_drawn_by_the_cpu() {
    let huge = view(1 << 20, 1);
    let shapes = [Shape::Sphere { radius: 0.1 }];
    let error = DepthRenderer::new(Backend::Gpu, huge, &shapes).unwrap_err();
    assert!(matches!(error, RenderError::LimitExceeded { .. }), "{error}");
    let mut renderer = made(DepthRenderer::new(Backend::Auto, huge, &shapes));
    assert_eq!(renderer.description(), "CPU rasteriser");
    let mut layers = DepthLayers::empty(huge, 1);
    renderer.render(&[Pose::IDENTITY], &mut layers).unwrap();
    assert!(layers.front(0)[1 << 19].is_finite());
}

#[test]
fn auto_never_chooses_a_software_adapter() {
    let shapes = [Shape::Sphere { radius: 0.1 }];
    let auto = made(DepthRenderer::new(Backend::Auto, view(4, 4), &shapes));
    let real =
        GpuRenderer::new(GpuOptions { allow_software: false, ..Default::default() }, view(4, 4), &shapes);
    match real {
        Ok(real) => assert_eq!(auto.description(), real.description()),
        Err(error) => {
            assert!(
                matches!(error, RenderError::OnlySoftwareAdapter(_) | RenderError::NoAdapter(_)),
                "{error}"
            );
            assert_eq!(auto.description(), "CPU rasteriser");
            assert!(!auto.uses_graphics_adapter());
        }
    }
    let any = made(DepthRenderer::new(Backend::Gpu, view(4, 4), &shapes));
    assert!(any.uses_graphics_adapter() && !any.description().is_empty());
}

/// Where a line along z at (x, y) enters and leaves a box; +∞ and -∞ when it misses.
fn ray_box(size: DVec3, pose: &Pose, x: f64, y: f64) -> (f64, f64) {
    let origin = pose.object_from_sensor(DVec3::new(x, y, 0.0));
    let direction = pose.rotation.inverse() * DVec3::Z;
    let (a, b) = ((-0.5 * size - origin) / direction, (0.5 * size - origin) / direction);
    let (enter, leave) = (a.min(b).max_element(), a.max(b).min_element());
    if enter < leave { (enter, leave) } else { (f64::INFINITY, f64::NEG_INFINITY) }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn random_boxes_are_where_rays_meet_them(
        size in prop::array::uniform3(0.01..0.3_f64),
        position in prop::array::uniform3(-0.15..0.15_f64),
        rotation in prop::array::uniform4(-1.0..1.0_f64).prop_filter("of some length", |q| {
            q.iter().map(|x| x * x).sum::<f64>() > 0.01
        }),
        width in 1..60_usize,
        height in 1..60_usize,
    ) {
        let size = DVec3::from_array(size);
        let rotation = DQuat::from_array(rotation).normalize();
        let pose = Pose { translation: DVec3::from_array(position), rotation };
        // A domain deep enough that nothing is cut off in z.
        let domain = Aabb { min: DVec3::new(-0.25, -0.2, -1.0), max: DVec3::new(0.25, 0.2, 1.0) };
        let view = OrthographicView { domain, width, height };
        let mut layers = DepthLayers::empty(view, 1);
        CpuRenderer::new(view, &[Shape::Box { size }]).unwrap().render(&[pose], &mut layers).unwrap();
        layers.validate().unwrap();

        let exact: Vec<_> = (0..width * height)
            .map(|pixel| view.pixel_centre(pixel % width, pixel / width))
            .map(|at| ray_box(size, &pose, at.x, at.y))
            .collect();
        let fronts: Vec<_> = exact.iter().map(|e| e.0 as f32).collect();
        let backs: Vec<_> = exact.iter().map(|e| e.1 as f32).collect();
        let missed = |pixel: usize| layers.front(0)[pixel].is_infinite();
        for pixel in 0..width * height {
            // The outline is exact to rounding: hits and misses agree unless the ray passes within a micrometre.
            if exact[pixel].0.is_finite() == missed(pixel) {
                let at = view.pixel_centre(pixel % width, pixel / width);
                let nudged = [(1e-6, 0.0), (-1e-6, 0.0), (0.0, 1e-6), (0.0, -1e-6)]
                    .map(|(dx, dy)| ray_box(size, &pose, at.x + dx, at.y + dy).0.is_finite());
                prop_assert!(nudged.contains(&!missed(pixel)), "pixel {pixel}: hit or miss");
            }
            if !near_silhouette(&view, &fronts, pixel) && !missed(pixel) {
                let error = (layers.front(0)[pixel] - fronts[pixel]).abs();
                prop_assert!(error <= 2e-6, "front of pixel {pixel}: {error} m");
            }
            if !near_silhouette(&view, &backs, pixel) && !missed(pixel) {
                let error = (layers.back(0)[pixel] - backs[pixel]).abs();
                prop_assert!(error <= 2e-6, "back of pixel {pixel}: {error} m");
            }
        }
    }
}
