//! `capsense stress`: where methods fail, as a table and as a map.

use super::interrupt::Interrupt;
use super::output::{print_out, write_whole};
use super::text::table;
use anyhow::{Context, bail};
use capsense::core::solver::available_threads;
use capsense::evidence::stress::{Map, Method, Status, Stress};
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use std::path::PathBuf;

/// Find where each method fails, and write stress.csv and stress.svg
///
/// Interface models, solvers and precisions against what breaks them: strong and weak dielectrics, slivers, narrow gaps,
/// cells that differ in size, thousands of frames, tolerances, thin and floating bodies, meshes without ground. Each field
/// of the map is ok, slow, refused with a message, inaccurate within its error bar, or wrong without notice. Takes some
/// minutes.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  capsense stress --out results")]
pub(super) struct StressArguments {
    /// Folder for the results
    #[arg(long, default_value = "capsense-out", value_name = "DIR")]
    out: PathBuf,
}

const TABLE_FILE: &str = "stress.csv";
const DRAWING_FILE: &str = "stress.svg";

pub(super) fn stress(arguments: &StressArguments) -> anyhow::Result<()> {
    let out = &arguments.out;
    let interrupt = Interrupt::listen().context("cannot listen for Ctrl-C")?;
    std::fs::create_dir_all(out).with_context(|| format!("cannot make the folder {}", out.display()))?;
    let columns = Stress::all().len();
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} stresses, {eta} left")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    let progress = ProgressBar::new(columns as u64).with_style(style);
    let map = Map::measure(available_threads(), |done| {
        progress.set_position(done as u64);
        !interrupt.requested()
    });
    progress.finish_and_clear();
    write_whole(&out.join(TABLE_FILE), &map.to_csv()?)?;
    write_whole(&out.join(DRAWING_FILE), map.to_svg()?.as_bytes())?;
    let measured = map.cells.len() / Method::all().len();
    if measured < columns {
        bail!("interrupted after {measured} of {columns} stresses, which are in {}", out.display());
    }
    print_out(&format!("{}\nWritten to {}: {TABLE_FILE}, {DRAWING_FILE}\n", summary(&map), out.display()))
}

/// For each method the number of fields of each kind.
fn summary(map: &Map) -> String {
    let names = Status::ALL.map(|status| status.name().to_owned());
    let mut rows = vec![["", ""].map(str::to_owned).into_iter().chain(names).collect::<Vec<_>>()];
    for method in Method::all() {
        let of_method = map.cells.iter().filter(|cell| cell.method == method);
        let count = |status| of_method.clone().filter(|cell| cell.status() == Some(status)).count();
        let counts = Status::ALL.map(|status| count(status).to_string());
        let names = [method.interface_name(), method.solver_name()].map(str::to_owned);
        rows.push(names.into_iter().chain(counts).collect());
    }
    table(&rows)
}
