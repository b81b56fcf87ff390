//! From the next coarser level: what each thread does.

use super::layout::{BLOCK, RED};
use super::level::{Level, Slab};
use super::pairs::RowShares;
use super::rows::{add, add_product, combine, copy};
use super::transfer::{Between, Stages};
use pulp::{Simd, WithSimd};

/// Work that goes on with planes whose correction is finished, in the same walk through the lattice.
pub(super) trait Behind {
    /// How many stages there are after that in which the sweep ends.
    const STAGES: usize;

    /// What is done in a step; `stage` is the one in which the sweep ends.
    fn follow<S: Simd>(&mut self, simd: S, slab: &mut Slab<'_>, stage: usize, step: usize);
}

/// No work.
pub(super) struct Nothing;

impl Behind for Nothing {
    const STAGES: usize = 0;

    #[inline(always)]
    fn follow<S: Simd>(&mut self, _simd: S, _slab: &mut Slab<'_>, _stage: usize, _step: usize) {}
}

/// What one thread prolongs.
pub(super) struct Prolongation<'a, B> {
    pub(super) stages: &'a Stages,
    pub(super) between: &'a mut Between,
    pub(super) fine: Slab<'a>,
    pub(super) coarse: &'a Level,
    pub(super) behind: B,
}

impl<B: Behind> WithSimd for Prolongation<'_, B> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let mut interpolated = None;
        for step in self.fine.part.steps(3 + B::STAGES) {
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
            self.behind.follow(simd, &mut self.fine, 2, step);
        }
    }
}

impl<B: Behind> Prolongation<'_, B> {
    /// Interpolates a coarse plane along x, then y.
    #[inline(always)]
    fn interpolate<S: Simd>(&mut self, simd: S, k: usize) {
        let (rows, count) = (self.coarse.layout.rows(), self.coarse.layout.counts[1]);
        for j in 0..count {
            self.between.halves.swap(0, 1);
            if rows.contains(&j) {
                self.along_x(simd, j, k);
            } else {
                self.between.halves[0].clear();
            }
            self.along_y(simd, j, k);
        }
    }

    /// Interpolates a coarse row along x.
    #[inline(always)]
    fn along_x<S: Simd>(&mut self, simd: S, j: usize, k: usize) {
        let Level { x, layout, .. } = self.coarse;
        let Between { halves: [halves, _], pairs, .. } = &mut *self.between;
        let (colour, even) = layout.place([0, j, k]);
        let (other, odd) = layout.place([1, j, k]);
        let n = layout.counts[0].next_multiple_of(2 * BLOCK) / 2;
        let shares = RowShares::of(self.stages.x.as_ref(), j, k);
        for &column in self.fine.active {
            let of_even = &x[colour][layout.in_column(column, even)..][..n + BLOCK];
            let of_odd = &x[other][layout.in_column(column, odd)..][..n + BLOCK];
            if shares.is_some() {
                pairs.fill(column, of_even, of_odd);
            } else {
                let here = halves.columns.places(column);
                copy::<S>(&mut halves.nodes_mut(0)[here.clone()], of_even);
                copy::<S>(&mut halves.nodes_mut(1)[here], of_odd);
            }
        }
        if let Some(shares) = shares {
            for &column in self.fine.active {
                pairs.interpolate(simd, shares, column);
            }
            for &column in self.fine.active {
                pairs.put::<S>(&self.stages.pieces, column, halves.row_mut(column));
            }
        }
    }

    /// Copies a coarse row to the thick plane, once the eliminated one before it is interpolated.
    #[inline(always)]
    fn along_y<S: Simd>(&mut self, simd: S, j: usize, k: usize) {
        let Between { thick: [thick, _], halves: [after, before], .. } = &mut *self.between;
        let (layout, stage) = (&self.fine.layout, &self.stages.y);
        let own = stage.as_ref().map_or(j, |stage| stage.fine_plane[j]);
        let columns = after.columns;
        let span = columns.span;
        let eliminated = stage.as_ref().filter(|stage| stage.is_eliminated(own.wrapping_sub(1)));
        // What is written beyond the end of a row is overwritten by the rows that follow.
        if let Some(stage) = eliminated {
            for parity in 0..2 {
                let places = after.places(parity);
                let previous = &stage.previous.row(own - 1, k)[places.clone()];
                let next = &stage.next.row(own - 1, k)[places];
                let to = thick.nodes_mut(layout, own - 1, parity, span);
                let (before, next_row) = (&before.nodes(parity)[..span], &after.nodes(parity)[..span]);
                for &column in self.fine.active {
                    let here = columns.places(column);
                    let (previous, next) =
                        ([previous, &before[here.clone()]], [next, &next_row[here.clone()]]);
                    combine(simd, &mut to[here], previous, next);
                }
            }
        }
        for parity in 0..2 {
            let to = thick.nodes_mut(layout, own, parity, span);
            let from = &after.nodes(parity)[..span];
            for &column in self.fine.active {
                let here = columns.places(column);
                copy::<S>(&mut to[here.clone()], &from[here]);
            }
        }
    }

    /// Corrects the red nodes of a fine plane, where x = D⁻¹ b, from the thick plane at it or from the two around it.
    #[inline(always)]
    fn correct_red<S: Simd>(&mut self, simd: S, k: usize, between: bool) {
        let Slab { part, stencil, layout, b: [b, _], x: [red, _], active, .. } = &mut self.fine;
        let places = stencil.layout.plane(k);
        let piece = stencil.piece(RED, places.clone());
        let [after, before] = &self.between.thick;
        for &column in *active {
            let here = part.within(&layout.plane_of(column, k));
            let (x, b) = (&mut red[here.clone()], &b[here]);
            piece.scale(simd, x, b);
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
