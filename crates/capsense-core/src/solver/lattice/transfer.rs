//! From one level to the next coarser one and back, plane by plane: the stages of all axes in one go.
//!
//! After a sweep only red nodes have a residual, and the sweep after the correction starts with the black nodes, which
//! it computes from the red ones: so only red nodes are restricted and corrected.

use super::layout::{BLOCK, Layout, RED};
use super::level::Level;
use super::network::{Changed, Network};
use super::rows::{add, add_product, collect, combine, copy, deal, gather};
use super::stage::Stage;
use pulp::Simd;
use std::ops::Range;

/// How a level is made coarser: at most one stage for each axis.
#[derive(Clone, Debug)]
pub(super) struct Transfer {
    z: Option<Stage>,
    y: Option<Stage>,
    x: Option<Stage>,
    /// What is between the stages of z and y: a coarse plane, and the one before.
    thick: [ThickPlane; 2],
    thin: ThinPlane,
    /// The coarse rows in pieces that are alike.
    segments: Vec<Segment>,
    /// One coarse row, in the order of its nodes.
    row: Vec<f32>,
}

/// Successive nodes of a coarse row.
#[derive(Clone, Copy, Debug)]
struct Segment {
    /// The first, as a fine and as a coarse node, and their number.
    fine: usize,
    coarse: usize,
    len: usize,
    /// Whether an eliminated node is between each two; none is otherwise.
    paired: bool,
}

/// A plane of a level, apart by whether i + j is even or odd, places as in the level but for the plane's shift.
#[derive(Clone, Debug)]
struct ThickPlane {
    len: usize,
    values: [Vec<f32>; 2],
}

/// A plane with the rows of the coarse level, but all nodes along x: even ones in one piece, then odd ones.
#[derive(Clone, Debug)]
struct ThinPlane {
    half: usize,
    columns: usize,
    values: Vec<f32>,
}

impl ThickPlane {
    fn zeros(layout: &Layout, columns: usize) -> Self {
        let len = layout.plane + 4 * BLOCK + layout.counts[0];
        Self { len, values: [vec![0.0; columns * len], vec![0.0; columns * len]] }
    }

    /// Which part the nodes of one colour in plane k are in, and where those at some places are.
    #[inline(always)]
    fn part(
        &self,
        layout: &Layout,
        colour: usize,
        k: usize,
        places: &Range<usize>,
        column: usize,
    ) -> (usize, Range<usize>) {
        let start = column * self.len + BLOCK + places.start - layout.shift(colour, k);
        ((colour + k) % 2, start..start + places.len())
    }

    /// The part and the start of row j's nodes of one parity.
    #[inline(always)]
    fn row(&self, layout: &Layout, j: usize, parity: usize, column: usize) -> (usize, usize) {
        ((parity + j) % 2, column * self.len + BLOCK + (parity + j) / 2 + j * layout.row)
    }

    /// Row j's nodes of one parity, and some more to fill blocks.
    #[inline(always)]
    fn half_row(&self, layout: &Layout, j: usize, parity: usize, column: usize, half: usize) -> &[f32] {
        let (part, start) = self.row(layout, j, parity, column);
        &self.values[part][start..start + half]
    }
}

impl ThinPlane {
    /// Where a node is in a row. There is room behind the last.
    #[inline(always)]
    fn place(&self, node: usize) -> usize {
        place_in_halves(node, self.half)
    }

    /// Where the node before another is. There is room before the first.
    #[inline(always)]
    fn place_before(&self, node: usize) -> usize {
        if node.is_multiple_of(2) { self.place(node + 1) - 1 } else { self.place(node - 1) }
    }

    /// A row: even nodes, then odd ones.
    #[inline(always)]
    fn row(&self, j: usize, column: usize) -> &[f32] {
        &self.values[(j * self.columns + column) * 2 * self.half..][..2 * self.half]
    }

    #[inline(always)]
    fn row_mut(&mut self, j: usize, column: usize) -> &mut [f32] {
        &mut self.values[(j * self.columns + column) * 2 * self.half..][..2 * self.half]
    }
}

