//! Rows of pixels, looked at some at a time.

/// Pixels that are looked at together.
pub(super) const LANES: usize = 8;

/// Successive values from an index on, and others behind the last.
#[inline(always)]
pub(super) fn lanes<T: Copy>(values: &[T], at: usize, others: T) -> [T; LANES] {
    let rest = values.get(at..).unwrap_or_default();
    match rest.first_chunk() {
        Some(chunk) => *chunk,
        None => {
            let mut all = [others; LANES];
            all[..rest.len()].copy_from_slice(rest);
            all
        }
    }
}

/// The first place at which something is the case in two rows that are as long.
#[inline(always)]
pub(super) fn first_where(a: &[f32], b: &[f32], is: impl Fn(f32, f32) -> bool) -> Option<usize> {
    let blocks = a.as_chunks::<LANES>().0.iter().zip(b.as_chunks::<LANES>().0);
    let passed = LANES * blocks.take_while(|(a, b)| !is_anywhere(a, b, &is)).count();
    let found = a[passed..].iter().zip(&b[passed..]).position(|(&a, &b)| is(a, b));
    found.map(|found| passed + found)
}

/// The last one.
#[inline(always)]
pub(super) fn last_where(a: &[f32], b: &[f32], is: impl Fn(f32, f32) -> bool) -> Option<usize> {
    let blocks = a.as_rchunks::<LANES>().1.iter().zip(b.as_rchunks::<LANES>().1);
    let passed = LANES * blocks.rev().take_while(|(a, b)| !is_anywhere(a, b, &is)).count();
    let rest = a.len() - passed;
    a[..rest].iter().zip(&b[..rest]).rposition(|(&a, &b)| is(a, b))
}

/// Mapped arrays may become calls, which are compiled without the processor's extensions.
#[inline(always)]
fn is_anywhere(a: &[f32; LANES], b: &[f32; LANES], is: &impl Fn(f32, f32) -> bool) -> bool {
    let mut found = false;
    for i in 0..LANES {
        found |= is(a[i], b[i]);
    }
    found
}

/// The extreme one of some depths, found in lanes that do not wait for each other.
#[inline(always)]
pub(super) fn reduce(depths: &[f32], start: f32, pick: impl Fn(f32, f32) -> f32) -> f32 {
    let (blocks, rest) = depths.as_chunks::<LANES>();
    let mut lanes = [start; LANES];
    for block in blocks {
        for i in 0..LANES {
            lanes[i] = pick(lanes[i], block[i]);
        }
    }
    lanes.iter().chain(rest).fold(start, |extreme, &depth| pick(extreme, depth))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_and_last_places_are_found_wherever_they_are() {
        for len in [0, 1, 7, 8, 9, 16, 21] {
            let zeros = vec![0.0; len];
            let differ = |a: f32, b: f32| a != b;
            assert_eq!([first_where(&zeros, &zeros, differ), last_where(&zeros, &zeros, differ)], [None; 2]);
            for (first, last) in (0..len).flat_map(|first| (first..len).map(move |last| (first, last))) {
                let mut row = zeros.clone();
                (row[first], row[last]) = (1.0, 2.0);
                assert_eq!(first_where(&row, &zeros, differ), Some(first), "{len}");
                assert_eq!(last_where(&row, &zeros, differ), Some(last), "{len}");
                assert_eq!(reduce(&row, 0.0, f32::max), 2.0);
            }
        }
    }
}
