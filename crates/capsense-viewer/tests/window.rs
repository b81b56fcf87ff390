//! The window as a whole, drawn without a display, and the command's answers to bad input.

#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

mod common;

use capsense::Scene;
use capsense::run_folder::{CURVES_FILE, REPORT_FILE, RunOrigin};
use capsense_viewer::app::ViewerApp;
use capsense_viewer::history::TimeAxis;
use capsense_viewer::session::Severity;
use capsense_viewer::start::Start;
use common::{SCENE, preferences, settle, start, until, window};
use egui::{Event, Key, Modifiers};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use glam::DVec3;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

const SIZE: [f32; 2] = [1200.0, 800.0];

fn ready(text: &str) -> Harness<'static, ViewerApp> {
    let mut harness = window(start(text), preferences(), SIZE);
    settle(&mut harness);
    harness
}

fn press(harness: &mut Harness<'_, ViewerApp>, modifiers: Modifiers, key: Key) {
    harness.key_press_modifiers(modifiers, key);
    harness.run_steps(2);
    harness.check_accessibility();
}

/// A file that is dropped on the window.
#[derive(Debug)]
struct Dropped(PathBuf);

impl egui::DroppedFile for Dropped {
    fn path(&self) -> &Path {
        &self.0
    }

    fn bytes(&self) -> Result<Vec<u8>, String> {
        std::fs::read(&self.0).map_err(|error| error.to_string())
    }
}

fn drop_file(harness: &mut Harness<'_, ViewerApp>, path: &Path) {
    harness.input_mut().dropped_files.push(Arc::new(Dropped(path.to_owned())));
    harness.run_steps(2);
}

#[test]
fn the_window_begins_with_the_scene_and_its_curves() {
    let mut harness = ready(SCENE);
    for label in ["ball", "bar", "Curves", "Matrix", "Performance", "Objects", "Simulation"] {
        assert!(harness.get_all_by_label(label).count() > 0, "{label}");
    }
    assert_eq!(harness.state().session.history.electrodes(), ["E1", "E2"]);
    press(&mut harness, Modifiers::NONE, Key::R);
    until(&mut harness, |app| app.session.history.samples(TimeAxis::Scene).len() == 21);
}

#[test]
fn keys_move_the_selected_object_and_the_capacitance_follows() {
    let mut harness = ready(SCENE);
    let c11 = |harness: &Harness<'_, ViewerApp>| {
        harness.state().session.last.as_ref().unwrap().frame.capacitance.get(0, 0)
    };
    let before = c11(&harness);
    harness.get_by_label("bar").click();
    harness.run_steps(2);
    assert_eq!(harness.state().session.selected, Some(1));
    for _ in 0..3 {
        press(&mut harness, Modifiers::ALT | Modifiers::SHIFT, Key::PageDown);
    }
    press(&mut harness, Modifiers::ALT, Key::ArrowRight);
    settle(&mut harness);
    let pose = harness.state().session.poses()[1];
    assert!((pose.translation - DVec3::new(-0.099, 0.0, 0.05)).length() < 1e-12, "{pose:?}");
    assert!(c11(&harness) > before, "a grounded bar that comes nearer adds capacitance");
    // What is saved rests where it was left.
    let saved = harness.state().session.document_to_save();
    assert!(saved.text().starts_with("# A comment of the user."));
    let scene = saved.scene().unwrap();
    assert_eq!(scene.objects[1].motion.pose_at(1.0), pose);
    harness.get_by_label("follow it again").click();
    settle(&mut harness);
    let back = c11(&harness);
    assert!((back / before - 1.0).abs() < 1e-4, "at the same pose: {before:e} and {back:e}");
}

#[test]
fn a_change_that_cannot_be_simulated_leaves_the_last_good_scene() {
    let mut harness = ready(SCENE);
    let app = harness.state_mut();
    app.session.edit(|document| document.set_tolerance(-1.0));
    until(&mut harness, |app| app.session.message.is_some());
    let session = &harness.state().session;
    let message = session.message.clone().unwrap();
    assert_eq!(message.severity, Severity::Error);
    assert!(message.text.contains("solver.tolerance"), "{message:?}");
    assert_eq!(session.open.as_ref().unwrap().scene.solver.tolerance, 1e-8);
    assert!(session.document_to_save().scene().is_ok(), "what failed is not saved either");
    let samples = session.history.session().len();
    harness.state_mut().session.transport.seek(5);
    until(&mut harness, |app| app.session.history.session().len() > samples);
    harness.get_by_label("dismiss").click();
    harness.run_steps(2);
    assert!(harness.state().session.message.is_none());
}

