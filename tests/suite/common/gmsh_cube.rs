//! One cube as a Gmsh file, in every version and encoding.

use capsense::gmsh::{Encoding, FormatVersion};

/// A unit cube of six Kuhn tetrahedra around the diagonal from node 1 to node 8.
pub const NODES: [[f64; 3]; 8] = [
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
pub const TETS: [[u64; 4]; 6] =
    [[1, 2, 4, 8], [1, 4, 3, 8], [1, 3, 7, 8], [1, 7, 5, 8], [1, 5, 6, 8], [1, 6, 2, 8]];
/// The bottom is electrode "E 1", group 11; one triangle of the top is unlabelled.
pub const BOTTOM: [[u64; 3]; 2] = [[1, 2, 4], [1, 4, 3]];
pub const TOP: [u64; 3] = [5, 6, 8];
pub const NAMES: &str =
    "$PhysicalNames\n3\n2 11 \"E 1\"\n3 1 \"half\"\n3 2 \"other half\"\n$EndPhysicalNames\n";
/// Node tags that are unordered and far apart.
pub const SPARSE: [u64; 8] = [900_000_000, 2, 7_000, 41, 40, 1_234_567_890, 3, 77];

pub fn is_first_half(tet: usize) -> bool {
    tet < 3
}

pub fn ascii_v2(names: &str, tag: impl Fn(u64) -> u64) -> String {
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

pub fn ascii_v4(names: &str, tag: impl Fn(u64) -> u64) -> String {
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

pub fn binary_v2(is_big: bool) -> Vec<u8> {
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

pub fn binary_v4(is_big: bool, size_bytes: usize) -> Vec<u8> {
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

pub fn dense(node: u64) -> u64 {
    node
}

pub fn sparse(node: u64) -> u64 {
    SPARSE[node as usize - 1]
}

/// The cube in every version and encoding.
pub fn all_encodings() -> Vec<(FormatVersion, Encoding, Vec<u8>)> {
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
