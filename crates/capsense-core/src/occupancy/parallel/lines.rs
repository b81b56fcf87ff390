//! Lines in the box around an edge, in the frame of a body.

use super::super::{BARS, Bars, Fill, LayersWithin, Side, Span, Surfaces};
use super::around::{Around, Quarter};
use glam::DVec3;

/// How many lines pass a quarter.
pub(super) const LINES: usize = BARS;

/// Where they do, in parts of half its widths from its middle. Along either axis each is at a place of its own,
/// so that they are side by side there without a gap, and places along one axis tell nothing of those along the other.
const PLACES: [[f64; 2]; LINES] = [[-0.75, -0.25], [-0.25, 0.75], [0.25, -0.75], [0.75, 0.25]];

/// How far what a line stands for reaches beside it, in the same parts.
const REACH: f64 = 0.25;

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
    #[inline]
    pub(super) fn of(surfaces: &'a dyn Surfaces, object: usize, around: &Around) -> Self {
        let frame = surfaces.frame(object);
        let direction = |axis: usize| frame.object_from_sensor.col(axis);
        let Around { from, to, axis, across: [first, second], .. } = *around;
        Self {
            surfaces,
            object,
            from: frame.point(from),
            way: direction(axis) * (to[axis] - from[axis]),
            across: [direction(first), direction(second)],
        }
    }

    /// On which side of the body's surface all of the box around the edge is, if that is soon seen.
    #[inline]
    pub(super) fn side(&self, around: &Around) -> Option<Side> {
        let (mut middle, mut half) = (self.from + 0.5 * self.way, 0.5 * self.way.abs());
        for (direction, [below, above]) in self.across.into_iter().zip(around.reach()) {
            middle += (0.5 * (above + below)) * direction;
            half += (0.5 * (above - below)) * direction.abs();
        }
        self.surfaces.side_of(self.object, middle, half)
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

    /// What of each line is in the body, as a bar of a quarter of the quarter's widths.
    #[inline]
    pub(super) fn fill(&self) -> Fill {
        let &InFrame { surfaces, object, from, way, .. } = self.edge;
        let [first, second] = self.offset;
        let mut starts = [from + first + second; LINES];
        for (start, [along_first, along_second]) in starts.iter_mut().zip(PLACES) {
            *start += first * along_first + second * along_second;
        }
        let Some(layers) = self.layers else {
            let across = [REACH * first, REACH * second];
            return surfaces.fill_in_frame(object, &Bars { starts, way, across });
        };
        Fill::over(starts.map(|start| {
            let end = start + way;
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
