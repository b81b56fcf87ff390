//! The networks that the hierarchy is computed on: nodes in their natural order, x fastest.

use std::ops::Range;

/// A 7-point network in single precision. All arrays are padded by one plane at either end. Edges that would lead out of
/// the lattice have the weight zero, so nodes need not know whether they are at its end.
#[derive(Clone, Debug)]
pub(super) struct Network {
    /// Number of nodes along each axis.
    pub(super) counts: [usize; 3],
    pub(super) nodes: Vec<Node>,
}

/// What a node is coupled by.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Node {
    /// Weight to the next node along each axis.
    pub(super) next: [f32; 3],
    /// Weight to fixed potentials that are no nodes of this network; infinite where the node itself is fixed.
    pub(super) leak: f32,
}

impl Network {
    pub(super) fn new(counts: [usize; 3]) -> Self {
        Self { counts, nodes: vec![Node::default(); counts[0] * counts[1] * (counts[2] + 2)] }
    }

    /// Distance between neighbours along each axis.
    pub(super) fn strides(&self) -> [usize; 3] {
        [1, self.counts[0], self.counts[0] * self.counts[1]]
    }

    /// Place of a node.
    pub(super) fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        ((k + 1) * self.counts[1] + j) * self.counts[0] + i
    }

    /// Weight from a node to the next along an axis.
    pub(super) fn weight(&self, axis: usize, at: usize) -> f32 {
        self.nodes[at].next[axis]
    }

    /// Inverse of the diagonal; zero where the potential is fixed.
    pub(super) fn inverse(&self, at: usize) -> f32 {
        let strides = self.strides();
        let weights = (0..3).map(|axis| self.weight(axis, at) + self.weight(axis, at - strides[axis]));
        let diagonal = weights.sum::<f32>() + self.nodes[at].leak;
        if diagonal == 0.0 { 0.0 } else { 1.0 / diagonal }
    }

    pub(super) fn is_fixed(&self, at: usize) -> bool {
        self.nodes[at].leak == f32::INFINITY
    }
}

/// Nodes of a network that changed, as one interval in each row.
#[derive(Clone, Debug)]
pub(super) struct Changed {
    counts: [usize; 3],
    intervals: Vec<Range<u32>>,
    rows: Vec<u32>,
}

impl Changed {
    pub(super) fn nothing(counts: [usize; 3]) -> Self {
        Self { counts, intervals: vec![0..0; counts[1] * counts[2]], rows: Vec::new() }
    }

    pub(super) fn clear(&mut self) {
        for row in self.rows.drain(..) {
            self.intervals[row as usize] = 0..0;
        }
    }

    /// Adds some nodes of row (j, k); those outside the network are ignored.
    pub(super) fn add(&mut self, nodes: Range<usize>, j: usize, k: usize) {
        let [nx, ny, nz] = self.counts;
        let (start, end) = (nodes.start as u32, nodes.end.min(nx) as u32);
        if j >= ny || k >= nz || start >= end {
            return;
        }
        let row = k * ny + j;
        let interval = &mut self.intervals[row];
        if interval.start >= interval.end {
            self.rows.push(row as u32);
            *interval = start..end;
        } else {
            *interval = interval.start.min(start)..interval.end.max(end);
        }
    }

    /// Adds some nodes of the four rows beside row (j, k).
    pub(super) fn add_beside_row(&mut self, nodes: Range<usize>, j: usize, k: usize) {
        let (before_j, before_k) = (j.wrapping_sub(1), k.wrapping_sub(1));
        for (j, k) in [(j + 1, k), (before_j, k), (j, k + 1), (j, before_k)] {
            self.add(nodes.clone(), j, k);
        }
    }

    /// Visits the changed nodes of every row as an interval.
    pub(super) fn for_each_row(&self, mut visit: impl FnMut(Range<usize>, usize, usize)) {
        let ny = self.counts[1];
        for row in self.rows.iter().map(|&row| row as usize) {
            let Range { start, end } = self.intervals[row];
            visit(start as usize..end as usize, row % ny, row / ny);
        }
    }
}
