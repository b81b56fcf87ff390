//! Desktop viewer of CapSense: a scene that can be touched, and what its sensor measures meanwhile.
//!
//! [`worker`] owns the simulation on a thread of its own, [`session`] what is edited and what was computed, [`app`] the
//! window. [`scene3d`] draws the scene, [`panels`] everything else. [`screenshot`] draws the window without one.

#![forbid(unsafe_code)]

pub mod app;
pub mod export;
pub mod frame_rate;
pub mod history;
pub mod icons;
pub mod live;
pub mod measured;
pub mod palette;
pub mod panels;
pub mod plain_painter;
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
use frame_rate::{FrameRate, Report, ReportSlot, Request};
use preferences::Preferences;
use start::Start;
use std::sync::PoisonError;

/// Name by which window managers know the program.
pub const APP_ID: &str = "capsense-viewer";

/// Opens the window and returns when it is closed. If frames are to be counted, this is done in a window as it is the
/// first time, and the report comes back.
///
/// # Errors
/// When there is no display, or no graphics adapter that can draw.
pub fn open_window(start: Start, measured: Option<Request>) -> Result<Option<Report>, eframe::Error> {
    let size = measured.map_or([1440.0, 900.0], |request| request.size.map(|side| side as f32));
    let options = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_app_id(APP_ID)
            .with_title("CapSense")
            .with_inner_size(size)
            .with_min_inner_size([720.0, 480.0])
            .with_drag_and_drop(true),
        persist_window: measured.is_none(),
        ..Default::default()
    };
    let slot = ReportSlot::default();
    let of_window = slot.clone();
    let create: eframe::AppCreator<'_> = Box::new(move |cc| {
        let preferences = match measured {
            Some(_) => Preferences::default(),
            None => ViewerApp::remembered(cc.storage),
        };
        let mut app = ViewerApp::new(&cc.egui_ctx, cc.wgpu_render_state.as_ref(), start, preferences)?;
        if let Some(request) = measured {
            app.measure(FrameRate::new(request, of_window));
        }
        Ok(Box::new(app))
    });
    eframe::run_native(APP_ID, options, create)?;
    Ok(slot.lock().unwrap_or_else(PoisonError::into_inner).take())
}
