//! Where a segment crosses the surfaces of a depth image.
//!
//! Between pixel centres the surfaces are interpolated bilinearly; at silhouettes and depth jumps the pixel's own value
//! holds up to its border, so that no jump is taken for a surface. Every answer is a function of the segment and of
//! the depths in the pixels that it passes and in their eight neighbours, of nothing else.

use super::half_pixels::HalfPixelBorders;
use super::pixel_row::{LANES, lanes};
use super::{DepthLayers, LayerWall, LayerWay, LayersWithin, Side, Span};
use crate::geometry::Aabb;
use glam::{DVec2, DVec3};
use std::ops::Range;

/// Neighbouring depths further apart than this many pixel widths belong to different surfaces.
pub(super) const JUMP_IN_PIXELS: f64 = 4.0;

/// Rounding moves no border and no surface by more than this many pixel widths.
pub(super) const MARGIN_IN_PIXELS: f64 = 1e-3;

/// No depths, as an interval.
pub(super) const NOWHERE: [f32; 2] = [f32::INFINITY, f32::NEG_INFINITY];

/// The interval around two.
#[inline(always)]
pub(super) fn hull(a: [f32; 2], b: [f32; 2]) -> [f32; 2] {
    [smaller(a[0], b[0]), larger(a[1], b[1])]
}

/// The smaller of two numbers; simpler than [`f32::min`], as neither is NaN.
#[inline(always)]
pub(super) fn smaller(a: f32, b: f32) -> f32 {
    if b < a { b } else { a }
}

/// The interval around the depths of some pixels of an image.
#[inline]
fn hull_of_pixels(face: &[f32], width: usize, columns: &Range<usize>, rows: Range<usize>) -> [f32; 2] {
    let mut hull_of_all = NOWHERE;
    for first in columns.clone().step_by(LANES) {
        let [low, high] = NOWHERE;
        let (mut low, mut high) = ([low; LANES], [high; LANES]);
        for row in rows.clone() {
            let depths = lanes(&face[row * width..][..width], first, 0.0);
            for i in 0..LANES {
                (low[i], high[i]) = (smaller(low[i], depths[i]), larger(high[i], depths[i]));
            }
        }
        for i in 0..LANES.min(columns.end - first) {
            hull_of_all = hull(hull_of_all, [low[i], high[i]]);
        }
    }
    hull_of_all
}

/// The larger of two numbers.
#[inline(always)]
pub(super) fn larger(a: f32, b: f32) -> f32 {
    if b > a { b } else { a }
}

/// Front and back of an object over a quarter of a pixel.
struct Quarter {
    /// Centre of the pixel, in pixels.
    centre: DVec2,
    /// Depths at that centre, at those of the neighbours in its row and its column, and of the one across.
    front: [f64; 4],
    back: [f64; 4],
}

impl Quarter {
    /// Front and back at a point of the quarter.
    #[inline]
    fn at(&self, uv: DVec2) -> [f64; 2] {
        let offset = (uv - self.centre).abs();
        [self.front, self.back].map(|z| {
            let along = |a: f64, b: f64| a + (b - a) * offset.x;
            let (near, far) = (along(z[0], z[1]), along(z[2], z[3]));
            near + (far - near) * offset.y
        })
    }

    /// The part of a segment that is behind the front and before the back. Both are taken as straight lines between
    /// its ends, which lie in the quarter, at parameters `t` of the whole.
    #[inline]
    fn span(&self, ends: [DVec2; 2], z: [f64; 2], t: [f64; 2]) -> Option<Span> {
        span_behind(self.at_both(ends), z, t)
    }

    /// Front and back at both ends of a segment.
    #[inline]
    fn at_both(&self, ends: [DVec2; 2]) -> [[f64; 2]; 2] {
        let at_start = self.at(ends[0]);
        [at_start, if ends[0] == ends[1] { at_start } else { self.at(ends[1]) }]
    }
}

/// The part of a segment, given by its depths at two parameters, that is behind a front and before a back, which are straight lines
/// between where they are there.
#[inline]
pub(super) fn span_behind([at_start, at_end]: [[f64; 2]; 2], z: [f64; 2], t: [f64; 2]) -> Option<Span> {
    let depth_inside = |z: f64, [front, back]: [f64; 2]| [z - front, back - z];
    let (at_start, at_end) = (depth_inside(z[0], at_start), depth_inside(z[1], at_end));
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
    // Exactly the end where there is no crossing, so that the whole of an edge inside is [0, 1] in any pieces.
    let at = |part: f64| if part == 1.0 { t[1] } else { t[0] + part * (t[1] - t[0]) };
    (part[0] < part[1]).then(|| Span { enter: at(part[0]), exit: at(part[1]) })
}

