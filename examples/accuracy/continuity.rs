//! `accuracy continuity`: C11 while the grounded bar rises and while it moves sideways, in small steps.

use crate::cases::{BAR, DOMAIN, stripes};
use crate::plot::plot;
use crate::statistics::Statistics;
use anyhow::{Context, Result};
use capsense::core::geometry::{Aabb, Pose, Shape};
use capsense::core::glam::DVec3;
use capsense::core::material::{Connection, Material};
use capsense::core::occupancy::{DepthLayers, Interface, OrthographicView};
use capsense::core::sensor::Sensor;
use capsense::core::simulator::Simulator;
use capsense::core::solids::Solids;
use capsense::core::solver::SolverOptions;
use clap::Args;
use std::fs;
use std::path::{Path, PathBuf};

const TETS: usize = 30_000;

/// Of the self-capacitances.
const TOLERANCE: f64 = 1e-9;

/// In femtofarads: what is less may be an error of the solver, and counts as no response at all.
const FELT: f64 = 1e-5;

/// Between two places of the bar, in millimetres.
const STEP: f64 = 0.5;

/// Of the depth camera, across and down.
const PIXELS: usize = 256;

/// How steps of a moving bar are felt, by each interface model
#[derive(Args, Debug)]
pub(crate) struct ContinuityArguments {
    /// Where continuity.csv and continuity.svg are written
    #[arg(long, value_name = "DIR", default_value = "capsense-out")]
    out: PathBuf,
}

/// Moves the bar, writes the curves and prints what their steps are like.
pub(crate) fn continuity(arguments: &ContinuityArguments) -> Result<()> {
    let mut curves = Vec::new();
    for model in MODELS {
        for way in WAYS {
            curves.push(curve(model, way)?);
        }
    }
    println!("C11 of a grounded bar on {TETS} tetrahedra, in steps of {STEP} mm.\n");
    println!("{}", Statistics::HEADING);
    for curve in &curves {
        println!("{}", Statistics::of(curve).row(curve.model.name, curve.way.name));
    }
    for height in OTHER_HEIGHTS {
        let found = Statistics::of(&curve(SOLID, Way { height: Some(height), ..SIDEWAYS })?);
        println!("{}", found.row(SOLID.name, &format!("sideways, {height} mm above")));
    }
    let out = &arguments.out;
    fs::create_dir_all(out).with_context(|| format!("cannot make {}", out.display()))?;
    write(&out.join("continuity.csv"), &csv(&curves)?)?;
    write(&out.join("continuity.svg"), &plot(&curves)?)
}

/// How surfaces reach the mesh.
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct Model {
    pub(crate) name: &'static str,
    interface: Interface,
    /// Whether a depth camera sees the bar, or else its exact surface is known.
    camera: bool,
}

pub(crate) const SOLID: Model =
    Model { name: "edge-cut, solids", interface: Interface::EdgeCut, camera: false };
pub(crate) const CAMERA: Model =
    Model { name: "edge-cut, camera", interface: Interface::EdgeCut, camera: true };
pub(crate) const CENTROID: Model =
    Model { name: "centroid, solids", interface: Interface::Centroid, camera: false };

/// In the order in which they are drawn.
pub(crate) const MODELS: [Model; 3] = [CENTROID, CAMERA, SOLID];

/// A way of the bar along which C11 falls all the time.
#[derive(Clone, Copy)]
pub(crate) struct Way {
    pub(crate) name: &'static str,
    /// What changes, with its unit.
    pub(crate) label: &'static str,
    /// From and to where, in millimetres.
    pub(crate) range: [f64; 2],
    /// The height of the bar's lower face, in millimetres, if it moves along y.
    height: Option<f64>,
}

pub(crate) const UPWARDS: Way =
    Way { name: "upwards", label: "height of the bar's lower face [mm]", range: [20.0, 200.0], height: None };
