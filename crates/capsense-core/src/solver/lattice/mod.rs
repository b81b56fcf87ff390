//! The solver on lattices: the 7-point network without indices in double precision, preconditioned by geometric
//! multigrid in single precision.

mod between;
mod coarse_row;
mod coarsening;
mod hierarchy;
mod layout;
mod level;
mod network;
mod operator;
mod pairs;
mod parts;
mod prolongation;
mod restriction;
mod rows;
mod shares;
mod stage;
mod stencil;
mod sums;
mod transfer;
mod walk;

use super::islands::Islands;
use super::operator::State;
use super::workers::Workers;
use crate::mesh::Lattice;
use crate::occupancy::Occupancy;
use crate::stiffness::StiffnessMatrix;
use hierarchy::Hierarchy;
use layout::{Coloured, Layout};
use parts::Parts;
use pulp::Arch;
use std::ops::Range;
use stencil::Stencil;
use sums::Sums;

#[cfg(test)]
mod tests;

/// Fields on a lattice with everything needed to improve them.
#[derive(Clone, Debug)]
pub(crate) struct LatticeSolver {
    columns: usize,
    /// That of the vectors.
    layout: Layout,
    /// K over the nodes; what links nodes to objects is on the diagonal.
    stencil: Stencil<f64>,
    links: ObjectLinks,
    x: Coloured<f64>,
    /// The last step but for a factor, which each column has its own.
    p: Coloured<f32>,
    scale: Vec<f64>,
    /// Its finest level holds r and z.
    hierarchy: Hierarchy,
    islands: Islands,
    /// Columns that are worked on.
    active: Vec<usize>,
    /// rᵀz, or zᵀKz and zᵀKp.
    products: [Vec<f64>; 2],
    /// The same and the state, of each plane alone.
    products_of_planes: Vec<[Vec<f64>; 2]>,
    state_of_planes: Vec<State>,
    state: State,
    /// How threads share the planes, and storage for each.
    parts: Parts,
    sums: Vec<Sums>,
    workers: Workers,
    arch: Arch,
}

/// Links to objects that are at 1 V in some column.
#[derive(Clone, Debug, Default)]
struct ObjectLinks {
    /// In the order of colours and places.
    links: Vec<ObjectLink>,
    /// Those of nodes that are not evaluated because their rows and planes are fixed throughout.
    of_margin: Vec<ObjectLink>,
    /// Potentials of objects: object by object, all columns.
    potentials: Vec<f64>,
}

