//! `capsense chart`: speed against accuracy of every method and mesh size.

use super::BadInput;
use super::interrupt::Interrupt;
use super::output::{print_out, write_whole};
use super::text::table;
use anyhow::{Context, anyhow, bail};
use capsense::evidence::chart::{draw, mark_front};
use capsense::evidence::measure::measure;
use capsense::evidence::reference::{BUILT_IN, Provenance, Reference, ReferenceMethod};
use capsense::evidence::setting::Setting;
use capsense::evidence::stage::{SEGMENTS, Stage};
use capsense::evidence::table::{Row, from_csv, to_csv};
use capsense::evidence::{EvidenceError, ladder};
use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::path::{Path, PathBuf};

const TABLE_FILE: &str = "chart.csv";
const DRAWING_FILE: &str = "chart.svg";
const REFERENCE_FILE: &str = "references/steel_bar.json";

/// Measure speed against accuracy and write chart.csv and chart.svg
///
/// A grounded bar moves past three stripe electrodes and towards them, 20 to 200 mm away. Every method, interface model,
/// preconditioner and tolerance is run on meshes of 3,000 to 1,000,000 tetrahedra, one thread: a few minutes. Changes of C are
/// compared with a converged reference, which comes with the program; where it does not fit the program, it is computed first,
/// which takes several minutes, and kept in DIR/references.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  capsense chart --quick\n  capsense chart --out results --resume")]
pub(super) struct ChartArguments {
    /// Folder for the results
    #[arg(long, default_value = "capsense-out", value_name = "DIR")]
    out: PathBuf,
    /// Fewer settings on meshes of at most 100,000 tetrahedra: less than two minutes
    #[arg(long)]
    quick: bool,
    /// Keep the rows of DIR/chart.csv that this version of the program has measured, as after Ctrl-C
    #[arg(long)]
    resume: bool,
}

pub(super) fn chart(arguments: &ChartArguments) -> anyhow::Result<()> {
    let out = &arguments.out;
    let interrupt = Interrupt::listen().context("cannot listen for Ctrl-C")?;
    let stage = Stage::new(&SEGMENTS)?;
    let kept = if arguments.resume { kept_rows(&out.join(TABLE_FILE))? } else { Vec::new() };
    let found = find_reference(out, &stage)?;
    std::fs::create_dir_all(out).with_context(|| format!("cannot make the folder {}", out.display()))?;
    let Some(reference) = complete_reference(out, &stage, found, &interrupt)? else {
        bail!("interrupted while the reference was computed; {REFERENCE_FILE} has what there is of it");
    };
    let settings = if arguments.quick { ladder::quick() } else { ladder::full() };
    let rows = measure_all(&stage, &settings, &reference, kept, &interrupt)?;
    let measured = rows.len();
    write_results(out, rows, arguments)?;
    if measured < settings.len() {
        bail!(
            "interrupted after {measured} of {} settings, which are in {}; --resume measures the others",
            settings.len(),
            out.display()
        );
    }
    Ok(())
}

/// The rows measured so far; none where there is no table.
fn kept_rows(path: &Path) -> anyhow::Result<Vec<Row>> {
    if !path.exists() {
        return Ok(Vec::new());
    }
    let text = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    from_csv(&text).map_err(|error| {
        BadInput(format!("{}: {error}; without --resume it is written anew", path.display())).into()
    })
}

/// What is in the folder or else comes with the program, if it fits; as far as it has been computed.
fn find_reference(out: &Path, stage: &Stage) -> anyhow::Result<Reference> {
    let wanted = Provenance::of(stage, ReferenceMethod::STANDARD);
    let path = out.join(REFERENCE_FILE);
    if path.exists() {
        let text =
            std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
        let kept = Reference::read(&text, stage, &wanted)
            .map_err(|error| BadInput(format!("{}: {error}", path.display())))?;
        match kept {
            Some(kept) => return Ok(kept),
            None => eprintln!("{} is of another program or scene and is not used", path.display()),
        }
    }
    let built_in =
        Reference::read(BUILT_IN, stage, &wanted).context("the reference that comes with the program")?;
    Ok(built_in.unwrap_or_else(|| Reference::begin(stage, ReferenceMethod::STANDARD)))
}

