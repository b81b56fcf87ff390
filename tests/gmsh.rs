//! Gmsh files: one cube in every version and encoding, every error, cut-off and damaged files, and round trips.

#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use capsense::gmsh::{
    self, At, Encoding, FormatVersion, GmshError, GmshFile, GroupKey, SurfaceGroup, VolumeGroup, WriteError,
};
use capsense_core::mesh::{Lattice, MeshError, TetMesh};
use capsense_core::units::LengthUnit;
use glam::DVec3;
use proptest::prelude::*;

/// A unit cube of six Kuhn tetrahedra around the diagonal from node 1 to node 8.
const NODES: [[f64; 3]; 8] = [
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [1.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, 0.0, 1.0],
    [0.0, 1.0, 1.0],
    [1.0, 1.0, 1.0],
];
/// Physical group 1 "half", then physical group 2 "other half"; nodes from 1.
const TETS: [[u64; 4]; 6] =
    [[1, 2, 4, 8], [1, 4, 3, 8], [1, 3, 7, 8], [1, 7, 5, 8], [1, 5, 6, 8], [1, 6, 2, 8]];
/// The bottom is electrode "E 1", group 11; one triangle of the top is unlabelled.
const BOTTOM: [[u64; 3]; 2] = [[1, 2, 4], [1, 4, 3]];
const TOP: [u64; 3] = [5, 6, 8];
const NAMES: &str = "$PhysicalNames\n3\n2 11 \"E 1\"\n3 1 \"half\"\n3 2 \"other half\"\n$EndPhysicalNames\n";
/// Node tags that are unordered and far apart.
const SPARSE: [u64; 8] = [900_000_000, 2, 7_000, 41, 40, 1_234_567_890, 3, 77];

fn is_first_half(tet: usize) -> bool {
    tet < 3
}

fn ascii_v2(names: &str, tag: impl Fn(u64) -> u64) -> String {
    let mut text = format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n{names}$Nodes\n8\n");
    for (node, [x, y, z]) in (1..).zip(NODES) {
        text += &format!("{} {x} {y} {z:e}\n", tag(node));
    }
    text += "$EndNodes\n$Elements\n11\n";
    text += &format!("1 15 2 0 1 {}\n2 1 2 5 1 {} {}\n", tag(1), tag(1), tag(2));
    for (element, [a, b, c]) in (3..).zip(BOTTOM) {
        text += &format!("{element} 2 2 11 5 {} {} {}\n", tag(a), tag(b), tag(c));
    }
    let [a, b, c] = TOP;
    text += &format!("5 2 0 {} {} {}\n", tag(a), tag(b), tag(c));
    for (index, [a, b, c, d]) in TETS.into_iter().enumerate() {
        // Three partition tags behind physical group and entity.
        let group = if is_first_half(index) { 1 } else { 2 };
        text += &format!("{} 4 4 {group} 1 1 1 ", index + 101);
        text += &format!("{} {} {} {}\n", tag(a), tag(b), tag(c), tag(d));
    }
    text + "$EndElements\n"
}

