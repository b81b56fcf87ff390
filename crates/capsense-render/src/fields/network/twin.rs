//! The kernels on the processor, one function for each.

use super::changes::{FEED, ROW};
use super::plan::{Level, Plan};
use super::rules::{OMEGA, OVERCORRECTION, SWEEPS};
use capsense_core::solver::{NO_AGGREGATE, NO_HOLDER, of_links};

/// The buffers of kernels.
#[derive(Debug)]
pub(super) struct Twin {
    pub(super) plan: Plan,
    pub(super) networks: Vec<f32>,
    pub(super) vectors: Vec<f32>,
    holders: Vec<u32>,
    /// r·z and p·K p of the last step of each column.
    last: Vec<[f64; 2]>,
}

/// The inverse of the diagonal; where weights are negative, of as much more as keeps sweeps from overshooting.
fn inverse_of(sum: f32, size: f32) -> f32 {
    let diagonal = sum.max(0.5 * (sum + size));
    if diagonal > f32::MIN_POSITIVE { 1.0 / diagonal } else { 0.0 }
}

impl Twin {
    pub(super) fn new(plan: Plan) -> Self {
        Self {
            networks: vec![0.0; plan.network_len],
            vectors: vec![0.0; plan.vectors_len],
            holders: vec![NO_HOLDER; plan.nodes()],
            last: vec![[0.0; 2]; plan.columns],
            plan,
        }
    }

    fn at(&self, vector: u32, row: usize, column: usize) -> usize {
        vector as usize + row * self.plan.columns + column
    }

    fn value(&self, vector: u32, row: usize, column: usize) -> f32 {
        self.vectors[self.at(vector, row, column)]
    }

    fn set(&mut self, vector: u32, row: usize, column: usize, value: f32) {
        let at = self.at(vector, row, column);
        self.vectors[at] = value;
    }

    pub(super) fn is_free(&self, row: usize) -> bool {
        self.holders[row] == NO_HOLDER
    }

    pub(super) fn take_changes(&mut self, words: &[u32]) {
        let [rows_at, rows, feeds_at, feeds] = [0, 1, 2, 3].map(|at| words[at] as usize);
        let level = self.plan.levels[0];
        for record in words[rows_at..][..ROW * rows].chunks(ROW) {
            let (row, holder) = (record[0] as usize, record[1]);
            let [leak, held] = [record[2], record[3]].map(f32::from_bits);
            let (at, count) = (record[4] as usize, record[5] as usize);
            let is_free = holder == NO_HOLDER;
            let (mut sum, mut size) = (leak, leak.abs());
            for (number, entry) in self.plan.entries(&level, row).take(count).enumerate() {
                let weight = f32::from_bits(words[at + number]);
                let is_held = words[at + count + number / 32] >> (number % 32) & 1 == 1;
                self.networks[self.plan.weights as usize + entry] = weight;
                self.networks[level.weights as usize + entry] =
                    if is_free && !is_held { weight } else { 0.0 };
                sum += weight;
                size += weight.abs();
            }
            self.networks[self.plan.links as usize + row] = leak;
            self.networks[level.leak as usize + row] = if is_free { leak + held } else { 0.0 };
            self.networks[level.inverse as usize + row] = if is_free { inverse_of(sum, size) } else { 0.0 };
            self.holders[row] = holder;
            for column in (0..self.plan.columns).filter(|_| !is_free) {
                let held = if holder == column as u32 { 1.0 } else { 0.0 };
                self.set(self.plan.potential, row, column, held);
            }
        }
        for feed in words[feeds_at..][..FEED * feeds].chunks(FEED) {
            self.set(self.plan.feed, feed[0] as usize, feed[1] as usize, f32::from_bits(feed[2]));
        }
    }

    pub(super) fn empty_columns(&mut self, words: &[u32]) {
        for row in 0..self.plan.nodes() {
            for column in (0..self.plan.columns).filter(|column| words[4] >> column & 1 == 1) {
                let held = if self.holders[row] == column as u32 { 1.0 } else { 0.0 };
                self.set(self.plan.potential, row, column, held);
                for vector in [self.plan.image, self.plan.steps[0], self.plan.steps[1]] {
                    self.set(vector, row, column, 0.0);
                }
            }
        }
    }

