//! Where a scene's fields are computed: on the processor, or on a graphics device.

use crate::pipeline::PipelineError;
use crate::scene::{Geometry, Scene};
use capsense_core::occupancy::{Interface, may_change_weights};
use capsense_core::sensor::Sensor;
use capsense_core::simulator::{Simulator, SimulatorError};
use capsense_core::solids::Solids;
use capsense_core::solver::RemoteProblem;
use capsense_render::fields::{Camera, GpuFields, GpuNetwork, Objects};

/// What a scene asks for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Device {
    /// The processor.
    #[default]
    Cpu,
    /// A graphics adapter, even one in software. It is an error if there is none, or it cannot take the scene.
    Gpu,
    /// Whichever is faster for this scene, as measured once; the processor where there is no real graphics adapter.
    Auto,
}

impl Device {
    /// Its name in scene files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            Self::Gpu => "gpu",
            Self::Auto => "auto",
        }
    }
}

/// The fields of a scene on a graphics adapter.
#[derive(Debug)]
pub(crate) enum Graphics {
    /// Those of a lattice.
    Lattice(GpuFields),
    /// Those of any other mesh.
    Network(GpuNetwork),
}

impl Graphics {
    /// Those of a lattice, which may find the objects, too.
    pub(crate) fn lattice(&self) -> Option<&GpuFields> {
        match self {
            Self::Lattice(fields) => Some(fields),
            Self::Network(_) => None,
        }
    }

    /// Name of the adapter and its driver.
    pub(crate) fn description(&self) -> String {
        match self {
            Self::Lattice(fields) => fields.description(),
            Self::Network(network) => network.description(),
        }
    }
}

/// A simulator, and the graphics device that its fields are on, if they are on one.
pub(crate) struct Placed {
    pub(crate) simulator: Simulator,
    pub(crate) gpu: Option<Graphics>,
}

/// The simulator of a scene on the processor.
pub(crate) fn on_cpu(scene: &Scene, sensor: Sensor) -> Result<Placed, PipelineError> {
    let materials = scene.objects.iter().map(|object| object.material).collect();
    let simulator = Simulator::with_interface(sensor, materials, scene.solver, scene.interface)?;
    Ok(Placed { simulator, gpu: None })
}

/// The simulator of a scene on a graphics adapter.
pub(crate) fn on_gpu(scene: &Scene, sensor: Sensor, allow_software: bool) -> Result<Placed, PipelineError> {
    let materials: Vec<_> = scene.objects.iter().map(|object| object.material).collect();
    if sensor.lattice().is_none() {
        let problem = Simulator::network_problem(&sensor, &materials, scene.interface)?;
        let network = GpuNetwork::new(problem, allow_software).map_err(PipelineError::Device)?;
        let fields =
            network.fields().ok_or(SimulatorError::NotForDevice("its fields are given out already"))?;
        let simulator = Simulator::with_remote(sensor, materials, scene.solver, scene.interface, fields)?;
        return Ok(Placed { simulator, gpu: Some(Graphics::Network(network)) });
    }
    let problem = Simulator::remote_problem(&sensor, &materials)?;
    let gpu = match finding_objects(scene, &sensor, &problem, allow_software) {
        Some(gpu) => gpu,
        // It may have what fields need and lack what objects do; where it lacks both, this tells.
        None => GpuFields::new(&problem, 1, allow_software).map_err(PipelineError::Device)?,
    };
    let fields = gpu
        .scene(0, problem.columns)
        .ok_or(SimulatorError::NotForDevice("its fields are given out already"))?;
    let simulator = Simulator::with_remote(sensor, materials, scene.solver, scene.interface, fields)?;
    Ok(Placed { simulator, gpu: Some(Graphics::Lattice(gpu)) })
}

/// Fields on an adapter that finds the objects, too; `None` where these are no surfaces that cut edges, or solids of
/// triangles that are no box or floating plates whose ends change weights, or the adapter does not suffice for it.
fn finding_objects(
    scene: &Scene,
    sensor: &Sensor,
    problem: &RemoteProblem,
    allow_software: bool,
) -> Option<GpuFields> {
    if scene.interface != Interface::EdgeCut {
        return None;
    }
    let objects = Objects {
        shapes: scene.objects.iter().map(|object| object.shape.clone()).collect(),
        materials: scene.objects.iter().map(|object| object.material).collect(),
    };
    let (of_sensor, objects) = ((problem, sensor), [objects]);
    let gpu = match scene.geometry {
        Geometry::Camera => {
            let camera = Camera { view: scene.view, back_fill: scene.back_fill };
            GpuFields::with_camera(of_sensor, camera, &objects, allow_software)
        }
        Geometry::Solids(_) if have_ends(&objects[0], sensor) => return None,
        Geometry::Solids(_) => GpuFields::with_solids(of_sensor, &objects, allow_software),
    };
    gpu.ok()
}

/// Whether ends of objects may change weights, of which devices know nothing.
fn have_ends(objects: &Objects, sensor: &Sensor) -> bool {
    let (Some(lattice), Ok(solids)) = (sensor.lattice(), Solids::new(&objects.shapes)) else { return false };
    let mut materials = objects.materials.iter().enumerate();
    materials.any(|(object, material)| may_change_weights(lattice, &solids, object, material))
}
