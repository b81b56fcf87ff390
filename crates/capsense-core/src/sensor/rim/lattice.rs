//! Rims on a lattice: outlines along lattice lines, across them, and curved.

use super::half_plane::HalfPlane;
use super::place::{Place, Places};
use super::{Linked, Rim};
use crate::electrode::Electrode;
use crate::mesh::{Background, Lattice};
use crate::sensor::{FREE, Terminal};
use glam::DVec2;

/// Links of a share closer to 1 weigh so much more than edges that the node is as good as held.
const LARGEST_SHARE: f64 = 0.999;

/// The share of a node on a convex corner, in parts of that of a straight rim: with it, square plates of few cells have
/// the capacitance that they have on fine lattices, whether cells are flat or high.
const CONVEX_CORNER: f64 = 0.766;

/// Nodes closer to a corner than this part of a cell lie on it.
const ON_CORNER: f64 = 1e-6;

/// A lattice and what is known of it before its electrodes are.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ground<'a> {
    pub(crate) lattice: &'a Lattice,
    /// That of the lattice's tetrahedra.
    pub(crate) permittivity: &'a Background,
    /// What holds each node so far.
    pub(crate) terminals: &'a [Terminal],
}

/// The nodes that a thin electrode holds and those it is linked to. `flat` is how far from the electrode's plane a node
/// may lie.
pub(crate) fn rim_on_lattice(ground: Ground<'_>, electrode: &Electrode, flat: f64) -> Rim {
    let lattice = ground.lattice;
    let [xs, ys, zs] = lattice.axes();
    let [low, high] = electrode.outline.bounds();
    let places = Places::of(&electrode.outline);
    let mut rim = Rim::default();
    let inner = |axis: &[f64]| 1..axis.len() - 1;
    for k in inner(zs).filter(|&k| (zs[k] - electrode.z).abs() <= flat) {
        let height = (zs[k + 1] - zs[k]).max(zs[k] - zs[k - 1]);
        for j in inner(ys) {
            for i in inner(xs) {
                // One cell beyond the outline.
                let near =
                    xs[i + 1] >= low.x && xs[i - 1] <= high.x && ys[j + 1] >= low.y && ys[j - 1] <= high.y;
                if !near {
                    continue;
                }
                let size = DVec2::new(xs[i + 1] - xs[i - 1], ys[j + 1] - ys[j - 1]) / 2.0;
                let place = places.at(DVec2::new(xs[i], ys[j]), ON_CORNER * size.min_element());
                let node = lattice.node_index([i, j, k]) as u32;
                let near_rim = || Cell::around(ground, [i, j, k], size).link(&place);
                match link_of_far(&place, size, height).unwrap_or_else(near_rim) {
                    Link::Held => rim.held.push(node),
                    Link::Weight(weight) => {
                        rim.linked.push(Linked { node, weight, inside: place.distance <= 0.0 })
                    }
                    Link::None => {}
                }
            }
        }
    }
    rim
}

/// What most nodes are, without a look at what is around them: those so far from the rim that nothing there can matter.
fn link_of_far(place: &Place, size: DVec2, height: f64) -> Option<Link> {
    let rows = size.max_element();
    if place.distance >= rows {
        return Some(Link::None);
    }
    let held = HalfPlane::depth_of_share(LARGEST_SHARE / CONVEX_CORNER, rows, height);
    (-place.distance >= held).then_some(Link::Held)
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
    /// Above and below.
    sides: [Side; 2],
}

/// What is on one side of the plane.
struct Side {
    /// Height of the lattice cell.
    height: f64,
    /// Of that cell.
    permittivity: f64,
    /// ∫ dz/ε up to the nearest node that is held, as by a shield; infinite if that is further away than a cell is wide.
    to_shield: f64,
}

impl Cell {
    fn around(ground: Ground<'_>, place: [usize; 3], size: DVec2) -> Self {
        Self { size, sides: [true, false].map(|up| Side::of(ground, place, size, up)) }
    }

