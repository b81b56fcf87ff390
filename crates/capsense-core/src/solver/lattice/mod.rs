//! The solver on lattices: the 7-point network without indices, preconditioned by geometric multigrid in single
//! precision.

mod between;
mod charges;
mod coarse_row;
mod coarsening;
mod collection;
mod descent;
mod following;
mod groups;
mod held;
mod hierarchy;
mod increment;
mod layout;
mod level;
mod links;
mod network;
mod operator;
mod pairs;
mod parts;
mod picks;
mod potentials;
mod precision;
mod products;
mod prolongation;
mod refreshed;
mod relaxation;
mod relaxed;
mod restriction;
mod rows;
mod shares;
mod stage;
mod stencil;
mod sums;
mod transfer;
mod walk;

use super::islands::{CONTRAST, Islands};
use super::operator::State;
use crate::instructions::EightLanes;
use crate::mesh::Lattice;
use crate::occupancy::Occupancy;
use crate::stiffness::StiffnessMatrix;
use crate::workers::Workers;
use charges::{NodeCharges, Place};
use held::{Energies, Held};
use hierarchy::Hierarchy;
pub(super) use hierarchy::coarsenings;
use increment::Increment;
use layout::{Coloured, Layout};
use links::ObjectLinks;
use parts::Parts;
use potentials::Potentials;
use refreshed::{Blocks, Refreshed};
use relaxation::Room;
use std::sync::atomic::{AtomicBool, Ordering};
use sums::PIECE;

#[cfg(test)]
mod tests;

/// Fields on a lattice with everything needed to improve them.
#[derive(Clone, Debug)]
pub(crate) struct LatticeSolver {
    columns: usize,
    /// That of the vectors, and that of numbers which are there once for each node.
    layout: Layout,
    of_nodes: Layout,
    potentials: Potentials,
    links: ObjectLinks,
    /// The last step but for a factor, which each column has its own.
    p: Coloured<f32>,
    scale: Vec<f64>,
    /// Room for how much of p a step takes, in relation to z.
    beta: Vec<f64>,
    increment: Increment,
    /// Its finest level holds r and z.
    hierarchy: Hierarchy,
    /// Whether networks may hold what is no number, and are to be computed everywhere.
    networks_are_lost: bool,
    islands: Islands,
    /// Columns that are worked on.
    active: Vec<usize>,
    /// RᵀMR of all pairs of columns, and the finest level's part of it.
    gains: Vec<f64>,
    finest_gains: Vec<f64>,
    /// zᵀKz and zᵀKp.
    curvatures: [Vec<f64>; 2],
    /// The same and the state, of each plane alone.
    curvatures_of_planes: Vec<[Vec<f64>; 2]>,
    state_of_planes: Vec<State>,
    state: State,
    /// The part of the state's energies that is of free rows, for pairs s <= t of columns; and what is held.
    of_free: Vec<f64>,
    held: Held,
    /// Room for one node.
    node: NodeCharges,
    /// Where rows changed, and what is worked on there.
    blocks: Blocks,
    room: Room,
    /// How threads share the planes, and storage for each.
    parts: Parts,
    charges: Vec<Vec<f32>>,
    workers: Workers,
    arch: EightLanes,
}

impl LatticeSolver {
    /// Zero fields on a lattice; `objects` conducting objects may be linked to. Weights come with
    /// [`LatticeSolver::refresh`].
    pub(crate) fn new(
        lattice: &Lattice,
        columns: usize,
        objects: usize,
        fixed: &[bool],
        workers: Workers,
    ) -> Self {
        let counts = lattice.node_counts();
        let of_nodes = Layout::new(counts, fixed_margin(counts, fixed));
        let layout = of_nodes.with_columns(columns);
        let mut hierarchy = Hierarchy::new(lattice, of_nodes, columns, workers.threads());
        hierarchy.levels[0].charges = layout.zeros();
        let parts = hierarchy.levels[0].parts.clone();
        Self {
            columns,
            layout,
            of_nodes,
            potentials: Potentials::double(of_nodes, &layout, Blocks::tasks(parts.slabs.len())),
            links: ObjectLinks::new(objects, columns),
            p: layout.zeros(),
            scale: vec![0.0; columns],
            beta: vec![0.0; columns],
            increment: Increment::new(&layout),
            hierarchy,
            networks_are_lost: false,
            islands: Islands::from_contrast(CONTRAST),
            active: Vec::with_capacity(columns),
            gains: vec![0.0; columns * columns],
            finest_gains: vec![0.0; columns * columns],
            curvatures: [vec![0.0; columns], vec![0.0; columns]],
            curvatures_of_planes: vec![[vec![0.0; columns], vec![0.0; columns]]; counts[2]],
            state_of_planes: vec![State::new(columns); counts[2]],
            state: State::new(columns),
            of_free: vec![0.0; columns * columns],
            held: Held::new(counts.into_iter().product()),
            node: NodeCharges::new(columns),
            blocks: Blocks::new(&of_nodes, columns),
            room: Room::new(&of_nodes, &layout),
            charges: vec![vec![0.0; PIECE]; parts.slabs.len()],
            parts,
            workers,
            arch: EightLanes::new(),
        }
    }

