//! `capsense export`: a recording as a table.

use super::BadInput;
use super::device_profile::{find_profile, told};
use super::output::print_out;
use capsense_hw::recording::{export_csv, export_parquet};
use clap::Args;
use std::path::PathBuf;

/// Write the samples of a recording as CSV or Parquet
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  capsense export bar.mcap --out bar.csv\n  capsense export bar.mcap --device mine.toml --out bar.parquet"
)]
pub(super) struct ExportArguments {
    /// The recording
    file: PathBuf,
    /// The table: .csv or .parquet
    #[arg(long)]
    out: PathBuf,
    /// Decode the bytes anew by this device profile, built-in or a file (.toml)
    #[arg(long)]
    device: Option<String>,
}

pub(super) fn export(arguments: &ExportArguments) -> anyhow::Result<()> {
    let profile = arguments.device.as_deref().map(find_profile).transpose()?;
    let write = match arguments.out.extension().and_then(|extension| extension.to_str()) {
        Some("csv") => export_csv,
        Some("parquet") => export_parquet,
        _ => return Err(BadInput(format!("{}: must be .csv or .parquet", arguments.out.display())).into()),
    };
    let report = write(&arguments.file, profile.as_ref(), &arguments.out).map_err(told)?;
    let out = arguments.out.display();
    print_out(&format!("{} samples of {} channels written to {out}\n", report.samples, report.channels))
}
