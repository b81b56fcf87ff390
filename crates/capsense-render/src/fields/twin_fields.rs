//! Conjugate gradients by the kernels' twin, and the fields that they make for a simulator.

use super::iteration::to_come;
use super::plan::Plan;
use super::rules::FIXED;
use super::twin::Twin;
use capsense_core::solver::{Changes, NO_HOLDER, RemoteFields, RemoteSolution, SolveError, of_links};
use std::sync::{Arc, Mutex};

/// Iterations where it is not known how exact fields must be.
const UNKNOWN: usize = 12;

/// Fields on the processor, by what the kernels do.
#[derive(Clone, Debug)]
pub(super) struct TwinFields {
    pub(super) twin: Arc<Mutex<Twin>>,
}

impl TwinFields {
    pub(super) fn new(plan: Plan) -> Self {
        Self { twin: Arc::new(Mutex::new(Twin::new(plan))) }
    }
}

impl Twin {
    /// Takes over what changed.
    pub(super) fn update(&mut self, changes: &Changes<'_>) {
        let (grid, plan) = (self.plan.grids[0], &self.plan);
        let stride = plan.levels[0].stride;
        for row in changes.rows {
            let node = row.node as usize;
            let is_free = row.holder == NO_HOLDER;
            let leak = if is_free { row.leak } else { FIXED };
            for (array, value) in row.next.into_iter().chain([leak]).enumerate() {
                self.networks[grid.at as usize + array * grid.stride as usize + node] = value;
            }
            self.vectors[plan.leak as usize + node] = row.leak;
            self.holders[node] = row.holder;
            for column in 0..plan.columns as u32 {
                if !is_free {
                    let at = (plan.potential + column * stride) as usize + node;
                    self.vectors[at] = f32::from(u8::from(row.holder == column));
                }
            }
        }
        for feed in changes.feeds {
            self.vectors[(plan.feed + feed.column * stride + feed.node) as usize] = feed.charge;
        }
        for &column in changes.emptied {
            for node in 0..plan.nodes() {
                let holds = self.holders[node] == column as u32;
                self.vectors[(plan.potential + column as u32 * stride) as usize + node] =
                    f32::from(u8::from(holds));
            }
        }
    }

    /// r = feed - K x on free nodes, and z = D⁻¹ r at red ones.
    pub(super) fn residual(&mut self) {
        let level = self.plan.levels[0];
        for column in 0..self.plan.columns as u32 {
            let shift = column * level.stride;
            for node in 0..self.plan.nodes() {
                let charge = self.charge(self.plan.potential + shift, node);
                let fed = self.vectors[(self.plan.feed + shift) as usize + node];
                let is_free = self.holders[node] == NO_HOLDER;
                self.vectors[(level.residual + shift) as usize + node] =
                    if is_free { fed - charge } else { 0.0 };
            }
        }
        self.scale_red(0);
    }

    fn dot(&self, a: u32, b: u32) -> f32 {
        (0..self.plan.nodes())
            .map(|node| {
                f64::from(self.vectors[a as usize + node]) * f64::from(self.vectors[b as usize + node])
            })
            .sum::<f64>() as f32
    }

    /// XᵀKX of all pairs, and the residual over the charges on each column's own nodes.
    fn evaluate(&self) -> (Vec<f64>, f64) {
        let (columns, level, grid) = (self.plan.columns, self.plan.levels[0], self.plan.grids[0]);
        let at = |vector: u32, column: usize, node: usize| {
            f64::from(self.vectors[(vector + column as u32 * level.stride) as usize + node])
        };
        let (potential, feed) = (self.plan.potential, self.plan.feed);
        let plan_leak = self.plan.leak as usize;
        let mut energies = vec![0.0; columns * columns];
        let mut residual: f64 = 0.0;
        for s in 0..columns {
            for t in 0..columns {
                let mut sum = 0.0;
                for node in 0..self.plan.nodes() {
                    for (axis, step) in grid.steps().into_iter().enumerate() {
                        let difference =
                            |column| at(potential, column, node) - at(potential, column, node + step);
                        sum += f64::from(self.weight(&grid, axis, node)) * difference(s) * difference(t);
                    }
                    let single = |vector: u32, column: usize| {
                        self.vectors[(vector + column as u32 * level.stride) as usize + node]
                    };
                    let leak = self.vectors[plan_leak + node];
                    let ends = [single(potential, s), single(potential, t)];
                    sum += f64::from(of_links(leak, ends, [single(feed, s), single(feed, t)]));
                }
                energies[s * columns + t] = sum;
            }
            let (mut free, mut held) = (0.0, 0.0);
            for node in 0..self.plan.nodes() {
                let vector = potential + s as u32 * level.stride;
                let charge = f64::from(self.charge(vector, node)) - at(feed, s, node);
                match self.holders[node] {
                    NO_HOLDER => free += charge * charge,
                    holder if holder == s as u32 => held += charge * charge,
                    _ => {}
                }
            }
            residual = residual.max(if held > 0.0 { f64::sqrt(free / held) } else { 0.0 });
        }
        (energies, residual)
    }
}

