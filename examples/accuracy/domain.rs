//! `accuracy domain`: what the wall changes, and what it costs to move it away: growing domains around the three stripes, with
//! grounded and open walls.

use crate::cases::{BAR, Body, CONNECTIONS, DOMAIN, ENTRIES, Entries, bodies, stripes};
use crate::measure::{Measured, measure, percent};
use anyhow::{Context, Result};
use capsense::core::geometry::{Aabb, Pose, Shape};
use capsense::core::glam::DVec3;
use capsense::core::material::{Connection, Material};
use capsense::core::mesh::Lattice;
use capsense::core::sensor::{Sensor, SensorDesign, Wall};
use capsense::core::simulator::Simulator;
use capsense::core::solids::Solids;
use capsense::core::solver::SolverOptions;
use clap::Args;
use std::time::Instant;

/// Lengths of the domain's sides in metres; the first is that of the built-in scene. The last three are extrapolated.
const SIZES: [f64; 7] = [0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 4.0];
const QUICK_SIZES: [f64; 4] = [0.5, 1.0, 1.5, 2.0];

/// Those with an open wall; the last is the limit that all else is compared with.
const OPEN_SIZES: [f64; 4] = [0.5, 0.7, 1.0, 4.0];

/// By what factor cells outside of the built-in domain grow.
const GROWTH: f64 = 1.3;

/// Frames that are timed.
const FRAMES: usize = 101;

/// What the wall changes, and what it costs to move it away: growing domains, with grounded and open walls
#[derive(Args, Debug)]
pub(crate) struct DomainArguments {
    /// Largest number of tetrahedra within the domain of 0.5 m
    #[arg(long, default_value_t = 130_000)]
    elements: usize,
    /// Only up to 2 m
    #[arg(long)]
    quick: bool,
}

/// Prints one table with the same cells in the domain of 0.5 m whatever is around it, and one with as many tetrahedra.
pub(crate) fn domain(arguments: &DomainArguments) -> Result<()> {
    let sizes = if arguments.quick { &QUICK_SIZES[..] } else { &SIZES[..] };
    let bars = |body: &Body| body.name.starts_with("bar at") && body.name.ends_with("mm");
    let bodies: Vec<Body> = bodies().into_iter().filter(bars).collect();
    let inner = stripes().lattice(arguments.elements)?;
    let around = |wall: Wall, size: f64| -> Result<Case> {
        let design = SensorDesign { wall, ..design_of(size) };
        let lattice = extended(&inner, &design.domain)?;
        Case::new(wall, size, Sensor::on_lattice(&design, &lattice)?, &bodies)
    };
    let grounded: Vec<Case> =
        sizes.iter().map(|&size| around(Wall::Grounded, size)).collect::<Result<_>>()?;
    let largest = sizes[sizes.len() - 1];
    let open_sizes = OPEN_SIZES.map(|size| size.min(largest));
    let open: Vec<Case> = open_sizes.iter().map(|&size| around(Wall::Open, size)).collect::<Result<_>>()?;
    let limit = &open.last().context("no open wall")?.measured;
    println!(
        "Off the open wall at {largest} m in percent: entries of C; of changes of C by the bar, the largest error in \
         parts of the largest change.\n"
    );
    println!("The same cells within 0.5 m\n\n{}", heading(&bodies));
    grounded.iter().for_each(|case| println!("{}", case.row(limit)));
    println!("| grounded, extrapolated | | |{}", cells(&extrapolated(&grounded), limit));
    open.iter().for_each(|case| println!("{}", case.row(limit)));
    println!("\nAs many tetrahedra\n\n{}", heading(&bodies));
    for (wall, size) in
        [0.5, 1.0, 2.0, 4.0].map(|size| (Wall::Grounded, size)).into_iter().chain([(Wall::Open, 0.5)])
    {
        let design = SensorDesign { wall, ..design_of(size) };
        let lattice = design.lattice(arguments.elements)?;
        let sensor = Sensor::on_lattice(&design, &lattice)?;
        println!("{}", Case::new(wall, size, sensor, &bodies)?.row(limit));
    }
    Ok(())
}

/// The stripes in the domain of the built-in scene, scaled.
fn design_of(size: f64) -> SensorDesign {
    let scale = size / (DOMAIN.max.x - DOMAIN.min.x);
    SensorDesign { domain: Aabb { min: scale * DOMAIN.min, max: scale * DOMAIN.max }, ..stripes() }
}

/// One domain.
struct Case {
    wall: Wall,
    size: f64,
    tets: usize,
    /// Median of a frame, update and solve.
    milliseconds: f64,
    measured: Measured,
}

impl Case {
    fn new(wall: Wall, size: f64, sensor: Sensor, bodies: &[Body]) -> Result<Self> {
        let measured = measure(&sensor, bodies)?;
        Ok(Self {
            wall,
            size,
            tets: sensor.mesh().tets().len(),
            milliseconds: milliseconds(sensor)?,
            measured,
        })
    }

