//! `accuracy rims`: how exact links at the rims of thin electrodes are, for plates of 1 m in a grounded box of 3 m.

use crate::plates::{Layer, Plate, capacitance as reference};
use anyhow::{Context, Result};
use capsense::core::electrode::{Electrode, Outline};
use capsense::core::geometry::Aabb;
use capsense::core::glam::{DVec2, DVec3};
use capsense::core::material::RelativePermittivity;
use capsense::core::mesh::Lattice;
use capsense::core::sensor::{Sensor, SensorDesign, Substrate, Wall};
use capsense::core::simulator::Simulator;
use capsense::core::solver::SolverOptions;
use clap::Args;
use std::fmt::Write as _;

/// Half the width of the box.
const WALL: f64 = 1.5;

/// Permittivity of the substrate.
const BOARD: f64 = 4.4;

/// Of capacitances on lattices.
const TOLERANCE: f64 = 1e-6;

const ACROSS: [usize; 4] = [4, 8, 16, 32];
const QUICK_ACROSS: [usize; 2] = [4, 8];

/// Where the plate's centre is from a node, in cells, where it is on none; what else there is follows by symmetry.
const DISPLACED: [[f64; 2]; 6] =
    [[0.0, 0.25], [0.0, 0.5], [0.25, 0.25], [0.25, 0.5], [0.5, 0.5], [0.125, 0.375]];

/// Errors of capacitances that are due to the rims of thin electrodes, on lattices of several sizes
#[derive(Args, Debug)]
pub(crate) struct RimsArguments {
    /// Only 4 and 8 cells across
    #[arg(long)]
    quick: bool,
}

/// Prints one table after the other.
pub(crate) fn rims(arguments: &RimsArguments) -> Result<()> {
    println!("Errors in percent. Where a plate is displaced: mean (smallest to largest) of several places.");
    for (title, cases) in [("A plate in air", in_air()), ("A square on a board of ε = 4.4", on_board())] {
        println!("\n**{title}**\n\n{}", markdown(&cases, arguments.quick)?);
    }
    Ok(())
}

/// A plate, what is below it, and how a lattice lies.
pub(crate) struct Case {
    pub(crate) name: &'static str,
    plate: Plate,
    board: Option<Board>,
    /// Heights of cells in their widths.
    aspect: f64,
    displaced: &'static [[f64; 2]],
    held_as_well: bool,
}

/// A slab as wide as the box.
#[derive(Clone, Copy)]
struct Board {
    thickness: Thickness,
    shield: bool,
}

#[derive(Clone, Copy)]
enum Thickness {
    Metres(f64),
    Cells(f64),
}

const SQUARE: Plate = Plate::Square { size: 1.0, degrees: 0.0 };
const DISK: Plate = Plate::Disk { radius: 0.5 };

/// What is in the first table.
pub(crate) fn in_air() -> Vec<Case> {
    let case = |name, plate| Case {
        name,
        plate,
        board: None,
        aspect: 1.0,
        displaced: &[[0.0; 2]],
        held_as_well: true,
    };
    let high = |name, aspect| Case { aspect, ..case(name, SQUARE) };
    let turned = |name, degrees| case(name, Plate::Square { size: 1.0, degrees });
    let displaced = |name, plate| Case { displaced: &DISPLACED, ..case(name, plate) };
    vec![
        case("square", SQUARE),
        high("cells ¼ as high as wide", 0.25),
        high("cells ½ as high", 0.5),
        high("cells twice as high", 2.0),
        high("cells 3 times as high", 3.0),
        high("cells 4 times as high", 4.0),
        turned("turned by 10°", 10.0),
        turned("turned by 30°", 30.0),
        turned("turned by 45°", 45.0),
        displaced("square, displaced", SQUARE),
        case("disk, centre on a node", DISK),
        displaced("disk, displaced", DISK),
    ]
}

/// What is in the second table.
pub(crate) fn on_board() -> Vec<Case> {
    let case = |name, thickness, shield| Case {
        name,
        plate: SQUARE,
        board: Some(Board { thickness, shield }),
        aspect: 1.0,
        displaced: &[[0.0; 2]],
        held_as_well: false,
    };
    vec![
        Case { held_as_well: true, ..case("down to the wall", Thickness::Metres(WALL), false) },
        Case { held_as_well: true, ..case("0.25 m thick", Thickness::Metres(0.25), false) },
        case("2 cells thick", Thickness::Cells(2.0), false),
        case("1 cell thick", Thickness::Cells(1.0), false),
        case("½ cell thick", Thickness::Cells(0.5), false),
        Case { held_as_well: true, ..case("0.25 m thick, shield", Thickness::Metres(0.25), true) },
        case("2 cells thick, shield", Thickness::Cells(2.0), true),
        case("1 cell thick, shield", Thickness::Cells(1.0), true),
        case("½ cell thick, shield", Thickness::Cells(0.5), true),
    ]
}

