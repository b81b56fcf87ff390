//! Scenes whose surfaces are exact solids, from the file to the capacitances.

use crate::common::{SCENE, capsense, line_of};
use capsense::{Pipeline, Scene, SceneError};
use std::path::Path;

/// Not in line with the mesh. An object's rim that runs through nodes takes them or leaves them by a hair's breadth, and
/// then the camera and solids differ by several percent on a mesh as coarse as this.
const WAY: [&str; 2] =
    ["[[-0.1, 0.0, 0.1], [0.1, 0.0, 0.1]]", "[[-0.1031, 0.0137, 0.1013], [0.0969, 0.0137, 0.1013]]"];

/// The scene without a camera; what stands instead of its box, and in the table of the simulation.
fn scene(object: &str, simulation: &str) -> String {
    let camera = "[camera]\npixels = [32, 32]\nlayers = 2\n";
    let bar = "box = { size = [0.15, 0.15, 0.04] }";
    let geometry = "geometry = \"camera\"\ninterface = \"edge-cut\"\nback_fill = false";
    assert!([camera, bar, geometry, WAY[0]].iter().all(|piece| SCENE.contains(piece)));
    SCENE.replace(camera, "").replace(WAY[0], WAY[1]).replace(bar, object).replace(geometry, simulation)
}

const BOX: &str = "box = { size = [0.15, 0.15, 0.04] }";
const SOLIDS: &str = "geometry = \"solids\"";

/// Change of each capacitance in some frames, in farads, and how they were found.
fn changes(text: &str, folder: &Path) -> (Vec<f64>, String) {
    let scene = Scene::parse("scene.toml", text, folder).unwrap();
    let mut pipeline = Pipeline::new(&scene).unwrap();
    let mut changes = Vec::new();
    for index in 0..scene.frames {
        let frame = pipeline.frame(index).unwrap();
        let base = pipeline.simulator().base();
        changes.extend([(0, 0), (0, 1), (1, 1)].map(|(i, j)| frame.capacitance.get(i, j) - base.get(i, j)));
    }
    assert_eq!(pipeline.layers().is_some(), text.contains("\"camera\""));
    (changes, pipeline.renderer().to_owned())
}

#[test]
fn a_fine_camera_sees_what_solids_are() {
    let camera = "geometry = \"camera\"\n[camera]\npixels = [512, 512]";
    let ball = "sphere = { radius = 0.06 }";
    let rod = "capsule = { radius = 0.03, length = 0.1 }";
    for object in [BOX, ball, rod] {
        let (solids, description) = changes(&scene(object, SOLIDS), Path::new(""));
        let (seen, renderer) = changes(&scene(object, camera), Path::new(""));
        assert_eq!(description, "exact solids");
        assert_ne!(description, renderer);
        let largest = solids.iter().fold(0.0, |largest, change| change.abs().max(largest));
        for (solid, seen) in solids.iter().zip(&seen) {
            // Cells are coarse, and with solids alone the field around edges and before round bodies is known.
            assert!((solid - seen).abs() < 0.17 * largest, "{object}: {solid:e} {seen:e}");
        }
    }
}

/// The hand with its forearm, in some frames of its way down.
#[test]
fn a_hand_is_the_same_through_the_camera_and_as_a_solid() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes");
    let text = std::fs::read_to_string(folder.join("hand.toml")).unwrap();
    let table = "[simulation]";
    assert_eq!(text.matches(table).count(), 1);
    let as_solid = text.replace(table, &format!("{table}\n{SOLIDS}"));
    let [seen, solid] = [text, as_solid].map(|text| {
        let mut pipeline = Pipeline::new(&Scene::parse("hand.toml", &text, &folder).unwrap()).unwrap();
        let frames = [0, 60, 90, 110].map(|index| pipeline.frame(index).unwrap().capacitance);
        let base = pipeline.simulator().base().clone();
        frames.map(|c| {
            [(0, 0), (1, 1), (3, 3), (4, 4), (0, 1), (3, 4)].map(|(i, j)| c.get(i, j) - base.get(i, j))
        })
    });
    for entry in 0..6 {
        let largest = solid[3][entry].abs();
        for (seen, solid) in seen.iter().zip(&solid) {
            // Pixels are 5.8 mm wide, and a camera sees no gap between thumb and palm, where cells are as high as the hand.
            assert!((seen[entry] - solid[entry]).abs() < 0.05 * largest, "{entry}: {seen:?} {solid:?}");
        }
        assert!(solid.windows(2).all(|pair| pair[1][entry] > pair[0][entry]), "{entry}: {solid:?}");
    }
}

/// A tetrahedron of 0.1 m; without its last face it has three open edges.
fn tetrahedron(faces: usize) -> String {
    let corners = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\n";
    let all = ["f 1 3 2\n", "f 1 2 4\n", "f 2 3 4\n", "f 1 4 3\n"];
    format!("{corners}{}", all[..faces].concat())
}

#[test]
fn an_open_mesh_is_refused_by_file_line_and_key() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("thing.obj"), tetrahedron(3)).unwrap();
    let file = "file = \"thing.obj\"";
    let text = scene(file, SOLIDS);
    let error = Scene::parse("scene.toml", &text, folder.path()).unwrap_err();
    assert!(matches!(error, SceneError::Invalid { .. }));
    let (message, line) = (error.to_string(), line_of(&text, file));
    assert!(message.starts_with(&format!("scene.toml:{line}: object[0].file: `thing.obj`")), "{message}");
    assert!(message.contains("3 open edges") && message.contains("\"camera\""), "{message}");

    let (seen, _) = changes(&scene(file, "geometry = \"camera\""), folder.path());
    assert!(seen[0] > 0.0, "the camera takes it");
    std::fs::write(folder.path().join("thing.obj"), tetrahedron(4)).unwrap();
    let (solids, _) = changes(&text, folder.path());
    assert!(solids[0] > 0.0, "closed, it is a solid");
}

#[test]
fn the_report_tells_of_solids_and_what_is_ignored() {
    let folder = tempfile::tempdir().unwrap();
    let text = SCENE.replace("geometry = \"camera\"", SOLIDS);
    std::fs::write(folder.path().join("scene.toml"), &text).unwrap();
    let outcome = capsense(folder.path(), &["run", "scene.toml", "--out", "out"]);
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    assert!(outcome.stdout.contains("surfaces by exact solids"), "{}", outcome.stdout);
    for (key, piece) in [
        ("camera.pixels", "pixels ="),
        ("camera.layers", "layers ="),
        ("simulation.back_fill", "back_fill ="),
    ] {
        let warning = format!("scene.toml:{}: {key} is ignored", line_of(&text, piece));
        assert!(outcome.stderr.contains(&warning), "{warning}\n{}", outcome.stderr);
    }
    let report = std::fs::read(folder.path().join("out/report.json")).unwrap();
    let report: serde_json::Value = serde_json::from_slice(&report).unwrap();
    let method = &report["method"];
    assert_eq!(method["geometry"], "solids");
    assert!(method["pixels"].is_null() && method["renderer"] == "exact solids", "{method}");
    let clean = scene(BOX, SOLIDS);
    assert!(Scene::parse("scene.toml", &clean, Path::new("")).unwrap().warnings.is_empty());
}
