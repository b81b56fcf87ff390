//! The dense equations of a frame, and the energies that they make of those of the empty scene.
//!
//! With points that are drawn to τ by potentials of the empty scene φ0, with compliances κ, Green's function G between them
//! and B = φ0 - τ, energies grow by Bᵀ (G + κ)⁻¹ B. What is left of G on the nodes of other changes D, R = L Lᵀ, comes out of
//! the same Cholesky factorisation, and so do the potentials φ there, and D φ less what is drawn, ρ. Then energies change
//! by φᵀDφ - 2 φᵀd - ρᵀ L (1 + LᵀDL)⁻¹ Lᵀ ρ. Both factorisations are of symmetric matrices that are positive definite
//! wherever K is.

use super::changes::{Changes, Point};
use super::table::Empty;
use faer::dyn_stack::MemStack;
use faer::linalg::cholesky::llt::factor::{cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::{Accum, MatMut, MatRef, Par};
use std::mem::MaybeUninit;

/// An unknown: places in the table, and parts of them.
#[derive(Clone, Copy, Debug)]
struct Place {
    at: [u32; 2],
    parts: [f64; 2],
}

/// Potentials that unit charges at two places make, and parts of them.
#[derive(Clone, Copy)]
struct Charged<'a> {
    potentials: [&'a [f64]; 2],
    parts: [f64; 2],
}

impl Place {
    fn charged(self, empty: &Empty) -> Charged<'_> {
        Charged { potentials: self.at.map(|at| empty.of_charge_at(at as usize)), parts: self.parts }
    }

    #[inline(always)]
    fn potential(&self, charged: Charged<'_>) -> f64 {
        let [from_a, from_b] = charged.potentials;
        let at = |place: u32| {
            charged.parts[0] * from_a[place as usize] + charged.parts[1] * from_b[place as usize]
        };
        self.parts[0] * at(self.at[0]) + self.parts[1] * at(self.at[1])
    }
}

/// Working storage for up to `capacity` unknowns, by columns.
#[derive(Clone, Debug)]
pub(super) struct System {
    columns: usize,
    points: usize,
    unknowns: usize,
    places: Vec<Place>,
    /// The factor of G and compliances, scaled to a unit diagonal.
    factor: Vec<f64>,
    scale: Vec<f64>,
    /// B, then what the factor makes of it; below, potentials of nodes.
    right: Vec<f64>,
    /// D L, and 1 + LᵀDL, and its factor.
    product: Vec<f64>,
    inner: Vec<f64>,
    /// ρ, and what the inner factor makes of it.
    rest: Vec<f64>,
    inner_right: Vec<f64>,
    pub(super) energies: Vec<f64>,
    scratch: Vec<MaybeUninit<u8>>,
}

impl System {
    pub(super) fn new(capacity: usize, columns: usize) -> Self {
        let request = cholesky_in_place_scratch::<f64>(capacity, Par::Seq, Default::default());
        Self {
            columns,
            points: 0,
            unknowns: 0,
            places: Vec::with_capacity(capacity),
            factor: vec![0.0; capacity * capacity],
            scale: vec![0.0; capacity],
            right: vec![0.0; capacity * columns],
            product: Vec::new(),
            inner: Vec::new(),
            rest: Vec::new(),
            inner_right: Vec::new(),
            energies: vec![0.0; columns * columns],
            scratch: vec![MaybeUninit::uninit(); request.unaligned_bytes_required()],
        }
    }

    /// Factorises and computes the energies. Returns their relative error as the factors tell it, or `None` where a matrix
    /// is not positive definite.
    pub(super) fn solve(&mut self, empty: &Empty, changes: &Changes) -> Option<f64> {
        (self.points, self.unknowns) = (changes.points.len(), changes.len());
        self.fill(empty, changes)?;
        self.energies.copy_from_slice(&empty.energies);
        self.energies.iter_mut().zip(&changes.known).for_each(|(energy, known)| *energy += known);
        let size = self.unknowns;
        let matrix = MatMut::from_column_major_slice_mut(&mut self.factor[..size * size], size, size);
        factorise(matrix, &mut self.scratch)?;
        let smallest = (0..size).map(|k| self.factor[k * size + k]).fold(1.0, f64::min);
        let taken = self.add_points();
        let mut amplified = taken / (smallest * smallest);
        if size > self.points {
            amplified += self.add_nodes(changes)?;
        }
        let columns = self.columns;
        for (s, t) in (0..columns).flat_map(|s| (0..s).map(move |t| (s, t))) {
            let mean = 0.5 * (self.energies[s * columns + t] + self.energies[t * columns + s]);
            self.energies[s * columns + t] = mean;
            self.energies[t * columns + s] = mean;
        }
        let error = f64::EPSILON * (1.0 + amplified);
        (error.is_finite() && self.energies.iter().all(|energy| energy.is_finite())).then_some(error)
    }

