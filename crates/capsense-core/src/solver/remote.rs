//! Fields that are solved for elsewhere, on a graphics device say: what the rest of the solver tells of K and of what is
//! held, and what comes back.

use super::SolveError;
use super::lattice::coarsenings;
use crate::material::Material;
use crate::mesh::Lattice;
use crate::occupancy::Contact;
use crate::stiffness::StiffnessMatrix;
use std::collections::BTreeMap;
use std::fmt::Debug;
use std::sync::OnceLock;

/// The holder of a node whose potential is unknown.
pub const NO_HOLDER: u32 = u32::MAX;

/// The holder of a node at 0 V in every column.
pub const HELD_AT_ZERO: u32 = u32::MAX - 1;

/// What single precision makes of the width of a gap in parts of an edge, and of potentials across it. Seen at most: 2e-7.
const ROUNDING_OF_GAPS: f64 = 1e-6;

/// What a lattice's nodes are and how many fields there are, before anything is known of K.
#[derive(Clone, Debug)]
pub struct RemoteProblem {
    /// The lattice; nodes are numbered as it does.
    pub lattice: Lattice,
    /// Number of fields: one for each electrode and for each object that finds its own potential.
    pub columns: usize,
}

impl RemoteProblem {
    /// How the lattice is made coarser, step by step: which planes across x, y and z are kept of those of the step before.
    /// Nodes become fewer by `reduction` at least in each step; no two neighbouring planes are given up, nor the first or
    /// the last.
    pub fn coarsenings(&self, reduction: f64) -> Vec<[Vec<bool>; 3]> {
        coarsenings(&self.lattice, reduction)
    }
}

/// The row of one node: farads over ε0, that is metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodeRow {
    /// Number of the node.
    pub node: u32,
    /// Weights to the next node along x, y and z; zero where there is none.
    pub next: [f32; 3],
    /// Sum of the weights of its links.
    pub leak: f32,
    /// The column in which it is held at 1 V, at 0 V in all others; or [`HELD_AT_ZERO`], or [`NO_HOLDER`].
    pub holder: u32,
}

/// The row of one node of a mesh that is no lattice, but for the weights to its neighbours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NetworkRow {
    /// Number of the node.
    pub node: u32,
    /// As in [`NodeRow`].
    pub leak: f32,
    /// As in [`NodeRow`].
    pub holder: u32,
}

/// Rows of such a mesh.
#[derive(Clone, Copy, Debug, Default)]
pub struct NetworkRows<'a> {
    /// The rows.
    pub rows: &'a [NetworkRow],
    /// Their weights to neighbours, row after row, each in the order of
    /// [`NetworkProblem::neighbours`](super::NetworkProblem::neighbours).
    pub weights: &'a [f32],
}

/// What the links of one node lead to: Σ w V over its links in one column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Feed {
    /// Number of the node.
    pub node: u32,
    /// Number of the column.
    pub column: u32,
    /// The sum.
    pub charge: f32,
}

/// What differs from the frame before.
#[derive(Clone, Copy, Debug, Default)]
pub struct Changes<'a> {
    /// Rows of a lattice that changed. A node that is no longer held keeps its potential as a first guess.
    pub rows: &'a [NodeRow],
    /// Rows of any other mesh that did.
    pub network: NetworkRows<'a>,
    /// Feeds that changed; those that were never told are zero.
    pub feeds: &'a [Feed],
    /// Columns whose fields are to start from zero where nothing holds them.
    pub emptied: &'a [usize],
}

/// What a solve reached.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RemoteSolution {
    /// Σ w (x_s - x_s')(x_t - x_t') over edges, plus what [`of_links`] tells of each node, for all pairs of columns, row by
    /// row.
    pub energies: Vec<f64>,
    /// What each column's energy may still fall by, as estimated.
    pub to_come: Vec<f64>,
    /// Number of iterations.
    pub iterations: usize,
    /// Recomputed residual on free nodes over the charges on the column's own, the largest of all columns.
    pub residual: f64,
    /// Kernels that the device launched for it, and for others of a batch along with it.
    pub launches: usize,
    /// What it found of objects before, if it finds them by itself and they were placed anew.
    pub found: Option<Found>,
}