    fn row(&self, limit: &Measured) -> String {
        let wall = match self.wall {
            Wall::Grounded => "grounded",
            Wall::Open => "open",
        };
        let numbers = cells(&self.measured, limit);
        format!("| {wall}, {} m | {} | {:.2} |{numbers}", self.size, self.tets, self.milliseconds)
    }
}

/// The median time of a frame in which a grounded bar moves by 1 mm, on one thread.
fn milliseconds(sensor: Sensor) -> Result<f64> {
    let options = SolverOptions { threads: Some(1), ..SolverOptions::default() };
    let mut simulator = Simulator::new(sensor, vec![Material::Conductor(Connection::Grounded)], options)?;
    let mut solids = Solids::new(&[Shape::Box { size: BAR }])?;
    let mut times = Vec::with_capacity(FRAMES);
    for frame in 0..FRAMES {
        solids.place(&[Pose::at(DVec3::new(0.0, 0.0, 0.16 - 0.001 * frame as f64))])?;
        let start = Instant::now();
        let _ = simulator.step(&solids)?;
        times.push(1e3 * start.elapsed().as_secs_f64());
    }
    times.sort_by(f64::total_cmp);
    Ok(times[FRAMES / 2])
}

fn heading(bodies: &[Body]) -> String {
    let entries = ENTRIES.map(|entry| entry.0).join(" | ");
    let of = |connection: &str| -> String {
        bodies.iter().map(|body| format!(" {connection} {} |", body.name)).collect()
    };
    let changes: String = CONNECTIONS.iter().map(|(connection, _)| of(connection)).collect();
    let columns = 2 + ENTRIES.len() + CONNECTIONS.len() * bodies.len();
    format!("| wall | tetrahedra | ms | {entries} |{changes}\n|---|{}", "---:|".repeat(columns))
}

fn cells(measured: &Measured, limit: &Measured) -> String {
    let entries = percent(&measured.empty, &limit.empty).map(|error| format!(" {error:.2} |")).concat();
    let change = |body: usize, connection: usize| {
        let [values, limits] = [measured, limit].map(|of| of.changes[body][connection]);
        let differences: Entries = std::array::from_fn(|entry| values[entry] - limits[entry]);
        format!(" {:.2} |", 100.0 * largest(&differences) / largest(&limits))
    };
    let bodies = measured.changes.len();
    let changes =
        (0..CONNECTIONS.len()).flat_map(|connection| (0..bodies).map(move |body| (body, connection)));
    entries + &changes.map(|(body, connection)| change(body, connection)).collect::<String>()
}

fn largest(entries: &Entries) -> f64 {
    entries.iter().fold(0.0, |largest, entry| entry.abs().max(largest))
}

/// The values at 1/size = 0 of polynomials through those of the three largest domains.
fn extrapolated(cases: &[Case]) -> Measured {
    let last = &cases[cases.len() - 3..];
    let factors: [f64; 3] = std::array::from_fn(|own| {
        let others = (0..3).filter(|&other| other != own);
        others.map(|other| last[own].size / (last[own].size - last[other].size)).product()
    });
    let limit = |of: &dyn Fn(&Measured) -> Entries| -> Entries {
        std::array::from_fn(|entry| {
            last.iter().zip(factors).map(|(case, factor)| factor * of(&case.measured)[entry]).sum()
        })
    };
    let change = |body: usize| {
        std::array::from_fn(|connection| limit(&|measured: &Measured| measured.changes[body][connection]))
    };
    Measured {
        empty: limit(&|measured: &Measured| measured.empty),
        changes: (0..last[0].measured.changes.len()).map(change).collect(),
    }
}

/// A lattice with cells added around it up to the walls of a larger domain.
fn extended(inner: &Lattice, domain: &Aabb) -> Result<Lattice> {
    let mut axes = inner.axes().clone();
    for (axis, planes) in axes.iter_mut().enumerate() {
        for wall in [domain.max[axis], domain.min[axis]] {
            extend(planes, wall);
            planes.reverse();
        }
    }
    Ok(Lattice::new(axes)?)
}

/// Adds planes up to a wall that lies behind the last.
fn extend(planes: &mut Vec<f64>, wall: f64) {
    let [before, last] = [planes[planes.len() - 2], planes[planes.len() - 1]];
    let (rest, mut step) = ((wall - last).abs(), (last - before).abs());
    let mut distances = vec![0.0];
    while distances[distances.len() - 1] < rest * (1.0 - 1e-9) {
        step *= GROWTH;
        distances.push(distances[distances.len() - 1] + step);
    }
    let reached = distances[distances.len() - 1];
    planes.extend(distances[1..].iter().map(|distance| last + (wall - last) * (distance / reached)));
}
