//! Scene files that are accepted, and files that nobody would write.

use crate::common::{MESH_SCENE, SCENE, cube_file};
use capsense::Scene;
use capsense::core::glam::DVec3;
use capsense::core::material::{Connection, Material};
use capsense::core::occupancy::Interface;
use capsense::core::sensor::{GROUND, MeshKind, Wall};
use capsense::core::workspace::Probes;
use capsense::scene::{GeneratedMesh, MeshSize, SceneSensor};
use proptest::prelude::*;
use std::path::Path;

/// The scene of the contract, every key that it has.
const CONTRACT: &str = r#"
[domain]
min = [-0.25, -0.25, -0.05]
max = [ 0.25,  0.25,  0.45]

[mesh]
generate = { elements = 30000 }        # best mesh of at most so many tets

[sensor]
substrate = { thickness = 1.6e-3, relative_permittivity = 4.4, size = [0.14, 0.12], back = "open" }
[[sensor.electrode]]
name = "E1"
rectangle = { center = [-0.03, 0.0], size = [0.02, 0.1] }
z = 0.0

[camera]
pixels = [64, 64]
layers = 2                             # 1: front only, back-filled

[[object]]
name = "bar"
box = { size = [0.15, 0.15, 0.02] }
material = { conductor = "grounded" }
position = [0.0, 0.0, 0.10]            # centre of the object, sensor frame
rotation = [0.0, 0.0, 0.0, 1.0]        # quaternion x, y, z, w
trajectory = { file = "t2.csv" }

[simulation]
frame_rate = 100.0
frames = 250
geometry = "camera"
interface = "edge-cut"
back_fill = false

[solver]
tolerance = 1e-4
preconditioner = "multigrid"
threads = 0
"#;

#[test]
fn the_whole_contract_is_understood() {
    let folder = tempfile::tempdir().unwrap();
    let table = "t,x,y,z,qx,qy,qz,qw\n0,0,0,0.1,0,0,0,1\n2,0,0.1,0.1,0,0,0.70711,0.70711\n";
    std::fs::write(folder.path().join("t2.csv"), table).unwrap();
    let scene = Scene::parse("scene.toml", CONTRACT, folder.path()).unwrap();
    assert_eq!(scene.electrodes, ["E1"]);
    assert_eq!(scene.frames, 250);
    assert_eq!((scene.view.width, scene.view.height, scene.back_fill), (64, 64, false));
    assert_eq!(scene.solver.tolerance, 1e-4);
    assert!(scene.warnings.is_empty());
    let SceneSensor::Generated { design, mesh } = &scene.sensor else { panic!("not generated") };
    assert_eq!(*mesh, GeneratedMesh { kind: MeshKind::Lattice, size: MeshSize::Elements(30_000) });
    assert_eq!(design.substrate.unwrap().relative_permittivity.value(), 4.4);
    let bar = &scene.objects[0];
    assert_eq!(bar.material, Material::Conductor(Connection::Grounded));
    let half = bar.motion.pose_at(1.0);
    assert!(half.translation.abs_diff_eq(DVec3::new(0.0, 0.05, 0.1), 1e-12));
    let angle = half.rotation.to_axis_angle().1.to_degrees();
    assert!((angle - 45.0).abs() < 1e-3, "rounded quaternions are mended: {angle}");
}

#[test]
fn variants_of_the_contract_are_understood() {
    let parse = |text: &str| Scene::parse("scene.toml", text, Path::new("")).unwrap();
    let material =
        |text: &str| parse(&SCENE.replace("{ conductor = \"grounded\" }", text)).objects[0].material;
    assert_eq!(material("{ conductor = \"floating\" }"), Material::Conductor(Connection::Floating));
    let tied = material("{ conductor = { capacitance = 150e-12 } }");
    assert_eq!(tied, Material::Conductor(Connection::Capacitance(150e-12)));
    assert!(
        matches!(material("{ relative_permittivity = 80 }"), Material::Dielectric(e) if e.value() == 80.0)
    );

    let one_layer = parse(&SCENE.replace("layers = 2", "layers = 1").replace("back_fill = false\n", ""));
    assert!(one_layer.back_fill, "one layer has no back");
    assert!(parse(&SCENE.replace("back_fill = false", "back_fill = true")).back_fill);
    assert!(parse(&SCENE.replace("threads = 0", "threads = 8")).threads == 8);
    assert_eq!(parse(SCENE).solver.change_tolerance, None);
    let of_changes = parse(&SCENE.replace("threads = 0", "threads = 0\nchange_tolerance = 0.01"));
    assert_eq!(of_changes.solver.change_tolerance, Some(0.01));
    for interface in [Interface::EdgeCut, Interface::Centroid, Interface::VolumeFraction] {
        let text = SCENE.replace("\"edge-cut\"", &format!("{:?}", interface.name()));
        assert_eq!(parse(&text).interface, interface);
    }
    assert_eq!(parse(SCENE).frames, 5);

    let least = "[[sensor.electrode]]\nname = \"E\"\npolygon = [[0, 0], [0.1, 0], [0, 0.1]]\n";
    let scene = parse(least);
    assert_eq!((scene.frames, scene.objects.len()), (1, 0));
    let SceneSensor::Generated { mesh, .. } = scene.sensor else { panic!("not generated") };
    assert_eq!(mesh, GeneratedMesh { kind: MeshKind::Lattice, size: MeshSize::Elements(100_000) });
}

