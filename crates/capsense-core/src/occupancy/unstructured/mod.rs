//! What objects make of edges on a mesh that is no lattice, where a node has many edges and some weigh less than nothing.
//!
//! The edge rule says what is left of each edge. What it says of negative weights is not for a single edge: next to
//! conductors nodes are linked for them ([`node_links`]), and in dielectrics elements scale them ([`negative`]).

mod cut_element;
mod ending;
mod immersed;
mod least_links;
mod negative;
mod node_links;
mod obtuse;

use super::elements::edges_of;
use super::index_set::IndexList;
use super::{Coupling, Filled, NO_OBJECT, Occupancy, Scene};
use crate::few::Few;
use crate::geometry::Aabb;
use crate::mesh::{Edges, TetMesh};
use crate::workers::Workers;
pub(crate) use immersed::may_be_immersed;
use immersed::{ImmersedElements, OtherRules};
use least_links::LeastLinks;
use negative::NegativeWeights;
use node_links::NodeLinks;
use obtuse::ObtuseElements;

/// The edges of such a mesh.
#[derive(Clone, Debug)]
pub(super) struct Unstructured {
    /// The weight of each edge without objects, and what the edge rule makes of it.
    weights: Vec<f64>,
    rule: Few<Coupling>,
    links: NodeLinks,
    obtuse: ObtuseElements,
    /// How little the links of nodes may be together, as far as these elements tell.
    least: LeastLinks,
    /// Negative weights that dielectrics are to scale.
    negative: Option<NegativeWeights>,
    /// Elements that weak dielectrics cut.
    immersed: Option<ImmersedElements>,
    /// Edges to be coupled anew in this frame.
    pending: IndexList,
}

/// An edge and what holds it.
#[derive(Clone, Copy)]
pub(super) struct HeldEdge {
    pub(super) edge: usize,
    /// The conductor that holds each end, or [`NO_OBJECT`].
    pub(super) owners: [u16; 2],
}

impl HeldEdge {
    pub(super) fn of(edge: usize, ends: [u32; 2], conductors: &[u16]) -> Self {
        Self { edge, owners: ends.map(|node| conductors[node as usize]) }
    }
}

impl Unstructured {
    /// Takes the weights that edges have without objects. If there will be dielectrics, or several conductors, elements are
    /// to scale negative weights.
    pub(super) fn new(mesh: &TetMesh, edges: &Edges, weights: &[f64], are_scaled: bool) -> Self {
        let of_elements: Vec<[u32; 6]> = mesh.tets().iter().map(|tet| edges_of(tet, edges)).collect();
        let obtuse = ObtuseElements::new(mesh, &of_elements, edges.len());
        let are_scaled = are_scaled && obtuse.len() > 0;
        Self {
            negative: are_scaled.then(|| NegativeWeights::new(mesh, &of_elements, edges.len(), &obtuse)),
            weights: weights.to_vec(),
            rule: Few::of(weights.len(), Coupling::PLAIN),
            links: NodeLinks::new(mesh, edges, weights),
            least: LeastLinks::new(obtuse.len()),
            obtuse,
            immersed: None,
            pending: IndexList::below(weights.len()),
        }
    }

    /// Immerses elements that weak dielectrics will cut.
    pub(super) fn immerse(&mut self, mesh: &TetMesh, edges: &Edges) {
        let of_elements: Vec<[u32; 6]> = mesh.tets().iter().map(|tet| edges_of(tet, edges)).collect();
        self.immersed = ImmersedElements::new(mesh, &of_elements, &self.weights, &self.obtuse);
    }

    /// Takes what fills an edge that surfaces may cut another way than before.
    pub(super) fn fill(&mut self, edge: usize, filled: Filled) {
        if let Some(immersed) = &mut self.immersed {
            immersed.fill(edge, filled);
        }
    }

