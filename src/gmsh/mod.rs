//! Gmsh `.msh` files: reading formats 2.2 and 4.1, ASCII and binary, and writing 4.1 ASCII.
//!
//! Bytes in, a mesh out: no files are opened here. The format is that of the Gmsh reference manual, chapters "MSH
//! file format" (4.1) and "MSH file format version 2 (Legacy)". A file is a list of sections `$Name … $EndName`;
//! those that are not needed (`$Periodic`, `$NodeData`, …) are skipped.

mod build;
mod cursor;
mod defects;
mod element_type;
mod error;
mod faces;
mod file;
mod repair;
mod v2;
mod v4;
mod write;

pub use cursor::Encoding;
pub use defects::{Defects, Found};
pub use error::{At, GmshError};
pub use faces::{boundary_faces, faces_among};
pub use file::{Element, FormatVersion, GmshFile, GroupKey, PhysicalGroup, SurfaceSummary};
pub use write::{SurfaceGroup, VolumeGroup, WriteError, write};

use build::Builder;
use cursor::{Cursor, Record};

/// Reads a Gmsh file.
///
/// # Errors
/// When the bytes are not a Gmsh file of format 2.2 or 4.1, are cut off or contradict themselves, or hold elements
/// that are no points, lines, triangles or tetrahedra, or have no volume. Nothing is read past an error. Lesser defects are
/// mended and counted ([`Defects`]).
pub fn parse(bytes: &[u8]) -> Result<GmshFile, GmshError> {
    let cursor = &mut Cursor::new(bytes);
    let mut builder = Builder::new();
    let mut entities = v4::Entities::new();
    let version = loop {
        let (mark, name) = section(cursor).ok().flatten().ok_or(GmshError::NotGmsh)?;
        match name.as_str() {
            "MeshFormat" => break mesh_format(cursor)?,
            "Comments" => cursor.skip_section(mark, &name)?,
            _ => return Err(GmshError::NotGmsh),
        }
    };
    let encoding = cursor.encoding;
    while let Some((mark, name)) = section(cursor)? {
        match (name.as_str(), version) {
            ("PhysicalNames", _) => {
                physical_names(cursor, &mut builder)?;
                close(cursor, "$EndPhysicalNames")?;
            }
            ("Entities" | "PartitionedEntities", FormatVersion::V4_1) => {
                let is_partitioned = name == "PartitionedEntities";
                entities_section(cursor, &mut builder, &mut entities, (mark, is_partitioned))?;
            }
            ("ParametricNodes", FormatVersion::V2_2) => {
                builder.has_nodes = true;
                v2::nodes(cursor, &mut builder, true)?;
                close(cursor, "$EndParametricNodes")?;
            }
            ("Nodes", _) => {
                builder.has_nodes = true;
                match version {
                    FormatVersion::V2_2 => v2::nodes(cursor, &mut builder, false)?,
                    FormatVersion::V4_1 => v4::nodes(cursor, &mut builder)?,
                }
                close(cursor, "$EndNodes")?;
            }
            ("Elements", _) => {
                if !builder.has_nodes {
                    let rule = "after $Nodes";
                    return Err(GmshError::Order { at: cursor.at(mark), section: "Elements", rule });
                }
                builder.has_elements = true;
                builder.index_nodes(cursor)?;
                match version {
                    FormatVersion::V2_2 => v2::elements(cursor, &mut builder)?,
                    FormatVersion::V4_1 => v4::elements(cursor, &mut builder, &entities)?,
                }
                close(cursor, "$EndElements")?;
            }
            ("MeshFormat", _) => {
                return Err(cursor.unexpected(mark, "one section $MeshFormat", "$MeshFormat"));
            }
            _ => cursor.skip_section(mark, &name)?,
        }
    }
    builder.finish(cursor, version, encoding)
}

