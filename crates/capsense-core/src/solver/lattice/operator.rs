//! The iteration's view of the fields on a lattice.

use super::LatticeSolver;
use super::layout::{BLACK, BLOCK, RED};
use super::sums::{Evaluated, add_mixed_products, total};
use crate::solver::operator::{Operator, State};
use pulp::{Simd, WithSimd};

impl Operator for LatticeSolver {
    fn columns(&self) -> usize {
        self.columns
    }

    fn state(&self) -> &State {
        &self.state
    }

    fn evaluate(&mut self) {
        self.scale.fill(0.0);
        self.walk_all(None);
    }

    fn precondition(&mut self, active: &[bool]) -> &[f64] {
        self.active.clear();
        self.active.extend((0..self.columns).filter(|&column| active[column]));
        self.arch.dispatch(Precondition(self));
        self.correct_islands();
        &self.products[0]
    }

    fn curvatures(&mut self, _active: &[bool]) -> (&[f64], &[f64]) {
        self.arch.dispatch(Curvatures(self));
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
            .map(|((&a, &b), &scale)| if a == 0.0 { 0.0 } else { b * scale / a })
            .collect();
        self.scale.copy_from_slice(a);
        if beta.iter().all(|&beta| beta == 0.0) {
            std::mem::swap(&mut self.p, &mut self.hierarchy.levels[0].x);
            self.walk_all(None);
        } else {
            self.walk_all(Some(&beta));
        }
        self.state.along.iter_mut().zip(&self.scale).for_each(|(along, scale)| *along *= scale);
    }
}

/// Work that is compiled once for each set of instructions that a processor may have. Not closures, which the compiler
/// may leave out of the function that has these instructions.
struct Precondition<'a>(&'a mut LatticeSolver);
struct Curvatures<'a>(&'a mut LatticeSolver);
struct Walk<'a>(&'a mut LatticeSolver, Option<&'a [f64]>);

impl WithSimd for Precondition<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.0.hierarchy.cycle(simd, &self.0.active);
        self.0.residual_along_correction();
    }
}

impl WithSimd for Curvatures<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.0.curvatures_of_correction(simd);
    }
}

impl WithSimd for Walk<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.0.walk(simd, self.1);
    }
}

impl LatticeSolver {
    /// Adds the directions of islands to z.
    fn correct_islands(&mut self) {
        let layout = self.stencil.layout;
        let finest = &mut self.hierarchy.levels[0];
        for &column in &self.active {
            let place = |node: u32| {
                let (colour, at) = layout.place(layout.indices(node as usize));
                (colour, column * layout.len() + at)
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

    fn walk_all(&mut self, beta: Option<&[f64]>) {
        self.arch.dispatch(Walk(self, beta));
    }

    /// Moves the fields of each plane by the step, after z was added to it, and evaluates the plane before.
    #[inline(always)]
    fn walk<S: Simd>(&mut self, simd: S, beta: Option<&[f64]>) {
        self.state.clear();
        let planes = self.stencil.layout.planes();
        for k in planes.start..planes.end + 1 {
            if k < planes.end {
                if let Some(beta) = beta {
                    self.turn_step(k, beta);
                }
                self.move_fields(k);
            }
            if k > planes.start {
                let finest = &mut self.hierarchy.levels[0];
                let evaluated = Evaluated {
                    stencil: &self.stencil,
                    inverse: &finest.stencil.centre,
                    links: &self.links,
                    x: &self.x,
                    p: &self.p,
                };
                self.sums.evaluate(simd, &evaluated, &mut finest.b, k - 1, &mut self.state);
            }
        }
        let columns = self.columns;
        for t in 0..columns {
            for s in 0..t {
                self.state.energies[t * columns + s] = self.state.energies[s * columns + t];
            }
        }
    }

    /// p = z + β p.
    #[inline(always)]
    fn turn_step(&mut self, k: usize, beta: &[f64]) {
        let layout = self.stencil.layout;
        let places = layout.plane(k);
        for colour in [RED, BLACK] {
            for (column, &beta) in beta.iter().enumerate() {
                let at = column * layout.len() + places.start..column * layout.len() + places.end;
                let z = &self.hierarchy.levels[0].x[colour][at.start..at.end];
                self.p[colour][at].iter_mut().zip(z).for_each(|(p, z)| *p = z + beta as f32 * *p);
            }
        }
    }

    /// x += p.
    #[inline(always)]
    fn move_fields(&mut self, k: usize) {
        let layout = self.stencil.layout;
        let places = layout.plane(k);
        for colour in [RED, BLACK] {
            for (column, &scale) in self.scale.iter().enumerate() {
                if scale == 0.0 {
                    continue;
                }
                let at = column * layout.len() + places.start..column * layout.len() + places.end;
                let p = &self.p[colour][at.start..at.end];
                self.x[colour][at].iter_mut().zip(p).for_each(|(x, p)| *x += scale * f64::from(*p));
            }
        }
    }

    /// rᵀz.
    #[inline(always)]
    fn residual_along_correction(&mut self) {
        let layout = self.stencil.layout;
        let finest = &self.hierarchy.levels[0];
        self.products[0].fill(0.0);
        let planes = layout.planes();
        for k in planes.start..planes.end {
            let places = layout.plane(k);
            for &column in &self.active {
                let mut sum = [0.0; BLOCK];
                for colour in [RED, BLACK] {
                    let at = column * layout.len() + places.start..column * layout.len() + places.end;
                    let (r, z) = (&finest.b[colour][at.start..at.end], &finest.x[colour][at]);
                    sum = add_mixed_products(sum, r, z);
                }
                self.products[0][column] += total(&sum);
            }
        }
    }

    /// zᵀKz and zᵀKp, p without its factor.
    #[inline(always)]
    fn curvatures_of_correction<S: Simd>(&mut self, simd: S) {
        let layout = self.stencil.layout;
        let len = layout.len();
        let z = &self.hierarchy.levels[0].x;
        // In single precision: lengths of steps need not be exact.
        let stencil = &self.hierarchy.levels[0].stencil;
        let mut sums_of_z = vec![0.0; layout.plane + 2 * BLOCK];
        for products in &mut self.products {
            products.fill(0.0);
        }
        let planes = layout.planes();
        for k in planes.start..planes.end {
            let places = layout.plane(k);
            let gathered = &mut sums_of_z[..places.len()];
            for &column in &self.active {
                let at = column * len + places.start..column * len + places.end;
                let mut sums = [[0.0; BLOCK]; 2];
                for colour in [RED, BLACK] {
                    let own = &z[colour][at.start..at.end];
                    let piece = stencil.piece(colour, places.start..places.end);
                    piece.gather(simd, 1.0, gathered, &z[1 - colour][column * len..(column + 1) * len]);
                    let diagonal = &self.stencil.centre[colour][places.start..places.end];
                    for ((kz, z), diagonal) in gathered.iter_mut().zip(own).zip(diagonal) {
                        *kz = (diagonal * f64::from(*z) - f64::from(*kz)) as f32;
                    }
                    sums[0] = add_mixed_products(sums[0], gathered, own);
                    sums[1] = add_mixed_products(sums[1], gathered, &self.p[colour][at.start..at.end]);
                }
                self.products[0][column] += total(&sums[0]);
                self.products[1][column] += total(&sums[1]);
            }
        }
    }
}
