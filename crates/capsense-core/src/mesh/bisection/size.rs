//! Refinement until elements are as small as a function of position wants them.
//!
//! Elements are bisected three times or not at all, but where neighbours ask for more: the generations between
//! may have obtuse angles, and so edges of negative weight. An element counts with the diagonal of the cell that it is of. A
//! Kuhn tetrahedron (x0, x1, x2, x3) has it from x0 to x3; in the next two generations x3 is the middle of the cell and
//! x0 one of its corners.

use super::ring::Scratch;
use super::{Bisection, Refinement};
use glam::DVec3;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// An element that is to be smaller.
struct Oversized {
    /// The diagonal of its cell in parts of the longest edge wanted.
    ratio: f64,
    element: u32,
    generation: u8,
}

impl Bisection {
    /// Bisects the element of the cell that is largest in relation to the size wanted, again and again, until no cell's
    /// diagonal, and so no element's edge, is longer than wanted; or until one more bisection would make more than
    /// `max_tets` elements. Sizes then exceed those wanted by about the same factor everywhere.
    ///
    /// `size` gives the longest edge wanted around a point, in metres; the least of its values at the corners and the
    /// centroid counts. Where it is NaN, any size is right.
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
        let generation = self.generations[element as usize];
        let corners = self.corners(element as usize);
        let diagonal = corners[0].distance(corners[3]) * if generation.is_multiple_of(3) { 1.0 } else { 2.0 };
        let centroid = corners.iter().sum::<DVec3>() / 4.0;
        let wanted = corners.into_iter().map(&size).fold(size(centroid), f64::min);
        let ratio = diagonal / if wanted < 0.0 { 0.0 } else { wanted };
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
