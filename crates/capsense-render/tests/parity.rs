//! The GPU and the CPU draw the same layers.
#![allow(missing_docs, clippy::unwrap_used, clippy::panic)]

mod common;

use capsense_core::geometry::{Pose, Shape};
use capsense_core::occupancy::{DepthLayers, Surfaces};
use capsense_render::{CpuRenderer, GpuOptions};
use common::{both, depth_rounding, gpu, lump, near_silhouette, pose, steepness, view};
use glam::DVec3;

/// Depths may differ by this much in metres.
const DEPTH_TOLERANCE: f32 = 1e-5;

/// Hardware rounds vertices to this part of a pixel. At a crease (which is no silhouette) the depth then differs by
/// this part of the change from one pixel to the next.
const VERTEX_ROUNDING: f32 = 1.0 / 256.0;

/// Overlapping objects of every kind; some reach beyond the domain on a side, in front and behind.
fn crowd() -> (Vec<Shape>, Vec<Pose>) {
    let objects = [
        (Shape::Box { size: DVec3::new(0.15, 0.15, 0.02) }, pose([0.01, 0.02, 0.2], [1.0, 0.2, 0.1], 25.0)),
        (Shape::Sphere { radius: 0.07 }, pose([0.05, -0.04, 0.15], [0.0, 0.0, 1.0], 10.0)),
        (Shape::Capsule { radius: 0.03, length: 0.2 }, pose([-0.03, 0.0, 0.3], [1.0, 1.0, 0.0], 70.0)),
        (Shape::Cylinder { radius: 0.05, length: 0.12 }, pose([-0.1, -0.1, 0.1], [1.0, -0.3, 0.2], 60.0)),
        (lump(24), pose([0.0, 0.03, 0.08], [0.3, 1.0, 0.5], 130.0)),
        (Shape::Box { size: DVec3::new(0.1, 0.2, 0.1) }, pose([0.24, 0.1, 0.25], [1.0, 1.0, 1.0], 40.0)),
        (Shape::Box { size: DVec3::new(0.2, 0.1, 0.1) }, pose([0.05, -0.15, 0.44], [1.0, 0.5, 0.0], 33.0)),
        (Shape::Sphere { radius: 0.08 }, pose([-0.12, 0.12, -0.06], [1.0, 0.0, 0.0], 0.0)),
    ];
    objects.into_iter().unzip()
}

/// Compares away from silhouettes; there must be some pixels to compare.
fn compare(gpu: &DepthLayers, cpu: &DepthLayers, at_least: usize) {
    let view = cpu.view();
    let (mut compared, mut close) = (0, 0);
    for object in 0..cpu.objects() {
        for (layer, gpu, cpu) in
            [("front", gpu.front(object), cpu.front(object)), ("back", gpu.back(object), cpu.back(object))]
        {
            for pixel in 0..view.width * view.height {
                if near_silhouette(view, cpu, pixel) || near_silhouette(view, gpu, pixel) {
                    continue;
                }
                let difference = (gpu[pixel] - cpu[pixel]).abs();
                // A single pixel has no neighbours to tell the slope; then one up to 45 degrees is assumed.
                let step = match view.width * view.height {
                    1 => view.pixel_size().max_element() as f32,
                    _ => steepness(view, cpu, pixel).unwrap(),
                };
                let rounding = VERTEX_ROUNDING * step;
                assert!(
                    difference <= DEPTH_TOLERANCE + rounding,
                    "{layer} of object {object} at column {}, row {}: {} on the GPU, {} on the CPU",
                    pixel % view.width,
                    pixel / view.width,
                    gpu[pixel],
                    cpu[pixel],
                );
                compared += 1;
                close += usize::from(difference <= DEPTH_TOLERANCE);
            }
        }
    }
    println!("{}x{}: {close} of {compared} within {DEPTH_TOLERANCE} m", view.width, view.height);
    assert!(compared >= at_least, "only {compared} pixels compared");
    if depth_rounding() == 0.0 && compared > 1000 {
        assert!(close as f64 >= 0.999 * compared as f64, "{close} of {compared} within {DEPTH_TOLERANCE} m");
    }
}

