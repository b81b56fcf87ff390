//! Ends of plates that are no thicker than two cells and a half, and that nothing holds at a potential.
//!
//! A floating plate has no charge: what counts is the field that passes through it, and how that leaves at its ends. Links make the field
//! around either edge of an end right, which is alike on both faces. For one that is not, a lattice takes the plate to be a few percent
//! larger, and to be nearer to the middle of its cells than it is. Weights of few edges there make up for it, each of which is multiplied by
//! 1 + y, where y depends on where it is to the end, as in [`PlateEnds::factor`], times one of four numbers. Links follow, so that the field
//! around the edges of the end stays as it is.
//!
//! The numbers are those with which a plate in two dimensions does to fields exp(-k z) cos k x of several wave lengths, and to a uniform one, what it should,
//! floating as well as grounded (`examples/accuracy/ends.rs` computes them; nothing is fitted to scenes). They depend on how thick the plate is
//! and how wide cells are, both over their height, and on where its middle is between two rows of nodes. What it makes of plates in space:
//! `docs/interface.md`.

use super::end_table::{Numbers, PLACES, ROWS, THICKNESSES, WIDTHS};
use super::{KnownField, RightAngles};
use crate::geometry::Aabb;
use crate::material::{Connection, Material};
use crate::mesh::{Edges, Lattice};
use crate::occupancy::Surfaces;
use glam::DVec3;
use std::ops::Range;

/// Plates count whose normal is as nearly along an axis of the lattice as the second cosine tells, those beyond the first not at all.
const LEVEL: Range<f64> = 0.9997..0.99997;

/// Thicker plates, in heights of cells, count less, and from the second thickness on not at all.
const THIN: Range<f64> = 2.2..2.6;

/// From nothing to all over this part of a cell's height, or of the plate's thickness.
const RAMP: f64 = 0.2;

/// No weight becomes less than this part of what it is.
const LEAST: f64 = 0.1;

/// Within a plate, sides count that are not the nearest one, if they are further away by no more than this part of its thickness.
const CORNER: f64 = 0.25;

/// Plates count less whose narrower side is less thicknesses than the second, and not at all with the first.
const FLAT: Range<f64> = 2.0..4.0;

/// Plates count less that are less cells wide than the second, and not at all with the first.
const FEWEST: Range<f64> = 3.2..4.0;

/// Other bodies count from so many cells on, and all that is nearer than the first.
const OTHERS: Range<f64> = 1.0..1.6;

/// Whether ends of an object of a material may change weights on a lattice: of a box that nothing holds at a potential, which is a plate
/// and thin over the largest cells of the lattice. What finds objects elsewhere than in [`Occupancy`](crate::occupancy::Occupancy) may not know of it.
///
/// # Panics
/// When there is no such object.
pub fn may_change_weights(
    lattice: &Lattice,
    surfaces: &dyn Surfaces,
    object: usize,
    material: &Material,
) -> bool {
    let largest = lattice.axes().iter().flat_map(|planes| planes.windows(2)).map(|pair| pair[1] - pair[0]);
    let largest = largest.fold(0.0, f64::max);
    let field = KnownField::around(surfaces, object);
    let is_thin_plate = |half: DVec3| {
        let mut extents = (2.0 * half).to_array();
        extents.sort_unstable_by(f64::total_cmp);
        let [thickness, narrowest, _] = extents;
        thickness < THIN.end * largest && narrowest > FLAT.start * thickness
    };
    is_held_by_nothing(material) && field.of_box().is_some_and(|(_, half)| is_thin_plate(half))
}

fn is_held_by_nothing(material: &Material) -> bool {
    matches!(material, Material::Conductor(Connection::Floating | Connection::Capacitance(_)))
}

/// What the ends of an object change, if it is such a plate.
#[derive(Clone, Debug, Default)]
pub(in super::super) struct PlateEnds {
    /// Whether they change anything.
    pub(in super::super) are_of_use: bool,
    object: usize,
    /// The axis of the lattice across the plate, and those along it.
    axis: usize,
    along: [usize; 2],
    thickness: f64,
    /// Where its faces are along the axis, and the first planes of nodes beyond them.
    faces: [f64; 2],
    planes: [usize; 2],
    /// How much these count; the next ones count for the rest.
    first: [f64; 2],
    /// Around the plate, the planes along it that nodes are in, and for each of their columns where the nearest end is and what it changes.
    near: [Range<usize>; 2],
    ends: Vec<End>,
    changes: Vec<Changes>,
}

