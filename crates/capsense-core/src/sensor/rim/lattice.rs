//! Rims on a lattice: outlines along lattice lines, across them, and curved.

use super::half_plane::HalfPlane;
use super::place::{Corner, Place, Places};
use super::second_order::SecondOrder;
use super::stack::{Cell, Stack};
use super::{CONVEX_CORNER, LARGEST_SHARE, Link, Linked, Rim, RimEdge};
use crate::electrode::Electrode;
use crate::mesh::{Background, Lattice};
use crate::sensor::{DualLengths, FREE, Terminal};
use glam::DVec2;

/// Nodes closer to a convex corner than so many cells, along either axis, are told of both of its sides. Those further
/// away have at most one that is so near that it matters.
const NEAR_CORNER: f64 = 2.0;

/// At corners rims of smaller shares, as of cells four times as high as wide, count as if they had this one.
const SMALLEST_AT_CORNERS: f64 = 0.1;

/// How far above and below a rim cells are looked at, in distances of rows: what is further away hardly matters to how the
/// field at a rim of the lattice differs from that at a true rim.
const LOOK: f64 = 3.0;

/// Fields of which a larger part than this is not that of plates count as spreading altogether: with shields farther away than
/// one and a half cells, as without any, C is more exact by a quarter with the covered part, but what bodies change is not.
const SPREADING: f64 = 0.7;

/// What [`CONVEX_CORNER`] is between sides that are right in second order.
const CONVEX_CORNER_OF_SIDES: f64 = 0.68;

/// Where the smaller part of a rim's normal is as large as this, or larger, it is right in first order only.
const OBLIQUE: f64 = 0.25;

/// An edge out of an electrode keeps at least this part of its weight: those between flat cells have little.
const LEAST_OF_EDGE: f64 = 0.5;

/// Nodes closer to the outline than this part of a cell lie on it.
const ON_RIM: f64 = 1e-6;

/// A lattice and what is known of it before its electrodes are.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ground<'a> {
    pub(crate) lattice: &'a Lattice,
    /// `None` for links where edges have the weights of linear elements.
    pub(crate) dual_lengths: Option<&'a DualLengths>,
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
                let before = DVec2::new(xs[i] - xs[i - 1], ys[j] - ys[j - 1]);
                let after = DVec2::new(xs[i + 1] - xs[i], ys[j + 1] - ys[j]);
                let (size, middle) = (0.5 * (before + after), 0.25 * (after - before));
                let place = places.at(DVec2::new(xs[i], ys[j]), ON_RIM * size.min_element());
                let node = lattice.node_index([i, j, k]) as u32;
                let around = Surroundings { ground, place: [i, j, k], size, middle };
                // As far as the larger of two unequal cells reaches.
                let larger = before.max(after);
                if let Some(link) = link_of_far(&place, larger, height) {
                    rim.held.extend(matches!(link, Link::Held).then_some(node));
                    continue;
                }
                let shared = around.shared(&place);
                match Link::of_share(shared.share, shared.weight * shared.second.link) {
                    Link::Held => rim.held.push(node),
                    Link::Weight(weight) => {
                        let (covered, rows) = (around.covered(&place), around.rows_at(&place));
                        let inside = place.distance <= 0.0;
                        rim.linked.push(Linked { node, weight, of_elements: weight, inside, covered, rows });
                        let factor = 1.0 + shared.second.edge;
                        let outside = lattice.node_index(stepped([i, j, k], shared.normal)) as u32;
                        rim.edges.extend((factor != 1.0).then_some(RimEdge { node, outside, factor }));
                    }
                    Link::None => {}
                }
            }
        }
    }
    rim
}

/// The next place of a lattice along the axis that a direction in the plane is nearest to.
fn stepped([i, j, k]: [usize; 3], way: DVec2) -> [usize; 3] {
    let next = |at: usize, ahead: bool| if ahead { at + 1 } else { at - 1 };
    if way.x.abs() > way.y.abs() { [next(i, way.x > 0.0), j, k] } else { [i, next(j, way.y > 0.0), k] }
}

