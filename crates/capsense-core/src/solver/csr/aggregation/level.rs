//! One level of the aggregation hierarchy: a network of any shape in single precision, and Gauss-Seidel on it.
//!
//! A forward sweep that starts from zero reads only lower neighbours, and what it leaves of the residual comes only from
//! the others. So a symmetric pair of sweeps with the residual between them reads every weight twice.

use super::super::change::Ahead;
use super::super::columns::add as add_double;
use super::super::pattern::Pattern;
use super::krylov::Krylov;
use super::rows_of_task;
use super::transfer::Transfer;
use crate::instructions::vectorised_by_eight;
use crate::workers::Workers;
use std::ops::Range;
use std::sync::Arc;

/// No aggregate.
pub(super) const NONE: u32 = crate::solver::NO_AGGREGATE;

/// The network, with fixed nodes eliminated: their weights are leaks of their neighbours.
#[derive(Clone, Debug)]
pub(super) struct Level {
    pub(super) pattern: Arc<Pattern>,
    /// Of each entry.
    pub(super) weights: Vec<f32>,
    /// Weight to everything at a fixed potential.
    pub(super) leak: Vec<f32>,
    /// Inverse of the diagonal; zero where the potential is fixed.
    pub(super) inverse: Vec<f32>,
}

/// The vectors of one level.
#[derive(Clone, Debug)]
pub(super) struct Vectors<const L: usize> {
    pub(super) x: Vec<[f32; L]>,
    /// The right-hand side; the finest level has it from elsewhere.
    pub(super) b: Vec<[f32; L]>,
    /// What the rows of the border take from other blocks.
    far: Vec<[f32; L]>,
    /// What the forward sweep of each block gains.
    pub(super) gains: Vec<Gains<L>>,
    /// On levels that are visited twice.
    pub(super) krylov: Option<Box<Krylov<L>>>,
}

impl<const L: usize> Vectors<L> {
    pub(super) fn new(level: &Level, finest: bool, twice: bool) -> Self {
        let rows = level.rows();
        Self {
            x: vec![[0.0; L]; rows],
            b: vec![[0.0; L]; if finest { 0 } else { rows }],
            far: vec![[0.0; L]; level.pattern.border().len()],
            gains: vec![Gains::default(); level.pattern.blocks()],
            krylov: twice.then(|| Box::new(Krylov::new(rows))),
        }
    }
}

/// What a forward sweep from zero takes from the energies of all pairs of columns, bᵀ(D+L)⁻ᵀD(D+L)⁻¹b with L the lower
/// triangle of K, and Σ b².
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Gains<const L: usize> {
    pub(in super::super) products: [[f64; L]; L],
    pub(in super::super) squares: [f64; L],
}

impl<const L: usize> Gains<L> {
    pub(super) fn add(&mut self, other: &Self) {
        self.products.iter_mut().zip(&other.products).for_each(|(sums, products)| add_double(sums, products));
        add_double(&mut self.squares, &other.squares);
    }

    #[inline(always)]
    fn add_products(&mut self, a: &[f32; L], b: &[f32; L]) {
        for (sums, &a) in self.products.iter_mut().zip(a) {
            add_single(sums, &scaled(*b, a));
        }
    }
}

impl<const L: usize> Default for Gains<L> {
    fn default() -> Self {
        Self { products: [[0.0; L]; L], squares: [0.0; L] }
    }
}

/// Rows whose gains are added up in single precision.
const ROWS_IN_SINGLE: usize = 64;

/// The right-hand side of a row: the level's own, or what is given for the finest.
pub(super) trait RightHandSide<const L: usize>: Sync {
    /// b at a row; `own` is that of the level.
    fn at(&self, own: &[[f32; L]], row: usize) -> [f32; L];
}

/// The level's own.
pub(super) struct Own;

impl<const L: usize> RightHandSide<L> for Own {
    #[inline(always)]
    fn at(&self, own: &[[f32; L]], row: usize) -> [f32; L] {
        own[row]
    }
}

/// -K x of the fields, which is zero on fixed rows only after it was multiplied with the inverse of their diagonal.
pub(super) struct Residual<'a, const L: usize>(pub(super) &'a [[f64; L]]);

/// The same of fields that are ahead of those.
pub(super) struct ResidualAhead<'a, const L: usize>(pub(super) &'a [[f64; L]], pub(super) Ahead<'a, L>);

