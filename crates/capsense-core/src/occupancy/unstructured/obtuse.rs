//! How little links may be where elements have obtuse angles, for K to stay positive definite.
//!
//! K is a sum over elements, K_e, each of which is positive semidefinite, and so it stays if what becomes of each K_e is. An
//! element without negative weights may lose any of its edges. Of another one, think of the corners that still are coupled
//! with each other as one part. If conductors cut all edges between its parts and none within, then with the weights of
//! these edges as links of their ends each part has what it has of K_e if the others are held, which is positive
//! semidefinite. If not, it needs of its links what the edge rule makes of its positive weights: these are capacitors of
//! which the cut ones hold their ends together no less than before, and without negative ones between free corners it is no
//! worse off. Negative weights to held corners stay in its diagonal.

use super::super::coupling::Coupling;
use super::super::elements::{Lists, NO_EDGE};
use crate::mesh::{EdgeShare, TetMesh};

/// What part of what an element is with safe links it keeps.
const KEPT: f64 = 0.01;

/// What holds a node's potential.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Holder {
    None,
    Conductor,
    /// An electrode or the wall.
    Sensor,
}

/// Elements with negative weights.
#[derive(Clone, Debug)]
pub(super) struct ObtuseElements {
    /// The nodes, edges and weights of each.
    elements: Vec<Element>,
    at_node: Lists<u32>,
    at_edge: Lists<u32>,
}

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
        for (element, (&nodes, &edges)) in mesh.tets().iter().zip(of_elements).enumerate() {
            let shares = EdgeShare::of_element(mesh.corners(element));
            if shares.clone().any(|share| share.counts() && share.weight < 0.0) {
                let background = mesh.relative_permittivity().at(element);
                let mut weights = [0.0; 6];
                shares.zip(&mut weights).for_each(|(share, weight)| *weight = background * share.weight);
                elements.push(Element { nodes, edges, weights });
            }
        }
        let numbered = || (0..).zip(&elements);
        let at_node = numbered().flat_map(|(number, element): (u32, &Element)| {
            element.nodes.into_iter().map(move |node| (node as usize, number))
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

    /// Visits the nodes of the elements at an edge, some several times.
    pub(super) fn for_nodes_around(&self, edge: usize, mut visit: impl FnMut(usize)) {
        let elements = self.at_edge(edge).iter().map(|&element| &self.elements[element as usize]);
        elements.flat_map(|element| element.nodes).for_each(|node| visit(node as usize));
    }

    /// What the links of a free node must be together at least, edges to nodes that conductors hold among them. `rule` is
    /// what the edge rule makes of edges, `scale` by what each element's weights are multiplied.
    pub(super) fn least_links(
        &self,
        node: usize,
        rule: &[Coupling],
        holder: impl Fn(u32) -> Holder,
        scale: impl Fn(usize) -> f64,
    ) -> f64 {
        let elements = self.at_node.of(node).iter().map(|&number| number as usize);
        elements.map(|number| self.elements[number].least_links(node, rule, &holder, scale(number))).sum()
    }
}

impl Element {
    fn existing_edges(&self) -> impl Iterator<Item = usize> + Clone + use<> {
        self.edges.into_iter().filter(|edge| *edge != NO_EDGE).map(|edge| edge as usize)
    }

    fn least_links(&self, node: usize, rule: &[Coupling], holder: impl Fn(u32) -> Holder, scale: f64) -> f64 {
        let Some(corner) = (0..4).find(|&corner| self.nodes[corner] as usize == node) else { return 0.0 };
        let cut = self.cut(rule, holder);
        if cut.is_whole { 0.0 } else { scale * cut.least_links(corner) }
    }

    /// What conductors leave of the element.
    fn cut(&self, rule: &[Coupling], holder: impl Fn(u32) -> Holder) -> CutElement {
        let holders = self.nodes.map(holder);
        let free = holders.map(|holder| holder == Holder::None);
        let is_cut = |edge: usize| self.edges[edge] != NO_EDGE && rule[self.edges[edge] as usize].is_linked();
        // Corners of one part have the smallest of their numbers.
        let mut part = [0, 1, 2, 3];
        for (edge, [a, b]) in EdgeShare::CORNERS.into_iter().enumerate() {
            if free[a] && free[b] && !is_cut(edge) {
                let [one, other] = [part[a].min(part[b]), part[a].max(part[b])];
                part.iter_mut().filter(|part| **part == other).for_each(|part| *part = one);
            }
        }
        let mut pairs = EdgeShare::CORNERS.into_iter().enumerate().filter(|(_, [a, b])| free[*a] && free[*b]);
        let is_clean = pairs.all(|(edge, [a, b])| !is_cut(edge) || part[a] != part[b]);
        let mut cut = CutElement::default();
        for (edge, ends) in EdgeShare::CORNERS.into_iter().enumerate() {
            if self.edges[edge] == NO_EDGE {
                continue;
            }
            let (weight, rule) = (self.weights[edge], &rule[self.edges[edge] as usize]);
            for (own, other) in [(ends[0], ends[1]), (ends[1], ends[0])] {
                if !free[own] {
                    continue;
                }
                if !is_cut(edge) && holders[other] != Holder::Conductor {
                    cut.kept[own] += weight;
                    cut.between[own][other] = if free[other] { weight } else { 0.0 };
                    continue;
                }
                let end = usize::from(self.nodes[own] > self.nodes[other]);
                let exact = weight * if rule.is_linked() { rule.factor[end] } else { rule.through };
                cut.is_whole = false;
                cut.exact[own] += exact;
                cut.safe[own] += match (is_clean, weight > 0.0) {
                    (false, true) => exact,
                    (false, false) if free[other] => 0.0,
                    _ => weight,
                };
            }
        }
        cut
    }
}

/// An element of which conductors hold a part, as a form in the potentials of its free corners.
struct CutElement {
    is_whole: bool,
    /// What is left of the edges between free corners.
    between: [[f64; 4]; 4],
    /// The sum of the weights of edges of each corner that conductors do not meet.
    kept: [f64; 4],
    /// Links with which the form is positive semidefinite for certain, and those that faces ask for.
    safe: [f64; 4],
    exact: [f64; 4],
}

impl Default for CutElement {
    fn default() -> Self {
        Self { is_whole: true, between: [[0.0; 4]; 4], kept: [0.0; 4], safe: [0.0; 4], exact: [0.0; 4] }
    }
}

impl CutElement {
    fn least_links(&self, corner: usize) -> f64 {
        let base: [f64; 4] = std::array::from_fn(|k| self.kept[k] + self.safe[k]);
        let more: [f64; 4] = std::array::from_fn(|k| self.exact[k] - self.safe[k]);
        let diagonal = |t: f64| -> [f64; 4] {
            std::array::from_fn(|k| base[k] + if more[k] < 0.0 { t * more[k] } else { more[k] })
        };
        let mut t = 1.0;
        if !self.is_semidefinite(diagonal(1.0)) {
            t = 0.0;
            let mut step = 0.5;
            for _ in 0..16 {
                if self.is_semidefinite(diagonal(t + step)) {
                    t += step;
                }
                step *= 0.5;
            }
        }
        let all = diagonal(t);
        let mut squares = 0.0;
        for a in 0..4 {
            for b in 0..a {
                let weight = self.between[a][b];
                if weight != 0.0 {
                    squares += 2.0 * weight * weight / (all[a] * all[b]);
                }
            }
        }
        let count = all.iter().zip(&self.kept).filter(|_| true).count() as f64;
        let highest = f64::sqrt(squares * (count - 1.0) / count).min(1.0);
        self.safe[corner] + (1.0 - KEPT) * (highest * all[corner] - base[corner])
    }

    /// Whether the form with this diagonal is.
    fn is_semidefinite(&self, diagonal: [f64; 4]) -> bool {
        let mut a = self.between.map(|row| row.map(|weight| -weight));
        for k in 0..4 {
            a[k][k] = diagonal[k];
        }
        for k in 0..4 {
            let pivot = a[k][k];
            if pivot < 0.0 {
                return false;
            }
            for i in k + 1..4 {
                if a[i][k] == 0.0 {
                    continue;
                }
                if pivot == 0.0 {
                    return false;
                }
                let factor = a[i][k] / pivot;
                for j in k + 1..4 {
                    a[i][j] -= factor * a[k][j];
                }
            }
        }
        true
    }
}
