//! The kernels' source, with the numbers that they need to know when they are compiled.

use super::launch::THREADS;
use super::plan::MOST_LEVELS;
use super::rules::{CAUTION, LANES, LEAST_RATIO, OMEGA, OVERCORRECTION, SWEEPS};
use crate::fields::device::MOST_ITERATIONS;
use crate::fields::iteration::MOST_RATIO;

/// The kernels for so many columns, of which so many workgroups share the finest level.
pub(super) fn source(columns: usize, teams: u32) -> String {
    let (least, largest, aggregates) = (f32::MIN_POSITIVE, f32::MAX, THREADS / LANES);
    let constants = format!(
        "const COLUMNS: u32 = {columns}u;
const TEAMS: u32 = {teams}u;
const MOST_LEVELS: u32 = {MOST_LEVELS}u;
const LEAST: f32 = {least:e}f;
const LARGEST: f32 = {largest:e}f;
const OMEGA: f32 = {OMEGA}f;
const OVERCORRECTION: f32 = {OVERCORRECTION}f;
const SWEEPS: u32 = {SWEEPS}u;
const LANES: u32 = {LANES}u;
const AGGREGATES: u32 = {aggregates}u;
const CAUTION: f32 = {CAUTION}f;
const LEAST_RATIO: f32 = {LEAST_RATIO}f;
const MOST_RATIO: f32 = {MOST_RATIO}f;
const OF_MIXED: u32 = OF_RECORDS + {MOST_ITERATIONS}u * COLUMNS * 4u + COLUMNS * 4u;
"
    );
    let files = [
        include_str!("common.wgsl"),
        include_str!("../sums.wgsl"),
        include_str!("networks.wgsl"),
        include_str!("cycle.wgsl"),
        include_str!("iteration.wgsl"),
        include_str!("steps.wgsl"),
    ];
    constants + &files.join("\n")
}

#[cfg(test)]
mod tests {
    use super::super::launch::KERNELS;
    use super::*;

    /// Needs no GPU: the kernels are valid WGSL, and there is one for each step.
    #[test]
    fn the_kernels_of_networks_are_valid() {
        for (columns, teams) in [(1, 1), (3, 512), (31, 7)] {
            let module = naga::front::wgsl::parse_str(&source(columns, teams)).unwrap();
            let flags = naga::valid::ValidationFlags::all();
            let mut validator = naga::valid::Validator::new(flags, naga::valid::Capabilities::empty());
            validator.validate(&module).unwrap();
            let mut entries: Vec<_> = module.entry_points.iter().map(|entry| entry.name.as_str()).collect();
            let mut named = KERNELS.map(|kernel| kernel.entry()).to_vec();
            entries.sort_unstable();
            named.sort_unstable();
            assert_eq!(entries, named);
            // Pipelines are found by a kernel's number.
            assert!(KERNELS.iter().enumerate().all(|(number, kernel)| *kernel as usize == number));
        }
    }
}
