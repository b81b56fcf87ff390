//! How exact the field of each terminal must be, that the capacitances between electrodes are as exact as was asked for.
//!
//! What an object that floats takes from an electrode's field leaves a capacitance that may be a small part of the energies
//! that were solved for, all other terminals at 0 V, and all their errors remain in it.

use super::SolverOptions;

/// No less than this part of the tolerance is asked for: of capacitances smaller than that rounding leaves little.
const LEAST: f64 = 1e-6;

/// What is asked of the energy of each column.
#[derive(Clone, Debug)]
pub(super) struct Demand {
    columns: usize,
    /// What ties objects to ground, in units of energy: one for each of the last columns, which are released.
    to_ground: Vec<f64>,
    /// Energies of the empty scene, once they are known.
    base: Vec<f64>,
    /// For each column its tolerance in relation to that of the capacitances, and to that of their changes.
    parts: Vec<f64>,
    parts_of_changes: Vec<f64>,
    /// The energies while objects are released one after the other, and each field as a sum of those solved for.
    energies: Vec<f64>,
    fields: Vec<f64>,
}

impl Demand {
    pub(super) fn new(columns: usize, to_ground: &[f64]) -> Self {
        let square = vec![0.0; columns * columns];
        Self {
            columns,
            to_ground: to_ground.to_vec(),
            base: Vec::new(),
            parts: vec![1.0; columns],
            parts_of_changes: vec![1.0; columns],
            energies: square.clone(),
            fields: square,
        }
    }

    /// Takes energies of all pairs of columns for those of the empty scene.
    pub(super) fn remember_base(&mut self, energies: &[f64]) {
        self.base = energies.iter().step_by(self.columns + 1).copied().collect();
    }

    /// Looks at the energies of all pairs of columns as they are now.
    pub(super) fn update(&mut self, energies: &[f64]) {
        if self.to_ground.is_empty() {
            return;
        }
        let columns = self.columns;
        self.energies.copy_from_slice(energies);
        self.fields.fill(0.0);
        self.fields.iter_mut().step_by(columns + 1).for_each(|own| *own = 1.0);
        let electrodes = columns - self.to_ground.len();
        for object in electrodes..columns {
            self.release(object, self.to_ground[object - electrodes]);
        }
        let parts = self.parts.iter_mut().zip(&mut self.parts_of_changes);
        for (column, (part, of_change)) in parts.enumerate() {
            let own = energies[column * (columns + 1)];
            // Of what is left of an electrode's energy, or of its change, by what of the column is contained in it.
            let least = |of_left: &dyn Fn(usize, f64) -> f64| {
                let of_electrode = |electrode: usize| {
                    let contained = self.fields[electrode * columns + column].powi(2) * own;
                    let left = of_left(electrode, self.energies[electrode * (columns + 1)]);
                    if contained > 0.0 { left / contained } else { 1.0 }
                };
                (0..electrodes).map(of_electrode).fold(1.0, f64::min)
            };
            *part = least(&|_, left| left).max(LEAST);
            *of_change = match self.base.is_empty() {
                true => 1.0,
                false => least(&|electrode, left| (left - self.base[electrode]).abs()),
            };
        }
    }

    /// Lets an object find its potential in the fields of electrodes and of objects that are yet to be released.
    fn release(&mut self, object: usize, to_ground: f64) {
        let columns = self.columns;
        let pivot = self.energies[object * (columns + 1)] + to_ground;
        for s in (0..columns).filter(|&s| s != object && pivot > 0.0) {
            let share = self.energies[s * columns + object] / pivot;
            for t in 0..columns {
                if t != object {
                    self.energies[s * columns + t] -= share * self.energies[object * columns + t];
                }
                self.fields[s * columns + t] -= share * self.fields[object * columns + t];
            }
        }
        for t in 0..columns {
            (self.energies[object * columns + t], self.energies[t * columns + object]) = (0.0, 0.0);
        }
    }

    /// The relative error that is allowed of a column's energy.
    pub(super) fn allowed(&self, column: usize, energy: f64, options: &SolverOptions) -> f64 {
        let of_change = self.base.get(column).map(|base| match self.to_ground.is_empty() {
            true => (energy - base).abs() / energy,
            false => self.parts_of_changes[column],
        });
        options.allowed(self.parts[column], of_change)
    }

    /// The error of capacitances that a relative error of a column's energy may make.
    pub(super) fn error_of_capacitance(&self, column: usize, relative: f64) -> f64 {
        relative / self.parts[column]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a floating object leaves of a change may be much less than what it changes while it is held.
    #[test]
    fn changes_are_those_that_floating_objects_leave() {
        let options =
            SolverOptions { tolerance: 1e-2, change_tolerance: Some(1e-2), ..SolverOptions::default() };
        let mut demand = Demand::new(2, &[0.0]);
        demand.remember_base(&[1.0, 0.0, 0.0, 0.0]);
        // Held, it changes 0.1; released, 0.001 of that is left.
        demand.update(&[1.1, -0.0999, -0.0999, 0.0999f64.powi(2) / 0.0999]);
        let of_change = (1.1 - 0.0999 - 1.0) / 1.1;
        assert!((demand.allowed(0, 1.1, &options) / (1e-2 * of_change) - 1.0).abs() < 1e-6, "{demand:?}");
        // Without such objects, it is all of it.
        let mut demand = Demand::new(1, &[]);
        demand.remember_base(&[1.0]);
        assert!((demand.allowed(0, 1.1, &options) / (1e-2 * 0.1 / 1.1) - 1.0).abs() < 1e-6);
    }

    /// An electrode that couples to a floating object almost alone keeps little of its energy.
    #[test]
    fn what_couples_to_a_floating_object_must_be_more_exact() {
        let mut demand = Demand::new(2, &[0.0]);
        demand.update(&[1.0, -0.9, -0.9, 0.9]);
        assert!((demand.parts[0] - 0.1).abs() < 1e-12, "{:?}", demand.parts);
        assert!((demand.parts[1] - 0.1 / 0.9).abs() < 1e-12, "{:?}", demand.parts);
        // Tied to ground by much more than that it is as good as grounded.
        let mut demand = Demand::new(2, &[1e6]);
        demand.update(&[1.0, -0.9, -0.9, 0.9]);
        assert!(demand.parts.iter().all(|part| *part > 0.999), "{:?}", demand.parts);
    }
}
