//! What is not published of section V-B, fitted to two measured curves of the stripe electrode: one set for both.
//!
//! A vertical rod passes three stripes of 100 mm; measured is the coupling of two neighbours. Scale is not to be had from curves
//! without units, so the stripes' length is given; with it go width and gap of the stripes, radius and clearance of the
//! rod, its way per sample, and the corners of both trajectories.

use crate::map::Map;
use crate::minimum::minimum;
use capsense::Scene;
use capsense::core::geometry::Pose;
use capsense::core::glam::{DVec2, DVec3};
use capsense::curve_table::{Clock, CurveTable};
use capsense::series::{Curve, pearson};
use clap::Args;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Length of the stripes in metres.
const LENGTH: f64 = 0.1;

/// Length of the rod in metres: its far end is out of reach.
const ROD: f64 = 0.15;

/// The speed of both curves in metres per second.
const SPEED: f64 = 0.116;

/// Passes of the zig-zag.
const PASSES: f64 = 10.0;

/// Where the tip of the rod is in maps of the triangle's plane, which are even in the logarithm of its height.
const TIP: (f64, f64) = (0.003, 0.14);

/// Where searches begin: way per sample; first sample, samples a pass, pitch and centre of the zig-zag; first sample, left and
/// right corner, and apex of the triangle above its base.
const START: [f64; 11] = [0.0041, 2.3, 48.1, 0.0175, 0.0015, -0.0007, 26.8, -0.1, 0.086, -0.007, 0.0355];
const STEPS: [f64; 11] = [0.0003, 0.5, 0.05, 0.001, 0.003, 0.003, 2.0, 0.01, 0.01, 0.005, 0.01];

/// Fit what is not published of section V-B to the curves in a folder, one set for both
#[derive(Debug, Args)]
pub(crate) struct FitArguments {
    /// Folder with fig9_stripe_triangular_measured.csv and fig9_stripe_zigzag_measured.csv
    folder: PathBuf,
    /// Widths of a stripe to try, in metres
    #[arg(long, value_delimiter = ',', default_value = "0.005,0.008")]
    width: Vec<f64>,
    /// Gaps between stripes to try, in metres
    #[arg(long, value_delimiter = ',', default_value = "0.004")]
    gap: Vec<f64>,
    /// Radii of the rod to try, in metres
    #[arg(long, value_delimiter = ',', default_value = "0.004,0.005,0.006")]
    radius: Vec<f64>,
    /// Heights of the rod's tip above the stripes to try, in metres
    #[arg(long, value_delimiter = ',', default_value = "0.003,0.004")]
    clearance: Vec<f64>,
    /// Elements of the mesh
    #[arg(long, default_value_t = 150_000)]
    elements: usize,
}

/// What is the same for all trajectories.
#[derive(Clone, Copy)]
struct Setup {
    width: f64,
    gap: f64,
    radius: f64,
    clearance: f64,
}

impl Setup {
    fn scene(self, elements: usize) -> anyhow::Result<Scene> {
        let mut text = format!(
            "domain = {{ min = [-0.3, -0.3, -0.05], max = [0.3, 0.3, 0.35] }}\n\
             mesh.generate = {{ elements = {elements} }}\nsimulation.geometry = \"solids\"\n"
        );
        for stripe in [-1.0, 0.0, 1.0] {
            let (y, width) = (stripe * (self.width + self.gap), self.width);
            writeln!(
                text,
                "[[sensor.electrode]]\nname = \"{stripe}\"\n\
                 rectangle = {{ center = [0.0, {y}], size = [{LENGTH}, {width}] }}"
            )?;
        }
        let radius = self.radius;
        writeln!(
            text,
            "[[object]]\nname = \"rod\"\ncylinder = {{ radius = {radius}, length = {ROD} }}\n\
             material = {{ conductor = \"grounded\" }}\nposition = [0.0, 0.0, 0.2]"
        )?;
        Ok(Scene::parse("fit", &text, Path::new(""))?)
    }

    /// Middle of the gap between the first two stripes.
    fn gap_y(self) -> f64 {
        -0.5 * (self.width + self.gap)
    }
}

/// The measured curves, and what couples the first two stripes with the rod anywhere.
struct Problem {
    triangular: Curve,
    zigzag: Curve,
    setup: Setup,
    flat: Map,
    upright: Map,
}

impl Problem {
    fn new(arguments: &FitArguments, setup: Setup) -> anyhow::Result<Self> {
        let read = |name: &str| -> anyhow::Result<Curve> {
            let table = CurveTable::load(&arguments.folder.join(name))?;
            Ok(table.curve("normalized_capacitance", Clock::Counts)?)
        };
        let scene = setup.scene(arguments.elements)?;
        let place = |x: f64, y: f64, tip: f64| Pose::at(DVec3::new(x, y, tip + 0.5 * ROD));
        let reach = DVec2::new(0.1, 0.12);
        let steps = DVec2::new(0.005, 0.003);
        let flat = Map::new(&scene, (-reach, reach), steps, |at| place(at.x, at.y, setup.clearance))?;
        let (low, high) = (TIP.0.ln(), TIP.1.ln());
        let corners = (DVec2::new(-0.13, low), DVec2::new(0.13, high));
        let steps = DVec2::new(0.005, (high - low) / 20.0);
        let upright = Map::new(&scene, corners, steps, |at| place(at.x, setup.gap_y(), at.y.exp()))?;
        Ok(Self {
            triangular: read("fig9_stripe_triangular_measured.csv")?,
            zigzag: read("fig9_stripe_zigzag_measured.csv")?,
            setup,
            flat,
            upright,
        })
    }

