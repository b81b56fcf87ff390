//! Gmsh files that are read: one cube in every version and encoding, its groups, and what may stand beside it.

use crate::common::gmsh_cube::{
    NAMES, NODES, SPARSE, TETS, all_encodings, ascii_v2, ascii_v4, binary_v4, dense, sparse,
};
use capsense::gmsh::{self, GmshFile};
use capsense_core::units::LengthUnit;
use glam::DVec3;

fn assert_cube(file: &GmshFile) {
    let mesh = file.to_tet_mesh(LengthUnit::Millimetre).unwrap();
    assert_eq!(mesh.nodes(), NODES.map(|node| DVec3::from(node) * 1e-3));
    assert_eq!(mesh.tets().to_vec(), TETS.map(|tet| tet.map(|node| node as u32 - 1)));
    assert!((mesh.volume() - 1e-9).abs() < 1e-20);
    assert_eq!(file.tets.iter().map(|tet| tet.tag).collect::<Vec<_>>(), [101, 102, 103, 104, 105, 106]);
    assert_eq!(file.triangles.iter().map(|triangle| triangle.tag).collect::<Vec<_>>(), [3, 4, 5]);
    assert_eq!(file.nodes_of(11).unwrap(), [0, 1, 2, 3]);
    assert_eq!(file.triangles_of(11).unwrap(), [0, 1]);
    assert_eq!(file.tets_of(1).unwrap(), [0, 1, 2]);
    assert_eq!(file.tets_of(2).unwrap(), [3, 4, 5]);
    assert_eq!(file.nodes_of(2).unwrap(), [0, 1, 4, 5, 6, 7]);
    assert_eq!(file.groups_of(&file.triangles[0]), [11]);
    assert_eq!(file.groups_of(&file.triangles[2]), [] as [i32; 0]);
    let summary = file.surface_summary().unwrap();
    assert_eq!(summary.boundary_faces, 12);
    assert_eq!(summary.unlabelled_boundary_faces, 10);
    assert_eq!(summary.detached_triangles, [] as [u64; 0]);
}

#[test]
fn every_version_and_encoding_gives_the_same_cube() {
    for (version, encoding, bytes) in all_encodings() {
        let file = gmsh::parse(&bytes).unwrap_or_else(|error| panic!("{version} {encoding:?}: {error}"));
        assert_eq!((file.version, file.encoding), (version, encoding));
        assert_cube(&file);
        assert_eq!(file.nodes_of("E 1").unwrap(), [0, 1, 2, 3]);
        assert_eq!(file.tets_of("other half").unwrap(), [3, 4, 5]);
        assert_eq!(file.node_tags, [1, 2, 3, 4, 5, 6, 7, 8]);
        let groups: Vec<String> = file.groups.iter().map(ToString::to_string).collect();
        let expected = [
            "physical curve 5",
            "physical surface 11 \"E 1\"",
            "physical volume 1 \"half\"",
            "physical volume 2 \"other half\"",
        ];
        assert_eq!(groups, expected);
    }
}

#[test]
fn sparse_and_unordered_node_tags_work() {
    for text in [ascii_v2(NAMES, sparse), ascii_v4(NAMES, sparse)] {
        let file = gmsh::parse(text.as_bytes()).unwrap();
        assert_cube(&file);
        assert_eq!(file.node_tags, SPARSE);
    }
}

#[test]
fn groups_without_names_are_found_by_number_and_by_the_number_as_text() {
    for text in [ascii_v2("", dense), ascii_v4("", dense)] {
        let file = gmsh::parse(text.as_bytes()).unwrap();
        assert_cube(&file);
        assert_eq!(file.nodes_of("11").unwrap(), [0, 1, 2, 3]);
        assert!(file.groups.iter().all(|group| group.name.is_none()));
    }
}

#[test]
fn windows_line_ends_and_unknown_sections_are_read_over() {
    for text in [ascii_v2(NAMES, dense), ascii_v4(NAMES, dense)] {
        let extra = "$Comments\nprice in $ and $EndCommentsary\n$EndComments\n";
        let data = "$NodeData\n1\n\"view\"\n1\n0.0\n3\n0\n1\n1\n1 0.5\n$EndNodeData\n";
        let text = format!("{extra}{}{data}", text.replace("$Nodes", &format!("{extra}$Nodes")));
        assert_cube(&gmsh::parse(text.as_bytes()).unwrap());
        assert_cube(&gmsh::parse(text.replace('\n', "\r\n").as_bytes()).unwrap());
    }
    let mut binary = binary_v4(false, 8);
    binary.extend(b"$Periodic\n\0\0$\xff$End\0\n$EndPeriodic\n");
    assert_cube(&gmsh::parse(&binary).unwrap());
}

#[test]
fn a_section_may_come_in_parts() {
    let text = ascii_v2(NAMES, dense);
    let parts = "$Nodes\n1\n1 0 0 0\n$EndNodes\n$Nodes\n7\n";
    let text = text.replace("$Nodes\n8\n1 0 0 0e0\n", parts);
    assert!(text.contains(parts));
    assert_cube(&gmsh::parse(text.as_bytes()).unwrap());
}

#[test]
fn without_entities_everything_is_unlabelled() {
    let text = ascii_v4("", dense);
    let (head, rest) = text.split_once("$Entities").unwrap();
    let (_, tail) = rest.split_once("$EndEntities\n").unwrap();
    let file = gmsh::parse(format!("{head}{tail}").as_bytes()).unwrap();
    assert!(file.groups.is_empty());
    assert_eq!(file.surface_summary().unwrap().unlabelled_boundary_faces, 12);
    assert_eq!(file.to_tet_mesh(LengthUnit::Metre).unwrap().tets().len(), 6);
}

#[test]
fn an_entity_of_two_groups_is_in_both() {
    let text = ascii_v4(NAMES, dense).replace("0 0 0 1 1 0 1 -11 1 1", "0 0 0 1 1 0 2 12 -11 1 1");
    let file = gmsh::parse(text.as_bytes()).unwrap();
    assert_eq!(file.nodes_of(12).unwrap(), file.nodes_of("E 1").unwrap());
    assert_eq!(file.groups_of(&file.triangles[0]), [11, 12]);
}

#[test]
fn format_2_2_repeats_an_element_for_each_of_its_groups() {
    let text = ascii_v2(NAMES, dense)
        .replace("$Elements\n11\n", "$Elements\n13\n")
        .replace("$EndElements", "201 2 2 12 5 1 2 4\n202 4 2 20 1 1 2 4 8\n$EndElements");
    let file = gmsh::parse(text.as_bytes()).unwrap();
    assert_eq!((file.triangles.len(), file.tets.len()), (3, 6));
    assert_eq!(file.groups_of(&file.triangles[0]), [11, 12]);
    assert_eq!(file.tets_of(20).unwrap(), [0]);
    assert_eq!(file.tets_of("half").unwrap(), [0, 1, 2]);
}

#[test]
fn triangles_apart_from_the_tetrahedra_are_reported() {
    let text = ascii_v2(NAMES, dense).replace("4 2 2 11 5 1 4 3\n", "4 2 2 11 5 2 3 5\n");
    let summary = gmsh::parse(text.as_bytes()).unwrap().surface_summary().unwrap();
    assert_eq!(summary.detached_triangles, [4]);
    assert_eq!(summary.unlabelled_boundary_faces, 11);
}