/// What a device tells of objects that it finds by itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Found {
    /// Number of edges whose coupling or ends changed.
    pub changed_edges: usize,
    /// Conducting objects that touch electrodes, in increasing order.
    pub contacts: Vec<Contact>,
}

/// What the links of a node add to the energy of two columns in which it is at x and y and has these feeds. Most nodes with
/// links have them to one potential, and differences from that keep digits that products do not.
pub fn of_links(leak: f32, [x, y]: [f32; 2], [feed_x, feed_y]: [f32; 2]) -> f32 {
    match potential_of_links(leak, [feed_x, feed_y]) {
        Some([to_x, to_y]) => leak * (x - to_x) * (y - to_y),
        None => leak * x * y - feed_x * y - feed_y * x,
    }
}

/// The mean potentials that a node's links lead to, where its leak is that of capacitances.
fn potential_of_links(leak: f32, feeds: [f32; 2]) -> Option<[f32; 2]> {
    feeds.iter().all(|feed| leak > 0.5 * feed.abs()).then(|| feeds.map(|feed| feed / leak))
}

/// A solver that keeps the fields.
pub trait RemoteFields: Debug + Send {
    /// Takes over what changed. Nothing needs to happen before the next solve.
    ///
    /// # Errors
    /// When the device is lost or its memory does not suffice.
    fn update(&mut self, changes: Changes<'_>) -> Result<(), SolveError>;

    /// Tells of a solve to come: what computes many fields at once may begin with all of which that is known.
    fn announce(&mut self, allowed: Option<&[f64]>, max_iterations: usize) {
        let _ = (allowed, max_iterations);
    }

    /// Improves the fields until no column's energy may fall by more than `allowed`, or after so many iterations. Where
    /// nothing is known of energies yet, it is as far as single precision goes.
    ///
    /// # Errors
    /// When the device fails.
    fn solve(&mut self, allowed: Option<&[f64]>, max_iterations: usize)
    -> Result<RemoteSolution, SolveError>;

    /// For how many nodes and columns these are.
    fn shape(&self) -> [usize; 2];

    /// Whether the mesh is no lattice: rows are told as [`NetworkRows`].
    fn is_of_network(&self) -> bool {
        false
    }

    /// What the objects are made of that it finds by itself, if it does. Then it is told of rows of the empty scene only, it keeps
    /// what objects make of them, and [`RemoteSolution::energies`] are all of the energies.
    fn finds(&self) -> Option<Vec<Material>> {
        None
    }

    /// Has the next solve find the objects if they were placed anew since this was last called, and returns whether they were.
    fn take_placed(&mut self) -> bool {
        false
    }

    /// The potentials of all nodes in one column.
    ///
    /// # Errors
    /// When the device fails.
    fn potentials(&self, column: usize) -> Result<Vec<f32>, SolveError>;

    /// Another of these, in the same state.
    ///
    /// # Errors
    /// When the device fails or has no room for it.
    fn duplicate(&self) -> Result<Box<dyn RemoteFields>, SolveError>;
}

/// In place of a copy that could not be made: every call tells why.
#[derive(Debug)]
struct NotCopied(SolveError);

impl RemoteFields for NotCopied {
    fn update(&mut self, _changes: Changes<'_>) -> Result<(), SolveError> {
        Err(self.0.clone())
    }

    fn solve(
        &mut self,
        _allowed: Option<&[f64]>,
        _max_iterations: usize,
    ) -> Result<RemoteSolution, SolveError> {
        Err(self.0.clone())
    }

    fn shape(&self) -> [usize; 2] {
        [0, 0]
    }

