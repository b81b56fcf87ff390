//! Which kernels are launched for a frame, in what order, and with how many workgroups.

use super::finder::Finding;
use super::plan::Plan;
use super::rules::SWEEPS;
use bytemuck::{Pod, Zeroable};

/// Threads of a workgroup.
const THREADS: u32 = 256;

/// More workgroups than these do not share one scene's finest level: each sums up what all of them found.
const MOST_TEAMS: u32 = 512;

/// A scene of no more nodes is one workgroup's, from the first change to the capacitances.
const WHOLE: usize = 12_000;

/// From the first level of no more nodes on, one workgroup goes through a cycle's coarse levels.
const TAIL: usize = 2_048;

/// Workgroups in one direction.
const MOST_GROUPS: u32 = 65_535;

/// What a kernel is told.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(super) struct Launch {
    pub(super) level: u32,
    /// Or a colour.
    pub(super) axis: u32,
    pub(super) iteration: u32,
    pub(super) end: u32,
}

/// The kernels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kernel {
    Empty,
    Changes,
    Coarsen,
    CoarsenTail,
    Residual,
    Relax,
    Leave,
    Restrict,
    Prolong,
    Tail,
    Rz,
    Direction,
    Advance,
    Evaluate,
    Collect,
    Whole,
    Holders,
    Rows,
    Wedges,
}

/// All of them; the last three only where objects are found on the device, and the very last where they are solids.
pub(super) const KERNELS: [Kernel; 19] = [
    Kernel::Empty,
    Kernel::Changes,
    Kernel::Coarsen,
    Kernel::CoarsenTail,
    Kernel::Residual,
    Kernel::Relax,
    Kernel::Leave,
    Kernel::Restrict,
    Kernel::Prolong,
    Kernel::Tail,
    Kernel::Rz,
    Kernel::Direction,
    Kernel::Advance,
    Kernel::Evaluate,
    Kernel::Collect,
    Kernel::Whole,
    Kernel::Holders,
    Kernel::Rows,
    Kernel::Wedges,
];

/// The kernels that need no objects.
const OF_FIELDS: usize = 16;

/// The kernels that there are.
pub(super) fn kernels(finding: Option<&Finding>) -> &'static [Kernel] {
    match finding {
        None => &KERNELS[..OF_FIELDS],
        Some(Finding { is_exact: false, .. }) => &KERNELS[..KERNELS.len() - 1],
        Some(Finding { is_exact: true, .. }) => &KERNELS,
    }
}

/// What is launched for: some iterations, and before the first of them what is told and found.
#[derive(Clone, Debug)]
pub(super) struct Work {
    pub(super) iterations: std::ops::Range<u32>,
    /// The largest number of rows that changed in a scene.
    pub(super) changed_rows: u32,
    /// Whether fields may have to start from zero.
    pub(super) empties: bool,
    /// Whether objects of a scene are to be found, and whether as solids.
    pub(super) finds: bool,
    pub(super) is_exact: bool,
}

impl Kernel {
    /// Its entry point.
    pub(super) fn entry(self) -> &'static str {
        match self {
            Self::Empty => "step_empty",
            Self::Changes => "step_changes",
            Self::Coarsen => "step_coarsen",
            Self::CoarsenTail => "step_coarsen_tail",
            Self::Residual => "step_residual",
            Self::Relax => "step_relax",
            Self::Leave => "step_leave",
            Self::Restrict => "step_restrict",
            Self::Prolong => "step_prolong",
            Self::Tail => "step_tail",
            Self::Rz => "step_rz",
            Self::Direction => "step_direction",
            Self::Advance => "step_advance",
            Self::Evaluate => "step_evaluate",
            Self::Collect => "step_collect",
            Self::Whole => "whole_scene",
            Self::Holders => "step_holders",
            Self::Rows => "step_rows",
            Self::Wedges => "step_wedges",
        }
    }
}

/// How the work on one scene is shared out. It depends on the mesh alone, so a scene's bits do not depend on others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sharing {
    /// Whether one workgroup does all.
    pub(super) is_whole: bool,
    /// The first level that one workgroup goes on from.
    pub(super) tail: usize,
    /// Workgroups that share the finest level.
    pub(super) teams: u32,
}

impl Sharing {
    pub(super) fn of(plan: &Plan) -> Self {
        let is_whole = plan.nodes() <= WHOLE;
        let last = plan.levels.len() - 1;
        let is_few = |level: &usize| plan.grids[plan.levels[*level].grid as usize].nodes as usize <= TAIL;
        let tail = (1..=last).find(is_few).unwrap_or(last);
        let teams = if is_whole { 1 } else { plan.grids[0].nodes.div_ceil(THREADS).min(MOST_TEAMS) };
        Self { is_whole, tail, teams }
    }

