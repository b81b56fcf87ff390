//! Quarters of the box around an edge of a lattice, and the lines in them.

use super::super::{LayersWithin, Side, Span, Surfaces};
use crate::geometry::Aabb;
use crate::mesh::Lattice;
use glam::DVec3;

/// How many lines pass a quarter.
pub(super) const LINES: usize = 4;

/// Where they do, in parts of half its widths from its middle. Along either axis each is at a place of its own,
/// so that a face across an axis is known to an eighth of the quarter's width, and places along one axis tell nothing of those
/// along the other.
const PLACES: [[f64; 2]; LINES] = [[-0.75, -0.25], [-0.25, 0.75], [0.25, -0.75], [0.75, 0.25]];

/// From an edge it is so many times as far to the next one as to the middle of the quarter on that side.
const TO_NEXT: f64 = 4.0;

/// A quarter of the box around an edge: what of it lies in one of the cells around the edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Quarter {
    /// The line through its middle.
    middle: [DVec3; 2],
    /// The way there from the edge, in which half its widths are.
    pub(super) offset: DVec3,
    /// The area of its cross-section in square metres.
    pub(super) share: f64,
    /// That along which the edge is.
    axis: usize,
    /// The cell that it lies in.
    pub(super) cell: usize,
}

impl Quarter {
    pub(super) fn bounds(&self) -> Aabb {
        let ([from, to], half) = (self.middle, self.offset.abs());
        Aabb { min: from.min(to) - half, max: from.max(to) + half }
    }
}

/// The lines in a quarter, in the frame of a body.
pub(super) struct BodyLines<'a> {
    surfaces: &'a dyn Surfaces,
    object: usize,
    /// Between which depths its surfaces are in all of the quarter, if they are seen along z; they tell of most lines.
    layers: Option<LayersWithin>,
    /// Where the line through the middle starts, the way along it, and half the widths of the quarter.
    from: DVec3,
    way: DVec3,
    across: [DVec3; 2],
}

impl<'a> BodyLines<'a> {
    #[inline]
    pub(super) fn of(
        surfaces: &'a dyn Surfaces,
        object: usize,
        quarter: &Quarter,
        layers: Option<LayersWithin>,
    ) -> Self {
        let &Quarter { middle: [from, to], offset, axis, .. } = quarter;
        let frame = surfaces.frame(object);
        let along = |axis: usize, length: f64| frame.object_from_sensor.col(axis) * length;
        let across = [(axis + 1) % 3, (axis + 2) % 3].map(|axis| along(axis, offset[axis]));
        let way = along(axis, to[axis] - from[axis]);
        Self { surfaces, object, layers, from: frame.point(from), way, across }
    }

    /// The part of a line that is in the body.
    #[inline]
    pub(super) fn span(&self, line: usize) -> Option<Span> {
        let [first, second] = PLACES[line];
        let from = self.from + (self.across[0] * first + self.across[1] * second);
        let to = from + self.way;
        match self.layers.and_then(|layers| layers.side_of([from.z.min(to.z), from.z.max(to.z)])) {
            Some(Side::Outside) => None,
            Some(Side::Inside) => Some(Span::WHOLE),
            None => self.surfaces.span_in_frame(self.object, from, to),
        }
    }

    /// The same of all lines.
    #[inline]
    pub(super) fn spans(&self) -> [Option<Span>; LINES] {
        std::array::from_fn(|line| self.span(line))
    }

    /// The object whose lines these are.
    pub(super) fn object(&self) -> usize {
        self.object
    }

    /// The way from a place on the edge to the next one in the quarter's direction: the part of it in the body, and its length in parts
    /// of the edge's, along the shorter of the two axes.
    pub(super) fn span_to_next(&self, along: f64) -> Option<(Span, f64)> {
        let middle = self.across[0] + self.across[1];
        let from = self.from - middle + along * self.way;
        let span = self.surfaces.span_in_frame(self.object, from, from + TO_NEXT * middle)?;
        let width = TO_NEXT * self.across[0].length().min(self.across[1].length());
        Some((span, width / self.way.length()))
    }
}

/// The four quarters of the box around an edge. At the rim of the lattice there are fewer than four.
pub(super) fn quarters(lattice: &Lattice, edge: usize) -> impl Iterator<Item = Quarter> {
    let (node, axis) = (edge / 3, edge % 3);
    let place = lattice.node_place(node);
    let planes = lattice.axes();
    let from = DVec3::from_array(std::array::from_fn(|axis| planes[axis][place[axis]]));
    let to = planes[axis].get(place[axis] + 1).map(|&end| {
        let mut to = from;
        to[axis] = end;
        to
    });
    let across = [(axis + 1) % 3, (axis + 2) % 3];
    // The steps to the neighbours below and above, across the edge.
    let steps = across.map(|axis| {
        let to = |other: Option<usize>| {
            other.and_then(|other| planes[axis].get(other)).map(|plane| plane - from[axis])
        };
        [to(place[axis].checked_sub(1)), to(Some(place[axis] + 1))]
    });
    let [nx, ny, _] = lattice.node_counts().map(|count| count - 1);
    [[0, 0], [0, 1], [1, 0], [1, 1]].into_iter().filter_map(move |sides| {
        let (Some(first), Some(second), Some(to)) = (steps[0][sides[0]], steps[1][sides[1]], to) else {
            return None;
        };
        let mut behind = place;
        across.into_iter().zip(sides).for_each(|(axis, side)| behind[axis] = place[axis] + side - 1);
        let cell = (behind[2] * ny + behind[1]) * nx + behind[0];
        let mut offset = DVec3::ZERO;
        offset[across[0]] = 0.25 * first;
        offset[across[1]] = 0.25 * second;
        let share = 0.25 * (first * second).abs();
        Some(Quarter { middle: [from + offset, to + offset], offset, share, axis, cell })
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn quarters_share_the_box_around_an_edge() {
        let axes = [vec![0.0, 1.0, 3.0], vec![0.0, 2.0, 3.0, 7.0], vec![0.0, 1.0, 5.0]];
        let lattice = Lattice::new(axes).unwrap();
        let edge = |place, axis| 3 * lattice.node_index(place) + axis;
        let found: Vec<_> = quarters(&lattice, edge([0, 2, 1], 0)).collect();
        let at = |x, y, z| DVec3::new(x, y, z);
        let quarter = |middle, offset, share, axis, cell: [usize; 3]| {
            let cell = (0..12).find(|&other| lattice.cell_place(other) == cell).unwrap();
            Quarter { middle, offset, share, axis, cell }
        };
        let middle = [at(0.0, 2.75, 0.75), at(1.0, 2.75, 0.75)];
        assert_eq!(found[0], quarter(middle, at(0.0, -0.25, -0.25), 0.25, 0, [0, 1, 0]));
        assert_eq!(
            found[3],
            quarter([at(0.0, 4.0, 2.0), at(1.0, 4.0, 2.0)], at(0.0, 1.0, 1.0), 4.0, 0, [0, 2, 1])
        );
        assert_eq!(found.iter().map(|quarter| quarter.share).sum::<f64>(), 2.5 * 2.5);
        let of_rim: Vec<_> = quarters(&lattice, edge([0, 0, 1], 2)).collect();
        assert_eq!(
            of_rim,
            [quarter([at(0.25, 0.5, 1.0), at(0.25, 0.5, 5.0)], at(0.25, 0.5, 0.0), 0.5, 2, [0, 0, 1])]
        );
        assert_eq!(quarters(&lattice, edge([2, 0, 0], 0)).count(), 0, "there is no such edge");
    }
}
