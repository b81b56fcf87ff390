//! Aggregation multigrid on any mesh: an approximate K⁻¹ in single precision.
//!
//! Aggregates are formed once, in the empty scene; their weights are refreshed where rows changed. A dielectric that
//! would float among its surroundings, which a single level resolves only after thousands of iterations, is a handful
//! of nodes on a coarse level.

mod aggregates;
mod coarsest;
mod krylov;
mod level;
#[cfg(test)]
mod tests;
mod transfer;

use super::change::Charges;
use super::columns::add;
use super::rows::Rows;
use crate::instructions::vectorised_by_eight;
use crate::workers::{TASK_ROWS, Workers};
use aggregates::{Couplings, aggregates};
use coarsest::Coarsest;
pub(super) use level::Gains;
use level::{Level, Own, Residual, ResidualAhead, RightHandSide, Vectors};
use transfer::{Changes, Transfer};

/// A level with no more rows is solved exactly.
const FEW_ROWS: usize = 40;

/// So many levels below the finest are visited twice. With two, frames take as many steps and half a cycle 1.06 times as long.
const TWICE: usize = 1;

/// Into so many tasks the rows of a coarse level, or those at the border of any, are cut at least, as many for each of two threads,
/// unless they have fewer rows each than the first number; and how many one has at most. With 1024 each, 5,100 rows would be five
/// tasks, three of them one thread's.
const COARSE_TASKS: usize = 8;
const ROWS_OF_COARSE_TASK: [usize; 2] = [256, 1024];

/// The hierarchy of a mesh. It has no levels before the first refresh.
#[derive(Clone, Debug, Default)]
pub(super) struct Hierarchy {
    /// From fine to coarse.
    levels: Vec<Level>,
    transfers: Vec<Transfer>,
    coarsest: Coarsest,
    changes: Vec<Changes>,
}

/// The vectors of all levels.
#[derive(Clone, Debug, Default)]
pub(super) struct Work<const L: usize> {
    levels: Vec<Vectors<L>>,
    /// zᵀKz and zᵀKp of every task, and what the second level gains in each.
    curvatures: Vec<[[f64; L]; 2]>,
    gains: Vec<[[f64; L]; L]>,
}

impl Hierarchy {
    /// Takes over the rows that changed; at the first call, all.
    pub(super) fn refresh(&mut self, rows: &Rows) {
        let first = self.levels.is_empty();
        if first {
            self.levels.push(Level::new(rows.pattern().clone()));
            self.changes.push(Changes::default());
        }
        refresh_finest(&mut self.levels[0], rows, &mut self.changes[0]);
        if first {
            self.build();
            // Far less changes from now on.
            self.changes.fill_with(Changes::default);
        } else {
            for (index, transfer) in self.transfers.iter_mut().enumerate() {
                let (fine, coarse) = self.levels.split_at_mut(index + 1);
                let (from, to) = self.changes.split_at_mut(index + 1);
                transfer.refresh(&fine[index], &mut coarse[0], &from[index], &mut to[0]);
            }
        }
        if let Some(last) = self.levels.get(1..).and_then(<[Level]>::last) {
            self.coarsest.refresh(last);
        }
    }

    /// The aggregate of each row of all levels but the coarsest.
    pub(super) fn aggregates(&self) -> Vec<Vec<u32>> {
        self.transfers.iter().map(|transfer| transfer.aggregate().to_vec()).collect()
    }

    fn build(&mut self) {
        let mut couplings = Couplings::of(&self.levels[0]);
        while let Some(fine) = self.levels.last().filter(|level| level.rows() > FEW_ROWS) {
            let aggregates = aggregates(fine, &couplings);
            let (mut transfer, mut coarse) = Transfer::new(fine, &aggregates);
            couplings = aggregates.couplings;
            if coarse.rows() == 0 || 10 * coarse.rows() > 9 * transfer.count() {
                break;
            }
            let all = Changes { rows: (0..fine.rows() as u32).collect(), weights: pairs_of(fine) };
            let mut changes = Changes::default();
            transfer.refresh(fine, &mut coarse, &all, &mut changes);
            transfer.remember(&coarse);
            self.levels.push(coarse);
            self.transfers.push(transfer);
            self.changes.push(changes);
        }
    }

