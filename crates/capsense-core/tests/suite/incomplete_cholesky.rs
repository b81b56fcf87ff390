//! The incomplete Cholesky factorisation against what it must equal and what it must satisfy.

use capsense_core::solver::{IncompleteCholesky, PatternError};
use nalgebra_sparse::pattern::SparsityPattern;
use nalgebra_sparse::{CooMatrix, CsrMatrix};
use proptest::prelude::*;

fn matrix(rows: usize, entries: impl IntoIterator<Item = (usize, usize, f64)>) -> CsrMatrix<f64> {
    let mut triplets = CooMatrix::new(rows, rows);
    for (row, column, value) in entries {
        triplets.push(row, column, value);
        if row != column {
            triplets.push(column, row, value);
        }
    }
    CsrMatrix::from(&triplets)
}

fn factorised(matrix: &CsrMatrix<f64>, fixed: &[bool]) -> (IncompleteCholesky, usize) {
    let mut factors = IncompleteCholesky::new(matrix.pattern()).unwrap();
    let replaced = factors.refactor(matrix.values(), fixed);
    (factors, replaced)
}

/// M as columns, from the unit vectors, four at a time.
fn dense_inverse(factors: &IncompleteCholesky) -> Vec<Vec<f64>> {
    let rows = factors.rows();
    let mut columns = Vec::new();
    for first in (0..rows).step_by(4) {
        let mut unit = vec![[0.0; 4]; rows];
        (first..rows.min(first + 4)).for_each(|column| unit[column][column - first] = 1.0);
        let mut z = vec![[f64::NAN; 4]; rows];
        factors.solve(&unit, &mut z);
        columns
            .extend((first..rows.min(first + 4)).map(|column| z.iter().map(|z| z[column - first]).collect()));
    }
    columns
}

fn tridiagonal(rows: usize) -> CsrMatrix<f64> {
    let diagonal = (0..rows).map(|row| (row, row, 2.5 + row as f64));
    let beside = (1..rows).map(|row| (row, row - 1, -1.0 - 0.1 * row as f64));
    matrix(rows, diagonal.chain(beside))
}

#[test]
fn a_tridiagonal_matrix_is_inverted_exactly() {
    let k = tridiagonal(9);
    let (factors, replaced) = factorised(&k, &[false; 9]);
    assert_eq!(replaced, 0);
    for (column, z) in dense_inverse(&factors).into_iter().enumerate() {
        for (row, entries) in k.row_iter().enumerate() {
            let product: f64 =
                entries.col_indices().iter().zip(entries.values()).map(|(&c, v)| v * z[c]).sum();
            let expected = if row == column { 1.0 } else { 0.0 };
            assert!((product - expected).abs() < 1e-14, "{row} {column}: {product}");
        }
    }
}

#[test]
fn fixed_rows_are_those_of_the_identity() {
    let k = tridiagonal(7);
    let fixed = [true, false, false, true, false, false, true];
    let (factors, _) = factorised(&k, &fixed);
    let inverse = dense_inverse(&factors);
    let of_two = |row: usize| {
        let [a, b, c] = [(row, row), (row, row + 1), (row + 1, row + 1)]
            .map(|(row, column)| k.get_entry(row, column).unwrap().into_value());
        let determinant = a * c - b * b;
        [(row, row, c / determinant), (row, row + 1, -b / determinant), (row + 1, row + 1, a / determinant)]
    };
    let expected =
        matrix(7, [0, 3, 6].map(|row| (row, row, 1.0)).into_iter().chain(of_two(1)).chain(of_two(4)));
    for (column, z) in inverse.iter().enumerate() {
        for (row, &value) in z.iter().enumerate() {
            let expected = expected.get_entry(row, column).map_or(0.0, |entry| entry.into_value());
            assert!((value - expected).abs() < 1e-14, "{row} {column}: {value} {expected}");
        }
    }
}

/// The product L D Lᵀ, which is M⁻¹, has K's entries on K's pattern.
#[test]
fn the_product_of_the_factors_equals_the_matrix_on_its_pattern() {
    let k = square_grid(6, |_| 1.0);
    let (factors, replaced) = factorised(&k, &[false; 36]);
    assert_eq!(replaced, 0);
    let inverse = dense_inverse(&factors);
    let product = invert(inverse);
    for (row, entries) in k.row_iter().enumerate() {
        for (&column, &value) in entries.col_indices().iter().zip(entries.values()) {
            assert!((product[row][column] - value).abs() < 1e-12, "{row} {column}: {}", product[row][column]);
        }
    }
    assert!(product[7][2].abs() > 0.01, "what is dropped is fill beside the pattern: {}", product[7][2]);
}

