//! K in compressed rows, in the solver's own order of the nodes.

use super::ordering::reverse_cuthill_mckee;
use super::pattern::Pattern;
use crate::occupancy::IndexList;
use crate::stiffness::StiffnessMatrix;
use crate::workers::Workers;
use std::ops::Range;
use std::sync::Arc;

/// Rows that are evaluated together: what they take and give stays in the first cache.
pub(super) const STRIP: usize = 256;

/// The rows of all nodes: a Laplacian of weights, and its links to objects.
#[derive(Clone, Debug)]
pub(super) struct Rows {
    /// The row of each node.
    row_of_node: Vec<u32>,
    /// Parts of a row keep the order in which the matrix lists the neighbours.
    pattern: Arc<Pattern>,
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
            node_of_row[row as usize] = node;
        }
        let pattern = Pattern::new(nodes, |row, found| {
            found.extend(matrix.row(node_of_row[row]).map(|(other, _)| row_of_node[other]));
        });
        Self {
            row_of_node,
            weights: vec![0.0; pattern.columns().len()],
            reach: reach(&pattern),
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
        let Self { row_of_node, pattern, weights, diagonal, link_sums, .. } = self;
        let (is_fixed, links, rows) = (&mut self.fixed, &mut self.links, &mut self.changed);
        let (row_of_node, pattern) = (&*row_of_node, &**pattern);
        let take_rows = || {
            changed.for_each(|node| {
                let row = row_of_node[node] as usize;
                rows.insert(row);
                take_weights(
                    pattern,
                    weights,
                    row,
                    matrix.row(node).map(|(other, w)| (row_of_node[other], w)),
                );
                diagonal[row] = matrix.diagonal(node);
                link_sums[row] = matrix.link_weight(node);
                if std::mem::replace(&mut is_fixed[row], fixed[node]) != fixed[node] {
                    let around = &pattern.columns()[pattern.entries(row)];
                    around.iter().for_each(|&other| rows.insert(other as usize));
                }
            });
            rows.sort();
        };
        let take_links = || {
            links.clear();
            links.extend(matrix.links().zip(0..).map(|((node, object_row, weight), place)| RowLink {
                row: row_of_node[node],
                object_row: object_row as u32,
                weight,
                place,
            }));
            links.sort_unstable_by_key(|link| (link.row, link.place));
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

    /// Adds what the charges of a row and of its neighbours change by when its potential changes.
    #[inline(always)]
    pub(super) fn add_charges<const L: usize>(&self, row: usize, by: &[f64; L], charges: &mut [[f64; L]]) {
        let (columns, weights) = self.row(row);
        for (&column, &weight) in columns.iter().zip(weights) {
            add_product(&mut charges[column as usize], -weight, by);
        }
        add_product(&mut charges[row], self.diagonal[row], by);
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

/// Takes over the weights of a row to its neighbours, in the order of the matrix.
fn take_weights(
    pattern: &Pattern,
    weights: &mut [f64],
    row: usize,
    neighbours: impl Iterator<Item = (u32, f64)>,
) {
    let [mut lower, mut higher, mut far] = [pattern.lower(row), pattern.higher(row), pattern.far(row)];
    let block = pattern.block_of(row);
    neighbours.for_each(|(other, weight)| {
        let entry = match (block.contains(&(other as usize)), (other as usize) < row) {
            (false, _) => far.next(),
            (true, true) => lower.next(),
            (true, false) => higher.next(),
        };
        entry.into_iter().for_each(|entry| weights[entry] = weight);
    });
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
