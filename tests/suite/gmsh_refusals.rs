//! Gmsh files that are refused: every error, and files that are cut off and damaged.

use crate::common::gmsh_cube::{NAMES, all_encodings, ascii_v2, ascii_v4, binary_v2, dense, sparse};
use capsense::gmsh::{self, At, GmshError, GmshFile, GroupKey};
use capsense_core::mesh::MeshError;
use capsense_core::units::LengthUnit;
use glam::DVec3;
use proptest::prelude::*;

/// The error of the 2.2 cube with one piece of its text replaced.
fn damage_v2(from: &str, to: &str) -> GmshError {
    damage(&ascii_v2(NAMES, dense), from, to)
}

fn damage_v4(from: &str, to: &str) -> GmshError {
    damage(&ascii_v4(NAMES, dense), from, to)
}

fn damage(text: &str, from: &str, to: &str) -> GmshError {
    assert!(text.contains(from), "nothing to replace: {from}");
    let damaged = text.replacen(from, to, 1);
    let file = match gmsh::parse(damaged.as_bytes()) {
        Ok(file) => file,
        Err(error) => return error,
    };
    file.to_tet_mesh(LengthUnit::Metre).unwrap_err()
}

#[test]
fn errors_in_the_head_are_told() {
    assert_eq!(gmsh::parse(b"").unwrap_err(), GmshError::NotGmsh);
    assert_eq!(gmsh::parse(b"$NOD\n1\n$ENDNOD\n").unwrap_err(), GmshError::NotGmsh);
    assert_eq!(gmsh::parse(b"solid cube\n").unwrap_err(), GmshError::NotGmsh);
    assert!(matches!(damage_v2("$Nodes", "Nodes"), GmshError::Unexpected { at: At::Line(10), .. }));
    for version in ["4", "4.0", "2.1", "1e", "nan"] {
        let error = damage_v2("2.2 0 8", &format!("{version} 0 8"));
        let version = if version == "4" { "4.0" } else { version };
        assert_eq!(error, GmshError::Version { at: At::Line(2), version: version.to_owned() });
        assert!(error.to_string().contains(&format!("format {version} is not supported")));
    }
    assert_eq!(damage_v2("2.2 0 8", "2.2 0 4"), GmshError::DataSize { at: At::Line(2), size: 4 });
    assert_eq!(damage_v4("4.1 0 8", "4.1 0 16"), GmshError::DataSize { at: At::Line(2), size: 16 });
    assert!(matches!(damage_v4("4.1 0 8", "4.1 2 8"), GmshError::Unexpected { at: At::Line(2), .. }));
    let mut marker = binary_v2(false);
    let one = marker.windows(4).position(|bytes| bytes == [1, 0, 0, 0]).unwrap();
    marker[one] = 2;
    assert_eq!(gmsh::parse(&marker).unwrap_err(), GmshError::ByteOrder { at: At::Byte(one) });
}

#[test]
fn errors_of_sections_are_told() {
    let unterminated = damage_v2("$EndElements\n", "$EndElements\n$Periodic\n0\n$EndPeriod\n");
    assert_eq!(unterminated, GmshError::Unterminated { at: At::Line(35), section: "Periodic".to_owned() });
    assert_eq!(
        damage_v2("$EndNodes", "$EndKnots"),
        GmshError::Unexpected { at: At::Line(20), expected: "$EndNodes", found: "$EndKnots".to_owned() }
    );
    let ended = damage_v2("$EndElements\n", "");
    assert_eq!(ended, GmshError::UnexpectedEnd { at: At::Line(34), expected: "$EndElements" });
    let text = ascii_v2("", dense);
    let (head, elements) = text.split_once("$Elements").unwrap();
    assert_eq!(gmsh::parse(head.as_bytes()).unwrap_err(), GmshError::MissingSection("Elements"));
    let (head, _) = head.split_once("$Nodes").unwrap();
    assert_eq!(gmsh::parse(head.as_bytes()).unwrap_err(), GmshError::MissingSection("Nodes"));
    let early = format!("{head}$Elements{elements}");
    assert!(matches!(
        gmsh::parse(early.as_bytes()).unwrap_err(),
        GmshError::Order { at: At::Line(4), section: "Elements", .. }
    ));
    let late = ascii_v4(NAMES, dense) + "$Entities\n0 0 0 0\n$EndEntities\n";
    let late = gmsh::parse(late.as_bytes()).unwrap_err();
    assert!(matches!(late, GmshError::Order { section: "Entities", .. }));
    let parts = "$PartitionedEntities\n2 0 0 0 0 0\n$EndPartitionedEntities\n";
    let late = gmsh::parse((ascii_v4(NAMES, dense) + parts).as_bytes()).unwrap_err();
    assert!(matches!(late, GmshError::Order { section: "PartitionedEntities", .. }));
    let ghosts = damage_v4("$Nodes", "$PartitionedEntities\n2\n18446744073709551615\n$Nodes");
    assert!(matches!(ghosts, GmshError::Count { at: At::Line(21), what: "ghost entities", .. }));
    let again = damage_v2("$Nodes", "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes");
    assert!(matches!(again, GmshError::Unexpected { at: At::Line(10), .. }));
    let twice = damage_v2("2 11 \"E 1\"", "3 1 \"E 1\"");
    assert_eq!(twice, GmshError::NamedTwice { at: At::Line(7), dimension: 3, tag: 1 });
    assert!(matches!(damage_v2("\"E 1\"", "\"E 1"), GmshError::Unexpected { at: At::Line(6), .. }));
    assert!(matches!(
        damage_v2("2 11 \"E 1\"", "4 11 \"E 1\""),
        GmshError::Unexpected { at: At::Line(6), .. }
    ));
}