/// Computes the poses that are missing, and keeps each at once; none when Ctrl-C comes before the last.
fn complete_reference(
    out: &Path,
    stage: &Stage,
    mut reference: Reference,
    interrupt: &Interrupt,
) -> anyhow::Result<Option<Reference>> {
    let path = out.join(REFERENCE_FILE);
    let progress = progress_bar(Reference::wanted(stage), "poses of the reference");
    progress.set_position(reference.values.len() as u64);
    while reference.values.len() < Reference::wanted(stage) {
        if interrupt.requested() {
            return Ok(None);
        }
        reference.add_next(stage).context("cannot compute the reference")?;
        let folder = path.parent().unwrap_or(out);
        std::fs::create_dir_all(folder)
            .with_context(|| format!("cannot make the folder {}", folder.display()))?;
        write_whole(&path, reference.to_json()?.as_bytes())?;
        progress.inc(1);
    }
    progress.finish_and_clear();
    Ok(Some(reference))
}

/// Those of the settings, in their order, up to the first that Ctrl-C prevents.
fn measure_all(
    stage: &Stage,
    settings: &[Setting],
    reference: &Reference,
    mut kept: Vec<Row>,
    interrupt: &Interrupt,
) -> Result<Vec<Row>, EvidenceError> {
    let progress = progress_bar(settings.len(), "settings");
    let mut rows = Vec::with_capacity(settings.len());
    for setting in settings {
        let row = match kept.iter().position(|row| row.is_of(setting)) {
            Some(index) => kept.swap_remove(index),
            None => match measure(stage, setting, reference, &|| interrupt.requested())? {
                Some(row) => row,
                None => break,
            },
        };
        progress.set_message(setting_text(&row));
        progress.inc(1);
        rows.push(row);
    }
    progress.finish_and_clear();
    Ok(rows)
}

/// Nothing is drawn when standard error is no terminal.
fn progress_bar(count: usize, what: &str) -> ProgressBar {
    let style =
        ProgressStyle::with_template(&format!("{{bar:30}} {{pos}}/{{len}} {what}, {{eta}} left  {{msg}}"))
            .unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::with_draw_target(Some(count as u64), ProgressDrawTarget::stderr()).with_style(style)
}

fn write_results(out: &Path, mut rows: Vec<Row>, arguments: &ChartArguments) -> anyhow::Result<()> {
    mark_front(&mut rows);
    write_whole(&out.join(TABLE_FILE), &to_csv(&rows)?)?;
    let drawing = draw(&rows).map_err(|error| anyhow!("cannot draw the chart: {error}"))?;
    write_whole(&out.join(DRAWING_FILE), drawing.as_bytes())?;
    let written = format!("Written to {}: {TABLE_FILE}, {DRAWING_FILE}", arguments.out.display());
    print_out(&format!("{}\n{written}\n", summary(&rows)))
}

fn setting_text(row: &Row) -> String {
    let mesh = format!("{} {}", row.mesh, row.asked);
    [&row.method, &mesh, &row.interface, &row.geometry, &row.storage, &row.preconditioner]
        .map(String::as_str)
        .join(", ")
}

/// The settings that nothing beats, and those that failed.
fn summary(rows: &[Row]) -> String {
    let mut front: Vec<&Row> = rows.iter().filter(|row| row.on_front).collect();
    front.sort_by(|a, b| a.median_ms.partial_cmp(&b.median_ms).unwrap_or(std::cmp::Ordering::Equal));
    let head = [
        "nothing is both faster and more exact than",
        "tolerance",
        "tetrahedra",
        "ms a frame",
        "error of ΔC [%]",
    ];
    let number = |value: Option<f64>| value.map_or(String::new(), |value| format!("{value:.3}"));
    let cells = front.iter().map(|row| {
        vec![
            setting_text(row),
            format!("{:e}", row.tolerance),
            row.tets.map_or(String::new(), |tets| tets.to_string()),
            number(row.median_ms),
            number(row.rms_error_percent),
        ]
    });
    let cells: Vec<Vec<String>> = std::iter::once(head.map(str::to_owned).to_vec()).chain(cells).collect();
    let mut text = table(&cells);
    for row in rows {
        if let Some(failure) = &row.failure {
            text += &format!("{}: {failure}\n", setting_text(row));
        }
    }
    text
}
