//! Numbers that kernels and their twins share.

/// The leak of a node whose potential is held: larger than any weight, and finite, as shaders know no infinity.
pub(super) const FIXED: f32 = 1e30;

/// Shares that miss no more than this to one miss nothing.
pub(super) const ROUNDING: f32 = 1e-6;

/// Residuals are raised by this on their way to a coarser level, which is somewhat too stiff.
pub(super) const OVERCORRECTION: f32 = 1.15;

/// Sweeps on the coarsest level.
pub(super) const SWEEPS: usize = 4;
