//! From one level of the lattice hierarchy to the next coarser one and back.
//!
//! Some planes across one axis are eliminated, never two neighbours. Along that axis the two edges of an eliminated
//! node are capacitors in series, the exact Schur complement of a line; what couples eliminated nodes to each other is
//! divided among the neighbours that they are interpolated from. A node at a fixed potential interpolates to zero and
//! its edges become leaks, so that no conductor is lost on a coarse level, however thin.

use super::level::Level;
use crate::stiffness::{LANES, Lane32};

/// How a level is made coarser.
#[derive(Clone, Debug)]
pub(super) struct Transfer {
    axis: usize,
    /// The coarse plane of each fine plane that is kept.
    coarse_plane: Vec<Option<usize>>,
    /// The fine plane of each coarse plane.
    fine_plane: Vec<usize>,
    /// The parts of the previous and of the next neighbour's value that an eliminated node takes. Zero for kept nodes.
    share: [Vec<f32>; 2],
    /// What is missing to one in the sum of both shares of an eliminated node.
    lost: Vec<f32>,
}

/// Half-open ranges of node indices along the three axes.
pub(super) type IndexBox = [std::ops::Range<usize>; 3];

impl Transfer {
    /// Keeps the planes across `axis` for which `kept` holds; the first and last plane and one of any two neighbours
    /// must be kept.
    pub(super) fn new(fine: &Level, axis: usize, kept: &[bool]) -> Self {
        let fine_plane: Vec<usize> = (0..kept.len()).filter(|&plane| kept[plane]).collect();
        let coarse_plane = (0..kept.len()).map(|plane| fine_plane.binary_search(&plane).ok()).collect();
        let zeros = || vec![0.0; fine.leak.len()];
        Self { axis, coarse_plane, fine_plane, share: [zeros(), zeros()], lost: zeros() }
    }

    /// Number of nodes of the coarse level along each axis.
    pub(super) fn coarse_counts(&self, fine: &Level) -> [usize; 3] {
        let mut counts = fine.counts;
        counts[self.axis] = self.fine_plane.len();
        counts
    }

    /// Recomputes what depends on the fine level's nodes in a box and returns the box of coarse nodes that changed.
    pub(super) fn refresh(&mut self, fine: &Level, coarse: &mut Level, changed: &IndexBox) -> IndexBox {
        // Weights to the next node stand at the node before, so what changes reaches one node back.
        let mut region: IndexBox = std::array::from_fn(|axis| {
            changed[axis].start.saturating_sub(1)..(changed[axis].end + 1).min(fine.counts[axis])
        });
        let planes = &mut region[self.axis];
        let first = self.fine_plane.partition_point(|&plane| plane < planes.start).saturating_sub(1);
        let last = self.fine_plane.partition_point(|&plane| plane < planes.end);
        *planes = first..(last + 1).min(self.fine_plane.len());
        for_each(&region, |at| self.refresh_share(fine, at));
        for_each(&region, |at| self.refresh_weights(fine, coarse, at));
        for_each(&region, |at| {
            let fixed = fine.is_fixed(fine.index(self.fine_node(at)));
            coarse.set_inverse(coarse.index(at), fixed);
        });
        region
    }

    /// The fine node that a coarse node is.
    fn fine_node(&self, mut at: [usize; 3]) -> [usize; 3] {
        at[self.axis] = self.fine_plane[at[self.axis]];
        at
    }

    fn is_eliminated(&self, plane: usize) -> bool {
        self.coarse_plane.get(plane).is_some_and(Option::is_none)
    }

    /// Of the eliminated node after a coarse node, if there is one.
    fn refresh_share(&mut self, fine: &Level, at: [usize; 3]) {
        let mut at = self.fine_node(at);
        at[self.axis] += 1;
        if !self.is_eliminated(at[self.axis]) {
            return;
        }
        let node = fine.index(at);
        let previous = node - fine.strides()[self.axis];
        let (before, after) = (fine.weight(self.axis, previous), fine.weight(self.axis, node));
        let sum = before + after + fine.leak[node];
        let fixed = fine.is_fixed(node) || sum == 0.0;
        let scale = if fixed { 0.0 } else { 1.0 / sum };
        self.share[0][node] = before * scale;
        self.share[1][node] = after * scale;
        self.lost[node] = if fixed { 1.0 } else { fine.leak[node] * scale };
    }

    fn refresh_weights(&self, fine: &Level, coarse: &mut Level, at: [usize; 3]) {
        let axis = self.axis;
        let own = self.fine_node(at);
        let has_next = self.is_eliminated(own[axis] + 1);
        let has_previous = own[axis] > 0 && self.is_eliminated(own[axis] - 1);
        let (at, own, strides) = (coarse.index(at), fine.index(own), fine.strides());
        let (previous, next) = (own - strides[axis], own + strides[axis]);
        let mut leak = fine.leak[own];
        coarse.stencil[at].next[axis] =
            fine.weight(axis, own) * if has_next { self.share[1][next] } else { 1.0 };
        if has_next {
            leak += fine.weight(axis, own) * self.lost[next];
        }
        if has_previous {
            leak += fine.weight(axis, previous) * self.lost[previous];
        }
        for across in (0..3).filter(|&across| across != axis) {
            let stride = strides[across];
            let mut sum = fine.weight(across, own);
            for (exists, share, node) in
                [(has_next, &self.share[0], next), (has_previous, &self.share[1], previous)]
            {
                if exists {
                    // What two eliminated neighbours do not both take from here couples to neither.
                    let with_after = share[node].min(share[node + stride]);
                    let with_before = share[node].min(share[node - stride]);
                    sum += fine.weight(across, node) * with_after;
                    leak += fine.weight(across, node) * (share[node] - with_after);
                    leak += fine.weight(across, node - stride) * (share[node] - with_before);
                }
            }
            coarse.stencil[at].next[across] = sum;
        }
        coarse.leak[at] = leak;
    }

