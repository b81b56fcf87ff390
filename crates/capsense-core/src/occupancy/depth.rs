//! What an orthographic depth camera sees of each object.
//!
//! The camera looks along +z through the whole cross-section of the domain. Every object has layers of its own:
//! the nearest and the farthest surface along each pixel's ray, so that objects behind each other do not merge and
//! each has a thickness.

use super::crossing::{JUMP_IN_PIXELS, MARGIN_IN_PIXELS, larger, smaller};
use super::pixel_row::{first_where, last_where, reduce};
use super::{Earlier, LayerWall, LayerWay, LayersWithin, Regions, Span, Surfaces};
use crate::geometry::Aabb;
use crate::instructions::vectorised;
use glam::{DVec2, DVec3};

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
        let uv = (point.truncate() - self.domain.min.truncate()) / self.pixel_size();
        let clamp = |value: f64, count: usize| (value.max(0.0) as usize).min(count - 1);
        clamp(uv.y, self.height) * self.width + clamp(uv.x, self.width)
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
    /// Edge lengths of a pixel.
    pixel: DVec2,
    pixels_per_metre: DVec2,
    /// Neighbouring depths further apart belong to different surfaces.
    jump: f32,
}

impl DepthLayers {
    /// Layers in which no ray hits anything.
    ///
    /// # Panics
    /// When the view has no pixel.
    pub fn empty(view: OrthographicView, objects: usize) -> Self {
        assert!(view.width > 0 && view.height > 0, "an image of {} x {} pixels", view.width, view.height);
        let len = view.width * view.height * objects;
        let pixel = view.pixel_size();
        Self {
            view,
            objects,
            front: vec![f32::INFINITY; len],
            back: vec![f32::NEG_INFINITY; len],
            pixel,
            pixels_per_metre: 1.0 / pixel,
            jump: (JUMP_IN_PIXELS * pixel.max_element()) as f32,
        }
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

    pub(super) fn jump(&self) -> f32 {
        self.jump
    }

    /// The longer side of a pixel.
    pub(super) fn pixel_width(&self) -> f32 {
        self.pixel.max_element() as f32
    }

    /// Edge lengths of a pixel.
    pub(super) fn pixel_size(&self) -> DVec2 {
        self.pixel
    }

    /// Continuous pixel coordinates of a point; pixel k covers k..k+1.
    pub(super) fn pixel_coordinates(&self, point: DVec3) -> DVec2 {
        (point.truncate() - self.view.domain.min.truncate()) * self.pixels_per_metre
    }

    /// The space between two depths over columns and rows from the first up to, without, the second, and a margin.
    pub(super) fn pixel_box(&self, columns: [usize; 2], rows: [usize; 2], depths: [f32; 2]) -> Aabb {
        let pixel = self.pixel;
        let margin = (MARGIN_IN_PIXELS * pixel).extend(MARGIN_IN_PIXELS * pixel.max_element());
        let corner = |end: usize| {
            let at = DVec2::new(columns[end] as f64, rows[end] as f64);
            (self.view.domain.min.truncate() + pixel * at).extend(f64::from(depths[end]))
        };
        // Far out, rounding exceeds any part of a pixel.
        let margin = margin + depths.map(|z| f64::from(z.abs())).into_iter().fold(0.0, f64::max) * 1e-9;
        Aabb { min: corner(0) - margin, max: corner(1) + margin }
    }

    /// Whether two images show as many objects by the same camera.
    pub(super) fn is_comparable_to(&self, other: &Self) -> bool {
        self.view == other.view && self.objects == other.objects
    }

    /// The columns, the rows and the depths that an object is seen in.
    #[inline(always)]
    fn pixels_seen(&self, object: usize) -> Option<([usize; 2], [usize; 2], [f32; 2])> {
        let width = self.view.width;
        let rows = self.front(object).chunks_exact(width).zip(self.back(object).chunks_exact(width));
        let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
        let (mut columns, mut seen_rows) = ([width, 0], [self.view.height, 0]);
        for (row, (fronts, backs)) in rows.enumerate() {
            let nearest = reduce(fronts, f32::INFINITY, smaller);
            let farthest = reduce(backs, f32::NEG_INFINITY, larger);
            if nearest <= farthest {
                (low, high) = (low.min(nearest), high.max(farthest));
                seen_rows = [seen_rows[0].min(row), row + 1];
                let is_hit = |front: f32, back: f32| front <= back;
                let [before, end] = columns;
                columns[0] = first_where(&fronts[..before], &backs[..before], is_hit).unwrap_or(before);
                columns[1] =
                    last_where(&fronts[end..], &backs[end..], is_hit).map_or(end, |last| end + last + 1);
            }
        }
        (seen_rows[0] < seen_rows[1]).then_some((columns, seen_rows, [low, high]))
    }

    fn pixels_of(&self, object: usize) -> std::ops::Range<usize> {
        let pixels = self.view.width * self.view.height;
        object * pixels..(object + 1) * pixels
    }
}

/// Whether a ray either meets a front and then a back, or misses both.
#[inline(always)]
fn is_surface(front: f32, back: f32) -> bool {
    let met = (front > f32::NEG_INFINITY) & (front <= back) & (back < f32::INFINITY);
    let missed = (front == f32::INFINITY) & (back == f32::NEG_INFINITY);
    met | missed
}

impl Surfaces for DepthLayers {
    fn objects(&self) -> usize {
        self.objects
    }

