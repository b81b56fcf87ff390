//! What of bars is in a convex solid.
//!
//! **Boxes.** A face takes from the cross-section, at each place along the bar, what of the bar's width is before it, as if it were across
//! that width: of faces along a bar it takes a part of all of it, of others what is behind them. Opposite faces together leave a part
//! that grows along the bar, up to the whole or what fits between the faces, and then falls. In its place stands a bar of as much volume, as
//! thick as it is at the most. So what is in a bar changes evenly as a face moves through it, however that is turned. A bar that passes a
//! box by its edge may be before no face and yet outside: of all planes that can part two boxes (their faces', and those along an edge of
//! either) each leaves what of the bar's thickness is not behind it.
//!
//! **Cylinders and capsules.** Where they stand along bars or across them, ends are faces, and a side takes of bars along it what is
//! between the distances of the nearest and of the farthest place of the cross-section from the axis. Turned ones, whose sides slant, and spheres have chords that change evenly by
//! themselves: middle lines are asked.

use super::convex::Convex;
use crate::instructions::vectorised;
use crate::occupancy::{BARS, Bars, Fill, larger, smaller};
use glam::DVec3;

/// Bars are no thinner than this, in metres: by less nothing can be divided.
const LEAST_REACH: f64 = 1e-100;

/// What is missing from a cross-section is the same all along a bar if it differs by less than this from end to end.
const EVEN: f64 = 1e-6;

/// Directions are along each other if they differ by no more than this.
const ALONG: f64 = 1e-9;

impl Convex {
    /// What of each bar is in the solid: nothing of those that are outside, all of those that are inside.
    pub(super) fn fill(&self, bars: &Bars) -> Fill {
        let mut fill = Fill::WHOLE;
        let is_met = match *self {
            Self::Box(half) => vectorised(
                #[inline(always)]
                || keep_in_box(&mut fill, bars, half),
            ),
            Self::Cylinder { radius, half_length } if is_aligned(bars) => {
                let is_met = keep_between(&mut fill, bars, 2, half_length).is_some();
                if is_along_z(bars.way) {
                    keep_about_axis(&mut fill, bars, radius);
                } else {
                    keep_interval(&mut fill, bars, &Self::Cylinder { radius, half_length: f64::INFINITY });
                }
                is_met
            }
            Self::Capsule { radius, half_length } if half_length > 0.0 && is_along_z(bars.way) => {
                keep_about_axis(&mut fill, bars, radius);
                keep_between_caps(&mut fill, bars, self);
                true
            }
            Self::Cylinder { .. } | Self::Capsule { .. } => {
                keep_interval(&mut fill, bars, self);
                true
            }
        };
        if is_met { fill } else { Fill::NOTHING }
    }
}

/// Keeps what is in a box; returns whether that may be anything.
#[inline(always)]
fn keep_in_box(fill: &mut Fill, bars: &Bars, half: DVec3) -> bool {
    let Some(x) = keep_between(fill, bars, 0, half.x) else { return false };
    let Some(y) = keep_between(fill, bars, 1, half.y) else { return false };
    let Some(z) = keep_between(fill, bars, 2, half.z) else { return false };
    if (x & y) | (y & z) | (z & x) {
        keep_where_not_apart(fill, bars, half);
    }
    true
}

fn is_along_z(way: DVec3) -> bool {
    way.truncate().length_squared() <= ALONG * ALONG * way.length_squared()
}

/// Whether the sides of bars are along the z axis and across it.
fn is_aligned(bars: &Bars) -> bool {
    let is_across_z = |way: DVec3| way.z.abs() <= ALONG * way.length();
    [bars.way, bars.across[0], bars.across[1]].into_iter().all(|way| is_along_z(way) || is_across_z(way))
}

