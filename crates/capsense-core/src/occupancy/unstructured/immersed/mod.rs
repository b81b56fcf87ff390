//! Weak dielectrics on a mesh that is no lattice: immersed elements.
//!
//! What is normal to a surface the edge rule has right, capacitors in series. A weak body lets most of the field pass along its surface,
//! where what is side by side adds up, and of that an edge knows nothing. An element knows: its potential is linear on either side of the plane through
//! the points where the surface crosses its edges, with a kink there ([`element`], [`plane`]). This too is six edge weights.
//!
//! It is right where one surface that is nearly plane is in an element. Where a body is thinner than the element, or another object is
//! near, the edge rule stays, and in between either has its share ([`share`]). Both are positive semidefinite, and so is their sum.
//!
//! The weight of an edge is then what the other rules make of it and, of each element around it, the share times the difference. Elements lack that
//! have a rim, an open wall or no number for one of their edges.

mod element;
mod plane;
mod reading;
mod share;

use super::super::elements::{Lists, NO_EDGE};
use super::super::index_set::IndexList;
use super::super::{Coupling, Filled, NO_OBJECT, Scene};
use super::negative::NegativeWeights;
use super::obtuse::ObtuseElements;
use crate::few::Few;
use crate::geometry::Aabb;
use crate::material::Material;
use crate::mesh::{EdgeShare, TetMesh};
use crate::workers::Workers;
use glam::DVec3;

/// So many elements keep a thread busy for ten times as long as it takes to hand them over.
const ELEMENTS_OF_A_TASK: usize = 64;

/// What an edge's weight may differ by, in parts of it, from the sum of its elements for rounding.
const SAME: f64 = 1e-9;

/// Stands in for the number of an element among those with negative weights.
const NOT_OBTUSE: u32 = u32::MAX;

/// The elements of a mesh, what fills their edges, and how their weights differ from those of the other rules.
#[derive(Clone, Debug)]
pub(super) struct ImmersedElements {
    elements: Vec<Element>,
    /// Elements around each edge, times six, and which of their edges it is.
    at_edge: Lists<u32>,
    filled: Vec<Filled>,
    /// What elements weigh along their edges more than by the other rules.
    excess: Vec<[f64; 6]>,
    /// Elements of which a surface cuts an edge, and where all objects were when it was last looked at what is near them.
    cut: IndexList,
    bounds: Vec<Aabb>,
    /// Elements to be looked at again in this frame, and what becomes of them.
    pending: IndexList,
    found: Vec<[f64; 6]>,
}

#[derive(Clone, Copy, Debug)]
struct Element {
    nodes: [u32; 4],
    edges: [u32; 6],
    /// Relative permittivity without objects; zero where the edge rule stays.
    background: f64,
    obtuse: u32,
}

/// What an element's other weights follow from.
#[derive(Clone, Copy)]
pub(super) struct OtherRules<'a> {
    pub(super) rule: &'a Few<Coupling>,
    pub(super) negative: Option<&'a NegativeWeights>,
}

/// Whether elements are immersed in some of these materials, in front of some background.
pub(crate) fn may_be_immersed(mesh: &TetMesh, materials: &[Material]) -> bool {
    let highest = mesh.relative_permittivity().iter().fold(1.0, f64::max);
    let is_weak = |material: &Material| match material {
        Material::Dielectric(permittivity) => permittivity.value() < share::STRONG * highest,
        Material::Conductor(_) => false,
    };
    materials.iter().any(is_weak)
}

impl ImmersedElements {
    /// Takes the edges of all elements and the weights that edges have without objects. `None` if no element can be immersed.
    pub(super) fn new(
        mesh: &TetMesh,
        of_elements: &[[u32; 6]],
        weights: &[f64],
        obtuse: &ObtuseElements,
    ) -> Option<Self> {
        let mut elements = Vec::with_capacity(of_elements.len());
        let mut number = 0;
        for (element, (nodes, &edges)) in mesh.tets().iter().zip(of_elements).enumerate() {
            let is_obtuse = obtuse.is(number as usize, nodes);
            let background = mesh.relative_permittivity().at(element);
            elements.push(Element {
                nodes,
                edges,
                background,
                obtuse: if is_obtuse { number } else { NOT_OBTUSE },
            });
            number += u32::from(is_obtuse);
        }
        let is_sum = are_sums(mesh, of_elements, weights);
        for element in &mut elements {
            if !element.edges.iter().all(|&edge| edge != NO_EDGE && is_sum[edge as usize]) {
                element.background = 0.0;
            }
        }
        let numbered = elements.iter().enumerate().filter(|(_, element)| element.is_fit());
        let at_edge = numbered.clone().flat_map(|(number, element)| {
            let of_element = move |(at, edge): (usize, u32)| (edge as usize, (6 * number + at) as u32);
            element.edges.into_iter().enumerate().map(of_element)
        });
        numbered.clone().next()?;
        Some(Self {
            at_edge: Lists::new(weights.len(), at_edge),
            filled: vec![Filled::NOTHING; weights.len()],
            excess: vec![[0.0; 6]; elements.len()],
            cut: IndexList::below(elements.len()),
            bounds: Vec::new(),
            pending: IndexList::below(elements.len()),
            found: Vec::new(),
            elements,
        })
    }

