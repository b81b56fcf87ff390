//! Scene files: everything of a simulation in one TOML file, in SI units. Every key is explained in docs/scene.md.
//!
//! [`Scene::load`] reads a file in two steps, each in files of its own: names and types, and checks of every value. What comes out are the core's types, ready for
//! [`Pipeline::new`](crate::pipeline::Pipeline::new).

mod check;
mod design;
mod electrode_stl;
mod generate;
mod geometry;
mod measurement;
mod mesh_file;
mod object;
mod raw;
mod source;
mod trajectory;
pub mod write;

pub use generate::{GeneratedMesh, MeshSize};
pub use geometry::{Geometry, GeometrySource};
pub use mesh_file::mesh_warnings;
pub use object::SceneObject;
pub use source::{SceneError, Source};

use crate::device::Device;
use crate::motion::frames_until_end;
use capsense_core::capacitance::CapacitanceMatrix;
use capsense_core::electrode::Electrode;
use capsense_core::geometry::Aabb;
use capsense_core::measurement::{Measurement, MeasurementModel};
use capsense_core::mesh::TetMesh;
use capsense_core::occupancy::{Interface, OrthographicView};
use capsense_core::sensor::{ElectrodeNodes, Sensor, SensorDesign, Wall};
use capsense_core::solver::{Preconditioner, SolverOptions};
use check::Checker;
use raw::{RawDevice, RawElectrode, RawInterface, RawPreconditioner, RawScene};
use std::path::Path;

/// The scene that runs when none is named: a grounded steel bar sweeps past three stripe electrodes.
const BUILT_IN: &str = include_str!("../../assets/scenes/steel_bar.toml");

/// What messages call it.
const BUILT_IN_NAME: &str = "steel_bar.toml (built in)";

/// More pixels than this along a side are a mistake.
const MOST_PIXELS: usize = 4096;

/// More frames than this are a mistake: a day at 100 frames per second.
const MOST_FRAMES: usize = 8_640_000;

/// Relative errors below this drown in the rounding of the sums that make up a capacitance.
const FINEST_TOLERANCE: f64 = 1e-14;

/// A scene whose every value has been checked.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The file it comes from, and where its keys are.
    pub source: Source,
    /// The simulated space.
    pub domain: Aabb,
    /// What lies beyond its outer wall.
    pub wall: Wall,
    /// The sensor and how it is meshed.
    pub sensor: SceneSensor,
    /// Names of the electrodes in the order of the capacitance matrix.
    pub electrodes: Vec<String>,
    /// Where surfaces come from.
    pub geometry: Geometry,
    /// The depth camera, if surfaces come from it.
    pub view: OrthographicView,
    /// Whether all that lies behind an object's front surface belongs to it.
    pub back_fill: bool,
    /// What surfaces of objects do to the mesh.
    pub interface: Interface,
    /// The objects, in the order of the file.
    pub objects: Vec<SceneObject>,
    /// Frames per second of scene time.
    pub frame_rate: f64,
    /// Number of frames.
    pub frames: usize,
    /// When and how the solver stops.
    pub solver: SolverOptions,
    /// Threads to use; 0 for all cores. Results do not depend on it.
    pub threads: usize,
    /// Where fields are computed.
    pub device: Device,
    /// What converters make of the capacitances, if there are any.
    pub measurement: Option<MeasurementModel>,
    /// What is odd but no error.
    pub warnings: Vec<String>,
}

/// A sensor before it has its stiffness matrix.
#[derive(Clone, Debug)]
pub enum SceneSensor {
    /// To be meshed.
    Generated {
        /// Domain, electrodes and board.
        design: SensorDesign,
        /// The mesh to be made for them.
        mesh: GeneratedMesh,
    },
    /// On a mesh from a file.
    Meshed {
        /// The mesh, the board's permittivity in it.
        mesh: TetMesh,
        /// Grounded nodes.
        ground: Vec<u32>,
        /// Electrodes by name.
        electrodes: Vec<(String, ElectrodeNodes)>,
    },
}

impl Scene {
    /// Reads a scene file; paths in it are relative to its folder.
    ///
    /// # Errors
    /// When it cannot be read or anything in it is wrong; the message names file, line and key.
    pub fn load(path: &Path) -> Result<Self, SceneError> {
        let bytes = std::fs::read(path).map_err(|error| SceneError::Read { path: path.to_owned(), error })?;
        let file = path.display().to_string();
        let text = std::str::from_utf8(&bytes).map_err(|error| {
            let line = 1 + bytes[..error.valid_up_to()].iter().filter(|byte| **byte == b'\n').count();
            SceneError::Invalid {
                file: file.clone(),
                line,
                key: None,
                message: "is not UTF-8 text".to_owned(),
            }
        })?;
        Self::parse(&file, text, path.parent().unwrap_or(Path::new("")))
    }

