//! From one level to the next coarser one and back, plane by plane: the stages of all axes in one go.
//!
//! After a sweep only red nodes have a residual, and the sweep after the correction starts with the black nodes, which
//! it computes from the red ones: so only red nodes are restricted and corrected.

use super::layout::{BLOCK, Layout, RED};
use super::level::Level;
use super::network::{Changed, Network};
use super::stage::Stage;
use pulp::Simd;
use std::ops::Range;

/// Columns that are worked on side by side along x.
const GROUP: usize = 4;

/// How a level is made coarser: at most one stage for each axis.
#[derive(Clone, Debug)]
pub(super) struct Transfer {
    z: Option<Stage>,
    y: Option<Stage>,
    x: Option<Stage>,
    /// What is between the stages of z and y: a coarse plane, and the one before.
    thick: [ThickPlane; 2],
    thin: ThinPlane,
    /// Where in a half row pair each coarse node is, and the nodes before and after it.
    across_x: Vec<Triple>,
    /// A thin row and a coarse row with several columns side by side: along x, neighbours are where they are.
    lanes: Vec<[f32; GROUP]>,
    coarse_lanes: Vec<[f32; GROUP]>,
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

/// Places of a node that is kept and of its neighbours along x.
#[derive(Clone, Copy, Debug)]
struct Triple {
    previous: usize,
    own: usize,
    next: usize,
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
        let place = |node: usize| node % 2 * half + node / 2;
        let nowhere = 2 * half - 1;
        let across_x = (0..layout.counts[0])
            .filter(|&node| kept[0][node])
            .map(|node| Triple {
                previous: node.checked_sub(1).map_or(nowhere, place),
                own: place(node),
                next: if node + 1 < layout.counts[0] { place(node + 1) } else { nowhere },
            })
            .collect();
        let thick = ThickPlane::zeros(layout, columns);
        let thin = ThinPlane { half, columns, values: vec![0.0; coarse[1] * columns * 2 * half] };
        let lanes = vec![[0.0; GROUP]; 2 * half];
        let coarse_lanes = vec![[0.0; GROUP]; 2 * half_row(coarse[0])];
        (Self { z, y, x, thick: [thick.clone(), thick], thin, across_x, lanes, coarse_lanes }, coarse)
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
                for group in active.chunks(GROUP) {
                    self.restrict_x(coarse, j, k, group);
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
        let ([thick, _], half) = (&self.thick, self.thin.half);
        let own = self.y.as_ref().map_or(j, |stage| stage.fine_plane[j]);
        for parity in 0..2 {
            let to = &mut self.thin.row_mut(j, column)[parity * half..][..half];
            to.copy_from_slice(thick.half_row(layout, own, parity, column, half));
            let Some(stage) = &self.y else { continue };
            for (beside, share) in [(own + 1, &stage.previous), (own.wrapping_sub(1), &stage.next)] {
                if stage.is_eliminated(beside) {
                    let share = &share.row(beside, k)[parity * half..][..half];
                    add_product(simd, to, share, thick.half_row(layout, beside, parity, column, half));
                }
            }
        }
    }

    /// A row of the coarse right-hand side from the thin plane.
    #[inline(always)]
    fn restrict_x(&mut self, coarse: &mut Level, j: usize, k: usize, columns: &[usize]) {
        let layout = coarse.stencil.layout;
        let Some(stage) = &self.x else {
            for (column, parity) in columns.iter().flat_map(|column| [(column, 0), (column, 1)]) {
                let (colour, start) = layout.place([parity, j, k]);
                let count = (layout.counts[0] + 1 - parity) / 2;
                let from = &self.thin.row(j, *column)[parity * self.thin.half..][..count];
                coarse.b[colour][column * layout.len() + start..][..count].copy_from_slice(from);
            }
            return;
        };
        for (lane, &column) in columns.iter().enumerate() {
            let row = self.thin.row(j, column);
            self.lanes.iter_mut().zip(row).for_each(|(lanes, value)| lanes[lane] = *value);
        }
        let (lanes, half) = (&self.lanes[..2 * self.thin.half], self.coarse_lanes.len() / 2);
        let (previous, next) = (stage.previous.row(j, k), stage.next.row(j, k));
        for (node, at) in self.across_x.iter().enumerate() {
            // Shares of nodes that are kept, and of those beyond the ends, are zero.
            let (from_next, from_previous) = (previous[at.next], next[at.previous]);
            let own = combine(1.0, &lanes[at.own], from_next, &lanes[at.next]);
            let sum = combine(1.0, &own, from_previous, &lanes[at.previous]);
            self.coarse_lanes[node % 2 * half + node / 2] = sum;
        }
        for (lane, column) in columns.iter().enumerate() {
            for parity in 0..2 {
                let (colour, start) = layout.place([parity, j, k]);
                let count = (layout.counts[0] + 1 - parity) / 2;
                let b = &mut coarse.b[colour][column * layout.len() + start..][..count];
                b.iter_mut().zip(&self.coarse_lanes[parity * half..]).for_each(|(b, sum)| *b = sum[lane]);
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
        for j in 0..coarse.layout().counts[1] {
            for group in active.chunks(GROUP) {
                self.prolong_x(coarse, j, k, group);
            }
        }
        let ([thick, _], thin, half) = (&mut self.thick, &self.thin, self.thin.half);
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
                    let before = &thin.row(coarse_row, column)[parity * half..][..half];
                    let Some(stage) = eliminated else {
                        to.copy_from_slice(before);
                        continue;
                    };
                    let after = &thin.row(coarse_row + 1, column)[parity * half..][..half];
                    let previous = &stage.previous.row(j, k)[parity * half..][..half];
                    let next = &stage.next.row(j, k)[parity * half..][..half];
                    to.fill(0.0);
                    add_product(simd, to, previous, before);
                    add_product(simd, to, next, after);
                }
            }
        }
    }

