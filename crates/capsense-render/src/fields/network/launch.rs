//! Which kernels are launched for a frame, in what order, and with how many workgroups.

use super::plan::Plan;
use super::rules::{LANES, SWEEPS};
use bytemuck::{Pod, Zeroable};
use std::ops::Range;

/// Threads of a workgroup.
pub(super) const THREADS: u32 = 256;

/// More workgroups than these do not share the finest level: each sums up what all of them found.
const MOST_TEAMS: u32 = 512;

/// From the first level of no more rows on, one workgroup goes through a cycle's coarse levels.
pub(super) const TAIL: u32 = 2_048;

/// Workgroups in one direction.
const MOST_GROUPS: u32 = 65_535;

/// What a kernel is told.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(super) struct Launch {
    pub(super) level: u32,
    pub(super) iteration: u32,
    pub(super) end: u32,
    pub(super) padding: u32,
}

/// The kernels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kernel {
    Changes,
    Empty,
    Coarsen,
    CoarsenTail,
    Residual,
    Restrict,
    Tail,
    Prolong,
    ProlongFinest,
    Direction,
    Advance,
    Evaluate,
    Collect,
}

pub(super) const KERNELS: [Kernel; 13] = [
    Kernel::Changes,
    Kernel::Empty,
    Kernel::Coarsen,
    Kernel::CoarsenTail,
    Kernel::Residual,
    Kernel::Restrict,
    Kernel::Tail,
    Kernel::Prolong,
    Kernel::ProlongFinest,
    Kernel::Direction,
    Kernel::Advance,
    Kernel::Evaluate,
    Kernel::Collect,
];

impl Kernel {
    /// Its entry point.
    pub(super) fn entry(self) -> &'static str {
        match self {
            Self::Changes => "network_changes",
            Self::Empty => "network_empty",
            Self::Coarsen => "network_coarsen",
            Self::CoarsenTail => "network_coarsen_tail",
            Self::Residual => "network_residual",
            Self::Restrict => "network_restrict",
            Self::Tail => "network_tail",
            Self::Prolong => "network_prolong",
            Self::ProlongFinest => "network_prolong_finest",
            Self::Direction => "network_direction",
            Self::Advance => "network_advance",
            Self::Evaluate => "network_evaluate",
            Self::Collect => "network_collect",
        }
    }
}

/// How the work is shared out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sharing {
    /// The first level that one workgroup goes on from; never the finest.
    pub(super) tail: usize,
    /// Workgroups that share the finest level.
    pub(super) teams: u32,
}

impl Sharing {
    /// Levels of no more rows than `tail` are one workgroup's.
    pub(super) fn of(plan: &Plan, tail: u32) -> Self {
        let last = plan.levels.len() - 1;
        let tail = (1..last).find(|&level| plan.levels[level].rows <= tail).unwrap_or(last);
        Self { tail, teams: plan.levels[0].rows.div_ceil(THREADS).clamp(1, MOST_TEAMS) }
    }

    /// What is launched from one iteration to another: kernels, what each is told, and workgroups.
    pub(super) fn launches(
        &self,
        plan: &Plan,
        iterations: Range<u32>,
        changed: u32,
        empties: bool,
    ) -> Vec<(Kernel, Launch, u32)> {
        let end = iterations.end;
        let groups = |rows: u32| rows.div_ceil(THREADS).clamp(1, MOST_GROUPS);
        let of_level = |level: usize| groups(plan.levels[level].rows);
        let none = Launch::default();
        let mut all = Vec::new();
        if iterations.start == 0 {
            all.push((Kernel::Changes, none, groups(changed)));
            if empties {
                all.push((Kernel::Empty, none, of_level(0)));
            }
            for level in 0..self.tail {
                let told = Launch { level: level as u32, ..none };
                all.push((Kernel::Coarsen, told, of_level(level + 1)));
            }
            if self.tail + 1 < plan.levels.len() {
                all.push((Kernel::CoarsenTail, none, 1));
            }
            all.push((Kernel::Residual, none, of_level(0)));
        }
        for iteration in iterations {
            let told = |level: usize| Launch { level: level as u32, iteration, end, padding: 0 };
            for level in 0..self.tail {
                let aggregates = plan.levels[level + 1].rows.div_ceil(THREADS / LANES).max(1);
                all.push((Kernel::Restrict, told(level), aggregates));
            }
            all.push((Kernel::Tail, told(self.tail), 1));
            for level in (1..self.tail).rev() {
                all.push((Kernel::Prolong, told(level), of_level(level)));
            }
            for kernel in [Kernel::ProlongFinest, Kernel::Direction, Kernel::Advance] {
                all.push((kernel, told(0), self.teams));
            }
        }
        all.push((Kernel::Evaluate, none, self.teams));
        all.push((Kernel::Collect, Launch { end, ..none }, 1));
        all
    }

    /// Bytes that the kernels of an iteration read and write, the least that they could: each array once for each kernel.
    pub(super) fn bytes_per_iteration(&self, plan: &Plan) -> u64 {
        let columns = plan.columns as u64;
        let rows = |level: usize| u64::from(plan.levels[level].rows);
        // Of each entry its weight and where it leads to.
        let product = |level: usize| 2 * plan.entry_count(level) + rows(level);
        let of_cycle = |level: usize| match level + 1 == plan.levels.len() {
            true => u64::from(SWEEPS - 1) * (product(level) + rows(level) * (1 + 3 * columns)),
            // Down: the residual, what was swept, members, and two vectors of the next level; up: both again, aggregates,
            // corrections, inverses, and what is found.
            false => {
                2 * product(level) + rows(level) * (3 + 5 * columns) + rows(level + 1) * (2 + 3 * columns)
            }
        };
        let of_cycles: u64 = (0..plan.levels.len()).map(of_cycle).sum();
        // r·z and z·K p: the image; the direction: holders, z, p, and p and its image written; the advance: x, r, p, the image,
        // what is swept.
        let of_finest =
            rows(0) * columns + product(0) + rows(0) * (1 + 4 * columns) + rows(0) * (1 + 7 * columns);
        4 * (of_cycles + of_finest)
    }
}
