//! The folder that `capsense run` writes: what its files are called, and the way back from them to the scene.

use crate::scene::{Scene, SceneError};
use capsense_core::mesh::TetMesh;
use capsense_core::sensor::Sensor;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The table of capacitances over time.
pub const CURVES_FILE: &str = "capacitance.csv";
/// The drawing of the curves.
pub const DRAWING_FILE: &str = "capacitance.svg";
/// Everything about the run except its curves.
pub const REPORT_FILE: &str = "report.json";

/// Size of a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct MeshSize {
    /// Number of nodes.
    pub nodes: usize,
    /// Number of tetrahedra.
    pub tets: usize,
}

impl MeshSize {
    /// Counts.
    pub fn of(mesh: &TetMesh) -> Self {
        Self { nodes: mesh.nodes().len(), tets: mesh.tets().len() }
    }
}

/// The part of a report from which the sensor of a run can be built again.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunOrigin {
    /// The scene as the user named it.
    pub scene: String,
    /// Absolute path of the scene file; `None` for the built-in scene.
    pub scene_file: Option<String>,
    /// The mesh that the run was computed on.
    pub mesh: MeshSize,
}

/// Why the sensor of a run cannot be built again.
#[derive(Debug, thiserror::Error)]
pub enum RunOriginError {
    /// The report cannot be read.
    #[error("{}: {error}", path.display())]
    Read {
        /// Path of the report.
        path: PathBuf,
        /// What the operating system says.
        error: std::io::Error,
    },
    /// The report is no report, or one of a version that did not name the scene file.
    #[error("{}: is not the report of a run: {error}", path.display())]
    Parse {
        /// Path of the report.
        path: PathBuf,
        /// What is wrong.
        error: serde_json::Error,
    },
    /// What the report names is no file, or no longer one.
    #[error("the scene {0} is not there any more")]
    Gone(String),
    /// The scene file is there, but is refused now.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The scene's mesh is not that of the run.
    #[error(
        "the mesh of {scene} has {} tetrahedra now, that of the run had {}: \
         the scene or the program has changed since", now.tets, then.tets
    )]
    Changed {
        /// The scene as the user named it.
        scene: String,
        /// The mesh of the run.
        then: MeshSize,
        /// The mesh that the scene gives now.
        now: MeshSize,
    },
}

impl RunOrigin {
    /// Describes a run of a scene; `file` is where the scene comes from, `None` for the built-in one.
    ///
    /// # Errors
    /// When the working folder is needed to make the path absolute and is not known.
    pub fn new(scene: &Scene, file: Option<&Path>, mesh: &TetMesh) -> std::io::Result<Self> {
        // A path that is not Unicode is not found again, which is no reason to lose the run.
        let absolute = file.map(std::path::absolute).transpose()?;
        Ok(Self {
            scene: scene.source.file().to_owned(),
            scene_file: absolute.map(|path| path.to_string_lossy().into_owned()),
            mesh: MeshSize::of(mesh),
        })
    }

    /// Reads it from the report in a run's folder.
    ///
    /// # Errors
    /// When there is no report, or it is not one of these.
    pub fn read(folder: &Path) -> Result<Self, RunOriginError> {
        let path = folder.join(REPORT_FILE);
        let bytes =
            std::fs::read(&path).map_err(|error| RunOriginError::Read { path: path.clone(), error })?;
        serde_json::from_slice(&bytes).map_err(|error| RunOriginError::Parse { path, error })
    }

    /// Reads the scene again and meshes its sensor.
    ///
    /// # Errors
    /// When the scene is gone, is refused, or gives a mesh of another size.
    pub fn build_sensor(&self) -> Result<Sensor, RunOriginError> {
        let scene = match &self.scene_file {
            None => Scene::built_in()?,
            // A pipe or a terminal would be waited for.
            Some(file) if !Path::new(file).is_file() => return Err(RunOriginError::Gone(file.clone())),
            Some(file) => Scene::load(Path::new(file))?,
        };
        let sensor = scene.build_sensor()?;
        let now = MeshSize::of(sensor.mesh());
        if now == self.mesh {
            Ok(sensor)
        } else {
            Err(RunOriginError::Changed { scene: self.scene.clone(), then: self.mesh, now })
        }
    }
}
