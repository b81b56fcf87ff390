//! Approximations of K⁻¹ on the free rows.

use super::super::{CONTRAST, IncompleteCholesky, Preconditioner};
use super::aggregation::{Gains, Hierarchy, Work};
use super::change::Charges;
use super::columns::Columns;
use super::direct::Direct;
use super::rows::Rows;
use crate::workers::Workers;

/// Of bodies that are weaker, coarse levels know the direction as well as any other. Told of by both it counts twice, and what
/// a cycle tells is now too much and now too little of what there is: at 300,000 tetrahedra with a body of 80 between 0.9 and
/// 3.8 times was to come, so few frames could be foreseen. Of much stronger ones single precision may know too little.
const CONTRAST_BEYOND_LEVELS: f64 = 100.0;

/// An approximate inverse with its numbers, and what it made of the residuals of each group of columns.
#[derive(Clone, Debug)]
pub(super) struct Inverse<const L: usize> {
    kind: Kind,
    preconditioned: Vec<Preconditioned<L>>,
}

#[derive(Clone, Debug)]
enum Kind {
    Aggregation(Box<Hierarchy>),
    IncompleteCholesky(Box<IncompleteCholesky>),
    Direct(Box<Direct>),
    /// What each row is multiplied with.
    Diagonal {
        identity: bool,
        factors: Vec<f32>,
    },
}

/// z of one group.
#[derive(Clone, Debug)]
pub(super) enum Preconditioned<const L: usize> {
    Single(Vec<[f32; L]>),
    /// Of Cholesky factors.
    Double(Vec<[f64; L]>),
    /// As it stands on the finest level of a hierarchy.
    Work(Work<L>),
}

/// What is known of one group before z is: of pairs of columns what M gains and what of that the sweep on the finest level
/// gained, and the residuals' squares.
pub(super) struct Told<const L: usize> {
    pub(super) gains: [[f64; L]; L],
    pub(super) of_finest: [[f64; L]; L],
    pub(super) residual: Option<[f64; L]>,
}

/// z of one group, to be changed.
pub(super) enum Approximate<'a, const L: usize> {
    Single(&'a mut [[f32; L]]),
    Double(&'a mut [[f64; L]]),
}

impl<const L: usize> Approximate<'_, L> {
    /// Adds to z at one place.
    pub(super) fn raise(&mut self, row: usize, lane: usize, shift: f64) {
        match self {
            Self::Single(z) => z[row][lane] = (f64::from(z[row][lane]) + shift) as f32,
            Self::Double(z) => z[row][lane] += shift,
        }
    }
}

impl<const L: usize> Inverse<L> {
    pub(super) fn new(preconditioner: Preconditioner, rows: &Rows, groups: usize) -> Self {
        let nodes = rows.len();
        let single = Preconditioned::Single(vec![[0.0; L]; nodes]);
        let double = Preconditioned::Double(vec![[0.0; L]; nodes]);
        let diagonal = |identity| Kind::Diagonal { identity, factors: vec![0.0; nodes] };
        let (kind, preconditioned) = match preconditioner {
            Preconditioner::Multigrid => {
                (Kind::Aggregation(Box::default()), Preconditioned::Work(Work::default()))
            }
            Preconditioner::Ic0 => (Kind::IncompleteCholesky(Box::new(incomplete_cholesky(rows))), double),
            Preconditioner::Direct | Preconditioner::Cholesky => {
                (Kind::Direct(Box::new(Direct::new(rows))), double)
            }
            Preconditioner::Jacobi => (diagonal(false), single),
            Preconditioner::None => (diagonal(true), single),
        };
        Self { kind, preconditioned: vec![preconditioned; groups] }
    }

    /// Zeros for what it made of residuals.
    pub(super) fn clear(&mut self) {
        for preconditioned in &mut self.preconditioned {
            match preconditioned {
                Preconditioned::Single(z) => z.fill([0.0; L]),
                Preconditioned::Double(z) => z.fill([0.0; L]),
                // Made anew when it is needed.
                Preconditioned::Work(work) => *work = Work::default(),
            }
        }
    }

    /// Takes over the rows that changed.
    pub(super) fn refresh(&mut self, rows: &Rows) {
        match &mut self.kind {
            Kind::Aggregation(hierarchy) => hierarchy.refresh(rows),
            Kind::IncompleteCholesky(factors) if !rows.changed().is_empty() => {
                factors.factorise(rows.diagonal(), |entry| -rows.weight(entry), rows.fixed());
            }
            Kind::IncompleteCholesky(_) => {}
            Kind::Direct(direct) => direct.refresh(rows),
            Kind::Diagonal { identity, factors } => {
                for row in rows.changed().iter().map(|&row| row as usize) {
                    factors[row] = match (rows.fixed()[row], *identity) {
                        (true, _) => 0.0,
                        (false, true) => 1.0,
                        (false, false) => (1.0 / rows.diagonal()[row]) as f32,
                    };
                }
            }
        }
    }

    /// As if there were no memory for an exact one.
    #[cfg(test)]
    pub(super) fn run_out_of_memory(&mut self, rows: &Rows) {
        if let Kind::Direct(direct) = &mut self.kind {
            direct.run_out_of_memory(rows);
        }
    }

