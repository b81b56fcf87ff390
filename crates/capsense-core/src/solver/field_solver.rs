//! The fields with the operator that fits the mesh.

use super::bracket::Bracket;
use super::csr::CsrSolver;
use super::demand::Demand;
use super::energy_error::{ErrorRule, Experience};
use super::green::{Empty, Green};
use super::lattice::LatticeSolver;
use super::operator::Operator;
use super::pcg::ConjugateGradients;
use super::remote::{Found, RemoteFields, RemoteSolver};
use super::{Preconditioner, SolveError, SolveReport, SolverOptions, available_threads};
use crate::mesh::Edges;
use crate::occupancy::Occupancy;
use crate::stiffness::StiffnessMatrix;
use crate::workers::Workers;

/// Down to this relative error of an energy, potentials may be in single precision.
const SINGLE_PRECISION: f64 = 1e-6;

/// What single precision leaves of an energy for each unit of a body's permittivity, as differences of potentials within the body
/// are multiplied by it. Measured in scenes of the example `tolerance` with potentials in single precision: 3e-11 in 99 of 100
/// frames with permittivities from 10,000 on, 1.4e-9 at worst (6e-4 of C, 440,000 about a floating conductor).
const ROUNDING_IN_SINGLE_PRECISION: f64 = 2e-9;

/// Iterations that a solve in single precision may take: more of them tell of rounding that does not let it end.
const ITERATIONS_IN_SINGLE_PRECISION: usize = 30;

/// The finest relative error of an energy that fields elsewhere, in single precision, are asked for.
const FINEST_IN_SINGLE_PRECISION: f64 = 1e-7;

/// In single precision, an energy below this part of the largest is that of an object that is not there.
const ABSENT: f64 = 1e-10;

/// Energies may have changed by this factor since it was said how exact they must be.
const ENERGIES_CHANGED: f64 = 1.1;

/// Fields of several terminals, and how to improve them.
#[derive(Clone, Debug)]
pub(crate) struct FieldSolver {
    vectors: Vectors,
    workers: Workers,
    iteration: ConjugateGradients,
    /// Whether the residual is not that of the fields, and must be computed everywhere.
    residual_is_lost: bool,
    columns: usize,
    bracket: Bracket,
    demand: Demand,
    /// Of the last frame that was solved.
    residual: f64,
    /// Exact answers on small meshes; fields of the operator then are those of an earlier frame, but for held rows.
    green: Option<Box<Green>>,
    /// The relative error of the answer to this frame.
    answered: Option<f64>,
    /// What the last solve elsewhere left.
    of_remote: SolveReport,
    /// The finest relative error of an energy that can be had with potentials in single precision.
    finest_in_single: f64,
}

/// The operators.
#[derive(Clone, Debug)]
enum Vectors {
    Lattice(Box<LatticeSolver>),
    Csr(CsrSolver),
    Remote(Box<RemoteSolver>),
}

impl FieldSolver {
    /// Zero fields of so many columns. `fixed` tells for every row, nodes and then objects, whether it is held,
    /// `to_ground` for each of the last columns, which belong to objects that find their own potential, what capacitance
    /// ties them to ground, in units of energy. Fields may be `remote`.
    pub(crate) fn new(
        matrix: &StiffnessMatrix,
        fixed: &[bool],
        columns: usize,
        to_ground: &[f64],
        options: &SolverOptions,
        remote: Option<Box<dyn RemoteFields>>,
    ) -> Self {
        let rule = match options.preconditioner {
            Preconditioner::Jacobi | Preconditioner::None => ErrorRule::Window,
            _ => ErrorRule::Experience(Experience::default()),
        };
        let objects = fixed.len() - matrix.nodes();
        let threads = options.threads.unwrap_or_else(available_threads);
        // While fields are elsewhere, there is nothing to share here.
        let threads = if remote.is_some() { 1 } else { threads };
        let workers = Workers::new(threads, matrix.nodes());
        let vectors = match (remote, matrix.network().edges()) {
            (Some(remote), _) => {
                Vectors::Remote(Box::new(RemoteSolver::new(remote, columns, matrix.nodes(), objects)))
            }
            (None, Edges::Lattice(lattice)) if matrix.is_lattice() => {
                let fields = LatticeSolver::new(lattice, columns, objects, fixed, workers.clone());
                Vectors::Lattice(Box::new(fields))
            }
            _ => {
                let rows = fixed.len();
                Vectors::Csr(CsrSolver::new(matrix, rows, columns, options.preconditioner, workers.clone()))
            }
        };
        Self {
            vectors,
            workers,
            iteration: ConjugateGradients::new(columns, rule),
            residual_is_lost: true,
            columns,
            bracket: Bracket::new(columns),
            demand: Demand::new(columns, to_ground),
            residual: 0.0,
            green: None,
            answered: None,
            of_remote: SolveReport::default(),
            finest_in_single: SINGLE_PRECISION,
        }
    }

