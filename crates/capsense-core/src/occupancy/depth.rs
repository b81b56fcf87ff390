//! What an orthographic depth camera sees of each object, and where mesh edges cross it.
//!
//! The camera looks along +z through the whole cross-section of the domain. Every object has layers of its own:
//! the nearest and the farthest surface along each pixel's ray, so that objects behind each other do not merge and
//! each has a thickness. Between pixel centres the surfaces are interpolated bilinearly; at silhouettes and depth
//! jumps the pixel's own value holds up to its border, so that no jump is taken for a surface.

use super::{Span, Surfaces};
use crate::geometry::Aabb;
use glam::{DVec2, DVec3};

/// Neighbouring depths further apart than this many pixel widths belong to different surfaces.
const JUMP_IN_PIXELS: f64 = 4.0;

/// An orthographic view of the domain along +z. Column 0 is at the smallest x, row 0 at the smallest y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrthographicView {
    /// What is seen: all of the domain.
    pub domain: Aabb,
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
}

impl OrthographicView {
    /// Edge lengths of one pixel in metres.
    pub fn pixel_size(&self) -> DVec2 {
        self.domain.size().truncate() / DVec2::new(self.width as f64, self.height as f64)
    }

    /// x and y of the centre of a pixel.
    pub fn pixel_centre(&self, column: usize, row: usize) -> DVec2 {
        self.domain.min.truncate() + self.pixel_size() * DVec2::new(column as f64 + 0.5, row as f64 + 0.5)
    }

    /// Continuous pixel coordinates of a point; pixel k covers k..k+1.
    fn pixel_coordinates(&self, point: DVec3) -> DVec2 {
        (point.truncate() - self.domain.min.truncate()) / self.pixel_size()
    }

    /// The pixel that continuous coordinates fall into; points outside get the nearest one.
    fn pixel_at(&self, uv: DVec2) -> (usize, usize) {
        let clamp = |value: f64, count: usize| (value.max(0.0) as usize).min(count - 1);
        (clamp(uv.x, self.width), clamp(uv.y, self.height))
    }
}

/// A depth that is NaN, or a layer whose back lies before its front.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "depth image of object {object}, column {column}, row {row}: front {front} and back {back} are no surface"
)]
pub struct InvalidDepth {
    /// Index of the object.
    pub object: usize,
    /// Pixel column.
    pub column: usize,
    /// Pixel row.
    pub row: usize,
    /// z of the front surface.
    pub front: f32,
    /// z of the back surface.
    pub back: f32,
}

/// Front and back surface of every object along each pixel's ray: z in the sensor frame, metres.
///
/// Where a ray misses an object, its front is +∞ and its back -∞.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthLayers {
    view: OrthographicView,
    objects: usize,
    front: Vec<f32>,
    back: Vec<f32>,
}

impl DepthLayers {
    /// Layers in which no ray hits anything.
    pub fn empty(view: OrthographicView, objects: usize) -> Self {
        let len = view.width * view.height * objects;
        Self { view, objects, front: vec![f32::INFINITY; len], back: vec![f32::NEG_INFINITY; len] }
    }

    /// The camera these layers were seen by.
    pub fn view(&self) -> &OrthographicView {
        &self.view
    }

    /// Number of objects.
    pub fn objects(&self) -> usize {
        self.objects
    }

    /// z of an object's surface nearest to the camera, row by row.
    pub fn front(&self, object: usize) -> &[f32] {
        &self.front[self.pixels_of(object)]
    }

    /// z of an object's surface farthest from the camera, row by row.
    pub fn back(&self, object: usize) -> &[f32] {
        &self.back[self.pixels_of(object)]
    }

    /// Front and back of one object, to be filled in.
    pub fn layer_mut(&mut self, object: usize) -> (&mut [f32], &mut [f32]) {
        let pixels = self.pixels_of(object);
        (&mut self.front[pixels.clone()], &mut self.back[pixels])
    }

    /// Forgets every hit.
    pub fn clear(&mut self) {
        self.front.fill(f32::INFINITY);
        self.back.fill(f32::NEG_INFINITY);
    }

    /// Fills everything behind each front surface up to the far wall, as a camera that sees one layer must.
    pub fn back_fill(&mut self) {
        let wall = self.view.domain.max.z as f32;
        for (front, back) in self.front.iter().zip(&mut self.back) {
            if *front < wall {
                *back = wall;
            }
        }
    }

    /// The object that each pixel sees first, row by row; of objects at equal depth the first listed.
    pub fn visible_objects(&self) -> Vec<Option<usize>> {
        let pixels = self.view.width * self.view.height;
        (0..pixels)
            .map(|pixel| {
                (0..self.objects)
                    .map(|object| (object, self.front[object * pixels + pixel]))
                    .filter(|(_, z)| z.is_finite())
                    .min_by(|a, b| a.1.total_cmp(&b.1))
                    .map(|(object, _)| object)
            })
            .collect()
    }

    /// Looks for pixels that cannot be a surface.
    ///
    /// # Errors
    /// Names the first pixel whose depth is NaN or whose back lies before its front.
    pub fn validate(&self) -> Result<(), InvalidDepth> {
        let missed = |front: f32, back: f32| front == f32::INFINITY && back == f32::NEG_INFINITY;
        let bad = self.front.iter().zip(&self.back).position(|(&front, &back)| {
            !(missed(front, back) || (front.is_finite() && back.is_finite() && front <= back))
        });
        match bad {
            None => Ok(()),
            Some(index) => {
                let pixels = self.view.width * self.view.height;
                Err(InvalidDepth {
                    object: index / pixels,
                    column: index % pixels % self.view.width,
                    row: index % pixels / self.view.width,
                    front: self.front[index],
                    back: self.back[index],
                })
            }
        }
    }

    fn pixels_of(&self, object: usize) -> std::ops::Range<usize> {
        let pixels = self.view.width * self.view.height;
        object * pixels..(object + 1) * pixels
    }
}
