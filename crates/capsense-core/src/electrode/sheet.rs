//! Outlines of electrodes from triangles: a flat sheet's border, or the top face of a thin plate.
//!
//! Vertices in one place are welded; what is then an edge of one triangle only is border, and the border's edges make
//! contours. Which way triangles are wound does not matter.

use super::{Outline, polygon};
use crate::geometry::{Aabb, TriangleMesh};
use glam::{DVec2, DVec3};
use std::collections::{BTreeMap, HashMap};

/// Points closer than this part of the largest coordinate are one, planes too: some rounding errors of single
/// precision, in which triangles are stored.
const SAME_PLACE: f64 = 1e-6;

/// A corner this close to the line through its neighbours, as a part of the largest coordinate, is none.
const STRAIGHT: f64 = 1e-7;

/// A plate thicker than this part of its smaller extent is a block.
const THICKEST: f64 = 0.1;

/// Size of the cells in which close points are looked for, in slacks: most points are far from other cells.
const CELL: f64 = 16.0;

/// Why triangles are no thin electrode parallel to the sensing surface. Lengths in metres.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SheetError {
    /// Neither all in one plane, nor a plate with two flat faces and upright sides.
    #[error(
        "spans z from {low} m to {high} m and is neither a flat sheet nor a flat plate parallel to the sensing surface"
    )]
    NotFlat {
        /// Smallest z.
        low: f64,
        /// Largest z.
        high: f64,
    },
    /// A block rather than a plate.
    #[error("is {thickness} m thick and {width} m wide: at most a tenth of the width is a thin electrode")]
    TooThick {
        /// Extent along z.
        thickness: f64,
        /// The smaller of its extents along x and y.
        width: f64,
    },
    /// A plate with a gap in its surface.
    #[error("is a plate with {edges} open edges; its surface must be closed")]
    NotClosed {
        /// Edges of one triangle only.
        edges: usize,
    },
    /// Triangles lie on each other.
    #[error("has triangles that overlap")]
    Overlapping,
    /// The border has no inside there: parts touch in a corner, or a triangle's corner lies on another one's edge.
    #[error("has parts that touch in the corner x = {x} m, y = {y} m only")]
    Touching {
        /// Where along x.
        x: f64,
        /// Where along y.
        y: f64,
    },
    /// The border encloses no usable area.
    #[error("has an outline that {0}")]
    Outline(&'static str),
}

/// The place of a thin electrode that was given as triangles.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheet {
    /// Outline in x and y, metres. Contours run counter-clockwise from their corner with the smallest x, so that the
    /// order of the triangles does not matter.
    pub outline: Outline,
    /// Height in metres: of the sheet, or of the plate's upper face.
    pub z: f64,
}

impl Sheet {
    /// Takes the outline of a flat sheet, or of the upper face of a closed thin plate with upright sides.
    ///
    /// # Errors
    /// When the surface is not flat, is a block, is an open plate, overlaps itself, or has an unusable border.
    pub fn of_surface(surface: &TriangleMesh) -> Result<Self, SheetError> {
        let welded = Welded::new(surface);
        let Aabb { min, max } = Aabb::around(welded.points.iter().copied());
        let thickness = max.z - min.z;
        if thickness <= welded.slack {
            let outline = welded.flat_outline()?;
            return Ok(Self { outline, z: min.z + 0.5 * thickness });
        }
        let top = welded.top_face(min.z, max.z)?;
        let width = (max - min).truncate().min_element();
        if thickness > THICKEST * width {
            return Err(SheetError::TooThick { thickness, width });
        }
        let edges = count_edges(&welded.triangles);
        match edges.iter().filter(|(_, count)| *count == 1).count() {
            0 => Ok(Self { outline: welded.outline(&top)?, z: max.z }),
            edges => Err(SheetError::NotClosed { edges }),
        }
    }
}

/// Triangles whose corners in one place are one point.
struct Welded {
    points: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    /// What counts as one place, metres.
    slack: f64,
    /// What counts as straight, metres.
    straight: f64,
}

impl Welded {
    fn new(surface: &TriangleMesh) -> Self {
        let corners = surface.triangles().iter().flatten().map(|&corner| surface.vertices()[corner as usize]);
        let reach = corners.map(|corner| corner.abs().max_element()).fold(0.0, f64::max);
        let slack = SAME_PLACE * reach;
        let mut welding = Welding { points: Vec::new(), cells: HashMap::new(), slack };
        let mut place = vec![None; surface.vertices().len()];
        let mut triangles: Vec<[u32; 3]> = Vec::with_capacity(surface.triangles().len());
        for corners in surface.triangles() {
            let triangle = corners.map(|corner| {
                let corner = corner as usize;
                *place[corner].get_or_insert_with(|| welding.point_at(surface.vertices()[corner]))
            });
            let [a, b, c] = triangle;
            if a != b && b != c && c != a {
                triangles.push(triangle);
            }
        }
        Self { points: welding.points, triangles, slack, straight: STRAIGHT * reach }
    }

