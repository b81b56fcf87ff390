//! From one level to the next coarser one and back, plane by plane: the stages of all axes in one go.
//!
//! After a sweep only red nodes have a residual, and the sweep after the correction starts with the black nodes, which
//! it computes from the red ones: so only red nodes are restricted and corrected.

use super::between::{ThickPlane, ThinPlane};
use super::layout::{BLOCK, Layout, RED};
use super::level::{Level, Slab};
use super::network::{Changed, Network};
use super::parts::{Part, Parts, cut_both};
use super::rows::{add, add_product, collect, combine, copy, deal, gather};
use super::stage::Stage;
use crate::solver::workers::Workers;
use pulp::{Arch, Simd, WithSimd};

/// How a level is made coarser, with storage for each thread.
#[derive(Clone, Debug)]
pub(super) struct Transfer {
    stages: Stages,
    between: Vec<Between>,
    /// How threads share the coarse planes.
    coarse: Parts,
}

/// At most one stage for each axis.
#[derive(Clone, Debug)]
struct Stages {
    z: Option<Stage>,
    y: Option<Stage>,
    x: Option<Stage>,
    /// The coarse rows in pieces that are alike.
    segments: Vec<Segment>,
}

/// What is between stages.
#[derive(Clone, Debug)]
struct Between {
    /// Between the stages of z and y: a coarse plane, and the one before.
    thick: [ThickPlane; 2],
    thin: ThinPlane,
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

impl Transfer {
    /// Zeros everywhere, after numbers that were not finite.
    pub(super) fn clear(&mut self) {
        for Between { thick, thin, row, .. } in &mut self.between {
            thick.iter_mut().for_each(ThickPlane::clear);
            thin.clear();
            row.fill(0.0);
        }
    }

    /// Keeps those planes across x, y and z for which `kept` holds. Returns the counts of the coarse level too.
    pub(super) fn new(fine: &Level, kept: &[Vec<bool>; 3], threads: usize) -> (Self, [usize; 3]) {
        let mut coarse = fine.layout.counts;
        let mut stage = |axis: usize| {
            kept[axis].contains(&false).then(|| {
                let stage = Stage::new(coarse, axis, &kept[axis], &fine.stencil.layout);
                coarse = stage.coarse.counts;
                stage
            })
        };
        let (z, y, x) = (stage(2), stage(1), stage(0));
        let thick = ThickPlane::zeros(&fine.layout);
        let between = Between {
            thick: [thick.clone(), thick],
            thin: ThinPlane::zeros(&fine.layout, coarse[1]),
            row: vec![0.0; coarse[0].next_multiple_of(2 * BLOCK) + 4 * BLOCK],
        };
        let layout = Layout::new(coarse, fine.layout.margin).with_columns(fine.layout.columns);
        let transfer = Self {
            stages: Stages { z, y, x, segments: segments(&kept[0]) },
            between: vec![between; fine.parts.slabs.len()],
            coarse: Parts::new(&layout, Parts::worthwhile(&fine.layout, threads)),
        };
        (transfer, coarse)
    }

    /// The coarse network and where it changed last; none if nothing is made coarser.
    pub(super) fn coarse(&self) -> Option<(&Network, &Changed)> {
        let Stages { z, y, x, .. } = &self.stages;
        let last = x.as_ref().or(y.as_ref()).or(z.as_ref())?;
        Some((&last.coarse, &last.changed))
    }

    /// Recomputes the coarse network where the fine one changed.
    pub(super) fn refresh(&mut self, fine: &Network, changed: &Changed) {
        let (mut fine, mut changed) = (fine, changed);
        let Stages { z, y, x, .. } = &mut self.stages;
        for stage in z.iter_mut().chain(y).chain(x) {
            stage.refresh(fine, changed);
            (fine, changed) = (&stage.coarse, &stage.changed);
        }
    }

    /// The coarse right-hand side: each eliminated node's residual goes to the nodes it is interpolated from.
    pub(super) fn restrict(
        &mut self,
        workers: &Workers,
        arch: Arch,
        fine: &Level,
        coarse: &mut Level,
        active: &[usize],
    ) {
        let Self { stages, between, coarse: parts } = self;
        let (layout, slabs) = (coarse.layout, &parts.slabs);
        let vectors = cut_both(slabs, &mut coarse.b).zip(between);
        let tasks = slabs.iter().zip(vectors).map(|(part, (b, between))| Restriction {
            stages,
            between,
            fine,
            layout,
            part,
            b,
            active,
        });
        workers.for_each(tasks, |task| arch.dispatch(task));
    }

