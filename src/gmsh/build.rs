//! Collects what the readers of both versions find, resolves node tags, and gathers the labels of elements.

use super::cursor::{Cursor, Encoding};
use super::element_type::{ElementType, Shape};
use super::error::GmshError;
use super::repair::Parts;
use super::{Defects, Element, FormatVersion, GmshFile, PhysicalGroup};
use capsense_core::mesh::MeshError;
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet, HashMap};

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

    /// The tags of a number.
    pub(super) fn list(&self, number: u32) -> &[i32] {
        self.lists.get(number as usize).map_or(&[], Vec::as_slice)
    }

    /// Number of the list that holds one tag.
    pub(super) fn number_of_one(&mut self, tag: i32) -> u32 {
        if self.last.0 != tag {
            self.last = (tag, self.number([tag]));
        }
        self.last.1
    }
}

/// An element before its nodes.
#[derive(Clone, Copy)]
pub(super) struct ElementHead {
    /// Where it stands.
    pub(super) mark: usize,
    pub(super) tag: u64,
    pub(super) kind: ElementType,
    pub(super) label: u32,
}

/// From a node's tag to its index.
enum TagMap {
    /// Tags nearly without gaps, as Gmsh writes them: index + 1 at tag - first, 0 in the gaps.
    Dense { first: u64, table: Vec<u32> },
    /// Sparse tags in order.
    Sorted(Vec<(u64, u32)>),
}

impl TagMap {
    /// Of nodes with one tag it leads to the first; also gives each other one behind it.
    fn new(tags: &[u64]) -> (Self, Vec<[u32; 2]>) {
        let first = tags.iter().copied().min().unwrap_or(0);
        let last = tags.iter().copied().max().unwrap_or(0);
        let span = usize::try_from(last - first).unwrap_or(usize::MAX).saturating_add(1);
        let mut repeated = Vec::new();
        if span <= tags.len().saturating_mul(4) {
            let mut table: Vec<u32> = vec![0; span];
            for (tag, index) in tags.iter().zip(0..) {
                let slot = &mut table[(tag - first) as usize];
                match slot.checked_sub(1) {
                    Some(before) => repeated.push([before, index]),
                    None => *slot = index + 1,
                }
            }
            return (Self::Dense { first, table }, repeated);
        }
        let mut sorted: Vec<(u64, u32)> = tags.iter().copied().zip(0..).collect();
        sorted.sort_unstable();
        sorted.dedup_by(|later, before| {
            let is_repeated = later.0 == before.0;
            if is_repeated {
                repeated.push([before.1, later.1]);
            }
            is_repeated
        });
        (Self::Sorted(sorted), repeated)
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
    /// Where each tetrahedron stands.
    tet_marks: Vec<usize>,
    /// Whether a node lies between corners; empty before the first element of higher order.
    is_between: Vec<bool>,
    pub(super) defects: Defects,
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
            tet_marks: Vec::new(),
            is_between: Vec::new(),
            defects: Defects::default(),
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
        let (map, repeated) = TagMap::new(&self.node_tags);
        // What is said twice alike is no contradiction; both are in one place, where nodes are joined later.
        for [first, again] in repeated.into_iter().map(|pair| pair.map(|index| index as usize)) {
            if self.nodes[first] != self.nodes[again] {
                return Err(GmshError::DuplicateNode {
                    at: cursor.at(self.node_marks[again]),
                    node: self.node_tags[again],
                });
            }
        }
        self.lookup = Some(map);
        Ok(())
    }

    fn find(&self, cursor: &Cursor<'_>, head: ElementHead, node: u64) -> Result<u32, GmshError> {
        self.lookup.as_ref().and_then(|map| map.get(node)).ok_or_else(|| GmshError::UnknownNode {
            at: cursor.at(head.mark),
            element: head.tag,
            node,
        })
    }

    /// Reads the nodes of an element and takes it; points and lines are of no use here.
    pub(super) fn read_element<'a>(
        &mut self,
        cursor: &mut Cursor<'a>,
        head: ElementHead,
        read: fn(&mut Cursor<'a>, &'static str) -> Result<u64, GmshError>,
    ) -> Result<(), GmshError> {
        let ElementHead { mark, tag, kind, label } = head;
        let is_taken = matches!(kind.shape, Shape::Triangle | Shape::Tet);
        let mut corners = [0; 4];
        for at in 0..kind.nodes {
            let node = read(cursor, "a node of an element")?;
            if !is_taken {
                continue;
            }
            let index = self.find(cursor, head, node)?;
            match corners[..kind.shape.corners()].get_mut(at) {
                Some(corner) => *corner = index,
                None => {
                    self.is_between.resize(self.nodes.len(), false);
                    self.is_between[index as usize] = true;
                }
            }
        }
        if !is_taken {
            return Ok(());
        }
        if kind.is_of_higher_order() {
            self.defects.higher_order.add(tag);
        }
        let [a, b, c, _] = corners;
        if kind.shape == Shape::Triangle {
            self.triangles.push(Element { tag, nodes: [a, b, c], label });
        } else {
            self.tets.push(Element { tag, nodes: corners, label });
            self.tet_marks.push(mark);
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
        let mut parts = Parts {
            nodes: self.nodes,
            node_tags: self.node_tags,
            is_between: self.is_between,
            triangles: self.triangles,
            tets: self.tets,
            tet_marks: self.tet_marks,
            labels: self.labels,
            defects: self.defects,
        };
        parts.mend(cursor, version)?;
        let group = |((dimension, tag), name)| PhysicalGroup { dimension, tag, name };
        let groups = self.groups.into_iter().map(group).collect();
        let Parts { nodes, node_tags, triangles, tets, labels, defects, .. } = parts;
        let labels = labels.lists;
        Ok(GmshFile { version, encoding, nodes, node_tags, triangles, tets, groups, defects, labels })
    }
}
