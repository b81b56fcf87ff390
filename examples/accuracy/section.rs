//! A long conducting plate in a section of a lattice: nodes with potentials, edges with weights between them, and links
//! of nodes to the plate.
//!
//! Lengths are in heights of cells, weights in those of a square cell's edges. Sections and plates are symmetric about x = 0,
//! as are all fields here, so that sections have only the half at x ≥ 0.

use std::f64::consts::PI;

pub(crate) const X: usize = 0;
pub(crate) const Z: usize = 1;

/// What is nearer than this to a face is in it.
const IN_FACE: f64 = 1e-9;

/// Smallest parts of cut edges, in edges: links of what almost touches the plate stay finite.
const SMALLEST_PART: f64 = 1e-3;

/// Links are by the field at a right angle alone up to so many cells from it, and not at all from so many on.
const BY_ANGLE: [f64; 2] = [1.0, 1.6];

/// What is held at one potential: |x| up to `end`, z from `bottom` to `top`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plate {
    pub(crate) end: f64,
    pub(crate) bottom: f64,
    pub(crate) top: f64,
}

impl Plate {
    fn span(self, axis: usize) -> [f64; 2] {
        [[-self.end, self.end], [self.bottom, self.top]][axis]
    }

    fn covers(self, axis: usize, at: f64) -> bool {
        let [start, end] = self.span(axis);
        at > start - IN_FACE && at < end + IN_FACE
    }
}

/// Potentials at the section's outer boundary, and without a plate everywhere.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Field {
    /// Along z.
    Uniform,
    /// exp(-`decay` z) cos(`wave` x).
    Wave { decay: f64, wave: f64 },
}

impl Field {
    fn potential(self, [x, z]: [f64; 2]) -> f64 {
        match self {
            Self::Uniform => z,
            Self::Wave { decay, wave } => (-decay * z).exp() * (wave * x).cos(),
        }
    }
}

/// Twice the energy for each field.
#[derive(Clone, Debug)]
pub(crate) struct Energies {
    pub(crate) floating: Vec<f64>,
    pub(crate) grounded: Vec<f64>,
}

/// Nodes are numbered with z fastest. Of edges, each node has those to the next one along x and along z.
#[derive(Clone)]
pub(crate) struct Section {
    planes: [Vec<f64>; 2],
    weights: [Vec<f64>; 2],
    cut: [Vec<bool>; 2],
    held: Vec<bool>,
    links: Vec<f64>,
}

/// Where potentials come from.
#[derive(Clone, Copy)]
enum Node {
    Free(usize),
    Boundary,
    Held,
}

impl Section {
    /// Without a plate. The first of `planes[X]` is the one of symmetry.
    pub(crate) fn new(planes: [Vec<f64>; 2]) -> Self {
        let nodes = planes[X].len() * planes[Z].len();
        let weights = [vec![0.0; nodes], vec![0.0; nodes]];
        let cut = [vec![false; nodes], vec![false; nodes]];
        let mut section = Self { planes, weights, cut, held: vec![false; nodes], links: vec![0.0; nodes] };
        let shares = [X, Z].map(|axis| shares(&section.planes[axis]));
        for axis in [X, Z] {
            for (node, next) in section.edges(axis) {
                let [from, to] = [node, next].map(|node| section.position(node)[axis]);
                let share = shares[1 - axis][section.indices(node)[1 - axis]];
                section.weights[axis][node] = share / (to - from);
            }
        }
        section
    }

    fn indices(&self, node: usize) -> [usize; 2] {
        let rows = self.planes[Z].len();
        [node / rows, node % rows]
    }

    fn position(&self, node: usize) -> [f64; 2] {
        let [i, j] = self.indices(node);
        [self.planes[X][i], self.planes[Z][j]]
    }

    /// From one node to the next.
    fn stride(&self, axis: usize) -> usize {
        [self.planes[Z].len(), 1][axis]
    }

    fn edges(&self, axis: usize) -> Vec<(usize, usize)> {
        let stride = self.stride(axis);
        let has_next = |node: &usize| self.indices(*node)[axis] + 1 < self.planes[axis].len();
        (0..self.held.len()).filter(has_next).map(|node| (node, node + stride)).collect()
    }

    /// Holds nodes inside, and gives parts of cut edges to links, which are exact where fields are uniform along the edge.
    pub(crate) fn insert(&mut self, plate: Plate) {
        for node in 0..self.held.len() {
            let position = self.position(node);
            self.held[node] = [X, Z].into_iter().all(|axis| plate.covers(axis, position[axis]));
        }
        for axis in [X, Z] {
            let [start, end] = plate.span(axis);
            for (node, next) in self.edges(axis) {
                let [from, to] = [node, next].map(|node| self.position(node));
                let beside = !plate.covers(1 - axis, from[1 - axis]);
                let [from, to] = [from[axis], to[axis]];
                let apart = start >= to - IN_FACE || end <= from + IN_FACE;
                if beside || apart || (self.held[node] && self.held[next]) {
                    continue;
                }
                let through = self.weights[axis][node] * (to - from);
                for (node, gap) in [(node, start - from), (next, to - end)] {
                    if !self.held[node] {
                        self.links[node] += through / gap.max(SMALLEST_PART * (to - from));
                    }
                }
                self.cut[axis][node] = true;
                self.weights[axis][node] = 0.0;
            }
        }
    }

