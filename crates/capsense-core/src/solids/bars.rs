//! What of bars is in a convex solid: of faces that are along a bar the part of its cross-section that they leave, of others where its
//! middle line passes them. So what is in a bar changes evenly as a face moves through it, however that is turned.
//!
//! A face takes from the cross-section, at each place along the bar, what of the bar's width is before it, as if it were across
//! that width. Opposite faces together leave a part that grows along the bar, up to the whole or what fits between the faces, and then
//! falls. In its place stands a bar of as much volume, as thick as it is at the most.

use super::convex::Convex;
use crate::instructions::vectorised;
use crate::occupancy::{BARS, Bars, Fill, larger, smaller};
use glam::DVec2;

/// Bars are no thinner than this, in metres: by less nothing can be divided.
const LEAST_REACH: f64 = 1e-100;

/// What is missing from a cross-section is the same all along a bar if it differs by less than this from end to end.
const EVEN: f64 = 1e-6;

impl Convex {
    /// What of each bar is in the solid.
    pub(super) fn fill(&self, bars: &Bars) -> Fill {
        let mut fill = Fill::WHOLE;
        let is_met = match *self {
            Self::Box(half) => vectorised(
                #[inline(always)]
                || {
                    keep_between(&mut fill, bars, 0, half.x)
                        && keep_between(&mut fill, bars, 1, half.y)
                        && keep_between(&mut fill, bars, 2, half.z)
                },
            ),
            Self::Cylinder { radius, half_length } => {
                let is_met = keep_between(&mut fill, bars, 2, half_length);
                if is_met && is_along_axis(bars) {
                    keep_about_axis(&mut fill, bars, radius);
                } else if is_met {
                    keep_interval(&mut fill, bars, &Self::Cylinder { radius, half_length: f64::INFINITY });
                }
                is_met
            }
            Self::Capsule { radius, half_length } if half_length > 0.0 && is_along_axis(bars) => {
                keep_about_axis(&mut fill, bars, radius);
                keep_between_caps(&mut fill, bars, [radius, half_length]);
                true
            }
            Self::Capsule { .. } => {
                keep_interval(&mut fill, bars, self);
                true
            }
        };
        if is_met { fill } else { Fill::NOTHING }
    }
}

/// Whether bars lead so nearly along z that they move sideways by less than they are thick.
fn is_along_axis(bars: &Bars) -> bool {
    bars.way.truncate().length_squared() < 4.0 * bars.half.truncate().length_squared()
}

/// Keeps what is left between the faces across an axis, so far from the origin; returns whether that may be anything.
#[inline(always)]
fn keep_between(fill: &mut Fill, bars: &Bars, axis: usize, half: f64) -> bool {
    let [a, b, c, d] = bars.starts;
    let starts = [a[axis], b[axis], c[axis], d[axis]];
    let (way, reach) = (bars.way[axis], bars.half[axis]);
    let least = smaller(smaller(starts[0], starts[1]), smaller(starts[2], starts[3]));
    let most = larger(larger(starts[0], starts[1]), larger(starts[2], starts[3]));
    let (least, most) = (least + smaller(way, 0.0) - reach, most + larger(way, 0.0) + reach);
    if least >= -half && most <= half {
        return true;
    }
    if least >= half || most <= -half {
        return false;
    }
    let (lines, faces) = (Lines::new(way, reach), [-half, half]);
    if lines.are_even() {
        for (part, start) in fill.part.iter_mut().zip(starts) {
            *part *= lines.part(start, faces);
        }
    } else if reach == 0.0 {
        // The faces are across the bars, which all start at one place.
        let left = lines.left(starts[0], faces);
        (0..BARS).for_each(|bar| keep(fill, bar, left));
    } else {
        for (bar, start) in starts.into_iter().enumerate() {
            keep(fill, bar, lines.left(start, faces));
        }
    }
    true
}

/// Keeps what the side of a cylinder about the z axis leaves of bars that are nearly along it.
fn keep_about_axis(fill: &mut Fill, bars: &Bars, radius: f64) {
    for bar in 0..BARS {
        let [from, to] = [bars.starts[bar], bars.starts[bar] + bars.way].map(|end| end.truncate());
        let outwards = (0.5 * (from + to)).normalize_or(DVec2::X);
        let lines = Lines::new(to.length() - from.length(), bars.half.truncate().dot(outwards.abs()));
        let beyond_axis = -radius - 2.0 * lines.reach;
        keep(fill, bar, lines.left(from.length(), [beyond_axis, radius]));
    }
}

/// Keeps what the round ends of a capsule leave of the same.
fn keep_between_caps(fill: &mut Fill, bars: &Bars, [radius, half_length]: [f64; 2]) {
    let lines = Lines::new(bars.way.z, bars.half.z);
    for bar in 0..BARS {
        let beside = (bars.starts[bar] + 0.5 * bars.way).truncate().length_squared();
        let end = half_length + (radius * radius - beside).max(0.0).sqrt();
        keep(fill, bar, lines.left(bars.starts[bar].z, [-end, end]));
    }
}