/// What most nodes are, without a look at what is around them: those so far from the rim that nothing there can matter.
fn link_of_far(place: &Place, size: DVec2, height: f64) -> Option<Link> {
    let rows = size.max_element();
    if place.distance >= rows {
        return Some(Link::None);
    }
    let held = HalfPlane::depth_of_share(1.0, rows, height);
    (-place.distance >= held).then_some(Link::Held)
}

/// The cell of the dual lattice around a node.
struct Surroundings<'a> {
    ground: Ground<'a>,
    /// Of the node.
    place: [usize; 3],
    /// Size in the plane.
    size: DVec2,
    /// Where its middle is from the node, as neighbours are not equally far.
    middle: DVec2,
}

impl Surroundings<'_> {
    fn shared(&self, place: &Place) -> Shared {
        match self.near_corner(place) {
            Some(corner) => self.at_corner(&corner),
            None => self.across(place.normal, place.distance),
        }
    }

    fn near_corner(&self, place: &Place) -> Option<Corner> {
        place.corner.filter(|corner| (corner.from.abs() / self.size).max_element() < NEAR_CORNER)
    }

    /// How far rows along a rim are apart. Those along an oblique one are closer to each other, of nodes further apart.
    fn rows(&self, normal: DVec2) -> f64 {
        1.0 / (normal.abs() / self.size).element_sum()
    }

    /// The same for a node: at a corner the closer ones of both sides.
    fn rows_at(&self, place: &Place) -> f64 {
        match self.near_corner(place) {
            Some(Corner { normals: [a, b], .. }) => self.rows(a).min(self.rows(b)),
            None => self.rows(place.normal),
        }
    }

    /// The part of it that an electrode covers, of which its rim leaves all behind it.
    fn covered(&self, place: &Place) -> f64 {
        let behind = |normal: DVec2, distance: f64| {
            (0.5 - (distance + normal.dot(self.middle)) / self.rows(normal)).clamp(0.0, 1.0)
        };
        match self.near_corner(place) {
            Some(Corner { from, normals: [a, b] }) => behind(a, a.dot(from)) * behind(b, b.dot(from)),
            None => behind(place.normal, place.distance),
        }
        .min(LARGEST_SHARE)
    }

    /// What the node's dual length along a rim is multiplied by: that of the axis which the rim is along, of others in between.
    fn along(&self, normal: DVec2) -> f64 {
        let Some(lengths) = self.ground.dual_lengths else { return 1.0 };
        let [i, j, _] = self.place;
        let [x, y] = [(0, i), (1, j)].map(|(axis, plane)| lengths.of_axis(axis)[plane]);
        (normal * normal).dot(DVec2::new(y, x))
    }

    /// At a distance outside of a straight rim: exact along the axes and, on squares, along diagonals.
    fn across(&self, normal: DVec2, distance: f64) -> Shared {
        let rows = self.rows(normal);
        let stack = |up| self.ground.stack(self.place, LOOK * rows, up).in_units_of(rows);
        let stacks = [true, false].map(stack);
        let half_plane = HalfPlane::new(&stacks);
        let plates: f64 = stacks.iter().map(Stack::plate).sum();
        let spreading = (1.0 - plates / half_plane.weight).max(0.0);
        // Where a field goes straight down, what counts is the part of the node's cell that is covered.
        let straight = (1.0 - spreading / SPREADING).max(0.0);
        let distance = distance + straight * normal.dot(self.middle);
        let share = half_plane.share(distance / rows).clamp(0.0, 1.0);
        Shared {
            share,
            on_rim: half_plane.share(0.0),
            weight: self.size.element_product() / rows * self.along(normal) * half_plane.weight,
            spreading,
            second: self.second_order(&half_plane, &stacks, share, normal, 1.0 - straight),
            normal,
        }
    }

    /// In parts of the edge's own weight, as far as a field spreads: plates have no second order. Nor have linear elements.
    fn second_order(
        &self,
        half_plane: &HalfPlane,
        stacks: &[Stack; 2],
        share: f64,
        normal: DVec2,
        spreading: f64,
    ) -> SecondOrder {
        if self.ground.dual_lengths.is_none() || share <= 0.0 || share >= LARGEST_SHARE {
            return SecondOrder::NONE;
        }
        let part = spreading * (1.0 - normal.abs().min_element() / OBLIQUE).max(0.0);
        let edge: f64 = stacks.iter().map(Stack::half_of_row).sum();
        let of = |part| {
            let second = SecondOrder::new(half_plane, share, part);
            SecondOrder { edge: second.edge * half_plane.weight / edge, ..second }
        };
        let second = of(part);
        let most = LEAST_OF_EDGE - 1.0;
        if second.edge < most { of(part * most / second.edge) } else { second }
    }

    /// Where a field goes straight down to a shield, what counts is the covered part of a node's cell: the product of what
    /// either side leaves of it. A field that spreads is stronger at corners, and the share is larger by an excess. It
    /// vanishes where either side has all of the node, and for a node on the corner, its neighbours equally far, it gives the
    /// share that is known.
    fn at_corner(&self, corner: &Corner) -> Shared {
        let [a, b] = corner.normals.map(|normal| self.across(normal, normal.dot(corner.from)));
        let convex = if self.ground.dual_lengths.is_some() { CONVEX_CORNER_OF_SIDES } else { CONVEX_CORNER };
        let on_rim = (0.5 * (a.on_rim + b.on_rim)).clamp(SMALLEST_AT_CORNERS, convex);
        let excess = (convex / on_rim - 1.0) / (1.0 - on_rim).powi(2);
        let spreading = 0.5 * (a.spreading + b.spreading);
        let [left_by_a, left_by_b] = [a, b].map(|side| 1.0 - side.share);
        let share = a.share * b.share * (1.0 + spreading * excess * left_by_a * left_by_b);
        // Of the side that matters more.
        let part_of_a = if left_by_a > 0.0 { left_by_a / (left_by_a + left_by_b) } else { 0.0 };
        let weight = part_of_a * a.weight + (1.0 - part_of_a) * b.weight;
        // On the corner itself nothing is known in second order.
        let nearer = if part_of_a > 0.5 { a } else { b };
        let second = nearer.second.fading((2.0 * part_of_a - 1.0).abs());
        Shared { share: share.min(1.0), weight, on_rim, spreading, second, normal: nearer.normal }
    }
}

