//! Rows of a coarse network, computed by a stage from those of the fine one, a row's changed blocks at a time.
//!
//! Across y and z a fine row is a coarse one, or is eliminated as a whole. Across x, what rows are made of is picked from
//! the fine row first: the coarse nodes, and what is behind them. Where that is no eliminated node, it has no shares.

use super::coarsening::{Across, add_lost, divide_value, divide_weights, put_in_series};
use super::layout::BLOCK;
use super::network::{Changed, Network, whole_blocks};
use super::rows::{copy, single};
use super::shares::Shares;
use super::stage::Stage;
use pulp::{Simd, WithSimd};
use std::ops::Range;

/// A row of coarse nodes in the making, the first behind one block.
#[derive(Clone, Debug, Default)]
pub(super) struct CoarseRow {
    /// One where a row has an eliminated node behind the coarse one, else zero.
    exists: Vec<f32>,
    /// Weights to the next nodes along each axis.
    pub(super) next: [Vec<f32>; 3],
    pub(super) leak: Vec<f32>,
    /// What eliminated nodes couple besides, of those after the coarse nodes and of those before.
    besides: [Vec<f32>; 2],
    behind: Behind,
}

/// Across x: the nodes behind the coarse ones.
#[derive(Clone, Debug, Default)]
struct Behind {
    /// Weights to the next nodes along each axis.
    next: [Vec<f32>; 3],
    leak: Vec<f32>,
    /// Weights to the previous nodes along y and z.
    previous: [Vec<f32>; 2],
}

/// Eliminated nodes on one side of successive coarse ones.
struct Eliminated<'a> {
    exists: &'a [f32],
    /// Weights to the coarse nodes.
    along: &'a [f32],
    /// Weights from the nodes before and to those after along the other axes.
    across: [[&'a [f32]; 2]; 2],
    /// Their shares in the coarse nodes and in those on their other side, and where these shares are.
    shares: [&'a Shares; 2],
    place: usize,
}

/// The shares of all eliminated nodes that changed, and what that reaches. Compiled once for each set of instructions that
/// a processor may have.
pub(super) struct Share<'a> {
    pub(super) stage: &'a mut Stage,
    pub(super) row: &'a mut CoarseRow,
    pub(super) fine: &'a Network,
    pub(super) changed: &'a Changed,
}

impl WithSimd for Share<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { stage, row: room, fine, changed } = self;
        for row in 0..changed.rows() {
            let (nodes, j, k) = changed.row(row);
            stage.reach_beside(nodes.clone(), j, k);
            let are_others = if stage.axis == 0 {
                stage.share_among_picked(simd, room, fine, &nodes, j, k)
            } else {
                stage.share_among_rows(simd, room, fine, &nodes, j, k)
            };
            if are_others {
                stage.reach_across(nodes, j, k);
            }
        }
    }
}

impl CoarseRow {
    /// For fine rows of so many nodes; across x, those are coarse for which `kept` holds.
    pub(super) fn new(nodes: usize, axis: usize, kept: &[bool]) -> Self {
        let room = nodes.next_multiple_of(BLOCK) + 2 * BLOCK;
        let zeros = || vec![0.0; room];
        let mut exists = vec![1.0; room];
        if axis == 0 {
            exists.fill(0.0);
            let coarse = (0..kept.len()).filter(|&node| kept[node]);
            let behind = coarse.map(|node| kept.get(node + 1) == Some(&false));
            exists[BLOCK..].iter_mut().zip(behind).for_each(|(to, behind)| *to = f32::from(u8::from(behind)));
        }
        let behind = if axis == 0 {
            Behind { next: [zeros(), zeros(), zeros()], leak: zeros(), previous: [zeros(), zeros()] }
        } else {
            Behind::default()
        };
        let next = [zeros(), zeros(), zeros()];
        Self { exists, next, leak: zeros(), besides: [zeros(), zeros()], behind }
    }