    /// Adds the interpolated coarse correction to the red nodes of the fine level, and finishes its sweep behind.
    pub(super) fn prolong(
        &mut self,
        workers: &Workers,
        arch: Arch,
        fine: &mut Level,
        coarse: &Level,
        active: &[usize],
    ) {
        let Self { stages, between, .. } = self;
        let stages = &*stages;
        for phase in [0, 1] {
            let slabs = fine.slabs(phase, active).zip(&mut *between);
            let tasks = slabs.map(|(fine, between)| Prolongation { stages, between, fine, coarse });
            workers.for_each(tasks, |task| arch.dispatch(task));
        }
    }
}

/// What one thread restricts.
struct Restriction<'a> {
    stages: &'a Stages,
    between: &'a mut Between,
    fine: &'a Level,
    /// The coarse planes and their right-hand side.
    layout: Layout,
    part: &'a Part,
    b: [&'a mut [f32]; 2],
    active: &'a [usize],
}

/// What one thread prolongs.
struct Prolongation<'a> {
    stages: &'a Stages,
    between: &'a mut Between,
    fine: Slab<'a>,
    coarse: &'a Level,
}

impl WithSimd for Restriction<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let rows = self.layout.rows();
        for step in self.part.steps(1) {
            let Some(k) = self.part.plane(0, step) else { continue };
            self.along_z(simd, k);
            for j in rows.start..rows.end {
                for &column in self.active {
                    self.along_y(simd, j, k, column);
                }
                for &column in self.active {
                    self.along_x(simd, j, k, column);
                }
            }
        }
    }
}

