//! The iteration's view of the fields on a lattice.

use super::LatticeSolver;
use super::products::Factor;
use crate::solver::operator::{Operator, State};

impl Operator for LatticeSolver {
    fn columns(&self) -> usize {
        self.columns
    }

    fn state(&self) -> &State {
        &self.state
    }

    fn evaluate(&mut self) {
        self.scale.fill(0.0);
        self.walk(None);
    }

    fn precondition(&mut self, active: &[bool]) -> &[f64] {
        self.activate(active);
        self.hierarchy.cycle(&self.workers, self.arch, &self.active);
        self.multiply_correction(Factor::Residual);
        self.correct_islands();
        &self.products[0]
    }

    fn precondition_and_step(&mut self, active: &[bool], a: &[f64], b: &[f64], rz: &mut [f64]) {
        self.activate(active);
        self.scale.copy_from_slice(a);
        if self.islands.is_empty() && self.cycle_and_walk() {
            std::mem::swap(&mut self.p, &mut self.hierarchy.levels[0].x);
            rz.copy_from_slice(&self.state.before);
            self.scale_products();
        } else {
            rz.copy_from_slice(self.precondition(active));
            self.step(a, b);
        }
    }

    fn curvatures(&mut self, _active: &[bool]) -> (&[f64], &[f64]) {
        self.multiply_correction(Factor::Charges);
        let [own, with_step] = &mut self.products;
        with_step.iter_mut().zip(&self.scale).for_each(|(product, scale)| *product *= scale);
        (own, with_step)
    }

    fn step(&mut self, a: &[f64], b: &[f64]) {
        // With p stored but for a factor, p = a z + b p is a (z + β p).
        let beta: Vec<f64> = a
            .iter()
            .zip(b)
            .zip(&self.scale)
            .map(|((&a, &b), &scale)| if a == 0.0 || b == 0.0 { 0.0 } else { b * scale / a })
            .collect();
        self.scale.copy_from_slice(a);
        if beta.iter().all(|&beta| beta == 0.0) {
            std::mem::swap(&mut self.p, &mut self.hierarchy.levels[0].x);
            self.walk(None);
        } else {
            self.walk(Some(&beta));
        }
        self.scale_products();
    }
}

impl LatticeSolver {
    fn activate(&mut self, active: &[bool]) {
        self.active.clear();
        self.active.extend((0..self.columns).filter(|&column| active[column]));
    }

    /// p is stored but for a factor; rᵀp is not.
    fn scale_products(&mut self) {
        self.state.along.iter_mut().zip(&self.scale).for_each(|(along, scale)| *along *= scale);
    }

    /// Adds the directions of islands to z.
    fn correct_islands(&mut self) {
        let layout = self.layout;
        let finest = &mut self.hierarchy.levels[0];
        for &column in &self.active {
            let place = |node: u32| {
                let (colour, at) = layout.place(layout.indices(node as usize));
                (colour, layout.in_column(column, at))
            };
            let b = &finest.b;
            let r = |node| {
                let (colour, at) = place(node);
                f64::from(b[colour][at])
            };
            self.products[0][column] += self.islands.correct(r, |node, shift| {
                let (colour, at) = place(node);
                let z = &mut finest.x[colour][at];
                let before = f64::from(std::mem::replace(z, (f64::from(*z) + shift) as f32));
                f64::from(*z) - before
            });
        }
    }
}
