//! Collects what the readers of both versions find, resolves node tags, and gathers the labels of elements.

use super::cursor::{Cursor, Encoding};
use super::error::GmshError;
use super::{Element, FormatVersion, GmshFile, PhysicalGroup};
use capsense_core::mesh::MeshError;
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// The element types that may appear in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    Point,
    Line,
    Triangle,
    Tet,
}

impl Shape {
    /// The shape of a Gmsh element type, if it is one of first order and made of triangles.
    pub(super) fn of_type(number: i64) -> Option<Self> {
        match number {
            15 => Some(Self::Point),
            1 => Some(Self::Line),
            2 => Some(Self::Triangle),
            4 => Some(Self::Tet),
            _ => None,
        }
    }

    pub(super) fn dimension(self) -> u8 {
        self.node_count() as u8 - 1
    }

    pub(super) fn node_count(self) -> usize {
        match self {
            Self::Point => 1,
            Self::Line => 2,
            Self::Triangle => 3,
            Self::Tet => 4,
        }
    }
}

/// Name of an element type that is refused (numbers from Gmsh's `GmshDefines.h`).
pub(super) fn type_name(number: i64) -> &'static str {
    match number {
        3 => "quadrangle",
        5 => "hexahedron",
        6 => "prism",
        7 => "pyramid",
        8 => "second-order line",
        9 => "second-order triangle",
        10 | 16 => "second-order quadrangle",
        11 => "second-order tetrahedron",
        12 | 17 => "second-order hexahedron",
        13 | 18 => "second-order prism",
        14 | 19 => "second-order pyramid",
        20..=25 => "triangle of higher order",
        26..=28 => "line of higher order",
        29..=31 => "tetrahedron of higher order",
        _ => "shape unknown here",
    }
}

/// Distinct lists of physical tags. Number 0 is the empty list: unlabelled.
pub(super) struct Labels {
    lists: Vec<Vec<i32>>,
    numbers: HashMap<Vec<i32>, u32>,
    /// The tag that was alone in a list last, and that list: neighbours in a file are mostly in one group.
    last: (i32, u32),
}

impl Labels {
    fn new() -> Self {
        Self { lists: vec![Vec::new()], numbers: HashMap::from([(Vec::new(), 0)]), last: (0, 0) }
    }

    /// Number of a list of tags; a negative tag means the same group with the other orientation, 0 no group.
    pub(super) fn number(&mut self, tags: impl IntoIterator<Item = i32>) -> u32 {
        let set: BTreeSet<i32> =
            tags.into_iter().map(i32::saturating_abs).filter(|&group| group != 0).collect();
        let list: Vec<i32> = set.into_iter().collect();
        if let Some(&number) = self.numbers.get(&list) {
            return number;
        }
        let number = self.lists.len() as u32;
        self.lists.push(list.clone());
        self.numbers.insert(list, number);
        number
    }

    /// Number of the list that holds one tag.
    pub(super) fn number_of_one(&mut self, tag: i32) -> u32 {
        if self.last.0 != tag {
            self.last = (tag, self.number([tag]));
        }
        self.last.1
    }
}

/// From a node's tag to its index.
enum TagMap {
    /// Tags nearly without gaps, as Gmsh writes them: index + 1 at tag - first, 0 in the gaps.
    Dense { first: u64, table: Vec<u32> },
    /// Sparse tags in order.
    Sorted(Vec<(u64, u32)>),
}

impl TagMap {
    /// The second node of a tag that is there twice is the error.
    fn new(tags: &[u64]) -> Result<Self, usize> {
        let first = tags.iter().copied().min().unwrap_or(0);
        let last = tags.iter().copied().max().unwrap_or(0);
        let span = usize::try_from(last - first).unwrap_or(usize::MAX).saturating_add(1);
        if span <= tags.len().saturating_mul(4) {
            let mut table = vec![0; span];
            for (index, tag) in tags.iter().enumerate() {
                let slot = &mut table[(tag - first) as usize];
                if *slot != 0 {
                    return Err(index);
                }
                *slot = index as u32 + 1;
            }
            return Ok(Self::Dense { first, table });
        }
        let mut sorted: Vec<_> = tags.iter().enumerate().map(|(index, &tag)| (tag, index as u32)).collect();
        sorted.sort_unstable();
        match sorted.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            Some(pair) => Err(pair[1].1 as usize),
            None => Ok(Self::Sorted(sorted)),
        }
    }

    fn get(&self, tag: u64) -> Option<u32> {
        match self {
            Self::Dense { first, table } => {
                let slot = usize::try_from(tag.checked_sub(*first)?).ok()?;
                table.get(slot)?.checked_sub(1)
            }
            Self::Sorted(sorted) => {
                let slot = sorted.binary_search_by_key(&tag, |entry| entry.0).ok()?;
                Some(sorted[slot].1)
            }
        }
    }
}

/// A Gmsh file as far as it has been read.
pub(super) struct Builder {
    nodes: Vec<DVec3>,
    node_tags: Vec<u64>,
    /// Where each node stands, to tell the place of a duplicate.
    node_marks: Vec<usize>,
    /// `None` after nodes have been added.
    lookup: Option<TagMap>,
    triangles: Vec<Element<3>>,
    tets: Vec<Element<4>>,
    pub(super) labels: Labels,
    groups: BTreeMap<(u8, i32), Option<String>>,
    pub(super) has_nodes: bool,
    pub(super) has_elements: bool,
}

impl Builder {
    pub(super) fn new() -> Self {
        Self {
            nodes: Vec::new(),
            node_tags: Vec::new(),
            node_marks: Vec::new(),
            lookup: None,
            triangles: Vec::new(),
            tets: Vec::new(),
            labels: Labels::new(),
            groups: BTreeMap::new(),
            has_nodes: false,
            has_elements: false,
        }
    }

