//! Rims on a lattice: outlines along lattice lines, across them, and curved.

use super::Rim;
use super::half_plane::HalfPlane;
use super::place::{Place, place};
use crate::electrode::Electrode;
use crate::mesh::{Background, Lattice};
use glam::DVec2;
use std::f64::consts::PI;

/// Links of a share closer to 1 weigh so much more than edges that the node is as good as held.
const LARGEST_SHARE: f64 = 0.999;

/// The share of a node on a convex corner, in parts of that of a straight rim: with it, square plates of few cells have
/// the capacitance that they have on fine lattices, whether cells are flat or high.
const CONVEX_CORNER: f64 = 0.766;

/// Nodes closer to a corner than this part of a cell lie on it.
const ON_CORNER: f64 = 1e-6;

/// The nodes that a thin electrode holds and those it is linked to. `permittivity` is that of the lattice's
/// tetrahedra, `flat` how far from the electrode's plane a node may lie.
pub(crate) fn rim_on_lattice(
    lattice: &Lattice,
    permittivity: &Background,
    electrode: &Electrode,
    flat: f64,
) -> Rim {
    let [xs, ys, zs] = lattice.axes();
    let [low, high] = electrode.outline.bounds();
    let mut rim = Rim::default();
    let inner = |axis: &[f64]| 1..axis.len() - 1;
    for k in inner(zs).filter(|&k| (zs[k] - electrode.z).abs() <= flat) {
        for j in inner(ys) {
            for i in inner(xs) {
                // One cell beyond the outline.
                let near =
                    xs[i + 1] >= low.x && xs[i - 1] <= high.x && ys[j + 1] >= low.y && ys[j - 1] <= high.y;
                if !near {
                    continue;
                }
                let cell = Cell::around(lattice, permittivity, [i, j, k]);
                let slack = ON_CORNER * cell.size.min_element();
                let place = place(&electrode.outline, DVec2::new(xs[i], ys[j]), slack);
                let node = lattice.node_index([i, j, k]) as u32;
                match cell.link(&place) {
                    Link::Held => rim.held.push(node),
                    Link::Weight(weight) => rim.linked.push((node, weight)),
                    Link::None => {}
                }
            }
        }
    }
    rim
}

enum Link {
    Held,
    Weight(f64),
    None,
}

/// The cell of the dual lattice around a node.
struct Cell {
    /// Size in the plane.
    size: DVec2,
    /// Heights of the lattice cells above and below.
    heights: [f64; 2],
    permittivity: [f64; 2],
}

impl Cell {
    fn around(lattice: &Lattice, permittivity: &Background, [i, j, k]: [usize; 3]) -> Self {
        let [xs, ys, zs] = lattice.axes();
        let [cells_x, cells_y] = [xs.len() - 1, ys.len() - 1];
        let size = DVec2::new(xs[i + 1] - xs[i - 1], ys[j + 1] - ys[j - 1]) / 2.0;
        let mean = |layer: usize| {
            let of_cells = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(di, dj)| {
                let (i, j) = (i - 1 + di, j - 1 + dj);
                let area = (xs[i + 1] - xs[i]) * (ys[j + 1] - ys[j]);
                area * permittivity.at(6 * ((layer * cells_y + j) * cells_x + i))
            });
            of_cells.iter().sum::<f64>() / (4.0 * size.x * size.y)
        };
        Self { size, heights: [zs[k + 1] - zs[k], zs[k] - zs[k - 1]], permittivity: [mean(k), mean(k - 1)] }
    }

    fn link(&self, place: &Place) -> Link {
        let (share, weight) = match place.corner {
            None => self.across(place.normal, place.distance),
            Some(angle) => self.at_corner(angle),
        };
        if share >= LARGEST_SHARE {
            Link::Held
        } else if share > 0.0 {
            Link::Weight(weight)
        } else {
            Link::None
        }
    }

    /// Share and weight of a node at a distance outside of a straight rim. Oblique rims have rows closer to each other,
    /// of nodes further apart: exact along the axes and, on squares, along diagonals.
    fn across(&self, normal: DVec2, distance: f64) -> (f64, f64) {
        let rows = 1.0 / (normal.abs() / self.size).element_sum();
        let half_plane = HalfPlane::new(self.heights.map(|height| height / rows), self.permittivity);
        let share = half_plane.share(distance / rows);
        (share, self.size.element_product() / rows * half_plane.link(share))
    }

    /// The same for a node on a corner between two sides along the axes.
    fn at_corner(&self, angle: f64) -> (f64, f64) {
        let part = if angle < PI { CONVEX_CORNER } else { 1.0 };
        let sides = [DVec2::X, DVec2::Y].map(|normal| {
            let rows = 1.0 / (normal / self.size).element_sum();
            let half_plane = HalfPlane::new(self.heights.map(|height| height / rows), self.permittivity);
            let share = part * half_plane.share(0.0);
            (share, self.size.element_product() / rows * half_plane.link(share.clamp(0.0, LARGEST_SHARE)))
        });
        (0.5 * (sides[0].0 + sides[1].0), 0.5 * (sides[0].1 + sides[1].1))
    }
}
