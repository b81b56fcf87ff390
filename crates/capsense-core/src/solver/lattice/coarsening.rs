//! The arithmetic of a stage, on successive coarse nodes of one row: whole blocks, the same whatever is in them.

use super::rows::single;
use pulp::Simd;
use std::ops::Range;

/// A coarse network follows the fine one but for changes below this part of a weight, which a preconditioner does not
/// feel: so what a motion does to a few rows does not spread over all of the coarse levels. What is kept is never further
/// than that from what it should be, however many frames go by.
///
/// Measured where a bar moves towards the sensor, grounded or of permittivity 80, at 25k, 300k and 1.5 million tetrahedra:
/// 2,400 frames took 1,926 cycles with 0.02, 1,837 with 0.05 and 1,947 with 0.1, of which those of the grounded bar at
/// 1.5 million were a sixth more. Shares follow every change: where they did only when they were more than 2 % away, the
/// body of permittivity 80 took a third more cycles at 25k.
const NEGLIGIBLE: f32 = 0.05;

/// Shares that miss no more than this to one miss nothing.
const ROUNDING: f32 = 1e-6;

/// The numbers of a vector of nodes, counted from the first.
const LANES: [f32; 8] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

/// What is across the axis of a stage at successive eliminated nodes, along one other axis: of the nodes before and of those
/// after them.
pub(super) struct Across<'a, S: Simd> {
    /// The weights to them.
    pub(super) weights: [&'a [S::f32s]; 2],
    /// The shares that they have in the coarse nodes, and in those on their other side.
    pub(super) shares: [[&'a [S::f32s]; 2]; 2],
}

/// Where numbers of a row changed.
#[derive(Clone, Debug)]
pub(super) struct Taken {
    pub(super) nodes: Range<u32>,
    /// Whether any weight to the next node did, along each axis.
    pub(super) next: [bool; 3],
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
    exists: S::f32s,
    next: S::f32s,
    more: S::f32s,
    weight: &mut S::f32s,
) {
    let part = simd.add_f32s(next, simd.sub_f32s(simd.splat_f32s(1.0), exists));
    *weight = simd.add_f32s(simd.mul_f32s(*weight, part), more);
}

/// Adds to the leak what weights to eliminated nodes lose, because their shares do not sum to one.
#[inline(always)]
pub(super) fn add_lost<S: Simd>(
    simd: S,
    exists: S::f32s,
    weight: S::f32s,
    [own, other]: [S::f32s; 2],
    leak: &mut S::f32s,
) {
    let lost = simd.sub_f32s(exists, simd.add_f32s(own, other));
    let is_lost = simd.greater_than_f32s(lost, simd.splat_f32s(ROUNDING));
    let lost = simd.select_f32s(is_lost, lost, simd.splat_f32s(0.0));
    *leak = simd.add_f32s(*leak, simd.mul_f32s(weight, lost));
}

/// Takes the part of coarse nodes in the weights across the axis of their eliminated neighbours, whose shares in the coarse
/// nodes and in those on their other side are given. Returns what is to be added along the axis.
///
/// Where of two of these one takes more from this side and the other more from the other, that couples coarse nodes which
/// are no neighbours. It is divided between the two ways from one to the other along axes, of which this axis gets what is
/// along it: a body of high permittivity neither is tied to ground by its surface nor falls apart there. What is left has
/// no potential at its other end, and leaks.
#[inline(always)]
pub(super) fn divide_weights<S: Simd>(
    simd: S,
    shares: [S::f32s; 2],
    across: &Across<'_, S>,
    i: usize,
    weight: &mut S::f32s,
    leak: &mut S::f32s,
) -> S::f32s {
    let ([before, after], [around_before, around_after]) = (&across.weights, &across.shares);
    let (before, after, half) = (before[i], after[i], simd.splat_f32s(0.5));
    let with_after = Divided::between(simd, shares, [around_after[0][i], around_after[1][i]]);
    let with_before = Divided::between(simd, shares, [around_before[0][i], around_before[1][i]]);
    let crossing_after = simd.mul_f32s(half, simd.mul_f32s(after, with_after.crossing));
    let crossing_before = simd.mul_f32s(half, simd.mul_f32s(before, with_before.crossing));
    let shared = simd.mul_f32s(after, with_after.shared);
    *weight = simd.add_f32s(*weight, simd.add_f32s(shared, crossing_after));
    let to_after = simd.mul_f32s(after, with_after.lost);
    let to_before = simd.mul_f32s(before, with_before.lost);
    *leak = simd.add_f32s(*leak, simd.add_f32s(to_after, to_before));
    simd.add_f32s(crossing_after, crossing_before)
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
/// Nodes are counted from `first`. Returns where; none if nowhere.
#[inline(always)]
pub(super) fn take_over<S: Simd>(
    simd: S,
    first: usize,
    [x, y, z, leak]: [&mut [f32]; 4],
    [new_x, new_y, new_z, new_leak]: [&[f32]; 4],
) -> Option<Taken> {
    let (x, y) = (S::as_mut_simd_f32s(x).0, S::as_mut_simd_f32s(y).0);
    let (z, leak) = (S::as_mut_simd_f32s(z).0, S::as_mut_simd_f32s(leak).0);
    let n = x.len();
    let (y, z, leak) = (&mut y[..n], &mut z[..n], &mut leak[..n]);
    let (new_x, new_y) = (&single::<S>(new_x)[..n], &single::<S>(new_y)[..n]);
    let (new_z, new_leak) = (&single::<S>(new_z)[..n], &single::<S>(new_leak)[..n]);
    let step = simd.splat_f32s(S::F32_LANES as f32);
    let mut node = simd.add_f32s(simd.splat_f32s(first as f32), single::<S>(&LANES)[0]);
    let (none, zero, one) = (simd.splat_f32s(-1.0), simd.splat_f32s(0.0), simd.splat_f32s(1.0));
    let (mut first, mut last) = (simd.splat_f32s(f32::INFINITY), none);
    let (mut of_x, mut of_y, mut of_z) = (zero, zero, zero);
    for i in 0..n {
        let differs_x = replace_if_different(simd, &mut x[i], new_x[i]);
        let differs_y = replace_if_different(simd, &mut y[i], new_y[i]);
        let differs_z = replace_if_different(simd, &mut z[i], new_z[i]);
        let differs_leak = replace_if_different(simd, &mut leak[i], new_leak[i]);
        let differs = simd.or_m32s(simd.or_m32s(differs_x, differs_y), simd.or_m32s(differs_z, differs_leak));
        of_x = simd.select_f32s(differs_x, one, of_x);
        of_y = simd.select_f32s(differs_y, one, of_y);
        of_z = simd.select_f32s(differs_z, one, of_z);
        first = simd.select_f32s(differs, simd.min_f32s(first, node), first);
        last = simd.select_f32s(differs, node, last);
        node = simd.add_f32s(node, step);
    }
    let last = simd.reduce_max_f32s(last);
    if last < 0.0 {
        return None;
    }
    let nodes = simd.reduce_min_f32s(first) as u32..last as u32 + 1;
    let (of_x, of_y, of_z) =
        (simd.reduce_max_f32s(of_x), simd.reduce_max_f32s(of_y), simd.reduce_max_f32s(of_z));
    Some(Taken { nodes, next: [of_x > 0.0, of_y > 0.0, of_z > 0.0] })
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
