//! The tensor lattice: graded coordinates along x, y and z, every cell split into six Kuhn tetrahedra.
//!
//! Linear elements on it are exactly a 7-point network: along each of a Kuhn tetrahedron's three orthogonal steps
//! there is a weight, along its diagonals there is none.

use super::{MeshError, TetMesh};
use crate::geometry::Aabb;
use glam::DVec3;

/// Coordinates of lattice planes along each axis, strictly increasing, at least two per axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Lattice {
    axes: [Vec<f64>; 3],
}

/// Coordinates that are not a lattice.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("lattice coordinates along axis {axis} must be finite, strictly increasing and at least two")]
pub struct InvalidAxis {
    /// 0, 1, 2 for x, y, z.
    pub axis: usize,
}

impl Lattice {
    /// Takes the coordinates of the lattice planes in metres.
    ///
    /// # Errors
    /// When an axis has fewer than two coordinates or they are not finite and strictly increasing.
    pub fn new(axes: [Vec<f64>; 3]) -> Result<Self, InvalidAxis> {
        for (axis, planes) in axes.iter().enumerate() {
            let increasing = planes.windows(2).all(|pair| pair[0] < pair[1]);
            if planes.len() < 2 || !increasing || !planes.iter().all(|plane| plane.is_finite()) {
                return Err(InvalidAxis { axis });
            }
        }
        Ok(Self { axes })
    }

    /// A lattice of equal cells.
    ///
    /// # Errors
    /// When the box is empty or an axis has no cell.
    pub fn uniform(domain: Aabb, cells: [usize; 3]) -> Result<Self, InvalidAxis> {
        let planes = |axis: usize| {
            let (low, high, count) = (domain.min[axis], domain.max[axis], cells[axis]);
            (0..=count).map(|k| low + (high - low) * k as f64 / count as f64).collect()
        };
        Self::new([planes(0), planes(1), planes(2)])
    }

    /// Coordinates of the lattice planes along x, y and z.
    pub fn axes(&self) -> &[Vec<f64>; 3] {
        &self.axes
    }

    /// Number of nodes along each axis.
    pub fn node_counts(&self) -> [usize; 3] {
        [self.axes[0].len(), self.axes[1].len(), self.axes[2].len()]
    }

    /// From a node's index to that of the next node along each axis.
    pub fn strides(&self) -> [usize; 3] {
        [1, self.axes[0].len(), self.axes[0].len() * self.axes[1].len()]
    }

    /// Number of tetrahedra: six for each cell.
    pub fn tet_count(&self) -> usize {
        6 * self.axes.iter().map(|planes| planes.len() - 1).product::<usize>()
    }

    /// Index of a node; x runs fastest.
    pub fn node_index(&self, [i, j, k]: [usize; 3]) -> usize {
        let [nx, ny, _] = self.node_counts();
        (k * ny + j) * nx + i
    }

    /// The indices of the three planes that a node lies in, from its index.
    pub fn node_place(&self, node: usize) -> [usize; 3] {
        place_of_index(node, self.node_counts())
    }

    /// Index of the cell behind a node in all three directions; x runs fastest. Its six tetrahedra stand together.
    pub(crate) fn cell_index(&self, [i, j, k]: [usize; 3]) -> usize {
        let [nx, ny, _] = self.node_counts();
        (k * (ny - 1) + j) * (nx - 1) + i
    }

    /// The node that a cell lies behind in all three directions, from the cell's index.
    pub(crate) fn cell_place(&self, cell: usize) -> [usize; 3] {
        place_of_index(cell, self.node_counts().map(|count| count - 1))
    }

    /// The lattice as tetrahedra.
    ///
    /// # Errors
    /// When there are more nodes than 32-bit indices can name.
    pub fn to_tet_mesh(&self) -> Result<TetMesh, MeshError> {
        let [nx, ny, nz] = self.node_counts();
        let mut tets = Vec::with_capacity(self.tet_count());
        for k in 0..nz - 1 {
            for j in 0..ny - 1 {
                for i in 0..nx - 1 {
                    tets.extend(KUHN_PATHS.map(|path| self.kuhn_tet([i, j, k], path)));
                }
            }
        }
        TetMesh::new(self.nodes(), tets)
    }

