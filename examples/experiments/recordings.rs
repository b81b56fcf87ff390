//! Recordings of a real grid of 3 by 2 electrodes that a robot moved past an arm. The arm's place, axis and radius, and when
//! in a recording the robot moved, are not known: one set is fitted to some runs, and the others are predicted.

use crate::minimum::minimum;
use capsense::Scene;
use capsense::core::geometry::{Pose, Shape};
use capsense::core::glam::{DQuat, DVec3};
use capsense::core::simulator::Simulator;
use capsense::core::solids::Solids;
use capsense::curve_table::{Clock, CurveTable};
use capsense::series::{Curve, best_lag, pearson};
use clap::Args;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Folders of the two motions.
const MOTIONS: [&str; 2] = ["arm_straight_through_Arm", "arm_vertical_movement"];

/// The electrode of each column of counts.
const COLUMNS: [usize; 6] = [4, 1, 6, 5, 2, 3];

const RUNS: usize = 5;

/// Pitch of the grid along x and y, in metres, and side of an electrode, which is not published.
const PITCH: [f64; 2] = [0.055, 0.07];
const SIDE: f64 = 0.03;

/// Where the limb's place is told, in metres of the recordings' frame.
const ORIGIN_Y: f64 = 1.2;

/// Length of the limb: it sticks out of the domain.
const LENGTH: f64 = 0.8;

/// Nearest that the limb's surface may come to the middle of an electrode.
const NEAREST: f64 = 0.004;

/// Samples that curves are averaged over where it says so: counts jitter by some units.
const SMOOTHING: usize = 15;

/// What ties the limb to ground instead of a wire, as in a scene file.
const COUPLINGS: [&str; 4] =
    ["{ capacitance = 100e-12 }", "{ capacitance = 10e-12 }", "{ capacitance = 1e-12 }", "\"floating\""];

/// Points at which the fit compares.
const POINTS: usize = 31;

/// Where the search begins: the axis at [`ORIGIN_Y`], x and z; its direction, in the plane and out of it; radius; then of each motion
/// when in the recording of counts, whose length is one, the recording of positions begins and ends.
const START: [f64; 9] = [-0.607, -0.295, 2.09, 0.138, 0.03, 0.0, 1.05, 0.0, 0.8];
const STEPS: [f64; 9] = [0.02, 0.02, 0.2, 0.1, 0.005, 0.02, 0.05, 0.02, 0.03];

/// Fit the limb of a folder of recordings to some runs and predict the others
#[derive(Debug, Args)]
pub(crate) struct RecordingsArguments {
    /// Folder with arm_straight_through_Arm and arm_vertical_movement
    folder: PathBuf,
    /// Runs to fit, of each motion; the others are predicted
    #[arg(long, value_delimiter = ',', default_value = "2,3")]
    fit: Vec<usize>,
    /// Elements of the mesh
    #[arg(long, default_value_t = 20_000)]
    elements: usize,
    /// How many limbs the search tries
    #[arg(long, default_value_t = 500)]
    most: usize,
}

/// One run: counts of each electrode, and where the first electrode was.
struct Run {
    counts: Vec<Curve>,
    places: [Curve; 3],
}

impl Run {
    fn read(folder: &Path, number: usize) -> anyhow::Result<Self> {
        let counts = CurveTable::load(&folder.join(format!("capacitance_data{number}.txt")))?;
        let places = CurveTable::load(&folder.join("electrode1.txt"))?;
        let whole = |table: &CurveTable, column: usize| -> anyhow::Result<Curve> {
            let curve = table.curve(&column.to_string(), Clock::Counts)?;
            let end = curve.span().1;
            Ok(curve.retimed(1.0 / end, 0.0)?)
        };
        let column_of = |electrode: usize| 1 + COLUMNS.iter().position(|at| *at == electrode).unwrap_or(0);
        Ok(Self {
            counts: (1..=6)
                .map(|electrode| whole(&counts, column_of(electrode)))
                .collect::<Result<_, _>>()?,
            places: [whole(&places, 1)?, whole(&places, 2)?, whole(&places, 3)?],
        })
    }

    /// Centre of the grid at a part of the recording of positions.
    fn centre(&self, part: f64) -> DVec3 {
        let [x, y, z] = &self.places;
        DVec3::new(x.at(part) - PITCH[0], y.at(part) - 0.5 * PITCH[1], z.at(part))
    }
}

/// The sensor and a limb of a radius.
struct Grid {
    simulator: Simulator,
}

