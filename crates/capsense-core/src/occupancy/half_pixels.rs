//! Where a line crosses the borders of pixels and the lines half-way between them.

use glam::DVec2;

/// The parameters at which a line crosses multiples of half a pixel, in order.
pub(super) struct HalfPixelBorders {
    pub(super) axes: [AxisBorders; 2],
}

/// Those along one axis.
pub(super) struct AxisBorders {
    from: f64,
    /// Parameter for each pixel.
    inverse: f64,
    /// The next border, in half pixels, and the one behind the last.
    next: i32,
    end: i32,
    direction: i32,
}

impl HalfPixelBorders {
    pub(super) fn between([a, b]: [DVec2; 2]) -> Self {
        let axes = [(a.x, b.x), (a.y, b.y)].map(|(from, to)| {
            let (first, last) = (floor(2.0 * from), floor(2.0 * to));
            let (next, end, direction) =
                if first <= last { (first + 1, last + 1, 1) } else { (first, last, -1) };
            let inverse = if next == end { 0.0 } else { 1.0 / (to - from) };
            AxisBorders { from, inverse, next, end, direction }
        });
        Self { axes }
    }

    /// The same, to be walked from the end of the line.
    pub(super) fn backwards(&self) -> Self {
        Self { axes: [&self.axes[0], &self.axes[1]].map(AxisBorders::backwards) }
    }

    /// Number of crossings.
    pub(super) fn count(&self) -> u32 {
        self.axes.iter().map(|axis| axis.end.abs_diff(axis.next)).sum()
    }

    /// The next crossing after a parameter; 1 after the last.
    pub(super) fn next_after(&mut self, t: f64) -> f64 {
        loop {
            let crossings = [&self.axes[0], &self.axes[1]].map(AxisBorders::crossing);
            let axis = usize::from(crossings[1] < crossings[0]);
            if crossings[axis] >= 1.0 {
                return 1.0;
            }
            self.axes[axis].next += self.axes[axis].direction;
            if crossings[axis] > t {
                return crossings[axis];
            }
        }
    }

    /// The same on the way back: 0 after the last.
    pub(super) fn next_before(&mut self, t: f64) -> f64 {
        loop {
            let crossings = [&self.axes[0], &self.axes[1]].map(AxisBorders::crossing_back);
            let axis = usize::from(crossings[1] > crossings[0]);
            if crossings[axis] <= 0.0 {
                return 0.0;
            }
            self.axes[axis].next += self.axes[axis].direction;
            if crossings[axis] < t {
                return crossings[axis];
            }
        }
    }
}

impl AxisBorders {
    /// Passes all borders up to one that the line crosses, and returns where it does.
    pub(super) fn pass(&mut self, border: usize) -> f64 {
        self.next = border as i32;
        let crossing = self.crossing();
        self.next += self.direction;
        crossing
    }

    /// Those on the way back.
    fn backwards(&self) -> Self {
        let (next, end) = (self.end - self.direction, self.next - self.direction);
        Self { next, end, direction: -self.direction, ..*self }
    }

    /// Where the next border is crossed; beyond the end of the line if there is none.
    #[inline]
    fn crossing(&self) -> f64 {
        if self.next == self.end { f64::INFINITY } else { self.at_next() }
    }

    /// The same on the way back.
    #[inline]
    fn crossing_back(&self) -> f64 {
        if self.next == self.end { f64::NEG_INFINITY } else { self.at_next() }
    }

    #[inline]
    fn at_next(&self) -> f64 {
        (0.5 * f64::from(self.next) - self.from) * self.inverse
    }
}

/// The largest whole number not above a value, which a pixel coordinate always is near enough to zero to have.
fn floor(value: f64) -> i32 {
    let towards_zero = value as i32;
    towards_zero - i32::from(value < f64::from(towards_zero))
}
