//! Cells beside planes of nodes, by which distances are counted: of one plane, and of several next to each other in arrays.

use super::star::Plane;
use std::ops::Range;

/// One number or the other, both being known. In bits, as a choice between floating-point numbers may become a branch.
#[inline(always)]
pub(crate) fn either(condition: bool, one: f64, other: f64) -> f64 {
    let mask = u64::from(condition).wrapping_neg();
    f64::from_bits(one.to_bits() & mask | other.to_bits() & !mask)
}

/// The cells below and above a plane of nodes, by which distances along an axis are counted.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlaneCells {
    pub(super) at: f64,
    /// The way to the nearer neighbour.
    pub(super) narrowest: f64,
    /// Half of the way from one neighbour to the other, and by how much the way upwards is the longer one.
    pub(super) width: f64,
    pub(super) skew: f64,
    /// The cells next to the plane, and one over their sizes and those behind them.
    first: [f64; 2],
    per_first: [f64; 2],
    per_second: [f64; 2],
}

impl PlaneCells {
    pub(super) fn of(plane: &Plane) -> Self {
        let of_cell = |cell: usize| plane.cells.map(|cells| cells[cell]);
        Self {
            at: plane.at,
            narrowest: plane.narrowest,
            width: plane.width,
            skew: plane.skew,
            first: of_cell(0),
            per_first: of_cell(0).map(f64::recip),
            per_second: of_cell(1).map(f64::recip),
        }
    }

    /// Cells to what is so far above, or below; without branches.
    #[inline(always)]
    pub(super) fn cells_to(&self, way: f64) -> f64 {
        let of_side = |[below, above]: [f64; 2]| either(way > 0.0, above, below);
        let (away, first) = (way.abs(), of_side(self.first));
        let within = away * of_side(self.per_first);
        let behind = 1.0 + (away - first) * of_side(self.per_second);
        either(away <= first, within, behind)
    }
}

/// The same of several planes, one array for each number.
#[derive(Clone, Debug, Default)]
pub(super) struct CellArrays {
    at: Vec<f64>,
    narrowest: Vec<f64>,
    width: Vec<f64>,
    skew: Vec<f64>,
    first: [Vec<f64>; 2],
    per_first: [Vec<f64>; 2],
    per_second: [Vec<f64>; 2],
}

/// So many nodes of a row are looked at together. Arrays go on for as many planes behind the last, which are as that one.
pub(super) const TOGETHER: usize = 4;

impl CellArrays {
    pub(super) fn of(planes: &[Plane]) -> Self {
        let spare = planes.last().into_iter().cycle().take(TOGETHER);
        let cells: Vec<PlaneCells> = planes.iter().chain(spare).map(PlaneCells::of).collect();
        let all = |number: &dyn Fn(&PlaneCells) -> f64| cells.iter().map(number).collect::<Vec<f64>>();
        let sides = |of: &dyn Fn(&PlaneCells) -> [f64; 2]| [0, 1].map(|side| all(&|cells| of(cells)[side]));
        Self {
            at: all(&|cells| cells.at),
            narrowest: all(&|cells| cells.narrowest),
            width: all(&|cells| cells.width),
            skew: all(&|cells| cells.skew),
            first: sides(&|cells| cells.first),
            per_first: sides(&|cells| cells.per_first),
            per_second: sides(&|cells| cells.per_second),
        }
    }

    /// So many from one on, in groups.
    pub(super) fn groups(&self, from: usize, count: usize) -> CellGroups<'_> {
        fn some(array: &[f64], range: Range<usize>) -> &[Group] {
            array[range].as_chunks().0
        }
        fn sides(arrays: &[Vec<f64>; 2], range: Range<usize>) -> [&[Group]; 2] {
            arrays.each_ref().map(|array| some(array, range.clone()))
        }
        let range = from..from + count;
        CellGroups {
            at: some(&self.at, range.clone()),
            narrowest: some(&self.narrowest, range.clone()),
            width: some(&self.width, range.clone()),
            skew: some(&self.skew, range.clone()),
            first: sides(&self.first, range.clone()),
            per_first: sides(&self.per_first, range.clone()),
            per_second: sides(&self.per_second, range),
        }
    }
}

/// A number of planes next to each other.
type Group = [f64; TOGETHER];

/// Pieces of these arrays, all of one length, in groups.
#[derive(Clone, Copy, Debug)]
pub(super) struct CellGroups<'a> {
    at: &'a [Group],
    narrowest: &'a [Group],
    width: &'a [Group],
    skew: &'a [Group],
    first: [&'a [Group]; 2],
    per_first: [&'a [Group]; 2],
    per_second: [&'a [Group]; 2],
}

/// One group of each.
#[derive(Clone, Copy, Debug)]
pub(super) struct CellGroup<'a> {
    at: &'a Group,
    narrowest: &'a Group,
    width: &'a Group,
    skew: &'a Group,
    first: [&'a Group; 2],
    per_first: [&'a Group; 2],
    per_second: [&'a Group; 2],
}

impl CellGroup<'_> {
    #[inline(always)]
    pub(super) fn at(&self, plane: usize) -> PlaneCells {
        let sides = |[below, above]: [&Group; 2]| [below[plane], above[plane]];
        PlaneCells {
            at: self.at[plane],
            narrowest: self.narrowest[plane],
            width: self.width[plane],
            skew: self.skew[plane],
            first: sides(self.first),
            per_first: sides(self.per_first),
            per_second: sides(self.per_second),
        }
    }
}

/// Cells around nodes next to each other along x.
#[derive(Clone, Copy, Debug)]
pub(super) struct RowCells<'a> {
    /// Along x, of the nodes and of a few more that make the last group full.
    pub(super) x: CellGroups<'a>,
    /// Along y and z.
    pub(super) across: [&'a PlaneCells; 2],
}

impl<'a> RowCells<'a> {
    /// How many groups there are along x.
    #[inline(always)]
    pub(super) fn groups(&self) -> usize {
        self.x.at.len()
    }

    /// Along x, one of the groups.
    #[inline(always)]
    pub(super) fn group(&self, group: usize) -> CellGroup<'a> {
        let x = &self.x;
        let sides = |groups: [&'a [Group]; 2]| [&groups[0][group], &groups[1][group]];
        CellGroup {
            at: &x.at[group],
            narrowest: &x.narrowest[group],
            width: &x.width[group],
            skew: &x.skew[group],
            first: sides(x.first),
            per_first: sides(x.per_first),
            per_second: sides(x.per_second),
        }
    }
}
