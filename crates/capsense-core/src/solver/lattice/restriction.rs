//! To the next coarser level: what each thread does.

use super::layout::{BLOCK, Layout, RED};
use super::level::Level;
use super::pairs::RowShares;
use super::parts::Part;
use super::rows::{add_product, copy, gather};
use super::transfer::{Between, Stages};
use pulp::{Simd, WithSimd};

/// What one thread restricts.
pub(super) struct Restriction<'a> {
    pub(super) stages: &'a Stages,
    pub(super) between: &'a mut Between,
    pub(super) fine: &'a Level,
    /// The coarse planes and their right-hand side.
    pub(super) layout: Layout,
    pub(super) part: &'a Part,
    pub(super) b: [&'a mut [f32]; 2],
    pub(super) active: &'a [usize],
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
                self.along_y(simd, j, k);
                self.along_x(simd, j, k);
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

    /// Fills the rows between the stages of y and x from the thick plane.
    #[inline(always)]
    fn along_y<S: Simd>(&mut self, simd: S, j: usize, k: usize) {
        let Between { thick: [thick, _], halves: [halves, _], .. } = &mut *self.between;
        let (layout, stage) = (&self.fine.layout, &self.stages.y);
        let own = stage.as_ref().map_or(j, |stage| stage.fine_plane[j]);
        let eliminated = |plane: usize| stage.as_ref().filter(|stage| stage.is_eliminated(plane));
        let (after, before) = (eliminated(own + 1), eliminated(own.wrapping_sub(1)));
        for parity in 0..2 {
            let nodes = halves.nodes(parity);
            let n = nodes.len();
            let from = thick.half_rows(layout, own, parity);
            let next = after.map(|stage| {
                (&stage.previous.row(own + 1, k)[nodes.clone()], thick.half_rows(layout, own + 1, parity))
            });
            let previous = before.map(|stage| {
                (&stage.next.row(own - 1, k)[nodes.clone()], thick.half_rows(layout, own - 1, parity))
            });
            for &column in self.active {
                let here = column * thick.len..column * thick.len + n;
                let to = &mut halves.column_mut(column)[nodes.clone()];
                let own = &from[here.clone()];
                match (next, previous) {
                    (Some((share, next)), Some((other_share, previous))) => {
                        let previous = [other_share, &previous[here.clone()]];
                        gather(simd, to, own, [share, &next[here]], previous);
                    }
                    (Some((share, beside)), None) | (None, Some((share, beside))) => {
                        copy::<S>(to, own);
                        add_product(simd, to, share, &beside[here]);
                    }
                    (None, None) => copy::<S>(to, own),
                }
            }
        }
    }

    /// Makes a row of the coarse right-hand side of what is between the stages of y and x.
    #[inline(always)]
    fn along_x<S: Simd>(&mut self, simd: S, j: usize, k: usize) {
        let Between { halves: [halves, _], pairs, .. } = &mut *self.between;
        let (layout, [red, black]) = (&self.layout, &mut self.b);
        let (colour, even) = layout.place([0, j, k]);
        let (_, odd) = layout.place([1, j, k]);
        let (of_even, of_odd) = if colour == RED { (red, black) } else { (black, red) };
        // What is written beyond the end of a row is overwritten by the rows that follow.
        let n = layout.counts[0].next_multiple_of(2 * BLOCK) / 2;
        for &column in self.active {
            let (even, odd) = (layout.in_column(column, even), layout.in_column(column, odd));
            let of_even = &mut of_even[self.part.within(&(even..even + n))];
            let of_odd = &mut of_odd[self.part.within(&(odd..odd + n))];
            let row = halves.column(column);
            match &self.stages.x {
                Some(stage) => {
                    pairs.take::<S>(&self.stages.pieces, row);
                    pairs.restrict(simd, RowShares::of(stage, j, k), of_even, of_odd);
                }
                None => {
                    copy::<S>(of_even, &row[halves.nodes(0)]);
                    copy::<S>(of_odd, &row[halves.nodes(1)]);
                }
            }
        }
    }
}
