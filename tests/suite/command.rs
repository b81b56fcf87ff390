//! The program as a user runs it: files, tables, JSON, help and exit codes.

use crate::common::{MESH_SCENE, SCENE, capsense, cube_file};
use capsense::run_folder::{MeshSize, RunOrigin, RunOriginError};
use serde_json::Value;
use std::path::Path;

fn write_scene(folder: &Path) {
    std::fs::write(folder.join("scene.toml"), SCENE).unwrap();
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// Columns by name; every cell must be a number.
fn columns(path: &Path) -> Vec<(String, Vec<f64>)> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    let mut columns: Vec<_> =
        reader.headers().unwrap().iter().map(|name| (name.to_owned(), vec![])).collect();
    for record in reader.records() {
        for (cell, (_, values)) in record.unwrap().iter().zip(&mut columns) {
            values.push(cell.parse().unwrap());
        }
    }
    columns
}

fn matrix(value: &Value) -> Vec<Vec<f64>> {
    serde_json::from_value(value.clone()).unwrap()
}

#[test]
fn run_writes_curves_table_and_report() {
    let folder = tempfile::tempdir().unwrap();
    write_scene(folder.path());
    let outcome = capsense(folder.path(), &["run", "scene.toml", "--out", "results"]);
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    for text in ["E1 E2", "5 frames", "the largest error bars, told once in "] {
        assert!(outcome.stdout.contains(text), "`{text}` is missing in:\n{}", outcome.stdout);
    }
    let out = folder.path().join("results");
    let mut names: Vec<_> =
        std::fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["capacitance.csv", "capacitance.svg", "report.json"]);

    let table = std::fs::read_to_string(out.join("capacitance.csv")).unwrap();
    assert_eq!(
        table.lines().next(),
        Some(
            "frame,time_s,C_E1_E1_F,C_E1_E2_F,C_E2_E2_F,changed_edges,iterations,geometry_ms,update_ms,solve_ms"
        )
    );
    let columns = columns(&out.join("capacitance.csv"));
    assert_eq!(columns[0].1, [0.0, 1.0, 2.0, 3.0, 4.0], "0.2 m at 0.5 m/s and 10 frames per second");
    assert_eq!(columns[1].1, [0.0, 0.1, 0.2, 0.3, 0.4]);
    assert!(columns[2].1.iter().chain(&columns[4].1).all(|&farads| farads > 1e-13 && farads < 1e-10));
    assert!(columns[3].1.iter().all(|&farads| farads < 0.0));
    assert!(columns[5].1.iter().sum::<f64>() > 0.0, "the bar changes edges");

    let svg = std::fs::read_to_string(out.join("capacitance.svg")).unwrap();
    for text in ["time [s]", "E1 E1", "E1 E2", "E2 E2", "[fF]"] {
        assert!(svg.contains(text), "{text}");
    }
    let report = json(&out.join("report.json"));
    assert_eq!(report["scene"], "scene.toml");
    let scene_file = Path::new(report["scene_file"].as_str().unwrap());
    assert!(scene_file.is_absolute() && scene_file.ends_with("scene.toml"), "{}", scene_file.display());
    assert_eq!(std::fs::read_to_string(scene_file).unwrap(), SCENE);
    assert_eq!(report["electrodes"], serde_json::json!(["E1", "E2"]));
    assert_eq!(report["frames"]["computed"], 5);
    assert_eq!(report["frames"]["interrupted"], false);
    assert_eq!(report["method"]["interface"], "edge-cut");
    assert!(report["mesh"]["tets"].as_u64().unwrap() <= 8000);
    assert!(report["mesh"]["tets"].as_u64().unwrap() > 4000);
    let [median, most] =
        ["median", "max"].map(|rank| report["solver"][format!("iterations_{rank}")].as_u64().unwrap());
    assert!(0 < median && median <= most, "{median} {most}");
    assert!(report["solver"]["relative_error_max"].as_f64().unwrap() <= 1e-4);
    assert_eq!(matrix(&report["base_farads"]).len(), 2);
    for part in ["geometry", "update", "solve", "total"] {
        let spread = &report["milliseconds"][part];
        let [median, p95, max] = ["median", "p95", "max"].map(|rank| spread[rank].as_f64().unwrap());
        assert!(0.0 <= median && median <= p95 && p95 <= max, "{part}: {spread}");
    }
    let bars = &report["error_bars"];
    assert!(bars["every"].as_u64().unwrap() > 5);
    assert!(bars["mesh"]["tets"].as_u64().unwrap() == 8 * report["mesh"]["tets"].as_u64().unwrap());
    assert!(bars["milliseconds"]["setup"].as_f64().unwrap() > 0.0);
    let frames = bars["frames"].as_array().unwrap();
    assert_eq!(frames.iter().map(|frame| frame["frame"].as_u64().unwrap()).collect::<Vec<_>>(), [2]);
    for key in ["error_farads", "change_error_farads"] {
        let bars = matrix(&frames[0][key]);
        assert_eq!(bars.len(), 2);
        assert!(bars.iter().flatten().all(|bar| *bar > 0.0), "{bars:?}");
    }
    assert_eq!(report["warnings"], serde_json::json!([]));
}