    /// Twice the area of a triangle seen along z, positive when it runs counter-clockwise.
    fn doubled_area(&self, triangle: &[u32; 3]) -> f64 {
        let [a, b, c] = triangle.map(|corner| self.points[corner as usize].truncate());
        (b - a).perp_dot(c - a)
    }

    fn area(&self, triangles: &[[u32; 3]]) -> f64 {
        0.5 * triangles.iter().map(|triangle| self.doubled_area(triangle).abs()).sum::<f64>()
    }

    /// The outline of a sheet, or of one side of a sheet with two sides in one plane.
    fn flat_outline(&self) -> Result<Outline, SheetError> {
        let sorted = |triangle: &[u32; 3]| {
            let mut corners = *triangle;
            corners.sort_unstable();
            corners
        };
        let mut once = self.triangles.clone();
        once.sort_by_key(sorted);
        once.dedup_by_key(|triangle| sorted(triangle));
        let upper: Vec<[u32; 3]> =
            self.triangles.iter().filter(|t| self.doubled_area(t) > 0.0).copied().collect();
        match self.outline(&once) {
            Err(error) if upper.is_empty() || upper.len() == self.triangles.len() => Err(error),
            Err(error) => self.outline(&upper).map_err(|_| error),
            outline => outline,
        }
    }

    /// The triangles of the upper of two faces, when all others are the lower face or upright.
    fn top_face(&self, low: f64, high: f64) -> Result<Vec<[u32; 3]>, SheetError> {
        let not_flat = Err(SheetError::NotFlat { low, high });
        let (mut top, mut bottom) = (Vec::new(), Vec::new());
        for triangle in &self.triangles {
            let corners = triangle.map(|corner| self.points[corner as usize]);
            let upper = corners.map(|corner| high - corner.z <= self.slack);
            let lower = corners.map(|corner| corner.z - low <= self.slack);
            if upper == [true; 3] {
                top.push(*triangle);
            } else if lower == [true; 3] {
                bottom.push(*triangle);
            } else {
                let [a, b, c] = corners.map(DVec3::truncate);
                let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
                let upright = self.doubled_area(triangle).abs() <= 2.0 * self.slack * longest;
                if !upright || (0..3).any(|k| !upper[k] && !lower[k]) {
                    return not_flat;
                }
            }
        }
        let (above, below) = (self.area(&top), self.area(&bottom));
        if (above - below).abs() <= 1e-3 * above && above > 0.0 { Ok(top) } else { not_flat }
    }

    /// The outline of triangles in one plane.
    fn outline(&self, triangles: &[[u32; 3]]) -> Result<Outline, SheetError> {
        let edges = count_edges(triangles);
        if edges.iter().any(|(_, count)| *count > 2) {
            return Err(SheetError::Overlapping);
        }
        let border = edges.into_iter().filter(|(_, count)| *count == 1).map(|(ends, _)| ends);
        let mut contours = self.contours(border)?;
        snap(&mut contours, self.slack);
        for contour in &mut contours {
            straighten(contour, self.straight);
        }
        contours.sort_by(|a, b| by_x(&a[0], &b[0]));
        if let Some(defect) = polygon::defect(&contours) {
            return Err(SheetError::Outline(defect));
        }
        // Triangles that overlap without a common edge cover less than they have.
        let border: f64 = contours.iter().flat_map(|c| polygon::sides(c)).map(|[p, q]| p.distance(q)).sum();
        let (covered, area) = (enclosed_area(&contours), self.area(triangles));
        if (covered - area).abs() > 1e-6 * area + 2.0 * self.slack * border {
            return Err(SheetError::Overlapping);
        }
        Ok(match <[_; 1]>::try_from(contours) {
            Ok([contour]) => Outline::Polygon(contour),
            Err(contours) => Outline::Contours(contours),
        })
    }

