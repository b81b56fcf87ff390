//! Lines in the box around an edge, in the frame of a body.

use super::super::{BARS, Bars, Fill, LayersWithin, Side, Span, Surfaces};
use super::around::{Around, QUARTERS, Quarter};
use glam::DVec3;

/// How many lines pass a quarter.
pub(super) const LINES: usize = BARS;

/// From an edge it is so many times as far to the next one as to the middle of the quarter on that side.
const TO_NEXT: f64 = 4.0;

/// An edge of a lattice in the frame of a body.
pub(super) struct InFrame<'a> {
    surfaces: &'a dyn Surfaces,
    pub(super) object: usize,
    from: DVec3,
    way: DVec3,
    /// The directions across it.
    across: [DVec3; 2],
    /// The middle of a box that holds that around the edge, and half its size.
    within: [DVec3; 2],
}

/// The lines in a quarter of its box.
pub(super) struct Lines<'a> {
    edge: &'a InFrame<'a>,
    /// Between which depths surfaces are in all of the quarter, if they are seen along z; they tell of most lines.
    layers: Option<LayersWithin>,
    /// From the edge to the middle of the quarter, along either axis. Half its widths are in it.
    offset: [DVec3; 2],
}

impl<'a> InFrame<'a> {
    #[inline(always)]
    pub(super) fn of(surfaces: &'a dyn Surfaces, object: usize, around: &Around) -> Self {
        let frame = surfaces.frame(object);
        let direction = |axis: usize| frame.object_from_sensor.col(axis);
        let Around { from, to, axis, across: [first, second], .. } = *around;
        let (from, way) = (frame.point(from), direction(axis) * (to[axis] - from[axis]));
        let across = [direction(first), direction(second)];
        let (mut middle, mut half) = (from + 0.5 * way, 0.5 * way.abs());
        for (direction, [below, above]) in across.into_iter().zip(around.reach()) {
            middle += (0.5 * (above + below)) * direction;
            half += (0.5 * (above - below)) * direction.abs();
        }
        Self { surfaces, object, from, way, across, within: [middle, half] }
    }

    /// On which side of the body's surface all of the box around the edge is, if that is soon seen.
    #[inline]
    pub(super) fn side(&self) -> Option<Side> {
        let [middle, half] = self.within;
        self.surfaces.side_of(self.object, middle, half)
    }

    /// Tells what of the lines in each quarter is in the body.
    #[inline]
    pub(super) fn fill(&self, quarters: &[Quarter], fill: &mut [Fill; QUARTERS]) {
        let mut bars = [Bars::NONE; QUARTERS];
        for (bars, quarter) in bars.iter_mut().zip(quarters) {
            *bars = self.lines(quarter, None).bars();
        }
        let count = quarters.len();
        self.surfaces.fill_in_frame(self.object, self.within, &bars[..count], &mut fill[..count]);
    }

    #[inline]
    pub(super) fn lines(&'a self, quarter: &Quarter, layers: Option<LayersWithin>) -> Lines<'a> {
        let [first, second] = quarter.offset;
        Lines { edge: self, layers, offset: [self.across[0] * first, self.across[1] * second] }
    }
}

impl Lines<'_> {
    pub(super) fn object(&self) -> usize {
        self.edge.object
    }

    /// What the lines stand for: a quarter of the quarter's widths each.
    #[inline]
    fn bars(&self) -> Bars {
        let InFrame { from, way, .. } = *self.edge;
        let [first, second] = self.offset;
        Bars { start: from + first + second, way, across: self.offset }
    }

    /// What of them is in the body.
    #[inline]
    pub(super) fn fill(&self) -> Fill {
        let (surfaces, object, bars) = (self.edge.surfaces, self.edge.object, self.bars());
        let Some(layers) = self.layers else {
            let mut fill = Fill::WHOLE;
            let of_one = std::slice::from_mut(&mut fill);
            surfaces.fill_in_frame(object, self.edge.within, std::slice::from_ref(&bars), of_one);
            return fill;
        };
        Fill::over(bars.middle_lines().map(|[start, end]| {
            match layers.side_of([start.z.min(end.z), start.z.max(end.z)]) {
                Some(Side::Outside) => None,
                Some(Side::Inside) => Some(Span::WHOLE),
                None => surfaces.span_in_frame(object, start, end),
            }
        }))
    }

    /// The way from a place on the edge to the next one in the quarter's direction: the part of it in the body, and its length in parts
    /// of the edge's, along the shorter of the two axes.
    pub(super) fn span_to_next(&self, along: f64) -> Option<(Span, f64)> {
        let InFrame { surfaces, object, from, way, .. } = *self.edge;
        let [first, second] = self.offset;
        let start = from + along * way;
        let span = surfaces.span_in_frame(object, start, start + TO_NEXT * (first + second))?;
        let width = TO_NEXT * first.length().min(second.length());
        Some((span, width / way.length()))
    }
}
