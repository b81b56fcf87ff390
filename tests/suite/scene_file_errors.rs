//! Files that a scene names: what is wrong with them is said with file, line and key, and the program ends with code 2.

use crate::common::{MESH_SCENE, SCENE, cube_file, expect_refusal, line_of};
use capsense::Scene;

#[test]
fn files_that_a_scene_names_must_exist() {
    let folder = tempfile::tempdir().unwrap();
    let trajectory = "trajectory = { waypoints = [[-0.1, 0.0, 0.1], [0.1, 0.0, 0.1]], speed = 0.5 }";
    for (replace, by, key) in [
        (trajectory, "trajectory = { file = \"none.csv\" }", "object[0].trajectory.file"),
        ("box = { size = [0.15, 0.15, 0.04] }", "file = \"none.csv\"", "object[0].file"),
        ("generate = { elements = 8000 }", "file = \"none.csv\"", "mesh.file"),
    ] {
        let scene = SCENE.replace(replace, by);
        let line = line_of(&scene, "none.csv");
        expect_refusal(folder.path(), &scene, "scene.toml", line, key, "none.csv");
    }
    let scene = SCENE.replace("box = { size = [0.15, 0.15, 0.04] }", "file = \"none.stl\"");
    let line = line_of(&scene, "none.stl");
    expect_refusal(folder.path(), &scene, "scene.toml", line, "object[0].file", "none.stl");
}

#[test]
fn trajectory_tables_are_checked_row_by_row() {
    let folder = tempfile::tempdir().unwrap();
    let trajectory = "trajectory = { waypoints = [[-0.1, 0.0, 0.1], [0.1, 0.0, 0.1]], speed = 0.5 }";
    let scene = SCENE.replace(trajectory, "trajectory = { file = \"t.csv\" }");
    for (table, line, column, says) in [
        ("", 1, "", "the header must be t,x,y,z"),
        ("t,x,y\n0,0,0\n", 1, "", "the header must be t,x,y,z"),
        ("t,x,y,z\n", 1, "", "empty trajectory"),
        ("t,x,y,z\n0,0,0,0.1\n1,0,zero,0.1\n", 3, "y: ", "`zero` is not a number"),
        ("t,x,y,z\n0,0,0,nan\n", 2, "z: ", "must be finite"),
        ("t,x,y,z\r\n\r\n0,0,0,0.1\r\n\r\n\r\n1,0,0,nan", 6, "z: ", "must be finite"),
        ("t,x\u{1b}[2J,y,z\n", 1, "", "not \"t,x\\u{1b}[2J,y,z\""),
        ("t,x,y,z\n0,0,0\n", 2, "", "has 3 columns, the header has 4"),
        ("t,x,y,z\n0,0,0,0.1\n0,0,0,0.1\n", 3, "t: ", "not later"),
        ("t,x,y,z,qx,qy,qz,qw\n0,0,0,0.1,0,0,0,0\n", 2, "qx,qy,qz,qw: ", "unit length"),
    ] {
        std::fs::write(folder.path().join("t.csv"), table).unwrap();
        expect_refusal(folder.path(), &scene, "t.csv", line, column, says);
    }
}

#[test]
fn mesh_files_are_checked() {
    let folder = tempfile::tempdir().unwrap();
    let cube = cube_file(false);
    let try_mesh = |mesh: &str, scene: &str, at: &str, key: &str, says: &str| {
        std::fs::write(folder.path().join("cube.msh"), mesh).unwrap();
        expect_refusal(folder.path(), scene, "scene.toml", line_of(scene, at), key, says);
    };
    // Unit and domain.
    let scene = MESH_SCENE.replace("\"m\"", "\"inch\"");
    try_mesh(&cube, &scene, "unit", "mesh.unit", "unknown unit of length `inch`");
    let scene = MESH_SCENE.replace("\"m\"", "\"mm\"");
    try_mesh(&cube, &scene, "unit", "mesh.unit", "check mesh.unit");
    let scene = format!("{MESH_SCENE}\n[domain]\nmin = [-2.0, -2.0, -1.0]\nmax = [2.0, 2.0, 3.0]\n");
    try_mesh(&cube, &scene, "[domain]", "domain", "check mesh.unit");
    // Groups.
    let scene = MESH_SCENE.replace("ground = \"outer_ground\"", "ground = \"outside\"");
    try_mesh(&cube, &scene, "groups", "mesh.groups.ground", "outer_ground");
    let scene = MESH_SCENE.replace("ground = \"outer_ground\", ", "");
    try_mesh(&cube, &scene, "groups", "mesh.groups.ground", "outer_ground");
    let scene = MESH_SCENE.replace("E1 = \"plate\"", "E1 = 42");
    try_mesh(&cube, &scene, "groups", "mesh.groups.E1", "plate");
    let scene = MESH_SCENE.replace(", E1 = \"plate\"", "");
    try_mesh(&cube, &scene, "[[sensor.electrode]]", "sensor.electrode[0]", "outer_ground");
    let scene = MESH_SCENE.replace("E1 = \"plate\"", "E1 = \"plate\", E9 = \"plate\"");
    try_mesh(&cube, &scene, "groups", "mesh.groups.E9", "no electrode is named `E9`");
    let scene = MESH_SCENE.replace("E1 = \"plate\"", "E1 = \"plate\", substrate = \"air\"");
    try_mesh(&cube, &scene, "groups", "mesh.groups.substrate", "sensor.substrate");
    let second = "name = \"E1\"\n[[sensor.electrode]]\nname = \"plate\"\n";
    let scene = MESH_SCENE.replace("name = \"E1\"\n", second);
    try_mesh(
        &cube,
        &scene,
        "[[sensor.electrode]]\nname = \"plate\"",
        "sensor.electrode[1]",
        "the groups of `E1` and `plate` share mesh nodes: ",
    );
    let file = |mesh: &str, says: &str| try_mesh(mesh, MESH_SCENE, "file", "mesh.file", says);
    file("nonsense", "cube.msh");
    file(&cube[..cube.len() / 2], "cube.msh");
}

#[test]
fn surfaces_of_objects_are_checked() {
    let folder = tempfile::tempdir().unwrap();
    let pyramid = "v 0 0 0\nv 100 0 0\nv 0 100 0\nv 0 0 100\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    std::fs::write(folder.path().join("pyramid.obj"), pyramid).unwrap();
    let object = "box = { size = [0.15, 0.15, 0.04] }";
    let good = SCENE.replace(object, "file = \"pyramid.obj\"\nunit = \"mm\"");
    Scene::parse("scene.toml", &good, folder.path()).unwrap();
    for (unit, says) in [("km", "unknown unit of length"), ("m", "wrong unit?")] {
        let scene = SCENE.replace(object, &format!("file = \"pyramid.obj\"\nunit = \"{unit}\""));
        expect_refusal(folder.path(), &scene, "scene.toml", line_of(&scene, "unit"), "object[0].unit", says);
    }
    let scene = SCENE.replace(object, "file = \"pyramid.step\"");
    std::fs::write(folder.path().join("pyramid.step"), pyramid).unwrap();
    let line = line_of(&scene, "pyramid");
    expect_refusal(folder.path(), &scene, "scene.toml", line, "object[0].file", "pyramid.step");
}