    /// Names the first pixel whose depth is NaN or whose back lies before its front.
    fn validate(&self) -> Result<(), InvalidDepth> {
        let pairs = || self.front.iter().zip(&self.back);
        // All pixels first, without a branch for each; which one it is matters only when one is bad.
        let are_good = vectorised(
            #[inline(always)]
            || pairs().fold(true, |good, (&front, &back)| good & is_surface(front, back)),
        );
        if are_good {
            return Ok(());
        }
        match pairs().position(|(&front, &back)| !is_surface(front, back)) {
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

    /// A thousandth of a pixel wider than what is seen, so that rounding puts nothing outside.
    fn bounds(&self, object: usize) -> Aabb {
        let found = vectorised(
            #[inline(always)]
            || self.pixels_seen(object),
        );
        found.map_or(Aabb::EMPTY, |(columns, rows, depths)| self.pixel_box(columns, rows, depths))
    }

    fn contains(&self, object: usize, point: DVec3) -> bool {
        self.is_inside(object, point)
    }

    fn contains_as_measured(&self, object: usize, point: DVec3) -> bool {
        let pixel = self.view().pixel_of(point);
        let [front, back] = [self.front(object), self.back(object)].map(|layer| f64::from(layer[pixel]));
        front < point.z && point.z < back
    }

    fn span(&self, object: usize, a: DVec3, b: DVec3) -> Option<Span> {
        self.span_between(object, a, b)
    }

    fn layers_within(&self, object: usize, bounds: &Aabb) -> Option<LayersWithin> {
        Some(self.layers_in_box(object, bounds))
    }

    fn has_layers(&self) -> bool {
        true
    }

    fn layer_at(&self, object: usize, point: DVec3) -> Option<[f64; 2]> {
        self.layer(object, point)
    }

    fn wall_between(&self, object: usize, a: DVec3, b: DVec3, depths: [f64; 2]) -> Option<LayerWall> {
        self.first_wall_between(object, a, b, depths)
    }

    fn way_between(&self, object: usize, a: DVec3, b: DVec3) -> Option<LayerWay> {
        self.first_way_between(object, a, b)
    }

    fn find_changes(&self, before: &mut Earlier, regions: &mut Regions) -> bool {
        let Some((image, comparison)) = before.image_like(self) else {
            before.remember_image(self);
            return false;
        };
        for object in 0..self.objects {
            comparison.find(object, image, self, regions);
        }
        true
    }
}
