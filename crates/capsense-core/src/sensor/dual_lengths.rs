//! What spacing that grows does to a field, and dual lengths that take it back.
//!
//! A lattice's edge weighs the product of two dual lengths across it over its own length. With linear elements a node's dual
//! length along an axis is half of both cells beside it, the trapezoidal rule. Where spacing grows away from what a field comes
//! from, that rule has too much of it throughout: with cells that grow like γ times the distance, γ²/16 of the admittance of any
//! wave. So dual lengths are matched: those that make each plane of nodes see what a lattice would be whose cells go
//! on as they are beside the plane. A wave that varies across the axis by λ, the sum of 4 sin²(k d/2)/d² over both axes there,
//! seen from a plane of that lattice, cells h high and the wall L away, has the charge
//! Y(λ) = sinh(q h)/h coth(q L), where sinh(q h/2) = √λ h/2,
//! for each unit of potential, on either side; on the lattice as it is, a continued fraction of cells and dual lengths (as of
//! optimal grids: Druskin and Knizhnerman 2000). Their sums over both sides are matched by least squares, at all planes, for
//! waves from the domain's size down to the shortest that cells beside a plane would have if they were cubes. What a
//! lattice of even spacing does is left alone: links at rims and at bodies' edges follow from such ([`super::rim`],
//! `core::occupancy::near_field`).

use crate::mesh::Lattice;
use faer::linalg::solvers::Solve;
use faer::{Mat, Side};

/// Waves, evenly on the logarithm.
const WAVES: usize = 14;

/// λ of the shortest wave times the square of the longer cell beside a plane: 4 along either axis across, if cells were cubes.
const SHORTEST: f64 = 8.0;

/// A dual length that differs by this much counts like as much of an error in one wave's admittance at one plane, times this.
const UNUSUAL: f64 = 0.03;

/// Steps of Gauss and Newton: the second already changes less than 1e-4.
const STEPS: usize = 3;

/// Factors are at most that far from 1: where cells differ so much that more would be asked for, they go as far as that allows.
const LARGEST: f64 = 0.2;

/// Cells that differ by no more than this part are alike.
const ALIKE: f64 = 1e-9;

/// By what a lattice's dual lengths are multiplied, for each plane of each axis.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct DualLengths {
    counts: [usize; 3],
    factors: [Vec<f64>; 3],
}

impl DualLengths {
    /// Those that are matched; along z only in a background that `is_uniform`. Waves see boards as well as cells there, the cells in
    /// and beside a board are as high as it asks for, and links at rims count them.
    pub(crate) fn matched(lattice: &Lattice, is_uniform: bool) -> Self {
        let [x, y, z] = lattice.axes();
        let along_z = if is_uniform { matched(z) } else { vec![1.0; z.len()] };
        Self { counts: lattice.node_counts(), factors: [matched(x), matched(y), along_z] }
    }

    /// Of the planes along an axis.
    pub(crate) fn of_axis(&self, axis: usize) -> &[f64] {
        &self.factors[axis]
    }

    /// What the weight of an edge between two nodes of the lattice is multiplied by: that of both axes across it. One
    /// between nodes that are not next to each other along an axis.
    pub(crate) fn of_edge(&self, ends: [u32; 2]) -> f64 {
        let [a, b] = ends.map(|node| self.place(node as usize));
        let mut across = (0..3).filter(|&axis| a[axis] == b[axis]);
        match (across.next(), across.next(), across.next()) {
            (Some(first), Some(second), None) => {
                self.factors[first][a[first]] * self.factors[second][a[second]]
            }
            _ => 1.0,
        }
    }

    fn place(&self, node: usize) -> [usize; 3] {
        let [nx, ny, _] = self.counts;
        let row = node / nx;
        [node % nx, row % ny, row / ny]
    }
}

/// The factors of one axis; those of the planes at its ends are 1.
fn matched(planes: &[f64]) -> Vec<f64> {
    let mut factors = vec![1.0; planes.len()];
    let axis = Axis::new(planes);
    if axis.inner == 0 || axis.is_even() {
        return factors;
    }
    for _ in 0..STEPS {
        let Some(changes) = axis.step(&factors) else { break };
        let inner = &mut factors[1..=axis.inner];
        let room =
            |(factor, change): (&f64, &f64)| (LARGEST - (factor - 1.0) * change.signum()) / change.abs();
        let part = inner.iter().zip(&changes).map(room).fold(1.0, f64::min);
        inner.iter_mut().zip(&changes).for_each(|(factor, change)| *factor += part * change);
        if part < 1.0 {
            break;
        }
    }
    factors
}

/// Planes of nodes along an axis, between walls at 0 V.
struct Axis {
    cells: Vec<f64>,
    /// Of the trapezoidal rule; those of the ends are of one cell.
    dual: Vec<f64>,
    /// Distance of each plane from both walls.
    to_walls: Vec<[f64; 2]>,
    /// Planes that are no walls.
    inner: usize,
}