impl Transfer {
    /// Keeps those planes across x, y and z for which `kept` holds. Returns the counts of the coarse level too.
    pub(super) fn new(layout: &Layout, kept: &[Vec<bool>; 3], columns: usize) -> (Self, [usize; 3]) {
        let mut coarse = layout.counts;
        let mut stage = |axis: usize| {
            kept[axis].contains(&false).then(|| {
                let stage = Stage::new(coarse, axis, &kept[axis], layout);
                coarse = stage.coarse.counts;
                stage
            })
        };
        let (z, y, x) = (stage(2), stage(1), stage(0));
        let half = half_row(layout.counts[0]);
        let thick = ThickPlane::zeros(layout, columns);
        let thin = ThinPlane { half, columns, values: vec![0.0; coarse[1] * columns * 2 * half] };
        let (segments, row) =
            (segments(&kept[0]), vec![0.0; coarse[0].next_multiple_of(2 * BLOCK) + 4 * BLOCK]);
        (Self { z, y, x, thick: [thick.clone(), thick], thin, segments, row }, coarse)
    }

    /// The coarse network and where it changed last; none if nothing is made coarser.
    pub(super) fn coarse(&self) -> Option<(&Network, &Changed)> {
        let last = self.x.as_ref().or(self.y.as_ref()).or(self.z.as_ref())?;
        Some((&last.coarse, &last.changed))
    }

    /// Recomputes the coarse network where the fine one changed.
    pub(super) fn refresh(&mut self, fine: &Network, changed: &Changed) {
        let (mut fine, mut changed) = (fine, changed);
        for stage in self.z.iter_mut().chain(&mut self.y).chain(&mut self.x) {
            stage.refresh(fine, changed);
            (fine, changed) = (&stage.coarse, &stage.changed);
        }
    }

    /// The coarse right-hand side: each eliminated node's residual goes to the nodes it is interpolated from.
    #[inline(always)]
    pub(super) fn restrict<S: Simd>(&mut self, simd: S, fine: &Level, coarse: &mut Level, active: &[usize]) {
        let (planes, rows) = (coarse.layout().planes(), coarse.layout().rows());
        for k in planes.start..planes.end {
            self.restrict_z(simd, fine, k, active);
            for j in rows.start..rows.end {
                for &column in active {
                    self.restrict_y(simd, fine.layout(), j, k, column);
                }
                for &column in active {
                    self.restrict_x(simd, coarse, j, k, column);
                }
            }
        }
    }

    /// Fills the thick plane of a coarse plane.
    #[inline(always)]
    fn restrict_z<S: Simd>(&mut self, simd: S, fine: &Level, plane: usize, active: &[usize]) {
        let layout = fine.layout();
        let [thick, _] = &mut self.thick;
        let own = self.z.as_ref().map_or(plane, |stage| stage.fine_plane[plane]);
        let places = layout.plane(own);
        for &column in active {
            let r = &fine.r[column * layout.len()..(column + 1) * layout.len()];
            let (part, at) = thick.part(layout, RED, own, &places, column);
            thick.values[part][at].copy_from_slice(&r[places.start..places.end]);
            thick.values[1 - part][column * thick.len..(column + 1) * thick.len].fill(0.0);
            let Some(stage) = &self.z else { continue };
            for (beside, share) in [(own + 1, &stage.previous), (own.wrapping_sub(1), &stage.next)] {
                if stage.is_eliminated(beside) {
                    let places = layout.plane(beside);
                    let (part, at) = thick.part(layout, RED, beside, &places, column);
                    let share = share.red(places.start, places.len());
                    add_product(simd, &mut thick.values[part][at], share, &r[places]);
                }
            }
        }
    }

    /// Fills a row of the thin plane from the thick one.
    #[inline(always)]
    fn restrict_y<S: Simd>(&mut self, simd: S, layout: &Layout, j: usize, k: usize, column: usize) {
        let ([thick, _], half) = (&self.thick, self.thin.half - 3 * BLOCK);
        let own = self.y.as_ref().map_or(j, |stage| stage.fine_plane[j]);
        let eliminated = |plane: usize| self.y.as_ref().filter(|stage| stage.is_eliminated(plane));
        let (after, before) = (eliminated(own + 1), eliminated(own.wrapping_sub(1)));
        for parity in 0..2 {
            let nodes = parity * self.thin.half + BLOCK..parity * self.thin.half + BLOCK + half;
            let to = &mut self.thin.row_mut(j, column)[nodes.start..nodes.end];
            let from = thick.half_row(layout, own, parity, column, half);
            match (after, before) {
                (Some(stage), Some(_)) => {
                    let next = thick.half_row(layout, own + 1, parity, column, half);
                    let previous = thick.half_row(layout, own - 1, parity, column, half);
                    let from_next = &stage.previous.row(own + 1, k)[nodes.start..nodes.end];
                    let from_previous = &stage.next.row(own - 1, k)[nodes.start..nodes.end];
                    gather(simd, to, from, [from_next, next], [from_previous, previous]);
                }
                (Some(stage), None) => {
                    copy::<S>(to, from);
                    let share = &stage.previous.row(own + 1, k)[nodes.start..nodes.end];
                    add_product(simd, to, share, thick.half_row(layout, own + 1, parity, column, half));
                }
                (None, Some(stage)) => {
                    copy::<S>(to, from);
                    let share = &stage.next.row(own - 1, k)[nodes.start..nodes.end];
                    add_product(simd, to, share, thick.half_row(layout, own - 1, parity, column, half));
                }
                (None, None) => copy::<S>(to, from),
            }
        }
    }

