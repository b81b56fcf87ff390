//! The field around a right angle of a conductor, r^(2/3) sin(2θ/3), at a node and its neighbours.

use glam::DVec3;

/// A right angle at which two faces of an object meet, seen from a point near it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RightAngle {
    /// The nearest place on the edge, or on the line through it.
    pub place: DVec3,
    /// Outward unit normals of the two faces.
    pub normals: [DVec3; 2],
    /// How far the place is from the edge's nearest end; negative beyond.
    pub inside: f64,
    /// Of the circle that the edge is part of, its centre behind the first face; infinite where the edge is straight.
    pub radius: f64,
    /// How thick the object is behind either face.
    pub thickness: [f64; 2],
    /// The middle one of the object's extents.
    pub breadth: f64,
}

impl RightAngle {
    /// Where a point is: how far before either face, and along the edge.
    pub(in super::super) fn coordinates(&self, point: DVec3) -> [f64; 3] {
        let [p, q] = self.before(point);
        [p, q, self.along().dot(point - self.place)]
    }

    /// How far a point is before either face.
    pub(super) fn before(&self, point: DVec3) -> [f64; 2] {
        self.normals.map(|normal| normal.dot(point - self.place))
    }

    /// The direction of the edge.
    pub(in super::super) fn along(&self) -> DVec3 {
        self.normals[0].cross(self.normals[1])
    }
}

/// Points around a node: itself, then its neighbours, and one more that makes the number even.
pub(in super::super) const POINTS: usize = 8;

/// Coordinates of points by a right angle, one array for each.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Places<const N: usize = POINTS>([[f64; N]; 3]);

impl<const N: usize> Places<N> {
    /// All of them at the place of the angle.
    pub(in super::super) const ORIGIN: Self = Self([[0.0; N]; 3]);

    pub(in super::super) fn set(&mut self, point: usize, place: [f64; 3]) {
        (0..3).for_each(|coordinate| self.0[coordinate][point] = place[coordinate]);
    }

    /// The potentials of an edge of some radius at the points.
    #[inline(always)]
    pub(in super::super) fn potentials(&self, radius: f64) -> [f64; N] {
        let [p, q, along] = &self.0;
        let bend = 0.5 / radius;
        let mut before = [0.0; N];
        for point in 0..N {
            before[point] = p[point] + bend * along[point] * along[point];
        }
        wedge_potentials(&before, q)
    }
}

/// r^(2/3) sin(2θ/3) at points so far before either face, θ from one face to the other; zero in the object. Loops without
/// branches, so that several points are one instruction.
#[inline(always)]
pub(super) fn wedge_potentials<const N: usize>(p: &[f64; N], q: &[f64; N]) -> [f64; N] {
    let (mut squared, mut roots) = ([0.0; N], [0.0; N]);
    for point in 0..N {
        squared[point] = p[point] * p[point] + q[point] * q[point] + f64::MIN_POSITIVE;
    }
    for point in 0..N {
        roots[point] = about_cube_root(squared[point]);
    }
    let mut potentials = [0.0; N];
    for point in 0..N {
        let (p, q, squared) = (p[point], q[point], squared[point]);
        // From the bisector outside, angles are φ = θ - 3π/4.
        let third = cosine_of_third(std::f64::consts::FRAC_1_SQRT_2 * (p + q) / squared.sqrt());
        let potential = better_cube_root(squared, roots[point]) * (2.0 * third * third - 1.0);
        potentials[point] = if p > 0.0 || q > 0.0 { potential } else { 0.0 };
    }
    potentials
}

/// cos(φ/3) from cos φ, for |φ| up to 3π/4, by Newton's method on 4c³ - 3c = cos φ; wrong by less than 3e-8.
#[inline(always)]
fn cosine_of_third(cosine: f64) -> f64 {
    // The parabola through the values at 0, π/2 and 3π/4.
    let mut c = 0.8660 + cosine * (0.1871 - 0.0531 * cosine);
    for _ in 0..2 {
        let squared = c * c;
        c -= (c * (4.0 * squared - 3.0) - cosine) / (12.0 * squared - 3.0);
    }
    c
}

