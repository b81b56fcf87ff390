//! `accuracy fitted`: what a mesh gets wrong of a box that it fits, all faces in its planes, and of the same box between them.

use crate::cases::{BAR, Body, CONNECTIONS, ENTRIES, Entries, stripes};
use crate::measure::{Measured, measure, percent};
use anyhow::{Context, Result};
use capsense::core::geometry::{Pose, Shape};
use capsense::core::glam::DVec3;
use capsense::core::mesh::Lattice;
use capsense::core::sensor::Sensor;
use clap::Args;

/// So many entries of C are told: all but C13, of which a floating box changes next to nothing.
const TOLD: usize = 3;

/// Heights, in metres, above which the first cell is filled.
pub(crate) const HEIGHTS: [f64; 2] = [0.1, 0.2];

/// How far boxes are moved up, in parts of the cell.
const SHIFTS: [(f64, &str); 4] =
    [(0.0, "fitted"), (0.25, "a quarter up"), (0.5, "half up"), (0.75, "three quarters up")];

/// Errors of a box as high as a cell, its faces in planes of the lattice or between them
#[derive(Args, Debug)]
pub(crate) struct FittedArguments {
    /// Tetrahedra of the lattice, at most
    #[arg(long, value_name = "N", default_value_t = 130_000)]
    elements: usize,
    /// Parts that each spacing of the reference lattice is cut into
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u8).range(2..))]
    finer: u8,
}

/// Prints one table for each height and lattice.
pub(crate) fn fitted(arguments: &FittedArguments) -> Result<()> {
    let lattice = stripes().lattice(arguments.elements)?;
    let finer = usize::from(arguments.finer);
    println!("Errors in percent of changes on a lattice with every spacing cut in {finer}.");
    for height in HEIGHTS {
        let bodies = bodies(&lattice, height)?;
        let (_, reference) = measure_on(&lattice, [finer; 3], &bodies)?;
        for (name, parts) in [("as it is", [1; 3]), ("x and y in two", [2, 2, 1]), ("z in two", [1, 1, 2])] {
            let (tets, measured) = measure_on(&lattice, parts, &bodies)?;
            println!("\n**{} mm, {name}, {tets} tetrahedra**\n\n{}", 1e3 * height, header());
            for (body, errors) in bodies.iter().zip(errors(&measured, &reference)) {
                println!("| {} |{}", body.name, errors.each_ref().map(cells).concat());
            }
        }
    }
    Ok(())
}

/// What is measured on a lattice with spacings along the axes cut in so many parts, and how many tetrahedra it has.
pub(crate) fn measure_on(lattice: &Lattice, parts: [usize; 3], bodies: &[Body]) -> Result<(usize, Measured)> {
    let [x, y, z] = lattice.axes();
    let lattice = Lattice::new([cut(x, parts[0]), cut(y, parts[1]), cut(z, parts[2])])?;
    Ok((lattice.tet_count(), measure(&Sensor::on_lattice(&stripes(), &lattice)?, bodies)?))
}

/// By how many percent the changes by each body exceed those of the reference.
pub(crate) fn errors(measured: &Measured, reference: &Measured) -> Vec<[Entries; CONNECTIONS.len()]> {
    let of_body = |(changes, references): (&[Entries; 2], &[Entries; 2])| {
        std::array::from_fn(|connection| percent(&changes[connection], &references[connection]))
    };
    measured.changes.iter().zip(&reference.changes).map(of_body).collect()
}

/// A box as wide as the bar, but for what planes of the lattice are next to its sides, that fills the first cells above a height;
/// and the same higher up.
pub(crate) fn bodies(lattice: &Lattice, height: f64) -> Result<Vec<Body>> {
    let [x, y, z] = lattice.axes();
    let nearest = |axis: &[f64], place: f64| {
        axis.iter().copied().min_by(|a, b| (a - place).abs().total_cmp(&(b - place).abs()))
    };
    let cell = z.windows(2).find(|cell| cell[0] > height).context("the lattice is not so high")?;
    let [low, high] = [cell[0], cell[1]];
    let sides = |axis: &[f64], width: f64| Some([nearest(axis, -0.5 * width)?, nearest(axis, 0.5 * width)?]);
    let [left, right] = sides(x, BAR.x).context("no planes across x")?;
    let [front, back] = sides(y, BAR.y).context("no planes across y")?;
    let (least, most) = (DVec3::new(left, front, low), DVec3::new(right, back, high));
    let at = |(shift, name)| Body {
        name,
        shape: Shape::Box { size: most - least },
        pose: Pose::at(0.5 * (least + most) + shift * (high - low) * DVec3::Z),
    };
    Ok(SHIFTS.map(at).into())
}

/// An axis with each spacing cut into so many parts.
fn cut(axis: &[f64], parts: usize) -> Vec<f64> {
    let within = |cell: &[f64]| {
        let (from, to) = (cell[0], cell[1]);
        (0..parts).map(move |part| from + (to - from) * part as f64 / parts as f64).collect::<Vec<_>>()
    };
    axis.windows(2).flat_map(within).chain(axis.last().copied()).collect()
}

fn header() -> String {
    let columns = CONNECTIONS.iter().flat_map(|(connection, _)| {
        ENTRIES[..TOLD].iter().map(move |(entry, ..)| format!(" {entry} {connection} |"))
    });
    let columns = columns.collect::<String>();
    format!("| |{columns}\n|---|{}", "---:|".repeat(TOLD * CONNECTIONS.len()))
}

/// Those of the entries that are told.
pub(crate) fn told(errors: &Entries) -> &[f64] {
    &errors[..TOLD]
}

fn cells(errors: &Entries) -> String {
    told(errors).iter().map(|error| format!(" {error:.1} |")).collect()
}
