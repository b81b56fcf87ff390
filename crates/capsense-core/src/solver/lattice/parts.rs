//! Planes shared out among threads.
//!
//! Fused work goes through the planes in stages, each one plane behind the one before, because it needs what that left
//! in the planes on both sides. So each thread first does what needs no planes but those of its slab, which is a plane
//! less at either end from stage to stage; then what is left at the borders between slabs is done. A stage reads only
//! what no other node of the same stage writes: whatever the slabs, the results have the same bits.

use super::layout::Layout;
use std::ops::Range;

/// A slab must have so many planes, for the borders at its two ends not to touch.
const MIN_PLANES: usize = 8;

/// A slab without borders must have so many, as each goes through two or three planes of its neighbours again.
const MIN_PLANES_APART: usize = 4;

/// Below this number of nodes, threads lose more with borders than they save.
const WORTHWHILE: usize = 3_000;

/// How the planes of a lattice are cut.
#[derive(Clone, Debug)]
pub(super) struct Parts {
    /// What is done first, and what after it.
    pub(super) slabs: Vec<Part>,
    pub(super) borders: Vec<Part>,
}

/// Work that one thread does alone.
#[derive(Clone, Debug)]
pub(super) struct Part {
    /// The planes that it may use, where they are in vectors, and where those before it are.
    pub(super) planes: Range<usize>,
    pub(super) places: Range<usize>,
    /// The planes of the first stage.
    first: Range<usize>,
    /// By how many planes each further stage starts and ends later.
    later: [isize; 2],
}

impl Parts {
    /// Cuts the planes of vectors for so many threads at most. There is always one slab.
    pub(super) fn new(layout: &Layout, threads: usize) -> Self {
        let planes = layout.planes();
        let count = threads.min(planes.len() / MIN_PLANES).max(1);
        Self::cut_at(layout, count, |slab| planes.start + planes.len() * slab / count)
    }

    /// Cuts planes that each know how many planes of another lattice are before them, so that slabs have as many of
    /// those. They do not border on each other.
    pub(super) fn apart(layout: &Layout, threads: usize, before: impl Fn(usize) -> usize) -> Self {
        let count = threads.min(layout.planes().len() / MIN_PLANES_APART).max(1);
        let mut parts = Self { slabs: Vec::with_capacity(count), borders: Vec::new() };
        parts.cut_apart(layout, count, 0, before);
        parts
    }

    /// Cuts the planes of [`Parts::apart`] anew: the first slab, whose thread has something else to do before, gets fewer planes
    /// than others. By how many, counted as those before a plane are, it may not get what the others do: `later`.
    pub(super) fn recut(&mut self, layout: &Layout, later: usize, before: impl Fn(usize) -> usize) {
        self.cut_apart(layout, self.slabs.len(), later, before);
    }

    fn cut_apart(&mut self, layout: &Layout, count: usize, later: usize, before: impl Fn(usize) -> usize) {
        let planes = layout.planes();
        let (first, all) = (before(planes.start), before(planes.end) - before(planes.start));
        let of_first = if count == 1 { all } else { ((all + later) / count).saturating_sub(later) };
        let start = |slab: usize| of_first + (all - of_first) * (slab - 1) / (count - 1);
        let border = |slab: usize| {
            if slab == 0 || slab == count {
                return if slab == 0 { planes.start } else { planes.end };
            }
            let reached = |plane: &usize| before(*plane) - first >= start(slab);
            planes.clone().find(reached).unwrap_or(planes.end)
        };
        self.slabs.clear();
        self.slabs.extend(slabs(layout, count, border));
    }

    /// So many slabs, each from its border to the next.
    fn cut_at(layout: &Layout, count: usize, border: impl Fn(usize) -> usize) -> Self {
        let all = 0..layout.counts[2];
        let middle = |slab: usize| border(slab).midpoint(border(slab + 1));
        let borders = (1..count).map(|slab| {
            let from = if slab == 1 { all.start } else { middle(slab - 1) };
            let to = if slab + 1 == count { all.end } else { middle(slab) };
            let first = border(slab)..border(slab);
            Part { planes: from..to, places: places(layout, from..to), first, later: [-1, 1] }
        });
        Self { slabs: slabs(layout, count, &border).collect(), borders: borders.collect() }
    }

    /// As many threads as are worth it for a lattice.
    pub(super) fn worthwhile(layout: &Layout, threads: usize) -> usize {
        if layout.counts.into_iter().product::<usize>() < WORTHWHILE { 1 } else { threads }
    }

