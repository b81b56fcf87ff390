//! Boxes sorted into a uniform grid of bins, so that those near a region are found without looking at all of them.

use crate::geometry::Aabb;
use glam::{DVec3, USizeVec3};

/// Mean number of boxes for each bin.
const BOXES_PER_BIN: f64 = 8.0;

/// Bins along one axis are no more than this.
const MOST_BINS: f64 = 512.0;

/// Along an axis on which all boxes lie together, their extent counts as this part of the largest one.
const FLATTEST: f64 = 1e-3;

/// Extents below this are none; their product still is a number.
const SMALLEST: DVec3 = DVec3::splat(1e-100);

/// The boxes that overlap each bin, by their numbers.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Bins {
    low: DVec3,
    bins_per_metre: DVec3,
    last: USizeVec3,
    /// Bin b holds `boxes[starts[b]..starts[b + 1]]`.
    starts: Vec<u32>,
    boxes: Vec<u32>,
}

impl Bins {
    /// Sorts `count` boxes; `bounds` tells where each is.
    pub(crate) fn new(count: usize, bounds: impl Fn(usize) -> Aabb) -> Self {
        let all =
            (0..count).map(&bounds).fold(Aabb::EMPTY, |all, one| all.including(one.min).including(one.max));
        let size = all.size().max(DVec3::splat(FLATTEST * all.size().max_element()).max(SMALLEST));
        let bins = (count as f64 / BOXES_PER_BIN).max(1.0);
        let bin = (size.x * size.y * size.z / bins).cbrt();
        let counts = (size / bin).clamp(DVec3::ONE, DVec3::splat(MOST_BINS)).floor();
        let mut sorted = Self {
            low: all.min,
            bins_per_metre: counts / size,
            last: counts.as_usizevec3() - 1,
            starts: vec![0; counts.element_product() as usize + 1],
            boxes: Vec::new(),
        };
        for index in 0..count {
            let mut starts = std::mem::take(&mut sorted.starts);
            sorted.for_bins(&bounds(index), |bin| starts[bin + 1] += 1);
            sorted.starts = starts;
        }
        for bin in 1..sorted.starts.len() {
            sorted.starts[bin] += sorted.starts[bin - 1];
        }
        let mut boxes = vec![0; sorted.starts.last().map_or(0, |&end| end as usize)];
        let mut next = sorted.starts.clone();
        for index in 0..count {
            sorted.for_bins(&bounds(index), |bin| {
                boxes[next[bin] as usize] = index as u32;
                next[bin] += 1;
            });
        }
        Self { boxes, ..sorted }
    }

    /// Visits at least all boxes that touch a region, some of them several times.
    pub(crate) fn for_boxes_near(&self, region: &Aabb, mut visit: impl FnMut(u32)) {
        self.for_bins(region, |bin| {
            let boxes = self.starts[bin] as usize..self.starts[bin + 1] as usize;
            self.boxes[boxes].iter().copied().for_each(&mut visit);
        });
    }

    fn for_bins(&self, region: &Aabb, mut visit: impl FnMut(usize)) {
        // Rounds down the same way for boxes and regions, so that what touches shares a bin.
        let bin_at = |point: DVec3| {
            let bins = ((point - self.low) * self.bins_per_metre).max(DVec3::ZERO);
            bins.as_usizevec3().min(self.last)
        };
        let (from, to) = (bin_at(region.min), bin_at(region.max));
        for z in from.z..=to.z {
            for y in from.y..=to.y {
                for x in from.x..=to.x {
                    visit((z * (self.last.y + 1) + y) * (self.last.x + 1) + x);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_that_touches_a_region_is_found() {
        let place =
            |number: usize| DVec3::new(number as f64 % 7.0, (number / 7) as f64 % 7.0, (number / 49) as f64);
        let bounds = |number: usize| Aabb { min: 0.1 * place(number), max: 0.1 * place(number) + 0.1 };
        let bins = Bins::new(343, bounds);
        for number in 0..343 {
            // From a corner that eight boxes have in common.
            let region = Aabb { min: 0.1 * place(number), max: 0.1 * place(number) + 0.02 };
            let mut found = Vec::new();
            bins.for_boxes_near(&region, |number| found.push(number as usize));
            let touching = (0..343).filter(|&number| bounds(number).intersects(&region));
            touching.for_each(|number| assert!(found.contains(&number), "{number} of {found:?}"));
            found.sort_unstable();
            found.dedup();
            assert!(found.len() <= 64, "{found:?}");
        }
    }
}
