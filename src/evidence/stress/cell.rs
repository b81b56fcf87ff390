//! One method under one stress: what came of it, and how good that is.

use super::ladder::Stress;
use super::method::Method;
use std::fmt;

/// Iterations above which a cell is slow. Multigrid takes ten to twenty where nothing is difficult.
pub const SLOW: usize = 100;

/// How many tolerances a result may be off: the promise that is tested elsewhere, too.
pub const ALLOWED: f64 = 3.0;

/// How much of a change by objects a method may miss because of its mesh and interface model.
pub const MODEL: f64 = 0.25;

/// How a method did.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Status {
    /// As it should.
    Ok,
    /// Right after more than [`SLOW`] iterations.
    Slow,
    /// No result, but an error or a warning that says why.
    Refused,
    /// A result that is wrong by no more than its error bar says.
    Inaccurate,
    /// A result that is wrong without notice.
    Wrong,
}

impl Status {
    /// All of them, from good to bad.
    pub const ALL: [Self; 5] = [Self::Ok, Self::Slow, Self::Refused, Self::Inaccurate, Self::Wrong];

    /// From 0 for the best.
    pub fn rank(self) -> usize {
        self as usize
    }

    /// As in the table.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Slow => "slow",
            Self::Refused => "refused",
            Self::Inaccurate => "inaccurate",
            Self::Wrong => "wrong",
        }
    }
}

/// What was measured where there was a result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Most iterations of a frame, of all columns together for the paper's method.
    pub iterations: usize,
    /// What was asked for.
    pub tolerance: f64,
    /// Largest difference to a factorisation of the same equations, of an entry C_st in parts of √(C_ss C_tt).
    pub solver_error: f64,
    /// Largest difference of changes by objects to those on a fine mesh, in parts of the largest change.
    pub model_error: Option<f64>,
    /// The error bar of the largest change in the same parts, where there is one.
    pub error_bar: Option<f64>,
}

/// What came of it.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// A result.
    Measured(Measured),
    /// An error, or a warning that the result means nothing.
    Refused(String),
    /// The method does not know such meshes, materials or tolerances.
    NotOffered,
}

/// One field of the map.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// Its row.
    pub method: Method,
    /// Its column.
    pub stress: Stress,
    /// What came of it.
    pub outcome: Outcome,
}

impl Measured {
    /// Whether the equations were not solved to what was asked for.
    pub fn is_unsolved(&self) -> bool {
        self.solver_error.is_nan() || self.solver_error > ALLOWED * self.tolerance
    }

    /// Whether the equations are not those of the scene.
    pub fn is_mismodelled(&self) -> bool {
        self.model_error.is_some_and(|error| error.is_nan() || error > MODEL)
    }

    /// Whether the error bar says that changes may be as wrong as they are.
    pub fn is_told(&self) -> bool {
        self.model_error.zip(self.error_bar).is_some_and(|(error, bar)| error <= bar)
    }
}

impl Cell {
    /// `None` where there is nothing to judge.
    pub fn status(&self) -> Option<Status> {
        match &self.outcome {
            Outcome::NotOffered => None,
            Outcome::Refused(_) => Some(Status::Refused),
            Outcome::Measured(m) if m.is_unsolved() => Some(Status::Wrong),
            Outcome::Measured(m) if m.is_mismodelled() => {
                Some(if m.is_told() { Status::Inaccurate } else { Status::Wrong })
            }
            Outcome::Measured(m) if m.iterations > SLOW => Some(Status::Slow),
            Outcome::Measured(_) => Some(Status::Ok),
        }
    }
}

/// What the map shows: iterations, by how many tolerances the equations are off, or how many percent of the change.
impl fmt::Display for Cell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.outcome {
            Outcome::NotOffered => f.write_str("–"),
            Outcome::Refused(_) => f.write_str("×"),
            Outcome::Measured(m) if m.is_unsolved() => {
                let times = m.solver_error / m.tolerance;
                if times.is_infinite() {
                    return f.write_str("∞");
                }
                if times < 1000.0 { write!(f, "{times:.0}t") } else { write!(f, "{times:.0e}t") }
            }
            Outcome::Measured(Measured { model_error: Some(error), .. }) if *error > MODEL => {
                if *error < 10.0 {
                    write!(f, "{:.0}%", 100.0 * error)
                } else {
                    write!(f, "{:.0e}%", 100.0 * error)
                }
            }
            Outcome::Measured(m) => write!(f, "{}", m.iterations),
        }
    }
}
