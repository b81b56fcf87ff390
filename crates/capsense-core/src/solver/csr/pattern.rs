//! Which rows are coupled to which, sorted for sweeps on blocks of rows.
//!
//! Rows form blocks that do not see what a sweep does in others, so that threads can share a sweep without changing a bit
//! of the result. What a row is coupled to is listed in three parts: lower rows of its own block, higher ones, and rows of
//! other blocks. Each part of a sweep reads one or two of them, which lie side by side.

use std::ops::Range;

/// Most rows that a block may have if it is thick enough; of coarse levels, which are visited twice, a quarter.
/// With all of the second level in one block, two threads were 1.3 times as fast as one at 300,000 tetrahedra.
const LARGEST_BLOCK: usize = 16_384;
const LARGEST_COARSE_BLOCK: usize = 4096;

/// A block, of more than two, has so many times as many rows as the rows of an entry are apart at most: of couplings between
/// blocks a sweep sees nothing new, so they must be few. With blocks of 16,384 rows the first solve at 3M tetrahedra takes
/// 131 iterations, in one block 29.
const THICKNESS: usize = 8;

/// What a branch costs that goes another way than expected, in entries that could be read in its time.
const UNEXPECTED_BRANCH: usize = 12;

/// Processors remember which ways the branches of so few rows go.
const KNOWN_BY_HEART: usize = 1000;

/// The entries of a matrix without its diagonal.
#[derive(Clone, Debug)]
pub(super) struct Pattern {
    /// Number of rows in each block but the last.
    block: usize,
    /// One more than there are rows.
    spans: Vec<Span>,
    columns: Vec<u32>,
    /// Rows with entries in other blocks, in increasing order.
    border: Vec<u32>,
}

/// Where the parts of a row start.
#[derive(Clone, Copy, Debug)]
struct Span {
    lower: u32,
    higher: u32,
    far: u32,
}

/// The three parts of a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Part {
    Lower,
    Higher,
    Far,
}

impl Pattern {
    /// `neighbours` lists those of a row, which keep their order within each part.
    pub(super) fn new(rows: usize, neighbours: impl Fn(usize, &mut Vec<u32>)) -> Self {
        Self::in_blocks_of(LARGEST_BLOCK, rows, neighbours, false)
    }

    /// The same for a level coarser than another one. The parts of rows within a block are filled up to some common length,
    /// where they are not empty: entries that repeat the first of a part, and must never weigh anything. A loop that ends
    /// sooner or later from row to row takes twice as long.
    pub(super) fn coarser(finer: &Self, rows: usize, neighbours: impl Fn(usize, &mut Vec<u32>)) -> Self {
        // Where one thread does all of a level, more blocks are of no use below it.
        let largest = if finer.blocks() > 1 { LARGEST_COARSE_BLOCK } else { LARGEST_BLOCK };
        Self::in_blocks_of(largest, rows, neighbours, rows > KNOWN_BY_HEART)
    }

