//! The exact capacitances of a frame through the Green's function of the empty scene.
//!
//! What bodies change of the network is a sum of squares at their surfaces ([`changes`]), and in them where they are
//! dielectrics. The empty network answers charges there by its Green's function, a dense table that is made once; what is
//! left is a dense system of as many unknowns ([`system`]). Its size is that of the surfaces, whatever the mesh, and the
//! number of columns hardly matters. Nothing is kept from one frame to the next. Potentials are computed where they are
//! asked for.

mod changes;
mod system;
mod table;

use crate::occupancy::{NO_OBJECT, Occupancy};
use crate::stiffness::StiffnessMatrix;
use changes::Changes;
use std::sync::OnceLock;
use system::System;
pub(crate) use table::Empty;

/// Up to as many unknowns as this times n^(2/3), of n free nodes, dense equations cost less than a factorisation of all of
/// K, which takes n² products.
const LARGEST: f64 = 3.5;

/// What a node costs that is no point, in relation to one: it takes part in a product and in a factorisation more.
const COST_OF_NODE: f64 = 1.6;

/// The table, and the equations of the last frame.
#[derive(Clone, Debug)]
pub(crate) struct Green {
    empty: Empty,
    changes: Changes,
    system: System,
    capacity: usize,
    charges: OnceLock<Vec<f64>>,
}

impl Green {
    /// From a table of the empty scene.
    pub(crate) fn new(empty: Empty) -> Self {
        let capacity = (LARGEST * (empty.free() as f64).powf(2.0 / 3.0)) as usize;
        Self {
            changes: Changes::new(&empty),
            system: System::new(capacity, empty.columns),
            capacity,
            empty,
            charges: OnceLock::new(),
        }
    }

    /// Computes the energies of a frame. Returns their relative error, or `None` where too much differs from the empty
    /// scene, or K is not positive definite.
    pub(crate) fn update(&mut self, matrix: &StiffnessMatrix, occupancy: &Occupancy) -> Option<f64> {
        self.charges.take();
        // Nodes within conductors need not be known, but for those from which a link leads through an open wall.
        let is_held = |(node, ..): (usize, usize, f64)| occupancy.conductors()[node] != NO_OBJECT;
        if matrix.links().take(self.empty.rim.len()).any(is_held) {
            return None;
        }
        self.changes.collect(&self.empty, matrix, occupancy);
        let cost = self.changes.points.len() as f64 + COST_OF_NODE * self.changes.nodes.len() as f64;
        if cost > self.capacity as f64 {
            return None;
        }
        self.system.solve(&self.empty, &self.changes)
    }

    /// XᵀKX, all pairs of columns.
    pub(crate) fn energies(&self) -> &[f64] {
        &self.system.energies
    }

    /// The potential of a node that is not held in the last frame.
    pub(crate) fn potential(&self, column: usize, node: u32) -> f64 {
        let charges = self.charges.get_or_init(|| self.system.charges());
        let reaction = self.system.reaction(&self.empty, charges, column, node);
        self.empty.fields(node)[column] + reaction
    }
}