    /// Takes a scene from its text; `file` is what messages call it, `folder` what paths in it are relative to.
    ///
    /// # Errors
    /// When anything in it is wrong; the message names file, line and key.
    pub fn parse(file: &str, text: &str, folder: &Path) -> Result<Self, SceneError> {
        let (source, raw) = Source::parse(file, text)?;
        validate(Checker { source: &source, folder }, &raw)
    }

    /// The steel-bar scene that comes with the program.
    ///
    /// # Errors
    /// None, unless the program was built from a broken file.
    pub fn built_in() -> Result<Self, SceneError> {
        Self::parse(BUILT_IN_NAME, BUILT_IN, Path::new(""))
    }

    /// Meshes the sensor.
    ///
    /// # Errors
    /// When the mesh cannot resolve the electrodes, or none is as exact as was asked for; the message names file, line and
    /// key.
    pub fn build_sensor(&self) -> Result<Sensor, SceneError> {
        match &self.sensor {
            SceneSensor::Generated { design, mesh } => {
                mesh.build(&self.source, &self.electrodes, design, self.threads)
            }
            SceneSensor::Meshed { mesh, ground, electrodes } => {
                Sensor::on_mesh_within(self.wall, mesh.clone(), ground, electrodes.clone())
                    .map_err(|error| design::locate(&self.source, &self.electrodes, &error))
            }
        }
    }

    /// The converters of the scene, one scan a frame, if it has any. `base` is what the sensor has without objects: offset DACs
    /// are set and offsets calibrated by it.
    ///
    /// # Errors
    /// When it is a matrix of another sensor.
    pub fn measurement(&self, base: &CapacitanceMatrix) -> Result<Option<Measurement>, SceneError> {
        let begin = |model| Measurement::new(model, self.frame_rate, base);
        let measurement = self.measurement.as_ref().map(begin).transpose();
        measurement.map_err(|error| measurement::locate(&self.source, &error))
    }
}

fn validate(check: Checker<'_>, raw: &RawScene) -> Result<Scene, SceneError> {
    let electrodes = design::electrode_names(check, &raw.sensor)?;
    let mut warnings = Vec::new();
    let (domain, sensor) = sensor(check, raw, &electrodes, &mut warnings)?;
    let (view, back_fill) = camera(check, raw, domain)?;
    let objects = object::objects(check, &raw.object, &domain)?;
    let geometry = geometry::geometry(check, raw, &objects, &mut warnings)?;
    let frame_rate = check.positive("simulation.frame_rate", raw.simulation.frame_rate.unwrap_or(100.0))?;
    let frames = match raw.simulation.frames {
        Some(frames) => check.count("simulation.frames", frames, 1, MOST_FRAMES)?,
        None => {
            let frames = frames_until_end(objects.iter().map(|object| &object.motion), frame_rate);
            if frames > MOST_FRAMES as f64 {
                let message =
                    format!("{frames:.3e} frames until the trajectories end; at most {MOST_FRAMES}");
                return check.error("simulation.frame_rate", message);
            }
            frames as usize
        }
    };
    let times = (0..frames).step_by(frames.div_ceil(1000)).map(|frame| frame as f64 / frame_rate);
    for object in objects.iter().filter(|object| !object.meets(&domain, times.clone())) {
        warnings.push(format!("{}: object `{}` never enters the domain", check.source.file(), object.name));
    }
    let defaults = SolverOptions::default();
    let tolerance = check.fraction("solver.tolerance", raw.solver.tolerance.unwrap_or(defaults.tolerance))?;
    if tolerance < FINEST_TOLERANCE {
        let message =
            format!("must be at least {FINEST_TOLERANCE:e}, which is rounding, but is {tolerance:e}");
        return check.error("solver.tolerance", message);
    }
    let change_tolerance = raw.solver.change_tolerance;
    let change_tolerance =
        change_tolerance.map(|tolerance| check.fraction("solver.change_tolerance", tolerance)).transpose()?;
    let preconditioner = match raw.solver.preconditioner {
        Some(RawPreconditioner::Multigrid) => Preconditioner::Multigrid,
        Some(RawPreconditioner::Ic0) => Preconditioner::Ic0,
        Some(RawPreconditioner::Direct) => Preconditioner::Direct,
        Some(RawPreconditioner::Jacobi) => Preconditioner::Jacobi,
        Some(RawPreconditioner::None) => Preconditioner::None,
        None => defaults.preconditioner,
    };
    let device = match raw.solver.device {
        None | Some(RawDevice::Cpu) => Device::Cpu,
        Some(RawDevice::Gpu) => Device::Gpu,
        Some(RawDevice::Auto) => Device::Auto,
    };
    let threads = check.count("solver.threads", raw.solver.threads.unwrap_or(0), 0, 1024)?;
    let measurement = measurement::measurement(check, raw.measurement.as_ref(), &electrodes, frame_rate)?;
    Ok(Scene {
        source: check.source.clone(),
        domain,
        wall: design::wall(&raw.domain),
        sensor,
        electrodes,
        geometry,
        view,
        back_fill,
        interface: match raw.simulation.interface {
            None | Some(RawInterface::EdgeCut) => Interface::EdgeCut,
            Some(RawInterface::Centroid) => Interface::Centroid,
            Some(RawInterface::VolumeFraction) => Interface::VolumeFraction,
        },
        objects,
        frame_rate,
        frames,
        solver: SolverOptions {
            tolerance,
            change_tolerance,
            preconditioner,
            threads: (threads > 0).then_some(threads),
            ..defaults
        },
        threads,
        device,
        measurement,
        warnings,
    })
}

