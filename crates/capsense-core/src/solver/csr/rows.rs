//! K in compressed rows, in the solver's own order of the nodes.

use super::ordering::reverse_cuthill_mckee;
use super::pattern::{Part, Pattern};
use crate::occupancy::IndexList;
use crate::stiffness::StiffnessMatrix;
use crate::workers::Workers;
use std::ops::Range;
use std::sync::Arc;

/// Rows that are evaluated together: what they take and give stays in the first cache.
pub(super) const STRIP: usize = 256;

/// Changed rows that a thread takes at a time.
pub(super) const ROWS_OF_A_TASK: usize = 64;

/// The rows of all nodes: a Laplacian of weights, and its links to objects.
#[derive(Clone, Debug)]
pub(super) struct Rows {
    /// The row of each node, and the node of each row.
    row_of_node: Vec<u32>,
    node_of_row: Vec<u32>,
    /// Parts of a row keep the order in which the matrix lists the neighbours.
    pattern: Arc<Pattern>,
    /// For each row, of its neighbours in the order of the matrix, which of its entries are theirs.
    places: Vec<u32>,
    weights: Vec<f64>,
    diagonal: Vec<f64>,
    /// Sum of the weights of each row's links.
    link_sums: Vec<f64>,
    fixed: Vec<bool>,
    /// Of each strip the first row and the end of those that it takes potentials from.
    reach: Vec<[u32; 2]>,
    /// Ordered by row.
    links: Vec<RowLink>,
    /// Rows that the last refresh touched.
    changed: IndexList,
}

/// A weight between a row and that of an object.
#[derive(Clone, Copy, Debug)]
pub(super) struct RowLink {
    pub(super) row: u32,
    pub(super) object_row: u32,
    pub(super) weight: f64,
    /// Place in the matrix's list, which makes the order unique.
    place: u32,
}

impl Rows {
    /// The pattern of a matrix; all values still are zero.
    pub(super) fn new(matrix: &StiffnessMatrix) -> Self {
        let nodes = matrix.nodes();
        let row_of_node = reverse_cuthill_mckee(nodes, |node, found| {
            found.extend(matrix.row(node).map(|(other, _)| other as u32));
        });
        let mut node_of_row = vec![0; nodes];
        for (node, &row) in row_of_node.iter().enumerate() {
            node_of_row[row as usize] = node as u32;
        }
        let neighbours =
            |row: usize| matrix.row(node_of_row[row] as usize).map(|(other, _)| row_of_node[other]);
        let pattern = Pattern::new(nodes, |row, found| found.extend(neighbours(row)));
        let mut places: Vec<u32> =
            (0..nodes).flat_map(|row| places(&pattern, row, neighbours(row))).collect();
        places.shrink_to_fit();
        Self {
            places,
            node_of_row,
            weights: vec![0.0; pattern.columns().len()],
            reach: reach(&pattern),
            row_of_node,
            pattern: Arc::new(pattern),
            diagonal: vec![0.0; nodes],
            link_sums: vec![0.0; nodes],
            fixed: vec![false; nodes],
            links: Vec::new(),
            changed: IndexList::below(nodes),
        }
    }

    /// Number of rows, without those of objects.
    pub(super) fn len(&self) -> usize {
        self.diagonal.len()
    }

    /// The row of a node or of an object.
    pub(super) fn row_of(&self, node: usize) -> usize {
        self.row_of_node.get(node).map_or(node, |&row| row as usize)
    }

