//! The field in front of a round conductor, which falls as the surfaces at a distance d from it grow.
//!
//! Where the principal curvatures of a surface are k and l, those of the surface at a distance d have an area of
//! (1 + k d)(1 + l d) times its own, and a field that is normal to them is ∫ dd / (1 + k d)(1 + l d): d/(1 + d/R) for a sphere,
//! R ln(1 + d/R) for a cylinder. Every potential that is constant on a surface bends there as this one does.

use super::cylinder::FlatEnded;
use glam::DVec3;

/// A round surface: all that is as far as the radius from a piece of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Round {
    /// The middle of the piece.
    pub centre: DVec3,
    /// From there to its end; zero for a sphere.
    pub half: DVec3,
    /// The radius.
    pub radius: f64,
}

/// The same, seen from a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in super::super) struct RoundNear {
    round: Round,
    /// The smaller principal curvature in parts of the larger one.
    second: f64,
    /// Of what it stands for, if that has flat ends, and how much of the potential is by the distance from this.
    ended: Option<(FlatEnded, f64)>,
}

impl Round {
    /// The place on the piece of a line that is nearest to a point, and how far the point is beyond its ends.
    fn on_axis(&self, point: DVec3) -> (DVec3, f64) {
        let squared = self.half.length_squared();
        if squared == 0.0 {
            return (self.centre, f64::INFINITY);
        }
        let part = (point - self.centre).dot(self.half) / squared;
        (self.centre + part.clamp(-1.0, 1.0) * self.half, (part.abs() - 1.0) * squared.sqrt())
    }

    fn distance(&self, point: DVec3) -> f64 {
        point.distance(self.on_axis(point).0) - self.radius
    }

    /// The place on the surface that is nearest to a point.
    pub(super) fn place(&self, point: DVec3) -> DVec3 {
        let (axis, _) = self.on_axis(point);
        axis + self.radius * (point - axis).normalize_or_zero()
    }

    /// The surface as it is near a point. From the side to the ends, curvatures change within a radius: what nodes make of
    /// it is to be continuous.
    pub(in super::super) fn seen_from(self, point: DVec3) -> RoundNear {
        let (_, beyond) = self.on_axis(point);
        RoundNear { round: self, second: (beyond / self.radius + 0.5).clamp(0.0, 1.0), ended: None }
    }
}

impl RoundNear {
    /// The same in place of a cylinder, with a part of the potential by the distance from that.
    pub(super) fn in_place_of(self, cylinder: FlatEnded, part: f64) -> Self {
        Self { ended: Some((cylinder, part)), ..self }
    }

    pub(super) fn diameter(&self) -> f64 {
        2.0 * self.round.radius
    }

    /// The potential at a point; zero in the object.
    pub(in super::super) fn potential(&self, point: DVec3) -> f64 {
        let round = self.at_distance(self.round.distance(point));
        match &self.ended {
            None => round,
            Some((ended, part)) => round + part * (self.at_distance(ended.distance(point)) - round),
        }
    }

    /// The potential so far from the surface.
    fn at_distance(&self, distance: f64) -> f64 {
        let along = distance.max(0.0) / self.round.radius;
        let rest = 1.0 - self.second;
        // ln((1 + k d)/(1 + l d)) / (k - l), in radii; the logarithm's series where k is all but l.
        let of_log = (rest * along) / (1.0 + self.second * along);
        let over = if of_log < 1e-6 { 1.0 - 0.5 * of_log } else { of_log.ln_1p() / of_log };
        along / (1.0 + self.second * along) * over
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn potentials_are_those_of_spheres_and_cylinders() {
        let sphere = Round { centre: DVec3::X, half: DVec3::ZERO, radius: 2.0 };
        let capsule = Round { half: 100.0 * DVec3::Z, ..sphere };
        for distance in [0.0, 1e-9, 0.01, 1.0, 7.0] {
            let point = DVec3::new(3.0 + distance, 0.0, 0.0);
            let of_sphere = sphere.seen_from(point).potential(point);
            let of_cylinder = capsule.seen_from(point).potential(point);
            assert!((of_sphere - (1.0 - 2.0 / (2.0 + distance))).abs() < 1e-12, "{distance} {of_sphere}");
            assert!(
                (of_cylinder - f64::ln_1p(0.5 * distance)).abs() <= 1e-7 * distance,
                "{distance} {of_cylinder}"
            );
        }
        assert_eq!(sphere.seen_from(DVec3::ZERO).potential(DVec3::ZERO), 0.0);
    }
}