    /// Takes what fills an edge.
    pub(super) fn fill(&mut self, edge: usize, filled: Filled) {
        if !std::mem::replace(&mut self.filled[edge], filled).is(&filled) {
            self.look_at(edge);
        }
    }

    /// Notes that the elements at an edge are to be looked at again.
    pub(super) fn look_at(&mut self, edge: usize) {
        for &place in self.at_edge.of(edge) {
            self.pending.insert((place / 6) as usize);
        }
    }

    /// What the elements at an edge weigh along it more than by the other rules.
    pub(super) fn excess(&self, edge: usize) -> f64 {
        self.at_edge
            .of(edge)
            .iter()
            .map(|&place| self.excess[(place / 6) as usize][(place % 6) as usize])
            .sum()
    }

    /// Looks again at elements at edges that changed, and where something moved near them; tells which edges feel it.
    pub(super) fn update(
        &mut self,
        workers: &Workers,
        scene: &Scene<'_>,
        others: OtherRules<'_>,
        mut feels: impl FnMut(usize),
    ) {
        self.look_near_moved(scene);
        let mut found = std::mem::take(&mut self.found);
        let numbers = self.pending.numbers();
        found.resize(numbers.len(), [0.0; 6]);
        let tasks = numbers.chunks(ELEMENTS_OF_A_TASK).zip(found.chunks_mut(ELEMENTS_OF_A_TASK));
        workers.for_each(tasks, |(numbers, found)| {
            for (&number, found) in numbers.iter().zip(found) {
                *found = self.excess_of(scene, others, &self.elements[number as usize]);
            }
        });
        for (&number, now) in self.pending.numbers().iter().zip(&found) {
            let before = std::mem::replace(&mut self.excess[number as usize], *now);
            if before.map(f64::to_bits) != now.map(f64::to_bits) {
                self.elements[number as usize].edges.iter().for_each(|&edge| feels(edge as usize));
            }
            if self.elements[number as usize].is_cut(&self.filled) {
                self.cut.insert(number as usize);
            }
        }
        self.pending.clear();
        self.found = found;
    }

    /// Notes elements that other objects came nearer to or went away from. Those that no surface cuts any more are forgotten.
    fn look_near_moved(&mut self, scene: &Scene<'_>) {
        let Self { elements, filled, cut, bounds, pending, .. } = self;
        if bounds.len().max(scene.bounds.len()) > 1 {
            cut.retain(|number| elements[number].is_cut(filled));
            for object in 0..bounds.len().max(scene.bounds.len()) {
                let [before, now] = [bounds.get(object), scene.bounds.get(object)];
                if before == now {
                    continue;
                }
                let is_near = |around: &Aabb, longest: f64| {
                    let regions = [before, now].into_iter().flatten();
                    regions.map(|region| share::gap(around, region)).any(|gap| gap < share::REACH * longest)
                };
                for &number in cut.numbers() {
                    let element = &elements[number as usize];
                    let corners = element.corners(scene);
                    if element.object(filled) != object as u16
                        && is_near(&Aabb::around(corners), longest(corners))
                    {
                        pending.insert(number as usize);
                    }
                }
            }
        }
        bounds.clear();
        bounds.extend_from_slice(scene.bounds);
    }

