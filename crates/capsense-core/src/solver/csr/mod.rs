//! The operator of any mesh, in compressed rows, with its approximate inverses.
//!
//! Everything is kept in an order of the solver's own, fields and residuals in double, directions and inverses in single
//! precision. Columns lie side by side in groups, so that what is read of K serves all of a group.
//!
//! A factorisation does not win on small meshes: at 10 000 tetrahedra a frame of [`Preconditioner::Cholesky`] takes 25
//! times, at 30 000 50 times as long as one iteration with aggregation multigrid, which leaves an error of 1e-6 and
//! 5e-6; most of it is the factorisation, whatever the number of columns. What does win there is [`super::green`], which
//! factorises no more than what bodies change.

mod aggregation;
mod change;
mod columns;
mod direct;
mod increment;
mod inverse;
mod ordering;
mod pattern;
mod relaxation;
mod rows;
mod stale;
#[cfg(test)]
mod tests;

use super::Preconditioner;
use super::islands::Islands;
use super::operator::{Operator, State};
use crate::occupancy::Occupancy;
use crate::stiffness::StiffnessMatrix;
use crate::workers::Workers;
use change::Charges;
use columns::{Along, Columns, Sums, add_products};
use increment::Increment;
use inverse::{Approximate, Inverse, Preconditioned, Told};
use rows::Rows;
use stale::Stale;

/// Above this part of the rows, recomputing all of K x costs less than finding the rows that changed.
const MANY: usize = 4;

/// Fields of several terminals with K and an approximate inverse of it.
///
/// Nodes are numbered as in the mesh, whatever the order inside.
#[derive(Clone, Debug)]
pub(crate) enum CsrSolver {
    /// Up to four columns.
    Four(Box<Solver<4>>),
    /// More, eight to a group.
    Eight(Box<Solver<8>>),
}

/// The same, with columns in groups of `L`.
#[derive(Clone, Debug)]
pub(crate) struct Solver<const L: usize> {
    columns: usize,
    rows: Rows,
    groups: Vec<Columns<L>>,
    /// What the fields of each group changed by last.
    increments: Vec<Increment<L>>,
    inverse: Inverse<L>,
    islands: Islands,
    workers: Workers,
    state: State,
    /// Columns that are worked on.
    active: Vec<usize>,
    /// RᵀMR of all pairs of columns; with several groups only of pairs in one.
    gains: Vec<f64>,
    finest_gains: Vec<f64>,
    /// zᵀKz and zᵀKp of each column.
    products: [Vec<f64>; 2],
    /// Rows in which K x is not what K and x say.
    stale: Stale<L>,
    /// Whether the inverse is still to be told of rows that changed.
    inverse_is_stale: bool,
}

/// The row of each node in the solver's order, and for each level of the aggregation hierarchy that the matrix of the
/// empty scene has, the aggregates of its rows.
pub(super) fn aggregated(matrix: &StiffnessMatrix, fixed: &[bool]) -> (Vec<u32>, Vec<Vec<u32>>) {
    let mut rows = Rows::new(matrix);
    rows.refresh(matrix, fixed, 0..matrix.nodes() as u32, &Workers::default());
    let mut hierarchy = aggregation::Hierarchy::default();
    hierarchy.refresh(&rows);
    let row_of_node = (0..matrix.nodes()).map(|node| rows.row_of(node) as u32).collect();
    (row_of_node, hierarchy.aggregates())
}

/// Does the same for both widths.
macro_rules! for_width {
    ($solver:expr, $of:ident => $result:expr) => {
        match $solver {
            CsrSolver::Four($of) => $result,
            CsrSolver::Eight($of) => $result,
        }
    };
}

impl CsrSolver {
    /// All potentials are zero. `rows` counts nodes and objects.
    pub(crate) fn new(
        matrix: &StiffnessMatrix,
        rows: usize,
        columns: usize,
        preconditioner: Preconditioner,
        workers: Workers,
    ) -> Self {
        if columns <= 4 {
            Self::Four(Box::new(Solver::new(matrix, rows, columns, preconditioner, workers)))
        } else {
            Self::Eight(Box::new(Solver::new(matrix, rows, columns, preconditioner, workers)))
        }
    }