    /// Takes what the edge rule makes of an edge; `is_moved` tells that what holds its ends may have changed.
    pub(super) fn take(&mut self, held: HeldEdge, ends: [u32; 2], is_moved: bool, rule: Coupling) {
        let edge = held.edge;
        self.links.note_leads(held, ends, &rule);
        let is_as_before = rule.is(self.rule.get(edge));
        if !is_moved && is_as_before {
            return;
        }
        self.rule.set(edge, (!rule.is(&Coupling::PLAIN)).then_some(rule));
        self.pending.insert(edge);
        ends.into_iter().for_each(|node| self.links.look_at(node as usize));
        if let Some(negative) = &mut self.negative {
            negative.take(&self.obtuse, held, &rule);
        }
        if let Some(immersed) = &mut self.immersed {
            immersed.look_at(edge);
        }
    }

    /// Looks again at elements that weak dielectrics cut, as far as something changed there, and notes edges that feel it.
    fn update_immersed(&mut self, workers: &Workers, scene: &Scene<'_>) {
        let Self { rule, negative, immersed, pending, .. } = self;
        if let Some(immersed) = immersed {
            let others = OtherRules { rule, negative: negative.as_ref() };
            immersed.update(workers, scene, others, |edge| pending.insert(edge));
        }
    }

    /// By what factor the permittivity along an edge is raised, if its weight does not tell.
    pub(super) fn contrast(&self, edge: usize) -> Option<f64> {
        let is_scaled = !self.obtuse.at_edge(edge).is_empty();
        let scaled = self.negative.as_ref().filter(|_| is_scaled).map(|negative| negative.factor(edge));
        scaled.or_else(|| self.immersed.as_ref().map(|_| self.rule.get(edge).through))
    }

    /// What is left of an edge but for links of nodes.
    fn without_links(&self, held: HeldEdge) -> Coupling {
        let rule = *self.rule.get(held.edge);
        let part = self.part(held);
        match self.weights[held.edge] > 0.0 {
            true if is_conducting(&rule, held.owners) => rule.scaled(part),
            // There is no capacitor that a conductor could cut, and between two conductors there is nothing.
            false if rule.is_linked() || rule.meets_two(held.owners) => Coupling::only_through(0.0),
            _ if is_conducting(&rule, held.owners) => Coupling::only_through(part),
            _ => Coupling::only_through(part + self.excess(held.edge)),
        }
    }

    /// What immersed elements add to that of an edge on which no conductor is.
    fn excess(&self, edge: usize) -> f64 {
        self.immersed.as_ref().map_or(0.0, |immersed| immersed.excess(edge) / self.weights[edge])
    }

    /// What multiplies the weight of an edge, which conductors then may cut, if no element is immersed.
    fn part(&self, held: HeldEdge) -> f64 {
        let rule = self.rule.get(held.edge);
        match &self.negative {
            Some(negative) => negative.part(held, rule),
            None if is_conducting(rule, held.owners) => 1.0,
            None => rule.through,
        }
    }
}

/// Whether a conductor is on an edge with these owners of its ends.
fn is_conducting(rule: &Coupling, owners: [u16; 2]) -> bool {
    rule.is_linked() || owners != [NO_OBJECT; 2]
}

impl Occupancy {
    /// Couples the edges of a mesh that is no lattice, as far as something changed there.
    /// `around_edges` are boxes outside of which no edge of an object was or is, of what changed.
    pub(super) fn update_unstructured(
        &mut self,
        workers: &Workers,
        scene: &Scene<'_>,
        around_edges: &[Aabb],
    ) {
        let Some(mut unstructured) = self.unstructured.take() else { return };
        let Unstructured { negative, obtuse, pending, .. } = &mut *unstructured;
        if let Some(negative) = negative {
            negative.update_elements(obtuse, |edge| pending.insert(edge));
        }
        unstructured.update_links(workers, scene, around_edges, &self.conductor);
        unstructured.update_immersed(workers, scene);
        let conductor = std::mem::take(&mut self.conductor);
        let (known, replaced) = self.known();
        for &edge in unstructured.pending.numbers() {
            let edge = edge as usize;
            let ends = scene.mesh.edges.ends_of_existing(edge);
            let held = HeldEdge::of(edge, ends, &conductor);
            known.couple(edge, ends, unstructured.coupling(held, ends), replaced);
        }
        unstructured.pending.clear();
        self.conductor = conductor;
        self.unstructured = Some(unstructured);
    }
}
