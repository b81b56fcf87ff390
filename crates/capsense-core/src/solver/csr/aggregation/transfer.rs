//! From one level of the aggregation hierarchy to the next coarser one and back.
//!
//! Nodes that are strongly coupled in the empty scene form an aggregate, which is one coarse node; its value is taken by
//! all its members. The aggregates never change, so coarse weights are sums over fixed lists of fine ones (Galerkin's
//! product with a piecewise constant prolongator), times a factor that is fixed as well.
//!
//! A field that varies evenly is a staircase of aggregates, all of it at the edges between them: of aggregates that are n
//! rows long that takes n times the energy. So corrections are too small, and more so along longer aggregates. What part of
//! the rows of two aggregates is coupled is one over n, and its full power makes corrections right for fields that vary
//! evenly, but those of others too large: of powers from 0 to 1 a fourth root took the fewest steps. Within strong dielectrics, thin
//! ones above all, fields do vary evenly, and hardly anything else is left of an error there: so it is the root where
//! weights have grown.

use super::super::pattern::Pattern;
use super::aggregates::Aggregates;
use super::level::{Level, NONE};
use std::ops::Range;
use std::sync::Arc;

/// What corrections are stretched by, as piecewise constant ones are too small (Braess 1995), beside what follows from the
/// factors of coarse weights.
const STRETCH: f32 = 1.35;

/// The power of the part of rows that are coupled.
const POWER: f32 = 0.25;

/// Weights that are so many times what they were in the empty scene are those in a dielectric.
const GROWN: f32 = 3.0;

/// The aggregates of a level.
#[derive(Clone, Debug)]
pub(super) struct Transfer {
    /// Of each fine row; [`NONE`] where the potential was fixed from the first.
    aggregate: Vec<u32>,
    members: Lists,
    /// For each block of fine rows the first of its aggregates, and in the end their number.
    first_of_block: Vec<u32>,
    /// The fine weights that make up each coarse one; of the two at an edge, only that in the higher row has some.
    parts: Lists,
    /// What the sum of these is multiplied with, and what that made in the empty scene.
    factors: Vec<f32>,
    in_empty_scene: Vec<f32>,
    weight_marked: Vec<bool>,
    row_marked: Vec<bool>,
}

/// What changed on a level.
#[derive(Clone, Debug, Default)]
pub(super) struct Changes {
    pub(super) rows: Vec<u32>,
    /// Row and entry of weights. Of the two at an edge, that in the row of the higher aggregate is enough.
    pub(super) weights: Vec<[u32; 2]>,
}

/// A list of numbers for each of several things.
#[derive(Clone, Debug)]
struct Lists {
    offsets: Vec<u32>,
    numbers: Vec<u32>,
}

impl Lists {
    /// Sorts what belongs to [`NONE`] out, keeps the order of the rest.
    fn new(count: usize, owners: impl Iterator<Item = (u32, u32)> + Clone) -> Self {
        let mut offsets = vec![0; count + 1];
        let owned = owners.filter(|(owner, _)| *owner != NONE);
        owned.clone().for_each(|(owner, _)| offsets[owner as usize + 1] += 1);
        (0..count).for_each(|owner| offsets[owner + 1] += offsets[owner]);
        let mut next = offsets.clone();
        let mut numbers = vec![0; offsets[count] as usize];
        for (owner, number) in owned {
            let place = &mut next[owner as usize];
            numbers[*place as usize] = number;
            *place += 1;
        }
        Self { offsets, numbers }
    }

    #[inline(always)]
    fn of(&self, owner: usize) -> &[u32] {
        let range: Range<usize> = self.offsets[owner] as usize..self.offsets[owner + 1] as usize;
        &self.numbers[range]
    }
}

/// What a coarse solution x gains as it is taken over, with b what it is the solution for.
#[inline(always)]
pub(super) fn gains<const L: usize>(x: &[[f32; L]], b: &[[f32; L]]) -> [[f64; L]; L] {
    let mut gains = [[0.0; L]; L];
    for (x, b) in x.iter().zip(b) {
        for (gains, x) in gains.iter_mut().zip(x) {
            for lane in 0..L {
                gains[lane] += f64::from(STRETCH * x * b[lane]);
            }
        }
    }
    gains
}

