//! Edges near which surfaces are others than before: finding them is most of an update on meshes that are no lattice, so threads
//! share the regions.

use super::EdgeGeometry;
use super::changes::Changes;
use super::index_set::IndexSet;
use super::parallel::Beside;
use crate::geometry::Aabb;
use crate::mesh::{Edges, for_lattice_edges};
use crate::workers::Workers;

/// Fewer regions are not worth handing over.
const REGIONS_OF_A_TASK: usize = 8;

/// Sets for each thread, as some regions have more edges and some threads come later.
const TASKS_OF_A_THREAD: usize = 2;

/// A set of edges, in the making one for each task.
#[derive(Clone, Debug, Default)]
pub(super) struct EdgesNear {
    edges: usize,
    marked: IndexSet,
    others: Vec<IndexSet>,
}

impl EdgesNear {
    /// None, with numbers below a bound.
    pub(super) fn below(edges: usize) -> Self {
        Self { edges, marked: IndexSet::below(edges), others: Vec::new() }
    }

    /// Marks the edges near where something differs, and those of a lattice to which it is near enough beside them.
    pub(super) fn mark(
        &mut self,
        workers: &Workers,
        mesh: &EdgeGeometry<'_>,
        changes: &Changes,
        beside: Beside,
    ) {
        match mesh.edges {
            Edges::Lattice(lattice) => {
                self.share(workers, changes.regions(), |at, region, set| {
                    let (planes, mut mark) = (&changes.planes()[at], |edge| set.insert(edge));
                    match beside {
                        Beside::Nowhere => for_lattice_edges(lattice, planes, |edge, _| mark(edge)),
                        Beside::HalfWay => {
                            lattice.for_edges_reaching(region, planes, |way| 0.5 * way, mark);
                        }
                        Beside::ToNext => lattice.for_edges_reaching(region, planes, |way| way, mark),
                    }
                });
            }
            edges @ Edges::List(_) => self.share(workers, changes.regions(), |_, region, set| {
                edges.for_edges_near(mesh.nodes, region, |edge, _| set.insert(edge));
            }),
        }
    }

    /// Has threads mark the edges of regions, each told with its number.
    fn share(
        &mut self,
        workers: &Workers,
        regions: &[Aabb],
        mark: impl Fn(usize, &Aabb, &mut IndexSet) + Sync,
    ) {
        let tasks = workers.tasks(TASKS_OF_A_THREAD);
        self.others.resize_with(tasks - 1, || IndexSet::below(self.edges));
        let size = regions.len().div_ceil(tasks).max(REGIONS_OF_A_TASK);
        let sets = std::iter::once(&mut self.marked).chain(&mut self.others);
        let parts = (0..).step_by(size).zip(regions.chunks(size));
        workers.for_each(parts.zip(sets), |((first, regions), set)| {
            (first..).zip(regions).for_each(|(at, region)| mark(at, region, set));
        });
        self.others.iter_mut().for_each(|other| self.marked.unite(other));
    }

    /// Those marked.
    pub(super) fn marked(&mut self) -> &mut IndexSet {
        &mut self.marked
    }
}