    /// The first half of a symmetric cycle on r, the charges' opposite: all but the backward sweep of the finest level.
    /// Returns what its forward sweep gains, and RᵀMR, with what the coarser levels do, which is not quite symmetric; Σ r²
    /// with both.
    pub(super) fn descend<const L: usize>(
        &self,
        Charges { kx, ahead }: Charges<'_, L>,
        work: &mut Work<L>,
        workers: &Workers,
    ) -> [Gains<L>; 2] {
        match ahead {
            Some(ahead) => self.descend_from(&ResidualAhead(kx, ahead), work, workers),
            None => self.descend_from(&Residual(kx), work, workers),
        }
    }

    fn descend_from<const L: usize>(
        &self,
        residual: &impl RightHandSide<L>,
        work: &mut Work<L>,
        workers: &Workers,
    ) -> [Gains<L>; 2] {
        let Work { levels, gains: of_tasks, .. } = work;
        for (index, level) in self.levels.iter().enumerate().skip(levels.len()) {
            levels.push(Vectors::new(level, index == 0, (1..=TWICE).contains(&index)));
        }
        let mut gains = Gains::default();
        let Some((finest, coarser)) = levels.split_first_mut() else { return [gains; 2] };
        let coarse = self.transfers.first().zip(coarser.first_mut());
        let coarse = coarse.map(|(transfer, coarse)| (transfer, coarse.b.as_mut_slice()));
        self.levels[0].sweep_forward::<L, true>(finest, coarse, workers, residual);
        for block in &finest.gains {
            gains.add(block);
        }
        let of_finest = gains;
        if !coarser.is_empty() {
            self.solve(1, coarser, workers);
            add_gains(&coarser[0].x, &coarser[0].b, of_tasks, workers, &mut gains.products);
        }
        [of_finest, gains]
    }

    /// z = M r: the second half of the cycle.
    pub(super) fn ascend<const L: usize>(
        &self,
        Charges { kx, ahead }: Charges<'_, L>,
        work: &mut Work<L>,
        workers: &Workers,
    ) {
        let Some((finest, coarser)) = work.levels.split_first_mut() else { return };
        let correction = self.transfers.first().zip(coarser.first());
        let correction = correction.map(|(transfer, coarse)| (transfer, coarse.x.as_slice()));
        match ahead {
            Some(ahead) => {
                self.levels[0].sweep_backward(finest, correction, workers, &ResidualAhead(kx, ahead));
            }
            None => self.levels[0].sweep_backward(finest, correction, workers, &Residual(kx)),
        }
    }

    /// zᵀKz and zᵀKp, z what the last application made.
    pub(super) fn curvatures<const L: usize>(
        &self,
        work: &mut Work<L>,
        p: &[[f32; L]],
        workers: &Workers,
    ) -> [[f64; L]; 2] {
        let (finest, z) = (&self.levels[0], &work.levels[0].x);
        let rows = finest.rows();
        work.curvatures.resize(rows.div_ceil(TASK_ROWS), [[0.0; L]; 2]);
        workers.for_each(work.curvatures.iter_mut().zip((0..).step_by(TASK_ROWS)), |(sums, first)| {
            *sums = vectorised_by_eight(
                #[inline(always)]
                || finest.curvatures(first..(first + TASK_ROWS).min(rows), z, p),
            );
        });
        let mut sums = [[0.0; L]; 2];
        for part in &work.curvatures {
            sums.iter_mut().zip(part).for_each(|(sum, part)| add(sum, part));
        }
        sums
    }

