//! Depth layers drawn by the CPU: the twin of the GPU path, and the only one where there is no Vulkan.
//!
//! The sampling rule is that of graphics hardware: a pixel belongs to a triangle when its centre lies inside, and a
//! centre exactly on an edge counts for the left and the top edge only (row 0, at the smallest y, is on top). Each
//! triangle is scanned row by row. The two ends of a row's span come from the triangle's edges, always computed from the
//! end of smaller y, so that neighbouring triangles leave no gap. All of this is in double precision, where hardware
//! rounds vertices to 1/256 of a pixel; at silhouettes the two may therefore differ by a pixel.

use crate::error::RenderError;
use crate::scene::{RenderScene, SceneObject, check_view, clamp_pixel};
use capsense_core::geometry::{Pose, Shape};
use capsense_core::occupancy::{DepthLayers, OrthographicView, Surfaces};
use glam::{DMat3, DVec2, DVec3};

/// Objects that stay this far inside the domain in z (metres) need not be cut to it.
const CUT_MARGIN: f64 = 1e-6;

/// Draws depth layers without a GPU.
#[derive(Clone, Debug)]
pub struct CpuRenderer {
    view: OrthographicView,
    scene: RenderScene,
    /// Vertices of the object being drawn: x and y in pixels, z in metres.
    pixels: Vec<DVec3>,
}

impl CpuRenderer {
    /// Tessellates the shapes and reserves all memory that frames need.
    ///
    /// # Errors
    /// When the view has no pixels or no extent, or a shape an impossible length.
    pub fn new(view: OrthographicView, shapes: &[Shape]) -> Result<Self, RenderError> {
        check_view(&view)?;
        let scene = RenderScene::new(shapes)?;
        let most = scene.objects().iter().map(|o| o.positions().len()).max().unwrap_or(0);
        Ok(Self { view, scene, pixels: Vec::with_capacity(most) })
    }

    /// What the frames show.
    pub fn view(&self) -> &OrthographicView {
        &self.view
    }

    /// Draws one frame: `poses[k]` is where object k stands. Layers of another view or number of objects are replaced.
    ///
    /// # Errors
    /// When there is not one valid pose per object; `out` is left as it was.
    pub fn render(&mut self, poses: &[Pose], out: &mut DepthLayers) -> Result<(), RenderError> {
        self.scene.check_poses(poses)?;
        prepare(out, &self.view, poses.len());
        for (index, (object, pose)) in self.scene.objects().iter().zip(poses).enumerate() {
            let bounds = object.bounds(pose);
            if !bounds.intersects(&self.view.domain) {
                continue;
            }
            let (front, back) = out.layer_mut(index);
            let mut target = Target { front, back, width: self.view.width, height: self.view.height };
            project(&self.view, object, pose, &mut self.pixels);
            for corners in object.triangles() {
                target.draw(corners.map(|v| self.pixels[v as usize]));
            }
            let domain = &self.view.domain;
            if bounds.min.z < domain.min.z + CUT_MARGIN || bounds.max.z > domain.max.z - CUT_MARGIN {
                let (near, far) = (domain.min.z as f32, domain.max.z as f32);
                for (front, back) in target.front.iter_mut().zip(&mut *target.back) {
                    clamp_pixel(front, back, near, far);
                }
            }
        }
        Ok(())
    }
}

/// Empties the layers; makes new ones if they are of another view or another number of objects.
pub(crate) fn prepare(out: &mut DepthLayers, view: &OrthographicView, objects: usize) {
    if out.view() == view && out.objects() == objects {
        out.clear();
    } else {
        *out = DepthLayers::empty(*view, objects);
    }
}

/// Puts an object's vertices into pixel coordinates (x, y) and metres (z).
fn project(view: &OrthographicView, object: &SceneObject, pose: &Pose, pixels: &mut Vec<DVec3>) {
    let per_pixel = DVec2::ONE / view.pixel_size();
    let scale = per_pixel.extend(1.0);
    let rotation = DMat3::from_diagonal(scale) * DMat3::from_quat(pose.rotation);
    let corner = view.domain.min.truncate().extend(0.0);
    let centre = (pose.sensor_from_object(object.centre()) - corner) * scale;
    pixels.clear();
    pixels.extend(object.positions().iter().map(|p| rotation * p.as_dvec3() + centre));
}

/// One object's layers while they are drawn.
struct Target<'a> {
    front: &'a mut [f32],
    back: &'a mut [f32],
    width: usize,
    height: usize,
}