    /// Positions of all nodes, in metres.
    pub(super) fn nodes(&self) -> Vec<DVec3> {
        let [x, y, z] = &self.axes;
        let row = |y: f64, z: f64| x.iter().map(move |&x| DVec3::new(x, y, z));
        z.iter().flat_map(|&z| y.iter().flat_map(move |&y| row(y, z))).collect()
    }

    /// The corners that are met on a walk through a cell along the three axes in the given order.
    pub(super) fn kuhn_path(&self, cell: [usize; 3], path: [usize; 3]) -> [u32; 4] {
        let mut corner = cell;
        let mut tet = [self.node_index(corner) as u32; 4];
        for (step, axis) in path.into_iter().enumerate() {
            corner[axis] += 1;
            tet[step + 1] = self.node_index(corner) as u32;
        }
        tet
    }

    /// The tetrahedron of a path, with positive orientation.
    fn kuhn_tet(&self, cell: [usize; 3], path: [usize; 3]) -> [u32; 4] {
        let mut tet = self.kuhn_path(cell, path);
        let odd = path == [0, 2, 1] || path == [1, 0, 2] || path == [2, 1, 0];
        if odd {
            tet.swap(2, 3);
        }
        tet
    }
}

/// Where a thing is among so many along each axis that are numbered with x running fastest.
fn place_of_index(index: usize, [nx, ny, _]: [usize; 3]) -> [usize; 3] {
    [index % nx, index / nx % ny, index / (nx * ny)]
}

/// Paths through a cell; those of even permutations first.
pub(super) const KUHN_PATHS: [[usize; 3]; 6] =
    [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [1, 0, 2], [2, 1, 0]];

/// Coordinates from `low` to `high` that are `finest` apart in the fine intervals and at `planes`, and whose spacing
/// grows by about `growth - 1` times the distance from the nearest of these. All of `planes` and the ends of the fine
/// intervals are among the coordinates.
///
/// The wanted spacing is s(x) = finest + (growth - 1)·d(x); between two fixed coordinates the others are placed so
/// that each step takes the same share of ∫ dx/s(x).
pub fn graded_axis(
    low: f64,
    high: f64,
    planes: &[f64],
    fine: &[[f64; 2]],
    finest: f64,
    growth: f64,
) -> Vec<f64> {
    let mut fixed: Vec<f64> = planes
        .iter()
        .copied()
        .chain(fine.iter().flatten().copied())
        .filter(|&x| x > low && x < high)
        .chain([low, high])
        .collect();
    fixed.sort_by(f64::total_cmp);
    let tolerance = 1e-9 * (high - low);
    fixed.dedup_by(|b, a| (*b - *a).abs() <= tolerance);
    let distance = |x: f64| {
        let to_planes = planes.iter().map(|&p| (x - p).abs());
        let to_fine = fine.iter().map(|&[a, b]| (a - x).max(x - b).max(0.0));
        to_planes.chain(to_fine).fold(f64::INFINITY, f64::min)
    };
    let density = |x: f64| 1.0 / (finest + (growth - 1.0) * distance(x).min(high - low));
    let mut axis = vec![fixed[0]];
    for pair in fixed.windows(2) {
        place_between(pair[0], pair[1], &density, &mut axis);
    }
    axis
}

/// Appends coordinates after `a` up to and including `b`, each step taking an equal share of the density's integral.
fn place_between(a: f64, b: f64, density: &impl Fn(f64) -> f64, axis: &mut Vec<f64>) {
    const SAMPLES: usize = 512;
    let step = (b - a) / SAMPLES as f64;
    let mut cumulative = vec![0.0];
    for sample in 0..SAMPLES {
        let middle = a + (sample as f64 + 0.5) * step;
        cumulative.push(cumulative[sample] + density(middle) * step);
    }
    let total = cumulative[SAMPLES];
    let count = (total - 1e-6).ceil().max(1.0) as usize;
    let mut sample = 0;
    for k in 1..count {
        let target = total * k as f64 / count as f64;
        while cumulative[sample + 1] < target {
            sample += 1;
        }
        let part = (target - cumulative[sample]) / (cumulative[sample + 1] - cumulative[sample]);
        axis.push(a + (sample as f64 + part) * step);
    }
    axis.push(b);
}
