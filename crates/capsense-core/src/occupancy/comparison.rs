//! Where two depth images of one object may give different answers.
//!
//! The answer for a point depends on its pixel and the eight pixels around it. As long as its pixel sees the object,
//! it changes only between the lowest and the highest place at which the interpolated surface was or is. What lies to
//! one side of that interval in all its pixels, in both images, keeps its answers bit for bit.

use super::crossing::{NOWHERE, hull, larger, smaller};
use super::pixel_row::{LANES, first_where, lanes, last_where};
use super::{DepthLayers, Regions};
use crate::instructions::vectorised;
use std::ops::Range;

/// Pixels that are looked at together, with those beside the first and the last.
const WITH_BESIDE: usize = LANES + 2;

/// Boxes this long, in mean spacings of the mesh, are small enough, and depths in them may differ by so much.
const SMALL: f64 = 1.0;
const THIN: f64 = 0.3;

const FRONT: usize = 0;
const BACK: usize = 1;

/// One surface in both images.
type Pair<'a> = [&'a [f32]; 2];

/// Working storage for one comparison. The elements of arrays are for the front and the back.
#[derive(Clone, Debug, Default)]
pub(super) struct Comparison {
    differences: [Difference; 2],
    stacks: [BoxStack; 2],
}

impl Comparison {
    /// Appends boxes around all that may differ between two comparable images of an object, has the earlier one be as the
    /// later one.
    pub(super) fn find(
        &mut self,
        object: usize,
        before: &mut DepthLayers,
        now: &DepthLayers,
        regions: &mut Regions,
    ) {
        let (width, height) = (now.view().width, now.view().height);
        let images = [&*before, now];
        let pairs = [images.map(|image| image.front(object)), images.map(|image| image.back(object))];
        vectorised(
            #[inline(always)]
            || {
                for (difference, pair) in self.differences.iter_mut().zip(pairs) {
                    difference.mark(width, pair);
                }
            },
        );
        let columns = self.columns_near(0..height, width);
        if columns.is_empty() {
            return;
        }
        let (spacing, boxes) = regions.of_object(object);
        let pixel = now.pixel_width();
        for stack in &mut self.stacks {
            // As far as the cast goes; images have fewer columns.
            stack.reach = (SMALL * spacing / f64::from(pixel)) as usize;
            stack.slack = larger(pixel, (THIN * spacing) as f32);
        }
        vectorised(
            #[inline(always)]
            || self.compare_rows(width, &columns, pairs, now.jump()),
        );
        for stack in &mut self.stacks {
            boxes.extend(stack.done.drain(..).map(|b| now.pixel_box(b.columns, b.rows, b.depths)));
        }
        let [of_front, of_back] = &self.differences;
        let (front, back) = before.layer_mut(object);
        of_front.take_over(width, front, now.front(object));
        of_back.take_over(width, back, now.back(object));
    }

    /// Finds boxes row by row; all that differs is in some columns, at least one away from their ends if there is one.
    #[inline(always)]
    fn compare_rows(&mut self, width: usize, columns: &Range<usize>, pairs: [Pair<'_>; 2], jump: f32) {
        let height = self.differences[0].rows.len();
        // One more column on either side, and what lanes that start before the last column reach behind it.
        let last = (columns.end + LANES).div_ceil(LANES).min(width.div_ceil(LANES));
        let blocks = columns.start.saturating_sub(1) / LANES..last;
        let mut next = 0;
        for row in 0..height {
            let around = row.saturating_sub(1)..(row + 2).min(height);
            let near = self.columns_near(around.clone(), width);
            if !near.is_empty() {
                next = next.max(around.start);
                for line in next..around.end {
                    let pixels = line * width..(line + 1) * width;
                    for (difference, pair) in self.differences.iter_mut().zip(pairs) {
                        difference.take_line(&blocks, line, pair.map(|surface| &surface[pixels.clone()]));
                    }
                }
                next = around.end;
                for difference in &mut self.differences {
                    difference.stack_rows(&blocks, row, &around);
                }
                let own = pairs.map(|pair| pair.map(|surface| &surface[row * width..][..width]));
                let strip = Strip { differences: &self.differences, own, jump };
                for column in near.step_by(LANES) {
                    let found = strip.may_differ(column);
                    for (stack, depths) in self.stacks.iter_mut().zip(found.iter().flatten()) {
                        stack.add_lanes(column, row, depths);
                    }
                }
            }
            self.stacks.iter_mut().for_each(BoxStack::end_row);
        }
        self.stacks.iter_mut().for_each(BoxStack::end_row);
    }

    /// Columns beside which something differs in some rows.
    #[inline(always)]
    fn columns_near(&self, rows: Range<usize>, width: usize) -> Range<usize> {
        let differing = self.differences.iter().flat_map(|of| &of.rows[rows.clone()]);
        let [first, end] = differing.fold([width, 0], |[a, b], [c, d]| [a.min(*c), b.max(*d)]);
        if first < end { first.saturating_sub(1)..(end + 1).min(width) } else { 0..0 }
    }
}

/// Where one surface differs.
#[derive(Clone, Debug, Default)]
struct Difference {
    /// The columns that differ in each row lie from the first up to, without, the second.
    rows: Vec<[usize; 2]>,
    /// What is in three successive rows, by the row's number modulo three.
    lines: [Vec<Block>; 3],
    /// What is in each column of the row at hand and of those beside it.
    upright: Band,
}

/// For each of some successive columns, bits in which some pixels differ, and the lowest and the highest of their depths in either
/// image.
#[derive(Clone, Copy, Debug)]
struct Block {
    bits: [u32; LANES],
    low: [f32; LANES],
    high: [f32; LANES],
}

impl Block {
    const NOTHING: Self = Self { bits: [0; LANES], low: [NOWHERE[0]; LANES], high: [NOWHERE[1]; LANES] };
}

/// The same for all columns, and as many as a block has before the first and behind the last.
#[derive(Clone, Debug, Default)]
struct Band {
    bits: Vec<u32>,
    low: Vec<f32>,
    high: Vec<f32>,
}

impl Band {
    /// Forgets all if the number of blocks is another.
    fn resize(&mut self, blocks: usize) {
        let columns = (blocks + 2) * LANES;
        if self.bits.len() != columns {
            let Self { bits, low, high } = self;
            bits.clear();
            low.clear();
            high.clear();
            bits.resize(columns, 0);
            low.resize(columns, NOWHERE[0]);
            high.resize(columns, NOWHERE[1]);
        }
    }

