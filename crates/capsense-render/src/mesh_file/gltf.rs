//! glTF 2.0, text and binary: the meshes of the default scene (else the first), each where its node stands.

use super::{Failure, Surface, base64, point};
use ::gltf::accessor::{DataType, Dimensions};
use ::gltf::mesh::Mode;
use ::gltf::scene::Transform;
use ::gltf::{Accessor, Gltf, Node, Primitive, Semantic};
use glam::{DMat4, DQuat};
use std::path::Path;

/// Bytes of the header of a binary file. The crate's reader subtracts this from the length without looking.
const GLB_HEADER: u32 = 12;

pub(super) fn load(bytes: &[u8], path: &Path) -> Result<Surface, Failure> {
    if bytes.starts_with(b"glTF") {
        let length = bytes.get(8..12).and_then(<[u8]>::first_chunk::<4>).map(|l| u32::from_le_bytes(*l));
        if length.is_none_or(|length| length < GLB_HEADER) {
            return Err("the header of the binary glTF file is cut short".to_owned().into());
        }
    }
    let gltf = Gltf::from_slice(bytes).map_err(|error| error.to_string())?;
    let buffers = buffers(&gltf, path)?;
    let mut surface = Surface::default();
    let Some(scene) = gltf.default_scene().or_else(|| gltf.scenes().next()) else {
        return Ok(surface);
    };
    let mut seen = vec![false; gltf.nodes().len()];
    let mut waiting: Vec<(Node<'_>, DMat4)> = scene.nodes().map(|node| (node, DMat4::IDENTITY)).collect();
    while let Some((node, scene_from_parent)) = waiting.pop() {
        if std::mem::replace(&mut seen[node.index()], true) {
            return Err(format!("node {} hangs below two others or below itself", node.index()).into());
        }
        let scene_from_node = scene_from_parent * parent_from_node(node.transform());
        for primitive in node.mesh().iter().flat_map(|mesh| mesh.primitives()) {
            add(&mut surface, &primitive, scene_from_node, &buffers)
                .map_err(|reason| format!("node {}: {reason}", node.index()))?;
        }
        waiting.extend(node.children().map(|child| (child, scene_from_node)));
    }
    Ok(surface)
}

/// The bytes of every buffer: the binary chunk, a data URI, or a file beside this one.
fn buffers(gltf: &Gltf, path: &Path) -> Result<Vec<Vec<u8>>, Failure> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let load = |buffer: ::gltf::Buffer<'_>| -> Result<Vec<u8>, Failure> {
        let bytes = match buffer.source() {
            ::gltf::buffer::Source::Bin => {
                gltf.blob.clone().ok_or_else(|| format!("buffer {} has no data", buffer.index()))?
            }
            ::gltf::buffer::Source::Uri(uri) => match uri.strip_prefix("data:") {
                Some(data) => data
                    .split_once(";base64,")
                    .and_then(|(_, text)| base64::decode(text))
                    .ok_or_else(|| format!("the data URI of buffer {} is not base64", buffer.index()))?,
                None if uri.contains("://") => {
                    return Err(format!("buffer {} is not a file: {uri}", buffer.index()).into());
                }
                None => {
                    let name = base64::percent_decode(uri)
                        .ok_or_else(|| format!("the URI of buffer {} is malformed: {uri}", buffer.index()))?;
                    let file = folder.join(name);
                    std::fs::read(&file).map_err(|source| Failure::Buffer { buffer: file, source })?
                }
            },
        };
        if bytes.len() < buffer.length() {
            let (index, needed) = (buffer.index(), buffer.length());
            return Err(format!("buffer {index} has {} bytes instead of {needed}", bytes.len()).into());
        }
        Ok(bytes)
    };
    gltf.buffers().map(load).collect()
}

fn parent_from_node(transform: Transform) -> DMat4 {
    match transform {
        Transform::Matrix { matrix } => DMat4::from_cols_array_2d(&matrix.map(|c| c.map(f64::from))),
        Transform::Decomposed { translation, rotation, scale } => DMat4::from_scale_rotation_translation(
            point(scale),
            DQuat::from_array(rotation.map(f64::from)).normalize(),
            point(translation),
        ),
    }
}

