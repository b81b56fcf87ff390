//! A node of a lattice, its neighbours, and distances counted in cells.

use super::Cells;
use super::cells::{CellArrays, CellGroups, PlaneCells, RowCells, TOGETHER};
use super::row::smaller;
use super::share::part_within;
use crate::geometry::Aabb;
use crate::mesh::{Edges, Lattice};
use crate::sensor::DualLengths;
use glam::DVec3;
use std::ops::Range;

/// So many cells from an edge of a conductor, nothing is known of it. With two cells a frame of exact solids takes longer by a ninth, and
/// errors are as large; with one and a half, steps of a bar sideways differ by up to 0.10 of themselves, not 0.09 (`docs/interface.md`).
pub(super) const FAR: f64 = 1.6;
/// Planes of nodes on either side of an edge that may be nearer.
const PLANES: usize = 2;
/// The same as [`FAR`] off the lattice, where a cell is no more than a mean of edges of all lengths. With 1.6 a mesh that has dihedral angles of
/// 1e-6 degrees was solved with an error that was not told.
pub(in super::super) const FAR_OFF_LATTICE: f64 = 2.0;

/// A plane of nodes across an axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    pub(super) at: f64,
    /// How far the planes below and above are; zero where the lattice ends.
    ways: [f64; 2],
    /// Where they are, or this one where the lattice ends.
    next: [f64; 2],
    /// The cells below and above and those behind them, the nearer first. Where the lattice ends, cells are as the last one.
    pub(super) cells: [[f64; PLANES]; 2],
    /// By how much cells grow from one to the next, upwards, as far as two on either side tell; no more than by the smaller one beside the plane.
    growth: f64,
    /// One over the ways; zero where the lattice ends.
    inverse: [f64; 2],
    /// How far what is less than [`FAR`] cells away may be.
    reach: f64,
    /// Half of the way from one neighbour to the other.
    pub(super) width: f64,
    /// What the plane's dual length is of that.
    dual: f64,
    /// By how much the way to the neighbour above is longer than that to the one below, and a twelfth of that.
    pub(super) skew: f64,
    skew_twelfth: f64,
    /// The ways to the nearer and to the farther neighbour.
    pub(super) narrowest: f64,
    longest: f64,
    per_longest: f64,
    /// A bit for each neighbour that there is.
    sides: u8,
    /// By how much the numbers of nodes differ from those of their neighbours below and above; zero where the lattice ends.
    strides: [usize; 2],
    /// The first and the last plane, and one over the sizes of the cells there.
    ends: [f64; 2],
    per_end: [f64; 2],
}

impl Plane {
    /// One of the planes across an axis along which numbers of nodes grow by `stride`.
    fn of(planes: &[f64], index: usize, stride: usize, dual: f64) -> Self {
        let at = planes[index];
        let next = [index.checked_sub(1), Some(index + 1)]
            .map(|next| next.and_then(|next| planes.get(next)).copied().unwrap_or(at));
        let ways = [at - next[0], next[1] - at];
        let [below, above] = ways;
        let longest = below.max(above);
        let narrowest = if below > 0.0 && above > 0.0 { below.min(above) } else { longest };
        // Behind the first and the last plane, cells are as those before it.
        let two_below = if index > 1 { at - planes[index - 2] } else { 2.0 * longest };
        let two_above = planes.get(index + 2).map_or(2.0 * longest, |plane| plane - at);
        let first = ways.map(|way| if way > 0.0 { way } else { longest });
        let behind = [
            index.checked_sub(2).map(|second| next[0] - planes[second]),
            planes.get(index + 2).map(|second| second - next[1]),
        ];
        let cells = [0, 1].map(|side| [first[side], behind[side].unwrap_or(first[side])]);
        let [pair_below, pair_above] = cells.map(|[first, second]| first + second);
        Self {
            at,
            ways,
            next,
            cells,
            growth: (0.25 * (pair_above - pair_below)).clamp(-narrowest, narrowest),
            inverse: ways.map(|way| if way > 0.0 { 1.0 / way } else { 0.0 }),
            reach: two_below.max(two_above),
            width: 0.5 * (below + above),
            dual,
            skew: above - below,
            skew_twelfth: (above - below) / 12.0,
            narrowest,
            longest,
            per_longest: 1.0 / longest,
            sides: u8::from(below > 0.0) | u8::from(above > 0.0) << 1,
            strides: ways.map(|way| if way > 0.0 { stride } else { 0 }),
            ends: [planes[0], planes[planes.len() - 1]],
            per_end: [planes[1] - planes[0], planes[planes.len() - 1] - planes[planes.len() - 2]]
                .map(f64::recip),
        }
    }