/// The section that begins at the mark: `$Entities`, or `$PartitionedEntities`.
fn entities_section(
    cursor: &mut Cursor<'_>,
    builder: &mut Builder,
    entities: &mut v4::Entities,
    (mark, is_partitioned): (usize, bool),
) -> Result<(), GmshError> {
    let section = if is_partitioned { "PartitionedEntities" } else { "Entities" };
    if builder.has_elements {
        return Err(GmshError::Order { at: cursor.at(mark), section, rule: "before $Elements" });
    }
    cursor.start_data()?;
    if is_partitioned {
        v4::partitioned_entities(cursor, builder, entities)?;
        close(cursor, "$EndPartitionedEntities")
    } else {
        v4::entities(cursor, builder, entities)?;
        close(cursor, "$EndEntities")
    }
}

/// The beginning and the name of the next section.
fn section(cursor: &mut Cursor<'_>) -> Result<Option<(usize, String)>, GmshError> {
    let Some((mark, token)) = cursor.token() else {
        return Ok(None);
    };
    let name = token.strip_prefix(b"$").and_then(|name| std::str::from_utf8(name).ok());
    match name {
        Some(name) if !name.is_empty() && !name.starts_with("End") => Ok(Some((mark, name.to_owned()))),
        _ => Err(cursor.unexpected(mark, "the beginning of a section", String::from_utf8_lossy(token))),
    }
}

/// The end of a section.
fn close(cursor: &mut Cursor<'_>, end: &'static str) -> Result<(), GmshError> {
    let (mark, word) = cursor.word(end)?;
    if word == end { Ok(()) } else { Err(cursor.unexpected(mark, end, word)) }
}

/// version file-type data-size, and in binary files the integer 1.
fn mesh_format(cursor: &mut Cursor<'_>) -> Result<FormatVersion, GmshError> {
    let (mark, version) = cursor.word("the version of the format")?;
    let number = version.parse::<f64>().unwrap_or(f64::NAN);
    let version = if number == 2.2 {
        FormatVersion::V2_2
    } else if number == 4.1 {
        FormatVersion::V4_1
    } else {
        // Gmsh itself writes 4.0 as `4`.
        let version = if number == 4.0 { "4.0".to_owned() } else { version };
        return Err(GmshError::Version { at: cursor.at(mark), version });
    };
    let mark = cursor.mark();
    let file_type = cursor.text_int("the file type (0 for ASCII, 1 for binary)")?;
    if !matches!(file_type, 0 | 1) {
        return Err(cursor.unexpected(mark, "the file type (0 for ASCII, 1 for binary)", file_type));
    }
    let mark = cursor.mark();
    let size = cursor.text_size("the data size")?;
    cursor.size_bytes = match (size, version) {
        (8, _) => 8,
        (4, FormatVersion::V4_1) => 4,
        _ => return Err(GmshError::DataSize { at: cursor.at(mark), size }),
    };
    if file_type == 1 {
        cursor.end_line()?;
        cursor.byte_order()?;
    }
    close(cursor, "$EndMeshFormat")?;
    Ok(version)
}

/// number-of-names, then for each: dimension number "name".
fn physical_names(cursor: &mut Cursor<'_>, builder: &mut Builder) -> Result<(), GmshError> {
    let mark = cursor.text_mark();
    let claimed = cursor.text_size("the number of physical names")?;
    cursor.check_count(claimed, "physical names", mark, Record { ints: 3, ..Record::default() })?;
    for _ in 0..claimed {
        const EXPECTED: &str = "the dimension (0 to 3) of a physical group";
        let mark = cursor.text_mark();
        let dimension = cursor.text_int(EXPECTED)?;
        let dimension = u8::try_from(dimension)
            .ok()
            .filter(|&dimension| dimension <= 3)
            .ok_or_else(|| cursor.unexpected(mark, EXPECTED, dimension))?;
        let tag = cursor.text_int("the number of a physical group")?;
        let name = cursor.quoted("the name of a physical group in double quotes")?;
        if !builder.name_group(dimension, tag, name) {
            return Err(GmshError::NamedTwice { at: cursor.at(mark), dimension, tag });
        }
    }
    Ok(())
}