    /// Takes over changed rows, and which nodes are fixed now. `changed` holds nodes.
    pub(super) fn refresh(
        &mut self,
        matrix: &StiffnessMatrix,
        fixed: &[bool],
        changed: impl Iterator<Item = u32>,
        workers: &Workers,
    ) {
        let mut changed = changed.map(|node| node as usize).filter(|&node| node < matrix.nodes()).peekable();
        self.changed.clear();
        if changed.peek().is_none() {
            return;
        }
        for node in changed {
            let row = self.row_of_node[node] as usize;
            self.changed.insert(row);
            if std::mem::replace(&mut self.fixed[row], fixed[node]) != fixed[node] {
                let around = &self.pattern.columns()[self.pattern.entries(row)];
                around.iter().for_each(|&other| self.changed.insert(other as usize));
            }
        }
        self.changed.sort();
        let Self { row_of_node, node_of_row, pattern, places, changed, links, .. } = self;
        let mut values = Values {
            first_row: 0,
            first_entry: 0,
            weights: &mut self.weights,
            diagonal: &mut self.diagonal,
            link_sums: &mut self.link_sums,
        };
        let tasks = changed.numbers().chunks(ROWS_OF_A_TASK).map(|rows| {
            let last = rows[rows.len() - 1] as usize;
            (rows, values.split_to(last + 1, pattern.entries(last).end))
        });
        let take_rows = || {
            workers.for_each(tasks, |(rows, mut values)| {
                for row in rows.iter().map(|&row| row as usize) {
                    let entries = pattern.entries(row);
                    values.take(row, &entries, &places[entries.clone()], matrix, node_of_row[row] as usize);
                }
            });
        };
        let take_links = || {
            links.clear();
            links.extend(matrix.links().zip(0..).map(|((node, object_row, weight), place)| RowLink {
                row: row_of_node[node],
                object_row: object_row as u32,
                weight,
                place,
            }));
            links.sort_unstable_by_key(|link| u64::from(link.row) << 32 | u64::from(link.place));
        };
        workers.both(take_rows, take_links);
    }

    /// Rows whose values or state, or whose neighbours' state, the last refresh changed.
    pub(super) fn changed(&self) -> &[u32] {
        self.changed.numbers()
    }

    pub(super) fn fixed(&self) -> &[bool] {
        &self.fixed
    }

    pub(super) fn diagonal(&self) -> &[f64] {
        &self.diagonal
    }

    #[cfg(test)]
    pub(super) fn set_diagonal(&mut self, row: usize, diagonal: f64) {
        self.diagonal[row] = diagonal;
    }

    pub(super) fn link_sums(&self) -> &[f64] {
        &self.link_sums
    }

    /// Which entries there are.
    pub(super) fn pattern(&self) -> &Arc<Pattern> {
        &self.pattern
    }

    /// The rows that a strip takes potentials from lie in this range, and so does the strip.
    pub(super) fn reach(&self, strip: usize) -> Range<usize> {
        self.reach[strip][0] as usize..self.reach[strip][1] as usize
    }

    /// Where the neighbours of a row are.
    #[inline(always)]
    pub(super) fn entries(&self, row: usize) -> Range<usize> {
        self.pattern.entries(row)
    }

    /// The neighbours of a row and the weights to them.
    #[inline(always)]
    pub(super) fn row(&self, row: usize) -> (&[u32], &[f64]) {
        let entries = self.entries(row);
        (&self.pattern.columns()[entries.clone()], &self.weights[entries])
    }

    /// Adds what the charges of a row and of its neighbours change by when its potential changes. Those given count from `first`.
    #[inline(always)]
    pub(super) fn add_charges<const L: usize>(
        &self,
        row: usize,
        by: &[f64; L],
        charges: &mut [[f64; L]],
        first: usize,
    ) {
        let (columns, weights) = self.row(row);
        for (&column, &weight) in columns.iter().zip(weights) {
            add_product(&mut charges[column as usize - first], -weight, by);
        }
        add_product(&mut charges[row - first], self.diagonal[row], by);
    }

    /// The weight at one entry.
    pub(super) fn weight(&self, entry: usize) -> f64 {
        self.weights[entry]
    }

    /// All links, ordered by row.
    pub(super) fn links(&self) -> &[RowLink] {
        &self.links
    }

    /// The links of some rows.
    pub(super) fn links_of(&self, rows: Range<usize>) -> &[RowLink] {
        let before = |row: usize| self.links.partition_point(|link| (link.row as usize) < row);
        &self.links[before(rows.start)..before(rows.end)]
    }

