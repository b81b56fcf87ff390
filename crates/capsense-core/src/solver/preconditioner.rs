//! Approximations of K⁻¹ on the free rows.

use super::lattice::LatticeMultigrid;
use crate::mesh::Lattice;
use crate::stiffness::{LANES, Lane, StiffnessMatrix};

/// Which approximate inverse the conjugate gradients are preconditioned with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Preconditioner {
    /// Geometric multigrid where the mesh is a lattice, the inverse of the diagonal elsewhere.
    #[default]
    Multigrid,
    /// The inverse of the diagonal.
    Jacobi,
    /// The identity.
    None,
}

/// An approximate inverse with its numbers.
#[derive(Clone, Debug)]
pub(super) enum ApproximateInverse {
    Multigrid(Box<LatticeMultigrid>),
    /// What each row is multiplied with.
    Diagonal {
        kind: Preconditioner,
        factors: Vec<f64>,
    },
}

impl ApproximateInverse {
    pub(super) fn new(kind: Preconditioner, rows: usize, lattice: Option<&Lattice>) -> Self {
        match (kind, lattice) {
            (Preconditioner::Multigrid, Some(lattice)) => {
                Self::Multigrid(Box::new(LatticeMultigrid::new(lattice)))
            }
            (Preconditioner::Multigrid | Preconditioner::Jacobi, _) => {
                Self::Diagonal { kind: Preconditioner::Jacobi, factors: vec![0.0; rows] }
            }
            (Preconditioner::None, _) => Self::Diagonal { kind, factors: vec![0.0; rows] },
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
            Self::Multigrid(multigrid) => multigrid.refresh(matrix, fixed, changed),
            Self::Diagonal { kind, factors } => {
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

    /// z = M r, zero on fixed rows, and the columns' r·z.
    pub(super) fn apply(&mut self, r: &[Lane], z: &mut [Lane]) -> Lane {
        match self {
            Self::Multigrid(multigrid) => multigrid.apply(r, z),
            Self::Diagonal { factors, .. } => {
                let mut products = [0.0; LANES];
                for ((z, r), factor) in z.iter_mut().zip(r).zip(factors) {
                    for lane in 0..LANES {
                        z[lane] = *factor * r[lane];
                        products[lane] += r[lane] * z[lane];
                    }
                }
                products
            }
        }
    }
}