    /// Multiplies weights by 1 + `change(axis, from, to)`, the latter the positions of an edge's nodes.
    pub(crate) fn change_weights(&mut self, change: impl Fn(usize, [f64; 2], [f64; 2]) -> f64) {
        for axis in [X, Z] {
            for (node, next) in self.edges(axis) {
                self.weights[axis][node] *= 1.0 + change(axis, self.position(node), self.position(next));
            }
        }
    }

    /// Links nodes near the plate's edges so that the field at a right angle is in balance there, with weights as they are
    /// now; cells are `width` wide and 1 high.
    pub(crate) fn link_near_end(&mut self, plate: Plate, width: f64) {
        let mut linked = Vec::new();
        for node in 0..self.held.len() {
            let [x, z] = self.position(node);
            let (edge, outwards) =
                if z - plate.bottom < plate.top - z { (plate.bottom, -1.0) } else { (plate.top, 1.0) };
            let distance = ((x - plate.end) / width).hypot(z - edge);
            let [nearest, farthest] = BY_ANGLE;
            if self.held[node] || distance >= farthest {
                continue;
            }
            let potential = |node| {
                let [x, z] = self.position(node);
                at_right_angle(plate.end - x, (z - edge) * outwards)
            };
            let flow: f64 = self
                .neighbours(node)
                .into_iter()
                .map(|(weight, neighbour)| weight * (potential(neighbour) - potential(node)))
                .sum();
            let share = ((farthest - distance) / (farthest - nearest)).min(1.0);
            linked.push((node, share * flow / potential(node) + (1.0 - share) * self.links[node]));
        }
        for (node, link) in linked {
            self.links[node] = link;
        }
    }

    /// Over edges that the plate doesn't cut, of a node that is not at the boundary.
    fn neighbours(&self, node: usize) -> Vec<(f64, usize)> {
        let mut neighbours = Vec::with_capacity(4);
        for axis in [X, Z] {
            let stride = self.stride(axis);
            for (edge, neighbour) in [(node, node + stride), (node - stride, node - stride)] {
                if !self.cut[axis][edge] {
                    neighbours.push((self.weights[axis][edge], neighbour));
                }
            }
        }
        neighbours
    }

    /// With the plate without charge, and with it at zero.
    pub(crate) fn energies(&self, fields: &[Field]) -> Energies {
        let nodes: Vec<Node> = (0..self.held.len()).map(|node| self.node(node)).collect();
        let mut system = System::new((self.planes[X].len() - 1) * self.rows(), self.rows(), fields.len());
        let boundary =
            |node| fields.iter().map(|field| field.potential(self.position(node))).collect::<Vec<_>>();
        for axis in [X, Z] {
            for (node, next) in self.edges(axis) {
                let weight = self.weights[axis][node];
                match (nodes[node], nodes[next]) {
                    (Node::Free(a), Node::Free(b)) => system.matrix.connect(a, b, weight),
                    (Node::Free(free), Node::Boundary) => system.hold(free, weight, &boundary(next)),
                    (Node::Boundary, Node::Free(free)) => system.hold(free, weight, &boundary(node)),
                    (Node::Free(free), Node::Held) | (Node::Held, Node::Free(free)) => {
                        system.link(free, weight)
                    }
                    _ => {}
                }
            }
        }
        for (node, &link) in nodes.iter().zip(&self.links) {
            if let Node::Free(free) = *node {
                system.link(free, link);
            }
        }
        system.solve();
        let grounded: Vec<f64> = (0..fields.len())
            .map(|field| {
                self.energy(|node| match nodes[node] {
                    Node::Free(free) => system.potentials[field][free],
                    Node::Boundary => fields[field].potential(self.position(node)),
                    Node::Held => 0.0,
                })
            })
            .collect();
        let floating =
            grounded.iter().zip(&system.potentials).map(|(energy, of)| energy - system.saved(of)).collect();
        Energies { floating, grounded }
    }

    /// Of free nodes, per column.
    fn rows(&self) -> usize {
        self.planes[Z].len() - 2
    }

    fn node(&self, node: usize) -> Node {
        let [i, j] = self.indices(node);
        let [columns, rows] = [X, Z].map(|axis| self.planes[axis].len());
        if i + 1 == columns || j == 0 || j + 1 == rows {
            Node::Boundary
        } else if self.held[node] {
            Node::Held
        } else {
            Node::Free(i * self.rows() + j - 1)
        }
    }

