//! The window, drawn without a display on whatever Vulkan driver there is, and the command's answer to bad input.
//!
//! The pictures in `tests/snapshots` are written by `UPDATE_SNAPSHOTS=true cargo test --workspace`.

#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use capsense::Scene;
use capsense::run_folder::{CURVES_FILE, REPORT_FILE, RunOrigin};
use capsense_core::geometry::Aabb;
use capsense_core::mesh::Lattice;
use capsense_viewer::app::{Content, ViewerApp};
use capsense_viewer::curves::Curves;
use capsense_viewer::wireframe::MeshView;
use capsense_viewer::{ViewerData, load_run};
use egui_kittest::kittest::{NodeT, Queryable};
use egui_kittest::{Harness, SnapshotOptions};
use glam::DVec3;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Three electrodes; every entry dips like a bell of its own depth while something passes.
fn small_run() -> String {
    let mut text = "frame,time_s".to_owned();
    let pairs = [(1, 1), (1, 2), (1, 3), (2, 2), (2, 3), (3, 3)];
    for (a, b) in pairs {
        write!(text, ",C_E{a}_E{b}_F").unwrap();
    }
    text += ",changed_edges,iterations,geometry_ms,update_ms,solve_ms\n";
    for frame in 0..61 {
        let time = f64::from(frame) / 60.0;
        write!(text, "{frame},{time}").unwrap();
        for (k, (a, b)) in pairs.into_iter().enumerate() {
            let base = if a == b { 4e-12 } else { -0.8e-12 / f64::from(b - a) };
            let bell = 1.0 / (1.0 + ((time - 0.3 - 0.08 * k as f64) / 0.1).powi(2));
            let depth = if a == b { 4e-14 } else { 2e-14 };
            write!(text, ",{:e}", base + depth * (1.0 + 0.3 * k as f64) * bell).unwrap();
        }
        writeln!(text, ",{},3,0.2,0.1,0.4", 40 * frame).unwrap();
    }
    text
}

fn stripes() -> MeshView {
    let domain = Aabb { min: DVec3::new(-0.25, -0.25, -0.05), max: DVec3::new(0.25, 0.25, 0.45) };
    let mesh = Lattice::uniform(domain, [20, 20, 10]).unwrap().to_tet_mesh().unwrap();
    let terminal = mesh
        .nodes()
        .iter()
        .map(|p| {
            let on_wall = (0..3).any(|k| p[k] == domain.min[k] || p[k] == domain.max[k]);
            let electrode = (0..3).find(|&k| (p.x - 0.075 * (f64::from(k) - 1.0)).abs() < 0.03);
            match electrode {
                _ if on_wall => Some(0),
                Some(k) if p.z.abs() < 1e-9 && p.y.abs() < 0.11 => Some(1 + k as usize),
                _ => None,
            }
        })
        .collect();
    MeshView::from_mesh(&mesh, terminal).unwrap().with_terminal_names(&["ground", "E1", "E2", "E3"])
}

fn harness(content: Content) -> Harness<'static, ViewerApp> {
    Harness::builder()
        .with_size([1000.0, 560.0])
        .with_pixels_per_point(1.0)
        .with_theme(egui::Theme::Dark)
        .wgpu()
        .build_eframe(move |_| ViewerApp::new(content.clone()))
}

fn run_content(mesh: Result<MeshView, String>) -> Content {
    let curves = Curves::parse(small_run().as_bytes(), Path::new("small.csv")).unwrap();
    Content::Run { name: "small".into(), data: Box::new(ViewerData { curves, mesh }) }
}

/// Drivers round differently: a few hundred pixels on the edges of lines and letters may differ.
fn options() -> SnapshotOptions {
    SnapshotOptions::new().threshold(1.0).max_failed_pixels(400)
}

#[test]
fn curves_and_mesh_are_shown() {
    let mut harness = harness(run_content(Ok(stripes())));
    harness.run_steps(6);
    for entry in ["E1–E1", "E1–E2", "E1–E3", "E2–E2", "E2–E3", "E3–E3"] {
        harness.get_by_label(entry);
    }
    for label in ["61 frames", "3 electrodes", "0.70 ms a frame (median)", "ground", "E1", "E2", "E3"] {
        harness.get_by_label(label);
    }
    harness.get_by_label_contains("Mesh picture");
    harness.snapshot_options("curves_and_mesh", &options());
}