    #[inline(always)]
    fn set(&mut self, block: usize, of: &Block) {
        let at = (block + 1) * LANES;
        self.bits[at..at + LANES].copy_from_slice(&of.bits);
        self.low[at..at + LANES].copy_from_slice(&of.low);
        self.high[at..at + LANES].copy_from_slice(&of.high);
    }

    /// What is in successive columns from one on and in those beside them.
    #[inline(always)]
    fn around(&self, column: usize) -> Block {
        let from = column + LANES - 1;
        let (bits, low, high) = (&self.bits[from..], &self.low[from..], &self.high[from..]);
        let mut around = Block::NOTHING;
        if let (Some(bits), Some(low), Some(high)) = (
            bits.first_chunk::<WITH_BESIDE>(),
            low.first_chunk::<WITH_BESIDE>(),
            high.first_chunk::<WITH_BESIDE>(),
        ) {
            for i in 0..LANES {
                around.bits[i] = bits[i] | bits[i + 1] | bits[i + 2];
                around.low[i] = smaller(smaller(low[i], low[i + 1]), low[i + 2]);
                around.high[i] = larger(larger(high[i], high[i + 1]), high[i + 2]);
            }
        }
        around
    }
}

impl Difference {
    /// Marks rows that are not the same bit for bit.
    #[inline(always)]
    fn mark(&mut self, width: usize, [before, now]: Pair<'_>) {
        let blocks = width.div_ceil(LANES);
        self.lines.iter_mut().for_each(|line| line.resize(blocks, Block::NOTHING));
        self.upright.resize(blocks);
        self.rows.resize(now.len() / width, [width, 0]);
        let rows = before.chunks_exact(width).zip(now.chunks_exact(width));
        for (differing, (before, now)) in self.rows.iter_mut().zip(rows) {
            *differing = [width, 0];
            let differ = |a: f32, b: f32| a.to_bits() != b.to_bits();
            if let Some(first) = first_where(before, now, differ) {
                let last = last_where(before, now, differ);
                *differing = [first, last.map_or(0, |last| last + 1)];
            }
        }
    }

    /// Takes what is in some columns of one row.
    #[inline(always)]
    fn take_line(&mut self, blocks: &Range<usize>, row: usize, [before, now]: Pair<'_>) {
        let line = &mut self.lines[row % 3][blocks.clone()];
        for (block, column) in line.iter_mut().zip((blocks.start * LANES..).step_by(LANES)) {
            // Rays that miss are nowhere, and the same in both images.
            let [before, now] = [before, now].map(|depths| lanes(depths, column, f32::INFINITY));
            for i in 0..LANES {
                block.bits[i] = before[i].to_bits() ^ now[i].to_bits();
                block.low[i] = smaller(interval(before[i])[0], interval(now[i])[0]);
                block.high[i] = larger(interval(before[i])[1], interval(now[i])[1]);
            }
        }
    }

