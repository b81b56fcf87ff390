//! Electrodes from STL files, in scenes: the same sensor as by lengths, and refusals that name file, line and key.

use crate::common::{SCENE, expect_refusal, line_of};
use capsense::Scene;
use capsense::core::sensor::Sensor;
use capsense::core::simulator::Simulator;
use capsense::core::solver::SolverOptions;
use proptest::prelude::*;
use std::path::Path;

const SHAPE: &str = "rectangle = { center = [-0.05, 0.0], size = [0.06, 0.1] }";

type Triangle = [[f32; 3]; 3];

fn ascii(triangles: &[Triangle]) -> Vec<u8> {
    let corner = |[x, y, z]: &[f32; 3]| format!("vertex {x} {y} {z}\n");
    let facet = |triangle: &Triangle| {
        let corners: String = triangle.iter().map(corner).collect();
        format!("facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n")
    };
    format!("solid e\n{}endsolid e\n", triangles.iter().map(facet).collect::<String>()).into_bytes()
}

fn binary(triangles: &[Triangle]) -> Vec<u8> {
    let mut bytes = vec![0; 80];
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for triangle in triangles {
        bytes.extend([0; 12]);
        bytes.extend(triangle.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

/// The rectangle of [`SHAPE`] in millimetres.
fn rectangle(z: f32) -> Vec<Triangle> {
    let [a, b, c, d] = [[-80.0, -50.0, z], [-20.0, -50.0, z], [-20.0, 50.0, z], [-80.0, 50.0, z]];
    vec![[a, b, c], [a, c, d]]
}

fn plate(low: f32, high: f32) -> Vec<Triangle> {
    let mut all = rectangle(high);
    all.extend(rectangle(low).into_iter().map(|[a, b, c]| [a, c, b]));
    let [[a, b, c], [_, _, d]] = [rectangle(high)[0], rectangle(high)[1]];
    for (p, q) in [(a, b), (b, c), (c, d), (d, a)] {
        let down = |p: [f32; 3]| [p[0], p[1], low];
        all.extend([[p, down(p), down(q)], [p, down(q), q]]);
    }
    all
}

fn sensor(folder: &Path, scene: &str) -> Sensor {
    Scene::parse("scene.toml", scene, folder).unwrap().build_sensor().unwrap()
}

#[test]
fn a_rectangle_is_the_same_sensor_however_it_is_given() {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in [
        ("sheet.stl", ascii(&rectangle(0.0))),
        ("plate.STL", binary(&plate(-0.035, 0.0))),
        ("high.stl", binary(&rectangle(7.5))),
    ] {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    let base = |sensor: Sensor| {
        let options = SolverOptions { tolerance: 1e-12, ..SolverOptions::default() };
        let simulator = Simulator::new(sensor, vec![], options).unwrap();
        [simulator.base().get(0, 0), simulator.base().get(0, 1), simulator.base().get(1, 1)]
    };
    let expected = sensor(folder.path(), SCENE);
    let capacitances = base(expected.clone());
    for shape in [
        "polygon = [[-0.08, -0.05], [-0.02, -0.05], [-0.02, 0.05], [-0.08, 0.05]]",
        "polygon = [[-0.08, -0.05], [-0.02, -0.05], [-0.02, 0.05], [-0.08, 0.05], [-0.08, -0.05]]",
        "stl = \"sheet.stl\"\nunit = \"mm\"",
        "stl = \"plate.STL\"\nunit = \"mm\"",
        "stl = \"high.stl\"\nunit = \"mm\"\nz = 0.0",
    ] {
        let found = sensor(folder.path(), &SCENE.replace(SHAPE, shape));
        assert_eq!(found.terminals(), expected.terminals(), "{shape}");
        for (a, b) in base(found).into_iter().zip(capacitances) {
            assert!((a / b - 1.0).abs() < 1e-9, "{shape}: {a} {b}");
        }
    }
    // Without `z` the file's own height counts.
    let high = sensor(folder.path(), &SCENE.replace(SHAPE, "stl = \"high.stl\"\nunit = \"mm\""));
    let nodes = high.mesh().nodes().iter().zip(high.terminals());
    let heights: Vec<f64> = nodes.filter(|(_, terminal)| **terminal == 1).map(|(node, _)| node.z).collect();
    assert!(!heights.is_empty() && heights.iter().all(|z| (z - 7.5e-3).abs() < 1e-9), "{heights:?}");
}

#[test]
fn files_that_are_no_thin_electrode_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let tilted: Vec<Triangle> =
        rectangle(0.0).into_iter().map(|t| t.map(|[x, y, _]| [x, y, 0.5 * x])).collect();
    let files: [(&str, Vec<u8>); 5] = [
        ("flat.stl", ascii(&rectangle(0.0))),
        ("tilted.stl", ascii(&tilted)),
        ("block.stl", binary(&plate(0.0, 20.0))),
        ("cut.stl", binary(&rectangle(0.0))[..130].to_vec()),
        ("flat.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".to_vec()),
    ];
    for (name, bytes) in files {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    let stl = "sensor.electrode[0].stl";
    for (shape, at, key, says) in [
        ("stl = \"tilted.stl\"\nunit = \"mm\"", "stl =", stl, "`tilted.stl` spans z from -0.04 m to -0.01 m"),
        ("stl = \"block.stl\"\nunit = \"mm\"", "stl =", stl, "`block.stl` is 0.02 m thick and 0.06 m wide"),
        ("stl = \"cut.stl\"", "stl =", stl, "cut.stl: "),
        ("stl = \"none.stl\"", "stl =", stl, "none.stl: "),
        ("stl = \"flat.obj\"", "stl =", stl, "`flat.obj` must end in .stl"),
        ("stl = \"flat.stl\"\nunit = \"inch\"", "unit", "sensor.electrode[0].unit", "unknown unit"),
        ("stl = \"flat.stl\"\nunit = \"mm\"\nz = nan", "z = nan", "sensor.electrode[0].z", "must be finite"),
        ("stl = \"flat.stl\"", "[[sensor.electrode]]", "sensor.electrode[0]", "the file is read in metres"),
        ("stl = \"flat.stl\"\npolygon = []", "[[sensor.electrode]]", "sensor.electrode[0]", "has 2 shapes"),
    ] {
        let scene = SCENE.replace(SHAPE, shape);
        expect_refusal(folder.path(), &scene, "scene.toml", line_of(&scene, at), key, says);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever the bytes of the file, the scene is accepted or refused with a message.
    #[test]
    fn damaged_files_never_panic(edits in prop::collection::vec((0usize..2000, any::<u8>()), 1..8), text in any::<bool>()) {
        let folder = tempfile::tempdir().unwrap();
        let mut bytes = if text { ascii(&plate(-0.035, 0.0)) } else { binary(&plate(-0.035, 0.0)) };
        let length = bytes.len();
        for (at, byte) in edits {
            bytes[at % length] = byte;
        }
        std::fs::write(folder.path().join("e.stl"), bytes).unwrap();
        let scene = SCENE.replace(SHAPE, "stl = \"e.stl\"\nunit = \"mm\"");
        if let Err(error) = Scene::parse("scene.toml", &scene, folder.path()) {
            prop_assert!(error.to_string().contains("sensor.electrode[0]"), "{error}");
        }
    }
}
