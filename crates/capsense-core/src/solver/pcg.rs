//! Preconditioned conjugate gradients for several terminals at once.
//!
//! Each step goes to the point of least energy in the plane that the preconditioned residual z and the last step p span,
//! which is the step of conjugate gradients, but forgives steps before it that were not exact. The first step of a frame
//! therefore takes the length that was right in the frame before; how good it was shows afterwards at no cost, because
//! the residual is recomputed after every step: pᵀKp is what r·p falls by.

use super::demand::Demand;
use super::energy_error::{EnergyError, ErrorRule, Step};
use super::foresight::{Foresight, Gains};
use super::operator::Operator;
use super::thorough::Thorough;
use super::{SolveError, SolveReport, SolverOptions};

#[cfg(test)]
mod tests;

/// Below this sine squared of the angle between z and p, the two are taken for parallel.
const PARALLEL: f64 = 1e-10;

/// When r·p falls by no more than this part of it in a step of assumed length, rounding rules, or the length was absurd.
const UNRELIABLE: f64 = 0.1;

/// Squared residuals below this part of the squared charges are gone.
const GONE: f64 = 1e-24;

/// Lengths of first steps that may be used again.
const USUAL_LENGTHS: std::ops::RangeInclusive<f64> = 0.5..=2.0;

/// What one solve leaves for the next, and working storage.
#[derive(Clone, Debug)]
pub(crate) struct ConjugateGradients {
    error: EnergyError,
    foresight: Foresight,
    thorough: Thorough,
    /// The length of each column's first step that would have been best.
    lengths: Vec<f64>,
    active: Vec<bool>,
    a: Vec<f64>,
    b: Vec<f64>,
    rz: Vec<f64>,
    /// rᵀp before and after the step, and pᵀKp.
    before: Vec<f64>,
    along: Vec<f64>,
    curvature: Vec<f64>,
}

impl ConjugateGradients {
    pub(crate) fn new(columns: usize, rule: ErrorRule) -> Self {
        let zeros = || vec![0.0; columns];
        Self {
            error: EnergyError::new(rule, columns),
            foresight: Foresight::new(columns),
            thorough: Thorough::default(),
            lengths: zeros(),
            active: vec![true; columns],
            a: zeros(),
            b: zeros(),
            rz: zeros(),
            before: zeros(),
            along: zeros(),
            curvature: zeros(),
        }
    }

    /// Improves the fields until the tolerance is reached. The residual must be that of the fields.
    ///
    /// # Errors
    /// When the tolerance is not reached, the matrix is indefinite, or a value is not finite.
    pub(crate) fn solve(
        &mut self,
        fields: &mut impl Operator,
        demand: &mut Demand,
        options: &SolverOptions,
    ) -> Result<SolveReport, SolveError> {
        self.start();
        fields.go_ahead();
        demand.update(&fields.state().energies);
        let (mut iterations, mut is_evaluated) = (0, false);
        while self.active.contains(&true) {
            if iterations == options.max_iterations {
                // Without a step, nothing is known.
                let relative_error = if iterations > 0 { self.worst(demand) } else { 1.0 };
                let tolerance = options.tolerance;
                return Err(SolveError::NotConverged { iterations, relative_error, tolerance });
            }
            fields.descend(&self.active);
            let own = fields.gains().iter().step_by(self.active.len() + 1).zip(&self.active);
            let of_active = self.rz.iter_mut().zip(own).filter(|(_, (_, active))| **active);
            of_active.for_each(|(rz, (gain, _))| *rz = *gain);
            if let Some(column) = self.check(fields, demand, options, iterations)? {
                // Sums of residuals may have followed the rows that changed with rounding, or not yet.
                if iterations == 0 && !std::mem::replace(&mut is_evaluated, true) {
                    fields.evaluate();
                    self.start();
                    continue;
                }
                return Err(self.breakdown(fields, demand, column, iterations));
            }
            if !self.active.contains(&true) {
                break;
            }
            if self.foresees_enough(fields, demand, options, iterations) {
                break;
            }
            self.improve(fields, iterations)?;
            iterations += 1;
            demand.update(&fields.state().energies);
            // What is not needed must not fail.
            let part = if iterations < options.max_iterations { self.thorough.part(iterations) } else { 1.0 };
            for (column, active) in self.active.iter_mut().enumerate() {
                let energy = fields.state().energies[column * fields.columns() + column];
                let allowed = demand.allowed(column, energy, options);
                // Where there was nothing more to gain, there is nothing to go on with.
                let may_go_on = *active || self.rz[column] > 0.0;
                *active = may_go_on && !self.error.is_below(column, part * allowed);
            }
        }
        let (relative_error, state) = (self.worst(demand), fields.state());
        self.foresight
            .finish(iterations, &state.energies, |column| self.error.relative(column).unwrap_or(1.0));
        if iterations > 0 {
            self.error.finish();
        }
        if may_stand_still(fields, options) {
            self.thorough.finish(iterations);
        }
        let ratios = state.residual.iter().zip(&state.charge).filter(|(_, charge)| **charge > 0.0);
        let residual = ratios.map(|(free, held)| (free.max(0.0) / held).sqrt()).fold(0.0, f64::max);
        Ok(SolveReport { iterations, relative_error, residual, skipped: false, launches: 0 })
    }