    /// Takes rows together: one and those beside it.
    #[inline(always)]
    fn stack_rows(&mut self, blocks: &Range<usize>, row: usize, rows: &Range<usize>) {
        let Self { lines, upright, .. } = self;
        let [own, first, last] = [row, rows.start, rows.end - 1].map(|row| &lines[row % 3][..blocks.end]);
        for block in blocks.clone() {
            let mut all = own[block];
            for beside in [&first[block], &last[block]] {
                for i in 0..LANES {
                    all.bits[i] |= beside.bits[i];
                    all.low[i] = smaller(all.low[i], beside.low[i]);
                    all.high[i] = larger(all.high[i], beside.high[i]);
                }
            }
            upright.set(block, &all);
        }
    }

    /// Copies what differs.
    fn take_over(&self, width: usize, old: &mut [f32], new: &[f32]) {
        for (row, &[first, end]) in self.rows.iter().enumerate().filter(|(_, [first, end])| first < end) {
            let pixels = row * width + first..row * width + end;
            old[pixels.clone()].copy_from_slice(&new[pixels]);
        }
    }
}

/// Depths between which answers may differ in successive pixels, from the lowest to the highest; [`NOWHERE`] in those in
/// which none does.
struct Depths {
    low: [f32; LANES],
    high: [f32; LANES],
}

impl Depths {
    const NOWHERE: Self = Self { low: [NOWHERE[0]; LANES], high: [NOWHERE[1]; LANES] };
}

/// A row of both images, with what is around it.
struct Strip<'a> {
    differences: &'a [Difference; 2],
    own: [Pair<'a>; 2],
    jump: f32,
}

impl Strip<'_> {
    /// Where answers may differ because of the fronts, and because of the backs, in the pixels from some column on. Those
    /// that see the object in one of the images only count with the front. `None` if nothing is different.
    #[inline(always)]
    fn may_differ(&self, column: usize) -> Option<[Depths; 2]> {
        let [of_front, of_back] =
            [self.differences[FRONT].upright.around(column), self.differences[BACK].upright.around(column)];
        let bits = [of_front.bits, of_back.bits];
        let mut in_either = [0; LANES];
        for i in 0..LANES {
            in_either[i] = bits[FRONT][i] | bits[BACK][i];
        }
        if folded(in_either, |a, b| a | b) == 0 {
            return None;
        }
        let images = |side: usize, missed: f32| {
            let [before, now] = self.own[side];
            [lanes(before, column, missed), lanes(now, column, missed)]
        };
        let (front, back) = (images(FRONT, f32::INFINITY), images(BACK, f32::NEG_INFINITY));
        let (of_front, of_back) =
            (self.depths_around(&of_front, &front), self.depths_around(&of_back, &back));
        // Masks, each in a loop of its own: what is done with booleans and mapped arrays is done one by one, or by calls that are compiled
        // without the processor's extensions.
        let (mut one, mut both) = ([0; LANES], [0; LANES]);
        for i in 0..LANES {
            let (before, now) = (mask(front[0][i] <= back[0][i]), mask(front[1][i] <= back[1][i]));
            (one[i], both[i]) = (before ^ now, before & now);
        }
        let mut found = [Depths::NOWHERE, Depths::NOWHERE];
        for i in 0..LANES {
            let in_front = one[i] | both[i] & mask(bits[FRONT][i] != 0);
            let highest = select(one[i], of_back.high[i], of_front.high[i]);
            found[FRONT].low[i] = select(in_front, of_front.low[i], NOWHERE[0]);
            found[FRONT].high[i] = select(in_front, highest, NOWHERE[1]);
        }
        for i in 0..LANES {
            let in_back = both[i] & mask(bits[BACK][i] != 0);
            found[BACK].low[i] = select(in_back, of_back.low[i], NOWHERE[0]);
            found[BACK].high[i] = select(in_back, of_back.high[i], NOWHERE[1]);
        }
        Some(found)
    }

    /// The intervals around all that interpolation may make of pixels' depths in both images: values between those of
    /// their neighbours that are no jump away.
    #[inline(always)]
    fn depths_around(&self, around: &Block, [before, now]: &[[f32; LANES]; 2]) -> Depths {
        let mut depths = Depths::NOWHERE;
        for i in 0..LANES {
            let [low, high] = hull(interval(before[i]), interval(now[i]));
            depths.low[i] = larger(around.low[i], low - self.jump);
            depths.high[i] = smaller(around.high[i], high + self.jump);
        }
        depths
    }
}

/// Columns and rows from the first up to, without, the second, between two depths.
#[derive(Clone, Copy, Debug)]
struct PixelBox {
    columns: [usize; 2],
    rows: [usize; 2],
    depths: [f32; 2],
}