    fn link(&self, place: &Place) -> Link {
        // A corner counts at the four nodes around it, as much as each is near.
        let near = place
            .from_corner
            .map_or(0.0, |from| (1.0 - from.abs() / self.size).max(DVec2::ZERO).element_product());
        let part = 1.0 - (1.0 - CONVEX_CORNER) * near;
        let (share, weight) = match place.distance == 0.0 && near > 0.999 {
            true => {
                let [x, y] = [DVec2::X, DVec2::Y].map(|normal| self.across(normal, 0.0, part));
                (0.5 * (x.0 + y.0), 0.5 * (x.1 + y.1))
            }
            false => self.across(place.normal, place.distance, part),
        };
        if share >= LARGEST_SHARE {
            Link::Held
        } else if weight > 0.0 {
            Link::Weight(weight)
        } else {
            Link::None
        }
    }

    /// Share and weight of a node at a distance outside of a straight rim, the share reduced to a part of it. Oblique rims
    /// have rows closer to each other, of nodes further apart: exact along the axes and, on squares, along diagonals.
    fn across(&self, normal: DVec2, distance: f64, part: f64) -> (f64, f64) {
        let rows = 1.0 / (normal.abs() / self.size).element_sum();
        let [above, below] = &self.sides;
        let permittivity = [above.permittivity, below.permittivity];
        let half_plane = HalfPlane::new([above.height / rows, below.height / rows], permittivity);
        let share = part * half_plane.share(distance / rows);
        let open = half_plane.link(share.clamp(0.0, LARGEST_SHARE));
        // Over a shield that is nearer than the next row, the field goes straight down: a plate capacitor, of which the
        // electrode covers a part.
        let covered = (0.5 - distance / rows).clamp(0.0, LARGEST_SHARE);
        let plate = |side: &Side| rows / side.to_shield * covered / (1.0 - covered);
        let sum = permittivity[0] + permittivity[1];
        let weight: f64 =
            self.sides.iter().map(|side| f64::max(open * side.permittivity / sum, plate(side))).sum();
        (share, self.size.element_product() / rows * weight)
    }
}

impl Side {
    fn of(ground: Ground<'_>, [i, j, k]: [usize; 3], size: DVec2, up: bool) -> Self {
        let zs = &ground.lattice.axes()[2];
        let layer = |k: usize| if up { k } else { k - 1 };
        let next = |k: usize| if up { k + 1 } else { k - 1 };
        let height = |k: usize| zs[layer(k) + 1] - zs[layer(k)];
        let (mut at, mut depth, mut to_shield) = (k, 0.0, 0.0);
        loop {
            depth += height(at);
            to_shield += height(at) / ground.mean_permittivity([i, j, layer(at)]);
            at = next(at);
            let held = ground.terminals[ground.lattice.node_index([i, j, at])] != FREE;
            let beyond = depth > size.max_element() || at == 0 || at + 1 == zs.len();
            if held || beyond {
                let to_shield = if held && depth <= size.max_element() { to_shield } else { f64::INFINITY };
                let permittivity = ground.mean_permittivity([i, j, layer(k)]);
                return Self { height: height(k), permittivity, to_shield };
            }
        }
    }
}

impl Ground<'_> {
    /// Mean over the four cells of a layer around a node that is not at the wall, weighted with their areas.
    fn mean_permittivity(&self, [i, j, layer]: [usize; 3]) -> f64 {
        let [xs, ys, _] = self.lattice.axes();
        let (mut sum, mut area) = (0.0, 0.0);
        for (i, j) in [(i - 1, j - 1), (i, j - 1), (i - 1, j), (i, j)] {
            let of_cell = (xs[i + 1] - xs[i]) * (ys[j + 1] - ys[j]);
            sum += of_cell * self.permittivity.at(6 * self.lattice.cell_index([i, j, layer]));
            area += of_cell;
        }
        sum / area
    }
}
