//! Where the nodes of a lattice stand in memory.
//!
//! Nodes are coloured like a chess board and the two colours are stored apart, so whatever is computed for one colour
//! reads only the other: in any order, with the same result. Node (i, j, k) stands at ⌊(i+j+k)/2⌋ + j·row + k·plane of
//! its colour. In these skewed coordinates each of the six neighbours is at the same distance for all nodes of a colour:
//! a whole plane is one loop with unit stride, whatever its rows. Rows are packed without gaps; what a row's first or
//! last node finds beyond its end is a node of another row, with the weight zero between them.
//!
//! Vectors have several columns. Each plane holds all of them, one after the other, so that some planes of a vector are
//! one piece of memory, which a thread can have for itself.

use std::ops::Range;

/// Planes are computed in blocks of this many nodes.
pub(super) const BLOCK: usize = 8;

/// Something for every node of each colour.
pub(super) type Coloured<T> = [Vec<T>; 2];

/// Nodes whose three indices have an even sum are red, the others black.
pub(super) const RED: usize = 0;
pub(super) const BLACK: usize = 1;

/// The arrangement of the nodes of one lattice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    /// Number of nodes along each axis.
    pub(super) counts: [usize; 3],
    /// How many rows at either end of y, and planes at either end of z, are fixed whatever happens.
    pub(super) margin: [usize; 2],
    /// Number of columns.
    pub(super) columns: usize,
    /// Distance between rows, between columns and between planes; columns are a whole number of blocks apart.
    pub(super) row: usize,
    column: usize,
    pub(super) plane: usize,
}

impl Layout {
    /// That of numbers which are there once for each node.
    pub(super) fn new(counts: [usize; 3], margin: [usize; 2]) -> Self {
        let [nx, ny, _] = counts;
        let row = nx / 2;
        let nodes = (ny - 1) * row + (nx + ny) / 2 + 1;
        // Whole blocks, or rows of nodes of either colour in whole blocks, are written up to the last row that is not fixed.
        let last = ny - 1 - margin[0];
        let written = last * row + (nx + last).div_ceil(2) + BLOCK + BLOCK / 2;
        let plane = nodes.max(written).next_multiple_of(BLOCK);
        Self { counts, margin, columns: 1, row, column: plane, plane }
    }

    /// That of vectors with so many columns.
    pub(super) fn with_columns(self, columns: usize) -> Self {
        Self { columns, plane: columns * self.column, ..self }
    }

    /// Room for all values of one colour, and for what is read beside planes that are not fixed.
    pub(super) fn len(&self) -> usize {
        let nz = self.counts[2];
        (nz + 2 - 2 * self.margin[1]) * self.plane + nz / 2 + 4 * BLOCK
    }

    /// The room for planes before plane k.
    #[inline(always)]
    fn before(&self, k: usize) -> usize {
        (k + 1 - self.margin[1]) * self.plane
    }

    /// Zeros at every node.
    pub(super) fn zeros<T: Clone + Default>(&self) -> Coloured<T> {
        [vec![T::default(); self.len()], vec![T::default(); self.len()]]
    }

    /// Colour and place of a node, in the first column.
    #[inline(always)]
    pub(super) fn place(&self, [i, j, k]: [usize; 3]) -> (usize, usize) {
        let sum = i + j + k;
        (sum % 2, BLOCK + sum / 2 + j * self.row + self.before(k))
    }

    /// The indices along the axes of a node by its number.
    pub(super) fn indices(&self, node: usize) -> [usize; 3] {
        // Dividing takes most of the time, so as little as possible and in few bits.
        let [nx, ny, _] = self.counts.map(|count| count as u32);
        let node = node as u32;
        let (row, plane) = (node / nx, node / nx / ny);
        [node - row * nx, row - plane * ny, plane].map(|index| index as usize)
    }

    /// Rows and planes that are not fixed throughout.
    pub(super) fn rows(&self) -> Range<usize> {
        self.margin[0]..self.counts[1] - self.margin[0]
    }

    pub(super) fn planes(&self) -> Range<usize> {
        self.margin[1]..self.counts[2] - self.margin[1]
    }

    /// The places of a plane's nodes of either colour in the first column, but for rows fixed throughout; a whole number
    /// of blocks.
    #[inline(always)]
    pub(super) fn plane(&self, k: usize) -> Range<usize> {
        let [nx, ny, _] = self.counts;
        let (first, last) = (self.margin[0], ny - 1 - self.margin[0]);
        let plane = BLOCK + self.before(k);
        let start = plane + (first + k) / 2 + first * self.row;
        let end = plane + (nx - 1 + last + k) / 2 + last * self.row + 1;
        start..start + (end - start).next_multiple_of(BLOCK)
    }

    /// The same in any column.
    #[inline(always)]
    pub(super) fn plane_of(&self, column: usize, k: usize) -> Range<usize> {
        let Range { start, end } = self.plane(k);
        self.in_column(column, start)..self.in_column(column, end)
    }

    /// A place in the first column, in any.
    #[inline(always)]
    pub(super) fn in_column(&self, column: usize, at: usize) -> usize {
        column * self.column + at
    }

