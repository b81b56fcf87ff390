//! Bars side by side, and what of them is in an object.

use super::Span;
use glam::DVec3;

/// How many bars are asked for at once.
pub const BARS: usize = 4;

/// Bars of equal rectangular cross-section that all lead the same way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bars {
    /// Where the middle line of each starts.
    pub starts: [DVec3; BARS],
    /// From there to its end.
    pub way: DVec3,
    /// From the middle of the cross-section to the middles of two of its sides.
    pub across: [DVec3; 2],
}

impl Bars {
    /// How far the cross-section reaches from its middle along each axis.
    #[inline]
    pub fn reach(&self) -> DVec3 {
        self.across[0].abs() + self.across[1].abs()
    }
}

/// What of each bar is in an object: a part of its cross-section, over a part of its length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fill {
    /// Of the cross-section, in [0, 1].
    pub part: [f64; BARS],
    /// Where along the bar that starts, in [0, 1].
    pub enter: [f64; BARS],
    /// Where it ends, in [enter, 1].
    pub exit: [f64; BARS],
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
