//! `capsense solve`: one frame, with error bars.

use super::text::{Prefix, table};
use super::{BadInput, load_scene};
use capsense::core::capacitance::CapacitanceMatrix;
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
    error_farads: Vec<&'a [f64]>,
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
    let error = pipeline.simulator().error_estimate(&frame.solve);
    if arguments.json {
        let solved = Solved {
            terminals: &scene.electrodes,
            capacitance_farads: frame.capacitance.rows().collect(),
            error_farads: error.rows().collect(),
            base_farads: pipeline.simulator().base().rows().collect(),
            mesh: MeshSize::of(pipeline.simulator().sensor().mesh()),
            solver: SolverSummary {
                iterations: frame.solve.iterations,
                relative_error: frame.solve.relative_error,
                preconditioner: preconditioner_name(&scene),
            },
            milliseconds: frame.milliseconds,
        };
        println!("{}", serde_json::to_string(&solved)?);
    } else {
        print_readable(&scene, &pipeline, &frame, &error);
    }
    Ok(())
}

fn print_readable(scene: &Scene, pipeline: &Pipeline, frame: &Frame, error: &CapacitanceMatrix) {
    let base = pipeline.simulator().base();
    let names = &scene.electrodes;
    println!("Frame {} of {} at {:.4} s, {}\n", frame.index, scene.frames, frame.time_s, scene.source.file());
    let unit = Prefix::for_magnitude(largest(&frame.capacitance));
    println!("Maxwell capacitance matrix in {}, with the estimated error:", unit.symbol);
    print!(
        "{}",
        matrix(names, |row, column| format!(
            "{:.5} ± {:.5}",
            unit.of(frame.capacitance.get(row, column)),
            unit.of(error.get(row, column))
        ))
    );
    let change = |row, column| frame.capacitance.get(row, column) - base.get(row, column);
    let most = (0..names.len()).flat_map(|row| (0..names.len()).map(move |column| change(row, column).abs()));
    let unit = Prefix::for_magnitude(most.fold(0.0, f64::max));
    println!("\nChange by the objects in {}:", unit.symbol);
    print!("{}", matrix(names, |row, column| format!("{:+.4}", unit.of(change(row, column)))));
    let size = MeshSize::of(pipeline.simulator().sensor().mesh());
    let took = frame.milliseconds;
    println!("\nMesh: {} tetrahedra, {} nodes", size.tets, size.nodes);
    println!(
        "Solver: {} iterations ({}), relative error {:.1e}",
        frame.solve.iterations,
        preconditioner_name(scene),
        frame.solve.relative_error
    );
    println!(
        "Time: {:.2} ms = geometry {:.2} + update {:.2} + solve {:.2}",
        took.total, took.geometry, took.update, took.solve
    );
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

/// What the preconditioner is called in scene files.
pub(super) fn preconditioner_name(scene: &Scene) -> &'static str {
    use capsense::core::solver::Preconditioner;
    match scene.solver.preconditioner {
        Preconditioner::Jacobi => "jacobi",
        Preconditioner::None => "none",
    }
}