    /// With the plate at zero.
    fn energy(&self, potential: impl Fn(usize) -> f64) -> f64 {
        let potentials: Vec<f64> = (0..self.held.len()).map(potential).collect();
        let along = |axis: usize| {
            let edges = self.edges(axis);
            let of = |(a, b): (usize, usize)| self.weights[axis][a] * (potentials[b] - potentials[a]).powi(2);
            edges.into_iter().map(of).sum::<f64>()
        };
        let links: f64 = self.links.iter().zip(&potentials).map(|(link, at)| link * at * at).sum();
        along(X) + along(Z) + links
    }
}

/// How much of an axis each plane stands for.
fn shares(planes: &[f64]) -> Vec<f64> {
    let mut shares = vec![0.0; planes.len()];
    for (k, pair) in planes.windows(2).enumerate() {
        let half = 0.5 * (pair[1] - pair[0]);
        shares[k] += half;
        shares[k + 1] += half;
    }
    shares
}

/// r^(2/3) sin(2θ/3) about a conductor that has x > 0, z < 0; zero inside.
fn at_right_angle(x: f64, z: f64) -> f64 {
    let angle = z.atan2(x).rem_euclid(2.0 * PI);
    if angle > 1.5 * PI { 0.0 } else { x.hypot(z).powf(2.0 / 3.0) * (angle / 1.5).sin() }
}

/// Equations for the potentials of free nodes, for one field after the other, and for the plate at 1 and no field.
struct System {
    matrix: Banded,
    potentials: Vec<Vec<f64>>,
    links: Vec<f64>,
    of_plate: Vec<f64>,
}

impl System {
    fn new(size: usize, band: usize, fields: usize) -> Self {
        let zeros = vec![0.0; size];
        Self {
            matrix: Banded::new(size, band),
            potentials: vec![zeros.clone(); fields],
            links: zeros.clone(),
            of_plate: zeros,
        }
    }

    fn hold(&mut self, free: usize, weight: f64, potentials: &[f64]) {
        self.matrix.add(free, weight);
        for (side, potential) in self.potentials.iter_mut().zip(potentials) {
            side[free] += weight * potential;
        }
    }

    fn link(&mut self, free: usize, weight: f64) {
        self.matrix.add(free, weight);
        self.links[free] += weight;
    }

    fn solve(&mut self) {
        self.matrix.factor();
        self.of_plate.clone_from(&self.links);
        for side in self.potentials.iter_mut().chain([&mut self.of_plate]) {
            self.matrix.solve(side);
        }
    }

    /// By how much a plate without charge has less energy than a grounded one: its charge, squared, by its capacitance.
    fn saved(&self, potentials: &[f64]) -> f64 {
        let charge: f64 = self.links.iter().zip(potentials).map(|(link, at)| link * at).sum();
        let capacitance: f64 =
            self.links.iter().zip(&self.of_plate).map(|(link, at)| link * (1.0 - at)).sum();
        // Without a plate there are no links.
        if capacitance == 0.0 { 0.0 } else { charge * charge / capacitance }
    }
}

/// A symmetric matrix, by columns from the diagonal down; then its LDLᵀ, as links near edges, and so what is on the
/// diagonal, may be negative.
struct Banded {
    size: usize,
    stride: usize,
    columns: Vec<f64>,
}

impl Banded {
    fn new(size: usize, band: usize) -> Self {
        let stride = band + 1;
        Self { size, stride, columns: vec![0.0; size * stride] }
    }

    fn add(&mut self, node: usize, weight: f64) {
        self.columns[node * self.stride] += weight;
    }

    fn connect(&mut self, from: usize, to: usize, weight: f64) {
        self.add(from, weight);
        self.add(to, weight);
        self.columns[from * self.stride + to - from] -= weight;
    }

    fn factor(&mut self) {
        let stride = self.stride;
        for k in 0..self.size {
            let (done, rest) = self.columns.split_at_mut((k + 1) * stride);
            let column = &mut done[k * stride..];
            // Rows of what is no free node.
            if column[0] == 0.0 {
                column[0] = 1.0;
            }
            for below in 1..stride.min(self.size - k) {
                let factor = column[below] / column[0];
                if factor != 0.0 {
                    let changed = &mut rest[(below - 1) * stride..][..stride - below];
                    for (entry, of) in changed.iter_mut().zip(&column[below..]) {
                        *entry -= factor * of;
                    }
                }
            }
            let pivot = column[0];
            for entry in &mut column[1..] {
                *entry /= pivot;
            }
        }
    }

    fn solve(&self, side: &mut [f64]) {
        for (k, column) in self.columns.chunks(self.stride).enumerate() {
            let (solved, below) = side[k..].split_at_mut(1);
            for (value, factor) in below.iter_mut().zip(&column[1..]) {
                *value -= factor * solved[0];
            }
        }
        for (k, column) in self.columns.chunks(self.stride).enumerate().rev() {
            let (value, below) = side[k..].split_at_mut(1);
            let sum: f64 = below.iter().zip(&column[1..]).map(|(value, factor)| factor * value).sum();
            value[0] = value[0] / column[0] - sum;
        }
    }
}
