//! Numbers that kernels and their twins share, chosen by iterations on a bisected mesh of 300k tetrahedra (`docs/gpu.md`).

/// The part of a sweep's step that is taken.
pub(super) const OMEGA: f32 = 0.8;

/// Corrections that are the same on all of an aggregate are too stiff, and are stretched by this.
pub(super) const OVERCORRECTION: f32 = 1.25;

/// Sweeps on the coarsest level, which has up to some tens of rows.
pub(super) const SWEEPS: u32 = 8;

/// Threads that sum up one aggregate of a large level.
pub(super) const LANES: u32 = 8;
