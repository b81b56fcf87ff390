//! Desktop viewer of CapSense: the curves of a finished run, and the mesh that it was computed on.
//!
//! [`load_run`] reads what a run left behind, [`open_window`] shows it. The parts can be used on their own:
//! [`curves`] reads and checks `capacitance.csv`, [`wireframe`] draws a mesh, [`app`] puts both into a window.

#![forbid(unsafe_code)]

pub mod app;
pub mod curves;
pub mod wireframe;

use app::{Content, ViewerApp};
use curves::{Curves, CurvesError};
use std::path::{Path, PathBuf};
use wireframe::MeshView;

/// Name by which window managers know the program.
pub const APP_ID: &str = "capsense-viewer";
/// The file of curves inside a run's folder.
pub const CURVES_FILE: &str = "capacitance.csv";

/// What the window shows.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewerData {
    /// Capacitances over time.
    pub curves: Curves,
    /// The mesh, where it is known.
    pub mesh: Option<MeshView>,
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
/// # Errors
/// When the curves cannot be read; the message names file, line and column.
pub fn load_run(run: &Path) -> Result<ViewerData, LoadError> {
    let curves = Curves::read(&curves_file(run))?;
    Ok(ViewerData { curves, mesh: None })
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
