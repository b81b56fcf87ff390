//! Geometric multigrid on the tensor lattice: an approximate K⁻¹ in single precision.
//!
//! A graded lattice has cells stretched in every direction somewhere. Point smoothing alone fails on them, so levels
//! are made coarser where spacing is small: each step merges only those neighbouring cells of one axis that together
//! are no longer than a length which doubles from step to step. Cells become more equal from level to level, and errors
//! that a level cannot smooth along a short spacing are smooth on the level where that spacing is gone.

mod level;
mod transfer;

use super::preconditioner::products;
use crate::mesh::Lattice;
use crate::stiffness::{LANES, Lane, Lane32, StiffnessMatrix};
use level::Level;
use transfer::{IndexBox, Transfer};

/// Merged cells may exceed the length of a step by this factor, so that equal cells merge in spite of rounding.
const SLACK: f64 = 1.05;

/// An axis with no more planes than this is coarse enough.
const FEW_PLANES: usize = 4;

/// Symmetric Gauss-Seidel sweeps on the coarsest level.
const COARSEST_SWEEPS: usize = 4;

/// The hierarchy of a lattice.
#[derive(Clone, Debug)]
pub(super) struct LatticeMultigrid {
    /// From fine to coarse.
    levels: Vec<Level>,
    transfers: Vec<Transfer>,
}

impl LatticeMultigrid {
    /// Plans the levels; weights come with [`LatticeMultigrid::refresh`].
    pub(super) fn new(lattice: &Lattice) -> Self {
        let mut planes = lattice.axes().clone();
        let mut levels = vec![Level::new(lattice.node_counts())];
        let mut transfers = Vec::new();
        let spacings = planes.iter().flat_map(|axis| axis.windows(2)).map(|pair| pair[1] - pair[0]);
        let mut length = spacings.fold(f64::INFINITY, f64::min);
        while planes.iter().any(|axis| axis.len() > FEW_PLANES) {
            length *= 2.0;
            for (axis, planes) in planes.iter_mut().enumerate() {
                let kept = kept_planes(planes, length * SLACK);
                if kept.contains(&false) {
                    let fine = &levels[levels.len() - 1];
                    let transfer = Transfer::new(fine, axis, &kept);
                    levels.push(Level::new(transfer.coarse_counts(fine)));
                    transfers.push(transfer);
                    let mut kept = kept.into_iter();
                    planes.retain(|_| kept.next().unwrap_or(true));
                }
            }
        }
        Self { levels, transfers }
    }

    /// Takes over the matrix and the fixed rows. Only what depends on the given nodes is recomputed: all nodes whose
    /// row or state changed, and those with links before or now.
    pub(super) fn refresh(
        &mut self,
        matrix: &StiffnessMatrix,
        fixed: &[bool],
        changed: impl Iterator<Item = u32>,
    ) {
        let [nx, ny, _] = self.levels[0].counts;
        let place = |node: usize| [node % nx, node / nx % ny, node / (nx * ny)];
        let nowhere = || std::ops::Range { start: usize::MAX, end: 0 };
        let mut region: IndexBox = std::array::from_fn(|_| nowhere());
        for node in changed {
            for (range, at) in region.iter_mut().zip(place(node as usize)) {
                *range = range.start.min(at)..range.end.max(at + 1);
            }
        }
        if region[0].is_empty() {
            return;
        }
        self.refresh_finest(matrix, fixed, &region);
        for (index, transfer) in self.transfers.iter_mut().enumerate() {
            let (fine, coarse) = self.levels.split_at_mut(index + 1);
            region = transfer.refresh(&fine[index], &mut coarse[0], &region);
        }
    }
}

