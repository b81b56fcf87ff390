//! Scenes and comparisons shared by the tests of the renderers.
#![allow(dead_code, unreachable_pub, missing_docs, clippy::unwrap_used, clippy::panic)]

use capsense_core::geometry::{Aabb, Pose, Shape, TriangleMesh};
use capsense_core::occupancy::{DepthLayers, OrthographicView, Surfaces};
use capsense_render::{CpuRenderer, GpuOptions, GpuRenderer, RenderError};
use glam::{DQuat, DVec3};
use std::sync::{Arc, OnceLock};

/// Neighbouring depths further apart than this many pixel widths are a jump.
const JUMP_IN_PIXELS: f64 = 4.0;

pub const DOMAIN: Aabb = Aabb { min: DVec3::new(-0.25, -0.25, -0.05), max: DVec3::new(0.25, 0.25, 0.45) };

pub fn view(width: usize, height: usize) -> OrthographicView {
    OrthographicView { domain: DOMAIN, width, height }
}

pub fn pose(position: [f64; 3], axis: [f64; 3], degrees: f64) -> Pose {
    let axis = DVec3::from_array(axis).normalize();
    Pose {
        translation: DVec3::from_array(position),
        rotation: DQuat::from_axis_angle(axis, degrees.to_radians()),
    }
}

/// A renderer, or a message that says how to get one.
#[track_caller]
pub fn made<T>(result: Result<T, RenderError>) -> T {
    match result {
        Ok(renderer) => renderer,
        Err(RenderError::NoAdapter(reason)) => {
            panic!("these tests need Vulkan: install mesa-vulkan-drivers and libvulkan1 ({reason})")
        }
        Err(error) => panic!("{error}"),
    }
}

#[track_caller]
pub fn gpu(options: GpuOptions, view: OrthographicView, shapes: &[Shape]) -> GpuRenderer {
    made(GpuRenderer::new(options, view, shapes))
}

/// To what part of a pixel the adapter rounds vertices before it interpolates depth. Hardware does, lavapipe does not
/// (it rounds only to decide which pixels a triangle covers).
pub fn depth_rounding() -> f64 {
    static ROUNDING: OnceLock<f64> = OnceLock::new();
    *ROUNDING.get_or_init(|| {
        let renderer = gpu(GpuOptions::default(), view(1, 1), &[]);
        if renderer.is_software() { 0.0 } else { 1.0 / 256.0 }
    })
}

/// The layers as both renderers draw them, GPU first.
pub fn both(view: OrthographicView, shapes: &[Shape], poses: &[Pose]) -> [DepthLayers; 2] {
    let mut layers = [DepthLayers::empty(view, 0), DepthLayers::empty(view, 0)];
    gpu(GpuOptions::default(), view, shapes).render(poses, &mut layers[0]).unwrap();
    CpuRenderer::new(view, shapes).unwrap().render(poses, &mut layers[1]).unwrap();
    for layers in &layers {
        layers.validate().unwrap();
        assert_eq!(layers.objects(), shapes.len());
    }
    layers
}

/// A closed lumpy surface of 2 * `rings` * (2 * `rings` - 1) * 2 triangles, about 0.1 m across, off its origin.
pub fn lump(rings: usize) -> Shape {
    let segments = 2 * rings;
    let mut vertices = Vec::new();
    for ring in 0..=rings {
        for segment in 0..segments {
            let polar = std::f64::consts::PI * ring as f64 / rings as f64;
            let around = std::f64::consts::TAU * segment as f64 / segments as f64;
            let direction = DVec3::new(polar.sin() * around.cos(), polar.sin() * around.sin(), polar.cos());
            let radius = 0.05 * (1.0 + 0.2 * (3.0 * around).sin() * polar.sin() + 0.1 * (4.0 * polar).cos());
            vertices.push(direction * radius + DVec3::new(0.01, -0.02, 0.03));
        }
    }
    let at = |ring: usize, segment: usize| (ring * segments + segment % segments) as u32;
    let triangles = (0..rings)
        .flat_map(|ring| (0..segments).map(move |segment| (ring, segment)))
        .flat_map(|(r, s)| {
            [[at(r, s), at(r + 1, s), at(r + 1, s + 1)], [at(r, s), at(r + 1, s + 1), at(r, s + 1)]]
        })
        .collect();
    Shape::Mesh(Arc::new(TriangleMesh::new(vertices, triangles).unwrap()))
}

/// Whether a pixel has a neighbour that misses, or a depth jump to one, in a layer.
pub fn near_silhouette(view: &OrthographicView, layer: &[f32], pixel: usize) -> bool {
    match steepness(view, layer, pixel) {
        None => true,
        Some(step) => f64::from(step) > JUMP_IN_PIXELS * view.pixel_size().max_element(),
    }
}

/// The largest change of depth to one of the eight neighbours; `None` when one of the nine misses.
pub fn steepness(view: &OrthographicView, layer: &[f32], pixel: usize) -> Option<f32> {
    let (column, row) = (pixel % view.width, pixel / view.width);
    let rows = row.saturating_sub(1)..(row + 2).min(view.height);
    let columns = column.saturating_sub(1)..(column + 2).min(view.width);
    let mut most = 0.0_f32;
    for neighbour in rows.flat_map(|r| columns.clone().map(move |c| r * view.width + c)) {
        if !layer[neighbour].is_finite() {
            return None;
        }
        most = most.max((layer[neighbour] - layer[pixel]).abs());
    }
    Some(most)
}
