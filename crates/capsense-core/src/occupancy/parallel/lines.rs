//! Lines in the box around an edge, in the frame of a body.

use super::super::{
    BARS, Bars, Fill, Frame, LayersWithin, OnAxis, Side, Span, Surfaces, keep_between, larger, span_in_box,
};
use super::around::{Around, QUARTERS, Quarter};
use crate::geometry::Aabb;
use glam::{DMat3, DVec3};

/// How many lines pass a quarter.
pub(super) const LINES: usize = BARS;

/// What is nearer by this part of its distance from the middle of a body is so whatever rounding does.
const BEYOND: f64 = 1e-9;

/// From an edge it is so many times as far to the next one as to the middle of the quarter on that side.
const TO_NEXT: f64 = 4.0;

/// An edge of a lattice in the frame of a body.
pub(super) struct InFrame<'a> {
    surfaces: &'a dyn Surfaces,
    pub(super) object: usize,
    /// Half the edge lengths of the body if it is a box.
    half: Option<DVec3>,
    from: DVec3,
    way: DVec3,
    /// The directions across it.
    across: [DVec3; 2],
    /// The middle of a box that holds that around the edge, and half its size.
    within: [DVec3; 2],
}

/// The faces of a box across one of its axes, so far from its middle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Faces {
    pub(super) axis: usize,
    pub(super) half: f64,
}

/// What the box around an edge meets of a body.
pub(super) enum Met {
    /// Nothing of it.
    Nothing,
    /// It is all in it.
    Inside,
    /// These faces of a box at the most.
    Faces(Faces),
    /// Any surfaces.
    Surfaces,
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
    /// An edge in the frame of an object, of which half the edge lengths are told if it is a box.
    #[inline(always)]
    pub(super) fn of(
        surfaces: &'a dyn Surfaces,
        (object, frame, half): (usize, &Frame, Option<DVec3>),
        around: &Around,
    ) -> Self {
        let Around { from, length, axis, .. } = *around;
        let DMat3 { x_axis, y_axis, z_axis } = frame.object_from_sensor;
        // The axes in a cycle, of which each is across the one before.
        let (along, across) = match axis {
            0 => (x_axis, [y_axis, z_axis]),
            1 => (y_axis, [z_axis, x_axis]),
            _ => (z_axis, [x_axis, y_axis]),
        };
        let Aabb { min, max } = around.bounds();
        let within = [frame.point(0.5 * (min + max)), frame.half_size_of(0.5 * (max - min))];
        Self { surfaces, object, half, from: frame.point(from), way: along * length, across, within }
    }

    /// What the box around the edge meets of the body, as far as that is soon seen.
    #[inline(always)]
    pub(super) fn met(&self) -> Met {
        let [middle, reach] = self.within;
        let Some(half) = self.half else {
            return match self.surfaces.side_of(self.object, middle, reach) {
                Some(Side::Outside) => Met::Nothing,
                Some(Side::Inside) => Met::Inside,
                None => Met::Surfaces,
            };
        };
        let far = middle.abs() + reach;
        if ((middle.abs() - reach) * (1.0 - BEYOND)).cmpgt(half).any() {
            return Met::Nothing;
        }
        if (far * (1.0 + BEYOND)).cmplt(half).all() {
            return Met::Inside;
        }
        match far.cmple(half).bitmask() {
            0b110 => Met::Faces(Faces { axis: 0, half: half.x }),
            0b101 => Met::Faces(Faces { axis: 1, half: half.y }),
            0b011 => Met::Faces(Faces { axis: 2, half: half.z }),
            _ => Met::Surfaces,
        }
    }

    /// Whether the body is known to have no edge in the box around the edge, even one that reaches up to the next edges.
    #[inline(always)]
    pub(super) fn is_far_from_edges(&self, around: &Around) -> bool {
        let Some(half) = self.half else { return false };
        let [middle, mut reach] = self.within;
        for (direction, [below, above]) in self.across.into_iter().zip(around.reach()) {
            reach += larger(-below, above) * direction.abs();
        }
        ((middle.abs() + reach) * (1.0 + BEYOND)).cmplt(half).bitmask().count_ones() > 1
    }

    /// What of the lines in a quarter, so far from the edge along the axis across two faces, these leave.
    #[inline(always)]
    pub(super) fn fill_between(&self, Faces { axis, half }: Faces, [first, second]: [f64; 2]) -> Fill {
        let start = self.from[axis] + first + second;
        let mut fill = Fill::WHOLE;
        match keep_between(&mut fill, &OnAxis::new(start, self.way[axis], [first, second]), half) {
            Some(_) => fill,
            None => Fill::NOTHING,
        }
    }

    /// How far it is from the edge to the middle of a quarter along an axis of the body, by either way across the edge.
    #[inline(always)]
    pub(super) fn offset_on_axis(&self, quarter: &Quarter, axis: usize) -> [f64; 2] {
        let [first, second] = quarter.offset;
        [self.across[0][axis] * first, self.across[1][axis] * second]
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
        let InFrame { surfaces, object, half, from, way, .. } = *self.edge;
        let [first, second] = self.offset;
        let start = from + along * way;
        let end = start + TO_NEXT * (first + second);
        let span = match half {
            Some(half) => span_in_box(half, start, end)?,
            None => surfaces.span_in_frame(object, start, end)?,
        };
        let width = TO_NEXT * first.length().min(second.length());
        Some((span, width / way.length()))
    }
}