/// Keeps the part of each middle line that is in a solid.
fn keep_interval(fill: &mut Fill, bars: &Bars, solid: &Convex) {
    for bar in 0..BARS {
        let [enter, exit] = solid.interval(bars.starts[bar], bars.way).unwrap_or_default();
        keep(fill, bar, Left { part: 1.0, enter, exit });
    }
}

/// What is left of a bar: a part of its cross-section, from one place along it to another.
#[derive(Clone, Copy, Debug)]
struct Left {
    part: f64,
    enter: f64,
    exit: f64,
}

/// Keeps of a bar what is left of it otherwise.
#[inline(always)]
fn keep(fill: &mut Fill, bar: usize, Left { part, enter, exit }: Left) {
    let (enter, exit) = (larger(fill.enter[bar], enter), smaller(fill.exit[bar], exit));
    (fill.enter[bar], fill.exit[bar]) = (enter, larger(enter, exit));
    fill.part[bar] *= if enter < exit { part } else { 0.0 };
}

/// Bars along an axis: how far they lead along it, by size and sign, and how far they reach from their middle lines.
#[derive(Clone, Copy, Debug)]
struct Lines {
    way: f64,
    is_backwards: bool,
    reach: f64,
    per_thickness: f64,
    per_way: f64,
}

impl Lines {
    #[inline(always)]
    fn new(way: f64, reach: f64) -> Self {
        let (way, is_backwards, reach) = (way.abs(), way < 0.0, larger(reach, LEAST_REACH));
        Self { way, is_backwards, reach, per_thickness: 0.5 / reach, per_way: 1.0 / way }
    }

    /// Whether faces take as much of the cross-section all along them.
    #[inline(always)]
    fn are_even(&self) -> bool {
        self.way * self.per_thickness < EVEN
    }

    /// The thickest part of the cross-section that two faces leave of a bar whose middle line starts at a place.
    #[inline(always)]
    fn part(&self, start: f64, faces: [f64; 2]) -> f64 {
        let [above, below] = self.inside(start, faces);
        let fits = smaller((faces[1] - faces[0]) * self.per_thickness, 1.0);
        within((smaller(above, below) + self.reach) * self.per_thickness, fits)
    }

    /// How far the middle line is inside of either face at the most.
    #[inline(always)]
    fn inside(&self, start: f64, [low, high]: [f64; 2]) -> [f64; 2] {
        let least = if self.is_backwards { start - self.way } else { start };
        [least + self.way - low, high - least]
    }

    /// What two faces leave of such a bar.
    #[inline(always)]
    fn left(&self, start: f64, faces: [f64; 2]) -> Left {
        let part = self.part(start, faces);
        let [above, below] = self.inside(start, faces);
        let (missing_below, missing_above) = (self.missing(above), self.missing(below));
        let all = missing_below + missing_above;
        let left = larger(1.0 - all, 0.0);
        let length = if part < 1.0 { smaller(left / larger(part, f64::MIN_POSITIVE), 1.0) } else { left };
        let mut enter = if self.is_backwards { missing_above } else { missing_below };
        if part < 1.0 {
            // Of what is missing, that much at the start.
            enter *= (1.0 - length) / larger(all, f64::MIN_POSITIVE);
        }
        Left { part, enter, exit: enter + length }
    }

    /// What a face takes of the volume if the middle line is so far inside of it at one end and, the bar's way less, at the other.
    #[inline(always)]
    fn missing(&self, inside: f64) -> f64 {
        let Self { way, reach, per_thickness, per_way, .. } = *self;
        if inside - way >= reach {
            return 0.0;
        }
        // Of the cross-section (reach - x) / 2 reach is missing where the middle line is x inside, but no less than nothing and no more
        // than all.
        if way < 2.0 * reach {
            let least = (reach - inside) * per_thickness;
            let more = way * per_thickness;
            if more < EVEN {
                return within(least + 0.5 * more, 1.0);
            }
            let sum = |ramp: f64| {
                let some = within(ramp, 1.0);
                0.5 * some * some + larger(ramp - 1.0, 0.0)
            };
            if least >= 1.0 { 1.0 } else { (sum(least + more) - sum(least)) * (2.0 * reach * per_way) }
        } else {
            let (width, behind) = (2.0 * reach * per_way, 1.0 - inside * per_way);
            let sum = |behind: f64| {
                let some = within(behind + 0.5 * width, width);
                0.5 * some * (some / width) + larger(behind - 0.5 * width, 0.0)
            };
            sum(behind) - sum(behind - 1.0)
        }
    }
}

/// A number, but no less than nothing and no more than another.
#[inline(always)]
fn within(number: f64, most: f64) -> f64 {
    smaller(larger(number, 0.0), most)
}