/// What edges of the nodes in a column across the plate are changed by.
#[derive(Clone, Copy, Debug, Default)]
struct Changes {
    /// Those across the plate, beyond the first rows, and those that pass it.
    across: f64,
    passing: f64,
    /// Those in the first rows, upwards along either axis: against each other on either side of the plate, and alike.
    lean: [f64; 2],
    both: [f64; 2],
}

impl PlateEnds {
    /// Takes an object at a pose, in a lattice.
    pub(in super::super) fn take(
        &mut self,
        object: usize,
        edges: &Edges,
        material: &Material,
        field: &KnownField,
    ) {
        self.are_of_use = false;
        let Edges::Lattice(lattice) = edges else { return };
        let Some((angles, half)) = field.of_box() else { return };
        if !is_held_by_nothing(material) {
            return;
        }
        let Some(plate) = Plate::of(lattice, angles, half) else { return };
        self.object = object;
        self.take_rows(lattice, &plate);
        self.take_columns(lattice, &plate);
        self.are_of_use = true;
    }

    fn take_rows(&mut self, lattice: &Lattice, plate: &Plate) {
        let Plate { axis, thickness, height, faces, planes: [below, above], .. } = *plate;
        let rows = &lattice.axes()[axis];
        let gaps = [faces[0] - rows[below], rows[above] - faces[1]];
        (self.axis, self.along) = (axis, [(axis + 1) % 3, (axis + 2) % 3]);
        (self.thickness, self.faces, self.planes) = (thickness, faces, plate.planes);
        self.first = gaps.map(|gap| (gap / (RAMP * height)).min(1.0));
    }

    fn take_columns(&mut self, lattice: &Lattice, plate: &Plate) {
        let axes = self.along.map(|axis| &lattice.axes()[axis]);
        self.near = [0, 1].map(|k: usize| {
            let axis = self.along[k];
            let reach =
                plate.sides[0][axis].abs() * plate.half[0] + plate.sides[1][axis].abs() * plate.half[1];
            let [low, high] = [-reach, reach].map(|reach| plate.centre[axis] + reach);
            let first = axes[k].partition_point(|&at| at < low).saturating_sub(COUNTED);
            let last = axes[k].partition_point(|&at| at <= high) + COUNTED;
            first..last.min(axes[k].len())
        });
        let [firsts, seconds] = self.near.clone();
        let mut place = DVec3::ZERO;
        self.ends.clear();
        for second in seconds.clone() {
            for first in firsts.clone() {
                (place[self.along[0]], place[self.along[1]]) = (axes[0][first], axes[1][second]);
                let mut end = plate.end_at(place);
                let way = -end.outside * end.normal;
                let cells = |k: usize| cells_to(axes[k], [first, second][k], way[self.along[k]]);
                let place = [axes[0][first] + way[self.along[0]], axes[1][second] + way[self.along[1]]];
                let normal = self.along.map(|axis| end.normal[axis].abs());
                let size = normal[1] * spacing(axes[0], first) + normal[0] * spacing(axes[1], second);
                let within = [0, 1].map(|k| 1.0 - normal[k].powi(2) * (1.0 - part_within(axes[k], place[k])));
                end.counts = (end.inside / size).min(1.0) * within[0].min(within[1]);
                end.outside = cells(0).max(cells(1)).copysign(end.outside);
                self.ends.push(end);
            }
        }
        self.changes.clear();
        for second in seconds.clone() {
            for first in firsts.clone() {
                let cell = [spacing(axes[0], first), spacing(axes[1], second)];
                let at = self.changes.len();
                let mut changes = plate.of_column(&self.ends[at], self.along, cell);
                let steps = [(first + 1 < firsts.end, 1), (second + 1 < seconds.end, firsts.len())];
                for (k, (_, step)) in steps.into_iter().enumerate().filter(|(_, (exists, _))| *exists) {
                    let mut cell = cell;
                    cell[k] = axes[k][[first, second][k] + 1] - axes[k][[first, second][k]];
                    let ends = [&self.ends[at], &self.ends[at + step]];
                    (changes.lean[k], changes.both[k]) = plate.of_edge(ends, self.along, k, cell);
                }
                self.changes.push(changes);
            }
        }
    }

