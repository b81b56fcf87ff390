//! What rims of a lattice take to be right in the next order, too.
//!
//! A link puts a rim in its place ([`half_plane`](super::half_plane)), which is an error of the first order in the size of cells. What is left is of the
//! second: between three stripes that are four cells wide it makes the field above 1.5 % too weak, and the charge 0.4 % too large. Both go
//! when the link is heavier and the edge from its node straight out of the electrode lighter.
//!
//! What charge at row n of the plane does to potentials at row n', outside of a half-plane whose rows below 0 are held, has on the lattice the
//! generating function G(z, w) = f(z) f(w)/2 · 1/(1 - zw) with f(z) = (1-z)^{-1/2} exp(-c_0/2 - Σ c_n zⁿ), and beyond the lattice, for a
//! half-plane that ends at x, f'(s) f'(s')/2 · 1/(-s-s') with f'(s) = (-s)^{-1/2} e^{xs}. A link L on row 0, and a change e of the edge between rows 0 and 1,
//! take a form of rank two from the lattice's:
//! 1/(1-zw) - (α + β (z+w) + γ zw), where (α, β; β, γ) = N, N/(1-N) = F V Fᵀ/2, V = (L+e, -e; -e, e), F = f_0 (1, ρ; 0, 1), and ρ = f_1/f_0 = 1/2 - c_1.
//! With z = e^s and w = e^{s'} both are the same far away
//! - in first order, if α + 2β + γ = x + 3/4 - b =: A, the share of [`HalfPlane::share`];
//! - in second order, if β + γ = (A - 1/2)²/2 - 1/12 =: B, too. What waves in free space have too much or too little of on the lattice, a factor
//!   1 + (a²/16 - 1/48) (s² + s'²), no rim can mend, and none has to.
//!
//! Together with V's form, N_01 (1 - N)⁻¹... that row 1 has no link, α, β and γ follow: with p = 1/2 + c_1,
//! β = -p B (1 - A + B) / (1 - p (1 - A)). With B = 0 it is the first order: β = γ = 0. B is taken to be zero where it would be positive: for shares below 0.09, and above 0.91,
//! so that nothing jumps where a node is held, or let go.

use super::half_plane::HalfPlane;

/// How a link and an edge change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SecondOrder {
    /// By which factor the link is heavier than in first order.
    pub(super) link: f64,
    /// What is added to the edge, in parts of a link's weight for a half.
    pub(super) edge: f64,
}

impl SecondOrder {
    pub(super) const NONE: Self = Self { link: 1.0, edge: 0.0 };

    /// A part of it.
    pub(super) fn fading(self, part: f64) -> Self {
        Self { link: 1.0 + part * (self.link - 1.0), edge: part * self.edge }
    }

    /// For a node of a share between 0 and 1, or for a part of B.
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
