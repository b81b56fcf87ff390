//! What the device's kernels do, on the processor, one after the other: the kernels' twin in tests.

use super::plan::{Grid, Plan, Transfer};
use super::rules::{FIXED, OVERCORRECTION, ROUNDING, SWEEPS};
use capsense_core::solver::NO_HOLDER;

pub(super) const RED: u32 = 0;
pub(super) const BLACK: u32 = 1;

/// One scene's buffers.
#[derive(Clone, Debug)]
pub(super) struct Twin {
    pub(super) plan: Plan,
    pub(super) networks: Vec<f32>,
    pub(super) vectors: Vec<f32>,
    pub(super) holders: Vec<u32>,
}

impl Grid {
    pub(super) fn steps(&self) -> [usize; 3] {
        [1, self.counts[0] as usize, (self.counts[0] * self.counts[1]) as usize]
    }

    fn node(&self, [i, j, k]: [u32; 3]) -> usize {
        ((k * self.counts[1] + j) * self.counts[0] + i) as usize
    }

    fn place(&self, node: usize) -> [u32; 3] {
        let [nx, ny, _] = self.counts;
        let node = node as u32;
        [node % nx, node / nx % ny, node / (nx * ny)]
    }
}

impl Twin {
    pub(super) fn new(plan: Plan) -> Self {
        let (networks, vectors) = (vec![0.0; plan.network_len], vec![0.0; plan.vectors_len]);
        let holders = vec![NO_HOLDER; plan.nodes()];
        Self { plan, networks, vectors, holders }
    }

    pub(super) fn weight(&self, grid: &Grid, axis: usize, node: usize) -> f32 {
        self.networks[grid.at as usize + axis * grid.stride as usize + node]
    }

    /// The weight from the node before; a node's own place may be less than a step from the array's beginning.
    pub(super) fn weight_before(&self, grid: &Grid, axis: usize, node: usize) -> f32 {
        self.networks[grid.at as usize + axis * grid.stride as usize + node - grid.steps()[axis]]
    }

    fn leak(&self, grid: &Grid, node: usize) -> f32 {
        self.networks[grid.at as usize + 3 * grid.stride as usize + node]
    }

    /// What a node that is given up takes from the nodes before and after it.
    fn shares_at(&self, grid: &Grid, axis: usize, place: isize) -> [f32; 2] {
        let at = |array: usize, place: isize| {
            self.networks[(grid.at as isize + (array * grid.stride as usize) as isize + place) as usize]
        };
        let (before, after) = (at(axis, place - grid.steps()[axis] as isize), at(axis, place));
        let scale = 1.0 / (before + after + at(3, place).max(0.0)).max(f32::MIN_POSITIVE);
        [before * scale, after * scale]
    }

    fn shares(&self, grid: &Grid, axis: usize, node: usize) -> [f32; 2] {
        self.shares_at(grid, axis, node as isize)
    }

    /// The stage of one axis: its coarse network from its fine one.
    pub(super) fn coarsen(&mut self, transfer: &Transfer, axis: usize) {
        let [from, to] = [0, 1].map(|side| self.plan.grids[transfer.grids[axis + side] as usize]);
        if transfer.grids[axis] == transfer.grids[axis + 1] {
            return;
        }
        for node in 0..to.nodes as usize {
            let row = self.coarse_row(transfer, axis, &from, to.place(node));
            for (array, value) in row.into_iter().enumerate() {
                self.networks[to.at as usize + array * to.stride as usize + node] = value;
            }
        }
    }

    fn coarse_row(&self, transfer: &Transfer, axis: usize, from: &Grid, mut place: [u32; 3]) -> [f32; 4] {
        let plane = self.plan.maps[(transfer.fine[axis] + place[axis]) as usize];
        place[axis] = plane;
        let node = from.node(place);
        let mut row = [0, 1, 2].map(|axis| self.weight(from, axis, node));
        let mut leak = self.leak(from, node).max(0.0);
        let mut series = row[axis];
        if self.is_given_up(transfer, axis, from, plane + 1) {
            let eliminated = node + from.steps()[axis];
            let mut more = 0.0;
            self.divide(from, axis, eliminated, 0, row[axis], &mut row, &mut leak, &mut more);
            series = series * self.shares(from, axis, eliminated)[1] + more;
        }
        if plane > 0 && self.is_given_up(transfer, axis, from, plane - 1) {
            let eliminated = node - from.steps()[axis];
            let along = self.weight(from, axis, eliminated);
            self.divide(from, axis, eliminated, 1, along, &mut row, &mut leak, &mut 0.0);
        }
        row[axis] = series;
        [row[0], row[1], row[2], leak]
    }

    fn is_given_up(&self, transfer: &Transfer, axis: usize, from: &Grid, plane: u32) -> bool {
        plane < from.counts[axis] && self.plan.maps[(transfer.coarse[axis] + plane) as usize] % 2 == 1
    }

