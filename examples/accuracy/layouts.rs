//! `accuracy layouts`: lattices for electrodes of many layouts, and how exact bodies are on them that no lattice was chosen for.

use crate::cases::{BAR, CONNECTIONS, DOMAIN, stripes};
use anyhow::{Context, Result};
use capsense::core::electrode::{Electrode, Outline};
use capsense::core::geometry::{Pose, Shape};
use capsense::core::glam::{DQuat, DVec2, DVec3};
use capsense::core::material::{Material, RelativePermittivity};
use capsense::core::sensor::{MeshKind, Sensor, SensorDesign, Substrate, Wall};
use capsense::core::simulator::Simulator;
use capsense::core::solids::Solids;
use capsense::core::solver::SolverOptions;
use capsense::core::workspace::{Change, most_accurate};
use clap::Args;
use std::time::Instant;

/// Tetrahedra of the lattices that errors are measured against.
const REFERENCE: usize = 8_000_000;
const QUICK_REFERENCE: usize = 1_000_000;

/// Of C.
const SOLVED: f64 = 1e-6;

/// A board as most are, and a thick one.
const BOARD: f64 = 0.0016;
const THICK_BOARD: f64 = 0.01;

/// Electrodes in many layouts: how exact bodies near them are, on the usual lattice and on the one that is taken
#[derive(Args, Debug)]
pub(crate) struct LayoutsArguments {
    /// Only layouts whose name contains this
    #[arg(long, default_value = "")]
    only: String,
    /// Largest numbers of tetrahedra
    #[arg(long, value_delimiter = ',', default_values_t = [16_000, 28_000, 60_000, 124_000])]
    elements: Vec<usize>,
    /// A coarser reference
    #[arg(long)]
    quick: bool,
}

/// What a layout's bodies change, grounded and floating, and C without them as a change from nothing.
struct Measured {
    tets: usize,
    empty: Change,
    changes: [Vec<Change>; 2],
}

/// Errors in percent: of C without bodies, and for each connection the square mean and the worst entry.
struct Errors {
    empty: f64,
    changes: [[f64; 2]; 2],
}

/// Prints one row for each layout and number of tetrahedra.
pub(crate) fn layouts(arguments: &LayoutsArguments) -> Result<()> {
    let reference = if arguments.quick { QUICK_REFERENCE } else { REFERENCE };
    println!(
        "Errors in % against lattices of up to {reference} tetrahedra: of C without bodies, square mean of the entries; of what 8 \
         bodies change, grounded and floating, square mean and worst entry. Usual lattice, and the one that is taken.\n"
    );
    println!(
        "| layout | usual: tetrahedra | C | grounded | floating | taken: tetrahedra | C | grounded | floating | s |"
    );
    println!("|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|");
    for (name, design) in designs()?.into_iter().filter(|(name, _)| name.contains(&arguments.only)) {
        let exact = measure(&Sensor::generated(&design, MeshKind::Lattice, reference)?)?;
        for &elements in &arguments.elements {
            let usual = measure(&Sensor::generated(&design, MeshKind::Lattice, elements)?)?;
            let start = Instant::now();
            let taken = most_accurate(&design, MeshKind::Lattice, elements, None)?;
            let seconds = start.elapsed().as_secs_f64();
            let [usual, taken] = [usual, measure(&taken)?].map(|measured| row(&measured, &exact));
            println!("| {name} | {} | {} | {seconds:.1} |", usual?, taken?);
        }
    }
    Ok(())
}

fn row(measured: &Measured, exact: &Measured) -> Result<String> {
    let Errors { empty, changes: [grounded, floating] } = errors(measured, exact)?;
    let pair = |[mean, worst]: [f64; 2]| format!("{mean:.1}, {worst:.1}");
    Ok(format!("{} | {empty:.1} | {} | {}", measured.tets, pair(grounded), pair(floating)))
}

fn errors(measured: &Measured, exact: &Measured) -> Result<Errors> {
    let error = |ours: &Change, exact: &Change| ours.error(exact).context("a body is felt by no electrode");
    let mut changes = [[0.0f64; 2]; 2];
    for ([mean, worst], (ours, exact)) in changes.iter_mut().zip(measured.changes.iter().zip(&exact.changes))
    {
        for (ours, exact) in ours.iter().zip(exact) {
            let error = error(ours, exact)?;
            *mean += (100.0 * error.of_all).powi(2) / measured.changes[0].len() as f64;
            *worst = worst.max(100.0 * error.largest);
        }
        *mean = mean.sqrt();
    }
    Ok(Errors { empty: 100.0 * error(&measured.empty, &exact.empty)?.of_all, changes })
}

fn measure(sensor: &Sensor) -> Result<Measured> {
    let options = SolverOptions { tolerance: SOLVED, ..SolverOptions::default() };
    let with = |connection| Simulator::new(sensor.clone(), vec![Material::Conductor(connection)], options);
    let [grounded, floating] = CONNECTIONS.map(|(_, connection)| with(connection));
    let grounded = grounded?;
    let base = grounded.base();
    let upper = (0..base.size()).flat_map(|i| (i..base.size()).map(move |j| base.get(i, j)));
    let empty = Change::from_farads(base.size(), upper.collect()).context("C is not finite")?;
    Ok(Measured {
        tets: sensor.mesh().tets().len(),
        empty,
        changes: [changes_by_bodies(grounded)?, changes_by_bodies(floating?)?],
    })
}

fn changes_by_bodies(mut simulator: Simulator) -> Result<Vec<Change>> {
    let change = |(shape, pose)| {
        let mut solids = Solids::new(&[shape])?;
        solids.place(&[pose])?;
        let _ = simulator.step(&solids)?;
        anyhow::ensure!(simulator.contacts().is_empty(), "a body touches an electrode");
        Ok(Change::between(simulator.base(), simulator.capacitance()))
    };
    bodies().into_iter().map(change).collect()
}

