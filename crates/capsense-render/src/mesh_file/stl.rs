//! STL files, binary and ASCII. Whether a file is binary is told by its length, not by its first word: many programs
//! start binary files with `solid` too.

use super::{Surface, point};
use std::io::Cursor;

/// Bytes before the first triangle of a binary file: a free text and the number of triangles.
const HEADER: usize = 84;

/// Bytes of a triangle in a binary file.
const TRIANGLE: usize = 50;

pub(super) fn load(bytes: &[u8]) -> Result<Surface, String> {
    let mut surface = Surface::default();
    // Names of solids may be in any encoding.
    let text = String::from_utf8_lossy(bytes);
    let text = Some(&*text).filter(|text| starts_solid(text));
    match (binary_triangles(bytes), text) {
        (Some(announced), _) if bytes.len() == HEADER + announced * TRIANGLE => {
            add_binary(&mut surface, bytes)?
        }
        (_, Some(text)) => add_ascii(&mut surface, text)?,
        (Some(announced), None) => {
            return Err(format!(
                "a binary STL file of {announced} triangles has {} bytes, but this one has {}",
                HEADER + announced * TRIANGLE,
                bytes.len()
            ));
        }
        (None, None) => return Err("this is neither a binary nor an ASCII STL file".to_owned()),
    }
    Ok(surface)
}

fn starts_solid(text: &str) -> bool {
    text.split_whitespace().next().is_some_and(|word| word.eq_ignore_ascii_case("solid"))
}

/// The number of triangles that the header of a binary file announces.
fn binary_triangles(bytes: &[u8]) -> Option<usize> {
    let count = bytes.get(HEADER - 4..HEADER)?.first_chunk::<4>()?;
    Some(u32::from_le_bytes(*count) as usize)
}

fn add_binary(surface: &mut Surface, bytes: &[u8]) -> Result<(), String> {
    let mut bytes = bytes.to_vec();
    // The reader takes everything that starts with `solid` for ASCII; the header's text has no meaning.
    bytes[0] = 0;
    add(surface, &bytes)
}

/// Reads every `solid ... endsolid`; the reader takes one at a time, in lower case, and wants the solid to have a name.
fn add_ascii(surface: &mut Surface, text: &str) -> Result<(), String> {
    let mut solid = String::new();
    for line in text.lines() {
        let line = line.trim().to_ascii_lowercase();
        if line == "solid" || line.starts_with("solid ") {
            solid.clear();
            solid.push_str("solid unnamed\n");
            continue;
        }
        solid.push_str(&line);
        solid.push('\n');
        if line.starts_with("endsolid") {
            add(surface, solid.as_bytes())?;
            solid.clear();
        }
    }
    if solid.trim().is_empty() {
        Ok(())
    } else {
        // A truncated file: the reader says what it misses.
        add(surface, solid.as_bytes())
    }
}

fn add(surface: &mut Surface, bytes: &[u8]) -> Result<(), String> {
    let mesh = stl_io::read_stl(&mut Cursor::new(bytes)).map_err(|error| error.to_string())?;
    let base = surface.vertices.len();
    surface.vertices.extend(mesh.vertices.iter().map(|v| point(v.0)));
    for face in mesh.faces {
        let corner = |v: usize| u32::try_from(base + v).map_err(|_| "too many vertices".to_owned());
        let [a, b, c] = face.vertices;
        surface.triangles.push([corner(a)?, corner(b)?, corner(c)?]);
    }
    Ok(())
}
