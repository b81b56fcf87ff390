//! What is before the side of a cylinder, and before its ends where cells are too large for rims.
//!
//! Where cells are small, what the field around the rims leaves is that before the side, as if it had no ends. Where they are as large as
//! the radius, nothing is known of rims; a cylinder that is no disk is then what has the same capacitance, a capsule. That
//! passes within the cylinder near its rims, and beyond its ends before their middles, where nodes may be. So the potential is the mean of
//! those at the distances from both.

use super::share::{Cells, known_within, share_of_round};
use super::{RightAngles, Round, RoundNear};
use glam::DVec3;

/// So many radii longer at either end is a capsule with the radius and the capacitance of a cylinder: 0.42 to 0.41 for cylinders
/// of one to ten diameters, by rings of charge.
const BEYOND_ENDS: f64 = 0.4;

/// How much of the potential is by the distance from the cylinder, where ends are those of a capsule.
const BY_CYLINDER: f64 = 0.5;

/// So many times as long, ends are nowhere.
const ENDLESS: f64 = 1e6;

/// A cylinder with flat ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in super::super) struct FlatEnded {
    centre: DVec3,
    /// The unit vector along the axis.
    along: DVec3,
    half_length: f64,
    radius: f64,
}

/// A cylinder as cells see it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Side {
    cylinder: FlatEnded,
    /// How much its ends are those of a capsule. Up to a half they come from far away, as what is before the side; from there on nodes
    /// before them have more and more of it, too.
    rounded: f64,
}

impl FlatEnded {
    fn of(side: &Round) -> Self {
        let half_length = side.half.length();
        Self { centre: side.centre, along: side.half / half_length, half_length, radius: side.radius }
    }

    /// A point by the way along the axis from the middle, and across it.
    fn ways(&self, point: DVec3) -> (f64, DVec3) {
        let way = point - self.centre;
        let along = way.dot(self.along);
        (along, way - along * self.along)
    }

    /// How far a point is from the surface; negative within.
    pub(super) fn distance(&self, point: DVec3) -> f64 {
        let (along, across) = self.ways(point);
        let (beyond, outside) = (along.abs() - self.half_length, across.length() - self.radius);
        if beyond > 0.0 && outside > 0.0 { beyond.hypot(outside) } else { beyond.max(outside) }
    }

    /// The place of the cylinder that is nearest to a point before it.
    fn place(&self, point: DVec3) -> DVec3 {
        let (along, across) = self.ways(point);
        self.centre
            + along.clamp(-self.half_length, self.half_length) * self.along
            + across.clamp_length_max(self.radius)
    }

    /// How much ends are those of a capsule where so much is known of rims: disks have none that are.
    fn rounded(&self, known: f64) -> f64 {
        let within = (1.0 - BEYOND_ENDS) * self.radius;
        (1.0 - known) * (self.half_length / within - 1.0).clamp(0.0, 1.0)
    }
}

impl Side {
    /// The side of what has these right angles, if it is a cylinder. What is known of all of a rim counts, so that nodes on both sides of
    /// the axis see the same.
    pub(super) fn of(angles: &RightAngles, cells: &impl Cells) -> Option<Self> {
        let cylinder = FlatEnded::of(&angles.side()?);
        let largest = cells.size_along(cylinder.along).max(cells.size_across(cylinder.along));
        Some(Self { cylinder, rounded: cylinder.rounded(known_within(cylinder.radius, largest)) })
    }

    /// How much of a node's links the side has if there is nothing else, and ends that are those of a capsule: of a side without ends all of
    /// it a cell from either, and nothing beyond.
    pub(super) fn share(&self, cells: &impl Cells, point: DVec3) -> f64 {
        let FlatEnded { along, half_length, .. } = self.cylinder;
        let before_end = half_length - self.cylinder.ways(point).0.abs();
        let beside = (before_end / cells.size_along(along)).clamp(0.0, 1.0);
        let part = beside + (1.0 - beside) * (2.0 * self.rounded - 1.0).max(0.0);
        if part == 0.0 {
            return 0.0;
        }
        let place = self.cylinder.place(point);
        part * share_of_round(cells, place)
    }

    /// The surface as it is near a point.
    pub(super) fn seen_from(&self, point: DVec3) -> RoundNear {
        let FlatEnded { centre, along, half_length, radius } = self.cylinder;
        let round = |half: f64| Round { centre, half: half * along, radius };
        let ended = (2.0 * self.rounded).min(1.0);
        if ended == 0.0 {
            return round(ENDLESS * half_length).seen_from(point);
        }
        // As ends appear, they come from far away.
        let half = half_length / ended - (1.0 - BEYOND_ENDS) * radius;
        round(half).seen_from(point).in_place_of(self.cylinder, BY_CYLINDER * ended)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CYLINDER: FlatEnded =
        FlatEnded { centre: DVec3::X, along: DVec3::Z, half_length: 4.0, radius: 1.0 };

    #[test]
    fn places_are_the_nearest_ones() {
        for (point, place) in [
            (DVec3::new(4.0, 0.0, 3.0), DVec3::new(2.0, 0.0, 3.0)),
            (DVec3::new(1.5, 0.0, -6.0), DVec3::new(1.5, 0.0, -4.0)),
            (DVec3::new(1.0, 5.0, 7.0), DVec3::new(1.0, 1.0, 4.0)),
        ] {
            assert!(CYLINDER.place(point).distance(place) < 1e-12, "{point}");
            assert!((CYLINDER.distance(point) - point.distance(place)).abs() < 1e-12, "{point}");
        }
        assert!((CYLINDER.distance(DVec3::new(1.5, 0.0, 3.0)) + 0.5).abs() < 1e-12);
    }

    /// What a cylinder is taken for changes with the cells, but not in steps: ends come from far away.
    #[test]
    fn potentials_do_not_jump_as_ends_appear() {
        let points = [DVec3::new(3.0, 0.5, 0.0), DVec3::new(2.5, 0.0, 3.5), DVec3::new(1.2, 0.0, 5.0)];
        for point in points {
            let at = |rounded: f64| Side { cylinder: CYLINDER, rounded }.seen_from(point).potential(point);
            let mut before = at(0.0);
            for step in 1..=1000 {
                let now = at(1e-3 * f64::from(step));
                assert!((now - before).abs() < 0.04 * before.max(0.1), "{point} {step}: {before} {now}");
                before = now;
            }
        }
        // Beside the middle it is that before a cylinder.
        let beside =
            |rounded: f64| Side { cylinder: CYLINDER, rounded }.seen_from(points[0]).potential(points[0]);
        assert!((beside(1.0) / beside(0.0) - 1.0).abs() < 1e-12);
    }

    /// A node before the middle of an end may be within the capsule, but is not held.
    #[test]
    fn nodes_before_ends_are_before_the_conductor() {
        for rounded in [0.5, 1.0] {
            let side = Side { cylinder: CYLINDER, rounded };
            for gap in [0.01, 0.1, 0.3] {
                let point = DVec3::new(1.0, 0.1, 4.0 + gap);
                let potential = side.seen_from(point).potential(point);
                assert!(potential > 0.3 * gap, "{rounded} {gap}: {potential}");
            }
        }
    }
}