    /// The potential of a row, numbered as in the matrix, in one column.
    pub(crate) fn potential(&self, column: usize, row: usize) -> f64 {
        for_width!(self, of => of.potential(column, row))
    }

    /// The charge (K x) of a row in one column, as the last step left it.
    #[cfg(test)]
    pub(crate) fn charge(&self, column: usize, row: usize) -> f64 {
        for_width!(self, of => of.charge(column, row))
    }

    /// Sets a potential. [`CsrSolver::refresh`] must follow before the next iteration.
    pub(crate) fn set_potential(&mut self, column: usize, row: usize, value: f64) {
        for_width!(self, of => of.set_potential(column, row, value));
    }

    /// Takes over a changed matrix. `changed` must hold every node whose row changed or that became fixed or free
    /// since the last call; all nodes at the first. The inverse is told when it is needed. K x and the energies are right again afterwards; other sums of
    /// [`Operator::state`] are those of the last step or [`Operator::evaluate`].
    pub(crate) fn refresh(
        &mut self,
        matrix: &StiffnessMatrix,
        fixed: &[bool],
        changed: impl Iterator<Item = u32>,
    ) {
        for_width!(self, of => of.refresh(matrix, fixed, changed));
    }

    /// Zero fields without a last step, after a solve that failed: none of its numbers may be left.
    pub(crate) fn clear(&mut self) {
        for_width!(self, of => of.clear());
    }

    /// K⁻¹ between some free nodes, by columns, where the preconditioner is exact. [`CsrSolver::refresh_inverse`] must have been
    /// called since the matrix changed.
    pub(crate) fn inverse(&self, nodes: &[u32]) -> Option<Vec<f64>> {
        for_width!(self, of => {
            let rows: Vec<usize> = nodes.iter().map(|&node| of.rows.row_of(node as usize)).collect();
            of.inverse.exact(&rows)
        })
    }

    /// Why the matrix could not be factorised, if that is what the preconditioner does and the matrix is not to blame.
    pub(crate) fn failure(&self) -> Option<&'static str> {
        for_width!(self, of => of.inverse.failure())
    }

    /// Tells the inverse of the rows that changed. An iteration does that by itself.
    pub(crate) fn refresh_inverse(&mut self) {
        for_width!(self, of => of.refresh_inverse());
    }

    /// Finds the bodies of very high permittivity, which need a direction of their own.
    pub(crate) fn find_islands(
        &mut self,
        matrix: &StiffnessMatrix,
        occupancy: &Occupancy,
        fixed: &[bool],
        changed: &[u32],
    ) {
        for_width!(self, of => of.islands.find(matrix, occupancy, fixed, changed));
    }
}

impl Operator for CsrSolver {
    fn columns(&self) -> usize {
        for_width!(self, of => of.columns)
    }

    fn state(&self) -> &State {
        for_width!(self, of => &of.state)
    }

    fn evaluate(&mut self) {
        for_width!(self, of => of.evaluate());
    }

    fn go_ahead(&mut self) {
        for_width!(self, of => of.go_ahead());
    }

    fn descend(&mut self, active: &[bool]) {
        for_width!(self, of => of.descend(active));
    }

    fn gains(&self) -> &[f64] {
        for_width!(self, of => &of.gains)
    }

    fn finest_gains(&self) -> &[f64] {
        for_width!(self, of => &of.finest_gains)
    }

    fn foretells(&self, steps: usize) -> bool {
        for_width!(self, of => of.foretells(steps))
    }

    fn precondition(&mut self, active: &[bool]) {
        for_width!(self, of => of.precondition(active));
    }

    fn curvatures(&mut self, active: &[bool]) -> (&[f64], &[f64]) {
        for_width!(self, of => of.curvatures(active))
    }

    fn step(&mut self, a: &[f64], b: &[f64]) {
        for_width!(self, of => of.step(a, b));
    }
}

