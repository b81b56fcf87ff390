//! The potentials of a lattice's nodes.

use super::groups::Group;
use super::layout::{Coloured, Layout};
use super::stencil::Stencil;
use super::sums::Sums;
use crate::stiffness::StiffnessMatrix;
use glam::{DVec4, Vec4};

/// Potentials in one of two precisions, what K has in it besides the finest level's weights, and storage for each thread.
/// `leak` holds for each node the weight of its links.
#[derive(Clone, Debug)]
pub(super) enum Potentials {
    Single {
        x: Coloured<f32>,
        leak: Coloured<f32>,
        sums: Vec<Sums<f32>>,
    },
    Double {
        x: Coloured<f64>,
        leak: Coloured<f32>,
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
            leak: of_nodes.zeros(),
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

    /// Those of a node in a group of columns, in single precision.
    #[inline(always)]
    pub(super) fn gather(&self, group: &Group, colour: usize, first: usize) -> Vec4 {
        match self {
            Self::Single { x, .. } => Vec4::from_array(group.gather(&x[colour], first)),
            Self::Double { x, .. } => DVec4::from_array(group.gather(&x[colour], first)).as_vec4(),
        }
    }

    /// Sets those of a node in a group of columns; what is in double precision is more by so much instead.
    #[inline(always)]
    pub(super) fn move_to(&mut self, group: &Group, colour: usize, first: usize, values: Vec4) {
        match self {
            Self::Single { x, .. } => group.scatter(&mut x[colour], first, values),
            Self::Double { x, .. } => {
                for (place, value) in group.places(first).zip(values.to_array()) {
                    x[colour][place] += f64::from(value);
                }
            }
        }
    }

    /// The weight of the links of each node.
    pub(super) fn leak(&self) -> &Coloured<f32> {
        let (Self::Single { leak, .. } | Self::Double { leak, .. }) = self;
        leak
    }

    pub(super) fn clear(&mut self) {
        match self {
            Self::Single { x, .. } => x.iter_mut().for_each(|values| values.fill(0.0)),
            Self::Double { x, .. } => x.iter_mut().for_each(|values| values.fill(0.0)),
        }
    }

    /// Takes over the row of a node.
    #[inline]
    pub(super) fn refresh(&mut self, matrix: &StiffnessMatrix, node: usize, (colour, at): (usize, usize)) {
        let (Self::Single { leak, .. } | Self::Double { leak, .. }) = &mut *self;
        leak[colour][at] = matrix.link_weight(node) as f32;
        if let Self::Double { stencil, .. } = self {
            for axis in 0..3 {
                stencil.next[axis][colour][at] = matrix.lattice_weight(node, axis);
            }
            stencil.centre[colour][at] = matrix.diagonal(node);
        }
    }
}