    /// (K x) at one row without its links to objects other than at 0 V. The rows of x count from `first`.
    #[inline(always)]
    pub(super) fn product<const L: usize, T: Copy + Into<f64>>(
        &self,
        row: usize,
        x: &[[T; L]],
        first: usize,
    ) -> [f64; L] {
        let (columns, weights) = self.row(row);
        let (column_pairs, last_column) = columns.as_chunks::<2>();
        let (weight_pairs, last_weight) = weights.as_chunks::<2>();
        // Two sums, so that one does not wait for the other.
        let mut outward = [[0.0; L]; 2];
        for (columns, weights) in column_pairs.iter().zip(weight_pairs) {
            for entry in 0..2 {
                add_product(&mut outward[entry], weights[entry], &x[columns[entry] as usize - first]);
            }
        }
        for (&column, &weight) in last_column.iter().zip(last_weight) {
            add_product(&mut outward[0], weight, &x[column as usize - first]);
        }
        let mut product = [0.0; L];
        let (x, diagonal) = (&x[row - first], self.diagonal[row]);
        for lane in 0..L {
            product[lane] = diagonal * x[lane].into() - (outward[0][lane] + outward[1][lane]);
        }
        product
    }
}

/// What is known of successive rows, from some row and entry on.
struct Values<'a> {
    first_row: usize,
    first_entry: usize,
    weights: &'a mut [f64],
    diagonal: &'a mut [f64],
    link_sums: &'a mut [f64],
}

impl<'a> Values<'a> {
    /// Those up to a row and an entry; the rest is left.
    fn split_to(&mut self, row: usize, entry: usize) -> Self {
        let (rows, entries) = (row - self.first_row, entry - self.first_entry);
        let first = Values {
            first_row: self.first_row,
            first_entry: self.first_entry,
            weights: self.weights.split_off_mut(..entries).unwrap_or_default(),
            diagonal: self.diagonal.split_off_mut(..rows).unwrap_or_default(),
            link_sums: self.link_sums.split_off_mut(..rows).unwrap_or_default(),
        };
        (self.first_row, self.first_entry) = (row, entry);
        first
    }

    /// Takes over what the matrix has at the node of a row, its neighbours at some places among its entries.
    fn take(
        &mut self,
        row: usize,
        entries: &Range<usize>,
        places: &[u32],
        matrix: &StiffnessMatrix,
        node: usize,
    ) {
        let weights = &mut self.weights[entries.start - self.first_entry..entries.end - self.first_entry];
        let mut places = places.iter();
        matrix.row(node).for_each(|(_, weight)| {
            if let Some(&place) = places.next() {
                weights[place as usize] = weight;
            }
        });
        self.diagonal[row - self.first_row] = matrix.diagonal(node);
        self.link_sums[row - self.first_row] = matrix.link_weight(node);
    }
}

/// Which of the entries of a row its neighbours are at, in the order in which they come. The pattern must not be filled up.
fn places(pattern: &Pattern, row: usize, neighbours: impl Iterator<Item = u32>) -> impl Iterator<Item = u32> {
    let first = pattern.entries(row).start;
    let [mut lower, mut higher, mut far] = [pattern.lower(row), pattern.higher(row), pattern.far(row)];
    neighbours.filter_map(move |other| {
        let entry = match pattern.part(row, other as usize) {
            Part::Lower => lower.next(),
            Part::Higher => higher.next(),
            Part::Far => far.next(),
        };
        entry.map(|entry| (entry - first) as u32)
    })
}

/// sum += weight x.
#[inline(always)]
fn add_product<const L: usize, T: Copy + Into<f64>>(sum: &mut [f64; L], weight: f64, x: &[T; L]) {
    for lane in 0..L {
        sum[lane] += weight * x[lane].into();
    }
}

fn reach(pattern: &Pattern) -> Vec<[u32; 2]> {
    let strips = (0..pattern.rows()).step_by(STRIP).map(|first| first..(first + STRIP).min(pattern.rows()));
    let of_strip = |rows: Range<usize>| {
        let columns =
            &pattern.columns()[pattern.entries(rows.start).start..pattern.entries(rows.end - 1).end];
        let own = [rows.start as u32, rows.end as u32];
        columns.iter().fold(own, |[start, end], &column| [start.min(column), end.max(column + 1)])
    };
    strips.map(of_strip).collect()
}