    fn in_blocks_of(
        largest: usize,
        rows: usize,
        neighbours: impl Fn(usize, &mut Vec<u32>),
        fills: bool,
    ) -> Self {
        let mut around = Vec::new();
        let mut bandwidth = 0;
        for row in 0..rows {
            around.clear();
            neighbours(row, &mut around);
            bandwidth = around.iter().map(|&other| row.abs_diff(other as usize)).fold(bandwidth, usize::max);
        }
        let mut pattern = Self {
            block: block_size(largest, rows, bandwidth),
            spans: Vec::new(),
            columns: Vec::new(),
            border: Vec::new(),
        };
        let mut lengths = [Vec::new(), Vec::new()];
        for row in (0..rows).filter(|_| fills) {
            around.clear();
            neighbours(row, &mut around);
            for (lengths, part) in lengths.iter_mut().zip([Part::Lower, Part::Higher]) {
                let of_part = around.iter().filter(|&&other| pattern.part(row, other as usize) == part);
                count(lengths, of_part.count());
            }
        }
        let common = lengths.map(|lengths| common_length(&lengths));
        for row in 0..rows {
            around.clear();
            neighbours(row, &mut around);
            let mut columns = std::mem::take(&mut pattern.columns);
            let [lower, higher, far] = [Part::Lower, Part::Higher, Part::Far].map(|part| {
                let start = columns.len();
                columns.extend(around.iter().filter(|&&other| pattern.part(row, other as usize) == part));
                let length = columns.len() - start;
                if fills && length > 0 && part != Part::Far {
                    let common = common[usize::from(part == Part::Higher)];
                    columns.resize(start + length.next_multiple_of(2).max(common), columns[start]);
                }
                start as u32
            });
            pattern.columns = columns;
            pattern.spans.push(Span { lower, higher, far });
            if far < pattern.columns.len() as u32 {
                pattern.border.push(row as u32);
            }
        }
        let end = pattern.columns.len() as u32;
        pattern.spans.push(Span { lower: end, higher: end, far: end });
        pattern.columns.shrink_to_fit();
        pattern
    }

    /// Where a row lists another.
    pub(super) fn part(&self, row: usize, other: usize) -> Part {
        match (row / self.block == other / self.block, other < row) {
            (false, _) => Part::Far,
            (true, true) => Part::Lower,
            (true, false) => Part::Higher,
        }
    }

    /// Number of rows.
    pub(super) fn rows(&self) -> usize {
        self.spans.len() - 1
    }

    /// Number of rows in each block but the last.
    pub(super) fn block(&self) -> usize {
        self.block
    }

    /// Number of blocks.
    pub(super) fn blocks(&self) -> usize {
        self.rows().div_ceil(self.block)
    }

    /// The rows that the entries lead to.
    #[inline(always)]
    pub(super) fn columns(&self) -> &[u32] {
        &self.columns
    }

    /// Rows with entries in other blocks, in increasing order.
    pub(super) fn border(&self) -> &[u32] {
        &self.border
    }

    /// The entries of a row.
    #[inline(always)]
    pub(super) fn entries(&self, row: usize) -> Range<usize> {
        self.spans[row].lower as usize..self.spans[row + 1].lower as usize
    }

    /// Those to lower rows of its block.
    #[inline(always)]
    pub(super) fn lower(&self, row: usize) -> Range<usize> {
        self.spans[row].lower as usize..self.spans[row].higher as usize
    }

    /// Those to all rows of its block.
    #[inline(always)]
    pub(super) fn near(&self, row: usize) -> Range<usize> {
        self.spans[row].lower as usize..self.spans[row].far as usize
    }

    /// Those to higher rows of its block.
    #[inline(always)]
    pub(super) fn higher(&self, row: usize) -> Range<usize> {
        self.spans[row].higher as usize..self.spans[row].far as usize
    }

    /// Those to rows of other blocks.
    #[inline(always)]
    pub(super) fn far(&self, row: usize) -> Range<usize> {
        self.spans[row].far as usize..self.spans[row + 1].lower as usize
    }

    /// Whether an entry of a row is there to fill it up.
    pub(super) fn is_filling(&self, row: usize, entry: usize) -> bool {
        let Span { lower, higher, .. } = self.spans[row];
        [lower, higher].map(|first| first as usize).into_iter().any(|first| {
            // Those of the lower part lead to none of the higher one.
            entry > first && self.columns[entry] == self.columns[first]
        })
    }

    /// The entry of a row that leads to another, if there is one.
    pub(super) fn find(&self, row: u32, other: u32) -> Option<usize> {
        self.entries(row as usize).find(|&entry| self.columns[entry] == other)
    }
}

/// Notes one more of some length.
fn count(lengths: &mut Vec<usize>, length: usize) {
    lengths.resize(lengths.len().max(length + 1), 0);
    lengths[length] += 1;
}