    /// What is done first, and what after it.
    pub(super) fn phases(&self) -> [&[Part]; 2] {
        [&self.slabs, &self.borders]
    }
}

/// So many slabs, each from its border to the next.
fn slabs(layout: &Layout, count: usize, border: impl Fn(usize) -> usize) -> impl Iterator<Item = Part> {
    let all = 0..layout.counts[2];
    (0..count).map(move |slab| {
        let first = border(slab)..border(slab + 1);
        let (is_first, is_last) = (slab == 0, slab + 1 == count);
        let from = if is_first { all.start } else { first.start };
        let to = if is_last { all.end } else { first.end };
        let later = [isize::from(!is_first), -isize::from(!is_last)];
        Part { planes: from..to, places: places(layout, from..to), first, later }
    })
}

/// Where planes are in vectors.
pub(super) fn places(layout: &Layout, planes: Range<usize>) -> Range<usize> {
    // Before the first plane and behind the last one is padding, which is theirs.
    let border = |plane: usize| match plane {
        0 => 0,
        plane if plane == layout.counts[2] => layout.len(),
        plane => layout.cut(plane),
    };
    border(planes.start)..border(planes.end)
}

impl Part {
    /// The steps of work with so many stages.
    #[inline(always)]
    pub(super) fn steps(&self, stages: usize) -> Range<usize> {
        let behind = (stages - 1) * (1 + self.later[1]) as usize;
        self.first.start..self.first.end + behind
    }

    /// The plane in which a stage works in a step.
    #[inline(always)]
    pub(super) fn plane(&self, stage: usize, step: usize) -> Option<usize> {
        let [start, end] = self.later;
        let plane = step as isize - stage as isize;
        let from = self.first.start as isize + stage as isize * start;
        let to = self.first.end as isize + stage as isize * end;
        if from <= plane && plane < to { Some(plane as usize) } else { None }
    }

    /// A place of a vector in the piece that is of this part.
    #[inline(always)]
    pub(super) fn within(&self, places: &Range<usize>) -> Range<usize> {
        let base = self.places.start;
        places.start - base..places.end - base
    }
}

/// Cuts a vector at the parts.
fn cut<'a, T>(parts: &[Part], mut values: &'a mut [T]) -> impl Iterator<Item = &'a mut [T]> {
    parts.iter().map_while(move |part| values.split_off_mut(..part.places.len()))
}

/// Cuts a vector with one value for each plane at the parts.
pub(super) fn cut_planes<'a, T>(
    parts: &[Part],
    mut values: &'a mut [T],
) -> impl Iterator<Item = &'a mut [T]> {
    parts.iter().map_while(move |part| values.split_off_mut(..part.planes.len()))
}

/// Cuts the vectors of both colours.
pub(super) fn cut_both<'a, T>(
    parts: &[Part],
    [red, black]: &'a mut [Vec<T>; 2],
) -> impl Iterator<Item = [&'a mut [T]; 2]> {
    cut(parts, red).zip(cut(parts, black)).map(|(red, black)| [red, black])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever the first slab is to leave to others, all planes and places are in one, in their order, also where the first plane is
    /// free; the later its thread comes the fewer are in the first one.
    #[test]
    fn the_first_slab_leaves_planes_to_others() {
        for (margin, threads) in [0, 1].into_iter().flat_map(|margin| [1, 2, 3, 5].map(|of| (margin, of))) {
            let layout = Layout::new([9, 9, 41], [margin; 2]).with_columns(3);
            let mut parts = Parts::apart(&layout, threads, |plane| 3 * plane);
            let even = parts.slabs[0].steps(1).len();
            assert!(even.abs_diff(layout.planes().len() / threads) <= 1, "{threads} {even}");
            let mut fewest = even;
            for later in [0, 10, 40, 100, 1000] {
                parts.recut(&layout, later, |plane| 3 * plane);
                let (mut plane, mut place) = (layout.planes().start, 0);
                for slab in &parts.slabs {
                    assert_eq!([slab.steps(1).start, slab.places.start], [plane, place], "{margin} {later}");
                    (plane, place) = (slab.steps(1).end, slab.places.end);
                }
                let all = [threads, layout.planes().end, layout.len()];
                assert_eq!([parts.slabs.len(), plane, place], all, "{margin} {later}");
                let of_first = parts.slabs[0].steps(1).len();
                assert!(of_first <= fewest, "{threads} {later}");
                fewest = of_first;
            }
            assert!(threads == 1 || fewest == 0);
        }
    }
}
