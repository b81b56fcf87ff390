//! Incomplete Cholesky factorisation without fill-in, IC(0): K ≈ L D Lᵀ with L unit lower triangular on K's own
//! pattern.
//!
//! Meijerink and van der Vorst 1977: for a matrix whose off-diagonal entries are not positive, such as K on a lattice,
//! all pivots are positive. Meshes with obtuse angles have others; a pivot that comes out too small is replaced by the
//! diagonal entry (the guard of Kershaw 1978), so that M = (L D Lᵀ)⁻¹ is symmetric positive definite for every matrix
//! with a positive diagonal.

use nalgebra_sparse::pattern::SparsityPattern;

/// A pivot below this part of its diagonal entry is replaced by that entry.
const SMALLEST_PIVOT: f64 = 1e-3;

/// Why a pattern cannot be factorised.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PatternError {
    /// Rows and columns differ in number.
    #[error("the pattern has {rows} rows and {columns} columns; it must be square")]
    NotSquare {
        /// Number of rows.
        rows: usize,
        /// Number of columns.
        columns: usize,
    },
    /// A diagonal entry is missing.
    #[error("row {0} of the pattern has no diagonal entry")]
    NoDiagonal(usize),
    /// More entries than 32-bit indices can name.
    #[error("the pattern has {0} entries, more than 32-bit indices can name")]
    TooManyEntries(usize),
}

/// The factors L and D of a matrix on a fixed symmetric pattern. The symbolic part is done once, the numbers as often
/// as the matrix changes.
#[derive(Clone, Debug)]
pub struct IncompleteCholesky {
    /// The strictly lower triangle by rows, columns increasing.
    offsets: Vec<u32>,
    columns: Vec<u32>,
    /// Where each of its entries, and each diagonal entry, stands among the values of the whole matrix; the latter only
    /// where that is one list.
    sources: Vec<u32>,
    diagonal_sources: Vec<u32>,
    /// L below its unit diagonal.
    lower: Vec<f64>,
    /// 1/D.
    inverse_pivots: Vec<f64>,
    /// For the row at hand, one more than the entry in each column; zero where it has none.
    place: Vec<u32>,
}

impl IncompleteCholesky {
    /// The symbolic part. Until [`IncompleteCholesky::refactor`] is called, the factors are those of the identity.
    ///
    /// `pattern` is that of the whole symmetric matrix; of its upper triangle nothing is read.
    ///
    /// # Errors
    /// When the pattern is not square, lacks a diagonal entry, or has more entries than 32-bit indices can name.
    pub fn new(pattern: &SparsityPattern) -> Result<Self, PatternError> {
        let (rows, columns) = (pattern.major_dim(), pattern.minor_dim());
        if rows != columns {
            return Err(PatternError::NotSquare { rows, columns });
        }
        if u32::try_from(pattern.nnz()).is_err() {
            return Err(PatternError::TooManyEntries(pattern.nnz()));
        }
        let below = |row| pattern.lane(row).partition_point(|&column| column < row);
        let mut diagonal_sources = Vec::with_capacity(rows);
        for row in 0..rows {
            if pattern.lane(row).get(below(row)) != Some(&row) {
                return Err(PatternError::NoDiagonal(row));
            }
            diagonal_sources.push((pattern.major_offsets()[row] + below(row)) as u32);
        }
        let triangle = (0..rows).map(|row| {
            let columns = pattern.lane(row)[..below(row)].iter().map(|&column| column as u32);
            columns.zip(pattern.major_offsets()[row] as u32..)
        });
        Ok(Self { diagonal_sources, ..Self::of_triangle(triangle) })
    }

    /// The symbolic part from the strictly lower triangle, row by row: the columns in increasing order, and the number
    /// by which [`IncompleteCholesky::factorise`] asks for each value.
    pub(crate) fn of_triangle(triangle: impl Iterator<Item: IntoIterator<Item = (u32, u32)>>) -> Self {
        let (mut offsets, mut columns, mut sources) = (vec![0], Vec::new(), Vec::new());
        for entries in triangle {
            for (column, source) in entries {
                columns.push(column);
                sources.push(source);
            }
            offsets.push(columns.len() as u32);
        }
        let rows = offsets.len() - 1;
        Self {
            lower: vec![0.0; columns.len()],
            offsets,
            columns,
            sources,
            diagonal_sources: Vec::new(),
            inverse_pivots: vec![1.0; rows],
            place: vec![0; rows],
        }
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.inverse_pivots.len()
    }