    /// G and compliances scaled to a unit diagonal, and B with it.
    fn fill(&mut self, empty: &Empty, changes: &Changes) -> Option<()> {
        let size = self.unknowns;
        let at_node = |node: &u32| Point { nodes: [*node; 2], parts: [1.0, 0.0], compliance: 0.0 };
        let all = changes.points.iter().copied().chain(changes.nodes.iter().map(at_node));
        self.places.clear();
        for (k, Point { nodes, parts, compliance }) in all.enumerate() {
            let place = Place { at: nodes.map(|node| empty.place(node) as u32), parts };
            let diagonal = place.potential(place.charged(empty)) + compliance;
            if !(diagonal > 0.0 && diagonal.is_finite()) {
                return None;
            }
            let scale = 1.0 / diagonal.sqrt();
            self.scale[k] = scale;
            for column in 0..self.columns {
                let target = changes.targets.get(k * self.columns + column).map_or(0.0, |target| *target);
                let [a, b] = nodes.map(|node| empty.fields(node)[column]);
                self.right[column * size + k] = scale * (parts[0] * a + parts[1] * b - target);
            }
            self.places.push(Place { parts: parts.map(|part| scale * part), ..place });
        }
        for (column, place) in self.places.iter().enumerate() {
            let rows = &mut self.factor[column * size..][..size];
            let charged = place.charged(empty);
            rows[column] = 1.0;
            for (value, place) in rows.iter_mut().zip(&self.places).skip(column + 1) {
                *value = place.potential(charged);
            }
        }
        Some(())
    }

    /// Adds what points add, and returns the largest part that it is of an energy.
    fn add_points(&mut self) -> f64 {
        let (size, points, columns) = (self.unknowns, self.points, self.columns);
        let factor = MatRef::from_column_major_slice(&self.factor[..size * size], size, size);
        let right = MatMut::from_column_major_slice_mut(&mut self.right[..size * columns], size, columns);
        let (mut at_points, mut at_nodes) = right.split_at_row_mut(points);
        let (upper, lower) = factor.split_at_row(points);
        solve_lower_triangular_in_place(upper.subcols(0, points), at_points.as_mut(), Par::Seq);
        matmul(at_nodes.as_mut(), Accum::Add, lower.subcols(0, points), at_points.as_ref(), -1.0, Par::Seq);
        let at_points = at_points.as_ref();
        let energies = MatMut::from_column_major_slice_mut(&mut self.energies, columns, columns);
        matmul(energies, Accum::Add, at_points.transpose(), at_points, 1.0, Par::Seq);
        let own =
            |column: usize| at_points.col(column).squared_norm_l2() / self.energies[column * (columns + 1)];
        (0..columns).map(own).filter(|part| part.is_finite()).fold(0.0, f64::max)
    }

    /// D L and ρ of the nodes.
    fn fill_nodes(&mut self, changes: &Changes) {
        let (size, points, columns) = (self.unknowns, self.points, self.columns);
        let nodes = size - points;
        for (storage, length) in [
            (&mut self.product, nodes * nodes),
            (&mut self.inner, nodes * nodes),
            (&mut self.rest, nodes * columns),
            (&mut self.inner_right, nodes * columns),
        ] {
            storage.clear();
            storage.resize(length, 0.0);
        }
        let scale = &self.scale[points..size];
        for column in 0..nodes {
            let lower = &self.factor[(points + column) * size + points..][..nodes];
            multiply(changes, scale, lower, column, &mut self.product[column * nodes..][..nodes]);
        }
        for column in 0..columns {
            let field = &self.right[column * size + points..][..nodes];
            let rest = &mut self.rest[column * nodes..][..nodes];
            multiply(changes, scale, field, 0, rest);
            for node in 0..nodes {
                rest[node] -= changes.drawn[node * columns + column] / scale[node];
            }
        }
    }

    /// Adds what other changes add, and returns the largest part that it is of an energy, times how far it is amplified.
    fn add_nodes(&mut self, changes: &Changes) -> Option<f64> {
        self.fill_nodes(changes);
        self.add_forced(changes);
        let (size, points, columns) = (self.unknowns, self.points, self.columns);
        let nodes = size - points;
        let factor = MatRef::from_column_major_slice(&self.factor[..size * size], size, size);
        let lower = factor.submatrix(points, points, nodes, nodes);
        let product = MatRef::from_column_major_slice(&self.product, nodes, nodes);
        let rest = MatRef::from_column_major_slice(&self.rest, nodes, columns);
        let mut inner = MatMut::from_column_major_slice_mut(&mut self.inner, nodes, nodes);
        let mut right = MatMut::from_column_major_slice_mut(&mut self.inner_right, nodes, columns);
        (0..nodes).for_each(|k| inner[(k, k)] = 1.0);
        let by_factor = |to: MatMut<'_, f64>, part: BlockStructure, of: MatRef<'_, f64>| {
            let (half, all) = (BlockStructure::TriangularUpper, BlockStructure::Rectangular);
            triangular::matmul(to, part, Accum::Add, lower.transpose(), half, of, all, 1.0, Par::Seq);
        };
        by_factor(inner.as_mut(), BlockStructure::TriangularLower, product);
        by_factor(right.as_mut(), BlockStructure::Rectangular, rest);
        factorise(inner.as_mut(), &mut self.scratch)?;
        solve_lower_triangular_in_place(inner.as_ref(), right.as_mut(), Par::Seq);
        let right = right.as_ref();
        let energies = MatMut::from_column_major_slice_mut(&mut self.energies, columns, columns);
        matmul(energies, Accum::Add, right.transpose(), right, -1.0, Par::Seq);
        let pivots = (0..nodes).map(|k| inner[(k, k)]);
        let (least, most) =
            pivots.fold((f64::INFINITY, 0.0_f64), |(a, b), pivot| (a.min(pivot), b.max(pivot)));
        let own = |column: usize| right.col(column).squared_norm_l2() / self.energies[column * (columns + 1)];
        let taken = (0..columns).map(own).filter(|part| part.is_finite()).fold(0.0, f64::max);
        Some(taken * (most / least).powi(2))
    }