    fn start(&mut self) {
        self.active.fill(true);
        self.error.start();
        self.foresight.start();
    }

    /// One step.
    fn improve(&mut self, fields: &mut impl Operator, iteration: usize) -> Result<(), SolveError> {
        let exact = iteration > 0 || self.error.is_learning() || !self.lengths_are_usual();
        if exact {
            fields.precondition(&self.active);
            self.minimise(fields, iteration)?;
            fields.step(&self.a, &self.b);
        } else {
            self.take_usual_lengths();
            fields.precondition_and_step(&self.active, &self.a, &self.b);
        }
        self.record(fields, iteration, exact)
    }

    /// Whether what the first half of a cycle has told is enough.
    fn foresees_enough(
        &mut self,
        fields: &impl Operator,
        demand: &Demand,
        options: &SolverOptions,
        steps: usize,
    ) -> bool {
        let gains = Gains { all: fields.gains(), of_finest: fields.finest_gains() };
        let energies = &fields.state().energies;
        self.foresight.note(steps, gains);
        if self.error.is_learning() || !fields.foretells(steps) {
            return false;
        }
        if steps == 0 && !may_stand_still(fields, options) {
            return false;
        }
        let part = self.thorough.part(steps);
        let allowed = |column: usize, energy: f64| part * demand.allowed(column, energy, options);
        self.foresight.is_enough(steps, &self.active, gains, energies, allowed)
    }

    /// r·z of a column is zero though its residual is not, and nothing is known of what that leaves.
    fn breakdown(
        &self,
        fields: &impl Operator,
        demand: &Demand,
        column: usize,
        iterations: usize,
    ) -> SolveError {
        let state = fields.state();
        let residual = (state.residual[column] / state.charge[column]).sqrt();
        let relative_error = if self.error.has_stepped(column) { self.worst(demand) } else { 1.0 };
        SolveError::Breakdown { column, iterations, residual, relative_error }
    }

    /// Forgets what solves have shown, after one that failed.
    pub(crate) fn forget(&mut self) {
        self.error.forget();
        self.lengths.fill(f64::NAN);
    }

    /// The estimated relative error that the last solve left of one column.
    pub(crate) fn relative_error(&self, column: usize) -> f64 {
        self.foresight.error(column).or_else(|| self.error.relative(column)).unwrap_or(1.0)
    }

    /// What is to be taken from the energies of the fields, all pairs of columns.
    pub(crate) fn corrections(&self) -> &[f64] {
        self.foresight.corrections()
    }

    /// The largest estimate over all columns of what their errors make of capacitances; all of it where nothing can be
    /// told.
    fn worst(&self, demand: &Demand) -> f64 {
        (0..self.active.len())
            .map(|column| demand.error_of_capacitance(column, self.relative_error(column)))
            .fold(0.0, f64::max)
    }