/// Keeps what is left between the faces across an axis, so far from the origin; returns whether that may be a part alone, and `None` if it is
/// nothing.
#[inline(always)]
fn keep_between(fill: &mut Fill, bars: &Bars, axis: usize, half: f64) -> Option<bool> {
    let [a, b, c, d] = bars.starts;
    let starts = [a[axis], b[axis], c[axis], d[axis]];
    let (way, reach) = (bars.way[axis], bars.reach()[axis]);
    let least = smaller(smaller(starts[0], starts[1]), smaller(starts[2], starts[3]));
    let most = larger(larger(starts[0], starts[1]), larger(starts[2], starts[3]));
    let (least, most) = (least + smaller(way, 0.0) - reach, most + larger(way, 0.0) + reach);
    if least >= -half && most <= half {
        return Some(false);
    }
    if least >= half || most <= -half {
        return None;
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
    Some(true)
}

/// Keeps nothing of bars that a plane parts from a box, which its faces by themselves do not tell, and little of those that nearly are.
fn keep_where_not_apart(fill: &mut Fill, bars: &Bars, half: DVec3) {
    let [way, first, second] = [0.5 * bars.way, bars.across[0], bars.across[1]];
    let sides = [way, first, second];
    // If bars and box have an axis in common, planes along their faces tell all.
    let is_aligned =
        sides.iter().any(|side| side.to_array().iter().filter(|part| **part == 0.0).count() == 2);
    let along_both = |axis: DVec3| sides.map(|side| axis.cross(side));
    for bar in 0..BARS {
        if fill.part[bar] == 0.0 {
            continue;
        }
        let centre = bars.starts[bar] + way;
        // How far both reach into each other along a direction.
        let overlap = |normal: DVec3| {
            let reach = normal.dot(way).abs() + normal.dot(first).abs() + normal.dot(second).abs();
            normal.abs().dot(half) + reach - normal.dot(centre).abs()
        };
        let length = overlap(way) / (2.0 * way.length_squared());
        fill.exit[bar] = smaller(fill.exit[bar], fill.enter[bar] + larger(length, 0.0));
        let mut part = smaller(
            overlap(first) / (2.0 * first.length_squared()),
            overlap(second) / (2.0 * second.length_squared()),
        );
        for normal in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().filter(|_| !is_aligned).flat_map(along_both)
        {
            if normal.length_squared() > ALONG * ALONG * way.length_squared() {
                let thickness = normal.dot(first).abs() + normal.dot(second).abs();
                part = smaller(part, overlap(normal) / larger(2.0 * thickness, LEAST_REACH));
            }
        }
        fill.part[bar] = within(part, fill.part[bar]);
    }
}

/// Places of a cross-section, in parts of its half sides: its corners, the middles of its sides, and its middle.
const OF_CROSS_SECTION: [[f64; 2]; 9] = [
    [-1.0, -1.0],
    [1.0, -1.0],
    [-1.0, 1.0],
    [1.0, 1.0],
    [0.0, -1.0],
    [0.0, 1.0],
    [-1.0, 0.0],
    [1.0, 0.0],
    [0.0, 0.0],
];

/// Where the line of a bar that is along the z axis and next to it starts, and how far it and the farthest are from the axis.
fn nearest_to_axis(bars: &Bars, bar: usize) -> (DVec3, [f64; 2]) {
    let [first, second] = bars.across;
    let mut nearest = (bars.starts[bar], f64::INFINITY);
    let mut farthest = 0.0;
    for [along_first, along_second] in OF_CROSS_SECTION {
        let start = bars.starts[bar] + along_first * first + along_second * second;
        let distance = start.truncate().length();
        if distance < nearest.1 {
            nearest = (start, distance);
        }
        farthest = larger(farthest, distance);
    }
    (nearest.0, [nearest.1, farthest])
}

/// Keeps what the side of a cylinder about the z axis leaves of bars that are along it.
fn keep_about_axis(fill: &mut Fill, bars: &Bars, radius: f64) {
    for bar in 0..BARS {
        let (_, [nearest, farthest]) = nearest_to_axis(bars, bar);
        fill.part[bar] *= within((radius - nearest) / larger(farthest - nearest, LEAST_REACH), 1.0);
    }
}

/// Keeps what the round ends of a capsule leave of the same, as of the line next to the axis.
fn keep_between_caps(fill: &mut Fill, bars: &Bars, capsule: &Convex) {
    for bar in 0..BARS {
        let (start, _) = nearest_to_axis(bars, bar);
        let [enter, exit] = capsule.interval(start, bars.way).unwrap_or_default();
        keep(fill, bar, Left { part: 1.0, enter, exit });
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

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use glam::DQuat;
    use proptest::prelude::*;

    /// Four bars side by side about a place, so long, wide and high, along x but for a rotation.
    fn bars(rotation: DQuat, middle: DVec3, size: DVec3) -> Bars {
        let [way, width, height] = [DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z];
        let starts = [[-1.5, -0.5], [-0.5, 1.5], [0.5, -1.5], [1.5, 0.5]]
            .map(|[wide, high]| middle + rotation * (wide * width + high * height - 0.5 * way));
        Bars { starts, way: rotation * way, across: [0.5 * (rotation * width), 0.5 * (rotation * height)] }
    }

    fn volumes(fill: &Fill) -> [f64; BARS] {
        std::array::from_fn(|bar| fill.part[bar] * (fill.exit[bar] - fill.enter[bar]))
    }

    fn rotations() -> impl Strategy<Value = DQuat> {
        let part = -1.0..1.0;
        [part.clone(), part.clone(), part.clone(), part].prop_filter_map("too short", |[x, y, z, w]| {
            let rotation = DQuat::from_xyzw(x, y, z, w);
            (rotation.length() > 0.1).then(|| rotation.normalize())
        })
    }

    fn vectors(size: std::ops::Range<f64>) -> impl Strategy<Value = DVec3> {
        [size.clone(), size.clone(), size].prop_map(DVec3::from_array)
    }

    proptest! {
        /// Of bars along the axes of a box the volume is known, whatever is thinner than what.
        #[test]
        fn boxes_along_bars_fill_what_they_overlap(
            half in vectors(0.05..2.0),
            middle in vectors(-2.0..2.0),
            size in vectors(0.05..2.0),
        ) {
            let bars = bars(DQuat::IDENTITY, middle, size);
            let found = volumes(&Convex::Box(half).fill(&bars));
            for (bar, start) in bars.starts.into_iter().enumerate() {
                let centre = start + 0.5 * bars.way;
                let overlap = ((centre + 0.5 * size).min(half) - (centre - 0.5 * size).max(-half)).max(DVec3::ZERO) / size;
                prop_assert!((found[bar] - overlap.element_product()).abs() < 1e-9, "{} {overlap}", found[bar]);
            }
        }

        /// A body that moves a little takes or leaves little of a bar, however either is turned.
        #[test]
        fn bodies_that_move_fill_bars_evenly(
            rotation in prop_oneof![Just(DQuat::IDENTITY), Just(DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2)), rotations()],
            half in vectors(0.3..2.0),
            middle in vectors(-2.0..2.0),
            size in vectors(0.3..1.0),
            direction in 0..3usize,
        ) {
            let step = 1e-4;
            let [mut now, mut then] = [middle, middle];
            now[direction] -= 0.5 * step;
            then[direction] += 0.5 * step;
            let (radius, half_length) = (half.x, half.z);
            // Chords near the side of something round are as the root of what is left.
            for (solid, most) in [
                (Convex::Box(half), 4e-3),
                (Convex::Cylinder { radius, half_length }, 0.15),
                (Convex::Capsule { radius, half_length }, 0.15),
                (Convex::Capsule { radius, half_length: 0.0 }, 0.15),
            ] {
                let [now, then] = [now, then].map(|middle| volumes(&solid.fill(&bars(rotation, middle, size))));
                for bar in 0..BARS {
                    prop_assert!((now[bar] - then[bar]).abs() < most, "{solid:?} {} {}", now[bar], then[bar]);
                }
            }
        }

        /// Nothing is told of bars that no point of is in the body: of a box that is turned against them, that is more than its faces tell.
        #[test]
        fn bars_outside_are_empty(
            rotation in prop_oneof![Just(DQuat::IDENTITY), Just(DQuat::from_rotation_z(0.7)), rotations()],
            half in vectors(0.3..1.0),
            middle in vectors(-2.0..2.0),
            size in vectors(0.3..2.0),
        ) {
            let bars = bars(rotation, middle, size);
            let (radius, half_length) = (half.x, half.z);
            let solids = [
                Convex::Box(half),
                Convex::Cylinder { radius, half_length },
                Convex::Capsule { radius, half_length },
            ];
            for solid in solids {
                let fill = solid.fill(&bars);
                for bar in (0..BARS).filter(|&bar| fill.part[bar] * (fill.exit[bar] - fill.enter[bar]) > 2e-2) {
                    let parts = |count: u32| (0..=count).map(move |k| f64::from(k) / f64::from(count));
                    let is_met = parts(24).any(|along| parts(8).any(|wide| parts(8).any(|high| {
                        let [wide, high] = [wide, high].map(|part| 2.0 * part - 1.0);
                        let point = bars.starts[bar] + along * bars.way + wide * bars.across[0] + high * bars.across[1];
                        solid.contains(point)
                    })));
                    prop_assert!(is_met, "{solid:?} {fill:?}");
                }
            }
        }

        /// What is all inside is told to be so, and what is all outside.
        #[test]
        fn bars_within_and_beside_are_whole_and_empty(rotation in rotations(), place in vectors(-0.2..0.2)) {
            let size = DVec3::splat(0.1);
            let (half, radius, half_length) = (DVec3::splat(1.0), 1.0, 1.0);
            for solid in [Convex::Box(half), Convex::Cylinder { radius, half_length }, Convex::Capsule { radius, half_length }] {
                prop_assert_eq!(solid.fill(&bars(rotation, place, size)), Fill::WHOLE);
                let beside = solid.fill(&bars(rotation, place + 4.0 * DVec3::X, size));
                prop_assert_eq!(beside.part, Fill::NOTHING.part);
            }
        }
    }
}
