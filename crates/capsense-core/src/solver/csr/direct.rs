//! The exact inverse: a sparse Cholesky factorisation of all of K on the free rows.
//!
//! Fixed rows stay in the matrix as rows of the identity, so that its pattern never changes and is analysed once.

use super::rows::Rows;
use faer::sparse::linalg::LltError;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::sparse::{FaerError, SparseColMatRef, SymbolicSparseColMat};
use faer::{Mat, Side, linalg::solvers::Solve};

/// The lower half of K by columns, and its factors.
#[derive(Clone, Debug)]
pub(super) struct Direct {
    pattern: SymbolicSparseColMat<u32>,
    /// Which entry of the rows each value is; [`DIAGONAL`] on the diagonal.
    sources: Vec<u32>,
    values: Vec<f64>,
    symbolic: Result<SymbolicLlt<u32>, FaerError>,
    /// None where K is not positive definite, or the factorisation is too large.
    factors: Option<Llt<u32, f64>>,
    failure: Option<FaerError>,
}

/// No entry, but the diagonal.
const DIAGONAL: u32 = u32::MAX;

impl Direct {
    pub(super) fn new(rows: &Rows) -> Self {
        let nodes = rows.len();
        let (mut offsets, mut numbers, mut sources) = (vec![0], Vec::new(), Vec::new());
        let mut higher = Vec::new();
        for column in 0..nodes {
            numbers.push(column as u32);
            sources.push(DIAGONAL);
            higher.clear();
            let entries = rows.entries(column).zip(rows.row(column).0);
            higher.extend(
                entries.filter(|&(_, &row)| row as usize > column).map(|(entry, &row)| (row, entry as u32)),
            );
            higher.sort_unstable();
            numbers.extend(higher.iter().map(|&(row, _)| row));
            sources.extend(higher.iter().map(|&(_, entry)| entry));
            offsets.push(numbers.len() as u32);
        }
        let pattern = SymbolicSparseColMat::new_checked(nodes, nodes, offsets, None, numbers);
        let symbolic = SymbolicLlt::try_new(pattern.as_ref(), Side::Lower);
        Self { values: vec![0.0; sources.len()], pattern, sources, symbolic, factors: None, failure: None }
    }

    /// Factorises anew where anything changed.
    pub(super) fn refresh(&mut self, rows: &Rows) {
        if !rows.changed().is_empty() {
            self.factorise(rows);
        }
    }

    fn factorise(&mut self, rows: &Rows) {
        let fixed = rows.fixed();
        let mut entry = 0;
        for column in 0..rows.len() {
            for &row in self.pattern.row_idx_of_col_raw(column) {
                let coupled = !fixed[column] && !fixed[row as usize];
                self.values[entry] = match self.sources[entry] {
                    DIAGONAL if fixed[column] => 1.0,
                    DIAGONAL => rows.diagonal()[column],
                    source if coupled => -rows.weight(source as usize),
                    _ => 0.0,
                };
                entry += 1;
            }
        }
        let matrix = SparseColMatRef::new(self.pattern.as_ref(), self.values.as_slice());
        let symbolic = self.symbolic.clone().map_err(LltError::Generic);
        let factors = symbolic.and_then(|symbolic| Llt::try_new_with_symbolic(symbolic, matrix, Side::Lower));
        self.failure = match &factors {
            Err(LltError::Generic(failure)) => Some(*failure),
            Ok(_) | Err(LltError::Numeric(_)) => None,
        };
        self.factors = factors.ok();
    }

    /// As if there were no memory.
    #[cfg(test)]
    pub(super) fn run_out_of_memory(&mut self, rows: &Rows) {
        self.symbolic = Err(FaerError::OutOfMemory);
        self.factorise(rows);
    }

    /// Why there are no factors, if it is not K itself.
    pub(super) fn failure(&self) -> Option<&'static str> {
        self.failure.map(|failure| match failure {
            FaerError::IndexOverflow => "its factors have too many entries",
            FaerError::OutOfMemory => "there is not enough memory for its factors",
            _ => "its factors could not be made",
        })
    }

    /// z = K⁻¹ (-kx), zero on fixed rows, and the columns' zᵀ(-kx). Without factors z is kx, which the
    /// iteration knows by the negative products.
    pub(super) fn apply<const L: usize>(&self, rows: &Rows, kx: &[[f64; L]], z: &mut [[f64; L]]) -> [f64; L] {
        let fixed = rows.fixed();
        let mut solution =
            Mat::from_fn(rows.len(), L, |row, lane| if fixed[row] { 0.0 } else { -kx[row][lane] });
        match &self.factors {
            Some(factors) => factors.solve_in_place(&mut solution),
            None => solution *= faer::Scale(-1.0),
        }
        let mut products = [0.0; L];
        for (row, z) in z.iter_mut().enumerate() {
            *z = std::array::from_fn(|lane| solution[(row, lane)]);
            for lane in 0..L {
                products[lane] -= kx[row][lane] * z[lane];
            }
        }
        products
    }

    /// K⁻¹ between some free rows, by columns; `None` where K is not positive definite.
    pub(super) fn inverse(&self, some: &[usize]) -> Option<Vec<f64>> {
        /// Columns that are solved for together.
        const WIDTH: usize = 64;
        let factors = self.factors.as_ref()?;
        let mut inverse = Vec::with_capacity(some.len() * some.len());
        for columns in some.chunks(WIDTH) {
            let mut solution = Mat::zeros(self.pattern.nrows(), columns.len());
            columns.iter().enumerate().for_each(|(column, &row)| solution[(row, column)] = 1.0);
            factors.solve_in_place(&mut solution);
            for column in 0..columns.len() {
                inverse.extend(some.iter().map(|&row| solution[(row, column)]));
            }
        }
        Some(inverse)
    }
}