#[test]
fn a_run_leads_back_to_its_scene_from_anywhere() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("deep/scene.toml");
    std::fs::create_dir_all(folder.path().join("deep/er")).unwrap();
    std::fs::write(&scene, SCENE).unwrap();
    let outcome =
        capsense(&folder.path().join("deep/er"), &["run", "../scene.toml", "--quiet", "--out", "../../out"]);
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);

    let origin = RunOrigin::read(&folder.path().join("out")).unwrap();
    assert_eq!(origin.scene, "../scene.toml");
    let sensor = origin.build_sensor().unwrap();
    assert_eq!(sensor.electrode_names(), ["E1", "E2"]);
    assert_eq!(MeshSize::of(sensor.mesh()), origin.mesh);

    std::fs::write(&scene, SCENE.replace("elements = 8000", "elements = 20000")).unwrap();
    assert!(matches!(origin.build_sensor(), Err(RunOriginError::Changed { .. })));
    std::fs::write(&scene, SCENE.replace("elements", "element")).unwrap();
    assert!(matches!(origin.build_sensor(), Err(RunOriginError::Scene(_))));
    std::fs::remove_file(&scene).unwrap();
    assert!(matches!(origin.build_sensor(), Err(RunOriginError::Gone(_))));

    let report = folder.path().join("out/report.json");
    std::fs::write(&report, r#"{"scene": "scene.toml", "mesh": {}}"#).unwrap();
    assert!(matches!(RunOrigin::read(&folder.path().join("out")), Err(RunOriginError::Parse { .. })));
    std::fs::remove_file(&report).unwrap();
    assert!(matches!(RunOrigin::read(&folder.path().join("out")), Err(RunOriginError::Read { .. })));
}

#[test]
fn a_conductor_on_an_electrode_is_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    let scene = SCENE.replace("[[-0.1, 0.0, 0.1], [0.1, 0.0, 0.1]]", "[[0.0, 0.0, 0.12], [0.0, 0.0, 0.02]]");
    std::fs::write(folder.path().join("scene.toml"), scene).unwrap();
    let outcome = capsense(folder.path(), &["run", "scene.toml", "--quiet", "--out", "out"]);
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    let says = |electrode: &str| {
        format!(
            "scene.toml: in frame 2 object `bar` touches electrode `{electrode}`, a short circuit: \
             capacitances of what touches mean nothing"
        )
    };
    let expected = ["E1", "E2"].map(says);
    let printed: Vec<_> = outcome.stderr.lines().map(|line| line.trim_start_matches("warning: ")).collect();
    assert_eq!(printed, expected);
    let report = json(&folder.path().join("out/report.json"));
    assert_eq!(report["warnings"], serde_json::json!(expected));

    for (frame, warned) in [("1", false), ("2", true)] {
        let outcome = capsense(folder.path(), &["solve", "scene.toml", "--frame", frame]);
        assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
        assert_eq!(
            outcome.stderr.contains(&format!("warning: {}", says("E2"))),
            warned,
            "{}",
            outcome.stderr
        );
    }
}

#[test]
fn two_runs_give_identical_capacitances() {
    let folder = tempfile::tempdir().unwrap();
    write_scene(folder.path());
    let of_run = |out: &str| {
        let outcome = capsense(folder.path(), &["run", "scene.toml", "--quiet", "--out", out]);
        assert_eq!((outcome.code, outcome.stdout.as_str()), (Some(0), ""), "{}", outcome.stderr);
        let mut columns = columns(&folder.path().join(out).join("capacitance.csv"));
        columns.truncate(7);
        columns
    };
    assert_eq!(of_run("first"), of_run("second"));
}

