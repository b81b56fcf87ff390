//! The tensor lattice: graded coordinates along x, y and z, every cell split into six Kuhn tetrahedra.
//!
//! Linear elements on it are exactly a 7-point network: along each of a Kuhn tetrahedron's three orthogonal steps
//! there is a weight, along its diagonals there is none.

use super::{MeshError, TetMesh, Tets};
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
        TetMesh::checked(self.nodes(), Tets::of_lattice(self))
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
    pub(super) fn kuhn_tet(&self, cell: [usize; 3], path: [usize; 3]) -> [u32; 4] {
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
    // One division for each axis: they are slow.
    let row = index / nx;
    [index % nx, row % ny, row / ny]
}

/// Paths through a cell; those of even permutations first.
pub(super) const KUHN_PATHS: [[usize; 3]; 6] =
    [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [1, 0, 2], [2, 1, 0]];

/// Coordinates from `low` to `high` that are `finest` apart in the fine intervals and at `planes`, and whose spacing
/// grows by about `growth - 1` times the distance from the nearest of these. All of `planes` and the ends of the fine
/// intervals are among the coordinates.
pub fn graded_axis(
    low: f64,
    high: f64,
    planes: &[f64],
    fine: &[[f64; 2]],
    finest: f64,
    growth: f64,
) -> Vec<f64> {
    let spacing = |place: Along| finest + (growth - 1.0) * place.distance;
    spaced_axis(low, high, planes, fine, f64::INFINITY, spacing)
}

/// A place along an axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Along {
    pub(crate) coordinate: f64,
    /// From the nearest of the planes and of the fine intervals.
    pub(crate) distance: f64,
    /// How far the nearest of the fixed coordinates is from its own nearest neighbour, if it is a plane: one of the cells there
    /// can be no larger.
    pub(crate) room: f64,
}

/// A plane or the end of a fine interval, and how far the next fixed coordinate is.
#[derive(Clone, Copy)]
struct Anchor {
    coordinate: f64,
    room: f64,
}

/// Coordinates from `low` to `high` whose spacing follows a function of the place among `planes` and fine intervals. All of
/// `planes` and the ends of the fine intervals are among the coordinates.
///
/// Between two fixed coordinates the others are placed so that each step takes the same share of ∫ dx/s(x). There are as
/// many as that asks for, and up to twice as many where cells on both sides of a fixed one would differ by more than a
/// factor of `unequal`.
pub(crate) fn spaced_axis(
    low: f64,
    high: f64,
    planes: &[f64],
    fine: &[[f64; 2]],
    unequal: f64,
    spacing: impl Fn(Along) -> f64,
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
    let is_at = |x: f64, others: &[f64]| others.iter().any(|y| (y - x).abs() <= tolerance);
    let anchors: Vec<Option<Anchor>> = (0..fixed.len())
        .map(|at| {
            let coordinate = fixed[at];
            let is_plane = is_at(coordinate, planes);
            let is_anchor = is_plane || is_at(coordinate, fine.as_flattened());
            // What is fine between two ends may have any cells beyond these.
            let has_room = is_plane && at > 0 && at + 1 < fixed.len();
            let to_next = || (coordinate - fixed[at - 1]).min(fixed[at + 1] - coordinate);
            let room = if has_room { to_next() } else { high - low };
            is_anchor.then_some(Anchor { coordinate, room })
        })
        .collect();
    let span = |at: usize| {
        let (start, end) = (fixed[at], fixed[at + 1]);
        let middle = 0.5 * (start + end);
        let is_fine = fine.iter().any(|[from, to]| (from..=to).contains(&&middle));
        Span::new(start, end, &|coordinate| {
            let near = [anchors[at], anchors[at + 1]].into_iter().flatten();
            let near = near.map(|anchor| ((coordinate - anchor.coordinate).abs(), anchor.room));
            let far = (high - low, high - low);
            let (distance, room) = near.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or(far);
            let distance = if is_fine { 0.0 } else { distance };
            1.0 / spacing(Along { coordinate, distance, room })
        })
    };
    let mut spans: Vec<Span> = (0..fixed.len() - 1).map(span).collect();
    while let Some(coarser) = uneven(&spans, unequal) {
        spans[coarser].cells += 1;
    }
    let inner = spans.iter().flat_map(|span| (1..=span.cells).map(|cell| span.end_of(cell)));
    std::iter::once(fixed[0]).chain(inner).collect()
}

/// The span with the larger of two cells that meet at a fixed coordinate and differ by more than a factor of `unequal`.
fn uneven(spans: &[Span], unequal: f64) -> Option<usize> {
    (1..spans.len()).find_map(|span| {
        let (before, after) = (spans[span - 1].last_cell(), spans[span].first_cell());
        let larger = if before > after { span - 1 } else { span };
        let differ = before.max(after) > unequal * before.min(after);
        (differ && spans[larger].cells < spans[larger].most).then_some(larger)
    })
}

/// What lies between two fixed coordinates.
struct Span {
    start: f64,
    end: f64,
    step: f64,
    /// ∫ dx/s(x) up to each of some equal steps.
    cumulative: Vec<f64>,
    cells: usize,
    most: usize,
}

impl Span {
    fn new(start: f64, end: f64, density: &impl Fn(f64) -> f64) -> Self {
        const SAMPLES: usize = 512;
        let step = (end - start) / SAMPLES as f64;
        let mut cumulative = vec![0.0];
        for sample in 0..SAMPLES {
            let middle = start + (sample as f64 + 0.5) * step;
            cumulative.push(cumulative[sample] + density(middle) * step);
        }
        let cells = (cumulative[SAMPLES] - 1e-6).ceil().max(1.0) as usize;
        Self { start, end, step, cumulative, cells, most: 2 * cells }
    }

    /// Where a cell ends; they are numbered from one.
    fn end_of(&self, cell: usize) -> f64 {
        let last = self.cumulative.len() - 1;
        if cell == self.cells {
            return self.end;
        }
        let target = self.cumulative[last] * cell as f64 / self.cells as f64;
        let sample = self.cumulative.partition_point(|&sum| sum < target).clamp(1, last) - 1;
        let part =
            (target - self.cumulative[sample]) / (self.cumulative[sample + 1] - self.cumulative[sample]);
        self.start + (sample as f64 + part) * self.step
    }

    fn first_cell(&self) -> f64 {
        self.end_of(1) - self.start
    }

    fn last_cell(&self) -> f64 {
        self.end_of(self.cells) - if self.cells > 1 { self.end_of(self.cells - 1) } else { self.start }
    }
}