    /// Interpolates a coarse row along x.
    #[inline(always)]
    fn prolong_x(&mut self, coarse: &Level, j: usize, k: usize, columns: &[usize]) {
        let layout = coarse.stencil.layout;
        let (half, thin_half) = (self.coarse_lanes.len() / 2, self.thin.half);
        let Some(stage) = &self.x else {
            for (column, parity) in columns.iter().flat_map(|column| [(column, 0), (column, 1)]) {
                let (colour, start) = layout.place([parity, j, k]);
                let count = (layout.counts[0] + 1 - parity) / 2;
                let from = &coarse.x[colour][column * layout.len() + start..][..count];
                self.thin.row_mut(j, *column)[parity * thin_half..][..count].copy_from_slice(from);
            }
            return;
        };
        for (lane, column) in columns.iter().enumerate() {
            for parity in 0..2 {
                let (colour, start) = layout.place([parity, j, k]);
                let count = (layout.counts[0] + 1 - parity) / 2;
                let x = &coarse.x[colour][column * layout.len() + start..][..count];
                self.coarse_lanes[parity * half..].iter_mut().zip(x).for_each(|(lanes, x)| lanes[lane] = *x);
            }
        }
        let lanes = &mut self.lanes[..2 * thin_half];
        let (previous, next) = (stage.previous.row(j, k), stage.next.row(j, k));
        let mut own = self.coarse_lanes[0];
        for (node, at) in self.across_x.iter().enumerate() {
            let after = self.coarse_lanes[(node + 1) % 2 * half + (node + 1) / 2];
            // Where the next node is kept too, it will overwrite this.
            lanes[at.next] = combine(previous[at.next], &own, next[at.next], &after);
            lanes[at.own] = own;
            own = after;
        }
        for (lane, &column) in columns.iter().enumerate() {
            let row = self.thin.row_mut(j, column);
            row.iter_mut().zip(&self.lanes).for_each(|(value, lanes)| *value = lanes[lane]);
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

/// Room for every second node of a row, in blocks, with at least one place to spare.
pub(super) fn half_row(nodes: usize) -> usize {
    (nodes.div_ceil(2) + 1).next_multiple_of(BLOCK)
}

/// a u + b v.
#[inline(always)]
fn combine(a: f32, u: &[f32; GROUP], b: f32, v: &[f32; GROUP]) -> [f32; GROUP] {
    [a * u[0] + b * v[0], a * u[1] + b * v[1], a * u[2] + b * v[2], a * u[3] + b * v[3]]
}

/// to += a b.
#[inline(always)]
fn add_product<S: Simd>(simd: S, to: &mut [f32], a: &[f32], b: &[f32]) {
    let (to, a, b) = (S::as_mut_simd_f32s(to).0, S::as_simd_f32s(a).0, S::as_simd_f32s(b).0);
    for ((to, a), b) in to.iter_mut().zip(a).zip(b) {
        *to = simd.add_f32s(*to, simd.mul_f32s(*a, *b));
    }
}

/// to += a.
#[inline(always)]
fn add<S: Simd>(simd: S, to: &mut [f32], a: &[f32]) {
    for (to, a) in S::as_mut_simd_f32s(to).0.iter_mut().zip(S::as_simd_f32s(a).0) {
        *to = simd.add_f32s(*to, *a);
    }
}
