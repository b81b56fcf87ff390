//! Making a network coarser along one axis.
//!
//! Some planes across the axis are eliminated, never two neighbours. Along the axis the two edges of an eliminated node
//! are capacitors in series, the exact Schur complement of a line; what couples eliminated nodes to each other is divided
//! among the neighbours that they are interpolated from. A node at a fixed potential interpolates to zero and its edges
//! become leaks, so that no conductor is lost on a coarse level, however thin.
//!
//! Here is which planes are eliminated and what a change reaches; how rows are computed is in `coarse_row`, and their
//! arithmetic in `coarsening`.

use super::coarse_row::{CoarseRow, Refresh};
use super::layout::Layout;
use super::network::{Changed, Network};
use super::shares::Shares;
use pulp::Arch;
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
    /// What the eliminated nodes take from the previous and from the next node.
    pub(super) previous: Shares,
    pub(super) next: Shares,
    /// What the fine network becomes.
    pub(super) coarse: Network,
    /// Where the coarse network may have changed last, and where it did.
    pub(super) reached: Changed,
    pub(super) changed: Changed,
    /// A coarse row in the making.
    pub(super) row: CoarseRow,
}

impl Stage {
    /// Keeps the planes across `axis` for which `kept` holds; the first and last plane and one of any two neighbours
    /// must be kept. `layout` is that of the level that the stage starts from.
    pub(super) fn new(fine: [usize; 3], axis: usize, kept: &[bool], layout: &Layout) -> Self {
        let fine_plane: Vec<usize> = (0..kept.len()).filter(|&plane| kept[plane]).collect();
        let kept_before =
            (0..=kept.len()).map(|plane| fine_plane.partition_point(|&kept| kept < plane)).collect();
        let mut counts = fine;
        counts[axis] = fine_plane.len();
        Self {
            axis,
            kept_before,
            eliminated: kept.iter().map(|kept| !kept).collect(),
            fine_plane,
            previous: Shares::zeros(fine, counts, axis, layout),
            next: Shares::zeros(fine, counts, axis, layout),
            coarse: Network::new(counts),
            reached: Changed::nothing(counts),
            changed: Changed::nothing(counts),
            row: CoarseRow::new(fine[0], axis, kept),
        }
    }

    /// Zeros, as before the first refresh.
    pub(super) fn clear(&mut self) {
        self.previous.clear();
        self.next.clear();
        self.coarse.clear();
        self.row.clear();
    }

    /// Recomputes the coarse network where the fine one changed, and notes where that made a difference.
    pub(super) fn refresh(&mut self, arch: Arch, fine: &Network, changed: &Changed) {
        self.reached.clear();
        self.changed.clear();
        arch.dispatch(Refresh { stage: self, fine, changed });
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

    /// Where shares of eliminated nodes changed, that reaches their neighbours across the axis too, as what couples two
    /// eliminated nodes is divided by the shares of both.
    #[inline(always)]
    pub(super) fn reach_across(&mut self, nodes: Range<usize>, j: usize, k: usize) {
        let wider = nodes.start.saturating_sub(1)..nodes.end + 1;
        let rows = |plane| self.reach(plane..plane + 1);
        match self.axis {
            0 => self.reached.add_beside_row(self.reach(nodes), j, k),
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
        if next[what] == COUNTS[what] {
            return vec![];
        }
        fine.next[what][at] = value as f32;
        vec![node, next]
    }

    fn refresh(stage: &mut Stage, fine: &Network, nodes: &[[usize; 3]]) {
        let mut changed = Changed::nothing(COUNTS);
        nodes.iter().for_each(|&[i, j, k]| changed.add(i..i + 1, j, k));
        stage.refresh(Arch::new(), fine, &changed);
    }

    fn is_near(a: f32, b: f32) -> bool {
        a == b || (a - b).abs() < 0.0201 * a.max(b)
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
            let mut moving = Stage::new(COUNTS, axis, &kept, &layout);
            refresh(&mut moving, &fine, &all);
            for _ in 0..200 {
                let changed = change(&mut fine, all[noise(all.len())], noise(4), noise(10));
                refresh(&mut moving, &fine, &changed);
                let mut fresh = Stage::new(COUNTS, axis, &kept, &layout);
                refresh(&mut fresh, &fine, &all);
                assert_eq!(moving.previous.values, fresh.previous.values, "{axis} {changed:?}");
                assert_eq!(moving.next.values, fresh.next.values, "{axis} {changed:?}");
                let numbers =
                    |stage: &Stage| [stage.coarse.next.concat(), stage.coarse.leak.clone()].concat();
                for (a, b) in numbers(&moving).iter().zip(&numbers(&fresh)) {
                    assert!(is_near(*a, *b), "{axis} {changed:?}: {a} {b}");
                }
            }
        }
    }
}
