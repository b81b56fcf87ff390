//! `accuracy bars`: how large error bars are in relation to errors, and how many errors they hold.

use crate::cases::{Body, CONNECTIONS, ENTRIES, Entries, bodies, entries, few_bodies, stripes};
use crate::plates::{Layer, Plate, capacitance};
use crate::references::References;
use anyhow::{Context, Result};
use capsense::Scene;
use capsense::core::capacitance::CapacitanceMatrix;
use capsense::core::electrode::{Electrode, Outline};
use capsense::core::estimate::{ErrorBars, halved_lattice};
use capsense::core::geometry::{Aabb, Pose, Shape};
use capsense::core::glam::{DVec2, DVec3};
use capsense::core::material::{Connection, Material, RelativePermittivity};
use capsense::core::occupancy::Interface;
use capsense::core::sensor::{MeshKind, Sensor, SensorDesign, Substrate, Wall};
use capsense::core::simulator::Simulator;
use capsense::core::solids::Solids;
use capsense::core::solver::SolverOptions;
use capsense::core::workspace::most_accurate;
use capsense::error_bars::{halved_sensor, unweighed, unweighed_sensor};
use clap::Args;
use std::path::PathBuf;

const SIZES: [usize; 5] = [10_000, 16_000, 30_000, 64_000, 130_000];
const QUICK_SIZES: [usize; 2] = [10_000, 30_000];

/// Of capacitances on all meshes; far below what is compared.
const TOLERANCE: f64 = 1e-6;

/// Half the width of the box around plates, and from where up it is filled by a grounded body.
const WALL: f64 = 1.5;
const CEILINGS: [f64; 3] = [0.3, 0.4, 0.55];

/// Below plates on boards.
const BOARD: Layer = Layer { thickness: 0.25, permittivity: 4.4 };

/// Error bars against errors, on lattices of several sizes
#[derive(Args, Debug)]
pub(crate) struct BarsArguments {
    /// Only small lattices and few bodies
    #[arg(long)]
    quick: bool,
    /// A scene with the same three stripes on another mesh, for one more row
    #[arg(long, value_name = "FILE.toml")]
    scene: Option<PathBuf>,
}

/// Errors and their bars, both in parts of what they are compared with.
#[derive(Clone, Debug, Default)]
pub(crate) struct Comparison {
    errors: Vec<f64>,
    bars: Vec<f64>,
}

impl Comparison {
    fn add(&mut self, value: f64, reference: f64, bar: f64, scale: f64) {
        self.errors.push((value - reference) / scale);
        self.bars.push(bar / scale);
    }

    /// Both together.
    pub(crate) fn extend(&mut self, other: Self) {
        self.errors.extend(other.errors);
        self.bars.extend(other.bars);
    }

    /// How large errors are, root mean square.
    pub(crate) fn error(&self) -> f64 {
        rms(&self.errors)
    }

    /// Effectivity: bars over errors.
    pub(crate) fn ratio(&self) -> f64 {
        rms(&self.bars) / rms(&self.errors)
    }

    /// The part of errors that are within their bars.
    pub(crate) fn held(&self) -> f64 {
        let held = self.errors.iter().zip(&self.bars).filter(|(error, bar)| error.abs() <= **bar).count();
        held as f64 / self.errors.len() as f64
    }

    fn cells(&self) -> String {
        let [error, held] = [self.error(), self.held()].map(|part| 100.0 * part);
        format!("{error:.2} | {:.2} | {held:.0}", self.ratio())
    }
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}

