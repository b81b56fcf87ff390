//! Arithmetic on pieces of rows. All lengths are whole numbers of blocks.
//!
//! Copies are written out, because rows are short and a call for each would cost more than the copy.

use super::layout::BLOCK;
use pulp::Simd;

/// A slice as vectors.
#[inline(always)]
pub(super) fn single<S: Simd>(slice: &[f32]) -> &[S::f32s] {
    S::as_simd_f32s(slice).0
}

/// Some successive numbers as vectors.
#[inline(always)]
pub(super) fn vectors<S: Simd>(numbers: &[f32], at: usize, n: usize) -> &[S::f32s] {
    single::<S>(&numbers[at..at + n])
}

/// The same, to be changed.
#[inline(always)]
pub(super) fn vectors_mut<S: Simd>(numbers: &mut [f32], at: usize, n: usize) -> &mut [S::f32s] {
    S::as_mut_simd_f32s(&mut numbers[at..at + n]).0
}

/// to = a.
#[inline(always)]
pub(super) fn copy<S: Simd>(to: &mut [f32], a: &[f32]) {
    for (to, a) in S::as_mut_simd_f32s(to).0.iter_mut().zip(S::as_simd_f32s(a).0) {
        *to = *a;
    }
}

/// to = a u.
#[inline(always)]
pub(super) fn multiply<S: Simd>(simd: S, to: &mut [f32], [a, u]: [&[f32]; 2]) {
    for (to, (a, u)) in S::as_mut_simd_f32s(to).0.iter_mut().zip(single::<S>(a).iter().zip(single::<S>(u))) {
        *to = simd.mul_f32s(*a, *u);
    }
}

/// to += a.
#[inline(always)]
pub(super) fn add<S: Simd>(simd: S, to: &mut [f32], a: &[f32]) {
    for (to, a) in S::as_mut_simd_f32s(to).0.iter_mut().zip(S::as_simd_f32s(a).0) {
        *to = simd.add_f32s(*to, *a);
    }
}

/// to -= a.
#[inline(always)]
pub(super) fn subtract<S: Simd>(simd: S, to: &mut [f32], a: &[f32]) {
    for (to, a) in S::as_mut_simd_f32s(to).0.iter_mut().zip(S::as_simd_f32s(a).0) {
        *to = simd.sub_f32s(*to, *a);
    }
}

/// to += a u.
#[inline(always)]
pub(super) fn add_product<S: Simd>(simd: S, to: &mut [f32], a: &[f32], u: &[f32]) {
    let (to, a, u) = (S::as_mut_simd_f32s(to).0, S::as_simd_f32s(a).0, S::as_simd_f32s(u).0);
    for ((to, a), u) in to.iter_mut().zip(a).zip(u) {
        *to = simd.add_f32s(*to, simd.mul_f32s(*a, *u));
    }
}

/// to -= a u.
#[inline(always)]
pub(super) fn subtract_product<S: Simd>(simd: S, to: &mut [f32], a: &[f32], u: &[f32]) {
    let (to, a, u) = (S::as_mut_simd_f32s(to).0, S::as_simd_f32s(a).0, S::as_simd_f32s(u).0);
    for ((to, a), u) in to.iter_mut().zip(a).zip(u) {
        *to = simd.sub_f32s(*to, simd.mul_f32s(*a, *u));
    }
}

/// to = own + a u.
#[inline(always)]
pub(super) fn add_to<S: Simd>(simd: S, to: &mut [f32], own: &[f32], [a, u]: [&[f32]; 2]) {
    let (own, a, u) = (S::as_simd_f32s(own).0, S::as_simd_f32s(a).0, S::as_simd_f32s(u).0);
    for (((to, own), a), u) in S::as_mut_simd_f32s(to).0.iter_mut().zip(own).zip(a).zip(u) {
        *to = simd.add_f32s(*own, simd.mul_f32s(*a, *u));
    }
}

/// to = own - f a.
#[inline(always)]
pub(super) fn subtract_multiple<S: Simd>(simd: S, to: &mut [f32], own: &[f32], factor: f32, a: &[f32]) {
    let (own, a, factor) = (S::as_simd_f32s(own).0, S::as_simd_f32s(a).0, simd.splat_f32s(factor));
    for ((to, own), a) in S::as_mut_simd_f32s(to).0.iter_mut().zip(own).zip(a) {
        *to = simd.sub_f32s(*own, simd.mul_f32s(factor, *a));
    }
}