    /// Tells the largest relative permittivity that a body may have.
    pub(crate) fn expect_permittivity(&mut self, largest: f64) {
        self.finest_in_single = SINGLE_PRECISION.max(ROUNDING_IN_SINGLE_PRECISION * largest);
    }

    /// Gives back the room that the first refresh took.
    pub(crate) fn settle(&mut self) {
        if let Vectors::Lattice(fields) = &mut self.vectors {
            fields.settle();
        }
    }

    /// The threads that share the work.
    pub(crate) fn workers(&self) -> &Workers {
        &self.workers
    }

    /// The potential of a row in one column.
    pub(crate) fn potential(&self, column: usize, row: usize, fixed: &[bool]) -> f64 {
        if let (Some(green), Some(_), false) = (&self.green, self.answered, fixed[row]) {
            return green.potential(column, row as u32);
        }
        match &self.vectors {
            Vectors::Lattice(fields) => fields.potential(column, row),
            Vectors::Csr(fields) => fields.potential(column, row),
            Vectors::Remote(fields) => fields.potential(column, row),
        }
    }

    /// Visits the potentials of a row in all columns.
    #[inline]
    pub(crate) fn for_potentials(&self, row: usize, fixed: &[bool], mut visit: impl FnMut(usize, f64)) {
        match &self.vectors {
            // Where a node stands is found once for all columns.
            Vectors::Lattice(fields) if self.green.is_none() => fields.for_potentials(row, visit),
            _ => (0..self.columns).for_each(|column| visit(column, self.potential(column, row, fixed))),
        }
    }

    /// Sets the potential of a row in one column. Then the row must be among those that the next
    /// [`FieldSolver::refresh`] is told of, or the residual be forgotten.
    pub(crate) fn set_potential(&mut self, column: usize, row: usize, potential: f64) {
        match &mut self.vectors {
            Vectors::Lattice(fields) => fields.set_potential(column, row, potential),
            Vectors::Csr(fields) => fields.set_potential(column, row, potential),
            Vectors::Remote(fields) => fields.set_potential(column, row, potential),
        }
    }

    /// One column becomes what `held` tells of each row; the residual is lost.
    pub(crate) fn empty_column(&mut self, column: usize, held: impl Iterator<Item = f64>) {
        for (row, potential) in held.enumerate() {
            self.set_potential(column, row, potential);
        }
        if let Vectors::Remote(fields) = &mut self.vectors {
            fields.empty(column);
        }
        self.forget_residual();
    }

    /// The next solve computes the residual everywhere.
    pub(crate) fn forget_residual(&mut self) {
        self.residual_is_lost = true;
    }

    /// Takes over the matrix and the fixed rows where they changed.
    pub(crate) fn refresh(
        &mut self,
        matrix: &StiffnessMatrix,
        occupancy: &Occupancy,
        fixed: &[bool],
        changed: &[u32],
        options: &SolverOptions,
    ) {
        if let Some(green) = self.green.as_mut().filter(|_| !changed.is_empty()) {
            self.answered = green.update(matrix, occupancy).filter(|error| {
                self.demand.update(green.energies());
                let allowed = |(column, energy)| self.demand.allowed(column, energy, options);
                let own = own_energies(green.energies(), self.columns).enumerate();
                own.filter(|(_, energy)| *energy > 0.0).map(allowed).all(|allowed| *error <= allowed)
            });
            if self.answered.is_none()
                && let Vectors::Csr(fields) = &mut self.vectors
            {
                // It was not told of frames before.
                fields.refresh(matrix, fixed, 0..matrix.nodes() as u32);
                self.residual_is_lost = true;
            }
            return;
        }
        match &mut self.vectors {
            Vectors::Lattice(fields) => fields.refresh(matrix, fixed, changed),
            Vectors::Csr(fields) => fields.refresh(matrix, fixed, changed.iter().copied()),
            Vectors::Remote(fields) => fields.refresh(matrix, fixed, changed),
        }
    }

