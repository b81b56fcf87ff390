//! What the host keeps of a network, and the words that tell kernels what changed in it.
//!
//! A row's couplings depend on whether its neighbours are held, so rows are told again, too, of which only a neighbour was
//! taken or released.

use capsense_core::solver::{Changes, NO_HOLDER, NetworkProblem};
use std::collections::HashSet;

/// Words before all others.
pub(super) const HEADER: usize = 8;

/// Words of a row, without its weights: row, holder, weight of its links, weight to held neighbours, where its weights stand
/// and how many these are.
pub(super) const ROW: usize = 6;

/// Words of a feed: row, column, charge.
pub(super) const FEED: usize = 3;

/// Neighbours in a word that tells which of them are held.
const BITS: usize = 32;

/// The network as it was told last.
#[derive(Clone, Debug)]
pub(super) struct Network {
    problem: NetworkProblem,
    weights: Vec<f32>,
    leaks: Vec<f32>,
    holders: Vec<u32>,
    /// Nodes that kernels are to be told of.
    changed: Vec<u32>,
    is_changed: Vec<bool>,
    feeds: Vec<[u32; FEED]>,
    emptied: u32,
}

/// What a solve is asked for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Asked<'a> {
    /// How far the energy of each column may be from the least.
    pub(super) allowed: &'a [f32],
    pub(super) most_iterations: u32,
}

impl Network {
    /// All weights are zero, nothing is held.
    pub(super) fn new(problem: NetworkProblem) -> Self {
        let nodes = problem.nodes();
        Self {
            weights: vec![0.0; problem.neighbours.len()],
            leaks: vec![0.0; nodes],
            holders: vec![NO_HOLDER; nodes],
            changed: Vec::new(),
            is_changed: vec![false; nodes],
            feeds: Vec::new(),
            emptied: 0,
            problem,
        }
    }

    /// Takes over what changed; `false` where these are changes of another mesh.
    #[must_use]
    pub(super) fn take(&mut self, changes: &Changes<'_>) -> bool {
        let mut weights = changes.network.weights;
        for row in changes.network.rows {
            let node = row.node as usize;
            if node >= self.holders.len() {
                return false;
            }
            let range = self.problem.offsets[node] as usize..self.problem.offsets[node + 1] as usize;
            let Some((own, rest)) = weights.split_at_checked(range.len()) else { return false };
            self.weights[range].copy_from_slice(own);
            weights = rest;
            self.leaks[node] = row.leak;
            self.mark(row.node);
            let before = std::mem::replace(&mut self.holders[node], row.holder);
            if (before == NO_HOLDER) != (row.holder == NO_HOLDER) {
                for at in self.problem.offsets[node]..self.problem.offsets[node + 1] {
                    self.mark(self.problem.neighbours[at as usize]);
                }
            }
        }
        let row_of = |node: u32| self.problem.row_of_node[node as usize];
        // Later feeds replace earlier ones, as kernels take them in no order.
        if !(self.feeds.is_empty() || changes.feeds.is_empty()) {
            let new: HashSet<_> = changes.feeds.iter().map(|feed| [row_of(feed.node), feed.column]).collect();
            self.feeds.retain(|known| !new.contains(&[known[0], known[1]]));
        }
        let told = changes.feeds.iter().map(|feed| [row_of(feed.node), feed.column, feed.charge.to_bits()]);
        self.feeds.extend(told);
        for &column in changes.emptied {
            self.emptied |= 1 << column;
        }
        weights.is_empty() && changes.rows.is_empty()
    }

    fn mark(&mut self, node: u32) {
        if !std::mem::replace(&mut self.is_changed[node as usize], true) {
            self.changed.push(node);
        }
    }

