//! The arithmetic of a stage, on successive coarse nodes of one row: whole blocks, the same whatever is in them.

use super::rows::single;
use pulp::Simd;
use std::ops::Range;

/// A coarse network follows the fine one but for changes below this part of a weight, which a preconditioner does not
/// feel: so what a motion does to a few rows does not spread over all of the coarse levels. What is kept is never further
/// than that from what it should be, however many frames go by.
const NEGLIGIBLE: f32 = 0.02;

/// Shares that miss no more than this to one miss nothing.
const ROUNDING: f32 = 1e-6;

/// The numbers of a vector of nodes, counted from the first.
const LANES: [f32; 8] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

/// What is across the axis of a stage at eliminated nodes.
#[derive(Clone, Copy)]
pub(super) struct Across<'a> {
    /// The shares that they have in the coarse nodes, and in those on their other side.
    pub(super) own: [&'a [f32]; 2],
    /// The same of those before and of those after them.
    pub(super) around: [[&'a [f32]; 2]; 2],
    /// The weights from those before and to those after.
    pub(super) weights: [&'a [f32]; 2],
}

/// The first and the last of the nodes that changed.
struct Extent<S: Simd> {
    first: S::f32s,
    last: S::f32s,
}

/// Where numbers of a row changed.
#[derive(Clone, Debug)]
pub(super) struct Taken {
    pub(super) any: Range<u32>,
    /// The weight to the next node along each axis.
    pub(super) next: [Range<u32>; 3],
}

/// The shares of eliminated nodes in the nodes before and after them, from their weights to these and their leak. Returns
/// whether any is another than before.
#[inline(always)]
pub(super) fn divide_value<S: Simd>(
    simd: S,
    exists: &[f32],
    [before, after, leak]: [&[f32]; 3],
    [previous, next]: [&mut [f32]; 2],
) -> bool {
    let (previous, next) = (S::as_mut_simd_f32s(previous).0, S::as_mut_simd_f32s(next).0);
    let n = previous.len();
    let (next, exists) = (&mut next[..n], &single::<S>(exists)[..n]);
    let (before, after) = (&single::<S>(before)[..n], &single::<S>(after)[..n]);
    let leak = &single::<S>(leak)[..n];
    // Keeps 0 / 0 away. An infinite leak leaves nothing to the neighbours, and one below zero would leave them more than
    // there is.
    let (least, zero) = (simd.splat_f32s(f32::MIN_POSITIVE), simd.splat_f32s(0.0));
    let mut difference = zero;
    for i in 0..n {
        let leak = simd.max_f32s(leak[i], zero);
        let sum = simd.add_f32s(simd.add_f32s(before[i], after[i]), leak);
        let scale = simd.div_f32s(exists[i], simd.max_f32s(sum, least));
        let (new_previous, new_next) = (simd.mul_f32s(before[i], scale), simd.mul_f32s(after[i], scale));
        let of_previous = simd.abs_f32s(simd.sub_f32s(new_previous, previous[i]));
        let of_next = simd.abs_f32s(simd.sub_f32s(new_next, next[i]));
        difference = simd.max_f32s(difference, simd.max_f32s(of_previous, of_next));
        (previous[i], next[i]) = (new_previous, new_next);
    }
    simd.reduce_max_f32s(difference) > 0.0
}

/// Puts the edges of an eliminated node in series: the weight to it becomes that to the coarse node behind it, to which is
/// added what else couples the two.
#[inline(always)]
pub(super) fn put_in_series<S: Simd>(
    simd: S,
    exists: &[f32],
    next: &[f32],
    more: &[f32],
    weight: &mut [f32],
) {
    let weight = S::as_mut_simd_f32s(weight).0;
    let (exists, next, more) = (single::<S>(exists), single::<S>(next), single::<S>(more));
    let one = simd.splat_f32s(1.0);
    for (((weight, next), exists), more) in weight.iter_mut().zip(next).zip(exists).zip(more) {
        let part = simd.add_f32s(*next, simd.sub_f32s(one, *exists));
        *weight = simd.add_f32s(simd.mul_f32s(*weight, part), *more);
    }
}

/// Adds to the leak what weights to eliminated nodes lose, because their shares do not sum to one.
#[inline(always)]
pub(super) fn add_lost<S: Simd>(
    simd: S,
    exists: &[f32],
    weight: &[f32],
    [previous, next]: [&[f32]; 2],
    leak: &mut [f32],
) {
    let leak = S::as_mut_simd_f32s(leak).0;
    let n = leak.len();
    let (exists, weight) = (&single::<S>(exists)[..n], &single::<S>(weight)[..n]);
    let (previous, next) = (&single::<S>(previous)[..n], &single::<S>(next)[..n]);
    let (zero, rounding) = (simd.splat_f32s(0.0), simd.splat_f32s(ROUNDING));
    for i in 0..n {
        let lost = simd.sub_f32s(exists[i], simd.add_f32s(previous[i], next[i]));
        let lost = simd.select_f32s(simd.greater_than_f32s(lost, rounding), lost, zero);
        leak[i] = simd.add_f32s(leak[i], simd.mul_f32s(weight[i], lost));
    }
}

/// Takes the part of coarse nodes in the weights across the axis of their eliminated neighbours.
///
/// Where of two of these one takes more from this side and the other more from the other, that couples coarse nodes which
/// are no neighbours. It is divided between the two ways from one to the other along axes, of which `along` gets what is
/// along this one: a body of high permittivity neither is tied to ground by its surface nor falls apart there. What is
/// left has no potential at its other end, and leaks.
#[inline(always)]
pub(super) fn divide_weights<S: Simd>(
    simd: S,
    across: Across<'_>,
    weight: &mut [f32],
    leak: &mut [f32],
    along: &mut [f32],
) {
    let (weight, leak) = (S::as_mut_simd_f32s(weight).0, S::as_mut_simd_f32s(leak).0);
    let along = S::as_mut_simd_f32s(along).0;
    let n = weight.len();
    let [own, other] = across.own.map(|shares| &single::<S>(shares)[..n]);
    let [[own_before, other_before], [own_after, other_after]] =
        across.around.map(|both| both.map(|shares| &single::<S>(shares)[..n]));
    let [before, after] = across.weights.map(|weights| &single::<S>(weights)[..n]);
    let (leak, along, half) = (&mut leak[..n], &mut along[..n], simd.splat_f32s(0.5));
    for i in 0..n {
        let shares = [own[i], other[i]];
        let with_after = Divided::between(simd, shares, [own_after[i], other_after[i]]);
        let with_before = Divided::between(simd, shares, [own_before[i], other_before[i]]);
        let crossing_after = simd.mul_f32s(half, simd.mul_f32s(after[i], with_after.crossing));
        let crossing_before = simd.mul_f32s(half, simd.mul_f32s(before[i], with_before.crossing));
        let shared = simd.mul_f32s(after[i], with_after.shared);
        weight[i] = simd.add_f32s(weight[i], simd.add_f32s(shared, crossing_after));
        along[i] = simd.add_f32s(along[i], simd.add_f32s(crossing_after, crossing_before));
        let to_after = simd.mul_f32s(after[i], with_after.lost);
        let to_before = simd.mul_f32s(before[i], with_before.lost);
        leak[i] = simd.add_f32s(leak[i], simd.add_f32s(to_after, to_before));
    }
}

/// What becomes of a weight between two eliminated nodes, on one side.
struct Divided<S: Simd> {
    /// The part that both take from this side.
    shared: S::f32s,
    /// What one takes from this side and the other from the other.
    crossing: S::f32s,
    /// What the first node loses.
    lost: S::f32s,
}

impl<S: Simd> Divided<S> {
    /// For the shares of two eliminated nodes in the coarse nodes on this side, and in those on the other.
    #[inline(always)]
    fn between(simd: S, [own, other]: [S::f32s; 2], [own_beside, other_beside]: [S::f32s; 2]) -> Self {
        let zero = simd.splat_f32s(0.0);
        let excess = |a: S::f32s, b: S::f32s| simd.max_f32s(simd.sub_f32s(a, b), zero);
        let (more, less) = (excess(own, own_beside), excess(own_beside, own));
        let crossing = simd.min_f32s(more, excess(other_beside, other));
        let back = simd.min_f32s(less, excess(other, other_beside));
        let lost = simd.sub_f32s(more, crossing);
        let is_lost = simd.greater_than_f32s(lost, simd.splat_f32s(ROUNDING));
        Self {
            shared: simd.sub_f32s(own, more),
            crossing: simd.add_f32s(crossing, back),
            lost: simd.select_f32s(is_lost, lost, zero),
        }
    }
}

/// Takes over those numbers that are not nearly what is stored: weights to the next nodes along x, y and z, and leaks.
/// Nodes are counted from `first`.
#[inline(always)]
pub(super) fn take_over<S: Simd>(
    simd: S,
    first: usize,
    [x, y, z, leak]: [&mut [f32]; 4],
    [new_x, new_y, new_z, new_leak]: [&[f32]; 4],
) -> Taken {
    let (x, y) = (S::as_mut_simd_f32s(x).0, S::as_mut_simd_f32s(y).0);
    let (z, leak) = (S::as_mut_simd_f32s(z).0, S::as_mut_simd_f32s(leak).0);
    let n = x.len();
    let (y, z, leak) = (&mut y[..n], &mut z[..n], &mut leak[..n]);
    let (new_x, new_y) = (&single::<S>(new_x)[..n], &single::<S>(new_y)[..n]);
    let (new_z, new_leak) = (&single::<S>(new_z)[..n], &single::<S>(new_leak)[..n]);
    let step = simd.splat_f32s(S::F32_LANES as f32);
    let mut node = simd.add_f32s(simd.splat_f32s(first as f32), single::<S>(&LANES)[0]);
    let [mut any, mut of_x] = [Extent::none(simd), Extent::none(simd)];
    let [mut of_y, mut of_z] = [Extent::none(simd), Extent::none(simd)];
    for i in 0..n {
        let differs_x = replace_if_different(simd, &mut x[i], new_x[i]);
        let differs_y = replace_if_different(simd, &mut y[i], new_y[i]);
        let differs_z = replace_if_different(simd, &mut z[i], new_z[i]);
        let differs_leak = replace_if_different(simd, &mut leak[i], new_leak[i]);
        let differs = simd.or_m32s(simd.or_m32s(differs_x, differs_y), simd.or_m32s(differs_z, differs_leak));
        of_x.add(simd, node, differs_x);
        of_y.add(simd, node, differs_y);
        of_z.add(simd, node, differs_z);
        any.add(simd, node, differs);
        node = simd.add_f32s(node, step);
    }
    Taken { any: any.range(simd), next: [of_x.range(simd), of_y.range(simd), of_z.range(simd)] }
}

/// Takes over numbers where they are not nearly those that are stored. Returns where.
#[inline(always)]
fn replace_if_different<S: Simd>(simd: S, stored: &mut S::f32s, new: S::f32s) -> S::m32s {
    // Infinite is not nearly any other number, but nearly infinite.
    let most = simd.splat_f32s(f32::MAX);
    let (a, b) = (simd.min_f32s(new, most), simd.min_f32s(*stored, most));
    let slack = simd.mul_f32s(simd.splat_f32s(NEGLIGIBLE), simd.max_f32s(a, b));
    let differs = simd.greater_than_f32s(simd.abs_f32s(simd.sub_f32s(a, b)), slack);
    *stored = simd.select_f32s(differs, new, *stored);
    differs
}

impl<S: Simd> Extent<S> {
    #[inline(always)]
    fn none(simd: S) -> Self {
        Self { first: simd.splat_f32s(f32::INFINITY), last: simd.splat_f32s(-1.0) }
    }

    #[inline(always)]
    fn add(&mut self, simd: S, node: S::f32s, changed: S::m32s) {
        self.first = simd.select_f32s(changed, simd.min_f32s(self.first, node), self.first);
        self.last = simd.select_f32s(changed, simd.max_f32s(self.last, node), self.last);
    }

    #[inline(always)]
    fn range(self, simd: S) -> Range<u32> {
        simd.reduce_min_f32s(self.first) as u32..(simd.reduce_max_f32s(self.last) + 1.0) as u32
    }
}
