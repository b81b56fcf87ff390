//! Rows of a coarse network, computed by a stage from those of the fine one, a row's changed blocks at a time.
//!
//! Across y and z a fine row is a coarse one, or is eliminated as a whole. Across x, what rows are made of is picked from
//! the fine row first: the coarse nodes, and what is behind them. Where that is no eliminated node, it has no shares.

use super::coarsening::{Across, add_lost, divide_value, divide_weights, put_in_series};
use super::layout::BLOCK;
use super::network::{Changed, Network, whole_blocks};
use super::rows::{vectors, vectors_mut};
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
struct Eliminated<'a, S: Simd> {
    exists: &'a [S::f32s],
    /// Their shares in the coarse nodes and in those on their other side.
    shares: [&'a [S::f32s]; 2],
    /// What is along the other axes.
    across: [Across<'a, S>; 2],
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
            let are_others = if stage.axis == 0 {
                stage.share_among_picked(simd, room, fine, &nodes, j, k)
            } else {
                stage.share_among_rows(simd, room, fine, &nodes, j, k)
            };
            if are_others {
                stage.reach_across(nodes, j, k);
            } else {
                stage.reach_beside(nodes, j, k);
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
        Self { exists, next, leak: zeros(), behind }
    }

    /// Zeros for all but where nodes are.
    pub(super) fn clear(&mut self) {
        let Self { next, leak, behind: Behind { next: beyond, leak: leak_behind, previous }, .. } = self;
        let weights = next.iter_mut().chain(beyond).chain(previous);
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
        let (own, n) = (fine.index([0, j, k]), nodes.len());
        let CoarseRow { exists, next: [before, ..], behind, .. } = room;
        self.picks.pick_pairs(before, &mut behind.next[0], &fine.next[0][own..], &nodes);
        self.picks.pick(&mut behind.leak, &fine.leak[own + 1..], &nodes);
        let here = BLOCK + nodes.start..BLOCK + nodes.end;
        let weights = [&before[here.clone()], &behind.next[0][here.clone()], &behind.leak[here.clone()]];
        let place = self.previous.place([nodes.start, j, k]);
        let shares = [&mut self.previous.values[place..place + n], &mut self.next.values[place..place + n]];
        divide_value(simd, &exists[here], weights, shares)
    }

    /// Row (j, k) as the fine rows at it make it, along y or z.
    #[inline(always)]
    pub(super) fn collect_rows<S: Simd, const AXIS: usize>(
        &self,
        simd: S,
        room: &mut CoarseRow,
        fine: &Network,
        nodes: &Range<usize>,
        j: usize,
        k: usize,
    ) {
        let at = self.fine_node([nodes.start, j, k]);
        let (own, n, plane, stride) = (fine.index(at), nodes.len(), at[AXIS], fine.strides[AXIS]);
        let CoarseRow { exists, next: [x, y, z], leak, .. } = room;
        let here = BLOCK + nodes.start;
        let (x, y) = (vectors_mut::<S>(x, here, n), vectors_mut::<S>(y, here, n));
        let (z, leak) = (vectors_mut::<S>(z, here, n), vectors_mut::<S>(leak, here, n));
        let exists = vectors::<S>(exists, here, n);
        let [of_x, of_y, of_z] = &fine.next;
        let (of_x, of_y) = (vectors::<S>(of_x, own, n), vectors::<S>(of_y, own, n));
        let (of_z, leaks) = (vectors::<S>(of_z, own, n), vectors::<S>(&fine.leak, own, n));
        for i in 0..leak.len() {
            (x[i], y[i], z[i]) = (of_x[i], of_y[i], of_z[i]);
            leak[i] = above_zero(simd, leaks[i]);
        }
        let (series, first, second) = if AXIS == 1 { (y, z, x) } else { (z, x, y) };
        if self.is_eliminated(plane + 1) {
            let place = self.previous.place(beside(at, AXIS, plane + 1));
            let shares = [&self.previous, &self.next];
            let after = Eliminated::of_row::<AXIS>(exists, fine, own + stride, shares, place, n);
            after.take_after(simd, [&mut *first, &mut *second], leak, series);
        }
        if self.is_eliminated(plane.wrapping_sub(1)) {
            let place = self.previous.place(beside(at, AXIS, plane - 1));
            let shares = [&self.next, &self.previous];
            let before = Eliminated::of_row::<AXIS>(exists, fine, own - stride, shares, place, n);
            let along = vectors::<S>(&fine.next[AXIS], own - stride, n);
            before.take_before(simd, [first, second], leak, along);
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
        let own = fine.index([0, j, k]);
        self.pick(room, fine, own, nodes);
        // The node behind the one before the first counts too.
        if nodes.start > 0 {
            room.behind.pick_one(fine, own + self.fine_plane[nodes.start - 1] + 1, BLOCK + nodes.start - 1);
        }
        let CoarseRow { exists, next: [x, y, z], leak, behind } = room;
        let (here, n) = (BLOCK + nodes.start, nodes.len());
        let (x, y) = (vectors_mut::<S>(x, here, n), vectors_mut::<S>(y, here, n));
        let (z, leak) = (vectors_mut::<S>(z, here, n), vectors_mut::<S>(leak, here, n));
        for leak in leak.iter_mut() {
            *leak = above_zero(simd, *leak);
        }
        let place = self.previous.place([nodes.start, j, k]);
        let after = behind.eliminated::<S>(exists, here, [&self.previous, &self.next], place, n);
        after.take_after(simd, [&mut *y, &mut *z], leak, x);
        let before = behind.eliminated::<S>(exists, here - 1, [&self.next, &self.previous], place - 1, n);
        before.take_before(simd, [y, z], leak, vectors::<S>(&behind.next[0], here - 1, n));
    }

    /// Picks the coarse nodes of the fine row that begins at a place, and those behind them.
    #[inline(always)]
    fn pick(&self, room: &mut CoarseRow, fine: &Network, own: usize, nodes: &Range<usize>) {
        let CoarseRow { next: [x, y, z], leak, behind, .. } = room;
        let [behind_x, behind_y, behind_z] = &mut behind.next;
        self.picks.pick_pairs(x, behind_x, &fine.next[0][own..], nodes);
        self.picks.pick_pairs(y, behind_y, &fine.next[1][own..], nodes);
        self.picks.pick_pairs(z, behind_z, &fine.next[2][own..], nodes);
        self.picks.pick(leak, &fine.leak[own..], nodes);
        let ([_, row, plane], [along_y, along_z]) = (fine.strides, &mut behind.previous);
        self.picks.pick(along_y, &fine.next[1][own + 1 - row..], nodes);
        self.picks.pick(along_z, &fine.next[2][own + 1 - plane..], nodes);
    }
}

impl Behind {
    /// Picks a single node.
    #[inline(always)]
    fn pick_one(&mut self, fine: &Network, from: usize, to: usize) {
        let ([_, row, plane], [x, y, z]) = (fine.strides, &fine.next);
        let [behind_x, behind_y, behind_z] = &mut self.next;
        (behind_x[to], behind_y[to], behind_z[to]) = (x[from], y[from], z[from]);
        let [along_y, along_z] = &mut self.previous;
        (along_y[to], along_z[to]) = (y[from - row], z[from - plane]);
    }

    /// Those behind some coarse nodes, with their shares from a place on.
    #[inline(always)]
    fn eliminated<'a, S: Simd>(
        &'a self,
        exists: &'a [f32],
        here: usize,
        shares: [&'a Shares; 2],
        place: usize,
        n: usize,
    ) -> Eliminated<'a, S> {
        let ([_, y, z], [previous_y, previous_z]) = (&self.next, &self.previous);
        let along_y = [vectors::<S>(previous_y, here, n), vectors::<S>(y, here, n)];
        let along_z = [vectors::<S>(previous_z, here, n), vectors::<S>(z, here, n)];
        Eliminated {
            exists: vectors::<S>(exists, here, n),
            shares: shares_at::<S>(shares, place, n),
            across: [
                Across { weights: along_y, shares: shares_around::<S>(shares, 1, place, n) },
                Across { weights: along_z, shares: shares_around::<S>(shares, 2, place, n) },
            ],
        }
    }
}

impl<'a, S: Simd> Eliminated<'a, S> {
    /// Nodes of a row across y or z, with their shares from a place on.
    #[inline(always)]
    fn of_row<const AXIS: usize>(
        exists: &'a [S::f32s],
        fine: &'a Network,
        own: usize,
        shares: [&'a Shares; 2],
        place: usize,
        n: usize,
    ) -> Self {
        // Across y, that is along z and x; across z, along x and y.
        let [first, second] = if AXIS == 1 { [2, 0] } else { [0, 1] };
        let (before_first, before_second) = (own - fine.strides[first], own - fine.strides[second]);
        let [along_first, along_second] = [&fine.next[first], &fine.next[second]];
        let of_first = [vectors::<S>(along_first, before_first, n), vectors::<S>(along_first, own, n)];
        let of_second = [vectors::<S>(along_second, before_second, n), vectors::<S>(along_second, own, n)];
        Self {
            exists,
            shares: shares_at::<S>(shares, place, n),
            across: [
                Across { weights: of_first, shares: shares_around::<S>(shares, first, place, n) },
                Across { weights: of_second, shares: shares_around::<S>(shares, second, place, n) },
            ],
        }
    }

    /// Those after the coarse nodes: adds to the weights of these along the other axes and to their leaks, and makes of the
    /// weights to the eliminated nodes those to the next coarse ones.
    #[inline(always)]
    fn take_after(
        &self,
        simd: S,
        [first, second]: [&mut [S::f32s]; 2],
        leak: &mut [S::f32s],
        along: &mut [S::f32s],
    ) {
        for i in 0..leak.len() {
            let more = self.take(simd, i, along[i], [&mut first[i], &mut second[i]], &mut leak[i]);
            put_in_series(simd, self.exists[i], self.shares[1][i], more, &mut along[i]);
        }
    }

    /// The same for those before, but for the weights to them.
    #[inline(always)]
    fn take_before(
        &self,
        simd: S,
        [first, second]: [&mut [S::f32s]; 2],
        leak: &mut [S::f32s],
        along: &[S::f32s],
    ) {
        for i in 0..leak.len() {
            self.take(simd, i, along[i], [&mut first[i], &mut second[i]], &mut leak[i]);
        }
    }

    /// Adds to the weights of a vector of coarse nodes along the other axes and to their leaks. Returns what couples those on
    /// both sides besides.
    #[inline(always)]
    fn take(
        &self,
        simd: S,
        i: usize,
        along: S::f32s,
        [first, second]: [&mut S::f32s; 2],
        leak: &mut S::f32s,
    ) -> S::f32s {
        let shares = [self.shares[0][i], self.shares[1][i]];
        add_lost(simd, self.exists[i], along, shares, leak);
        let of_first = divide_weights(simd, shares, &self.across[0], i, first, leak);
        let of_second = divide_weights(simd, shares, &self.across[1], i, second, leak);
        simd.add_f32s(of_first, of_second)
    }
}

/// Shares of successive nodes.
#[inline(always)]
fn shares_at<S: Simd>([own, other]: [&Shares; 2], place: usize, n: usize) -> [&[S::f32s]; 2] {
    [vectors::<S>(&own.values, place, n), vectors::<S>(&other.values, place, n)]
}

/// Those of the nodes before and after them along an axis.
#[inline(always)]
fn shares_around<S: Simd>(shares: [&Shares; 2], axis: usize, place: usize, n: usize) -> [[&[S::f32s]; 2]; 2] {
    let stride = shares[0].strides[axis];
    [shares_at::<S>(shares, place - stride, n), shares_at::<S>(shares, place + stride, n)]
}

/// A node in another plane across an axis.
#[inline(always)]
fn beside(mut node: [usize; 3], axis: usize, plane: usize) -> [usize; 3] {
    node[axis] = plane;
    node
}

/// A leak, but for those below zero, which links to edges of conductors may be: they are so little that a preconditioner
/// does not feel them; but on a coarse level they could outweigh what else a node has.
#[inline(always)]
fn above_zero<S: Simd>(simd: S, leak: S::f32s) -> S::f32s {
    simd.max_f32s(leak, simd.splat_f32s(0.0))
}