/// to = a u + b v.
#[inline(always)]
pub(super) fn combine<S: Simd>(simd: S, to: &mut [f32], [a, u]: [&[f32]; 2], [b, v]: [&[f32]; 2]) {
    let (a, u) = (S::as_simd_f32s(a).0, S::as_simd_f32s(u).0);
    let (b, v) = (S::as_simd_f32s(b).0, S::as_simd_f32s(v).0);
    for ((((to, a), u), b), v) in S::as_mut_simd_f32s(to).0.iter_mut().zip(a).zip(u).zip(b).zip(v) {
        *to = simd.add_f32s(simd.mul_f32s(*a, *u), simd.mul_f32s(*b, *v));
    }
}

/// to = own + a u + b v.
#[inline(always)]
pub(super) fn gather<S: Simd>(
    simd: S,
    to: &mut [f32],
    own: &[f32],
    [a, u]: [&[f32]; 2],
    [b, v]: [&[f32]; 2],
) {
    let own = S::as_simd_f32s(own).0;
    let (a, u) = (S::as_simd_f32s(a).0, S::as_simd_f32s(u).0);
    let (b, v) = (S::as_simd_f32s(b).0, S::as_simd_f32s(v).0);
    let to = S::as_mut_simd_f32s(to).0;
    for (((((to, own), a), u), b), v) in to.iter_mut().zip(own).zip(a).zip(u).zip(b).zip(v) {
        let sum = simd.add_f32s(*own, simd.mul_f32s(*a, *u));
        *to = simd.add_f32s(sum, simd.mul_f32s(*b, *v));
    }
}

/// Deals a row to its first, third and so on, and to the others.
#[inline(always)]
pub(super) fn deal(row: &[f32], first: &mut [f32], second: &mut [f32]) {
    let (first, second) = (first.as_chunks_mut::<BLOCK>().0, second.as_chunks_mut::<BLOCK>().0);
    let row = row.as_chunks::<{ 2 * BLOCK }>().0;
    for ((row, first), second) in row.iter().zip(first).zip(second) {
        *first = [row[0], row[2], row[4], row[6], row[8], row[10], row[12], row[14]];
        *second = [row[1], row[3], row[5], row[7], row[9], row[11], row[13], row[15]];
    }
}

/// The opposite of [`deal`].
#[inline(always)]
pub(super) fn collect(row: &mut [f32], first: &[f32], second: &[f32]) {
    let (first, second) = (first.as_chunks::<BLOCK>().0, second.as_chunks::<BLOCK>().0);
    let row = row.as_chunks_mut::<{ 2 * BLOCK }>().0;
    for ((row, a), b) in row.iter_mut().zip(first).zip(second) {
        *row =
            [a[0], b[0], a[1], b[1], a[2], b[2], a[3], b[3], a[4], b[4], a[5], b[5], a[6], b[6], a[7], b[7]];
    }
}

/// Deals a piece of a row, of any length, as [`deal`] does. It is mostly shorter than two blocks.
#[inline(always)]
pub(super) fn deal_piece(row: &[f32], first: &mut [f32], second: &mut [f32]) {
    const HALF: usize = BLOCK / 2;
    let (blocks, rest) = row.as_chunks::<BLOCK>();
    let (first, first_rest) = first.split_at_mut((blocks.len() * HALF).min(first.len()));
    let (second, second_rest) = second.split_at_mut((blocks.len() * HALF).min(second.len()));
    let halves = first.as_chunks_mut::<HALF>().0.iter_mut().zip(second.as_chunks_mut::<HALF>().0);
    for (row, (first, second)) in blocks.iter().zip(halves) {
        *first = [row[0], row[2], row[4], row[6]];
        *second = [row[1], row[3], row[5], row[7]];
    }
    for (at, value) in rest.iter().enumerate() {
        let to = if at % 2 == 0 { first_rest.get_mut(at / 2) } else { second_rest.get_mut(at / 2) };
        if let Some(to) = to {
            *to = *value;
        }
    }
}

/// Copies the first, third and so on of a row, whatever their number. Pieces of rows are mostly shorter than two blocks.
#[inline(always)]
pub(super) fn copy_every_second(to: &mut [f32], row: &[f32]) {
    let (blocks, rest) = row.as_chunks::<BLOCK>();
    let (to_blocks, to_rest) = to.split_at_mut((blocks.len() * (BLOCK / 2)).min(to.len()));
    for (to, row) in to_blocks.as_chunks_mut::<{ BLOCK / 2 }>().0.iter_mut().zip(blocks) {
        *to = [row[0], row[2], row[4], row[6]];
    }
    for (to, row) in to_rest.iter_mut().zip(rest.chunks(2)) {
        *to = row[0];
    }
}