impl<const L: usize> Solver<L> {
    fn new(
        matrix: &StiffnessMatrix,
        rows: usize,
        columns: usize,
        preconditioner: Preconditioner,
        workers: Workers,
    ) -> Self {
        let nodes = matrix.nodes();
        let groups = columns.div_ceil(L);
        let objects = rows - nodes;
        let rows = Rows::new(matrix);
        let inverse = Inverse::new(preconditioner, &rows, groups);
        Self {
            columns,
            groups: vec![Columns::new(nodes, objects); groups],
            increments: vec![Increment::new(nodes); groups],
            islands: Islands::from_contrast(inverse.contrast_of_islands()),
            inverse,
            rows,
            workers,
            state: State::new(columns),
            products: [vec![0.0; columns], vec![0.0; columns]],
            active: Vec::with_capacity(columns),
            gains: vec![0.0; columns * columns],
            finest_gains: vec![0.0; columns * columns],
            stale: Stale::below(nodes),
            inverse_is_stale: false,
        }
    }

    fn potential(&self, column: usize, row: usize) -> f64 {
        let (group, row, lane) = (column / L, self.rows.row_of(row), column % L);
        self.groups[group].x[row][lane] + self.increments[group].lead_of(row)[lane]
    }

    #[cfg(test)]
    fn charge(&self, column: usize, row: usize) -> f64 {
        let (group, row) = (column / L, self.rows.row_of(row));
        let mut charges = self.increments[group].charges_of(&self.groups[group]);
        charges.ahead = charges.ahead.filter(|_| row < self.rows.len());
        charges.at(row)[column % L]
    }

    fn set_potential(&mut self, column: usize, row: usize, value: f64) {
        let row = self.rows.row_of(row);
        let group = &mut self.groups[column / L];
        let before = group.x[row][column % L];
        group.set_potential(row, column % L, value);
        let changes_charges = self.increments[column / L].hold(row, column % L, &group.kx[row]);
        if (before.to_bits() != value.to_bits() || changes_charges) && row < self.rows.len() {
            // What K x is there and at all neighbours.
            self.stale.insert(row as u32);
            self.rows.row(row).0.iter().for_each(|&other| self.stale.insert(other));
        }
    }

    fn clear(&mut self) {
        self.groups.iter_mut().for_each(Columns::clear);
        self.increments.iter_mut().for_each(Increment::forget);
        self.inverse.clear();
        self.state.clear();
    }

    fn refresh(&mut self, matrix: &StiffnessMatrix, fixed: &[bool], changed: impl Iterator<Item = u32>) {
        self.refresh_inverse();
        self.rows.refresh(matrix, fixed, changed, &self.workers);
        self.inverse_is_stale = true;
        self.rows.changed().iter().for_each(|&row| self.stale.insert(row));
        if self.stale.len() * MANY > self.rows.len() {
            self.evaluate();
        } else {
            let Self { rows, groups, increments, stale, workers, .. } = self;
            stale.sort();
            for (group, increment) in groups.iter_mut().zip(increments) {
                stale.evaluate(rows, group, increment, workers);
            }
            (0..self.groups.len()).for_each(|index| self.take_energies(index));
            self.add_cross_energies();
        }
        self.stale.clear();
    }

    /// Tells the inverse of the rows that changed, if it was not told yet.
    fn refresh_inverse(&mut self) {
        if std::mem::take(&mut self.inverse_is_stale) {
            self.inverse.refresh(&self.rows);
        }
    }

    fn evaluate(&mut self) {
        for (increment, group) in self.increments.iter_mut().zip(&mut self.groups) {
            increment.catch_up(&mut group.x, &mut []);
            increment.forget();
        }
        for index in 0..self.groups.len() {
            let sums = self.groups[index].evaluate(&self.rows, &self.workers);
            self.record(index, &sums);
        }
        self.add_cross_energies();
    }

    fn add_cross_energies(&mut self) {
        for (a, b) in (0..self.groups.len()).flat_map(|b| (0..b).map(move |a| (a, b))) {
            let energies = cross_energies([a, b].map(|group| (&self.groups[group], &self.increments[group])));
            for (s, t) in (0..L).flat_map(|s| (0..L).map(move |t| (s, t))) {
                self.set_energy(a * L + s, b * L + t, energies[s][t]);
                self.set_energy(b * L + t, a * L + s, energies[s][t]);
            }
        }
    }