/// To what length parts are best filled up of which there are so many of each length: one that is longer costs a branch, one that
/// is shorter the entries that are read for nothing.
fn common_length(lengths: &[usize]) -> usize {
    let cost = |common: usize| -> usize {
        let of_length = |(length, number): (usize, &usize)| match length <= common {
            true => number * common,
            false => number * (length.next_multiple_of(2) + UNEXPECTED_BRANCH),
        };
        lengths.iter().enumerate().skip(1).map(of_length).sum()
    };
    (0..lengths.len() + 1).step_by(2).min_by_key(|&common| cost(common)).unwrap_or(0)
}

/// Blocks are alike, and an even number of them, so that two threads have the same to do.
fn block_size(largest: usize, rows: usize, bandwidth: usize) -> usize {
    let thick_enough = rows / (THICKNESS * bandwidth).max(1) / 2 * 2;
    let blocks = match rows.div_ceil(largest) {
        0 | 1 => 1,
        blocks => blocks.next_multiple_of(2).min(thick_enough.max(2)),
    };
    rows.div_ceil(blocks).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Below a level that threads share they share the next one too, though it has fewer rows; below others there is nothing
    /// to share.
    #[test]
    fn coarse_levels_of_large_meshes_are_shared() {
        let chain = |rows: usize| {
            move |row: usize, found: &mut Vec<u32>| {
                found.extend(
                    [row.wrapping_sub(1), row + 1]
                        .into_iter()
                        .filter(|&other| other < rows)
                        .map(|r| r as u32),
                );
            }
        };
        let [large, small] = [20_000, 10_000].map(|rows| Pattern::new(rows, chain(rows)));
        assert_eq!([large.blocks(), small.blocks()], [2, 1]);
        let below = |finer: &Pattern, rows| Pattern::coarser(finer, rows, chain(rows));
        assert_eq!([5_000, 4_000].map(|rows| below(&large, rows).blocks()), [2, 1]);
        assert_eq!(below(&small, 5_000).blocks(), 1);
        // A row at either side of the border.
        assert_eq!(below(&large, 5_000).border(), [2_499, 2_500]);
    }

    /// Lengths that most parts have cost little to reach; few longer ones are not worth filling up all others.
    #[test]
    fn parts_are_filled_up_to_what_most_of_them_have() {
        assert_eq!(common_length(&[5, 0, 0, 30, 40, 50, 40, 0, 0, 2]), 6);
        assert_eq!(common_length(&[]), 0);
    }

    /// Rows of coarse levels have the entries that they would have, in their order, and such as repeat the first of a part.
    #[test]
    fn rows_of_coarse_levels_are_filled_up() {
        let rows = KNOWN_BY_HEART + 200;
        let neighbours = move |row: usize, found: &mut Vec<u32>| {
            let reach = 2 + row % 3;
            let around = row.saturating_sub(reach)..(row + reach + 1).min(rows);
            found.extend(around.filter(|&other| other != row).map(|other| other as u32));
        };
        let plain = Pattern::new(rows, neighbours);
        let filled = Pattern::coarser(&plain, rows, neighbours);
        let lengths: Vec<usize> = (50..rows - 50).map(|row| filled.lower(row).len()).collect();
        assert!(lengths.iter().all(|length| *length == 4), "{:?}", &lengths[..9]);
        for row in 0..rows {
            let own = filled.entries(row).filter(|&entry| !filled.is_filling(row, entry));
            let own: Vec<u32> = own.map(|entry| filled.columns()[entry]).collect();
            assert_eq!(own, plain.columns()[plain.entries(row)], "{row}");
        }
        let small = Pattern::coarser(&plain, KNOWN_BY_HEART, move |row, found| {
            found.extend((row > 0).then(|| row as u32 - 1));
        });
        assert_eq!(small.columns().len(), KNOWN_BY_HEART - 1);
    }
}
