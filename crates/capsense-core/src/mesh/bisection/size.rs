//! Refinement until elements are as small as a function of position wants them.

use super::ring::Scratch;
use super::{Bisection, Refinement};
use glam::DVec3;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// An element that is to be smaller.
struct Oversized {
    /// Its longest edge in parts of the longest wanted.
    ratio: f64,
    element: u32,
    generation: u8,
}

impl Bisection {
    /// Bisects the element that is largest in relation to the size wanted, again and again, until no edge is longer than
    /// wanted, or one more bisection would make more than `max_tets` elements. `size` gives the longest edge wanted around a
    /// point, in metres; the least of its values at the corners and the centroid counts. Where it is NaN, any size is right.
    pub fn refine_to_size(&mut self, size: impl Fn(DVec3) -> f64, max_tets: usize) -> Refinement {
        let mut oversized: BinaryHeap<Oversized> =
            (0..self.tets.len() as u32).filter_map(|element| self.oversized(element, &size)).collect();
        let mut scratch = Scratch::default();
        let mut refinement = Refinement::Complete;
        while let Some(Oversized { element, generation, .. }) = oversized.pop() {
            if self.generations[element as usize] != generation {
                continue;
            }
            let before = self.parents.len();
            match self.bisect(element, max_tets, &mut scratch) {
                Refinement::Full => return Refinement::Full,
                Refinement::TooFine => refinement = Refinement::TooFine,
                Refinement::Complete => {}
            }
            let split_off = self.lattice[1] + before..;
            for (element, &parent) in split_off.zip(&self.parents[before..]) {
                let both = [element as u32, parent];
                oversized.extend(both.into_iter().filter_map(|element| self.oversized(element, &size)));
            }
        }
        refinement
    }

    fn oversized(&self, element: u32, size: impl Fn(DVec3) -> f64) -> Option<Oversized> {
        let corners = self.corners(element as usize);
        let centroid = corners.iter().sum::<DVec3>() / 4.0;
        let wanted = corners.into_iter().map(&size).fold(size(centroid), f64::min);
        let squares = (0..4).flat_map(|i| (0..i).map(move |j| corners[i].distance_squared(corners[j])));
        let ratio = squares.fold(0.0, f64::max).sqrt() / if wanted < 0.0 { 0.0 } else { wanted };
        let generation = self.generations[element as usize];
        (ratio > 1.0).then_some(Oversized { ratio, element, generation })
    }
}

/// By ratio; of equal ones the earlier element is greater, so that it comes first.
impl Ord for Oversized {
    fn cmp(&self, other: &Self) -> Ordering {
        self.ratio.total_cmp(&other.ratio).then(other.element.cmp(&self.element))
    }
}

impl PartialOrd for Oversized {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Oversized {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Oversized {}
