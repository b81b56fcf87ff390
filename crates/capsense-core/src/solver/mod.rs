//! Solves K φ = 0 on the free rows for many terminals at once.

mod bracket;
mod csr;
mod demand;
mod energy_error;
mod field_solver;
mod foresight;
mod green;
mod incomplete_cholesky;
mod islands;
mod lattice;
mod network;
mod operator;
mod pcg;
mod preconditioner;
mod remote;
mod thorough;
mod worth;

pub(crate) use bracket::EdgeFields;
pub(crate) use field_solver::FieldSolver;
pub use incomplete_cholesky::{IncompleteCholesky, PatternError};
pub(crate) use islands::CONTRAST;
pub use network::{NO_AGGREGATE, NetworkProblem};
pub use preconditioner::Preconditioner;
pub use remote::{
    Changes, Feed, Found, HELD_AT_ZERO, NO_HOLDER, NetworkRow, NetworkRows, NodeRow, RemoteFields,
    RemoteProblem, RemoteSolution, of_links,
};

/// No capacitance is known better than to its own rounding, whatever tolerance is asked for.
const ROUNDING: f64 = 1e-16;

/// Changes may be as small as nothing; no more than this part of the capacitance is asked for to resolve them.
const FINEST_FOR_CHANGES: f64 = 1e-9;

/// When to stop, and how to get there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolverOptions {
    /// Largest relative error of the self-capacitances that an unfinished iteration may leave.
    pub tolerance: f64,
    /// Largest error of the self-capacitances in relation to how far they are from those of the empty scene, if that is
    /// to be bounded too. It asks for no more than 1e-9 of the self-capacitance itself.
    pub change_tolerance: Option<f64>,
    /// What the residual is multiplied with.
    pub preconditioner: Preconditioner,
    /// Iterations after which the solver gives up.
    pub max_iterations: usize,
    /// Threads that share the work on large meshes, [`available_threads`] where no number is given. Results do not depend on
    /// it.
    pub threads: Option<usize>,
}

impl Default for SolverOptions {
    fn default() -> Self {
        Self {
            tolerance: 1e-4,
            change_tolerance: None,
            preconditioner: Preconditioner::default(),
            max_iterations: 10_000,
            threads: None,
        }
    }
}

/// A larger number of threads in the environment is no number of threads.
const MOST_THREADS: usize = 1024;

/// How many threads share the work where nobody says how many: what the environment variable `RAYON_NUM_THREADS` tells, as
/// programs that run beside others set it, else as many as the machine can run at once.
#[must_use]
pub fn available_threads() -> usize {
    let told = std::env::var("RAYON_NUM_THREADS").ok().and_then(|told| number_of_threads(&told));
    told.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from))
}

fn number_of_threads(text: &str) -> Option<usize> {
    text.trim().parse().ok().filter(|threads| (1..=MOST_THREADS).contains(threads))
}

impl SolverOptions {
    /// The relative error that is allowed of the energy of a column. `part` of the tolerance is what the capacitances between
    /// electrodes need, and `change` of that of their changes, where these are known.
    fn allowed(&self, part: f64, change: Option<f64>) -> f64 {
        let of_change = self
            .change_tolerance
            .zip(change)
            .map(|(tolerance, part)| (part * tolerance).max(FINEST_FOR_CHANGES));
        (part * self.tolerance).min(of_change.unwrap_or(f64::INFINITY)).max(ROUNDING)
    }
}

/// What a solve reached.
#[must_use]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SolveReport {
    /// Number of steps that the fields took; all terminals advance together. None if the frame was skipped, and none if
    /// it was seen before any step how much they would take from the capacitances: then [`SolveReport::relative_error`]
    /// is that of what was foreseen, and fields follow in a later frame.
    pub iterations: usize,
    /// Estimated relative error of the self-capacitances, the largest over all terminals.
    pub relative_error: f64,
    /// Recomputed norm of the residual charges on free rows over the norm of the charges on the terminal's own nodes, the
    /// largest over all terminals. That of the last frame solved when this one was skipped, or answered through the Green's
    /// function of the empty scene. Off lattices the charges on
    /// terminals are those of the last frame in which fields moved.
    pub residual: f64,
    /// Whether there was nothing to solve, because bounds from both sides showed that what changed in the scene moves no
    /// capacitance by more than the tolerance.
    pub skipped: bool,
    /// Kernels that a device launched for it, where the fields are on one; those of a whole batch.
    pub launches: usize,
}

impl SolveReport {
    /// The same after so many steps more, which had led nowhere.
    fn after(self, steps: usize) -> Self {
        Self { iterations: self.iterations + steps, ..self }
    }
}

/// Why there is no solution. The field of the last good frame is lost, that of the failed one is not used.
#[must_use]
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SolveError {
    /// The tolerance was not reached.
    #[error(
        "not converged after {iterations} iterations: relative error {relative_error:e}, asked for {tolerance:e}"
    )]
    NotConverged {
        /// Number of iterations made.
        iterations: usize,
        /// Estimated relative error of the self-capacitances.
        relative_error: f64,
        /// The error asked for.
        tolerance: f64,
    },
    /// The preconditioner makes nothing of a residual that is still there, as where rounding has left it worthless.
    #[error(
        "the iteration broke down: after {iterations} iterations the preconditioner gains nothing of the residual of \
         {residual:e} that is left in column {column}, relative error {relative_error:e}"
    )]
    Breakdown {
        /// Column of the solution, the first of them.
        column: usize,
        /// Number of iterations made.
        iterations: usize,
        /// Norm of the residual charges that are left over the norm of the charges on the terminal's own nodes.
        residual: f64,
        /// Estimated relative error of the self-capacitances.
        relative_error: f64,
    },
    /// The matrix is not positive definite on the free rows.
    #[error(
        "the stiffness matrix is indefinite: p·Kp = {curvature:e} in column {column}, iteration {iteration}"
    )]
    Indefinite {
        /// Column of the solution.
        column: usize,
        /// Iteration in which it showed.
        iteration: usize,
        /// The quadratic form that should have been positive.
        curvature: f64,
    },
    /// The exact preconditioner could not be made.
    #[error("the stiffness matrix cannot be factorised: {reason}")]
    Factorisation {
        /// What is lacking.
        reason: &'static str,
    },
    /// A number overflowed or was not a number.
    #[error("the solution of column {column} is not finite in iteration {iteration}")]
    NonFinite {
        /// Column of the solution.
        column: usize,
        /// Iteration in which it showed.
        iteration: usize,
    },
    /// The device that the fields are on failed.
    #[error("the device that computes the fields failed: {reason}")]
    Device {
        /// What it said.
        reason: String,
    },
}

impl SolveError {
    /// The same after so many steps more, which had led nowhere.
    fn after(mut self, steps: usize) -> Self {
        match &mut self {
            Self::NotConverged { iterations, .. } | Self::Breakdown { iterations, .. } => {
                *iterations += steps
            }
            Self::Indefinite { iteration, .. } | Self::NonFinite { iteration, .. } => *iteration += steps,
            Self::Factorisation { .. } | Self::Device { .. } => {}
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_number_of_threads_is_none() {
        assert_eq!(number_of_threads("3"), Some(3));
        assert_eq!(number_of_threads(" 1024\n"), Some(1024));
        for text in ["", "0", "-1", "1.5", "1025", "all"] {
            assert_eq!(number_of_threads(text), None, "{text}");
        }
    }
}
