//! Numbers that kernels and their twins share, chosen by iterations on a bisected mesh of 300k tetrahedra (`docs/gpu.md`).

/// The part of a sweep's step that is taken.
pub(super) const OMEGA: f32 = 0.8;

/// Corrections that are the same on all of an aggregate are too stiff, and are stretched by this.
pub(super) const OVERCORRECTION: f32 = 1.25;

/// Sweeps on the coarsest level, which has up to some tens of rows.
pub(super) const SWEEPS: u32 = 8;

/// Threads that sum up one aggregate of a large level.
pub(super) const LANES: u32 = 8;

/// Drops of the energy are taken to fall by no more than this from step to step: the first ones often do, where an object came, but
/// in the end they fall by a third (on lattices by more, where this is 0.05).
pub(super) const LEAST_RATIO: f32 = 0.3;

/// What is left may be so many times what drops tell. With 3, as on lattices, a floating bar that appeared in front of a board on a
/// bisected mesh was wrong by 1.08e-5 at a tolerance of 1e-5.
pub(super) const CAUTION: f32 = 5.0;