#[test]
fn every_preconditioner_gives_the_same_capacitances() {
    let folder = tempfile::tempdir().unwrap();
    let solve = |name: &str| {
        let scene = crate::common::SCENE.replace("\"jacobi\"", &format!("\"{name}\""));
        std::fs::write(folder.path().join("scene.toml"), scene).unwrap();
        let outcome = capsense(folder.path(), &["solve", "scene.toml", "--json", "--frame", "2"]);
        assert_eq!(outcome.code, Some(0), "{name}: {}", outcome.stderr);
        let solved: Value = serde_json::from_str(&outcome.stdout).unwrap();
        assert_eq!(solved["solver"]["preconditioner"], name);
        matrix(&solved["capacitance_farads"])
    };
    let exact = solve("direct");
    for name in ["multigrid", "ic0", "jacobi", "none"] {
        for (c, exact) in solve(name).iter().flatten().zip(exact.iter().flatten()) {
            assert!((c - exact).abs() <= 3e-4 * exact.abs(), "{name}: {c} {exact}");
        }
    }
}

#[test]
fn solve_prints_one_json_object_that_is_a_maxwell_matrix() {
    let folder = tempfile::tempdir().unwrap();
    write_scene(folder.path());
    let outcome = capsense(folder.path(), &["solve", "scene.toml", "--json", "--frame", "2"]);
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    let solved: Value = serde_json::from_str(&outcome.stdout).unwrap();
    let keys: Vec<_> = solved.as_object().unwrap().keys().map(String::as_str).collect();
    let expected = [
        "base_farads",
        "capacitance_farads",
        "change_error_farads",
        "change_farads",
        "error_farads",
        "mesh",
        "milliseconds",
        "solver",
        "terminals",
    ];
    assert_eq!(
        {
            let mut keys = keys;
            keys.sort_unstable();
            keys
        },
        expected
    );
    assert_eq!(solved["terminals"], serde_json::json!(["E1", "E2"]));
    for group in
        [("mesh", vec!["nodes", "tets"]), ("milliseconds", vec!["geometry", "update", "solve", "total"])]
    {
        for key in group.1 {
            assert!(solved[group.0][key].as_f64().unwrap() >= 0.0, "{} {key}", group.0);
        }
    }
    assert_eq!(solved["solver"]["preconditioner"], "jacobi");
    assert!(solved["solver"]["iterations"].as_u64().unwrap() > 0);
    let error = matrix(&solved["error_farads"]);
    for key in ["capacitance_farads", "base_farads"] {
        let c = matrix(&solved[key]);
        assert_eq!((c.len(), c[0].len()), (2, 2));
        assert_eq!(c[0][1], c[1][0]);
        assert!(c[0][0] > 0.0 && c[1][1] > 0.0 && c[0][1] < 0.0, "{key}: {c:?}");
        assert!(c[0][0] + c[0][1] > 0.0 && c[1][1] + c[0][1] > 0.0, "what is missing is held to ground");
        assert!(error.iter().flatten().zip(c.iter().flatten()).all(|(e, c)| *e > 0.0 && *e < c.abs()));
    }
    let change = matrix(&solved["capacitance_farads"])[0][1] - matrix(&solved["base_farads"])[0][1];
    approx::assert_relative_eq!(matrix(&solved["change_farads"])[0][1], change, max_relative = 1e-12);
    let of_change = matrix(&solved["change_error_farads"])[0][1];
    assert!(of_change > 0.0 && of_change < change, "{of_change}");
    assert!(change > 0.0, "a grounded bar above lowers the mutual capacitance: {change}");
}

#[test]
fn solve_prints_a_readable_matrix() {
    let folder = tempfile::tempdir().unwrap();
    write_scene(folder.path());
    let outcome = capsense(folder.path(), &["solve", "scene.toml"]);
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    for text in
        ["Maxwell capacitance matrix in pF", "±", "Change by the objects in fF", "tetrahedra", "iterations"]
    {
        assert!(outcome.stdout.contains(text), "{text} is missing:\n{}", outcome.stdout);
    }
}

#[test]
fn nothing_is_written_to_standard_error_without_a_session_folder() {
    let folder = tempfile::tempdir().unwrap();
    write_scene(folder.path());
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_capsense"))
        .current_dir(folder.path())
        .args(["solve", "scene.toml"])
        .env_remove("XDG_RUNTIME_DIR")
        .output()
        .unwrap();
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
}

#[test]
fn bad_arguments_end_with_code_2() {
    let folder = tempfile::tempdir().unwrap();
    write_scene(folder.path());
    for arguments in [
        &["solve"][..],
        &["fly"],
        &["run", "--speed", "3"],
        &["mesh"],
        &["mesh", "scene.toml"],
        &["mesh", "info"],
        &["mesh", "info", "none.msh"],
        &["mesh", "info", "scene.toml"],
        &["solve", "scene.toml", "--frame", "5"],
        &["solve", "scene.toml", "--frame", "-1"],
    ] {
        let outcome = capsense(folder.path(), arguments);
        assert_eq!(outcome.code, Some(2), "{arguments:?}: {}", outcome.stderr);
        assert!(!outcome.stderr.is_empty());
    }
}