impl<const L: usize> RightHandSide<L> for ResidualAhead<'_, L> {
    #[inline(always)]
    fn at(&self, _: &[[f32; L]], row: usize) -> [f32; L] {
        let Self(kx, ahead) = self;
        let mut b = [0.0; L];
        for (b, charge) in b.iter_mut().zip(ahead.charge(&kx[row], row)) {
            *b = -charge as f32;
        }
        b
    }
}

impl<const L: usize> RightHandSide<L> for Residual<'_, L> {
    #[inline(always)]
    fn at(&self, _: &[[f32; L]], row: usize) -> [f32; L] {
        let mut b = [0.0; L];
        for (b, kx) in b.iter_mut().zip(&self.0[row]) {
            *b = -*kx as f32;
        }
        b
    }
}

impl Level {
    /// A network whose weights still are zero.
    pub(super) fn new(pattern: Arc<Pattern>) -> Self {
        let (rows, entries) = (pattern.rows(), pattern.columns().len());
        Self { pattern, weights: vec![0.0; entries], leak: vec![0.0; rows], inverse: vec![0.0; rows] }
    }

    /// Sets the diagonal of a row; zero where nothing is unknown.
    pub(super) fn set_diagonal(&mut self, row: usize, diagonal: f64) {
        self.inverse[row] = if diagonal > 0.0 { (1.0 / diagonal) as f32 } else { 0.0 };
    }

    pub(super) fn rows(&self) -> usize {
        self.inverse.len()
    }

    /// x = one forward sweep on K x = b from zero, and what it leaves of the residual summed up for the coarser level. On
    /// levels that `TELL`, what it gains.
    pub(super) fn sweep_forward<const L: usize, const TELL: bool>(
        &self,
        vectors: &mut Vectors<L>,
        coarse: Option<(&Transfer, &mut [[f32; L]])>,
        workers: &Workers,
        b: &impl RightHandSide<L>,
    ) {
        let Vectors { x, b: own, gains, .. } = vectors;
        let (size, own) = (self.pattern.block(), own.as_slice());
        let blocks = x.chunks_mut(size).zip(gains.iter_mut()).zip((0..).step_by(size));
        let Some((transfer, coarse)) = coarse else {
            return workers.for_each(blocks, |((x, gains), first)| {
                vectorised_by_eight(
                    #[inline(always)]
                    || self.sweep_block_forward::<L, TELL>(x, gains, first, own, b),
                );
            });
        };
        workers.for_each(
            blocks.zip(transfer.cut(coarse)),
            |(((x, gains), first), (first_coarse, coarse))| {
                vectorised_by_eight(
                    #[inline(always)]
                    || {
                        self.sweep_block_forward::<L, TELL>(x, gains, first, own, b);
                        coarse.fill([0.0; L]);
                        transfer.restrict(
                            coarse,
                            first_coarse,
                            first..first + x.len(),
                            #[inline(always)]
                            |row| self.sum(self.pattern.higher(row), x, first),
                        );
                    },
                );
            },
        );
        if !self.pattern.border().is_empty() {
            self.restrict_border::<L, TELL>(x, gains, transfer, coarse, workers);
        }
    }

    #[inline(always)]
    fn sweep_block_forward<const L: usize, const TELL: bool>(
        &self,
        x: &mut [[f32; L]],
        gains: &mut Gains<L>,
        first: usize,
        own: &[[f32; L]],
        b: &impl RightHandSide<L>,
    ) {
        let (entries, inverse) = (self.entries(), &self.inverse[first..][..x.len()]);
        *gains = Gains::default();
        for start in (0..x.len()).step_by(ROWS_IN_SINGLE) {
            let (mut products, mut squares) = ([[0.0; L]; L], [0.0; L]);
            for at in start..(start + ROWS_IN_SINGLE).min(x.len()) {
                let row = first + at;
                let given = b.at(own, row);
                let mut sum = given;
                entries.gather(self.pattern.lower(row), x, first, &mut sum);
                x[at] = scaled(sum, inverse[at]);
                if TELL {
                    for (products, &x) in products.iter_mut().zip(&x[at]) {
                        add_product(products, x, &sum);
                    }
                    let is_free = f32::from(u8::from(inverse[at] != 0.0));
                    for lane in 0..L {
                        squares[lane] += is_free * given[lane] * given[lane];
                    }
                }
            }
            if TELL {
                for (sums, products) in gains.products.iter_mut().zip(&products) {
                    add_single(sums, products);
                }
                add_single(&mut gains.squares, &squares);
            }
        }
    }

