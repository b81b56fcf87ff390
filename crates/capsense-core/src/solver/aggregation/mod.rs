//! Aggregation multigrid on any mesh: an approximate K⁻¹ in single precision.
//!
//! Aggregates are formed once, in the empty scene; their weights are refreshed where rows changed. A dielectric that
//! would float among its surroundings, which a single level resolves only after thousands of iterations, is a handful
//! of nodes on a coarse level.

mod level;
mod transfer;

use super::preconditioner::products;
use crate::stiffness::{LANES, Lane, Lane32, StiffnessMatrix};
use level::Level;
use transfer::Transfer;

/// A level with no more nodes is not made coarser.
const FEW_NODES: usize = 40;

/// Symmetric Gauss-Seidel sweeps on the coarsest level.
const COARSEST_SWEEPS: usize = 8;

/// The hierarchy of a mesh. It has no levels before the first refresh.
#[derive(Clone, Debug, Default)]
pub(super) struct AggregationMultigrid {
    /// From fine to coarse.
    levels: Vec<Level>,
    transfers: Vec<Transfer>,
    changed: Vec<u32>,
}

impl AggregationMultigrid {
    /// Takes over the matrix and the fixed rows; at the first call, everything. `changed` must hold all nodes whose row
    /// or state changed.
    pub(super) fn refresh(
        &mut self,
        matrix: &StiffnessMatrix,
        fixed: &[bool],
        changed: impl Iterator<Item = u32>,
    ) {
        let first = self.levels.is_empty();
        if first {
            let row = |node| matrix.row(node).map(|(other, _)| other as u32).collect();
            self.levels.push(Level::new((0..matrix.nodes()).map(row)));
        }
        self.changed.clear();
        self.changed.extend(changed);
        let finest = &mut self.levels[0];
        for node in self.changed.iter().map(|&node| node as usize) {
            for (entry, (_, weight)) in finest.row(node).zip(matrix.row(node)) {
                finest.weights[entry] = weight as f32;
            }
            finest.leak[node] = matrix.link_weight(node) as f32;
            finest.inverse[node] = if fixed[node] { 0.0 } else { (1.0 / matrix.diagonal(node)) as f32 };
        }
        if first {
            self.build();
        } else {
            for (index, transfer) in self.transfers.iter_mut().enumerate() {
                let (fine, coarse) = self.levels.split_at_mut(index + 1);
                transfer.refresh(&fine[index], &mut coarse[0], &mut self.changed);
            }
        }
    }

    fn build(&mut self) {
        while let Some(fine) = self.levels.last().filter(|level| level.nodes() > FEW_NODES) {
            let (mut transfer, mut coarse) = Transfer::new(fine);
            if 10 * coarse.nodes() > 9 * fine.nodes() {
                break;
            }
            let mut all = (0..fine.nodes() as u32).collect();
            transfer.refresh(fine, &mut coarse, &mut all);
            self.levels.push(coarse);
            self.transfers.push(transfer);
        }
    }

    /// z = M r on node rows by one symmetric V-cycle, and the columns' r·z.
    pub(super) fn apply(&mut self, r: &[Lane]) -> (&mut [Lane32], Lane) {
        for (b, r) in self.levels[0].b.iter_mut().zip(r) {
            *b = r.map(|r| r as f32);
        }
        for (index, transfer) in self.transfers.iter().enumerate() {
            let (fine, coarse) = self.levels.split_at_mut(index + 1);
            fine[index].smooth_from_zero();
            transfer.restrict(&fine[index], &mut coarse[0]);
        }
        if let Some(coarsest) = self.levels.last_mut() {
            coarsest.x.fill([0.0; LANES]);
            (0..COARSEST_SWEEPS).for_each(|_| coarsest.smooth_both_ways());
        }
        for (index, transfer) in self.transfers.iter().enumerate().rev() {
            let (fine, coarse) = self.levels.split_at_mut(index + 1);
            transfer.prolong(&mut fine[index], &coarse[0]);
            fine[index].smooth_backward();
        }
        let z = &mut self.levels[0].x;
        let products = products(r, z);
        (z, products)
    }
}
