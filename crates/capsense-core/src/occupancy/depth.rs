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

    /// Number of the pixel that a point is seen in, counted row by row; points outside get the nearest one.
    pub(crate) fn pixel_of(&self, point: DVec3) -> usize {
        let (column, row) = self.pixel_at(self.pixel_coordinates(point));
        row * self.width + column
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

    fn pixels_of(&self, object: usize) -> std::ops::Range<usize> {
        let pixels = self.view.width * self.view.height;
        object * pixels..(object + 1) * pixels
    }
}

impl Surfaces for DepthLayers {
    fn objects(&self) -> usize {
        self.objects
    }

    /// Names the first pixel whose depth is NaN or whose back lies before its front.
    fn validate(&self) -> Result<(), InvalidDepth> {
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

    fn bounds(&self, object: usize) -> Aabb {
        let pixel = self.view.pixel_size();
        let corner = self.view.domain.min.truncate();
        let mut bounds = Aabb::EMPTY;
        for (row, (fronts, backs)) in self
            .front(object)
            .chunks_exact(self.view.width)
            .zip(self.back(object).chunks_exact(self.view.width))
            .enumerate()
        {
            for (column, (&front, &back)) in fronts.iter().zip(backs).enumerate() {
                if front <= back {
                    let low = corner + pixel * DVec2::new(column as f64, row as f64);
                    bounds = bounds
                        .including(low.extend(f64::from(front)))
                        .including((low + pixel).extend(f64::from(back)));
                }
            }
        }
        bounds
    }

    fn contains(&self, object: usize, point: DVec3) -> bool {
        let uv = self.view.pixel_coordinates(point);
        self.column(object, self.view.pixel_at(uv), uv)
            .is_some_and(|[front, back]| front < point.z && point.z < back)
    }

    /// Walks the segment from one half pixel to the next: within a half pixel the same pixel is hit or missed and the
    /// same four depths are interpolated, so front and back are taken as straight lines there.
    fn span(&self, object: usize, a: DVec3, b: DVec3) -> Option<Span> {
        let (uv_a, uv_b) = (self.view.pixel_coordinates(a), self.view.pixel_coordinates(b));
        let mut found: Option<Span> = None;
        let mut start = 0.0;
        while start < 1.0 {
            let end = next_half_pixel(uv_a, uv_b, start);
            let pixel = self.view.pixel_at(uv_a.lerp(uv_b, 0.5 * (start + end)));
            if let Some(piece) = self.span_in_half_pixel(object, pixel, [a, b], [uv_a, uv_b], [start, end]) {
                found = Some(Span { enter: found.map_or(piece.enter, |f| f.enter), exit: piece.exit });
            }
            start = end;
        }
        found
    }
}

impl DepthLayers {
    /// Front and back at a point of a pixel; `None` where the pixel misses the object.
    fn column(&self, object: usize, (column, row): (usize, usize), uv: DVec2) -> Option<[f64; 2]> {
        let width = self.view.width;
        let own = row * width + column;
        let (fronts, backs) = (self.front(object), self.back(object));
        if fronts[own] > backs[own] {
            return None;
        }
        // The three neighbours between whose centres and the own one the point lies.
        let beside = |at: f64, own: usize, count: usize| match at < own as f64 + 0.5 {
            true => own.checked_sub(1),
            false => Some(own + 1).filter(|&next| next < count),
        };
        let nearest = [f64::from(fronts[own]), f64::from(backs[own])];
        let (Some(next_column), Some(next_row)) =
            (beside(uv.x, column, width), beside(uv.y, row, self.view.height))
        else {
            return Some(nearest);
        };
        let offset = (uv - DVec2::new(column as f64 + 0.5, row as f64 + 0.5)).abs();
        let corners =
            [own, row * width + next_column, next_row * width + column, next_row * width + next_column];
        let jump = JUMP_IN_PIXELS * self.view.pixel_size().max_element();
        let smooth = |layer: &[f32], fallback: f64| {
            let z = corners.map(|corner| f64::from(layer[corner]));
            let (low, high) =
                z.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &z| (l.min(z), h.max(z)));
            if high - low <= jump {
                let along = |a: f64, b: f64| a + (b - a) * offset.x;
                let (near, far) = (along(z[0], z[1]), along(z[2], z[3]));
                near + (far - near) * offset.y
            } else {
                fallback
            }
        };
        Some([smooth(fronts, nearest[0]), smooth(backs, nearest[1])])
    }

    /// The part of the segment between parameters `t` that is behind the front and before the back.
    fn span_in_half_pixel(
        &self,
        object: usize,
        pixel: (usize, usize),
        ends: [DVec3; 2],
        uv: [DVec2; 2],
        t: [f64; 2],
    ) -> Option<Span> {
        let inside = |t: f64| {
            let z = ends[0].z + (ends[1].z - ends[0].z) * t;
            self.column(object, pixel, uv[0].lerp(uv[1], t)).map(|[front, back]| [z - front, back - z])
        };
        let (at_start, at_end) = (inside(t[0])?, inside(t[1])?);
        let mut part = [0.0, 1.0];
        for side in 0..2 {
            let (s, e) = (at_start[side], at_end[side]);
            match (s > 0.0, e > 0.0) {
                (true, true) => {}
                (false, false) => return None,
                (true, false) => part[1] = f64::min(part[1], s / (s - e)),
                (false, true) => part[0] = f64::max(part[0], s / (s - e)),
            }
        }
        let length = t[1] - t[0];
        (part[0] < part[1]).then(|| Span { enter: t[0] + part[0] * length, exit: t[0] + part[1] * length })
    }
}

/// The next parameter after `t` at which the line from `a` to `b` crosses a multiple of half a pixel; 1 at the end.
fn next_half_pixel(a: DVec2, b: DVec2, t: f64) -> f64 {
    let mut next: f64 = 1.0;
    for axis in 0..2 {
        let step = b[axis] - a[axis];
        if step != 0.0 {
            let here = 2.0 * (a[axis] + step * t);
            let border = if step > 0.0 { (here + 1e-9).floor() + 1.0 } else { (here - 1e-9).ceil() - 1.0 };
            next = next.min((0.5 * border - a[axis]) / step);
        }
    }
    // Each step makes progress, whatever the rounding.
    next.max(t + 1e-9).min(1.0)
}
