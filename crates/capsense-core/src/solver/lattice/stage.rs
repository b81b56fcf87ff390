//! Making a network coarser along one axis.
//!
//! Some planes across the axis are eliminated, never two neighbours. Along the axis the two edges of an eliminated node
//! are capacitors in series, the exact Schur complement of a line; what couples eliminated nodes to each other is divided
//! among the neighbours that they are interpolated from. A node at a fixed potential interpolates to zero and its edges
//! become leaks, so that no conductor is lost on a coarse level, however thin.
//!
//! Here is which planes are eliminated and what a change reaches; how rows are computed is in `coarse_row`, their
//! arithmetic in `coarsening`, and how threads share them in `collection`.

use super::coarse_row::{CoarseRow, Share};
use super::collection::{Made, Room, TASKS_OF_A_THREAD, tasks};
use super::layout::Layout;
use super::network::{Changed, Network, place};
use super::picks::Picks;
use super::shares::Shares;
use crate::instructions::EightLanes;
use crate::workers::Workers;
use std::ops::Range;

/// One axis made coarser.
#[derive(Clone, Debug)]
pub(super) struct Stage {
    pub(super) axis: usize,
    /// How many planes before each fine plane, and before the end, are kept.
    kept_before: Vec<usize>,
    eliminated: Vec<bool>,
    /// The fine plane of each coarse plane.
    pub(super) fine_plane: Vec<usize>,
    /// Across x, the nodes of fine rows that are coarse.
    pub(super) picks: Picks,
    /// What the eliminated nodes take from the previous and from the next node.
    pub(super) previous: Shares,
    pub(super) next: Shares,
    /// Where the coarse network may have changed last.
    pub(super) reached: Changed,
    /// The distances between neighbours in the coarse network.
    strides: [usize; 3],
    /// What the fine network becomes.
    made: Made,
}

impl Stage {
    /// Keeps the planes across `axis` for which `kept` holds; the first and last plane and one of any two neighbours
    /// must be kept. `layout` is that of the level that the stage starts from.
    pub(super) fn new(fine: [usize; 3], axis: usize, kept: &[bool], layout: &Layout, threads: usize) -> Self {
        let fine_plane: Vec<usize> = (0..kept.len()).filter(|&plane| kept[plane]).collect();
        let kept_before =
            (0..=kept.len()).map(|plane| fine_plane.partition_point(|&kept| kept < plane)).collect();
        let mut counts = fine;
        counts[axis] = fine_plane.len();
        let coarse = Network::new(counts);
        let tasks = if threads == 1 { 1 } else { threads * TASKS_OF_A_THREAD };
        let rooms = vec![Room::new(CoarseRow::new(fine[0], axis, kept)); tasks];
        Self {
            axis,
            kept_before,
            eliminated: kept.iter().map(|kept| !kept).collect(),
            picks: Picks::new(if axis == 0 { &fine_plane } else { &[] }),
            fine_plane,
            previous: Shares::zeros(fine, axis, kept, layout),
            next: Shares::zeros(fine, axis, kept, layout),
            reached: Changed::nothing(counts),
            strides: coarse.strides,
            made: Made { coarse, changed: Changed::nothing(counts), rooms },
        }
    }

    /// Zeros, as before the first refresh.
    pub(super) fn clear(&mut self) {
        self.previous.clear();
        self.next.clear();
        self.made.coarse.clear();
        self.made.rooms.iter_mut().for_each(|room| room.row.clear());
    }

    /// Gives back the room that the first refresh took.
    pub(super) fn settle(&mut self) {
        self.reached.release();
        self.made.settle();
    }

    /// Recomputes the coarse network where the fine one changed, and notes where that made a difference.
    pub(super) fn refresh(&mut self, workers: &Workers, arch: EightLanes, fine: &Network, changed: &Changed) {
        self.reached.clear();
        let mut made = std::mem::take(&mut self.made);
        if let Some(Room { row, .. }) = made.rooms.first_mut() {
            arch.dispatch(Share { stage: self, row, fine, changed });
        }
        if tasks(self.reached.rows(), made.rooms.len()) > 1 {
            self.reached.sort();
        }
        made.collect(workers, arch, self, fine);
        self.made = made;
    }

    /// What the fine network becomes, and where that changed last.
    pub(super) fn coarse(&self) -> (&Network, &Changed) {
        (&self.made.coarse, &self.made.changed)
    }

    /// Place of a node in the coarse network.
    #[inline(always)]
    pub(super) fn place_in_coarse(&self, node: [usize; 3]) -> usize {
        place(self.strides, node)
    }