    /// Closed walks along edges of which two meet in every point.
    fn contours(&self, border: impl Iterator<Item = [u32; 2]>) -> Result<Vec<Vec<DVec2>>, SheetError> {
        let place = |point: u32| self.points[point as usize].truncate();
        let mut beside: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for [a, b] in border {
            beside.entry(a).or_default().push(b);
            beside.entry(b).or_default().push(a);
        }
        if let Some(&point) = beside.iter().find(|(_, ends)| ends.len() != 2).map(|(point, _)| point) {
            let DVec2 { x, y } = place(point);
            return Err(SheetError::Touching { x, y });
        }
        let mut contours = Vec::new();
        while let Some((first, ends)) = beside.pop_first() {
            let mut contour = vec![place(first)];
            let mut from = first;
            let mut at = ends[0];
            // Back at the first point, whose entry is gone, the walk ends.
            while let Some(ends) = beside.remove(&at) {
                contour.push(place(at));
                let next = if ends[0] == from { ends[1] } else { ends[0] };
                (from, at) = (at, next);
            }
            contours.push(contour);
        }
        Ok(contours)
    }
}

/// Points so far, by the cell of a grid that they lie in.
struct Welding {
    points: Vec<DVec3>,
    cells: HashMap<[i64; 3], Vec<u32>>,
    slack: f64,
}

impl Welding {
    /// The point at a place, a new one unless one is closer than the slack.
    fn point_at(&mut self, place: DVec3) -> u32 {
        // All coordinates are zero when the slack is.
        let size = CELL * self.slack.max(f64::MIN_POSITIVE);
        let key = |place: DVec3| (place / size).floor().to_array().map(|index| index as i64);
        let low = key(place - self.slack);
        // At most one cell further; past the largest number it would be infinitely many.
        let ends = key(place + self.slack);
        let high: [i64; 3] =
            std::array::from_fn(|axis| ends[axis].clamp(low[axis], low[axis].saturating_add(1)));
        let ([x, y, z], [right, far, up]) = (low, high);
        let close = |point: &&u32| self.points[**point as usize].distance(place) <= self.slack;
        for cell in (z..=up).flat_map(|z| (y..=far).flat_map(move |y| (x..=right).map(move |x| [x, y, z]))) {
            if let Some(&found) = self.cells.get(&cell).and_then(|points| points.iter().find(close)) {
                return found;
            }
        }
        // No more points than vertices, which are numbered by 32 bits.
        let index = self.points.len() as u32;
        self.points.push(place);
        self.cells.entry(key(place)).or_default().push(index);
        index
    }
}

/// Every edge once, its smaller end first, and how many triangles have it.
fn count_edges(triangles: &[[u32; 3]]) -> Vec<([u32; 2], usize)> {
    let mut edges: Vec<[u32; 2]> = triangles
        .iter()
        .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
        .map(|[a, b]| [a.min(b), a.max(b)])
        .collect();
    edges.sort_unstable();
    edges.chunk_by(|a, b| a == b).map(|same| (same[0], same.len())).collect()
}

/// Gives coordinates that differ by rounding only one value, so that sides parallel to an axis are exactly so.
fn snap(contours: &mut [Vec<DVec2>], slack: f64) {
    for axis in 0..2 {
        let mut values: Vec<f64> = contours.iter().flatten().map(|corner| corner[axis]).collect();
        values.sort_by(f64::total_cmp);
        // From the first value of a group, so that many close values do not merge into one.
        let mut groups: Vec<f64> = Vec::new();
        for value in values {
            if groups.last().is_none_or(|first| value - first > slack) {
                groups.push(value);
            }
        }
        for corner in contours.iter_mut().flatten() {
            let group = groups.partition_point(|first| *first <= corner[axis]);
            corner[axis] = groups[group.saturating_sub(1)];
        }
    }
}

/// Takes out corners that are none, and starts counter-clockwise at the corner with the smallest x (of these, y).
fn straighten(contour: &mut Vec<DVec2>, slack: f64) {
    let start = (0..contour.len()).min_by(|&a, &b| by_x(&contour[a], &contour[b])).unwrap_or_default();
    contour.rotate_left(start);
    if polygon::signed_area(contour) < 0.0 {
        contour[1..].reverse();
    }
    let mut kept: Vec<DVec2> = Vec::with_capacity(contour.len());
    for (k, &corner) in contour.iter().enumerate() {
        let next = contour[(k + 1) % contour.len()];
        if kept.last().is_none_or(|&last| polygon::nearest([last, next], corner).distance(corner) > slack) {
            kept.push(corner);
        }
    }
    *contour = kept;
}

fn by_x(a: &DVec2, b: &DVec2) -> std::cmp::Ordering {
    a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y))
}

/// What contours that do not cross enclose by the even-odd rule.
fn enclosed_area(contours: &[Vec<DVec2>]) -> f64 {
    let is_hole = |k: usize| {
        let around = (0..contours.len())
            .filter(|&other| other != k && polygon::surround(&contours[other..=other], contours[k][0]));
        around.count() % 2 == 1
    };
    (0..contours.len())
        .map(|k| polygon::signed_area(&contours[k]).abs() * if is_hole(k) { -1.0 } else { 1.0 })
        .sum()
}
