//! Where everything is in the buffers of a device: the networks and vectors of all levels of the multigrid hierarchy, for
//! one scene. Scenes of a batch stand one behind the other.
//!
//! A level leads to the next coarser one in stages, one for each axis along which planes are given up, and each stage has
//! the network that it starts from. Every array is padded by a plane and a row of zeros at either end, so that each node has six
//! neighbours, and these have; edges that would lead out of the lattice weigh nothing.

use bytemuck::{Pod, Zeroable};
use capsense_core::solver::RemoteProblem;

/// A coarser level has at most this part of a level's nodes. Smaller than on processors, where 0.5 is best: there are fewer
/// levels to launch, and nodes cost less than launches.
const REDUCTION: f64 = 0.3;

/// No more levels and grids than the shader has room for.
pub(super) const MOST_LEVELS: usize = 24;
pub(super) const MOST_GRIDS: usize = 64;

/// One network: weights to the next nodes along x, y and z, and leaks, one array after the other.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(super) struct Grid {
    /// Number of nodes along each axis, and of all.
    pub(super) counts: [u32; 3],
    pub(super) nodes: u32,
    /// Where the weights along x begin, and the distance to the next array.
    pub(super) at: u32,
    pub(super) stride: u32,
    padding: [u32; 2],
}

/// The vectors of one level: residual and correction, column by column.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(super) struct Level {
    pub(super) grid: u32,
    /// Where the first column begins.
    pub(super) residual: u32,
    pub(super) correction: u32,
    /// The distance to the next column.
    pub(super) stride: u32,
}

/// From a level to the next coarser one.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(super) struct Transfer {
    /// The grids before and after the stages of x, y and z. A stage that gives no plane up has the same on both sides.
    pub(super) grids: [u32; 4],
    /// Where it is told of each fine plane which coarse one is at it or before it: twice its number, and one more where the
    /// plane is given up.
    pub(super) coarse: [u32; 3],
    padding: u32,
    /// Where the fine planes of coarse ones are.
    pub(super) fine: [u32; 3],
    padding_too: u32,
}

/// Where everything is.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Plan {
    pub(super) columns: usize,
    pub(super) grids: Vec<Grid>,
    pub(super) levels: Vec<Level>,
    pub(super) transfers: Vec<Transfer>,
    /// What transfers point to.
    pub(super) maps: Vec<u32>,
    /// On the finest level, with its stride between columns: potentials, the last two steps, K times the step, what links
    /// feed; and one column of leaks.
    pub(super) potential: u32,
    pub(super) steps: [u32; 2],
    pub(super) image: u32,
    pub(super) feed: u32,
    pub(super) leak: u32,
    /// Number of values of one scene in networks and in vectors.
    pub(super) network_len: usize,
    pub(super) vectors_len: usize,
}

impl Plan {
    /// `None` where 32 bits do not name all values, or there are more levels than the shader has room for.
    pub(super) fn new(problem: &RemoteProblem) -> Option<Self> {
        let columns = problem.columns;
        let mut plan = Self {
            columns,
            grids: Vec::new(),
            levels: Vec::new(),
            transfers: Vec::new(),
            maps: Vec::new(),
            potential: 0,
            steps: [0; 2],
            image: 0,
            feed: 0,
            leak: 0,
            network_len: 0,
            vectors_len: 0,
        };
        let counts = problem.lattice.node_counts();
        let finest = plan.add_grid(counts);
        plan.add_level(finest);
        for kept in problem.coarsenings(REDUCTION) {
            plan.add_transfer(&kept);
        }
        let mut vectors = || plan.add_vectors(0, columns);
        (plan.potential, plan.steps, plan.image, plan.feed) = {
            let (potential, first, second) = (vectors(), vectors(), vectors());
            (potential, [first, second], vectors(), vectors())
        };
        plan.leak = plan.add_vectors(0, 1);
        let fits = plan.network_len.max(plan.vectors_len) <= u32::MAX as usize
            && plan.levels.len() <= MOST_LEVELS
            && plan.grids.len() <= MOST_GRIDS;
        fits.then_some(plan)
    }

    /// Number of nodes of the finest level.
    pub(super) fn nodes(&self) -> usize {
        self.grids[0].nodes as usize
    }

    fn add_grid(&mut self, counts: [usize; 3]) -> u32 {
        let [nx, ny, nz] = counts;
        let (nodes, padding) = (nx * ny * nz, padding(nx, ny));
        let stride = nodes + 2 * padding;
        self.grids.push(Grid {
            counts: counts.map(|count| count as u32),
            nodes: nodes as u32,
            at: (self.network_len + padding) as u32,
            stride: stride as u32,
            padding: [0; 2],
        });
        self.network_len += 4 * stride;
        self.grids.len() as u32 - 1
    }

    /// Where the first column of some vectors on a grid begins.
    fn add_vectors(&mut self, grid: u32, columns: usize) -> u32 {
        let Grid { counts: [nx, ny, _], stride, .. } = self.grids[grid as usize];
        let at = self.vectors_len + padding(nx as usize, ny as usize);
        self.vectors_len += columns * stride as usize;
        at as u32
    }

    fn add_level(&mut self, grid: u32) {
        let (residual, correction) =
            (self.add_vectors(grid, self.columns), self.add_vectors(grid, self.columns));
        let stride = self.grids[grid as usize].stride;
        self.levels.push(Level { grid, residual, correction, stride });
    }

    fn add_transfer(&mut self, kept: &[Vec<bool>; 3]) {
        let mut transfer = Transfer::default();
        let mut grid = self.levels.last().map_or(0, |level| level.grid);
        transfer.grids[0] = grid;
        for (axis, kept) in kept.iter().enumerate() {
            let fine: Vec<u32> =
                (0..kept.len()).filter(|&plane| kept[plane]).map(|plane| plane as u32).collect();
            transfer.coarse[axis] = self.maps.len() as u32;
            let mut before = 0;
            for &kept in kept {
                before += u32::from(kept);
                self.maps.push(2 * (before - 1) + u32::from(!kept));
            }
            transfer.fine[axis] = self.maps.len() as u32;
            if fine.len() < kept.len() {
                let mut counts = self.grids[grid as usize].counts.map(|count| count as usize);
                counts[axis] = fine.len();
                grid = self.add_grid(counts);
            }
            self.maps.extend(fine);
            transfer.grids[axis + 1] = grid;
        }
        self.transfers.push(transfer);
        self.add_level(grid);
    }
}

/// What stands before the first node and behind the last: the neighbours of their neighbours.
fn padding(nx: usize, ny: usize) -> usize {
    nx * ny + nx + 1
}