    /// Takes over the sums of one group.
    fn record(&mut self, group: usize, sums: &Sums<L>) {
        for (lane, column) in (group * L..self.columns.min(group * L + L)).enumerate() {
            // r = -K x on free rows, and p is zero on fixed ones.
            self.state.along[column] = -sums.along[lane];
            self.state.residual[column] = sums.residual[lane];
            self.state.charge[column] = sums.charge[lane];
        }
        self.take_energies(group);
    }

    /// Takes over the energies of one group, where its fields are ahead.
    fn take_energies(&mut self, group: usize) {
        let (energies, gain) = (*self.groups[group].energies(), self.increments[group].gain());
        for (s, t) in (0..L).flat_map(|s| (0..L).map(move |t| (s, t))) {
            let energy = 0.5 * (energies[s][t] + energies[t][s]) + gain[s][t];
            self.set_energy(group * L + s, group * L + t, energy);
        }
    }

    fn set_energy(&mut self, s: usize, t: usize, energy: f64) {
        if s < self.columns && t < self.columns {
            self.state.energies[s * self.columns + t] = energy;
        }
    }

    fn go_ahead(&mut self) {
        let Self { rows, groups, increments, inverse, workers, .. } = self;
        let mut stale_inverse = self.inverse_is_stale.then_some(inverse);
        let mut has_changed = false;
        for (increment, group) in increments.iter_mut().zip(groups) {
            let stale_inverse = stale_inverse.take();
            let meanwhile = || stale_inverse.into_iter().for_each(|inverse| inverse.refresh(rows));
            has_changed |= increment.go_ahead(rows, group, (workers, meanwhile));
        }
        self.inverse_is_stale = false;
        if has_changed {
            (0..self.groups.len()).for_each(|index| self.take_energies(index));
            self.add_cross_energies();
        }
    }

    /// Moves fields to where they are ahead, for inverses that know of no such thing.
    fn catch_up(&mut self) {
        for (increment, group) in self.increments.iter_mut().zip(&mut self.groups) {
            group.add_energies(&increment.gain());
            increment.catch_up(&mut group.x, &mut group.kx);
            group.evaluate_objects(&self.rows);
        }
    }

    fn descend(&mut self, active: &[bool]) {
        self.refresh_inverse();
        if !self.inverse.is_multigrid() {
            self.catch_up();
        }
        for index in at_work::<L>(active) {
            let charges = self.increments[index].charges_of(&self.groups[index]);
            let Told { gains, of_finest, residual } =
                self.inverse.descend(index, &self.rows, charges, &self.workers);
            self.increments[index].note_gains(&gains);
            for (s, t) in (0..L).flat_map(|s| (0..L).map(move |t| (s, t))) {
                let (row, column) = (index * L + s, index * L + t);
                if row < self.columns && column < self.columns {
                    let at = row * self.columns + column;
                    self.gains[at] = 0.5 * (gains[s][t] + gains[t][s]);
                    self.finest_gains[at] = 0.5 * (of_finest[s][t] + of_finest[t][s]);
                }
            }
            if let Some(residual) = residual {
                spread(index, &residual, &mut self.state.residual);
            }
        }
        if !self.islands.is_empty() && self.inverse.is_approximate() {
            self.active.clear();
            self.active.extend((0..self.columns).filter(|&column| active[column]));
            self.add_gains_of_islands();
        }
    }

    fn foretells(&self, steps: usize) -> bool {
        let knows_pairs = self.groups.len() == 1 && self.inverse.is_multigrid();
        knows_pairs && (steps <= 1 || self.islands.is_empty())
    }

    fn add_gains_of_islands(&mut self) {
        let Self { columns, rows, groups, increments, islands, gains, active, .. } = self;
        let r = |node: u32, column: usize| {
            let charges = increments[column / L].charges_of(&groups[column / L]);
            -charges.at(rows.row_of(node as usize))[column % L]
        };
        islands.add_gains(r, active, *columns, gains);
        for t in 0..*columns {
            for s in 0..t {
                gains[t * *columns + s] = gains[s * *columns + t];
            }
        }
    }

