//! Loading object meshes: small files of every kind, and bad ones.
#![allow(missing_docs, clippy::unwrap_used, clippy::panic)]

use capsense_core::geometry::{Aabb, TriangleMesh};
use capsense_core::units::LengthUnit;
use capsense_render::{MeshFileError, load_mesh};
use glam::DVec3;
use std::path::{Path, PathBuf};

/// A tetrahedron at the origin with legs of 1, 2 and 3 along the axes.
const CORNERS: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]];
const FACES: [[u16; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    }
}

fn load(path: &Path) -> TriangleMesh {
    load_mesh(path, LengthUnit::Metre).unwrap()
}

fn bounds(mesh: &TriangleMesh) -> Aabb {
    Aabb::around(mesh.vertices().iter().copied())
}

/// Volume enclosed by a closed surface, negative when its triangles face inwards.
fn volume(mesh: &TriangleMesh) -> f64 {
    let six = |&[a, b, c]: &[u32; 3]| {
        let [a, b, c] = [a, b, c].map(|v| mesh.vertices()[v as usize]);
        a.dot(b.cross(c))
    };
    mesh.triangles().iter().map(six).sum::<f64>() / 6.0
}

#[track_caller]
fn assert_is_tetrahedron(mesh: &TriangleMesh, scale: f64) {
    assert_eq!(mesh.triangles().len(), 4);
    approx::assert_relative_eq!(volume(mesh), scale.powi(3), max_relative = 1e-6);
    let size = bounds(mesh).size() / scale;
    assert!((size - DVec3::new(1.0, 2.0, 3.0)).length() < 1e-6, "{size}");
}

fn obj() -> String {
    let vertices = CORNERS.map(|[x, y, z]| format!("v {x} {y} {z}\n")).concat();
    let faces = FACES.map(|t| format!("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1)).concat();
    format!("# a tetrahedron\nmtllib missing.mtl\no thing\n{vertices}{faces}")
}

fn stl_ascii(name: &str) -> String {
    let facets = FACES.map(|t| {
        let corners =
            t.map(|v| CORNERS[v as usize]).map(|[x, y, z]| format!("vertex {x} {y} {z}\n")).concat();
        format!("  facet normal 0 0 0\n    outer loop\n{corners}    endloop\n  endfacet\n")
    });
    format!("solid{name}\n{}endsolid{name}\n", facets.concat())
}

fn stl_binary(header: &str, first_x: f32) -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes[..header.len()].copy_from_slice(header.as_bytes());
    bytes.extend(4_u32.to_le_bytes());
    for triangle in FACES {
        bytes.extend([0; 12]);
        for (k, corner) in triangle.map(|v| CORNERS[v as usize]).iter().enumerate() {
            let x = if k == 0 { first_x + corner[0] } else { corner[0] };
            bytes.extend([x, corner[1], corner[2]].iter().flat_map(|v| v.to_le_bytes()));
        }
        bytes.extend([0; 2]);
    }
    bytes
}

/// Positions and 16-bit indices of the tetrahedron.
fn gltf_buffer() -> Vec<u8> {
    let positions = CORNERS.iter().flatten().flat_map(|v| v.to_le_bytes());
    let indices = FACES.iter().flatten().flat_map(|v| v.to_le_bytes());
    positions.chain(indices).collect()
}

/// A scene whose root moves by (10, 0, 0) and turns x to y; its child scales. `buffer` and `nodes` as JSON.
fn gltf_with(buffer: &str, nodes: &str, mode: u32) -> String {
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0]}}], "nodes": {nodes},
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}, "indices": 1, "mode": {mode}}}]}}],
        "accessors": [
            {{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0,0,0], "max": [1,2,3]}},
            {{"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"}}],
        "bufferViews": [
            {{"buffer": 0, "byteOffset": 0, "byteLength": 48}},
            {{"buffer": 0, "byteOffset": 48, "byteLength": 24}}],
        "buffers": [{buffer}]}}"#
    )
}

const PLAIN: &str = r#"[{"mesh": 0}]"#;

