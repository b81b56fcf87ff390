//! Mends what can be mended about the mesh of a file: nodes that lie in one place, elements that collapsed, are turned
//! over or stand there twice, nodes without elements.

use super::build::Labels;
use super::cursor::Cursor;
use super::error::GmshError;
use super::{Defects, Element, FormatVersion};
use capsense_core::geometry::Aabb;
use capsense_core::mesh::{Orientation, orientation};
use glam::DVec3;
use std::collections::BTreeSet;

/// Nodes closer to each other than this part of the mesh's largest extent are in one place.
const SAME_PLACE: f64 = 1e-9;

/// A direction along which the nodes of no usual mesh lie in planes.
const SKEWED: DVec3 = DVec3::new(0.618_033_988_749_894_9, 0.551_912_318_437_065, 0.559_838_732_916_409);

/// The mesh of a file, indices for node tags.
pub(super) struct Parts {
    pub(super) nodes: Vec<DVec3>,
    pub(super) node_tags: Vec<u64>,
    /// Whether a node lies between the corners of elements of higher order; empty if no node does.
    pub(super) is_between: Vec<bool>,
    pub(super) triangles: Vec<Element<3>>,
    pub(super) tets: Vec<Element<4>>,
    /// Where each tetrahedron stands in the file.
    pub(super) tet_marks: Vec<usize>,
    pub(super) labels: Labels,
    pub(super) defects: Defects,
}

impl Parts {
    /// Mends everything.
    ///
    /// # Errors
    /// When a tetrahedron has no volume.
    pub(super) fn mend(&mut self, cursor: &Cursor<'_>, version: FormatVersion) -> Result<(), GmshError> {
        let joined = self.join_nodes();
        self.drop_collapsed();
        self.turn_over(cursor)?;
        merge(&mut self.triangles, &mut self.labels, |_, _| ());
        let repeated = &mut self.defects.repeated_tets;
        merge(&mut self.tets, &mut self.labels, |tag, is_in_other_group| {
            // Format 2.2 has room for one group only, so Gmsh writes an element of two groups twice.
            if version == FormatVersion::V4_1 || !is_in_other_group {
                repeated.add(tag);
            }
        });
        if !self.tets.is_empty() {
            self.drop_unused(&joined);
        }
        Ok(())
    }

    /// Gives the elements of nodes in one place to the first of them; says which nodes lost theirs.
    fn join_nodes(&mut self) -> Vec<bool> {
        // A node far off that nothing uses must not make all others one.
        let corners = self.tets.iter().flat_map(|tet| tet.nodes.map(|node| self.nodes[node as usize]));
        let extent = Aabb::around(corners).size().max_element().max(0.0);
        let near = SAME_PLACE * extent;
        let mut along: Vec<(f64, u32)> = self.nodes.iter().map(|node| node.dot(SKEWED)).zip(0..).collect();
        along.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut first: Vec<u32> = (0..self.nodes.len() as u32).collect();
        for (at, &(place, node)) in along.iter().enumerate() {
            let beside = along[at + 1..].iter().take_while(|other| other.0 - place <= near);
            for &(_, other) in beside {
                if self.nodes[node as usize].distance(self.nodes[other as usize]) <= near {
                    let (a, b) = (root(&first, node), root(&first, other));
                    first[a.max(b) as usize] = a.min(b);
                }
            }
        }
        let mut joined = vec![false; self.nodes.len()];
        for node in 0..first.len() {
            first[node] = root(&first, node as u32);
            if first[node] as usize != node {
                joined[node] = true;
                self.defects.joined_nodes.add(self.node_tags[node]);
            }
        }
        if self.defects.joined_nodes.count > 0 {
            renumber(&mut self.triangles, &first);
            renumber(&mut self.tets, &first);
        }
        joined
    }

    fn drop_collapsed(&mut self) {
        let collapsed = &mut self.defects.collapsed;
        self.triangles.retain(|triangle| {
            let stays = !has_node_twice(triangle.nodes);
            if !stays {
                collapsed.add(triangle.tag);
            }
            stays
        });
        let mut stays: Vec<bool> = Vec::with_capacity(self.tets.len());
        for tet in &self.tets {
            stays.push(!has_node_twice(tet.nodes));
            if stays.last() == Some(&false) {
                collapsed.add(tet.tag);
            }
        }
        keep(&mut self.tets, &stays);
        keep(&mut self.tet_marks, &stays);
    }

