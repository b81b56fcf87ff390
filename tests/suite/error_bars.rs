//! Error bars are about as large as errors, on lattices, on meshes from files, with rims that are linked and surfaces that cut
//! edges.

use crate::bars::{Comparison, Halved, of_stripes, plates as plates_in_boxes};
use crate::cases::{CONNECTIONS, bodies, stripes};
use crate::references::References;
use capsense::core::capacitance::CapacitanceMatrix;
use capsense::core::estimate::ErrorBars;
use capsense::core::occupancy::Interface;
use capsense::error_bars::{halved_sensor, unweighed_sensor};
use capsense::gmsh::{self, SurfaceGroup};
use capsense::{ErrorEstimator, Pipeline, Scene};
use std::path::Path;

fn assert_honest(name: &str, compared: &Comparison) {
    let (ratio, held) = (compared.ratio(), compared.held());
    println!("{name}: {ratio:.2} {held:.2}");
    assert!((0.5..3.0).contains(&ratio), "{name}: bars are {ratio:.2} times the errors");
    assert!(held > 0.75, "{name}: {held:.2} of errors are within their bars");
}

#[test]
fn bars_of_stripes_are_as_large_as_errors() {
    let references = References::load().unwrap();
    for tets in [10_000, 30_000] {
        let sensors = Halved::of(&stripes(), tets).unwrap();
        for connection in CONNECTIONS {
            let [of_c, of_change] =
                of_stripes(&sensors, Interface::EdgeCut, connection, &bodies(), &references).unwrap();
            assert_honest(&format!("C at {tets}, {}", connection.0), &of_c);
            assert_honest(&format!("changes at {tets}, {}", connection.0), &of_change);
        }
    }
}

/// Models that fill whole elements are wrong by how a staircase happens to stand, on the halved mesh too.
#[test]
fn bars_of_models_that_fill_elements_are_as_large_as_errors() {
    let references = References::load().unwrap();
    let sensors = Halved::of(&stripes(), 10_000).unwrap();
    for interface in [Interface::VolumeFraction, Interface::Centroid] {
        for connection in CONNECTIONS {
            let [_, of_change] = of_stripes(&sensors, interface, connection, &bodies(), &references).unwrap();
            let name = format!("changes with {}, {}", interface.name(), connection.0);
            assert_honest(&name, &of_change);
            assert!(of_change.held() > 0.9, "{name}: {:.2} of errors are within", of_change.held());
        }
    }
}

#[test]
fn bars_of_plates_are_as_large_as_errors() {
    let mut all = [Comparison::default(), Comparison::default()];
    for plate in plates_in_boxes().unwrap() {
        let of_plate = plate.compare(&Halved::of(&plate.design, 16_000).unwrap()).unwrap();
        all.iter_mut().zip(of_plate).for_each(|(all, of_plate)| all.extend(of_plate));
    }
    assert_honest("C", &all[0]);
    assert_honest("changes", &all[1]);
}

/// A scene of the stripes and a bar, with a mesh as given.
fn scene(mesh: &str, threads: usize, folder: &Path) -> Scene {
    scene_at("0.06", mesh, threads, folder)
}

/// The same with the bar's middle at another height.
fn scene_at(height: &str, mesh: &str, threads: usize, folder: &Path) -> Scene {
    let stripe = |k: usize| {
        let y = 0.03 * (k as f64 - 2.0);
        format!(
            "[[sensor.electrode]]\nname = \"E{k}\"\nrectangle = {{ center = [0.0, {y}], size = [0.1, 0.02] }}\n"
        )
    };
    let text = format!(
        "[mesh]\n{mesh}\n{}[[object]]\nname = \"bar\"\nbox = {{ size = [0.15, 0.15, 0.02] }}\n\
         material = {{ conductor = \"grounded\" }}\nposition = [0.0, 0.0, {height}]\n\
         [simulation]\ngeometry = \"solids\"\nframes = 3\n[solver]\nthreads = {threads}\n",
        (1..=3).map(stripe).collect::<String>()
    );
    Scene::parse("stripes.toml", &text, folder).unwrap()
}

fn bars_of(scene: &Scene) -> ErrorBars {
    let mut pipeline = Pipeline::new(scene).unwrap();
    let mut estimator = ErrorEstimator::new(scene, &pipeline).unwrap().unwrap();
    let frame = pipeline.frame(0).unwrap();
    estimator.estimate(&mut pipeline, &frame).unwrap()
}

/// The pipeline's own bars do so, too, wherever a bar stands between planes of nodes.
#[test]
fn bars_of_scenes_know_what_filled_elements_miss() {
    let change = |scene: &Scene| {
        let mut pipeline = Pipeline::new(scene).unwrap();
        let frame = pipeline.frame(0).unwrap();
        frame.capacitance.minus(pipeline.simulator().base())
    };
    for height in ["0.04", "0.047", "0.055", "0.063"] {
        let generate = |elements| {
            let mesh = format!("generate = {{ elements = {elements} }}");
            scene_at(height, &mesh, 0, Path::new(""))
        };
        let (truth, coarse) = (change(&generate(100_000)), generate(10_000));
        for interface in [Interface::VolumeFraction, Interface::Centroid] {
            let scene = Scene { interface, ..coarse.clone() };
            let (error, bars) = (change(&scene).minus(&truth), bars_of(&scene).change);
            let largest = |matrix: &CapacitanceMatrix| {
                matrix.rows().flatten().fold(0.0, |most: f64, entry| most.max(entry.abs()))
            };
            let ratio = largest(&bars) / largest(&error);
            assert!((1.0..3.0).contains(&ratio), "{interface:?} at {height}: {ratio}");
        }
    }
}

