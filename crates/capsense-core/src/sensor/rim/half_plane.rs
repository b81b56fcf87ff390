//! The rim of a half-plane at 0 V on an infinite lattice, in closed form but for two integrals.
//!
//! Across the rim the lattice has rows of nodes h apart; above and below the half-plane its cells are h_u and h_d high. A
//! field that decays away from the plane has in the plane, per unit of length along the rim, the charges
//! q(k) = 2 (ε_u + ε_d) |sin k/2| K(k) φ(k), K(k) = (ε_u √(1 + a_u² sin² k/2) + ε_d √(1 + a_d² sin² k/2)) / (ε_u + ε_d),
//! where a = h_u/h, h_d/h. The method of Wiener and Hopf factorises K with
//! log K(k) = c_0 + 2 Σ c_n cos nk and gives the field that has no charge from row m on and no potential before it: far
//! away it is proportional to √(n - x), x = m - 3/4 + b, b = -Σ n c_n. So a half-plane of which row m-1 is the last one
//! held looks as if it ended at x. Since Σ n cos nk = -1/(4 sin² k/2) in the sense of distributions and log K(0) = 0,
//! b = 1/(8π) ∫ log K(k) / sin² k/2 dk over a period. It grows with either aspect a, and with both the same it is
//! (√(1 + a²) - 1)/4. The combination (1-γ) φ^(m) + γ φ^(m+1) ends at x + γ, and its charge and potential in
//! row m are in the ratio 2 ((ε_u + ε_d)/2) e^{c_0} γ/(1-γ): the weight of a link that puts the rim where it is.
//!
//! On cubes with the rim in row 0 the weight is 3 + √2 for each unit of length.

use std::f64::consts::PI;

/// Points of the midpoint rule for the integrals, over half a period; the integrands are even. They are also periodic and
/// analytic, so it converges exponentially up to cells some twenty times as high as wide.
const SAMPLES: usize = 128;

/// A rim along rows of a lattice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct HalfPlane {
    /// Weight of a link for each unit of length where γ = 1/2, the mean permittivity of both sides in it.
    pub(super) weight: f64,
    /// b.
    pub(super) reach: f64,
}

impl HalfPlane {
    /// For the heights of the cells above and below in distances of rows, and the relative permittivities there.
    pub(super) fn new(aspect: [f64; 2], permittivity: [f64; 2]) -> Self {
        let sum = permittivity[0] + permittivity[1];
        let (mut mean, mut reach) = (0.0, 0.0);
        for j in 0..SAMPLES {
            let square_of_sine = (PI * (j as f64 + 0.5) / (2 * SAMPLES) as f64).sin().powi(2);
            let side = |side: usize| {
                permittivity[side] * (1.0 + aspect[side] * aspect[side] * square_of_sine).sqrt()
            };
            let log_kernel = ((side(0) + side(1)) / sum).ln();
            mean += log_kernel / SAMPLES as f64;
            reach += log_kernel / square_of_sine / (4 * SAMPLES) as f64;
        }
        Self { weight: sum * mean.exp(), reach }
    }

    /// How deep inside of the rim, in metres, every row has at least some share, whatever the permittivities and the
    /// direction of the rim: for rows at most `rows` apart and cells at most `height` high.
    pub(super) fn depth_of_share(share: f64, rows: f64, height: f64) -> f64 {
        // b is at most that of equal sides, which is less than a/4.
        (share - 0.75) * rows + 0.25 * height
    }

    /// γ of a row that is `distance` rows outside of the rim: at or below 0 it is free, from 1 on it is held.
    pub(super) fn share(&self, distance: f64) -> f64 {
        0.75 - self.reach - distance
    }

    /// The weight of the link for each unit of length along the rim, for a share between 0 and 1.
    pub(super) fn link(&self, share: f64) -> f64 {
        self.weight * share / (1.0 - share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// For equal sides b = (√(1+a²) - 1)/4 and e^{c_0} = (√(1+a²) + 1)/2.
    #[test]
    fn equal_sides_have_a_closed_form() {
        for aspect in [0.1, 0.5, 1.0, 2.0, 3.5, 10.0] {
            let root = f64::sqrt(1.0 + aspect * aspect);
            let half_plane = HalfPlane::new([aspect; 2], [1.0; 2]);
            assert!((half_plane.reach - (root - 1.0) / 4.0).abs() < 1e-13, "{aspect} {half_plane:?}");
            assert!((half_plane.weight - (root + 1.0)).abs() < 1e-13, "{aspect} {half_plane:?}");
            let link = half_plane.link(half_plane.share(0.0));
            assert!((link - (1.0 + root) * (4.0 - root) / root).abs() < 1e-12, "{aspect} {link}");
        }
    }

    #[test]
    fn cubes_need_three_and_the_root_of_two() {
        let half_plane = HalfPlane::new([1.0; 2], [1.0; 2]);
        assert!((half_plane.link(half_plane.share(0.0)) - (3.0 + 2f64.sqrt())).abs() < 1e-13);
    }

    #[test]
    fn rows_deeper_than_is_said_have_that_share() {
        for aspect in [[0.1, 3.0], [1.0, 1.0], [8.0, 0.5], [8.0, 8.0]] {
            for permittivity in [[1.0, 1.0], [1.0, 80.0], [80.0, 1.0]] {
                let half_plane = HalfPlane::new(aspect, permittivity);
                for share in [0.9, 1.3] {
                    let depth = HalfPlane::depth_of_share(share, 1.0, aspect[0].max(aspect[1]));
                    assert!(half_plane.share(-depth) >= share, "{aspect:?} {permittivity:?}");
                }
            }
        }
    }

    #[test]
    fn permittivities_add_up() {
        let [one, two] = [1.0, 4.4].map(|below| HalfPlane::new([1.0; 2], [1.0, below]));
        assert!((two.weight / one.weight - 2.7).abs() < 1e-12 && (two.reach - one.reach).abs() < 1e-12);
    }
}
