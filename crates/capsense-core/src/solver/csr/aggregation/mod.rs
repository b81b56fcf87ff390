//! Aggregation multigrid on any mesh: an approximate K⁻¹ in single precision.
//!
//! Aggregates are formed once, in the empty scene; their weights are refreshed where rows changed. A dielectric that
//! would float among its surroundings, which a single level resolves only after thousands of iterations, is a handful
//! of nodes on a coarse level.

mod aggregates;
mod coarsest;
mod krylov;
mod level;
mod transfer;

use super::columns::add;
use super::rows::Rows;
use crate::solver::workers::Workers;
use coarsest::Coarsest;
use level::{BLOCK, Level, Vectors};
use transfer::{Changes, Transfer};

/// A level with no more rows is solved exactly.
const FEW_ROWS: usize = 40;

/// So many levels below the finest are visited twice.
const TWICE: usize = 2;

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
    sums: Vec<[f64; L]>,
}

impl Hierarchy {
    /// Takes over the rows that changed; at the first call, all.
    pub(super) fn refresh(&mut self, rows: &Rows) {
        let first = self.levels.is_empty();
        if first {
            self.levels.push(Level::new(rows.len(), |row, found| {
                found.extend(rows.row(row).0.iter().filter(|&&other| (other as usize) < row));
            }));
            self.changes.push(Changes::default());
        }
        refresh_finest(&mut self.levels[0], rows, &mut self.changes[0]);
        if first {
            self.build();
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

    fn build(&mut self) {
        while let Some(fine) = self.levels.last().filter(|level| level.rows() > FEW_ROWS) {
            let (mut transfer, mut coarse) = Transfer::new(fine);
            if coarse.rows() == 0 || 10 * coarse.rows() > 9 * transfer.count() {
                break;
            }
            let all = Changes {
                edges: (0..fine.edges.len() as u32).collect(),
                rows: (0..fine.rows() as u32).collect(),
            };
            let mut changes = Changes::default();
            transfer.refresh(fine, &mut coarse, &all, &mut changes);
            self.levels.push(coarse);
            self.transfers.push(transfer);
            self.changes.push(changes);
        }
    }

    /// z = M (-kx) by one symmetric cycle, and the columns' zᵀ(-kx).
    pub(super) fn apply<const L: usize>(
        &self,
        kx: &[[f64; L]],
        work: &mut Work<L>,
        workers: &Workers,
    ) -> [f64; L] {
        let Work { levels, sums } = work;
        for (index, level) in self.levels.iter().enumerate().skip(levels.len()) {
            levels.push(Vectors::new(level.rows(), (1..=TWICE).contains(&index)));
        }
        let finest = &self.levels[0];
        sums.clear();
        sums.resize(finest.rows().div_ceil(BLOCK), [0.0; L]);
        let load = |row: usize| {
            let free = finest.inverse[row] != 0.0;
            Some(if free { kx[row].map(|kx| -kx as f32) } else { [0.0; L] })
        };
        let visit = |sum: &mut [f64; L], row: usize, z: &[f32; L]| {
            for lane in 0..L {
                sum[lane] -= kx[row][lane] * f64::from(z[lane]);
            }
        };
        self.cycle(0, levels, workers, load, sums, visit);
        let mut products = [0.0; L];
        sums.iter().for_each(|sum| add(&mut products, sum));
        products
    }

    fn cycle<const L: usize, S: Send>(
        &self,
        index: usize,
        levels: &mut [Vectors<L>],
        workers: &Workers,
        load: impl Fn(usize) -> Option<[f32; L]> + Sync,
        sums: &mut [S],
        visit: impl Fn(&mut S, usize, &[f32; L]) + Sync,
    ) {
        let Some((fine, coarser)) = levels.split_first_mut() else { return };
        let level = &self.levels[index];
        level.sweep_forward(fine, workers, load);
        if let (Some(transfer), Some(coarse)) = (self.transfers.get(index), coarser.first_mut()) {
            transfer.restrict(level, fine, coarse, workers);
            self.solve(index + 1, coarser, workers);
            transfer.prolong(fine, &coarser[0], workers);
        } else {
            fine.nodes.iter_mut().for_each(|node| node.r = [0.0; L]);
        }
        level.sweep_backward(fine, workers, sums, visit);
    }

    /// b = approximately K⁻¹ b on a coarse level.
    fn solve<const L: usize>(&self, index: usize, levels: &mut [Vectors<L>], workers: &Workers) {
        if index + 1 == self.levels.len() && self.coarsest.solve(&mut levels[0]) {
            return;
        }
        let cycle = |levels: &mut [Vectors<L>]| {
            // There is nothing to sum up; a list of nothing takes no memory.
            let mut sums = vec![(); self.levels[index].rows().div_ceil(BLOCK)];
            self.cycle(index, levels, workers, |_| None, &mut sums, |(), _, _| ());
        };
        match levels[0].krylov.take() {
            Some(mut krylov) => {
                krylov.solve(&self.levels[index], levels, cycle);
                levels[0].krylov = Some(krylov);
            }
            None => cycle(levels),
        }
    }
}

impl<const L: usize> Work<L> {
    /// What the last application made.
    pub(super) fn solution(&self) -> &[[f32; L]] {
        self.levels.first().map_or(&[], |finest| &finest.b)
    }

    pub(super) fn solution_mut(&mut self) -> Option<&mut [[f32; L]]> {
        self.levels.first_mut().map(|finest| finest.b.as_mut_slice())
    }
}

/// Edges at fixed rows have no weight, but leak.
fn refresh_finest(finest: &mut Level, rows: &Rows, changes: &mut Changes) {
    changes.edges.clear();
    changes.rows.clear();
    changes.rows.extend_from_slice(rows.changed());
    let fixed = rows.fixed();
    for row in rows.changed().iter().map(|&row| row as usize) {
        let (columns, weights) = rows.row(row);
        let mut leak = rows.link_sums()[row];
        for (&column, &weight) in columns.iter().zip(weights) {
            leak += if fixed[column as usize] { weight } else { 0.0 };
            if (column as usize) < row {
                let free = !fixed[row] && !fixed[column as usize];
                let weight = if free { weight as f32 } else { 0.0 };
                let found = finest.lower(row).find(|&edge| finest.edges[edge].row == column);
                if let Some(edge) = found
                    && finest.edges[edge].weight.to_bits() != weight.to_bits()
                {
                    finest.edges[edge].weight = weight;
                    changes.edges.push(edge as u32);
                }
            }
        }
        let (leak, diagonal) = if fixed[row] { (0.0, 0.0) } else { (leak, rows.diagonal()[row]) };
        finest.leak[row] = leak as f32;
        finest.set_diagonal(row, diagonal);
    }
}