pub(crate) const SIDEWAYS: Way = Way {
    name: "sideways",
    label: "shift of the bar along y, 50 mm above [mm]",
    range: [10.0, 100.0],
    height: Some(50.0),
};
/// Of more ways sideways, in millimetres: planes of nodes are within the bar, at its faces, and on either side of it.
const OTHER_HEIGHTS: [f64; 9] = [20.0, 25.0, 30.0, 35.0, 40.0, 60.0, 70.0, 80.0, 100.0];

pub(crate) const WAYS: [Way; 2] = [UPWARDS, SIDEWAYS];

/// C11 along a way.
pub(crate) struct Curve {
    pub(crate) model: Model,
    pub(crate) way: Way,
    /// In millimetres.
    pub(crate) places: Vec<f64>,
    /// By how much C11 exceeds that of the empty scene, in femtofarads.
    pub(crate) changes: Vec<f64>,
}

impl Curve {
    /// By how much C11 falls from each place to the next.
    pub(crate) fn falls(&self) -> Vec<f64> {
        let falls = self.changes.windows(2).map(|pair| pair[0] - pair[1]);
        falls.map(|fall| if fall.abs() < FELT { 0.0 } else { fall }).collect()
    }
}

/// Moves the bar along a way.
pub(crate) fn curve(model: Model, way: Way) -> Result<Curve> {
    let design = stripes();
    let sensor = Sensor::on_lattice(&design, &design.lattice(TETS)?)?;
    let options = SolverOptions { tolerance: TOLERANCE, ..SolverOptions::default() };
    let grounded = vec![Material::Conductor(Connection::Grounded)];
    let mut simulator = Simulator::with_interface(sensor, grounded, options, model.interface)?;
    let mut solids = Solids::new(&[Shape::Box { size: BAR }])?;
    let [from, to] = way.range;
    let steps = ((to - from) / STEP).round() as usize;
    let places: Vec<f64> = (0..=steps).map(|step| from + STEP * step as f64).collect();
    let mut changes = Vec::with_capacity(places.len());
    for &place in &places {
        let [height, shift] = way.height.map_or([place, 0.0], |height| [height, place]);
        let centre = DVec3::new(0.0, 1e-3 * shift, 1e-3 * height + 0.5 * BAR.z);
        let _ = if model.camera {
            simulator.step(&seen(Aabb { min: centre - 0.5 * BAR, max: centre + 0.5 * BAR }))?
        } else {
            solids.place(&[Pose::at(centre)])?;
            simulator.step(&solids)?
        };
        changes.push(1e15 * (simulator.capacitance().get(0, 0) - simulator.base().get(0, 0)));
    }
    Ok(Curve { model, way, places, changes })
}

/// What the depth camera sees of a box along the axes.
fn seen(solid: Aabb) -> DepthLayers {
    let view = OrthographicView { domain: DOMAIN, width: PIXELS, height: PIXELS };
    let mut depth = DepthLayers::empty(view, 1);
    let (front, back) = depth.layer_mut(0);
    for (pixel, (front, back)) in front.iter_mut().zip(back).enumerate() {
        let centre = view.pixel_centre(pixel % PIXELS, pixel / PIXELS);
        if solid.contains(centre.extend(solid.min.z)) {
            (*front, *back) = (solid.min.z as f32, solid.max.z as f32);
        }
    }
    depth
}

fn csv(curves: &[Curve]) -> Result<String> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(["model", "way", "place_mm", "C11_change_fF"])?;
    for curve in curves {
        for (place, change) in curve.places.iter().zip(&curve.changes) {
            let [place, change] = [place, change].map(ToString::to_string);
            writer.write_record([curve.model.name, curve.way.name, &place, &change])?;
        }
    }
    Ok(String::from_utf8(writer.into_inner()?)?)
}

fn write(path: &Path, text: &str) -> Result<()> {
    fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))?;
    eprintln!("{}", path.display());
    Ok(())
}
