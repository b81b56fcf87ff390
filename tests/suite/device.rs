//! Scenes whose fields are on a graphics device. Tests run on a software adapter where there is no other.

use crate::common::SCENE;
use capsense::core::solver::Preconditioner;
use capsense::{Device, Pipeline, Scene};
use std::path::Path;

/// The scene with other words in its table of the solver.
fn scene(solver: &str) -> Scene {
    Scene::parse("device.toml", &scene_text(solver), Path::new(".")).unwrap()
}

fn scene_text(solver: &str) -> String {
    let start = SCENE.find("tolerance = 1e-4").unwrap();
    format!("{}{solver}\n", &SCENE[..start])
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
            .replace("elements = 8000 }", "elements = 30000, kind = \"bisection\" }")
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
            assert!((a - b).abs() < 1e-5 * expected.capacitance.get(0, 0), "{a:e} {b:e} {:?}", ours.solve);
        }
    }
}

/// Solids are found on the device, and on the processor for who looks; those of triangles that are no box on the processor alone.
#[test]
fn solids_are_found_on_the_device_if_they_can_be() {
    let text = |solver: &str| scene_text(solver).replace("geometry = \"camera\"", "geometry = \"solids\"");
    let on = |text: &str| Pipeline::new(&Scene::parse("device.toml", text, Path::new(".")).unwrap()).unwrap();
    let mut gpu = on(&text("tolerance = 1e-5\ndevice = \"gpu\""));
    let mut cpu = on(&text("tolerance = 1e-9"));
    assert!(gpu.finds_objects_on_gpu() && gpu.renderer() == "exact solids" && gpu.layers().is_none());
    for frame in [0, 2, 2] {
        let (ours, expected) = (gpu.frame(frame).unwrap(), cpu.frame(frame).unwrap());
        for (a, b) in ours.capacitance.rows().flatten().zip(expected.capacitance.rows().flatten()) {
            assert!((a - b).abs() < 1e-5 * expected.capacitance.get(0, 0), "{a:e} {b:e}");
        }
        assert_eq!(ours.changed_edges == 0, ours.solve.skipped);
        assert_eq!(ours.changed_edges == 0, expected.changed_edges == 0);
    }
    let conductors = |pipeline: &Pipeline| pipeline.simulator().occupancy().conductors().to_vec();
    assert!(conductors(&gpu) != conductors(&cpu));
    gpu.look().unwrap();
    assert!(conductors(&gpu) == conductors(&cpu));
    assert_eq!(gpu.unresolved().unwrap(), cpu.unresolved().unwrap());
    let forearm = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/objects/forearm.stl");
    let text =
        text("device = \"gpu\"").replace("box = { size = [0.15, 0.15, 0.04] }", "file = FILE\nunit = \"m\"");
    let mut pipeline = on(&text.replace("FILE", &format!("{forearm:?}")));
    assert!(pipeline.is_on_gpu() && !pipeline.finds_objects_on_gpu());
    assert!(pipeline.frame(0).unwrap().changed_edges > 0);
}

/// What the ends of floating plates change, devices do not know.
#[test]
fn floating_plates_are_found_on_the_processor() {
    let text = |size: &str, connection: &str| {
        let text = scene_text("tolerance = 1e-5\ndevice = \"gpu\"")
            .replace("geometry = \"camera\"", "geometry = \"solids\"");
        text.replace("[0.15, 0.15, 0.04]", size).replace("\"grounded\"", connection)
    };
    let on = |text: &str| Pipeline::new(&Scene::parse("device.toml", text, Path::new(".")).unwrap()).unwrap();
    for (size, connection, is_on_gpu) in [
        ("[0.15, 0.15, 0.04]", "\"grounded\"", true),
        ("[0.15, 0.15, 0.04]", "\"floating\"", false),
        ("[0.15, 0.15, 0.04]", "{ capacitance = 1e-12 }", false),
        ("[0.15, 0.15, 0.08]", "\"floating\"", true),
    ] {
        let pipeline = on(&text(size, connection));
        assert!(pipeline.is_on_gpu() && pipeline.finds_objects_on_gpu() == is_on_gpu, "{size} {connection}");
    }
}

/// Objects seen by a depth camera are found on the device, and on the processor for who looks.
#[test]
fn a_camera_on_the_device_sees_what_one_here_does() {
    let mut gpu = Pipeline::new(&scene("tolerance = 1e-5\ndevice = \"gpu\"")).unwrap();
    let mut cpu = Pipeline::new(&scene("tolerance = 1e-9")).unwrap();
    assert!(gpu.finds_objects_on_gpu() && !cpu.finds_objects_on_gpu());
    for frame in [0, 1, 1, 3] {
        let (ours, expected) = (gpu.frame(frame).unwrap(), cpu.frame(frame).unwrap());
        for (a, b) in ours.capacitance.rows().flatten().zip(expected.capacitance.rows().flatten()) {
            // The processor draws with pixels of its own at silhouettes.
            assert!((a - b).abs() < 2e-3 * expected.capacitance.get(0, 0), "{a:e} {b:e}");
        }
        assert_eq!(ours.changed_edges == 0, ours.solve.skipped);
    }
    let nothing = gpu.layers().unwrap().front(0).iter().all(|z| z.is_infinite());
    gpu.look().unwrap();
    let conductors = |pipeline: &Pipeline| pipeline.simulator().occupancy().conductors().to_vec();
    assert!(nothing && conductors(&gpu) == conductors(&cpu));
    assert!(gpu.layers().unwrap().front(0).iter().any(|z| z.is_finite()));
    assert_eq!(gpu.unresolved().unwrap(), cpu.unresolved().unwrap());
    // Other models than surfaces that cut edges are the processor's.
    let filled = scene_text("device = \"gpu\"").replace("edge-cut", "centroid");
    let filled = Scene::parse("device.toml", &filled, Path::new(".")).unwrap();
    let mut pipeline = Pipeline::new(&filled).unwrap();
    assert!(pipeline.is_on_gpu() && !pipeline.finds_objects_on_gpu());
    assert!(pipeline.frame(0).unwrap().changed_edges > 0);
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