#[test]
fn meshes_for_a_tolerance_and_of_both_kinds_are_understood() {
    let mesh = |text: &str| {
        let scene = SCENE.replace("elements = 8000", text);
        let scene = Scene::parse("scene.toml", &scene, Path::new("")).unwrap();
        let SceneSensor::Generated { design, mesh } = scene.sensor else { panic!("not generated") };
        (design, mesh)
    };
    let (_, bisected) = mesh("elements = 9000, kind = \"bisection\"");
    assert_eq!(bisected, GeneratedMesh { kind: MeshKind::Bisection, size: MeshSize::Elements(9000) });
    let (design, exact) = mesh("tolerance = 0.02");
    let probes = Probes::around(&design);
    let size = MeshSize::Tolerance { tolerance: 0.02, probes };
    assert_eq!(exact, GeneratedMesh { kind: MeshKind::Lattice, size });
    let (_, at) = mesh("tolerance = 0.02, kind = \"lattice\", probes = [[0, 0, 0.1], [0.1, 0, 0.2]]");
    let MeshSize::Tolerance { probes, .. } = at.size else { panic!("no tolerance") };
    assert_eq!(probes.places, [DVec3::new(0.0, 0.0, 0.1), DVec3::new(0.1, 0.0, 0.2)]);
}

/// Larger tolerances take smaller meshes, and where errors are estimated makes a difference.
#[test]
fn scenes_are_meshed_for_their_tolerance() {
    let tets = |text: &str| {
        let scene = SCENE.replace("elements = 8000", text);
        let scene = Scene::parse("scene.toml", &scene, Path::new("")).unwrap();
        scene.build_sensor().unwrap().mesh().tets().len()
    };
    let [coarse, fine] = ["tolerance = 0.2", "tolerance = 0.05"].map(tets);
    assert!(coarse < fine && fine < 200_000, "{coarse} {fine}");
    let of_one = tets("tolerance = 0.05, probes = [[0, 0, 0.1]]");
    // One place may be further off than several are in the mean.
    assert!(10 * of_one <= 11 * fine, "{of_one} {fine}");
}

#[test]
fn an_object_that_never_enters_is_warned_of() {
    let scene = SCENE.replace("[[-0.1, 0.0, 0.1], [0.1, 0.0, 0.1]]", "[[-0.1, 0.0, 10.0], [0.1, 0.0, 10.0]]");
    let scene = Scene::parse("scene.toml", &scene, Path::new("")).unwrap();
    assert_eq!(scene.warnings, ["scene.toml: object `bar` never enters the domain"]);
    // Nor does a mesh that is far from its origin.
    let folder = tempfile::tempdir().unwrap();
    let far = "v 5 0 0\nv 5.1 0 0\nv 5 0.1 0\nv 5 0 0.1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";
    let warnings = |offset: &str| {
        std::fs::write(folder.path().join("far.obj"), far.replace("v 5", &format!("v {offset}"))).unwrap();
        let scene = SCENE.replace("box = { size = [0.15, 0.15, 0.04] }", "file = \"far.obj\"");
        Scene::parse("scene.toml", &scene, folder.path()).unwrap().warnings
    };
    assert_eq!(warnings("5"), ["scene.toml: object `bar` never enters the domain"]);
    assert_eq!(warnings("0"), Vec::<String>::new());
}

#[test]
fn a_wall_may_be_open_with_or_without_a_domain() {
    let parse = |text: &str| Scene::parse("scene.toml", text, Path::new("")).unwrap();
    let wall = |text: &str| {
        let scene = parse(text);
        let sensor = scene.build_sensor().unwrap();
        assert_eq!(sensor.wall(), scene.wall);
        scene.wall
    };
    assert_eq!(wall(SCENE), Wall::Grounded);
    assert_eq!(wall(&SCENE.replace("[domain]", "[domain]\nwall = \"grounded\"")), Wall::Grounded);
    assert_eq!(wall(&SCENE.replace("[domain]", "[domain]\nwall = \"open\"")), Wall::Open);
    let least = "domain.wall = \"open\"\n[[sensor.electrode]]\nname = \"E\"\ndisk = { center = [0, 0], radius = 0.1 }\n";
    assert_eq!(wall(least), Wall::Open);
    assert_eq!(parse(least).domain, parse(&least.replace("open", "grounded")).domain);
}

