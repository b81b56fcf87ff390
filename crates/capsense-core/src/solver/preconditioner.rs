//! The choice of an approximation of K⁻¹ on the free rows.

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