    fn precondition(&mut self, active: &[bool]) {
        for index in at_work::<L>(active) {
            let charges = self.increments[index].charges_of(&self.groups[index]);
            self.inverse.ascend(index, charges, &self.workers);
            if let Some(z) = self.inverse.approximate_mut(index) {
                add_islands(&mut self.islands, &self.rows, charges, z);
            }
        }
    }

    fn curvatures(&mut self, active: &[bool]) -> (&[f64], &[f64]) {
        let (rows, workers) = (&self.rows, &self.workers);
        for index in at_work::<L>(active) {
            let [zz, zp] = self.inverse.curvatures(index, rows, &mut self.groups[index], workers);
            spread(index, &zz, &mut self.products[0]);
            spread(index, &zp, &mut self.products[1]);
        }
        (&self.products[0], &self.products[1])
    }

    fn step(&mut self, a: &[f64], b: &[f64]) {
        for index in 0..self.groups.len() {
            let (a, b) = (lanes(a, index), lanes(b, index));
            if [a, b] == [[0.0; L]; 2] {
                // Its fields stay where they are, ahead of what is stored or not.
                continue;
            }
            let along = Along::new(a, b);
            let (group, rows, workers) = (&mut self.groups[index], &self.rows, &self.workers);
            let increment = &mut self.increments[index];
            let change = increment.start_step();
            let sums = match self.inverse.preconditioned(index) {
                Preconditioned::Single(z) => group.step(rows, z, &along, change, workers),
                Preconditioned::Double(z) => group.step(rows, z, &along, change, workers),
                Preconditioned::Work(work) => group.step(rows, work.solution(), &along, change, workers),
            };
            increment.end_step(rows, &sums.of_change, &group.kx);
            self.record(index, &sums);
        }
        self.add_cross_energies();
    }
}

/// The groups in which some column is worked on.
fn at_work<const L: usize>(active: &[bool]) -> impl Iterator<Item = usize> {
    active.chunks(L).enumerate().filter(|(_, columns)| columns.contains(&true)).map(|(group, _)| group)
}

/// The values of a group's columns; zero for those that fill it up.
fn lanes<const L: usize>(columns: &[f64], group: usize) -> [f64; L] {
    std::array::from_fn(|lane| columns.get(group * L + lane).copied().unwrap_or(0.0))
}

/// Writes a group's values to their columns.
fn spread<const L: usize>(group: usize, lanes: &[f64; L], columns: &mut [f64]) {
    columns.iter_mut().skip(group * L).zip(lanes).for_each(|(column, lane)| *column = *lane);
}

/// Adds the directions of islands to z.
fn add_islands<const L: usize>(
    islands: &mut Islands,
    rows: &Rows,
    charges: Charges<'_, L>,
    mut z: Approximate<'_, L>,
) {
    let row = |node: u32| rows.row_of(node as usize);
    (0..L).for_each(|lane| {
        islands.correct(|node| -charges.at(row(node))[lane], |node, shift| z.raise(row(node), lane, shift));
    });
}

/// XᵀKX between the columns of two groups, where their fields are ahead.
fn cross_energies<const L: usize>(groups: [(&Columns<L>, &Increment<L>); 2]) -> [[f64; L]; L] {
    let [(a, of_a), (b, of_b)] = groups;
    let mut energies = [[0.0; L]; L];
    for (x, kx) in a.x.iter().zip(&b.kx) {
        add_products(&mut energies, x, kx);
    }
    let charges_b = of_b.charges_of(b);
    for row in 0..of_a.fields.len() {
        // K is symmetric, and no object moves along a change.
        let [lead_a, lead_b] = [of_a, of_b].map(|of| of.lead_of(row));
        add_products(&mut energies, &lead_a, &charges_b.at(row));
        add_products(&mut energies, &a.kx[row], &lead_b);
    }
    energies
}