    pub(super) fn reserve_nodes(&mut self, count: usize) {
        self.nodes.reserve(count);
        self.node_tags.reserve(count);
        self.node_marks.reserve(count);
        self.lookup = None;
    }

    pub(super) fn add_node(&mut self, tag: u64, position: DVec3, mark: usize) {
        self.nodes.push(position);
        self.node_tags.push(tag);
        self.node_marks.push(mark);
    }

    /// A name from `$PhysicalNames`; `false` if the group has another already.
    pub(super) fn name_group(&mut self, dimension: u8, tag: i32, name: String) -> bool {
        let known = self.groups.entry((dimension, tag.saturating_abs())).or_default();
        let agrees = known.as_ref().is_none_or(|other| *other == name);
        *known = Some(name);
        agrees
    }

    /// A group that elements or entities are in, named or not.
    pub(super) fn use_group(&mut self, dimension: u8, tag: i32) {
        if tag != 0 {
            self.groups.entry((dimension, tag.saturating_abs())).or_default();
        }
    }

    /// Makes node tags resolvable; elements may be added after it.
    pub(super) fn index_nodes(&mut self, cursor: &Cursor<'_>) -> Result<(), GmshError> {
        if self.lookup.is_some() {
            return Ok(());
        }
        if u32::try_from(self.nodes.len()).is_err() {
            return Err(MeshError::TooManyNodes(self.nodes.len()).into());
        }
        let map = TagMap::new(&self.node_tags).map_err(|index| GmshError::DuplicateNode {
            at: cursor.at(self.node_marks[index]),
            node: self.node_tags[index],
        })?;
        self.lookup = Some(map);
        Ok(())
    }

    /// Takes an element; points and lines are of no use here.
    pub(super) fn add_element(
        &mut self,
        cursor: &Cursor<'_>,
        mark: usize,
        tag: u64,
        shape: Shape,
        nodes: [u64; 4],
        label: u32,
    ) -> Result<(), GmshError> {
        if matches!(shape, Shape::Point | Shape::Line) {
            return Ok(());
        }
        let mut found = [0; 4];
        for (index, &node) in found.iter_mut().zip(&nodes[..shape.node_count()]) {
            *index = self
                .lookup
                .as_ref()
                .and_then(|map| map.get(node))
                .ok_or_else(|| GmshError::UnknownNode { at: cursor.at(mark), element: tag, node })?;
        }
        let [a, b, c, _] = found;
        if shape == Shape::Triangle {
            self.triangles.push(Element { tag, nodes: [a, b, c], label });
        } else {
            self.tets.push(Element { tag, nodes: found, label });
        }
        Ok(())
    }

    pub(super) fn finish(
        mut self,
        cursor: &Cursor<'_>,
        version: FormatVersion,
        encoding: Encoding,
    ) -> Result<GmshFile, GmshError> {
        if !self.has_nodes {
            return Err(GmshError::MissingSection("Nodes"));
        }
        if !self.has_elements {
            return Err(GmshError::MissingSection("Elements"));
        }
        self.index_nodes(cursor)?;
        let Self { nodes, node_tags, mut triangles, mut tets, mut labels, groups, .. } = self;
        merge(&mut triangles, &mut labels, Repeats::Merged)?;
        let repeats = match version {
            FormatVersion::V2_2 => Repeats::OfOtherGroups,
            FormatVersion::V4_1 => Repeats::Refused,
        };
        merge(&mut tets, &mut labels, repeats)?;
        let groups = groups
            .into_iter()
            .map(|((dimension, tag), name)| PhysicalGroup { dimension, tag, name })
            .collect();
        Ok(GmshFile { version, encoding, nodes, node_tags, triangles, tets, groups, labels: labels.lists })
    }
}

/// What becomes of elements with the same nodes.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Repeats {
    /// They become one.
    Merged,
    /// They become one if each is in another group and none is turned over: format 2.2 has room for one group only,
    /// so Gmsh writes an element of two groups twice.
    OfOtherGroups,
    /// They are a defect.
    Refused,
}

/// Makes one element in the groups of all out of those with the same nodes, where that is allowed. The others keep
/// their order.
fn merge<const N: usize>(
    elements: &mut Vec<Element<N>>,
    labels: &mut Labels,
    repeats: Repeats,
) -> Result<(), GmshError> {
    let mut order: Vec<([u32; N], usize)> = elements
        .iter()
        .enumerate()
        .map(|(index, element)| {
            let mut key = element.nodes;
            key.sort_unstable();
            (key, index)
        })
        .collect();
    order.sort_unstable();
    let mut dropped = vec![false; elements.len()];
    for same in order.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() > 1) {
        let first = elements[same[0].1];
        let mut groups: BTreeSet<i32> = labels.lists[first.label as usize].iter().copied().collect();
        let is_labelled = !groups.is_empty();
        for &(_, index) in &same[1..] {
            let other = elements[index];
            let list = &labels.lists[other.label as usize];
            let is_elsewhere = is_labelled
                && !list.is_empty()
                && first.nodes == other.nodes
                && !list.iter().any(|group| groups.contains(group));
            let is_allowed = match repeats {
                Repeats::Merged => true,
                Repeats::OfOtherGroups => is_elsewhere,
                Repeats::Refused => false,
            };
            if !is_allowed {
                return Err(GmshError::DuplicateTet(first.tag, other.tag));
            }
            groups.extend(list);
            dropped[index] = true;
        }
        elements[same[0].1].label = labels.number(groups);
    }
    let mut dropped = dropped.into_iter();
    elements.retain(|_| !dropped.next().unwrap_or(false));
    Ok(())
}
