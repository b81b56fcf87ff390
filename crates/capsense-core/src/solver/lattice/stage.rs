//! Making a network coarser along one axis.
//!
//! Some planes across the axis are eliminated, never two neighbours. Along the axis the two edges of an eliminated node
//! are capacitors in series, the exact Schur complement of a line; what couples eliminated nodes to each other is divided
//! among the neighbours that they are interpolated from. A node at a fixed potential interpolates to zero and its edges
//! become leaks, so that no conductor is lost on a coarse level, however thin.

use super::between::{half_row, place_in_halves};
use super::layout::{Layout, RED};
use super::network::{Changed, Network, Node};
use super::pairs::{place_in_pairs, room_for_pairs};
use std::ops::Range;

/// A coarse network follows the fine one but for changes below this part of a weight, which a preconditioner does not
/// feel: so what a motion does to a few rows does not spread over all of the coarse levels. What is kept is never further
/// than that from what it should be, however many frames go by.
const NEGLIGIBLE: f32 = 0.02;

/// Shares that miss no more than this to one miss nothing.
const ROUNDING: f32 = 1e-6;

/// One axis made coarser.
#[derive(Clone, Debug)]
pub(super) struct Stage {
    pub(super) axis: usize,
    /// The coarse plane of each fine plane that is kept.
    coarse_plane: Vec<Option<usize>>,
    /// The fine plane of each coarse plane.
    pub(super) fine_plane: Vec<usize>,
    /// What the eliminated nodes take from their neighbours, as the network is ordered; zero for kept nodes.
    shares: Vec<Share>,
    /// The same as the kernels read it: from the previous and from the next neighbour.
    pub(super) previous: Shares,
    pub(super) next: Shares,
    /// What the fine network becomes.
    pub(super) coarse: Network,
    /// Where the coarse network may have changed last, and where it did.
    reached: Changed,
    pub(super) changed: Changed,
}

/// The parts of the previous and of the next neighbour's value that an eliminated node takes.
#[derive(Clone, Copy, Debug, Default)]
struct Share {
    previous: f32,
    next: f32,
}

impl Share {
    /// What is missing to one in their sum: the part of fixed potentials.
    #[inline]
    fn lost(self) -> f32 {
        let lost = 1.0 - (self.previous + self.next);
        if lost > ROUNDING { lost } else { 0.0 }
    }
}

/// A number for every node of a network, as the kernels want it.
#[derive(Clone, Debug)]
pub(super) enum Shares {
    /// For stages across z: red nodes in the layout of the level.
    Red(Layout, Vec<f32>),
    /// For other stages: the rows of each plane in turn, as the kernels have them on the fine side of the stage.
    Rows { rows: usize, row: usize, values: Vec<f32> },
}

impl Shares {
    fn zeros([nx, ny, nz]: [usize; 3], axis: usize, layout: &Layout) -> Self {
        let row = match axis {
            2 => return Self::Red(*layout, vec![0.0; layout.len()]),
            1 => 2 * half_row(nx),
            _ => room_for_pairs(nx),
        };
        Self::Rows { rows: ny, row, values: vec![0.0; ny * nz * row] }
    }

    /// `in_row` is where the kernels have the node in its row.
    fn set(&mut self, at: [usize; 3], in_row: usize, value: f32) {
        match self {
            Self::Red(layout, values) => {
                if let (RED, place) = layout.place(at) {
                    values[place] = value;
                }
            }
            Self::Rows { rows, row, values } => {
                let [_, j, k] = at;
                values[(k * *rows + j) * *row + in_row] = value;
            }
        }
    }

    /// Those of some red nodes.
    #[inline(always)]
    pub(super) fn red(&self, places: Range<usize>) -> &[f32] {
        match self {
            Self::Red(_, values) => &values[places],
            Self::Rows { .. } => &[],
        }
    }

    /// Those of row (j, k).
    #[inline(always)]
    pub(super) fn row(&self, j: usize, k: usize) -> &[f32] {
        match self {
            Self::Red(..) => &[],
            Self::Rows { rows, row, values } => &values[(k * rows + j) * row..][..*row],
        }
    }
}