fn ascii_v4(names: &str, tag: impl Fn(u64) -> u64) -> String {
    let mut text = format!("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n{names}");
    text += "$Entities\n1 1 2 2\n1 0 0 0 0\n1 0 0 0 1 0 0 1 5 2 1 -1\n";
    text += "5 0 0 0 1 1 0 1 -11 1 1\n6 0 0 1 1 1 1 0 0\n";
    text += "1 0 0 0 1 1 1 1 1 0\n2 0 0 0 1 1 1 1 2 2 5 -6\n$EndEntities\n";
    let tags: Vec<u64> = (1..=8).map(&tag).collect();
    let (least, most) = (tags.iter().min().unwrap(), tags.iter().max().unwrap());
    text += &format!("$Nodes\n2 8 {least} {most}\n2 5 1 3\n{}\n{}\n{}\n", tags[0], tags[1], tags[2]);
    for [x, y, z] in &NODES[..3] {
        text += &format!("{x} {y} {z} 0.25 0.75\n");
    }
    text += "3 1 0 5\n";
    for tag in &tags[3..] {
        text += &format!("{tag}\n");
    }
    for [x, y, z] in &NODES[3..] {
        text += &format!("{x} {y} {z}\n");
    }
    text += &format!("$EndNodes\n$Elements\n6 11 1 106\n0 1 15 1\n1 {}\n", tag(1));
    text += &format!("1 1 1 1\n2 {} {}\n2 5 2 2\n", tag(1), tag(2));
    for (element, [a, b, c]) in (3..).zip(BOTTOM) {
        text += &format!("{element} {} {} {}\n", tag(a), tag(b), tag(c));
    }
    let [a, b, c] = TOP;
    text += &format!("2 6 2 1\n5 {} {} {}\n", tag(a), tag(b), tag(c));
    for (index, [a, b, c, d]) in TETS.into_iter().enumerate() {
        if index % 3 == 0 {
            text += &format!("3 {} 4 3\n", index / 3 + 1);
        }
        text += &format!("{} {} {} {} {}\n", index + 101, tag(a), tag(b), tag(c), tag(d));
    }
    text + "$EndElements\n"
}

/// Writes numbers in one byte order.
struct Bytes {
    bytes: Vec<u8>,
    is_big: bool,
    size_bytes: usize,
}

impl Bytes {
    fn text(&mut self, text: &str) {
        self.bytes.extend(text.as_bytes());
    }
    fn raw(&mut self, mut little: Vec<u8>) {
        if self.is_big {
            little.reverse();
        }
        self.bytes.extend(little);
    }
    fn ints(&mut self, values: &[i32]) {
        values.iter().for_each(|value| self.raw(value.to_le_bytes().to_vec()));
    }
    fn sizes(&mut self, values: &[u64]) {
        values.iter().for_each(|value| self.raw(value.to_le_bytes()[..self.size_bytes].to_vec()));
    }
    fn reals(&mut self, values: &[f64]) {
        values.iter().for_each(|value| self.raw(value.to_le_bytes().to_vec()));
    }
}

fn binary_v2(is_big: bool) -> Vec<u8> {
    let mut out = Bytes { bytes: Vec::new(), is_big, size_bytes: 8 };
    out.text("$MeshFormat\n2.2 1 8\n");
    out.ints(&[1]);
    out.text(&format!("\n$EndMeshFormat\n{NAMES}$Nodes\n8\n"));
    for (node, position) in (1..).zip(NODES) {
        out.ints(&[node]);
        out.reals(&position);
    }
    out.text("\n$EndNodes\n$Elements\n11\n");
    out.ints(&[15, 1, 2, 1, 0, 1, 1]);
    out.ints(&[1, 1, 2, 2, 5, 1, 1, 2]);
    out.ints(&[2, 2, 2]);
    for (element, nodes) in (3..).zip(BOTTOM) {
        out.ints(&[element, 11, 5]);
        out.ints(&nodes.map(|node| node as i32));
    }
    out.ints(&[2, 1, 0, 5]);
    out.ints(&TOP.map(|node| node as i32));
    out.ints(&[4, 6, 4]);
    for (index, nodes) in TETS.into_iter().enumerate() {
        let group = if is_first_half(index) { 1 } else { 2 };
        out.ints(&[index as i32 + 101, group, 1, 1, 1]);
        out.ints(&nodes.map(|node| node as i32));
    }
    out.text("\n$EndElements\n");
    out.bytes
}