impl Grid {
    fn new(elements: usize, coupling: &str) -> anyhow::Result<Self> {
        let mut text = format!(
            "domain = {{ min = [-0.25, -0.25, -0.25], max = [0.25, 0.25, 0.25], wall = \"open\" }}\n\
             mesh.generate = {{ elements = {elements} }}\nsimulation.geometry = \"solids\"\n"
        );
        for electrode in 0..6 {
            let [x, y] = place_of(electrode);
            writeln!(
                text,
                "[[sensor.electrode]]\nname = \"E{}\"\nrectangle = {{ center = [{x}, {y}], size = [{SIDE}, {SIDE}] }}",
                electrode + 1
            )?;
        }
        writeln!(
            text,
            "[[object]]\nname = \"limb\"\ncapsule = {{ radius = 0.04, length = {LENGTH} }}\n\
             material = {{ conductor = {coupling} }}\nposition = [0.0, 0.0, 0.1]"
        )?;
        let scene = Scene::parse("grid", &text, Path::new(""))?;
        let materials = vec![scene.objects[0].material];
        let simulator =
            Simulator::with_interface(scene.build_sensor()?, materials, scene.solver, scene.interface)?;
        Ok(Self { simulator })
    }

    /// Self-capacitances of all electrodes with the limb in places.
    fn curves(&mut self, radius: f64, limbs: &[Limb]) -> anyhow::Result<Vec<Vec<f64>>> {
        let mut solids = Solids::new(&[Shape::Capsule { radius, length: LENGTH }])?;
        let mut curves = vec![Vec::new(); 6];
        for limb in limbs {
            let rotation = DQuat::from_rotation_arc(DVec3::Z, limb.direction);
            solids.place(&[Pose { translation: limb.point, rotation }])?;
            let _ = self.simulator.step(&solids)?;
            for (electrode, curve) in curves.iter_mut().enumerate() {
                curve.push(self.simulator.capacitance().get(electrode, electrode));
            }
        }
        Ok(curves)
    }
}

/// Axis of the limb in the sensor's frame; the point is that nearest to the grid's centre, so that the limb's ends stay far.
struct Limb {
    point: DVec3,
    direction: DVec3,
}

impl Limb {
    /// Where it is at parts of a run's counts.
    fn places(p: &[f64], motion: usize, run: &Run, parts: &[f64]) -> Vec<Self> {
        let direction = DVec3::new(p[2].cos() * p[3].cos(), p[2].sin() * p[3].cos(), p[3].sin());
        let (begin, end) = (p[5 + 2 * motion], p[6 + 2 * motion]);
        let place = |part: &f64| {
            let centre = run.centre(((part - begin) / (end - begin)).clamp(0.0, 1.0));
            let axis = DVec3::new(p[0], ORIGIN_Y, p[1]) - centre;
            Self { point: axis - direction * axis.dot(direction), direction }
        };
        parts.iter().map(place).collect()
    }

    /// How near the axis comes to the middle of an electrode.
    fn gap(&self) -> f64 {
        let gap = |electrode| {
            let [x, y] = place_of(electrode);
            (DVec3::new(x, y, 0.0) - self.point).cross(self.direction).length()
        };
        (0..6).map(gap).fold(f64::INFINITY, f64::min)
    }
}

/// Place of an electrode in the sensor's frame: odd numbers at one side, even ones at the other.
fn place_of(electrode: usize) -> [f64; 2] {
    let side = if electrode.is_multiple_of(2) { 0.5 } else { -0.5 };
    [PITCH[0] * (1.0 - (electrode / 2) as f64), PITCH[1] * side]
}

fn parts(count: usize) -> Vec<f64> {
    (0..count).map(|k| k as f64 / (count - 1) as f64).collect()
}

/// Moving averages, shorter at both ends.
fn smoothed(curve: &Curve) -> Curve {
    let values = curve.values();
    let half = SMOOTHING / 2;
    let mean = |index: usize| {
        let around = &values[index.saturating_sub(half)..(index + half + 1).min(values.len())];
        around.iter().sum::<f64>() / around.len() as f64
    };
    let averaged = (0..values.len()).map(mean).collect();
    // Times are those of a curve.
    Curve::new(curve.times().to_vec(), averaged).unwrap_or_else(|_| curve.clone())
}

