//! Every scene that comes with the program loads without a warning and gives a Maxwell matrix.

use capsense::{Pipeline, Scene};
use std::path::{Path, PathBuf};

fn scenes(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            scenes(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "toml") {
            found.push(path);
        }
    }
}

#[test]
fn every_scene_runs() {
    let mut found = Vec::new();
    scenes(&Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes"), &mut found);
    found.sort();
    assert!(found.len() >= 30, "{}", found.len());
    for path in found {
        let scene = Scene::load(&path).unwrap_or_else(|error| panic!("{error}"));
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
