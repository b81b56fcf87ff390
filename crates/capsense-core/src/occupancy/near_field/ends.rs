//! Ends of plates that are thinner than a cell or little thicker, and that nothing holds at a potential.
//!
//! A floating plate has no charge: what counts is the field that passes through it, and how that leaves at its ends. Links make the field
//! around either edge of an end right, which is alike on both faces. For one that is not, a lattice takes the plate to be a few percent
//! larger, and to be nearer to the middle of its cells than it is. Weights of few edges there make up for it, each of which is multiplied by
//! 1 + y, where y depends on where it is to the end, as in [`PlateEnds::factor`], times one of four numbers. Links follow, so that the field
//! around the edges of the end stays as it is.
//!
//! The numbers are those with which a plate in two dimensions does to fields exp(-k z) cos k x of several wave lengths, and to an even one, what it should,
//! floating as well as grounded (`examples/accuracy/ends.rs` computes them; nothing is fitted to scenes). They depend on how thick the plate is
//! and how wide cells are, both over their height, and on where its middle is between two rows of nodes. What it makes of plates in space:
//! `docs/interface.md`.

use super::end_table::{Numbers, PLACES, ROWS, THICKNESSES, WIDTHS};
use super::{KnownField, RightAngles};
use crate::geometry::Aabb;
use crate::material::{Connection, Material};
use crate::mesh::{Edges, Lattice};
use glam::DVec3;
use std::ops::Range;

/// Plates count whose normal is as nearly along an axis of the lattice as the second cosine tells, those beyond the first not at all.
const LEVEL: Range<f64> = 0.9990..0.9999;

/// Thicker plates, in heights of cells, count less, and from the second thickness on not at all.
const THIN: Range<f64> = 1.3..1.8;

/// From nothing to all over this part of a cell's height, or of the plate's thickness.
const RAMP: f64 = 0.2;

/// No weight becomes less than this part of what it is.
const LEAST: f64 = 0.1;

/// Within a plate, sides count that are not the nearest one, if they are further away by no more than this part of its thickness.
const CORNER: f64 = 0.25;

/// Other bodies count from so many cells on, and all that is nearer than the first.
const OTHERS: Range<f64> = 1.0..1.6;

/// A plate whose ends change weights.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct PlateEnds {
    object: usize,
    /// The axis of the lattice across it.
    axis: usize,
    centre: DVec3,
    /// The directions of its sides, and half its extents along these.
    sides: [DVec3; 2],
    half: [f64; 2],
    thickness: f64,
    /// Where its faces are along the axis, and the first planes of nodes beyond them.
    faces: [f64; 2],
    planes: [usize; 2],
    /// The height of a cell, and how much the first planes count; the next ones count for the rest.
    height: f64,
    first: [f64; 2],
    /// For cells as wide over their height as [`WIDTHS`].
    numbers: [Numbers; WIDTHS.len()],
}

impl PlateEnds {
    /// Those of an object, if it is such a plate, in a lattice.
    pub(in super::super) fn of(
        object: usize,
        edges: &Edges,
        material: &Material,
        field: &KnownField,
    ) -> Option<Self> {
        let Edges::Lattice(lattice) = edges else { return None };
        let (angles, half) = field.of_box()?;
        match material {
            Material::Conductor(Connection::Floating | Connection::Capacitance(_)) => {
                Self::of_box(object, lattice, angles, half)
            }
            _ => None,
        }
    }

    fn of_box(object: usize, lattice: &Lattice, angles: &RightAngles, half: DVec3) -> Option<Self> {
        let thin = (0..3).min_by(|&a, &b| half[a].total_cmp(&half[b]))?;
        let turn = &angles.sensor_from_object.matrix3;
        let normal = turn.col(thin).abs();
        let axis = (0..3).max_by(|&a, &b| normal[a].total_cmp(&normal[b]))?;
        let centre = angles.sensor_from_object.translation;
        let faces = [-1.0, 1.0].map(|side| centre[axis] + side * half[thin]);
        let rows = &lattice.axes()[axis];
        let above = rows.partition_point(|&row| row < faces[1]);
        let below = rows.partition_point(|&row| row <= faces[0]).checked_sub(1)?;
        if above >= rows.len() {
            return None;
        }
        let (height, place) = height_and_place(rows, centre[axis])?;
        let thickness = 2.0 * half[thin] / height;
        let counts = rising(LEVEL, normal[axis]) * (1.0 - rising(THIN, thickness));
        if counts == 0.0 {
            return None;
        }
        let others = [(thin + 1) % 3, (thin + 2) % 3];
        Some(Self {
            object,
            axis,
            centre,
            sides: others.map(|side| turn.col(side)),
            half: others.map(|side| half[side]),
            thickness: 2.0 * half[thin],
            faces,
            planes: [below, above],
            height,
            first: [faces[0] - rows[below], rows[above] - faces[1]]
                .map(|gap| (gap / (RAMP * height)).min(1.0)),
            numbers: numbers(thickness, place).map(|of_width| of_width.map(|y| counts * y)),
        })
    }