    /// Why the exact inverse could not be made, if it is not the matrix itself.
    pub(super) fn failure(&self) -> Option<&'static str> {
        match &self.kind {
            Kind::Direct(direct) => direct.failure(),
            _ => None,
        }
    }

    /// The first half of a cycle on the residuals r of one group, and what it gains; of other approximations, whose fields
    /// must not be ahead, z = M r, and of each column zᵀr. Σ r² over free rows too where it is new.
    pub(super) fn descend(
        &mut self,
        group: usize,
        rows: &Rows,
        charges: Charges<'_, L>,
        workers: &Workers,
    ) -> Told<L> {
        let kx = charges.kx;
        let own = match (&self.kind, &mut self.preconditioned[group]) {
            (Kind::Aggregation(hierarchy), Preconditioned::Work(work)) => {
                let [of_finest, Gains { products, squares }] = hierarchy.descend(charges, work, workers);
                return Told { gains: products, of_finest: of_finest.products, residual: Some(squares) };
            }
            (Kind::IncompleteCholesky(factors), Preconditioned::Double(z)) => {
                substitute(factors, rows.fixed(), kx, z)
            }
            (Kind::Direct(direct), Preconditioned::Double(z)) => direct.apply(rows, kx, z),
            (Kind::Diagonal { factors, .. }, Preconditioned::Single(z)) => scale(factors, kx, z),
            // No other pair is ever made.
            _ => [0.0; L],
        };
        let mut gains = [[0.0; L]; L];
        (0..L).for_each(|lane| gains[lane][lane] = own[lane]);
        Told { gains, of_finest: gains, residual: None }
    }

    /// The second half of a cycle: z = M r.
    pub(super) fn ascend(&mut self, group: usize, charges: Charges<'_, L>, workers: &Workers) {
        if let (Kind::Aggregation(hierarchy), Preconditioned::Work(work)) =
            (&self.kind, &mut self.preconditioned[group])
        {
            hierarchy.ascend(charges, work, workers);
        }
    }

    /// Whether M is not exactly K⁻¹.
    pub(super) fn is_approximate(&self) -> bool {
        !matches!(self.kind, Kind::Direct(_))
    }

    /// From which contrast on a body's direction is solved for beside it.
    pub(super) fn contrast_of_islands(&self) -> f64 {
        if self.is_multigrid() { CONTRAST_BEYOND_LEVELS } else { CONTRAST }
    }

    /// Whether [`Inverse::descend`] is half a cycle.
    pub(super) fn is_multigrid(&self) -> bool {
        matches!(self.kind, Kind::Aggregation(_))
    }

    /// z of one group where it is not exact.
    pub(super) fn approximate_mut(&mut self, group: usize) -> Option<Approximate<'_, L>> {
        match (&self.kind, &mut self.preconditioned[group]) {
            (Kind::Direct(_), _) => None,
            (_, Preconditioned::Single(z)) => Some(Approximate::Single(z)),
            (_, Preconditioned::Double(z)) => Some(Approximate::Double(z)),
            (_, Preconditioned::Work(work)) => work.solution_mut().map(Approximate::Single),
        }
    }

    /// zᵀKz and zᵀKp of one group; of a hierarchy in single precision, because lengths of steps need not be exact.
    pub(super) fn curvatures(
        &mut self,
        group: usize,
        rows: &Rows,
        columns: &mut Columns<L>,
        workers: &Workers,
    ) -> [[f64; L]; 2] {
        match (&self.kind, &mut self.preconditioned[group]) {
            (Kind::Aggregation(hierarchy), Preconditioned::Work(work)) => {
                hierarchy.curvatures(work, &columns.p, workers)
            }
            (_, Preconditioned::Single(z)) => columns.curvatures(rows, z, workers),
            (_, Preconditioned::Double(z)) => columns.curvatures(rows, z, workers),
            // No other pair is ever made.
            _ => [[0.0; L]; 2],
        }
    }

    /// K⁻¹ between some free rows, by columns, where it is known.
    pub(super) fn exact(&self, some: &[usize]) -> Option<Vec<f64>> {
        match &self.kind {
            Kind::Direct(direct) => direct.inverse(some),
            _ => None,
        }
    }

    pub(super) fn preconditioned(&self, group: usize) -> &Preconditioned<L> {
        &self.preconditioned[group]
    }
}

/// The pattern of the incomplete factors: in each row the columns before it, and where their weights are.
fn incomplete_cholesky(rows: &Rows) -> IncompleteCholesky {
    IncompleteCholesky::of_triangle((0..rows.len()).map(|row| {
        let entries = rows.row(row).0.iter().copied().zip(rows.entries(row).start as u32..);
        let mut before: Vec<_> = entries.filter(|&(column, _)| (column as usize) < row).collect();
        before.sort_unstable();
        before
    }))
}

/// z = (L D Lᵀ)⁻¹ (-kx), zero on fixed rows, and the columns' zᵀ(-kx).
fn substitute<const L: usize>(
    factors: &IncompleteCholesky,
    fixed: &[bool],
    kx: &[[f64; L]],
    z: &mut [[f64; L]],
) -> [f64; L] {
    // Rows of objects, which are fixed, come after those of the nodes.
    factors.solve(&kx[..z.len()], z);
    let mut products = [0.0; L];
    for ((z, kx), &fixed) in z.iter_mut().zip(kx).zip(fixed) {
        *z = if fixed { [0.0; L] } else { z.map(|z| -z) };
        for lane in 0..L {
            products[lane] -= kx[lane] * z[lane];
        }
    }
    products
}

/// z = -factor kx, and the columns' zᵀ(-kx).
fn scale<const L: usize>(factors: &[f32], kx: &[[f64; L]], z: &mut [[f32; L]]) -> [f64; L] {
    let mut products = [0.0; L];
    for ((z, kx), factor) in z.iter_mut().zip(kx).zip(factors) {
        for lane in 0..L {
            z[lane] = -factor * kx[lane] as f32;
            products[lane] -= kx[lane] * f64::from(z[lane]);
        }
    }
    products
}