    /// What is launched: kernels, what each is told, and workgroups for each scene.
    pub(super) fn launches(&self, plan: &Plan, work: &Work) -> Vec<(Kernel, Launch, u32)> {
        let (first, end) = (work.iterations.start, work.iterations.end);
        let groups = |work: u32| work.div_ceil(THREADS).clamp(1, MOST_GROUPS);
        let nodes = |level: usize| plan.grids[plan.levels[level].grid as usize].nodes;
        let mut all = Vec::new();
        let none = Launch::default();
        if first == 0 && work.finds {
            // Shared out among all workgroups even where one does the rest.
            let nodes = groups(plan.grids[0].nodes);
            all.push((Kernel::Holders, none, nodes));
            if work.is_exact {
                all.push((Kernel::Wedges, none, nodes));
            }
            all.push((Kernel::Rows, none, nodes));
        }
        if self.is_whole {
            all.push((Kernel::Whole, Launch { iteration: first, end, ..none }, 1));
            return all;
        }
        if first == 0 {
            if work.changed_rows > 0 {
                all.push((Kernel::Changes, none, groups(work.changed_rows)));
            }
            if work.empties {
                all.push((Kernel::Empty, none, groups(plan.grids[0].nodes)));
            }
            for (level, transfer) in plan.transfers[..self.tail].iter().enumerate() {
                for axis in (0..3).filter(|&axis| transfer.grids[axis] != transfer.grids[axis + 1]) {
                    let coarse = plan.grids[transfer.grids[axis + 1] as usize].nodes;
                    let told = Launch { level: level as u32, axis: axis as u32, ..none };
                    all.push((Kernel::Coarsen, told, groups(coarse)));
                }
            }
            all.push((Kernel::CoarsenTail, none, 1));
            all.push((Kernel::Residual, none, groups(plan.grids[0].nodes)));
        }
        for iteration in first..end {
            let told = |level: usize, axis: u32| Launch { level: level as u32, axis, iteration, end };
            for level in 0..self.tail {
                let half = groups(nodes(level).div_ceil(2));
                all.push((Kernel::Relax, told(level, BLACK), half));
                all.push((Kernel::Leave, told(level, RED), half));
                all.push((Kernel::Restrict, told(level, 0), groups(nodes(level + 1))));
            }
            all.push((Kernel::Tail, told(0, 0), 1));
            for level in (0..self.tail).rev() {
                let half = groups(nodes(level).div_ceil(2));
                all.push((Kernel::Prolong, told(level, 0), half));
                all.push((Kernel::Relax, told(level, BLACK), half));
                all.push((Kernel::Relax, told(level, RED), half));
            }
            for kernel in [Kernel::Rz, Kernel::Direction, Kernel::Advance] {
                all.push((kernel, told(0, 0), self.teams));
            }
        }
        all.push((Kernel::Evaluate, none, self.teams));
        all.push((Kernel::Collect, Launch { end, ..none }, 1));
        all
    }

    /// Bytes that the kernels of an iteration read and write of the finest level, the least that they could: each array
    /// once for each kernel.
    pub(super) fn bytes_per_iteration(&self, plan: &Plan) -> u64 {
        let columns = plan.columns as u64;
        let of_level = |level: usize| u64::from(plan.grids[plan.levels[level].grid as usize].nodes);
        let of_cycle = |level: usize| match level + 1 == plan.levels.len() {
            // A sweep over both colours reads the network, r and z, and writes z.
            true => of_level(level) * 2 * SWEEPS as u64 * (4 + 2 * columns),
            // Relaxed twice on the way down (half of the nodes each) and thrice on the way up; what goes up and down.
            false => of_level(level) * (3 * 4 + 8 * columns) + of_level(level + 1) * (4 + 3 * columns),
        };
        let of_cycles: u64 = (0..plan.levels.len()).map(of_cycle).sum();
        // r·z: two vectors; the direction: network, holders, leak, z, p, and p and its image written; the advance: network, x
        // and r, p and the image, z.
        let of_finest = of_level(0) * (2 * columns + (6 + 4 * columns) + (4 + 7 * columns));
        4 * (of_cycles + of_finest)
    }
}

const RED: u32 = 0;
const BLACK: u32 = 1;
