//! The rows of the map: an interface model, what solves for the field, and the precision it has.

use capsense_core::occupancy::Interface;
use capsense_core::solver::{Preconditioner, SolverOptions};

/// What solves for the field, and in which precision.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Solver {
    /// Multigrid on a lattice, potentials in single precision: down to tolerances of 1e-6.
    LatticeSingle,
    /// Multigrid on a lattice, potentials in double precision: below.
    LatticeDouble,
    /// Multigrid by aggregation, on any mesh. Potentials are double, its V-cycle is single.
    Aggregation,
    /// Incomplete Cholesky factors.
    Ic0,
    /// The inverse of the diagonal.
    Jacobi,
    /// No preconditioner.
    Plain,
    /// The exact inverse, through the Green's function of the empty scene where that is faster.
    Direct,
    /// The paper's method, K accumulated in single precision.
    PaperSingle,
    /// The paper's method, K accumulated in double precision.
    PaperDouble,
}

/// Solvers of [`capsense_core::simulator::Simulator`], in the order of the map.
const OURS: [Solver; 7] = [
    Solver::LatticeSingle,
    Solver::LatticeDouble,
    Solver::Aggregation,
    Solver::Direct,
    Solver::Ic0,
    Solver::Jacobi,
    Solver::Plain,
];

const INTERFACES: [Interface; 3] = [Interface::EdgeCut, Interface::VolumeFraction, Interface::Centroid];

/// The smallest tolerance for which potentials are in single precision.
const SINGLE_PRECISION: f64 = 1e-6;

/// A row of the map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Method {
    /// What surfaces do to the mesh.
    pub interface: Interface,
    /// What solves for the field.
    pub solver: Solver,
}

impl Method {
    /// All rows in their order.
    pub fn all() -> Vec<Self> {
        let ours = INTERFACES
            .into_iter()
            .flat_map(|interface| OURS.into_iter().map(move |solver| Self { interface, solver }));
        let paper = [Solver::PaperDouble, Solver::PaperSingle];
        ours.chain(paper.map(|solver| Self { interface: Interface::Centroid, solver })).collect()
    }

    /// Whether it is the paper's, which has an implementation of its own.
    pub fn is_paper(self) -> bool {
        matches!(self.solver, Solver::PaperSingle | Solver::PaperDouble)
    }

    /// The first part of a row's name.
    pub fn interface_name(self) -> &'static str {
        if self.is_paper() { "paper" } else { self.interface.name() }
    }

    /// The second part of a row's name.
    pub fn solver_name(self) -> &'static str {
        match self.solver {
            Solver::LatticeSingle => "multigrid, lattice",
            Solver::LatticeDouble => "multigrid, lattice, f64",
            Solver::Aggregation => "multigrid, any mesh",
            Solver::Ic0 => "IC(0)",
            Solver::Jacobi => "Jacobi",
            Solver::Plain => "none",
            Solver::Direct => "direct",
            Solver::PaperSingle => "none, K in f32",
            Solver::PaperDouble => "none, K in f64",
        }
    }

    /// The precision of potentials, or, for the paper's method, of K.
    pub fn precision(self) -> &'static str {
        match self.solver {
            Solver::LatticeSingle | Solver::PaperSingle => "f32",
            _ => "f64",
        }
    }

    /// What it is asked for where the stress is not the tolerance: a relative error of C, or, for the paper's method, of the
    /// residual.
    pub fn usual_tolerance(self) -> f64 {
        if self.is_paper() || self.solver == Solver::LatticeSingle { 1e-5 } else { 1e-8 }
    }

    /// Whether it is what the simulator uses for a tolerance.
    pub fn takes_tolerance(self, tolerance: f64) -> bool {
        match self.solver {
            Solver::LatticeSingle => tolerance >= SINGLE_PRECISION,
            Solver::LatticeDouble => tolerance < SINGLE_PRECISION,
            _ => true,
        }
    }

    /// Whether it needs a mesh that is a lattice.
    pub fn needs_lattice(self) -> bool {
        matches!(self.solver, Solver::LatticeSingle | Solver::LatticeDouble)
    }

    /// What the simulator is told.
    pub fn options(self, tolerance: f64) -> SolverOptions {
        let preconditioner = match self.solver {
            Solver::LatticeSingle | Solver::LatticeDouble | Solver::Aggregation => Preconditioner::Multigrid,
            Solver::Ic0 => Preconditioner::Ic0,
            Solver::Jacobi => Preconditioner::Jacobi,
            Solver::Plain | Solver::PaperSingle | Solver::PaperDouble => Preconditioner::None,
            Solver::Direct => Preconditioner::Direct,
        };
        SolverOptions { tolerance, preconditioner, threads: Some(1), ..SolverOptions::default() }
    }
}
