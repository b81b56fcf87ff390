//! Times a frame on every backend: `cargo run --release --example time_backends`.
#![allow(clippy::unwrap_used)]

use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::occupancy::{DepthLayers, OrthographicView};
use capsense_render::{Backend, DepthRenderer, tessellate};
use glam::{DQuat, DVec3};
use std::sync::Arc;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let slab = Shape::Box { size: DVec3::new(0.15, 0.15, 0.02) };
    let ball = Shape::Sphere { radius: 0.08 };
    // Each triangle of a ball cut into four.
    let ball_mesh = tessellate(&ball)?;
    let mesh = Shape::Mesh(Arc::new(refined(&ball_mesh)));
    let capsule = Shape::Capsule { radius: 0.03, length: 0.2 };
    for (name, shape, pixels) in [
        ("box, 12 triangles", slab, 64),
        ("capsule, 2176", capsule, 64),
        ("ball, 2048", ball, 64),
        ("mesh, 8192", mesh.clone(), 64),
        ("mesh, 8192", mesh, 256),
    ] {
        for backend in [Backend::Cpu, Backend::Gpu] {
            match milliseconds(backend, pixels, &shape) {
                Ok((description, median)) => {
                    println!("{name:18} {pixels:4}x{pixels:<4} {median:8.4} ms  {description}")
                }
                Err(error) => println!("{name:18} {pixels:4}x{pixels:<4} {error}"),
            }
        }
    }
    Ok(())
}

/// What drew, and the median time of a frame after warming up.
fn milliseconds(
    backend: Backend,
    pixels: usize,
    shape: &Shape,
) -> Result<(String, f64), Box<dyn std::error::Error>> {
    let domain = Aabb { min: DVec3::new(-0.25, -0.25, -0.05), max: DVec3::new(0.25, 0.25, 0.45) };
    let view = OrthographicView { domain, width: pixels, height: pixels };
    let mut renderer = DepthRenderer::new(backend, view, std::slice::from_ref(shape))?;
    let mut layers = DepthLayers::empty(view, 1);
    let mut times = Vec::new();
    for frame in 0..600 {
        let angle = 0.01 * frame as f64;
        let pose = Pose {
            translation: DVec3::new(0.05 * angle.sin(), 0.0, 0.2),
            rotation: DQuat::from_axis_angle(DVec3::new(1.0, 1.0, 0.0).normalize(), 0.3 + 0.1 * angle),
        };
        let start = Instant::now();
        renderer.render(&[pose], &mut layers)?;
        if frame >= 100 {
            times.push(start.elapsed().as_secs_f64() * 1e3);
        }
    }
    times.sort_by(f64::total_cmp);
    Ok((renderer.description().to_owned(), times[times.len() / 2]))
}

fn refined(mesh: &capsense_core::geometry::TriangleMesh) -> capsense_core::geometry::TriangleMesh {
    let mut vertices = mesh.vertices().to_vec();
    let mut middles = std::collections::HashMap::new();
    let mut triangles = Vec::new();
    for &[a, b, c] in mesh.triangles() {
        let mut middle = |p: u32, q: u32| {
            *middles.entry((p.min(q), p.max(q))).or_insert_with(|| {
                vertices.push(0.5 * (vertices[p as usize] + vertices[q as usize]));
                vertices.len() as u32 - 1
            })
        };
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    capsense_core::geometry::TriangleMesh::new(vertices, triangles).unwrap()
}