#[test]
fn a_folder_that_cannot_be_made_is_a_failure() {
    let folder = tempfile::tempdir().unwrap();
    write_scene(folder.path());
    let outcome = capsense(folder.path(), &["run", "scene.toml", "--out", "scene.toml/results"]);
    assert_eq!(outcome.code, Some(1), "{}", outcome.stderr);
    assert!(outcome.stderr.contains("scene.toml/results"), "{}", outcome.stderr);
}

#[test]
fn every_help_ends_with_an_example() {
    let folder = tempfile::tempdir().unwrap();
    for arguments in [
        &["--help"][..],
        &["run", "--help"],
        &["solve", "--help"],
        &["mesh", "--help"],
        &["mesh", "info", "--help"],
        &["ports", "--help"],
        &["record", "--help"],
        &["replay", "--help"],
        &["recover", "--help"],
        &["export", "--help"],
        &["device", "--help"],
        &["compare", "--help"],
    ] {
        let outcome = capsense(folder.path(), arguments);
        assert_eq!(outcome.code, Some(0), "{arguments:?}");
        let (_, example) =
            outcome.stdout.split_once("Example").unwrap_or_else(|| panic!("{}", outcome.stdout));
        assert!(example.contains("\n  capsense "), "{arguments:?}: {example}");
    }
}

#[test]
fn ports_are_listed() {
    let folder = tempfile::tempdir().unwrap();
    let outcome = capsense(folder.path(), &["ports"]);
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    assert!(!outcome.stdout.is_empty());
}

#[test]
fn mesh_info_describes_a_mesh() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("cube.msh"), cube_file(true)).unwrap();
    let outcome = capsense(folder.path(), &["mesh", "info", "cube.msh"]);
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    let words: String = outcome.stdout.split_whitespace().collect::<Vec<_>>().join(" ");
    for text in [
        "nodes 729",
        "tetrahedra 3072",
        "6.400000e-2",
        "\"outer_ground\" 640 triangles",
        "\"plate\" 8 triangles",
        "\"air\" 3072 tetrahedra",
        "Tetrahedra by their smallest dihedral angle: 0° to 10° 0 10° to 20° 0 20° to 30° 0 30° to 40°",
        "128 of 768 boundary faces are in no group",
    ] {
        assert!(words.contains(text), "`{text}` is missing in:\n{}", outcome.stdout);
    }
    let outcome = capsense(folder.path(), &["mesh", "info", "cube.msh", "--unit", "mm"]);
    assert!(outcome.stdout.contains("6.400000e-11"), "{}", outcome.stdout);
}

#[test]
fn a_mesh_file_with_an_open_wall_runs_with_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let self_capacitance = |open: bool| {
        std::fs::write(folder.path().join("cube.msh"), cube_file(open)).unwrap();
        std::fs::write(folder.path().join("scene.toml"), MESH_SCENE).unwrap();
        let outcome = capsense(folder.path(), &["solve", "scene.toml", "--json"]);
        assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
        assert_eq!(outcome.stderr.contains("natural condition"), open, "{}", outcome.stderr);
        let solved: Value = serde_json::from_str(&outcome.stdout).unwrap();
        matrix(&solved["base_farads"])[0][0]
    };
    let (closed, open) = (self_capacitance(false), self_capacitance(true));
    assert!(open < closed, "less ground, less capacitance: {open} against {closed}");
    let outcome = capsense(folder.path(), &["run", "scene.toml", "--quiet"]);
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    let report = json(&folder.path().join("capsense-out/report.json"));
    assert!(report["warnings"][0].as_str().unwrap().contains("natural condition"));
}

#[test]
fn a_written_mesh_gives_the_same_capacitances_as_the_scene_it_came_from() {
    for kind in ["lattice", "bisection"] {
        assert_written_mesh_is_the_same(kind);
    }
}