    /// What multiplies the weight of an edge, other bodies being within these bounds.
    pub(in super::super) fn factor(&self, lattice: &Lattice, edge: usize, bounds: &[Aabb]) -> f64 {
        let (place, along) = (lattice.node_place(edge / 3), edge % 3);
        let part = self.part(lattice, place, along);
        if part == Part::default() {
            return 1.0;
        }
        let Some(spot) = Spot::of(lattice, place, along) else { return 1.0 };
        let [first, second] = spot.ends.map(|(place, end)| self.cells_outside(lattice, place, end));
        let outside = 0.5 * (first + second);
        let beside = |middle: f64, reach: f64| (1.0 - (outside - middle).abs() / reach).max(0.0);
        let End { normal, .. } = self.end_at(spot.middle);
        let width = normal.abs().dot(spot.cell);
        let [lean_across, lean_along, passing, both] = self.numbers_of_width(width / self.height);
        let change = if along == self.axis {
            let past = 1.25 * outside.min(1.6 - outside).max(0.0);
            lean_across * part.lean * beside(0.5, 1.0) + passing * part.passing * past
        } else {
            // As much of either axis as gives the direction away from the end all of it.
            let share = normal[along].powi(2) / normal.to_array().iter().map(|n| n.powi(4)).sum::<f64>();
            share * (lean_along * part.lean * beside(-0.3, 1.25) + both * part.lean.abs() * beside(0.0, 1.0))
        };
        let narrowest = 2.0 * self.half[0].min(self.half[1]);
        let counts = (narrowest / (2.0 * self.thickness.max(width)) - 1.0).clamp(0.0, 1.0);
        (1.0 + counts * self.alone(lattice, &spot, bounds) * change).max(LEAST)
    }

    /// How an edge is to the plate's faces.
    fn part(&self, lattice: &Lattice, place: [usize; 3], along: usize) -> Part {
        let row = place[self.axis];
        let [below, above] = self.planes;
        let [first_below, first_above] = self.first;
        if along != self.axis {
            return Part {
                lean: of_rows(row, above, first_above) - of_rows(below, row, first_below),
                passing: 0.0,
            };
        }
        let rows = &lattice.axes()[self.axis];
        let Some(&next) = rows.get(row + 1) else { return Part::default() };
        if row + 1 > below && row < above {
            let overlap = self.faces[1].min(next) - self.faces[0].max(rows[row]);
            return Part { lean: 0.0, passing: (overlap / (RAMP * self.thickness)).clamp(0.0, 1.0) };
        }
        Part { lean: of_rows(row, above, first_above) - of_rows(below, row + 1, first_below), passing: 0.0 }
    }

    /// How many cells a node is outside of the nearest end, less than nothing within the plate.
    fn cells_outside(&self, lattice: &Lattice, place: [usize; 3], node: DVec3) -> f64 {
        let End { distance, normal } = self.end_at(node);
        let way = -distance * normal;
        let cells = |axis: usize| cells_to(&lattice.axes()[axis], place[axis], way[axis]);
        cells(0).max(cells(1)).max(cells(2)).copysign(distance)
    }