#[test]
fn errors_of_counts_are_told_before_memory_is_taken() {
    let count = |error: GmshError| match error {
        GmshError::Count { at, what, claimed } => (at, what, claimed),
        other => panic!("{other}"),
    };
    let huge = u64::MAX;
    let cases = [
        (damage_v2("$Nodes\n8", "$Nodes\n18446744073709551615"), At::Line(11), "nodes"),
        (damage_v2("$Elements\n11", "$Elements\n18446744073709551615"), At::Line(22), "elements"),
        (damage_v2("101 4 4", "101 4 18446744073709551615"), At::Line(28), "tags of an element"),
        (damage_v2("Names\n3", "Names\n18446744073709551615"), At::Line(5), "physical names"),
        (damage_v4("1 1 2 2", "1 1 18446744073709551615 2"), At::Line(11), "entities"),
        (damage_v4("1 5 2 1 -1", "18446744073709551615 5 2 1"), At::Line(13), "physical tags of an entity"),
        (damage_v4("$Nodes\n2 8", "$Nodes\n18446744073709551615 8"), At::Line(20), "blocks"),
        (damage_v4("2 5 1 3", "2 5 1 18446744073709551615"), At::Line(21), "nodes"),
        (damage_v4("2 5 2 2", "2 5 2 18446744073709551615"), At::Line(46), "elements"),
    ];
    for (error, at, what) in cases {
        assert_eq!(count(error), (at, what, huge));
    }
    // A node takes eight bytes of text or more: 200 do not fit into the 500 that are left.
    assert_eq!(count(damage_v2("$Nodes\n8", "$Nodes\n200")), (At::Line(11), "nodes", 200));
    assert_eq!(
        damage_v4("2 8 1 8", "2 9 1 8"),
        GmshError::Total { at: At::Line(20), what: "nodes", claimed: 9, found: 8 }
    );
    let mut blocks = binary_v2(false);
    let head = blocks.windows(14).position(|bytes| bytes == b"$Elements\n11\n\x0f").unwrap();
    blocks[head + 11] = b'0';
    assert_eq!(
        gmsh::parse(&blocks).unwrap_err(),
        GmshError::Total { at: At::Byte(head + 10), what: "elements", claimed: 10, found: 11 }
    );
}

#[test]
fn errors_of_nodes_are_told() {
    for bad in ["nan", "-inf", "1e999", "-1.1e12"] {
        assert_eq!(
            damage_v2("8 1 1 1e0", &format!("8 1 {bad} 1")),
            GmshError::NonFinite { at: At::Line(19), node: 8 }
        );
    }
    assert_eq!(damage_v4("1 0 0 0.25", "nan 0 0 0.25"), GmshError::NonFinite { at: At::Line(26), node: 2 });
    let mut binary = binary_v2(true);
    let second = binary.windows(9).position(|b| b == b"$Nodes\n8\n").unwrap() + 9 + 28 + 4;
    binary[second..second + 8].copy_from_slice(&f64::NAN.to_be_bytes());
    assert_eq!(gmsh::parse(&binary).unwrap_err(), GmshError::NonFinite { at: At::Byte(second), node: 2 });
    assert_eq!(damage_v2("8 1 1 1e0", "3 1 1 1e0"), GmshError::DuplicateNode { at: At::Line(19), node: 3 });
    let sparse = ascii_v2(NAMES, sparse);
    assert_eq!(
        damage(&sparse, "77 1 1 1e0", "41 1 1 1e0"),
        GmshError::DuplicateNode { at: At::Line(19), node: 41 }
    );
    assert_eq!(damage_v4("1\n2\n3\n", "1\n2\n8\n"), GmshError::DuplicateNode { at: At::Line(33), node: 8 });
    assert_eq!(
        damage_v2("8 1 1 1e0", "8 1 1 1,0"),
        GmshError::Unexpected {
            at: At::Line(19),
            expected: "a coordinate of a node",
            found: "1,0".to_owned()
        }
    );
    assert!(matches!(damage_v2("8 1 1 1e0", "-8 1 1 1e0"), GmshError::Unexpected { at: At::Line(19), .. }));
    assert!(matches!(damage_v4("2 5 1 3", "4 5 1 3"), GmshError::Unexpected { at: At::Line(21), .. }));
    assert!(matches!(damage_v4("2 5 1 3", "2 5 2 3"), GmshError::Unexpected { at: At::Line(21), .. }));
}