    fn turn_over(&mut self, cursor: &Cursor<'_>) -> Result<(), GmshError> {
        for (tet, &mark) in self.tets.iter_mut().zip(&self.tet_marks) {
            let corners = tet.nodes.map(|node| self.nodes[node as usize]);
            match orientation(corners) {
                Orientation::Positive => {}
                Orientation::Inverted => {
                    tet.nodes.swap(2, 3);
                    self.defects.inverted.add(tet.tag);
                }
                Orientation::Flat => {
                    return Err(GmshError::Flat {
                        at: cursor.at(mark),
                        element: tet.tag,
                        centre: corners.iter().sum::<DVec3>() / 4.0,
                    });
                }
            }
        }
        Ok(())
    }

    /// Drops nodes in no tetrahedron and the triangles at them.
    fn drop_unused(&mut self, joined: &[bool]) {
        let mut is_used = vec![false; self.nodes.len()];
        for &node in self.tets.iter().flat_map(|tet| &tet.nodes) {
            is_used[node as usize] = true;
        }
        let is_between = |node: usize| self.is_between.get(node).copied().unwrap_or(false);
        for node in (0..is_used.len()).filter(|&node| !is_used[node] && !joined[node] && !is_between(node)) {
            self.defects.unused_nodes.add(self.node_tags[node]);
        }
        if !is_used.contains(&false) {
            return;
        }
        let detached = &mut self.defects.detached_triangles;
        self.triangles.retain(|triangle| {
            let stays = triangle.nodes.iter().all(|&node| is_used[node as usize]);
            if !stays && triangle.label != 0 {
                detached.push(triangle.tag);
            }
            stays
        });
        detached.sort_unstable();
        let mut next = 0;
        let place: Vec<u32> = is_used
            .iter()
            .map(|&is_used| {
                next += u32::from(is_used);
                next.wrapping_sub(1)
            })
            .collect();
        keep(&mut self.nodes, &is_used);
        keep(&mut self.node_tags, &is_used);
        renumber(&mut self.triangles, &place);
        renumber(&mut self.tets, &place);
    }
}

/// Follows nodes to the first of those that are joined; each leads to a smaller one or to itself.
fn root(first: &[u32], mut node: u32) -> u32 {
    while first[node as usize] != node {
        node = first[node as usize];
    }
    node
}

fn has_node_twice<const N: usize>(nodes: [u32; N]) -> bool {
    (0..N).any(|k| nodes[..k].contains(&nodes[k]))
}

fn renumber<const N: usize>(elements: &mut [Element<N>], place: &[u32]) {
    for node in elements.iter_mut().flat_map(|element| &mut element.nodes) {
        *node = place[*node as usize];
    }
}

fn keep<T>(values: &mut Vec<T>, stays: &[bool]) {
    let mut stays = stays.iter().copied();
    values.retain(|_| stays.next().unwrap_or(false));
}

/// Makes one element in the groups of all out of those with the same nodes; the others keep their order. `dropped` is
/// called with the tag of each element that goes, and whether it is in groups that none before it is in.
fn merge<const N: usize>(
    elements: &mut Vec<Element<N>>,
    labels: &mut Labels,
    mut dropped: impl FnMut(u64, bool),
) {
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
    let mut stays = vec![true; elements.len()];
    for same in order.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() > 1) {
        let mut groups: BTreeSet<i32> = labels.list(elements[same[0].1].label).iter().copied().collect();
        for &(_, index) in &same[1..] {
            let list = labels.list(elements[index].label);
            let is_elsewhere =
                !groups.is_empty() && !list.is_empty() && !list.iter().any(|group| groups.contains(group));
            groups.extend(list);
            dropped(elements[index].tag, is_elsewhere);
            stays[index] = false;
        }
        elements[same[0].1].label = labels.number(groups);
    }
    keep(elements, &stays);
}
