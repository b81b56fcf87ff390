//! One level of the hierarchy: red-black Gauss-Seidel, fused so that the lattice is walked through once.

use super::layout::{BLACK, Coloured, Layout, RED};
use super::network::{Changed, Network};
use super::stencil::Stencil;
use pulp::Simd;

/// Coarse networks are somewhat too stiff, because what couples eliminated nodes is divided among their neighbours: with
/// four or five of them, corrections of smooth errors fall short by a third. Residuals are raised by this factor on their
/// way to the coarser level to make up for most of it. Measured at 200k tetrahedra: the condition number falls from 4.9
/// to 3.9 (as estimated, with caution); a larger factor makes other errors worse.
const OVERCORRECTION: f32 = 1.15;

/// A level's network and vectors, column after column.
#[derive(Clone, Debug)]
pub(super) struct Level {
    pub(super) stencil: Stencil<f32>,
    /// Right-hand side and correction.
    pub(super) b: Coloured<f32>,
    pub(super) x: Coloured<f32>,
    /// The residual of red nodes after a sweep; that of black ones is zero.
    pub(super) r: Vec<f32>,
}

impl Level {
    pub(super) fn new(layout: Layout, columns: usize) -> Self {
        Self {
            stencil: Stencil::new(layout),
            b: layout.zeros(columns),
            x: layout.zeros(columns),
            r: vec![0.0; columns * layout.len()],
        }
    }

    #[inline(always)]
    pub(super) fn layout(&self) -> &Layout {
        &self.stencil.layout
    }

    /// Takes over the network where it changed.
    pub(super) fn refresh(&mut self, network: &Network, changed: &Changed) {
        changed.for_each_row(|nodes, j, k| {
            for i in nodes {
                let (colour, at) = self.stencil.layout.place([i, j, k]);
                let node = &network.nodes[network.index([i, j, k])];
                for axis in 0..3 {
                    self.stencil.next[axis][colour][at] = node.next[axis];
                }
                self.stencil.centre[colour][at] = node.inverse;
            }
        });
    }

    /// x = one sweep on K x = b from zero, red nodes first, and r = b - K x after it: red nodes see no neighbours, and
    /// what black ones add is all that is left over at the red ones.
    #[inline(always)]
    pub(super) fn smooth_from_zero<S: Simd>(&mut self, simd: S, active: &[usize]) {
        let planes = self.layout().planes();
        for k in planes.start..planes.end + 2 {
            if k < planes.end {
                self.scale_red(simd, k, active);
            }
            if k > planes.start && k <= planes.end {
                self.relax(simd, BLACK, k - 1, active);
            }
            if k > planes.start + 1 {
                self.red_residual(simd, k - 2, active);
            }
        }
    }

    /// Once the red nodes of plane k are corrected: the black ones of the plane before are relaxed, then the red ones of
    /// that before it. After the last plane, two more calls finish the sweep.
    #[inline(always)]
    pub(super) fn smooth_behind<S: Simd>(&mut self, simd: S, k: usize, active: &[usize]) {
        let planes = self.layout().planes();
        if k > planes.start && k <= planes.end {
            self.relax(simd, BLACK, k - 1, active);
        }
        if k > planes.start + 1 {
            self.relax(simd, RED, k - 2, active);
        }
    }

    /// Some symmetric sweeps from zero, for a level that has no coarser one.
    #[inline(always)]
    pub(super) fn solve<S: Simd>(&mut self, simd: S, sweeps: usize, active: &[usize]) {
        let planes = self.layout().planes();
        for k in planes.start..planes.end {
            self.scale_red(simd, k, active);
        }
        for sweep in 0..2 * sweeps {
            for k in planes.start..planes.end {
                self.relax(simd, [BLACK, RED][sweep % 2], k, active);
            }
        }
    }

    /// x = D⁻¹ b at the red nodes of a plane.
    #[inline(always)]
    fn scale_red<S: Simd>(&mut self, simd: S, k: usize, active: &[usize]) {
        let (len, places) = (self.layout().len(), self.layout().plane(k));
        let stencil = self.stencil.piece(RED, places.start..places.end);
        for column in active {
            let at = column * len + places.start..column * len + places.end;
            stencil.scale(simd, &mut self.x[RED][at.start..at.end], &self.b[RED][at]);
        }
    }

    /// Solves the equations of one colour in a plane.
    #[inline(always)]
    fn relax<S: Simd>(&mut self, simd: S, colour: usize, k: usize, active: &[usize]) {
        let (len, places) = (self.layout().len(), self.layout().plane(k));
        let [red, black] = &mut self.x;
        let (own, other) = if colour == RED { (red, &*black) } else { (black, &*red) };
        let stencil = self.stencil.piece(colour, places.start..places.end);
        for column in active {
            let at = column * len + places.start..column * len + places.end;
            let b = &self.b[colour][at.start..at.end];
            stencil.relax(simd, &mut own[at], b, &other[column * len..(column + 1) * len]);
        }
    }

    /// r = Σ w x, raised for the coarser level, at the red nodes of a plane.
    #[inline(always)]
    fn red_residual<S: Simd>(&mut self, simd: S, k: usize, active: &[usize]) {
        let (len, places) = (self.layout().len(), self.layout().plane(k));
        let stencil = self.stencil.piece(RED, places.start..places.end);
        for column in active {
            let r = &mut self.r[column * len + places.start..column * len + places.end];
            stencil.gather(simd, OVERCORRECTION, r, &self.x[BLACK][column * len..(column + 1) * len]);
        }
    }
}