    /// What an element weighs along its edges more than by the other rules.
    fn excess_of(&self, scene: &Scene<'_>, others: OtherRules<'_>, element: &Element) -> [f64; 6] {
        let object = usize::from(element.object(&self.filled));
        let Some(&Material::Dielectric(permittivity)) = scene.materials.get(object) else { return [0.0; 6] };
        let ratio = permittivity.value() / element.background;
        let corners = element.corners(scene);
        let others_near = scene.bounds.iter().enumerate().filter(|(other, _)| *other != object);
        let others_near = others_near.map(|(_, bounds)| *bounds);
        let share =
            share::of_ratio(ratio) * share::of_others(&Aabb::around(corners), longest(corners), others_near);
        if share == 0.0 {
            return [0.0; 6];
        }
        let filled = element.filled(&self.filled);
        let by_rules = element.by_rules(corners, others);
        let mut excess = [0.0; 6];
        for reading in reading::readings(&filled) {
            let part = |from: usize, to: usize| filled[edge_between(from, to)].part();
            let Some(levels) = plane::levels(reading.inside, part) else { continue };
            let share = share * reading.share;
            let weights = element::weights(corners, levels, ratio);
            for at in 0..6 {
                excess[at] += share * (element.background * weights[at] - by_rules[at]);
            }
        }
        excess
    }
}

impl Element {
    /// Whether it can be immersed.
    fn is_fit(&self) -> bool {
        self.background > 0.0
    }

    fn corners(&self, scene: &Scene<'_>) -> [DVec3; 4] {
        self.nodes.map(|node| scene.mesh.nodes[node as usize])
    }

    /// What fills its edges, each from the first of its corners to the second.
    fn filled(&self, filled: &[Filled]) -> [Filled; 6] {
        std::array::from_fn(|at| {
            let [i, j] = EdgeShare::CORNERS[at].map(|corner| self.nodes[corner]);
            let filled = filled[self.edges[at] as usize];
            if i < j { filled } else { filled.turned() }
        })
    }

    /// The first dielectric on its edges, or [`NO_OBJECT`].
    fn object(&self, filled: &[Filled]) -> u16 {
        let objects = self.edges.map(|edge| filled[edge as usize].object);
        objects.into_iter().find(|object| *object != NO_OBJECT).unwrap_or(NO_OBJECT)
    }

    /// Whether a dielectric fills some of its edges, but not all.
    fn is_cut(&self, filled: &[Filled]) -> bool {
        let parts = self.edges.map(|edge| filled[edge as usize].part());
        parts.iter().any(|part| *part > 0.0) && parts.iter().any(|part| *part < 1.0)
    }

    /// What it weighs along its edges by the other rules, where no conductor is on them.
    fn by_rules(&self, corners: [DVec3; 4], others: OtherRules<'_>) -> [f64; 6] {
        let smallest = match others.negative {
            Some(negative) if self.obtuse != NOT_OBTUSE => negative.smallest(self.obtuse as usize),
            _ => 1.0,
        };
        let mut weights = [0.0; 6];
        for (at, share) in EdgeShare::of_element(corners).enumerate() {
            let is_scaled = others.negative.is_some() && share.counts() && share.weight < 0.0;
            let factor = if is_scaled { smallest } else { others.rule.get(self.edges[at] as usize).through };
            weights[at] = factor * self.background * share.weight;
        }
        weights
    }
}

/// Which of an element's edges joins two of its corners.
fn edge_between(a: usize, b: usize) -> usize {
    [[0, 0, 1, 2], [0, 0, 3, 4], [1, 3, 0, 5], [2, 4, 5, 0]][a][b]
}

/// The length of the longest edge.
fn longest(corners: [DVec3; 4]) -> f64 {
    let lengths = EdgeShare::CORNERS.map(|[i, j]| corners[i].distance_squared(corners[j]));
    lengths.into_iter().fold(0.0, f64::max).sqrt()
}

/// Whether the weight of each edge is the sum of those of elements, not changed by a rim or an open wall.
fn are_sums(mesh: &TetMesh, of_elements: &[[u32; 6]], weights: &[f64]) -> Vec<bool> {
    let mut sums = vec![(0.0, 0.0); weights.len()];
    for (element, edges) in of_elements.iter().enumerate() {
        let background = mesh.relative_permittivity().at(element);
        let shares = EdgeShare::of_element(mesh.corners(element)).zip(edges);
        for (share, &edge) in shares.filter(|(_, edge)| **edge != NO_EDGE) {
            let (sum, magnitude) = &mut sums[edge as usize];
            *sum += background * share.weight;
            *magnitude += background * share.magnitude;
        }
    }
    let is_sum =
        |(&(sum, magnitude), weight): (&(f64, f64), &f64)| f64::abs(weight - sum) <= SAME * magnitude;
    sums.iter().zip(weights).map(is_sum).collect()
}
