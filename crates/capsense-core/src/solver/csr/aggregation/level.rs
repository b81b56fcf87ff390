//! One level of the aggregation hierarchy: a network of any shape in single precision, and Gauss-Seidel on it.
//!
//! Every edge is stored once, with the higher of its rows. A sweep reads it once, too: at the higher row, what the lower
//! rows bring is gathered, the row is relaxed, and what that adds to the residuals of the lower rows is handed back.
//!
//! Rows form blocks of a fixed size which do not see what a sweep does in others, so that threads can share them without
//! changing a bit of the result.

use super::krylov::Krylov;
use crate::solver::workers::{Workers, vectorised};
use std::ops::Range;

/// Rows that are swept one after another.
pub(super) const BLOCK: usize = 16_384;

/// No aggregate, or no edge.
pub(super) const NONE: u32 = u32::MAX;

/// The network, with fixed nodes eliminated: their weights are leaks of their neighbours.
#[derive(Clone, Debug)]
pub(super) struct Level {
    /// Where the edges of each row to lower ones start: first those to rows of its own block.
    offsets: Vec<u32>,
    /// Where those to other blocks start.
    far: Vec<u32>,
    pub(super) edges: Vec<Edge>,
    /// Edges to higher rows in other blocks.
    higher_offsets: Vec<u32>,
    higher: Vec<Higher>,
    /// Weight to everything at a fixed potential.
    pub(super) leak: Vec<f32>,
    diagonal: Vec<f32>,
    /// Inverse of the diagonal; zero where the potential is fixed.
    pub(super) inverse: Vec<f32>,
}

/// A weight and the lower of the two rows it lies between.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edge {
    pub(super) row: u32,
    pub(super) weight: f32,
}

/// A row and the edge to it.
#[derive(Clone, Copy, Debug)]
struct Higher {
    row: u32,
    edge: u32,
}

/// Correction and residual of one row, side by side because they are used together.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node<const L: usize> {
    pub(super) x: [f32; L],
    pub(super) r: [f32; L],
}

/// The vectors of one level.
#[derive(Clone, Debug)]
pub(super) struct Vectors<const L: usize> {
    pub(super) nodes: Vec<Node<L>>,
    /// The right-hand side, in the end the solution.
    pub(super) b: Vec<[f32; L]>,
    /// On levels that are visited twice.
    pub(super) krylov: Option<Box<Krylov<L>>>,
}

impl<const L: usize> Vectors<L> {
    pub(super) fn new(rows: usize, twice: bool) -> Self {
        Self {
            nodes: vec![Node { x: [0.0; L], r: [0.0; L] }; rows],
            b: vec![[0.0; L]; rows],
            krylov: twice.then(|| Box::new(Krylov::new(rows))),
        }
    }
}

impl Level {
    /// A network whose weights still are zero. `lower` visits the lower neighbours of a row.
    pub(super) fn new(rows: usize, lower: impl Fn(usize, &mut Vec<u32>)) -> Self {
        let (mut offsets, mut far, mut edges) = (vec![0], Vec::new(), Vec::new());
        let mut crossing = Vec::new();
        let mut around = Vec::new();
        for row in 0..rows {
            around.clear();
            lower(row, &mut around);
            let block = (row / BLOCK * BLOCK) as u32;
            let mut push = |other: u32| edges.push(Edge { row: other, weight: 0.0 });
            around.iter().filter(|&&other| other >= block).for_each(|&other| push(other));
            around.iter().filter(|&&other| other < block).for_each(|&other| push(other));
            let first_far = offsets[row] + around.iter().filter(|&&other| other >= block).count() as u32;
            far.push(first_far);
            offsets.push(edges.len() as u32);
            crossing
                .extend((first_far..edges.len() as u32).map(|edge| (edges[edge as usize].row, edge, row)));
        }
        crossing.sort_unstable();
        let before = |row: usize| crossing.partition_point(|crossing| (crossing.0 as usize) < row) as u32;
        Self {
            higher_offsets: (0..=rows).map(before).collect(),
            higher: crossing.iter().map(|&(_, edge, row)| Higher { row: row as u32, edge }).collect(),
            offsets,
            far,
            edges,
            leak: vec![0.0; rows],
            diagonal: vec![0.0; rows],
            inverse: vec![0.0; rows],
        }
    }

    /// Sets the diagonal of a row; zero where nothing is unknown.
    pub(super) fn set_diagonal(&mut self, row: usize, diagonal: f64) {
        self.diagonal[row] = diagonal as f32;
        self.inverse[row] = if diagonal > 0.0 { (1.0 / diagonal) as f32 } else { 0.0 };
    }

    pub(super) fn rows(&self) -> usize {
        self.inverse.len()
    }

    /// The edges of a row to lower ones.
    #[inline(always)]
    pub(super) fn lower(&self, row: usize) -> Range<usize> {
        self.offsets[row] as usize..self.offsets[row + 1] as usize
    }

    /// Those within its block.
    #[inline(always)]
    fn near(&self, row: usize) -> &[Edge] {
        &self.edges[self.offsets[row] as usize..self.far[row] as usize]
    }