#[test]
fn files_that_are_dropped_are_opened_or_told_of() {
    let root = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets"));
    let mut harness = ready(SCENE);
    drop_file(&mut harness, &root.join("objects/hand.glb"));
    until(&mut harness, |app| app.session.open.as_ref().is_some_and(|open| open.scene.objects.len() == 3));
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes, told) in [
        ("bad.toml", &b"[mesh\n"[..], "bad.toml:1"),
        ("bad.stl", b"solid nothing", "bad.stl"),
        ("bad.csv", b"a,b\n1,2\n", "bad.csv, line 1: no column is called time_s"),
        ("bad.mcap", b"no recording", "bad.mcap: Bad magic number"),
        ("bad.exe", b"", "bad.exe"),
    ] {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        harness.state_mut().session.message = None;
        drop_file(&mut harness, &path);
        until(&mut harness, |app| app.session.message.is_some());
        let message = harness.state().session.message.clone().unwrap();
        assert!(message.text.contains(told), "{name}: {message:?}");
        assert_eq!(harness.state().session.open.as_ref().unwrap().scene.objects.len(), 3, "{name}");
    }
    drop_file(&mut harness, &root.join("scenes/sphere_floating.toml"));
    until(&mut harness, |app| app.session.history.electrodes().len() == 3);
}

#[test]
fn a_scene_that_cannot_be_read_at_the_start_is_told_of_beside_the_one_that_is_shown() {
    let message = Start::from_path(Path::new("no/such.toml")).unwrap_err();
    let start = Start { message: Some(message), ..start(SCENE) };
    let mut harness = window(start, preferences(), SIZE);
    settle(&mut harness);
    harness.get_by_label_contains("no/such.toml: cannot read the scene");
    harness.get_by_label("dismiss").click();
    harness.run_steps(4);
    assert!(harness.query_by_label_contains("no/such.toml").is_none(), "it is told once");
}

#[test]
fn curves_are_exported_to_the_path_that_is_given() {
    let mut harness = ready(SCENE);
    press(&mut harness, Modifiers::COMMAND, Key::E);
    harness.get_by_label("Export the curves as CSV");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("curves.csv");
    press(&mut harness, Modifiers::COMMAND, Key::A);
    harness.event(Event::Text(path.display().to_string()));
    harness.run_steps(2);
    press(&mut harness, Modifiers::NONE, Key::Enter);
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.starts_with("frame,time_s,C_E1_E1_F,C_E1_E2_F,C_E2_E2_F,changed_edges"), "{text}");
    harness.get_by_label_contains("written to");
    // A folder that is not there is told of in the dialog, which stays.
    press(&mut harness, Modifiers::COMMAND, Key::E);
    press(&mut harness, Modifiers::COMMAND, Key::A);
    harness.event(Event::Text("no/such/folder/x.csv".to_owned()));
    harness.run_steps(2);
    press(&mut harness, Modifiers::NONE, Key::Enter);
    harness.get_by_label_contains("no/such/folder/x.csv:");
    press(&mut harness, Modifiers::NONE, Key::Escape);
    assert!(harness.query_by_label("Export the curves as CSV").is_none());
}

#[test]
fn pictures_of_the_window_are_written_and_failures_told_in_it() {
    let mut harness = ready(SCENE);
    let folder = tempfile::tempdir().unwrap();
    let (good, bad) = (folder.path().join("window.png"), folder.path().join("no/such/folder.png"));
    for (path, told, severity) in
        [(&good, "written to", Severity::Note), (&bad, "no/such/folder.png:", Severity::Error)]
    {
        press(&mut harness, Modifiers::COMMAND, Key::P);
        press(&mut harness, Modifiers::COMMAND, Key::A);
        harness.event(Event::Text(path.display().to_string()));
        harness.run_steps(2);
        press(&mut harness, Modifiers::NONE, Key::Enter);
        until(&mut harness, |app| app.session.message.as_ref().is_some_and(|m| m.severity == severity));
        harness.get_by_label_contains(told);
    }
    assert_eq!(image::open(&good).unwrap().to_rgba8().dimensions(), (1200, 800));
    assert!(!bad.exists());
}

