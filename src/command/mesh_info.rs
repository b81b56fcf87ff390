//! `capsense mesh`: what is in a mesh file.

use clap::Subcommand;
use std::path::PathBuf;

/// Inspect meshes
#[derive(Debug, Subcommand)]
#[command(after_help = "Example:\n  capsense mesh info sensor.msh")]
pub(super) enum MeshCommand {
    /// Print counts, volume, element quality, groups and warnings of a Gmsh file
    #[command(after_help = "Example:\n  capsense mesh info sensor.msh")]
    Info {
        /// The mesh file (.msh, format 2.2 or 4.1)
        file: PathBuf,
    },
}

pub(super) fn mesh(command: &MeshCommand) -> anyhow::Result<()> {
    match command {
        MeshCommand::Info { file } => anyhow::bail!("{}", file.display()),
    }
}
