//! What tests share: a small scene, a small mesh, Gmsh files of a cube, and how to call the program.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs, dead_code, unreachable_pub)]

pub mod gmsh_cube;

use capsense::core::geometry::Aabb;
use capsense::core::glam::DVec3;
use capsense::core::mesh::{Lattice, TetMesh};
use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

/// Two electrodes, a grounded box that moves sideways, about 8000 tetrahedra.
pub const SCENE: &str = r#"
[domain]
min = [-0.25, -0.25, -0.05]
max = [0.25, 0.25, 0.45]

[mesh]
generate = { elements = 8000 }

[sensor]
substrate = { thickness = 2e-3, relative_permittivity = 4.4, size = [0.2, 0.2], back = "open" }

[[sensor.electrode]]
name = "E1"
rectangle = { center = [-0.05, 0.0], size = [0.06, 0.1] }

[[sensor.electrode]]
name = "E2"
disk = { center = [0.05, 0.0], radius = 0.03 }
z = 0.0

[camera]
pixels = [32, 32]
layers = 2

[[object]]
name = "bar"
box = { size = [0.15, 0.15, 0.04] }
material = { conductor = "grounded" }
position = [0.0, 0.0, 0.1]
rotation = [0.0, 0.0, 0.0, 1.0]
trajectory = { waypoints = [[-0.1, 0.0, 0.1], [0.1, 0.0, 0.1]], speed = 0.5 }

[simulation]
frame_rate = 10.0
geometry = "camera"
interface = "edge-cut"
back_fill = false

[solver]
tolerance = 1e-4
preconditioner = "jacobi"
threads = 0
"#;

/// What a run of the program left.
pub struct Outcome {
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

/// Runs the program in a folder.
pub fn capsense(folder: &Path, arguments: &[&str]) -> Outcome {
    let output =
        Command::new(env!("CARGO_BIN_EXE_capsense")).args(arguments).current_dir(folder).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    Outcome { code: output.status.code(), stdout: text(output.stdout), stderr: text(output.stderr) }
}

/// Line of the first occurrence of a piece of text.
pub fn line_of(text: &str, piece: &str) -> usize {
    let at = text.find(piece).unwrap_or_else(|| panic!("`{piece}` is not in the text"));
    1 + text[..at].matches('\n').count()
}

/// A cube with sides of 0.4 m in equal cells of 50 mm, its floor at z = -0.1.
pub fn cube() -> TetMesh {
    let domain = Aabb { min: DVec3::new(-0.2, -0.2, -0.1), max: DVec3::new(0.2, 0.2, 0.3) };
    Lattice::uniform(domain, [8, 8, 8]).unwrap().to_tet_mesh().unwrap()
}

/// A physical group of triangles.
pub struct Surface<'a> {
    pub name: &'a str,
    pub number: u32,
    pub holds: &'a dyn Fn([DVec3; 3]) -> bool,
}

/// A mesh in Gmsh's format 2.2, the faces that belong to a group written as its triangles.
pub fn gmsh_2_2(mesh: &TetMesh, surfaces: &[Surface<'_>]) -> String {
    let mut names = String::new();
    let mut elements = String::new();
    let mut count = 0;
    for surface in surfaces {
        writeln!(names, "2 {} \"{}\"", surface.number, surface.name).unwrap();
        let mut written = std::collections::HashSet::new();
        for tet in mesh.tets().iter() {
            for face in [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]].map(|face| face.map(|k: usize| tet[k])) {
                let corners = face.map(|node| mesh.nodes()[node as usize]);
                let mut key = face;
                key.sort_unstable();
                if (surface.holds)(corners) && written.insert(key) {
                    count += 1;
                    let [a, b, c] = face.map(|node| node + 1);
                    writeln!(elements, "{count} 2 2 {0} {0} {a} {b} {c}", surface.number).unwrap();
                }
            }
        }
    }
    for tet in mesh.tets().iter() {
        count += 1;
        let [a, b, c, d] = tet.map(|node| node + 1);
        writeln!(elements, "{count} 4 2 99 99 {a} {b} {c} {d}").unwrap();
    }
    let mut nodes = String::new();
    for (index, node) in mesh.nodes().iter().enumerate() {
        writeln!(nodes, "{} {} {} {}", index + 1, node.x, node.y, node.z).unwrap();
    }
    format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n{}\n{names}3 99 \"air\"\n$EndPhysicalNames\n\
         $Nodes\n{}\n{nodes}$EndNodes\n$Elements\n{count}\n{elements}$EndElements\n",
        surfaces.len() + 1,
        mesh.nodes().len()
    )
}

/// The cube with its walls in `outer_ground` (except the ceiling where `open`) and a plate in `plate`.
pub fn cube_file(open: bool) -> String {
    let low = DVec3::new(-0.2, -0.2, -0.1);
    let high = DVec3::new(0.2, 0.2, 0.3);
    let on_wall = |corners: [DVec3; 3]| {
        (0..3).any(|axis| {
            let all_at = |value: f64| corners.iter().all(|corner| (corner[axis] - value).abs() < 1e-9);
            all_at(low[axis]) || (all_at(high[axis]) && !(open && axis == 2))
        })
    };
    let on_plate = |corners: [DVec3; 3]| {
        let inside = |corner: &DVec3| corner.z.abs() < 1e-9 && corner.truncate().abs().max_element() < 0.0501;
        corners.iter().all(inside)
    };
    gmsh_2_2(
        &cube(),
        &[
            Surface { name: "outer_ground", number: 7, holds: &on_wall },
            Surface { name: "plate", number: 8, holds: &on_plate },
        ],
    )
}

/// A scene on the cube.
pub const MESH_SCENE: &str = r#"
[mesh]
file = "cube.msh"
unit = "m"
groups = { ground = "outer_ground", E1 = "plate" }

[[sensor.electrode]]
name = "E1"

[[object]]
name = "ball"
sphere = { radius = 0.06 }
material = { conductor = "grounded" }
position = [0.0, 0.0, 0.12]
"#;

/// Runs the program on a scene; says what is wrong with how it is refused, if anything is.
pub fn refusal(folder: &Path, scene: &str, place: &str, says: &str) -> Result<(), String> {
    std::fs::write(folder.join("scene.toml"), scene).unwrap();
    let outcome = capsense(folder, &["solve", "scene.toml"]);
    let message = &outcome.stderr;
    let ok = outcome.code == Some(2)
        && message.starts_with(&format!("error: {place}"))
        && message.contains(says)
        && message.lines().count() == 1;
    if ok { Ok(()) } else { Err(format!("expected `{place} … {says}`, got {:?} {message}", outcome.code)) }
}

pub fn expect_refusal(folder: &Path, scene: &str, file: &str, line: usize, key: &str, says: &str) {
    refusal(folder, scene, &format!("{file}:{line}: {key}"), says).unwrap();
}