    fn potentials(&self, _column: usize) -> Result<Vec<f32>, SolveError> {
        Err(self.0.clone())
    }

    fn duplicate(&self) -> Result<Box<dyn RemoteFields>, SolveError> {
        Err(self.0.clone())
    }
}

/// Fields that are elsewhere.
#[derive(Debug)]
pub(crate) struct RemoteSolver {
    remote: Box<dyn RemoteFields>,
    columns: usize,
    nodes: usize,
    /// For each node the column that holds it at 1 V, if one does.
    holders: Vec<Option<u32>>,
    /// Potentials of electrodes' and objects' rows, row by row.
    bodies: Vec<f64>,
    /// By node and column.
    feeds: BTreeMap<(u32, u32), f64>,
    emptied: Vec<usize>,
    /// Whether something changed since the last solve that was exact enough.
    is_changed: bool,
    /// What links add to energies that does not depend on potentials of nodes, less what [`of_links`] has of it.
    constant: Vec<f64>,
    /// Room for what changed.
    rows: Vec<NodeRow>,
    network_rows: Vec<NetworkRow>,
    weights: Vec<f32>,
    changed_feeds: Vec<Feed>,
    /// Why an update failed: the next solve tells.
    failed: Option<SolveError>,
    /// Potentials that were asked for since the last solve.
    read: Vec<OnceLock<Vec<f32>>>,
    /// What was found of objects elsewhere, if they are found there.
    found: Option<Found>,
    /// Each column's energy if all around what holds it were at 0 V in the first scene, the empty one. Where no gap is narrower
    /// than an edge, there is no more.
    most_without_gaps: Vec<f64>,
}

impl Clone for RemoteSolver {
    fn clone(&self) -> Self {
        let Self { columns, nodes, .. } = *self;
        Self {
            remote: self.remote.duplicate().unwrap_or_else(|error| Box::new(NotCopied(error))),
            columns,
            nodes,
            holders: self.holders.clone(),
            bodies: self.bodies.clone(),
            feeds: self.feeds.clone(),
            emptied: self.emptied.clone(),
            is_changed: true,
            constant: self.constant.clone(),
            rows: Vec::new(),
            network_rows: Vec::new(),
            weights: Vec::new(),
            changed_feeds: Vec::new(),
            failed: self.failed.clone(),
            read: vec![OnceLock::new(); columns],
            found: self.found.clone(),
            most_without_gaps: self.most_without_gaps.clone(),
        }
    }
}

impl RemoteSolver {
    /// Zero fields, with so many rows behind those of the nodes.
    pub(crate) fn new(remote: Box<dyn RemoteFields>, columns: usize, nodes: usize, bodies: usize) -> Self {
        let found = remote.finds().map(|_| Found::default());
        Self {
            remote,
            columns,
            nodes,
            found,
            holders: vec![None; nodes],
            bodies: vec![0.0; bodies * columns],
            feeds: BTreeMap::new(),
            emptied: (0..columns).collect(),
            is_changed: true,
            constant: vec![0.0; columns * columns],
            rows: Vec::new(),
            network_rows: Vec::new(),
            weights: Vec::new(),
            changed_feeds: Vec::new(),
            failed: None,
            read: vec![OnceLock::new(); columns],
            most_without_gaps: Vec::new(),
        }
    }

    /// Notes what holds a row: 1 V in the column of its holder. Potentials of free nodes are the remote's own.
    pub(crate) fn set_potential(&mut self, column: usize, row: usize, potential: f64) {
        if let Some(body) = row.checked_sub(self.nodes) {
            self.bodies[body * self.columns + column] = potential;
        } else if potential == 1.0 {
            self.holders[row] = Some(column as u32);
        } else if self.holders[row] == Some(column as u32) {
            self.holders[row] = None;
        }
    }

    /// Whether the fields are those of the last solve that was exact enough.
    pub(crate) fn is_settled(&self) -> bool {
        !self.is_changed && self.failed.is_none()
    }