    /// How many cells a coordinate is away from where the lattice ends, no more than one; zero outside.
    fn within(&self, coordinate: f64) -> f64 {
        let [first, last] = self.ends;
        let [from_first, from_last] = [coordinate - first, last - coordinate];
        (from_first * self.per_end[0]).min(from_last * self.per_end[1]).clamp(0.0, 1.0)
    }

    /// Cells to a coordinate, parts of them counted; no more than [`FAR`].
    #[inline]
    fn cells_to(&self, coordinate: f64) -> f64 {
        let side = usize::from(coordinate > self.at);
        let [first, second] = self.cells[side];
        let part = (coordinate - self.at).abs() / first;
        if part <= 1.0 || self.ways[side] == 0.0 {
            return part.min(FAR);
        }
        (1.0 + (coordinate - self.next[side]).abs() / second).min(FAR)
    }
}

/// The planes of a lattice.
#[derive(Clone, Debug, Default)]
pub(in super::super) struct Stars {
    planes: [Vec<Plane>; 3],
    along_x: CellArrays,
    /// The cells beside the planes across y and z.
    across: [Vec<PlaneCells>; 2],
    /// By how much the numbers of nodes grow along each axis.
    strides: [usize; 3],
}

/// The row of nodes that was asked for last.
#[derive(Clone, Debug, Default)]
pub(in super::super) struct Row {
    nodes: Range<usize>,
    /// Its planes across y and z.
    place: [usize; 2],
}

impl Stars {
    /// `is_uniform` tells whether the background has one permittivity.
    pub(super) fn of(lattice: &Lattice, is_uniform: bool) -> Self {
        let strides = lattice.strides();
        let lengths = DualLengths::matched(lattice, is_uniform);
        let planes: [Vec<Plane>; 3] = std::array::from_fn(|axis| {
            let (planes, lengths) = (&lattice.axes()[axis], lengths.of_axis(axis));
            (0..planes.len()).map(|index| Plane::of(planes, index, strides[axis], lengths[index])).collect()
        });
        let along_x = CellArrays::of(&planes[0]);
        let across = [1, 2].map(|axis: usize| planes[axis].iter().map(PlaneCells::of).collect());
        Self { planes, along_x, across, strides }
    }

    /// Those of some nodes that are in the row of the first.
    pub(super) fn in_row(&self, nodes: Range<usize>, row: &mut Row) -> StarsInRow<'_> {
        self.find_row(nodes.start, row);
        let [x, y, z] = &self.planes;
        let nodes = nodes.start..nodes.end.min(row.nodes.end);
        let from = nodes.start - row.nodes.start;
        StarsInRow {
            x: &x[from..from + nodes.len()],
            across: [&y[row.place[0]], &z[row.place[1]]],
            cells_across: [0, 1].map(|across| &self.across[across][row.place[across]]),
            along_x: self.along_x.groups(from, nodes.len().next_multiple_of(TOGETHER)),
            nodes,
        }
    }

    /// The number of a neighbour that a node has.
    pub(super) fn neighbour_of(&self, node: usize, number: usize) -> usize {
        let stride = self.strides[number / 2];
        if number.is_multiple_of(2) { node - stride } else { node + stride }
    }

    /// Notes the row of a node.
    #[inline]
    fn find_row(&self, node: usize, row: &mut Row) {
        let [x, y, _] = &self.planes;
        if !row.nodes.contains(&node) {
            let number = node / x.len();
            *row = Row {
                nodes: number * x.len()..(number + 1) * x.len(),
                place: [number % y.len(), number / y.len()],
            };
        }
    }

    /// A node of the lattice, best in the row of the one before.
    #[inline]
    pub(in super::super) fn at(&self, node: usize, row: &mut Row) -> Star<'_> {
        self.find_row(node, row);
        let [x, y, z] = &self.planes;
        let planes = [&x[node - row.nodes.start], &y[row.place[0]], &z[row.place[1]]];
        Star { node, planes }
    }
}

