//! The iteration on small dense matrices: every failure, and what it tells against what is computed from the matrix.

#![allow(clippy::unwrap_used, clippy::panic)]

use super::*;
use crate::solver::operator::State;

/// Fields on a matrix and with a preconditioner that are given entry by entry. Rows of terminals come first: each is at 1 V in
/// its own column, at 0 V in the others.
#[derive(Clone)]
struct Dense {
    k: Vec<Vec<f64>>,
    /// Between free rows.
    m: Vec<Vec<f64>>,
    terminals: usize,
    /// By column; z and p of all rows, zero at terminals.
    x: Vec<Vec<f64>>,
    z: Vec<Vec<f64>>,
    p: Vec<Vec<f64>>,
    gains: Vec<f64>,
    products: [Vec<f64>; 2],
    state: State,
}

fn product(k: &[Vec<f64>], x: &[f64]) -> Vec<f64> {
    k.iter().map(|row| dot(row, x)).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn identity(n: usize) -> Vec<Vec<f64>> {
    (0..n).map(|row| (0..n).map(|column| f64::from(u8::from(row == column))).collect()).collect()
}

impl Dense {
    fn new(k: Vec<Vec<f64>>, m: Vec<Vec<f64>>) -> Self {
        let (rows, terminals) = (k.len(), k.len() - m.len());
        let zeros = vec![vec![0.0; rows]; terminals];
        let mut x = zeros.clone();
        (0..terminals).for_each(|terminal| x[terminal][terminal] = 1.0);
        let mut fields = Self {
            k,
            m,
            terminals,
            x,
            z: zeros.clone(),
            p: zeros,
            gains: vec![0.0; terminals * terminals],
            products: [vec![0.0; terminals], vec![0.0; terminals]],
            state: State::new(terminals),
        };
        fields.evaluate();
        fields
    }

    /// Resistors of 1 between free nodes in a row, with one terminal at each end.
    fn chain(free: usize) -> Self {
        let rows = free + 2;
        let mut k = vec![vec![0.0; rows]; rows];
        // Rows in line: terminal 0, all free ones, terminal 1.
        let line: Vec<usize> = [0].into_iter().chain(2..rows).chain([1]).collect();
        for ends in line.windows(2) {
            for (a, b) in [(ends[0], ends[1]), (ends[1], ends[0])] {
                k[a][a] += 1.0;
                k[a][b] -= 1.0;
            }
        }
        Self::new(k, identity(free))
    }

    /// -K x, zero at terminals.
    fn residual(&self, column: usize) -> Vec<f64> {
        let charges = product(&self.k, &self.x[column]).into_iter().enumerate();
        charges.map(|(row, charge)| if row < self.terminals { 0.0 } else { -charge }).collect()
    }

    fn preconditioned(&self, column: usize) -> Vec<f64> {
        let free = product(&self.m, &self.residual(column)[self.terminals..]);
        std::iter::repeat_n(0.0, self.terminals).chain(free).collect()
    }

    fn energy(&self, column: usize) -> f64 {
        dot(&self.x[column], &product(&self.k, &self.x[column]))
    }

    fn solve(&mut self, options: &SolverOptions) -> Result<SolveReport, SolveError> {
        let rule = ErrorRule::Window;
        let mut demand = Demand::new(self.terminals, &[]);
        ConjugateGradients::new(self.terminals, rule).solve(self, &mut demand, options)
    }
}

impl Operator for Dense {
    fn columns(&self) -> usize {
        self.terminals
    }

    fn state(&self) -> &State {
        &self.state
    }

    fn evaluate(&mut self) {
        for s in 0..self.terminals {
            let (r, kx) = (self.residual(s), product(&self.k, &self.x[s]));
            for t in 0..self.terminals {
                self.state.energies[s * self.terminals + t] = dot(&self.x[t], &kx);
            }
            self.state.along[s] = dot(&r, &self.p[s]);
            self.state.residual[s] = dot(&r, &r);
            self.state.charge[s] = kx[s] * kx[s];
        }
    }

    fn descend(&mut self, _active: &[bool]) {
        for (s, t) in (0..self.terminals).flat_map(|s| (0..self.terminals).map(move |t| (s, t))) {
            self.gains[s * self.terminals + t] = dot(&self.residual(s), &self.preconditioned(t));
        }
    }

    fn gains(&self) -> &[f64] {
        &self.gains
    }

    fn finest_gains(&self) -> &[f64] {
        &self.gains
    }

    fn foretells(&self, _steps: usize) -> bool {
        false
    }

    fn precondition(&mut self, _active: &[bool]) {
        self.z = (0..self.terminals).map(|column| self.preconditioned(column)).collect();
    }

    fn curvatures(&mut self, _active: &[bool]) -> (&[f64], &[f64]) {
        for column in 0..self.terminals {
            let kz = product(&self.k, &self.z[column]);
            self.products[0][column] = dot(&self.z[column], &kz);
            self.products[1][column] = dot(&self.p[column], &kz);
        }
        (&self.products[0], &self.products[1])
    }

    fn step(&mut self, a: &[f64], b: &[f64]) {
        for column in 0..self.terminals {
            for (row, p) in self.p[column].iter_mut().enumerate() {
                *p = a[column] * self.z[column][row] + b[column] * *p;
                self.x[column][row] += *p;
            }
        }
        self.evaluate();
    }
}

fn to(tolerance: f64) -> SolverOptions {
    SolverOptions { tolerance, ..SolverOptions::default() }
}

#[test]
fn a_chain_is_solved() {
    let mut fields = Dense::chain(30);
    let report = fields.solve(&to(1e-10)).unwrap();
    // 31 resistors in series.
    assert!((fields.energy(0) - 1.0 / 31.0).abs() < 1e-12, "{report:?}");
    let [free, held] = [&fields.state.residual, &fields.state.charge].map(|squares| squares[0].sqrt());
    assert_eq!(report.residual.max(free / held), report.residual);
}

/// The error that is told of a solve that was cut short is no less than that of its fields, and not much more, where free nodes
/// leak, so that convergence is even.
#[test]
fn what_is_left_when_there_are_no_more_iterations_is_told() {
    let leaky = || {
        let mut fields = Dense::chain(150);
        (2..152).for_each(|row| fields.k[row][row] += 0.01);
        fields.evaluate();
        fields
    };
    let mut exact = leaky();
    let _ = exact.solve(&to(1e-14)).unwrap();
    for most in [20, 40, 60] {
        let mut fields = leaky();
        let error = fields.solve(&SolverOptions { max_iterations: most, ..to(1e-12) }).unwrap_err();
        let SolveError::NotConverged { iterations, relative_error, tolerance } = error else {
            panic!("{error}")
        };
        assert_eq!((iterations, tolerance), (most, 1e-12));
        let truth = 1.0 - exact.energy(0) / fields.energy(0);
        assert!(
            (truth..=50.0 * truth).contains(&relative_error),
            "{most}: {relative_error:e}, true {truth:e}"
        );
    }
}

#[test]
fn an_indefinite_matrix_is_told_with_the_form_that_shows_it() {
    // Positive at terminals, negative at one of two free nodes.
    let k = vec![vec![2.0, -1.0, -1.0], vec![-1.0, -3.0, 0.5], vec![-1.0, 0.5, 1.0]];
    let mut fields = Dense::new(k, identity(2));
    let r = fields.residual(0);
    let curvature = dot(&r, &product(&fields.k, &r));
    assert!(curvature < 0.0);
    let expected = SolveError::Indefinite { column: 0, iteration: 0, curvature };
    assert_eq!(fields.solve(&to(1e-4)).unwrap_err(), expected);
    assert!(expected.to_string().contains("indefinite"));
}

/// As where its factors were made of an indefinite matrix.
#[test]
fn an_indefinite_preconditioner_is_told_with_what_it_gains() {
    let mut fields = Dense::chain(3);
    fields.m[2][2] = -5.0;
    // Only the second terminal's field meets it at first.
    let curvature = dot(&fields.residual(1), &fields.preconditioned(1));
    assert!(curvature < 0.0);
    let expected = SolveError::Indefinite { column: 1, iteration: 0, curvature };
    assert_eq!(fields.solve(&to(1e-4)).unwrap_err(), expected);
}

/// Steps may be positive while what is held is not.
#[test]
fn a_negative_energy_is_told() {
    let mut fields = Dense::new(vec![vec![-5.0, 1.0], vec![1.0, 1.0]], identity(1));
    let error = fields.solve(&to(1e-4)).unwrap_err();
    assert_eq!(error, SolveError::Indefinite { column: 0, iteration: 0, curvature: -6.0 });
    assert_eq!(fields.energy(0), -6.0);
}

#[test]
fn a_preconditioner_that_gains_nothing_breaks_the_iteration_down() {
    let mut fields = Dense::chain(3);
    fields.m.iter_mut().flatten().for_each(|entry| *entry = 0.0);
    let told = fields.solve(&to(1e-4)).unwrap_err();
    let SolveError::Breakdown { column: 0, iterations: 0, residual, relative_error } = told else {
        panic!("{told}")
    };
    let (r, kx) = (fields.residual(0), product(&fields.k, &fields.x[0]));
    assert_eq!(residual, dot(&r, &r).sqrt() / kx[0].abs());
    assert_eq!(relative_error, 1.0, "nothing is known without a step");
    // In one column alone: only the second terminal's field begins at the last node.
    let mut fields = Dense::chain(3);
    fields.m[2][2] = 0.0;
    let told = fields.solve(&to(1e-4)).unwrap_err();
    assert!(matches!(told, SolveError::Breakdown { column: 1, iterations: 0, .. }), "{told}");
    // Where no residual is left there is nothing to gain.
    let mut solved = Dense::chain(3);
    solved.x = vec![vec![1.0, 0.0, 0.75, 0.5, 0.25], vec![0.0, 1.0, 0.25, 0.5, 0.75]];
    solved.evaluate();
    assert_eq!(solved.solve(&to(1e-4)).unwrap().iterations, 0);
}

/// Sums of residuals that were not told of rows that changed are found out before a solve breaks down.
#[test]
fn residuals_of_before_break_nothing_down() {
    let mut solved = Dense::chain(3);
    solved.x = vec![vec![1.0, 0.0, 0.75, 0.5, 0.25], vec![0.0, 1.0, 0.25, 0.5, 0.75]];
    assert!(solved.state.residual[0] > 0.1, "of zero fields");
    assert_eq!(solved.solve(&to(1e-4)).unwrap().iterations, 0);
    assert_eq!(solved.state.residual[0], 0.0);
}

#[test]
fn what_is_no_number_is_told_with_its_column_and_iteration() {
    // In the fields from the first.
    let mut fields = Dense::chain(3);
    fields.x[1][3] = f64::NAN;
    fields.evaluate();
    let error = fields.solve(&to(1e-4)).unwrap_err();
    assert_eq!(error, SolveError::NonFinite { column: 1, iteration: 0 });
    // In zᵀKz, where K is too large for its square but not for itself.
    let large = 1e200;
    let k = vec![vec![large, -large], vec![-large, large]];
    let error = Dense::new(k, identity(1)).solve(&to(1e-4)).unwrap_err();
    assert_eq!(error, SolveError::NonFinite { column: 0, iteration: 0 });
}