/// The cube root of a positive number to within 5 %: a third of its exponent.
#[inline(always)]
fn about_cube_root(x: f64) -> f64 {
    // Two thirds of the exponent's offset, 1023 · 2⁵², less what makes the largest error smallest.
    const OFFSET: u64 = 0x2a9f_7893_0000_0000;
    // A third of the upper half alone, by a product of 32 bits: of several numbers at once.
    const THIRD: u64 = 0xaaaa_aaab;
    let third = ((x.to_bits() >> 32) * THIRD) >> 33;
    f64::from_bits((third << 32) + OFFSET)
}

/// The cube root from a guess that is within 5 % of it, to about twelve digits by two steps of Halley's method. That of the
/// standard library is exact to the last bit and takes several times as long.
#[inline(always)]
fn better_cube_root(x: f64, mut root: f64) -> f64 {
    for _ in 0..2 {
        let cube = root * root * root;
        root *= (cube + 2.0 * x) / (2.0 * cube + x);
    }
    root
}

#[cfg(test)]
mod tests {
    use super::super::Extent;
    use super::*;
    use std::f64::consts::FRAC_PI_4;

    #[test]
    fn the_potential_is_that_of_a_wedge() {
        let angle = RightAngle {
            place: DVec3::new(0.1, -0.2, 0.3),
            normals: [DVec3::X, DVec3::Z],
            inside: 1.0,
            radius: f64::INFINITY,
            thickness: [1.0; 2],
            breadth: 1.0,
        };
        for step in 0..=60 {
            // From the face across x, around the edge, to the face across z.
            let theta = 6.0 * FRAC_PI_4 * f64::from(step) / 60.0;
            for r in [1e-6, 0.02, 3.0_f64] {
                let (sine, cosine) = theta.sin_cos();
                let mut places = Places::<POINTS>::ORIGIN;
                places.set(0, angle.coordinates(angle.place + r * DVec3::new(sine, 5.0, -cosine)));
                places.set(1, angle.coordinates(angle.place - DVec3::new(r, 0.0, 0.5 * r)));
                let [found, within, at_edge, ..] = places.potentials(angle.radius);
                let expected = r.powf(2.0 / 3.0) * (2.0 / 3.0 * theta).sin();
                assert!(
                    (found - expected).abs() < 2e-7 * r.powf(2.0 / 3.0),
                    "{theta} {r}: {found} {expected}"
                );
                assert_eq!([within, at_edge], [0.0; 2]);
            }
        }
    }

    #[test]
    fn thickness_is_that_across_each_face() {
        // The upper edge of a plate: as broad as long, and thin.
        let angle = RightAngle {
            place: DVec3::ZERO,
            normals: [DVec3::Y, DVec3::Z],
            inside: 1.0,
            radius: f64::INFINITY,
            thickness: [0.15, 0.02],
            breadth: 0.15,
        };
        assert!(angle.is_thicker_than(DVec3::new(0.2, 0.1, 0.018)));
        // A tenth is to spare.
        assert!(!angle.is_thicker_than(DVec3::new(0.01, 0.01, 0.019)));
        assert!(!angle.is_thicker_than(DVec3::new(0.01, 0.16, 0.01)));
        let turned = RightAngle { normals: [DVec3::Y, DVec3::new(0.6, 0.0, 0.8)], ..angle };
        assert!(!turned.is_thicker_than(DVec3::new(0.04, 0.01, 0.01)));
    }

    #[test]
    fn cube_roots_have_nine_digits() {
        for power in -60..60 {
            for part in 0..20 {
                let x = 2.0_f64.powi(power) * (1.0 + 0.05 * f64::from(part));
                let root = better_cube_root(x, about_cube_root(x));
                assert!((root / x.cbrt() - 1.0).abs() < 1e-9, "{x}");
            }
        }
    }
}