impl LatticeMultigrid {
    fn refresh_finest(&mut self, matrix: &StiffnessMatrix, fixed: &[bool], region: &IndexBox) {
        let level = &mut self.levels[0];
        let first = level.nodes().start;
        let each = |level: &mut Level, margin: usize, visit: &mut dyn FnMut(&mut Level, usize)| {
            for k in region[2].start.saturating_sub(margin)..region[2].end {
                for j in region[1].start.saturating_sub(margin)..region[1].end {
                    for i in region[0].start.saturating_sub(margin)..region[0].end {
                        let at = level.index([i, j, k]);
                        visit(level, at);
                    }
                }
            }
        };
        // An edge's weight stands at its first node, one before the nodes that changed.
        each(level, 1, &mut |level, at| {
            level.stencil[at].next = [0, 1, 2].map(|axis| matrix.lattice_weight(at - first, axis) as f32);
            level.leak[at] = matrix.link_weight(at - first) as f32;
        });
        each(level, 0, &mut |level, at| level.set_inverse(at, fixed[at - first]));
    }

    /// z = M r on node rows by one symmetric V-cycle, and the columns' r·z.
    pub(super) fn apply(&mut self, r: &[Lane]) -> (&mut [Lane32], Lane) {
        let nodes = self.levels[0].nodes();
        for (b, r) in self.levels[0].b[nodes.clone()].iter_mut().zip(r) {
            *b = r.map(|r| r as f32);
        }
        self.cycle();
        let z = &mut self.levels[0].x[nodes];
        let products = products(r, z);
        (z, products)
    }

    fn cycle(&mut self) {
        for (index, transfer) in self.transfers.iter().enumerate() {
            let (fine, coarse) = self.levels.split_at_mut(index + 1);
            fine[index].smooth_from_zero();
            transfer.restrict(&fine[index], &mut coarse[0]);
        }
        if let Some(coarsest) = self.levels.last_mut() {
            coarsest.x.fill([0.0; LANES]);
            for _ in 0..COARSEST_SWEEPS {
                coarsest.smooth_both_ways();
            }
        }
        for (index, transfer) in self.transfers.iter().enumerate().rev() {
            let (fine, coarse) = self.levels.split_at_mut(index + 1);
            transfer.prolong(&mut fine[index], &coarse[0]);
            fine[index].smooth();
        }
    }
}

