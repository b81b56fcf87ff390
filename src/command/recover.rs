//! `capsense recover`: a recording from one that was cut off.

use super::device_profile::told;
use super::output::print_out;
use clap::Args;
use std::path::PathBuf;

/// Make a whole recording of one that was cut off
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  capsense recover bar.mcap.partial --out bar.mcap")]
pub(super) struct RecoverArguments {
    /// The recording that was cut off
    file: PathBuf,
    /// The new recording
    #[arg(long)]
    out: PathBuf,
}

pub(super) fn recover(arguments: &RecoverArguments) -> anyhow::Result<()> {
    let report = capsense_hw::recording::recover(&arguments.file, &arguments.out).map_err(told)?;
    let end = report.cut_off.map_or("; it was whole".to_owned(), |reason| format!(", up to where: {reason}"));
    print_out(&format!("{} messages written to {}{end}\n", report.messages, arguments.out.display()))
}