#[test]
fn entries_quantity_and_unit_can_be_chosen() {
    let mut harness = harness(run_content(Err("no file report.json".to_owned())));
    harness.run_steps(4);
    harness.get_by_label("ΔC in fF over time in s");
    harness.get_by_label("The mesh cannot be shown:");
    harness.get_by_label("no file report.json");
    let before = harness.render().unwrap();
    harness.get_by_label("None").click();
    harness.run_steps(4);
    let checked = |harness: &Harness<'_, ViewerApp>, label: &str| {
        harness.get_by_label(label).accesskit_node().toggled() == Some(egui::accesskit::Toggled::True)
    };
    assert!(!checked(&harness, "E1–E2"));
    assert!(harness.render().unwrap() != before, "no curve is left");
    harness.get_by_label("E1–E2").click();
    harness.get_by_label("C").click();
    harness.get_by_label("pF").click();
    harness.run_steps(4);
    assert!(checked(&harness, "E1–E2") && !checked(&harness, "E1–E1"));
    harness.get_by_label("C in pF over time in s");
}

#[test]
fn the_mesh_turns_with_the_pointer_and_its_parts_can_be_hidden() {
    let mut harness = harness(run_content(Ok(stripes())));
    harness.run_steps(4);
    let first = harness.render().unwrap();
    let middle = harness.get_by_label_contains("Mesh picture").rect().center();
    harness.hover_at(middle);
    harness.run_steps(1);
    harness.drag_at(middle);
    harness.run_steps(2);
    harness.hover_at(middle + egui::vec2(60.0, 20.0));
    harness.run_steps(2);
    harness.drop_at(middle + egui::vec2(60.0, 20.0));
    harness.run_steps(2);
    let turned = harness.render().unwrap();
    let changed = differing(first.as_raw(), turned.as_raw());
    assert!(changed > 1000, "{changed} pixels differ");
    let edges = |harness: &Harness<'_, ViewerApp>| {
        harness.get_by_label_contains("Mesh picture").accesskit_node().label()
    };
    let all = edges(&harness);
    harness.get_by_label("ground").click();
    harness.run_steps(2);
    assert_ne!(edges(&harness), all);
}

/// Pixels that are not the same in two pictures of four bytes a pixel.
fn differing(a: &[u8], b: &[u8]) -> usize {
    a.chunks_exact(4).zip(b.chunks_exact(4)).filter(|(p, q)| p != q).count()
}

#[test]
fn a_run_that_cannot_be_read_and_no_run_at_all_give_a_message() {
    let error = load_run(Path::new("no/such/run")).unwrap_err().to_string();
    let mut failed = harness(Content::Failed(error));
    failed.run_steps(2);
    failed.get_by_label("The run could not be opened");
    failed.get_by_label_contains("no/such/run");
    let mut nothing = harness(Content::Nothing);
    nothing.run_steps(2);
    nothing.get_by_label("No run is open");
}

#[test]
fn a_folder_and_a_file_are_the_same_run() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("capacitance.csv");
    std::fs::write(&file, small_run()).unwrap();
    assert_eq!(load_run(folder.path()).unwrap(), load_run(&file).unwrap());
}

/// A scene with the electrodes of [`small_run`].
const SCENE: &str = r#"
mesh.generate = { elements = 5000 }
sensor.electrode = [
    { name = "E1", rectangle = { center = [-0.06, 0.0], size = [0.04, 0.1] } },
    { name = "E2", rectangle = { center = [0.0, 0.0], size = [0.04, 0.1] } },
    { name = "E3", rectangle = { center = [0.06, 0.0], size = [0.04, 0.1] } },
]
"#;