    /// Takes over that objects were placed anew that are found where fields are, and returns whether they were.
    pub(crate) fn take_placed_elsewhere(&mut self) -> bool {
        let Vectors::Remote(fields) = &mut self.vectors else { return false };
        let is_news = fields.take_placed();
        self.bracket.is_lost |= is_news;
        is_news
    }

    /// What was found of objects where fields are, if they are found there.
    pub(crate) fn found(&self) -> Option<&Found> {
        match &self.vectors {
            Vectors::Remote(fields) => fields.found(),
            _ => None,
        }
    }

    /// Finds the bodies of very high permittivity, which need a direction of their own.
    pub(crate) fn find_islands(
        &mut self,
        matrix: &StiffnessMatrix,
        occupancy: &Occupancy,
        fixed: &[bool],
        changed: &[u32],
    ) {
        match &mut self.vectors {
            Vectors::Lattice(fields) => fields.find_islands(matrix, occupancy, fixed, changed),
            Vectors::Csr(fields) => fields.find_islands(matrix, occupancy, fixed, changed),
            Vectors::Remote(_) => {}
        }
    }

    /// Improves the fields until the tolerance is reached, unless nothing that changed can matter.
    pub(crate) fn solve(
        &mut self,
        matrix: &StiffnessMatrix,
        options: &SolverOptions,
    ) -> Result<SolveReport, SolveError> {
        if !self.must_solve(options) {
            return Ok(SolveReport {
                iterations: 0,
                relative_error: self.gap_of_capacitances(),
                residual: self.residual,
                skipped: true,
                launches: 0,
            });
        }
        self.bracket.is_lost = true;
        if let Vectors::Remote(_) = self.vectors {
            let report = self.solve_remotely(options);
            if let (Err(_), Vectors::Remote(fields)) = (&report, &mut self.vectors) {
                fields.empty_all();
            }
            return report;
        }
        if let Some(report) = self.answer() {
            return Ok(report);
        }
        let report = self.improve_in_some_precision(matrix, options);
        if report.is_err() {
            self.iteration.forget();
            match &mut self.vectors {
                Vectors::Lattice(fields) => fields.clear(),
                Vectors::Csr(fields) => fields.clear(),
                Vectors::Remote(_) => {}
            }
        }
        let report = report?;
        let energies = match &self.vectors {
            Vectors::Lattice(fields) => &fields.state().energies,
            Vectors::Csr(fields) => &fields.state().energies,
            Vectors::Remote(_) => return Ok(report),
        };
        let errors = (0..self.columns).map(|column| self.iteration.relative_error(column));
        self.bracket.reset(energies, self.iteration.corrections(), errors);
        // Fields that bounds could start from are not kept.
        self.bracket.is_lost = self.green.is_some();
        self.residual = report.residual;
        Ok(report)
    }

    /// Reads potentials of one column back from where they are.
    ///
    /// # Errors
    /// When the device that has them fails.
    pub(crate) fn read(&self, column: usize) -> Result<(), SolveError> {
        match &self.vectors {
            Vectors::Remote(fields) => fields.read(column),
            _ => Ok(()),
        }
    }

    /// Tells fields that are elsewhere of a solve to come.
    pub(crate) fn announce(&mut self, options: &SolverOptions) {
        let Self { vectors, bracket, demand, columns, .. } = self;
        if let Vectors::Remote(fields) = vectors
            && !fields.is_settled()
        {
            let allowed = allowed_energies(bracket, demand, *columns, options);
            let most = options.max_iterations.min(ITERATIONS_IN_SINGLE_PRECISION);
            fields.announce(allowed.as_deref(), most);
        }
    }