impl Stage {
    /// Keeps the planes across `axis` for which `kept` holds; the first and last plane and one of any two neighbours
    /// must be kept. `layout` is that of the level that the stage starts from.
    pub(super) fn new(fine: [usize; 3], axis: usize, kept: &[bool], layout: &Layout) -> Self {
        let fine_plane: Vec<usize> = (0..kept.len()).filter(|&plane| kept[plane]).collect();
        let coarse_plane = (0..kept.len()).map(|plane| fine_plane.binary_search(&plane).ok()).collect();
        let mut counts = fine;
        counts[axis] = fine_plane.len();
        Self {
            axis,
            coarse_plane,
            fine_plane,
            shares: vec![Share::default(); fine[0] * fine[1] * (fine[2] + 2)],
            previous: Shares::zeros(fine, axis, layout),
            next: Shares::zeros(fine, axis, layout),
            coarse: Network::new(counts),
            reached: Changed::nothing(counts),
            changed: Changed::nothing(counts),
        }
    }

    /// Recomputes the coarse network where the fine one changed, and notes where that made a difference.
    pub(super) fn refresh(&mut self, fine: &Network, changed: &Changed) {
        self.find_reached(changed);
        self.changed.clear();
        let reached = std::mem::replace(&mut self.reached, Changed::nothing([0; 3]));
        reached.for_each_row(|nodes, j, k| nodes.for_each(|i| self.refresh_share(fine, [i, j, k])));
        reached.for_each_row(|nodes, j, k| self.refresh_row(fine, nodes, j, k));
        self.reached = reached;
    }

    fn refresh_row(&mut self, fine: &Network, nodes: Range<usize>, j: usize, k: usize) {
        // A weight is as much the next node's.
        let [mut own, mut beyond_j, mut beyond_k] = [Interval::EMPTY; 3];
        for i in nodes {
            let node = self.coarse_node(fine, [i, j, k]);
            let index = self.coarse.index([i, j, k]);
            let stored = &mut self.coarse.nodes[index];
            let mut changed = [false; 3];
            for (axis, changed) in changed.iter_mut().enumerate() {
                *changed = replace_if_different(&mut stored.next[axis], node.next[axis]);
            }
            if replace_if_different(&mut stored.leak, node.leak) || changed != [false; 3] {
                own.add(i);
            }
            if changed[0] {
                own.add(i + 1);
            }
            if changed[1] {
                beyond_j.add(i);
            }
            if changed[2] {
                beyond_k.add(i);
            }
        }
        self.changed.add(own.range(), j, k);
        self.changed.add(beyond_j.range(), j + 1, k);
        self.changed.add(beyond_k.range(), j, k + 1);
    }

    /// What changes at a node reaches the coarse node at it, or, where nodes are eliminated, those beside it too and their
    /// neighbours across the axis.
    fn find_reached(&mut self, fine: &Changed) {
        let mut changed = std::mem::replace(&mut self.reached, Changed::nothing([0; 3]));
        changed.clear();
        fine.for_each_row(|nodes, j, k| {
            let wider = nodes.start.saturating_sub(1)..nodes.end + 1;
            let own = [nodes.clone(), j..j + 1, k..k + 1][self.axis].clone();
            let (reached, is_spread) = self.reach(own);
            match self.axis {
                0 => {
                    changed.add(reached.clone(), j, k);
                    if is_spread {
                        changed.add_beside_row(reached, j, k);
                    }
                }
                1 => {
                    for j in reached {
                        changed.add(if is_spread { wider.clone() } else { nodes.clone() }, j, k);
                        if is_spread {
                            changed.add(nodes.clone(), j, k + 1);
                            changed.add(nodes.clone(), j, k.wrapping_sub(1));
                        }
                    }
                }
                _ => {
                    for k in reached {
                        changed.add(if is_spread { wider.clone() } else { nodes.clone() }, j, k);
                        if is_spread {
                            changed.add(nodes.clone(), j + 1, k);
                            changed.add(nodes.clone(), j.wrapping_sub(1), k);
                        }
                    }
                }
            }
        });
        self.reached = changed;
    }

    /// The coarse planes that some fine planes reach, and whether more than these planes themselves because a plane
    /// among or beside them is eliminated.
    fn reach(&self, fine: Range<usize>) -> (Range<usize>, bool) {
        let coarse = |plane: usize| self.fine_plane.partition_point(|&kept| kept < plane);
        let (first, last) = (coarse(fine.start), coarse(fine.end));
        let wide = fine.start.saturating_sub(1)..(fine.end + 1).min(self.coarse_plane.len());
        if wide.clone().any(|plane| self.is_eliminated(plane)) {
            (first.saturating_sub(1)..(last + 1).min(self.fine_plane.len()), true)
        } else {
            (first..last, false)
        }
    }

    /// The fine node that a coarse node is.
    fn fine_node(&self, mut at: [usize; 3]) -> [usize; 3] {
        at[self.axis] = self.fine_plane[at[self.axis]];
        at
    }

