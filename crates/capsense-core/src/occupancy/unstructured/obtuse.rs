//! How little links may be where elements have obtuse angles, for K to stay positive definite.
//!
//! K is a sum over elements, K_e, each of which is positive semidefinite, and so it stays if what becomes of each K_e is. An
//! element without negative weights may lose any of its edges. Of another one, think of the corners that still are coupled
//! with each other as one part. If conductors cut all edges between its parts and none within, then with the weights of
//! these edges as links of their ends each part has what it has of K_e if the others are held, which is positive
//! semidefinite. If not, it is with links that are what the edge rule makes of its positive weights: these are capacitors of
//! which the cut ones hold their ends together no less than before, and without negative ones between free corners it is no
//! worse off. Negative weights to held corners stay in its diagonal.
//!
//! These links are certain, but in flat elements they are far more than a face asks for. How much less they may be is for
//! [`CutElement`] to say, if all ends lead to one conductor; then only differences from its potential matter. The conductor
//! may float, so corners that the sensor holds count as free ones, but for edges between two of these: as they differ alike,
//! such an edge is nothing in the form, and is taken as whole.

use super::super::coupling::Coupling;
use super::super::elements::{Lists, NO_EDGE};
use super::cut_element::CutElement;
use super::least_links::ElementLinks;
use crate::few::Few;
use crate::mesh::{EdgeShare, TetMesh};

/// What holds a node's potential.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Holder {
    None,
    Conductor(u16),
    /// An electrode or the wall.
    Sensor,
}

/// Elements with negative weights.
#[derive(Clone, Debug)]
pub(super) struct ObtuseElements {
    /// The nodes, edges and weights of each.
    elements: Vec<Element>,
    at_node: Lists<Corner>,
    at_edge: Lists<u32>,
}

/// A corner of an element: four times the element's number and its own.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Corner(u32);

#[derive(Clone, Copy, Debug)]
struct Element {
    nodes: [u32; 4],
    edges: [u32; 6],
    weights: [f64; 6],
}

impl ObtuseElements {
    /// Finds them, from the edges of all elements. They are numbered in the order of the mesh.
    pub(super) fn new(mesh: &TetMesh, of_elements: &[[u32; 6]], edge_count: usize) -> Self {
        let mut elements = Vec::new();
        for (element, (nodes, &edges)) in mesh.tets().iter().zip(of_elements).enumerate() {
            let shares = EdgeShare::of_element(mesh.corners(element));
            if shares.clone().any(|share| share.counts() && share.weight < 0.0) {
                let background = mesh.relative_permittivity().at(element);
                let mut weights = [0.0; 6];
                shares.zip(&mut weights).for_each(|(share, weight)| *weight = background * share.weight);
                elements.push(Element { nodes, edges, weights });
            }
        }
        elements.shrink_to_fit();
        let numbered = || (0..).zip(&elements);
        let at_node = numbered().flat_map(|(number, element): (u32, &Element)| {
            (0..4).zip(element.nodes).map(move |(corner, node)| (node as usize, Corner(4 * number + corner)))
        });
        let at_edge =
            numbered().flat_map(|(number, element)| element.existing_edges().map(move |edge| (edge, number)));
        Self {
            at_node: Lists::new(mesh.nodes().len(), at_node),
            at_edge: Lists::new(edge_count, at_edge),
            elements,
        }
    }

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        self.elements.len()
    }

    /// Whether an element of the mesh with these nodes has a number.
    pub(super) fn is(&self, number: usize, nodes: [u32; 4]) -> bool {
        self.elements.get(number).is_some_and(|element| element.nodes == nodes)
    }

    /// The elements at an edge.
    pub(super) fn at_edge(&self, edge: usize) -> &[u32] {
        self.at_edge.of(edge)
    }

    /// The edges of an element that have a weight.
    pub(super) fn edges(&self, element: u32) -> impl Iterator<Item = usize> {
        self.elements[element as usize].existing_edges()
    }

    /// The nodes of an element.
    pub(super) fn nodes(&self, element: u32) -> [u32; 4] {
        self.elements[element as usize].nodes
    }

    /// The corners at a node.
    pub(super) fn at_node(&self, node: usize) -> &[Corner] {
        self.at_node.of(node)
    }

    /// What the links of an element's corners must be at least. `rule` is what the edge rule makes of edges.
    pub(super) fn least_links(
        &self,
        element: u32,
        rule: &Few<Coupling>,
        holder: impl Fn(u32) -> Holder,
    ) -> ElementLinks {
        let (cut, ends_in) = self.elements[element as usize].cut(rule, holder);
        match ends_in {
            EndsIn::Nothing => ElementLinks::NONE,
            // What is certain is all that counts.
            EndsIn::Several => ElementLinks { ends_in, certain: cut.certain, least: cut.certain },
            EndsIn::One(_) => ElementLinks { ends_in, certain: cut.certain, least: cut.least_links() },
        }
    }
}

