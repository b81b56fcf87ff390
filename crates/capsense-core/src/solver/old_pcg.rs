//! Preconditioned conjugate gradients for several terminals at once.
//!
//! The columns share every pass over the matrix and keep their own step lengths. Fields, residuals and all sums are in
//! double precision; search directions are in single precision, which costs no accuracy because the same rounded
//! direction enters field and residual.

use super::old_error::{EnergyError, ErrorRule};
use super::islands::Islands;
use super::preconditioner::{ApproximateInverse, Preconditioner};
use super::{SolveError, SolveReport, SolverOptions};
use crate::occupancy::Occupancy;
use crate::stiffness::{LANES, Lane, Lane32, StiffnessMatrix};

/// The iteration with its preconditioner and working storage, sized once.
#[derive(Clone, Debug)]
pub(crate) struct Pcg {
    inverse: ApproximateInverse,
    islands: Islands,
    rule: ErrorRule,
    /// -K x on free rows, zero on fixed ones.
    r: Vec<Lane>,
    p: Vec<Lane32>,
    q: Vec<Lane>,
}

impl Pcg {
    /// Storage for a matrix with so many rows; `lattice` when its nodes are those of a lattice.
    pub fn new(rows: usize, preconditioner: Preconditioner) -> Self {
        let inverse = ApproximateInverse::new(preconditioner, rows);
        let rule = match inverse {
            ApproximateInverse::Diagonal { .. } => ErrorRule::Window,
            _ => ErrorRule::Spectrum { condition: None, solves: 0 },
        };
        let (zeros, zeros32) = (vec![[0.0; LANES]; rows], vec![[0.0; LANES]; rows]);
        Self { inverse, islands: Islands::default(), rule, r: zeros.clone(), p: zeros32, q: zeros }
    }

    /// The preconditioner in use.
    pub fn preconditioner(&self) -> Preconditioner {
        match self.inverse {
            ApproximateInverse::Diagonal { kind, .. } => kind,
            _ => Preconditioner::Multigrid,
        }
    }

    /// Takes over a changed matrix. `changed` must hold every node whose row changed or that became fixed or free
    /// since the last call; all nodes at the first.
    pub fn refresh(&mut self, matrix: &StiffnessMatrix, fixed: &[bool], changed: impl Iterator<Item = u32>) {
        self.inverse.refresh(matrix, fixed, changed);
    }

    /// Finds the bodies of very high permittivity, which need a direction of their own.
    pub fn find_islands(&mut self, matrix: &StiffnessMatrix, occupancy: &Occupancy, fixed: &[bool]) {
        self.islands.find(matrix, occupancy, fixed);
    }

    /// Improves the fields `x` until the tolerance is reached. Fixed rows of `x` keep their values; free rows hold the
    /// initial guess. On return `kx` is K x, the charges.
    ///
    /// # Errors
    /// When the tolerance is not reached, the matrix is indefinite, or a value is not finite.
    pub fn solve(
        &mut self,
        matrix: &StiffnessMatrix,
        fixed: &[bool],
        x: &mut [Lane],
        kx: &mut [Lane],
        options: &SolverOptions,
    ) -> Result<SolveReport, SolveError> {
        let (energy, mut active) = self.start(matrix, fixed, x);
        let mut error = EnergyError::new(self.rule, energy);
        let mut rz = self.first_direction();
        let mut iterations = 0;
        while active.contains(&true) {
            if iterations == options.max_iterations {
                return Err(SolveError::NotConverged {
                    iterations,
                    relative_error: error.worst(),
                    tolerance: options.tolerance,
                });
            }
            let alpha = self.step_lengths(matrix, &mut active, rz, iterations)?;
            self.advance(fixed, x, alpha);
            error.record(alpha, rz);
            iterations += 1;
            for (lane, active) in active.iter_mut().enumerate() {
                *active &= !error.is_below(lane, options.tolerance);
            }
            if active.contains(&true) {
                rz = self.next_direction(rz);
            }
        }
        self.rule = error.rule();
        matrix.apply(x, kx);
        let relative_error = if iterations == 0 { 0.0 } else { error.worst() };
        Ok(SolveReport { iterations, relative_error, residual: residual(fixed, kx) })
    }

    /// Residual, energies, and which columns have anything to do.
    fn start(&mut self, matrix: &StiffnessMatrix, fixed: &[bool], x: &[Lane]) -> (Lane, [bool; LANES]) {
        let energy = matrix.apply(x, &mut self.r);
        let mut largest = [0.0_f64; LANES];
        for (r, &fixed) in self.r.iter_mut().zip(fixed) {
            let free = if fixed { 0.0 } else { -1.0 };
            for lane in 0..LANES {
                r[lane] *= free;
                // Not `max`, which would overlook a NaN.
                largest[lane] += r[lane].abs();
            }
        }
        (energy, largest.map(|largest| largest != 0.0))
    }

    /// p = z = M r; returns r·z.
    fn first_direction(&mut self) -> Lane {
        let (z, mut rz) = self.inverse.apply(&self.r);
        correct(&self.islands, &self.r, z, &mut rz);
        self.p[..z.len()].copy_from_slice(z);
        rz
    }

    /// p = z + β p with z = M r and β the ratio of the new r·z, which is returned, to the old.
    fn next_direction(&mut self, rz: Lane) -> Lane {
        let (z, mut next) = self.inverse.apply(&self.r);
        correct(&self.islands, &self.r, z, &mut next);
        let beta: Lane32 = std::array::from_fn(|lane| match rz[lane] {
            0.0 => 0.0,
            rz => (next[lane] / rz) as f32,
        });
        for (p, z) in self.p.iter_mut().zip(z) {
            for lane in 0..LANES {
                p[lane] = z[lane] + beta[lane] * p[lane];
            }
        }
        next
    }

