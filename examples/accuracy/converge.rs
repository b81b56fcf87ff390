//! `accuracy converge`: computes again the references that are CapSense's own, from ladders of lattices made for each body.

use crate::cases::{Body, CONNECTIONS, ENTRIES, Entries, bodies, stripes};
use crate::measure::{measure, percent};
use crate::references::References;
use anyhow::{Result, ensure};
use capsense::core::estimate::halved_lattice;
use capsense::core::geometry::{Aabb, Shape};
use capsense::core::glam::{DQuat, DVec3};
use capsense::core::mesh::{Lattice, graded_axis};
use capsense::core::sensor::{Sensor, SensorDesign};
use clap::Args;

/// Spacing of the coarsest lattice at electrodes, and at the faces of bodies that lie in lattice planes, in metres.
const FINEST: f64 = 0.005;

/// Spacing of the coarsest lattice around other bodies.
const AROUND: f64 = 0.01;

const GROWTH: f64 = 1.3;

/// The order of convergence that is assumed where two lattices do not tell: that of the field's singularity at a right
/// edge of a conductor.
const EDGE_ORDER: f64 = 4.0 / 3.0;

/// The references that are CapSense's own, computed again: lattices made for each body, halved, extrapolated
#[derive(Args, Debug)]
pub(crate) struct ConvergeArguments {
    /// How often spacings are halved. 1 takes half a minute, 2 about 6 minutes on two cores: its lattices have up to 24
    /// million tetrahedra and need 3 GB
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=2))]
    levels: u32,
    /// Only bodies whose name contains this
    #[arg(long, default_value = "")]
    body: String,
    /// Errors of each of these lattices, which are made for the body, against the references
    #[arg(long)]
    each: bool,
}

/// Prints the changes by each body on the finest lattice, extrapolated, and by how much that is off the reference; or the errors of each
/// lattice.
pub(crate) fn converge(arguments: &ConvergeArguments) -> Result<()> {
    let references = References::load()?;
    let bodies: Vec<Body> = bodies().into_iter().filter(|body| body.name.contains(&arguments.body)).collect();
    ensure!(!bodies.is_empty(), "no body is called {}", arguments.body);
    let entries = ENTRIES.map(|entry| entry.0).join(" | ");
    if arguments.each {
        println!("Errors in percent of the references, of lattices made for each body.\n");
        println!("| body | | tetrahedra | {entries} |\n|---|---|---:|{}", "---:|".repeat(ENTRIES.len()));
    } else {
        println!(
            "Changes in fF, extrapolated, and in parentheses by how many percent they exceed the reference.\n"
        );
        println!("| body | | finest lattice | {entries} | reference from |");
        println!("|---|---|---:|{}---|", "---:|".repeat(ENTRIES.len()));
    }
    for body in bodies {
        let ladder = ladder(body, arguments.levels)?;
        for (number, (connection, _)) in CONNECTIONS.into_iter().enumerate() {
            let values: Vec<Entries> = ladder.changes.iter().map(|changes| changes[number]).collect();
            let reference = references.change(ladder.name, connection)?;
            if arguments.each {
                print_each(&ladder, connection, &values, &reference);
                continue;
            }
            let limit = extrapolated(&values);
            let cells: String = limit
                .iter()
                .zip(percent(&limit, &reference))
                .map(|(limit, error)| format!(" {limit:.5} ({error:+.2}) |"))
                .collect();
            let (finest, origin) =
                (ladder.tetrahedra.last().unwrap_or(&0), references.origin(ladder.name, connection)?);
            println!("| {} | {connection} | {finest} |{cells} {origin} |", ladder.name);
        }
    }
    Ok(())
}

fn print_each(ladder: &Ladder, connection: &str, values: &[Entries], reference: &Entries) {
    for (tetrahedra, values) in ladder.tetrahedra.iter().zip(values) {
        let cells: String = percent(values, reference).iter().map(|error| format!(" {error:.2} |")).collect();
        println!("| {} | {connection} | {tetrahedra} |{cells}", ladder.name);
    }
}

/// What the lattices of one body gave, the coarsest first.
struct Ladder {
    name: &'static str,
    /// Number of tetrahedra of each.
    tetrahedra: Vec<usize>,
    changes: Vec<[Entries; CONNECTIONS.len()]>,
}