    /// The end that is nearest to a place.
    fn end_at(&self, place: DVec3) -> End {
        let way = place - self.centre;
        let along = self.sides.map(|side| side.dot(way));
        let beyond = [0, 1].map(|side| along[side].abs() - self.half[side]);
        let outwards = [0, 1].map(|side| self.sides[side] * 1.0_f64.copysign(along[side]));
        let [first, second] = beyond;
        let (distance, parts) = match (first > 0.0, second > 0.0) {
            (true, true) => (first.hypot(second), [first, second]),
            (true, false) => (first, [1.0, 0.0]),
            (false, true) => (second, [0.0, 1.0]),
            (false, false) if beyond == [0.0; 2] => (0.0, [1.0, 0.0]),
            (false, false) => {
                // So that nothing jumps between two sides, and none counts far from its ends.
                let by_so_much = (first - second) / (CORNER * self.thickness);
                let [of_first, of_second] =
                    [-by_so_much, by_so_much].map(|less| (1.0 - less).clamp(0.0, 1.0));
                (first.max(second), [-second * of_first, -first * of_second])
            }
        };
        let length = parts[0].hypot(parts[1]);
        let mut normal = (parts[0] / length) * outwards[0] + (parts[1] / length) * outwards[1];
        normal[self.axis] = 0.0;
        End { distance, normal }
    }

    fn numbers_of_width(&self, width: f64) -> Numbers {
        let part = ((width - WIDTHS[0]) / (WIDTHS[1] - WIDTHS[0])).clamp(0.0, 1.0);
        between(&self.numbers[0], &self.numbers[1], part)
    }

    /// How much an edge counts beside other bodies.
    fn alone(&self, lattice: &Lattice, spot: &Spot, bounds: &[Aabb]) -> f64 {
        let others = bounds.iter().enumerate().filter(|(other, _)| *other != self.object);
        others.fold(1.0, |alone, (_, other)| {
            // Of the farther end, so that nodes at both are near whatever counts.
            let away = spot.ends.map(|(place, end)| {
                let way = end.clamp(other.min, other.max) - end;
                let cells = |axis: usize| cells_to(&lattice.axes()[axis], place[axis], way[axis]);
                cells(0).max(cells(1)).max(cells(2))
            });
            f64::min(alone, rising(OTHERS, away[0].max(away[1])))
        })
    }
}

/// Nodes so many planes further from the edges of a plate than those with links are looked at as it moves.
pub(in super::super) const MORE_PLANES: usize = 1;

/// So many cells are counted: nodes that are so many planes away are looked at.
const COUNTED: isize = 3;

/// Cells from a plane to what is so far above or below.
fn cells_to(planes: &[f64], plane: usize, way: f64) -> f64 {
    let step = if way > 0.0 { 1 } else { -1 };
    let size = |cells: isize| {
        let [near, far] = [cells, cells + 1].map(|cells| plane.checked_add_signed(step * cells));
        Some((planes.get(far?)? - planes.get(near?)?).abs())
    };
    let mut left = way.abs();
    for cells in 0..COUNTED {
        match size(cells) {
            Some(size) if left > size => left -= size,
            Some(size) => return cells as f64 + left / size,
            None => break,
        }
    }
    if left > 0.0 { COUNTED as f64 } else { 0.0 }
}

/// How high cells are at a height, without jumps from one to the next, and how far that is above the nearest row, in parts of the cell that it is
/// in.
fn height_and_place(rows: &[f64], at: f64) -> Option<(f64, f64)> {
    let above = rows.partition_point(|&row| row <= at);
    let below = above.checked_sub(1)?;
    let of_row = |row: usize| {
        let (low, high) = (row.saturating_sub(1), (row + 1).min(rows.len() - 1));
        (rows[high] - rows[low]) / (high - low) as f64
    };
    let part = (at - rows[below]) / (rows.get(above)? - rows[below]);
    let place = if part < 0.5 { part } else { part - 1.0 };
    Some((of_row(below) + part * (of_row(above) - of_row(below)), place))
}

/// How much an edge is one of those in or beyond the first rows, less than nothing below the plate, and how much it passes the plate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Part {
    lean: f64,
    passing: f64,
}

/// How much a row counts that is as many rows from the first as these differ.
fn of_rows(row: usize, from: usize, first: f64) -> f64 {
    match row.checked_sub(from) {
        Some(0) => first,
        Some(1) => 1.0 - first,
        _ => 0.0,
    }
}

/// Where an edge is, and how large cells are there along each axis.
struct Spot {
    /// Its nodes, by their planes and where they are.
    ends: [([usize; 3], DVec3); 2],
    middle: DVec3,
    cell: DVec3,
}

