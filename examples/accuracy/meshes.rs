//! `accuracy meshes`: what a tolerance of ΔC costs on every kind of mesh, and how well it is kept at poses that are no probes.

use crate::cases::{BAR, stripes};
use anyhow::{Context, Result};
use capsense::Scene;
use capsense::core::geometry::{Pose, Shape};
use capsense::core::glam::{DQuat, DVec3};
use capsense::core::material::{Connection, Material};
use capsense::core::occupancy::{DepthLayers, OrthographicView};
use capsense::core::sensor::{MeshKind, Sensor, SensorDesign};
use capsense::core::simulator::{Simulator, StepReport};
use capsense::core::solids::Solids;
use capsense::core::solver::SolverOptions;
use capsense::core::workspace::{Change, MeshRequest, WorkspaceError, most_accurate};
use capsense::evidence::clock::thread_seconds;
use capsense::render::{Backend, DepthRenderer};
use clap::Args;
use std::path::PathBuf;
use std::time::Instant;

const TOLERANCES: [f64; 3] = [0.03, 0.01, 0.003];

/// Far below what is compared, also for bodies that change C by a thousandth.
const EXACT: f64 = 1e-7;

/// Of C, in frames that are timed.
const OF_FRAMES: f64 = 1e-4;

/// Tetrahedra of the lattice that errors are measured against.
const REFERENCE: usize = 25_000_000;
const QUICK_REFERENCE: usize = 1_500_000;

/// Numbers of tetrahedra of meshes beside those that were chosen.
const SIZES: [usize; 5] = [30_000, 100_000, 300_000, 1_000_000, 3_000_000];

/// The bar's way in millimetres: heights above the electrodes, and along y, 50 mm above them.
const HEIGHTS: [i32; 2] = [20, 200];
const ASIDE: [i32; 2] = [-120, 120];

/// Meshes for tolerances: their errors and the time of a frame, beside lattices that are not graded
#[derive(Args, Debug)]
pub(crate) struct MeshesArguments {
    /// Tolerances of 3 and 1 % only, and a coarser reference
    #[arg(long)]
    quick: bool,
    /// A scene with the same three stripes on another mesh, for one more row
    #[arg(long, value_name = "FILE.toml")]
    scene: Option<PathBuf>,
    /// Only meshes whose description contains this
    #[arg(long, default_value = "")]
    only: String,
    /// Numbers of tetrahedra of meshes that are not chosen by tolerance
    #[arg(long, value_delimiter = ',', default_values_t = SIZES)]
    elements: Vec<usize>,
    /// Only times, no errors
    #[arg(long)]
    times: bool,
    /// Bodies as a depth camera of so many pixels along either axis sees them, front and back, instead of exact solids;
    /// drawing the images takes no part of the times
    #[arg(long, value_name = "N")]
    pixels: Option<usize>,
}

/// A body at a pose.
type Placed = (Shape, Pose);

/// Prints one row for each mesh.
pub(crate) fn meshes(arguments: &MeshesArguments) -> Result<()> {
    let design = stripes();
    let table = Table::begin(arguments, &design)?;
    let kinds = [("lattice", MeshKind::Lattice), ("bisection", MeshKind::Bisection)];
    let tolerances = if arguments.quick { &TOLERANCES[..2] } else { &TOLERANCES[..] };
    for (name, kind) in kinds {
        for &tolerance in tolerances {
            let name = format!("{name}, tolerance {} %", 100.0 * tolerance);
            table.row(&name, || chosen(&design, tolerance, kind))?;
        }
    }
    for (name, kind) in kinds {
        for &size in &arguments.elements {
            let sensor = || Ok((most_accurate(&design, kind, size, None)?, String::new()));
            table.row(&format!("{name}, elements"), sensor)?;
        }
    }
    for &size in &arguments.elements {
        table.row("even lattice", || Ok((even(&design, size)?, String::new())))?;
    }
    if let Some(path) = &arguments.scene {
        let scene = Scene::load(path).context("the scene of --scene")?;
        table.row("file", || Ok((scene.build_sensor()?, String::new())))?;
    }
    Ok(())
}

/// What rows are compared with.
struct Table {
    /// Of each group of bodies, if errors are asked for.
    exact: Option<[Vec<Change>; 3]>,
    only: String,
    pixels: Option<usize>,
}

impl Table {
    fn begin(arguments: &MeshesArguments, design: &SensorDesign) -> Result<Self> {
        let finest = if arguments.quick { QUICK_REFERENCE } else { REFERENCE };
        let exact = match arguments.times {
            true => None,
            false => {
                // With the lowest layers: of three stripes, what these make of bars is off by 0.03 % of what 40 million do.
                let lattices = design.lattices_of_lower_layers(finest)?;
                let reference = Sensor::on_lattice(design, lattices.last().context("no lattice")?)?;
                let [over, aside, others] = groups().map(|bodies| changes(&reference, &bodies, None));
                Some([over?, aside?, others?])
            }
        };
        println!(
            "Errors in % of the changes on a lattice of up to {finest} tetrahedra: the mean of the entries in the worst pose, and \
             the worst entry. Milliseconds of a frame, update and solve, one thread, its own time, C to {OF_FRAMES:e}, means and \
             medians of ways there and back.\n"
        );
        println!(
            "| mesh | tetrahedra | bars over the middle | worst entry | bars aside | worst entry | other bodies | worst entry \
             | ms up and down | ms sideways | ms of both |"
        );
        println!("|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|");
        Ok(Self { exact, only: arguments.only.clone(), pixels: arguments.pixels })
    }

