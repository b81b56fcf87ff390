//! What a scene changes of the empty network's energy, as a sum of squares.
//!
//! A conductor at potential V that cuts the edge from a to b, of weight w, a part c of its length from a, adds
//! w ((1-c) x_a + c x_b - V)² / (c (1-c)): then the edge's own energy is that of two edges of weights w/c and w/(1-c) to V.
//! Nodes behind such cuts need not be known: all around them is at V. A link adds w (x_a - V)². Both are [`Point`]s, with
//! positive weights. What else changes, by dielectrics and by links that weigh less than nothing, is kept node by node.

use super::table::{Empty, Holder};
use crate::occupancy::{Coupling, NO_OBJECT, Occupancy};
use crate::stiffness::StiffnessMatrix;

/// A cut so near to a held node holds the node itself: points at the ends of its edges would be one and the same.
const BESIDE_NODE: f64 = 1.05;

/// Less than nothing by this part of what it was taken from is rounding.
const ROUNDING: f64 = 1e-13;

/// A sum of potentials that is drawn to a value.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    pub(super) nodes: [u32; 2],
    pub(super) parts: [f64; 2],
    /// One over its weight in the energy; zero where it is held.
    pub(super) compliance: f64,
}

/// What is drawn at one node.
#[derive(Clone, Copy, Debug)]
struct Drawn {
    node: u32,
    weight: f64,
    /// Whether it is more than one positive weight, to be kept node by node.
    is_general: bool,
    is_negative: bool,
    to: Holder,
}

/// A part of the energy, weight (x_a - x_b)², between two of [`Changes::nodes`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Between {
    pub(super) ends: [u32; 2],
    pub(super) weight: f64,
}

/// An edge with its base weight and what is left of it.
struct Cut<'a> {
    ends: [u32; 2],
    weight: f64,
    coupling: &'a Coupling,
}

/// No slot.
const NONE: u32 = u32::MAX;

/// All changes of one frame.
#[derive(Clone, Debug)]
pub(super) struct Changes {
    pub(super) points: Vec<Point>,
    /// What points are drawn to, all columns of each.
    pub(super) targets: Vec<f64>,
    /// Nodes of which energies change in other ways: weight x² - 2 x drawn, and [`Between`] some of them.
    pub(super) nodes: Vec<u32>,
    pub(super) weights: Vec<f64>,
    pub(super) drawn: Vec<f64>,
    pub(super) between: Vec<Between>,
    /// Between what is held, all pairs of columns.
    pub(super) known: Vec<f64>,
    columns: usize,
    slot: Vec<u32>,
    slots: Vec<Drawn>,
    /// Σ weight · potential of each slot, all columns.
    pulls: Vec<f64>,
    /// Whether a held node is a point already.
    is_point: Vec<bool>,
    pairs: Vec<Between>,
}

impl Changes {
    pub(super) fn new(empty: &Empty) -> Self {
        let (nodes, columns) = (empty.nodes(), empty.columns);
        Self {
            points: Vec::new(),
            targets: Vec::new(),
            nodes: Vec::new(),
            weights: Vec::new(),
            drawn: Vec::new(),
            between: Vec::new(),
            known: vec![0.0; columns * columns],
            columns,
            slot: vec![NONE; nodes],
            slots: Vec::new(),
            pulls: Vec::new(),
            is_point: vec![false; nodes],
            pairs: Vec::new(),
        }
    }

    /// Collects all that differs from the empty scene.
    pub(super) fn collect(&mut self, empty: &Empty, matrix: &StiffnessMatrix, occupancy: &Occupancy) {
        self.clear();
        let scene = Scene { empty, conductors: occupancy.conductors() };
        let network = matrix.network();
        let scales_negative = occupancy.scales_negative_weights();
        let cut = |edge: usize, ends: [u32; 2]| {
            let weight = network.weights()[edge];
            let is_cut = weight > 0.0 || scales_negative;
            let coupling = if is_cut { occupancy.coupling(edge) } else { &Coupling::PLAIN };
            Cut { ends, weight, coupling }
        };
        for (node, _) in scene.conductors.iter().enumerate().filter(|(_, object)| **object != NO_OBJECT) {
            network.edges().for_edges_at(node, |edge, end| {
                if let Some(ends) = network.edges().ends(edge) {
                    self.take_held(&scene, end, &cut(edge, ends));
                }
            });
        }
        for (edge, _) in occupancy.coupled_edges() {
            let ends = network.edges().ends_of_existing(edge);
            if ends.iter().all(|&node| scene.conductors[node as usize] == NO_OBJECT) {
                self.take_outside(&scene, &cut(edge, ends));
            }
        }
        for ((node, row, weight), base) in matrix.links().zip(&empty.rim) {
            self.draw(&scene, node as u32, weight - base, empty.holder(row));
        }
        self.finish(empty);
    }