fn assert_written_mesh_is_the_same(kind: &str) {
    let folder = tempfile::tempdir().unwrap();
    // Rectangles lie in lattice lines, so that nothing is lost by naming nodes.
    let scene = SCENE.replace(
        "disk = { center = [0.05, 0.0], radius = 0.03 }",
        "rectangle = { center = [0.05, 0.0], size = [0.06, 0.06] }",
    );
    let generate = format!("generate = {{ elements = 60000, kind = \"{kind}\" }}");
    let scene = scene.replace("generate = { elements = 8000 }", &generate);
    std::fs::write(folder.path().join("scene.toml"), &scene).unwrap();
    let outcome = capsense(folder.path(), &["mesh", "scene.toml", "--out", "sensor.msh"]);
    assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(0), ""));
    let from_file = "file = \"sensor.msh\"\ngroups = { substrate = \"substrate\" }";
    let copy = scene.replace(&generate, from_file);
    std::fs::write(folder.path().join("copy.toml"), copy).unwrap();
    let of_scene = |name: &str| {
        let outcome = capsense(folder.path(), &["solve", name, "--json"]);
        assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
        let solved: Value = serde_json::from_str(&outcome.stdout).unwrap();
        (matrix(&solved["capacitance_farads"]), outcome.stderr)
    };
    let (original, quiet) = of_scene("scene.toml");
    let (copied, warned) = of_scene("copy.toml");
    // Links at rims have other weights off lattices, and cells are coarse; on bisected meshes they are those of the file.
    let allowed = if kind == "lattice" { 0.15 } else { 1e-4 };
    for (a, b) in original.iter().flatten().zip(copied.iter().flatten()) {
        assert!((a - b).abs() <= allowed * original[0][0], "{kind}: {a} against {b}");
    }
    assert!(!quiet.contains("warning:"), "{quiet}");
    assert!(
        warned.contains("electrode `E1` is a group of the mesh; its shape in the scene is ignored"),
        "{warned}"
    );
}

/// The triangles within a disk are less than the disk; and the ground has no faces within the domain.
#[test]
fn electrodes_that_are_rounded_to_a_written_mesh_are_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("scene.toml"), SCENE).unwrap();
    let outcome = capsense(folder.path(), &["mesh", "scene.toml", "--out", "sensor.msh"]);
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    let warnings: Vec<&str> = outcome.stderr.lines().collect();
    assert_eq!(warnings.len(), 1, "{}", outcome.stderr);
    assert!(warnings[0].starts_with("warning: electrode `E2` has "), "{}", warnings[0]);
    assert!(warnings[0].contains("its outline 2.8274e-3 m²"), "{}", warnings[0]);
    let file = capsense::gmsh::parse(&std::fs::read(folder.path().join("sensor.msh")).unwrap()).unwrap();
    let mesh = file.to_tet_mesh(capsense_core::units::LengthUnit::Metre).unwrap();
    let ground = file.triangles_of("ground").unwrap();
    let ground: Vec<[u32; 3]> = ground.iter().map(|&at| file.triangles[at as usize].nodes).collect();
    let [ground, boundary] = [ground, capsense::gmsh::boundary_faces(&mesh)].map(|mut faces| {
        faces.iter_mut().for_each(|face| face.sort_unstable());
        faces.sort_unstable();
        faces
    });
    assert!(ground == boundary, "{} and {} faces", ground.len(), boundary.len());
}

/// Waits for at most a minute.
fn wait_until(condition: impl Fn() -> bool) {
    let started = std::time::Instant::now();
    while !condition() {
        assert!(started.elapsed().as_secs() < 60, "nothing happened within a minute");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
}

#[cfg(unix)]
#[test]
fn ctrl_c_leaves_complete_files() {
    let folder = tempfile::tempdir().unwrap();
    let scene = SCENE.replace("frame_rate = 10.0", "frame_rate = 10.0\nframes = 8000000");
    std::fs::write(folder.path().join("scene.toml"), scene).unwrap();
    let out = folder.path().join("results");
    let child = std::process::Command::new(env!("CARGO_BIN_EXE_capsense"))
        .args(["run", "scene.toml", "--out", "results"])
        .current_dir(folder.path())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    // The program listens for Ctrl-C before it makes the folder.
    wait_until(|| out.exists());
    std::thread::sleep(std::time::Duration::from_millis(500));
    let interrupted =
        std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(interrupted.success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(stderr.contains("interrupted after"), "{stderr}");
    let report = json(&out.join("report.json"));
    assert_eq!(report["frames"]["interrupted"], true);
    let rows = columns(&out.join("capacitance.csv"))[0].1.len();
    assert_eq!(report["frames"]["computed"], rows);
    assert!(std::fs::read_to_string(out.join("capacitance.svg")).unwrap().ends_with("</svg>\n"));
    assert_eq!(std::fs::read_dir(&out).unwrap().count(), 3, "no unfinished file is left");
}