    fn nodes(&self) -> usize {
        self.layout.counts.into_iter().product()
    }

    /// The potential of a row in one column.
    pub(crate) fn potential(&self, column: usize, row: usize) -> f64 {
        match row.checked_sub(self.nodes()) {
            Some(object) => self.links.potentials[object * self.columns + column],
            None => {
                let (colour, at) = self.place(column, row);
                let ahead = f64::from(self.hierarchy.levels[0].ahead[column]);
                self.potentials.get(colour, at) + ahead * f64::from(self.increment.fields[colour][at])
            }
        }
    }

    /// Visits the potentials of a row in all columns.
    #[inline]
    pub(crate) fn for_potentials(&self, row: usize, mut visit: impl FnMut(usize, f64)) {
        match row.checked_sub(self.nodes()) {
            Some(object) => {
                let of_object = &self.links.potentials[object * self.columns..][..self.columns];
                of_object.iter().enumerate().for_each(|(column, potential)| visit(column, *potential));
            }
            None => {
                let (colour, first) = self.place(0, row);
                for (column, &ahead) in self.hierarchy.levels[0].ahead[..self.columns].iter().enumerate() {
                    let at = self.layout.in_column(column, first);
                    let led_on = f64::from(ahead) * f64::from(self.increment.fields[colour][at]);
                    visit(column, self.potentials.get(colour, at) + led_on);
                }
            }
        }
    }

    /// Sets the potential of a row in one column. The residual and the state follow with the next
    /// [`LatticeSolver::refresh`] or evaluation.
    pub(crate) fn set_potential(&mut self, column: usize, row: usize, potential: f64) {
        match row.checked_sub(self.nodes()) {
            Some(object) => self.links.potentials[object * self.columns + column] = potential,
            None => {
                let (colour, at) = self.place(column, row);
                let before = self.potentials.get(colour, at);
                self.potentials.set(colour, at, potential);
                let (layout, finest) = (self.layout, &self.hierarchy.levels[0]);
                let first = layout.place(layout.indices(row)).1;
                let d = f64::from(std::mem::take(&mut self.increment.fields[colour][at]));
                if self.increment.is_known && d != 0.0 {
                    let of_node = |t: usize| {
                        let at = layout.in_column(t, first);
                        [&finest.b, &finest.charges].map(|of| f64::from(of[colour][at]))
                    };
                    self.increment.sums.remove(column, d, of_node);
                }
                for t in column..self.columns {
                    let residual = self.hierarchy.levels[0].b[colour][self.place(t, row).1];
                    self.of_free[column * self.columns + t] -= (potential - before) * f64::from(residual);
                }
            }
        }
    }

    /// Whether potentials are stored in single precision.
    pub(crate) fn is_single(&self) -> bool {
        self.potentials.is_single()
    }

    /// Stores potentials in another precision.
    pub(crate) fn switch_precision(&mut self, matrix: &StiffnessMatrix) {
        self.drop_increment();
        let (of_nodes, layout) = (self.of_nodes, self.layout);
        let slabs = Blocks::tasks(self.parts.slabs.len());
        let mut potentials = match self.potentials {
            Potentials::Double { .. } => Potentials::single(of_nodes, &layout, slabs),
            Potentials::Single { .. } => Potentials::double(of_nodes, &layout, slabs),
        };
        for node in 0..self.nodes() {
            potentials.refresh(matrix, node, of_nodes.place(layout.indices(node)));
            for column in 0..self.columns {
                let (colour, at) = self.place(column, node);
                potentials.set(colour, at, self.potentials.get(colour, at));
            }
        }
        self.potentials = potentials;
    }