pub(crate) fn recordings(arguments: &RecordingsArguments) -> anyhow::Result<()> {
    let read = |motion: &str| -> anyhow::Result<Vec<Run>> {
        let folder = arguments.folder.join(motion);
        (1..=RUNS).map(|number| Run::read(&folder.join(number.to_string()), number)).collect()
    };
    let motions = MOTIONS.iter().map(|motion| read(motion)).collect::<anyhow::Result<Vec<_>>>()?;
    let fitted: Vec<usize> = arguments.fit.iter().map(|number| number.wrapping_sub(1)).collect();
    let fits = |number: &usize| *number < RUNS;
    anyhow::ensure!(!fitted.is_empty() && fitted.iter().all(fits), "--fit: runs are 1 to {RUNS}");
    let mut grid = Grid::new(arguments.elements, "\"grounded\"")?;
    let parts = parts(POINTS);
    let wanted: Vec<Vec<Vec<f64>>> = motions.iter().map(|runs| means(runs, &fitted, &parts)).collect();
    let missing = |p: &[f64]| mismatch(&mut grid, p, &motions, fitted[0], &parts, &wanted);
    let (found, missing) = minimum(&START, &STEPS, arguments.most, missing);
    println!("fitted to runs {:?} of each motion: mean r {:.4}", arguments.fit, 1.0 - missing);
    println!(
        "axis at y = {ORIGIN_Y} m: x {:.4}, z {:.4} m; direction {:.3}, {:.3} rad; radius {:.4} m",
        found[0], found[1], found[2], found[3], found[4]
    );
    println!(
        "positions begin and end at {:.3}, {:.3} and {:.3}, {:.3} of the counts\n",
        found[5], found[6], found[7], found[8]
    );
    for coupling in COUPLINGS {
        let mut grid = Grid::new(arguments.elements, coupling)?;
        let missing = mismatch(&mut grid, &found, &motions, fitted[0], &parts, &wanted);
        println!("the same limb, conductor = {coupling}: mean r {:.4}", 1.0 - missing);
    }
    println!();
    for (number, (name, runs)) in MOTIONS.iter().zip(&motions).enumerate() {
        let predicted: Vec<usize> = (0..RUNS).filter(|run| !fitted.contains(run)).collect();
        table(&mut grid, &found, (number, name), runs, &predicted)?;
    }
    Ok(())
}

/// Of each electrode the mean of smoothed runs.
fn means(runs: &[Run], which: &[usize], parts: &[f64]) -> Vec<Vec<f64>> {
    let mean = |electrode: usize| {
        let curves: Vec<Curve> = which.iter().map(|run| smoothed(&runs[*run].counts[electrode])).collect();
        parts.iter().map(|part| curves.iter().map(|curve| curve.at(*part)).sum()).collect()
    };
    (0..6).map(mean).collect()
}

/// One minus the mean r; what cannot be is worse than any r.
fn mismatch(
    grid: &mut Grid,
    p: &[f64],
    motions: &[Vec<Run>],
    run: usize,
    parts: &[f64],
    wanted: &[Vec<Vec<f64>>],
) -> f64 {
    if !(0.02..0.08).contains(&p[4]) || p[6] - p[5] < 0.3 || p[8] - p[7] < 0.3 {
        return 3.0;
    }
    let mut sum = 0.0;
    for (motion, runs) in motions.iter().enumerate() {
        let limbs = Limb::places(p, motion, &runs[run], parts);
        let lacks = limbs.iter().map(|limb| p[4] + NEAREST - limb.gap()).fold(0.0, f64::max);
        if lacks > 0.0 {
            return 3.0 + 10.0 * lacks;
        }
        let Ok(curves) = grid.curves(p[4], &limbs) else { return 3.0 };
        let r = curves.iter().zip(&wanted[motion]).map(|(a, b)| pearson(a, b).unwrap_or(0.0));
        sum += r.sum::<f64>();
    }
    1.0 - sum / 12.0
}

/// Pearson's r of predictions, beside those of the recordings of other runs.
fn table(
    grid: &mut Grid,
    p: &[f64],
    (motion, name): (usize, &str),
    runs: &[Run],
    predicted: &[usize],
) -> anyhow::Result<()> {
    println!(
        "{name}: mean r of runs {:?}, and of all pairs of runs",
        predicted.iter().map(|run| run + 1).collect::<Vec<_>>()
    );
    println!("electrode  as recorded: predicted, run to run   smoothed, at best lag: predicted, run to run");
    let times = parts(201);
    let mut simulated = Vec::new();
    for &run in predicted {
        let curves = grid.curves(p[4], &Limb::places(p, motion, &runs[run], &times))?;
        simulated.push(curves);
    }
    for electrode in 0..6 {
        let mut scores = [Vec::new(), Vec::new(), Vec::new(), Vec::new()];
        for (&run, curves) in predicted.iter().zip(&simulated) {
            let curve = Curve::new(times.clone(), curves[electrode].clone())?;
            let [raw, best] = both(&curve, &runs[run].counts[electrode])?;
            scores[0].push(raw);
            scores[2].push(best);
        }
        for one in 0..RUNS {
            for other in one + 1..RUNS {
                let [raw, best] = both(&runs[one].counts[electrode], &runs[other].counts[electrode])?;
                scores[1].push(raw);
                scores[3].push(best);
            }
        }
        let mean = scores.map(|all| all.iter().sum::<f64>() / all.len() as f64);
        println!(
            "E{}                    {:.3}  {:.3}                               {:.3}  {:.3}",
            electrode + 1,
            mean[0],
            mean[1],
            mean[2],
            mean[3]
        );
    }
    println!();
    Ok(())
}

/// Pearson's r at the samples of the second as they are; and of smoothed curves at their best lag.
fn both(one: &Curve, other: &Curve) -> anyhow::Result<[f64; 2]> {
    let raw = pearson(&one.resampled(other.times()), other.values()).unwrap_or(0.0);
    let best = best_lag(&smoothed(one), &smoothed(other))?.map_or(0.0, |lag| lag.pearson);
    Ok([raw, best])
}