#[test]
fn the_wall_of_a_mesh_file_may_be_open() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("cube.msh"), cube_file(false)).unwrap();
    let build = |scene: &str| Scene::parse("scene.toml", scene, folder.path()).unwrap().build_sensor();
    let open = format!("{MESH_SCENE}\n[domain]\nwall = \"open\"\n");
    let grounded_nodes = |scene: &str| {
        build(scene).unwrap().terminals().iter().filter(|terminal| **terminal == GROUND).count()
    };
    assert!(grounded_nodes(MESH_SCENE) > 100);
    assert_eq!(grounded_nodes(&open), 0);
    // The plate is within, so there is no wall.
    let inner = open.replace("\"outer_ground\", E1 = \"plate\"", "\"plate\", E1 = \"outer_ground\"");
    let message = build(&inner).unwrap_err().to_string();
    let line = 1 + inner.lines().position(|line| line.starts_with("wall")).unwrap();
    assert!(message.starts_with(&format!("scene.toml:{line}: domain.wall: no outer face")), "{message}");
}

#[test]
fn the_built_in_scene_is_three_stripes_and_a_bar() {
    let scene = Scene::built_in().unwrap();
    assert_eq!(scene.electrodes, ["E1", "E2", "E3"]);
    assert_eq!(scene.objects.len(), 1);
    assert_eq!(scene.frames, 277, "0.32 m at 0.116 m/s and 100 frames per second");
    for time in [0.0, 1.0, 10.0] {
        let place = scene.objects[0].motion.pose_at(time).translation;
        let reach = DVec3::new(0.075, 0.075, 0.01);
        assert!(scene.domain.contains(place - reach) && scene.domain.contains(place + reach));
    }
}

/// One edit of a text, at a place given as a part of its length.
#[derive(Clone, Debug)]
enum Edit {
    Delete(f64, usize),
    Insert(f64, String),
    Swap(f64, f64),
}

fn edits() -> impl Strategy<Value = Vec<Edit>> {
    let token = prop_oneof![
        Just("nan"),
        Just("-1"),
        Just("1e308"),
        Just("[]"),
        Just("{}"),
        Just("[[object]]\n"),
        Just("\""),
        Just("\n"),
        Just("="),
        Just("]"),
        Just("0"),
        Just("é"),
        Just("\u{0}"),
        Just("99999999999999999999"),
    ];
    let edit = prop_oneof![
        (0.0..1.0, 1usize..30).prop_map(|(at, length)| Edit::Delete(at, length)),
        (0.0..1.0, token).prop_map(|(at, token)| Edit::Insert(at, token.to_owned())),
        (0.0..1.0, ".{0,6}").prop_map(|(at, text)| Edit::Insert(at, text)),
        (0.0..1.0, 0.0..1.0).prop_map(|(a, b)| Edit::Swap(a, b)),
    ];
    prop::collection::vec(edit, 1..6)
}

fn apply(text: &str, edits: &[Edit]) -> String {
    let mut letters: Vec<char> = text.chars().collect();
    for edit in edits {
        let at = |part: f64| (part * letters.len() as f64) as usize;
        match edit {
            Edit::Delete(part, length) => {
                let start = at(*part);
                let end = (start + length).min(letters.len());
                letters.drain(start..end);
            }
            Edit::Insert(part, new) => {
                let start = at(*part);
                letters.splice(start..start, new.chars());
            }
            Edit::Swap(a, b) => {
                let mut lines: Vec<String> =
                    letters.iter().collect::<String>().lines().map(str::to_owned).collect();
                let pick = |part: &f64| (part * lines.len() as f64) as usize;
                let (a, b) = (pick(a), pick(b));
                if a < lines.len() && b < lines.len() {
                    lines.swap(a, b);
                }
                letters = lines.join("\n").chars().collect();
            }
        }
    }
    letters.into_iter().collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever is done to a scene, it is accepted or refused with a line that exists.
    #[test]
    fn mutated_scenes_never_panic(edits in edits(), which in 0usize..3) {
        let text = apply([SCENE, CONTRACT, MESH_SCENE][which], &edits);
        if let Err(error) = Scene::parse("scene.toml", &text, Path::new("no such folder")) {
            let message = error.to_string();
            let line: usize = message.split(':').nth(1).unwrap().parse().unwrap();
            prop_assert!(line >= 1 && line <= 1 + text.matches('\n').count(), "{message}");
        }
    }

    #[test]
    fn any_text_is_refused_without_a_panic(text in ".{0,200}") {
        prop_assert!(Scene::parse("scene.toml", &text, Path::new("")).is_err());
    }
}
