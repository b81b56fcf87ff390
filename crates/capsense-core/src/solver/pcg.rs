//! Preconditioned conjugate gradients for several terminals at once.
//!
//! The columns share every pass over the matrix and keep their own step lengths. Each iteration lowers the energy
//! φᵀKφ of a column by α (r·z), Hestenes and Stiefel 1952, and the energy is that terminal's self-capacitance: the
//! drops still to come are its error. The sum of the last few drops estimates the error before them, so it is an upper
//! estimate of the error now as long as that many iterations halve the error (Strakoš and Tichý 2002).

use super::{SolveError, SolveReport, SolverOptions, preconditioner};
use crate::stiffness::{LANES, Lane, StiffnessMatrix};

/// How many energy drops are summed up to estimate the error.
const WINDOW: usize = 12;

/// Working storage of the iteration, sized once.
#[derive(Clone, Debug)]
pub struct Pcg {
    factors: Vec<f64>,
    r: Vec<Lane>,
    z: Vec<Lane>,
    p: Vec<Lane>,
    q: Vec<Lane>,
}

/// What is known of each column.
struct Columns {
    energy: Lane,
    drops: [Lane; WINDOW],
    active: [bool; LANES],
}

impl Columns {
    fn error(&self, lane: usize) -> f64 {
        if self.energy[lane] > 0.0 {
            self.drops.iter().map(|drop| drop[lane]).sum::<f64>() / self.energy[lane]
        } else {
            0.0
        }
    }

    fn worst_error(&self) -> f64 {
        (0..LANES).map(|lane| self.error(lane)).fold(0.0, f64::max)
    }
}

impl Pcg {
    /// Storage for a matrix with so many rows.
    pub fn new(rows: usize) -> Self {
        let zeros = vec![[0.0; LANES]; rows];
        Self { factors: vec![0.0; rows], r: zeros.clone(), z: zeros.clone(), p: zeros.clone(), q: zeros }
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
        options.preconditioner.row_factors(matrix, fixed, &mut self.factors);
        let mut columns = self.start(matrix, fixed, x);
        let mut rz = preconditioner::apply(&self.factors, &self.r, &mut self.z);
        self.p.copy_from_slice(&self.z);
        let mut iterations = 0;
        while columns.active.contains(&true) {
            if iterations == options.max_iterations {
                return Err(SolveError::NotConverged {
                    iterations,
                    relative_error: columns.worst_error(),
                    tolerance: options.tolerance,
                });
            }
            let alpha = self.step_lengths(matrix, &mut columns, rz, iterations)?;
            self.advance(x, alpha);
            let next = preconditioner::apply(&self.factors, &self.r, &mut self.z);
            for lane in 0..LANES {
                let drop = alpha[lane] * rz[lane];
                columns.energy[lane] -= drop;
                columns.drops[iterations % WINDOW][lane] = drop;
                let settled = iterations + 1 >= WINDOW && columns.error(lane) <= options.tolerance;
                if settled || next[lane] == 0.0 {
                    columns.active[lane] = false;
                }
            }
            self.turn(next, rz);
            rz = next;
            iterations += 1;
        }
        matrix.apply(x, kx);
        Ok(SolveReport { iterations, relative_error: columns.worst_error(), residual: residual(fixed, kx) })
    }

    /// Residual and energy of the initial guess.
    fn start(&mut self, matrix: &StiffnessMatrix, fixed: &[bool], x: &[Lane]) -> Columns {
        matrix.apply(x, &mut self.q);
        let mut columns =
            Columns { energy: [0.0; LANES], drops: [[0.0; LANES]; WINDOW], active: [false; LANES] };
        for (row, r) in self.r.iter_mut().enumerate() {
            for lane in 0..LANES {
                columns.energy[lane] += x[row][lane] * self.q[row][lane];
                r[lane] = if fixed[row] { 0.0 } else { -self.q[row][lane] };
                columns.active[lane] |= r[lane] != 0.0;
            }
        }
        columns
    }

    /// q = K p and α = (r·z)/(p·q); zero for columns that are done.
    fn step_lengths(
        &mut self,
        matrix: &StiffnessMatrix,
        columns: &mut Columns,
        rz: Lane,
        iteration: usize,
    ) -> Result<Lane, SolveError> {
        matrix.apply(&self.p, &mut self.q);
        let mut curvature = [0.0; LANES];
        for (p, q) in self.p.iter().zip(&self.q) {
            for lane in 0..LANES {
                curvature[lane] += p[lane] * q[lane];
            }
        }
        let mut alpha = [0.0; LANES];
        for lane in 0..LANES {
            if !columns.active[lane] {
                continue;
            }
            let (rz, curvature) = (rz[lane], curvature[lane]);
            if !(rz.is_finite() && curvature.is_finite()) {
                return Err(SolveError::NonFinite { column: lane, iteration });
            }
            if rz == 0.0 {
                columns.active[lane] = false;
            } else if curvature <= 0.0 || rz < 0.0 {
                return Err(SolveError::Indefinite { column: lane, iteration, curvature });
            } else {
                alpha[lane] = rz / curvature;
            }
        }
        Ok(alpha)
    }

    /// x += α p, r -= α q on the free rows.
    fn advance(&mut self, x: &mut [Lane], alpha: Lane) {
        for (row, x) in x.iter_mut().enumerate() {
            // Zero on fixed rows, where p is zero too.
            let free = if self.factors[row] == 0.0 { 0.0 } else { 1.0 };
            for lane in 0..LANES {
                x[lane] += alpha[lane] * self.p[row][lane];
                self.r[row][lane] -= free * alpha[lane] * self.q[row][lane];
            }
        }
    }

    /// p = z + β p with β the ratio of the new r·z to the old.
    fn turn(&mut self, next: Lane, rz: Lane) {
        let mut beta = [0.0; LANES];
        for lane in 0..LANES {
            if rz[lane] != 0.0 {
                beta[lane] = next[lane] / rz[lane];
            }
        }
        for (p, z) in self.p.iter_mut().zip(&self.z) {
            for lane in 0..LANES {
                p[lane] = z[lane] + beta[lane] * p[lane];
            }
        }
    }
}

/// Largest ratio over the columns of the norm of K x on free rows to that on fixed rows.
fn residual(fixed: &[bool], kx: &[Lane]) -> f64 {
    let mut squares = [[0.0; LANES]; 2];
    for (&fixed, kx) in fixed.iter().zip(kx) {
        for lane in 0..LANES {
            squares[usize::from(fixed)][lane] += kx[lane] * kx[lane];
        }
    }
    (0..LANES)
        .filter(|&lane| squares[1][lane] > 0.0)
        .map(|lane| (squares[0][lane] / squares[1][lane]).sqrt())
        .fold(0.0, f64::max)
}
