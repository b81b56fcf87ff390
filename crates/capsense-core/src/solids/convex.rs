//! Boxes, spheres, capsules and cylinders in their own frames: which points and which part of a line they hold.
//!
//! A line meets a convex solid in one interval, which has a closed form: that of slabs for flat faces, that of a
//! quadratic for round ones. The quadratic is solved from the line's distance to the centre, so that nothing cancels
//! when both ends are far away.

use crate::occupancy::{RightAngled, Side};
use glam::{BVec3, DVec2, DVec3};
use std::f64::consts::FRAC_PI_2;

/// Solids are smaller than stated by this part. Points that lie in a face but for rounding then all are outside, so that
/// a face in a plane of nodes holds either all or none of them, and opposite faces are alike.
const SHRINK: f64 = 1e-12;

/// What is beyond a face by this part of how far it is from the centre is so whatever rounding does.
const BEYOND: f64 = 1e-9;

/// A convex solid about the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Convex {
    /// Half the edge lengths.
    Box(DVec3),
    /// All that is nearer than the radius to a piece of the z axis; a sphere if its half length is zero.
    Capsule { radius: f64, half_length: f64 },
    /// A cylinder along z with flat ends.
    Cylinder { radius: f64, half_length: f64 },
}

/// A part of a line, from the parameter of its start to that of its end.
type Interval = [f64; 2];

const ALL: Interval = [f64::NEG_INFINITY, f64::INFINITY];

impl Convex {
    /// The solid that is used in place of this one, see [`SHRINK`].
    pub(super) fn shrunk(self) -> Self {
        let by = |length: f64| length * (1.0 - SHRINK);
        match self {
            Self::Box(half) => Self::Box(half * (1.0 - SHRINK)),
            Self::Capsule { radius, half_length } => Self::Capsule { radius: by(radius), half_length },
            Self::Cylinder { radius, half_length } => {
                Self::Cylinder { radius: by(radius), half_length: by(half_length) }
            }
        }
    }

    /// Whether a point lies inside, not on the surface.
    #[inline]
    pub(super) fn contains(&self, point: DVec3) -> bool {
        match *self {
            Self::Box(half) => point.abs().cmplt(half).all(),
            Self::Capsule { radius, half_length } => {
                let beyond = (point.z.abs() - half_length).max(0.0);
                point.truncate().length_squared() + beyond * beyond < radius * radius
            }
            Self::Cylinder { radius, half_length } => {
                point.truncate().length_squared() < radius * radius && point.z.abs() < half_length
            }
        }
    }

    /// Whether two points are both before one flat face or in it, so that what is between them certainly is outside. In that
    /// case [`Convex::interval`] says the same after divisions, with the same rounding: no part of it is between them.
    #[inline]
    pub(super) fn parts_by_face(&self, a: DVec3, b: DVec3) -> bool {
        match *self {
            Self::Box(_) | Self::Capsule { .. } => false,
            Self::Cylinder { half_length, .. } => a.z.min(b.z) >= half_length || a.z.max(b.z) <= -half_length,
        }
    }

    /// Whether a box of half size `half` about a point is all before one flat face, by more than rounding.
    #[inline]
    pub(super) fn is_beyond_face(&self, centre: DVec3, half: DVec3) -> bool {
        let near = (centre.abs() - half) * (1.0 - BEYOND);
        match *self {
            Self::Box(size) => near.cmpgt(size).any(),
            Self::Capsule { .. } => false,
            Self::Cylinder { half_length, .. } => near.z > half_length,
        }
    }

    /// Where all of a box of half size `half` about a point is by more than rounding, if that is soon seen: inside if its farthest
    /// corner is.
    #[inline]
    pub(super) fn side_of(&self, centre: DVec3, half: DVec3) -> Option<Side> {
        if self.is_beyond_face(centre, half) || self.is_around(centre, half) {
            return Some(Side::Outside);
        }
        self.contains((centre.abs() + half) * (1.0 + BEYOND)).then_some(Side::Inside)
    }

    /// Whether such a box is all farther from the axis than what is round about it reaches, by more than rounding.
    #[inline]
    fn is_around(&self, centre: DVec3, half: DVec3) -> bool {
        let (distance, reach) = match *self {
            Self::Box(_) => return false,
            Self::Capsule { radius, half_length } => {
                let beyond_end = (centre.z.abs() - half_length).max(0.0);
                (centre.truncate().extend(beyond_end).length(), radius + half.length())
            }
            Self::Cylinder { radius, .. } => (centre.truncate().length(), radius + half.truncate().length()),
        };
        distance * (1.0 - BEYOND) > reach
    }

    /// Whether a round edge, where faces meet, may be in a box of half size `half` about a point.
    pub(super) fn has_round_edge_near(&self, centre: DVec3, half: DVec3) -> bool {
        match *self {
            Self::Box(_) | Self::Capsule { .. } => false,
            Self::Cylinder { radius, half_length } => {
                let from_rim = centre.truncate().length() - radius;
                (centre.z.abs() - half_length).abs() <= half.z && from_rim.abs() <= half.truncate().length()
            }
        }
    }

