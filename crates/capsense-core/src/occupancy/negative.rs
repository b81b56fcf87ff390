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

use super::elements::{Lists, NO_EDGE, edges_of};
use super::{Coupling, NO_OBJECT, Occupancy};
use crate::mesh::{CANCELLED, EdgeShare, Edges, TetMesh};

/// Elements with negative weights, and what the edge rule makes of their edges.
#[derive(Clone, Debug)]
pub(super) struct NegativeWeights {
    /// The edges of each such element.
    edges: Vec<[u32; 6]>,
    /// The elements at each edge; those that weigh less than nothing along it, with these weights, and the sum of the
    /// weights of all others.
    at_edge: Lists<u32>,
    negative: Lists<(u32, f64)>,
    positive: Vec<f64>,
    /// The weight of each edge without objects.
    reference: Vec<f64>,
    /// What the edge rule makes of each edge, and by what factor it scales weights: 1 where a conductor is on it, 0 where two
    /// are.
    rule: Vec<Coupling>,
    factor: Vec<f64>,
    /// The smallest factor of each element's edges.
    smallest: Vec<f64>,
    /// Edges to be looked at again in this frame, some of them several times, and elements that were.
    pending: Vec<u32>,
    elements: Vec<u32>,
    edge_seen: Vec<u8>,
}

impl NegativeWeights {
    /// Finds the elements with negative weights; `None` if there are none.
    pub(super) fn new(mesh: &TetMesh, edges: &Edges) -> Option<Self> {
        let count = edges.len();
        let (mut positive, mut magnitude) = (vec![0.0; count], vec![0.0; count]);
        let (mut of_elements, mut all, mut negative) = (Vec::new(), Vec::new(), Vec::new());
        let mut reference = vec![0.0; count];
        for (element, &tet) in mesh.tets().iter().enumerate() {
            let background = mesh.relative_permittivity().at(element);
            let edges = edges_of(tet, edges);
            let shares = EdgeShare::of_element(mesh.corners(element)).zip(edges);
            let existing = shares.filter(|(_, edge)| *edge != NO_EDGE);
            let number = of_elements.len() as u32;
            let negative_before = negative.len();
            for (share, edge) in existing.clone() {
                let (edge, weight) = (edge as usize, background * share.weight);
                reference[edge] += weight;
                magnitude[edge] += background * share.magnitude;
                if share.counts() && weight < 0.0 {
                    negative.push((edge, (number, weight)));
                } else {
                    positive[edge] += weight;
                }
            }
            if negative.len() > negative_before {
                of_elements.push(edges);
                all.extend(existing.map(|(_, edge)| (edge as usize, number)));
            }
        }
        for (reference, magnitude) in reference.iter_mut().zip(magnitude) {
            // As the network has it: such an edge weighs too little to matter, but not nothing.
            if f64::abs(*reference) <= CANCELLED * magnitude {
                *reference = CANCELLED * magnitude;
            }
        }
        (!of_elements.is_empty()).then(|| Self {
            smallest: vec![1.0; of_elements.len()],
            edges: of_elements,
            at_edge: Lists::new(count, all.into_iter()),
            negative: Lists::new(count, negative.into_iter()),
            positive,
            reference,
            rule: vec![Coupling::PLAIN; count],
            factor: vec![1.0; count],
            pending: Vec::new(),
            elements: Vec::new(),
            edge_seen: vec![0; count],
        })
    }

    /// Whether what becomes of an edge is told by [`Occupancy::update_negative`].
    pub(super) fn concern(&self, edge: usize) -> bool {
        !self.at_edge.of(edge).is_empty()
    }

    /// Takes what the edge rule makes of an edge with these owners of its ends.
    pub(super) fn take(&mut self, edge: usize, owners: [u16; 2], rule: Coupling) {
        let factor = match is_conducting(&rule, owners) {
            true if rule.meets_two(owners) => 0.0,
            true => 1.0,
            false => rule.through,
        };
        self.rule[edge] = rule;
        self.pending.push(edge as u32);
        if std::mem::replace(&mut self.factor[edge], factor).to_bits() != factor.to_bits() {
            self.elements.extend(self.at_edge.of(edge));
        }
    }

    /// What multiplies an edge's positive weights by the edge rule.
    pub(super) fn factor(&self, edge: usize) -> f64 {
        self.factor[edge]
    }

    /// Frames are numbered from one again.
    pub(super) fn forget_frames(&mut self) {
        self.edge_seen.fill(0);
    }

    /// Finds the smallest factors anew of elements at edges that changed, and notes edges that feel it.
    fn update_elements(&mut self) {
        self.elements.sort_unstable();
        self.elements.dedup();
        for &element in &self.elements {
            let edges = self.edges[element as usize];
            let existing = || edges.into_iter().filter(|edge| *edge != NO_EDGE);
            let smallest = existing().map(|edge| self.factor[edge as usize]).fold(f64::INFINITY, f64::min);
            let before = std::mem::replace(&mut self.smallest[element as usize], smallest);
            if before.to_bits() != smallest.to_bits() {
                self.pending.extend(existing());
            }
        }
        self.elements.clear();
    }

    /// What becomes of an edge.
    fn coupling(&self, edge: usize, owners: [u16; 2]) -> Coupling {
        let (rule, negative) = (self.rule[edge], self.negative.of(edge));
        if negative.is_empty() {
            return rule;
        }
        let is_conducting = is_conducting(&rule, owners);
        let through = if is_conducting { 1.0 } else { rule.through };
        let (mut sum, mut is_plain) = (through * self.positive[edge], through == 1.0);
        for &(element, weight) in negative {
            let factor = self.smallest[element as usize];
            is_plain &= factor == 1.0;
            sum += factor * weight;
        }
        let part = if is_plain { 1.0 } else { sum / self.reference[edge] };
        match is_conducting {
            true if self.reference[edge] > 0.0 => rule.scaled(part),
            // There is no capacitor that conductors could cut; between two of them there is nothing then.
            true if rule.meets_two(owners) => Coupling::only_through(0.0),
            _ => Coupling::only_through(part),
        }
    }
}

/// Whether a conductor is on an edge with these owners of its ends.
fn is_conducting(rule: &Coupling, owners: [u16; 2]) -> bool {
    rule.is_linked() || owners != [NO_OBJECT; 2]
}

impl Occupancy {
    /// Couples anew the edges of elements with negative weights that changed; whether links were lost.
    pub(super) fn update_negative(&mut self, edges: &Edges, weights: &mut NegativeWeights) -> bool {
        let mut links_lost = false;
        weights.update_elements();
        let pending = std::mem::take(&mut weights.pending);
        for &edge in &pending {
            let edge = edge as usize;
            let frame = self.scratch.frame;
            if std::mem::replace(&mut weights.edge_seen[edge], frame) != frame {
                let ends = edges.ends_of_existing(edge);
                let owners = ends.map(|node| self.conductor[node as usize]);
                links_lost |= self.couple(edge, ends, weights.coupling(edge, owners));
            }
        }
        weights.pending = pending;
        weights.pending.clear();
        links_lost
    }
}