impl Transfer {
    /// Makes the pattern of the coarse level.
    pub(super) fn new(fine: &Level, aggregates: &Aggregates) -> (Self, Level) {
        let (aggregate, count) = (aggregates.of_row.clone(), aggregates.count);
        let members = Lists::new(count, aggregate.iter().copied().zip(0..));
        let fine_entries = (0..fine.rows())
            .flat_map(|row| fine.pattern.entries(row).map(move |entry| (row, entry)))
            .filter(|&(row, entry)| !fine.pattern.is_filling(row, entry));
        let ends = |row: usize, entry: usize| {
            let ends = [aggregate[row], aggregate[fine.pattern.columns()[entry] as usize]];
            (ends[0] != ends[1] && !ends.contains(&NONE)).then_some(ends)
        };
        let mut pairs: Vec<_> = fine_entries.clone().filter_map(|(row, entry)| ends(row, entry)).collect();
        pairs.sort_unstable();
        pairs.dedup();
        let around = Lists::new(count, pairs.iter().map(|&[row, other]| (row, other)));
        let pattern = Pattern::coarser(&fine.pattern, count, |row, found| found.extend(around.of(row)));
        let owners: Vec<_> = fine_entries
            .filter_map(|(row, entry)| {
                let [row, other] = ends(row, entry).filter(|[row, other]| row > other)?;
                Some((pattern.find(row, other)? as u32, entry as u32))
            })
            .collect();
        let parts = Lists::new(pattern.columns().len(), owners.iter().copied());
        let entries = pattern.columns().len();
        let mut factors = vec![1.0; entries];
        for own in 0..count {
            // Where nothing was coupled in the empty scene, nothing is known.
            for (other, part) in aggregates.parts(own).filter(|&(_, part)| part > 0.0) {
                if let Some(entry) = pattern.find(own as u32, other) {
                    factors[entry] = part.min(1.0).powf(POWER);
                }
            }
        }
        let transfer = Self {
            members,
            first_of_block: first_of_blocks(&aggregate, fine.pattern.block(), count),
            aggregate,
            parts,
            factors,
            in_empty_scene: vec![f32::INFINITY; entries],
            weight_marked: vec![false; entries],
            row_marked: vec![false; count],
        };
        (transfer, Level::new(Arc::new(pattern)))
    }

    /// The aggregate of each fine row.
    pub(super) fn aggregate(&self) -> &[u32] {
        &self.aggregate
    }

    /// Number of members of all aggregates.
    pub(super) fn count(&self) -> usize {
        self.members.numbers.len()
    }

    /// Takes what coarse weights are now for what they are in the empty scene.
    pub(super) fn remember(&mut self, coarse: &Level) {
        self.in_empty_scene.clone_from(&coarse.weights);
    }

    /// A coarse weight of what its parts sum up to.
    fn weight(&self, entry: usize, sum: f64) -> f32 {
        let factor = f64::from(self.factors[entry]);
        let weight = (factor * sum) as f32;
        let has_grown = weight.abs() > GROWN * self.in_empty_scene[entry].abs();
        if has_grown { (factor * factor * sum) as f32 } else { weight }
    }