    /// Gives a coarse node its part of what a node beside it had that is given up. `side` is 0 for one after it.
    #[expect(clippy::too_many_arguments, reason = "as the kernel has them")]
    fn divide(
        &self,
        grid: &Grid,
        axis: usize,
        node: usize,
        side: usize,
        along: f32,
        row: &mut [f32; 3],
        leak: &mut f32,
        more: &mut f32,
    ) {
        let shares = self.shares(grid, axis, node);
        let (own, other) = (shares[side], shares[1 - side]);
        let lost = 1.0 - (own + other);
        *leak += along * if lost > ROUNDING { lost } else { 0.0 };
        for across in [0, 1, 2].into_iter().filter(|&across| across != axis) {
            let step = grid.steps()[across] as isize;
            let (before, after) = (self.weight_before(grid, across, node), self.weight(grid, across, node));
            let of_after = self.shares_at(grid, axis, node as isize + step);
            let of_before = self.shares_at(grid, axis, node as isize - step);
            let with_after = divided(own, other, of_after[side], of_after[1 - side]);
            let with_before = divided(own, other, of_before[side], of_before[1 - side]);
            let crossing = [0.5 * after * with_after[1], 0.5 * before * with_before[1]];
            row[across] += after * with_after[0] + crossing[0];
            *more += crossing[0] + crossing[1];
            *leak += after * with_after[2] + before * with_before[2];
        }
    }

    /// Σ w v over the six neighbours, and the inverse of the diagonal.
    fn gather(&self, grid: &Grid, vector: u32, node: usize) -> (f32, f32) {
        let (mut sum, mut diagonal) = (0.0, 0.0);
        for (axis, step) in grid.steps().into_iter().enumerate() {
            let (before, after) = (self.weight_before(grid, axis, node), self.weight(grid, axis, node));
            let at = vector as usize + node;
            sum += before * self.vectors[at - step] + after * self.vectors[at + step];
            diagonal += before + after;
        }
        diagonal += self.leak(grid, node);
        (sum, if diagonal > 0.0 && diagonal < 0.5 * FIXED { 1.0 / diagonal } else { 0.0 })
    }

    fn nodes_of(grid: Grid, colour: u32) -> impl Iterator<Item = usize> {
        (0..grid.nodes as usize).filter(move |&node| {
            let [i, j, k] = grid.place(node);
            (i + j + k) % 2 == colour
        })
    }

    /// z = D⁻¹ r at red nodes.
    pub(super) fn scale_red(&mut self, level: usize) {
        let level = self.plan.levels[level];
        let grid = self.plan.grids[level.grid as usize];
        for node in Self::nodes_of(grid, RED) {
            for column in 0..self.plan.columns as u32 {
                let (_, inverse) = self.gather(&grid, level.correction + column * level.stride, node);
                let at = (column * level.stride) as usize + node;
                self.vectors[level.correction as usize + at] =
                    inverse * self.vectors[level.residual as usize + at];
            }
        }
    }

    /// z = D⁻¹ (r + Σ w z) at the nodes of one colour.
    pub(super) fn relax(&mut self, level: usize, colour: u32) {
        let level = self.plan.levels[level];
        let grid = self.plan.grids[level.grid as usize];
        for column in 0..self.plan.columns as u32 {
            for node in Self::nodes_of(grid, colour) {
                let correction = level.correction + column * level.stride;
                let (sum, inverse) = self.gather(&grid, correction, node);
                let residual = self.vectors[(level.residual + column * level.stride) as usize + node];
                self.vectors[correction as usize + node] = (residual + sum) * inverse;
            }
        }
    }

    /// z = what is left of the residual at red nodes, for the next level.
    pub(super) fn leave_red(&mut self, level: usize) {
        let level = self.plan.levels[level];
        let grid = self.plan.grids[level.grid as usize];
        for column in 0..self.plan.columns as u32 {
            for node in Self::nodes_of(grid, RED) {
                let correction = level.correction + column * level.stride;
                let (sum, inverse) = self.gather(&grid, correction, node);
                self.vectors[correction as usize + node] = if inverse > 0.0 { sum } else { 0.0 };
            }
        }
    }

    /// r of the next level from what is left at red nodes.
    pub(super) fn restrict(&mut self, number: usize) {
        let transfer = self.plan.transfers[number];
        let [fine, coarse] = [0, 1].map(|side| self.plan.levels[number + side]);
        let grid = self.plan.grids[coarse.grid as usize];
        for node in 0..grid.nodes as usize {
            let place = grid.place(node);
            for column in 0..self.plan.columns as u32 {
                let sum = self.restricted(&transfer, 2, place, fine.correction + column * fine.stride);
                self.vectors[(coarse.residual + column * coarse.stride) as usize + node] =
                    OVERCORRECTION * sum;
            }
        }
    }

