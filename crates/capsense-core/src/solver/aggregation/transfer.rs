//! From one level of the aggregation hierarchy to the next coarser one and back.
//!
//! Nodes that are strongly coupled in the empty scene form an aggregate, which is one coarse node; its value is taken by
//! all its members. The aggregates never change, so coarse weights are sums over fixed lists of fine ones (Galerkin's
//! product with a piecewise constant prolongator).

use super::level::{Level, NONE};
use crate::stiffness::LANES;

/// A neighbour is strongly coupled when its weight is at least this part of the node's largest.
const STRONG: f32 = 0.25;

/// Piecewise constant corrections are too stiff; stretching them by about this factor makes up for it (Braess 1995).
const STRETCH: f32 = 1.5;

/// The aggregates of a level.
#[derive(Clone, Debug)]
pub(super) struct Transfer {
    aggregate: Vec<u32>,
    members: Vec<Vec<u32>>,
    /// For each fine entry the coarse entry that it adds to; [`NONE`] within an aggregate.
    slot: Vec<u32>,
    dirty: Vec<bool>,
}

impl Transfer {
    /// Forms aggregates of the free nodes and the pattern of the coarse level.
    pub(super) fn new(fine: &Level) -> (Self, Level) {
        let (aggregate, count) = aggregates(fine);
        let mut members = vec![Vec::new(); count];
        for (node, &of) in aggregate.iter().enumerate() {
            if of != NONE {
                members[of as usize].push(node as u32);
            }
        }
        let neighbours: Vec<Vec<u32>> = members
            .iter()
            .enumerate()
            .map(|(own, members)| {
                let entries = members.iter().flat_map(|&node| fine.row(node as usize));
                let mut of: Vec<u32> = entries.map(|entry| aggregate[fine.columns[entry] as usize]).collect();
                of.sort_unstable();
                of.dedup();
                of.retain(|&other| other != NONE && other as usize != own);
                of
            })
            .collect();
        let coarse = Level::new(neighbours.into_iter());
        let mut slot = vec![NONE; fine.columns.len()];
        for (node, &own) in aggregate.iter().enumerate().filter(|(_, own)| **own != NONE) {
            let row = coarse.row(own as usize);
            for entry in fine.row(node) {
                let other = aggregate[fine.columns[entry] as usize];
                if let Ok(at) = coarse.columns[row.clone()].binary_search(&other) {
                    slot[entry] = (row.start + at) as u32;
                }
            }
        }
        (Self { aggregate, dirty: vec![false; members.len()], members, slot }, coarse)
    }

    /// Recomputes the coarse rows that the fine nodes in `changed` have a part in, and leaves their numbers there.
    pub(super) fn refresh(&mut self, fine: &Level, coarse: &mut Level, changed: &mut Vec<u32>) {
        let mut rows = Vec::new();
        for &node in changed.iter() {
            let neighbours = fine.row(node as usize).map(|entry| fine.columns[entry]);
            for node in neighbours.chain([node]) {
                let own = self.aggregate[node as usize];
                if own != NONE && !std::mem::replace(&mut self.dirty[own as usize], true) {
                    rows.push(own);
                }
            }
        }
        for &own in &rows {
            self.dirty[own as usize] = false;
            self.refresh_row(fine, coarse, own as usize);
        }
        *changed = rows;
    }

    fn refresh_row(&self, fine: &Level, coarse: &mut Level, own: usize) {
        let row = coarse.row(own);
        coarse.weights[row.clone()].fill(0.0);
        let (mut leak, mut free) = (0.0, false);
        for node in self.members[own].iter().map(|&node| node as usize).filter(|&node| fine.is_free(node)) {
            free = true;
            leak += f64::from(fine.leak[node]);
            for entry in fine.row(node) {
                let (other, weight) = (fine.columns[entry] as usize, fine.weights[entry]);
                if !fine.is_free(other) {
                    leak += f64::from(weight);
                } else if self.slot[entry] != NONE {
                    coarse.weights[self.slot[entry] as usize] += weight;
                }
            }
        }
        let diagonal = leak + coarse.weights[row].iter().map(|&weight| f64::from(weight)).sum::<f64>();
        coarse.leak[own] = leak as f32;
        coarse.inverse[own] = if free && diagonal > 0.0 { (1.0 / diagonal) as f32 } else { 0.0 };
    }

    /// The coarse right-hand side: the sum of the members' residuals.
    pub(super) fn restrict(&self, fine: &Level, coarse: &mut Level) {
        for (b, members) in coarse.b.iter_mut().zip(&self.members) {
            *b = [0.0; LANES];
            for &node in members {
                if fine.is_free(node as usize) {
                    b.iter_mut().zip(&fine.r[node as usize]).for_each(|(b, r)| *b += r);
                }
            }
        }
    }

    /// Every free member takes its aggregate's correction.
    pub(super) fn prolong(&self, fine: &mut Level, coarse: &Level) {
        for (correction, members) in coarse.x.iter().zip(&self.members) {
            for &node in members {
                if fine.is_free(node as usize) {
                    fine.x[node as usize].iter_mut().zip(correction).for_each(|(x, c)| *x += STRETCH * c);
                }
            }
        }
    }
}

/// The aggregate of each node and their number. First every node none of whose strong neighbours is taken founds one
/// with them; then each node left over joins the one it is coupled to most.
fn aggregates(level: &Level) -> (Vec<u32>, usize) {
    let mut aggregate = vec![NONE; level.nodes()];
    let mut count = 0;
    let neighbours = |node: usize| {
        level
            .row(node)
            .map(|entry| (level.columns[entry] as usize, level.weights[entry]))
            .filter(|n| level.is_free(n.0))
    };
    let free = |node: &usize| level.is_free(*node);
    for node in (0..level.nodes()).filter(free) {
        let largest = neighbours(node).map(|(_, weight)| weight).fold(0.0, f32::max);
        let strong = || neighbours(node).filter(|&(_, weight)| weight > 0.0 && weight >= STRONG * largest);
        if aggregate[node] == NONE && strong().all(|(other, _)| aggregate[other] == NONE) {
            aggregate[node] = count;
            strong().for_each(|(other, _)| aggregate[other] = count);
            count += 1;
        }
    }
    let founded = aggregate.clone();
    for node in (0..level.nodes()).filter(free).filter(|&node| founded[node] == NONE) {
        let taken = neighbours(node).filter(|&(other, _)| founded[other] != NONE);
        let best = taken.reduce(|best, next| if next.1 > best.1 { next } else { best });
        aggregate[node] = best.map_or(count, |(other, _)| founded[other]);
        count += u32::from(best.is_none());
    }
    (aggregate, count as usize)
}