impl Restriction<'_> {
    /// Fills the thick plane of a coarse plane.
    #[inline(always)]
    fn along_z<S: Simd>(&mut self, simd: S, plane: usize) {
        let Level { stencil, layout, r, .. } = self.fine;
        let [thick, _] = &mut self.between.thick;
        let own = self.stages.fine_plane(plane);
        for &column in self.active {
            let (part, at) = thick.part(layout, RED, own, column);
            thick.values[part][at].copy_from_slice(&r[layout.plane_of(column, own)]);
            thick.values[1 - part][column * thick.len..(column + 1) * thick.len].fill(0.0);
            let Some(stage) = &self.stages.z else { continue };
            for (beside, share) in [(own + 1, &stage.previous), (own.wrapping_sub(1), &stage.next)] {
                if stage.is_eliminated(beside) {
                    let (part, at) = thick.part(layout, RED, beside, column);
                    let share = share.red(stencil.layout.plane(beside));
                    add_product(
                        simd,
                        &mut thick.values[part][at],
                        share,
                        &r[layout.plane_of(column, beside)],
                    );
                }
            }
        }
    }

    /// Fills a row of the thin plane from the thick one.
    #[inline(always)]
    fn along_y<S: Simd>(&mut self, simd: S, j: usize, k: usize, column: usize) {
        let Between { thick: [thick, _], thin, .. } = &mut *self.between;
        let (layout, half, stage) = (&self.fine.layout, thin.half - 3 * BLOCK, &self.stages.y);
        let own = stage.as_ref().map_or(j, |stage| stage.fine_plane[j]);
        let eliminated = |plane: usize| stage.as_ref().filter(|stage| stage.is_eliminated(plane));
        let (after, before) = (eliminated(own + 1), eliminated(own.wrapping_sub(1)));
        for parity in 0..2 {
            let nodes = parity * thin.half + BLOCK..parity * thin.half + BLOCK + half;
            let to = &mut thin.row_mut(j, column)[nodes.start..nodes.end];
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
    fn along_x<S: Simd>(&mut self, simd: S, j: usize, k: usize, column: usize) {
        let Between { thin: plane, row, .. } = &mut *self.between;
        let [red, black] = &mut self.b;
        let thin = plane.row(j, column);
        for segment in &self.stages.segments {
            let Segment { fine, coarse, len, paired } = *segment;
            let (colour, first) = self.layout.place([coarse, j, k]);
            let (_, second) = self.layout.place([coarse + 1, j, k]);
            let (of_first, of_second) = match colour {
                RED => (&mut *red, &mut *black),
                _ => (&mut *black, &mut *red),
            };
            // What is written beyond the end of a segment is overwritten by those that follow in this and the next row.
            let n = len.next_multiple_of(2 * BLOCK);
            let (first, second) =
                (self.layout.in_column(column, first), self.layout.in_column(column, second));
            let of_first = &mut of_first[self.part.within(&(first..first + n / 2))];
            let of_second = &mut of_second[self.part.within(&(second..second + n / 2))];
            let (own, next) = (plane.place(fine), plane.place(fine + 1));
            match &self.stages.x {
                Some(stage) if paired => {
                    // Shares of nodes that are kept, and of those beyond the ends, are zero.
                    let previous = plane.place_before(fine);
                    let (of_next, of_previous) = (next..next + n, previous..previous + n);
                    let from_next = &stage.previous.row(j, k)[of_next.start..of_next.end];
                    let from_previous = &stage.next.row(j, k)[of_previous.start..of_previous.end];
                    let sums = &mut row[..n];
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
}

impl Stages {
    /// The fine plane of a coarse one.
    #[inline(always)]
    fn fine_plane(&self, coarse: usize) -> usize {
        match &self.z {
            Some(stage) => stage.fine_plane[coarse],
            None => coarse,
        }
    }

    /// The coarse planes at a fine one, or before and after it.
    #[inline(always)]
    fn around(&self, fine: usize) -> [usize; 2] {
        match &self.z {
            Some(stage) => stage.around(fine),
            None => [fine, fine],
        }
    }
}

impl WithSimd for Prolongation<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let mut interpolated = None;
        for step in self.fine.part.steps(3) {
            if let Some(k) = self.fine.part.plane(0, step) {
                let [before, after] = self.stages.around(k);
                for coarse in interpolated.unwrap_or(before)..after + 1 {
                    self.between.thick.swap(0, 1);
                    self.interpolate(simd, coarse);
                }
                interpolated = Some(after + 1);
                self.correct_red(simd, k, before < after);
            }
            self.fine.smooth_behind(simd, step);
        }
    }
}

impl Prolongation<'_> {
    /// Interpolates a coarse plane along x, then y.
    #[inline(always)]
    fn interpolate<S: Simd>(&mut self, simd: S, k: usize) {
        let rows = self.coarse.layout.rows();
        for j in rows.start..rows.end {
            for &column in self.fine.active {
                self.along_x(simd, j, k, column);
            }
        }
        let Between { thick: [thick, _], thin, .. } = &mut *self.between;
        let (fine, half) = (self.fine.layout, thin.half - 3 * BLOCK);
        let mut coarse_row = 0;
        for j in 0..fine.counts[1] {
            let eliminated = match &self.stages.y {
                Some(stage) if stage.is_eliminated(j) => Some(stage),
                _ => None,
            };
            coarse_row += usize::from(j > 0 && eliminated.is_none());
            for &column in self.fine.active {
                for parity in 0..2 {
                    // What is written beyond the end of a row is overwritten by the rows that follow.
                    let (part, start) = thick.row(&fine, j, parity, column);
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
    fn along_x<S: Simd>(&mut self, simd: S, j: usize, k: usize, column: usize) {
        let Level { x, .. } = self.coarse;
        let layout = self.coarse.layout;
        let Between { thin: plane, row, .. } = &mut *self.between;
        for segment in &self.stages.segments {
            let Segment { fine, coarse: start, len, paired } = *segment;
            let (colour, first) = layout.place([start, j, k]);
            let (other, second) = layout.place([start + 1, j, k]);
            // What is written beyond the end of a segment is overwritten by those that follow.
            let n = len.next_multiple_of(2 * BLOCK);
            let of_first = &x[colour][layout.in_column(column, first)..][..n / 2 + BLOCK];
            let of_second = &x[other][layout.in_column(column, second)..][..n / 2 + BLOCK];
            let (own, next) = (plane.place(fine), plane.place(fine + 1));
            let thin = plane.row_mut(j, column);
            match &self.stages.x {
                Some(stage) if paired => {
                    // One more than there are, for the interpolation behind the last; where that is none, its share is
                    // zero.
                    collect(&mut row[..n + 2 * BLOCK], of_first, of_second);
                    copy::<S>(&mut thin[own..own + n], &row[..n]);
                    let shares =
                        [&stage.previous.row(j, k)[next..next + n], &stage.next.row(j, k)[next..next + n]];
                    let between = &mut thin[next..next + n];
                    combine(simd, between, [shares[0], &row[..n]], [shares[1], &row[1..n + 1]]);
                }
                _ => {
                    copy::<S>(&mut thin[own..own + n / 2], &of_first[..n / 2]);
                    copy::<S>(&mut thin[next..next + n / 2], &of_second[..n / 2]);
                }
            }
        }
    }

    /// Corrects the red nodes of a fine plane, from the thick plane at it or from the two around it.
    #[inline(always)]
    fn correct_red<S: Simd>(&mut self, simd: S, k: usize, between: bool) {
        let Slab { part, stencil, layout, x: [red, _], active, .. } = &mut self.fine;
        let places = stencil.layout.plane(k);
        let [after, before] = &self.between.thick;
        for &column in *active {
            let x = &mut red[part.within(&layout.plane_of(column, k))];
            let (half, at) = after.part(layout, RED, k, column);
            match &self.stages.z {
                Some(stage) if between => {
                    add_product(
                        simd,
                        x,
                        stage.previous.red(places.clone()),
                        &before.values[half][at.clone()],
                    );
                    add_product(simd, x, stage.next.red(places.clone()), &after.values[half][at]);
                }
                _ => add(simd, x, &after.values[half][at]),
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