    /// Adds the part of the residual that comes from other blocks, and of the gains.
    fn restrict_border<const L: usize, const TELL: bool>(
        &self,
        x: &[[f32; L]],
        gains: &mut [Gains<L>],
        transfer: &Transfer,
        coarse: &mut [[f32; L]],
        workers: &Workers,
    ) {
        let size = self.pattern.block();
        let blocks = transfer.cut(coarse).zip(gains).zip((0..).step_by(size));
        workers.for_each(blocks, |(((first_coarse, coarse), gains), first)| {
            vectorised_by_eight(
                #[inline(always)]
                || {
                    let border = self.border_before(first)..self.border_before(first + size);
                    for row in self.pattern.border()[border].iter().map(|&row| row as usize) {
                        transfer.restrict(
                            coarse,
                            first_coarse,
                            row..row + 1,
                            #[inline(always)]
                            |row| {
                                let sum = self.sum(self.pattern.far(row), x, 0);
                                if TELL {
                                    gains.add_products(&x[row], &sum);
                                }
                                sum
                            },
                        );
                    }
                },
            );
        });
    }

    /// Takes over the correction of the coarser level, if there is one, and then x = one backward sweep on K x = b.
    pub(super) fn sweep_backward<const L: usize>(
        &self,
        vectors: &mut Vectors<L>,
        coarse: Option<(&Transfer, &[[f32; L]])>,
        workers: &Workers,
        b: &impl RightHandSide<L>,
    ) {
        self.collect_far(vectors, coarse, workers);
        let Vectors { x, b: own, far, .. } = vectors;
        let (size, own, far) = (self.pattern.block(), own.as_slice(), far.as_slice());
        let tasks = x.chunks_mut(size).zip((0..).step_by(size));
        workers.for_each(tasks, |(x, first)| {
            vectorised_by_eight(
                #[inline(always)]
                || {
                    if let Some((transfer, correction)) = coarse {
                        transfer.prolong(x, first, correction);
                    }
                    let mut border = self.border_before(first + x.len());
                    let (entries, inverse) = (self.entries(), &self.inverse[first..][..x.len()]);
                    for at in (0..x.len()).rev() {
                        let row = first + at;
                        let mut b = b.at(own, row);
                        if border > 0 && self.pattern.border()[border - 1] as usize == row {
                            border -= 1;
                            add(&mut b, &far[border]);
                        }
                        entries.gather(self.pattern.near(row), x, first, &mut b);
                        x[at] = scaled(b, inverse[at]);
                    }
                },
            );
        });
    }

    /// How many rows of the border are before a row.
    fn border_before(&self, row: usize) -> usize {
        self.pattern.border().partition_point(|&border| (border as usize) < row)
    }

    /// What the rows of the border take from other blocks after the correction, before the sweep changes it.
    fn collect_far<const L: usize>(
        &self,
        vectors: &mut Vectors<L>,
        coarse: Option<(&Transfer, &[[f32; L]])>,
        workers: &Workers,
    ) {
        let Vectors { x, far, .. } = vectors;
        let (x, border) = (x.as_slice(), self.pattern.border());
        let of_task = rows_of_task(border.len());
        let tasks = far.chunks_mut(of_task).zip(border.chunks(of_task));
        workers.for_each(tasks, |(far, border)| {
            vectorised_by_eight(
                #[inline(always)]
                || {
                    for (far, &row) in far.iter_mut().zip(border) {
                        *far = [0.0; L];
                        for entry in self.pattern.far(row as usize) {
                            let other = self.pattern.columns()[entry] as usize;
                            let mut x = x[other];
                            if let Some((transfer, correction)) = coarse {
                                transfer.correct(&mut x, other, correction);
                            }
                            add_product(far, self.weights[entry], &x);
                        }
                    }
                },
            );
        });
    }

    /// Σ w x over some entries. The rows of x count from `first`.
    #[inline(always)]
    fn sum<const L: usize>(&self, entries: Range<usize>, x: &[[f32; L]], first: usize) -> [f32; L] {
        let mut sum = [0.0; L];
        self.entries().gather(entries, x, first, &mut sum);
        sum
    }