    /// What changes at a node that is kept reaches the coarse node at it, and nothing else: where a weight to an eliminated
    /// node changed, that node is among the changed ones too. What changes at an eliminated node reaches the two nodes
    /// beside it.
    #[inline(always)]
    pub(super) fn reach_beside(&mut self, nodes: Range<usize>, j: usize, k: usize) {
        let rows = |plane| self.reach(plane..plane + 1);
        match self.axis {
            0 => self.reached.add(self.reach(nodes), j, k),
            1 => rows(j).for_each(|j| self.reached.add(nodes.clone(), j, k)),
            _ => rows(k).for_each(|k| self.reached.add(nodes.clone(), j, k)),
        }
    }

    /// Where shares of eliminated nodes changed, that reaches besides their neighbours across the axis, as what couples two
    /// eliminated nodes is divided by the shares of both.
    #[inline(always)]
    pub(super) fn reach_across(&mut self, nodes: Range<usize>, j: usize, k: usize) {
        let wider = nodes.start.saturating_sub(1)..nodes.end + 1;
        let rows = |plane| self.reach(plane..plane + 1);
        match self.axis {
            0 => {
                let nodes = self.reach(nodes);
                self.reached.add(nodes.clone(), j, k);
                self.reached.add_beside_row(nodes, j, k);
            }
            1 => {
                for j in rows(j) {
                    self.reached.add(wider.clone(), j, k);
                    self.reached.add(nodes.clone(), j, k + 1);
                    self.reached.add(nodes.clone(), j, k.wrapping_sub(1));
                }
            }
            _ => {
                for k in rows(k) {
                    self.reached.add(wider.clone(), j, k);
                    self.reached.add(nodes.clone(), j + 1, k);
                    self.reached.add(nodes.clone(), j.wrapping_sub(1), k);
                }
            }
        }
    }

    /// The coarse planes that some fine planes reach: at them, or beside them where they are eliminated.
    #[inline(always)]
    pub(super) fn reach(&self, fine: Range<usize>) -> Range<usize> {
        let before = usize::from(self.is_eliminated(fine.start));
        let after = usize::from(self.is_eliminated(fine.end - 1));
        self.kept_before[fine.start] - before..self.kept_before[fine.end] + after
    }

    /// The fine node that a coarse node is.
    #[inline(always)]
    pub(super) fn fine_node(&self, mut at: [usize; 3]) -> [usize; 3] {
        at[self.axis] = self.fine_plane[at[self.axis]];
        at
    }

    /// The coarse planes at a fine one, or before and after it.
    #[inline(always)]
    pub(super) fn around(&self, fine: usize) -> [usize; 2] {
        let before = self.kept_before[fine];
        if self.is_eliminated(fine) { [before - 1, before] } else { [before, before] }
    }

