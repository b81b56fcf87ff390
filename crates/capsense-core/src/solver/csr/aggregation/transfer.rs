//! From one level of the aggregation hierarchy to the next coarser one and back.
//!
//! Nodes that are strongly coupled in the empty scene form an aggregate, which is one coarse node; its value is taken by
//! all its members. The aggregates never change, so coarse weights are sums over fixed lists of fine ones (Galerkin's
//! product with a piecewise constant prolongator).

use super::aggregates::aggregates;
use super::level::{Level, NONE, Vectors};
use crate::solver::workers::{TASK_ROWS, Workers, vectorised};
use std::ops::Range;

/// Piecewise constant corrections are too stiff; stretching them by about this factor makes up for it (Braess 1995).
const STRETCH: f32 = 1.5;

/// The aggregates of a level.
#[derive(Clone, Debug)]
pub(super) struct Transfer {
    /// Of each fine row; [`NONE`] where the potential was fixed from the first.
    aggregate: Vec<u32>,
    members: Lists,
    /// For each fine edge the coarse edge that it is part of; [`NONE`] within an aggregate.
    coarse_edge: Vec<u32>,
    /// The fine edges of each coarse one.
    parts: Lists,
    /// The coarse edges of each coarse row, to lower and to higher ones.
    around: Lists,
    /// The ends of each coarse edge.
    ends: Vec<[u32; 2]>,
    edge_marked: Vec<bool>,
    row_marked: Vec<bool>,
}

/// What changed on a level.
#[derive(Clone, Debug, Default)]
pub(super) struct Changes {
    pub(super) edges: Vec<u32>,
    pub(super) rows: Vec<u32>,
}

/// A list of numbers for each of several things.
#[derive(Clone, Debug)]
struct Lists {
    offsets: Vec<u32>,
    numbers: Vec<u32>,
}

impl Lists {
    /// Sorts what belongs to [`NONE`] out, keeps the order of the rest.
    fn new(count: usize, owners: impl Iterator<Item = (u32, u32)> + Clone) -> Self {
        let mut offsets = vec![0; count + 1];
        let owned = owners.filter(|(owner, _)| *owner != NONE);
        owned.clone().for_each(|(owner, _)| offsets[owner as usize + 1] += 1);
        (0..count).for_each(|owner| offsets[owner + 1] += offsets[owner]);
        let mut next = offsets.clone();
        let mut numbers = vec![0; offsets[count] as usize];
        for (owner, number) in owned {
            let place = &mut next[owner as usize];
            numbers[*place as usize] = number;
            *place += 1;
        }
        Self { offsets, numbers }
    }

    #[inline(always)]
    fn of(&self, owner: usize) -> &[u32] {
        let range: Range<usize> = self.offsets[owner] as usize..self.offsets[owner + 1] as usize;
        &self.numbers[range]
    }
}

impl Transfer {
    /// Forms aggregates and the pattern of the coarse level.
    pub(super) fn new(fine: &Level) -> (Self, Level) {
        let (aggregate, count) = aggregates(fine);
        let members = Lists::new(count, aggregate.iter().copied().zip(0..));
        let higher_aggregate = |row: usize, edge: usize| {
            let (a, b) = (aggregate[row], aggregate[fine.edges[edge].row as usize]);
            (a != b && a != NONE && b != NONE).then(|| (a.max(b), a.min(b)))
        };
        let mut pairs: Vec<(u32, u32)> = (0..fine.rows())
            .flat_map(|row| fine.lower(row).map(move |edge| (row, edge)))
            .filter_map(|(row, edge)| higher_aggregate(row, edge))
            .collect();
        pairs.sort_unstable();
        pairs.dedup();
        let lower_of = Lists::new(count, pairs.iter().copied());
        let coarse = Level::new(count, |row, found| found.extend(lower_of.of(row)));
        let mut ends = vec![[0; 2]; coarse.edges.len()];
        let mut coarse_edge = vec![NONE; fine.edges.len()];
        for row in 0..count {
            coarse.lower(row).for_each(|edge| ends[edge] = [row as u32, coarse.edges[edge].row]);
        }
        for row in 0..fine.rows() {
            for edge in fine.lower(row) {
                if let Some((high, low)) = higher_aggregate(row, edge) {
                    let found = coarse.lower(high as usize).find(|&edge| coarse.edges[edge].row == low);
                    coarse_edge[edge] = found.map_or(NONE, |edge| edge as u32);
                }
            }
        }
        let parts = Lists::new(ends.len(), coarse_edge.iter().copied().zip(0..));
        let both_ends = ends.iter().zip(0..).flat_map(|(ends, edge)| ends.map(|row| (row, edge)));
        let around = Lists::new(count, both_ends);
        let (edge_marked, row_marked) = (vec![false; ends.len()], vec![false; count]);
        (Self { aggregate, members, coarse_edge, parts, around, ends, edge_marked, row_marked }, coarse)
    }