/// What the camera sees of one object.
#[derive(Clone, Copy)]
struct Seen<'a> {
    /// Front and back, row by row.
    faces: [&'a [f32]; 2],
    /// Number of columns and of rows.
    counts: [usize; 2],
    jump: f32,
}

impl DepthLayers {
    pub(super) fn is_inside(&self, object: usize, point: DVec3) -> bool {
        let surfaces = self.layer(object, point);
        surfaces.is_some_and(|[front, back]| front < point.z && point.z < back)
    }

    fn seen(&self, object: usize) -> Seen<'_> {
        let faces = [self.front(object), self.back(object)];
        Seen { faces, counts: [self.view().width, self.view().height], jump: self.jump() }
    }

    /// Front and back of an object along the ray through a point.
    #[inline]
    pub(super) fn layer(&self, object: usize, point: DVec3) -> Option<[f64; 2]> {
        let uv = self.pixel_coordinates(point);
        self.seen(object).quarter(uv).map(|quarter| quarter.at(uv))
    }

    /// Walks the segment from one half pixel to the next: within one, the same pixel is hit or missed and the same
    /// four depths are interpolated. What is between the first and the last of them that meet the object does not matter.
    pub(super) fn span_between(&self, object: usize, a: DVec3, b: DVec3) -> Option<Span> {
        let uv = [a, b].map(|point| self.pixel_coordinates(point));
        let (z, seen) = ([a.z, b.z], self.seen(object));
        if uv[0] == uv[1] {
            return seen.quarter(uv[0])?.span(uv, z, [0.0, 1.0]);
        }
        let mut borders = HalfPixelBorders::between(uv);
        if borders.count() == 0 {
            return seen.quarter(uv[0])?.span(uv, z, [0.0, 1.0]);
        }
        if borders.count() > 1 {
            let (part, heights) = ([uv[0].min(uv[1]), uv[0].max(uv[1])], [a.z.min(b.z), a.z.max(b.z)]);
            match seen.layers_within(part, self.margin(heights)).side_of(heights) {
                Some(Side::Inside) => return Some(Span::WHOLE),
                Some(Side::Outside) => return None,
                None => {}
            }
        }
        let mut from_end = borders.backwards();
        let mut t = [0.0, borders.next_after(0.0)];
        let first = loop {
            match seen.piece(uv, z, t) {
                Some(first) => break first,
                None if t[1] >= 1.0 => return None,
                None => t = [t[1], borders.next_after(t[1])],
            }
        };
        let mut end = 1.0;
        while end > t[1] {
            let start = from_end.next_before(end);
            if let Some(last) = seen.piece(uv, z, [start, end]) {
                return Some(Span { enter: first.enter, exit: last.exit });
            }
            end = start;
        }
        Some(first)
    }

    /// Between which depths front and back of an object are in a box.
    pub(super) fn layers_in_box(&self, object: usize, &Aabb { min, max }: &Aabb) -> LayersWithin {
        let part = [min, max].map(|point| self.pixel_coordinates(point));
        self.seen(object).layers_within(part, self.margin([min.z, max.z]))
    }

    /// What rounding does to surfaces between two depths.
    fn margin(&self, [low, high]: [f64; 2]) -> f64 {
        MARGIN_IN_PIXELS * f64::from(self.pixel_width()) + 1e-9 * (low.abs() + high.abs())
    }

    /// Where that walk first meets an object along a row or a column of the image, if it is inside as soon as a pixel starts: where
    /// surfaces are interpolated, it is not. `a` and `b` are as deep. Pixels that miss the object are passed over at once.
    pub(super) fn first_wall_between(
        &self,
        object: usize,
        a: DVec3,
        b: DVec3,
        depths: [f64; 2],
    ) -> Option<LayerWall> {
        let mut walk = self.walk_between(object, a, b)?;
        loop {
            let way = walk.next_way()?;
            if let Some(span) = way.span_at(a.z) {
                return way.wall_before(span, depths);
            }
        }
    }

    /// The first half pixel of that walk that sees the object at some depth.
    pub(super) fn first_way_between(&self, object: usize, a: DVec3, b: DVec3) -> Option<LayerWay> {
        self.walk_between(object, a, b)?.next_way()
    }

    /// That walk up to the first pixel that meets the object.
    fn walk_between(&self, object: usize, a: DVec3, b: DVec3) -> Option<Walk<'_>> {
        let uv = [a, b].map(|point| self.pixel_coordinates(point));
        let seen = self.seen(object);
        let line = seen.line(uv)?;
        let first_hit = line.first_hit()?;
        let mut borders = HalfPixelBorders::between(uv);
        let mut start = 0.0;
        if first_hit != line.first {
            start = borders.axes[line.axis].pass(line.border_before(first_hit));
        }
        let spacing = self.pixel_size()[line.axis];
        Some(Walk { uv, seen, line, borders, start, spacing })
    }
}