    /// Columns must have a finite, positive r·z; those in which it is zero are done, as there is nothing more to gain. Tells the first
    /// of these that is not done after all: its residual is not gone, and no step has shown that its error is small.
    fn check(
        &mut self,
        fields: &impl Operator,
        demand: &Demand,
        options: &SolverOptions,
        iteration: usize,
    ) -> Result<Option<usize>, SolveError> {
        let (state, mut unfinished) = (fields.state(), None);
        for column in 0..self.rz.len() {
            let rz = self.rz[column];
            if !self.active[column] {
                continue;
            }
            if !rz.is_finite() {
                return Err(SolveError::NonFinite { column, iteration });
            }
            if rz < 0.0 {
                return Err(SolveError::Indefinite { column, iteration, curvature: rz });
            }
            if rz > 0.0 {
                continue;
            }
            self.active[column] = false;
            let energy = state.energies[column * fields.columns() + column];
            let is_small = self.error.has_stepped(column)
                && self.error.is_estimated_below(column, demand.allowed(column, energy, options));
            if state.residual[column] <= GONE * state.charge[column] {
                self.error.settle(column);
            } else if !is_small {
                unfinished = unfinished.or(Some(column));
            }
        }
        Ok(unfinished)
    }

    fn lengths_are_usual(&self) -> bool {
        self.lengths.iter().all(|length| USUAL_LENGTHS.contains(length))
    }

    fn take_usual_lengths(&mut self) {
        for column in 0..self.active.len() {
            let length = if self.active[column] { self.lengths[column] } else { 0.0 };
            (self.a[column], self.b[column]) = (length, 0.0);
        }
    }

    /// The step to the least energy in the span of z and p: the 2 by 2 system of their energies.
    fn minimise(&mut self, fields: &mut impl Operator, iteration: usize) -> Result<(), SolveError> {
        let (of_z, of_both) = fields.curvatures(&self.active);
        for column in 0..self.active.len() {
            (self.a[column], self.b[column], self.before[column]) = (0.0, 0.0, 0.0);
            if !self.active[column] {
                // It does not move, so it has no last step.
                self.curvature[column] = 0.0;
                continue;
            }
            let (zz, zp) = (of_z[column], of_both[column]);
            if !(zz.is_finite() && zp.is_finite()) {
                return Err(SolveError::NonFinite { column, iteration });
            }
            if zz <= 0.0 {
                return Err(SolveError::Indefinite { column, iteration, curvature: zz });
            }
            let (rz, pp) = (self.rz[column], self.curvature[column]);
            (self.a[column], self.before[column]) = (rz / zz, rz * rz / zz);
            let determinant = zz * pp - zp * zp;
            if iteration > 0 && determinant > PARALLEL * zz * pp {
                let rp = self.along[column];
                self.a[column] = (rz * pp - rp * zp) / determinant;
                self.b[column] = (rp * zz - rz * zp) / determinant;
                self.before[column] = self.a[column] * rz + self.b[column] * rp;
            }
        }
        Ok(())
    }

    /// What the step was worth. `exact` when its length was computed, not assumed.
    fn record(&mut self, fields: &impl Operator, iteration: usize, exact: bool) -> Result<(), SolveError> {
        let state = fields.state();
        let columns = self.active.len();
        for column in (0..columns).filter(|&column| self.active[column]) {
            let before = if exact { self.before[column] } else { self.a[column] * self.rz[column] };
            let after = state.along[column];
            let energy = state.energies[column * columns + column];
            if !(energy.is_finite() && after.is_finite()) {
                return Err(SolveError::NonFinite { column, iteration });
            }
            if energy < 0.0 {
                return Err(SolveError::Indefinite { column, iteration, curvature: energy });
            }
            let fallen = before - after;
            let reliable = exact || fallen > UNRELIABLE * before;
            let curvature = if exact || !reliable { before } else { fallen };
            let best = before / curvature;
            if iteration == 0 {
                self.lengths[column] = if reliable { self.a[column] * best } else { f64::NAN };
            }
            (self.along[column], self.curvature[column]) = (after, curvature);
            let drop = before * best;
            let excess = if reliable { after * after / curvature } else { energy };
            self.error.record(column, Step { drop, excess, energy, length: drop / self.rz[column] });
            self.foresight.shed(iteration, column, drop - excess);
        }
        self.error.advance();
        Ok(())
    }
}

/// Whether a frame may do without a step. Where changes of C must be exact it may not: a small change is a small part of what is
/// foreseen; of 40 frames one was off by three times what was asked.
fn may_stand_still(fields: &impl Operator, options: &SolverOptions) -> bool {
    fields.foretells(0) && options.change_tolerance.is_none()
}