    /// What multiplies the weight of an edge, other bodies being within these bounds.
    pub(in super::super) fn factor(&self, lattice: &Lattice, edge: usize, bounds: &[Aabb]) -> f64 {
        let (place, along) = (lattice.node_place(edge / 3), edge % 3);
        let [firsts, seconds] = &self.near;
        let [first, second] = self.along.map(|axis| place[axis]);
        if !firsts.contains(&first) || !seconds.contains(&second) {
            return 1.0;
        }
        let part = self.part(lattice, place, along);
        if part == Part::default() {
            return 1.0;
        }
        let changes = &self.changes[(second - seconds.start) * firsts.len() + (first - firsts.start)];
        let change = match self.along.iter().position(|axis| *axis == along) {
            Some(k) => part.lean * changes.lean[k] + part.lean.abs() * changes.both[k],
            None => part.lean * changes.across + part.passing * changes.passing,
        };
        let alone =
            if bounds.len() > 1 && change != 0.0 { self.alone(lattice, place, along, bounds) } else { 1.0 };
        (1.0 + alone * change).max(LEAST)
    }

    /// How an edge is to the plate's faces.
    fn part(&self, lattice: &Lattice, place: [usize; 3], along: usize) -> Part {
        let row = place[self.axis];
        let [below, above] = self.planes;
        let [first_below, first_above] = self.first;
        if along != self.axis {
            let lean = of_rows(row, above, first_above) - of_rows(below, row, first_below);
            return Part { lean, passing: 0.0 };
        }
        let rows = &lattice.axes()[self.axis];
        let Some(&next) = rows.get(row + 1) else { return Part::default() };
        if row + 1 > below && row < above {
            let overlap = self.faces[1].min(next) - self.faces[0].max(rows[row]);
            return Part { lean: 0.0, passing: (overlap / (RAMP * self.thickness)).clamp(0.0, 1.0) };
        }
        Part { lean: of_rows(row, above, first_above) - of_rows(below, row + 1, first_below), passing: 0.0 }
    }

    /// How much an edge counts beside other bodies.
    fn alone(&self, lattice: &Lattice, place: [usize; 3], along: usize, bounds: &[Aabb]) -> f64 {
        let axes = lattice.axes();
        let mut next = place;
        next[along] += 1;
        let others = bounds.iter().enumerate().filter(|(other, _)| *other != self.object);
        others.fold(1.0, |alone, (_, other)| {
            // Of the farther end, so that nodes at both are near whatever counts.
            let away = [place, next].map(|place| {
                let cells = |axis: usize| {
                    let at = axes[axis][place[axis]];
                    let nearest = at.min(other.max[axis]).max(other.min[axis]);
                    cells_to(&axes[axis], place[axis], nearest - at)
                };
                cells(0).max(cells(1)).max(cells(2))
            });
            f64::min(alone, rising(OTHERS, away[0].max(away[1])))
        })
    }
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

/// The end of a plate that is nearest to a place.
#[derive(Clone, Copy, Debug)]
struct End {
    /// How far outside the place is, less than nothing within the plate: in metres as [`Plate::end_at`] tells it, then in cells.
    outside: f64,
    /// How far it is from where another end is the nearest, in metres, and how much the end counts there.
    inside: f64,
    counts: f64,
    /// Away from the end, along the plate.
    normal: DVec3,
}

/// A plate in a lattice.
struct Plate {
    /// The axis of the lattice across it.
    axis: usize,
    centre: DVec3,
    /// The directions of its sides, along the lattice's other axes, and half its extents along these.
    sides: [DVec3; 2],
    half: [f64; 2],
    thickness: f64,
    faces: [f64; 2],
    /// The first planes of nodes beyond the faces.
    planes: [usize; 2],
    /// The height of a cell.
    height: f64,
    /// For cells as wide over their height as [`WIDTHS`].
    numbers: [Numbers; WIDTHS.len()],
}

impl Plate {
    /// `None` for boxes whose ends change nothing.
    fn of(lattice: &Lattice, angles: &RightAngles, half: DVec3) -> Option<Self> {
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
        let margins =
            [faces[0] - rows[0], rows[rows.len() - 1] - faces[1]].map(|margin| rising(0.0..height, margin));
        let counts =
            rising(LEVEL, normal[axis]) * (1.0 - rising(THIN, thickness)) * margins[0].min(margins[1]);
        if counts == 0.0 {
            return None;
        }
        let others = [(thin + 1) % 3, (thin + 2) % 3];
        let side = |side: usize| {
            let mut direction = turn.col(side);
            direction[axis] = 0.0;
            direction.normalize_or_zero()
        };
        Some(Self {
            axis,
            centre,
            sides: others.map(side),
            half: others.map(|side| half[side]),
            thickness: 2.0 * half[thin],
            faces,
            planes: [below, above],
            height,
            numbers: numbers(thickness, place).map(|of_width| of_width.map(|y| counts * y)),
        })
    }