    /// x = one forward sweep on K x = b from zero, and r = b - K x after it but for what other blocks add.
    pub(super) fn sweep_forward<const L: usize>(
        &self,
        Vectors { nodes, b, .. }: &mut Vectors<L>,
        workers: &Workers,
        right_hand_side: impl Fn(usize) -> Option<[f32; L]> + Sync,
    ) {
        let tasks = nodes.chunks_mut(BLOCK).zip(b.chunks_mut(BLOCK)).zip((0..).step_by(BLOCK));
        workers.for_each(tasks, |((nodes, b), first)| {
            vectorised(
                #[inline(always)]
                || {
                    for at in 0..nodes.len() {
                        if let Some(new) = right_hand_side(first + at) {
                            b[at] = new;
                        }
                        let (near, inverse) = (self.near(first + at), self.inverse[first + at]);
                        let x = relaxed(near, first, nodes, b[at], inverse);
                        scatter(near, first, nodes, &x);
                        nodes[at] = Node { x, r: [0.0; L] };
                    }
                },
            );
        });
    }

    /// b = one backward sweep on K x = b from the given x; r must be zero. `visit` sees every row of the solution.
    pub(super) fn sweep_backward<const L: usize, S: Send>(
        &self,
        Vectors { nodes, b, .. }: &mut Vectors<L>,
        workers: &Workers,
        sums: &mut [S],
        visit: impl Fn(&mut S, usize, &[f32; L]) + Sync,
    ) {
        if !self.higher.is_empty() {
            self.add_far(nodes, b, workers);
        }
        let tasks = nodes.chunks_mut(BLOCK).zip(b.chunks_mut(BLOCK)).zip((0..).step_by(BLOCK)).zip(sums);
        workers.for_each(tasks, |(((nodes, b), first), sum)| {
            vectorised(
                #[inline(always)]
                || {
                    for at in (0..nodes.len()).rev() {
                        let (near, inverse) = (self.near(first + at), self.inverse[first + at]);
                        let from_higher = nodes[at].r;
                        let b_here: [f32; L] = std::array::from_fn(|lane| b[at][lane] + from_higher[lane]);
                        let x = relaxed(near, first, nodes, b_here, inverse);
                        scatter(near, first, nodes, &x);
                        b[at] = x;
                        visit(sum, first + at, &x);
                    }
                },
            );
        });
    }

    /// y = K x.
    #[inline(always)]
    pub(super) fn product<const L: usize>(&self, x: &[[f32; L]], y: &mut [[f32; L]]) {
        for row in 0..self.rows() {
            let here = x[row];
            let diagonal = self.diagonal[row];
            let mut sum = here.map(|x| diagonal * x);
            for edge in &self.edges[self.lower(row)] {
                let (x, y) = (&x[edge.row as usize], &mut y[edge.row as usize]);
                for lane in 0..L {
                    sum[lane] -= edge.weight * x[lane];
                    y[lane] -= edge.weight * here[lane];
                }
            }
            y[row] = sum;
        }
    }

    /// Adds to b what the rows of other blocks bring.
    fn add_far<const L: usize>(&self, nodes: &[Node<L>], b: &mut [[f32; L]], workers: &Workers) {
        workers.for_each(b.chunks_mut(BLOCK).zip((0..).step_by(BLOCK)), |(b, first)| {
            vectorised(
                #[inline(always)]
                || {
                    for (b, row) in b.iter_mut().zip(first..) {
                        self.gather_far(row, nodes, b);
                    }
                },
            );
        });
    }

    /// sum += Σ w x over the neighbours of a row in other blocks.
    #[inline(always)]
    pub(super) fn gather_far<const L: usize>(&self, row: usize, nodes: &[Node<L>], sum: &mut [f32; L]) {
        let far = self.far[row] as usize..self.offsets[row + 1] as usize;
        gather(&self.edges[far], 0, nodes, sum);
        let higher = self.higher_offsets[row] as usize..self.higher_offsets[row + 1] as usize;
        for higher in &self.higher[higher] {
            let (x, weight) = (&nodes[higher.row as usize].x, self.edges[higher.edge as usize].weight);
            for lane in 0..L {
                sum[lane] += weight * x[lane];
            }
        }
    }
}

/// (b + Σ w x) / d.
#[inline(always)]
fn relaxed<const L: usize>(
    near: &[Edge],
    first: usize,
    nodes: &[Node<L>],
    mut b: [f32; L],
    inverse: f32,
) -> [f32; L] {
    gather(near, first, nodes, &mut b);
    b.map(|sum| inverse * sum)
}

#[inline(always)]
fn gather<const L: usize>(edges: &[Edge], first: usize, nodes: &[Node<L>], sum: &mut [f32; L]) {
    // Two sums, so that one does not wait for the other.
    let mut other = [0.0; L];
    let (pairs, last) = edges.as_chunks::<2>();
    for [a, b] in pairs {
        let (xa, xb) = (&nodes[a.row as usize - first].x, &nodes[b.row as usize - first].x);
        for lane in 0..L {
            sum[lane] += a.weight * xa[lane];
            other[lane] += b.weight * xb[lane];
        }
    }
    for edge in last {
        let x = &nodes[edge.row as usize - first].x;
        for lane in 0..L {
            sum[lane] += edge.weight * x[lane];
        }
    }
    for lane in 0..L {
        sum[lane] += other[lane];
    }
}

#[inline(always)]
fn scatter<const L: usize>(edges: &[Edge], first: usize, nodes: &mut [Node<L>], x: &[f32; L]) {
    for edge in edges {
        let r = &mut nodes[edge.row as usize - first].r;
        for lane in 0..L {
            r[lane] += edge.weight * x[lane];
        }
    }
}
