//! One level of the lattice hierarchy: a 7-point network in single precision, and Gauss-Seidel on it.

/// Potentials, residuals or corrections of several terminals at one node.
pub(super) type Lanes = [f32; crate::stiffness::LANES];

const LANES: usize = crate::stiffness::LANES;

/// A 7-point network. All arrays are padded by one plane at either end, where weights are zero, so that every node has
/// six neighbours in them.
#[derive(Clone, Debug)]
pub(super) struct Level {
    /// Number of nodes along each axis.
    pub(super) counts: [usize; 3],
    /// Weight to the next node along each axis; zero at the last.
    pub(super) weight: [Vec<f32>; 3],
    /// Weight to fixed potentials that are no nodes of this level.
    pub(super) leak: Vec<f32>,
    /// Inverse of the diagonal; zero where the potential is fixed.
    pub(super) inverse: Vec<f32>,
    /// Right-hand side, correction and residual.
    pub(super) b: Vec<Lanes>,
    pub(super) x: Vec<Lanes>,
    pub(super) r: Vec<Lanes>,
}

/// One row of nodes along x and its neighbours on either side.
struct Neighbours<'a> {
    previous_y: &'a [Lanes],
    next_y: &'a [Lanes],
    previous_z: &'a [Lanes],
    next_z: &'a [Lanes],
}

impl Level {
    pub(super) fn new(counts: [usize; 3]) -> Self {
        let plane = counts[0] * counts[1];
        let padded = plane * (counts[2] + 2);
        let zeros = || vec![0.0; padded];
        let vectors = || vec![[0.0; LANES]; padded];
        Self {
            counts,
            weight: [zeros(), zeros(), zeros()],
            leak: zeros(),
            inverse: zeros(),
            b: vectors(),
            x: vectors(),
            r: vectors(),
        }
    }

    /// Distance in the arrays between neighbours along each axis.
    pub(super) fn strides(&self) -> [usize; 3] {
        [1, self.counts[0], self.counts[0] * self.counts[1]]
    }