fn assert_same_visible_objects(gpu: &DepthLayers, cpu: &DepthLayers) {
    let (gpu, cpu) = (gpu.visible_objects(), cpu.visible_objects());
    let different = gpu.iter().zip(&cpu).filter(|(a, b)| a != b).count();
    assert!(different as f64 <= 1e-3 * cpu.len() as f64, "{different} of {} pixels differ", cpu.len());
}

#[test]
fn a_crowd_looks_the_same_at_odd_sizes() {
    let (shapes, poses) = crowd();
    for (width, height, at_least) in
        [(64, 64, 2000), (97, 61, 2000), (1, 1, 2), (16, 1024, 2000), (255, 257, 20_000), (3, 2, 0)]
    {
        let [gpu, cpu] = both(view(width, height), &shapes, &poses);
        compare(&gpu, &cpu, at_least);
        assert_same_visible_objects(&gpu, &cpu);
    }
}

#[test]
fn objects_that_do_not_fit_into_one_atlas_are_drawn_in_pages() {
    let shapes: Vec<_> = (0..40)
        .map(|k| match k % 3 {
            0 => Shape::Box { size: DVec3::new(0.05, 0.03 + 0.001 * k as f64, 0.02) },
            1 => Shape::Sphere { radius: 0.01 + 0.001 * k as f64 },
            _ => Shape::Cylinder { radius: 0.02, length: 0.05 + 0.001 * k as f64 },
        })
        .collect();
    let poses: Vec<_> = (0..40)
        .map(|k| {
            let (row, column) = (k / 8, k % 8);
            let position = [-0.2 + 0.055 * column as f64, -0.2 + 0.1 * row as f64, 0.01 * k as f64];
            pose(position, [1.0, 0.3 * row as f64, 0.2 * column as f64], 17.0 * k as f64)
        })
        .collect();
    let view = view(64, 64);
    let mut cpu = DepthLayers::empty(view, 40);
    CpuRenderer::new(view, &shapes).unwrap().render(&poses, &mut cpu).unwrap();
    // One page in a row; one page of several rows; 7 pages of 2 by 3 tiles; a page for each object.
    for max_atlas_dimension in [None, Some(1024), Some(192), Some(64)] {
        let options = GpuOptions { max_atlas_dimension, ..Default::default() };
        let mut renderer = gpu(options, view, &shapes);
        let mut layers = DepthLayers::empty(view, 40);
        // Twice, so that whatever one frame leaves behind shows in the next.
        for _ in 0..2 {
            renderer.render(&poses, &mut layers).unwrap();
            layers.validate().unwrap();
            compare(&layers, &cpu, 1000);
            assert_same_visible_objects(&layers, &cpu);
        }
    }
}

#[test]
fn frames_do_not_leave_traces_in_later_ones() {
    let (shapes, poses) = crowd();
    let view = view(48, 40);
    let mut gpu = gpu(GpuOptions::default(), view, &shapes);
    let mut cpu = CpuRenderer::new(view, &shapes).unwrap();
    let [expected_gpu, expected_cpu] = both(view, &shapes, &poses);
    let moved: Vec<_> = poses
        .iter()
        .map(|p| Pose {
            translation: -p.translation + DVec3::new(0.0, 0.0, 0.3),
            rotation: p.rotation.inverse(),
        })
        .collect();
    let mut layers = DepthLayers::empty(view, shapes.len());
    for _ in 0..3 {
        gpu.render(&moved, &mut layers).unwrap();
        gpu.render(&poses, &mut layers).unwrap();
        assert_eq!(layers, expected_gpu);
        cpu.render(&moved, &mut layers).unwrap();
        cpu.render(&poses, &mut layers).unwrap();
        assert_eq!(layers, expected_cpu);
    }
}