/// Nodes next to each other in a row.
pub(super) struct StarsInRow<'a> {
    pub(super) nodes: Range<usize>,
    x: &'a [Plane],
    across: [&'a Plane; 2],
    cells_across: [&'a PlaneCells; 2],
    along_x: CellGroups<'a>,
}

impl StarsInRow<'_> {
    /// Each of them.
    pub(super) fn each(&self) -> impl Iterator<Item = Star<'_>> {
        let [y, z] = self.across;
        let at = move |(node, x)| Star { node, planes: [x, y, z] };
        self.nodes.clone().zip(self.x).map(at)
    }

    /// The cells around them.
    pub(super) fn cells(&self) -> RowCells<'_> {
        RowCells { x: self.along_x, across: self.cells_across }
    }

    /// Whether all of a box is a cell or more away from where the lattice ends.
    pub(super) fn is_within(&self, bounds: &Aabb) -> bool {
        let [y, z] = self.across;
        self.x.first().is_some_and(|x| {
            let is_within =
                |place: DVec3| x.within(place.x).min(y.within(place.y)).min(z.within(place.z)) >= 1.0;
            is_within(bounds.min) && is_within(bounds.max)
        })
    }

    /// Whether the cells around any of them reach a box across the row.
    pub(super) fn reach(&self, bounds: &Aabb) -> bool {
        (0..2).all(|across| {
            let [below, above] = self.across[across].next;
            bounds.min[1 + across] <= above && bounds.max[1 + across] >= below
        })
    }
}

/// A node of the lattice and its neighbours.
pub(in super::super) struct Star<'a> {
    pub(super) node: usize,
    planes: [&'a Plane; 3],
}

impl Star<'_> {
    /// Where the node is.
    #[inline]
    pub(in super::super) fn place(&self) -> DVec3 {
        let [x, y, z] = self.planes;
        DVec3::new(x.at, y.at, z.at)
    }

    /// How far the neighbours below and above along an axis are; zero where the lattice ends.
    #[inline]
    pub(in super::super) fn ways(&self, axis: usize) -> [f64; 2] {
        self.planes[axis].ways
    }

    /// By how much cells grow from one to the next upwards along an axis: of the two on either side, so that cells that are all cut into the
    /// same number of parts grow as evenly as they did.
    #[inline]
    pub(super) fn growth(&self, axis: usize) -> f64 {
        self.planes[axis].growth
    }

    /// The plane of the neighbour above along an axis.
    #[inline]
    pub(in super::super) fn next(&self, axis: usize) -> f64 {
        self.planes[axis].next[1]
    }

    /// The neighbour on a side of the node along an axis; none where the lattice ends.
    #[inline]
    pub(super) fn neighbour(&self, axis: usize, upwards: bool) -> Option<usize> {
        let (node, step) = self.step(axis, usize::from(upwards));
        (step != 0.0).then_some(node)
    }

    /// The neighbour below (0) or above (1) along an axis, and the way there, negative if below. Where the lattice ends, the
    /// node itself.
    #[inline]
    pub(super) fn step(&self, axis: usize, side: usize) -> (usize, f64) {
        let &Plane { ways, strides, .. } = self.planes[axis];
        if side == 0 { (self.node - strides[0], -ways[0]) } else { (self.node + strides[1], ways[1]) }
    }

    /// One over the way to a neighbour; zero where the lattice ends.
    #[inline]
    pub(super) fn inverse(&self, axis: usize, side: usize) -> f64 {
        self.planes[axis].inverse[side]
    }

    /// Which of the node's edges exist: a bit for that to the neighbour below along each axis and that above.
    #[inline]
    pub(super) fn sides(&self) -> u8 {
        let [x, y, z] = self.planes;
        x.sides | y.sides << 2 | z.sides << 4
    }

    /// The area of the dual face of an edge along an axis: its weight in air times its length, dual lengths being matched. Of Kuhn's tetrahedra, cells on
    /// the diagonal from below to above count by a third, the other two by a sixth.
    #[inline]
    pub(super) fn area(&self, axis: usize) -> f64 {
        let [a, b] = [1, 2].map(|next| self.planes[(axis + next) % 3]);
        (a.width * b.width + a.skew * b.skew_twelfth) * (a.dual * b.dual)
    }

    /// The way to the nearer neighbour along an axis.
    #[inline]
    pub(in super::super) fn narrowest(&self, axis: usize) -> f64 {
        self.planes[axis].narrowest
    }

    /// Half of the way from one neighbour along an axis to the other.
    #[inline]
    pub(in super::super) fn width(&self, axis: usize) -> f64 {
        self.planes[axis].width
    }

    /// The ways to the farther neighbour along each axis.
    #[inline]
    pub(super) fn longest(&self) -> DVec3 {
        let [x, y, z] = self.planes;
        DVec3::new(x.longest, y.longest, z.longest)
    }

    /// One over the way to the farthest neighbour.
    #[inline]
    pub(super) fn per_longest(&self) -> f64 {
        let [x, y, z] = self.planes;
        smaller(smaller(x.per_longest, y.per_longest), z.per_longest)
    }

    /// The box up to the neighbours, which holds all that is beside the node's edges.
    #[inline]
    pub(super) fn bounds(&self) -> Aabb {
        let [x, y, z] = self.planes;
        let corner = |side: usize| DVec3::new(x.next[side], y.next[side], z.next[side]);
        Aabb { min: corner(0), max: corner(1) }
    }
}

