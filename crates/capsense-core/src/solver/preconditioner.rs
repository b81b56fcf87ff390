//! Approximations of K⁻¹ on the free rows.

use super::aggregation::AggregationMultigrid;
use crate::stiffness::{LANES, Lane, Lane32, StiffnessMatrix};

/// Which approximate inverse the conjugate gradients are preconditioned with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Preconditioner {
    /// Multigrid: geometric where the mesh is a lattice, by aggregation elsewhere.
    #[default]
    Multigrid,
    /// Incomplete Cholesky factors without fill.
    Ic0,
    /// The exact inverse, by sparse Cholesky factors.
    Direct,
    /// The inverse of the diagonal.
    Jacobi,
    /// The identity.
    None,
}

/// An approximate inverse with its numbers.
#[derive(Clone, Debug)]
pub(super) enum ApproximateInverse {
    Aggregation(Box<AggregationMultigrid>),
    /// What each row is multiplied with, and the product.
    Diagonal {
        kind: Preconditioner,
        factors: Vec<f64>,
        z: Vec<Lane32>,
    },
}

impl ApproximateInverse {
    pub(super) fn new(kind: Preconditioner, rows: usize) -> Self {
        match kind {
            Preconditioner::Multigrid => Self::Aggregation(Box::default()),
            kind => Self::Diagonal { kind, factors: vec![0.0; rows], z: vec![[0.0; LANES]; rows] },
        }
    }

    /// Takes over the matrix where it changed: the rows of `changed` and of nothing else.
    pub(super) fn refresh(
        &mut self,
        matrix: &StiffnessMatrix,
        fixed: &[bool],
        changed: impl Iterator<Item = u32>,
    ) {
        match self {
            Self::Aggregation(multigrid) => multigrid.refresh(matrix, fixed, changed),
            Self::Diagonal { kind, factors, .. } => {
                for row in changed {
                    let row = row as usize;
                    factors[row] = match (fixed[row], *kind) {
                        (true, _) => 0.0,
                        (false, Preconditioner::None) => 1.0,
                        (false, _) => 1.0 / matrix.diagonal(row),
                    };
                }
            }
        }
    }

    /// z = M r, zero on fixed rows, and the columns' r·z. There may be fewer rows in z than in r; the others are zero.
    pub(super) fn apply(&mut self, r: &[Lane]) -> (&mut [Lane32], Lane) {
        match self {
            Self::Aggregation(multigrid) => multigrid.apply(r),
            Self::Diagonal { factors, z, .. } => {
                for ((z, r), factor) in z.iter_mut().zip(r).zip(factors) {
                    *z = r.map(|r| (*factor * r) as f32);
                }
                let products = products(r, z);
                (z, products)
            }
        }
    }
}

/// The columns' r·z, over the rows of z.
pub(super) fn products(r: &[Lane], z: &[Lane32]) -> Lane {
    let mut sums = [0.0; LANES];
    for (z, r) in z.iter().zip(r) {
        for lane in 0..LANES {
            sums[lane] += r[lane] * f64::from(z[lane]);
        }
    }
    sums
}