impl Target<'_> {
    /// Draws a triangle given in pixels (x, y) and metres (z).
    fn draw(&mut self, [mut low, mut middle, mut high]: [DVec3; 3]) {
        // Most triangles of a fine mesh pass between the centres; leave before any division.
        let (least, most) = (low.min(middle).min(high), low.max(middle).max(high));
        let (first_row, end_row) = (first_centre(least.y, self.height), first_centre(most.y, self.height));
        if first_row >= end_row || first_centre(least.x, self.width) >= first_centre(most.x, self.width) {
            return;
        }
        if low.y > middle.y {
            std::mem::swap(&mut low, &mut middle);
        }
        if middle.y > high.y {
            std::mem::swap(&mut middle, &mut high);
        }
        if low.y > middle.y {
            std::mem::swap(&mut low, &mut middle);
        }
        let (u, v) = (middle - low, high - low);
        // Twice the signed area; the plane z(x, y) has the slopes (gx, gy).
        let area = u.x * v.y - u.y * v.x;
        if area == 0.0 {
            return;
        }
        let gx = (u.z * v.y - v.z * u.y) / area;
        let gy = (v.z * u.x - u.z * v.x) / area;
        let (lowest, highest) = (least.z as f32, most.z as f32);

        let long = Edge::new(low, high);
        let (lower, upper) = (Edge::new(low, middle), Edge::new(middle, high));
        for row in first_row..end_row {
            let y = row as f64 + 0.5;
            let (a, b) = (long.x_at(y), if y < middle.y { lower.x_at(y) } else { upper.x_at(y) });
            let first = first_centre(a.min(b), self.width);
            let end = first_centre(a.max(b), self.width);
            if first < end {
                let z = low.z + gy * (y - low.y) + gx * (first as f64 + 0.5 - low.x);
                self.draw_span(row * self.width + first..row * self.width + end, z, gx, lowest, highest);
            }
        }
    }

    /// Merges z + k gx into pixel k of a span. Rounding in slivers must not leave the triangle's own range of z.
    fn draw_span(&mut self, span: std::ops::Range<usize>, z: f64, gx: f64, lowest: f32, highest: f32) {
        let (z, gx) = (z as f32, gx as f32);
        let front = &mut self.front[span.clone()];
        let back = &mut self.back[span];
        for (k, (front, back)) in front.iter_mut().zip(back).enumerate() {
            let z = (z + k as f32 * gx).max(lowest).min(highest);
            *front = if z < *front { z } else { *front };
            *back = if z > *back { z } else { *back };
        }
    }
}

/// The first pixel whose centre is not before a coordinate, at most `count`.
fn first_centre(coordinate: f64, count: usize) -> usize {
    // Rounds up without `ceil`, which is a function call on baseline x86-64.
    let place = (coordinate - 0.5).max(0.0).min(count as f64);
    let below = place as usize;
    below + usize::from(place > below as f64)
}

/// An edge of a triangle, from smaller to larger y.
struct Edge {
    start: DVec2,
    slope: f64,
}

impl Edge {
    fn new(start: DVec3, end: DVec3) -> Self {
        // Of a level edge the slope is never used, as no row of centres crosses it.
        Self { start: start.truncate(), slope: (end.x - start.x) / (end.y - start.y) }
    }

    fn x_at(&self, y: f64) -> f64 {
        self.start.x + (y - self.start.y) * self.slope
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Draws triangles given in pixels and returns how often each pixel is covered.
    fn coverage(width: usize, height: usize, triangles: &[[DVec3; 3]]) -> Vec<usize> {
        let mut counts = vec![0; width * height];
        for &triangle in triangles {
            let mut front = vec![f32::INFINITY; width * height];
            let mut back = vec![f32::NEG_INFINITY; width * height];
            Target { front: &mut front, back: &mut back, width, height }.draw(triangle);
            for (count, front) in counts.iter_mut().zip(front) {
                *count += usize::from(front.is_finite());
            }
        }
        counts
    }

    #[test]
    fn a_fan_covers_every_pixel_exactly_once() {
        // The hub and the rim lie on pixel centres, so that many centres fall exactly on edges.
        let hub = DVec3::new(4.5, 4.5, 0.0);
        let rim: Vec<_> =
            [(0.5, 0.5), (4.5, 0.5), (8.5, 0.5), (8.5, 4.5), (8.5, 8.5), (4.5, 8.5), (0.5, 8.5), (0.5, 4.5)]
                .map(|(x, y)| DVec3::new(x, y, 1.0))
                .to_vec();
        let fan: Vec<_> = (0..8).map(|k| [hub, rim[k], rim[(k + 1) % 8]]).collect();
        let counts = coverage(10, 10, &fan);
        for row in 0..10 {
            for column in 0..10 {
                // Left and top edges belong to the square, right and bottom edges do not.
                let inside = column < 8 && row < 8;
                assert_eq!(counts[row * 10 + column], usize::from(inside), "column {column}, row {row}");
            }
        }
    }

    #[test]
    fn triangles_without_area_or_outside_draw_nothing() {
        let triangle = |points: [(f64, f64); 3]| points.map(|(x, y)| DVec3::new(x, y, 0.0));
        for points in [
            [(1.0, 1.0), (3.0, 3.0), (2.0, 2.0)],
            [(1.0, 1.5), (3.0, 1.5), (2.0, 1.5)],
            [(-5.0, -5.0), (-1.0, -3.0), (-2.0, -8.0)],
            [(15.0, 1.0), (11.0, 3.0), (12.0, 8.0)],
        ] {
            assert_eq!(coverage(10, 10, &[triangle(points)]).iter().sum::<usize>(), 0, "{points:?}");
        }
    }
}
