//! What rims of a lattice take to be right in the next order, too.
//!
//! A link puts a rim in its place ([`half_plane`](super::half_plane)); without it, errors are of the first order in the size of cells. What is left
//! is of the second: four cells between the rims of a stripe, and two to the next stripes, make the field above 1.5 % too weak and the charge 0.4 % too large.
//! Both go when the link is heavier, and the edge from its node straight out of the electrode lighter.
//!
//! What a charge at row n in the plane of a half-plane, of which all rows below 0 are held, does to the potential at row n' has the generating
//! function G(z, w) = ½ f(z) f(w) / (1 - zw) on the lattice, with f(z) = (1-z)^{-1/2} exp(-c_0/2 - Σ c_n zⁿ), so that f_0 = e^{-c_0/2} and
//! f_1 = (½ - c_1) f_0. Beyond the lattice, for a half-plane that ends at x, it is -½ f'(s) f'(t) / (s+t) with f'(s) = e^{xs} (-s)^{-1/2}, where z = e^s
//! and w = e^t. A link L at row 0 and a change e of the edge between rows 0 and 1 have the form V = (L+e, -e; -e, e) and make of 1/(1 - zw)
//!
//! 1/(1 - zw) - (α + β (z+w) + γ zw), (α, β; β, γ) = N, with N (1-N)⁻¹ = ½ F V Fᵀ and F = f_0 (1, f_1/f_0; 0, 1).
//!
//! For small s and t, which is far from the rim, both functions are the same
//! - in first order, if α + 2β + γ = ¾ - b + x, the node's share A ([`HalfPlane::share`]);
//! - in second order, if also β + γ = ½ (A - ½)² - 1/12, which is B. A factor (1 + η s²)(1 + η t²), η = a²/16 - 1/48, is left, which all waves on a lattice
//!   have wherever they come from: it is no rim's.
//!
//! That V has the form of a link and an edge gives the third equation, β = -p B (1-A+B) / (1 - p (1-A)), p = ½ + c_1. The first order alone is B = 0, and
//! where B would be positive, for shares below 0.09 and above 0.91, it stays zero, so that nothing jumps where a node is held or let go.

use super::half_plane::HalfPlane;

/// How a link and an edge change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SecondOrder {
    /// How many times as much the link weighs as in first order.
    pub(super) link: f64,
    /// What the edge weighs more, in parts of [`HalfPlane::weight`].
    pub(super) edge: f64,
}

impl SecondOrder {
    pub(super) const NONE: Self = Self { link: 1.0, edge: 0.0 };

    /// Only a part of it.
    pub(super) fn fading(self, part: f64) -> Self {
        Self { link: 1.0 + part * (self.link - 1.0), edge: part * self.edge }
    }

    /// For a node of a share between 0 and 1; with a part of B.
    pub(super) fn new(half_plane: &HalfPlane, share: f64, part: f64) -> Self {
        let second = part * (0.5 * (share - 0.5).powi(2) - 1.0 / 12.0).min(0.0);
        let left = 1.0 - share;
        let p = 0.5 + half_plane.first;
        let beta = -p * second * (left + second) / (1.0 - p * left);
        let [alpha, gamma] = [share - second - beta, second - beta];
        // N / (1 - N).
        let determinant = (1.0 - alpha) * (1.0 - gamma) - beta * beta;
        let [first, mixed, last] =
            [(1.0 - gamma) / determinant - 1.0, beta / determinant, (1.0 - alpha) / determinant - 1.0];
        let ratio = 0.5 - half_plane.first;
        let link = first - 2.0 * ratio * mixed + ratio * ratio * last - last;
        Self { link: link * left / share, edge: last }
    }
}

#[cfg(test)]
mod tests {
    use super::super::stack::Stack;
    use super::*;
    use faer::linalg::solvers::Solve;
    use faer::{Mat, Side};
    use std::f64::consts::{PI, TAU};

    /// Stripes at 1 and -1 V by turns, with rims along rows of nodes and free space on both sides.
    struct Stripes {
        /// Cells across, and from one to the next.
        across: usize,
        between: usize,
        /// Height of cells in distances of rows.
        height: f64,
    }

    impl Stripes {
        fn half_plane(&self) -> HalfPlane {
            HalfPlane::new(&[0, 1].map(|_| Stack::uniform(self.height, 1.0)))
        }

        /// The weights between rows in the plane: what waves along it see of the lattice above and below.
        fn plane(&self) -> Mat<f64> {
            let rows = 2 * (self.across + self.between);
            let of_wave = |wave: usize| {
                let square = 4.0 * (PI * wave as f64 / rows as f64).sin().powi(2);
                2.0 * (square * (1.0 + 0.25 * self.height.powi(2) * square)).sqrt() / rows as f64
            };
            let waves: Vec<f64> = (0..rows).map(of_wave).collect();
            let between = |rows_between: usize| -> f64 {
                let turn = TAU * rows_between as f64 / rows as f64;
                waves.iter().zip(0..).map(|(of_wave, wave)| of_wave * (turn * f64::from(wave)).cos()).sum()
            };
            let by_distance: Vec<f64> = (0..rows).map(between).collect();
            Mat::from_fn(rows, rows, |i, j| by_distance[i.abs_diff(j)])
        }

