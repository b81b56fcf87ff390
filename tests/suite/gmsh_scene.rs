//! Scenes on meshes from Gmsh files: groups by number, units, and electrodes that are volumes.

use crate::common::{MESH_SCENE, capsense, cube, cube_file};
use capsense::gmsh::{self, SurfaceGroup, VolumeGroup};
use serde_json::Value;
use std::path::Path;

/// The capacitance of the only electrode without objects.
fn self_capacitance(folder: &Path, scene: &str) -> f64 {
    let without_objects = scene.split("[[object]]").next().unwrap();
    std::fs::write(folder.join("scene.toml"), without_objects).unwrap();
    let outcome = capsense(folder, &["solve", "scene.toml", "--json"]);
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    let solved: Value = serde_json::from_str(&outcome.stdout).unwrap();
    solved["base_farads"][0][0].as_f64().unwrap()
}

#[test]
fn groups_may_be_named_by_number_and_lengths_be_in_any_unit() {
    let folder = tempfile::tempdir().unwrap();
    let of = |scene: &str, of_metre: f64| {
        std::fs::write(folder.path().join("cube.msh"), scaled(&cube_file(false), of_metre)).unwrap();
        self_capacitance(folder.path(), scene)
    };
    let expected = of(MESH_SCENE, 1.0);
    let numbered = MESH_SCENE.replace("\"outer_ground\"", "7").replace("\"plate\"", "8");
    assert_eq!(of(&numbered, 1.0), expected);
    for (unit, of_metre) in [("cm", 1e2), ("mm", 1e3)] {
        let found = of(&MESH_SCENE.replace("unit = \"m\"", &format!("unit = \"{unit}\"")), of_metre);
        assert!((found / expected - 1.0).abs() < 1e-6, "{unit}: {found} {expected}");
    }
}

/// A file with larger coordinates of its nodes.
fn scaled(file: &str, factor: f64) -> String {
    let (head, rest) = file.split_once("$Nodes\n").unwrap();
    let (nodes, elements) = rest.split_once("$EndNodes").unwrap();
    let node = |line: &str| {
        let numbers: Vec<f64> = line.split(' ').map(|number| number.parse().unwrap()).collect();
        match numbers[..] {
            [tag, x, y, z] => format!("{tag} {} {} {}\n", x * factor, y * factor, z * factor),
            _ => format!("{line}\n"),
        }
    };
    format!("{head}$Nodes\n{}$EndNodes{elements}", nodes.lines().map(node).collect::<String>())
}

/// Within a conductor there is no field, so its surface is worth as much as all of it.
#[test]
fn an_electrode_may_be_a_volume_or_its_surface() {
    let mesh = cube();
    let (block, air): (Vec<u32>, Vec<u32>) = (0..mesh.tets().len() as u32).partition(|&tet| {
        let centroid = mesh.centroid(tet as usize);
        centroid.truncate().abs().max_element() < 0.05 && (0.0..0.05).contains(&centroid.z)
    });
    let mut nodes: Vec<u32> = block.iter().flat_map(|&tet| mesh.tets().at(tet as usize)).collect();
    nodes.sort_unstable();
    nodes.dedup();
    let (wall, surface) = (gmsh::boundary_faces(&mesh), gmsh::faces_among(&mesh, &nodes));
    let ground = SurfaceGroup { name: "outer_ground", triangles: &wall };
    let volumes = [VolumeGroup { name: "block", tets: &block }, VolumeGroup { name: "air", tets: &air }];
    let folder = tempfile::tempdir().unwrap();
    let as_volume = gmsh::write(&mesh, std::slice::from_ref(&ground), &volumes).unwrap();
    let plate = SurfaceGroup { name: "plate", triangles: &surface };
    let as_surface = gmsh::write(&mesh, &[ground, plate], &volumes).unwrap();
    let [volume, surface] = [("block", as_volume), ("plate", as_surface)].map(|(group, file)| {
        std::fs::write(folder.path().join("cube.msh"), file).unwrap();
        self_capacitance(folder.path(), &MESH_SCENE.replace("\"plate\"", &format!("\"{group}\"")))
    });
    assert!((volume / surface - 1.0).abs() < 1e-6, "{volume} {surface}");
    // Larger than the sphere within it, in free space.
    assert!(volume > 4.0 * std::f64::consts::PI * 8.854e-12 * 0.025, "{volume}");
}
