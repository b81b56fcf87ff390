//! The box around an edge of a lattice, and its quarters.

use crate::geometry::Aabb;
use crate::mesh::Lattice;
use glam::DVec3;
use std::ops::Deref;

/// Into how many the box around an edge is cut.
pub(super) const QUARTERS: usize = 4;

/// What is around an edge of a lattice.
pub(super) struct Around {
    pub(super) from: DVec3,
    pub(super) to: DVec3,
    /// That along which the edge is, and those across it.
    pub(super) axis: usize,
    pub(super) across: [usize; 2],
    /// The steps to the neighbours below and above along either axis across the edge; zero at the rim of the lattice, where there is none.
    steps: [[f64; 2]; 2],
    /// The first node.
    place: [usize; 3],
    /// How many cells there are along x and y.
    cells: [usize; 2],
}

/// A quarter of the box around an edge: what of it lies in one of the cells around the edge.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Quarter {
    /// The way from the edge to the quarter's middle along the axes across it. Half its widths are in it.
    pub(super) offset: [f64; 2],
    /// The area of its cross-section in square metres.
    pub(super) share: f64,
    /// The cell that it lies in.
    pub(super) cell: usize,
}

/// The quarters of the box around an edge. At the rim of the lattice there are fewer than four.
pub(super) struct Quarters {
    all: [Quarter; QUARTERS],
    count: usize,
}

impl Deref for Quarters {
    type Target = [Quarter];

    #[inline]
    fn deref(&self) -> &[Quarter] {
        &self.all[..self.count]
    }
}

impl Around {
    /// `None` if there is no such edge.
    #[inline]
    pub(super) fn edge(lattice: &Lattice, edge: usize) -> Option<Self> {
        let (node, axis) = (edge / 3, edge % 3);
        let place = lattice.node_place(node);
        let planes = lattice.axes();
        let from = DVec3::new(planes[0][place[0]], planes[1][place[1]], planes[2][place[2]]);
        let mut to = from;
        to[axis] = *planes[axis].get(place[axis] + 1)?;
        let across = [(axis + 1) % 3, (axis + 2) % 3];
        let steps = |axis: usize| {
            let (planes, at) = (&planes[axis], place[axis]);
            let step = |plane: Option<&f64>| plane.map_or(0.0, |plane| plane - planes[at]);
            [step(planes[..at].last()), step(planes.get(at + 1))]
        };
        let steps = [steps(across[0]), steps(across[1])];
        let [x, y, _] = lattice.node_counts();
        Some(Self { from, to, axis, across, steps, place, cells: [x - 1, y - 1] })
    }

    /// How far the box around it, half-way to its neighbours, reaches along the axes across it.
    #[inline]
    pub(super) fn reach(&self) -> [[f64; 2]; 2] {
        self.steps.map(|[below, above]| [0.5 * below, 0.5 * above])
    }

    #[inline]
    pub(super) fn bounds(&self) -> Aabb {
        let (mut min, mut max) = (self.from, self.to);
        for (axis, [below, above]) in self.across.into_iter().zip(self.reach()) {
            min[axis] += below;
            max[axis] += above;
        }
        Aabb { min, max }
    }

    /// The quarters of that box.
    #[inline]
    pub(super) fn quarters(&self) -> Quarters {
        let [columns, rows] = self.cells;
        let (mut all, mut count) = ([Quarter::default(); QUARTERS], 0);
        for quarter in 0..QUARTERS {
            let sides = [quarter / 2, quarter % 2];
            let (first, second) = (self.steps[0][sides[0]], self.steps[1][sides[1]]);
            let share = 0.25 * (first * second).abs();
            if share == 0.0 {
                continue;
            }
            let mut behind = self.place;
            behind[self.across[0]] -= 1 - sides[0];
            behind[self.across[1]] -= 1 - sides[1];
            let cell = (behind[2] * rows + behind[1]) * columns + behind[0];
            all[count] = Quarter { offset: [0.25 * first, 0.25 * second], share, cell };
            count += 1;
        }
        Quarters { all, count }
    }

    pub(super) fn bounds_of(&self, quarter: &Quarter) -> Aabb {
        let (mut min, mut max) = (self.from, self.to);
        for (axis, offset) in self.across.into_iter().zip(quarter.offset) {
            let reach = 2.0 * offset;
            min[axis] += reach.min(0.0);
            max[axis] += reach.max(0.0);
        }
        Aabb { min, max }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn quarters_share_the_box_around_an_edge() {
        let axes = [vec![0.0, 1.0, 3.0], vec![0.0, 2.0, 3.0, 7.0], vec![0.0, 1.0, 5.0]];
        let lattice = Lattice::new(axes).unwrap();
        let at = |place, axis| Around::edge(&lattice, 3 * lattice.node_index(place) + axis);
        let quarter = |offset, share, cell: [usize; 3]| {
            let cell = (0..12).find(|&other| lattice.cell_place(other) == cell).unwrap();
            Quarter { offset, share, cell }
        };
        let along_x = at([0, 2, 1], 0).unwrap();
        let found = along_x.quarters();
        assert_eq!(found[0], quarter([-0.25, -0.25], 0.25, [0, 1, 0]));
        assert_eq!(found[3], quarter([1.0, 1.0], 4.0, [0, 2, 1]));
        assert_eq!(found.iter().map(|quarter| quarter.share).sum::<f64>(), 2.5 * 2.5);
        let of = |min: [f64; 3], max: [f64; 3]| Aabb { min: min.into(), max: max.into() };
        assert_eq!(along_x.bounds_of(&found[1]), of([0.0, 2.5, 1.0], [1.0, 3.0, 3.0]));
        assert_eq!(along_x.bounds(), of([0.0, 2.5, 0.5], [1.0, 5.0, 3.0]));
        let along_z = at([0, 0, 1], 2).unwrap();
        let of_rim = along_z.quarters();
        assert_eq!(*of_rim, [quarter([0.25, 0.5], 0.5, [0, 0, 1])]);
        assert_eq!(along_z.bounds(), of([0.0, 0.0, 1.0], [0.5, 1.0, 5.0]));
        assert!(at([2, 0, 0], 0).is_none(), "there is no such edge");
    }
}
