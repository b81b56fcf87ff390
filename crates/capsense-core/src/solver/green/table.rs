//! The empty scene: its Green's function between free nodes, its fields and energies, and what is held in it.

use crate::stiffness::StiffnessMatrix;

/// Most free nodes that a table is made for: 128 MB.
const MOST_NODES: usize = 4_000;

/// The column whose terminal a held row belongs to; `None` of what is grounded.
pub(super) type Holder = Option<u32>;

/// What does not change from frame to frame.
#[derive(Clone, Debug)]
pub(crate) struct Empty {
    pub(super) columns: usize,
    /// Of each row, nodes and then electrodes and objects.
    holder: Vec<Holder>,
    fixed: Vec<bool>,
    /// Potentials of each node, all columns.
    fields: Vec<f64>,
    /// XᵀKX.
    pub(super) energies: Vec<f64>,
    /// Weights of the links that are there without objects.
    pub(super) rim: Vec<f64>,
    pub(super) first_object: usize,
    /// Place of each node in the table; fixed nodes have the last, where all is zero.
    place: Vec<u32>,
    /// K⁻¹ by columns, with one more row and column of zeros.
    table: Vec<f64>,
    free: usize,
}

impl Empty {
    /// Of a scene with fields that are solved for. `inverse` tells K⁻¹ between some nodes. `None` where there are too
    /// many of them, or K has no inverse.
    pub(crate) fn new(
        matrix: &StiffnessMatrix,
        fixed: &[bool],
        energies: &[f64],
        columns: usize,
        potential: impl Fn(usize, usize) -> f64,
        inverse: impl FnOnce(&[u32]) -> Option<Vec<f64>>,
    ) -> Option<Self> {
        let nodes = matrix.nodes();
        let free: Vec<u32> = (0..nodes as u32).filter(|&node| !fixed[node as usize]).collect();
        if free.len() > MOST_NODES {
            return None;
        }
        let table = with_zeros(&inverse(&free)?, free.len());
        let mut place = vec![free.len() as u32; nodes];
        free.iter().zip(0..).for_each(|(&node, at)| place[node as usize] = at);
        let holder = |row: usize| {
            let held = (0..columns).find(|&column| fixed[row] && potential(column, row) != 0.0);
            held.map(|column| column as u32)
        };
        Some(Self {
            columns,
            holder: (0..fixed.len()).map(holder).collect(),
            fixed: fixed[..nodes].to_vec(),
            fields: (0..nodes * columns).map(|at| potential(at % columns, at / columns)).collect(),
            energies: energies.to_vec(),
            rim: matrix.links().map(|(_, _, weight)| weight).collect(),
            first_object: nodes + matrix.network().held_rows(),
            place,
            table,
            free: free.len(),
        })
    }

    /// Number of free nodes.
    pub(super) fn free(&self) -> usize {
        self.free
    }

    pub(super) fn nodes(&self) -> usize {
        self.fixed.len()
    }

    pub(super) fn is_fixed(&self, node: usize) -> bool {
        self.fixed[node]
    }

    /// What holds an electrode, an object, or a node that is fixed.
    pub(super) fn holder(&self, row: usize) -> Holder {
        self.holder[row]
    }

    /// The potentials of a node in all columns.
    pub(super) fn fields(&self, node: u32) -> &[f64] {
        &self.fields[node as usize * self.columns..][..self.columns]
    }

    pub(super) fn place(&self, node: u32) -> usize {
        self.place[node as usize] as usize
    }

    /// The potentials at all places that a unit charge at one of them makes.
    pub(super) fn of_charge_at(&self, place: usize) -> &[f64] {
        let stride = self.free + 1;
        &self.table[place * stride..][..stride]
    }
}

/// A square matrix, made symmetric, with one more row and column of zeros.
fn with_zeros(square: &[f64], size: usize) -> Vec<f64> {
    let mut table = vec![0.0; (size + 1) * (size + 1)];
    for a in 0..size {
        for b in 0..size {
            table[a * (size + 1) + b] = 0.5 * (square[a * size + b] + square[b * size + a]);
        }
    }
    table
}