    fn clear(&mut self) {
        for point in self.points.drain(..) {
            self.is_point[point.nodes[0] as usize] = false;
        }
        for slot in self.slots.drain(..) {
            self.slot[slot.node as usize] = NONE;
        }
        for values in [&mut self.targets, &mut self.weights, &mut self.drawn, &mut self.pulls] {
            values.clear();
        }
        self.nodes.clear();
        self.between.clear();
        self.pairs.clear();
        self.known.fill(0.0);
    }

    /// Number of unknowns.
    pub(super) fn len(&self) -> usize {
        self.points.len() + self.nodes.len()
    }

    /// An edge of a node that a conductor holds.
    fn take_held(&mut self, scene: &Scene<'_>, end: usize, cut: &Cut<'_>) {
        let [held, other] = [cut.ends[end], cut.ends[1 - end]];
        let [object, across] = [held, other].map(|node| scene.conductors[node as usize]);
        if object == across || cut.weight == 0.0 {
            return;
        }
        let holder = scene.object(object);
        let Coupling { through, factor, object: linked } = *cut.coupling;
        if scene.is_known(other) {
            self.hold(held, holder);
            if across == NO_OBJECT || end == 0 {
                self.pair(scene, cut.ends, (through - 1.0) * cut.weight);
                self.draw_links(scene, cut);
            }
            return;
        }
        let link = factor[1 - end];
        if link != 0.0 && linked[1 - end] != object {
            self.hold(held, holder);
            self.pair(scene, cut.ends, (through - 1.0) * cut.weight);
            self.draw_links(scene, cut);
            return;
        }
        let factor = through + link;
        if factor > BESIDE_NODE && cut.weight > 0.0 {
            let part = 1.0 / factor;
            let compliance = part * (1.0 - part) / cut.weight;
            self.push(Point { nodes: [other, held], parts: [1.0 - part, part], compliance }, holder);
        } else {
            self.hold(held, holder);
            self.draw(scene, other, (factor - 1.0) * cut.weight, holder);
        }
        // Of a link at the held end both ends are known.
        if cut.coupling.factor[end] != 0.0 {
            self.draw(scene, held, cut.coupling.factor[end] * cut.weight, scene.object(linked[end]));
        }
    }

    /// An edge between two nodes that no conductor holds.
    fn take_outside(&mut self, scene: &Scene<'_>, cut: &Cut<'_>) {
        let Coupling { through, factor, object } = *cut.coupling;
        let [a, b] = factor.map(|factor| (through - 1.0 + factor) * cut.weight);
        let drop = (1.0 - through) * cut.weight;
        let has_one = object[0] == object[1] || factor[0] == 0.0 || factor[1] == 0.0;
        let rest = b - drop * drop / a;
        let is_open = cut.ends.iter().any(|&node| !scene.is_known(node));
        let is_drawn = cut.coupling.is_linked() && has_one && drop > 0.0;
        if !(is_open && is_drawn && a > 0.0 && rest > -ROUNDING * b) {
            self.pair(scene, cut.ends, -drop);
            self.draw_links(scene, cut);
            return;
        }
        let holder = scene.object(if factor[0] == 0.0 { object[1] } else { object[0] });
        let ratio = drop / a;
        let parts = [1.0 / (1.0 + ratio), ratio / (1.0 + ratio)];
        let compliance = parts[0] * parts[0] / a;
        self.push(Point { nodes: cut.ends, parts, compliance }, holder);
        self.draw(scene, cut.ends[1], rest.max(0.0), holder);
    }

    fn draw_links(&mut self, scene: &Scene<'_>, cut: &Cut<'_>) {
        for (end, object, factor) in cut.coupling.links() {
            self.draw(scene, cut.ends[end], factor * cut.weight, scene.object(object));
        }
    }

    /// A node that is held itself.
    fn hold(&mut self, node: u32, holder: Holder) {
        if !std::mem::replace(&mut self.is_point[node as usize], true) {
            self.push(Point { nodes: [node; 2], parts: [1.0, 0.0], compliance: 0.0 }, holder);
        }
    }

    fn push(&mut self, point: Point, holder: Holder) {
        let at = self.targets.len();
        self.targets.resize(at + self.columns, 0.0);
        if let Some(column) = holder {
            self.targets[at + column as usize] = 1.0;
        }
        self.points.push(point);
    }

