//! `capsense run`: all frames of a scene, to curves and a report.

use super::bars::BarLog;
use super::contacts::{ContactLog, print_warnings};
use super::curves::curves;
use super::interrupt::Interrupt;
use super::load_scene;
use super::measured::MeasurementLog;
use super::output::{print_out, write_whole};
use super::report::{Report, Spread};
use super::text::{Prefix, table};
use anyhow::{Context, bail};
use capsense::core::capacitance::upper_triangle;
use capsense::frame_table::{FrameRow, frame_table};
use capsense::run_folder::{CURVES_FILE, DRAWING_FILE, REPORT_FILE, RunOrigin};
use capsense::{Frame, Pipeline, PipelineError, Scene};
use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Run a scene and write capacitance.csv, capacitance.svg and report.json
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  capsense run\n  capsense run scene.toml --out results --quiet")]
pub(super) struct RunArguments {
    /// The scene file; without one, a steel bar sweeps past three stripe electrodes
    scene: Option<PathBuf>,
    /// Folder for the results
    #[arg(long, default_value = "capsense-out", value_name = "DIR")]
    out: PathBuf,
    /// No progress bar and no summary
    #[arg(long)]
    quiet: bool,
}

pub(super) fn run(arguments: &RunArguments) -> anyhow::Result<()> {
    let scene = load_scene(arguments.scene.as_deref())?;
    let out = &arguments.out;
    let interrupt = Interrupt::listen().context("cannot listen for Ctrl-C")?;
    std::fs::create_dir_all(out).with_context(|| format!("cannot make the folder {}", out.display()))?;
    let started = Instant::now();
    let mut pipeline = Pipeline::new(&scene)?;
    let setup = started.elapsed().as_secs_f64() * 1e3;
    let mut bars = BarLog::new(&scene, &pipeline);
    let mut measured = MeasurementLog::new(&scene, &pipeline)?;
    let mesh = pipeline.simulator().sensor().mesh();
    let origin = RunOrigin::new(&scene, arguments.scene.as_deref(), mesh)
        .context("cannot tell where the scene file is")?;
    let progress = progress_bar(scene.frames, arguments.quiet);
    let mut frames = Vec::with_capacity(scene.frames);
    let mut contacts = ContactLog::default();
    let mut failure: Option<PipelineError> = None;
    while frames.len() < scene.frames && !interrupt.requested() && failure.is_none() {
        match pipeline.frame(frames.len()) {
            Ok(frame) => {
                contacts.note(frame.index, &mut pipeline);
                bars.note(&scene, &mut pipeline, &frame);
                measured.note(&frame);
                frames.push(frame);
            }
            Err(error) => failure = Some(error),
        }
        progress.inc(1);
    }
    progress.finish_and_clear();
    let found: Vec<String> = contacts.warnings(&scene).into_iter().chain(bars.warning().cloned()).collect();
    print_warnings(&found);
    let warnings = [scene.warnings.as_slice(), &found].concat();
    let complete = frames.len() == scene.frames;
    write_results(
        out,
        &scene,
        &pipeline,
        &frames,
        &measured,
        &Report::new(origin, &scene, &pipeline, &frames, setup, !complete)
            .with_error_bars(&bars)
            .with_measurement(measured.report(&scene))
            .with_warnings(warnings),
    )?;
    if let Some(error) = failure {
        let message = format!("frame {} failed; the frames before it are in {}", frames.len(), out.display());
        return Err(anyhow::Error::new(error).context(message));
    }
    if !complete {
        bail!(
            "interrupted after {} of {} frames, which are in {}",
            frames.len(),
            scene.frames,
            out.display()
        );
    }
    if !arguments.quiet {
        let written = format!("Written to {}: {CURVES_FILE}, {DRAWING_FILE}, {REPORT_FILE}", out.display());
        print_out(&format!("{}\n{written}\n", summary(&scene, &pipeline, &frames, &bars)))?;
    }
    Ok(())
}

fn progress_bar(frames: usize, quiet: bool) -> ProgressBar {
    // Nothing is drawn when stderr is no terminal.
    let target = if quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} frames, {fps} per second, {eta} left")
        .unwrap_or_else(|_| ProgressStyle::default_bar())
        .with_key("fps", |state: &ProgressState, text: &mut dyn std::fmt::Write| {
            // Nobody is told when a terminal cannot be written to.
            let _ = write!(text, "{:.0}", state.per_sec());
        });
    ProgressBar::with_draw_target(Some(frames as u64), target).with_style(style)
}

