//! Sections `$Nodes` and `$Elements` of format 2.2 (Gmsh reference manual, "MSH file format version 2 (Legacy)").
//!
//! Their counts are text even in binary files, and binary elements come in blocks of one type.

use super::build::{Builder, ElementHead};
use super::cursor::{Cursor, Encoding, Record};
use super::element_type::{ElementType, type_name};
use super::error::GmshError;

/// number-of-nodes, then for each node: tag x y z. In `$ParametricNodes`, which takes the place of `$Nodes` where Gmsh's
/// `Mesh.SaveParametric` is set, there follow the dimension and the tag of an entity, and on a curve one parameter, on a
/// surface two.
pub(super) fn nodes(
    cursor: &mut Cursor<'_>,
    builder: &mut Builder,
    are_parametric: bool,
) -> Result<(), GmshError> {
    let mark = cursor.text_mark();
    let claimed = cursor.text_size("the number of nodes")?;
    cursor.start_data()?;
    let count = cursor.check_count(claimed, "nodes", mark, Record { ints: 1, reals: 3, sizes: 0 })?;
    builder.reserve_nodes(count);
    for _ in 0..count {
        let mark = cursor.mark();
        let tag = cursor.natural("the tag of a node")?;
        let position = cursor.point(tag)?;
        if are_parametric {
            skip_parameters(cursor)?;
        }
        builder.add_node(tag, position, mark);
    }
    Ok(())
}

fn skip_parameters(cursor: &mut Cursor<'_>) -> Result<(), GmshError> {
    const EXPECTED: &str = "the dimension (0 to 3) of an entity";
    let mark = cursor.mark();
    let parameters = match cursor.int(EXPECTED)? {
        0 | 3 => 0,
        1 => 1,
        2 => 2,
        other => return Err(cursor.unexpected(mark, EXPECTED, other)),
    };
    cursor.int("the tag of an entity")?;
    for _ in 0..parameters {
        cursor.real("a parameter of a node")?;
    }
    Ok(())
}

/// number-of-elements, then for each element: tag type number-of-tags tags nodes; in binary files the elements stand
/// in blocks that are headed by: type number-of-elements number-of-tags.
pub(super) fn elements(cursor: &mut Cursor<'_>, builder: &mut Builder) -> Result<(), GmshError> {
    let mark = cursor.text_mark();
    let claimed = cursor.text_size("the number of elements")?;
    cursor.start_data()?;
    cursor.check_count(claimed, "elements", mark, Record { ints: 2, ..Record::default() })?;
    if cursor.encoding == Encoding::Ascii {
        for _ in 0..claimed {
            let mark = cursor.mark();
            let tag = cursor.natural("the tag of an element")?;
            let number = cursor.int("the type of an element")?;
            let tag_count = cursor.natural("the number of tags of an element")?;
            let kind = kind(cursor, mark, tag, number)?;
            element(cursor, builder, mark, tag, kind, tag_count)?;
        }
        return Ok(());
    }
    let mut found = 0;
    while found < claimed {
        let block = cursor.mark();
        let number = cursor.int("the type of a block of elements")?;
        let count = cursor.natural("the number of elements in a block")?;
        let tag_count = cursor.natural("the number of tags of an element")?;
        found += count;
        if found > claimed {
            return Err(GmshError::Total { at: cursor.at(mark), what: "elements", claimed, found });
        }
        cursor.check_count(count, "elements", block, Record { ints: 2, ..Record::default() })?;
        for _ in 0..count {
            let mark = cursor.mark();
            let tag = cursor.natural("the tag of an element")?;
            let kind = kind(cursor, mark, tag, number)?;
            element(cursor, builder, mark, tag, kind, tag_count)?;
        }
    }
    Ok(())
}

fn kind(cursor: &Cursor<'_>, mark: usize, tag: u64, number: i32) -> Result<ElementType, GmshError> {
    let number = i64::from(number);
    ElementType::of(number).ok_or_else(|| GmshError::ElementType {
        at: cursor.at(mark),
        element: tag,
        number,
        name: type_name(number),
    })
}

/// The tags (the first is the physical group, the others entity and partitions) and the nodes of an element.
fn element(
    cursor: &mut Cursor<'_>,
    builder: &mut Builder,
    mark: usize,
    tag: u64,
    kind: ElementType,
    tag_count: u64,
) -> Result<(), GmshError> {
    cursor.check_count(tag_count, "tags of an element", mark, Record { ints: 1, ..Record::default() })?;
    let mut physical = 0;
    for index in 0..tag_count {
        let value = cursor.int("a tag of an element")?;
        if index == 0 {
            physical = value;
        }
    }
    builder.use_group(kind.shape.dimension(), physical);
    let label = builder.labels.number_of_one(physical);
    builder.read_element(cursor, ElementHead { mark, tag, kind, label }, Cursor::natural)
}