/// Puts pixels together to boxes: first those next to each other in a row, then runs of successive rows that are equal or
/// so short that together they are small enough.
#[derive(Clone, Debug, Default)]
struct BoxStack {
    /// Number of pixels along a box that is small enough, and by how much depths in a box may differ.
    reach: usize,
    slack: f32,
    run: Option<PixelBox>,
    /// Boxes that end at the row before, in the order of their columns; those up to `passed` grow no more.
    growing: Vec<PixelBox>,
    passed: usize,
    grown: Vec<PixelBox>,
    done: Vec<PixelBox>,
}

impl BoxStack {
    /// Adds pixels from some column on; columns come in increasing order.
    #[inline(always)]
    fn add_lanes(&mut self, column: usize, row: usize, Depths { low, high }: &Depths) {
        let (mut is_there, mut lengths) = ([0; LANES], [0.0; LANES]);
        for i in 0..LANES {
            is_there[i] = mask(low[i] <= high[i]) & (1 << i);
            lengths[i] = high[i] - low[i];
        }
        let there = folded(is_there, |a, b| a | b);
        if there == 0 {
            return;
        }
        let (lowest, highest) = (folded(*low, smaller), folded(*high, larger));
        let longest = larger(0.0, folded(lengths, larger));
        let (first, end) = (there.trailing_zeros() as usize, (u32::BITS - there.leading_zeros()) as usize);
        if there.count_ones() as usize == end - first && highest - lowest <= longest + self.slack {
            self.add([column + first, column + end], row, [lowest, highest]);
            return;
        }
        for ((&low, &high), column) in low.iter().zip(high).zip(column..) {
            if low <= high {
                self.add([column, column + 1], row, [low, high]);
            }
        }
    }

    fn add(&mut self, columns: [usize; 2], row: usize, depths: [f32; 2]) {
        if let Some(run) = &mut self.run
            && run.columns[1] == columns[0]
            && let Some(depths) = joined(run.depths, depths, self.slack)
        {
            *run = PixelBox { columns: [run.columns[0], columns[1]], depths, ..*run };
        } else {
            self.end_run();
            self.run = Some(PixelBox { columns, rows: [row, row + 1], depths });
        }
    }

    fn end_run(&mut self) {
        let Some(mut run) = self.run.take() else { return };
        while let Some(&below) = self.growing.get(self.passed).filter(|b| b.columns[0] <= run.columns[1]) {
            if let Some(larger) = self.together(&below, &run) {
                run = larger;
            } else if below.columns[0] <= run.columns[0] {
                self.done.push(below);
            } else {
                // A later run of this row may be on top of it.
                break;
            }
            self.passed += 1;
        }
        self.grown.push(run);
    }

    /// The box around a box and a run on top of it, if it holds little else.
    fn together(&self, below: &PixelBox, run: &PixelBox) -> Option<PixelBox> {
        let columns = [below.columns[0].min(run.columns[0]), below.columns[1].max(run.columns[1])];
        let rows = [below.rows[0].min(run.rows[0]), run.rows[1]];
        let is_small = columns[1] - columns[0] <= self.reach && rows[1] - rows[0] <= self.reach;
        let depths = joined(below.depths, run.depths, self.slack)?;
        (is_small || below.columns == run.columns).then_some(PixelBox { columns, rows, depths })
    }

    /// The next pixel will be in the next row.
    fn end_row(&mut self) {
        self.end_run();
        self.done.extend(&self.growing[self.passed..]);
        self.growing.clear();
        self.passed = 0;
        std::mem::swap(&mut self.growing, &mut self.grown);
    }
}

/// All bits or none.
#[inline(always)]
fn mask(is: bool) -> u32 {
    if is { u32::MAX } else { 0 }
}

/// The first number where the mask has bits, or else the second.
#[inline(always)]
fn select(mask: u32, first: f32, second: f32) -> f32 {
    f32::from_bits(first.to_bits() & mask | second.to_bits() & !mask)
}

/// Lanes taken together, in as few steps as can be.
#[inline(always)]
fn folded<T: Copy>(mut lanes: [T; LANES], take: impl Fn(T, T) -> T) -> T {
    for i in 0..LANES / 2 {
        lanes[i] = take(lanes[i], lanes[i + LANES / 2]);
    }
    take(take(lanes[0], lanes[2]), take(lanes[1], lanes[3]))
}

/// A depth as an interval; that of a ray which misses is empty.
#[inline(always)]
fn interval(depth: f32) -> [f32; 2] {
    let [nowhere_low, nowhere_high] = NOWHERE;
    let low = if depth == f32::NEG_INFINITY { nowhere_low } else { depth };
    let high = if depth == f32::INFINITY { nowhere_high } else { depth };
    [low, high]
}

/// The interval around two, if it is not much longer than the longer one.
fn joined(a: [f32; 2], b: [f32; 2], slack: f32) -> Option<[f32; 2]> {
    let joined = hull(a, b);
    let length = |[low, high]: [f32; 2]| high - low;
    (length(joined) <= length(a).max(length(b)) + slack).then_some(joined)
}