    /// Has the fields improved where they are. The bracket stays lost: it would need potentials along changed edges.
    fn solve_remotely(&mut self, options: &SolverOptions) -> Result<SolveReport, SolveError> {
        let Self { vectors, bracket, demand, columns, residual_is_lost, residual, .. } = self;
        let Vectors::Remote(fields) = vectors else { return Ok(SolveReport::default()) };
        if fields.is_settled() {
            return Ok(SolveReport { skipped: true, ..self.of_remote });
        }
        let mut report = SolveReport::default();
        loop {
            let asked = allowed_energies(bracket, demand, *columns, options);
            let left = options.max_iterations - report.iterations;
            let solution = fields.solve(asked.as_deref(), left.min(ITERATIONS_IN_SINGLE_PRECISION))?;
            report.iterations += solution.iterations;
            report.launches += solution.launches;
            report.residual = solution.residual;
            bracket.energies.copy_from_slice(&solution.energies);
            demand.update(&solution.energies);
            // What was asked for in terms of energies as they were may be a little more than of those now.
            let allowed = allowed_energies(bracket, demand, *columns, options).unwrap_or_default();
            let reached = |(to_come, allowed): (&f64, &f64)| *to_come <= ENERGIES_CHANGED * allowed;
            let enough = solution.to_come.iter().zip(&allowed).all(reached);
            let errors = own_energies(&solution.energies, *columns).zip(&solution.to_come).enumerate();
            let worst = errors
                .filter(|(column, (energy, _))| *energy > 0.0 && allowed[*column] < f64::INFINITY)
                .map(|(column, (energy, to_come))| {
                    let rounding = FINEST_IN_SINGLE_PRECISION + fields.lost_in_gaps(column, energy);
                    demand.error_of_capacitance(column, to_come / energy + rounding)
                })
                .fold(0.0, f64::max);
            report.relative_error = worst;
            if enough {
                (*residual_is_lost, *residual) = (false, report.residual);
                fields.settle();
                self.of_remote = SolveReport { iterations: 0, launches: 0, ..report };
                return Ok(report);
            }
            // Nothing is known of a column of which nothing was asked, either.
            let is_broken = solution.to_come.iter().enumerate().any(|(column, to_come)| {
                *to_come >= f64::from(f32::MAX)
                    && asked.as_ref().is_none_or(|asked| asked[column] < f64::INFINITY)
            });
            if solution.iterations == 0 || is_broken || report.iterations >= options.max_iterations {
                let (iterations, tolerance) = (report.iterations, options.tolerance);
                return Err(SolveError::NotConverged { iterations, relative_error: worst, tolerance });
            }
        }
    }

    /// The exact answer to this frame, if there is one.
    fn answer(&mut self) -> Option<SolveReport> {
        let (green, relative_error) = (self.green.as_ref()?, self.answered?);
        self.bracket.energies.copy_from_slice(green.energies());
        self.demand.update(&self.bracket.energies);
        let of_column = |column| self.demand.error_of_capacitance(column, relative_error);
        Some(SolveReport {
            iterations: 1,
            relative_error: (0..self.columns).map(of_column).fold(0.0, f64::max),
            residual: self.residual,
            skipped: false,
            launches: 0,
        })
    }

    /// Makes the table that answers frames on small meshes, from the fields of the empty scene.
    pub(crate) fn tabulate(&mut self, matrix: &StiffnessMatrix, fixed: &[bool]) {
        if let Vectors::Csr(fields) = &mut self.vectors {
            fields.refresh_inverse();
            let fields = &*fields;
            let potential = |column: usize, row: usize| fields.potential(column, row);
            let inverse = |nodes: &[u32]| fields.inverse(nodes);
            let energies = &self.bracket.energies;
            let empty = Empty::new(matrix, fixed, energies, self.columns, potential, inverse);
            self.bracket.is_lost |= empty.is_some();
            self.green = empty.map(|empty| Box::new(Green::new(empty)));
        }
    }

    /// In single precision for as long as that is exact enough.
    fn improve_in_some_precision(
        &mut self,
        matrix: &StiffnessMatrix,
        options: &SolverOptions,
    ) -> Result<SolveReport, SolveError> {
        if self.is_single() && !self.single_is_enough(options) {
            self.switch_precision(matrix);
        }
        if !self.is_single() {
            return self.improve(options);
        }
        let max_iterations = options.max_iterations.min(ITERATIONS_IN_SINGLE_PRECISION);
        let report = self.improve(&SolverOptions { max_iterations, ..*options });
        match report {
            Err(SolveError::NotConverged { iterations, .. } | SolveError::Breakdown { iterations, .. })
                if iterations < options.max_iterations =>
            {
                self.iteration.forget();
                self.switch_precision(matrix);
                let max_iterations = options.max_iterations - iterations;
                let report = self.improve(&SolverOptions { max_iterations, ..*options });
                report.map(|report| report.after(iterations)).map_err(|error| error.after(iterations))
            }
            _ => report,
        }
    }