fn binary_v4(is_big: bool, size_bytes: usize) -> Vec<u8> {
    let mut out = Bytes { bytes: Vec::new(), is_big, size_bytes };
    out.text(&format!("$MeshFormat\n4.1 1 {size_bytes}\n"));
    out.ints(&[1]);
    out.text(&format!("\n$EndMeshFormat\n{NAMES}$Entities\n"));
    out.sizes(&[1, 1, 2, 2]);
    out.ints(&[1]);
    out.reals(&[0.0; 3]);
    out.sizes(&[0]);
    let entities: [(i32, &[i32], &[i32]); 5] =
        [(1, &[5], &[1, -1]), (5, &[-11], &[1]), (6, &[], &[]), (1, &[1], &[]), (2, &[2], &[5, -6])];
    for (tag, groups, boundary) in entities {
        out.ints(&[tag]);
        out.reals(&[0.0; 6]);
        out.sizes(&[groups.len() as u64]);
        out.ints(groups);
        out.sizes(&[boundary.len() as u64]);
        out.ints(boundary);
    }
    out.text("\n$EndEntities\n$Nodes\n");
    out.sizes(&[2, 8, 1, 8]);
    out.ints(&[2, 5, 1]);
    out.sizes(&[3, 1, 2, 3]);
    for [x, y, z] in &NODES[..3] {
        out.reals(&[*x, *y, *z, 0.25, 0.75]);
    }
    out.ints(&[3, 1, 0]);
    out.sizes(&[5, 4, 5, 6, 7, 8]);
    for position in &NODES[3..] {
        out.reals(position);
    }
    out.text("\n$EndNodes\n$Elements\n");
    out.sizes(&[6, 11, 1, 106]);
    out.ints(&[0, 1, 15]);
    out.sizes(&[1, 1, 1]);
    out.ints(&[1, 1, 1]);
    out.sizes(&[1, 2, 1, 2]);
    out.ints(&[2, 5, 2]);
    out.sizes(&[2, 3, 1, 2, 4, 4, 1, 4, 3]);
    out.ints(&[2, 6, 2]);
    out.sizes(&[1, 5, 5, 6, 8]);
    for half in 0..2 {
        out.ints(&[3, half as i32 + 1, 4]);
        out.sizes(&[3]);
        for (index, nodes) in TETS.iter().enumerate().skip(3 * half).take(3) {
            out.sizes(&[index as u64 + 101]);
            out.sizes(nodes);
        }
    }
    out.text("\n$EndElements\n");
    out.bytes
}

fn dense(node: u64) -> u64 {
    node
}

fn sparse(node: u64) -> u64 {
    SPARSE[node as usize - 1]
}

/// The cube in every version and encoding.
fn all_encodings() -> Vec<(FormatVersion, Encoding, Vec<u8>)> {
    use Encoding::{Ascii, BigEndian, LittleEndian};
    use FormatVersion::{V2_2, V4_1};
    vec![
        (V2_2, Ascii, ascii_v2(NAMES, dense).into_bytes()),
        (V2_2, LittleEndian, binary_v2(false)),
        (V2_2, BigEndian, binary_v2(true)),
        (V4_1, Ascii, ascii_v4(NAMES, dense).into_bytes()),
        (V4_1, LittleEndian, binary_v4(false, 8)),
        (V4_1, BigEndian, binary_v4(true, 8)),
        (V4_1, LittleEndian, binary_v4(false, 4)),
        (V4_1, BigEndian, binary_v4(true, 4)),
    ]
}