fn glb(json: &str, bin: &[u8]) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF".to_vec();
    bytes.extend(2_u32.to_le_bytes());
    bytes.extend(((12 + 8 + json.len() + 8 + bin.len()) as u32).to_le_bytes());
    bytes.extend((json.len() as u32).to_le_bytes());
    bytes.extend(b"JSON");
    bytes.extend(json);
    bytes.extend((bin.len() as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(bin);
    bytes
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for group in bytes.chunks(3) {
        let bits = group.iter().fold(0_u32, |bits, &b| (bits << 8) | u32::from(b)) << (8 * (3 - group.len()));
        for k in 0..4 {
            let digit = DIGITS[(bits >> (18 - 6 * k) & 63) as usize];
            text.push(if k <= group.len() { char::from(digit) } else { '=' });
        }
    }
    text
}

fn embedded(nodes: &str, mode: u32) -> String {
    let uri = format!("data:application/octet-stream;base64,{}", base64(&gltf_buffer()));
    gltf_with(&format!(r#"{{"byteLength": 72, "uri": "{uri}"}}"#), nodes, mode)
}

#[test]
fn obj_files() {
    let folder = Folder::new();
    assert_is_tetrahedron(&load(&folder.write("a.obj", obj())), 1.0);
    let in_mm = load_mesh(folder.write("B.OBJ", obj()), LengthUnit::Millimetre).unwrap();
    assert_is_tetrahedron(&in_mm, 1e-3);

    // Two objects, a quadrilateral, indices counted from the end, lines and points to be ignored.
    let two = "o one\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\nl 1 2\np 1\n\
               o two\nv 5 0 1\nv 6 0 1\nv 5 1 1\nf -3//1 -2//1 -1//1\nvn 0 0 1\n";
    let two = two.replace("vn 0 0 1\n", "").replace("o two\n", "o two\nvn 0 0 1\n");
    let mesh = load(&folder.write("two.obj", two));
    assert_eq!(mesh.triangles().len(), 3);
    assert_eq!(bounds(&mesh), Aabb { min: DVec3::ZERO, max: DVec3::new(6.0, 1.0, 1.0) });
}

/// In single precision 0.08 is 0.0799999982.
#[test]
fn coordinates_are_the_decimals_that_were_meant() {
    let folder = Folder::new();
    let mesh = load(&folder.write("a.obj", obj().replace("v 1 0 0", "v 0.08 0 0")));
    assert!(mesh.vertices().iter().any(|vertex| vertex.x == 0.08), "{:?}", mesh.vertices());
    let mesh = load(&folder.write("a.stl", stl_binary("made by a test", 0.08)));
    assert!(mesh.vertices().iter().any(|vertex| vertex.x == 0.08), "{:?}", mesh.vertices());
}

#[test]
fn stl_files() {
    let folder = Folder::new();
    for (name, bytes) in [
        ("binary.stl", stl_binary("made by a test", 0.0)),
        ("misleading.stl", stl_binary("solid made by a test", 0.0)),
        ("ascii.stl", stl_ascii(" thing").into_bytes()),
        ("unnamed.stl", stl_ascii("").into_bytes()),
        ("upper.stl", stl_ascii(" x").to_uppercase().into_bytes()),
        ("windows.stl", stl_ascii(" x").replace('\n', "\r\n").into_bytes()),
        ("latin1.stl", [b"solid \xe4\n", stl_ascii("").split_once('\n').unwrap().1.as_bytes()].concat()),
    ] {
        let mesh = load(&folder.write(name, bytes));
        assert_is_tetrahedron(&mesh, 1.0);
        assert_eq!(mesh.vertices().len(), 4, "{name}: equal corners are one vertex");
    }
    let two = format!("{}{}", stl_ascii(" one"), stl_ascii(" two").replace("vertex 1 0 0", "vertex 7 0 0"));
    let mesh = load(&folder.write("two.stl", two));
    assert_eq!((mesh.triangles().len(), bounds(&mesh).max.x), (8, 7.0));
}

#[test]
fn gltf_files_with_every_kind_of_buffer() {
    let folder = Folder::new();
    assert_is_tetrahedron(&load(&folder.write("embedded.gltf", embedded(PLAIN, 4))), 1.0);
    let binary = glb(&gltf_with(r#"{"byteLength": 72}"#, PLAIN, 4), &gltf_buffer());
    assert_is_tetrahedron(&load(&folder.write("binary.glb", binary)), 1.0);
    folder.write("the data.bin", gltf_buffer());
    let beside = gltf_with(r#"{"byteLength": 72, "uri": "the%20data.bin"}"#, PLAIN, 4);
    assert_is_tetrahedron(&load(&folder.write("beside.gltf", beside)), 1.0);
    let in_cm = load_mesh(folder.write("cm.gltf", embedded(PLAIN, 4)), LengthUnit::Centimetre).unwrap();
    assert_is_tetrahedron(&in_cm, 1e-2);
}

#[test]
fn gltf_nodes_stand_where_their_transforms_put_them() {
    let folder = Folder::new();
    // The root turns x to y about z and moves; one child scales and moves, the other mirrors by a matrix.
    let half = 0.5_f64.sqrt();
    let nodes = format!(
        r#"[{{"children": [1, 2], "translation": [10, 0, 0], "rotation": [0, 0, {half}, {half}]}},
           {{"mesh": 0, "scale": [2, 2, 2], "translation": [0, 0, 5]}},
           {{"mesh": 0, "matrix": [-1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,100,1]}},
           {{"mesh": 0, "translation": [1000, 1000, 1000]}}]"#
    );
    let mesh = load(&folder.write("nodes.gltf", embedded(&nodes, 4)));
    assert_eq!(mesh.triangles().len(), 8, "node 3 is not part of the scene");
    // 8 from the scaled child, 1 from the mirrored one, which must not be inside out.
    approx::assert_relative_eq!(volume(&mesh), 9.0, max_relative = 1e-5);
    let expected = [
        // (0,0,3) of child 1: doubled, raised by 5, turned, moved by 10.
        DVec3::new(10.0, 0.0, 11.0),
        // (1,0,0) of child 1: x turns to y.
        DVec3::new(10.0, 2.0, 5.0),
        // (0,2,0) of child 1: y turns to -x.
        DVec3::new(6.0, 0.0, 5.0),
        // (1,0,0) of child 2: mirrored to -x, turned to -y.
        DVec3::new(10.0, -1.0, 100.0),
    ];
    for point in expected {
        let found = mesh.vertices().iter().any(|v| (*v - point).length() < 1e-5);
        assert!(found, "{point} is not among {:?}", mesh.vertices());
    }
}

#[test]
fn gltf_strips_fans_and_lines() {
    let folder = Folder::new();
    // 12 indices: a strip and a fan have 10 triangles.
    assert_eq!(load(&folder.write("strip.gltf", embedded(PLAIN, 5))).triangles().len(), 10);
    let fan = load(&folder.write("fan.gltf", embedded(PLAIN, 6)));
    assert_eq!(fan.triangles()[..3], [[0, 2, 1], [0, 1, 0], [0, 0, 1]]);
    let lines = load_mesh(folder.write("lines.gltf", embedded(PLAIN, 1)), LengthUnit::Metre);
    assert!(matches!(lines, Err(MeshFileError::NoTriangles { .. })), "{lines:?}");
}

/// The message of the error; it must name the file.
#[track_caller]
fn refusal(path: &Path) -> MeshFileError {
    let error = load_mesh(path, LengthUnit::Metre).unwrap_err();
    let name = path.file_name().unwrap().to_str().unwrap();
    assert!(error.to_string().contains(name), "`{error}` does not name {name}");
    error
}

#[test]
fn unreadable_and_unknown_files() {
    let folder = Folder::new();
    for name in ["gone.obj", "gone.stl", "gone.glb"] {
        assert!(matches!(refusal(&folder.0.path().join(name)), MeshFileError::Read { .. }));
    }
    for name in ["thing.ply", "thing", "thing.obj.bak"] {
        let error = refusal(&folder.write(name, obj()));
        assert!(matches!(error, MeshFileError::UnsupportedExtension { .. }), "{error}");
    }
}

#[test]
fn files_without_triangles() {
    let folder = Folder::new();
    let mut no_triangles = vec![0; 84];
    no_triangles[..5].copy_from_slice(b"empty");
    let without = |name: &str, bytes: &[u8]| {
        let error = refusal(&folder.write(name, bytes));
        assert!(matches!(error, MeshFileError::NoTriangles { .. }), "{error}");
    };
    without("empty.obj", b"");
    without("points.obj", b"v 0 0 0\nv 1 0 0\nl 1 2\n");
    without("empty.stl", &no_triangles);
    without("ascii.stl", b"solid a\nendsolid a\n");
    without("empty.gltf", br#"{"asset": {"version": "2.0"}}"#);
}

#[test]
fn files_with_numbers_that_are_not_finite() {
    let folder = Folder::new();
    let nan_obj = obj().replace("v 1 0 0", "v nan 0 0");
    let mut nan_buffer = gltf_buffer();
    nan_buffer[12..16].copy_from_slice(&f32::INFINITY.to_le_bytes());
    let nan_glb = glb(&gltf_with(r#"{"byteLength": 72}"#, PLAIN, 4), &nan_buffer);
    for (name, bytes) in
        [("nan.obj", nan_obj.into_bytes()), ("nan.stl", stl_binary("x", f32::NAN)), ("nan.glb", nan_glb)]
    {
        let error = refusal(&folder.write(name, bytes));
        assert!(matches!(error, MeshFileError::NonFiniteVertex { .. }), "{error}");
    }
    // The ASCII reader refuses them itself.
    let error =
        refusal(&folder.write("nan_ascii.stl", stl_ascii("").replace("vertex 1 0 0", "vertex nan 0 0")));
    assert!(error.to_string().contains("finite"), "{error}");
}

#[test]
fn broken_files() {
    let folder = Folder::new();
    let broken = |name: &str, bytes: &[u8], what: &str| {
        let error = refusal(&folder.write(name, bytes));
        assert!(matches!(error, MeshFileError::Parse { .. }), "{error}");
        assert!(error.to_string().contains(what), "`{error}` does not say `{what}`");
    };
    broken("word.obj", b"v 0 zero 0\n", "position");
    broken("index.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "out of bounds");
    broken("zero.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", "");
    let binary = stl_binary("x", 0.0);
    broken("short.stl", &binary[..200], "284 bytes, but this one has 200");
    broken("tiny.stl", b"abc", "neither");
    broken("empty.stl", b"", "neither");
    let ascii = stl_ascii(" x");
    broken("cut.stl", &ascii.as_bytes()[..ascii.len() / 2], "");
    broken("word.stl", ascii.replace("endloop", "loopend").as_bytes(), "loopend");
    broken("not.gltf", b"not JSON", "");
    broken("short.glb", b"glTF", "cut short");
    broken("header.glb", b"glTF\x02\0\0\0\x05\0\0\0", "cut short");
    let whole = glb(&gltf_with(r#"{"byteLength": 72}"#, PLAIN, 4), &gltf_buffer());
    broken("cut.glb", &whole[..whole.len() - 10], "");
}

#[test]
fn broken_gltf_contents() {
    let folder = Folder::new();
    let good = embedded(PLAIN, 4);
    let broken = |name: &str, text: String, what: &str| {
        assert_ne!(text, good, "{name} is not broken");
        let error = refusal(&folder.write(name, text));
        assert!(matches!(error, MeshFileError::Parse { .. }), "{error}");
        assert!(error.to_string().contains(what), "`{error}` does not say `{what}`");
    };
    broken("count.gltf", good.replace(r#""count": 12"#, r#""count": 13"#), "accessor 1 reaches beyond");
    broken(
        "huge.gltf",
        good.replace(r#""count": 12"#, r#""count": 9007199254740991"#),
        "accessor 1 reaches beyond",
    );
    broken(
        "view.gltf",
        good.replace(r#""byteLength": 24"#, r#""byteLength": 26"#),
        "accessor 1 reaches beyond",
    );
    broken("type.gltf", good.replace(r#""componentType": 5123"#, r#""componentType": 5126"#), "accessor 1");
    broken("vector.gltf", good.replace(r#""SCALAR""#, r#""VEC2""#), "single numbers");
    broken("reference.gltf", good.replace(r#""indices": 1"#, r#""indices": 7"#), "");
    broken(
        "short.gltf",
        good.replace(r#""byteLength": 72"#, r#""byteLength": 73"#),
        "72 bytes instead of 73",
    );
    broken("base64.gltf", good.replace(";base64,", ";base64,*"), "base64");
    let web = gltf_with(r#"{"byteLength": 72, "uri": "https://example.org/a.bin"}"#, PLAIN, 4);
    broken("web.gltf", web, "not a file");
    broken("blob.gltf", gltf_with(r#"{"byteLength": 72}"#, PLAIN, 4), "buffer 0 has no data");
    broken("cycle.gltf", embedded(r#"[{"children": [1]}, {"children": [0], "mesh": 0}]"#, 4), "node 0 hangs");

    let missing = gltf_with(r#"{"byteLength": 72, "uri": "gone.bin"}"#, PLAIN, 4);
    let error = refusal(&folder.write("missing.gltf", missing));
    assert!(matches!(error, MeshFileError::ReadBuffer { .. }), "{error}");
    assert!(error.to_string().contains("gone.bin"), "{error}");
}