    #[inline(always)]
    fn entries(&self) -> Entries<'_> {
        let columns = self.pattern.columns();
        Entries { columns, weights: &self.weights[..columns.len()] }
    }

    /// (K x) at one row, by differences: no more is lost than the weights are rounded.
    #[inline(always)]
    pub(super) fn product<const L: usize>(&self, row: usize, x: &[[f32; L]]) -> [f32; L] {
        let here = &x[row];
        let mut sum = [0.0; L];
        add_product(&mut sum, self.leak[row], here);
        let entries = self.pattern.entries(row);
        for (&column, &weight) in self.pattern.columns()[entries.clone()].iter().zip(&self.weights[entries]) {
            let there = &x[column as usize];
            for lane in 0..L {
                sum[lane] += weight * (here[lane] - there[lane]);
            }
        }
        sum
    }

    /// zᵀKz and zᵀKp of some rows' share in the energy: their leaks, and every edge once or half at both ends.
    #[inline(always)]
    pub(super) fn curvatures<const L: usize>(
        &self,
        rows: Range<usize>,
        z: &[[f32; L]],
        p: &[[f32; L]],
    ) -> [[f64; L]; 2] {
        let mut sums = [[0.0; L]; 2];
        for row in rows {
            let mut of_row = [[0.0; L]; 2];
            for lane in 0..L {
                let leak = self.leak[row] * z[row][lane];
                of_row[0][lane] = leak * z[row][lane];
                of_row[1][lane] = leak * p[row][lane];
            }
            for (entries, part) in [(self.pattern.lower(row), 1.0), (self.pattern.far(row), 0.5)] {
                for entry in entries {
                    let (other, weight) =
                        (self.pattern.columns()[entry] as usize, part * self.weights[entry]);
                    for lane in 0..L {
                        let along = z[row][lane] - z[other][lane];
                        let flux = weight * along;
                        of_row[0][lane] += flux * along;
                        of_row[1][lane] += flux * (p[row][lane] - p[other][lane]);
                    }
                }
            }
            for lane in 0..L {
                sums[0][lane] += f64::from(of_row[0][lane]);
                sums[1][lane] += f64::from(of_row[1][lane]);
            }
        }
        sums
    }
}

/// The entries of a level, at hand for a sweep.
#[derive(Clone, Copy)]
struct Entries<'a> {
    columns: &'a [u32],
    weights: &'a [f32],
}

impl Entries<'_> {
    /// sum += Σ w x over some entries. The rows of x count from `first`.
    #[inline(always)]
    fn gather<const L: usize>(self, entries: Range<usize>, x: &[[f32; L]], first: usize, sum: &mut [f32; L]) {
        let columns = &self.columns[entries.clone()];
        let (column_pairs, last_column) = columns.as_chunks::<2>();
        let (weight_pairs, last_weight) = self.weights[entries].as_chunks::<2>();
        // Two sums, so that one does not wait for the other.
        let mut other = [0.0; L];
        for (columns, weights) in column_pairs.iter().zip(weight_pairs) {
            add_product(sum, weights[0], &x[columns[0] as usize - first]);
            add_product(&mut other, weights[1], &x[columns[1] as usize - first]);
        }
        for (&column, &weight) in last_column.iter().zip(last_weight) {
            add_product(sum, weight, &x[column as usize - first]);
        }
        add(sum, &other);
    }
}

#[inline(always)]
fn scaled<const L: usize>(mut sum: [f32; L], factor: f32) -> [f32; L] {
    for sum in &mut sum {
        *sum *= factor;
    }
    sum
}

/// sum += weight x.
#[inline(always)]
fn add_product<const L: usize>(sum: &mut [f32; L], weight: f32, x: &[f32; L]) {
    for lane in 0..L {
        sum[lane] += weight * x[lane];
    }
}

/// sum += other.
#[inline(always)]
fn add_single<const L: usize>(sum: &mut [f64; L], other: &[f32; L]) {
    for lane in 0..L {
        sum[lane] += f64::from(other[lane]);
    }
}

/// sum += other.
#[inline(always)]
fn add<const L: usize>(sum: &mut [f32; L], other: &[f32; L]) {
    for lane in 0..L {
        sum[lane] += other[lane];
    }
}