    /// The solid as one whose faces meet at right angles.
    pub(super) fn right_angled(&self) -> Option<RightAngled> {
        match *self {
            Self::Box(half) => Some(RightAngled::Box(half)),
            Self::Capsule { .. } => None,
            Self::Cylinder { radius, half_length } => Some(RightAngled::Cylinder { radius, half_length }),
        }
    }

    /// The parameters between which the line `start` + t `along` is inside; the first is not above the second.
    #[inline]
    pub(super) fn interval(&self, start: DVec3, along: DVec3) -> Option<Interval> {
        match *self {
            Self::Box(half) => {
                let x = slab(start.x, along.x, half.x)?;
                let y = slab(start.y, along.y, half.y)?;
                both(both(x, y)?, slab(start.z, along.z, half.z)?)
            }
            Self::Capsule { radius, half_length } => {
                if half_length == 0.0 {
                    return ball(start, along, radius);
                }
                let end = DVec3::Z * half_length;
                let side = || both(disk(start, along, radius)?, slab(start.z, along.z, half_length)?);
                // The union of the three is convex, so that it meets the line in one interval.
                let parts = [side(), ball(start - end, along, radius), ball(start + end, along, radius)];
                parts.into_iter().flatten().reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
            }
            Self::Cylinder { radius, half_length } => {
                both(disk(start, along, radius)?, slab(start.z, along.z, half_length)?)
            }
        }
    }
}

fn both(a: Interval, b: Interval) -> Option<Interval> {
    let both = [a[0].max(b[0]), a[1].min(b[1])];
    (both[0] < both[1]).then_some(both)
}

/// Where |start + t along| < half.
#[inline]
fn slab(start: f64, along: f64, half: f64) -> Option<Interval> {
    if along == 0.0 {
        return (start.abs() < half).then_some(ALL);
    }
    let leaving = half.copysign(along);
    Some([(-leaving - start) / along, (leaving - start) / along])
}

/// Where the line is nearer than the radius to the z axis.
#[inline]
fn disk(start: DVec3, along: DVec3, radius: f64) -> Option<Interval> {
    let (start, along) = (start.truncate(), along.truncate());
    let moment = start.perp_dot(along);
    round(start.dot(along), along.length_squared(), moment * moment, radius, || start.length_squared())
}

/// Where the line is nearer than the radius to the origin.
#[inline]
fn ball(start: DVec3, along: DVec3, radius: f64) -> Option<Interval> {
    let moment = start.cross(along).length_squared();
    round(start.dot(along), along.length_squared(), moment, radius, || start.length_squared())
}

/// Where r² > |start + t along|² = distance² + |along|² (t - t_nearest)², with distance² = |start × along|² / |along|².
#[inline]
fn round(
    dot: f64,
    along_squared: f64,
    moment_squared: f64,
    radius: f64,
    start_squared: impl Fn() -> f64,
) -> Option<Interval> {
    if along_squared < f64::MIN_POSITIVE {
        return (start_squared() < radius * radius).then_some(ALL);
    }
    let within = radius * radius - moment_squared / along_squared;
    if within <= 0.0 {
        return None;
    }
    let (nearest, half) = (-dot / along_squared, (within / along_squared).sqrt());
    Some([nearest - half, nearest + half])
}

/// The whole revolution of a profile.
fn around(profile: Profile) -> [Patch; 4] {
    [0.0, 1.0, 2.0, 3.0].map(|k| Patch::Round { azimuth: [k * FRAC_PI_2, (k + 1.0) * FRAC_PI_2], profile })
}

/// A piece of a solid's surface, or of a line on it, that can be halved.
#[derive(Clone, Copy, Debug)]
pub(super) enum Patch {
    /// A rectangle, as a box without thickness.
    Flat { min: DVec3, max: DVec3 },
    /// A piece of a surface of revolution about z: azimuths within a quarter turn, and a piece of the profile.
    Round { azimuth: [f64; 2], profile: Profile },
}

/// A piece of the curve whose revolution about the z axis is a surface.
#[derive(Clone, Copy, Debug)]
pub(super) enum Profile {
    /// From one point to another, in distance from the axis and z.
    Line([DVec2; 2]),
    /// Part of a quarter circle about a point of the axis, between two elevations of one sign.
    Arc { centre: f64, radius: f64, elevation: [f64; 2] },
}

impl Profile {
    /// Smallest and largest distance from the axis and z.
    fn bounds(&self) -> [DVec2; 2] {
        let [a, b] = match *self {
            Self::Line(ends) => ends,
            Self::Arc { centre, radius, elevation } => elevation
                .map(|elevation| DVec2::new(radius * elevation.cos(), centre + radius * elevation.sin())),
        };
        [a.min(b), a.max(b)]
    }

    fn halves(&self) -> [Self; 2] {
        match *self {
            Self::Line([a, b]) => {
                let middle = 0.5 * (a + b);
                [Self::Line([a, middle]), Self::Line([middle, b])]
            }
            Self::Arc { centre, radius, elevation } => {
                halved(elevation).map(|elevation| Self::Arc { centre, radius, elevation })
            }
        }
    }
}

