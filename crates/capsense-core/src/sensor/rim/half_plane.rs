//! The rim of a half-plane at 0 V on an infinite lattice, in closed form but for two integrals.
//!
//! Across the rim the lattice has rows of nodes h apart; above and below the half-plane its cells are h_u and h_d high. A
//! field that decays away from the plane has in the plane, per unit of length along the rim, the charges
//! q(k) = 2 (ε_u + ε_d) |sin k/2| K(k) φ(k), K(k) = (ε_u √(1 + a_u² sin² k/2) + ε_d √(1 + a_d² sin² k/2)) / (ε_u + ε_d),
//! where a = h_u/h, h_d/h. The method of Wiener and Hopf factorises K with
//! log K(k) = c_0 + 2 Σ c_n cos nk and gives the field that has no charge from row m on and no potential before it: far
//! away it is proportional to √(n - x), x = m - 3/4 + b, b = -Σ n c_n. So a half-plane of which row m-1 is the last one
//! held looks as if it ended at x. The combination (1-γ) φ^(m) + γ φ^(m+1) ends at x + γ, and its charge and potential in
//! row m are in the ratio 2 ((ε_u + ε_d)/2) e^{c_0} γ/(1-γ): the weight of a link that puts the rim where it is.
//!
//! On cubes with the rim in row 0 the weight is 3 + √2 for each unit of length.

use std::f64::consts::PI;

/// Sampling points of the integrals over a period. The integrand is periodic and analytic, so they converge
/// exponentially up to cells some twenty times as high as wide.
const SAMPLES: usize = 256;

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
        let log_kernel = |k: f64| {
            let sine = (0.5 * k).sin();
            let side = |side: usize| permittivity[side] * (1.0 + (aspect[side] * sine).powi(2)).sqrt();
            ((side(0) + side(1)) / sum).ln()
        };
        // The kernel is even: c_n = (1/N) Σ_j log K(k_j) cos(n k_j).
        let samples: Vec<f64> =
            (0..SAMPLES).map(|j| log_kernel(2.0 * PI * j as f64 / SAMPLES as f64)).collect();
        let coefficient = |n: usize| {
            let terms = samples.iter().enumerate().map(|(j, log)| {
                // The product is reduced before it is large.
                log * (2.0 * PI * ((n * j) % SAMPLES) as f64 / SAMPLES as f64).cos()
            });
            terms.sum::<f64>() / SAMPLES as f64
        };
        let reach = -(1..SAMPLES / 2).map(|n| n as f64 * coefficient(n)).sum::<f64>();
        Self { weight: sum * coefficient(0).exp(), reach }
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
        for aspect in [0.1, 0.5, 1.0, 2.0, 3.5] {
            let root = f64::sqrt(1.0 + aspect * aspect);
            let half_plane = HalfPlane::new([aspect; 2], [1.0; 2]);
            assert!((half_plane.reach - (root - 1.0) / 4.0).abs() < 1e-9, "{aspect} {half_plane:?}");
            assert!((half_plane.weight - (root + 1.0)).abs() < 1e-9, "{aspect} {half_plane:?}");
            let link = half_plane.link(half_plane.share(0.0));
            assert!((link - (1.0 + root) * (4.0 - root) / root).abs() < 1e-8, "{aspect} {link}");
        }
    }

    #[test]
    fn cubes_need_three_and_the_root_of_two() {
        let half_plane = HalfPlane::new([1.0; 2], [1.0; 2]);
        assert!((half_plane.link(half_plane.share(0.0)) - (3.0 + 2f64.sqrt())).abs() < 1e-9);
    }

    #[test]
    fn permittivities_add_up() {
        let [one, two] = [1.0, 4.4].map(|below| HalfPlane::new([1.0; 2], [1.0, below]));
        assert!((two.weight / one.weight - 2.7).abs() < 1e-12 && (two.reach - one.reach).abs() < 1e-12);
    }
}
