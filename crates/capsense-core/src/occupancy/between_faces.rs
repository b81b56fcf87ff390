//! What two opposite faces leave of bars: see [`crate::solids`], where boxes are made of them.

use super::{Fill, OfBars, OnAxis, either, larger, of_bars, smaller};

/// Bars are no thinner than this, in metres: by less nothing can be divided.
pub(crate) const LEAST_REACH: f64 = 1e-100;

/// What is missing from a cross-section is the same all along a bar if it differs by less than this from end to end.
const EVEN: f64 = 1e-6;

/// Keeps what is left of bars between two faces across an axis, so far from the origin; returns whether that may be a part alone, and `None` if it is
/// nothing.
#[inline(always)]
pub(crate) fn keep_between(fill: &mut Fill, bars: &OnAxis, half: f64) -> Option<bool> {
    let OnAxis { starts, way, reach } = *bars;
    let least = smaller(smaller(starts[0], starts[1]), smaller(starts[2], starts[3]));
    let most = larger(larger(starts[0], starts[1]), larger(starts[2], starts[3]));
    let (least, most) = (least + smaller(way, 0.0) - reach, most + larger(way, 0.0) + reach);
    if least >= -half && most <= half {
        return Some(false);
    }
    if least >= half || most <= -half {
        return None;
    }
    Lines::new(way, reach, &starts).keep_between(fill, [-half, half]);
    Some(true)
}

/// Bars along an axis: how far they lead along it, by size and sign, how far they reach from their middle lines, and where these
/// are lowest.
#[derive(Clone, Copy, Debug)]
struct Lines {
    way: f64,
    is_backwards: bool,
    reach: f64,
    per_thickness: f64,
    per_way: f64,
    lowest: OfBars,
}

impl Lines {
    #[inline(always)]
    fn new(way: f64, reach: f64, starts: &OfBars) -> Self {
        let (length, is_backwards, reach) = (way.abs(), way < 0.0, larger(reach, LEAST_REACH));
        let lowest = of_bars(
            #[inline(always)]
            |bar| starts[bar] + smaller(way, 0.0),
        );
        Self { way: length, is_backwards, reach, per_thickness: 0.5 / reach, per_way: 1.0 / length, lowest }
    }

    /// Keeps what two faces leave of each.
    #[inline(always)]
    fn keep_between(&self, fill: &mut Fill, [low, high]: [f64; 2]) {
        let Self { way, is_backwards, reach, per_thickness, lowest, .. } = *self;
        // How far middle lines are inside of either face at the most.
        let above = of_bars(
            #[inline(always)]
            |bar| lowest[bar] + way - low,
        );
        let below = of_bars(
            #[inline(always)]
            |bar| high - lowest[bar],
        );
        // The thickest part of the cross-section that is left.
        let fits = smaller((high - low) * per_thickness, 1.0);
        let part = of_bars(
            #[inline(always)]
            |bar| within((smaller(above[bar], below[bar]) + reach) * per_thickness, fits),
        );
        if way * per_thickness < EVEN {
            fill.part = of_bars(
                #[inline(always)]
                |bar| fill.part[bar] * part[bar],
            );
            return;
        }
        let (missing_below, missing_above) = (self.missing(above), self.missing(below));
        let missing_before = if is_backwards { missing_above } else { missing_below };
        let all = of_bars(
            #[inline(always)]
            |bar| missing_below[bar] + missing_above[bar],
        );
        let left = of_bars(
            #[inline(always)]
            |bar| larger(1.0 - all[bar], 0.0),
        );
        // As thick as it is at the most, and as much volume: of what is missing along a bar then, so much is at its start.
        let length = of_bars(
            #[inline(always)]
            |bar| {
                let thinner = smaller(left[bar] / larger(part[bar], f64::MIN_POSITIVE), 1.0);
                either(part[bar] < 1.0, thinner, left[bar])
            },
        );
        let enter = of_bars(
            #[inline(always)]
            |bar| {
                let at_start = (1.0 - length[bar]) / larger(all[bar], f64::MIN_POSITIVE);
                missing_before[bar] * either(part[bar] < 1.0, at_start, 1.0)
            },
        );
        let exit = of_bars(
            #[inline(always)]
            |bar| smaller(fill.exit[bar], enter[bar] + length[bar]),
        );
        let enter = of_bars(
            #[inline(always)]
            |bar| larger(fill.enter[bar], enter[bar]),
        );
        fill.part = of_bars(
            #[inline(always)]
            |bar| fill.part[bar] * either(enter[bar] < exit[bar], part[bar], 0.0),
        );
        fill.exit = of_bars(
            #[inline(always)]
            |bar| larger(enter[bar], exit[bar]),
        );
        fill.enter = enter;
    }

    /// What a face takes of the volume if the middle line is so far inside of it at one end and, the bar's way less, at the other.
    #[inline(always)]
    fn missing(&self, inside: OfBars) -> OfBars {
        let Self { way, reach, per_thickness, per_way, .. } = *self;
        // Of the cross-section (reach - x) / 2 reach is missing where the middle line is x inside, but no less than nothing and no more
        // than all.
        if way < 2.0 * reach {
            let (more, thickness) = (way * per_thickness, 2.0 * reach * per_way);
            of_bars(
                #[inline(always)]
                |bar| {
                    let least = (reach - inside[bar]) * per_thickness;
                    let some = (sum_of_ramp(least + more, 1.0) - sum_of_ramp(least, 1.0)) * thickness;
                    either(inside[bar] - way >= reach, 0.0, either(least >= 1.0, 1.0, some))
                },
            )
        } else {
            let width = 2.0 * reach * per_way;
            of_bars(
                #[inline(always)]
                |bar| {
                    let end = 1.0 - inside[bar] * per_way + 0.5 * width;
                    let some = sum_of_ramp(end, width) - sum_of_ramp(end - 1.0, width);
                    either(inside[bar] - way >= reach, 0.0, some)
                },
            )
        }
    }
}

/// The integral, up to a place, of what rises from nothing to one over a width and stays there.
#[inline(always)]
fn sum_of_ramp(to: f64, width: f64) -> f64 {
    let rising = within(to, width);
    0.5 * rising * (rising / width) + larger(to - width, 0.0)
}

/// A number, but no less than nothing and no more than another.
#[inline(always)]
pub(crate) fn within(number: f64, most: f64) -> f64 {
    smaller(larger(number, 0.0), most)
}