/// What lies beyond each plane, without the plane's own dual length: charge over potential.
struct Beyond {
    before: Vec<f64>,
    behind: Vec<f64>,
}

impl Axis {
    fn new(planes: &[f64]) -> Self {
        let cells: Vec<f64> = planes.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let last = cells.len();
        let half = |cell: Option<&f64>| 0.5 * cell.copied().unwrap_or(0.0);
        let dual = |at: usize| half(at.checked_sub(1).map(|before| &cells[before])) + half(cells.get(at));
        Self {
            dual: (0..=last).map(dual).collect(),
            to_walls: planes.iter().map(|plane| [plane - planes[0], planes[last] - plane]).collect(),
            inner: last - 1,
            cells,
        }
    }

    fn is_even(&self) -> bool {
        self.cells.iter().all(|cell| (cell - self.cells[0]).abs() <= ALIKE * self.cells[0])
    }

    /// λ of the waves.
    fn waves(&self) -> impl Iterator<Item = f64> {
        let length = self.to_walls[0][1];
        let shortest = self.cells.iter().copied().fold(f64::INFINITY, f64::min);
        let (from, to) = (length.powi(-2), SHORTEST / (shortest * shortest));
        (0..WAVES).map(move |wave| from * (to / from).powf(wave as f64 / (WAVES - 1) as f64))
    }

    /// By how much factors change in one step of least squares.
    fn step(&self, factors: &[f64]) -> Option<Vec<f64>> {
        let mut fit = Fit::new(self.inner);
        let mut slopes = vec![0.0; self.inner];
        for wave in self.waves() {
            let beyond = self.beyond(wave, factors);
            for (plane, factor) in factors.iter().enumerate() {
                let Some(even) = self.even_from(plane, wave) else { continue };
                let own = wave * self.dual[plane] * factor;
                let excess = (beyond.before[plane] + beyond.behind[plane] + own) / even - 1.0;
                self.slopes(plane, wave, &beyond, &mut slopes);
                slopes.iter_mut().for_each(|slope| *slope /= even);
                fit.add(&slopes, -excess);
            }
        }
        fit.solve(&factors[1..=self.inner])
    }

    /// What a plane would see on both sides, or on the one that there is, if cells went on as they are beside it. None for waves that
    /// are too short for these.
    fn even_from(&self, plane: usize, wave: f64) -> Option<f64> {
        let [before, behind] = self.to_walls[plane];
        let sides = [(plane.checked_sub(1), before), (Some(plane), behind)];
        let mut sum = 0.0;
        for (cell, wall) in sides {
            if let Some(&cell) = cell.and_then(|cell| self.cells.get(cell)) {
                if wave * cell * cell >= SHORTEST {
                    return None;
                }
                sum += of_even_cells(wave, cell, wall);
            }
        }
        Some(sum)
    }

    fn beyond(&self, wave: f64, factors: &[f64]) -> Beyond {
        let last = self.cells.len();
        let (mut before, mut behind) = (vec![0.0; last + 1], vec![0.0; last + 1]);
        let along = |plane: usize| wave * self.dual[plane] * factors[plane];
        for plane in 1..=last {
            let next = plane - 1;
            let rest = if next == 0 { 0.0 } else { 1.0 / (before[next] + along(next)) };
            before[plane] = 1.0 / (self.cells[next] + rest);
        }
        for plane in (0..last).rev() {
            let next = plane + 1;
            let rest = if next == last { 0.0 } else { 1.0 / (behind[next] + along(next)) };
            behind[plane] = 1.0 / (self.cells[plane] + rest);
        }
        Beyond { before, behind }
    }

    /// How what a plane sees depends on each factor: λ times the dual length and the square of the potential there.
    fn slopes(&self, plane: usize, wave: f64, beyond: &Beyond, slopes: &mut [f64]) {
        slopes.fill(0.0);
        let mut at = |other: usize, potential: f64| {
            slopes[other - 1] = wave * self.dual[other] * potential * potential;
        };
        if (1..=self.inner).contains(&plane) {
            at(plane, 1.0);
        }
        let mut potential = 1.0;
        for other in plane + 1..=self.inner {
            potential *= 1.0 - beyond.behind[other - 1] * self.cells[other - 1];
            at(other, potential);
        }
        potential = 1.0;
        for other in (1..plane).rev() {
            potential *= 1.0 - beyond.before[other + 1] * self.cells[other];
            at(other, potential);
        }
    }
}

/// What a wave sees of cells that are all so high, up to a wall so far away, from a plane on, half of its dual length included.
fn of_even_cells(wave: f64, cell: f64, wall: f64) -> f64 {
    let decay = 2.0 / cell * (0.5 * wave.sqrt() * cell).asinh();
    (decay * cell).sinh() / cell / (decay * wall).tanh()
}

/// Linear least squares for changes of factors.
struct Fit {
    normal: Mat<f64>,
    right: Mat<f64>,
}