impl Cells for Star<'_> {
    /// Along the axis where there are most.
    #[inline(always)]
    fn far(&self) -> f64 {
        FAR
    }

    #[inline]
    fn cells_to(&self, point: DVec3) -> f64 {
        let [x, y, z] = self.planes;
        x.cells_to(point.x).max(y.cells_to(point.y)).max(z.cells_to(point.z))
    }

    #[inline]
    fn is_next(&self, point: DVec3) -> bool {
        self.bounds().contains(point)
    }

    #[inline]
    fn reach(&self) -> DVec3 {
        let [x, y, z] = self.planes;
        DVec3::new(x.reach, y.reach, z.reach)
    }

    fn within(&self, place: DVec3, along: DVec3) -> f64 {
        let [x, y, z] = self.planes;
        part_within(DVec3::new(x.within(place.x), y.within(place.y), z.within(place.z)), along)
    }

    #[inline]
    fn size_along(&self, direction: DVec3) -> f64 {
        let [x, y, z] = self.planes;
        let along = direction.abs();
        along.x * x.narrowest + along.y * y.narrowest + along.z * z.narrowest
    }

    /// Of corners of a cell that lie opposite each other, the pair that is farthest from the axis.
    fn size_across(&self, axis: DVec3) -> f64 {
        let sizes = DVec3::from_array(self.planes.map(|plane| plane.narrowest));
        let DVec3 { x, y, z } = sizes * axis;
        let along = [x + y + z, x + y - z, x - y + z, x - y - z]
            .map(f64::abs)
            .into_iter()
            .fold(f64::INFINITY, f64::min);
        (sizes.length_squared() - along * along).max(0.0).sqrt()
    }
}

/// A region with all that is less than [`Cells::far`] cells away, none of which is larger than edges are long.
pub(in super::super) fn grown(edges: &Edges, region: &Aabb) -> Aabb {
    grown_more(edges, region, 0)
}

/// The same with so many planes more, if there are any.
pub(in super::super) fn grown_more(edges: &Edges, region: &Aabb, more: usize) -> Aabb {
    let mut grown = *region;
    let lattice = match edges {
        Edges::Lattice(lattice) => lattice,
        Edges::List(list) => {
            let reach = FAR_OFF_LATTICE * list.longest();
            return Aabb { min: region.min - reach, max: region.max + reach };
        }
    };
    for (axis, planes) in lattice.axes().iter().enumerate() {
        let first = planes.partition_point(|&plane| plane < region.min[axis]).saturating_sub(PLANES + more);
        let last = planes.partition_point(|&plane| plane <= region.max[axis]) + PLANES + more;
        grown.min[axis] = planes[first].min(region.min[axis]);
        grown.max[axis] = planes[last.min(planes.len()) - 1].max(region.max[axis]);
    }
    grown
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_counted_in_parts() {
        let planes = [0.0, 1.0, 3.0, 7.0];
        let places =
            [(1, 2.0), (1, 5.0), (1, 0.25), (1, -0.5), (3, 2.0), (0, 2.0), (0, 0.0), (0, -0.25), (3, 20.0)];
        let cells = places.map(|(index, coordinate)| Plane::of(&planes, index, 1, 1.0).cells_to(coordinate));
        assert_eq!(cells, [0.5, 1.5, 0.75, 1.5, 1.5, 1.5, 0.0, 0.25, FAR]);
    }
}
