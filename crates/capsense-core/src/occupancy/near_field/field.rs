//! The field around a right angle of a conductor, r^(2/3) sin(2θ/3), at a node and its neighbours.

use super::cells::either;
use super::row::larger;
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
    /// Where points are: how far before either face, and along the edge. Along a straight one all places are alike.
    pub(in super::super) fn coordinates(&self) -> impl Fn(DVec3) -> [f64; 3] {
        let along = if self.radius.is_finite() { self.along() } else { DVec3::ZERO };
        move |point| {
            let [p, q] = self.before(point);
            [p, q, along.dot(point - self.place)]
        }
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

/// Coordinates of points by a right angle, one array for each.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Places<const N: usize>([[f64; N]; 3]);

impl<const N: usize> Places<N> {
    /// All of them at the place of the angle.
    pub(in super::super) const ORIGIN: Self = Self([[0.0; N]; 3]);

    /// Points in a plane across the edge, so far before either face.
    #[inline(always)]
    pub(in super::super) fn in_plane(p: [f64; N], q: [f64; N]) -> Self {
        Self([p, q, [0.0; N]])
    }

    pub(in super::super) fn set(&mut self, point: usize, place: [f64; 3]) {
        (0..3).for_each(|coordinate| self.0[coordinate][point] = place[coordinate]);
    }

    /// The potentials of an edge of some radius at the points.
    #[inline(always)]
    pub(in super::super) fn potentials(&self, radius: f64) -> [f64; N] {
        let [p, q, along] = &self.0;
        if radius == f64::INFINITY {
            return wedge_potentials(p, q);
        }
        let (mut before, mut factors) = ([0.0; N], [0.0; N]);
        for point in 0..N {
            [before[point], factors[point]] = around_rim(radius.recip(), p[point], along[point]);
        }
        let mut potentials = wedge_potentials(&before, q);
        potentials.iter_mut().zip(factors).for_each(|(potential, factor)| *potential *= factor);
        potentials
    }
}

/// How far a point is before the side of a cylinder of some curvature 1/R, and √(R/ρ), ρ being how far it is from the axis. `p` is how
/// far it is before the plane that touches the side, and `along` how far along that plane.
///
/// With v = √ρ u, what is the same all around the axis satisfies ∂²v/∂ρ² + ∂²v/∂z² + v/4ρ² = 0. So but for the last term, which is small
/// while the edge is much nearer than the axis, v is the field around a straight edge, and that over √ρ is the field around the rim.
#[inline(always)]
pub(super) fn around_rim(curvature: f64, p: f64, along: f64) -> [f64; 2] {
    let (radial, sideways) = (1.0 + curvature * p, curvature * along);
    let from_axis = (radial * radial + sideways * sideways).sqrt();
    // Beyond the axis, the sum of both may be all but nothing.
    let bend =
        either(radial > 0.0, along * sideways / (from_axis + radial), (from_axis - radial) / curvature);
    [p + bend, 1.0 / larger(from_axis, LEAST_RADIUS).sqrt()]
}

/// Closer to the axis than this part of the radius the field is that at this place.
const LEAST_RADIUS: f64 = 0.1;

/// r^(2/3) sin(2θ/3) at points so far before either face, θ from one face to the other; zero in the object. Wrong by less than
/// 1e-9 of r^(2/3). Loops without branches, so that several points are one instruction, and with few steps that wait for others.
#[inline(always)]
pub(super) fn wedge_potentials<const N: usize>(p: &[f64; N], q: &[f64; N]) -> [f64; N] {
    let (mut squared, mut roots) = ([0.0; N], [0.0; N]);
    for point in 0..N {
        squared[point] = p[point] * p[point] + q[point] * q[point] + f64::MIN_POSITIVE;
    }
    for point in 0..N {
        roots[point] = about_inverse_cube_root(squared[point]);
    }
    let mut potentials = [0.0; N];
    for point in 0..N {
        let (p, q, squared) = (p[point], q[point], squared[point]);
        let root = better_inverse_cube_root(squared, roots[point]);
        // From the bisector outside, angles are φ = θ - 3π/4.
        let cosine = std::f64::consts::FRAC_1_SQRT_2 * (p + q) / squared.sqrt();
        let of_half = larger(0.5 + 0.5 * cosine, 0.0).sqrt();
        let potential = squared * root * root * cosine_of_four_thirds(of_half);
        potentials[point] = if p > 0.0 || q > 0.0 { potential } else { 0.0 };
    }
    potentials
}

/// cos(4α/3) from cos α, for |α| up to 3π/8, by a polynomial that is best for Chebyshev's points; wrong by less than 4e-10.
#[inline(always)]
fn cosine_of_four_thirds(cosine: f64) -> f64 {
    const POWERS: [f64; 8] = [
        -0.500_026_210_623_49,
        1.155_059_930_931_905,
        0.442_279_970_150_317,
        -0.142_115_517_264_298,
        0.065_135_988_839_959,
        -0.027_078_844_529_942,
        0.007_858_113_573_964,
        -0.001_113_431_392_503,
    ];
    let squared = cosine * cosine;
    let pair = |first: usize| POWERS[first] + POWERS[first + 1] * cosine;
    (pair(0) + pair(2) * squared) + (pair(4) + pair(6) * squared) * (squared * squared)
}

/// One over the cube root of a positive number to within 4 %: minus a third of its exponent.
#[inline(always)]
fn about_inverse_cube_root(x: f64) -> f64 {
    // Four thirds of the exponent's offset, 1023 · 2⁵², less what makes the largest error smallest.
    const OFFSET: u64 = 0x553e_e940_0000_0000;
    // A third of the upper half alone, by a product of 32 bits: of several numbers at once.
    const THIRD: u64 = 0xaaaa_aaab;
    let third = ((x.to_bits() >> 32) * THIRD) >> 33;
    f64::from_bits(OFFSET - (third << 32))
}

/// The same to about nine digits from a guess y that is within 4 % of it: y (1 - h)^(-1/3) with h = 1 - x y³, by four terms
/// of its series, then by two.
#[inline(always)]
fn better_inverse_cube_root(x: f64, guess: f64) -> f64 {
    let missing = |root: f64| 1.0 - x * root * root * root;
    let h = missing(guess);
    let root = guess + guess * h * (1.0 / 3.0 + h * (2.0 / 9.0 + h * (14.0 / 81.0)));
    root + root * missing(root) * (1.0 / 3.0)
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
                let mut places = Places::<8>::ORIGIN;
                places.set(0, angle.coordinates()(angle.place + r * DVec3::new(sine, 5.0, -cosine)));
                places.set(1, angle.coordinates()(angle.place - DVec3::new(r, 0.0, 0.5 * r)));
                let [found, within, at_edge, ..] = places.potentials(angle.radius);
                let expected = r.powf(2.0 / 3.0) * (2.0 / 3.0 * theta).sin();
                assert!(
                    (found - expected).abs() < 1e-9 * r.powf(2.0 / 3.0),
                    "{theta} {r}: {found} {expected}"
                );
                assert_eq!([within, at_edge], [0.0; 2]);
            }
        }
    }

    /// But for what is left of r²/R², it satisfies Laplace's equation; the field around a straight edge, bent about the axis, does not
    /// by r/R.
    #[test]
    fn the_potential_around_a_rim_is_harmonic_near_it() {
        let angle = RightAngle {
            place: DVec3::X,
            normals: [DVec3::X, DVec3::Z],
            inside: f64::INFINITY,
            radius: 1.0,
            thickness: [2.0; 2],
            breadth: 2.0,
        };
        let potential = |point: DVec3| {
            let mut places = Places::<1>::ORIGIN;
            places.set(0, angle.coordinates()(point));
            places.potentials(angle.radius)[0]
        };
        for distance in [0.02, 0.05, 0.1] {
            for step in 1..12 {
                let (sine, cosine) = (6.0 * FRAC_PI_4 * f64::from(step) / 12.0).sin_cos();
                let (place, way) = (DVec3::X + distance * DVec3::new(sine, 0.0, -cosine), 0.02 * distance);
                let around = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| {
                    potential(place + way * axis) + potential(place - way * axis) - 2.0 * potential(place)
                });
                let laplacian = around.iter().sum::<f64>() / (way * way);
                let left = laplacian * distance * distance / distance.powf(2.0 / 3.0);
                assert!(left.abs() < 0.4 * distance * distance, "{distance} {step}: {left}");
            }
        }
        // Across the axis the nearest place of the rim is another, but numbers are numbers.
        for point in [DVec3::ZERO, DVec3::new(-0.3, 1e-9, 0.1), DVec3::new(-1.0, 0.0, 0.5)] {
            assert!(potential(point).is_finite(), "{point}");
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
                let guess = about_inverse_cube_root(x);
                assert!((guess * x.cbrt() - 1.0).abs() < 0.04, "{x}");
                let root = better_inverse_cube_root(x, guess);
                assert!((root * x.cbrt() - 1.0).abs() < 1e-9, "{x}");
            }
        }
    }
}