/// Bodies near and far, none of them a probe of the choice.
fn bodies() -> Vec<(Shape, Pose)> {
    let at = |x: f64, y: f64, z: f64, about_z: f64, about_x: f64| Pose {
        rotation: DQuat::from_rotation_z(about_z.to_radians()) * DQuat::from_rotation_x(about_x.to_radians()),
        ..Pose::at(DVec3::new(x, y, z))
    };
    let bar = || Shape::Box { size: BAR };
    let small = || Shape::Box { size: DVec3::new(0.04, 0.08, 0.03) };
    let ball = || Shape::Sphere { radius: 0.03 };
    vec![
        (bar(), at(0.0, 0.0, 0.03, 0.0, 0.0)),
        (bar(), at(0.01, 0.0, 0.06, 20.0, 0.0)),
        (bar(), at(0.01, 0.03, 0.16, 20.0, 10.0)),
        (small(), at(0.01, 0.005, 0.03, 0.0, 0.0)),
        (small(), at(0.02, 0.005, 0.06, 40.0, 30.0)),
        (ball(), at(0.01, 0.01, 0.045, 0.0, 0.0)),
        (ball(), at(0.03, 0.02, 0.1, 0.0, 0.0)),
        (Shape::Capsule { radius: 0.025, length: 0.1 }, at(0.0, 0.01, 0.055, 10.0, 90.0)),
    ]
}

/// Layouts of electrodes, all in the built-in scene's domain.
fn designs() -> Result<Vec<(&'static str, SensorDesign)>> {
    let permittivity = RelativePermittivity::new(4.4).context("the board's permittivity")?;
    let board = |thickness: f64, grounded_back: bool| {
        let size = DVec2::new(0.16, 0.12);
        let board = Substrate { thickness, relative_permittivity: permittivity, size, grounded_back };
        SensorDesign { substrate: Some(board), ..stripes() }
    };
    let rect = |x: f64, y: f64, width: f64, depth: f64| Outline::Rectangle {
        center: DVec2::new(x, y),
        size: DVec2::new(width, depth),
    };
    let disk = |x: f64, y: f64, radius: f64| Outline::Disk { center: DVec2::new(x, y), radius };
    let turned = |x: f64, y: f64, width: f64, depth: f64, degrees: f64| {
        let about = DVec2::from_angle(degrees.to_radians());
        let corner =
            |(i, j): (f64, f64)| DVec2::new(x, y) + about.rotate(0.5 * DVec2::new(i * width, j * depth));
        Outline::Polygon([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(corner).to_vec())
    };
    let angle = [(-60, -50), (20, -50), (20, -30), (-40, -30), (-40, 40), (-60, 40)];
    let angle = angle.map(|(x, y)| 1e-3 * DVec2::new(f64::from(x), f64::from(y))).to_vec();
    let patch = |k: usize| rect(0.055 * ((k % 3) as f64 - 1.0), 0.07 * ((k / 3) as f64 - 0.5), 0.03, 0.03);
    let squares = [(-0.05, -0.02), (0.0, 0.0), (0.05, 0.025)].map(|(x, y)| rect(x, y, 0.03, 0.03));
    let staggered = [-1.0, 0.0, 1.0].map(|k| rect(0.012 * k, 0.03 * k, 0.09, 0.018));
    let narrow = [-0.02, 0.0, 0.02].map(|x| rect(x, 0.0, 0.006, 0.08));
    Ok(vec![
        ("three stripes", stripes()),
        ("on a board of 1.6 mm", board(BOARD, false)),
        ("with a shield", board(BOARD, true)),
        ("on 10 mm, with a shield", board(THICK_BOARD, true)),
        ("disks", of([disk(-0.05, 0.0, 0.02), disk(0.0, 0.0, 0.02), disk(0.05, 0.01, 0.02)])),
        (
            "turned squares",
            of([
                turned(-0.05, 0.0, 0.035, 0.035, 30.0),
                turned(0.0, 0.0, 0.035, 0.035, 20.0),
                turned(0.055, 0.01, 0.035, 0.035, 45.0),
            ]),
        ),
        ("squares across", of(squares)),
        ("narrow stripes", of(narrow)),
        ("six patches", of((0..6).map(patch))),
        (
            "rectangles",
            of([
                rect(-0.061, -0.013, 0.033, 0.041),
                rect(-0.008, 0.031, 0.052, 0.019),
                rect(0.011, -0.022, 0.047, 0.027),
                rect(0.066, 0.017, 0.024, 0.063),
            ]),
        ),
        ("two pads", of([rect(-0.03, 0.0, 0.05, 0.05), rect(0.03, 0.003, 0.05, 0.05)])),
        (
            "mixed",
            of([
                rect(-0.06, 0.0, 0.05, 0.05),
                disk(0.0, 0.02, 0.018),
                turned(0.055, -0.01, 0.05, 0.02, 35.0),
            ]),
        ),
        ("staggered stripes", of(staggered)),
        ("an angle and a square", of([Outline::Polygon(angle), rect(0.02, 0.01, 0.04, 0.04)])),
        ("one square", of([rect(0.0, 0.0, 0.12, 0.12)])),
    ])
}

/// Electrodes in air.
fn of(outlines: impl IntoIterator<Item = Outline>) -> SensorDesign {
    let electrode = |(k, outline): (usize, Outline)| Electrode { name: format!("E{k}"), outline, z: 0.0 };
    SensorDesign {
        domain: DOMAIN,
        electrodes: (1..).zip(outlines).map(electrode).collect(),
        substrate: None,
        wall: Wall::Grounded,
    }
}