fn write_results(
    out: &Path,
    scene: &Scene,
    pipeline: &Pipeline,
    frames: &[Frame],
    measured: &MeasurementLog,
    report: &Report<'_>,
) -> anyhow::Result<()> {
    let rows = frames.iter().enumerate().map(|(index, frame)| FrameRow::new(frame, measured.of_frame(index)));
    let table = frame_table(&scene.electrodes, scene.measurement.as_ref(), rows)?;
    write_whole(&out.join(CURVES_FILE), &table)?;
    let drawing = curves(&scene.electrodes, pipeline.simulator().base(), frames)?;
    write_whole(&out.join(DRAWING_FILE), drawing.as_bytes())?;
    write_whole(&out.join(REPORT_FILE), &serde_json::to_vec_pretty(report)?)
}

fn summary(scene: &Scene, pipeline: &Pipeline, frames: &[Frame], bars: &BarLog) -> String {
    let mesh = pipeline.simulator().sensor().mesh();
    let mut text = format!(
        "{}: {} frames, {} tetrahedra, surfaces by {}\n\n{}",
        scene.source.file(),
        frames.len(),
        mesh.tets().len(),
        pipeline.renderer(),
        changes(scene, pipeline, frames, bars)
    );
    text.extend(bars.summary());
    text + "\n" + &timing(frames)
}

/// For each entry: without objects, and how far objects change it.
fn changes(scene: &Scene, pipeline: &Pipeline, frames: &[Frame], bars: &BarLog) -> String {
    let base = pipeline.simulator().base();
    let entries = upper_triangle(scene.electrodes.len());
    let ranges: Vec<(usize, usize, f64, f64)> = entries
        .map(|(row, column)| {
            let changes = frames.iter().map(|f| f.capacitance.get(row, column) - base.get(row, column));
            let (low, high) = changes.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), change| {
                (low.min(change), high.max(change))
            });
            (row, column, low, high)
        })
        .collect();
    let most = |values: &mut dyn Iterator<Item = f64>| Prefix::for_magnitude(values.fold(0.0, f64::max));
    let base_unit = most(&mut ranges.iter().map(|(row, column, ..)| base.get(*row, *column).abs()));
    let unit = most(&mut ranges.iter().map(|(_, _, low, high)| low.abs().max(high.abs())));
    let mut rows = vec![vec![
        "Maxwell entry".to_owned(),
        format!("no objects [{}]", base_unit.symbol),
        format!("smallest change [{}]", unit.symbol),
        format!("largest change [{}]", unit.symbol),
        format!("its error [{}]", unit.symbol),
        format!("error of the entry [{}]", base_unit.symbol),
    ]];
    rows.extend(ranges.iter().map(|&(row, column, low, high)| {
        vec![
            format!("{} {}", scene.electrodes[row], scene.electrodes[column]),
            format!("{:.5}", base_unit.of(base.get(row, column))),
            format!("{:+.4}", unit.of(low)),
            format!("{:+.4}", unit.of(high)),
            error(bars.largest(|bars| &bars.change, row, column), unit, 4),
            error(bars.largest(|bars| &bars.capacitance, row, column), base_unit, 5),
        ]
    }));
    table(&rows)
}

fn error(farads: Option<f64>, unit: Prefix, digits: usize) -> String {
    farads.map_or("unknown".to_owned(), |farads| format!("{:.digits$}", unit.of(farads)))
}

/// What parts of frames took.
fn timing(frames: &[Frame]) -> String {
    let mut timing = vec![["", "median [ms]", "95 % [ms]", "max [ms]"].map(str::to_owned).to_vec()];
    let mut part = |name: &str, spread: Spread| {
        let times = [spread.median, spread.p95, spread.max].map(|time| format!("{time:.3}"));
        timing.push(std::iter::once(name.to_owned()).chain(times).collect());
    };
    part("geometry", Spread::of(frames, |took| took.geometry));
    part("update", Spread::of(frames, |took| took.update));
    part("solve", Spread::of(frames, |took| took.solve));
    part("frame", Spread::of(frames, |took| took.total));
    table(&timing)
}
