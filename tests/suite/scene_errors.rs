//! Every kind of bad input: the message names file, line and key, and the program ends with code 2.

use crate::common::{SCENE, capsense, expect_refusal, line_of, refusal};

/// A scene with one change, and where and how it is refused.
struct Case {
    replace: &'static str,
    by: &'static str,
    /// Text on the line that the message must name.
    at: &'static str,
    key: &'static str,
    says: &'static str,
}

const fn case(
    replace: &'static str,
    by: &'static str,
    at: &'static str,
    key: &'static str,
    says: &'static str,
) -> Case {
    Case { replace, by, at, key, says }
}

/// Changes to [`SCENE`]; those that need no file.
const CASES: &[Case] = &[
    // Names and types.
    case("threads = 0", "thread = 0", "thread = 0", "solver.thread", "unknown field `thread`"),
    case("z = 0.0", "hight = 0.0", "hight", "sensor.electrode[1].hight", "unknown field"),
    case(
        "radius = 0.03",
        "radius = \"x\"",
        "radius = \"x\"",
        "sensor.electrode[1].disk.radius",
        "invalid type",
    ),
    case("radius = 0.03", "", "disk = {", "sensor.electrode[1].disk", "missing field `radius`"),
    case("name = \"bar\"\n", "", "[[object]]", "object[0]", "missing field `name`"),
    case("layers = 2", "layers = 2 2", "layers = 2 2", "camera.layers", ""),
    case("layers = 2", "layers = 2\nlayers = 1", "layers = 1", "camera.layers", "duplicate key"),
    case("\"camera\"", "\"lidar\"", "\"lidar\"", "simulation.geometry", "unknown variant `lidar`"),
    case("\"jacobi\"", "\"magic\"", "\"magic\"", "solver.preconditioner", "unknown variant `magic`"),
    case(
        "\"grounded\" }\npos",
        "\"earthed\" }\npos",
        "\"earthed\"",
        "object[0].material.conductor",
        "unknown variant",
    ),
    // Domain.
    case(
        "max = [0.25, 0.25, 0.45]",
        "max = [0.25, -0.25, 0.45]",
        "max = ",
        "domain.max[1]",
        "greater than domain.min[1]",
    ),
    case("max = [0.25, 0.25, 0.45]", "max = [0.25, inf, 0.45]", "max = ", "domain.max[1]", "must be finite"),
    case("max = [0.25, 0.25, 0.45]", "max = [0.25, 0.45]", "max = ", "domain.max", "invalid length 2"),
    case(
        "max = [0.25, 0.25, 0.45]",
        "max = [0.25, 0.25, 0.45, 1]",
        "max = ",
        "domain.max",
        "invalid length 4",
    ),
    case("max = [0.25, 0.25, 0.45]", "", "min = ", "domain.min", "goes with `max`"),
    case(
        "max = [0.25, 0.25, 0.45]",
        "max = [0.25, 0.25, 0.45]\nwall = \"ajar\"",
        "wall = ",
        "domain.wall",
        "unknown variant `ajar`",
    ),
    // Mesh.
    case("elements = 8000", "elements = 0", "elements", "mesh.generate.elements", "must be from 6"),
    case(
        "elements = 8000",
        "elements = 100",
        "elements",
        "mesh.generate.elements",
        "100 tetrahedra are too few",
    ),
    case("elements = 8000", "kind = \"lattice\"", "kind", "mesh.generate", "needs `elements`"),
    case("[mesh]", "[mesh]\nunit = \"mm\"", "unit", "mesh.unit", "goes with `mesh.file`"),
    case("[mesh]", "[mesh]\nfile = \"a.msh\"", "[mesh]", "mesh", "both `generate` and `file`"),
    // Substrate.
    case("2e-3", "-2e-3", "substrate", "sensor.substrate.thickness", "greater than zero"),
    case("4.4", "0.0", "substrate", "sensor.substrate.relative_permittivity", "greater than zero"),
    case("[0.2, 0.2]", "[0.2, 0.9]", "substrate", "sensor.substrate", "reaches out of the domain"),
    // Electrodes.
    case("\"E2\"", "\"E1\"", "name = \"E1\"\ndisk", "sensor.electrode[1].name", "already named `E1`"),
    case("\"E2\"", "\" \"", "\" \"", "sensor.electrode[1].name", "must not be empty"),
    case("\"E2\"", "\"ground\"", "\"ground\"", "sensor.electrode[1].name", "not a name for an electrode"),
    case(
        "size = [0.06, 0.1]",
        "size = [0.06, -0.1]",
        "-0.1]",
        "sensor.electrode[0].rectangle.size[1]",
        "greater than zero",
    ),
    case(
        "size = [0.06, 0.1]",
        "size = [nan, 0.1]",
        "nan",
        "sensor.electrode[0].rectangle.size[0]",
        "must be finite",
    ),
    case(
        "radius = 0.03",
        "radius = 0.0",
        "radius = 0.0 }\nz",
        "sensor.electrode[1].disk.radius",
        "greater than zero",
    ),
    case(
        "z = 0.0",
        "polygon = [[0, 0], [1, 0], [0, 1]]",
        "[[sensor.electrode]]\nname = \"E2\"",
        "sensor.electrode[1]",
        "2 shapes",
    ),
    case(
        "disk = { center = [0.05, 0.0], radius = 0.03 }",
        "",
        "[[sensor.electrode]]\nname = \"E2\"",
        "sensor.electrode[1]",
        "no shape",
    ),
    case(
        "disk = { center = [0.05, 0.0], radius = 0.03 }",
        "polygon = [[0.03, 0.0], [0.06, 0.0]]",
        "[[sensor.electrode]]\nname = \"E2\"",
        "sensor.electrode[1]",
        "fewer than three corners",
    ),
    case("z = 0.0", "unit = \"mm\"", "unit", "sensor.electrode[1].unit", "goes with `stl`"),
    case(
        "z = 0.0",
        "z = 0.5",
        "[[sensor.electrode]]\nname = \"E2\"",
        "sensor.electrode[1]",
        "outside the domain",
    ),
    case(
        "z = 0.0",
        "z = -0.05",
        "[[sensor.electrode]]\nname = \"E2\"",
        "sensor.electrode[1]",
        "touches the grounded wall",
    ),
    case(
        "center = [-0.05, 0.0]",
        "center = [0.04, 0.0]",
        "[[sensor.electrode]]\nname = \"E2\"",
        "sensor.electrode[1]",
        "overlap or touch",
    ),
    case(
        "radius = 0.03",
        "radius = 1e-7",
        "[[sensor.electrode]]\nname = \"E2\"",
        "sensor.electrode[1]",
        "owns no node",
    ),
    // Camera.
    case("pixels = [32, 32]", "pixels = [0, 32]", "pixels", "camera.pixels[0]", "from 1 to 4096, but is 0"),
    case(
        "pixels = [32, 32]",
        "pixels = [32, 100000]",
        "pixels",
        "camera.pixels[1]",
        "from 1 to 4096, but is 100000",
    ),
    case("pixels = [32, 32]", "pixels = [32, 100_000]", "pixels", "camera.pixels[1]", "but is 100000"),
    case("pixels = [32, 32]", "pixels = [32, 32, 32]", "pixels", "camera.pixels", "invalid length 3"),
    case("pixels = [32, 32]", "pixels = [-1, 32]", "pixels", "camera.pixels[0]", "but is -1"),
    case("layers = 2", "layers = 3", "layers", "camera.layers", "from 1 to 2"),
    case("layers = 2", "layers = 1", "back_fill", "simulation.back_fill", "camera.layers = 1"),
    // Objects.
    case("[0.15, 0.15, 0.04]", "[0.15, -0.15, 0.04]", "box", "object[0].box.size[1]", "greater than zero"),
    case(
        "box = { size = [0.15, 0.15, 0.04] }",
        "sphere = { radius = -1 }",
        "sphere",
        "object[0].sphere.radius",
        "greater than zero",
    ),
    case(
        "box = { size = [0.15, 0.15, 0.04] }",
        "capsule = { radius = 0.1, length = nan }",
        "capsule",
        "object[0].capsule.length",
        "must be finite",
    ),
    case(
        "box = { size = [0.15, 0.15, 0.04] }",
        "cylinder = { radius = 0, length = 1 }",
        "cylinder",
        "object[0].cylinder.radius",
        "greater than zero",
    ),
    case("box = { size = [0.15, 0.15, 0.04] }", "", "[[object]]", "object[0]", "no shape"),
    case(
        "material =",
        "sphere = { radius = 1 }\nmaterial =",
        "[[object]]",
        "object[0]",
        "2 shapes (box, sphere)",
    ),
    case("material =", "unit = \"mm\"\nmaterial =", "unit", "object[0].unit", "goes with `file`"),
    case("{ conductor = \"grounded\" }", "{}", "material", "object[0].material", "needs `conductor`"),
    case(
        "{ conductor = \"grounded\" }",
        "{ conductor = \"floating\", relative_permittivity = 2 }",
        "material",
        "object[0].material",
        "not both",
    ),
    case(
        "{ conductor = \"grounded\" }",
        "{ conductor = { capacitance = -1e-12 } }",
        "material",
        "object[0].material.conductor.capacitance",
        "must not be negative",
    ),
    case(
        "{ conductor = \"grounded\" }",
        "{ relative_permittivity = 0 }",
        "material",
        "object[0].material.relative_permittivity",
        "greater than zero",
    ),
    case(
        "position = [0.0, 0.0, 0.1]",
        "position = [0.0, nan, 0.1]",
        "position",
        "object[0].position[1]",
        "must be finite",
    ),
    case(
        "rotation = [0.0, 0.0, 0.0, 1.0]",
        "rotation = [0.0, 0.0, 0.0, 0.0]",
        "rotation",
        "object[0].rotation",
        "unit length",
    ),
    case(
        "rotation = [0.0, 0.0, 0.0, 1.0]",
        "rotation = [0.0, 0.0, 0.0, 1.1]",
        "rotation",
        "object[0].rotation",
        "its length is 1.1",
    ),
    case(
        "rotation = [0.0, 0.0, 0.0, 1.0]",
        "rotation = [0.0, inf, 0.0, 1.0]",
        "rotation",
        "object[0].rotation[1]",
        "must be finite",
    ),
    case(
        "[solver]",
        "[[object]]\nname = \"bar\"\nsphere = { radius = 0.1 }\nmaterial = { relative_permittivity = 2 }\nposition = [0, 0, 0.2]\n[solver]",
        "name = \"bar\"\nsphere",
        "object[1].name",
        "already named `bar`",
    ),
    case(
        "[solver]",
        "[[object]]\nname = \"b\"\nsphere = { radius = 0.1 }\nmaterial = { relative_permittivity = 2 }\n[solver]",
        "[[object]]\nname = \"b\"\n",
        "object[1]",
        "`position` or a `trajectory`",
    ),
    case(
        "position = [0.0, 0.0, 0.1]",
        "position = [0.0, 0.0, 0.1, 0.2]",
        "position",
        "object[0].position",
        "invalid length 4, expected an array of length 3",
    ),
    case("box = { size = [0.15,", "box = { size = [1e300,", "box", "object[0].box", "lengths are in metres"),
    case(
        "box = { size = [0.15, 0.15, 0.04] }",
        "sphere = { radius = 1e-9 }",
        "sphere",
        "object[0].sphere",
        "is 2e-9 m large",
    ),
    case(
        "{ conductor = \"grounded\" }",
        "{ relative_permittivity = 1e12 }",
        "material",
        "object[0].material.relative_permittivity",
        "must be from 1e-9 to 1e9, but is 1e12",
    ),
    // Trajectories.
    case(
        "waypoints = [[-0.1, 0.0, 0.1], [0.1, 0.0, 0.1]]",
        "waypoints = [[0, 0, 0, 0]]",
        "waypoints",
        "object[0].trajectory.waypoints",
        "invalid length 4",
    ),
    case(
        "waypoints = [[-0.1, 0.0, 0.1], [0.1, 0.0, 0.1]]",
        "waypoints = []",
        "waypoints",
        "object[0].trajectory.waypoints",
        "at least one point",
    ),
    case(
        "waypoints = [[-0.1, 0.0, 0.1], [0.1, 0.0, 0.1]]",
        "waypoints = [[0, 0, nan]]",
        "waypoints",
        "object[0].trajectory.waypoints[0][2]",
        "must be finite",
    ),
    case("speed = 0.5", "speed = 0", "speed", "object[0].trajectory.speed", "greater than zero"),
    case(", speed = 0.5", "", "trajectory", "object[0].trajectory", "need a `speed`"),
    case(
        "waypoints =",
        "file = \"t.csv\", waypoints =",
        "trajectory",
        "object[0].trajectory",
        "both `file` and `waypoints`",
    ),
    case(
        "trajectory = { waypoints = [[-0.1, 0.0, 0.1], [0.1, 0.0, 0.1]], speed = 0.5 }",
        "trajectory = {}",
        "trajectory",
        "object[0].trajectory",
        "needs a `file`",
    ),
    case(
        "speed = 0.5",
        "speed = 1e-9",
        "frame_rate",
        "simulation.frame_rate",
        "frames until the trajectories end",
    ),
    // Simulation and solver.
    case("frame_rate = 10.0", "frame_rate = 0", "frame_rate", "simulation.frame_rate", "greater than zero"),
    case("frame_rate = 10.0", "frames = 0", "frames", "simulation.frames", "must be from 1"),
    case("tolerance = 1e-4", "tolerance = 0", "tolerance", "solver.tolerance", "between 0 and 1"),
    case("tolerance = 1e-4", "tolerance = 1", "tolerance", "solver.tolerance", "between 0 and 1"),
    case("tolerance = 1e-4", "tolerance = nan", "tolerance", "solver.tolerance", "must be finite"),
    case("tolerance = 1e-4", "tolerance = 1e-15", "tolerance", "solver.tolerance", "must be at least 1e-14"),
    case(
        "tolerance = 1e-4",
        "tolerance = 1e-4\nchange_tolerance = 1",
        "change_tolerance",
        "solver.change_tolerance",
        "between 0 and 1",
    ),
    case("threads = 0", "threads = -1", "threads", "solver.threads", "must be from 0"),
    // Meshes for a tolerance.
    case(
        "elements = 8000",
        "kind = \"lattice\"",
        "generate",
        "mesh.generate",
        "needs `elements` or `tolerance`",
    ),
    case(
        "elements = 8000",
        "elements = 8000, tolerance = 0.1",
        "generate",
        "mesh.generate",
        "has both `elements` and `tolerance`",
    ),
    case("elements = 8000", "tolerance = 0", "generate", "mesh.generate.tolerance", "between 0 and 1"),
    case("elements = 8000", "tolerance = nan", "generate", "mesh.generate.tolerance", "must be finite"),
    case("elements = 8000", "tolerance = 1e-9", "generate", "mesh.generate.tolerance", "no mesh of up to"),
    case(
        "elements = 8000",
        "elements = 8000, probes = [[0, 0, 0.1]]",
        "generate",
        "mesh.generate.probes",
        "goes with `tolerance`",
    ),
    case(
        "elements = 8000",
        "tolerance = 0.1, probes = []",
        "generate",
        "mesh.generate.probes",
        "must have at least one place",
    ),
    case(
        "elements = 8000",
        "tolerance = 0.1, probes = [[0, 0, 0.1], [0, 0, 0.01]]",
        "generate",
        "mesh.generate.probes[1]",
        "must be higher than z = 0.0",
    ),
    case(
        "elements = 8000",
        "tolerance = 0.1, probes = [[0, 0, 0.5]]",
        "generate",
        "mesh.generate.probes[0]",
        "lies outside the domain",
    ),
    case(
        "elements = 8000",
        "tolerance = 0.1, probes = [[0, 0, nan]]",
        "generate",
        "mesh.generate.probes[0][2]",
        "must be finite",
    ),
    case(
        "elements = 8000",
        "elements = 100, kind = \"bisection\"",
        "generate",
        "mesh.generate.elements",
        "100 tetrahedra are too few for the electrodes",
    ),
    case(
        "\"camera\"\ninterface = \"edge-cut\"\nback_fill = false",
        "\"solids\"\nback_fill = true",
        "back_fill",
        "simulation.back_fill",
        "must not be true with simulation.geometry = \"solids\"",
    ),
];