impl<'a> Seen<'a> {
    /// The row or column of pixels that a segment leads along; `None` if that is outside of the image.
    #[inline]
    fn line(&self, uv: [DVec2; 2]) -> Option<Line<'a>> {
        let way = uv[1] - uv[0];
        let axis = usize::from(way.y.abs() > way.x.abs());
        let Self { faces, counts, .. } = *self;
        let pixel = |uv: DVec2, axis: usize| pixel_at(uv[axis], counts[axis]).map(|(pixel, _)| pixel);
        let [first, last] = [pixel(uv[0], axis)?, pixel(uv[1], axis)?];
        let stride = [1, counts[0]][axis];
        let base = pixel(uv[0], 1 - axis)? * [1, counts[0]][1 - axis];
        Some(Line { faces, axis, stride, base, count: counts[axis], first, last })
    }

    /// What the object fills of a part of a segment within half a pixel, from one parameter to another.
    #[inline(always)]
    fn piece(&self, uv: [DVec2; 2], z: [f64; 2], t: [f64; 2]) -> Option<Span> {
        // Along an axis that the segment does not leave, exactly where its ends are: they may be on a border of pixels.
        let uv_at = |t: f64| uv[0] + (uv[1] - uv[0]) * t;
        let quarter = self.quarter(uv_at(0.5 * (t[0] + t[1])))?;
        quarter.span(t.map(uv_at), t.map(|t| z[0] + (z[1] - z[0]) * t), t)
    }

    /// Between which depths front and back are in a part of the image, with such a margin that walking along any segment there
    /// finds nothing else. Where it is not all in the image, nothing is behind the front.
    #[inline]
    fn layers_within(&self, [min, max]: [DVec2; 2], margin: f64) -> LayersWithin {
        let [width, height] = self.counts;
        let (columns, all_columns) = pixels_around(min.x, max.x, width);
        let (rows, all_rows) = pixels_around(min.y, max.y, height);
        let [front, back] = self.faces.map(|face| hull_of_pixels(face, width, &columns, rows.clone()));
        // The front of rays that miss is beyond everything.
        let last_front = if all_columns && all_rows { front[1] } else { f32::INFINITY };
        let with_margin = |[first, last]: [f32; 2]| [f64::from(first) - margin, f64::from(last) + margin];
        LayersWithin { front: with_margin([front[0], last_front]), back: with_margin(back) }
    }

    /// The quarter pixel around a point; `None` where its pixel misses the object or is outside of the image.
    #[inline(always)]
    fn quarter(&self, uv: DVec2) -> Option<Quarter> {
        let [width, height] = self.counts;
        let (column, across) = pixel_at(uv.x, width)?;
        let (row, up) = pixel_at(uv.y, height)?;
        let own = row * width + column;
        let [fronts, backs] = self.faces;
        if fronts[own] > backs[own] {
            return None;
        }
        let centre = DVec2::new(column as f64 + 0.5, row as f64 + 0.5);
        // Beside the image there is no pixel to interpolate with.
        let is_inner = across < width && up < height;
        let beside = |next: usize, own: usize| if is_inner { next } else { own };
        let (across, up) = (beside(across, column), beside(up, row));
        let corners = [own, row * width + across, up * width + column, up * width + across];
        let smooth = |face: &[f32]| {
            let z = corners.map(|corner| face[corner]);
            let [low, high] = hull(hull([z[0]; 2], [z[1]; 2]), hull([z[2]; 2], [z[3]; 2]));
            if high - low <= self.jump { z.map(f64::from) } else { [f64::from(z[0]); 4] }
        };
        Some(Quarter { centre, front: smooth(fronts), back: smooth(backs) })
    }
}