    /// Where memory may be cut between a plane and the one before: all that is computed of a plane and all that is read
    /// beside it, one plane away, is on the same side.
    pub(super) fn cut(&self, k: usize) -> usize {
        BLOCK / 2 + k / 2 + self.before(k)
    }

    /// Where the neighbours, all of the other colour, of a node at a place are: along x, y and z, the previous and the
    /// next. Beyond planes that are fixed there may be no room; what is told then is no node's place.
    #[inline(always)]
    pub(super) fn around(&self, colour: usize, at: usize) -> [usize; 6] {
        let [row, plane] = [self.row, self.plane];
        let [west, south, below] = if colour == RED { [1, row + 1, plane + 1] } else { [0, row, plane] };
        let (north, above) = (at - west + row + 1, at - west + plane + 1);
        let [south, below] = [south, below].map(|distance| at.saturating_sub(distance));
        [at - west, at - west + 1, south, north, below, above.min(self.len() - 1)]
    }

    /// The neighbours' values of `n` nodes from a place on, given all of the other colour.
    #[inline(always)]
    pub(super) fn neighbours<'v, T>(&self, colour: usize, at: usize, n: usize, of: &'v [T]) -> [&'v [T]; 6] {
        let [a, b, c, d, e, f] = self.around(colour, at);
        [&of[a..a + n], &of[b..b + n], &of[c..c + n], &of[d..d + n], &of[e..e + n], &of[f..f + n]]
    }

    /// How far the places of a plane's nodes of one colour are shifted against those of plane 0 whose i + j is as odd.
    #[inline(always)]
    pub(super) fn shift(&self, colour: usize, k: usize) -> usize {
        let skew = if colour == RED { k.div_ceil(2) } else { k / 2 };
        BLOCK + skew + self.before(k)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COUNTS: [[usize; 3]; 7] =
        [[5, 4, 3], [6, 7, 5], [3, 3, 3], [9, 2, 4], [8, 9, 12], [33, 5, 4], [17, 16, 3]];

    /// Layouts of all these counts, with and without margins, with one column and with three.
    fn layouts() -> impl Iterator<Item = Layout> {
        let margins = [[0, 0], [0, 1], [1, 0], [1, 1]];
        let of_nodes = COUNTS.into_iter().flat_map(move |counts| margins.map(|m| Layout::new(counts, m)));
        of_nodes.flat_map(|layout| [layout, layout.with_columns(3)])
    }

    #[test]
    fn every_node_has_a_place_of_its_own_and_neighbours_where_they_should_be() {
        for layout in layouts() {
            let (counts, columns) = (layout.counts, layout.columns);
            let mut taken = std::collections::BTreeSet::new();
            let nodes = counts.into_iter().product();
            for at in (0..nodes).map(|node| layout.indices(node)) {
                let (colour, place) = layout.place(at);
                let is_free = layout.rows().contains(&at[1]) && layout.planes().contains(&at[2]);
                for column in 0..columns {
                    let place = layout.in_column(column, place);
                    assert!(taken.insert((colour, place)), "{at:?}");
                    assert!(place < layout.len());
                    assert!(!is_free || layout.plane_of(column, at[2]).contains(&place));
                }
                let around = layout.around(colour, place);
                for (side, neighbour) in around.into_iter().enumerate() {
                    let mut beside = at;
                    let (axis, next) = (side / 2, side % 2 == 1);
                    if next && at[axis] + 1 < counts[axis] {
                        beside[axis] += 1;
                    } else if !next && at[axis] > 0 {
                        beside[axis] -= 1;
                    } else {
                        assert!(neighbour < layout.len());
                        continue;
                    }
                    assert_eq!(layout.place(beside), (1 - colour, neighbour), "{at:?} {side}");
                }
            }
        }
    }

    #[test]
    fn memory_can_be_cut_between_planes() {
        for layout in layouts() {
            let planes = layout.planes();
            for k in planes.start + 1..planes.end {
                let plane = layout.plane_of(layout.columns - 1, k - 1);
                assert!(plane.end <= layout.cut(k) && layout.cut(k) <= layout.plane(k).start);
                for colour in [RED, BLACK] {
                    // Of the plane before the cut, those after it are read, and the other way round.
                    let [.., below, _] = layout.around(colour, layout.plane(k).start);
                    let [.., above] = layout.around(colour, plane.end - 1);
                    assert!(below >= layout.cut(k - 1) && above < layout.cut(k + 1), "{layout:?} {k}");
                }
            }
        }
    }

    /// Rows are written in whole blocks of nodes of either colour: the last of a column before any of the next is read.
    #[test]
    fn rows_may_be_written_in_whole_blocks() {
        for layout in layouts() {
            let (rows, n) = (layout.rows(), layout.counts[0].next_multiple_of(2 * BLOCK) / 2);
            for k in layout.planes().filter(|_| !rows.is_empty()) {
                let end = layout.place([1, rows.end - 1, k]).1 + n;
                let next = layout.in_column(1, layout.place([0, 0, k]).1);
                assert!(end <= next && layout.in_column(layout.columns - 1, end) <= layout.cut(k + 1));
                assert!(layout.plane(k).end <= next, "{layout:?} {k}");
            }
        }
    }
}