/// How a node is shared between what is free and the electrode.
#[derive(Clone, Copy, Debug)]
struct Shared {
    /// From 0, of a free node, to 1, of one that is held.
    share: f64,
    /// What it is for nodes on the rim.
    on_rim: f64,
    /// Weight of a link for a share of 1/2.
    weight: f64,
    /// The part of the weight that is not that of the plate capacitors down and up to shields.
    spreading: f64,
    /// What link and edge weigh more or less, the edge in parts of its own weight.
    second: SecondOrder,
    /// Of the rim, or of the side that matters more.
    normal: DVec2,
}

impl Ground<'_> {
    /// The cells above or below a node, at least one, up to some depth or to a node that is held, as by a shield. Where dual lengths
    /// are matched to how cells grow, cells as high as the first in place of these.
    fn stack(&self, [i, j, k]: [usize; 3], depth: f64, up: bool) -> Stack {
        let zs = &self.lattice.axes()[2];
        let mut cells = Vec::new();
        let (mut at, mut seen) = (k, 0.0);
        loop {
            let layer = if up { at } else { at - 1 };
            let height = zs[layer + 1] - zs[layer];
            cells.push(Cell { height, permittivity: self.mean_permittivity([i, j, layer]) });
            seen += height;
            at = if up { at + 1 } else { at - 1 };
            let is_held = self.terminals[self.lattice.node_index([i, j, at])] != FREE;
            // Give or take rounding, so that mirrored nodes see as many cells.
            if is_held || seen >= 0.999 * depth || at == 0 || at + 1 == zs.len() {
                let first = cells.remove(0);
                if self.dual_lengths.is_some() && self.permittivity.is_uniform() {
                    let behind_first = if is_held && !cells.is_empty() { seen - first.height } else { 0.0 };
                    cells = alike(first, behind_first);
                }
                return Stack::new(first, cells, is_held);
            }
        }
    }

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

/// As many cells that are as high as one as fill a distance, nearly: at least one unless it is zero.
fn alike(cell: Cell, distance: f64) -> Vec<Cell> {
    let count = (distance / cell.height).round().max(1.0);
    let height = distance / count;
    if height > 0.0 { vec![Cell { height, ..cell }; count as usize] } else { Vec::new() }
}