/// A capacitance between a node and an object.
#[derive(Clone, Copy, Debug)]
struct ObjectLink {
    colour: usize,
    at: usize,
    object: usize,
    weight: f64,
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
        let hierarchy = Hierarchy::new(lattice, of_nodes, columns, workers.threads());
        let parts = hierarchy.levels[0].parts.clone();
        Self {
            columns,
            layout,
            stencil: Stencil::new(of_nodes),
            links: ObjectLinks { potentials: vec![0.0; objects * columns], ..ObjectLinks::default() },
            x: layout.zeros(),
            p: layout.zeros(),
            scale: vec![0.0; columns],
            hierarchy,
            islands: Islands::default(),
            active: Vec::with_capacity(columns),
            products: [vec![0.0; columns], vec![0.0; columns]],
            products_of_planes: vec![[vec![0.0; columns], vec![0.0; columns]]; counts[2]],
            state_of_planes: vec![State::new(columns); counts[2]],
            state: State::new(columns),
            sums: vec![Sums::new(&layout); parts.slabs.len()],
            parts,
            workers,
            arch: Arch::new(),
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
                self.x[colour][at]
            }
        }
    }

    /// Sets the potential of a row in one column. The residual follows with the next [`LatticeSolver::refresh`] or
    /// evaluation.
    pub(crate) fn set_potential(&mut self, column: usize, row: usize, potential: f64) {
        match row.checked_sub(self.nodes()) {
            Some(object) => self.links.potentials[object * self.columns + column] = potential,
            None => {
                let (colour, at) = self.place(column, row);
                self.x[colour][at] = potential;
            }
        }
    }

    /// Zero fields, after a solve that failed: nothing of it may be left, padding included.
    pub(crate) fn clear(&mut self) {
        self.x.iter_mut().for_each(|values| values.fill(0.0));
        self.p.iter_mut().for_each(|values| values.fill(0.0));
        self.scale.fill(0.0);
        self.hierarchy.clear();
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

    /// Where a node stands in the vectors.
    fn place(&self, column: usize, node: usize) -> (usize, usize) {
        let (colour, at) = self.layout.place(self.layout.indices(node));
        (colour, self.layout.in_column(column, at))
    }

    /// Takes over the matrix and the fixed rows where they changed, and the residual there. `changed` must hold all
    /// nodes whose row, state or neighbour's potential changed.
    pub(crate) fn refresh(&mut self, matrix: &StiffnessMatrix, fixed: &[bool], changed: &[u32]) {
        let layout = self.stencil.layout;
        for node in changed.iter().map(|&node| node as usize) {
            let (colour, at) = layout.place(layout.indices(node));
            for axis in 0..3 {
                self.stencil.next[axis][colour][at] = matrix.lattice_weight(node, axis);
            }
            self.stencil.centre[colour][at] = matrix.diagonal(node);
        }
        self.hierarchy.refresh(self.arch, matrix, fixed, changed);
        self.links.collect(&layout, matrix, self.columns);
        for &node in changed {
            self.refresh_residual(node as usize, fixed[node as usize]);
        }
    }

    /// The residual of one node, with the same operations as everywhere else.
    fn refresh_residual(&mut self, node: usize, fixed: bool) {
        let [of_nodes, layout] = [&self.stencil.layout, &self.layout];
        let indices = layout.indices(node);
        let ((colour, at), (_, first)) = (of_nodes.place(indices), layout.place(indices));
        for column in 0..self.columns {
            let place = layout.in_column(column, first);
            let mut charge = 0.0;
            if !fixed {
                let around = layout.neighbours(colour, place, 1, &self.x[1 - colour]);
                charge = self.stencil.charge(colour, at, self.x[colour][place], around);
                for link in self.links.between(colour, &(at..at + 1)) {
                    charge -= link.weight * self.links.potentials[link.object * self.columns + column];
                }
            }
            self.hierarchy.levels[0].b[colour][place] = -charge as f32;
        }
    }
}

impl ObjectLinks {
    /// Takes those links of a matrix that lead to objects that are at 1 V in some column.
    fn collect(&mut self, layout: &Layout, matrix: &StiffnessMatrix, columns: usize) {
        self.links.clear();
        self.of_margin.clear();
        for (node, object, weight) in matrix.object_links() {
            if self.potentials[object * columns..][..columns].iter().any(|&potential| potential != 0.0) {
                let indices = layout.indices(node);
                let (colour, at) = layout.place(indices);
                let is_evaluated =
                    layout.planes().contains(&indices[2]) && layout.plane(indices[2]).contains(&at);
                let links = if is_evaluated { &mut self.links } else { &mut self.of_margin };
                links.push(ObjectLink { colour, at, object, weight });
            }
        }
        self.links.sort_by_key(|link| (link.colour, link.at));
    }

    /// Adds the energies of links to nodes of the margin, which are held at 0 V in all columns.
    fn add_margin(&self, columns: usize, energies: &mut [f64]) {
        for link in &self.of_margin {
            let potentials = &self.potentials[link.object * columns..][..columns];
            for (s, t) in (0..columns).flat_map(|s| (0..columns).map(move |t| (s, t))) {
                energies[s * columns + t] += link.weight * potentials[s] * potentials[t];
            }
        }
    }

    /// Those of nodes of one colour at some places.
    fn between(&self, colour: usize, places: &Range<usize>) -> &[ObjectLink] {
        if self.links.is_empty() {
            return &[];
        }
        let start = self.links.partition_point(|link| (link.colour, link.at) < (colour, places.start));
        let end = self.links.partition_point(|link| (link.colour, link.at) < (colour, places.end));
        &self.links[start..end]
    }
}

/// How many rows at either end of y, and planes at either end of z, are fixed: one each where all of the outermost are.
fn fixed_margin([nx, ny, nz]: [usize; 3], fixed: &[bool]) -> [usize; 2] {
    let row_is_fixed = |j: usize, k: usize| fixed[(k * ny + j) * nx..][..nx].iter().all(|&fixed| fixed);
    let rows = (0..nz).all(|k| row_is_fixed(0, k) && row_is_fixed(ny - 1, k));
    let planes = (0..ny).all(|j| row_is_fixed(j, 0) && row_is_fixed(j, nz - 1));
    [usize::from(rows), usize::from(planes)]
}