    /// The coarse right-hand side: each eliminated node's residual goes to the two nodes it is interpolated from.
    pub(super) fn restrict(&self, fine: &Level, coarse: &mut Level) {
        if self.axis == 0 {
            return self.restrict_in_rows(fine, coarse);
        }
        let nx = fine.counts[0];
        let stride = fine.strides()[self.axis];
        for k in 0..coarse.counts[2] {
            for j in 0..coarse.counts[1] {
                let own = self.fine_node([0, j, k]);
                let to = coarse.index([0, j, k]);
                let from = fine.index(own);
                let b = &mut coarse.b[to..][..nx];
                b.copy_from_slice(&fine.r[from..][..nx]);
                if self.is_eliminated(own[self.axis] + 1) {
                    add_shares(b, &self.share[0][from + stride..][..nx], &fine.r[from + stride..][..nx]);
                }
                if own[self.axis] > 0 && self.is_eliminated(own[self.axis] - 1) {
                    add_shares(b, &self.share[1][from - stride..][..nx], &fine.r[from - stride..][..nx]);
                }
            }
        }
    }

    fn restrict_in_rows(&self, fine: &Level, coarse: &mut Level) {
        let (nx, coarse_nx) = (fine.counts[0], coarse.counts[0]);
        for (to, from) in coarse.nodes().step_by(coarse_nx).zip(fine.nodes().step_by(nx)) {
            let (r, b) = (&fine.r[from..][..nx], &mut coarse.b[to..][..coarse_nx]);
            let shares = [&self.share[0][from..][..nx], &self.share[1][from..][..nx]];
            let mut at = 0;
            for i in 0..nx {
                if let Some(coarse) = self.coarse_plane[i] {
                    at = coarse;
                    b[at] = r[i];
                    if i > 0 && self.coarse_plane[i - 1].is_none() {
                        add_share(&mut b[at], shares[1][i - 1], &r[i - 1]);
                    }
                } else {
                    add_share(&mut b[at], shares[0][i], &r[i]);
                }
            }
        }
    }

    /// Adds the interpolated coarse correction to the fine one.
    pub(super) fn prolong(&self, fine: &mut Level, coarse: &Level) {
        if self.axis == 0 {
            return self.prolong_in_rows(fine, coarse);
        }
        let nx = fine.counts[0];
        let step = coarse.strides()[self.axis];
        for k in 0..fine.counts[2] {
            for j in 0..fine.counts[1] {
                let mut at = [0, j, k];
                let to = fine.index(at);
                let plane = at[self.axis];
                let x = &mut fine.x[to..][..nx];
                at[self.axis] = self.fine_plane.partition_point(|&kept| kept <= plane) - 1;
                let from = coarse.index(at);
                if self.is_eliminated(plane) {
                    add_shares(x, &self.share[0][to..][..nx], &coarse.x[from..][..nx]);
                    add_shares(x, &self.share[1][to..][..nx], &coarse.x[from + step..][..nx]);
                } else {
                    for (x, correction) in x.iter_mut().zip(&coarse.x[from..][..nx]) {
                        add_share(x, 1.0, correction);
                    }
                }
            }
        }
    }

    fn prolong_in_rows(&self, fine: &mut Level, coarse: &Level) {
        let (nx, coarse_nx) = (fine.counts[0], coarse.counts[0]);
        for (from, to) in coarse.nodes().step_by(coarse_nx).zip(fine.nodes().step_by(nx)) {
            let (x, correction) = (&mut fine.x[to..][..nx], &coarse.x[from..][..coarse_nx]);
            let mut at = 0;
            for (i, x) in x.iter_mut().enumerate() {
                if let Some(coarse) = self.coarse_plane[i] {
                    at = coarse;
                    add_share(x, 1.0, &correction[at]);
                } else {
                    add_share(x, self.share[0][to + i], &correction[at]);
                    add_share(x, self.share[1][to + i], &correction[at + 1]);
                }
            }
        }
    }
}

#[inline(always)]
fn add_share(to: &mut Lane32, share: f32, value: &Lane32) {
    for lane in 0..LANES {
        to[lane] += share * value[lane];
    }
}

fn add_shares(to: &mut [Lane32], shares: &[f32], values: &[Lane32]) {
    for ((to, share), value) in to.iter_mut().zip(shares).zip(values) {
        add_share(to, *share, value);
    }
}

fn for_each([x, y, z]: &IndexBox, mut visit: impl FnMut([usize; 3])) {
    for k in z.clone() {
        for j in y.clone() {
            for i in x.clone() {
                visit([i, j, k]);
            }
        }
    }
}
