//! Sections `$Entities`, `$Nodes` and `$Elements` of format 4.1 (Gmsh reference manual, "MSH file format").
//!
//! Elements name the entity they discretise; the physical groups stand at the entities.

use super::build::{Builder, ElementHead};
use super::cursor::{Cursor, Record};
use super::element_type::{ElementType, type_name};
use super::error::GmshError;
use std::collections::HashMap;

/// The labels of each entity, by dimension and tag.
pub(super) type Entities = HashMap<(u8, i32), u32>;

/// The numbers of points, curves, surfaces and volumes, then for each: tag, bounding box (of points: position),
/// physical tags, bounding entities (of points: none).
pub(super) fn entities(
    cursor: &mut Cursor<'_>,
    builder: &mut Builder,
    entities: &mut Entities,
) -> Result<(), GmshError> {
    for_entities(cursor, |cursor, dimension| {
        let tag = cursor.int("the tag of an entity")?;
        let groups = extent_and_groups(cursor, dimension)?;
        for &group in &groups {
            builder.use_group(dimension, group);
        }
        entities.insert((dimension, tag), builder.labels.number(groups));
        Ok(())
    })
}

/// The numbers of partitions and of ghost entities, and for each ghost entity its tag and its partition; then the same
/// as in `$Entities`, but that behind each tag there are the dimension and the tag of the entity of which it is a part,
/// and a list of partitions. Parts are in the groups of what they are parts of.
pub(super) fn partitioned_entities(
    cursor: &mut Cursor<'_>,
    builder: &mut Builder,
    entities: &mut Entities,
) -> Result<(), GmshError> {
    builder.defects.partitions = cursor.size("the number of partitions")?;
    let mark = cursor.mark();
    let ghosts = cursor.size("the number of ghost entities")?;
    cursor.check_count(ghosts, "ghost entities", mark, Record { ints: 2, ..Record::default() })?;
    for _ in 0..ghosts {
        cursor.int("the tag of a ghost entity")?;
        cursor.int("the partition of a ghost entity")?;
    }
    for_entities(cursor, |cursor, dimension| {
        let tag = cursor.int("the tag of an entity")?;
        let parent = (cursor.int("the dimension of a parent")?, cursor.int("the tag of a parent")?);
        list(cursor, "partitions of an entity")?;
        let mut groups = extent_and_groups(cursor, dimension)?;
        if parent.0 == i32::from(dimension)
            && let Some(&label) = entities.get(&(dimension, parent.1))
        {
            groups.extend(builder.labels.list(label));
        }
        for &group in &groups {
            builder.use_group(dimension, group);
        }
        entities.insert((dimension, tag), builder.labels.number(groups));
        Ok(())
    })
}

/// Reads the numbers of points, curves, surfaces and volumes, and then each of them with its dimension.
fn for_entities<'a>(
    cursor: &mut Cursor<'a>,
    mut read: impl FnMut(&mut Cursor<'a>, u8) -> Result<(), GmshError>,
) -> Result<(), GmshError> {
    let mut counts = [(0, 0); 4];
    for count in &mut counts {
        *count = (cursor.mark(), cursor.size("the number of entities")?);
    }
    for (dimension, (mark, claimed)) in (0..=3).zip(counts) {
        let record = Record { ints: 1, sizes: 1, reals: extents(dimension) };
        cursor.check_count(claimed, "entities", mark, record)?;
        for _ in 0..claimed {
            read(cursor, dimension)?;
        }
    }
    Ok(())
}

/// How many numbers tell where an entity is.
fn extents(dimension: u8) -> usize {
    if dimension == 0 { 3 } else { 6 }
}

/// Reads over where an entity is and what bounds it, and takes its physical tags.
fn extent_and_groups(cursor: &mut Cursor<'_>, dimension: u8) -> Result<Vec<i32>, GmshError> {
    for _ in 0..extents(dimension) {
        cursor.real("the bounds of an entity")?;
    }
    let groups = list(cursor, "physical tags of an entity")?;
    if dimension > 0 {
        list(cursor, "bounding entities of an entity")?;
    }
    Ok(groups)
}

fn list(cursor: &mut Cursor<'_>, what: &'static str) -> Result<Vec<i32>, GmshError> {
    let mark = cursor.mark();
    let claimed = cursor.size(what)?;
    let count = cursor.check_count(claimed, what, mark, Record { ints: 1, ..Record::default() })?;
    (0..count).map(|_| cursor.int(what)).collect()
}