    /// x = approximately K⁻¹ b on a coarse level.
    fn cycle<const L: usize>(&self, index: usize, levels: &mut [Vectors<L>], workers: &Workers) {
        let Some((fine, coarser)) = levels.split_first_mut() else { return };
        let level = &self.levels[index];
        let mut correction = None;
        if let (Some(transfer), Some(coarse)) = (self.transfers.get(index), coarser.first_mut()) {
            level.sweep_forward::<L, false>(fine, Some((transfer, &mut coarse.b)), workers, &Own);
            self.solve(index + 1, coarser, workers);
            correction = Some((transfer, coarser[0].x.as_slice()));
        } else {
            level.sweep_forward::<L, false>(fine, None, workers, &Own);
        }
        level.sweep_backward(fine, correction, workers, &Own);
    }

    /// x = approximately K⁻¹ b on a coarse level.
    fn solve<const L: usize>(&self, index: usize, levels: &mut [Vectors<L>], workers: &Workers) {
        if index + 1 == self.levels.len() && self.coarsest.solve(&mut levels[0]) {
            return;
        }
        let cycle = |levels: &mut [Vectors<L>]| self.cycle(index, levels, workers);
        match levels[0].krylov.take() {
            Some(mut krylov) => {
                krylov.solve(&self.levels[index], levels, workers, cycle);
                levels[0].krylov = Some(krylov);
            }
            None => cycle(levels),
        }
    }
}

impl<const L: usize> Work<L> {
    /// What the last application made.
    pub(super) fn solution(&self) -> &[[f32; L]] {
        self.levels.first().map_or(&[], |finest| &finest.x)
    }

    pub(super) fn solution_mut(&mut self) -> Option<&mut [[f32; L]]> {
        self.levels.first_mut().map(|finest| finest.x.as_mut_slice())
    }
}

/// Number of rows that one task takes of so many of a coarse level or of a border.
fn rows_of_task(rows: usize) -> usize {
    let [least, most] = ROWS_OF_COARSE_TASK;
    rows.div_ceil(COARSE_TASKS).clamp(least, most)
}

/// Adds what a coarse solution x gains as it is taken over, with b what it is the solution for.
fn add_gains<const L: usize>(
    x: &[[f32; L]],
    b: &[[f32; L]],
    of_tasks: &mut Vec<[[f64; L]; L]>,
    workers: &Workers,
    gains: &mut [[f64; L]; L],
) {
    let of_task = rows_of_task(x.len());
    of_tasks.resize(x.len().div_ceil(of_task), [[0.0; L]; L]);
    let tasks = x.chunks(of_task).zip(b.chunks(of_task)).zip(&mut *of_tasks);
    workers.for_each(tasks, |((x, b), gains)| {
        *gains = vectorised_by_eight(
            #[inline(always)]
            || transfer::gains(x, b),
        );
    });
    for part in of_tasks {
        gains.iter_mut().zip(&*part).for_each(|(sum, part)| add(sum, part));
    }
}

/// All entries of a level, each with its row.
fn pairs_of(level: &Level) -> Vec<[u32; 2]> {
    let entries = |row: usize| level.pattern.entries(row).map(move |entry| [row as u32, entry as u32]);
    (0..level.rows()).flat_map(entries).collect()
}

/// Edges at fixed rows have no weight, but leak.
fn refresh_finest(finest: &mut Level, rows: &Rows, changes: &mut Changes) {
    changes.weights.clear();
    changes.rows.clear();
    changes.rows.extend_from_slice(rows.changed());
    let fixed = rows.fixed();
    for row in rows.changed().iter().map(|&row| row as usize) {
        let (columns, weights) = rows.row(row);
        let mut leak = rows.link_sums()[row];
        for ((&column, &weight), entry) in columns.iter().zip(weights).zip(rows.entries(row)) {
            let held = fixed[column as usize];
            leak += if held { weight } else { 0.0 };
            let weight = if held || fixed[row] { 0.0 } else { weight as f32 };
            if finest.weights[entry].to_bits() != weight.to_bits() {
                finest.weights[entry] = weight;
                changes.weights.push([row as u32, entry as u32]);
            }
        }
        let (leak, diagonal) = if fixed[row] { (0.0, 0.0) } else { (leak, rows.diagonal()[row]) };
        finest.leak[row] = leak as f32;
        finest.set_diagonal(row, diagonal);
    }
}
