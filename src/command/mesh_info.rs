//! `capsense mesh info`: what is in a mesh file.

use super::BadInput;
use super::output::print_out;
use super::text::table;
use capsense::core::mesh::MeshQuality;
use capsense::core::units::LengthUnit;
use capsense::gmsh::{self, GmshError, GmshFile};
use capsense::scene::mesh_warnings;
use clap::Args;
use std::path::{Path, PathBuf};

/// Print counts, volume, element quality, groups and warnings of a Gmsh file
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  capsense mesh info sensor.msh --unit mm")]
pub(super) struct InfoArguments {
    /// The mesh file (.msh, format 2.2 or 4.1)
    file: PathBuf,
    /// Its unit of length: m, cm or mm
    #[arg(long, default_value = "m")]
    unit: LengthUnit,
}

pub(super) fn info(arguments: &InfoArguments) -> anyhow::Result<()> {
    let file = &arguments.file;
    let bad = |problem: String| BadInput(format!("{}: {problem}", file.display()));
    let bytes = std::fs::read(file).map_err(|error| bad(format!("cannot read the mesh: {error}")))?;
    print_out(&describe(file, &bytes, arguments.unit).map_err(|error| bad(error.to_string()))?)
}

fn describe(file: &Path, bytes: &[u8], unit: LengthUnit) -> Result<String, GmshError> {
    let gmsh = gmsh::parse(bytes)?;
    let mesh = gmsh.to_tet_mesh(unit)?;
    let quality = MeshQuality::of(&mesh);
    let bounds = mesh.bounds();
    let mut text = format!("{}: Gmsh {}, unit {unit}\n\n", file.display(), gmsh.version);
    let row = |name: &str, value: String| vec![name.to_owned(), value];
    text += &table(&[
        row("nodes", mesh.nodes().len().to_string()),
        row("tetrahedra", mesh.tets().len().to_string()),
        row("from [m]", vector(bounds.min.to_array())),
        row("to [m]", vector(bounds.max.to_array())),
        row("volume [m³]", format!("{:.6e}", quality.volume)),
        row("edges [m]", format!("{:.3e} to {:.3e}", quality.shortest_edge, quality.longest_edge)),
        row(
            "dihedral angles [°]",
            format!("{:.1} to {:.1}", quality.min_dihedral_degrees, quality.max_dihedral_degrees),
        ),
        row(
            "radius ratio",
            format!("{:.3} smallest, {:.3} mean", quality.min_radius_ratio, quality.mean_radius_ratio),
        ),
    ]);
    text += "\nTetrahedra by their smallest dihedral angle:\n";
    text += &histogram(&quality.min_dihedral_histogram);
    text += "\nPhysical groups:\n";
    text += &groups(&gmsh)?;
    for warning in mesh_warnings(&gmsh)? {
        text += &format!("\nwarning: {warning}\n");
    }
    Ok(text)
}

fn vector(values: [f64; 3]) -> String {
    values.map(|value| format!("{value:.6}")).join(", ")
}

fn histogram(counts: &[usize]) -> String {
    const WIDEST: usize = 40;
    let most = counts.iter().copied().max().unwrap_or(0).max(1);
    let rows: Vec<Vec<String>> = counts
        .iter()
        .enumerate()
        .map(|(bin, &count)| {
            let bar = "#".repeat((count * WIDEST).div_ceil(most));
            vec![
                format!("{:>2}° to {:>2}°", 10 * bin, 10 * (bin + 1)),
                count.to_string(),
                format!("{bar:<WIDEST$}"),
            ]
        })
        .collect();
    table(&rows)
}

fn groups(gmsh: &GmshFile) -> Result<String, GmshError> {
    if gmsh.groups.is_empty() {
        return Ok("none\n".to_owned());
    }
    let mut rows = Vec::new();
    for group in &gmsh.groups {
        let elements = match group.dimension {
            2 => counted(gmsh.triangles_of(group.tag), "triangles")?,
            3 => counted(gmsh.tets_of(group.tag), "tetrahedra")?,
            _ => "not used".to_owned(),
        };
        rows.push(vec![group.to_string(), elements]);
    }
    Ok(table(&rows))
}

fn counted(members: Result<Vec<u32>, GmshError>, what: &str) -> Result<String, GmshError> {
    match members {
        Ok(members) => Ok(format!("{} {what}", members.len())),
        Err(GmshError::EmptyGroup(_)) => Ok(format!("no {what}")),
        Err(error) => Err(error),
    }
}
