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
use crate::instructions::vectorised_by_eight;
use crate::occupancy::{BARS, Bars, Fill, LEAST_REACH, keep_between, larger, of_bars, smaller, within};
use glam::DVec3;

/// So many groups of bars are looked at axis by axis: those of the quarters around an edge.
const TOGETHER: usize = 4;

/// Directions are along each other if they differ by no more than this.
const ALONG: f64 = 1e-9;

impl Convex {
    /// What of each bar is in the solid: nothing of those that are outside, all of those that are inside. All are in a box about a point, of
    /// some half size.
    pub(super) fn fill(&self, within: [DVec3; 2], bars: &[Bars], fill: &mut [Fill]) {
        match *self {
            Self::Box(half) => vectorised_by_eight(
                #[inline(always)]
                || {
                    for (bars, fill) in bars.chunks(TOGETHER).zip(fill.chunks_mut(TOGETHER)) {
                        fill_in_box(half, within, bars, fill);
                    }
                },
            ),
            _ => bars.iter().zip(fill).for_each(|(bars, fill)| *fill = self.fill_round(bars)),
        }
    }

    /// The same of a solid that is round.
    fn fill_round(&self, bars: &Bars) -> Fill {
        let mut fill = Fill::WHOLE;
        match *self {
            Self::Cylinder { radius, half_length } if is_aligned(bars) => {
                if keep_between(&mut fill, &bars.on_axis(2), half_length).is_none() {
                    return Fill::NOTHING;
                }
                if is_along_z(bars.way) {
                    keep_about_axis(&mut fill, bars, radius);
                } else {
                    keep_interval(&mut fill, bars, &Self::Cylinder { radius, half_length: f64::INFINITY });
                }
            }
            Self::Capsule { radius, half_length } if half_length > 0.0 && is_along_z(bars.way) => {
                keep_about_axis(&mut fill, bars, radius);
                keep_between_caps(&mut fill, bars, self);
            }
            _ => keep_interval(&mut fill, bars, self),
        }
        fill
    }
}

/// What of bars is in a box, in no more than [`TOGETHER`] groups. Faces that the box around all bars is behind take nothing of any.
#[inline(always)]
fn fill_in_box(half: DVec3, [middle, reach]: [DVec3; 2], bars: &[Bars], fill: &mut [Fill]) {
    let is_behind = (middle.abs() + reach).cmple(half);
    fill.iter_mut().for_each(|fill| *fill = Fill::WHOLE);
    let mut cuts = [0; TOGETHER];
    if !is_behind.x {
        keep_between_all(fill, &mut cuts, bars, 0, half.x);
    }
    if !is_behind.y {
        keep_between_all(fill, &mut cuts, bars, 1, half.y);
    }
    if !is_behind.z {
        keep_between_all(fill, &mut cuts, bars, 2, half.z);
    }
    for ((bars, fill), cuts) in bars.iter().zip(fill).zip(cuts) {
        if cuts > 1 && fill.part != Fill::NOTHING.part {
            keep_where_not_apart(fill, bars, half);
        }
    }
}

/// Keeps what is left between the faces across an axis of all bars, and counts of which these cut some.
#[inline(always)]
fn keep_between_all(fill: &mut [Fill], cuts: &mut [u8; TOGETHER], bars: &[Bars], axis: usize, half: f64) {
    for ((bars, fill), cuts) in bars.iter().zip(fill).zip(cuts) {
        match keep_between(fill, &bars.on_axis(axis), half) {
            Some(is_cut) => *cuts += u8::from(is_cut),
            None => fill.part = Fill::NOTHING.part,
        }
    }
}

fn is_along_z(way: DVec3) -> bool {
    way.truncate().length_squared() <= ALONG * ALONG * way.length_squared()
}

/// Whether the sides of bars are along the z axis and across it.
fn is_aligned(bars: &Bars) -> bool {
    let is_across_z = |way: DVec3| way.z.abs() <= ALONG * way.length();
    [bars.way, bars.across[0], bars.across[1]].into_iter().all(|way| is_along_z(way) || is_across_z(way))
}

