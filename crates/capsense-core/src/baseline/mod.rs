//! The methods that [`crate::simulator::Simulator`] is compared with, on the same sensors and depth images.
//!
//! - [`PaperMethod`]: that of Schöffmann, Erickson and Zangl, *CapSense: A Real-Time Capacitive Sensor Simulation
//!   Framework for Physical Human-Robot Interaction*, IEEE RA-L 2022. Elements take an object's permittivity whole, K
//!   accumulates the changes, and conjugate gradients without preconditioner start from zero.
//! - [`Ic0Method`]: the simulator's own K with what general libraries offer on one level: conjugate gradients with an
//!   incomplete Cholesky factorisation, one column after another, started from the frame before.
//!
//! Both stop on the residual, as such methods do, and not on the error of C.

mod accumulated;
mod centroid;
mod compressed_rows;
mod conjugate_gradients;
mod ic0;
mod paper;

pub use accumulated::{AccumulatedStiffness, Precision};
pub use centroid::CentroidOccupancy;
pub use ic0::Ic0Method;
pub use paper::{PaperMethod, STEEL};

use crate::occupancy::InvalidDepth;
use crate::solver::PatternError;

/// When the conjugate gradients stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CgOptions {
    /// Norm of the residual over the norm of the right-hand side, at which a column is done.
    pub relative_residual: f64,
    /// Iterations for one column after which the method gives up.
    pub max_iterations: usize,
}

impl CgOptions {
    /// What the paper's implementation stops at, a relative residual of 1e-5.
    pub const PAPER: Self = Self { relative_residual: 1e-5, max_iterations: 20_000 };

    /// What linear solvers usually are asked for, a relative residual of 1e-6.
    pub const USUAL: Self = Self { relative_residual: 1e-6, ..Self::PAPER };
}

/// What a frame took.
#[must_use]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BaselineReport {
    /// Number of elements ([`PaperMethod`]) or edges ([`Ic0Method`]) that changed.
    pub changed: usize,
    /// Iterations of all columns together.
    pub iterations: usize,
}

/// Why a frame cannot be computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BaselineError {
    /// The objects seen are not those that were announced.
    #[error("{seen} objects are seen, but the method knows the materials of {known}")]
    ObjectCount {
        /// Number of objects seen.
        seen: usize,
        /// Number of materials.
        known: usize,
    },
    /// The residual asked for was not reached.
    #[error("column {column} not converged after {iterations} iterations: residual {residual:e}")]
    NotConverged {
        /// The terminal at 1 V, from 0.
        column: usize,
        /// Number of iterations made.
        iterations: usize,
        /// Norm of the residual over that of the right-hand side.
        residual: f64,
    },
    /// The matrix is not positive definite, as after too many accumulated updates.
    #[error(
        "the stiffness matrix is indefinite: p·Kp = {curvature:e} in column {column}, iteration {iteration}"
    )]
    Indefinite {
        /// The terminal at 1 V, from 0.
        column: usize,
        /// Iteration in which it showed.
        iteration: usize,
        /// The quadratic form that should have been positive.
        curvature: f64,
    },
    /// A number overflowed or was not a number.
    #[error("the solution of column {column} is not finite in iteration {iteration}")]
    NonFinite {
        /// The terminal at 1 V, from 0.
        column: usize,
        /// Iteration in which it showed.
        iteration: usize,
    },
    /// The depth image is no picture of surfaces.
    #[error(transparent)]
    Depth(#[from] InvalidDepth),
    /// The matrix has more entries than can be numbered.
    #[error(transparent)]
    Pattern(#[from] PatternError),
}