    /// weight (x_node - potential)².
    fn draw(&mut self, scene: &Scene<'_>, node: u32, weight: f64, holder: Holder) {
        if weight == 0.0 {
            return;
        }
        if scene.is_known(node) {
            self.add_known(scene.holder(node), holder, weight);
            return;
        }
        let index = self.slot_of(node);
        let slot = &mut self.slots[index];
        slot.is_negative |= weight < 0.0;
        slot.is_general |= slot.weight != 0.0 && slot.to != holder && slot.is_negative;
        slot.weight += weight;
        slot.to = holder;
        if let Some(column) = holder {
            self.pulls[index * self.columns + column as usize] += weight;
            self.known[column as usize * (self.columns + 1)] += weight;
        }
    }

    /// weight (x_a - x_b)².
    fn pair(&mut self, scene: &Scene<'_>, [a, b]: [u32; 2], weight: f64) {
        match [a, b].map(|node| scene.is_known(node)) {
            _ if weight == 0.0 => {}
            [_, true] => self.draw(scene, a, weight, scene.holder(b)),
            [true, false] => self.draw(scene, b, weight, scene.holder(a)),
            [false, false] => {
                let ends = [a, b].map(|node| self.slot_of(node));
                for end in ends {
                    self.slots[end].is_general = true;
                    self.slots[end].weight += weight;
                }
                self.pairs.push(Between { ends: ends.map(|end| end as u32), weight });
            }
        }
    }

    fn slot_of(&mut self, node: u32) -> usize {
        let slot = &mut self.slot[node as usize];
        if *slot == NONE {
            *slot = self.slots.len() as u32;
            let drawn = Drawn { node, weight: 0.0, is_general: false, is_negative: false, to: None };
            self.slots.push(drawn);
            self.pulls.resize(self.slots.len() * self.columns, 0.0);
        }
        *slot as usize
    }

    /// weight (v_a - v_b)² of two held potentials.
    fn add_known(&mut self, a: Holder, b: Holder, weight: f64) {
        if a == b {
            return;
        }
        let columns = self.columns;
        for column in [a, b].into_iter().flatten() {
            self.known[column as usize * (columns + 1)] += weight;
        }
        if let (Some(a), Some(b)) = (a, b) {
            let (a, b) = (a as usize, b as usize);
            self.known[a * columns + b] -= weight;
            self.known[b * columns + a] -= weight;
        }
    }

    /// What is drawn at nodes becomes points, or is kept node by node.
    fn finish(&mut self, empty: &Empty) {
        let columns = self.columns;
        for index in 0..self.slots.len() {
            let Drawn { node, weight, is_general, .. } = self.slots[index];
            let pull = index * columns..(index + 1) * columns;
            let has_pull = self.pulls[pull.clone()].iter().any(|pull| *pull != 0.0);
            if is_general || weight < 0.0 || (weight == 0.0 && has_pull) {
                // From here on the slot is a place in the list of nodes.
                self.slot[node as usize] = self.nodes.len() as u32;
                self.nodes.push(node);
                self.weights.push(weight);
                self.drawn.extend_from_slice(&self.pulls[pull]);
            } else if weight > 0.0 {
                self.points.push(Point { nodes: [node; 2], parts: [1.0, 0.0], compliance: 1.0 / weight });
                self.targets.extend(self.pulls[pull.clone()].iter().map(|pull| pull / weight));
                if has_pull {
                    // Σ w (x - v)² is the same as W (x - v̄)² and what v differ from their mean v̄.
                    for (s, t) in (0..columns).flat_map(|s| (0..columns).map(move |t| (s, t))) {
                        self.known[s * columns + t] -=
                            self.pulls[pull.start + s] * self.pulls[pull.start + t] / weight;
                    }
                }
            }
        }
        for pair in &self.pairs {
            let ends = pair.ends.map(|slot| self.slot[self.slots[slot as usize].node as usize]);
            self.between.push(Between { ends, weight: pair.weight });
        }
        debug_assert!(self.nodes.iter().all(|&node| !empty.is_fixed(node as usize)));
    }
}

/// What is known of potentials in a frame.
struct Scene<'a> {
    empty: &'a Empty,
    conductors: &'a [u16],
}

impl Scene<'_> {
    fn is_known(&self, node: u32) -> bool {
        self.empty.is_fixed(node as usize) || self.conductors[node as usize] != NO_OBJECT
    }

    /// What holds a node that is known.
    fn holder(&self, node: u32) -> Holder {
        match self.conductors[node as usize] {
            NO_OBJECT => self.empty.holder(node as usize),
            object => self.object(object),
        }
    }

    fn object(&self, object: u16) -> Holder {
        self.empty.holder(self.empty.first_object + usize::from(object))
    }
}