    /// The last solve was exact enough.
    pub(crate) fn settle(&mut self) {
        self.is_changed = false;
    }

    /// Starts all columns from zero: a solve failed.
    pub(crate) fn empty_all(&mut self) {
        (0..self.columns).for_each(|column| self.empty(column));
    }

    /// Starts a column from zero.
    pub(crate) fn empty(&mut self, column: usize) {
        self.is_changed = true;
        if !self.emptied.contains(&column) {
            self.emptied.push(column);
        }
    }

    /// Has objects that are found elsewhere found again if they were placed anew, and returns whether they were. All that links add
    /// to energies is known there from then on.
    pub(crate) fn take_placed(&mut self) -> bool {
        let is_news = self.remote.take_placed();
        if is_news {
            self.is_changed = true;
            self.constant.fill(0.0);
        } else if let Some(found) = &mut self.found {
            found.changed_edges = 0;
        }
        is_news
    }

    /// What was found of objects elsewhere, if they are found there.
    pub(crate) fn found(&self) -> Option<&Found> {
        self.found.as_ref()
    }

    /// Tells of rows, and of all links.
    pub(crate) fn refresh(&mut self, matrix: &StiffnessMatrix, fixed: &[bool], changed: &[u32]) {
        self.rows.clear();
        self.network_rows.clear();
        self.weights.clear();
        for &node in changed {
            let row = node as usize;
            let holder = if fixed[row] { self.holders[row].unwrap_or(HELD_AT_ZERO) } else { NO_HOLDER };
            let leak = matrix.link_weight(row) as f32;
            if matrix.is_lattice() {
                let next = [0, 1, 2].map(|axis| matrix.lattice_weight(row, axis) as f32);
                self.rows.push(NodeRow { node, next, leak, holder });
            } else {
                self.network_rows.push(NetworkRow { node, leak, holder });
                self.weights.extend(matrix.row(row).map(|(_, weight)| weight as f32));
            }
        }
        self.collect_feeds(matrix);
        if self.most_without_gaps.is_empty() {
            self.most_without_gaps = self.energies_in_nothing(matrix);
        }
        self.is_changed |= !(changed.is_empty() && self.changed_feeds.is_empty());
        let network = NetworkRows { rows: &self.network_rows, weights: &self.weights };
        let changes =
            Changes { rows: &self.rows, network, feeds: &self.changed_feeds, emptied: &self.emptied };
        self.failed = self.remote.update(changes).err().or(self.failed.take());
        self.emptied.clear();
    }

    /// Each column's energy if all around what holds it were at 0 V.
    fn energies_in_nothing(&self, matrix: &StiffnessMatrix) -> Vec<f64> {
        let mut energies = vec![0.0; self.columns];
        for (node, holder) in self.holders.iter().enumerate() {
            let Some(column) = holder else { continue };
            let leaves = matrix.row(node).filter(|(other, _)| self.holders[*other] != *holder);
            energies[*column as usize] += leaves.map(|(_, weight)| weight).sum::<f64>();
        }
        for (_, row, weight) in matrix.links() {
            let potentials = &self.bodies[(row - self.nodes) * self.columns..][..self.columns];
            energies.iter_mut().zip(potentials).for_each(|(energy, volts)| *energy += weight * volts * volts);
        }
        energies
    }

    /// What single precision makes of a column's energy in gaps that are narrower than edges, in parts of it. Charges across a
    /// gap are inverse to its width and go with the difference of potentials across it, and single precision knows widths as parts
    /// of an edge and differences as parts of a volt.
    pub(crate) fn lost_in_gaps(&self, column: usize, energy: f64) -> f64 {
        let most = self.most_without_gaps.get(column).filter(|most| **most > 0.0);
        most.map_or(0.0, |most| ROUNDING_OF_GAPS * (energy / most - 1.0).max(0.0))
    }

