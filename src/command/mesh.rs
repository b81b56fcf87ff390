//! `capsense mesh`: the mesh of a scene's sensor, written to a file or looked into.

use super::contacts::print_warnings;
use super::mesh_info::{InfoArguments, info};
use super::output::{print_out, write_whole};
use super::{BadInput, load_scene};
use capsense::core::electrode::Electrode;
use capsense::core::mesh::TetMesh;
use capsense::core::sensor::{ElectrodeNodes, GROUND, Sensor, Terminal};
use capsense::gmsh::{SurfaceGroup, VolumeGroup, boundary_faces, faces_among, write};
use capsense::{Scene, scene::SceneSensor};
use clap::{Args, Subcommand};
use std::collections::BTreeSet;
use std::path::PathBuf;

/// Electrodes whose areas differ by more than this part are warned of.
const ROUNDED: f64 = 0.01;

/// Write the mesh of a scene's sensor to a Gmsh file, or inspect a mesh file
///
/// The file is in metres and of format 4.1. Its surfaces are `ground` and the electrodes, by their nodes: an outline
/// that cuts mesh edges is rounded to the nodes inside it, which a warning tells where it matters.
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
            let scene = load_scene(Some(scene))?;
            let sensor = scene.build_sensor()?;
            let groups = groups(&sensor);
            write_whole(out, gmsh_text(sensor.mesh(), &groups)?.as_bytes())?;
            let mesh = sensor.mesh();
            let (tets, nodes) = (mesh.tets().len(), mesh.nodes().len());
            print_out(&format!("{}: {tets} tetrahedra, {nodes} nodes\n", out.display()))?;
            print_warnings(&rounded(&scene, mesh, &groups));
            Ok(())
        }
        _ => Err(BadInput("give a scene and --out FILE.msh".to_owned()).into()),
    }
}

/// A group of the file, and its triangles.
type Group<'a> = (&'a str, Vec<[u32; 3]>);

/// The ground, then the electrodes.
fn groups(sensor: &Sensor) -> Vec<Group<'_>> {
    let mesh = sensor.mesh();
    // A file knows of no links: electrodes are what lies within their outlines.
    let held = sensor.clone().with_rims_held();
    let faces_of = |wanted: Terminal| {
        let terminals = held.terminals().iter().zip(0u32..);
        let nodes: Vec<u32> =
            terminals.filter(|(terminal, _)| **terminal == wanted).map(|(_, node)| node).collect();
        faces_among(mesh, &nodes)
    };
    let names = std::iter::once("ground").chain(sensor.electrode_names().iter().map(String::as_str));
    let mut groups: Vec<Group<'_>> =
        names.zip(GROUND..).map(|(name, terminal)| (name, faces_of(terminal))).collect();
    // Where walls meet, faces within the domain have all their nodes on walls.
    let surface: BTreeSet<[u32; 3]> = boundary_faces(mesh).into_iter().map(ascending).collect();
    let ground = &mut groups[0].1;
    let on_walls: BTreeSet<u32> =
        ground.iter().filter(|face| surface.contains(*face)).flatten().copied().collect();
    ground.retain(|face| surface.contains(face) || !face.iter().all(|node| on_walls.contains(node)));
    groups
}

fn ascending(mut face: [u32; 3]) -> [u32; 3] {
    face.sort_unstable();
    face
}

/// Warns of electrodes that are larger or smaller in the file than in the scene.
fn rounded(scene: &Scene, mesh: &TetMesh, groups: &[Group<'_>]) -> Vec<String> {
    let shapes: Vec<&Electrode> = match &scene.sensor {
        SceneSensor::Generated { design, .. } => design.electrodes.iter().collect(),
        SceneSensor::Meshed { electrodes, .. } => {
            let shapes = electrodes.iter().map(|(_, nodes)| match nodes {
                ElectrodeNodes::Shape(shape) => Some(shape),
                ElectrodeNodes::Nodes(_) => None,
            });
            shapes.flatten().collect()
        }
    };
    let area = |[a, b, c]: &[u32; 3]| {
        let [a, b, c] = [a, b, c].map(|&node| mesh.nodes()[node as usize]);
        0.5 * (b - a).cross(c - a).length()
    };
    let warning = |electrode: &Electrode| {
        let (name, triangles) = groups[1..].iter().find(|(name, _)| *name == electrode.name)?;
        let (in_file, exact) = (triangles.iter().map(area).sum::<f64>(), electrode.outline.area());
        ((in_file / exact - 1.0).abs() > ROUNDED).then(|| {
            format!(
                "electrode `{name}` has {in_file:.4e} m² in the file, its outline {exact:.4e} m²: the file has the triangles within it. \
                 To keep the outline, a scene with this file names the electrode otherwise and gives its shape"
            )
        })
    };
    shapes.into_iter().filter_map(warning).collect()
}

fn gmsh_text(mesh: &TetMesh, groups: &[Group<'_>]) -> anyhow::Result<String> {
    let surfaces: Vec<_> = groups.iter().map(|(name, triangles)| SurfaceGroup { name, triangles }).collect();
    let (board, air): (Vec<u32>, Vec<u32>) = (0..mesh.tets().len() as u32)
        .partition(|&element| mesh.relative_permittivity().at(element as usize) != 1.0);
    let volumes: Vec<_> = [("air", &air), ("substrate", &board)]
        .into_iter()
        .filter(|(_, tets)| !tets.is_empty())
        .map(|(name, tets)| VolumeGroup { name, tets })
        .collect();
    write(mesh, &surfaces, &volumes).map_err(|error| BadInput(error.to_string()).into())
}