    /// Number of members of all aggregates.
    pub(super) fn count(&self) -> usize {
        self.members.numbers.len()
    }

    /// Recomputes what changed on the coarse level, and what that is.
    pub(super) fn refresh(&mut self, fine: &Level, coarse: &mut Level, from: &Changes, to: &mut Changes) {
        to.edges.clear();
        to.rows.clear();
        for &edge in &from.edges {
            mark(self.coarse_edge[edge as usize], &mut self.edge_marked, &mut to.edges);
        }
        for &row in &from.rows {
            mark(self.aggregate[row as usize], &mut self.row_marked, &mut to.rows);
        }
        for &edge in &to.edges {
            self.edge_marked[edge as usize] = false;
            let parts = self.parts.of(edge as usize).iter();
            let sum: f64 = parts.map(|&part| f64::from(fine.edges[part as usize].weight)).sum();
            coarse.edges[edge as usize].weight = sum as f32;
            for row in self.ends[edge as usize] {
                mark(row, &mut self.row_marked, &mut to.rows);
            }
        }
        for &row in &to.rows {
            self.row_marked[row as usize] = false;
            let row = row as usize;
            let leak: f64 =
                self.members.of(row).iter().map(|&member| f64::from(fine.leak[member as usize])).sum();
            let around = self.around.of(row).iter();
            let outward: f64 = around.map(|&edge| f64::from(coarse.edges[edge as usize].weight)).sum();
            coarse.leak[row] = leak as f32;
            coarse.set_diagonal(row, leak + outward);
        }
    }

    /// The coarse right-hand side: the sum of the members' residuals.
    pub(super) fn restrict<const L: usize>(
        &self,
        level: &Level,
        fine: &Vectors<L>,
        coarse: &mut Vectors<L>,
        workers: &Workers,
    ) {
        let tasks = coarse.b.chunks_mut(TASK_ROWS).zip((0..).step_by(TASK_ROWS));
        workers.for_each(tasks, |(b, first)| {
            vectorised(
                #[inline(always)]
                || {
                    for (b, row) in b.iter_mut().zip(first..) {
                        *b = [0.0; L];
                        for &member in self.members.of(row) {
                            let r = &fine.nodes[member as usize].r;
                            for lane in 0..L {
                                b[lane] += r[lane];
                            }
                            level.gather_far(member as usize, &fine.nodes, b);
                        }
                    }
                },
            );
        });
    }

    /// Every member takes its aggregate's correction, stretched. Leaves the residuals zero.
    pub(super) fn prolong<const L: usize>(
        &self,
        fine: &mut Vectors<L>,
        coarse: &Vectors<L>,
        workers: &Workers,
    ) {
        let tasks = fine.nodes.chunks_mut(TASK_ROWS).zip(self.aggregate.chunks(TASK_ROWS));
        workers.for_each(tasks, |(nodes, aggregates)| {
            for (node, &aggregate) in nodes.iter_mut().zip(aggregates) {
                node.r = [0.0; L];
                if let Some(correction) = coarse.b.get(aggregate as usize) {
                    node.x.iter_mut().zip(correction).for_each(|(x, correction)| *x += STRETCH * correction);
                }
            }
        });
    }
}

/// Notes a number once; not [`NONE`].
fn mark(number: u32, marked: &mut [bool], list: &mut Vec<u32>) {
    if let Some(marked) = marked.get_mut(number as usize)
        && !std::mem::replace(marked, true)
    {
        list.push(number);
    }
}