    fn collect_feeds(&mut self, matrix: &StiffnessMatrix) {
        let mut feeds = BTreeMap::new();
        self.constant.fill(0.0);
        for (node, row, weight) in matrix.links() {
            let potentials = &self.bodies[(row - self.nodes) * self.columns..][..self.columns];
            for (s, of_s) in potentials.iter().enumerate().filter(|(_, potential)| **potential != 0.0) {
                *feeds.entry((node as u32, s as u32)).or_default() += weight * of_s;
                for (t, of_t) in potentials.iter().enumerate() {
                    self.constant[s * self.columns + t] += weight * of_s * of_t;
                }
            }
        }
        self.changed_feeds.clear();
        let feed = |(node, column): (u32, u32), charge: f64| Feed { node, column, charge: charge as f32 };
        let gone =
            self.feeds.keys().filter(|place| !feeds.contains_key(place)).map(|&place| feed(place, 0.0));
        self.changed_feeds.extend(gone);
        let is_new = |(place, charge): &(&(u32, u32), &f64)| self.feeds.get(place) != Some(charge);
        self.changed_feeds.extend(feeds.iter().filter(is_new).map(|(&place, &charge)| feed(place, charge)));
        self.feeds = feeds;
        self.take_what_is_told(matrix);
    }

    /// Takes from the constant part what [`of_links`] of nodes has of it.
    fn take_what_is_told(&mut self, matrix: &StiffnessMatrix) {
        for (&(node, s), &of_s) in &self.feeds {
            let leak = matrix.link_weight(node as usize) as f32;
            for (&(_, t), &of_t) in self.feeds.range((node, 0)..=(node, u32::MAX)) {
                if let Some([to_s, to_t]) = potential_of_links(leak, [of_s as f32, of_t as f32]) {
                    let told = f64::from(leak) * f64::from(to_s) * f64::from(to_t);
                    self.constant[s as usize * self.columns + t as usize] -= told;
                }
            }
        }
    }

    /// Tells of a solve to come.
    pub(crate) fn announce(&mut self, allowed: Option<&[f64]>, max_iterations: usize) {
        self.remote.announce(allowed, max_iterations);
    }

    /// Improves the fields; energies come back with what links add.
    pub(crate) fn solve(
        &mut self,
        allowed: Option<&[f64]>,
        max_iterations: usize,
    ) -> Result<RemoteSolution, SolveError> {
        self.read.fill(OnceLock::new());
        if let Some(error) = self.failed.take() {
            return Err(error);
        }
        if !self.emptied.is_empty() {
            self.remote.update(Changes { emptied: &self.emptied, ..Changes::default() })?;
            self.emptied.clear();
        }
        let mut solution = self.remote.solve(allowed, max_iterations)?;
        self.found = solution.found.take().or(self.found.take());
        solution.energies.iter_mut().zip(&self.constant).for_each(|(energy, constant)| *energy += constant);
        match solution.energies.iter().position(|energy| !energy.is_finite()) {
            Some(at) => {
                Err(SolveError::NonFinite { column: at / self.columns, iteration: solution.iterations })
            }
            None => Ok(solution),
        }
    }

    /// Reads a column's potentials back, unless that was done since the last solve.
    ///
    /// # Errors
    /// When the device fails.
    pub(crate) fn read(&self, column: usize) -> Result<(), SolveError> {
        if self.read[column].get().is_none() {
            let potentials = self.remote.potentials(column)?;
            let _ = self.read[column].set(potentials);
        }
        Ok(())
    }

    /// The potential of a row in one column; zero of nodes of a column that was not read.
    pub(crate) fn potential(&self, column: usize, row: usize) -> f64 {
        match row.checked_sub(self.nodes) {
            Some(body) => self.bodies[body * self.columns + column],
            None => self.read[column].get().map_or(0.0, |potentials| f64::from(potentials[row])),
        }
    }
}
