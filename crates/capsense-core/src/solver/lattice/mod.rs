//! Geometric multigrid on the tensor lattice: an approximate K⁻¹ in single precision.
//!
//! A graded lattice has cells stretched in every direction somewhere. Point smoothing alone fails on them, so levels
//! are made coarser where spacing is small: each step merges only those neighbouring cells of one axis that together
//! are no longer than a length which doubles from step to step. Cells become more equal from level to level, and errors
//! that a level cannot smooth along a short spacing are smooth on the level where that spacing is gone.

mod level;
mod transfer;

use crate::mesh::Lattice;
use crate::stiffness::{LANES, Lane, StiffnessMatrix};
use level::Level;
use transfer::{IndexBox, Transfer};

/// Merged cells may exceed the length of a step by this factor, so that equal cells merge in spite of rounding.
const SLACK: f64 = 1.05;

/// An axis with no more planes than this is coarse enough.
const FEW_PLANES: usize = 4;

/// Symmetric Gauss-Seidel sweeps on the coarsest level.
const COARSEST_SWEEPS: usize = 4;

/// The hierarchy of a lattice.
#[derive(Clone, Debug)]
pub(super) struct LatticeMultigrid {
    /// From fine to coarse.
    levels: Vec<Level>,
    transfers: Vec<Transfer>,
}

impl LatticeMultigrid {
    /// Plans the levels; weights come with [`LatticeMultigrid::refresh`].
    pub(super) fn new(lattice: &Lattice) -> Self {
        let mut planes = lattice.axes().clone();
        let mut levels = vec![Level::new(lattice.node_counts())];
        let mut transfers = Vec::new();
        let spacings = planes.iter().flat_map(|axis| axis.windows(2)).map(|pair| pair[1] - pair[0]);
        let mut length = spacings.fold(f64::INFINITY, f64::min);
        while planes.iter().any(|axis| axis.len() > FEW_PLANES) {
            length *= 2.0;
            for (axis, planes) in planes.iter_mut().enumerate() {
                let kept = kept_planes(planes, length * SLACK);
                if kept.contains(&false) {
                    let fine = &levels[levels.len() - 1];
                    let transfer = Transfer::new(fine, axis, &kept);
                    levels.push(Level::new(transfer.coarse_counts(fine)));
                    transfers.push(transfer);
                    let mut kept = kept.into_iter();
                    planes.retain(|_| kept.next().unwrap_or(true));
                }
            }
        }
        Self { levels, transfers }
    }

    /// Takes over the matrix and the fixed rows. Only what depends on the given nodes is recomputed: all nodes whose
    /// row or state changed, and those with links before or now.
    pub(super) fn refresh(
        &mut self,
        matrix: &StiffnessMatrix,
        fixed: &[bool],
        changed: impl Iterator<Item = u32>,
    ) {
        let [nx, ny, _] = self.levels[0].counts;
        let place = |node: usize| [node % nx, node / nx % ny, node / (nx * ny)];
        let nowhere = || std::ops::Range { start: usize::MAX, end: 0 };
        let mut region: IndexBox = std::array::from_fn(|_| nowhere());
        for node in changed {
            for (range, at) in region.iter_mut().zip(place(node as usize)) {
                *range = range.start.min(at)..range.end.max(at + 1);
            }
        }
        if region[0].is_empty() {
            return;
        }
        self.refresh_finest(matrix, fixed, &region);
        for (index, transfer) in self.transfers.iter_mut().enumerate() {
            let (fine, coarse) = self.levels.split_at_mut(index + 1);
            region = transfer.refresh(&fine[index], &mut coarse[0], &region);
        }
    }
}

impl LatticeMultigrid {
    fn refresh_finest(&mut self, matrix: &StiffnessMatrix, fixed: &[bool], region: &IndexBox) {
        let level = &mut self.levels[0];
        let first = level.nodes().start;
        let each = |level: &mut Level, margin: usize, visit: &mut dyn FnMut(&mut Level, usize)| {
            for k in region[2].start.saturating_sub(margin)..region[2].end {
                for j in region[1].start.saturating_sub(margin)..region[1].end {
                    for i in region[0].start.saturating_sub(margin)..region[0].end {
                        let at = level.index([i, j, k]);
                        visit(level, at);
                    }
                }
            }
        };
        // An edge's weight stands at its first node, one before the nodes that changed.
        each(level, 1, &mut |level, at| {
            for (axis, weight) in level.weight.iter_mut().enumerate() {
                weight[at] = matrix.lattice_weight(at - first, axis) as f32;
            }
            level.leak[at] = matrix.link_weight(at - first) as f32;
        });
        each(level, 0, &mut |level, at| {
            let free = if fixed[at - first] { 0.0 } else { 1.0 };
            level.inverse[at] = free / matrix.diagonal(at - first) as f32;
        });
    }

    /// z = M r on node rows, zero on object rows, and the columns' r·z: one symmetric V-cycle.
    pub(super) fn apply(&mut self, r: &[Lane], z: &mut [Lane]) -> Lane {
        let nodes = self.levels[0].nodes();
        for (b, r) in self.levels[0].b[nodes.clone()].iter_mut().zip(r) {
            *b = r.map(|r| r as f32);
        }
        self.cycle();
        let mut products = [0.0; LANES];
        z[nodes.len()..].fill([0.0; LANES]);
        for ((z, x), r) in z.iter_mut().zip(&self.levels[0].x[nodes]).zip(r) {
            for lane in 0..LANES {
                z[lane] = f64::from(x[lane]);
                products[lane] += r[lane] * z[lane];
            }
        }
        products
    }

    fn cycle(&mut self) {
        for (index, transfer) in self.transfers.iter().enumerate() {
            let (fine, coarse) = self.levels.split_at_mut(index + 1);
            fine[index].smooth_from_zero();
            transfer.restrict(&fine[index], &mut coarse[0]);
        }
        if let Some(coarsest) = self.levels.last_mut() {
            coarsest.x.fill([0.0; LANES]);
            for _ in 0..COARSEST_SWEEPS {
                coarsest.smooth_forward();
                coarsest.smooth_backward();
            }
        }
        for (index, transfer) in self.transfers.iter().enumerate().rev() {
            let (fine, coarse) = self.levels.split_at_mut(index + 1);
            transfer.prolong(&mut fine[index], &coarse[0]);
            fine[index].smooth_backward();
        }
    }
}

/// Merges neighbouring cells that together are at most so long, each with one neighbour at most.
fn kept_planes(planes: &[f64], length: f64) -> Vec<bool> {
    let mut kept = vec![true; planes.len()];
    let mut start = 0;
    while start + 2 < planes.len() {
        let merge = planes[start + 2] - planes[start] <= length;
        kept[start + 1] = !merge;
        start += if merge { 2 } else { 1 };
    }
    kept
}
