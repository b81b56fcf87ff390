//! The choice of an approximation of K⁻¹ on the free rows.

/// Which approximate inverse the conjugate gradients are preconditioned with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Preconditioner {
    /// Multigrid: geometric where the mesh is a lattice, by aggregation elsewhere.
    #[default]
    Multigrid,
    /// Incomplete Cholesky factors without fill.
    Ic0,
    /// The exact inverse. Scenes on small meshes, up to 4,000 free nodes, of which objects' surfaces touch a small part are
    /// answered through the Green's function of the empty scene, all others as by [`Preconditioner::Cholesky`].
    Direct,
    /// The exact inverse, by sparse Cholesky factors of all of K in every frame.
    Cholesky,
    /// The inverse of the diagonal.
    Jacobi,
    /// The identity.
    None,
}

impl Preconditioner {
    /// Its name in scene files and tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Multigrid => "multigrid",
            Self::Ic0 => "ic0",
            Self::Direct => "direct",
            Self::Cholesky => "cholesky",
            Self::Jacobi => "jacobi",
            Self::None => "none",
        }
    }
}