    /// The coarse planes at a fine one, or before and after it.
    #[inline(always)]
    pub(super) fn around(&self, fine: usize) -> [usize; 2] {
        match self.coarse_plane[fine] {
            Some(coarse) => [coarse, coarse],
            None => {
                let after = self.fine_plane.partition_point(|&plane| plane < fine);
                [after - 1, after]
            }
        }
    }

    pub(super) fn is_eliminated(&self, plane: usize) -> bool {
        self.coarse_plane.get(plane).is_some_and(Option::is_none)
    }

    /// Of the eliminated node after a coarse node, if there is one. Called once for each node: in a function of its own, it
    /// would wait for the indices to arrive through memory.
    #[inline(always)]
    fn refresh_share(&mut self, fine: &Network, coarse: [usize; 3]) {
        let mut at = self.fine_node(coarse);
        at[self.axis] += 1;
        if !self.is_eliminated(at[self.axis]) {
            return;
        }
        let node = fine.index(at);
        let previous = node - fine.strides()[self.axis];
        let (before, after) = (fine.weight(self.axis, previous), fine.weight(self.axis, node));
        let sum = before + after + fine.nodes[node].leak;
        let share = if fine.is_fixed(node) || sum == 0.0 {
            Share::default()
        } else {
            let scale = 1.0 / sum;
            Share { previous: before * scale, next: after * scale }
        };
        self.shares[node] = share;
        let in_row = match self.axis {
            0 => place_in_pairs(coarse[0]),
            _ => place_in_halves(at[0], half_row(fine.counts[0])),
        };
        self.previous.set(at, in_row, share.previous);
        self.next.set(at, in_row, share.next);
    }

    /// The weights and the leak of a coarse node.
    #[inline]
    fn coarse_node(&self, fine: &Network, at: [usize; 3]) -> Node {
        let axis = self.axis;
        let own = self.fine_node(at);
        let has_next = self.is_eliminated(own[axis] + 1);
        let has_previous = own[axis] > 0 && self.is_eliminated(own[axis] - 1);
        let (own, strides) = (fine.index(own), fine.strides());
        let (previous, next) = (own - strides[axis], own + strides[axis]);
        let mut coarse = fine.nodes[own];
        if has_next {
            let (weight, share) = (fine.nodes[own].next[axis], self.shares[next]);
            coarse.next[axis] *= share.next;
            coarse.leak += weight * share.lost();
            for across in [(axis + 1) % 3, (axis + 2) % 3] {
                self.divide(fine, next, |share| share.previous, across, strides[across], &mut coarse);
            }
        }
        if has_previous {
            coarse.leak += fine.nodes[previous].next[axis] * self.shares[previous].lost();
            for across in [(axis + 1) % 3, (axis + 2) % 3] {
                self.divide(fine, previous, |share| share.next, across, strides[across], &mut coarse);
            }
        }
        coarse
    }

    /// Takes the part of a coarse node in the weights across the axis of an eliminated neighbour. What two eliminated
    /// neighbours do not both take from here couples to neither.
    #[inline]
    fn divide(
        &self,
        fine: &Network,
        node: usize,
        share: impl Fn(&Share) -> f32,
        across: usize,
        stride: usize,
        coarse: &mut Node,
    ) {
        let own = share(&self.shares[node]);
        let with_after = own.min(share(&self.shares[node + stride]));
        let with_before = own.min(share(&self.shares[node - stride]));
        let (after, before) = (fine.nodes[node].next[across], fine.nodes[node - stride].next[across]);
        coarse.next[across] += after * with_after;
        coarse.leak += after * (own - with_after) + before * (own - with_before);
    }
}

/// Takes over a number if it is not nearly the one that is stored. Returns whether it was taken over.
#[inline]
fn replace_if_different(stored: &mut f32, new: f32) -> bool {
    let is_other_kind = new.is_infinite() != stored.is_infinite();
    let is_different = is_other_kind || (new - *stored).abs() > NEGLIGIBLE * new.max(*stored);
    if is_different {
        *stored = new;
    }
    is_different
}

/// The smallest and one more than the largest of some numbers.
#[derive(Clone, Copy, Debug)]
struct Interval(usize, usize);

impl Interval {
    const EMPTY: Self = Self(usize::MAX, 0);

    fn add(&mut self, i: usize) {
        *self = Self(self.0.min(i), self.1.max(i + 1));
    }

    fn range(self) -> Range<usize> {
        self.0.min(self.1)..self.1
    }
}
