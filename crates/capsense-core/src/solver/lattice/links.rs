//! Links between nodes and objects.

use super::layout::Layout;
use crate::stiffness::StiffnessMatrix;
use std::ops::Range;

/// Links to objects that are at 1 V in some column.
#[derive(Clone, Debug, Default)]
pub(super) struct ObjectLinks {
    /// In the order of colours and places.
    links: Vec<ObjectLink>,
    /// Those of nodes that are not evaluated because their rows and planes are fixed throughout.
    of_margin: Vec<ObjectLink>,
    /// Potentials of objects: object by object, all columns.
    pub(super) potentials: Vec<f64>,
}

/// A capacitance between a node and an object.
#[derive(Clone, Copy, Debug)]
pub(super) struct ObjectLink {
    pub(super) colour: usize,
    pub(super) at: usize,
    pub(super) object: usize,
    pub(super) weight: f64,
}

impl ObjectLinks {
    /// No links, and all objects at 0 V.
    pub(super) fn new(objects: usize, columns: usize) -> Self {
        Self { potentials: vec![0.0; objects * columns], ..Self::default() }
    }

    /// Takes those links of a matrix that lead to objects that are at 1 V in some column.
    pub(super) fn collect(&mut self, layout: &Layout, matrix: &StiffnessMatrix, columns: usize) {
        self.links.clear();
        self.of_margin.clear();
        for (node, object, weight) in matrix.object_links() {
            if self.potentials[object * columns..][..columns].iter().any(|&potential| potential != 0.0) {
                let indices = layout.indices(node);
                let (colour, at) = layout.place(indices);
                let is_evaluated =
                    layout.planes().contains(&indices[2]) && layout.plane(indices[2]).contains(&at);
                let links = if is_evaluated { &mut self.links } else { &mut self.of_margin };
                links.push(ObjectLink { colour, at, object, weight });
            }
        }
        self.links.sort_by_key(|link| (link.colour, link.at));
    }

    /// Adds the energies of links to nodes of the margin, which are held at 0 V in all columns.
    pub(super) fn add_margin(&self, columns: usize, energies: &mut [f64]) {
        for link in &self.of_margin {
            let potentials = &self.potentials[link.object * columns..][..columns];
            for (s, t) in (0..columns).flat_map(|s| (0..columns).map(move |t| (s, t))) {
                energies[s * columns + t] += link.weight * potentials[s] * potentials[t];
            }
        }
    }

    /// Those of nodes of one colour at some places.
    pub(super) fn between(&self, colour: usize, places: &Range<usize>) -> &[ObjectLink] {
        if self.links.is_empty() {
            return &[];
        }
        let start = self.links.partition_point(|link| (link.colour, link.at) < (colour, places.start));
        let end = self.links.partition_point(|link| (link.colour, link.at) < (colour, places.end));
        &self.links[start..end]
    }
}
