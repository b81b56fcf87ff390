//! What the window begins with: a scene file, the folder of a run, or the built-in scene.

use capsense::run_folder::{CURVES_FILE, RunOrigin};
use capsense::scene::SceneError;
use capsense::scene::write::SceneDocument;
use std::path::{Path, PathBuf};

/// What the window begins with.
#[derive(Clone, Debug)]
pub struct Start {
    /// The scene.
    pub document: SceneDocument,
    /// The file that it comes from; `None` for the built-in one.
    pub path: Option<PathBuf>,
    /// Curves to be shown beside those that are computed.
    pub recording: Option<PathBuf>,
    /// What is to be told.
    pub message: Option<String>,
}

impl Start {
    /// The built-in scene.
    ///
    /// # Errors
    /// None, unless the program was built from a broken file.
    pub fn built_in() -> Result<Self, SceneError> {
        Ok(Self { document: SceneDocument::built_in()?, path: None, recording: None, message: None })
    }

    /// A scene file; or the folder of a run, or its `capacitance.csv`: then the scene of the run, with its curves beside.
    ///
    /// # Errors
    /// What is wrong with it; of scene files with file, line and key.
    pub fn from_path(path: &Path) -> Result<Self, String> {
        let curves = if path.is_dir() { path.join(CURVES_FILE) } else { path.to_owned() };
        if curves.file_name().is_none_or(|name| name != CURVES_FILE) {
            let document = SceneDocument::load(path).map_err(|error| error.to_string())?;
            return Ok(Self { document, path: Some(path.to_owned()), recording: None, message: None });
        }
        if !curves.is_file() {
            return Err(format!("{}: there is no {CURVES_FILE} in it", path.display()));
        }
        let folder = curves.parent().unwrap_or(Path::new(""));
        let origin = RunOrigin::read(folder).map_err(|error| error.to_string())?;
        let scene = origin.scene_file.map(PathBuf::from);
        let document = match &scene {
            None => SceneDocument::built_in(),
            Some(file) => SceneDocument::load(file),
        };
        let document = document.map_err(|error| error.to_string())?;
        Ok(Self { document, path: scene, recording: Some(curves), message: None })
    }
}