impl Spot {
    fn of(lattice: &Lattice, place: [usize; 3], along: usize) -> Option<Self> {
        let axes = lattice.axes();
        let from = DVec3::from_array([0, 1, 2].map(|axis: usize| axes[axis][place[axis]]));
        let mut to = from;
        to[along] = *axes[along].get(place[along] + 1)?;
        let cell = [0, 1, 2].map(|axis: usize| {
            if axis == along {
                return to[axis] - from[axis];
            }
            let (low, high) = (place[axis].saturating_sub(1), (place[axis] + 1).min(axes[axis].len() - 1));
            (axes[axis][high] - axes[axis][low]) / (high - low) as f64
        });
        let mut next = place;
        next[along] += 1;
        let ends = [(place, from), (next, to)];
        Some(Self { ends, middle: 0.5 * (from + to), cell: DVec3::from_array(cell) })
    }
}

/// The end of a plate that is nearest to a place.
struct End {
    /// How far outside the place is, in metres.
    distance: f64,
    /// Away from the end, along the plate.
    normal: DVec3,
}

/// From zero to one over a range.
fn rising(over: Range<f64>, x: f64) -> f64 {
    ((x - over.start) / (over.end - over.start)).clamp(0.0, 1.0)
}

fn between(a: &Numbers, b: &Numbers, part: f64) -> Numbers {
    std::array::from_fn(|number| a[number] + part * (b[number] - a[number]))
}

/// Between which two of some increasing numbers another is, and how far.
fn interval(numbers: &[f64], x: f64) -> (usize, f64) {
    let next = numbers.partition_point(|&number| number <= x).clamp(1, numbers.len() - 1);
    (next - 1, rising(numbers[next - 1]..numbers[next], x))
}