/// Five-point Laplacian, fixed outside, with weights by edge.
fn square_grid(side: usize, weight: impl Fn(usize) -> f64) -> CsrMatrix<f64> {
    let mut entries: Vec<_> = (0..side * side).map(|row| (row, row, 0.5)).collect();
    for row in 0..side * side {
        for (step, exists) in [(1, row % side + 1 < side), (side, row / side + 1 < side)] {
            if exists {
                let weight = weight(entries.len());
                entries.extend([
                    (row + step, row, -weight),
                    (row, row, weight),
                    (row + step, row + step, weight),
                ]);
            }
        }
    }
    matrix(side * side, entries)
}

/// Gauss-Jordan elimination; positive definite matrices need no pivoting.
fn invert(mut a: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let rows = a.len();
    for (row, values) in a.iter_mut().enumerate() {
        values.extend((0..rows).map(|column| f64::from(u8::from(row == column))));
    }
    for pivot in 0..rows {
        let scale = 1.0 / a[pivot][pivot];
        a[pivot].iter_mut().for_each(|value| *value *= scale);
        let source = a[pivot].clone();
        for (_, values) in a.iter_mut().enumerate().filter(|(row, _)| *row != pivot) {
            let factor = values[pivot];
            values.iter_mut().zip(&source).for_each(|(value, source)| *value -= factor * source);
        }
    }
    a.into_iter().map(|mut values| values.split_off(rows)).collect()
}

#[test]
fn small_pivots_are_replaced() {
    // Without the guard the last pivot is 1 - 0.9² - 0.9² < 0.
    let k = matrix(3, [(0, 0, 1.0), (1, 1, 1.0), (2, 2, 1.0), (2, 0, 0.9), (2, 1, 0.9)]);
    let (factors, replaced) = factorised(&k, &[false; 3]);
    assert_eq!(replaced, 1);
    assert_positive_definite(&factors);
}

fn assert_positive_definite(factors: &IncompleteCholesky) {
    let inverse = dense_inverse(factors);
    let mut reduced = inverse.clone();
    for (row, values) in inverse.iter().enumerate() {
        for (column, &value) in values.iter().enumerate() {
            let mirrored = inverse[column][row];
            assert!((value - mirrored).abs() <= 1e-12 * (1.0 + value.abs()), "{value} {mirrored}");
        }
    }
    for pivot in 0..reduced.len() {
        assert!(reduced[pivot][pivot] > 0.0, "pivot {pivot} is {}", reduced[pivot][pivot]);
        let (above, below) = reduced.split_at_mut(pivot + 1);
        let source = &above[pivot];
        for values in below {
            let factor = values[pivot] / source[pivot];
            values.iter_mut().zip(source).for_each(|(value, source)| *value -= factor * source);
        }
    }
}

#[test]
fn unusable_patterns_are_refused() {
    let pattern = |rows, columns, offsets, indices| {
        SparsityPattern::try_from_offsets_and_indices(rows, columns, offsets, indices).unwrap()
    };
    let wide = pattern(1, 2, vec![0, 1], vec![0]);
    assert_eq!(IncompleteCholesky::new(&wide).unwrap_err(), PatternError::NotSquare { rows: 1, columns: 2 });
    let hollow = pattern(2, 2, vec![0, 2, 3], vec![0, 1, 0]);
    assert_eq!(IncompleteCholesky::new(&hollow).unwrap_err(), PatternError::NoDiagonal(1));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Weights of any size, some negative as on obtuse meshes.
    #[test]
    fn the_approximate_inverse_is_symmetric_and_positive_definite(
        weights in prop::collection::vec(-0.3..1.0_f64, 40),
        scale in 0.0..4.0_f64,
        fixed in prop::collection::vec(prop::bool::weighted(0.2), 16),
    ) {
        let k = square_grid(4, |edge| {
            let weight = weights[edge % weights.len()];
            if edge % 3 == 0 && weight > 0.0 { weight * 10_f64.powf(scale) } else { weight.max(-0.1) }
        });
        assert_positive_definite(&factorised(&k, &fixed).0);
    }
}
