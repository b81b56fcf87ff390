//! Conjugate gradients for one column, Hestenes and Stiefel 1952, with or without a preconditioner.

use super::compressed_rows::CompressedRows;
use super::{BaselineError, CgOptions};

/// The working storage of the iteration.
#[derive(Clone, Debug, Default)]
pub(super) struct ConjugateGradients {
    /// The residual; set by the caller to that of the first guess.
    pub(super) r: Vec<f64>,
    p: Vec<f64>,
    q: Vec<f64>,
    z: Vec<f64>,
}

impl ConjugateGradients {
    /// Improves x, whose residual b - A x is `self.r`, until |r| is at most `options.relative_residual` times `scale`,
    /// the norm of b. `precondition` sets z = M r. Returns the number of iterations.
    ///
    /// # Errors
    /// When the residual is not reached, A or M shows that it is not positive definite, or a value is not finite.
    pub(super) fn solve(
        &mut self,
        column: usize,
        matrix: &CompressedRows,
        mut precondition: impl FnMut(&[f64], &mut [f64]),
        x: &mut [f64],
        scale: f64,
        options: &CgOptions,
    ) -> Result<usize, BaselineError> {
        let Self { r, p, q, z } = self;
        let rows = r.len();
        for storage in [&mut *p, &mut *q, &mut *z] {
            storage.clear();
            storage.resize(rows, 0.0);
        }
        let enough = options.relative_residual * scale;
        // z·r of the iteration before; none before the first.
        let mut zr_before = None;
        let mut iteration = 0;
        loop {
            let norm = dot(r, r).sqrt();
            if !norm.is_finite() {
                return Err(BaselineError::NonFinite { column, iteration });
            }
            if norm <= enough {
                return Ok(iteration);
            }
            if iteration == options.max_iterations {
                let residual = norm / scale;
                return Err(BaselineError::NotConverged { column, iterations: iteration, residual });
            }
            // p = z + β p, q = A p, α = z·r / p·q.
            precondition(r, z);
            let zr = dot(z, r);
            let beta = zr_before.map_or(0.0, |before| zr / before);
            p.iter_mut().zip(&*z).for_each(|(p, z)| *p = z + beta * *p);
            let curvature = matrix.apply(p, q);
            if !(zr.is_finite() && curvature.is_finite()) {
                return Err(BaselineError::NonFinite { column, iteration });
            }
            if curvature <= 0.0 || zr <= 0.0 {
                return Err(BaselineError::Indefinite { column, iteration, curvature });
            }
            let alpha = zr / curvature;
            x.iter_mut().zip(&*p).for_each(|(x, p)| *x += alpha * p);
            r.iter_mut().zip(&*q).for_each(|(r, q)| *r -= alpha * q);
            zr_before = Some(zr);
            iteration += 1;
        }
    }
}

/// aᵀb, in eight sums that advance together.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<8>(), b.as_chunks::<8>());
    let mut sums = [0.0; 8];
    for (a, b) in a.iter().zip(b) {
        for lane in 0..8 {
            sums[lane] += a[lane] * b[lane];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f64>() + rest
}