#[test]
fn errors_of_elements_are_told() {
    assert_eq!(
        damage_v2("101 4 4 1 1 1 1 1 2 4 8", "101 4 4 1 1 1 1 1 2 4 9"),
        GmshError::UnknownNode { at: At::Line(28), element: 101, node: 9 }
    );
    for (number, name) in [
        (3, "quadrangle"),
        (5, "hexahedron"),
        (6, "prism"),
        (7, "pyramid"),
        (10, "quadrangle"),
        (12, "hexahedron"),
        (140, "shape unknown here"),
    ] {
        let error = damage_v2("101 4 4", &format!("101 {number} 4"));
        assert_eq!(error, GmshError::ElementType { at: At::Line(28), element: 101, number, name });
        assert!(error.to_string().contains(&format!("element 101 is a {name} (Gmsh element type {number})")));
        let error = damage_v4("3 1 4 3", &format!("3 1 {number} 3"));
        assert!(matches!(error, GmshError::ElementType { element: 101, number: n, .. } if n == number));
    }
    // A triangle on a volume would inherit the number of a volume group.
    assert!(matches!(damage_v4("2 5 2 2", "3 1 2 2"), GmshError::Unexpected { at: At::Line(46), .. }));
    assert!(matches!(damage_v4("2 5 2 2", "-1 5 2 2"), GmshError::Unexpected { at: At::Line(46), .. }));
    // A node between the corners of an element of second order must be there, too.
    assert_eq!(
        damage_v2("101 4 4 1 1 1 1 1 2 4 8", "101 11 4 1 1 1 1 1 2 4 8 1 2 3 4 5 99"),
        GmshError::UnknownNode { at: At::Line(28), element: 101, node: 99 }
    );
}

#[test]
fn defects_of_the_mesh_name_the_numbers_of_the_file() {
    let flat = damage_v4("104 1 7 5 8", "104 1 2 3 4");
    let centre = DVec3::new(0.5, 0.5, 0.0);
    assert_eq!(flat, GmshError::Flat { at: At::Line(56), element: 104, centre });
    let says = "line 56: tetrahedron 104 has no volume; remesh around [0.5, 0.5, 0.0]";
    assert!(flat.to_string().starts_with(says), "{flat}");
    // A seventh tetrahedron behind an inner face.
    let text = ascii_v4(NAMES, dense)
        .replace("$Nodes\n2 8 1 8", "$Nodes\n3 9 1 9\n3 2 0 1\n9\n0.5 0.1 0.2")
        .replace("6 11 1 106", "7 12 1 107")
        .replace("$EndElements", "3 2 4 1\n107 2 1 9 8\n$EndElements");
    let file = gmsh::parse(text.as_bytes()).unwrap();
    let shared = GmshError::SharedFace([101, 106, 107]);
    assert_eq!(file.to_tet_mesh(LengthUnit::Metre).unwrap_err(), shared);
    assert_eq!(file.surface_summary().unwrap_err(), shared);
    let empty = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n0\n$EndNodes\n$Elements\n0\n$EndElements\n";
    let empty = gmsh::parse(empty.as_bytes()).unwrap();
    assert_eq!(empty.to_tet_mesh(LengthUnit::Metre).unwrap_err(), GmshError::NoTets);
    // Fields are public: what the reader excludes can still be put there by hand.
    let mut file = gmsh::parse(ascii_v2(NAMES, dense).as_bytes()).unwrap();
    file.nodes[3].y = f64::NAN;
    assert_eq!(
        file.to_tet_mesh(LengthUnit::Metre).unwrap_err(),
        GmshError::Mesh(MeshError::NonFiniteNode(3))
    );
}

