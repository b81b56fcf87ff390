//! Numbers that kernels and their twins share. With these a bar that moves 1 mm a frame takes two iterations a frame at 100k
//! and at 300k tetrahedra (tolerance 1e-4), as many as the sweeps of the processor's multigrid, which see what they have
//! found before; damping by 0.7 or corrections longer by 1.5 take no fewer, and a second sweep or a second visit of coarse
//! levels makes up for no launch.

/// The part of a sweep's step that is taken.
pub(super) const OMEGA: f32 = 0.8;

/// Corrections that are the same on all of an aggregate are too stiff, and are stretched by this.
pub(super) const OVERCORRECTION: f32 = 1.25;

/// Sweeps on the coarsest level, which has up to some tens of rows.
pub(super) const SWEEPS: u32 = 8;

/// Threads that sum up one aggregate of a large level.
pub(super) const LANES: u32 = 8;