    /// What one node behind the stage of `axis` gets; `place` is in the grid behind that stage.
    fn restricted(&self, transfer: &Transfer, axis: usize, place: [u32; 3], vector: u32) -> f32 {
        let grid = self.plan.grids[transfer.grids[axis] as usize];
        let value = |place: [u32; 3]| match axis {
            0 => {
                let red = place.iter().sum::<u32>() % 2 == RED;
                if red { self.vectors[vector as usize + grid.node(place)] } else { 0.0 }
            }
            _ => self.restricted(transfer, axis - 1, place, vector),
        };
        let plane = self.plan.maps[(transfer.fine[axis] + place[axis]) as usize];
        let at = |plane: u32| std::array::from_fn(|other| if other == axis { plane } else { place[other] });
        let mut sum = value(at(plane));
        if self.is_given_up(transfer, axis, &grid, plane + 1) {
            sum += self.shares(&grid, axis, grid.node(at(plane + 1)))[0] * value(at(plane + 1));
        }
        if plane > 0 && self.is_given_up(transfer, axis, &grid, plane - 1) {
            sum += self.shares(&grid, axis, grid.node(at(plane - 1)))[1] * value(at(plane - 1));
        }
        sum
    }

    /// z = D⁻¹ r and the next level's correction at red nodes.
    pub(super) fn prolong(&mut self, number: usize) {
        let transfer = self.plan.transfers[number];
        let [fine, coarse] = [0, 1].map(|side| self.plan.levels[number + side]);
        let grid = self.plan.grids[fine.grid as usize];
        for node in Self::nodes_of(grid, RED) {
            for column in 0..self.plan.columns as u32 {
                let correction = fine.correction + column * fine.stride;
                let (_, inverse) = self.gather(&grid, correction, node);
                let own = inverse * self.vectors[(fine.residual + column * fine.stride) as usize + node];
                let from = coarse.correction + column * coarse.stride;
                let coarse =
                    if inverse > 0.0 { self.interpolated(&transfer, 0, grid.place(node), from) } else { 0.0 };
                self.vectors[correction as usize + node] = own + coarse;
            }
        }
    }

    /// The correction at a place in the grid before the stage of `axis`.
    fn interpolated(&self, transfer: &Transfer, axis: usize, place: [u32; 3], vector: u32) -> f32 {
        let grid = self.plan.grids[transfer.grids[axis] as usize];
        let told = self.plan.maps[(transfer.coarse[axis] + place[axis]) as usize];
        let value = |plane: u32| {
            let place = std::array::from_fn(|other| if other == axis { plane } else { place[other] });
            match axis {
                2 => {
                    let coarse = self.plan.grids[transfer.grids[3] as usize];
                    self.vectors[vector as usize + coarse.node(place)]
                }
                _ => self.interpolated(transfer, axis + 1, place, vector),
            }
        };
        if told.is_multiple_of(2) {
            return value(told / 2);
        }
        let [before, after] = self.shares(&grid, axis, grid.node(place));
        before * value(told / 2) + after * value(told / 2 + 1)
    }

    /// z = M r on the finest level, red nodes scaled already.
    pub(super) fn cycle(&mut self) {
        let last = self.plan.levels.len() - 1;
        for level in 0..last {
            self.relax(level, BLACK);
            self.leave_red(level);
            self.restrict(level);
            self.scale_red(level + 1);
        }
        for sweep in 0..2 * SWEEPS {
            self.relax(last, [BLACK, RED][sweep % 2]);
        }
        for level in (0..last).rev() {
            self.prolong(level);
            self.relax(level, BLACK);
            self.relax(level, RED);
        }
    }

    pub(super) fn coarsen_all(&mut self) {
        for transfer in self.plan.transfers.clone() {
            (0..3).for_each(|axis| self.coarsen(&transfer, axis));
        }
    }

    /// (K v)ᵢ - feed, by differences.
    pub(super) fn charge(&self, vector: u32, node: usize) -> f32 {
        let grid = self.plan.grids[0];
        let own = self.vectors[vector as usize + node];
        let mut sum = 0.0;
        for (axis, step) in grid.steps().into_iter().enumerate() {
            let at = vector as usize + node;
            sum += self.weight_before(&grid, axis, node) * (own - self.vectors[at - step])
                + self.weight(&grid, axis, node) * (own - self.vectors[at + step]);
        }
        sum + self.vectors[self.plan.leak as usize + node] * own
    }
}

/// What becomes of a weight between two nodes that are given up, on one side: what both take from this side, what one
/// takes from this and the other from the other, and what the first loses.
fn divided(own: f32, other: f32, own_beside: f32, other_beside: f32) -> [f32; 3] {
    let (more, less) = ((own - own_beside).max(0.0), (own_beside - own).max(0.0));
    let crossing = more.min((other_beside - other).max(0.0));
    let back = less.min((other - other_beside).max(0.0));
    let lost = more - crossing;
    [own - more, crossing + back, if lost > ROUNDING { lost } else { 0.0 }]
}