    fn list(&self, ends: u32, list: u32, number: usize) -> impl Iterator<Item = usize> + '_ {
        let [first, end] = [0, 1].map(|at| (self.plan.maps[ends as usize + number + at] + list) as usize);
        self.plan.maps[first..end].iter().map(|&item| item as usize)
    }

    pub(super) fn coarsen(&mut self, number: usize) {
        let (fine, coarse) = (self.plan.levels[number], self.plan.levels[number + 1]);
        for row in 0..coarse.rows as usize {
            let members = self.list(coarse.member_ends, coarse.members, row);
            let leak: f32 = members.map(|member| self.networks[fine.leak as usize + member]).sum();
            let (mut sum, mut size) = (leak, leak.abs());
            for entry in self.plan.entries(&coarse, row) {
                let parts = self.list(coarse.part_ends, coarse.parts, entry);
                let weight: f32 = parts.map(|part| self.networks[fine.weights as usize + part]).sum();
                self.networks[coarse.weights as usize + entry] = weight;
                sum += weight;
                size += weight.abs();
            }
            self.networks[coarse.leak as usize + row] = leak;
            self.networks[coarse.inverse as usize + row] = inverse_of(sum, size);
        }
    }

    /// Σ w (v - v') to all neighbours and through the leak, at one row.
    fn drawn(&self, level: &Level, [weights, leak]: [u32; 2], row: usize, v: impl Fn(usize) -> f32) -> f32 {
        let own = v(row);
        let currents = self.plan.entries(level, row).map(|entry| {
            let other = self.plan.maps[level.columns as usize + entry] as usize;
            self.networks[weights as usize + entry] * (own - v(other))
        });
        self.networks[leak as usize + row] * own + currents.sum::<f32>()
    }

    /// K v with v zero where potentials are held.
    pub(super) fn product(&self, level: &Level, vector: u32, row: usize, column: usize) -> f32 {
        self.drawn(level, [level.weights, level.leak], row, |row| self.value(vector, row, column))
    }

    /// What a node draws of the fields as they are.
    fn charge(&self, row: usize, column: usize) -> f32 {
        let network = [self.plan.weights, self.plan.links];
        let potential = |row: usize| self.value(self.plan.potential, row, column);
        self.drawn(&self.plan.levels[0], network, row, potential) - self.value(self.plan.feed, row, column)
    }

    pub(super) fn find_residual(&mut self) {
        let level = self.plan.levels[0];
        for row in 0..self.plan.nodes() {
            for column in 0..self.plan.columns {
                let residual = if self.is_free(row) { -self.charge(row, column) } else { 0.0 };
                self.start_row(&level, row, column, residual);
            }
        }
    }

    fn start_row(&mut self, level: &Level, row: usize, column: usize, residual: f32) {
        let swept = OMEGA * self.networks[level.inverse as usize + row] * residual;
        self.set(level.residual, row, column, residual);
        self.set(level.swept, row, column, swept);
    }

    fn restrict(&mut self, number: usize, column: usize) {
        let (fine, coarse) = (self.plan.levels[number], self.plan.levels[number + 1]);
        for row in 0..coarse.rows as usize {
            let left = |member: usize| {
                self.value(fine.residual, member, column) - self.product(&fine, fine.swept, member, column)
            };
            let sum = self.list(coarse.member_ends, coarse.members, row).map(left).sum();
            self.start_row(&coarse, row, column, sum);
        }
    }

    fn solve_coarsest(&mut self, column: usize) {
        let level = self.plan.levels[self.plan.levels.len() - 1];
        let all = |twin: &Self, vector: u32| -> Vec<f32> {
            (0..level.rows as usize).map(|row| twin.value(vector, row, column)).collect()
        };
        let mut solution = all(self, level.swept);
        for _ in 1..SWEEPS {
            let before = solution.clone();
            for (row, solution) in solution.iter_mut().enumerate() {
                let drawn = self.drawn(&level, [level.weights, level.leak], row, |row| before[row]);
                let left = self.value(level.residual, row, column) - drawn;
                *solution += OMEGA * self.networks[level.inverse as usize + row] * left;
            }
        }
        (0..).zip(solution).for_each(|(row, value)| self.set(level.correction, row, column, value));
    }

    fn lifted(&self, number: usize, row: usize, column: usize) -> f32 {
        let level = &self.plan.levels[number];
        let swept = self.value(level.swept, row, column);
        match self.plan.maps[level.aggregate as usize + row] {
            NO_AGGREGATE => swept,
            own => {
                let coarse = self.plan.levels[number + 1].correction;
                swept + OVERCORRECTION * self.value(coarse, own as usize, column)
            }
        }
    }

    fn prolong(&mut self, number: usize, column: usize) {
        let level = self.plan.levels[number];
        for row in 0..level.rows as usize {
            let inverse = self.networks[level.inverse as usize + row];
            let network = [level.weights, level.leak];
            let drawn = self.drawn(&level, network, row, |row| self.lifted(number, row, column));
            let left = self.value(level.residual, row, column) - drawn;
            let corrected = self.lifted(number, row, column) + OMEGA * inverse * left;
            self.set(level.correction, row, column, if inverse == 0.0 { 0.0 } else { corrected });
        }
    }

    /// z = M r in one column.
    pub(super) fn cycle(&mut self, column: usize) {
        let coarse = self.plan.levels.len() - 1;
        (0..coarse).for_each(|number| self.restrict(number, column));
        self.solve_coarsest(column);
        (0..coarse).rev().for_each(|number| self.prolong(number, column));
    }

    fn dot(&self, a: u32, b: u32, column: usize) -> f64 {
        let products = (0..self.plan.nodes())
            .map(|row| f64::from(self.value(a, row, column)) * f64::from(self.value(b, row, column)));
        products.sum()
    }

    /// One iteration of one column; returns r·z and the energy's drop.
    pub(super) fn iterate(&mut self, iteration: usize, column: usize) -> [f64; 2] {
        let level = self.plan.levels[0];
        let [before, now] = [iteration, iteration + 1].map(|step| self.plan.steps[step % 2]);
        self.cycle(column);
        let along = self.dot(level.residual, level.correction, column);
        let mixed = self.dot(level.correction, self.plan.image, column);
        let [_, last] = self.last[column];
        let beta = if iteration > 0 && last > 0.0 { (-mixed / last) as f32 } else { 0.0 };
        for row in 0..self.plan.nodes() {
            let z = self.value(level.correction, row, column);
            self.set(now, row, column, z + beta * self.value(before, row, column));
        }
        for row in 0..self.plan.nodes() {
            let image = if self.is_free(row) { self.product(&level, now, row, column) } else { 0.0 };
            self.set(self.plan.image, row, column, image);
        }
        let curvature = self.dot(now, self.plan.image, column);
        self.last[column] = [along, curvature];
        if !(along > 0.0 && curvature > 0.0) {
            return [along, 0.0];
        }
        let alpha = (along / curvature) as f32;
        for row in 0..self.plan.nodes() {
            let potential = self.value(self.plan.potential, row, column);
            let step = alpha * self.value(now, row, column);
            self.set(self.plan.potential, row, column, potential + step);
            let left =
                self.value(level.residual, row, column) - alpha * self.value(self.plan.image, row, column);
            self.start_row(&level, row, column, left);
        }
        [along, along * along / curvature]
    }

    /// The energies of all pairs of columns.
    pub(super) fn energies(&self) -> Vec<f64> {
        let (columns, level) = (self.plan.columns, self.plan.levels[0]);
        let mut energies = vec![0.0; columns * columns];
        for row in 0..self.plan.nodes() {
            let leak = self.networks[self.plan.links as usize + row];
            let ends = |s: usize| self.value(self.plan.potential, row, s);
            let feed = |s: usize| self.value(self.plan.feed, row, s);
            for (s, t) in (0..columns).flat_map(|s| (0..columns).map(move |t| (s, t))) {
                let of_edges = self.plan.entries(&level, row).map(|entry| {
                    let other = self.plan.maps[level.columns as usize + entry] as usize;
                    let along = |s: usize| ends(s) - self.value(self.plan.potential, other, s);
                    let weight = self.networks[self.plan.weights as usize + entry];
                    0.5 * f64::from(weight * along(s) * along(t))
                });
                let of_links = of_links(leak, [ends(s), ends(t)], [feed(s), feed(t)]);
                energies[s * columns + t] += of_edges.sum::<f64>() + f64::from(of_links);
            }
        }
        energies
    }
}