/// The folder of a run of [`SCENE`], which lies beside it.
fn run_folder(folder: &Path) -> (PathBuf, PathBuf) {
    let (scene_file, run) = (folder.join("scene.toml"), folder.join("run"));
    std::fs::write(&scene_file, SCENE).unwrap();
    std::fs::create_dir(&run).unwrap();
    std::fs::write(run.join(CURVES_FILE), small_run()).unwrap();
    let scene = Scene::load(&scene_file).unwrap();
    let origin = RunOrigin::new(&scene, Some(&scene_file), scene.build_sensor().unwrap().mesh()).unwrap();
    std::fs::write(run.join(REPORT_FILE), serde_json::to_vec(&origin).unwrap()).unwrap();
    (run, scene_file)
}

#[test]
fn the_mesh_comes_from_the_scene_that_the_report_names() {
    let folder = tempfile::tempdir().unwrap();
    let (run, _) = run_folder(folder.path());
    let data = load_run(&run).unwrap();
    let groups: Vec<_> = data.mesh.as_ref().unwrap().groups().iter().map(|g| g.name.as_str()).collect();
    assert_eq!(groups, ["ground", "E1", "E2", "E3"]);
    let mut harness = harness(Content::Run { name: "run".into(), data: Box::new(data) });
    harness.run_steps(4);
    for label in ["ground", "E1", "E2", "E3", "61 frames"] {
        harness.get_by_label(label);
    }
    harness.get_by_label_contains("Mesh picture");
}

#[test]
fn without_its_scene_a_run_still_shows_its_curves_and_says_why_there_is_no_mesh() {
    let folder = tempfile::tempdir().unwrap();
    let (run, scene_file) = run_folder(folder.path());
    let reason = || load_run(&run).unwrap().mesh.unwrap_err();
    let write = |text: String| std::fs::write(&scene_file, text).unwrap();
    write(SCENE.replace("elements = 5000", "elements = 50000"));
    assert!(reason().contains("has changed since"), "{}", reason());
    write(SCENE.replace("\"E3\"", "\"E4\""));
    assert!(reason().contains("other electrodes"), "{}", reason());
    write(SCENE.replace("elements", "element"));
    assert!(reason().contains("scene.toml:2: mesh.generate.element"), "{}", reason());
    std::fs::remove_file(&scene_file).unwrap();
    assert!(reason().contains("scene.toml is not there any more"), "{}", reason());

    let data = load_run(&run).unwrap();
    let mut harness = harness(Content::Run { name: "run".into(), data: Box::new(data) });
    harness.run_steps(4);
    harness.get_by_label("E1–E2");
    harness.get_by_label("61 frames");
    harness.get_by_label("The mesh cannot be shown:");
    harness.get_by_label_contains("scene.toml is not there any more");
    assert!(harness.query_by_label_contains("Mesh picture").is_none());

    std::fs::remove_file(run.join(REPORT_FILE)).unwrap();
    assert!(reason().contains(REPORT_FILE), "{}", reason());
}

#[test]
fn the_command_answers_bad_input_with_code_2_and_a_message_that_names_the_place() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("capacitance.csv");
    std::fs::write(&file, small_run().replacen(",4", ",oops", 1)).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_capsense-viewer"))
        .arg(folder.path())
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_DISPLAY")
        .output()
        .unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains(&file.display().to_string()), "{message}");
    assert!(message.contains("line 2, column 3 (`C_E1_E1_F`)"), "{message}");
    assert!(!message.contains("panicked"), "{message}");
}

#[test]
fn the_readme_calls_the_viewer_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("capsense-out")).unwrap();
    std::fs::write(folder.path().join("capsense-out").join(CURVES_FILE), small_run()).unwrap();
    let readme = concat!(env!("CARGO_MANIFEST_DIR"), "/../../README.md");
    let readme = std::fs::read_to_string(readme).unwrap();
    let calls: Vec<_> = readme.lines().filter_map(|line| line.strip_prefix("capsense-viewer ")).collect();
    assert!(!calls.is_empty());
    for call in calls {
        let output = Command::new(env!("CARGO_BIN_EXE_capsense-viewer"))
            .args(call.split_whitespace())
            .current_dir(folder.path())
            .env_remove("DISPLAY")
            .env_remove("WAYLAND_DISPLAY")
            .output()
            .unwrap();
        let message = String::from_utf8_lossy(&output.stderr);
        // Everything but the display is there.
        assert_eq!(output.status.code(), Some(1), "{message}");
        assert!(message.contains("the window could not be opened"), "{message}");
    }
}
