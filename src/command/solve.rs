//! `capsense solve`: one frame, with error bars.

use super::bars::BarLog;
use super::contacts::{ContactLog, print_warnings};
use super::output::print_out;
use super::text::{Prefix, table};
use super::{BadInput, load_scene};
use capsense::core::capacitance::CapacitanceMatrix;
use capsense::core::estimate::ErrorBars;
use capsense::pipeline::Milliseconds;
use capsense::run_folder::MeshSize;
use capsense::{Frame, Pipeline, Scene};
use clap::Args;
use serde::Serialize;
use std::path::PathBuf;

/// Solve one frame of a scene and print its Maxwell capacitance matrix with error bars
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  capsense solve scene.toml\n  capsense solve scene.toml --frame 100 --json"
)]
pub(super) struct SolveArguments {
    /// The scene file
    scene: PathBuf,
    /// Print one JSON object instead of tables
    #[arg(long)]
    json: bool,
    /// Number of the frame, from 0
    #[arg(long, default_value_t = 0, value_name = "N")]
    frame: usize,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Solved<'a> {
    terminals: &'a [String],
    capacitance_farads: Vec<&'a [f64]>,
    /// `null` where they cannot be told, as the next but one.
    error_farads: Option<Vec<&'a [f64]>>,
    change_farads: Vec<&'a [f64]>,
    change_error_farads: Option<Vec<&'a [f64]>>,
    base_farads: Vec<&'a [f64]>,
    mesh: MeshSize,
    solver: SolverSummary,
    milliseconds: Milliseconds,
}

#[derive(Serialize)]
struct SolverSummary {
    iterations: usize,
    relative_error: f64,
    preconditioner: &'static str,
    device: String,
}

pub(super) fn solve(arguments: &SolveArguments) -> anyhow::Result<()> {
    let scene = load_scene(Some(&arguments.scene))?;
    if arguments.frame >= scene.frames {
        let message = format!(
            "--frame {}: {} has frames 0 to {}",
            arguments.frame,
            arguments.scene.display(),
            scene.frames - 1
        );
        return Err(BadInput(message).into());
    }
    let mut pipeline = Pipeline::new(&scene)?;
    let frame = pipeline.frame(arguments.frame)?;
    let mut contacts = ContactLog::default();
    contacts.note(arguments.frame, &mut pipeline);
    let mut bars = BarLog::new(&scene, &pipeline);
    bars.tell(&scene, &mut pipeline, &frame);
    let warnings: Vec<String> =
        contacts.warnings(&scene).into_iter().chain(bars.warning().cloned()).collect();
    print_warnings(&warnings);
    let bars = bars.last();
    let change = frame.capacitance.minus(pipeline.simulator().base());
    if arguments.json {
        let solved = Solved {
            terminals: &scene.electrodes,
            capacitance_farads: frame.capacitance.rows().collect(),
            error_farads: bars.map(|bars| bars.capacitance.rows().collect()),
            change_farads: change.rows().collect(),
            change_error_farads: bars.map(|bars| bars.change.rows().collect()),
            base_farads: pipeline.simulator().base().rows().collect(),
            mesh: MeshSize::of(pipeline.simulator().sensor().mesh()),
            solver: SolverSummary {
                iterations: frame.solve.iterations,
                relative_error: frame.solve.relative_error,
                preconditioner: pipeline.simulator().preconditioner().name(),
                device: pipeline.device(),
            },
            milliseconds: frame.milliseconds,
        };
        print_out(&(serde_json::to_string(&solved)? + "\n"))
    } else {
        print_out(&readable(&scene, &pipeline, &frame, bars))
    }
}

fn readable(scene: &Scene, pipeline: &Pipeline, frame: &Frame, bars: Option<&ErrorBars>) -> String {
    let names = &scene.electrodes;
    let file = scene.source.file();
    let mut text = format!("Frame {} of {} at {:.4} s, {file}\n\n", frame.index, scene.frames, frame.time_s);
    let unit = Prefix::for_magnitude(largest(&frame.capacitance));
    let said = if bars.is_some() { ", with error bars that hold nine of ten errors" } else { "" };
    text += &format!("Maxwell capacitance matrix in {}{said}:\n", unit.symbol);
    text += &matrix(names, |row, column| {
        let error = bars.map(|bars| format!(" ± {:.5}", unit.of(bars.capacitance.get(row, column))));
        format!("{:.5}{}", unit.of(frame.capacitance.get(row, column)), error.unwrap_or_default())
    });
    if !scene.objects.is_empty() {
        let change = frame.capacitance.minus(pipeline.simulator().base());
        // Nothing may be left of a body, and all of it in the bars.
        let bar = bars.map_or(0.0, |bars| largest(&bars.change));
        let unit = Prefix::for_magnitude(largest(&change).max(bar));
        text += &format!("\nChange by the objects in {}:\n", unit.symbol);
        text += &matrix(names, |row, column| {
            let error = bars.map(|bars| format!(" ± {:.4}", unit.of(bars.change.get(row, column))));
            format!("{:+.4}{}", unit.of(change.get(row, column)), error.unwrap_or_default())
        });
    }
    let size = MeshSize::of(pipeline.simulator().sensor().mesh());
    let took = frame.milliseconds;
    text += &format!("\nMesh: {} tetrahedra, {} nodes\n", size.tets, size.nodes);
    text += &format!(
        "Solver: {} iterations ({}, {}), relative error {:.1e}\n",
        frame.solve.iterations,
        pipeline.simulator().preconditioner().name(),
        pipeline.device(),
        frame.solve.relative_error
    );
    text += &format!(
        "Time: {:.2} ms = geometry {:.2} + update {:.2} + solve {:.2}\n",
        took.total, took.geometry, took.update, took.solve
    );
    text
}

fn matrix(names: &[String], cell: impl Fn(usize, usize) -> String) -> String {
    let header = std::iter::once(String::new()).chain(names.iter().cloned()).collect();
    let rows = names.iter().enumerate().map(|(row, name)| {
        std::iter::once(name.clone()).chain((0..names.len()).map(|column| cell(row, column))).collect()
    });
    table(&std::iter::once(header).chain(rows).collect::<Vec<_>>())
}

fn largest(matrix: &CapacitanceMatrix) -> f64 {
    matrix.rows().flatten().fold(0.0, |most, farads| farads.abs().max(most))
}
