//! Each panel, drawn without a display on whatever Vulkan driver there is, and what its controls do.
//!
//! The pictures in `tests/snapshots` are written by `UPDATE_SNAPSHOTS=true cargo test --workspace`.

#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

mod common;

use capsense::core::geometry::Pose;
use capsense::core::material::{Connection, Material};
use capsense::pipeline::Milliseconds;
use capsense_viewer::history::{Overlay, TimeAxis};
use capsense_viewer::panels::curves::CurvesPanel;
use capsense_viewer::panels::dialogs::{self, Dialog, Purpose};
use capsense_viewer::panels::measurements::Measurements;
use capsense_viewer::panels::performance::Performance;
use capsense_viewer::panels::{matrix, objects, simulation, transport};
use capsense_viewer::preferences::{CurvePreferences, Theme};
use capsense_viewer::session::{Bars, Session};
use capsense_viewer::style;
use common::{PATIENCE, SCENE, start};
use egui_kittest::kittest::Queryable;
use egui_kittest::{Harness, SnapshotOptions};
use glam::DVec3;
use std::path::Path;
use std::time::{Duration, Instant};

/// A session on the small scene with all frames computed.
fn session() -> Session {
    let start = start(SCENE);
    let mut session = Session::new(start.document, start.path, || {}).unwrap();
    settle(&mut session);
    session.history.clear();
    session.run(0..session.transport.frames());
    settle(&mut session);
    session
}

fn settle(session: &mut Session) {
    let begun = Instant::now();
    loop {
        session.update(Duration::ZERO);
        if session.is_settled() && session.last.is_some() {
            break;
        }
        assert!(begun.elapsed() < PATIENCE, "waited in vain: {:?}", session.message);
        std::thread::sleep(Duration::from_millis(2));
    }
    session.update(Duration::ZERO);
}

/// A panel in a window of its own.
fn panel<'a, S: 'a>(
    size: [f32; 2],
    theme: Theme,
    state: S,
    draw: impl Fn(&mut egui::Ui, &mut S) + 'a,
) -> Harness<'a, S> {
    let mut is_styled = false;
    let mut harness = Harness::builder().with_size(size).with_pixels_per_point(1.0).wgpu().build_ui_state(
        move |ui, state| {
            if !is_styled {
                style::apply(ui.ctx(), theme);
                is_styled = true;
            }
            egui::CentralPanel::default().frame(style::panel_frame(ui)).show(ui, |ui| draw(ui, state));
        },
        state,
    );
    harness.run_steps(4);
    harness
}

/// Drivers round differently: some hundred pixels on the edges of lines and letters may differ.
fn options() -> SnapshotOptions {
    SnapshotOptions::new().threshold(1.0).max_failed_pixels(300)
}

#[test]
fn curves_show_every_entry_and_its_value() {
    let state = (session(), CurvesPanel::default(), CurvePreferences::default());
    let draw = |ui: &mut egui::Ui, (session, curves, preferences): &mut (_, CurvesPanel, _)| {
        curves.ui(ui, session, preferences, &[]);
    };
    let mut harness = panel([820.0, 300.0], Theme::Dark, state, draw);
    for entry in ["E1–E1", "E1–E2", "E2–E2"] {
        harness.get_by_label_contains(entry);
    }
    harness.snapshot_options("curves", &options());
    harness.get_by_label("none").click();
    harness.run_steps(2);
    assert!((0..3).all(|entry| !harness.state().1.is_shown(entry)));
    harness.get_by_label_contains("E1–E2").click();
    harness.get_by_label("pF").click();
    harness.get_by_label("C").click();
    harness.get_by_label("normalised").click();
    harness.run_steps(2);
    let (_, curves, preferences) = harness.state();
    assert!(curves.is_shown(1) && !curves.is_shown(0));
    assert!(preferences.normalised);
    assert_eq!(preferences.unit.symbol(), "pF");
    assert_eq!(preferences.quantity.symbol(), "C");
}

#[test]
fn curves_on_light_ground_lie_under_measured_ones() {
    let session = session();
    let samples = session.history.samples(TimeAxis::Scene);
    let points =
        samples.iter().map(|s| [s.time_s + 0.1, 1.1 * s.farads[0] - 0.1 * session.history.base()[0]]);
    let overlay = Overlay { name: "run".to_owned(), entry: 0, points: points.collect() };
    let state = (session, CurvesPanel::default(), CurvePreferences::default());
    let mut harness =
        panel([820.0, 300.0], Theme::Light, state, move |ui, (session, curves, preferences)| {
            curves.ui(ui, session, preferences, std::slice::from_ref(&overlay));
        });
    harness.snapshot_options("curves_measured", &options());
}

#[test]
fn the_matrix_has_numbers_and_error_bars() {
    let mut session = session();
    session.tell_bars();
    settle(&mut session);
    assert!(matches!(session.bars, Bars::Known(_)));
    let state = (session, CurvePreferences::default(), false);
    let draw = |ui: &mut egui::Ui,
                (session, preferences, at_rest): &mut (Session, CurvePreferences, bool)| {
        matrix::ui(ui, session, preferences, at_rest);
    };
    let mut harness = panel([272.0, 210.0], Theme::Dark, state, draw);
    harness.snapshot_options("matrix", &options());
}

