//! The iteration's view of the fields on a lattice.

use super::LatticeSolver;
use super::level::Level;
use crate::solver::operator::{Operator, State};

impl Operator for LatticeSolver {
    fn columns(&self) -> usize {
        self.columns
    }

    fn state(&self) -> &State {
        &self.state
    }

    fn evaluate(&mut self) {
        self.drop_increment();
        self.scale.fill(0.0);
        self.walk(None, false);
    }

    fn go_ahead(&mut self) {
        LatticeSolver::go_ahead(self);
    }

    fn descend(&mut self, active: &[bool]) {
        self.activate(active);
        let gains = [&mut self.gains, &mut self.finest_gains].map(|gains| &mut gains[..]);
        self.hierarchy.descend(&self.workers, self.arch, &self.active, gains);
        self.add_gains_of_islands();
        self.increment.note_gains(&self.gains);
        for gains in [&mut self.gains, &mut self.finest_gains] {
            for t in 0..self.columns {
                for s in 0..t {
                    gains[t * self.columns + s] = gains[s * self.columns + t];
                }
            }
        }
    }

    fn gains(&self) -> &[f64] {
        &self.gains
    }

    fn finest_gains(&self) -> &[f64] {
        &self.finest_gains
    }

    fn foretells(&self, steps: usize) -> bool {
        steps <= 1 || self.islands.is_empty()
    }

    fn precondition(&mut self, active: &[bool]) {
        self.catch_up();
        self.activate(active);
        self.hierarchy.ascend(&self.workers, self.arch, &self.active);
        self.correct_islands();
    }

    fn precondition_and_step(&mut self, active: &[bool], a: &[f64], b: &[f64]) {
        self.activate(active);
        self.scale.copy_from_slice(a);
        if self.islands.is_empty() && self.ascend_and_walk() {
            std::mem::swap(&mut self.p, &mut self.hierarchy.levels[0].x);
            self.scale_products();
        } else {
            self.precondition(active);
            self.step(a, b);
        }
    }

    fn curvatures(&mut self, _active: &[bool]) -> (&[f64], &[f64]) {
        self.find_curvatures();
        let [own, with_step] = &mut self.curvatures;
        with_step.iter_mut().zip(&self.scale).for_each(|(product, scale)| *product *= scale);
        (own, with_step)
    }

    fn step(&mut self, a: &[f64], b: &[f64]) {
        // With p stored but for a factor, p = a z + b p is a (z + β p).
        let mut beta = std::mem::take(&mut self.beta);
        beta.clear();
        let lengths = a.iter().zip(b).zip(&self.scale);
        beta.extend(lengths.map(|((&a, &b), &scale)| if a == 0.0 || b == 0.0 { 0.0 } else { b * scale / a }));
        self.scale.copy_from_slice(a);
        if beta.iter().all(|&beta| beta == 0.0) {
            std::mem::swap(&mut self.p, &mut self.hierarchy.levels[0].x);
            self.walk(None, true);
        } else {
            self.walk(Some(&beta), true);
        }
        self.beta = beta;
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

    /// Adds what the directions of islands gain.
    fn add_gains_of_islands(&mut self) {
        if self.islands.is_empty() {
            return;
        }
        let (layout, finest) = (self.layout, &self.hierarchy.levels[0]);
        let r = |node: u32, column: usize| {
            let (colour, first) = layout.place(layout.indices(node as usize));
            let at = layout.in_column(column, first);
            f64::from(finest.b[colour][at]) - f64::from(finest.ahead[column] * finest.charges[colour][at])
        };
        self.islands.add_gains(r, &self.active, self.columns, &mut self.gains);
    }

    /// Adds the directions of islands to z.
    fn correct_islands(&mut self) {
        let layout = self.layout;
        let Level { b, x, .. } = &mut self.hierarchy.levels[0];
        for &column in &self.active {
            let place = |node: u32| {
                let (colour, at) = layout.place(layout.indices(node as usize));
                (colour, layout.in_column(column, at))
            };
            let r = |node| {
                let (colour, at) = place(node);
                f64::from(b[colour][at])
            };
            self.islands.correct(r, |node, shift| {
                let (colour, at) = place(node);
                let z = &mut x[colour][at];
                *z = (f64::from(*z) + shift) as f32;
            });
        }
    }
}