    /// Pearson's r of the zig-zag and of the triangle.
    fn scores(&self, p: &[f64]) -> [f64; 2] {
        let zigzag = corners_of_zigzag(p, self.setup.gap_y());
        let triangle = corners_of_triangle(p, self.setup.clearance);
        let coupling = |map: &Map, at: DVec2| -map.at(map.entry(0, 1), at);
        [
            score(&self.zigzag, |sample| coupling(&self.flat, along(&zigzag, p[0] * (sample - p[1])))),
            score(&self.triangular, |sample| {
                let at = along(&triangle, p[0] * (sample - p[6]));
                coupling(&self.upright, DVec2::new(at.x, at.y.max(TIP.0).ln()))
            }),
        ]
    }
}

fn score(measured: &Curve, simulated: impl Fn(f64) -> f64) -> f64 {
    let simulated: Vec<f64> = measured.times().iter().map(|sample| simulated(*sample)).collect();
    pearson(&simulated, measured.values()).unwrap_or(-1.0)
}

/// Corners in x and y: passes across the stripes, each farther along them by a pitch.
fn corners_of_zigzag(p: &[f64], gap_y: f64) -> Vec<DVec2> {
    let (pitch, centre) = (p[3], DVec2::new(p[4], gap_y + p[5]));
    let half = 0.5 * ((p[0] * p[2]).powi(2) - pitch * pitch).max(0.0).sqrt();
    let corner = |k: i32| {
        let side = if k % 2 == 0 { -half } else { half };
        centre + DVec2::new(pitch * (f64::from(k) - 0.5 * PASSES), side)
    };
    (0..=PASSES as i32).map(corner).collect()
}

/// Corners in x and z, twice around and a little: up to the apex, down again, and back along the stripes.
fn corners_of_triangle(p: &[f64], clearance: f64) -> Vec<DVec2> {
    let corners = [(p[7], 0.0), (p[9], p[10].max(0.0)), (p[8], 0.0)];
    corners.iter().cycle().take(10).map(|&(x, z)| DVec2::new(x, clearance + z)).collect()
}

/// The place after a length along a polyline.
fn along(corners: &[DVec2], length: f64) -> DVec2 {
    let mut left = length.max(0.0);
    for pair in corners.windows(2) {
        let leg = pair[0].distance(pair[1]);
        if left < leg {
            return pair[0].lerp(pair[1], left / leg);
        }
        left -= leg;
    }
    corners[corners.len() - 1]
}

pub(crate) fn fit(arguments: &FitArguments) -> anyhow::Result<()> {
    println!("width  gap    radius clearance  r zig-zag  triangular  mm per sample");
    let mut best: Option<(f64, Setup, Vec<f64>)> = None;
    for &width in &arguments.width {
        for &gap in &arguments.gap {
            for &radius in &arguments.radius {
                for &clearance in &arguments.clearance {
                    let setup = Setup { width, gap, radius, clearance };
                    let problem = Problem::new(arguments, setup)?;
                    let (found, missing) =
                        minimum(&START, &STEPS, 4000, |p| problem.scores(p).iter().map(|r| 1.0 - r).sum());
                    let [zigzag, triangular] = problem.scores(&found);
                    let way = 1e3 * found[0];
                    println!(
                        "{width:.4} {gap:.4} {radius:.4} {clearance:.4}     {zigzag:.4}     {triangular:.4}      {way:.3}"
                    );
                    if best.as_ref().is_none_or(|(least, ..)| missing < *least) {
                        best = Some((missing, setup, found));
                    }
                }
            }
        }
    }
    if let Some((_, setup, found)) = best {
        tell(setup, &found);
    }
    Ok(())
}

fn tell(setup: Setup, p: &[f64]) {
    let Setup { width, gap, radius, clearance } = setup;
    println!("\nBest: width {width} gap {gap} radius {radius} clearance {clearance} m");
    println!("{:.2} samples per second at {SPEED} m/s", SPEED / p[0]);
    let list = |corners: &[DVec2]| {
        corners.iter().map(|c| format!("({:.4}, {:.4})", c.x, c.y)).collect::<Vec<_>>().join(" ")
    };
    println!("zig-zag from sample {:.2}, x and y: {}", p[1], list(&corners_of_zigzag(p, setup.gap_y())));
    println!("triangle from sample {:.2}, x and z: {}", p[6], list(&corners_of_triangle(p, clearance)[..4]));
}
