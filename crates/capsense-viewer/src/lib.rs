//! Desktop viewer of CapSense: the curves of a finished run, and the mesh that it was computed on.
//!
//! [`load_run`] reads what a run left behind, [`open_window`] shows it. The parts can be used on their own:
//! [`curves`] reads and checks `capacitance.csv`, [`wireframe`] draws a mesh, [`app`] puts both into a window.

#![forbid(unsafe_code)]

pub mod app;
pub mod curves;
pub mod palette;
pub mod scene3d;
pub mod wireframe;

use app::{Content, ViewerApp};
use capsense::core::sensor::FREE;
use capsense::run_folder::{CURVES_FILE, RunOrigin};
use curves::{Curves, CurvesError};
use std::path::{Path, PathBuf};
use wireframe::MeshView;

/// Name by which window managers know the program.
pub const APP_ID: &str = "capsense-viewer";

/// What the window shows.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewerData {
    /// Capacitances over time.
    pub curves: Curves,
    /// The mesh, or why it cannot be shown.
    pub mesh: Result<MeshView, String>,
}

/// Why a run cannot be shown.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// Its curves cannot be read.
    #[error(transparent)]
    Curves(#[from] CurvesError),
}

/// Where the curves of a run are: in its folder, or the file itself.
pub fn curves_file(run: &Path) -> PathBuf {
    if run.is_dir() { run.join(CURVES_FILE) } else { run.to_owned() }
}

/// Reads a finished run: the folder that `capsense run --out` wrote, or its `capacitance.csv`.
///
/// The mesh is built again from the scene that the run's report names. Where that fails the curves are there all the
/// same, with the reason in place of the mesh.
///
/// # Errors
/// When the curves cannot be read; the message names file, line and column.
pub fn load_run(run: &Path) -> Result<ViewerData, LoadError> {
    let file = curves_file(run);
    let curves = Curves::read(&file)?;
    let mesh = mesh_of_run(file.parent().unwrap_or(Path::new("")), &curves);
    Ok(ViewerData { curves, mesh })
}

fn mesh_of_run(folder: &Path, curves: &Curves) -> Result<MeshView, String> {
    let origin = RunOrigin::read(folder).map_err(|error| error.to_string())?;
    let sensor = origin.build_sensor().map_err(|error| error.to_string())?;
    if sensor.electrode_names() != curves.electrodes() {
        let message = "has other electrodes than the curves: it has changed since the run";
        return Err(format!("the scene {} {message}", origin.scene));
    }
    let terminals = sensor.owners().iter();
    let terminals = terminals.map(|&terminal| (terminal != FREE).then_some(usize::from(terminal))).collect();
    let view = MeshView::from_mesh(sensor.mesh(), terminals).map_err(|error| error.to_string())?;
    let names: Vec<&str> =
        std::iter::once("ground").chain(sensor.electrode_names().iter().map(String::as_str)).collect();
    Ok(view.with_terminal_names(&names))
}

/// Opens the window and returns when it is closed.
///
/// # Errors
/// When there is no display, or no graphics adapter that can draw.
pub fn open_window(content: Content) -> Result<(), eframe::Error> {
    let title = match &content {
        Content::Run { name, .. } => format!("CapSense – {name}"),
        Content::Nothing | Content::Failed(_) => "CapSense".to_owned(),
    };
    let options = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_app_id(APP_ID)
            .with_title(&title)
            .with_inner_size([1200.0, 720.0])
            .with_min_inner_size([560.0, 360.0]),
        ..Default::default()
    };
    eframe::run_native(APP_ID, options, Box::new(|_| Ok(Box::new(ViewerApp::new(content)))))
}