    /// φᵀDφ - 2 φᵀd of the nodes' potentials φ: φᵀρ - dᵀφ.
    fn add_forced(&mut self, changes: &Changes) {
        let (size, points, columns) = (self.unknowns, self.points, self.columns);
        let nodes = size - points;
        let right = MatRef::from_column_major_slice(&self.right[..size * columns], size, columns);
        let fields = right.subrows(points, nodes);
        let rest = MatRef::from_column_major_slice(&self.rest, nodes, columns);
        let mut energies = MatMut::from_column_major_slice_mut(&mut self.energies, columns, columns);
        matmul(energies.as_mut(), Accum::Add, fields.transpose(), rest, 1.0, Par::Seq);
        for node in 0..nodes {
            let drawn = &changes.drawn[node * columns..][..columns];
            for (s, drawn) in drawn.iter().enumerate().filter(|(_, drawn)| **drawn != 0.0) {
                for t in 0..columns {
                    energies[(s, t)] -= drawn / self.scale[points + node] * fields[(node, t)];
                }
            }
        }
    }

    /// The charges, scaled, all unknowns of each column, that make the frame's potentials of those of the empty scene.
    pub(super) fn charges(&self) -> Vec<f64> {
        let (size, points, columns) = (self.unknowns, self.points, self.columns);
        let nodes = size - points;
        let mut charges = self.right[..size * columns].to_vec();
        let factor = MatRef::from_column_major_slice(&self.factor[..size * size], size, size);
        let (upper, lower) = factor.split_at_row(points);
        if nodes > 0 {
            // D φ less what is drawn, of the frame's potentials φ, is L⁻ᵀ (1 + LᵀDL)⁻¹ Lᵀ ρ: computed from φ it would lose
            // digits as D is large.
            let mut reaction = self.inner_right.clone();
            let inner = MatRef::from_column_major_slice(&self.inner, nodes, nodes);
            let mut right = MatMut::from_column_major_slice_mut(&mut reaction, nodes, columns);
            solve_upper_triangular_in_place(inner.transpose(), right.as_mut(), Par::Seq);
            let own = factor.submatrix(points, points, nodes, nodes);
            solve_upper_triangular_in_place(own.transpose(), right, Par::Seq);
            for (charges, reaction) in charges.chunks_mut(size).zip(reaction.chunks(nodes)) {
                charges[points..].copy_from_slice(reaction);
            }
        }
        let all = MatMut::from_column_major_slice_mut(&mut charges, size, columns);
        let (mut at_points, at_nodes) = all.split_at_row_mut(points);
        let below = lower.subcols(0, points);
        matmul(at_points.as_mut(), Accum::Add, below.transpose(), at_nodes.as_ref(), -1.0, Par::Seq);
        solve_upper_triangular_in_place(upper.subcols(0, points).transpose(), at_points, Par::Seq);
        charges
    }

    /// What [`System::charges`] add to the potential of a node in one column.
    pub(super) fn reaction(&self, empty: &Empty, charges: &[f64], column: usize, node: u32) -> f64 {
        let from = empty.of_charge_at(empty.place(node));
        let charges = &charges[column * self.unknowns..][..self.unknowns];
        let one = Charged { potentials: [from; 2], parts: [1.0, 0.0] };
        let potentials = self.places.iter().map(|place| place.potential(one));
        -potentials.zip(charges).map(|(potential, charge)| potential * charge).sum::<f64>()
    }
}

/// product += D x, scaled, of x that is zero above `first`.
fn multiply(changes: &Changes, scale: &[f64], x: &[f64], first: usize, product: &mut [f64]) {
    for (node, weight) in changes.weights.iter().enumerate().skip(first) {
        product[node] += weight / (scale[node] * scale[node]) * x[node];
    }
    for pair in &changes.between {
        let [a, b] = pair.ends.map(|end| end as usize);
        let weight = pair.weight / (scale[a] * scale[b]);
        if b >= first {
            product[a] -= weight * x[b];
        }
        if a >= first {
            product[b] -= weight * x[a];
        }
    }
}

/// The lower Cholesky factor in place of the lower half.
fn factorise(matrix: MatMut<'_, f64>, scratch: &mut [MaybeUninit<u8>]) -> Option<()> {
    let stack = MemStack::new(scratch);
    cholesky_in_place(matrix, Default::default(), Par::Seq, stack, Default::default()).ok().map(|_| ())
}
