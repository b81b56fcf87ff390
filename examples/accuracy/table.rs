//! `accuracy table`: errors against the references, as Markdown.

use crate::cases::{Body, CONNECTIONS, ENTRIES, Entries, bodies, few_bodies, stripes};
use crate::measure::{Measured, measure};
use crate::references::References;
use anyhow::{Context, Result, ensure};
use capsense::Scene;
use capsense::core::sensor::Sensor;
use clap::Args;
use std::fmt::Write as _;
use std::path::PathBuf;

const SIZES: [usize; 3] = [30_000, 130_000, 800_000];
const QUICK_SIZES: [usize; 2] = [10_000, 30_000];

/// Errors of capacitances, and of their changes by bodies, on lattices of several sizes
#[derive(Args, Debug, Default)]
pub(crate) struct TableArguments {
    /// Only small lattices and few bodies
    #[arg(long)]
    quick: bool,
    /// A scene with the same three stripes on another mesh, for one more table
    #[arg(long, value_name = "FILE.toml")]
    scene: Option<PathBuf>,
}

/// Prints one table after the other.
pub(crate) fn table(arguments: &TableArguments) -> Result<()> {
    let references = References::load()?;
    let (sizes, bodies) =
        if arguments.quick { (&QUICK_SIZES[..], few_bodies()) } else { (&SIZES[..], bodies()) };
    println!("Errors in percent of the references: of C in the empty scene, and of its changes by bodies.");
    let print = |mesh: &str, sensor: &Sensor| -> Result<()> {
        let errors = measure(sensor, &bodies)?.errors(&bodies, &references)?;
        let tets = sensor.mesh().tets().len();
        println!("\n**{mesh}, {tets} tetrahedra**\n\n{}", markdown(&bodies, &errors));
        Ok(())
    };
    for &size in sizes {
        let design = stripes();
        print("Lattice", &Sensor::on_lattice(&design, &design.lattice(size)?)?)?;
    }
    if let Some(path) = &arguments.scene {
        let scene = Scene::load(path)?;
        scene.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
        let sensor = scene.build_sensor()?;
        ensure!(sensor.electrode_names().len() == 3, "{}: three electrodes are needed", path.display());
        let name = path.file_name().context("the scene is no file")?;
        print(&name.display().to_string(), &sensor)?;
    }
    Ok(())
}

/// A row for the empty scene, one for each body, and the median over all bodies.
fn markdown(bodies: &[Body], errors: &Measured) -> String {
    let mut text = "| |".to_owned();
    for (connection, _) in CONNECTIONS {
        for (entry, ..) in ENTRIES {
            let _ = write!(text, " {entry} {connection} |");
        }
    }
    let columns = CONNECTIONS.len() * ENTRIES.len();
    let _ = writeln!(text, "\n|---|{}", "---:|".repeat(columns));
    let blank = " |".repeat(columns - ENTRIES.len());
    let _ = writeln!(text, "| nothing |{}{blank}", cells(&errors.empty));
    for (body, changes) in bodies.iter().zip(&errors.changes) {
        let _ = writeln!(text, "| {} |{}", body.name, changes.iter().map(cells).collect::<String>());
    }
    let medians = (0..CONNECTIONS.len()).map(|connection| {
        let all = errors.changes.iter().map(|changes| changes[connection]);
        cells(&median(all))
    });
    let _ = write!(text, "| median size for bodies |{}", medians.collect::<String>());
    text
}

fn cells(errors: &Entries) -> String {
    errors.iter().map(|error| format!(" {error:.2} |")).collect()
}

/// The median of the sizes of errors: a mean would tell of nothing but the smallest changes.
fn median(rows: impl Iterator<Item = Entries> + Clone) -> Entries {
    std::array::from_fn(|entry| {
        let mut sizes: Vec<f64> = rows.clone().map(|row| row[entry].abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let half = sizes.len() / 2;
        if sizes.len() % 2 == 1 { sizes[half] } else { 0.5 * (sizes[half - 1] + sizes[half]) }
    })
}