    /// The end that is nearest to a place along the plate, and how many metres outside that is.
    fn end_at(&self, place: DVec3) -> End {
        let along = self.sides.map(|side| side.dot(place) - side.dot(self.centre));
        let beyond = [0, 1].map(|side| along[side].abs() - self.half[side]);
        let outwards = [0, 1].map(|side| self.sides[side] * 1.0_f64.copysign(along[side]));
        let [first, second] = beyond;
        let (outside, parts) = match (first > 0.0, second > 0.0) {
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
        let normal = (parts[0] / length) * outwards[0] + (parts[1] / length) * outwards[1];
        // Beyond a corner nothing is known. How much an end counts depends on cells, too.
        End { outside, inside: (-first.min(second)).max(0.0), counts: 0.0, normal }
    }

    /// What edges across the plate are changed by, where the nearest end is so many cells away and cells have such widths.
    fn of_column(&self, end: &End, along: [usize; 2], cell: [f64; 2]) -> Changes {
        let width = along.iter().zip(cell).map(|(&axis, cell)| end.normal[axis].abs() * cell).sum();
        let [across, _, passing, _] = self.numbers_of_width(width);
        let past = 1.25 * end.outside.min(1.6 - end.outside).max(0.0);
        Changes {
            across: end.counts * across * beside(end.outside, 0.5, 1.0),
            passing: end.counts * passing * past,
            ..Changes::default()
        }
    }

    /// What an edge along one of two axes is changed by, on either side of the plate and on both, between nodes where these ends are the nearest.
    fn of_edge(&self, ends: [&End; 2], along: [usize; 2], upwards: usize, cell: [f64; 2]) -> (f64, f64) {
        let outside = 0.5 * (ends[0].outside + ends[1].outside);
        let squares = along.map(|axis| (0.5 * (ends[0].normal[axis] + ends[1].normal[axis])).powi(2));
        let (length, fourth) = (squares[0] + squares[1], squares[0].powi(2) + squares[1].powi(2));
        if fourth == 0.0 {
            return (0.0, 0.0);
        }
        let width = squares.iter().zip(cell).map(|(square, cell)| (square / length).sqrt() * cell).sum();
        let [_, lean, _, both] = self.numbers_of_width(width);
        // As much of either axis as gives the direction away from the end all of it.
        let share = 0.5 * (ends[0].counts + ends[1].counts) * squares[upwards] * length / fourth;
        (share * lean * beside(outside, -0.3, 1.25), share * both * beside(outside, 0.0, 1.0))
    }

    /// The numbers where cells have a width away from the end.
    fn numbers_of_width(&self, width: f64) -> Numbers {
        let (narrower, part) = interval(&WIDTHS, width / self.height);
        let narrowest = 2.0 * self.half[0].min(self.half[1]);
        // Opposite ends are so far from each other that no edge is near both.
        let counts = rising(FLAT, narrowest / self.thickness) * rising(FEWEST, narrowest / width);
        between(&self.numbers[narrower], &self.numbers[narrower + 1], part).map(|y| counts * y)
    }
}

/// From nothing to one about a place, and back.
fn beside(at: f64, middle: f64, reach: f64) -> f64 {
    (1.0 - (at - middle).abs() / reach).max(0.0)
}

/// How far it is from plane to plane around one.
fn spacing(planes: &[f64], plane: usize) -> f64 {
    let (low, high) = (plane.saturating_sub(1), (plane + 1).min(planes.len() - 1));
    (planes[high] - planes[low]) / (high - low) as f64
}

/// How high cells are at a height, without jumps from one to the next, and how far that is above the nearest row, in parts of the cell that it is
/// in.
fn height_and_place(rows: &[f64], at: f64) -> Option<(f64, f64)> {
    let above = rows.partition_point(|&row| row <= at);
    let below = above.checked_sub(1)?;
    let part = (at - rows[below]) / (rows.get(above)? - rows[below]);
    let place = if part < 0.5 { part } else { part - 1.0 };
    let [low, high] = [below, above].map(|row| spacing(rows, row));
    Some((low + part * (high - low), place))
}

/// How much a place counts by where it is among planes: nothing outside, all of it a cell within.
fn part_within(planes: &[f64], at: f64) -> f64 {
    let last = planes.len() - 1;
    let low = (at - planes[0]) / (planes[1] - planes[0]);
    let high = (planes[last] - at) / (planes[last] - planes[last - 1]);
    low.min(high).clamp(0.0, 1.0)
}

/// Nodes so many planes further from the edges of a plate than those with links are looked at as it moves.
pub(in super::super) const MORE_PLANES: usize = 1;

/// So many cells are counted: nodes that are so many planes away are looked at.
const COUNTED: usize = 3;

/// Cells from a plane to what is so far above or below.
fn cells_to(planes: &[f64], plane: usize, way: f64) -> f64 {
    let neighbour = |cells: usize| match way > 0.0 {
        true => planes.get(plane + cells),
        false => plane.checked_sub(cells).map(|plane| &planes[plane]),
    };
    let (mut left, mut size) = (way.abs(), spacing(planes, plane));
    for cells in 0..COUNTED {
        // Cells go on beyond the lattice as they end.
        if let (Some(near), Some(far)) = (neighbour(cells), neighbour(cells + 1)) {
            size = (far - near).abs();
        }
        if left <= size {
            return cells as f64 + left / size;
        }
        left -= size;
    }
    COUNTED as f64
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

    fn ends(lattice: &Lattice, rotation: DQuat, centre: DVec3, size: DVec3) -> PlateEnds {
        let sensor_from_object = DAffine3::from_rotation_translation(rotation, centre);
        let object_from_sensor = sensor_from_object.matrix3.transpose();
        let angles =
            RightAngles { solid: RightAngled::Box(0.5 * size), sensor_from_object, object_from_sensor };
        let (floating, field) = (Material::Conductor(Connection::Floating), KnownField::Edges(angles));
        let mut ends = PlateEnds::default();
        ends.take(0, &Edges::Lattice(lattice.clone()), &floating, &field);
        ends
    }

    const PLATE: DVec3 = DVec3::new(0.13, 0.14, 0.02);

    fn factors(lattice: &Lattice, ends: PlateEnds) -> Vec<f64> {
        let edges = 3 * lattice.node_counts().into_iter().product::<usize>();
        let factor = |edge| if ends.are_of_use { ends.factor(lattice, edge, &[]) } else { 1.0 };
        (0..edges).map(factor).collect()
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
        assert!(ends(&lattice, DQuat::IDENTITY, centre, PLATE).are_of_use);
        assert!(!ends(&lattice, DQuat::IDENTITY, centre, DVec3::new(0.13, 0.14, 0.075)).are_of_use);
        assert!(!ends(&lattice, DQuat::from_rotation_x(0.1), centre, PLATE).are_of_use);
        assert!(!ends(&lattice, DQuat::IDENTITY, DVec3::new(0.151, 0.147, 0.5), PLATE).are_of_use);
        let sticks = ends(&lattice, DQuat::IDENTITY, centre, DVec3::new(0.02, 0.13, 0.018));
        assert!(factors(&lattice, sticks).iter().all(|factor| *factor == 1.0));
        // Beside another body, as far as that is near.
        let alone = ends(&lattice, DQuat::IDENTITY, centre, PLATE);
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