/// Prints a row for each mesh.
pub(crate) fn bars(arguments: &BarsArguments) -> Result<()> {
    let (sizes, bodies) =
        if arguments.quick { (&QUICK_SIZES[..], few_bodies()) } else { (&SIZES[..], bodies()) };
    println!(
        "Errors in percent of √(C_ss C_tt), error bars over errors (both root mean square), and percent of errors within \
         their bars.\n\n\
         | problem | mesh | C: error | bar / error | within | change: error | bar / error | within |\n\
         |---|---:|{}",
        "---:|".repeat(6)
    );
    let row = |name: &str, sensor: &Sensor, [of_c, of_change]: &[Comparison; 2]| {
        let tets = sensor.mesh().tets().len();
        println!("| {name} | {tets} | {} | {} |", of_c.cells(), of_change.cells());
    };
    let references = References::load()?;
    let with_stripes = |name: &str, interface: Interface, sensors: Halved| -> Result<()> {
        for (connection, material) in CONNECTIONS {
            let compared = of_stripes(&sensors, interface, (connection, material), &bodies, &references)?;
            row(&format!("{name}, {connection} bodies"), &sensors.own, &compared);
        }
        Ok(())
    };
    for &size in sizes {
        with_stripes("stripes", Interface::EdgeCut, Halved::of(&stripes(), size)?)?;
    }
    for interface in [Interface::VolumeFraction, Interface::Centroid] {
        for &size in sizes {
            with_stripes(
                &format!("stripes, `{}`", interface.name()),
                interface,
                Halved::of(&stripes(), size)?,
            )?;
        }
    }
    if let Some(path) = &arguments.scene {
        let scene = Scene::load(path)?;
        let own = scene.build_sensor()?;
        let sensors =
            Halved { unweighed: unweighed_sensor(&scene, &own)?, halved: halved_sensor(&scene, &own)?, own };
        let name = path.file_name().context("the scene is no file")?.to_string_lossy();
        with_stripes(&name, scene.interface, sensors)?;
    }
    let mut all = [Comparison::default(), Comparison::default()];
    for plate in plates()? {
        for &size in sizes {
            let sensors = Halved::of(&plate.design, size)?;
            let compared = plate.compare(&sensors)?;
            row(plate.name, &sensors.own, &compared);
            all.iter_mut().zip(compared).for_each(|(all, of_plate)| all.extend(of_plate));
        }
    }
    println!("| all plates | | {} | {} |", all[0].cells(), all[1].cells());
    Ok(())
}

/// A sensor on its mesh, on the same with links at rims that are not weighed, if they are, and on that with all spacings halved.
pub(crate) struct Halved {
    pub(crate) own: Sensor,
    pub(crate) unweighed: Option<Sensor>,
    pub(crate) halved: Sensor,
}

impl Halved {
    /// On the lattice of at most so many tetrahedra that scenes have.
    pub(crate) fn of(design: &SensorDesign, tets: usize) -> Result<Self> {
        let own = most_accurate(design, MeshKind::Lattice, tets, None)?;
        let lattice = own.lattice().context("a lattice is none")?;
        let halved = Sensor::on_lattice(design, &halved_lattice(lattice)?)?;
        Ok(Self { unweighed: unweighed(design, &own)?, halved, own })
    }

    /// A simulator on each; on the halved mesh surfaces cut edges.
    fn simulators(&self, interface: Interface, connection: Connection) -> Result<Simulators> {
        let options = SolverOptions { tolerance: TOLERANCE, ..SolverOptions::default() };
        let material = vec![Material::Conductor(connection)];
        let simulator = |sensor: &Sensor, interface| {
            Simulator::with_interface(sensor.clone(), material.clone(), options, interface)
        };
        Ok(Simulators {
            own: simulator(&self.own, interface)?,
            unweighed: self
                .unweighed
                .as_ref()
                .map(|unweighed| simulator(unweighed, interface))
                .transpose()?,
            halved: simulator(&self.halved, Interface::EdgeCut)?,
        })
    }
}

struct Simulators {
    own: Simulator,
    unweighed: Option<Simulator>,
    halved: Simulator,
}

impl Simulators {
    /// The bars of a frame with a body.
    fn step(&mut self, body: &Solids) -> Result<ErrorBars> {
        let report = self.own.step(body)?;
        for other in [&mut self.halved].into_iter().chain(&mut self.unweighed) {
            let _ = other.step(body)?;
        }
        Ok(self.own.error_bars(self.unweighed.as_ref(), &self.halved, &report.solve))
    }
}

/// Of C, and of its changes, with each of some bodies.
pub(crate) fn of_stripes(
    sensors: &Halved,
    interface: Interface,
    (name, connection): (&str, Connection),
    bodies: &[Body],
    references: &References,
) -> Result<[Comparison; 2]> {
    let mut simulators = sensors.simulators(interface, connection)?;
    let empty = references.empty()?;
    let mut compared = [Comparison::default(), Comparison::default()];
    for body in bodies {
        let mut solids = Solids::new(std::slice::from_ref(&body.shape))?;
        solids.place(&[body.pose])?;
        let bars = simulators.step(&solids)?;
        let own = &simulators.own;
        let change = references.change(body.name, name)?;
        let with_body: Entries = std::array::from_fn(|entry| empty[entry] + change[entry]);
        let found = own.capacitance().minus(own.base());
        let [of_c, of_change] = &mut compared;
        add(of_c, own.capacitance(), &with_body, &bars.capacitance);
        add(of_change, &found, &change, &bars.change);
    }
    Ok(compared)
}

