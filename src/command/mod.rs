//! The subcommands and what they share: arguments and exit codes.

mod bars;
mod chart;
mod compare;
mod contacts;
mod curves;
mod device;
mod device_profile;
mod export;
mod interrupt;
mod measured;
mod mesh;
mod mesh_info;
mod output;
mod ports;
mod record;
mod recover;
mod replay;
mod report;
mod run;
mod solve;
mod stress;
mod text;

use capsense::curve_table::CurveTableError;
use capsense::{PipelineError, Scene, SceneError};
use clap::{Parser, Subcommand};
use std::path::Path;

/// Simulates capacitive proximity sensors: what every electrode pair measures while objects move nearby.
#[derive(Debug, Parser)]
#[command(version, after_help = "Example:\n  capsense run\n  capsense run scene.toml --out results")]
pub(crate) struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Run(run::RunArguments),
    Solve(solve::SolveArguments),
    Mesh(mesh::MeshArguments),
    Chart(chart::ChartArguments),
    Compare(compare::CompareArguments),
    Stress(stress::StressArguments),
    Ports(ports::PortsArguments),
    Record(record::RecordArguments),
    Replay(replay::ReplayArguments),
    Recover(recover::RecoverArguments),
    Export(export::ExportArguments),
    Device(device::DeviceArguments),
}

impl Arguments {
    pub(crate) fn run(self) -> anyhow::Result<()> {
        match self.command {
            Command::Run(arguments) => run::run(&arguments),
            Command::Solve(arguments) => solve::solve(&arguments),
            Command::Mesh(arguments) => mesh::mesh(&arguments),
            Command::Chart(arguments) => chart::chart(&arguments),
            Command::Compare(arguments) => compare::compare(&arguments),
            Command::Stress(arguments) => stress::stress(&arguments),
            Command::Ports(arguments) => ports::ports(&arguments),
            Command::Record(arguments) => record::record(&arguments),
            Command::Replay(arguments) => replay::replay(&arguments),
            Command::Recover(arguments) => recover::recover(&arguments),
            Command::Export(arguments) => export::export(&arguments),
            Command::Device(arguments) => device::device(&arguments),
        }
    }
}

/// An argument or a file that the user must mend.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct BadInput(String);

/// 2 for bad input, 1 for everything else.
pub(crate) fn exit_code(error: &anyhow::Error) -> u8 {
    let of_scene = |error: &PipelineError| matches!(error, PipelineError::Scene(_));
    let bad_input = error.chain().any(|cause| {
        cause.is::<SceneError>()
            || cause.is::<CurveTableError>()
            || cause.is::<BadInput>()
            || cause.downcast_ref::<PipelineError>().is_some_and(of_scene)
    });
    if bad_input { 2 } else { 1 }
}

/// An error and its causes, without those that the message before them quotes.
pub(crate) fn message(error: &anyhow::Error) -> String {
    let mut parts: Vec<String> = Vec::new();
    for cause in error.chain().map(ToString::to_string) {
        if parts.last().is_none_or(|before| !before.ends_with(&cause)) {
            parts.push(cause);
        }
    }
    parts.join(": ")
}

/// Reads a scene, or takes the built-in one, and prints its warnings.
fn load_scene(path: Option<&Path>) -> Result<Scene, SceneError> {
    let scene = path.map_or_else(Scene::built_in, Scene::load)?;
    contacts::print_warnings(&scene.warnings);
    Ok(scene)
}

#[cfg(test)]
mod tests {
    use super::message;
    use anyhow::anyhow;

    #[test]
    fn causes_are_told_once() {
        #[derive(Debug, thiserror::Error)]
        #[error("cannot draw: {0}")]
        struct Quoting(#[from] std::fmt::Error);

        let cause = std::fmt::Error.to_string();
        let quoting = anyhow::Error::new(Quoting(std::fmt::Error)).context("frame 3 failed");
        assert_eq!(message(&quoting), format!("frame 3 failed: cannot draw: {cause}"));
        let apart = anyhow!("no space left").context("cannot write a.csv");
        assert_eq!(message(&apart), "cannot write a.csv: no space left");
    }
}