fn markdown(cases: &[Case], quick: bool) -> Result<String> {
    let across = if quick { &QUICK_ACROSS[..] } else { &ACROSS[..] };
    let mut text = "| | rim | C [pF] |".to_owned();
    for cells in across {
        let _ = write!(text, " {cells} cells |");
    }
    let _ = write!(text, "\n|---|---|---:|{}", "---:|".repeat(across.len()));
    for case in cases {
        let references = case.references(across);
        let [low, high] = span(&references);
        let picofarads = if low == high {
            format!("{:.3}", 1e12 * low)
        } else {
            format!("{:.1} to {:.1}", 1e12 * low, 1e12 * high)
        };
        for held in [true, false].into_iter().filter(|held| !held || case.held_as_well) {
            let rim = if held { "held" } else { "linked" };
            let _ = write!(text, "\n| {} | {rim} | {picofarads} |", case.name);
            for (&cells, reference) in across.iter().zip(&references) {
                let errors = case.errors(cells, held, *reference)?;
                let mean = errors.iter().sum::<f64>() / errors.len() as f64;
                // Without the sign of what rounds to zero.
                let rounded = |error: f64| (100.0 * error).round() / 100.0 + 0.0;
                let ([low, high], mean) = (span(&errors).map(rounded), rounded(mean));
                let _ = match errors.len() {
                    1 => write!(text, " {mean:.2} |"),
                    _ => write!(text, " {mean:.2} ({low:.2} to {high:.2}) |"),
                };
            }
        }
    }
    Ok(text)
}

fn span(values: &[f64]) -> [f64; 2] {
    values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &v| [low.min(v), high.max(v)])
}

impl Case {
    fn references(&self, across: &[usize]) -> Vec<f64> {
        match self.board {
            Some(Board { thickness: Thickness::Cells(_), .. }) => {
                across.iter().map(|&cells| self.reference(cells)).collect()
            }
            _ => vec![self.reference(1); across.len()],
        }
    }

    /// C without a lattice, in farads, for a board as it is with so many cells across.
    pub(crate) fn reference(&self, across: usize) -> f64 {
        let air = Layer { thickness: WALL, permittivity: 1.0 };
        let below = match self.board {
            None => vec![air],
            Some(board) => {
                let thickness = board.thickness.metres(across);
                let slab = Layer { thickness, permittivity: BOARD };
                let rest = Layer { thickness: WALL - thickness, ..air };
                if board.shield || rest.thickness <= 0.0 { vec![slab] } else { vec![slab, rest] }
            }
        };
        reference(self.plate, 2.0 * WALL, [&[air], &below])
    }

    /// Errors on a lattice with so many cells across the plate, in percent, one for each place of the plate.
    pub(crate) fn errors(&self, across: usize, held: bool, reference: f64) -> Result<Vec<f64>> {
        let cell = 1.0 / across as f64;
        let relative_permittivity = RelativePermittivity::new(BOARD).context("no permittivity")?;
        let board = self.board.map(|board| Substrate {
            thickness: board.thickness.metres(across),
            relative_permittivity,
            size: DVec2::splat(2.0 * WALL),
            grounded_back: board.shield,
        });
        let electrode = Electrode { name: "plate".to_owned(), outline: self.outline(), z: 0.0 };
        let domain = Aabb { min: DVec3::splat(-WALL), max: DVec3::splat(WALL) };
        let design =
            SensorDesign { domain, electrodes: vec![electrode], substrate: board, wall: Wall::Grounded };
        let heights = axis(0.0, self.aspect * cell, board.map(|board| -board.thickness));
        let mut errors = Vec::new();
        for displaced in self.displaced {
            let [xs, ys] = displaced.map(|part| axis(part * cell, cell, None));
            let mut sensor = Sensor::on_lattice(&design, &Lattice::new([xs, ys, heights.clone()])?)?;
            if held {
                sensor = sensor.with_rims_held();
            }
            let options = SolverOptions { tolerance: TOLERANCE, ..SolverOptions::default() };
            let capacitance = Simulator::new(sensor, vec![], options)?.base().get(0, 0);
            errors.push(100.0 * (capacitance / reference - 1.0));
        }
        Ok(errors)
    }

    fn outline(&self) -> Outline {
        match self.plate {
            Plate::Square { size, degrees } => {
                let turned =
                    |x, y| DVec2::from_angle(degrees.to_radians()).rotate(0.5 * size * DVec2::new(x, y));
                match degrees == 0.0 {
                    true => Outline::Rectangle { center: DVec2::ZERO, size: DVec2::splat(size) },
                    false => Outline::Polygon(vec![
                        turned(-1.0, -1.0),
                        turned(1.0, -1.0),
                        turned(1.0, 1.0),
                        turned(-1.0, 1.0),
                    ]),
                }
            }
            Plate::Disk { radius } => Outline::Disk { center: DVec2::ZERO, radius },
        }
    }
}

impl Thickness {
    fn metres(self, across: usize) -> f64 {
        match self {
            Self::Metres(metres) => metres,
            Self::Cells(cells) => cells / across as f64,
        }
    }
}

/// Planes a cell apart from one that they have to pass through, and one more where a board ends; cells at walls, and those
/// below a board, take what remains.
fn axis(through: f64, cell: f64, extra: Option<f64>) -> Vec<f64> {
    let mut fixed = vec![-WALL, through, WALL];
    fixed.extend(extra.filter(|extra| *extra > -WALL));
    fixed.sort_by(f64::total_cmp);
    let mut planes = vec![-WALL];
    for pair in fixed.windows(2) {
        let (start, end) = (pair[0], pair[1]);
        let count = ((end - start) / cell - 0.5).ceil().max(1.0) as usize;
        // From the electrode on, cells are whole.
        if start < through {
            planes.extend((1..count).rev().map(|k| end - cell * k as f64));
        } else {
            planes.extend((1..count).map(|k| start + cell * k as f64));
        }
        planes.push(end);
    }
    planes
}