fn add(to: &mut Comparison, found: &CapacitanceMatrix, reference: &Entries, bars: &CapacitanceMatrix) {
    let (found, bars) = (entries(found), entries(bars));
    for (entry, (_, row, column)) in ENTRIES.into_iter().enumerate() {
        // E3 mirrors E1.
        let of_diagonal = |terminal: usize| reference[terminal % 2];
        let scale = (of_diagonal(row) * of_diagonal(column)).abs().sqrt();
        to.add(found[entry], reference[entry], bars[entry], scale);
    }
}

/// A plate in a grounded box, and grounded bodies that fill the box from some height up: Fourier series know of these.
pub(crate) struct PlateInBox {
    pub(crate) name: &'static str,
    pub(crate) design: SensorDesign,
    plate: Plate,
    below: Vec<Layer>,
}

/// What is compared of plates.
pub(crate) fn plates() -> Result<Vec<PlateInBox>> {
    let relative_permittivity = RelativePermittivity::new(BOARD.permittivity).context("no permittivity")?;
    let air = Layer { thickness: WALL, permittivity: 1.0 };
    let square = Outline::Rectangle { center: DVec2::ZERO, size: DVec2::ONE };
    let corner = |k: u32| DVec2::from_angle(f64::from(30 + 90 * k).to_radians()).rotate(DVec2::splat(0.5));
    let turned = Outline::Polygon((0..4).map(corner).collect());
    let case = |name, plate, outline: &Outline, grounded_back: Option<bool>| {
        let substrate = grounded_back.map(|grounded_back| Substrate {
            thickness: BOARD.thickness,
            relative_permittivity,
            size: DVec2::splat(2.0 * WALL),
            grounded_back,
        });
        let below = match grounded_back {
            None => vec![air],
            Some(true) => vec![BOARD],
            Some(false) => vec![BOARD, Layer { thickness: WALL - BOARD.thickness, ..air }],
        };
        let electrodes = vec![Electrode { name: "plate".to_owned(), outline: outline.clone(), z: 0.0 }];
        let domain = Aabb { min: DVec3::splat(-WALL), max: DVec3::splat(WALL) };
        PlateInBox {
            name,
            design: SensorDesign { domain, electrodes, substrate, wall: Wall::Grounded },
            plate,
            below,
        }
    };
    let aligned = Plate::Square { size: 1.0, degrees: 0.0 };
    let disk = Outline::Disk { center: DVec2::ZERO, radius: 0.5 };
    Ok(vec![
        case("square", aligned, &square, None),
        case("square, turned by 30°", Plate::Square { size: 1.0, degrees: 30.0 }, &turned, None),
        case("disk", Plate::Disk { radius: 0.5 }, &disk, None),
        case("square on a board", aligned, &square, Some(false)),
        case("square on a board with a shield", aligned, &square, Some(true)),
    ])
}

impl PlateInBox {
    /// C in farads, in a box of a height above the plate.
    fn reference(&self, height: f64) -> f64 {
        let above = Layer { thickness: height, permittivity: 1.0 };
        capacitance(self.plate, 2.0 * WALL, [&[above], &self.below])
    }

    /// Of C, and of its changes, with bodies at all heights.
    pub(crate) fn compare(&self, sensors: &Halved) -> Result<[Comparison; 2]> {
        let mut simulators = sensors.simulators(Interface::EdgeCut, Connection::Grounded)?;
        let body = Shape::Box { size: DVec3::new(4.0 * WALL, 4.0 * WALL, 2.0 * WALL) };
        let mut solids = Solids::new(&[body])?;
        let empty = self.reference(WALL);
        let mut compared = [Comparison::default(), Comparison::default()];
        for height in CEILINGS {
            solids.place(&[Pose::at(DVec3::new(0.0, 0.0, height + WALL))])?;
            let bars = simulators.step(&solids)?;
            let own = &simulators.own;
            let (found, reference) = (own.capacitance().get(0, 0), self.reference(height));
            let (change, changed) = (found - own.base().get(0, 0), reference - empty);
            let [of_c, of_change] = &mut compared;
            of_c.add(found, reference, bars.capacitance.get(0, 0), reference);
            of_change.add(change, changed, bars.change.get(0, 0), changed);
        }
        Ok(compared)
    }
}