#[test]
fn an_object_is_moved_and_made_of_something_else() {
    let mut session = session();
    session.selected = Some(0);
    let mut harness = panel([272.0, 330.0], Theme::Dark, session, objects::ui);
    harness.snapshot_options("objects", &options());
    harness.get_by_label("ground").click();
    harness.run_steps(1);
    settle(harness.state_mut());
    let material = |session: &Session| session.open.as_ref().unwrap().scene.objects[0].material;
    assert_eq!(material(harness.state()), Material::Conductor(Connection::Grounded));
    harness.get_by_label("sphere").click();
    harness.run_steps(1);
    settle(harness.state_mut());
    harness.run_steps(2);
    let names = |session: &Session| -> Vec<String> {
        session.open.as_ref().unwrap().scene.objects.iter().map(|object| object.name.clone()).collect()
    };
    assert_eq!(names(harness.state()), ["ball", "bar", "sphere"]);
    harness.state_mut().selected = Some(1);
    harness.run_steps(2);
    harness.get_by_label_contains("remove").click();
    harness.run_steps(1);
    settle(harness.state_mut());
    assert_eq!(names(harness.state()), ["ball", "sphere"]);
    harness.state_mut().undo();
    settle(harness.state_mut());
    assert_eq!(names(harness.state()), ["ball", "bar", "sphere"]);
}

#[test]
fn what_is_removed_takes_its_pose_along() {
    let mut session = session();
    let place = Pose::at(DVec3::new(0.0, 0.0, 0.15));
    session.hold(1, place);
    session.remove_object(0);
    settle(&mut session);
    assert_eq!(session.poses(), [place]);
    assert!(session.is_held(0));
}

#[test]
fn settings_of_the_simulation_are_those_of_the_scene() {
    let mut harness = panel([272.0, 280.0], Theme::Dark, session(), simulation::ui);
    harness.snapshot_options("simulation", &options());
    harness.get_by_label("solids").click();
    harness.run_steps(1);
    settle(harness.state_mut());
    let open = harness.state().open.as_ref().unwrap();
    assert_eq!((open.renderer.as_str(), open.device.as_str()), ("exact solids", "CPU"));
}

#[test]
fn the_transport_plays_and_steps() {
    let mut harness = panel([820.0, 34.0], Theme::Dark, session(), transport::ui);
    harness.snapshot_options("transport", &options());
    let frame = harness.state().transport.frame();
    harness.get_by_label("One frame back").click();
    harness.run_steps(1);
    assert_eq!(harness.state().transport.frame(), frame - 1);
    harness.get_by_label("Play").click();
    harness.run_steps(2);
    assert!(harness.state().transport.is_playing);
    harness.get_by_label("Pause");
}

#[test]
fn times_are_stacked() {
    let mut session = session();
    let mut computed = session.last.take().unwrap();
    session.history.clear();
    let mut performance = Performance::default();
    let begun = Instant::now();
    for k in 0..100u32 {
        let part = 0.2 + 0.1 * f64::from(k % 10);
        computed.frame.milliseconds =
            Milliseconds { geometry: 0.1, update: part, solve: 2.0 * part, total: 0.1 + 3.0 * part };
        computed.frame.changed_edges = 1234;
        computed.frame.solve.iterations = 2;
        computed.frame.solve.relative_error = 5e-5;
        computed.frame.solve.skipped = k % 4 == 0;
        session.history.push(&computed, f64::from(k));
        performance.note(begun + Duration::from_millis(20 * u64::from(k)), Duration::from_micros(1500));
    }
    let mut harness =
        panel([272.0, 350.0], Theme::Dark, session, move |ui, session| performance.ui(ui, session));
    harness.get_by_label("25 of the last 100");
    harness.get_by_label("51 frames in the last second");
    harness.snapshot_options("performance", &options());
}

#[test]
fn a_recording_is_compared_with_the_curve_of_its_entry() {
    let session = session();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("measured.csv");
    std::fs::write(&path, session.history.to_csv(TimeAxis::Scene).unwrap()).unwrap();
    let mut measurements = Measurements::default();
    measurements.open(&path, &session).unwrap();
    assert!(measurements.open(Path::new("no/such.csv"), &session).unwrap_err().contains("such.csv"));
    assert_eq!(measurements.overlays(TimeAxis::Scene).len(), 3);
    assert!(measurements.overlays(TimeAxis::Session).is_empty());
    let mut harness =
        panel([300.0, 260.0], Theme::Dark, (session, measurements), |ui, (session, measurements)| {
            measurements.recordings_ui(ui, session);
        });
    // A curve is like itself.
    assert_eq!(harness.get_all_by_label("r 1.0000").count(), 3);
    harness.snapshot_options("recordings", &options());
}

#[test]
fn a_port_that_is_not_there_gives_a_message() {
    let state = (session(), Measurements::default());
    let mut harness = panel([300.0, 190.0], Theme::Dark, state, |ui, (session, measurements)| {
        measurements.hardware_ui(ui, session);
    });
    harness.snapshot_options("hardware", &options());
    harness.get_by_role_and_label(egui::accesskit::Role::TextInput, "port").click();
    harness.run_steps(2);
    harness.event(egui::Event::Text("/no/such/port".to_owned()));
    harness.run_steps(2);
    harness.get_by_label("connect").click();
    harness.run_steps(2);
    harness.get_by_label_contains("/no/such/port:");
}

#[test]
fn dialogs_ask_and_tell() {
    let mut help = panel([640.0, 480.0], Theme::Dark, Dialog::Help, |ui, dialog| {
        dialogs::ui(ui.ctx(), dialog);
    });
    help.snapshot_options("help", &options());
    let dialog = Dialog::path(Purpose::ExportCsv, Path::new("curves.csv"));
    let mut path = panel([640.0, 220.0], Theme::Light, dialog, |ui, dialog| {
        dialogs::ui(ui.ctx(), dialog);
    });
    path.get_by_label("Export");
    path.get_by_label("Cancel");
    path.run_steps(2);
}
