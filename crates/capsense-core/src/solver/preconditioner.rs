//! Cheap approximations of K⁻¹ on the free rows.

use crate::stiffness::{LANES, Lane, StiffnessMatrix};

/// The approximate inverse that the conjugate gradients are preconditioned with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Preconditioner {
    /// The inverse of the diagonal.
    #[default]
    Jacobi,
    /// The identity.
    None,
}

impl Preconditioner {
    /// Writes what each row is multiplied with: zero for rows that are fixed.
    pub(super) fn row_factors(self, matrix: &StiffnessMatrix, fixed: &[bool], factors: &mut [f64]) {
        for (row, (factor, &fixed)) in factors.iter_mut().zip(fixed).enumerate() {
            *factor = match (fixed, self) {
                (true, _) => 0.0,
                (false, Self::Jacobi) => 1.0 / matrix.diagonal(row),
                (false, Self::None) => 1.0,
            };
        }
    }
}

/// z = M r, and the columns' r·z.
pub(super) fn apply(factors: &[f64], r: &[Lane], z: &mut [Lane]) -> Lane {
    let mut products = [0.0; LANES];
    for ((z, r), factor) in z.iter_mut().zip(r).zip(factors) {
        for lane in 0..LANES {
            z[lane] = factor * r[lane];
            products[lane] += r[lane] * z[lane];
        }
    }
    products
}