fn sensor(
    check: Checker<'_>,
    raw: &RawScene,
    names: &[String],
    warnings: &mut Vec<String>,
) -> Result<(Aabb, SceneSensor), SceneError> {
    for (key, given) in [("mesh.unit", raw.mesh.unit.is_some()), ("mesh.groups", raw.mesh.groups.is_some())] {
        if given && raw.mesh.file.is_none() {
            return check.error(key, "goes with `mesh.file`");
        }
    }
    if let Some(file) = &raw.mesh.file {
        if raw.mesh.generate.is_some() {
            return check.error("mesh", "has both `generate` and `file`; give one of them");
        }
        return mesh_file::sensor(check, raw, file, names, warnings);
    }
    let domain = design::domain(check, &raw.domain)?.unwrap_or(design::DEFAULT_DOMAIN);
    let electrodes = raw
        .sensor
        .electrode
        .iter()
        .enumerate()
        .map(|(index, raw)| shaped_electrode(check, index, raw))
        .collect::<Result<Vec<_>, _>>()?;
    let substrate = match &raw.sensor.substrate {
        Some(raw) => Some(design::substrate(check, raw)?),
        None => None,
    };
    let design = SensorDesign { domain, electrodes, substrate, wall: design::wall(&raw.domain) };
    design.validate().map_err(|error| design::locate(check.source, names, &error))?;
    let mesh = generate::mesh(check, raw.mesh.generate.as_ref(), &design)?;
    Ok((domain, SceneSensor::Generated { design, mesh }))
}

fn shaped_electrode(check: Checker<'_>, index: usize, raw: &RawElectrode) -> Result<Electrode, SceneError> {
    let key = format!("sensor.electrode[{index}]");
    match design::electrode(check, &key, raw)? {
        Some(electrode) => Ok(electrode),
        None => check.error(&key, "has no shape: give `rectangle`, `disk`, `polygon` or `stl`"),
    }
}

fn camera(check: Checker<'_>, raw: &RawScene, domain: Aabb) -> Result<(OrthographicView, bool), SceneError> {
    let [width, height] = raw.camera.pixels.map_or([64, 64], |pixels| *pixels);
    let width = check.count("camera.pixels[0]", width, 1, MOST_PIXELS)?;
    let height = check.count("camera.pixels[1]", height, 1, MOST_PIXELS)?;
    let layers = check.count("camera.layers", raw.camera.layers.unwrap_or(2), 1, 2)?;
    let back_fill = match (layers, raw.simulation.back_fill) {
        (1, Some(false)) => {
            let message = "must not be false with camera.layers = 1: one layer has no back";
            return check.error("simulation.back_fill", message);
        }
        (1, _) => true,
        (_, wanted) => wanted.unwrap_or(false),
    };
    Ok((OrthographicView { domain, width, height }, back_fill))
}