    /// Zero fields, after a solve that failed: nothing of it may be left, padding included.
    pub(crate) fn clear(&mut self) {
        self.drop_increment();
        let charges = &mut self.hierarchy.levels[0].charges;
        self.increment.fields.iter_mut().chain(charges).for_each(|values| values.fill(0.0));
        self.potentials.clear();
        self.p.iter_mut().for_each(|values| values.fill(0.0));
        self.scale.fill(0.0);
        self.hierarchy.clear();
        self.networks_are_lost = true;
    }

    /// Finds the bodies of very high permittivity, which need a direction of their own.
    pub(crate) fn find_islands(
        &mut self,
        matrix: &StiffnessMatrix,
        occupancy: &Occupancy,
        fixed: &[bool],
        changed: &[u32],
    ) {
        self.islands.find(matrix, occupancy, fixed, changed);
    }

    /// Gives back the room that the first refresh took, in which every row changed.
    pub(crate) fn settle(&mut self) {
        self.hierarchy.settle();
        self.blocks.settle();
    }

    /// Where a node stands in the vectors.
    fn place(&self, column: usize, node: usize) -> (usize, usize) {
        let (colour, at) = self.layout.place(self.layout.indices(node));
        (colour, self.layout.in_column(column, at))
    }

    /// Takes over the matrix and the fixed rows where they changed, and the residual there, with the state. `changed` must
    /// hold all nodes whose row, state or neighbour's potential changed.
    pub(crate) fn refresh(&mut self, matrix: &StiffnessMatrix, fixed: &[bool], changed: &[u32]) {
        let (of_nodes, layout) = (self.of_nodes, self.layout);
        // Weights that overflowed left coarse ones that equal nothing and follow nothing.
        let all: Vec<u32>;
        let changed = if std::mem::take(&mut self.networks_are_lost) {
            self.hierarchy.clear_networks();
            all = (0..self.nodes() as u32).collect();
            &all
        } else {
            changed
        };
        let Self {
            arch,
            potentials,
            links,
            hierarchy,
            increment,
            of_free,
            held,
            state,
            node,
            blocks,
            room,
            workers,
            ..
        } = self;
        let arch = *arch;
        hierarchy.follow_all(workers, arch);
        let can_wait = increment.is_known;
        let finest = || hierarchy.refresh_finest(arch, matrix, fixed, changed, can_wait);
        let besides = || {
            for &node in changed {
                let row = node as usize;
                let indices = of_nodes.indices(row);
                let place = Place::at(indices, &of_nodes, &layout);
                potentials.refresh(matrix, row, (place.colour, place.at));
                if fixed[row] {
                    held.list(&layout, potentials, node, place);
                }
                blocks.list(&of_nodes, place, indices[2]);
            }
            links.collect(&of_nodes, &layout, matrix);
        };
        workers.both(finest, besides);
        let (finest, coarser) = hierarchy.split();
        let links = &*links;
        let residuals = || {
            let finest = finest.refresh(arch);
            increment.forget_energies();
            let mut rows =
                Refreshed { of_nodes, potentials, links, finest, increment, of_free, state, blocks, room };
            rows.refresh(workers, arch);
            rows.relax(changed);
            let Refreshed { potentials, finest, of_free, state, .. } = rows;
            Energies { of_nodes, potentials, links, finest, of_free, held, state, node }.add_held();
        };
        match coarser {
            Some(coarser) => {
                // Stages that are not done when residuals are wait for the way down, which helpers then begin with.
                let are_known = AtomicBool::new(false);
                let goes_on = || !are_known.load(Ordering::Relaxed);
                let residuals = || {
                    residuals();
                    are_known.store(true, Ordering::Relaxed);
                };
                workers.both(|| coarser.refresh(workers, arch, goes_on), residuals);
            }
            None => residuals(),
        }
    }
}

/// How many rows at either end of y, and planes at either end of z, are fixed: one each where all of the outermost are.
fn fixed_margin([nx, ny, nz]: [usize; 3], fixed: &[bool]) -> [usize; 2] {
    let row_is_fixed = |j: usize, k: usize| fixed[(k * ny + j) * nx..][..nx].iter().all(|&fixed| fixed);
    let rows = (0..nz).all(|k| row_is_fixed(0, k) && row_is_fixed(ny - 1, k));
    let planes = (0..ny).all(|j| row_is_fixed(j, 0) && row_is_fixed(j, nz - 1));
    [usize::from(rows), usize::from(planes)]
}
