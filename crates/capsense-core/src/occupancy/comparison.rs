//! Where two depth images of one object may give different answers.
//!
//! The answer for a point depends on its pixel and the eight pixels around it. As long as its pixel sees the object,
//! it changes only between the lowest and the highest place at which the interpolated surface was or is. What lies to
//! one side of that interval in all its pixels, in both images, keeps its answers bit for bit.

use super::DepthLayers;
use super::crossing::{NOWHERE, hull, larger, smaller};
use crate::geometry::Aabb;
use std::ops::Range;

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
    /// Appends boxes around all that may differ between two comparable images of an object, and says whether the images
    /// differ at all.
    pub(super) fn find(&mut self, object: usize, images: [&DepthLayers; 2], regions: &mut Vec<Aabb>) -> bool {
        let image = images[0];
        let (width, height) = (image.view().width, image.view().height);
        let pairs = [images.map(|image| image.front(object)), images.map(|image| image.back(object))];
        for (difference, pair) in self.differences.iter_mut().zip(pairs) {
            difference.mark(width, pair);
        }
        if self.differences.iter().all(|of| of.rows.iter().all(|[first, end]| first >= end)) {
            return false;
        }
        for row in 0..height {
            let around = row.saturating_sub(1)..(row + 2).min(height);
            let columns = self.columns_near(around.clone(), width);
            for (difference, pair) in self.differences.iter_mut().zip(pairs) {
                difference.gather(width, &columns, around.clone(), pair);
            }
            let own = pairs.map(|pair| pair.map(|surface| &surface[row * width..][..width]));
            let strip = Strip { differences: &self.differences, own, jump: image.jump() };
            for (side, stack) in self.stacks.iter_mut().enumerate() {
                for column in columns.clone() {
                    if let Some(depths) = strip.may_differ(side, column) {
                        stack.add(column, row, depths, image.pixel_width());
                    }
                }
                stack.end_row(image.pixel_width());
            }
        }
        for stack in &mut self.stacks {
            stack.end_row(image.pixel_width());
            regions.extend(stack.done.drain(..).map(|b| image.pixel_box(b.columns, b.rows, b.depths)));
        }
        true
    }

    /// Columns beside which something differs in some rows.
    fn columns_near(&self, rows: Range<usize>, width: usize) -> Range<usize> {
        let differing = self.differences.iter().flat_map(|of| &of.rows[rows.clone()]);
        let [first, end] = differing.fold([width, 0], |[a, b], [c, d]| [a.min(*c), b.max(*d)]);
        if first < end { first.saturating_sub(1)..(end + 1).min(width) } else { 0..0 }
    }
}

/// Where one surface differs.
#[derive(Clone, Debug, Default)]
struct Difference {
    pixels: Vec<bool>,
    /// The columns that differ in each row lie from the first up to, without, the second.
    rows: Vec<[usize; 2]>,
    /// What is in each column of the row at hand and of those beside it. One more column stands before the first.
    upright: Band,
    /// What is in the eight pixels around each pixel of the row at hand, and in itself.
    around: Band,
}

/// For each column, whether some pixels differ, and the lowest and the highest of their depths in either image.
#[derive(Clone, Debug, Default)]
struct Band {
    differs: Vec<bool>,
    low: Vec<f32>,
    high: Vec<f32>,
}

impl Band {
    fn resize(&mut self, columns: usize) {
        self.differs.resize(columns, false);
        self.low.resize(columns, NOWHERE[0]);
        self.high.resize(columns, NOWHERE[1]);
    }
}

impl Difference {
    /// Marks pixels and rows that are not the same bit for bit.
    fn mark(&mut self, width: usize, [before, now]: Pair<'_>) {
        self.pixels.resize(now.len(), false);
        self.upright.resize(width + 2);
        self.around.resize(width);
        self.rows.clear();
        let rows = before.chunks_exact(width).zip(now.chunks_exact(width));
        for ((before, now), pixels) in rows.zip(self.pixels.chunks_exact_mut(width)) {
            let bits = before.iter().zip(now).map(|(a, b)| a.to_bits() ^ b.to_bits());
            if bits.clone().fold(0, |all, bits| all | bits) == 0 {
                pixels.fill(false);
                self.rows.push([width, 0]);
                continue;
            }
            pixels.iter_mut().zip(bits).for_each(|(pixel, bits)| *pixel = bits != 0);
            let first = pixels.iter().position(|&differs| differs).unwrap_or(width);
            let last = pixels.iter().rposition(|&differs| differs).map_or(0, |last| last + 1);
            self.rows.push([first, last]);
        }
    }

