//! Every scene that comes with the program loads without a warning and gives a Maxwell matrix.

use capsense::{Pipeline, Scene};
use std::path::{Path, PathBuf};

/// Where there may be more than 250,000 tetrahedra, the usual mesh is taken and none compared with it, which would take seconds for each of the
/// scenes that differ in their ways alone.
const CHOSEN: &str = "elements = 150000";
const USUAL: &str = "elements = 260000";

/// Of these the mesh is chosen, as it is for users.
const WAY: &str = "t1_along_0.116";

/// All of them, those in folders, too.
fn scenes() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes");
    let entries = |folder: &Path| -> Vec<PathBuf> {
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect()
    };
    let (folders, mut found): (Vec<_>, Vec<_>) = entries(&folder).into_iter().partition(|path| path.is_dir());
    found.extend(folders.iter().flat_map(|folder| entries(folder)));
    found.retain(|path| path.extension().is_some_and(|extension| extension == "toml"));
    found.sort();
    found
}

#[test]
fn every_scene_runs() {
    let found = scenes();
    assert!(found.len() >= 30, "{}", found.len());
    for path in found {
        let mut text = std::fs::read_to_string(&path).unwrap();
        if !path.to_str().unwrap().contains(WAY) {
            text = text.replace(CHOSEN, USUAL);
        }
        let scene = Scene::parse(path.to_str().unwrap(), &text, path.parent().unwrap())
            .unwrap_or_else(|error| panic!("{error}"));
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        let mut pipeline =
            Pipeline::new(&scene).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let frame =
            pipeline.frame(scene.frames / 2).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let size = scene.electrodes.len();
        for (row, column) in (0..size).flat_map(|row| (0..size).map(move |column| (row, column))) {
            let farads = frame.capacitance.get(row, column);
            let sign = if row == column { 1.0 } else { -1.0 };
            assert!(
                farads * sign > 0.0 && farads.abs() < 1e-9,
                "{}: {row} {column} {farads:e}",
                path.display()
            );
        }
        assert!(frame.solve.relative_error <= scene.solver.tolerance, "{}", path.display());
    }
}