impl Corner {
    pub(super) fn element(self) -> usize {
        (self.0 / 4) as usize
    }

    pub(super) fn number(self) -> usize {
        (self.0 % 4) as usize
    }
}

impl Element {
    fn existing_edges(&self) -> impl Iterator<Item = usize> + Clone + use<> {
        self.edges.into_iter().filter(|edge| *edge != NO_EDGE).map(|edge| edge as usize)
    }

    /// What conductors leave of the element, and in what its edges end.
    fn cut(&self, rule: &Few<Coupling>, holder: impl Fn(u32) -> Holder) -> (CutElement, EndsIn) {
        let holders = self.nodes.map(holder);
        let differs = holders.map(|holder| !matches!(holder, Holder::Conductor(_)));
        let is_cut = |edge: usize| {
            let are_alike = EdgeShare::CORNERS[edge].map(|corner| holders[corner]) == [Holder::Sensor; 2];
            let number = self.edges[edge];
            !are_alike && number != NO_EDGE && rule.get(number as usize).is_linked()
        };
        let is_clean = is_clean(differs, is_cut);
        let mut cut = CutElement::default();
        let mut ends_in = EndsIn::Nothing;
        for (edge, [a, b]) in EdgeShare::CORNERS.into_iter().enumerate() {
            if self.edges[edge] == NO_EDGE {
                continue;
            }
            let (weight, rule) = (self.weights[edge], rule.get(self.edges[edge] as usize));
            for (own, other) in [(a, b), (b, a)].into_iter().filter(|(own, _)| differs[*own]) {
                let end = usize::from(self.nodes[own] > self.nodes[other]);
                let (conductor, factor) = match holders[other] {
                    _ if is_cut(edge) => (rule.object[end], rule.factor[end]),
                    Holder::Conductor(conductor) => (conductor, rule.through),
                    _ => {
                        cut.kept[own] += weight;
                        cut.between[own][other] = weight;
                        continue;
                    }
                };
                ends_in = ends_in.and(conductor);
                let certain = match (is_clean, weight > 0.0) {
                    (false, true) => weight * factor,
                    (false, false) if differs[other] => 0.0,
                    _ => weight,
                };
                cut.certain[own] += certain;
                cut.exact[own] += weight * factor;
            }
        }
        (cut, ends_in)
    }
}

/// Whether conductors cut all edges between parts of those corners that they do not hold, and none within.
fn is_clean(differs: [bool; 4], is_cut: impl Fn(usize) -> bool) -> bool {
    let pairs =
        || EdgeShare::CORNERS.into_iter().enumerate().filter(|(_, [a, b])| differs[*a] && differs[*b]);
    // Corners of one part have the smallest of their numbers.
    let mut part = [0, 1, 2, 3];
    for (_, [a, b]) in pairs().filter(|(edge, _)| !is_cut(*edge)) {
        let [one, other] = [part[a].min(part[b]), part[a].max(part[b])];
        part.iter_mut().filter(|part| **part == other).for_each(|part| *part = one);
    }
    pairs().all(|(edge, [a, b])| !is_cut(edge) || part[a] != part[b])
}

/// The conductors in which edges of an element end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum EndsIn {
    Nothing,
    One(u16),
    /// In several, whose potentials differ.
    Several,
}

impl EndsIn {
    fn and(self, conductor: u16) -> Self {
        match self {
            Self::Nothing => Self::One(conductor),
            Self::One(other) if other == conductor => self,
            _ => Self::Several,
        }
    }
}
