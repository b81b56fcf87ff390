//! Links between nodes and objects.

use super::charges::Place;
use super::layout::{BLACK, Layout, RED};
use super::precision::Network;
use crate::stiffness::StiffnessMatrix;
use std::ops::Range;

/// Links to objects that are at 1 V in some column.
#[derive(Clone, Debug, Default)]
pub(super) struct ObjectLinks {
    /// In the order of colours and places.
    links: Vec<ObjectLink>,
    /// For each colour the places from the first to behind the last: most nodes are far from them.
    extents: [Range<usize>; 2],
    /// Potentials of objects: object by object, all columns.
    pub(super) potentials: Vec<f64>,
}

/// A capacitance between a node and an object.
#[derive(Clone, Copy, Debug)]
pub(super) struct ObjectLink {
    pub(super) colour: usize,
    /// Where the node is in numbers that are there once for each node, and in the first column of vectors.
    pub(super) at: usize,
    pub(super) place: usize,
    pub(super) object: usize,
    pub(super) weight: f64,
}

impl ObjectLinks {
    /// No links, and all objects at 0 V.
    pub(super) fn new(objects: usize, columns: usize) -> Self {
        Self { potentials: vec![0.0; objects * columns], ..Self::default() }
    }

    /// Takes those links of a matrix that lead to objects that are at 1 V in some column. Layouts are those of numbers which
    /// are there once for each node, and of vectors.
    pub(super) fn collect(&mut self, of_nodes: &Layout, layout: &Layout, matrix: &StiffnessMatrix) {
        self.links.clear();
        self.extents = [0..0, 0..0];
        if self.potentials.iter().all(|&potential| potential == 0.0) {
            return;
        }
        for (node, body_row, weight) in matrix.links() {
            let object = body_row - matrix.nodes();
            let potentials = &self.potentials[object * layout.columns..][..layout.columns];
            if potentials.iter().any(|&potential| potential != 0.0) {
                let indices = of_nodes.indices(node);
                let ((colour, at), (_, place)) = (of_nodes.place(indices), layout.place(indices));
                self.links.push(ObjectLink { colour, at, place, object, weight });
            }
        }
        self.links.sort_by_key(|link| (link.colour, link.at));
        self.extents = [RED, BLACK].map(|colour| {
            let of_colour = || self.links.iter().filter(|link| link.colour == colour).map(|link| link.at);
            of_colour().min().zip(of_colour().max()).map_or(0..0, |(first, last)| first..last + 1)
        });
    }

    pub(super) fn all(&self) -> &[ObjectLink] {
        &self.links
    }

    /// What those of a node take from its charge in a column.
    pub(super) fn seen_from<K: Network>(
        &self,
        columns: usize,
        Place { colour, at, .. }: Place,
    ) -> impl Fn(usize, K::Value) -> K::Value {
        let links = self.between(colour, &(at..at + 1));
        move |column, charge| {
            links.iter().fold(charge, |charge, link| {
                K::linked(charge, link.weight, self.potentials[link.object * columns + column])
            })
        }
    }

    /// Σ weight times potential over the links of a node, in a column.
    pub(super) fn pull(&self, column: usize, columns: usize, Place { colour, at, .. }: Place) -> f64 {
        let links = self.between(colour, &(at..at + 1));
        links.iter().map(|link| link.weight * self.potentials[link.object * columns + column]).sum()
    }

    /// Those of nodes of one colour at some places.
    pub(super) fn between(&self, colour: usize, places: &Range<usize>) -> &[ObjectLink] {
        let extent = &self.extents[colour];
        if places.start >= extent.end || places.end <= extent.start {
            return &[];
        }
        let start = self.links.partition_point(|link| (link.colour, link.at) < (colour, places.start));
        let end = self.links.partition_point(|link| (link.colour, link.at) < (colour, places.end));
        &self.links[start..end]
    }
}
