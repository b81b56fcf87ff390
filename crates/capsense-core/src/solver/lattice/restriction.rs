//! To the next coarser level: what each thread does.
//!
//! What is optional is matched, not mapped: a closure may become a call, which is compiled without the processor's extensions.

use super::layout::{BLOCK, Layout, RED};
use super::level::Level;
use super::pairs::RowShares;
use super::parts::Part;
use super::rows::{add_to, combine, copy, gather, multiply};
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
        let planes = self.part.steps(1);
        if planes.is_empty() {
            return self.between.descent.rest();
        }
        let first = self.stages.fine_plane(planes.start).saturating_sub(1);
        self.between.descent.start(simd, self.fine, first, self.active);
        for k in planes.start..planes.end {
            let last = self.stages.fine_plane(k) + 1;
            self.between.descent.go_on(simd, self.fine, last, self.active);
            self.along_z(simd, k);
            for j in rows.start..rows.end {
                self.along_y(simd, j, k);
                self.along_x(simd, j, k);
            }
        }
    }
}

impl Restriction<'_> {
    /// Fills the thick plane of a coarse plane: red nodes have their own residual, black ones what eliminated planes beside
    /// this one hand over.
    #[inline(always)]
    fn along_z<S: Simd>(&mut self, simd: S, plane: usize) {
        let Level { stencil, layout, .. } = self.fine;
        let Between { descent, thick: [thick, _], .. } = &mut *self.between;
        let own = self.stages.fine_plane(plane);
        let [after, before] = [own + 1, own.wrapping_sub(1)];
        let (mut of_after, mut of_before) = (None, None);
        if let Some(stage) = &self.stages.z {
            if stage.is_eliminated(after) {
                of_after = Some((after, stage.previous.red(stencil.layout.plane(after))));
            }
            if stage.is_eliminated(before) {
                of_before = Some((before, stage.next.red(stencil.layout.plane(before))));
            }
        }
        for &column in self.active {
            let (part, at) = thick.part(layout, RED, own, column);
            thick.values[part][at].copy_from_slice(descent.residual(column, own));
            let of = |(plane, share)| [share, descent.residual(column, plane)];
            // The nodes of both are at the same places.
            let Some(beside) = of_after.or(of_before) else {
                thick.values[1 - part][column * thick.len..][..thick.len].fill(0.0);
                continue;
            };
            let (part, at) = thick.part(layout, RED, beside.0, column);
            let to = &mut thick.values[part][at];
            match (of_after, of_before) {
                (Some(after), Some(before)) => combine(simd, to, of(after), of(before)),
                _ => multiply(simd, to, of(beside)),
            }
        }
    }

    /// Fills the rows between the stages of y and x from the thick plane.
    #[inline(always)]
    fn along_y<S: Simd>(&mut self, simd: S, j: usize, k: usize) {
        let Between { thick: [thick, _], halves: [halves, _], .. } = &mut *self.between;
        let layout = &self.fine.layout;
        let (mut own, mut after, mut before) = (j, None, None);
        if let Some(stage) = &self.stages.y {
            own = stage.fine_plane[j];
            if stage.is_eliminated(own + 1) {
                after = Some(stage);
            }
            if stage.is_eliminated(own.wrapping_sub(1)) {
                before = Some(stage);
            }
        }
        let columns = halves.columns;
        let span = columns.span;
        for parity in 0..2 {
            let places = halves.places(parity);
            let from = thick.nodes(layout, own, parity, span);
            let (mut next, mut previous) = (None, None);
            if let Some(stage) = after {
                let share = &stage.previous.row(own + 1, k)[places.clone()];
                next = Some((share, thick.nodes(layout, own + 1, parity, span)));
            }
            if let Some(stage) = before {
                let share = &stage.next.row(own - 1, k)[places];
                previous = Some((share, thick.nodes(layout, own - 1, parity, span)));
            }
            let to = &mut halves.nodes_mut(parity)[..span];
            for &column in self.active {
                let here = columns.places(column);
                let (to, own) = (&mut to[here.clone()], &from[here.clone()]);
                match (next, previous) {
                    (Some((share, next)), Some((other_share, previous))) => {
                        let previous = [other_share, &previous[here.clone()]];
                        gather(simd, to, own, [share, &next[here]], previous);
                    }
                    (Some((share, beside)), None) | (None, Some((share, beside))) => {
                        add_to(simd, to, own, [share, &beside[here]]);
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
        let shares = RowShares::of(self.stages.x.as_ref(), j, k);
        if shares.is_some() {
            for &column in self.active {
                pairs.take::<S>(&self.stages.pieces, column, halves.row(column));
            }
        }
        for &column in self.active {
            let (even, odd) = (layout.in_column(column, even), layout.in_column(column, odd));
            let of_even = &mut of_even[self.part.within(&(even..even + n))];
            let of_odd = &mut of_odd[self.part.within(&(odd..odd + n))];
            if let Some(shares) = shares {
                pairs.restrict(simd, shares, column, [of_even, of_odd]);
            } else {
                copy::<S>(of_even, &halves.nodes(0)[halves.columns.places(column)]);
                copy::<S>(of_odd, &halves.nodes(1)[halves.columns.places(column)]);
            }
        }
    }
}