fn assert_cube(file: &GmshFile) {
    let mesh = file.to_tet_mesh(LengthUnit::Millimetre).unwrap();
    assert_eq!(mesh.nodes(), NODES.map(|node| DVec3::from(node) * 1e-3));
    assert_eq!(mesh.tets(), TETS.map(|tet| tet.map(|node| node as u32 - 1)));
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
    let partitioned = damage_v4("$Nodes", "$PartitionedEntities\n2\n$EndPartitionedEntities\n$Nodes");
    assert_eq!(partitioned, GmshError::Partitioned { at: At::Line(19) });
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
    for bad in ["nan", "-inf", "1e999"] {
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
        (8, "second-order line"),
        (9, "second-order triangle"),
        (11, "second-order tetrahedron"),
        (29, "tetrahedron of higher order"),
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
    // In format 2.2 the same tetrahedron may come again in another group, but not twice in one.
    assert_eq!(
        damage_v2("102 4 4 1 1 1 1 1 4 3 8", "102 4 4 1 1 1 1 1 2 4 8"),
        GmshError::DuplicateTet(101, 102)
    );
    for again in ["4 2 0 1 1 2 4 8", "4 0 1 2 4 8", "4 2 20 1 2 4 1 8"] {
        let error = damage_v2("$Elements\n11", &format!("$Elements\n12\n99 {again}"));
        assert_eq!(error, GmshError::DuplicateTet(99, 101));
    }
    assert_eq!(damage_v4("102 1 4 3 8", "102 2 4 1 8"), GmshError::DuplicateTet(101, 102));
    assert_eq!(damage_v4("105 1 5 6 8", "105 1 2 4 8"), GmshError::DuplicateTet(101, 105));
}

#[test]
fn defects_of_the_mesh_name_the_numbers_of_the_file() {
    let inverted = damage_v2("104 4 4 2 1 1 1 1 7 5 8", "104 4 4 2 1 1 1 7 1 5 8");
    assert!(
        matches!(inverted, GmshError::Inverted { element: 104, volume } if (volume + 1.0 / 6.0).abs() < 1e-12)
    );
    assert!(inverted.to_string().starts_with("tetrahedron 104 (Gmsh element tag) is inverted"));
    let flat = damage_v4("104 1 7 5 8", "104 1 2 3 4");
    assert_eq!(flat, GmshError::ZeroVolume { element: 104, volume: 0.0 });
    let orphan = damage_v2("$Nodes\n8\n", "$Nodes\n9\n4711 5 5 5\n");
    assert_eq!(orphan, GmshError::OrphanNode(4711));
    assert!(orphan.to_string().contains("4711"));
    let extra = damage_v2("$Nodes\n8\n", "$Nodes\n9\n9 0.4 0.6 -1\n");
    assert_eq!(extra, GmshError::OrphanNode(9));
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
    assert_eq!(empty.to_string(), "physical surface 13 \"none\" has no elements");
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

fn lattice() -> TetMesh {
    let axis = |step: f64| vec![-0.1, -0.1 + step, 1.0 / 3.0, 0.7];
    Lattice::new([axis(0.1), axis(1e-7), vec![0.0, 0.05]]).unwrap().to_tet_mesh().unwrap()
}

#[test]
fn what_is_written_is_read_back() {
    let mesh = lattice();
    let bottom: Vec<u32> =
        (0..mesh.nodes().len() as u32).filter(|&node| mesh.nodes()[node as usize].z == 0.0).collect();
    let electrode = gmsh::faces_among(&mesh, &bottom[..6]);
    let wall = gmsh::boundary_faces(&mesh);
    assert!(!electrode.is_empty());
    let all: Vec<u32> = (0..mesh.tets().len() as u32).collect();
    let (board, air) = all.split_at(10);
    let surfaces = [
        SurfaceGroup { name: "ground", triangles: &wall },
        SurfaceGroup { name: "E 1 µ", triangles: &electrode },
    ];
    let volumes = [
        VolumeGroup { name: "board", tets: board },
        VolumeGroup { name: "air", tets: air },
        VolumeGroup { name: "part", tets: &all[5..15] },
    ];
    let text = gmsh::write(&mesh, &surfaces, &volumes).unwrap();
    let file = gmsh::parse(text.as_bytes()).unwrap();
    let read = file.to_tet_mesh(LengthUnit::Metre).unwrap();
    // Positions survive bit for bit; nodes and elements are found again by their tags.
    let mut order: Vec<usize> = (0..file.nodes.len()).collect();
    order.sort_by_key(|&node| file.node_tags[node]);
    assert_eq!(order.iter().map(|&node| file.nodes[node]).collect::<Vec<_>>(), mesh.nodes());
    let original = |nodes: &[u32]| -> Vec<u32> {
        nodes.iter().map(|&node| file.node_tags[node as usize] as u32 - 1).collect()
    };
    let mut tets: Vec<Vec<u32>> = file.tets.iter().map(|tet| original(&tet.nodes)).collect();
    tets.sort();
    let mut expected: Vec<Vec<u32>> = mesh.tets().iter().map(|tet| tet.to_vec()).collect();
    expected.sort();
    assert_eq!(tets, expected);
    assert_eq!(read.tets().len(), mesh.tets().len());
    for volume in &volumes {
        let mut found: Vec<Vec<u32>> = file
            .tets_of(volume.name)
            .unwrap()
            .iter()
            .map(|&tet| original(&file.tets[tet as usize].nodes))
            .collect();
        found.sort();
        let mut expected: Vec<Vec<u32>> =
            volume.tets.iter().map(|&tet| mesh.tets()[tet as usize].to_vec()).collect();
        expected.sort();
        assert_eq!(found, expected, "{}", volume.name);
    }
    let mut nodes = original(&file.nodes_of("E 1 µ").unwrap());
    nodes.sort_unstable();
    let mut expected: Vec<u32> = electrode.iter().flatten().copied().collect();
    expected.sort_unstable();
    expected.dedup();
    assert_eq!(nodes, expected);
    let summary = file.surface_summary().unwrap();
    assert_eq!((summary.boundary_faces, summary.unlabelled_boundary_faces), (wall.len(), 0));
    assert!(summary.detached_triangles.is_empty());
}

#[test]
fn boundary_faces_point_outwards() {
    // On a Kuhn lattice some sides of the elements are never on the boundary; on one tetrahedron all are.
    let corners = [DVec3::ONE, DVec3::ONE + DVec3::X, DVec3::ONE + DVec3::Y, DVec3::ONE + DVec3::Z];
    let single = TetMesh::new(corners.to_vec(), vec![[0, 1, 2, 3]]).unwrap();
    assert_eq!(gmsh::boundary_faces(&single).len(), 4);
    for mesh in [lattice(), single] {
        let faces = gmsh::boundary_faces(&mesh);
        let corners = faces.iter().map(|face| face.map(|node| mesh.nodes()[node as usize]));
        let volume: f64 = corners.map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum();
        assert!((volume / mesh.volume() - 1.0).abs() < 1e-12, "{volume}");
    }
}

#[test]
fn a_mesh_without_groups_can_be_written() {
    let mesh = lattice();
    let file = gmsh::parse(gmsh::write(&mesh, &[], &[]).unwrap().as_bytes()).unwrap();
    assert!(file.groups.is_empty());
    assert_eq!(file.to_tet_mesh(LengthUnit::Metre).unwrap().tets().len(), mesh.tets().len());
}

#[test]
fn groups_that_cannot_be_written_are_told() {
    let mesh = lattice();
    let surface = |name, triangles| gmsh::write(&mesh, &[SurfaceGroup { name, triangles }], &[]).unwrap_err();
    let long = "x".repeat(128);
    for name in ["", "a\"b", "a\nb", &long] {
        assert_eq!(surface(name, &[]), WriteError::Name(name.to_owned()));
    }
    let (nodes, tets) = (mesh.nodes().len(), mesh.tets().len());
    let node = nodes as u32;
    let group = "E1".to_owned();
    assert_eq!(surface("E1", &[[0, 1, node]]), WriteError::NodeOutOfRange { group, node, nodes });
    let tet = tets as u32;
    let volume = VolumeGroup { name: "air", tets: &[0, tet] };
    assert_eq!(
        gmsh::write(&mesh, &[], &[volume]).unwrap_err(),
        WriteError::TetOutOfRange { group: "air".to_owned(), tet, tets }
    );
    let twins = [SurfaceGroup { name: "air", triangles: &[] }];
    let volume = VolumeGroup { name: "air", tets: &[0] };
    assert_eq!(
        gmsh::write(&mesh, &twins, &[volume]).unwrap_err(),
        WriteError::DuplicateName("air".to_owned())
    );
}