    /// A row of the coarse right-hand side from the thin plane.
    #[inline(always)]
    fn restrict_x<S: Simd>(&mut self, simd: S, coarse: &mut Level, j: usize, k: usize, column: usize) {
        let layout = coarse.stencil.layout;
        let [red, black] = &mut coarse.b;
        let thin = self.thin.row(j, column);
        for segment in &self.segments {
            let Segment { fine, coarse, len, paired } = *segment;
            let (colour, first) = layout.place([coarse, j, k]);
            let (_, second) = layout.place([coarse + 1, j, k]);
            let (of_first, of_second) = match colour {
                RED => (&mut *red, &mut *black),
                _ => (&mut *black, &mut *red),
            };
            // What is written beyond the end of a segment is overwritten by those that follow in this and the next row.
            let n = len.next_multiple_of(2 * BLOCK);
            let of_first = &mut of_first[column * layout.len() + first..][..n / 2];
            let of_second = &mut of_second[column * layout.len() + second..][..n / 2];
            let (own, next) = (self.thin.place(fine), self.thin.place(fine + 1));
            match &self.x {
                Some(stage) if paired => {
                    // Shares of nodes that are kept, and of those beyond the ends, are zero.
                    let previous = self.thin.place_before(fine);
                    let (of_next, of_previous) = (next..next + n, previous..previous + n);
                    let from_next = &stage.previous.row(j, k)[of_next.start..of_next.end];
                    let from_previous = &stage.next.row(j, k)[of_previous.start..of_previous.end];
                    let sums = &mut self.row[..n];
                    gather(
                        simd,
                        sums,
                        &thin[own..own + n],
                        [from_next, &thin[of_next]],
                        [from_previous, &thin[of_previous]],
                    );
                    deal(sums, of_first, of_second);
                }
                _ => {
                    copy::<S>(of_first, &thin[own..own + n / 2]);
                    copy::<S>(of_second, &thin[next..next + n / 2]);
                }
            }
        }
    }

    /// Adds the interpolated coarse correction to the red nodes of the fine level, and finishes its sweep behind.
    #[inline(always)]
    pub(super) fn prolong<S: Simd>(&mut self, simd: S, fine: &mut Level, coarse: &Level, active: &[usize]) {
        let planes = fine.layout().planes();
        let mut done = planes.start;
        for k in 0..coarse.layout().counts[2] {
            self.thick.swap(0, 1);
            self.prolong_plane(simd, fine.layout(), coarse, k, active);
            let own = self.z.as_ref().map_or(k, |stage| stage.fine_plane[k]);
            while done <= own && done < planes.end {
                self.correct_red(simd, fine, done, done < own, active);
                fine.smooth_behind(simd, done, active);
                done += 1;
            }
        }
        fine.smooth_behind(simd, planes.end, active);
        fine.smooth_behind(simd, planes.end + 1, active);
    }

    /// Interpolates a coarse plane along x, then y.
    #[inline(always)]
    fn prolong_plane<S: Simd>(&mut self, simd: S, fine: &Layout, coarse: &Level, k: usize, active: &[usize]) {
        let rows = coarse.layout().rows();
        for j in rows.start..rows.end {
            for &column in active {
                self.prolong_x(simd, coarse, j, k, column);
            }
        }
        let ([thick, _], thin, half) = (&mut self.thick, &self.thin, self.thin.half - 3 * BLOCK);
        let mut coarse_row = 0;
        for j in 0..fine.counts[1] {
            let eliminated = match &self.y {
                Some(stage) if stage.is_eliminated(j) => Some(stage),
                _ => None,
            };
            coarse_row += usize::from(j > 0 && eliminated.is_none());
            for &column in active {
                for parity in 0..2 {
                    // What is written beyond the end of a row is overwritten by the rows that follow.
                    let (part, start) = thick.row(fine, j, parity, column);
                    let to = &mut thick.values[part][start..start + half];
                    let nodes = parity * thin.half + BLOCK..parity * thin.half + BLOCK + half;
                    let before = &thin.row(coarse_row, column)[nodes.start..nodes.end];
                    let Some(stage) = eliminated else {
                        copy::<S>(to, before);
                        continue;
                    };
                    let after = &thin.row(coarse_row + 1, column)[nodes.start..nodes.end];
                    let previous = &stage.previous.row(j, k)[nodes.start..nodes.end];
                    let next = &stage.next.row(j, k)[nodes.start..nodes.end];
                    combine(simd, to, [previous, before], [next, after]);
                }
            }
        }
    }