    fn improve(&mut self, options: &SolverOptions) -> Result<SolveReport, SolveError> {
        let lost = std::mem::take(&mut self.residual_is_lost);
        let Self { vectors, iteration, demand, .. } = self;
        match vectors {
            Vectors::Lattice(fields) => improve(fields.as_mut(), lost, iteration, demand, options),
            Vectors::Csr(fields) => improve(fields, lost, iteration, demand, options).map_err(|error| {
                // Without factors the iteration takes the matrix for an indefinite one.
                fields.failure().map_or(error, |reason| SolveError::Factorisation { reason })
            }),
            Vectors::Remote(_) => Ok(SolveReport::default()),
        }
    }

    fn is_single(&self) -> bool {
        matches!(&self.vectors, Vectors::Lattice(fields) if fields.is_single())
    }

    fn single_is_enough(&self, options: &SolverOptions) -> bool {
        (0..self.columns).all(|column| {
            let energy = self.energies()[column * self.columns + column];
            energy <= 0.0 || self.demand.allowed(column, energy, options) >= self.finest_in_single
        })
    }

    /// Stores potentials in single precision if that is exact enough.
    pub(crate) fn choose_precision(&mut self, matrix: &StiffnessMatrix, options: &SolverOptions) {
        if !self.is_single() && self.single_is_enough(options) {
            self.switch_precision(matrix);
        }
    }

    fn switch_precision(&mut self, matrix: &StiffnessMatrix) {
        if let Vectors::Lattice(fields) = &mut self.vectors {
            fields.switch_precision(matrix);
            self.residual_is_lost = true;
        }
    }

    fn gap_of_capacitances(&self) -> f64 {
        (0..self.columns)
            .map(|column| self.demand.error_of_capacitance(column, self.bracket.relative_error(column)))
            .fold(0.0, f64::max)
    }

    /// Whether what changed can matter. Where it cannot, the solver need not be told of it yet.
    pub(crate) fn must_solve(&mut self, options: &SolverOptions) -> bool {
        self.demand.update(&self.bracket.energies);
        self.residual_is_lost || !self.may_skip(options)
    }

    fn may_skip(&self, options: &SolverOptions) -> bool {
        (0..self.columns).all(|column| {
            let energy = self.energies()[column * self.columns + column];
            self.bracket.is_below(column, self.demand.allowed(column, energy, options))
        })
    }

    /// Takes the energies of the last solve for those of the empty scene.
    pub(crate) fn remember_base(&mut self) {
        self.demand.remember_base(&self.bracket.energies);
    }

    /// The bounds on what changes of couplings do.
    pub(crate) fn bracket_mut(&mut self) -> &mut Bracket {
        &mut self.bracket
    }

    /// Whether bounds are of use: once they are further apart than the tolerance they are not.
    pub(crate) fn bracket_is_open(&self, options: &SolverOptions) -> bool {
        !self.residual_is_lost && self.may_skip(options)
    }

    /// XᵀKX of the fields as they are, row by row, all pairs of columns.
    pub(crate) fn energies(&self) -> &[f64] {
        &self.bracket.energies
    }
}

/// How far the energies of fields elsewhere may be from the least, as far as energies are known.
fn allowed_energies(
    bracket: &Bracket,
    demand: &Demand,
    columns: usize,
    options: &SolverOptions,
) -> Option<Vec<f64>> {
    let energies = || own_energies(&bracket.energies, columns);
    let largest = energies().fold(0.0, f64::max);
    // Of what is not known, and of objects that are not there, nothing can be asked.
    let allowed = |(column, energy): (usize, f64)| match energy > ABSENT * largest {
        true => energy * demand.allowed(column, energy, options).max(FINEST_IN_SINGLE_PRECISION),
        false => f64::INFINITY,
    };
    (largest > 0.0).then(|| energies().enumerate().map(allowed).collect())
}

/// The energies of all columns, of those of all pairs.
fn own_energies(energies: &[f64], columns: usize) -> impl Iterator<Item = f64> {
    energies.iter().step_by(columns + 1).copied()
}

fn improve(
    fields: &mut impl Operator,
    residual_is_lost: bool,
    iteration: &mut ConjugateGradients,
    demand: &mut Demand,
    options: &SolverOptions,
) -> Result<SolveReport, SolveError> {
    if residual_is_lost {
        fields.evaluate();
    }
    iteration.solve(fields, demand, options)
}