    /// Writes all that kernels do not know yet, and forgets it. Returns the number of rows or feeds, whichever is larger, and
    /// whether columns are to start from zero.
    pub(super) fn tell(&mut self, asked: Asked<'_>, words: &mut Vec<u32>) -> (usize, bool) {
        words.clear();
        words.resize(HEADER, 0);
        words.extend(asked.allowed.iter().map(|allowed| allowed.to_bits()));
        let rows_at = words.len();
        words.resize(rows_at + ROW * self.changed.len(), 0);
        for (number, &node) in self.changed.iter().enumerate() {
            self.is_changed[node as usize] = false;
            let at = words.len() as u32;
            let (held, count) = self.tell_weights(node as usize, words);
            let row = self.problem.row_of_node[node as usize];
            let (holder, leak) = (self.holders[node as usize], self.leaks[node as usize]);
            words[rows_at + ROW * number..][..ROW].copy_from_slice(&[
                row,
                holder,
                leak.to_bits(),
                held.to_bits(),
                at,
                count,
            ]);
        }
        let feeds_at = words.len();
        words.extend(self.feeds.as_flattened());
        let counts = [rows_at, self.changed.len(), feeds_at, self.feeds.len()].map(|count| count as u32);
        words[..4].copy_from_slice(&counts);
        words[4..7].copy_from_slice(&[self.emptied, 1, asked.most_iterations]);
        let told = (self.changed.len().max(self.feeds.len()), self.emptied != 0);
        self.changed.clear();
        self.feeds.clear();
        self.emptied = 0;
        told
    }

    /// The weights of a node and which of its neighbours are held. Returns the sum of the weights to those, and the number of
    /// all.
    fn tell_weights(&self, node: usize, words: &mut Vec<u32>) -> (f32, u32) {
        let range = self.problem.offsets[node] as usize..self.problem.offsets[node + 1] as usize;
        let (weights, neighbours) = (&self.weights[range.clone()], &self.problem.neighbours[range]);
        words.extend(weights.iter().map(|weight| weight.to_bits()));
        let is_held = |other: &u32| self.holders[*other as usize] != NO_HOLDER;
        let mut held = 0.0;
        for (neighbours, weights) in neighbours.chunks(BITS).zip(weights.chunks(BITS)) {
            let mut bits = 0;
            for (bit, _) in neighbours.iter().enumerate().filter(|(_, other)| is_held(other)) {
                bits |= 1 << bit;
                held += f64::from(weights[bit]);
            }
            words.push(bits);
        }
        (held as f32, weights.len() as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use capsense_core::solver::{HELD_AT_ZERO, NetworkRow, NetworkRows};

    fn of<'a>(rows: &'a [NetworkRow], weights: &'a [f32]) -> Changes<'a> {
        Changes { network: NetworkRows { rows, weights }, ..Changes::default() }
    }

    /// A chain of three nodes, stored from its end, of which the first is held in the end: its neighbour is told of, too, and which
    /// of its own neighbours that is; the third is not.
    #[test]
    fn neighbours_of_what_is_taken_are_told_of() {
        let mut network = Network::new(NetworkProblem {
            offsets: vec![0, 1, 3, 4],
            neighbours: vec![1, 2, 0, 1],
            row_of_node: vec![2, 1, 0],
            aggregates: Vec::new(),
            columns: 1,
        });
        let row = |node, holder| NetworkRow { node, leak: 0.5, holder };
        let all = [0, 1, 2].map(|node| row(node, NO_HOLDER));
        let asked = Asked { allowed: &[1e-3], most_iterations: 7 };
        let mut words = Vec::new();
        assert!(network.take(&of(&all, &[3.0, 4.0, 3.0, 4.0])));
        assert_eq!(network.tell(asked, &mut words), (3, false));
        assert!(network.take(&of(&[row(0, HELD_AT_ZERO)], &[3.0])));
        assert_eq!(network.tell(asked, &mut words), (2, false));
        let at = HEADER + 1;
        assert_eq!(words[..7], [at as u32, 2, words.len() as u32, 0, 0, 1, 7]);
        let [of_first, of_second] = [0, 1].map(|record| &words[at + ROW * record..][..ROW]);
        assert_eq!(of_first[..2], [2, HELD_AT_ZERO]);
        assert_eq!(of_second[..4], [1, NO_HOLDER, 0.5_f32.to_bits(), 3.0_f32.to_bits()]);
        assert_eq!(words[of_second[4] as usize..][..3], [4.0_f32.to_bits(), 3.0_f32.to_bits(), 0b10]);
        // Nothing is told twice, and rows of another mesh are refused.
        assert_eq!(network.tell(asked, &mut words), (0, false));
        assert!(!network.take(&of(&[row(1, NO_HOLDER)], &[3.0])) && !network.take(&of(&[row(3, 0)], &[3.0])));
    }
}
