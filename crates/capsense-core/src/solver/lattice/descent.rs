//! A sweep from zero, on the way to the next coarser level: x = D⁻¹ b at red nodes, which see no neighbours then, black
//! ones relaxed, and what that leaves over at red nodes; at black ones nothing is left.
//!
//! None of it is stored but for a few planes: the sweep after the coarser level's correction starts from D⁻¹ b at red nodes
//! again, and takes black ones from these.

use super::layout::{BLACK, BLOCK, Layout, RED};
use super::level::Level;
use super::rows::subtract_multiple;
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
    /// Room for the right-hand side and for D x in a plane of one column.
    b: Vec<f32>,
    charges: Vec<f32>,
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
    /// Number of pairs.
    pairs: usize,
}

impl Descent {
    /// For vectors of a level.
    pub(super) fn new(layout: &Layout) -> Self {
        let padding = (layout.row + 1).next_multiple_of(BLOCK);
        let zeros = vec![0.0; padding + layout.plane + layout.row + 3 * BLOCK];
        let planes = || [(); KEPT].map(|()| zeros.clone());
        let (red, black, residual) = (planes(), planes(), planes());
        let pairs = layout.columns * (layout.columns + 1) / 2;
        let gains = Gains { of_planes: vec![0.0; pairs * layout.counts[2]], pairs };
        let (b, charges) = (vec![0.0; layout.plane], vec![0.0; layout.plane]);
        Self { layout: *layout, padding, zeros, red, black, residual, b, charges, first: 0, next: 0, gains }
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

    /// Goes through no plane.
    pub(super) fn rest(&mut self) {
        (self.first, self.next) = (0, 0);
    }

    /// Goes on to the residual of a plane.
    #[inline(always)]
    pub(super) fn go_on<S: Simd>(&mut self, simd: S, level: &Level, k: usize, active: &[usize]) {
        while self.next <= k {
            self.scale_red(simd, level, self.next + 2, active);
            self.relax_black(simd, level, self.next + 1, active);
            self.leave_red(simd, level, self.next, active);
            self.next += 1;
        }
    }

    /// The residual of the red nodes of a plane in one column.
    #[inline(always)]
    pub(super) fn residual(&self, column: usize, k: usize) -> &[f32] {
        if self.layout.planes().contains(&k) {
            &self.residual[k % KEPT][self.places(RED, k).of(column)]
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
        self.gains.of_planes[k * self.gains.pairs + pair(s, t)]
    }

    /// Where the nodes of one colour of plane k are.
    #[inline(always)]
    fn places(&self, colour: usize, k: usize) -> Places {
        let (layout, Range { start, end }) = (self.layout, self.layout.plane(k));
        let shift = layout.shift(colour, k);
        Places { layout, first: start + self.padding - shift..end + self.padding - shift }
    }

    /// x = D⁻¹ b.
    #[inline(always)]
    fn scale_red<S: Simd>(&mut self, simd: S, level: &Level, k: usize, active: &[usize]) {
        if !self.layout.planes().contains(&k) {
            return;
        }
        self.gains.start(k);
        let stencil = level.stencil.piece(RED, level.stencil.layout.plane(k));
        let places = self.places(RED, k);
        let red = &mut self.red[k % KEPT];
        for (index, &t) in active.iter().enumerate() {
            let b = right_hand_side(simd, level, [RED, t, k], &mut self.b);
            stencil.scale(simd, &mut red[places.of(t)], b);
            for &s in active.iter().take(index + 1) {
                self.gains.add(simd, [k, s, t], &red[places.of(s)], b);
            }
        }
    }

    /// x = D⁻¹ (b + Σ w x).
    #[inline(always)]
    fn relax_black<S: Simd>(&mut self, simd: S, level: &Level, k: usize, active: &[usize]) {
        if !self.layout.planes().contains(&k) {
            return;
        }
        let stencil = level.stencil.piece(BLACK, level.stencil.layout.plane(k));
        let places = self.places(BLACK, k);
        let black = &mut self.black[k % KEPT];
        for (index, &t) in active.iter().enumerate() {
            let b = right_hand_side(simd, level, [BLACK, t, k], &mut self.b);
            let around = around(&self.layout, &self.red, &self.zeros, (BLACK + k) % 2, &places.of(t), k);
            let charges = &mut self.charges[..b.len()];
            stencil.relax_with_charges(simd, &mut black[places.of(t)], charges, b, around);
            for &s in active.iter().take(index + 1) {
                self.gains.add(simd, [k, s, t], &black[places.of(s)], charges);
            }
        }
    }

    /// r = Σ w x, raised for the coarser level.
    #[inline(always)]
    fn leave_red<S: Simd>(&mut self, simd: S, level: &Level, k: usize, active: &[usize]) {
        if !self.layout.planes().contains(&k) {
            return;
        }
        let stencil = level.stencil.piece(RED, level.stencil.layout.plane(k));
        let of_columns = self.places(RED, k);
        for &column in active {
            let places = of_columns.of(column);
            let around = around(&self.layout, &self.black, &self.zeros, (RED + k) % 2, &places, k);
            stencil.gather(simd, OVERCORRECTION, &mut self.residual[k % KEPT][places], around);
        }
    }
}

/// The places of successive nodes.
struct Places {
    layout: Layout,
    /// Those of the first column.
    first: Range<usize>,
}

impl Places {
    #[inline(always)]
    fn of(&self, column: usize) -> Range<usize> {
        let Range { start, end } = self.first;
        self.layout.in_column(column, start)..self.layout.in_column(column, end)
    }
}

impl Gains {
    /// Starts with a plane.
    #[inline(always)]
    fn start(&mut self, k: usize) {
        self.of_planes[k * self.pairs..][..self.pairs].fill(0.0);
    }

    /// Each node that is relaxed takes D x² from the energy: adds the products of x in one column and D x in another for all
    /// nodes of one colour in plane k.
    #[inline(always)]
    fn add<S: Simd>(&mut self, simd: S, [k, s, t]: [usize; 3], x: &[f32], charges: &[f32]) {
        let gain = &mut self.of_planes[k * self.pairs + pair(s, t)];
        // Counted, as both to cut into pieces at once would take two divisions.
        let mut start = 0;
        while start < x.len() {
            let piece = start..x.len().min(start + PIECE);
            *gain += total(&products(simd, &x[piece.clone()], &charges[piece]));
            start += PIECE;
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