    /// Prints a row, if it is wanted: of a sensor and what else there is to say of it.
    fn row(&self, name: &str, sensor: impl Fn() -> Result<(Sensor, String)>) -> Result<()> {
        if !name.contains(&self.only) {
            return Ok(());
        }
        let (sensor, note) = match sensor() {
            Ok(made) => made,
            Err(refused) if refused.is::<WorkspaceError>() => {
                println!("| {name}: {refused} | | | | | | | | | | |");
                return Ok(());
            }
            Err(other) => return Err(other),
        };
        let cells = match &self.exact {
            None => " | | | | | |".to_owned(),
            Some(exact) => {
                let errors = groups().into_iter().zip(exact).map(|(bodies, exact)| {
                    let [of_all, largest] = worst(&changes(&sensor, &bodies, self.pixels)?, exact)?;
                    Ok(format!(" {of_all:.2} | {largest:.2} |"))
                });
                errors.collect::<Result<String>>()?
            }
        };
        let times =
            milliseconds(&sensor, self.pixels)?.map(|[mean, median]| format!("{mean:.3}, {median:.3}"));
        println!("| {name}{note} | {} |{cells} {} |", sensor.mesh().tets().len(), times.join(" | "));
        Ok(())
    }
}

/// The smallest mesh for a tolerance, and what its choice took and promised.
fn chosen(design: &SensorDesign, tolerance: f64, kind: MeshKind) -> Result<(Sensor, String)> {
    let start = Instant::now();
    let choice = MeshRequest::new(design, tolerance, kind).choose(design)?;
    let seconds = start.elapsed().as_secs_f64();
    let note = format!(" (estimated {:.2} %, chosen in {seconds:.1} s)", 100.0 * choice.error);
    Ok((choice.sensor, note))
}

/// The finest lattice of nearly equal cells.
fn even(design: &SensorDesign, elements: usize) -> Result<Sensor> {
    let count = |spacing: f64| design.lattice_of_spacing(spacing, 1.0).map(|lattice| lattice.tet_count());
    let (mut fits, mut exceeds) = (0.1, 1e-3);
    for _ in 0..20 {
        let middle = 0.5 * (fits + exceeds);
        *(if count(middle)? <= elements { &mut fits } else { &mut exceeds }) = middle;
    }
    Ok(Sensor::on_lattice(design, &design.lattice_of_spacing(fits, 1.0)?)?)
}

/// What errors are told of: bars over the middle of the sensor, bars aside, none of them where the choice of a mesh looks, and others.
fn groups() -> [Vec<Placed>; 3] {
    let gaps = 0..19;
    let over = gaps.map(|step| bar([0.0, 0.0, 20.0 + 10.0 * f64::from(step)])).collect();
    let aside =
        [[0.0, 60.0, 20.0], [0.0, 60.0, 50.0], [50.0, 30.0, 35.0], [50.0, -30.0, 80.0], [0.0, -110.0, 50.0]];
    [over, aside.map(bar).to_vec(), others()]
}

/// The bar of the steel bar's scene, with its lower face so far above the electrodes, millimetres.
fn bar([x, y, gap]: [f64; 3]) -> Placed {
    (Shape::Box { size: BAR }, Pose::at(1e-3 * DVec3::new(x, y, gap) + 0.5 * BAR.z * DVec3::Z))
}

/// Bodies of other shapes, or turned.
fn others() -> Vec<Placed> {
    let at = |x: f64, y: f64, z: f64| Pose::at(1e-3 * DVec3::new(x, y, z));
    let turned = |pose: Pose, axis: DVec3, degrees: f64| Pose {
        rotation: DQuat::from_axis_angle(axis.normalize(), degrees.to_radians()),
        ..pose
    };
    let ball = Shape::Sphere { radius: 0.04 };
    let hand = Shape::Box { size: DVec3::new(0.1, 0.08, 0.03) };
    let arm = Shape::Capsule { radius: 0.03, length: 0.1 };
    vec![
        (Shape::Box { size: BAR }, turned(at(0.0, 0.0, 60.0), DVec3::Z, 30.0)),
        (Shape::Box { size: BAR }, turned(at(0.0, 0.0, 110.0), DVec3::X, 30.0)),
        (ball.clone(), at(10.0, 5.0, 70.0)),
        (ball, at(10.0, 5.0, 120.0)),
        (hand.clone(), at(3.0, 2.0, 35.0)),
        (hand, turned(at(0.0, 0.0, 80.0), DVec3::new(1.0, 1.0, 2.0), 25.0)),
        (arm, turned(at(0.0, 10.0, 60.0), DVec3::X, 70.0)),
    ]
}

