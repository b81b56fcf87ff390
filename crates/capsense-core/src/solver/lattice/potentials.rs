//! The potentials of a lattice's nodes.

use super::layout::{Coloured, Layout};
use super::level::Level;
use super::links::ObjectLinks;
use super::precision::{Leaking, Network};
use super::stencil::Stencil;
use super::sums::Sums;
use crate::stiffness::StiffnessMatrix;

/// Potentials in one of two precisions, what K has in it besides the finest level's weights, and storage for each thread.
#[derive(Clone, Debug)]
pub(super) enum Potentials {
    Single {
        x: Coloured<f32>,
        leak: Coloured<f32>,
        sums: Vec<Sums<f32>>,
    },
    Double {
        x: Coloured<f64>,
        /// K over the nodes; what links nodes to objects is on the diagonal.
        stencil: Box<Stencil<f64>>,
        sums: Vec<Sums<f64>>,
    },
}

impl Potentials {
    /// Zeros in double precision.
    pub(super) fn double(of_nodes: Layout, layout: &Layout, slabs: usize) -> Self {
        Self::Double {
            x: layout.zeros(),
            stencil: Box::new(Stencil::new(of_nodes)),
            sums: vec![Sums::new(layout); slabs],
        }
    }

    /// Zeros in single precision.
    pub(super) fn single(of_nodes: Layout, layout: &Layout, slabs: usize) -> Self {
        Self::Single { x: layout.zeros(), leak: of_nodes.zeros(), sums: vec![Sums::new(layout); slabs] }
    }

    pub(super) fn is_single(&self) -> bool {
        matches!(self, Self::Single { .. })
    }

    pub(super) fn get(&self, colour: usize, at: usize) -> f64 {
        match self {
            Self::Single { x, .. } => f64::from(x[colour][at]),
            Self::Double { x, .. } => x[colour][at],
        }
    }

    pub(super) fn set(&mut self, colour: usize, at: usize, potential: f64) {
        match self {
            Self::Single { x, .. } => x[colour][at] = potential as f32,
            Self::Double { x, .. } => x[colour][at] = potential,
        }
    }

    pub(super) fn clear(&mut self) {
        match self {
            Self::Single { x, .. } => x.iter_mut().for_each(|values| values.fill(0.0)),
            Self::Double { x, .. } => x.iter_mut().for_each(|values| values.fill(0.0)),
        }
    }

    /// Takes over the row of a node.
    pub(super) fn refresh(&mut self, matrix: &StiffnessMatrix, node: usize, (colour, at): (usize, usize)) {
        match self {
            Self::Single { leak, .. } => leak[colour][at] = matrix.link_weight(node) as f32,
            Self::Double { stencil, .. } => {
                for axis in 0..3 {
                    stencil.next[axis][colour][at] = matrix.lattice_weight(node, axis);
                }
                stencil.centre[colour][at] = matrix.diagonal(node);
            }
        }
    }

    /// The residual of a free node in one column, with the same operations as where fields are moved.
    pub(super) fn residual(&self, finest: &Level, links: &ObjectLinks, at: NodeInColumn) -> f32 {
        match self {
            Self::Single { x, leak, .. } => {
                at.residual(Leaking { stencil: &finest.stencil, leak }, x, &finest.layout, links)
            }
            Self::Double { x, stencil, .. } => at.residual(&**stencil, x, &finest.layout, links),
        }
    }
}

/// Where a node stands.
#[derive(Clone, Copy)]
pub(super) struct NodeInColumn {
    pub(super) column: usize,
    pub(super) colour: usize,
    /// In numbers that are there once for each node, and in vectors.
    pub(super) at: usize,
    pub(super) place: usize,
}

impl NodeInColumn {
    fn residual<K: Network>(
        self,
        network: K,
        x: &Coloured<K::Value>,
        layout: &Layout,
        links: &ObjectLinks,
    ) -> f32 {
        let Self { column, colour, at, place } = self;
        let around = layout.neighbours(colour, place, 1, &x[1 - colour]);
        let mut charge = network.charge(colour, at, x[colour][place], around);
        for link in links.between(colour, &(at..at + 1)) {
            let potential = links.potentials[link.object * layout.columns + column];
            charge = K::linked(charge, link.weight, potential);
        }
        let mut rounded = [0.0];
        K::round(&mut rounded, &[charge]);
        -rounded[0]
    }
}