impl RemoteFields for TwinFields {
    fn update(&mut self, changes: Changes<'_>) -> Result<(), SolveError> {
        self.twin.lock().unwrap().update(&changes);
        Ok(())
    }

    fn solve(
        &mut self,
        allowed: Option<&[f64]>,
        max_iterations: usize,
    ) -> Result<RemoteSolution, SolveError> {
        let twin = &mut *self.twin.lock().unwrap();
        let (columns, level) = (twin.plan.columns, twin.plan.levels[0]);
        twin.coarsen_all();
        twin.residual();
        let mut drops: Vec<Vec<f32>> = vec![Vec::new(); columns];
        let mut last = vec![0.0_f32; columns];
        let mut active = vec![true; columns];
        let mut to_go = vec![0.0_f32; columns];
        let mut iterations = 0;
        let max_iterations = max_iterations.min(if allowed.is_some() { usize::MAX } else { UNKNOWN });
        while active.contains(&true) && iterations < max_iterations {
            twin.cycle();
            let [before, now] = [iterations % 2, (iterations + 1) % 2].map(|which| twin.plan.steps[which]);
            for column in 0..columns {
                if !active[column] {
                    continue;
                }
                let shift = column as u32 * level.stride;
                let rz = twin.dot(level.residual + shift, level.correction + shift);
                let beta = if iterations == 0 || last[column] <= 0.0 { 0.0 } else { rz / last[column] };
                for node in 0..twin.plan.nodes() {
                    let z = twin.vectors[(level.correction + shift) as usize + node];
                    let p = twin.vectors[(before + shift) as usize + node];
                    twin.vectors[(now + shift) as usize + node] = if beta == 0.0 { z } else { z + beta * p };
                }
                for node in 0..twin.plan.nodes() {
                    let free = twin.holders[node] == NO_HOLDER;
                    let image = if free { twin.charge(now + shift, node) } else { 0.0 };
                    twin.vectors[(twin.plan.image + shift) as usize + node] = image;
                }
                let pq = twin.dot(now + shift, twin.plan.image + shift);
                let alpha = if rz > 0.0 && pq > 0.0 { rz / pq } else { 0.0 };
                for node in 0..twin.plan.nodes() {
                    let p = twin.vectors[(now + shift) as usize + node];
                    let q = twin.vectors[(twin.plan.image + shift) as usize + node];
                    twin.vectors[(twin.plan.potential + shift) as usize + node] += alpha * p;
                    twin.vectors[(level.residual + shift) as usize + node] -= alpha * q;
                }
                last[column] = rz;
                let drop = alpha * rz;
                to_go[column] = match (drop > 0.0, rz == 0.0) {
                    (true, _) => to_come(drop, drops[column].last().copied()),
                    (false, true) => 0.0,
                    (false, false) => f32::MAX,
                };
                drops[column].push(drop);
                active[column] =
                    drop > 0.0 && allowed.is_none_or(|allowed| f64::from(to_go[column]) > allowed[column]);
            }
            twin.scale_red(0);
            iterations += 1;
        }
        let (energies, residual) = twin.evaluate();
        let to_come = to_go.into_iter().map(f64::from).collect();
        Ok(RemoteSolution { energies, to_come, iterations, residual, launches: 0, found: None })
    }

    fn shape(&self) -> [usize; 2] {
        let plan = &self.twin.lock().unwrap().plan;
        [plan.nodes(), plan.columns]
    }

    fn potentials(&self, column: usize) -> Result<Vec<f32>, SolveError> {
        let twin = self.twin.lock().unwrap();
        let start = (twin.plan.potential + column as u32 * twin.plan.levels[0].stride) as usize;
        Ok(twin.vectors[start..start + twin.plan.nodes()].to_vec())
    }

    fn duplicate(&self) -> Result<Box<dyn RemoteFields>, SolveError> {
        Ok(Box::new(self.clone()))
    }
}