    /// Factorises anew. `values` are those of the whole matrix in the order of the pattern; rows and columns that are
    /// `fixed` count as those of the identity. Returns how many pivots were replaced.
    ///
    /// # Panics
    /// When there are fewer values than the pattern has entries, or another number of `fixed` than rows.
    pub fn refactor(&mut self, values: &[f64], fixed: &[bool]) -> usize {
        let diagonal: Vec<f64> =
            self.diagonal_sources.iter().map(|&source| values[source as usize]).collect();
        self.factorise(&diagonal, |source| values[source], fixed)
    }

    /// Factorises anew from the diagonal and the values below it by their numbers. Returns how many pivots were
    /// replaced.
    ///
    /// Row i of the factors, from the rows k < i before it:
    /// u_ik = a_ik - Σ_{j<k} u_ij l_kj, l_ik = u_ik / d_k, d_i = a_ii - Σ_k u_ik l_ik.
    pub(crate) fn factorise(
        &mut self,
        diagonal: &[f64],
        below: impl Fn(usize) -> f64,
        fixed: &[bool],
    ) -> usize {
        assert_eq!(fixed.len(), self.rows(), "one flag for each row");
        let mut replaced = 0;
        for row in 0..fixed.len() {
            let entries = self.entries(row);
            if fixed[row] {
                self.lower[entries].fill(0.0);
                self.inverse_pivots[row] = 1.0;
                continue;
            }
            for entry in entries.clone() {
                let free = !fixed[self.columns[entry] as usize];
                self.lower[entry] = if free { below(self.sources[entry] as usize) } else { 0.0 };
            }
            let mut pivot = diagonal[row] - self.eliminate(entries);
            if pivot <= SMALLEST_PIVOT * diagonal[row] {
                pivot = diagonal[row];
                replaced += 1;
            }
            self.inverse_pivots[row] = 1.0 / pivot;
        }
        replaced
    }

    /// Turns the entries a_ik of one row into l_ik and returns Σ_k u_ik l_ik.
    fn eliminate(&mut self, entries: std::ops::Range<usize>) -> f64 {
        for entry in entries.clone() {
            self.place[self.columns[entry] as usize] = entry as u32 + 1;
        }
        for entry in entries.clone() {
            let mut u = self.lower[entry];
            for other in self.entries(self.columns[entry] as usize) {
                if let Some(shared) = self.place[self.columns[other] as usize].checked_sub(1) {
                    u -= self.lower[shared as usize] * self.lower[other];
                }
            }
            self.lower[entry] = u;
        }
        let mut sum = 0.0;
        for entry in entries {
            let column = self.columns[entry] as usize;
            self.place[column] = 0;
            let u = self.lower[entry];
            self.lower[entry] = u * self.inverse_pivots[column];
            sum += u * self.lower[entry];
        }
        sum
    }

    fn entries(&self, row: usize) -> std::ops::Range<usize> {
        self.offsets[row] as usize..self.offsets[row + 1] as usize
    }

    /// z = (L D Lᵀ)⁻¹ r for `COLUMNS` interleaved columns. On fixed rows z = r.
    ///
    /// # Panics
    /// When r or z do not have one row for each of the matrix.
    pub fn solve<const COLUMNS: usize>(&self, r: &[[f64; COLUMNS]], z: &mut [[f64; COLUMNS]]) {
        assert!(
            r.len() == self.rows() && z.len() == self.rows(),
            "one row of r and z for each of the matrix"
        );
        for row in 0..r.len() {
            let mut sum = r[row];
            let entries = self.entries(row);
            for (&column, &l) in self.columns[entries.clone()].iter().zip(&self.lower[entries]) {
                let before = &z[column as usize];
                for lane in 0..COLUMNS {
                    sum[lane] -= l * before[lane];
                }
            }
            z[row] = sum;
        }
        // Lᵀ by columns. The rows after the one at hand have already taken their share from it.
        for (z, inverse_pivot) in z.iter_mut().zip(&self.inverse_pivots) {
            *z = z.map(|z| z * inverse_pivot);
        }
        for row in (0..r.len()).rev() {
            let here = z[row];
            let entries = self.entries(row);
            for (&column, &l) in self.columns[entries.clone()].iter().zip(&self.lower[entries]) {
                let before = &mut z[column as usize];
                for lane in 0..COLUMNS {
                    before[lane] -= l * here[lane];
                }
            }
        }
    }
}