    /// q = K p and α = (r·z)/(p·q); zero for columns that are done.
    fn step_lengths(
        &mut self,
        matrix: &StiffnessMatrix,
        active: &mut [bool; LANES],
        rz: Lane,
        iteration: usize,
    ) -> Result<Lane, SolveError> {
        let curvature = matrix.apply(&self.p, &mut self.q);
        let mut alpha = [0.0; LANES];
        for (column, active) in active.iter_mut().enumerate().filter(|(_, active)| **active) {
            let (rz, curvature) = (rz[column], curvature[column]);
            if !(rz.is_finite() && curvature.is_finite()) {
                return Err(SolveError::NonFinite { column, iteration });
            }
            if rz == 0.0 {
                *active = false;
            } else if curvature <= 0.0 || rz < 0.0 {
                return Err(SolveError::Indefinite { column, iteration, curvature });
            } else {
                alpha[column] = rz / curvature;
            }
        }
        Ok(alpha)
    }

    /// x += α p, r -= α q on the free rows. On fixed rows p is zero.
    fn advance(&mut self, fixed: &[bool], x: &mut [Lane], alpha: Lane) {
        for ((((x, r), p), q), &fixed) in x.iter_mut().zip(&mut self.r).zip(&self.p).zip(&self.q).zip(fixed) {
            let free = if fixed { 0.0 } else { 1.0 };
            for lane in 0..LANES {
                x[lane] += alpha[lane] * f64::from(p[lane]);
                r[lane] -= free * alpha[lane] * q[lane];
            }
        }
    }
}

/// Largest ratio over the columns of the norm of K x on free rows to that on fixed rows.
fn residual(fixed: &[bool], kx: &[Lane]) -> f64 {
    let (mut of_free, mut of_fixed) = ([0.0; LANES], [0.0; LANES]);
    for (&fixed, kx) in fixed.iter().zip(kx) {
        let held = if fixed { 1.0 } else { 0.0 };
        for lane in 0..LANES {
            let square = kx[lane] * kx[lane];
            of_free[lane] += (1.0 - held) * square;
            of_fixed[lane] += held * square;
        }
    }
    (0..LANES)
        .filter(|&lane| of_fixed[lane] > 0.0)
        .map(|lane| (of_free[lane] / of_fixed[lane]).sqrt())
        .fold(0.0, f64::max)
}

#[derive(Clone, Debug)]
pub(crate) struct CsrSolver {
    columns: usize,
    potentials: Vec<Vec<Lane>>,
    charges: Vec<Vec<Lane>>,
    energies: Vec<f64>,
    pcg: Pcg,
}

impl CsrSolver {
    pub(crate) fn new(columns: usize, rows: usize, preconditioner: Preconditioner) -> Self {
        let vectors = || vec![vec![[0.0; LANES]; rows]; columns.div_ceil(LANES)];
        let pcg = Pcg::new(rows, preconditioner);
        Self { columns, potentials: vectors(), charges: vectors(), energies: vec![0.0; columns * columns], pcg }
    }
    pub(crate) fn potential(&self, column: usize, row: usize) -> f64 {
        self.potentials[column / LANES][row][column % LANES]
    }
    pub(crate) fn set_potential(&mut self, column: usize, row: usize, potential: f64) {
        self.potentials[column / LANES][row][column % LANES] = potential;
    }
    pub(crate) fn refresh(&mut self, matrix: &StiffnessMatrix, fixed: &[bool], changed: &[u32]) {
        self.pcg.refresh(matrix, fixed, changed.iter().copied());
    }
    pub(crate) fn find_islands(&mut self, matrix: &StiffnessMatrix, occupancy: &Occupancy, fixed: &[bool]) {
        self.pcg.find_islands(matrix, occupancy, fixed);
    }
    pub(crate) fn energies(&self) -> &[f64] {
        &self.energies
    }
    pub(crate) fn solve(
        &mut self,
        matrix: &StiffnessMatrix,
        fixed: &[bool],
        options: &SolverOptions,
    ) -> Result<SolveReport, SolveError> {
        let mut worst = SolveReport { iterations: 0, relative_error: 0.0, residual: 0.0 };
        for (x, kx) in self.potentials.iter_mut().zip(&mut self.charges) {
            let report = self.pcg.solve(matrix, fixed, x, kx, options)?;
            worst = SolveReport {
                iterations: worst.iterations.max(report.iterations),
                relative_error: worst.relative_error.max(report.relative_error),
                residual: worst.residual.max(report.residual),
            };
        }
        for s in 0..self.columns {
            for t in 0..self.columns {
                let (a, b) = (&self.potentials[s / LANES], &self.charges[t / LANES]);
                let products = a.iter().zip(b).map(|(a, b)| a[s % LANES] * b[t % LANES]);
                self.energies[s * self.columns + t] = products.sum();
            }
        }
        Ok(worst)
    }
}

fn correct(islands: &Islands, r: &[Lane], z: &mut [Lane32], products: &mut Lane) {
    for lane in 0..LANES {
        products[lane] += islands.correct(
            |node| r[node as usize][lane],
            |node, shift| {
                let before = z[node as usize][lane];
                z[node as usize][lane] = (f64::from(before) + shift) as f32;
                f64::from(z[node as usize][lane]) - f64::from(before)
            },
        );
    }
}
