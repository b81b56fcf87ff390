//! K in compressed rows, in the solver's own order of the nodes.

use super::ordering::reverse_cuthill_mckee;
use crate::stiffness::StiffnessMatrix;
use std::ops::Range;

/// Rows are filled up to a multiple of this with weights of zero to themselves: loops of few different lengths are
/// foreseen by the processor.
const STRIDE: usize = 4;

/// The rows of all nodes: a Laplacian of weights, and its links to objects.
#[derive(Clone, Debug)]
pub(super) struct Rows {
    /// The row of each node.
    row_of_node: Vec<u32>,
    offsets: Vec<u32>,
    /// The neighbours of each row, in the order in which the matrix lists them, and the weights to them.
    columns: Vec<u32>,
    weights: Vec<f64>,
    diagonal: Vec<f64>,
    /// Sum of the weights of each row's links.
    link_sums: Vec<f64>,
    fixed: Vec<bool>,
    /// Ordered by row.
    links: Vec<RowLink>,
    /// Rows that the last refresh touched.
    changed: Vec<u32>,
    marked: Vec<bool>,
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
        let (mut offsets, mut columns) = (vec![0], Vec::new());
        for (row, node) in node_of_row.into_iter().enumerate() {
            columns.extend(matrix.row(node).map(|(other, _)| row_of_node[other]));
            columns.resize(columns.len().next_multiple_of(STRIDE), row as u32);
            offsets.push(columns.len() as u32);
        }
        Self {
            row_of_node,
            offsets,
            weights: vec![0.0; columns.len()],
            columns,
            diagonal: vec![0.0; nodes],
            link_sums: vec![0.0; nodes],
            fixed: vec![false; nodes],
            links: Vec::new(),
            changed: Vec::new(),
            marked: vec![false; nodes],
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
    ) {
        for row in self.changed.drain(..) {
            self.marked[row as usize] = false;
        }
        for node in changed.map(|node| node as usize).filter(|&node| node < matrix.nodes()) {
            let row = self.row_of_node[node] as usize;
            self.mark(row);
            let weights = &mut self.weights[self.offsets[row] as usize..];
            weights.iter_mut().zip(matrix.row(node)).for_each(|(weight, (_, new))| *weight = new);
            self.diagonal[row] = matrix.diagonal(node);
            self.link_sums[row] = matrix.link_weight(node);
            if std::mem::replace(&mut self.fixed[row], fixed[node]) != fixed[node] {
                for entry in self.entries(row) {
                    self.mark(self.columns[entry] as usize);
                }
            }
        }
        self.changed.sort_unstable();
        if !self.changed.is_empty() {
            self.links.clear();
            self.links.extend(matrix.links().zip(0..).map(|((node, object_row, weight), place)| RowLink {
                row: self.row_of_node[node],
                object_row: object_row as u32,
                weight,
                place,
            }));
            self.links.sort_unstable_by_key(|link| (link.row, link.place));
        }
    }

    fn mark(&mut self, row: usize) {
        if !std::mem::replace(&mut self.marked[row], true) {
            self.changed.push(row as u32);
        }
    }

    /// Rows whose values or state, or whose neighbours' state, the last refresh changed.
    pub(super) fn changed(&self) -> &[u32] {
        &self.changed
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

    /// Where the neighbours of a row are.
    #[inline(always)]
    pub(super) fn entries(&self, row: usize) -> Range<usize> {
        self.offsets[row] as usize..self.offsets[row + 1] as usize
    }

    /// The neighbours of a row and the weights to them.
    #[inline(always)]
    pub(super) fn row(&self, row: usize) -> (&[u32], &[f64]) {
        let entries = self.entries(row);
        (&self.columns[entries.clone()], &self.weights[entries])
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

    /// (K x) at one row without its links to objects other than at 0 V.
    #[inline(always)]
    pub(super) fn product<const L: usize, T: Copy + Into<f64>>(&self, row: usize, x: &[[T; L]]) -> [f64; L] {
        let (columns, weights) = self.row(row);
        // Two sums, so that one does not wait for the other.
        let mut outward = [[0.0; L]; 2];
        for (columns, weights) in columns.as_chunks::<STRIDE>().0.iter().zip(weights.as_chunks::<STRIDE>().0)
        {
            for entry in 0..STRIDE {
                let x = &x[columns[entry] as usize];
                for lane in 0..L {
                    outward[entry % 2][lane] += weights[entry] * x[lane].into();
                }
            }
        }
        let (x, diagonal) = (&x[row], self.diagonal[row]);
        std::array::from_fn(|lane| diagonal * x[lane].into() - (outward[0][lane] + outward[1][lane]))
    }
}
