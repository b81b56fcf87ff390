//! One walk over all rows in double precision: moves the fields, applies K, and takes all sums on the way.

use super::layout::{BLOCK, Coloured, Layout, RED};
use super::stencil::{Stencil, blocks, neighbours};

/// Sums over blocks of nodes: one number for each place in a block, so that the order of additions is fixed.
type Partial = [f64; BLOCK];

/// Sums over a plane, and the storage they are taken with.
#[derive(Clone, Debug)]
pub(super) struct Sums {
    columns: usize,
    /// K x of one half row, all columns.
    y: Vec<f64>,
    /// xᵀKx for all pairs s <= t, pair by pair.
    energies: Vec<Partial>,
    along: Vec<Partial>,
    residual: Vec<Partial>,
    charge: Vec<Partial>,
}
