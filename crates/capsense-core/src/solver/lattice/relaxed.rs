//! How nodes were relaxed since the fields took a step: a part of the change that ends with the next one.
//!
//! Without it the change that is followed (`increment`) has holes beside the surfaces that move, and where it leads to is wrong
//! there: of the frames of a bar that comes closer, 1.5 million tetrahedra, 56 of 100 then do without a step instead of 66.

use super::charges::Place;
use super::groups::{GROUP, Group};
use super::layout::{Coloured, Layout};
use super::stencil::Stencil;
use glam::Vec4;

/// Of as many as one in so many of all nodes it is kept by how much they were relaxed. What is beyond them the change lacks.
const FEW: usize = 3;

/// A change of which less than this part is kept keeps nothing of what nodes were relaxed by.
const LEAST_KEPT: f32 = 1e-3;

/// Nodes that were relaxed since the last step, each as often as it was.
#[derive(Clone, Debug)]
pub(super) struct RelaxedNodes {
    nodes: Vec<Relaxed>,
    most: usize,
    groups: Vec<Group>,
}

/// By how much the potential of a node changed in a group of columns.
#[derive(Clone, Copy, Debug)]
struct Relaxed {
    /// Its [`Place`].
    at: u32,
    first: u32,
    colour: u16,
    group: u16,
    by: [f32; GROUP],
}

/// Fields, the change that is followed and its charges, and what they are worked on with.
pub(super) struct Followed<'a> {
    pub(super) of_nodes: &'a Layout,
    pub(super) layout: &'a Layout,
    pub(super) stencil: &'a Stencil<f32>,
    /// What each column's change is multiplied with when the step is added to it, and the fields move by.
    pub(super) kept: &'a [f32],
    pub(super) fields: &'a mut Coloured<f32>,
    pub(super) change: &'a mut Coloured<f32>,
    pub(super) charges: &'a mut Coloured<f32>,
}

impl RelaxedNodes {
    /// None yet, of vectors with such a layout.
    pub(super) fn new(layout: &Layout) -> Self {
        let groups = Group::all(layout);
        let most = layout.counts.into_iter().product::<usize>() * groups.len() / FEW;
        Self { nodes: Vec::new(), most, groups }
    }

    /// Notes that a node was relaxed, in a group of columns.
    #[inline]
    pub(super) fn note(&mut self, Place { colour, at, first }: Place, group: usize, by: Vec4) {
        if self.nodes.len() < self.most {
            let (at, first, by) = (at as u32, first as u32, by.to_array());
            self.nodes.push(Relaxed { at, first, colour: colour as u16, group: group as u16, by });
        }
    }

    /// Forgets them.
    pub(super) fn clear(&mut self) {
        self.nodes.clear();
    }

    /// Takes from the fields what nodes were relaxed by and gives it to the change, which takes the fields there again.
    pub(super) fn hand_over(&mut self, followed: Followed<'_>) {
        let Followed { of_nodes, layout, stencil, kept, fields, change, charges } = followed;
        for Relaxed { at, first, colour, group, by } in self.nodes.drain(..) {
            let (at, first, colour) = (at as usize, first as usize, usize::from(colour));
            let (inverse, other) = (stencil.centre[colour][at], 1 - colour);
            if inverse == 0.0 {
                // A conductor holds it by now.
                continue;
            }
            let (nodes, around) = (of_nodes.around(colour, at), layout.around(colour, first));
            let mut weights = stencil.weights(colour, at);
            for (weight, node) in weights.iter_mut().zip(nodes) {
                // Charges of nodes that are held are none of those that are followed.
                *weight = if stencil.centre[other][node] == 0.0 { 0.0 } else { *weight };
            }
            for (column, by) in self.groups[usize::from(group)].columns().zip(by) {
                if kept[column].abs() < LEAST_KEPT {
                    continue;
                }
                let (shift, part) = (layout.in_column(column, 0), by / kept[column]);
                fields[colour][first + shift] -= by;
                change[colour][first + shift] += part;
                charges[colour][first + shift] += part / inverse;
                for (node, weight) in around.into_iter().zip(weights) {
                    charges[other][node + shift] -= weight * part;
                }
            }
        }
    }
}