    /// Recomputes what changed on the coarse level, and what that is.
    pub(super) fn refresh(&mut self, fine: &Level, coarse: &mut Level, from: &Changes, to: &mut Changes) {
        to.weights.clear();
        to.rows.clear();
        for &[row, entry] in &from.weights {
            let row = self.aggregate[row as usize];
            let other = self.aggregate[fine.pattern.columns()[entry as usize] as usize];
            if row == NONE || other == NONE || row <= other {
                continue;
            }
            let found = coarse.pattern.find(row, other);
            if let Some(entry) =
                found.filter(|&entry| !std::mem::replace(&mut self.weight_marked[entry], true))
            {
                to.weights.push([row, entry as u32]);
            }
        }
        for &row in &from.rows {
            self.mark_row(self.aggregate[row as usize], &mut to.rows);
        }
        for &[row, entry] in &to.weights {
            self.weight_marked[entry as usize] = false;
            let parts = self.parts.of(entry as usize).iter();
            let sum: f64 = parts.map(|&part| f64::from(fine.weights[part as usize])).sum();
            let weight = self.weight(entry as usize, sum);
            let other = coarse.pattern.columns()[entry as usize];
            for entry in [Some(entry as usize), coarse.pattern.find(other, row)].into_iter().flatten() {
                coarse.weights[entry] = weight;
            }
            self.mark_row(row, &mut to.rows);
            self.mark_row(other, &mut to.rows);
        }
        for row in to.rows.iter().map(|&row| row as usize) {
            self.row_marked[row] = false;
            let leaks = self.members.of(row).iter().map(|&member| f64::from(fine.leak[member as usize]));
            let leak: f64 = leaks.sum();
            let outward = coarse.weights[coarse.pattern.entries(row)].iter().map(|&weight| f64::from(weight));
            let outward: f64 = outward.sum();
            coarse.leak[row] = leak as f32;
            coarse.set_diagonal(row, leak + outward);
        }
    }

    /// Notes a coarse row once; not [`NONE`].
    fn mark_row(&mut self, row: u32, list: &mut Vec<u32>) {
        if let Some(marked) = self.row_marked.get_mut(row as usize)
            && !std::mem::replace(marked, true)
        {
            list.push(row);
        }
    }

    /// Adds the residuals of a block of fine rows, which start at `first`, to the right-hand side of its aggregates.
    #[inline(always)]
    pub(super) fn restrict<const L: usize>(
        &self,
        b: &mut [[f32; L]],
        first: usize,
        rows: Range<usize>,
        mut residual: impl FnMut(usize) -> [f32; L],
    ) {
        for row in rows {
            if let Some(b) = b.get_mut((self.aggregate[row] as usize).wrapping_sub(first)) {
                let residual = residual(row);
                for lane in 0..L {
                    b[lane] += residual[lane];
                }
            }
        }
    }

    /// Cuts the coarse right-hand side where blocks of fine rows begin. Every part comes with its first row.
    pub(super) fn cut<'a, T>(
        &'a self,
        mut coarse: &'a mut [T],
    ) -> impl Iterator<Item = (usize, &'a mut [T])> {
        self.first_of_block.windows(2).map(move |ends| {
            let (part, rest) = std::mem::take(&mut coarse).split_at_mut((ends[1] - ends[0]) as usize);
            coarse = rest;
            (ends[0] as usize, part)
        })
    }

    /// Every member takes its aggregate's correction, stretched. The rows of x start at `first`.
    #[inline(always)]
    pub(super) fn prolong<const L: usize>(&self, x: &mut [[f32; L]], first: usize, correction: &[[f32; L]]) {
        for (at, x) in x.iter_mut().enumerate() {
            self.correct(x, first + at, correction);
        }
    }

    /// The same at one row.
    #[inline(always)]
    pub(super) fn correct<const L: usize>(&self, x: &mut [f32; L], row: usize, correction: &[[f32; L]]) {
        if let Some(correction) = correction.get(self.aggregate[row] as usize) {
            for lane in 0..L {
                x[lane] += STRETCH * correction[lane];
            }
        }
    }
}

fn first_of_blocks(aggregate: &[u32], block: usize, count: usize) -> Vec<u32> {
    let count = count as u32;
    // Aggregates are ordered by their first rows; a block without any starts where the next one does.
    let mut firsts: Vec<u32> = aggregate
        .chunks(block)
        .map(|rows| rows.iter().copied().filter(|&own| own != NONE).min().unwrap_or(NONE))
        .chain([count])
        .collect();
    let mut next = count;
    for first in firsts.iter_mut().rev() {
        next = next.min(*first);
        *first = next;
    }
    firsts
}