    /// Zeros for all but where nodes are.
    pub(super) fn clear(&mut self) {
        let Self {
            next, leak, besides, behind: Behind { next: beyond, leak: leak_behind, previous }, ..
        } = self;
        let weights = next.iter_mut().chain(besides).chain(beyond).chain(previous);
        weights.chain([leak, leak_behind]).for_each(|numbers| numbers.fill(0.0));
    }
}

impl Stage {
    /// The shares of some nodes of fine row (j, k), if it is eliminated. Returns whether any is another than before.
    #[inline(always)]
    fn share_among_rows<S: Simd>(
        &mut self,
        simd: S,
        room: &CoarseRow,
        fine: &Network,
        nodes: &Range<usize>,
        j: usize,
        k: usize,
    ) -> bool {
        if !self.is_eliminated([0, j, k][self.axis]) {
            return false;
        }
        let nodes = whole_blocks(nodes);
        let (place, n, along) = (fine.index([nodes.start, j, k]), nodes.len(), &fine.next[self.axis]);
        let before = place - fine.strides[self.axis];
        let weights = [&along[before..before + n], &along[place..place + n], &fine.leak[place..place + n]];
        let place = self.previous.place([nodes.start, j, k]);
        let shares = [&mut self.previous.values[place..place + n], &mut self.next.values[place..place + n]];
        let are_others = divide_value(simd, &room.exists[..n], weights, shares);
        if are_others {
            self.previous.arrange(&nodes, j, k);
            self.next.arrange(&nodes, j, k);
        }
        are_others
    }

    /// The same across x: those of some nodes of fine row (j, k) that are eliminated.
    #[inline(always)]
    fn share_among_picked<S: Simd>(
        &mut self,
        simd: S,
        room: &mut CoarseRow,
        fine: &Network,
        nodes: &Range<usize>,
        j: usize,
        k: usize,
    ) -> bool {
        let nodes = whole_blocks(&self.reach(nodes.clone()));
        let (own, planes, n) = (fine.index([0, j, k]), &self.fine_plane, nodes.len());
        let CoarseRow { exists, next: [before, ..], behind, .. } = room;
        pick_pairs(before, &mut behind.next[0], &fine.next[0][own..], planes, &nodes);
        pick(&mut behind.leak, &fine.leak[own + 1..], planes, &nodes);
        let here = BLOCK + nodes.start..BLOCK + nodes.end;
        let weights = [&before[here.clone()], &behind.next[0][here.clone()], &behind.leak[here.clone()]];
        let place = self.previous.place([nodes.start, j, k]);
        let shares = [&mut self.previous.values[place..place + n], &mut self.next.values[place..place + n]];
        divide_value(simd, &exists[here], weights, shares)
    }