/// Merges neighbouring cells that together are at most so long, each with one neighbour at most.
fn kept_planes(planes: &[f64], length: f64) -> Vec<bool> {
    let mut kept = vec![true; planes.len()];
    let mut start = 0;
    while start + 2 < planes.len() {
        let merge = planes[start + 2] - planes[start] <= length;
        kept[start + 1] = !merge;
        start += if merge { 2 } else { 1 };
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Aabb;
    use crate::material::{Connection, Material};
    use crate::occupancy::{DepthLayers, EdgeGeometry, Occupancy, OrthographicView};
    use crate::sensor::{FREE, GROUND};
    use crate::stiffness::EdgeNetwork;
    use glam::{DVec2, DVec3};

    const DOMAIN: Aabb = Aabb { min: DVec3::ZERO, max: DVec3::ONE };

    /// A graded lattice with grounded walls, a thin grounded plate in it that moves, and its multigrid.
    struct Scene {
        nodes: Vec<DVec3>,
        terminals: Vec<u16>,
        matrix: StiffnessMatrix,
        occupancy: Occupancy,
        multigrid: LatticeMultigrid,
    }

    impl Scene {
        fn new() -> Self {
            let axis = |low: usize| -> Vec<f64> {
                (0..24).map(|i| ((i * (i + low)) as f64) / (23 * (23 + low)) as f64).collect()
            };
            let lattice = Lattice::new([axis(3), axis(5), axis(2)]).unwrap();
            let mesh = lattice.to_tet_mesh().unwrap();
            let network = EdgeNetwork::assemble_lattice(&lattice, mesh.relative_permittivity());
            let on_wall = |p: &DVec3| p.min_element() == 0.0 || p.max_element() == 1.0;
            let terminals = mesh.nodes().iter().map(|p| if on_wall(p) { GROUND } else { FREE }).collect();
            let occupancy = Occupancy::empty(mesh.nodes().len(), network.edges().len());
            let matrix = StiffnessMatrix::new(network, mesh.nodes().len());
            let multigrid = LatticeMultigrid::new(&lattice);
            let mut scene = Self { nodes: mesh.nodes().to_vec(), terminals, matrix, occupancy, multigrid };
            scene.refresh();
            scene
        }

        /// The plate between the heights 0.3 and 0.36 covers part of the view.
        fn step(&mut self, corner: f64) {
            let mut depth = DepthLayers::empty(OrthographicView { domain: DOMAIN, width: 32, height: 32 }, 1);
            let view = *depth.view();
            let (front, back) = depth.layer_mut(0);
            for pixel in 0..32 * 32 {
                let from_corner = view.pixel_centre(pixel % 32, pixel / 32) - DVec2::new(corner, 0.3);
                if from_corner.min_element() > 0.0 && from_corner.max_element() < 0.1 {
                    (front[pixel], back[pixel]) = (0.3, 0.36);
                }
            }
            let network = self.matrix.network();
            let mesh = EdgeGeometry {
                nodes: &self.nodes,
                terminals: &self.terminals,
                edges: network.edges(),
                permittivity: network.permittivity(),
            };
            self.occupancy.update(mesh, &[Material::Conductor(Connection::Grounded)], &depth);
            self.matrix.update(&self.occupancy);
            self.refresh();
        }

        fn refresh(&mut self) {
            let conductors = self.occupancy.conductors();
            let held = self.terminals.iter().zip(conductors);
            let fixed: Vec<bool> = held
                .map(|(&terminal, &object)| terminal != FREE || object != crate::occupancy::NO_OBJECT)
                .collect();
            let changed = self.matrix.changed_rows().iter().chain(self.occupancy.changed_nodes()).copied();
            self.multigrid.refresh(&self.matrix, &fixed, changed);
        }

        /// Residuals without a pattern.
        fn vector(&self, seed: u64) -> Vec<Lane> {
            let mut state = seed;
            let mut next = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 33) as f64 / f64::from(1u32 << 31) - 0.5
            };
            self.terminals.iter().map(|_| std::array::from_fn(|_| next())).collect()
        }
    }

    #[test]
    fn refreshing_what_changed_gives_the_bits_of_a_fresh_hierarchy() {
        let mut moving = Scene::new();
        for corner in [0.1, 0.12, 0.4, 0.44, 0.5, 0.52, 0.33] {
            moving.step(corner);
        }
        let mut fresh = Scene::new();
        fresh.step(0.33);
        for (a, b) in moving.multigrid.levels.iter().zip(&fresh.multigrid.levels) {
            assert_eq!(a.leak, b.leak);
            for (a, b) in a.stencil.iter().zip(&b.stencil) {
                assert_eq!((a.next, a.inverse), (b.next, b.inverse));
            }
        }
    }

    #[test]
    fn the_cycle_is_symmetric_and_positive() {
        let mut scene = Scene::new();
        scene.step(0.2);
        let (a, b) = (scene.vector(1), scene.vector(2));
        let (of_a, a_a) = scene.multigrid.apply(&a);
        let of_a = of_a.to_vec();
        let (of_b, b_b) = scene.multigrid.apply(&b);
        for lane in 0..LANES {
            let product = |x: &[Lane], z: &[Lane32]| -> f64 {
                x.iter().zip(z).map(|(x, z)| x[lane] * f64::from(z[lane])).sum()
            };
            let (b_of_a, a_of_b) = (product(&b, &of_a), product(&a, of_b));
            assert!(a_a[lane] > 0.0 && b_b[lane] > 0.0);
            assert!((b_of_a - a_of_b).abs() < 1e-5 * (a_a[lane] * b_b[lane]).sqrt(), "{b_of_a} {a_of_b}");
        }
    }

    #[test]
    fn planes_merge_where_they_are_close() {
        let kept = kept_planes(&[0.0, 0.1, 0.2, 0.3, 0.6, 1.0], 0.21);
        assert_eq!(kept, [true, false, true, true, true, true]);
        assert_eq!(kept_planes(&[0.0, 1.0], 9.0), [true, true]);
    }
}