/// Along one axis, the pixel at a coordinate and the next pixel on the nearer side, which may be none of the image. Coordinates on
/// the rim of the image are in it, others outside are in none.
#[inline(always)]
fn pixel_at(coordinate: f64, count: usize) -> Option<(usize, usize)> {
    if !(-MARGIN_IN_PIXELS..=count as f64 + MARGIN_IN_PIXELS).contains(&coordinate) {
        return None;
    }
    // Of conversions that mind what does not fit, this is the cheapest. What is below zero becomes zero.
    let pixel = (coordinate as u32 as usize).min(count - 1);
    let is_before_centre = coordinate < pixel as u32 as f64 + 0.5;
    let next = if is_before_centre { pixel.wrapping_sub(1) } else { pixel + 1 };
    Some((pixel, next))
}

/// Along one axis, the pixels that an interval touches and those that are interpolated with there, and whether the interval is all
/// in the image.
fn pixels_around(low: f64, high: f64, count: usize) -> (Range<usize>, bool) {
    let start = (low - 0.5 - MARGIN_IN_PIXELS).max(0.0) as u32 as usize;
    let end = ((high + 1.5 + MARGIN_IN_PIXELS).max(0.0) as u32 as usize).min(count);
    (start.min(end)..end, low >= 0.0 && high <= count as f64)
}

/// A row or a column of pixels, and between which of them a segment leads.
struct Line<'a> {
    faces: [&'a [f32]; 2],
    axis: usize,
    stride: usize,
    base: usize,
    count: usize,
    first: usize,
    last: usize,
}

impl Line<'_> {
    #[inline]
    fn depths(&self, pixel: usize) -> [f32; 2] {
        self.faces.map(|face| face[self.base + pixel * self.stride])
    }

    #[inline]
    fn is_hit(&self, pixel: usize) -> bool {
        let [front, back] = self.depths(pixel);
        front <= back
    }

    /// The pixel after another one on the segment's way.
    #[inline]
    fn after(&self, pixel: usize) -> usize {
        if self.first <= self.last { pixel + 1 } else { pixel.wrapping_sub(1) }
    }

    /// The first pixel on the segment's way that meets the object.
    #[inline]
    fn first_hit(&self) -> Option<usize> {
        let mut pixel = self.first;
        while !self.is_hit(pixel) {
            if pixel == self.last {
                return None;
            }
            pixel = self.after(pixel);
        }
        Some(pixel)
    }

    /// What the next pixel sees; `None` where that misses the object.
    #[inline]
    fn depths_behind(&self, pixel: usize) -> Option<[f32; 2]> {
        let behind = self.after(pixel);
        (behind < self.count && self.is_hit(behind)).then(|| self.depths(behind))
    }

    /// Where the segment enters a pixel, in half pixels.
    fn border_before(&self, pixel: usize) -> usize {
        2 * (pixel + usize::from(pixel < self.first))
    }
}

/// A walk along a row or a column of pixels, from one half pixel to the next.
struct Walk<'a> {
    uv: [DVec2; 2],
    seen: Seen<'a>,
    line: Line<'a>,
    borders: HalfPixelBorders,
    start: f64,
    spacing: f64,
}

impl Walk<'_> {
    /// The next half pixel that sees the object, whatever the depth of the walk.
    fn next_way(&mut self) -> Option<LayerWay> {
        let Self { uv, seen, line, .. } = self;
        let uv_at = |t: f64| uv[0] + (uv[1] - uv[0]) * t;
        while self.start < 1.0 {
            let part = [self.start, self.borders.next_after(self.start)];
            self.start = part[1];
            let middle = uv_at(0.5 * (part[0] + part[1]));
            let Some(quarter) = seen.quarter(middle) else { continue };
            // Rounding may put the rim of the image behind its last pixel.
            let pixel = (middle[line.axis] as u32 as usize).min(line.count - 1);
            return Some(LayerWay {
                part,
                faces: quarter.at_both(part.map(uv_at)),
                seen: line.depths(pixel),
                behind: line.depths_behind(pixel),
                spacing: self.spacing,
            });
        }
        None
    }
}