#[test]
fn every_bad_value_is_refused_with_file_line_and_key() {
    let folder = tempfile::tempdir().unwrap();
    let mut wrong = Vec::new();
    for Case { replace, by, at, key, says } in CASES {
        assert_eq!(SCENE.matches(replace).count(), 1, "`{replace}` must stand in the scene once");
        let scene = SCENE.replace(replace, by);
        let place = format!("scene.toml:{}: {key}", line_of(&scene, at));
        wrong.extend(refusal(folder.path(), &scene, &place, says).err());
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_unchanged_scene_is_accepted() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("scene.toml"), SCENE).unwrap();
    let outcome = capsense(folder.path(), &["solve", "scene.toml"]);
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
}

#[test]
fn a_scene_without_electrodes_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let start = SCENE.find("[[sensor.electrode]]").unwrap();
    let end = SCENE.find("[camera]").unwrap();
    let scene = [&SCENE[..start], &SCENE[end..]].concat();
    let line = line_of(&scene, "[sensor]");
    expect_refusal(folder.path(), &scene, "scene.toml", line, "sensor.electrode", "no electrodes");
    expect_refusal(folder.path(), "", "scene.toml", 1, "sensor.electrode", "no electrodes");
}

#[test]
fn missing_and_unreadable_scenes_are_bad_input() {
    let folder = tempfile::tempdir().unwrap();
    for command in ["run", "solve"] {
        let outcome = capsense(folder.path(), &[command, "nowhere.toml"]);
        assert_eq!(outcome.code, Some(2), "{}", outcome.stderr);
        assert!(outcome.stderr.contains("nowhere.toml: cannot read"), "{}", outcome.stderr);
    }
    std::fs::write(folder.path().join("binary.toml"), b"[mesh]\n\xff\xfe").unwrap();
    let outcome = capsense(folder.path(), &["solve", "binary.toml"]);
    assert_eq!(outcome.code, Some(2));
    assert!(outcome.stderr.contains("binary.toml:2: is not UTF-8"), "{}", outcome.stderr);
}

/// Where tetrahedra are too few, so many are named that are not.
#[test]
fn a_number_of_elements_that_will_do_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let solve = |elements: usize| {
        std::fs::write(folder.path().join("scene.toml"), few(elements)).unwrap();
        capsense(folder.path(), &["solve", "scene.toml"])
    };
    let refused = solve(100);
    assert_eq!(refused.code, Some(2), "{}", refused.stderr);
    let will_do = refused.stderr.trim_end().strip_suffix(" will do").unwrap();
    let enough: usize = will_do.rsplit(' ').next().unwrap().parse().unwrap();
    let made = solve(enough);
    assert_eq!(made.code, Some(0), "{enough}: {}", made.stderr);
}

/// [`SCENE`] with a small electrode, which even a lattice that has its edges in planes has no node within.
fn few(elements: usize) -> String {
    SCENE
        .replace("radius = 0.03", "radius = 0.004")
        .replace("elements = 8000", &format!("elements = {elements}"))
}
