//! The kernels' source, with the numbers that they need to know when they are compiled.

use super::device::HEADER;
use super::finder::Finding;
use super::iteration::{CAUTION, LEAST_RATIO, MOST_RATIO};
use super::plan::{MOST_GRIDS, MOST_LEVELS};
use super::rules::{FIXED, OVERCORRECTION, ROUNDING, SWEEPS};
use super::solids;

/// The kernels for so many columns, of which so many workgroups share a scene's finest level, with those that find objects if
/// these are found on the device.
pub(super) fn source(columns: usize, teams: u32, finding: Option<Finding>) -> String {
    let (least, largest) = (f32::MIN_POSITIVE, f32::MAX);
    let constants = format!(
        "const COLUMNS: u32 = {columns}u;
const TEAMS: u32 = {teams}u;
const HEADER: u32 = {HEADER}u;
const MOST_GRIDS: u32 = {MOST_GRIDS}u;
const MOST_LEVELS: u32 = {MOST_LEVELS}u;
const FIXED: f32 = {FIXED:e}f;
const LEAST: f32 = {least:e}f;
const LARGEST: f32 = {largest:e}f;
const ROUNDING: f32 = {ROUNDING:e}f;
const OVERCORRECTION: f32 = {OVERCORRECTION}f;
const SWEEPS: u32 = {SWEEPS}u;
const CAUTION: f32 = {CAUTION}f;
const LEAST_RATIO: f32 = {LEAST_RATIO}f;
const MOST_RATIO: f32 = {MOST_RATIO}f;
"
    );
    let files = [
        include_str!("common.wgsl"),
        include_str!("sums.wgsl"),
        include_str!("networks.wgsl"),
        include_str!("cycle.wgsl"),
        include_str!("iteration.wgsl"),
        include_str!("steps.wgsl"),
    ];
    let of_objects = match finding {
        None => "fn absent_columns() -> u32 { return 0u; }".to_owned(),
        Some(finding) => {
            let Finding { objects, has_lines, has_strong, is_exact } = finding;
            let (object_words, found_words) = (finding.object_words(), finding.found_words());
            let constants = format!(
                "const OBJECTS: u32 = {objects}u;
const OBJECT_WORDS: u32 = {object_words}u;
const FOUND: u32 = {found_words}u;
const HAS_LINES: bool = {has_lines};
const HAS_STRONG: bool = {has_strong};
const IS_EXACT: bool = {is_exact};
"
            );
            let source = match is_exact {
                true => solids::source() + include_str!("solids/found_solids.wgsl"),
                false => {
                    let files = [
                        include_str!("depth_layers.wgsl"),
                        include_str!("right_angle.wgsl"),
                        include_str!("camera_wall.wgsl"),
                    ];
                    files.join("\n")
                }
            };
            let files = [&source, include_str!("edge_rule.wgsl"), include_str!("occupancy.wgsl")];
            constants + &files.join("\n")
        }
    };
    constants + &files.join("\n") + &of_objects
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fields::launch::{KERNELS, kernels};

    /// Needs no GPU: the kernels are valid WGSL, and there is one for each step.
    #[test]
    fn the_kernels_are_valid() {
        let finding = |objects, has_lines, is_exact| {
            Some(Finding { objects, has_lines, has_strong: has_lines && is_exact, is_exact })
        };
        let all = [
            (1, 1, None),
            (3, 512, None),
            (31, 7, None),
            (1, 1, finding(1, false, false)),
            (1, 1, finding(1, false, true)),
            (3, 512, finding(2, true, true)),
            (31, 7, finding(16, true, false)),
            (31, 7, finding(16, true, true)),
        ];
        for (columns, teams, finding) in all {
            let source = source(columns, teams, finding);
            let module = match naga::front::wgsl::parse_str(&source) {
                Ok(module) => module,
                Err(error) => panic!("{}", error.emit_to_string(&source)),
            };
            let flags = naga::valid::ValidationFlags::all();
            let mut validator = naga::valid::Validator::new(flags, naga::valid::Capabilities::empty());
            if let Err(error) = validator.validate(&module) {
                panic!("{}", error.emit_to_string(&source));
            }
            let kernels = kernels(finding.as_ref());
            let mut entries: Vec<_> = module.entry_points.iter().map(|entry| entry.name.as_str()).collect();
            let mut named: Vec<_> = kernels.iter().map(|kernel| kernel.entry()).collect();
            entries.sort_unstable();
            named.sort_unstable();
            assert_eq!(entries, named);
            // Pipelines are found by a kernel's number.
            assert!(KERNELS.iter().enumerate().all(|(number, kernel)| *kernel as usize == number));
        }
    }
}
