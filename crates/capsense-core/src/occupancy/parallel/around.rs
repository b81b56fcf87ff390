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
    pub(super) length: f64,
    /// That along which the edge is, and those across it.
    pub(super) axis: usize,
    pub(super) across: [usize; 2],
    /// The steps to the neighbours below and above along either axis across the edge; zero at the rim of the lattice, where there is none.
    steps: [[f64; 2]; 2],
    /// The box around it, half-way to its neighbours.
    bounds: Aabb,
    /// The cell behind the first node in all directions, and how many cells it is to the one before along either axis across the edge.
    cell: usize,
    strides: [usize; 2],
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
        // No number is written to where an axis tells and then read with its neighbours: that waits.
        let plane = |axis: usize| {
            let (planes, at) = (&lattice.axes()[axis], place[axis]);
            let own = planes[at];
            let step = |plane: Option<&f64>| plane.map_or(0.0, |plane| plane - own);
            (own, [step(planes[..at].last()), step(planes.get(at + 1))])
        };
        let ((x, of_x), (y, of_y), (z, of_z)) = (plane(0), plane(1), plane(2));
        let [nodes_x, nodes_y, _] = lattice.node_counts();
        let (row, layer) = (nodes_x - 1, (nodes_x - 1) * (nodes_y - 1));
        let (own, across, steps, strides) = match axis {
            0 => (of_x, [1, 2], [of_y, of_z], [row, layer]),
            1 => (of_y, [2, 0], [of_z, of_x], [layer, 1]),
            _ => (of_z, [0, 1], [of_x, of_y], [1, row]),
        };
        let length = own[1];
        let reach = |of: usize, [below, above]: [f64; 2]| match of == axis {
            true => [0.0, above],
            false => [0.5 * below, 0.5 * above],
        };
        let ([min_x, max_x], [min_y, max_y], [min_z, max_z]) =
            (reach(0, of_x), reach(1, of_y), reach(2, of_z));
        let bounds = Aabb {
            min: DVec3::new(x + min_x, y + min_y, z + min_z),
            max: DVec3::new(x + max_x, y + max_y, z + max_z),
        };
        let cell = place[2] * layer + place[1] * row + place[0];
        let from = DVec3::new(x, y, z);
        (length > 0.0).then_some(Self { from, length, axis, across, steps, bounds, cell, strides })
    }

    /// How far the box around it, half-way to its neighbours, reaches along the axes across it.
    #[inline]
    pub(super) fn reach(&self) -> [[f64; 2]; 2] {
        self.steps.map(|[below, above]| [0.5 * below, 0.5 * above])
    }

    #[inline]
    pub(super) fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// The quarters of that box.
    #[inline]
    pub(super) fn quarters(&self) -> Quarters {
        let (mut all, mut count) = ([Quarter::default(); QUARTERS], 0);
        for quarter in 0..QUARTERS {
            let sides = [quarter / 2, quarter % 2];
            let (first, second) = (self.steps[0][sides[0]], self.steps[1][sides[1]]);
            let share = 0.25 * (first * second).abs();
            if share == 0.0 {
                continue;
            }
            let cell = self.cell - (1 - sides[0]) * self.strides[0] - (1 - sides[1]) * self.strides[1];
            all[count] = Quarter { offset: [0.25 * first, 0.25 * second], share, cell };
            count += 1;
        }
        Quarters { all, count }
    }

    pub(super) fn bounds_of(&self, quarter: &Quarter) -> Aabb {
        let (mut min, mut max) = (self.from, self.from);
        max[self.axis] = self.bounds.max[self.axis];
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