/// The numbers of a plate of some thickness, its middle so far above a row of nodes, both in heights of cells.
fn numbers(thickness: f64, place: f64) -> [Numbers; WIDTHS.len()] {
    let (thinner, of_thickness) = interval(&THICKNESSES, thickness);
    let (nearer, of_place) = interval(&PLACES, place.abs());
    ROWS.each_ref().map(|rows| {
        let at = |row: usize| between(&rows[row][nearer], &rows[row][nearer + 1], of_place);
        let [across, along, passing, both] = between(&at(thinner), &at(thinner + 1), of_thickness);
        let side = 1.0_f64.copysign(place);
        [side * across, side * along, passing, both]
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::super::RightAngled;
    use super::*;
    use glam::{DAffine3, DQuat};

    fn planes(count: usize, spacing: f64) -> Vec<f64> {
        (0..count).map(|k| spacing * k as f64).collect()
    }

    /// Cells 15 mm wide and 27 mm high.
    fn lattice() -> Lattice {
        Lattice::new([planes(21, 0.015), planes(21, 0.015), planes(13, 0.027)]).unwrap()
    }

    /// The same with other cells above and to one side.
    fn graded() -> Lattice {
        let grown = |planes: Vec<f64>| planes.iter().map(|at| at + 1.3 * at * at).collect::<Vec<_>>();
        Lattice::new([grown(planes(17, 0.015)), planes(21, 0.015), grown(planes(10, 0.024))]).unwrap()
    }

    fn ends(lattice: &Lattice, rotation: DQuat, centre: DVec3, size: DVec3) -> Option<PlateEnds> {
        let sensor_from_object = DAffine3::from_rotation_translation(rotation, centre);
        let object_from_sensor = sensor_from_object.matrix3.transpose();
        let angles =
            RightAngles { solid: RightAngled::Box(0.5 * size), sensor_from_object, object_from_sensor };
        PlateEnds::of(
            0,
            &Edges::Lattice(lattice.clone()),
            &Material::Conductor(Connection::Floating),
            &KnownField::Edges(angles),
        )
    }

    const PLATE: DVec3 = DVec3::new(0.13, 0.14, 0.02);

    fn factors(lattice: &Lattice, ends: Option<PlateEnds>) -> Vec<f64> {
        let edges = 3 * lattice.node_counts().into_iter().product::<usize>();
        (0..edges).map(|edge| ends.map_or(1.0, |ends| ends.factor(lattice, edge, &[]))).collect()
    }

    /// No weight jumps as a plate moves, turns and tilts, and all stay positive.
    #[test]
    fn factors_are_continuous_in_the_pose() {
        for lattice in [lattice(), graded()] {
            assert_continuous(&lattice);
        }
    }

    fn assert_continuous(lattice: &Lattice) {
        let step = 1e-5;
        let centre = DVec3::new(0.151, 0.147, 0.162);
        let upwards = |k: f64| (DQuat::IDENTITY, centre + k * DVec3::Z);
        let aside = |k: f64| (DQuat::IDENTITY, centre + k * DVec3::new(1.0, 0.3, 0.0));
        let turned = |k: f64| (DQuat::from_rotation_z(10.0 * k), centre);
        let tilted = |k: f64| (DQuat::from_rotation_x(2.0 * k), centre);
        let ways: [&dyn Fn(f64) -> (DQuat, DVec3); 4] = [&upwards, &aside, &turned, &tilted];
        for (number, way) in ways.into_iter().enumerate() {
            let mut most = 0.0_f64;
            for at in (0..60).map(|k| 0.0009 * f64::from(k)) {
                let [before, after] = [at, at + step].map(|at| {
                    let (rotation, centre) = way(at);
                    factors(lattice, ends(lattice, rotation, centre, PLATE))
                });
                for (before, after) in before.iter().zip(&after) {
                    assert!(*before >= LEAST && *after >= LEAST);
                    most = most.max((after - before).abs());
                }
            }
            // All of a weight within a fiftieth of a cell's height at the most.
            assert!(most < 0.02 && most > 1e-5, "{number}: {most}");
        }
    }

    /// What is above the middle of a cell is as what is below it, upside down.
    #[test]
    fn up_and_down_are_alike() {
        let lattice = lattice();
        let middle = 0.5 * 12.0 * 0.027;
        for above in [0.0, 0.002, 0.0071, 0.012] {
            let [up, down] = [above, -above].map(|above| {
                let centre = DVec3::new(0.151, 0.147, middle + above);
                factors(&lattice, ends(&lattice, DQuat::from_rotation_z(0.2), centre, PLATE))
            });
            assert!(up.iter().any(|factor| (factor - 1.0).abs() > 0.05));
            for (edge, factor) in up.iter().enumerate() {
                let ([x, y, z], axis) = (lattice.node_place(edge / 3), edge % 3);
                let mirrored = 12 - z;
                if axis == 2 && mirrored == 0 {
                    continue;
                }
                let below = lattice.node_index([x, y, mirrored - usize::from(axis == 2)]);
                assert!((factor - down[3 * below + axis]).abs() < 1e-9, "{above} {edge}");
            }
        }
    }

    #[test]
    fn plates_that_are_resolved_held_or_not_level_change_nothing() {
        let lattice = lattice();
        let centre = DVec3::new(0.151, 0.147, 0.162);
        assert!(ends(&lattice, DQuat::IDENTITY, centre, PLATE).is_some());
        assert!(ends(&lattice, DQuat::IDENTITY, centre, DVec3::new(0.13, 0.14, 0.05)).is_none());
        assert!(ends(&lattice, DQuat::from_rotation_x(0.1), centre, PLATE).is_none());
        assert!(ends(&lattice, DQuat::IDENTITY, DVec3::new(0.151, 0.147, 0.5), PLATE).is_none());
        let sticks = ends(&lattice, DQuat::IDENTITY, centre, DVec3::new(0.02, 0.13, 0.018));
        assert!(factors(&lattice, sticks).iter().all(|factor| *factor == 1.0));
        // Beside another body, as far as that is near.
        let alone = ends(&lattice, DQuat::IDENTITY, centre, PLATE).unwrap();
        let other = Aabb { min: DVec3::new(0.2, 0.0, 0.0), max: DVec3::new(0.3, 0.3, 0.3) };
        let bounds = [Aabb { min: centre - 0.5 * PLATE, max: centre + 0.5 * PLATE }, other];
        let (mut fewer, mut same) = (0, 0);
        for edge in 0..3 * 21 * 21 * 13 {
            let [without, beside] =
                [&bounds[..1], &bounds].map(|bounds| alone.factor(&lattice, edge, bounds));
            if without != 1.0 {
                *(if beside == without { &mut same } else { &mut fewer }) += 1;
            }
        }
        assert!(fewer > 50 && same > 50, "{fewer} {same}");
    }
}