/// With all that can be unfolded on the screen: who cannot see the window is told what each widget is.
#[test]
fn every_widget_has_a_name() {
    let converters =
        "[measurement]\nchannels = [[\"E2\", \"E1\"]]\nconverter = { step = 1e-15, bits = 16 }\n";
    let mut harness = window(start(&format!("{SCENE}{converters}")), preferences(), [1200.0, 3000.0]);
    settle(&mut harness);
    for label in ["bar", "Mesh", "live"] {
        harness.get_by_label(label).click();
        harness.run_steps(2);
    }
    let folder = tempfile::tempdir().unwrap();
    let curves = folder.path().join("curves.csv");
    let table = harness.state().session.history.to_csv(TimeAxis::Scene).unwrap();
    std::fs::write(&curves, table).unwrap();
    drop_file(&mut harness, &curves);
    harness.check_accessibility();
    for (menu, entry) in [("File", "Undo"), ("View", "Light")] {
        harness.get_by_label(menu).click();
        harness.run_steps(4);
        assert!(harness.query_by_label_contains(entry).is_some(), "{menu} opens");
        harness.check_accessibility();
        harness.get_by_label(menu).click();
        harness.run_steps(4);
    }
}

#[test]
fn keys_list_shortcuts_and_fold_panels() {
    let mut harness = ready(SCENE);
    harness.event(Event::Text("?".to_owned()));
    harness.run_steps(2);
    harness.get_by_label("Keyboard shortcuts");
    press(&mut harness, Modifiers::NONE, Key::Escape);
    assert!(harness.query_by_label("Keyboard shortcuts").is_none());
    press(&mut harness, Modifiers::NONE, Key::Num2);
    assert!(harness.query_by_label("Curves").is_none());
    assert!(!harness.state().preferences.panels.curves);
    press(&mut harness, Modifiers::NONE, Key::ArrowRight);
    assert_eq!(harness.state().session.transport.frame(), 1);
    press(&mut harness, Modifiers::NONE, Key::Space);
    assert!(harness.state().session.transport.is_playing);
}

/// The folder of a run of [`SCENE`], which lies beside it.
fn run_folder(folder: &Path) -> PathBuf {
    let (scene_file, run) = (folder.join("scene.toml"), folder.join("run"));
    std::fs::write(&scene_file, SCENE).unwrap();
    std::fs::create_dir(&run).unwrap();
    let scene = Scene::load(&scene_file).unwrap();
    let mut text = "frame,time_s,C_E1_E1_F,C_E1_E2_F,C_E2_E2_F,changed_edges,iterations\n".to_owned();
    for frame in 0..21 {
        text += &format!(
            "{frame},{},{}e-12,-1e-13,4e-12,0,1\n",
            0.1 * f64::from(frame),
            4.0 + 0.001 * f64::from(frame)
        );
    }
    std::fs::write(run.join(CURVES_FILE), text).unwrap();
    let origin = RunOrigin::new(&scene, Some(&scene_file), scene.build_sensor().unwrap().mesh()).unwrap();
    std::fs::write(run.join(REPORT_FILE), serde_json::to_vec(&origin).unwrap()).unwrap();
    run
}

#[test]
fn a_run_is_its_scene_with_its_curves_beside() {
    let folder = tempfile::tempdir().unwrap();
    let run = run_folder(folder.path());
    let start = Start::from_path(&run).unwrap();
    assert_eq!(start.path.as_deref(), Some(folder.path().join("scene.toml").as_path()));
    let mut harness = window(start, preferences(), SIZE);
    settle(&mut harness);
    assert_eq!(harness.state().measurements.overlays(TimeAxis::Scene).len(), 3);
    std::fs::remove_file(folder.path().join("scene.toml")).unwrap();
    assert!(Start::from_path(&run).unwrap_err().contains("scene.toml"));
    std::fs::remove_file(run.join(REPORT_FILE)).unwrap();
    assert!(Start::from_path(&run).unwrap_err().contains(REPORT_FILE));
}

