//! A sweep from zero, on the way to the next coarser level: x = D⁻¹ b at red nodes, which see no neighbours then, black
//! ones relaxed, and what that leaves over at red nodes; at black ones nothing is left.
//!
//! None of it is stored but for a few planes: the sweep after the coarser level's correction starts from D⁻¹ b at red nodes
//! again, and takes black ones from these.

use super::layout::{BLACK, BLOCK, Layout, RED};
use super::level::Level;
use super::rows::{multiply, subtract_multiple};
use super::sums::{PIECE, products, total};
use pulp::Simd;
use std::ops::Range;

/// Coarse networks are somewhat too stiff, because what couples eliminated nodes is divided among their neighbours: with
/// four or five of them, corrections of smooth errors fall short by a third. Residuals are raised by this factor on their
/// way to the coarser level to make up for most of it. Measured at 200k tetrahedra: the condition number falls from 4.9
/// to 3.9 (as estimated, with caution); a larger factor makes other errors worse.
pub(super) const OVERCORRECTION: f32 = 1.15;

/// So many planes are kept of each number, an even number of them, so that a plane takes the place of one coloured alike.
const KEPT: usize = 4;

/// The last planes of a sweep. A node's place in a plane depends on its indices along x and y only.
#[derive(Clone, Debug)]
pub(super) struct Descent {
    layout: Layout,
    /// What stands before the first place.
    padding: usize,
    /// For planes that are fixed.
    zeros: Vec<f32>,
    red: [Vec<f32>; KEPT],
    black: [Vec<f32>; KEPT],
    residual: [Vec<f32>; KEPT],
    /// Room for a plane of the right-hand side.
    b: Vec<f32>,
    /// The first plane that got a residual, and the next that gets one.
    first: usize,
    next: usize,
    gains: Gains,
}

/// What the sweep takes from the energies: bᵀMb, M the sweep, for all pairs of columns.
#[derive(Clone, Debug)]
struct Gains {
    /// Of every plane, all pairs s <= t; those of inactive columns are of no use.
    of_planes: Vec<f64>,
    /// D and D x of a piece.
    diagonal: Vec<f32>,
    charges: Vec<f32>,
}

impl Descent {
    /// For vectors of a level.
    pub(super) fn new(layout: &Layout) -> Self {
        let padding = (layout.row + 1).next_multiple_of(BLOCK);
        let zeros = vec![0.0; padding + layout.plane + layout.row + 3 * BLOCK];
        let planes = || [(); KEPT].map(|()| zeros.clone());
        let (red, black, residual) = (planes(), planes(), planes());
        let pairs = layout.columns * (layout.columns + 1) / 2;
        let gains = Gains {
            // A sweep ends one plane behind the last that gets a residual.
            of_planes: vec![0.0; pairs * (layout.counts[2] + 1)],
            diagonal: vec![0.0; PIECE],
            charges: vec![0.0; PIECE],
        };
        let b = vec![0.0; layout.plane];
        Self { layout: *layout, padding, zeros, red, black, residual, b, first: 0, next: 0, gains }
    }

    /// Zeros everywhere, after numbers that were not finite.
    pub(super) fn clear(&mut self) {
        let planes = self.red.iter_mut().chain(&mut self.black).chain(&mut self.residual);
        planes.for_each(|plane| plane.fill(0.0));
    }

    /// Starts with the residual of a plane.
    #[inline(always)]
    pub(super) fn start<S: Simd>(&mut self, simd: S, level: &Level, k: usize, active: &[usize]) {
        (self.first, self.next) = (k, k);
        for plane in k.saturating_sub(2)..k + 2 {
            self.scale_red(simd, level, plane, active);
        }
        for plane in k.saturating_sub(1)..k + 1 {
            self.relax_black(simd, level, plane, active);
        }
    }

    /// Goes on to the residual of a plane.
    #[inline(always)]
    pub(super) fn go_on<S: Simd>(&mut self, simd: S, level: &Level, k: usize, active: &[usize]) {
        while self.next <= k {
            self.scale_red(simd, level, self.next + 2, active);
            self.relax_black(simd, level, self.next + 1, active);
            self.leave_red(simd, level, self.next, active);
            self.note_gains(simd, level, self.next, active);
            self.next += 1;
        }
    }

    /// The residual of the red nodes of a plane in one column.
    #[inline(always)]
    pub(super) fn residual(&self, column: usize, k: usize) -> &[f32] {
        if self.layout.planes().contains(&k) {
            &self.residual[k % KEPT][self.places(RED, column, k)]
        } else {
            &self.zeros[..self.layout.plane(k).len()]
        }
    }

    /// Whether the last sweep went through a plane.
    pub(super) fn went_through(&self, k: usize) -> bool {
        (self.first..self.next).contains(&k)
    }

    /// What the sweep took in a plane, one of those gone through last, from the energy of a pair s <= t of active columns.
    pub(super) fn gain(&self, k: usize, s: usize, t: usize) -> f64 {
        self.gains.of_planes[k * self.pairs() + pair(s, t)]
    }

    fn pairs(&self) -> usize {
        pair(0, self.layout.columns)
    }

    /// Where the nodes of one colour of plane k are.
    #[inline(always)]
    fn places(&self, colour: usize, column: usize, k: usize) -> Range<usize> {
        let (Range { start, end }, shift) = (self.layout.plane_of(column, k), self.layout.shift(colour, k));
        start + self.padding - shift..end + self.padding - shift
    }