    #[inline(always)]
    pub(super) fn is_eliminated(&self, plane: usize) -> bool {
        self.eliminated.get(plane) == Some(&true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COUNTS: [usize; 3] = [19, 9, 10];

    /// Numbers without a pattern.
    fn noise() -> impl FnMut(usize) -> usize {
        let mut state = 11_u64;
        move |below| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as usize % below
        }
    }

    /// Changes the leak of a node or, for an axis, its weight to the next one. Returns the nodes that have changed.
    fn change(fine: &mut Network, node: [usize; 3], what: usize, value: usize) -> Vec<[usize; 3]> {
        let at = fine.index(node);
        if what == 3 {
            fine.leak[at] = [0.0, 0.0, 0.5, f32::INFINITY][value % 4];
            return vec![node];
        }
        let mut next = node;
        next[what] += 1;
        if next[what] == fine.counts[what] {
            return vec![];
        }
        fine.next[what][at] = value as f32;
        vec![node, next]
    }

    fn refresh(stage: &mut Stage, fine: &Network, nodes: &[[usize; 3]]) {
        let mut changed = Changed::nothing(COUNTS);
        nodes.iter().for_each(|&[i, j, k]| changed.add(i..i + 1, j, k));
        stage.refresh(&Workers::default(), EightLanes::new(), fine, &changed);
    }

    fn is_near(a: f32, b: f32) -> bool {
        a == b || (a - b).abs() < 0.0501 * a.max(b)
    }

    /// Shares follow every change, coarse numbers all but negligible ones.
    #[test]
    fn a_change_reaches_all_that_depends_on_it() {
        let (layout, mut noise) = (Layout::new(COUNTS, [0, 0]), noise());
        let all: Vec<[usize; 3]> = (0..COUNTS.iter().product()).map(|node| layout.indices(node)).collect();
        for (axis, planes) in COUNTS.into_iter().enumerate() {
            let kept: Vec<bool> = (0..planes).map(|plane| ![1, 4, 6].contains(&plane)).collect();
            let mut fine = Network::new(COUNTS);
            for &node in &all {
                (0..4).for_each(|what| drop(change(&mut fine, node, what, 1 + noise(9))));
            }
            let mut moving = Stage::new(COUNTS, axis, &kept, &layout, 1);
            refresh(&mut moving, &fine, &all);
            for _ in 0..200 {
                let changed = change(&mut fine, all[noise(all.len())], noise(4), noise(10));
                refresh(&mut moving, &fine, &changed);
                let mut fresh = Stage::new(COUNTS, axis, &kept, &layout, 1);
                refresh(&mut fresh, &fine, &all);
                assert_eq!(moving.previous.values, fresh.previous.values, "{axis} {changed:?}");
                assert_eq!(moving.next.values, fresh.next.values, "{axis} {changed:?}");
                let numbers = |stage: &Stage| {
                    [stage.made.coarse.next.concat(), stage.made.coarse.leak.clone()].concat()
                };
                for (a, b) in numbers(&moving).iter().zip(&numbers(&fresh)) {
                    assert!(is_near(*a, *b), "{axis} {changed:?}: {a} {b}");
                }
            }
        }
    }

    /// Links to edges of conductors may be below zero: eliminated nodes never take more than there is, and coarse nodes leak.
    #[test]
    fn links_below_zero_do_not_outweigh_neighbours() {
        let layout = Layout::new(COUNTS, [0, 0]);
        let all: Vec<[usize; 3]> = (0..COUNTS.iter().product()).map(|node| layout.indices(node)).collect();
        for (axis, planes) in COUNTS.into_iter().enumerate() {
            let kept: Vec<bool> = (0..planes).map(|plane| ![1, 4, 6].contains(&plane)).collect();
            let (mut fine, mut noise) = (contrasts(COUNTS), noise());
            for &node in &all {
                let at = fine.index(node);
                fine.leak[at] = [-2.0, -3.0, 0.0, 1.0][noise(4)];
            }
            let mut stage = Stage::new(COUNTS, axis, &kept, &layout, 1);
            refresh(&mut stage, &fine, &all);
            let shares = stage.previous.values.iter().zip(&stage.next.values);
            assert!(
                shares.into_iter().all(|(previous, next)| (0.0..=1.000_001).contains(&(previous + next)))
            );
            assert!(stage.coarse().0.leak.iter().all(|leak| (0.0..1e7).contains(leak)), "{axis}");
        }
    }

    /// Weights without any pattern, some of them much larger than others, and nothing that leads to fixed potentials.
    fn contrasts(counts: [usize; 3]) -> Network {
        let (layout, mut noise) = (Layout::new(counts, [0, 0]), noise());
        let mut fine = Network::new(counts);
        for node in 0..counts.iter().product() {
            let node = layout.indices(node);
            (0..3).for_each(|axis| drop(change(&mut fine, node, axis, [1, 2, 80, 1_000_000][noise(4)])));
        }
        fine
    }

    /// Bodies of high permittivity do not become grounded, wherever their surfaces are.
    #[test]
    fn where_no_potential_is_fixed_nothing_leaks() {
        let layout = Layout::new(COUNTS, [0, 0]);
        let all: Vec<[usize; 3]> = (0..COUNTS.iter().product()).map(|node| layout.indices(node)).collect();
        let fine = contrasts(COUNTS);
        for (axis, planes) in COUNTS.into_iter().enumerate() {
            let kept: Vec<bool> = (0..planes).map(|plane| ![1, 4, 6].contains(&plane)).collect();
            let mut stage = Stage::new(COUNTS, axis, &kept, &layout, 1);
            refresh(&mut stage, &fine, &all);
            let (coarse, _) = stage.coarse();
            let leak = coarse.leak.iter().copied().fold(0.0, f32::max);
            assert!(
                leak < 1e-3 && coarse.next.iter().flatten().all(|weight| *weight >= 0.0),
                "{axis} {leak}"
            );
        }
    }

    /// As many threads as there are rows enough for compute the same bits as one.
    #[test]
    fn threads_share_the_rows_without_a_trace() {
        let counts = [11, 20, 30];
        assert!(tasks(counts[1] * counts[2], 8) > 2);
        let layout = Layout::new(counts, [0, 0]);
        let (fine, workers) = (contrasts(counts), Workers::new(2, 1_000_000));
        let _awake = workers.wake_all();
        let kept: Vec<bool> = (0..counts[0]).map(|plane| ![1, 4, 6].contains(&plane)).collect();
        let numbers = |workers: &Workers, threads: usize| {
            let mut stage = Stage::new(counts, 0, &kept, &layout, threads);
            let mut changed = Changed::nothing(counts);
            // From above, so that rows do not come in the order of memory.
            for k in (0..counts[2]).rev() {
                (0..counts[1]).for_each(|j| changed.add(0..counts[0], j, k));
            }
            stage.refresh(workers, EightLanes::new(), &fine, &changed);
            [stage.made.coarse.next.concat(), stage.made.coarse.leak].concat()
        };
        assert_eq!(numbers(&workers, 2), numbers(&Workers::default(), 1));
    }
}
