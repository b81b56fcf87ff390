//! Negative weights of unstructured meshes in dielectrics.
//!
//! The weight of an edge is the sum of what the elements around it weigh along it, and opposite of an obtuse angle that is
//! negative. The edge rule scales capacitors, and there is no capacitor of negative weight. But left as they are, such
//! weights would be those of air inside of a body too, which then has another permittivity than its own, by percents that
//! no refinement takes away (measured in `docs/interface.md`). So each element scales its negative weights by the smallest
//! factor f of its edges: inside of a body that is what it is for the others, and as K_e is positive semidefinite without
//! objects, and only positive weights are scaled by more than f, what the element becomes is no less than f K_e. The
//! smallest of continuous factors is continuous. Next to conductors factors count as 1.
//!
//! Where an edge meets two conductors, what there is between these two is not part of the network: links end at whichever
//! conductor comes first. Nothing makes up for negative weights of the elements there any more, and the field of one
//! conductor could have a negative energy; so factors of such edges are 0, which leaves the elements without them.

use super::super::Coupling;
use super::super::elements::{Lists, NO_EDGE};
use super::obtuse::ObtuseElements;
use super::{HeldEdge, is_conducting};
use crate::mesh::{CANCELLED, EdgeShare, TetMesh};

/// Negative weights of elements, and what the edge rule makes of edges.
#[derive(Clone, Debug)]
pub(super) struct NegativeWeights {
    /// The elements that weigh less than nothing along each edge, with these weights, and the sum of the weights of all
    /// others.
    negative: Lists<(u32, f64)>,
    positive: Vec<f64>,
    /// The weight of each edge without objects.
    reference: Vec<f64>,
    /// By what factor the edge rule scales the weight of each edge: 1 where a conductor is on it, 0 where two are.
    factor: Vec<f64>,
    /// The smallest factor of each element's edges.
    smallest: Vec<f64>,
    /// Elements to be looked at again in this frame, some of them several times.
    elements: Vec<u32>,
}

impl NegativeWeights {
    /// Takes the weights of all elements along their edges, of which there are `count`; `obtuse` are those with negative
    /// ones.
    pub(super) fn new(
        mesh: &TetMesh,
        of_elements: &[[u32; 6]],
        count: usize,
        obtuse: &ObtuseElements,
    ) -> Self {
        let (mut positive, mut magnitude, mut reference) =
            (vec![0.0; count], vec![0.0; count], vec![0.0; count]);
        let mut negative = Vec::new();
        let mut number = 0;
        for (element, (nodes, &edges)) in mesh.tets().iter().zip(of_elements).enumerate() {
            let background = mesh.relative_permittivity().at(element);
            let shares = EdgeShare::of_element(mesh.corners(element)).zip(edges);
            for (share, edge) in shares.filter(|(_, edge)| *edge != NO_EDGE) {
                let (edge, weight) = (edge as usize, background * share.weight);
                reference[edge] += weight;
                magnitude[edge] += background * share.magnitude;
                if share.counts() && weight < 0.0 {
                    negative.push((edge, (number as u32, weight)));
                } else {
                    positive[edge] += weight;
                }
            }
            number += usize::from(obtuse.is(number, nodes));
        }
        for (reference, magnitude) in reference.iter_mut().zip(magnitude) {
            // As the network has it: such an edge weighs too little to matter, but not nothing.
            if f64::abs(*reference) <= CANCELLED * magnitude {
                *reference = CANCELLED * magnitude;
            }
        }
        Self {
            smallest: vec![1.0; obtuse.len()],
            negative: Lists::new(count, negative.into_iter()),
            positive,
            reference,
            factor: vec![1.0; count],
            elements: Vec::new(),
        }
    }

    /// Takes what the edge rule makes of an edge.
    pub(super) fn take(&mut self, obtuse: &ObtuseElements, held: HeldEdge, rule: &Coupling) {
        let elements = obtuse.at_edge(held.edge);
        if elements.is_empty() {
            return;
        }
        let factor = match is_conducting(rule, held.owners) {
            true if rule.meets_two(held.owners) => 0.0,
            true => 1.0,
            false => rule.through,
        };
        if std::mem::replace(&mut self.factor[held.edge], factor).to_bits() != factor.to_bits() {
            self.elements.extend(elements);
        }
    }

    /// By what an element multiplies its negative weights, and the others at least.
    pub(super) fn smallest(&self, element: usize) -> f64 {
        self.smallest[element]
    }

    /// What multiplies an edge's positive weights by the edge rule.
    pub(super) fn factor(&self, edge: usize) -> f64 {
        self.factor[edge]
    }

    /// Finds the smallest factors anew of elements at edges that changed, and tells which edges feel it.
    pub(super) fn update_elements(&mut self, obtuse: &ObtuseElements, mut feels: impl FnMut(usize)) {
        self.elements.sort_unstable();
        self.elements.dedup();
        for &element in &self.elements {
            let smallest = obtuse.edges(element).map(|edge| self.factor[edge]).fold(f64::INFINITY, f64::min);
            let before = std::mem::replace(&mut self.smallest[element as usize], smallest);
            if before.to_bits() != smallest.to_bits() {
                obtuse.edges(element).for_each(&mut feels);
            }
        }
        self.elements.clear();
    }

    /// What multiplies the weight of an edge, which a conductor then may cut.
    pub(super) fn part(&self, held: HeldEdge, rule: &Coupling) -> f64 {
        let through = if is_conducting(rule, held.owners) { 1.0 } else { rule.through };
        let negative = self.negative.of(held.edge);
        let (mut sum, mut is_plain) = (through * self.positive[held.edge], through == 1.0);
        for &(element, weight) in negative {
            let factor = self.smallest[element as usize];
            is_plain &= factor == 1.0;
            sum += factor * weight;
        }
        match negative.is_empty() || is_plain {
            true => through,
            // Not the negative zero.
            false => sum / self.reference[held.edge] + 0.0,
        }
    }
}