fn viewer() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_capsense-viewer"));
    command.env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY");
    command
}

#[test]
fn the_command_answers_bad_input_with_code_2_and_a_message_that_names_the_place() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scene.toml");
    std::fs::write(&file, SCENE.replace("elements", "element")).unwrap();
    let picture = folder.path().join("picture.png");
    for arguments in [vec![], vec!["--screenshot".as_ref(), picture.as_os_str()]] {
        let output = viewer().arg(&file).args(arguments).output().unwrap();
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.contains("scene.toml:2: mesh.generate.element"), "{message}");
        assert!(!message.contains("panicked"), "{message}");
    }
    assert!(!picture.exists());
}

#[test]
fn pictures_need_no_display() {
    let folder = tempfile::tempdir().unwrap();
    let (file, picture) = (folder.path().join("scene.toml"), folder.path().join("picture.png"));
    std::fs::write(&file, SCENE).unwrap();
    let draw = |frame: &str| {
        let mut command = viewer();
        command.arg("--screenshot").arg(&picture).args(["--frame", frame, "--size", "900", "600"]).arg(&file);
        command.output().unwrap()
    };
    let output = draw("7");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let pixels = image::open(&picture).unwrap().to_rgba8();
    assert_eq!(pixels.dimensions(), (900, 600));
    let first = *pixels.get_pixel(0, 0);
    let others = pixels.pixels().filter(|pixel| **pixel != first).count();
    assert!(others > 50_000, "{others} pixels are not ground");
    let output = draw("21");
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains("frames 0 to 20"), "{message}");
}

/// A size is for pictures and for windows that are measured; frames of a picture are not counted.
#[test]
fn arguments_that_do_not_go_together_are_refused() {
    for arguments in [
        &["--size", "800", "600"][..],
        &["--measure-fps", "2", "--screenshot", "picture.png"],
        &["--measure-fps", "0"],
        &["--measure-fps", "2", "--frame", "3"],
    ] {
        let output = viewer().args(arguments).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    }
}

#[test]
fn without_a_graphics_driver_the_command_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let output = viewer()
        .arg("--screenshot")
        .arg(folder.path().join("picture.png"))
        // The interface of another operating system finds nothing here.
        .env("WGPU_BACKEND", if cfg!(windows) { "metal" } else { "dx12" })
        .output()
        .unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("no graphics adapter"), "{message}");
    assert!(message.contains("mesa-vulkan-drivers"), "{message}");
}

#[test]
fn the_readme_calls_the_viewer_as_it_is() {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
    let readme = std::fs::read_to_string(format!("{root}/README.md")).unwrap();
    let calls: Vec<_> = readme.lines().filter_map(|line| line.strip_prefix("capsense-viewer ")).collect();
    assert!(!calls.is_empty());
    for call in calls {
        let output = viewer().args(call.split_whitespace()).current_dir(root).output().unwrap();
        let message = String::from_utf8_lossy(&output.stderr);
        // Everything but the display is there.
        assert_eq!(output.status.code(), Some(1), "{message}");
        assert!(message.contains("the window could not be opened"), "{message}");
    }
}

#[test]
fn what_converters_read_is_drawn_and_exported() {
    let converters =
        "[measurement]\nchannels = [[\"E2\", \"E1\"]]\nconverter = { step = 1e-15, bits = 16 }\n";
    let mut harness = ready(&format!("{SCENE}{converters}"));
    harness.state_mut().session.run(0..5);
    settle(&mut harness);
    let history = &harness.state().session.history;
    let [read] = &history.readings(TimeAxis::Scene)[..] else { panic!("one channel") };
    assert_eq!((read.entry, read.points.len()), (1, 5), "{read:?}");
    let table = String::from_utf8(history.to_csv(TimeAxis::Scene).unwrap()).unwrap();
    let columns: Vec<usize> = table.lines().map(|line| line.split(',').count()).collect();
    assert!(table.lines().next().unwrap().ends_with("raw_E1_E2,measured_E1_E2_F"), "{table}");
    assert!(columns.iter().all(|count| *count == columns[0]), "{table}");
    harness.get_by_label("as read").click();
    harness.run_steps(2);
    assert!(!harness.state().preferences.curves.as_read);
}
