//! How little the links of nodes may be together, as far as elements with obtuse angles tell ([`super::obtuse`]): kept for each
//! element from frame to frame, and computed once where something changed, not once for each node.

use super::obtuse::{Corner, EndsIn, ObtuseElements};
use crate::few::Few;
use crate::occupancy::index_set::IndexList;
use crate::workers::Workers;

/// Elements that a thread takes at a time.
const ELEMENTS_OF_A_TASK: usize = 64;

/// What the links of an element's corners must be at least, edges to nodes that conductors hold among them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ElementLinks {
    /// What its edges end in.
    pub(super) ends_in: EndsIn,
    /// With which it is positive semidefinite for certain.
    pub(super) certain: [f64; 4],
    /// With which it is if all lead to the one conductor that its edges end in; what is certain where that is not one.
    pub(super) least: [f64; 4],
}

impl ElementLinks {
    pub(super) const NONE: Self = Self { ends_in: EndsIn::Nothing, certain: [0.0; 4], least: [0.0; 4] };

    /// Those of a corner, if what is added or missing there leads to an object.
    fn of_corner(&self, corner: usize, object: u16) -> f64 {
        match self.ends_in {
            EndsIn::One(conductor) if conductor != object => self.least[corner].max(self.certain[corner]),
            _ => self.least[corner],
        }
    }
}

/// That of all elements.
#[derive(Clone, Debug)]
pub(super) struct LeastLinks {
    /// Of those of which edges end in a conductor.
    of_elements: Few<ElementLinks>,
    /// Elements to be looked at again in this frame, and what was found.
    pending: IndexList,
    found: Vec<ElementLinks>,
}

impl LeastLinks {
    /// None, of so many elements.
    pub(super) fn new(elements: usize) -> Self {
        Self {
            of_elements: Few::of(elements, ElementLinks::NONE),
            pending: IndexList::below(elements),
            found: Vec::new(),
        }
    }

    /// Notes that something changed at an edge.
    pub(super) fn look_at(&mut self, obtuse: &ObtuseElements, edge: usize) {
        obtuse.at_edge(edge).iter().for_each(|&element| self.pending.insert(element as usize));
    }

    /// Takes what `links` tells of the elements where something changed, which threads share, and visits their nodes, some several
    /// times.
    pub(super) fn update(
        &mut self,
        workers: &Workers,
        obtuse: &ObtuseElements,
        links: impl Fn(u32) -> ElementLinks + Sync,
        mut visit: impl FnMut(usize),
    ) {
        let Self { of_elements, pending, found } = self;
        let elements = pending.numbers();
        found.resize(elements.len(), ElementLinks::NONE);
        let tasks = elements.chunks(ELEMENTS_OF_A_TASK).zip(found.chunks_mut(ELEMENTS_OF_A_TASK));
        workers.for_each(tasks, |(elements, found)| {
            found.iter_mut().zip(elements).for_each(|(found, &element)| *found = links(element));
        });
        for (&element, found) in elements.iter().zip(&*found) {
            let is_cut = found.ends_in != EndsIn::Nothing;
            of_elements.set(element as usize, is_cut.then_some(*found));
            obtuse.nodes(element).into_iter().for_each(|node| visit(node as usize));
        }
        pending.clear();
    }

    /// What the links of a free node must be together at least, if what is added or missing there leads to an object; `scale` tells by
    /// what each element's weights are multiplied.
    pub(super) fn of_node(
        &self,
        obtuse: &ObtuseElements,
        (node, object): (usize, u16),
        scale: impl Fn(usize) -> f64,
    ) -> f64 {
        let links = |corner: &Corner| {
            let links = self.of_elements.own(corner.element())?;
            Some(scale(corner.element()) * links.of_corner(corner.number(), object))
        };
        obtuse.at_node(node).iter().filter_map(links).sum()
    }
}