/// The head of `$Nodes` and `$Elements`: number of blocks, number of all, smallest and largest tag.
fn head(cursor: &mut Cursor<'_>, what: &'static str) -> Result<(u64, Total), GmshError> {
    let mark = cursor.mark();
    let blocks = cursor.size("the number of blocks")?;
    cursor.check_count(blocks, "blocks", mark, Record { ints: 3, sizes: 1, reals: 0 })?;
    let mark = cursor.mark();
    let claimed = cursor.size(what)?;
    cursor.size("the smallest tag")?;
    cursor.size("the largest tag")?;
    Ok((blocks, Total { mark, what, claimed, found: 0 }))
}

/// What the head announced and what the blocks have held so far.
struct Total {
    mark: usize,
    what: &'static str,
    claimed: u64,
    found: u64,
}

impl Total {
    fn check(self, cursor: &Cursor<'_>) -> Result<(), GmshError> {
        let Self { mark, what, claimed, found } = self;
        if claimed == found {
            Ok(())
        } else {
            Err(GmshError::Total { at: cursor.at(mark), what, claimed, found })
        }
    }
}

/// Dimension (0 to 3) and tag of an entity.
fn entity(cursor: &mut Cursor<'_>) -> Result<(u8, i32), GmshError> {
    const EXPECTED: &str = "the dimension (0 to 3) of an entity";
    let mark = cursor.mark();
    let dimension = cursor.int(EXPECTED)?;
    let dimension = u8::try_from(dimension)
        .ok()
        .filter(|&dimension| dimension <= 3)
        .ok_or_else(|| cursor.unexpected(mark, EXPECTED, dimension))?;
    Ok((dimension, cursor.int("the tag of an entity")?))
}

/// Blocks of: entity, whether positions have parameters, number of nodes, all tags, all positions.
pub(super) fn nodes(cursor: &mut Cursor<'_>, builder: &mut Builder) -> Result<(), GmshError> {
    cursor.start_data()?;
    let (blocks, mut total) = head(cursor, "nodes")?;
    let mut tags = Vec::new();
    for _ in 0..blocks {
        let (dimension, _) = entity(cursor)?;
        const EXPECTED: &str = "0 or 1 (whether nodes have parameters)";
        let mark = cursor.mark();
        let parameters = match cursor.int(EXPECTED)? {
            0 => 0,
            1 => dimension,
            other => return Err(cursor.unexpected(mark, EXPECTED, other)),
        };
        let mark = cursor.mark();
        let claimed = cursor.size("the number of nodes in a block")?;
        let record = Record { ints: 0, sizes: 1, reals: 3 };
        let count = cursor.check_count(claimed, "nodes", mark, record)?;
        tags.clear();
        for _ in 0..count {
            let mark = cursor.mark();
            tags.push((mark, cursor.size("the tag of a node")?));
        }
        builder.reserve_nodes(count);
        for &(mark, tag) in &tags {
            let position = cursor.point(tag)?;
            for _ in 0..parameters {
                cursor.real("a parameter of a node")?;
            }
            builder.add_node(tag, position, mark);
        }
        total.found += claimed;
    }
    total.check(cursor)
}

/// Blocks of: entity, element type, number of elements, and for each: tag, nodes.
pub(super) fn elements(
    cursor: &mut Cursor<'_>,
    builder: &mut Builder,
    entities: &Entities,
) -> Result<(), GmshError> {
    cursor.start_data()?;
    let (blocks, mut total) = head(cursor, "elements")?;
    for _ in 0..blocks {
        let (dimension, entity) = entity(cursor)?;
        let type_mark = cursor.mark();
        let number = i64::from(cursor.int("the type of a block of elements")?);
        if ElementType::of(number).is_some_and(|kind| kind.shape.dimension() != dimension) {
            let expected = "an element type of the dimension of the entity";
            return Err(cursor.unexpected(type_mark, expected, number));
        }
        let mark = cursor.mark();
        let claimed = cursor.size("the number of elements in a block")?;
        cursor.check_count(claimed, "elements", mark, Record { sizes: 2, ..Record::default() })?;
        // An entity that is not declared is in no group: files without $Entities are valid.
        let label = entities.get(&(dimension, entity)).copied().unwrap_or(0);
        for _ in 0..claimed {
            let mark = cursor.mark();
            let tag = cursor.size("the tag of an element")?;
            let kind = ElementType::of(number).ok_or_else(|| GmshError::ElementType {
                at: cursor.at(mark),
                element: tag,
                number,
                name: type_name(number),
            })?;
            builder.read_element(cursor, ElementHead { mark, tag, kind, label }, Cursor::size)?;
        }
        total.found += claimed;
    }
    total.check(cursor)
}