/// Links that suit the mesh make C on it what it is on the halved one. Before bars knew, that of these squares was off by up to 2.3
/// bars.
#[test]
fn bars_know_what_links_that_suit_the_mesh_hide() {
    let squares: String = [[-0.02, -0.02], [0.02, -0.02], [-0.02, 0.02], [0.02, 0.02]]
        .iter()
        .enumerate()
        .map(|(k, [x, y])| {
            let shape = format!("rectangle = {{ center = [{x}, {y}], size = [0.03, 0.03] }}");
            format!("[[sensor.electrode]]\nname = \"E{k}\"\n{shape}\n")
        })
        .collect();
    let of = |elements: usize| {
        let text = format!(
            "[mesh]\ngenerate = {{ elements = {elements} }}\n{squares}[[object]]\nname = \"ball\"\n\
             sphere = {{ radius = 0.025 }}\nmaterial = {{ conductor = \"grounded\" }}\nposition = [0.01, 0.0, 0.06]\n\
             [simulation]\ngeometry = \"solids\"\n"
        );
        Scene::parse("squares.toml", &text, Path::new("")).unwrap()
    };
    let capacitance = |scene: &Scene| Pipeline::new(scene).unwrap().frame(0).unwrap().capacitance;
    let coarse = of(45_000);
    assert!(unweighed_sensor(&coarse, &coarse.build_sensor().unwrap()).unwrap().is_some());
    let (errors, bars) =
        (capacitance(&coarse).minus(&capacitance(&of(2_500_000))), bars_of(&coarse).capacitance);
    let ratios: Vec<f64> =
        bars.rows().flatten().zip(errors.rows().flatten()).map(|(bar, error)| bar / error.abs()).collect();
    println!("{ratios:.2?}");
    assert!(ratios.iter().all(|ratio| *ratio > 1.0), "{ratios:.2?}");
}

fn generated(elements: usize, threads: usize) -> Scene {
    scene(&format!("generate = {{ elements = {elements} }}"), threads, Path::new(""))
}

#[test]
fn bars_shrink_as_meshes_grow() {
    let [coarse, fine] = [10_000, 200_000].map(|elements| bars_of(&generated(elements, 0)));
    for (coarse, fine) in [(coarse.capacitance, fine.capacitance), (coarse.change, fine.change)] {
        for (coarse, fine) in coarse.rows().flatten().zip(fine.rows().flatten()) {
            assert!(*fine > 0.0 && 2.0 * fine < *coarse, "{coarse:e} {fine:e}");
        }
    }
}

#[test]
fn bars_have_the_same_bits_for_any_number_of_threads() {
    let [one, two] = [1, 2].map(|threads| bars_of(&generated(30_000, threads)));
    assert_eq!(one, two);
}

#[test]
fn bars_are_told_in_the_middle_of_many_frames() {
    let scene = generated(10_000, 0);
    let pipeline = Pipeline::new(&scene).unwrap();
    let estimator = ErrorEstimator::new(&scene, &pipeline).unwrap().unwrap();
    assert!(estimator.every() > 100, "{}", estimator.every());
    let due: Vec<usize> = (0..=estimator.every() + 2).filter(|&frame| estimator.is_due(frame)).collect();
    assert_eq!(due, [1, estimator.every() + 1], "in the middle of three frames");
}

/// On a lattice that went through a file: a mesh like any other, with electrodes as groups of triangles or as outlines.
#[test]
fn bars_on_meshes_from_files_are_as_large_as_errors() {
    let folder = tempfile::tempdir().unwrap();
    let sensor = generated(30_000, 0).build_sensor().unwrap().with_rims_held();
    let mesh = sensor.mesh();
    let wall = gmsh::boundary_faces(mesh);
    let sheets: Vec<_> = (1..=3u16)
        .map(|terminal| {
            let nodes = (0..).zip(sensor.terminals()).filter(|(_, held)| **held == terminal);
            (
                format!("E{terminal}"),
                gmsh::faces_among(mesh, &nodes.map(|(node, _)| node).collect::<Vec<u32>>()),
            )
        })
        .collect();
    let mut groups = vec![SurfaceGroup { name: "ground", triangles: &wall }];
    groups.extend(sheets.iter().map(|(name, triangles)| SurfaceGroup { name, triangles }));
    let references = References::load().unwrap();
    for (name, groups) in [("outlines", &groups[..1]), ("groups", &groups)] {
        std::fs::write(folder.path().join("mesh.msh"), gmsh::write(mesh, groups, &[]).unwrap()).unwrap();
        let scene = scene("file = \"mesh.msh\"\nunit = \"m\"", 0, folder.path());
        let own = scene.build_sensor().unwrap();
        let halved = halved_sensor(&scene, &own).unwrap();
        assert_eq!(halved.mesh().tets().len(), 8 * own.mesh().tets().len());
        assert!(unweighed_sensor(&scene, &own).unwrap().is_none());
        let sensors = Halved { own, unweighed: None, halved };
        let [of_c, of_change] =
            of_stripes(&sensors, Interface::EdgeCut, CONNECTIONS[0], &bodies(), &references).unwrap();
        assert_honest(&format!("C with {name}"), &of_c);
        assert_honest(&format!("changes with {name}"), &of_change);
    }
}
