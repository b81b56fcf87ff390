//! A small scene and the window on it, drawn without a display on whatever Vulkan driver there is.

#![allow(dead_code, clippy::unwrap_used)]

use capsense::scene::write::SceneDocument;
use capsense_viewer::app::ViewerApp;
use capsense_viewer::preferences::{Preferences, Theme};
use capsense_viewer::start::Start;
use egui_kittest::Harness;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Nothing here takes as long; a test that waits for ever says so.
pub(crate) const PATIENCE: Duration = Duration::from_secs(120);

/// Two electrodes, a ball at rest and a bar that passes.
pub(crate) const SCENE: &str = r#"# A comment of the user.
mesh.generate = { elements = 5000 }

[[sensor.electrode]]
name = "E1"
rectangle = { center = [-0.05, 0.0], size = [0.05, 0.1] }

[[sensor.electrode]]
name = "E2"
rectangle = { center = [0.05, 0.0], size = [0.05, 0.1] }

[[object]]
name = "ball"
sphere = { radius = 0.03 }
material = { conductor = "floating" }
position = [0.1, 0.1, 0.1]

[[object]]
name = "bar"
box = { size = [0.1, 0.1, 0.02] }
material = { conductor = "grounded" }
trajectory = { waypoints = [[-0.1, 0.0, 0.08], [0.1, 0.0, 0.08]], speed = 0.1 }

[simulation]
frame_rate = 10.0

# So small that pictures are the same whatever the solver leaves within it.
[solver]
tolerance = 1e-8
"#;

pub(crate) fn start(text: &str) -> Start {
    let document = SceneDocument::parse("test.toml", text, Path::new("")).unwrap();
    Start { document, path: Some(PathBuf::from("test.toml")), recording: None, message: None }
}

pub(crate) fn preferences() -> Preferences {
    Preferences { theme: Theme::Dark, ..Preferences::default() }
}

pub(crate) fn window(start: Start, preferences: Preferences, size: [f32; 2]) -> Harness<'static, ViewerApp> {
    let harness = Harness::builder().with_size(size).with_pixels_per_point(1.0);
    harness.wgpu().build_eframe(move |cc| {
        ViewerApp::new(&cc.egui_ctx, cc.wgpu_render_state.as_ref(), start.clone(), preferences.clone())
            .unwrap()
    })
}

/// Draws frames until something is so.
pub(crate) fn until(harness: &mut Harness<'_, ViewerApp>, is_done: impl Fn(&ViewerApp) -> bool) {
    let begun = Instant::now();
    loop {
        harness.run_steps(1);
        if is_done(harness.state()) {
            break;
        }
        assert!(begun.elapsed() < PATIENCE, "waited in vain: {:?}", harness.state().session.message);
        std::thread::sleep(Duration::from_millis(2));
    }
    harness.run_steps(4);
    // Of itself the harness looks for widgets without a name only where it waits for a window that stands still.
    harness.check_accessibility();
}

/// Draws frames until all that was asked for is there.
pub(crate) fn settle(harness: &mut Harness<'_, ViewerApp>) {
    harness.run_steps(2);
    until(harness, |app| app.session.is_settled() && app.session.last.is_some());
}
