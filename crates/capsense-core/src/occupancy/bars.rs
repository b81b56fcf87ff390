//! Bars side by side, and what of them is in an object.

use super::Span;
use glam::DVec3;

/// How many bars are asked for at once.
pub const BARS: usize = 4;

/// A number of each bar: side by side, so that all are computed at once.
pub type OfBars = [f64; BARS];

/// A number of each bar that follows from its number.
#[inline(always)]
pub(crate) fn of_bars(of_one: impl Fn(usize) -> f64) -> OfBars {
    let mut of_all = [0.0; BARS];
    for (bar, of_bar) in of_all.iter_mut().enumerate() {
        *of_bar = of_one(bar);
    }
    of_all
}

/// Where in the cross-section of all the middles of each are, in parts of half its widths. Along either axis each is at a place of its own,
/// so that they are side by side there without a gap, and places along one axis tell nothing of those along the other.
const PLACES: [OfBars; 2] = [[-0.75, -0.25, 0.25, 0.75], [-0.25, 0.75, -0.75, 0.25]];

/// How far each reaches from its middle line, in the same parts.
const REACH: f64 = 0.25;

/// Four bars in a box, all along it, of which each is a quarter as wide and as high.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bars {
    /// Where the middle line of the box starts.
    pub start: DVec3,
    /// From there to its end.
    pub way: DVec3,
    /// From the middle line to the middles of two sides of the box.
    pub across: [DVec3; 2],
}

impl Bars {
    /// None that reach anywhere.
    pub const NONE: Self = Self { start: DVec3::ZERO, way: DVec3::ZERO, across: [DVec3::ZERO; 2] };

    /// From the middle line of each to the middles of two of its sides.
    #[inline]
    pub fn sides(&self) -> [DVec3; 2] {
        let [first, second] = self.across;
        [REACH * first, REACH * second]
    }

    /// What is seen of them along an axis.
    #[inline(always)]
    pub(crate) fn on_axis(&self, axis: usize) -> OnAxis {
        OnAxis::new(self.start[axis], self.way[axis], self.across.map(|way| way[axis]))
    }

    /// Where the middle lines start along an axis.
    #[inline(always)]
    pub fn starts(&self, axis: usize) -> OfBars {
        self.on_axis(axis).starts
    }

    /// How far each reaches from its middle line along an axis.
    #[inline(always)]
    pub fn reach(&self, axis: usize) -> f64 {
        self.on_axis(axis).reach
    }

    /// Where the middle line of one starts.
    #[inline]
    pub fn start_of(&self, bar: usize) -> DVec3 {
        let [first, second] = self.across;
        self.start + (first * PLACES[0][bar] + second * PLACES[1][bar])
    }

    /// The middle lines, each from its start to its end.
    #[inline]
    pub fn middle_lines(&self) -> [[DVec3; 2]; BARS] {
        std::array::from_fn(|bar| {
            let start = self.start_of(bar);
            [start, start + self.way]
        })
    }
}

/// What is seen of bars along one axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OnAxis {
    /// Where the middle lines start.
    pub(crate) starts: OfBars,
    /// From there to their ends.
    pub(crate) way: f64,
    /// How far each bar reaches from its middle line.
    pub(crate) reach: f64,
}

impl OnAxis {
    /// Of bars in a box: where the middle line of the box starts, how far that leads, and from there to the middles of two sides.
    #[inline(always)]
    pub(crate) fn new(start: f64, way: f64, [first, second]: [f64; 2]) -> Self {
        let mut starts = [start; BARS];
        for (bar, at) in starts.iter_mut().enumerate() {
            *at += first * PLACES[0][bar] + second * PLACES[1][bar];
        }
        Self { starts, way, reach: (REACH * first).abs() + (REACH * second).abs() }
    }
}

/// What of each bar is in an object: a part of its cross-section, over a part of its length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fill {
    /// Of the cross-section, in [0, 1].
    pub part: OfBars,
    /// Where along the bar that starts, in [0, 1].
    pub enter: OfBars,
    /// Where it ends, in [enter, 1].
    pub exit: OfBars,
}

impl Fill {
    /// Nothing of any.
    pub const NOTHING: Self = Self { part: [0.0; BARS], ..Self::WHOLE };

    /// All of all.
    pub const WHOLE: Self = Self { part: [1.0; BARS], enter: [0.0; BARS], exit: [1.0; BARS] };

    /// The whole cross-section of each bar over a part of its length, if any.
    #[inline]
    pub fn over(spans: [Option<Span>; BARS]) -> Self {
        let mut fill = Self::WHOLE;
        for (bar, span) in spans.into_iter().enumerate() {
            match span {
                Some(Span { enter, exit }) => (fill.enter[bar], fill.exit[bar]) = (enter, exit),
                None => fill.part[bar] = 0.0,
            }
        }
        fill
    }

    /// The part of a bar's cross-section, and that of its length.
    #[inline]
    pub fn of(&self, bar: usize) -> Option<(f64, Span)> {
        let span = Span { enter: self.enter[bar], exit: self.exit[bar] };
        (self.part[bar] > 0.0).then_some((self.part[bar], span))
    }
}