    /// Row (j, k) as the fine rows at it make it.
    #[inline(always)]
    pub(super) fn collect_rows<S: Simd>(
        &self,
        simd: S,
        room: &mut CoarseRow,
        fine: &Network,
        nodes: &Range<usize>,
        j: usize,
        k: usize,
    ) {
        let at = self.fine_node([nodes.start, j, k]);
        let plane = at[self.axis];
        let (has_next, has_previous) =
            (self.is_eliminated(plane + 1), self.is_eliminated(plane.wrapping_sub(1)));
        let (own, n, stride) = (fine.index(at), nodes.len(), fine.strides[self.axis]);
        let here = BLOCK + nodes.start..BLOCK + nodes.end;
        let CoarseRow { exists, next, leak, besides, .. } = room;
        let (exists, leak) = (&exists[here.clone()], &mut leak[here.clone()]);
        let [after, before] = besides.each_mut().map(|besides| &mut besides[here.clone()]);
        after.fill(0.0);
        let [x, y, z] = next;
        copy::<S>(&mut x[here.clone()], &fine.next[0][own..own + n]);
        copy::<S>(&mut y[here.clone()], &fine.next[1][own..own + n]);
        copy::<S>(&mut z[here.clone()], &fine.next[2][own..own + n]);
        copy_leaks(simd, leak, &fine.leak[own..own + n]);
        // Across y, that is along z and x; across z, along x and y.
        let (series, across, others) = if self.axis == 1 {
            (y, [&mut z[here.clone()], &mut x[here.clone()]], [2, 0])
        } else {
            (z, [&mut x[here.clone()], &mut y[here.clone()]], [0, 1])
        };
        let [to_first, to_second] = across;
        let along = &fine.next[self.axis];
        if has_next {
            let (place, in_shares) = (own + stride, self.previous.place(beside(at, self.axis, plane + 1)));
            let eliminated = Eliminated {
                exists,
                along: &along[own..own + n],
                across: weights_across(fine, others, place, n),
                shares: [&self.previous, &self.next],
                place: in_shares,
            };
            eliminated.add(simd, others, [&mut *to_first, &mut *to_second], leak, after);
            put_in_series(
                simd,
                exists,
                &self.next.values[in_shares..in_shares + n],
                after,
                &mut series[here],
            );
        }
        if has_previous {
            let (place, in_shares) = (own - stride, self.previous.place(beside(at, self.axis, plane - 1)));
            let eliminated = Eliminated {
                exists,
                along: &along[place..place + n],
                across: weights_across(fine, others, place, n),
                shares: [&self.next, &self.previous],
                place: in_shares,
            };
            eliminated.add(simd, others, [to_first, to_second], leak, before);
        }
    }

    /// Row (j, k), of which the nodes behind the coarse ones have been eliminated.
    #[inline(always)]
    pub(super) fn collect_picked<S: Simd>(
        &self,
        simd: S,
        room: &mut CoarseRow,
        fine: &Network,
        nodes: &Range<usize>,
        j: usize,
        k: usize,
    ) {
        let (own, n, planes) = (fine.index([0, j, k]), nodes.len(), &self.fine_plane);
        let CoarseRow { exists, next, leak, besides, behind } = room;
        // The node behind the one before the first counts too.
        let wider = nodes.start.saturating_sub(1)..nodes.end;
        for ((to, behind), from) in next.iter_mut().zip(&mut behind.next).zip(&fine.next) {
            pick_pairs(to, behind, &from[own..], planes, &wider);
        }
        pick_leaks(leak, &fine.leak[own..], planes, nodes);
        let [_, row, plane] = fine.strides;
        let [along_y, along_z] = &mut behind.previous;
        pick(along_y, &fine.next[1][own + 1 - row..], planes, &wider);
        pick(along_z, &fine.next[2][own + 1 - plane..], planes, &wider);
        let place = self.previous.place([nodes.start, j, k]);
        let here = BLOCK + nodes.start..BLOCK + nodes.end;
        let before = here.start - 1..here.end - 1;
        let [series, y, z] = next;
        let (leak, y, z) = (&mut leak[here.clone()], &mut y[here.clone()], &mut z[here.clone()]);
        let [more, other] = besides.each_mut().map(|besides| &mut besides[here.clone()]);
        more.fill(0.0);
        let after = Eliminated {
            exists: &exists[here.clone()],
            along: &series[here.clone()],
            across: behind.across(here.clone()),
            shares: [&self.previous, &self.next],
            place,
        };
        after.add(simd, [1, 2], [&mut *y, &mut *z], leak, more);
        let shares = &self.next.values[place..place + n];
        put_in_series(simd, &exists[here.clone()], shares, more, &mut series[here]);
        let before = Eliminated {
            exists: &exists[before.clone()],
            along: &behind.next[0][before.clone()],
            across: behind.across(before),
            shares: [&self.next, &self.previous],
            place: place - 1,
        };
        before.add(simd, [1, 2], [y, z], leak, other);
    }
}

impl Behind {
    /// The weights across x at some places.
    #[inline(always)]
    fn across(&self, places: Range<usize>) -> [[&[f32]; 2]; 2] {
        let ([_, y, z], [previous_y, previous_z]) = (&self.next, &self.previous);
        [[&previous_y[places.clone()], &y[places.clone()]], [&previous_z[places.clone()], &z[places]]]
    }
}