    /// Finds what is around the pixels of one row: first takes three rows together, then three columns.
    fn gather(&mut self, width: usize, columns: &Range<usize>, rows: Range<usize>, pair: Pair<'_>) {
        if columns.is_empty() {
            return;
        }
        let Band { differs, low, high } = &mut self.upright;
        let padded = columns.start..columns.end + 2;
        differs[padded.clone()].fill(false);
        low[padded.clone()].fill(NOWHERE[0]);
        high[padded.clone()].fill(NOWHERE[1]);
        let beside = columns.start.saturating_sub(1)..(columns.end + 1).min(width);
        let padded_beside = beside.start + 1..beside.end + 1;
        for row in rows {
            let pixels = row * width + beside.start..row * width + beside.end;
            let marks = differs[padded_beside.clone()].iter_mut().zip(&self.pixels[pixels.clone()]);
            marks.for_each(|(differs, pixel)| *differs |= pixel);
            for surface in pair {
                let (low, high) = (&mut low[padded_beside.clone()], &mut high[padded_beside.clone()]);
                let extremes = low.iter_mut().zip(high);
                for ((low, high), &depth) in extremes.zip(&surface[pixels.clone()]) {
                    [*low, *high] = hull([*low, *high], interval(depth));
                }
            }
        }
        for (around, three) in
            self.around.differs[columns.clone()].iter_mut().zip(differs[padded.clone()].windows(3))
        {
            *around = three[0] | three[1] | three[2];
        }
        let lowest = self.around.low[columns.clone()].iter_mut().zip(low[padded.clone()].windows(3));
        lowest.for_each(|(lowest, three)| *lowest = smaller(smaller(three[0], three[1]), three[2]));
        let highest = self.around.high[columns.clone()].iter_mut().zip(high[padded].windows(3));
        highest.for_each(|(highest, three)| *highest = larger(larger(three[0], three[1]), three[2]));
    }

    /// The interval around all that interpolation may make of a pixel's depths in both images: values between those of
    /// its neighbours that are no jump away.
    fn depths_around(&self, column: usize, own: [f32; 2], jump: f32) -> [f32; 2] {
        let [low, high] = hull(interval(own[0]), interval(own[1]));
        [larger(self.around.low[column], low - jump), smaller(self.around.high[column], high + jump)]
    }
}

/// A row of both images, with what is around it.
struct Strip<'a> {
    differences: &'a [Difference; 2],
    own: [Pair<'a>; 2],
    jump: f32,
}

impl Strip<'_> {
    /// Depths between which answers may differ in a pixel because of its front, or because of its back. Pixels that see
    /// the object in one of the images only count with the front.
    fn may_differ(&self, side: usize, column: usize) -> Option<[f32; 2]> {
        let sees = |image: usize| self.own[FRONT][image][column] <= self.own[BACK][image][column];
        let depths = |side: usize| {
            let own = self.own[side].map(|surface| surface[column]);
            self.differences[side].depths_around(column, own, self.jump)
        };
        match (sees(0), sees(1)) {
            (true, true) => self.differences[side].around.differs[column].then(|| depths(side)),
            (false, false) => None,
            _ => (side == FRONT).then(|| [depths(FRONT)[0], depths(BACK)[1]]),
        }
    }
}

/// Columns and rows from the first up to, without, the second, between two depths.
#[derive(Clone, Copy, Debug)]
struct PixelBox {
    columns: [usize; 2],
    rows: [usize; 2],
    depths: [f32; 2],
}

/// Puts pixels together to boxes: first those next to each other in a row, then equal runs of successive rows.
#[derive(Clone, Debug, Default)]
struct BoxStack {
    run: Option<PixelBox>,
    /// Boxes that end at the row before, in the order of their columns; those up to `passed` grow no more.
    growing: Vec<PixelBox>,
    passed: usize,
    grown: Vec<PixelBox>,
    done: Vec<PixelBox>,
}

impl BoxStack {
    /// Adds a pixel; columns come in increasing order.
    fn add(&mut self, column: usize, row: usize, depths: [f32; 2], slack: f32) {
        if let Some(run) = &mut self.run
            && run.columns[1] == column
            && let Some(depths) = joined(run.depths, depths, slack)
        {
            *run = PixelBox { columns: [run.columns[0], column + 1], depths, ..*run };
        } else {
            self.end_run(slack);
            self.run = Some(PixelBox { columns: [column, column + 1], rows: [row, row + 1], depths });
        }
    }

    fn end_run(&mut self, slack: f32) {
        let Some(mut run) = self.run.take() else { return };
        while let Some(&below) = self.growing.get(self.passed).filter(|b| b.columns[0] <= run.columns[0]) {
            self.passed += 1;
            match joined(below.depths, run.depths, slack).filter(|_| below.columns == run.columns) {
                Some(depths) => run = PixelBox { rows: [below.rows[0], run.rows[1]], depths, ..run },
                None => self.done.push(below),
            }
        }
        self.grown.push(run);
    }

    /// The next pixel will be in the next row.
    fn end_row(&mut self, slack: f32) {
        self.end_run(slack);
        self.done.extend(&self.growing[self.passed..]);
        self.growing.clear();
        self.passed = 0;
        std::mem::swap(&mut self.growing, &mut self.grown);
    }
}

/// A depth as an interval; that of a ray which misses is empty.
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