        /// The charge of a stripe for each permittivity and metre, and the longest wave in the plane.
        fn charge_and_wave(&self, second: SecondOrder) -> [f64; 2] {
            let plane = self.plane();
            let rows = plane.nrows();
            let (half_plane, period) = (self.half_plane(), rows / 2);
            let share = half_plane.share(0.0);
            let link = half_plane.weight * share / (1.0 - share) * second.link;
            let edge = half_plane.weight * second.edge;
            let rims = [[0, rows - 1], [self.across, self.across + 1]];
            let mut of_scene = plane.clone();
            let mut driven = Mat::<f64>::zeros(rows, 1);
            for (stripe, volt) in [(0, 1.0), (period, -1.0)] {
                for [rim, outside] in rims.map(|ends| ends.map(|row| (row + stripe) % rows)) {
                    of_scene[(rim, rim)] += link + edge;
                    of_scene[(outside, outside)] += edge;
                    of_scene[(rim, outside)] -= edge;
                    of_scene[(outside, rim)] -= edge;
                    driven[(rim, 0)] += link * volt;
                }
                // As good as held.
                for row in stripe + 1..stripe + self.across {
                    of_scene[(row, row)] += 1e9;
                    driven[(row, 0)] += 1e9 * volt;
                }
            }
            let potential = of_scene.llt(Side::Lower).unwrap().solve(&driven);
            let flows = |row: usize| {
                let by_link = [0, self.across].contains(&row);
                let weight = if by_link { link } else { 1e9 };
                weight * (1.0 - potential[(row, 0)])
            };
            let charge: f64 = (0..=self.across).map(flows).sum();
            // From the middle of a stripe.
            let phase = |row: usize| TAU * (row as f64 - 0.5 * self.across as f64) / rows as f64;
            let wave: f64 = (0..rows).map(|row| potential[(row, 0)] * phase(row).cos()).sum();
            [charge, wave / rows as f64]
        }

        fn errors(&self, second: SecondOrder) -> [f64; 2] {
            // Conformal mapping: 4 K(k)/K(k'), k = sin of a right angle's part that stripes cover.
            let part = self.across as f64 / (self.across + self.between) as f64;
            let (sine, cosine) = (0.5 * PI * part).sin_cos();
            let charge = 4.0 * mean(1.0, sine) / mean(1.0, cosine);
            let finer = Stripes { across: 16 * self.across, between: 16 * self.between, ..*self };
            let [found, wave] = self.charge_and_wave(second);
            let [_, of_finer] = finer.charge_and_wave(SecondOrder::NONE);
            [found / charge - 1.0, wave / of_finer - 1.0]
        }
    }

    /// The arithmetic and geometric one, K(k) = π/2 / mean(1, k').
    fn mean(mut a: f64, mut b: f64) -> f64 {
        for _ in 0..20 {
            (a, b) = (0.5 * (a + b), (a * b).sqrt());
        }
        a
    }

    /// With cells of a height of 1/√3, waves in the plane are right in second order, too.
    #[test]
    fn stripes_of_few_cells_are_right_in_second_order() {
        for (across, between, charge, wave) in [(4, 2, 4e-3, 1e-3), (6, 3, 1e-3, 3e-4), (4, 4, 1e-3, 5e-4)] {
            let stripes = Stripes { across, between, height: 3f64.sqrt().recip() };
            let half_plane = stripes.half_plane();
            let second = SecondOrder::new(&half_plane, half_plane.share(0.0), 1.0);
            let first = stripes.errors(SecondOrder::NONE);
            let errors = stripes.errors(second);
            println!("{across} {between}: {first:?} {errors:?}");
            assert!(errors[0].abs() < charge && errors[1].abs() < wave, "{across} {between}: {errors:?}");
            assert!(first[1].abs() > 10.0 * errors[1].abs(), "{first:?} {errors:?}");
        }
    }

    #[test]
    fn without_a_part_of_it_it_is_the_first_order() {
        let half_plane = HalfPlane::new(&[0.4, 1.3].map(|height| Stack::uniform(height, 2.0)));
        for share in [0.05, 0.3, 0.7, 0.95] {
            let none = SecondOrder::new(&half_plane, share, 0.0);
            assert!((none.link - 1.0).abs() < 1e-12 && none.edge.abs() < 1e-15, "{none:?}");
        }
        // Next to free and held nodes there is no other.
        for share in [0.05, 0.95] {
            let second = SecondOrder::new(&half_plane, share, 1.0);
            assert!((second.link - 1.0).abs() < 1e-12 && second.edge.abs() < 1e-15, "{second:?}");
        }
        let second = SecondOrder::new(&half_plane, 0.7, 1.0);
        assert!(second.link > 1.1 && second.edge < -0.01, "{second:?}");
    }
}
