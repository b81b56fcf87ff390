//! Desktop viewer of CapSense: a scene that can be touched, and what its sensor measures meanwhile.
//!
//! [`worker`] owns the simulation on a thread of its own, [`session`] what is edited and what was computed, [`app`] the
//! window. [`scene3d`] draws the scene, [`panels`] everything else. [`screenshot`] draws the window without one.

#![forbid(unsafe_code)]

pub mod app;
pub mod export;
pub mod history;
pub mod icons;
pub mod live;
pub mod measured;
pub mod palette;
pub mod panels;
pub mod preferences;
pub mod quantity;
pub mod scene3d;
pub mod screenshot;
pub mod session;
mod shortcuts;
pub mod start;
mod status;
pub mod style;
pub mod transport;
pub mod worker;

use app::ViewerApp;
use start::Start;

/// Name by which window managers know the program.
pub const APP_ID: &str = "capsense-viewer";

/// Opens the window and returns when it is closed.
///
/// # Errors
/// When there is no display, or no graphics adapter that can draw.
pub fn open_window(start: Start) -> Result<(), eframe::Error> {
    let options = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_app_id(APP_ID)
            .with_title("CapSense")
            .with_inner_size([1440.0, 900.0])
            .with_min_inner_size([720.0, 480.0])
            .with_drag_and_drop(true),
        ..Default::default()
    };
    let create: eframe::AppCreator<'_> = Box::new(|cc| {
        let preferences = ViewerApp::remembered(cc.storage);
        Ok(Box::new(ViewerApp::new(&cc.egui_ctx, cc.wgpu_render_state.as_ref(), start, preferences)?))
    });
    eframe::run_native(APP_ID, options, create)
}
