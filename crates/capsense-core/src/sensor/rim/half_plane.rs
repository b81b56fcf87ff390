//! The rim of a half-plane at 0 V on an infinite lattice, in closed form but for a few integrals.
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
//!
//! Where cells differ in height or permittivity, or there is a shield, K is what the whole stack of
//! cells makes of a wave ([`Stack::on_lattice`]), and it is no longer √ that the field has to approach, but the field of
//! a true half-plane in the same layers. That one has the same theory on a line instead of a circle, with the kernel k K'(k)
//! ([`Stack::exact`]). Both K are relative to ε_u + ε_d of the first cells, so K' tends to 1 for short waves. For long
//! ones K/K' tends to 1, and the two fields are the same far away if the logarithms of their factors have the same slope
//! there: b = 1/(2π) (∫ (log K / (4 sin² k/2) - log K' / k²) dk over a period - ∫ log K' / k² dk over all beyond).
//! e^{c_0} is as before. Where a shield is much closer than the next row, b tends to 1/4 and the link to what puts half of a
//! row's plate capacitor at its rim.

use super::stack::Stack;
use std::f64::consts::PI;

/// Points of the midpoint rule for the integrals, over half a period; the integrands are even. They are also periodic and
/// analytic, so it converges exponentially up to cells some twenty times as high as wide.
const SAMPLES: usize = 128;

/// The same for what is not analytic at k = 0; there the points are close to each other.
const GRADED_SAMPLES: usize = 64;

/// A rim along rows of a lattice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct HalfPlane {
    /// Weight of a link for each unit of length where γ = 1/2, permittivities of both sides in it; for others times
    /// γ/(1-γ).
    pub(super) weight: f64,
    /// b.
    pub(super) reach: f64,
    /// c_1.
    pub(super) first: f64,
}

impl HalfPlane {
    /// For what is above and below, in distances of rows.
    pub(super) fn new(stacks: &[Stack; 2]) -> Self {
        let first = stacks.each_ref().map(Stack::first);
        let sum = first[0].permittivity + first[1].permittivity;
        let mut parts = Parts::default();
        for j in 0..SAMPLES {
            let square_of_sine = (PI * (j as f64 + 0.5) / (2 * SAMPLES) as f64).sin().powi(2);
            let side = |side: usize| {
                let aspect = first[side].height;
                first[side].permittivity * (1.0 + aspect * aspect * square_of_sine).sqrt()
            };
            let log_kernel = ((side(0) + side(1)) / sum).ln();
            parts.mean += log_kernel / SAMPLES as f64;
            parts.first += log_kernel * (1.0 - 2.0 * square_of_sine) / SAMPLES as f64;
            parts.reach += log_kernel / square_of_sine / (4 * SAMPLES) as f64;
        }
        if !stacks.iter().all(Stack::is_endless) {
            parts.add_other_cells(stacks);
        }
        Self { weight: sum * parts.mean.exp(), reach: parts.reach, first: parts.first }
    }

    /// How deep inside of the rim, in metres, every row has at least some share, whatever the permittivities and the
    /// direction of the rim: for rows at most `rows` apart and cells at most `height` high.
    pub(super) fn depth_of_share(share: f64, rows: f64, height: f64) -> f64 {
        // With equal cells b is at most that of equal sides, which is less than a/4; a shield may bring it up to 1/4.
        (share - 0.5) * rows + 0.25 * height
    }

    /// γ of a row that is `distance` rows outside of the rim: at or below 0 it is free, from 1 on it is held.
    pub(super) fn share(&self, distance: f64) -> f64 {
        0.75 - self.reach - distance
    }
}

/// Sums for c_0, c_1 and b.
#[derive(Debug, Default)]
struct Parts {
    mean: f64,
    first: f64,
    reach: f64,
}