fn simulator(sensor: &Sensor, tolerance: f64, threads: Option<usize>) -> Result<Simulator> {
    let options = SolverOptions { tolerance, threads, ..SolverOptions::default() };
    Ok(Simulator::new(sensor.clone(), vec![Material::Conductor(Connection::Grounded)], options)?)
}

/// What bodies change C by, as exact solids or as a camera of so many pixels sees them.
fn changes(sensor: &Sensor, bodies: &[Placed], pixels: Option<usize>) -> Result<Vec<Change>> {
    let mut simulator = simulator(sensor, EXACT, None)?;
    let mut changes = Vec::new();
    for (shape, pose) in bodies {
        let mut body = Body::new(shape, pixels)?;
        body.place(pose)?;
        let _ = body.step(&mut simulator)?;
        changes.push(Change::between(simulator.base(), simulator.capacitance()));
    }
    Ok(changes)
}

/// A body, and how a simulator learns of it.
enum Body {
    Solid(Solids),
    Seen(Box<DepthRenderer>, DepthLayers),
}

impl Body {
    fn new(shape: &Shape, pixels: Option<usize>) -> Result<Self> {
        let shapes = std::slice::from_ref(shape);
        let Some(pixels) = pixels else { return Ok(Self::Solid(Solids::new(shapes)?)) };
        let view = OrthographicView { domain: stripes().domain, width: pixels, height: pixels };
        let renderer = DepthRenderer::new(Backend::Cpu, view, shapes)?;
        Ok(Self::Seen(Box::new(renderer), DepthLayers::empty(view, 1)))
    }

    fn place(&mut self, pose: &Pose) -> Result<()> {
        match self {
            Self::Solid(solids) => solids.place(std::slice::from_ref(pose))?,
            Self::Seen(renderer, depth) => renderer.render(std::slice::from_ref(pose), depth)?,
        }
        Ok(())
    }

    fn step(&self, simulator: &mut Simulator) -> Result<StepReport> {
        Ok(match self {
            Self::Solid(solids) => simulator.step(solids)?,
            Self::Seen(_, depth) => simulator.step(depth)?,
        })
    }
}

/// In percent: the largest error of all entries of a pose, and that of one entry.
fn worst(changes: &[Change], exact: &[Change]) -> Result<[f64; 2]> {
    let mut worst = [0.0f64; 2];
    for (change, exact) in changes.iter().zip(exact) {
        let error = change.error(exact).context("a body that no electrode feels")?;
        worst = [worst[0].max(100.0 * error.of_all), worst[1].max(100.0 * error.largest)];
    }
    Ok(worst)
}

/// Of all frames of the bar's ways up and down, sideways, and of both, 1 mm a frame, the mean and the median; of the ways there and
/// back the second. Solids are placed within a frame, images are there before it.
fn milliseconds(sensor: &Sensor, pixels: Option<usize>) -> Result<[[f64; 2]; 3]> {
    let [low, high] = HEIGHTS;
    let up = (low..high).chain((low + 1..=high).rev()).map(|gap| DVec3::new(0.0, 0.0, f64::from(gap) + 10.0));
    let [left, right] = ASIDE;
    let sideways = (left..right).chain((left + 1..=right).rev()).map(|y| DVec3::new(0.0, f64::from(y), 60.0));
    let began = Instant::now();
    let [mut of_up, mut of_sideways] = [Vec::new(), Vec::new()];
    for (of_way, way) in
        [&mut of_up, &mut of_sideways].into_iter().zip([up.collect::<Vec<_>>(), sideways.collect()])
    {
        let mut simulator = simulator(sensor, OF_FRAMES, Some(1))?;
        let mut body = Body::new(&Shape::Box { size: BAR }, pixels)?;
        let mut took = Vec::with_capacity(2 * way.len());
        for place in way.iter().chain(&way) {
            let pose = Pose::at(1e-3 * *place);
            if pixels.is_some() {
                body.place(&pose)?;
            }
            let start = seconds(&began);
            if pixels.is_none() {
                body.place(&pose)?;
            }
            let _ = body.step(&mut simulator)?;
            took.push(1e3 * (seconds(&began) - start));
        }
        *of_way = took.split_off(way.len());
    }
    let of_both = [&of_up[..], &of_sideways].concat();
    Ok([of_up, of_sideways, of_both].map(|mut took| {
        took.sort_unstable_by(f64::total_cmp);
        [took.iter().sum::<f64>() / took.len() as f64, took[took.len() / 2]]
    }))
}

/// Processor time of this thread where the system tells it, else since it began. Other programs count for less then, but they
/// take room in caches.
fn seconds(began: &Instant) -> f64 {
    thread_seconds().unwrap_or_else(|| began.elapsed().as_secs_f64())
}
