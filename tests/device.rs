//! Scenes whose fields are on a graphics device. Tests run on a software adapter where there is no other.
#![allow(clippy::unwrap_used, clippy::panic)]

mod common;

use capsense::core::solver::Preconditioner;
use capsense::{Device, Pipeline, Scene};
use common::SCENE;
use std::path::Path;

/// The scene with other words in its table of the solver.
fn scene(solver: &str) -> Scene {
    let start = SCENE.find("tolerance = 1e-4").unwrap();
    let text = format!("{}{solver}\n", &SCENE[..start]);
    Scene::parse("device.toml", &text, Path::new(".")).unwrap()
}

#[test]
fn a_scene_has_the_same_capacitances_on_either_device() {
    let mut gpu = Pipeline::new(&scene("tolerance = 1e-5\ndevice = \"gpu\"")).unwrap();
    let mut cpu = Pipeline::new(&scene("tolerance = 1e-9")).unwrap();
    assert!(gpu.is_on_gpu() && gpu.device() != "CPU" && !cpu.is_on_gpu() && cpu.device() == "CPU");
    for frame in 0..4 {
        let (ours, expected) = (gpu.frame(frame).unwrap(), cpu.frame(frame).unwrap());
        assert!(ours.solve.launches > 0 && expected.solve.launches == 0);
        for (a, b) in ours.capacitance.rows().flatten().zip(expected.capacitance.rows().flatten()) {
            assert!((a - b).abs() < 1e-5 * expected.capacitance.get(0, 0), "{a:e} {b:e}");
        }
    }
}

/// The same on a mesh that is no lattice, with an object that finds its own potential, found by its surface.
#[test]
fn a_bisected_mesh_has_the_same_capacitances_on_either_device() {
    let other = |solver: &str| {
        let start = SCENE.find("tolerance = 1e-4").unwrap();
        let text = format!("{}{solver}\n", &SCENE[..start])
            .replace("elements = 8000 }", "elements = 8000, kind = \"bisection\" }")
            .replace("\"grounded\"", "\"floating\"")
            .replace("geometry = \"camera\"", "geometry = \"solids\"");
        Scene::parse("device.toml", &text, Path::new(".")).unwrap()
    };
    let mut gpu = Pipeline::new(&other("tolerance = 1e-5\ndevice = \"gpu\"")).unwrap();
    let mut cpu = Pipeline::new(&other("tolerance = 1e-9")).unwrap();
    assert!(gpu.simulator().sensor().lattice().is_none());
    assert!(gpu.is_on_gpu() && gpu.device() != "CPU" && !cpu.is_on_gpu());
    for frame in 0..4 {
        let (ours, expected) = (gpu.frame(frame).unwrap(), cpu.frame(frame).unwrap());
        assert!(ours.solve.launches > 0 && expected.solve.launches == 0);
        for (a, b) in ours.capacitance.rows().flatten().zip(expected.capacitance.rows().flatten()) {
            assert!((a - b).abs() < 1e-5 * expected.capacitance.get(0, 0), "{a:e} {b:e}");
        }
    }
}

/// Where nothing but a software adapter is at hand, and where no device takes the scene.
#[test]
fn auto_runs_everywhere() {
    for words in ["device = \"auto\"", "device = \"auto\"\npreconditioner = \"ic0\""] {
        let scene = scene(words);
        assert_eq!(scene.device, Device::Auto);
        let mut pipeline = Pipeline::new(&scene).unwrap();
        let frame = pipeline.frame(0).unwrap();
        assert!(frame.capacitance.get(0, 0) > 0.0);
        // Nothing but a real adapter is ever chosen, and none takes another preconditioner.
        assert!(!pipeline.is_on_gpu() || scene.solver.preconditioner == Preconditioner::Multigrid);
    }
}

#[test]
fn what_a_device_cannot_compute_is_refused() {
    let error = Pipeline::new(&scene("device = \"gpu\"\npreconditioner = \"ic0\"")).unwrap_err();
    assert_eq!(
        error.to_string(),
        "a graphics device cannot compute this: the preconditioner is not multigrid"
    );
    let text = format!("{}device = \"abacus\"\n", &SCENE[..SCENE.find("tolerance = 1e-4").unwrap()]);
    let error = Scene::parse("device.toml", &text, Path::new(".")).unwrap_err().to_string();
    assert!(error.contains("device.toml") && error.contains("abacus") && error.contains("auto"), "{error}");
}