impl Fit {
    fn new(unknowns: usize) -> Self {
        Self { normal: Mat::zeros(unknowns, unknowns), right: Mat::zeros(unknowns, 1) }
    }

    /// One equation. Of the matrix the lower half is kept.
    fn add(&mut self, slopes: &[f64], value: f64) {
        for (i, of_i) in slopes.iter().enumerate() {
            self.right[(i, 0)] += of_i * value;
            for (j, of_j) in slopes.iter().enumerate().take(i + 1) {
                self.normal[(i, j)] += of_i * of_j;
            }
        }
    }

    /// The changes, factors that are near 1 preferred; none where rounding leaves no solution.
    fn solve(mut self, factors: &[f64]) -> Option<Vec<f64>> {
        let unusual = UNUSUAL * UNUSUAL;
        for (i, factor) in factors.iter().enumerate() {
            self.normal[(i, i)] += unusual;
            self.right[(i, 0)] -= unusual * (factor - 1.0);
        }
        let changes = self.normal.llt(Side::Lower).ok()?.solve(&self.right);
        Some((0..factors.len()).map(|i| changes[(i, 0)]).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::graded_axis;

    fn graded(growth: f64) -> Vec<f64> {
        graded_axis(-0.05, 0.45, &[0.0], &[], 0.004, growth)
    }

    /// The square mean error of what planes see of waves, as a part of what they would see of even cells.
    fn excess(planes: &[f64], factors: &[f64]) -> f64 {
        let axis = Axis::new(planes);
        let (mut squares, mut count) = (0.0, 0.0);
        for wave in axis.waves() {
            let beyond = axis.beyond(wave, factors);
            for (plane, factor) in factors.iter().enumerate() {
                if let Some(even) = axis.even_from(plane, wave) {
                    let own = wave * axis.dual[plane] * factor;
                    squares += ((beyond.before[plane] + beyond.behind[plane] + own) / even - 1.0).powi(2);
                    count += 1.0;
                }
            }
        }
        f64::sqrt(squares / count)
    }

    #[test]
    fn even_cells_stay_as_they_are() {
        let planes: Vec<f64> = (0..20).map(|plane| 0.01 * f64::from(plane)).collect();
        assert_eq!(matched(&planes), vec![1.0; 20]);
        assert!(excess(&planes, &[1.0; 20]) < 1e-12);
    }

    #[test]
    fn waves_see_less_of_spacing_that_grows() {
        for growth in [1.1, 1.2, 1.3] {
            let planes = graded(growth);
            let without = excess(&planes, &vec![1.0; planes.len()]);
            let with = excess(&planes, &matched(&planes));
            println!("{growth}: {without:.5} {with:.5}");
            assert!(without > 5e-4 && with < 0.75 * without, "{growth}: {without} {with}");
        }
    }

    /// Cells that grow like γ times the distance have γ²/16 too much of a wave's charge; see the module.
    #[test]
    fn what_linear_elements_have_too_much_of_is_a_sixteenth() {
        let growth: f64 = 1.05;
        let gamma = growth.ln();
        let planes: Vec<f64> =
            std::iter::once(0.0).chain((0..250).map(|cell| 1e-4 * growth.powi(cell))).collect();
        let axis = Axis::new(&planes);
        // Far longer than the first cell, and far shorter than the axis.
        let wave = 2500.0;
        let seen = axis.beyond(wave, &vec![1.0; planes.len()]).behind[0] + wave * axis.dual[0];
        let excess = (seen / wave.sqrt() - 1.0) / (gamma * gamma / 16.0);
        assert!((excess - 1.0).abs() < 0.1, "{excess}");
    }

    #[test]
    fn mirrored_planes_are_alike() {
        let planes = graded(1.25);
        let mirrored: Vec<f64> = planes.iter().rev().map(|plane| -plane).collect();
        let (ours, theirs) = (matched(&planes), matched(&mirrored));
        assert!(ours.iter().zip(theirs.iter().rev()).all(|(a, b)| (a - b).abs() < 1e-9));
        assert!(ours.iter().all(|factor| (0.8..1.2).contains(factor)), "{ours:?}");
    }

    #[test]
    fn an_edge_has_the_factors_of_both_axes_across() {
        let lattice = Lattice::new([graded(1.2), graded(1.3), graded(1.4)]).unwrap();
        let lengths = DualLengths::matched(&lattice, true);
        let ends = [[3, 4, 5], [4, 4, 5]].map(|place| lattice.node_index(place) as u32);
        let expected = lengths.of_axis(1)[4] * lengths.of_axis(2)[5];
        assert!(expected != 1.0 && lengths.of_edge(ends) == expected);
        let on_a_board = DualLengths::matched(&lattice, false);
        assert!(
            on_a_board.of_edge(ends) == lengths.of_axis(1)[4] && on_a_board.of_axis(0) == lengths.of_axis(0)
        );
        let diagonal = [[3, 4, 5], [4, 5, 5]].map(|place| lattice.node_index(place) as u32);
        assert!(lengths.of_edge(diagonal) == 1.0);
    }
}
