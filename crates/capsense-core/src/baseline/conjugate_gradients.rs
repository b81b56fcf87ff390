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

#[cfg(test)]
mod tests {
    use super::*;

    const OPTIONS: CgOptions = CgOptions { relative_residual: 1e-6, max_iterations: 100 };

    /// -1 on both sides of a diagonal that grows from `first`.
    fn chain(rows: u32, first: f64) -> CompressedRows {
        let (mut offsets, mut columns, mut values) = (vec![0], Vec::new(), Vec::new());
        for row in 0..rows {
            let beside = [row.wrapping_sub(1), row, row + 1];
            columns.extend(beside.iter().filter(|&&column| column < rows));
            values.extend(beside.iter().filter(|&&column| column < rows).map(|&column| {
                match column == row {
                    true => first + f64::from(row),
                    false => -1.0,
                }
            }));
            offsets.push(columns.len() as u32);
        }
        CompressedRows { offsets, columns, values }
    }

    fn solve(matrix: &CompressedRows, b: &[f64], options: &CgOptions) -> Result<Vec<f64>, BaselineError> {
        let mut cg = ConjugateGradients { r: b.to_vec(), ..ConjugateGradients::default() };
        let mut x = vec![0.0; b.len()];
        cg.solve(1, matrix, |r, z| z.copy_from_slice(r), &mut x, dot(b, b).sqrt(), options)?;
        Ok(x)
    }

    fn recomputed_residual(matrix: &CompressedRows, b: &[f64], x: &[f64]) -> f64 {
        let mut r = vec![0.0; b.len()];
        matrix.apply(x, &mut r);
        r.iter_mut().zip(b).for_each(|(r, b)| *r = b - *r);
        (dot(&r, &r) / dot(b, b)).sqrt()
    }

    #[test]
    fn the_residual_asked_for_is_reached() {
        let (matrix, b) = (chain(37, 2.1), [1.0; 37]);
        let x = solve(&matrix, &b, &OPTIONS).unwrap();
        assert!(recomputed_residual(&matrix, &b, &x) < 1.01e-6);
    }

    #[test]
    fn the_residual_reported_is_the_one_recomputed() {
        let (matrix, b) = (chain(37, 2.1), [1.0; 37]);
        let mut cg = ConjugateGradients { r: b.to_vec(), ..ConjugateGradients::default() };
        let mut x = vec![0.0; b.len()];
        let few = CgOptions { max_iterations: 4, ..OPTIONS };
        let result = cg.solve(1, &matrix, |r, z| z.copy_from_slice(r), &mut x, dot(&b, &b).sqrt(), &few);
        let Err(BaselineError::NotConverged { column: 1, iterations: 4, residual }) = result else {
            panic!("{result:?}");
        };
        assert!((residual / recomputed_residual(&matrix, &b, &x) - 1.0).abs() < 1e-9, "{residual}");
    }

    #[test]
    fn breakdowns_are_told() {
        let indefinite = solve(&chain(5, -3.0), &[1.0, 0.0, 0.0, 0.0, 0.0], &OPTIONS);
        let Err(BaselineError::Indefinite { column: 1, iteration: 0, curvature }) = indefinite else {
            panic!("{indefinite:?}");
        };
        assert_eq!(curvature, -3.0);
        let infinite = solve(&chain(5, f64::INFINITY), &[1.0; 5], &OPTIONS);
        assert_eq!(infinite, Err(BaselineError::NonFinite { column: 1, iteration: 0 }));
    }
}