impl Eliminated<'_> {
    /// Adds to the weights of the coarse nodes along the other axes, to their leaks, and to what couples those on both sides
    /// besides.
    #[inline(always)]
    fn add<S: Simd>(
        &self,
        simd: S,
        axes: [usize; 2],
        weights: [&mut [f32]; 2],
        leak: &mut [f32],
        along: &mut [f32],
    ) {
        let (n, place) = (leak.len(), self.place);
        let [own, other] = [&self.shares[0].values, &self.shares[1].values];
        add_lost(simd, self.exists, self.along, [&own[place..place + n], &other[place..place + n]], leak);
        let [first, second] = weights;
        for (which, weight) in [first, second].into_iter().enumerate() {
            let stride = self.shares[0].strides[axes[which]];
            let (before, after) = (place - stride, place + stride);
            let at = |place: usize| [&own[place..place + n], &other[place..place + n]];
            let across =
                Across { own: at(place), around: [at(before), at(after)], weights: self.across[which] };
            divide_weights(simd, across, weight, leak, along);
        }
    }
}

/// A node in another plane across an axis.
#[inline(always)]
fn beside(mut node: [usize; 3], axis: usize, plane: usize) -> [usize; 3] {
    node[axis] = plane;
    node
}

/// The weights from the nodes before and to the nodes after some successive ones, along two axes.
#[inline(always)]
fn weights_across(fine: &Network, axes: [usize; 2], place: usize, n: usize) -> [[&[f32]; 2]; 2] {
    let [first, second] = [&fine.next[axes[0]], &fine.next[axes[1]]];
    let (before_first, before_second) = (place - fine.strides[axes[0]], place - fine.strides[axes[1]]);
    [
        [&first[before_first..before_first + n], &first[place..place + n]],
        [&second[before_second..before_second + n], &second[place..place + n]],
    ]
}

/// Copies leaks. Those below zero, which links to edges of conductors may be, are so little that a preconditioner does not
/// feel them; but on a coarse level they could outweigh what else a node has.
#[inline(always)]
fn copy_leaks<S: Simd>(simd: S, to: &mut [f32], leaks: &[f32]) {
    for (to, leak) in S::as_mut_simd_f32s(to).0.iter_mut().zip(single::<S>(leaks)) {
        *to = simd.max_f32s(*leak, simd.splat_f32s(0.0));
    }
}

/// Picks the leaks of the coarse nodes of a fine row, as [`copy_leaks`] would.
#[inline(always)]
fn pick_leaks(to: &mut [f32], row: &[f32], planes: &[usize], nodes: &Range<usize>) {
    pick(to, row, planes, nodes);
    to[BLOCK + nodes.start..BLOCK + nodes.end].iter_mut().for_each(|leak| *leak = leak.max(0.0));
}

/// Picks the coarse nodes of a fine row, or, of one that begins later, those behind them.
#[inline(always)]
fn pick(to: &mut [f32], row: &[f32], planes: &[usize], nodes: &Range<usize>) {
    let planes = &planes[nodes.start..nodes.end.min(planes.len())];
    for (to, &plane) in to[BLOCK + nodes.start..].iter_mut().zip(planes) {
        *to = row[plane];
    }
}

/// Picks the coarse nodes of a fine row and those behind them.
#[inline(always)]
fn pick_pairs(own: &mut [f32], behind: &mut [f32], row: &[f32], planes: &[usize], nodes: &Range<usize>) {
    let planes = &planes[nodes.start..nodes.end.min(planes.len())];
    let (own, behind) = (&mut own[BLOCK + nodes.start..], &mut behind[BLOCK + nodes.start..]);
    for ((own, behind), &plane) in own.iter_mut().zip(behind).zip(planes) {
        let pair = &row[plane..plane + 2];
        (*own, *behind) = (pair[0], pair[1]);
    }
}
