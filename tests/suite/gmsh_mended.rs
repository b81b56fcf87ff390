//! Gmsh files with defects that are mended and told, and kinds of files that Gmsh writes when its options are not the

//! usual ones: what comes out is the cube of the files without.

use crate::common::gmsh_cube::{NAMES, all_encodings, ascii_v2, ascii_v4, binary_v4, dense};
use crate::common::{MESH_SCENE, capsense, cube_file};
use capsense::gmsh::{self, Defects, Found, GmshFile};
use capsense::scene::mesh_warnings;
use capsense_core::units::LengthUnit;

/// The cube with pieces of its text replaced.
fn changed(text: &str, pairs: &[(&str, &str)]) -> GmshFile {
    let mut text = text.to_owned();
    for (from, to) in pairs {
        assert!(text.contains(from), "nothing to replace: {from}");
        text = text.replacen(from, to, 1);
    }
    gmsh::parse(text.as_bytes()).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

fn v2(pairs: &[(&str, &str)]) -> GmshFile {
    changed(&ascii_v2(NAMES, dense), pairs)
}

fn v4(pairs: &[(&str, &str)]) -> GmshFile {
    changed(&ascii_v4(NAMES, dense), pairs)
}

/// The mesh and its groups are those of the cube, and nothing but these defects was found.
fn assert_cube(file: &GmshFile, defects: &Defects) {
    assert_eq!(file.defects, *defects);
    let mesh = file.to_tet_mesh(LengthUnit::Metre).unwrap();
    assert_eq!((mesh.nodes().len(), mesh.tets().len(), file.triangles.len()), (8, 6, 3));
    assert!((mesh.volume() - 1.0).abs() < 1e-12);
    let tags = |name| -> Vec<u64> {
        let nodes = file.nodes_of(name).unwrap();
        let mut tags: Vec<u64> = nodes.iter().map(|&node| file.node_tags[node as usize]).collect();
        tags.sort_unstable();
        tags
    };
    assert_eq!(tags("E 1"), [1, 2, 3, 4]);
    assert_eq!(tags("other half"), [1, 2, 5, 6, 7, 8]);
    assert_eq!(file.tets_of("half").unwrap().len(), 3);
}

fn one(first: u64) -> Found {
    Found { count: 1, first }
}

#[test]
fn a_mark_for_utf_8_is_read_over() {
    for (version, encoding, bytes) in all_encodings() {
        let plain = gmsh::parse(&bytes).unwrap();
        let marked = gmsh::parse(&[b"\xef\xbb\xbf", bytes.as_slice()].concat()).unwrap();
        assert_eq!(marked, plain, "{version} {encoding:?}");
    }
}

#[test]
fn inverted_elements_are_turned_over() {
    let file = v2(&[("104 4 4 2 1 1 1 1 7 5 8", "104 4 4 2 1 1 1 7 1 5 8")]);
    assert_cube(&file, &Defects { inverted: one(104), ..Defects::default() });
    let text = ascii_v4(NAMES, dense).replace(" 8\n", " X\n");
    let all = ["1 2 4 8", "1 4 3 8", "1 3 7 8", "1 7 5 8", "1 5 6 8", "1 6 2 8"]
        .map(|nodes| format!("{} X", &nodes[..nodes.len() - 2]));
    let mirrored = all.iter().fold(text, |text, nodes| {
        let words: Vec<&str> = nodes.split(' ').collect();
        text.replace(nodes, &format!("{} {} {} {}", words[1], words[0], words[2], words[3]))
    });
    let file = gmsh::parse(mirrored.replace('X', "8").as_bytes()).unwrap();
    assert_cube(&file, &Defects { inverted: Found { count: 6, first: 101 }, ..Defects::default() });
}

#[test]
fn nodes_without_elements_are_left_out() {
    let file = v2(&[("$Nodes\n8\n", "$Nodes\n10\n4711 5 5 5\n9 0.4 0.6 -1\n")]);
    assert_cube(&file, &Defects { unused_nodes: Found { count: 2, first: 4711 }, ..Defects::default() });
    let file = v2(&[("$Nodes\n8\n", "$Nodes\n9\n9 1e12 0 0\n")]);
    assert_cube(&file, &Defects { unused_nodes: one(9), ..Defects::default() });
    // A labelled triangle at them is not part of the volume.
    let file = v2(&[
        ("$Nodes\n8\n", "$Nodes\n9\n4711 5 5 5\n"),
        ("$Elements\n11\n", "$Elements\n12\n77 2 2 12 5 1 2 4711\n"),
    ]);
    let defects = Defects { unused_nodes: one(4711), detached_triangles: vec![77], ..Defects::default() };
    assert_cube(&file, &defects);
    assert_eq!(file.surface_summary().unwrap().detached_triangles, [77]);
    let error = file.nodes_of(12).unwrap_err().to_string();
    assert!(
        error.contains("physical surface 12") && error.contains("part of the mesh of the volume"),
        "{error}"
    );
}

#[test]
fn nodes_in_one_place_are_joined() {
    // The second half of the cube has a corner of its own, as volumes have that were meshed apart.
    let pairs = [("$Nodes\n8\n", "$Nodes\n9\n50 1 1 1\n"), ("1 7 5 8", "1 7 5 50"), ("1 5 6 8", "1 5 6 50")];
    let mut file = v2(&pairs);
    assert_eq!(file.defects, Defects { joined_nodes: one(8), ..Defects::default() });
    file.node_tags[0] = if file.node_tags[0] == 50 { 8 } else { 0 };
    file.defects = Defects::default();
    assert_cube(&file, &Defects::default());
    // A node that is said twice alike.
    let file = v2(&[("$Nodes\n8\n", "$Nodes\n9\n8 1 1 1\n")]);
    assert_cube(&file, &Defects { joined_nodes: one(8), ..Defects::default() });
}

#[test]
fn elements_that_are_there_twice_or_collapsed_are_left_out() {
    for again in ["99 4 2 1 1 1 2 4 8", "99 4 0 1 2 4 8", "99 4 2 1 1 2 1 4 8"] {
        let file = v2(&[("$Elements\n11\n", &format!("$Elements\n12\n{again}\n"))]);
        let inverted = if again.ends_with("2 1 4 8") { one(99) } else { Found::default() };
        assert_cube(&file, &Defects { repeated_tets: one(101), inverted, ..Defects::default() });
    }
    let again = [("6 11 1 106", "7 12 1 107"), ("$EndElements", "3 1 4 1\n107 1 2 4 8\n$EndElements")];
    assert_cube(&v4(&again), &Defects { repeated_tets: one(107), ..Defects::default() });
    let collapsed = "$Elements\n13\n98 2 2 11 5 1 2 1\n99 4 2 1 1 1 2 4 4\n";
    let file = v2(&[("$Elements\n11\n", collapsed)]);
    let found = Found { count: 2, first: 98 };
    assert_cube(&file, &Defects { collapsed: found, ..Defects::default() });
}

#[test]
fn of_elements_of_second_order_the_corners_are_used() {
    // Their nodes between the corners are no unused ones.
    let file = v2(&[
        ("$Nodes\n8\n", "$Nodes\n14\n11 .5 0 0\n12 .5 .5 0\n13 1 .5 0\n14 .5 .5 .5\n15 1 .5 .5\n16 1 1 .5\n"),
        ("101 4 4 1 1 1 1 1 2 4 8", "101 11 4 1 1 1 1 1 2 4 8 11 13 12 14 16 15"),
        ("3 2 2 11 5 1 2 4", "3 9 2 11 5 1 2 4 11 13 12"),
        ("2 1 2 5 1 1 2", "2 8 2 5 1 1 2 11"),
    ]);
    let found = Found { count: 2, first: 3 };
    assert_cube(&file, &Defects { higher_order: found, ..Defects::default() });
    let warnings = mesh_warnings(&file).unwrap();
    let says = "2 elements, such as 3, are of second or higher order; only their corners are used";
    assert_eq!(warnings[0], says);
}

#[test]
fn parametric_nodes_and_partitions_are_read() {
    let text = ascii_v2(NAMES, dense)
        .replace("$Nodes", "$ParametricNodes")
        .replace("$EndNodes", "$EndParametricNodes")
        .replace("1 0 0 0e0\n", "1 0 0 0e0 0 1\n")
        .replace("2 1 0 0e0\n", "2 1 0 0e0 1 4 0.25\n")
        .replace("3 0 1 0e0\n", "3 0 1 0e0 2 5 0.25 0.75\n");
    let inside = ["4 1 1 0e0", "5 0 0 1e0", "6 1 0 1e0", "7 0 1 1e0", "8 1 1 1e0"];
    let text =
        inside.iter().fold(text, |text, line| text.replace(&format!("{line}\n"), &format!("{line} 3 1\n")));
    assert_cube(&gmsh::parse(text.as_bytes()).unwrap(), &Defects::default());
    // Volume 1 is cut into 7 and 8, which are in its group; surface 9 lies between them and is a part of volume 1.
    let parts = "$PartitionedEntities\n2\n1\n70 2\n0 0 1 2\n9 3 1 2 1 2 0 0 0 1 1 1 0 0\n\
                 7 3 1 1 1 0 0 0 1 1 1 0 1 9\n8 3 1 1 2 0 0 0 1 1 1 0 1 9\n$EndPartitionedEntities\n$Nodes\n";
    let file = v4(&[
        ("$Nodes\n", parts),
        ("6 11 1 106", "7 11 1 106"),
        ("3 1 4 3\n101 1 2 4 8\n", "3 7 4 1\n101 1 2 4 8\n3 8 4 2\n"),
        ("2 6 2 1\n", "2 9 2 1\n"),
    ]);
    assert_cube(&file, &Defects { partitions: 2, ..Defects::default() });
    assert!(file.groups_of(&file.triangles[2]).is_empty());
    assert_eq!(mesh_warnings(&file).unwrap()[0], "the mesh is cut into 2 partitions; they are ignored");
}

#[test]
fn faces_whose_nodes_are_in_one_group_are_not_called_open() {
    // Nine of the twelve faces of the cube are labelled: of each of two sides one triangle lacks, and one of the top.
    let file = v2(&[("$Elements\n11\n", "$Elements\n12\n90 2 2 30 5 1 5 7\n")]);
    let summary = file.surface_summary().unwrap();
    assert_eq!((summary.unlabelled_boundary_faces, summary.enclosed_boundary_faces), (9, 0));
    // Triangles 1 2 4 and 1 4 3 make the bottom; without the latter, node 3 is in the group by a triangle of the side.
    let file = v2(&[("4 2 2 11 5 1 4 3", "4 2 2 11 5 1 3 7")]);
    let summary = file.surface_summary().unwrap();
    assert_eq!((summary.unlabelled_boundary_faces, summary.enclosed_boundary_faces), (10, 1));
    let says = "10 of 12 boundary faces are in no group; 1 of them count as part of the group that has all their \
                nodes; no field passes through the others (natural condition)";
    assert_eq!(mesh_warnings(&file).unwrap(), [says]);
}

#[test]
fn a_file_without_groups_says_why_that_may_be() {
    let text = ascii_v2("", dense).replace("2 2 11 5", "2 2 0 5");
    let warnings = mesh_warnings(&gmsh::parse(text.as_bytes()).unwrap()).unwrap();
    assert!(
        warnings[0].contains("no triangle is in a physical group") && warnings[0].contains("Mesh.SaveAll")
    );
}

#[test]
fn a_scene_on_a_defective_file_gives_what_it_gives_on_a_sound_one() {
    let folder = tempfile::tempdir().unwrap();
    let sound = cube_file(false);
    let last = sound.trim_end().trim_end_matches("$EndElements").trim_end().rsplit('\n').next().unwrap();
    let words: Vec<&str> = last.split(' ').collect();
    let inverted = format!("{} {} {} {} {}", words[..5].join(" "), words[6], words[5], words[7], words[8]);
    let defective = sound.replace(last, &inverted).replace("$Nodes\n729\n", "$Nodes\n730\n1000 0 0 0.01\n");
    std::fs::write(folder.path().join("scene.toml"), MESH_SCENE).unwrap();
    let solve = |mesh: &str| {
        std::fs::write(folder.path().join("cube.msh"), mesh).unwrap();
        let outcome = capsense(folder.path(), &["solve", "scene.toml", "--json"]);
        assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
        let json: serde_json::Value = serde_json::from_str(&outcome.stdout).unwrap();
        (json["capacitance_farads"].clone(), outcome.stderr)
    };
    let (expected, silent) = solve(&sound);
    let (capacitance, warned) = solve(&defective);
    assert_eq!(capacitance, expected);
    assert!(!silent.contains("warning"), "{silent}");
    assert!(warned.contains("cube.msh: node 1000 is in no tetrahedron; it is left out"), "{warned}");
    assert!(warned.contains("is inverted; it is turned over"), "{warned}");
}

#[test]
fn a_binary_file_with_data_behind_the_mesh_is_read() {
    let mut bytes = binary_v4(false, 8);
    bytes.extend(b"$Periodic\n\x01\0\0\0\0\0\0\0$EndP$EndPeriodics\n$EndPeriodic\n$GhostElements\n\0\n$EndGhostElements\n");
    assert_cube(&gmsh::parse(&bytes).unwrap(), &Defects::default());
}
