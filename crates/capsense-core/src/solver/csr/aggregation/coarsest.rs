//! The coarsest level, solved exactly.

use super::level::{Level, Vectors};

/// A level with more rows, left by a mesh that forms no aggregates, is smoothed only.
const MOST_ROWS: usize = 400;

/// The Cholesky factor L D Lᵀ of a level's matrix, dense: D below its diagonal inverted.
#[derive(Clone, Debug, Default)]
pub(super) struct Coarsest {
    rows: usize,
    /// Row by row; on the diagonal the inverse pivots, zero where a row is no unknown.
    factor: Vec<f64>,
}

impl Coarsest {
    pub(super) fn refresh(&mut self, level: &Level) {
        let n = if level.rows() <= MOST_ROWS { level.rows() } else { 0 };
        self.rows = n;
        self.factor.clear();
        self.factor.resize(n * n, 0.0);
        for row in 0..n {
            self.factor[row * n + row] += f64::from(level.leak[row]);
            for entry in level.pattern.entries(row) {
                let weight = f64::from(level.weights[entry]);
                self.factor[row * n + level.pattern.columns()[entry] as usize] -= weight;
                self.factor[row * n + row] += weight;
            }
        }
        self.factorise();
    }

    fn factorise(&mut self) {
        let n = self.rows;
        for pivot in 0..n {
            let diagonal = self.factor[pivot * n + pivot];
            let inverse = if diagonal > 0.0 { 1.0 / diagonal } else { 0.0 };
            for row in pivot + 1..n {
                let scaled = self.factor[row * n + pivot] * inverse;
                for column in pivot + 1..=row {
                    self.factor[row * n + column] -= scaled * self.factor[column * n + pivot];
                }
            }
            (pivot + 1..n).for_each(|row| self.factor[row * n + pivot] *= inverse);
            self.factor[pivot * n + pivot] = inverse;
        }
    }

    /// Whether the level is small enough.
    pub(super) fn is_exact(&self) -> bool {
        self.rows > 0
    }

    /// The solution x of K x = b; returns whether there was one.
    pub(super) fn solve<const L: usize>(&self, vectors: &mut Vectors<L>) -> bool {
        let n = self.rows;
        let Vectors { b, x, .. } = vectors;
        for row in 0..n {
            x[row] = b[row];
            for other in 0..row {
                let factor = self.factor[row * n + other] as f32;
                x[row] = std::array::from_fn(|lane| x[row][lane] - factor * x[other][lane]);
            }
        }
        for row in (0..n).rev() {
            x[row] = x[row].map(|x| x * self.factor[row * n + row] as f32);
            for other in row + 1..n {
                let factor = self.factor[other * n + row] as f32;
                x[row] = std::array::from_fn(|lane| x[row][lane] - factor * x[other][lane]);
            }
        }
        self.is_exact()
    }
}