/// Keeps nothing of bars that a plane parts from a box, which its faces by themselves do not tell, and little of those that nearly are.
#[inline(always)]
fn keep_where_not_apart(fill: &mut Fill, bars: &Bars, half: DVec3) {
    let (way, [first, second]) = (0.5 * bars.way, bars.sides());
    let centres = [0, 1, 2].map(|axis| bars.starts(axis));
    // How far each and the box reach into each other along a direction.
    let overlap = |normal: DVec3| {
        let reach = normal.dot(way).abs() + normal.dot(first).abs() + normal.dot(second).abs();
        let both = normal.abs().dot(half) + reach;
        let along_way = normal.dot(way);
        of_bars(
            #[inline(always)]
            |bar| {
                let [x, y, z] = [centres[0][bar], centres[1][bar], centres[2][bar]];
                both - (normal.x * x + normal.y * y + normal.z * z + along_way).abs()
            },
        )
    };
    let (length, per_length) = (overlap(way), 0.5 / way.length_squared());
    let (wide, per_width) = (overlap(first), 0.5 / first.length_squared());
    let (high, per_height) = (overlap(second), 0.5 / second.length_squared());
    let mut part = of_bars(
        #[inline(always)]
        |bar| smaller(wide[bar] * per_width, high[bar] * per_height),
    );
    // If bars and box have an axis in common, planes along their faces tell all.
    let has_one_part = |side: DVec3| side.to_array().into_iter().filter(|part| *part == 0.0).count() == 2;
    if ![way, first, second].into_iter().any(has_one_part) {
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            for normal in [axis.cross(way), axis.cross(first), axis.cross(second)] {
                if normal.length_squared() > ALONG * ALONG * way.length_squared() {
                    let thickness = normal.dot(first).abs() + normal.dot(second).abs();
                    let (deep, per_thickness) = (overlap(normal), 1.0 / larger(2.0 * thickness, LEAST_REACH));
                    part = of_bars(
                        #[inline(always)]
                        |bar| smaller(part[bar], deep[bar] * per_thickness),
                    );
                }
            }
        }
    }
    for bar in 0..BARS {
        let length = larger(length[bar] * per_length, 0.0);
        fill.exit[bar] = smaller(fill.exit[bar], fill.enter[bar] + length);
        fill.part[bar] = within(part[bar], fill.part[bar]);
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
    let [first, second] = bars.sides();
    let mut nearest = (bars.start_of(bar), f64::INFINITY);
    let mut farthest = 0.0;
    for [along_first, along_second] in OF_CROSS_SECTION {
        let start = bars.start_of(bar) + along_first * first + along_second * second;
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
        keep(fill, bar, [enter, exit]);
    }
}

/// Keeps the part of each middle line that is in a solid.
fn keep_interval(fill: &mut Fill, bars: &Bars, solid: &Convex) {
    for bar in 0..BARS {
        let [enter, exit] = solid.interval(bars.start_of(bar), bars.way).unwrap_or_default();
        keep(fill, bar, [enter, exit]);
    }
}

/// Keeps of a bar what is left of it from one place along it to another.
#[inline(always)]
fn keep(fill: &mut Fill, bar: usize, [enter, exit]: [f64; 2]) {
    let (enter, exit) = (larger(fill.enter[bar], enter), smaller(fill.exit[bar], exit));
    (fill.enter[bar], fill.exit[bar]) = (enter, larger(enter, exit));
    fill.part[bar] *= if enter < exit { 1.0 } else { 0.0 };
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use glam::DQuat;
    use proptest::prelude::*;

    /// Four bars side by side about a place, each so long, wide and high, along x but for a rotation.
    fn bars(rotation: DQuat, middle: DVec3, size: DVec3) -> Bars {
        let [way, width, height] = [DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z];
        let start = middle - rotation * (0.5 * way);
        Bars { start, way: rotation * way, across: [2.0 * (rotation * width), 2.0 * (rotation * height)] }
    }

    /// What of them is in a solid. That they are in a box that is nearly as large tells nothing else.
    fn fill(solid: &Convex, bars: &Bars) -> Fill {
        let (middle, [first, second]) = (bars.start + 0.5 * bars.way, bars.across);
        let half = 0.5 * bars.way.abs() + first.abs() + second.abs();
        let mut fill = [Fill::NOTHING; 2];
        for (fill, half) in fill.iter_mut().zip([half, DVec3::INFINITY]) {
            solid.fill([middle, half], std::slice::from_ref(bars), std::slice::from_mut(fill));
        }
        let [known, unknown] = fill;
        for bar in 0..BARS {
            let difference = [known, unknown].map(|fill| fill.part[bar] * (fill.exit[bar] - fill.enter[bar]));
            assert!((difference[0] - difference[1]).abs() < 1e-12, "{known:?} {unknown:?}");
        }
        known
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
            let found = volumes(&fill(&Convex::Box(half), &bars));
            for (bar, found) in found.into_iter().enumerate() {
                let centre = bars.start_of(bar) + 0.5 * bars.way;
                let overlap = ((centre + 0.5 * size).min(half) - (centre - 0.5 * size).max(-half)).max(DVec3::ZERO) / size;
                prop_assert!((found - overlap.element_product()).abs() < 1e-9, "{found} {overlap}");
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
                let [now, then] = [now, then].map(|middle| volumes(&fill(&solid, &bars(rotation, middle, size))));
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
                let fill = fill(&solid, &bars);
                for bar in (0..BARS).filter(|&bar| fill.part[bar] * (fill.exit[bar] - fill.enter[bar]) > 2e-2) {
                    let parts = |count: u32| (0..=count).map(move |k| f64::from(k) / f64::from(count));
                    let is_met = parts(24).any(|along| parts(8).any(|wide| parts(8).any(|high| {
                        let ([wide, high], [first, second]) = ([wide, high].map(|part| 2.0 * part - 1.0), bars.sides());
                        solid.contains(bars.start_of(bar) + along * bars.way + wide * first + high * second)
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
                prop_assert_eq!(fill(&solid, &bars(rotation, place, size)), Fill::WHOLE);
                let beside = fill(&solid, &bars(rotation, place + 4.0 * DVec3::X, size));
                prop_assert_eq!(beside.part, Fill::NOTHING.part);
            }
        }
    }
}