    /// x = D⁻¹ b.
    #[inline(always)]
    fn scale_red<S: Simd>(&mut self, simd: S, level: &Level, k: usize, active: &[usize]) {
        if !self.layout.planes().contains(&k) {
            return;
        }
        let stencil = level.stencil.piece(RED, level.stencil.layout.plane(k));
        for &column in active {
            let places = self.places(RED, column, k);
            let b = right_hand_side(simd, level, [RED, column, k], &mut self.b);
            stencil.scale(simd, &mut self.red[k % KEPT][places], b);
        }
    }

    /// x = D⁻¹ (b + Σ w x).
    #[inline(always)]
    fn relax_black<S: Simd>(&mut self, simd: S, level: &Level, k: usize, active: &[usize]) {
        if !self.layout.planes().contains(&k) {
            return;
        }
        let stencil = level.stencil.piece(BLACK, level.stencil.layout.plane(k));
        for &column in active {
            let places = self.places(BLACK, column, k);
            let b = right_hand_side(simd, level, [BLACK, column, k], &mut self.b);
            let around = around(&self.layout, &self.red, &self.zeros, (BLACK + k) % 2, &places, k);
            stencil.relax(simd, &mut self.black[k % KEPT][places], b, around);
        }
    }

    /// r = Σ w x, raised for the coarser level.
    #[inline(always)]
    fn leave_red<S: Simd>(&mut self, simd: S, level: &Level, k: usize, active: &[usize]) {
        if !self.layout.planes().contains(&k) {
            return;
        }
        let stencil = level.stencil.piece(RED, level.stencil.layout.plane(k));
        for &column in active {
            let places = self.places(RED, column, k);
            let around = around(&self.layout, &self.black, &self.zeros, (RED + k) % 2, &places, k);
            stencil.gather(simd, OVERCORRECTION, &mut self.residual[k % KEPT][places], around);
        }
    }

    /// Each node that is relaxed takes D x² from the energy.
    #[inline(always)]
    fn note_gains<S: Simd>(&mut self, simd: S, level: &Level, k: usize, active: &[usize]) {
        let pairs = self.pairs();
        self.gains.of_planes[k * pairs..][..pairs].fill(0.0);
        if !self.layout.planes().contains(&k) {
            return;
        }
        let plane = level.stencil.layout.plane(k);
        for piece in 0..2 * plane.len().div_ceil(PIECE) {
            let (colour, start) = (piece % 2, piece / 2 * PIECE);
            let n = (plane.len() - start).min(PIECE);
            let (layout, before, shift) = (self.layout, self.padding + start, self.layout.shift(colour, k));
            let here = |column: usize| {
                let first = layout.plane_of(column, k).start + before - shift;
                first..first + n
            };
            let x = if colour == RED { &self.red[k % KEPT] } else { &self.black[k % KEPT] };
            let Gains { of_planes, diagonal, charges } = &mut self.gains;
            let (diagonal, charges) = (&mut diagonal[..n], &mut charges[..n]);
            let at = plane.start + start;
            level.stencil.piece(colour, at..at + n).diagonal(simd, diagonal);
            for (index, &t) in active.iter().enumerate() {
                multiply(simd, charges, diagonal, &x[here(t)]);
                for &s in &active[..=index] {
                    of_planes[k * pairs + pair(s, t)] += total(&products(simd, &x[here(s)], charges));
                }
            }
        }
    }
}

/// The right-hand side at the nodes of one colour of plane k in one column, if need be in `room`.
#[inline(always)]
fn right_hand_side<'a, S: Simd>(
    simd: S,
    level: &'a Level,
    [colour, column, k]: [usize; 3],
    room: &'a mut [f32],
) -> &'a [f32] {
    let at = level.layout.plane_of(column, k);
    let (b, length) = (&level.b[colour][at.clone()], level.ahead[column]);
    if length == 0.0 {
        return b;
    }
    let room = &mut room[..b.len()];
    subtract_multiple(simd, room, b, length, &level.charges[colour][at]);
    room
}

/// Number of a pair s <= t of columns.
#[inline(always)]
fn pair(s: usize, t: usize) -> usize {
    t * (t + 1) / 2 + s
}

/// The neighbours' values, along x, y and z, of nodes with even or odd i + j at some places of plane k.
#[inline(always)]
fn around<'v>(
    layout: &Layout,
    planes: &'v [Vec<f32>; KEPT],
    zeros: &'v [f32],
    parity: usize,
    places: &Range<usize>,
    k: usize,
) -> [&'v [f32]; 6] {
    let (at, n, row) = (places.start, places.len(), layout.row);
    let own = &*planes[k % KEPT];
    let (below, above) = (k.wrapping_sub(1), k + 1);
    let free = layout.planes();
    let below = if free.contains(&below) { &*planes[below % KEPT] } else { zeros };
    let above = if free.contains(&above) { &*planes[above % KEPT] } else { zeros };
    let [west, south, north] = match parity {
        0 => [at - 1, at - row - 1, at + row],
        _ => [at, at - row, at + row + 1],
    };
    [
        &own[west..west + n],
        &own[west + 1..west + 1 + n],
        &own[south..south + n],
        &own[north..north + n],
        &below[at..at + n],
        &above[at..at + n],
    ]
}