#[test]
fn errors_of_groups_are_told() {
    let text =
        ascii_v2("$PhysicalNames\n3\n2 11 \"E1\"\n3 1 \"E1\"\n2 13 \"none\"\n$EndPhysicalNames\n", dense);
    let file = gmsh::parse(text.as_bytes()).unwrap();
    assert_eq!(file.nodes_of("E1").unwrap_err(), GmshError::AmbiguousGroup(GroupKey::from("E1")));
    let surface = file.group("E1", &[2]).unwrap();
    assert_eq!(file.group_nodes(surface).unwrap(), [0, 1, 2, 3]);
    assert_eq!(file.triangles_of("E1").unwrap(), [0, 1]);
    assert_eq!(file.tets_of("E1").unwrap(), [0, 1, 2]);
    let empty = file.nodes_of("none").unwrap_err();
    assert!(matches!(&empty, GmshError::EmptyGroup(group) if group.tag == 13));
    assert!(empty.to_string().starts_with("physical surface 13 \"none\" has no elements"));
    assert!(matches!(file.triangles_of(13), Err(GmshError::EmptyGroup(_))));
    let missing = file.nodes_of("E2").unwrap_err();
    assert!(matches!(&missing, GmshError::NoSuchGroup { known, .. } if known.len() == 4));
    assert_eq!(
        missing.to_string(),
        "there is no physical group \"E2\" among the surfaces and volumes; there are physical surface 11 \"E1\", \
         physical surface 13 \"none\", physical volume 1 \"E1\", physical volume 2"
    );
    assert!(matches!(file.tets_of(99), Err(GmshError::NoSuchGroup { key: GroupKey::Number(99), .. })));
}

#[test]
fn a_file_cut_off_anywhere_is_an_error_or_whole() {
    for (version, encoding, bytes) in all_encodings() {
        let whole = gmsh::parse(&bytes).unwrap();
        let mut read = 0;
        for length in 0..bytes.len() {
            if let Ok(file) = gmsh::parse(&bytes[..length]) {
                assert_eq!(file, whole, "{version} {encoding:?} cut at {length}");
                read += 1;
            }
        }
        // Only the last line end can be spared.
        assert_eq!(read, 1, "{version} {encoding:?}");
    }
}

/// Everything a caller can ask for, to be run on damaged files.
fn use_all(file: &GmshFile) {
    let _ = file.to_tet_mesh(LengthUnit::Metre);
    let _ = file.surface_summary();
    for group in &file.groups {
        let _ = file.nodes_of(group.tag);
        let _ = file.triangles_of(group.tag);
        let _ = file.tets_of(group.tag);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn damaged_bytes_never_panic(
        which in 0usize..8,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let (_, _, mut bytes) = all_encodings().swap_remove(which);
        for (index, value) in changes {
            let at = index.index(bytes.len());
            bytes[at] = value;
        }
        match gmsh::parse(&bytes) {
            Ok(file) => use_all(&file),
            Err(error) => prop_assert!(!error.to_string().is_empty()),
        }
    }

    #[test]
    fn damaged_numbers_never_panic(
        which in 0usize..2,
        index in any::<prop::sample::Index>(),
        value in prop_oneof![any::<i64>().prop_map(|n| n.to_string()), (0..200i64).prop_map(|n| n.to_string()), "[-+.e0-9$]{0,6}"],
    ) {
        let text = if which == 0 { ascii_v2(NAMES, dense) } else { ascii_v4(NAMES, dense) };
        let mut words: Vec<&str> = text.split_inclusive(char::is_whitespace).collect();
        let at = index.index(words.len());
        let word = value + "\n";
        words[at] = &word;
        if let Ok(file) = gmsh::parse(words.concat().as_bytes()) {
            use_all(&file);
        }
    }

    #[test]
    fn arbitrary_bytes_behind_a_head_never_panic(body in prop::collection::vec(any::<u8>(), 0..200)) {
        for head in ["", "$MeshFormat\n4.1 1 8\n\x01\0\0\0\n$EndMeshFormat\n$Nodes\n", "$MeshFormat\n2.2 1 8\n\x01\0\0\0\n$EndMeshFormat\n$Nodes\n9\n"] {
            let mut bytes = head.as_bytes().to_vec();
            bytes.extend(&body);
            prop_assert!(gmsh::parse(&bytes).is_err());
        }
    }
}