fn ladder(body: Body, levels: u32) -> Result<Ladder> {
    let design = stripes();
    let mut lattice = fitted(&design, &body)?;
    let mut ladder = Ladder { name: body.name, tetrahedra: Vec::new(), changes: Vec::new() };
    let body = [body];
    for level in 0..=levels {
        if level > 0 {
            lattice = halved_lattice(&lattice)?;
        }
        let measured = measure(&Sensor::on_lattice(&design, &lattice)?, &body)?;
        ladder.changes.extend(measured.changes);
        ladder.tetrahedra.push(lattice.tet_count());
    }
    Ok(ladder)
}

/// A lattice with the faces of the body in its planes where they follow the axes, and fine around it otherwise.
fn fitted(design: &SensorDesign, body: &Body) -> Result<Lattice> {
    let bounds = bounds(body);
    let is_aligned = matches!(body.shape, Shape::Box { .. }) && body.pose.rotation == DQuat::IDENTITY;
    let mut axes = [const { Vec::new() }; 3];
    for (axis, coordinates) in axes.iter_mut().enumerate() {
        let of_electrode = |e: &capsense::core::electrode::Electrode| match axis {
            2 => vec![e.z],
            _ => e.outline.bounds().map(|corner| corner[axis]).to_vec(),
        };
        let mut planes: Vec<f64> = design.electrodes.iter().flat_map(of_electrode).collect();
        if is_aligned {
            planes.extend([bounds.min[axis], bounds.max[axis]]);
        }
        let (low, high) = (design.domain.min[axis], design.domain.max[axis]);
        *coordinates = graded_axis(low, high, &planes, &[], FINEST, GROWTH);
        if !is_aligned {
            *coordinates = refined(coordinates, [bounds.min[axis], bounds.max[axis]]);
        }
    }
    Ok(Lattice::new(axes)?)
}

/// The box around a body.
fn bounds(body: &Body) -> Aabb {
    // Corners of a box, or centres of balls.
    let (points, radius) = match body.shape {
        Shape::Box { size } => {
            let sides = [-0.5, 0.5];
            let corners = sides.map(|x| sides.map(|y| sides.map(|z| DVec3::new(x, y, z) * size)));
            (corners.into_iter().flatten().flatten().collect(), 0.0)
        }
        Shape::Capsule { radius, length } => {
            ([-0.5, 0.5].map(|end| DVec3::Z * end * length).to_vec(), radius)
        }
        _ => (vec![DVec3::ZERO], body.shape.bounding_radius()),
    };
    let bounds = Aabb::around(points.into_iter().map(|point| body.pose.sensor_from_object(point)));
    Aabb { min: bounds.min - radius, max: bounds.max + radius }
}

/// Splits the intervals of an axis that are too long near a body.
fn refined(axis: &[f64], [low, high]: [f64; 2]) -> Vec<f64> {
    let mut finer = axis[..1].to_vec();
    for pair in axis.windows(2) {
        let (start, length) = (pair[0], pair[1] - pair[0]);
        let middle = start + 0.5 * length;
        let distance = (low - middle).max(middle - high).max(0.0);
        let wanted = AROUND + (GROWTH - 1.0) * distance;
        let count = (length / wanted).ceil().max(1.0);
        finer.extend((1..=count as usize).map(|k| start + length * k as f64 / count));
    }
    finer
}

/// The limit of values on lattices that halve their spacing; there are at least two.
fn extrapolated(values: &[Entries]) -> Entries {
    let finest = values.len() - 1;
    std::array::from_fn(|entry| {
        let step = |level: usize| values[level][entry] - values[level - 1][entry];
        let order = match finest {
            0 | 1 => EDGE_ORDER,
            _ => observed_order(step(finest - 1) / step(finest)),
        };
        values[finest][entry] + step(finest) / (order.exp2() - 1.0)
    })
}

/// From the ratio of two steps; between one and two, where theory has it.
fn observed_order(ratio: f64) -> f64 {
    if ratio > 0.0 { ratio.log2().clamp(1.0, 2.0) } else { EDGE_ORDER }
}