    /// Interpolates a coarse row along x.
    #[inline(always)]
    fn prolong_x<S: Simd>(&mut self, simd: S, coarse: &Level, j: usize, k: usize, column: usize) {
        let layout = coarse.stencil.layout;
        for segment in &self.segments {
            let Segment { fine, coarse: start, len, paired } = *segment;
            let (colour, first) = layout.place([start, j, k]);
            let (other, second) = layout.place([start + 1, j, k]);
            // What is written beyond the end of a segment is overwritten by those that follow.
            let n = len.next_multiple_of(2 * BLOCK);
            let of_first = &coarse.x[colour][column * layout.len() + first..][..n / 2 + BLOCK];
            let of_second = &coarse.x[other][column * layout.len() + second..][..n / 2 + BLOCK];
            let (own, next) = (self.thin.place(fine), self.thin.place(fine + 1));
            match &self.x {
                Some(stage) if paired => {
                    // One more than there are, for the interpolation behind the last; where that is none, its share is
                    // zero.
                    collect(&mut self.row[..n + 2 * BLOCK], of_first, of_second);
                    let thin = self.thin.row_mut(j, column);
                    copy::<S>(&mut thin[own..own + n], &self.row[..n]);
                    let shares =
                        [&stage.previous.row(j, k)[next..next + n], &stage.next.row(j, k)[next..next + n]];
                    let between = &mut thin[next..next + n];
                    combine(simd, between, [shares[0], &self.row[..n]], [shares[1], &self.row[1..n + 1]]);
                }
                _ => {
                    let thin = self.thin.row_mut(j, column);
                    copy::<S>(&mut thin[own..own + n / 2], &of_first[..n / 2]);
                    copy::<S>(&mut thin[next..next + n / 2], &of_second[..n / 2]);
                }
            }
        }
    }

    /// Corrects the red nodes of a fine plane, from the thick plane at it or from the two around it.
    #[inline(always)]
    fn correct_red<S: Simd>(&self, simd: S, fine: &mut Level, k: usize, between: bool, active: &[usize]) {
        let layout = fine.stencil.layout;
        let [after, before] = &self.thick;
        let places = layout.plane(k);
        for &column in active {
            let x = &mut fine.x[RED][column * layout.len() + places.start..][..places.len()];
            let (part, at) = after.part(&layout, RED, k, &places, column);
            match &self.z {
                Some(stage) if between => {
                    let previous = stage.previous.red(places.start, places.len());
                    let next = stage.next.red(places.start, places.len());
                    add_product(simd, x, previous, &before.values[part][at.start..at.end]);
                    add_product(simd, x, next, &after.values[part][at]);
                }
                _ => add(simd, x, &after.values[part][at]),
            }
        }
    }
}

/// Cuts the kept nodes of a row into pieces in which an eliminated node is between each two, or between none.
fn segments(kept: &[bool]) -> Vec<Segment> {
    let is_eliminated = |node: usize| kept.get(node) == Some(&false);
    let mut segments: Vec<Segment> = Vec::new();
    for (coarse, fine) in (0..kept.len()).filter(|&node| kept[node]).enumerate() {
        let paired = is_eliminated(fine + 1) || is_eliminated(fine.wrapping_sub(1));
        let distance = if paired { 2 } else { 1 };
        match segments.last_mut() {
            Some(last) if last.paired == paired && last.fine + distance * last.len == fine => last.len += 1,
            _ => segments.push(Segment { fine, coarse, len: 1, paired }),
        }
    }
    segments
}

/// Room for every second node of a row, in blocks: one to spare before them, and two behind.
pub(super) fn half_row(nodes: usize) -> usize {
    3 * BLOCK + nodes.div_ceil(2).next_multiple_of(BLOCK)
}

/// Where a node is in a row of even nodes and, behind these, odd ones.
#[inline(always)]
pub(super) fn place_in_halves(node: usize, half: usize) -> usize {
    node % 2 * half + node / 2 + BLOCK
}