fn add(
    surface: &mut Surface,
    primitive: &Primitive<'_>,
    scene_from_node: DMat4,
    buffers: &[Vec<u8>],
) -> Result<(), String> {
    if matches!(primitive.mode(), Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
        return Ok(());
    }
    let positions = primitive.get(&Semantic::Positions).ok_or("a primitive has no positions")?;
    if (positions.data_type(), positions.dimensions()) != (DataType::F32, Dimensions::Vec3) {
        return Err(format!("accessor {}: positions must be three floats", positions.index()));
    }
    let base = u32::try_from(surface.vertices.len()).map_err(|_| "too many vertices")?;
    for bytes in elements(&positions, buffers)? {
        let position = point(bytemuck::pod_read_unaligned(bytes));
        surface.vertices.push(scene_from_node.transform_point3(position));
    }
    let indices = match primitive.indices() {
        Some(accessor) => read_indices(&accessor, buffers)?,
        None => (0..u32::try_from(positions.count()).map_err(|_| "too many vertices")?).collect(),
    };
    // A mirroring transform turns the triangles inside out; turn them back.
    let mirrored = scene_from_node.determinant() < 0.0;
    for [a, b, c] in triangles(primitive.mode(), &indices) {
        let corner = |v: u32| v.checked_add(base).ok_or("too many vertices");
        let (a, b, c) = (corner(a)?, corner(b)?, corner(c)?);
        surface.triangles.push(if mirrored { [a, c, b] } else { [a, b, c] });
    }
    Ok(())
}

/// Triangles of a list, a strip or a fan.
fn triangles(mode: Mode, indices: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        // Every other triangle of a strip is wound the other way.
        Mode::TriangleStrip => indices
            .windows(3)
            .enumerate()
            .map(|(k, w)| if k % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] })
            .collect(),
        Mode::TriangleFan => indices.windows(2).skip(1).map(|w| [indices[0], w[0], w[1]]).collect(),
        _ => indices.as_chunks::<3>().0.to_vec(),
    }
}

fn read_indices(accessor: &Accessor<'_>, buffers: &[Vec<u8>]) -> Result<Vec<u32>, String> {
    if accessor.dimensions() != Dimensions::Scalar {
        return Err(format!("accessor {}: indices must be single numbers", accessor.index()));
    }
    let elements = elements(accessor, buffers)?;
    match accessor.data_type() {
        DataType::U8 => Ok(elements.map(|bytes| u32::from(bytes[0])).collect()),
        DataType::U16 => Ok(elements.map(|b| u32::from(u16::from_le_bytes([b[0], b[1]]))).collect()),
        DataType::U32 => Ok(elements.map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()),
        other => Err(format!("accessor {}: indices cannot be {other:?}", accessor.index())),
    }
}

/// The bytes of each element of an accessor, checked to lie inside its buffer.
fn elements<'a>(
    accessor: &Accessor<'_>,
    buffers: &'a [Vec<u8>],
) -> Result<impl Iterator<Item = &'a [u8]> + use<'a>, String> {
    let name = format!("accessor {}", accessor.index());
    if accessor.sparse().is_some() {
        return Err(format!("{name} is sparse, which is not supported"));
    }
    let view = accessor.view().ok_or_else(|| format!("{name} has no data (is the mesh compressed?)"))?;
    let (size, count) = (accessor.size(), accessor.count());
    let stride = view.stride().unwrap_or(size);
    if stride < size {
        return Err(format!("{name}: its elements of {size} bytes overlap, {stride} bytes apart"));
    }
    let used = count.checked_sub(1).and_then(|n| n.checked_mul(stride)?.checked_add(size)).unwrap_or(0);
    let view_bytes = buffers
        .get(view.buffer().index())
        .and_then(|buffer| buffer.get(view.offset()..view.offset().checked_add(view.length())?));
    let bytes = view_bytes
        .and_then(|bytes| bytes.get(accessor.offset()..accessor.offset().checked_add(used)?))
        .ok_or_else(|| format!("{name} reaches beyond its buffer"))?;
    Ok((0..count).map_while(move |k| bytes.get(k * stride..k * stride + size)))
}
