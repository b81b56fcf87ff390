//! `capsense mesh`: the mesh of a scene's sensor, written to a file or looked into.

use super::mesh_info::{InfoArguments, info};
use super::output::{print_out, write_whole};
use super::{BadInput, load_scene};
use capsense::core::sensor::{GROUND, Sensor, Terminal};
use capsense::gmsh::{SurfaceGroup, VolumeGroup, faces_among, write};
use clap::{Args, Subcommand};
use std::path::PathBuf;

/// Write the mesh of a scene's sensor to a Gmsh file, or inspect a mesh file
///
/// The file is in metres and of format 4.1. Its surfaces are `ground` and the electrodes, by their nodes: an outline
/// that cuts mesh edges is rounded to the nodes inside it.
#[derive(Debug, Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = "Examples:\n  capsense mesh scene.toml --out sensor.msh\n  capsense mesh info sensor.msh"
)]
pub(super) struct MeshArguments {
    #[command(subcommand)]
    command: Option<MeshCommand>,
    /// The scene file
    #[arg(required = true)]
    scene: Option<PathBuf>,
    /// The mesh file to write (.msh)
    #[arg(long, required = true, value_name = "FILE")]
    out: Option<PathBuf>,
}

#[derive(Debug, Subcommand)]
enum MeshCommand {
    Info(InfoArguments),
}

pub(super) fn mesh(arguments: &MeshArguments) -> anyhow::Result<()> {
    match arguments {
        MeshArguments { command: Some(MeshCommand::Info(arguments)), .. } => info(arguments),
        MeshArguments { scene: Some(scene), out: Some(out), .. } => {
            let sensor = load_scene(Some(scene))?.build_sensor()?;
            write_whole(out, gmsh_text(&sensor)?.as_bytes())?;
            let mesh = sensor.mesh();
            let (tets, nodes) = (mesh.tets().len(), mesh.nodes().len());
            print_out(&format!("{}: {tets} tetrahedra, {nodes} nodes\n", out.display()))
        }
        _ => Err(BadInput("give a scene and --out FILE.msh".to_owned()).into()),
    }
}

fn gmsh_text(sensor: &Sensor) -> anyhow::Result<String> {
    let mesh = sensor.mesh();
    // A file knows of no links: electrodes are what lies within their outlines.
    let sensor = sensor.clone().with_rims_held();
    let faces_of = |wanted: Terminal| {
        let terminals = sensor.terminals().iter().zip(0u32..);
        let nodes: Vec<u32> =
            terminals.filter(|(terminal, _)| **terminal == wanted).map(|(_, node)| node).collect();
        faces_among(mesh, &nodes)
    };
    let names = std::iter::once("ground").chain(sensor.electrode_names().iter().map(String::as_str));
    let faces: Vec<_> = names.zip(GROUND..).map(|(name, terminal)| (name, faces_of(terminal))).collect();
    let surfaces: Vec<_> = faces.iter().map(|(name, triangles)| SurfaceGroup { name, triangles }).collect();
    let (board, air): (Vec<u32>, Vec<u32>) = (0..mesh.tets().len() as u32)
        .partition(|&element| mesh.relative_permittivity().at(element as usize) != 1.0);
    let volumes: Vec<_> = [("air", &air), ("substrate", &board)]
        .into_iter()
        .filter(|(_, tets)| !tets.is_empty())
        .map(|(name, tets)| VolumeGroup { name, tets })
        .collect();
    write(mesh, &surfaces, &volumes).map_err(|error| BadInput(error.to_string()).into())
}