impl Parts {
    /// Adds what they are more than if the first cells went on for ever.
    fn add_other_cells(&mut self, stacks: &[Stack; 2]) {
        let first = stacks.each_ref().map(Stack::first);
        let sum = first[0].permittivity + first[1].permittivity;
        let log_of_exact =
            |wave: f64| (stacks.iter().map(|stack| stack.exact(wave)).sum::<f64>() / (sum * wave)).ln();
        for j in 0..GRADED_SAMPLES {
            // k = π s² up to half a period, 1/k = s²/π beyond; with 2 s ds, and 1/π of all integrals.
            let s = (j as f64 + 0.5) / GRADED_SAMPLES as f64;
            let step = 2.0 * s / GRADED_SAMPLES as f64;
            let wave = PI * s * s;
            let square = 4.0 * (0.5 * wave).sin().powi(2);
            let on_lattice: f64 = stacks.iter().map(|stack| stack.on_lattice(square)).sum();
            let endless: f64 = first.iter().map(|cell| cell.endless(square)).sum();
            let log_of_lattice = (on_lattice / endless).ln();
            self.mean += step * log_of_lattice;
            self.first += step * log_of_lattice * wave.cos();
            self.reach += step * (log_of_lattice / square - log_of_exact(wave) / (wave * wave));
            self.reach -= step * log_of_exact(PI / (s * s)) / (PI * PI);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::stack::Cell;
    use super::*;

    fn uniform(aspect: [f64; 2], permittivity: [f64; 2]) -> HalfPlane {
        HalfPlane::new(&[0, 1].map(|side| Stack::uniform(aspect[side], permittivity[side])))
    }

    /// Of a row in the rim.
    fn link(half_plane: HalfPlane) -> f64 {
        let share = half_plane.share(0.0);
        half_plane.weight * share / (1.0 - share)
    }

    /// Air above, and below one cell of a permittivity over a shield or over air.
    fn on_slab(height: f64, permittivity: f64, is_shielded: bool) -> HalfPlane {
        let air = Cell { height: 1.0, permittivity: 1.0 };
        let others = if is_shielded { Vec::new() } else { vec![air] };
        let slab = Stack::new(Cell { height, permittivity }, others, is_shielded);
        HalfPlane::new(&[Stack::uniform(1.0, 1.0), slab])
    }

    /// For equal sides b = (√(1+a²) - 1)/4 and e^{c_0} = (√(1+a²) + 1)/2.
    #[test]
    fn equal_sides_have_a_closed_form() {
        for aspect in [0.1, 0.5, 1.0, 2.0, 3.5, 10.0] {
            let root = f64::sqrt(1.0 + aspect * aspect);
            let half_plane = uniform([aspect; 2], [1.0; 2]);
            assert!((half_plane.reach - (root - 1.0) / 4.0).abs() < 1e-13, "{aspect} {half_plane:?}");
            assert!((half_plane.weight - (root + 1.0)).abs() < 1e-13, "{aspect} {half_plane:?}");
            let link = link(half_plane);
            assert!((link - (1.0 + root) * (4.0 - root) / root).abs() < 1e-12, "{aspect} {link}");
        }
    }

    #[test]
    fn cubes_need_three_and_the_root_of_two() {
        let half_plane = uniform([1.0; 2], [1.0; 2]);
        assert!((link(half_plane) - (3.0 + 2f64.sqrt())).abs() < 1e-13);
    }

    #[test]
    fn rows_deeper_than_is_said_have_that_share() {
        for aspect in [[0.1, 3.0], [1.0, 1.0], [8.0, 0.5], [8.0, 8.0]] {
            for permittivity in [[1.0, 1.0], [1.0, 80.0], [80.0, 1.0]] {
                let half_plane = uniform(aspect, permittivity);
                for share in [0.9, 1.3] {
                    let depth = HalfPlane::depth_of_share(share, 1.0, aspect[0].max(aspect[1]));
                    assert!(half_plane.share(-depth) >= share, "{aspect:?} {permittivity:?}");
                }
            }
        }
    }

    #[test]
    fn permittivities_add_up() {
        let [one, two] = [1.0, 4.4].map(|below| uniform([1.0; 2], [1.0, below]));
        assert!((two.weight / one.weight - 2.7).abs() < 1e-12 && (two.reach - one.reach).abs() < 1e-12);
    }

    /// It is the plate capacitor between a row and the shield, of which the electrode covers what lies inside of the rim.
    #[test]
    fn a_shield_that_is_very_close_makes_a_plate_capacitor() {
        let half_plane = on_slab(1e-3, 4.4, true);
        assert!((half_plane.reach - 0.25).abs() < 2e-3, "{half_plane:?}");
        assert!((half_plane.weight / 4400.0 - 1.0).abs() < 5e-3, "{half_plane:?}");
    }

    /// A slab so thin that no wave on the lattice sees it, and one as deep as any.
    #[test]
    fn slabs_are_between_none_and_endless_ones() {
        let [air, endless] = [1.0, 4.4].map(|below| uniform([1.0; 2], [1.0, below]));
        let mut before = air;
        for thickness in [1, 2, 4, 40] {
            let board = Cell { height: 1.0, permittivity: 4.4 };
            let mut others = vec![board; thickness - 1];
            others.push(Cell { height: 1.0, permittivity: 1.0 });
            let slab = HalfPlane::new(&[Stack::uniform(1.0, 1.0), Stack::new(board, others, false)]);
            assert!(slab.weight > before.weight && slab.weight < endless.weight, "{thickness} {slab:?}");
            before = slab;
        }
        assert!((before.weight / endless.weight - 1.0).abs() < 1e-2, "{before:?}");
        assert!((before.reach - endless.reach).abs() < 1e-3, "{before:?}");
    }
}
