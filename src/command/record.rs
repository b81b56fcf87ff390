//! `capsense record`: what a board sends, into a file, until Ctrl-C.

use super::device_profile::{find_profile, told};
use super::interrupt::Interrupt;
use super::output::print_out;
use anyhow::{Context, bail};
use capsense_hw::recording::{Header, RecordingWriter};
use capsense_hw::{Counters, PortReader};
use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::path::PathBuf;
use std::time::{Duration, SystemTime};

/// Reads that may wait to be written: some seconds of a fast board.
const QUEUE: usize = 4096;

/// Record what a board sends, until Ctrl-C
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  capsense record --port /dev/ttyACM0 --device fdc2214-sketch --out bar.mcap"
)]
pub(super) struct RecordArguments {
    /// The serial port
    #[arg(long)]
    port: String,
    /// A built-in device profile, or a profile file (.toml)
    #[arg(long, default_value = "generic")]
    device: String,
    /// The recording; until it is complete its name ends in .partial
    #[arg(long, default_value = "recording.mcap")]
    out: PathBuf,
    /// Bits per second
    #[arg(long, default_value_t = 115_200)]
    baud: u32,
    /// Stop after so many seconds
    #[arg(long)]
    seconds: Option<f64>,
    /// Fail if a larger part of the bytes is lost or belongs to nothing
    #[arg(long, default_value_t = 0.01, value_name = "PART")]
    max_loss: f64,
    /// No counters and no summary
    #[arg(long)]
    quiet: bool,
}

pub(super) fn record(arguments: &RecordArguments) -> anyhow::Result<()> {
    let profile = find_profile(&arguments.device)?;
    let interrupt = Interrupt::listen().context("cannot listen for Ctrl-C")?;
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    let anchor = u64::try_from(now.as_nanos()).unwrap_or(u64::MAX);
    let header = Header::new(&arguments.port, anchor, &profile).map_err(told)?;
    let reader = PortReader::open(&arguments.port, arguments.baud, QUEUE)?;
    let writer = RecordingWriter::create(&arguments.out, &header).map_err(told)?;
    let limit = arguments.seconds.map(Duration::try_from_secs_f64).transpose().context("--seconds")?;
    let live = live_counters(arguments.quiet);
    let counters = capsense_hw::record(reader, &profile, writer, |counters| {
        live.set_message(line(counters));
        live.tick();
        !interrupt.requested() && limit.is_none_or(|limit| counters.time < limit)
    });
    live.finish_and_clear();
    let counters = counters.map_err(told)?;
    if !arguments.quiet {
        print_out(&format!("{}\nWritten to {}\n", line(&counters), arguments.out.display()))?;
    }
    if counters.loss() > arguments.max_loss {
        bail!("{:.2} % of the bytes were lost or belonged to nothing", 100.0 * counters.loss());
    }
    Ok(())
}

fn live_counters(quiet: bool) -> ProgressBar {
    // Nothing is drawn when stderr is no terminal.
    let target = if quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
    let style = ProgressStyle::with_template("{msg}").unwrap_or_else(|_| ProgressStyle::default_spinner());
    ProgressBar::with_draw_target(None, target).with_style(style)
}

fn line(counters: &Counters) -> String {
    let seconds = counters.time.as_secs_f64();
    let rate = counters.samples as f64 / seconds.max(1e-3);
    format!(
        "{seconds:.1} s: {} samples ({rate:.1} per second), {} bytes, {} lines of text, {} bytes passed over, \
         {} samples missing, {} bytes dropped, {} disconnections",
        counters.samples,
        counters.bytes,
        counters.lines,
        counters.passed_over,
        counters.missing,
        counters.dropped,
        counters.disconnections
    )
}