    /// Place of a node in the arrays.
    pub(super) fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        ((k + 1) * self.counts[1] + j) * self.counts[0] + i
    }

    /// Places of all nodes in the arrays, in their order.
    pub(super) fn nodes(&self) -> std::ops::Range<usize> {
        let plane = self.counts[0] * self.counts[1];
        plane..plane * (self.counts[2] + 1)
    }

    /// Sum of the weights around a node.
    pub(super) fn diagonal(&self, at: usize) -> f32 {
        let strides = self.strides();
        let weights = (0..3).map(|axis| self.weight[axis][at] + self.weight[axis][at - strides[axis]]);
        weights.sum::<f32>() + self.leak[at]
    }

    /// x = one forward Gauss-Seidel sweep on K x = b from zero, and r = b - K x after it. Nodes not yet visited are
    /// zero, so only three neighbours count; what is left over comes from the other three.
    pub(super) fn smooth_from_zero(&mut self) {
        let [nx, sy, sz] = [self.counts[0], self.counts[0], self.counts[0] * self.counts[1]];
        for row in self.nodes().step_by(nx) {
            let (before, current) = self.x.split_at_mut(row);
            let x = &mut current[..nx];
            let (before_y, before_z) = (&before[row - sy..][..nx], &before[row - sz..][..nx]);
            let (wx, wy) = (&self.weight[0][row..][..nx], &self.weight[1][row - sy..][..nx]);
            let (wz, inverse) = (&self.weight[2][row - sz..][..nx], &self.inverse[row..][..nx]);
            let b = &self.b[row..][..nx];
            let mut last = [0.0; LANES];
            for i in 0..nx {
                for lane in 0..LANES {
                    let sum = b[i][lane] + last[lane] + wy[i] * before_y[i][lane] + wz[i] * before_z[i][lane];
                    x[i][lane] = inverse[i] * sum;
                    last[lane] = wx[i] * x[i][lane];
                }
            }
        }
        for row in self.nodes().step_by(nx) {
            let r = &mut self.r[row..][..nx];
            let x = &self.x[row..][..nx + 1];
            let (after_y, after_z) = (&self.x[row + sy..][..nx], &self.x[row + sz..][..nx]);
            let (wx, wy) = (&self.weight[0][row..][..nx], &self.weight[1][row..][..nx]);
            let wz = &self.weight[2][row..][..nx];
            for i in 0..nx {
                for lane in 0..LANES {
                    r[i][lane] = wx[i] * x[i + 1][lane] + wy[i] * after_y[i][lane] + wz[i] * after_z[i][lane];
                }
            }
        }
    }

    /// One backward Gauss-Seidel sweep on K x = b.
    pub(super) fn smooth_backward(&mut self) {
        let nx = self.counts[0];
        for row in self.nodes().step_by(nx).rev() {
            let mut last = [0.0; LANES];
            self.sweep_row(row, |level, x, around| {
                for i in (0..nx).rev() {
                    let previous = if i == 0 { [0.0; LANES] } else { x[i - 1] };
                    let here = level.wx[i];
                    let before = level.wx_before[i];
                    let mut sum = level.b[i];
                    for lane in 0..LANES {
                        sum[lane] += here * last[lane] + before * previous[lane] + around.sum(level, i, lane);
                        x[i][lane] = level.inverse[i] * sum[lane];
                    }
                    last = x[i];
                }
            });
        }
    }

    /// One forward Gauss-Seidel sweep on K x = b.
    pub(super) fn smooth_forward(&mut self) {
        let nx = self.counts[0];
        for row in self.nodes().step_by(nx) {
            let mut last = [0.0; LANES];
            self.sweep_row(row, |level, x, around| {
                for i in 0..nx {
                    let next = if i + 1 == nx { [0.0; LANES] } else { x[i + 1] };
                    let mut sum = level.b[i];
                    for lane in 0..LANES {
                        sum[lane] += level.wx_before[i] * last[lane]
                            + level.wx[i] * next[lane]
                            + around.sum(level, i, lane);
                        x[i][lane] = level.inverse[i] * sum[lane];
                    }
                    last = x[i];
                }
            });
        }
    }

    /// Hands out one row of x to change, and what stands around it.
    fn sweep_row(&mut self, row: usize, sweep: impl FnOnce(&Row<'_>, &mut [Lanes], &Neighbours<'_>)) {
        let [nx, sy, sz] = [self.counts[0], self.counts[0], self.counts[0] * self.counts[1]];
        let (before, rest) = self.x.split_at_mut(row);
        let (x, after) = rest.split_at_mut(nx);
        let around = Neighbours {
            previous_y: &before[row - sy..][..nx],
            next_y: &after[sy - nx..][..nx],
            previous_z: &before[row - sz..][..nx],
            next_z: &after[sz - nx..][..nx],
        };
        let level = Row {
            b: &self.b[row..][..nx],
            inverse: &self.inverse[row..][..nx],
            wx: &self.weight[0][row..][..nx],
            wx_before: &self.weight[0][row - 1..][..nx],
            wy: &self.weight[1][row..][..nx],
            wy_before: &self.weight[1][row - sy..][..nx],
            wz: &self.weight[2][row..][..nx],
            wz_before: &self.weight[2][row - sz..][..nx],
        };
        sweep(&level, x, &around);
    }
}

/// Right-hand side and weights of one row.
struct Row<'a> {
    b: &'a [Lanes],
    inverse: &'a [f32],
    wx: &'a [f32],
    wx_before: &'a [f32],
    wy: &'a [f32],
    wy_before: &'a [f32],
    wz: &'a [f32],
    wz_before: &'a [f32],
}

impl Neighbours<'_> {
    #[inline(always)]
    fn sum(&self, row: &Row<'_>, i: usize, lane: usize) -> f32 {
        row.wy_before[i] * self.previous_y[i][lane]
            + row.wy[i] * self.next_y[i][lane]
            + row.wz_before[i] * self.previous_z[i][lane]
            + row.wz[i] * self.next_z[i][lane]
    }
}