fn halved([a, b]: [f64; 2]) -> [[f64; 2]; 2] {
    let middle = 0.5 * (a + b);
    [[a, middle], [middle, b]]
}

impl Patch {
    /// Corners of the smallest box around the patch, but for rounding.
    pub(super) fn bounds(&self) -> [DVec3; 2] {
        match *self {
            Self::Flat { min, max } => [min, max],
            Self::Round { azimuth, profile } => {
                let [low, high] = profile.bounds();
                // Within a quarter turn, x and y are extreme at its ends.
                let corners = azimuth.map(DVec2::from_angle);
                let directions = [corners[0].min(corners[1]), corners[0].max(corners[1])];
                let min = (directions[0] * low.x).min(directions[0] * high.x);
                let max = (directions[1] * low.x).max(directions[1] * high.x);
                [min.extend(low.y), max.extend(high.y)]
            }
        }
    }

    /// Two patches that together are this one, cut across its longer direction.
    pub(super) fn halves(&self) -> [Self; 2] {
        match *self {
            Self::Flat { min, max } => {
                let size = max - min;
                let axis = size.max_position();
                let middle = min[axis] + 0.5 * size[axis];
                let (mut lower_max, mut upper_min) = (max, min);
                (lower_max[axis], upper_min[axis]) = (middle, middle);
                [Self::Flat { min, max: lower_max }, Self::Flat { min: upper_min, max }]
            }
            Self::Round { azimuth, profile } => {
                let [low, high] = profile.bounds();
                if (high - low).length() > high.x * (azimuth[1] - azimuth[0]) {
                    profile.halves().map(|profile| Self::Round { azimuth, profile })
                } else {
                    halved(azimuth).map(|azimuth| Self::Round { azimuth, profile })
                }
            }
        }
    }
}

impl Convex {
    /// Lines where the surface turns abruptly, any coordinate of which tells where they are.
    pub(super) fn edges(&self) -> Vec<(Patch, BVec3)> {
        let lines: Vec<Patch> = match *self {
            Self::Box(half) => (0..12)
                .map(|edge| {
                    let (axis, corner) = (edge / 4, edge % 4);
                    let mut min = half;
                    min[(axis + 1) % 3] *= if corner % 2 == 0 { 1.0 } else { -1.0 };
                    min[(axis + 2) % 3] *= if corner < 2 { 1.0 } else { -1.0 };
                    let max = min;
                    min[axis] = -half[axis];
                    Patch::Flat { min, max }
                })
                .collect(),
            Self::Capsule { .. } => Vec::new(),
            Self::Cylinder { radius, half_length } => {
                let rim = |z: f64| around(Profile::Line([DVec2::new(radius, z); 2]));
                rim(half_length).into_iter().chain(rim(-half_length)).collect()
            }
        };
        lines.into_iter().map(|line| (line, BVec3::TRUE)).collect()
    }

    /// Patches that together are the surface, each with the coordinates that its part of [`Convex::interval`] and of
    /// [`Convex::contains`] is made of, and nothing else: those across a flat face, those across the axis of a round side.
    /// The parts of a capsule touch each other, so that they are not told apart.
    pub(super) fn surface(&self) -> Vec<(Patch, BVec3)> {
        let side =
            |radius: f64, half: f64| Profile::Line([DVec2::new(radius, -half), DVec2::new(radius, half)]);
        let all =
            |patches: Vec<Patch>, made_of: BVec3| patches.into_iter().map(move |patch| (patch, made_of));
        match *self {
            Self::Box(half) => (0..3)
                .flat_map(|axis| {
                    [-1.0, 1.0].map(|sign| {
                        let (mut min, mut max) = (-half, half);
                        (min[axis], max[axis]) = (sign * half[axis], sign * half[axis]);
                        (Patch::Flat { min, max }, BVec3::from_array([axis == 0, axis == 1, axis == 2]))
                    })
                })
                .collect(),
            Self::Capsule { radius, half_length } => {
                let cap = |sign: f64| Profile::Arc {
                    centre: sign * half_length,
                    radius,
                    elevation: [0.0, sign * FRAC_PI_2],
                };
                let ends = around(cap(1.0)).into_iter().chain(around(cap(-1.0)));
                let side = (half_length > 0.0).then(|| around(side(radius, half_length)));
                all(ends.chain(side.into_iter().flatten()).collect(), BVec3::TRUE).collect()
            }
            Self::Cylinder { radius, half_length } => {
                let end = |z: f64| Profile::Line([DVec2::new(0.0, z), DVec2::new(radius, z)]);
                let ends = around(end(half_length)).into_iter().chain(around(end(-half_length)));
                // Slid along its axis the side is the same, and slid across it the ends are; but nodes beside them know how far they are from
                // the ends, and from the axis.
                all(ends.chain(around(side(radius, half_length))).collect(), BVec3::TRUE).collect()
            }
        }
    }
}
