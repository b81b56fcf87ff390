//! Where everything of a network and of its coarse levels is, in words of the buffers that kernels read and write.
//!
//! Rows are stored in slices of 32: the first entries of all rows of a slice lie side by side, then the second ones, and so
//! on, so that threads side by side read words side by side. Rows that have fewer entries are filled up with entries to
//! themselves, which weigh nothing.

use bytemuck::{Pod, Zeroable};
use capsense_core::solver::{NO_AGGREGATE, NetworkProblem};

/// Rows of a slice.
pub(super) const SLICE: usize = 32;

/// More levels than these are not made; each has an eighth of the rows of the finer one, about.
pub(super) const MOST_LEVELS: usize = 12;

/// Where a level's parts are.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(super) struct Level {
    /// Number of rows.
    pub(super) rows: u32,
    /// In the maps: where the entries of each slice begin, and end.
    pub(super) slices: u32,
    /// In the maps: the row that each entry leads to.
    pub(super) columns: u32,
    /// In the maps: the aggregate of each row; on the coarsest level nothing.
    pub(super) aggregate: u32,
    /// In the maps: where the members of each row begin in the next list, on coarse levels; the list.
    pub(super) member_ends: u32,
    pub(super) members: u32,
    /// In the maps: where the finer entries begin that each entry is the sum of; the list.
    pub(super) part_ends: u32,
    pub(super) parts: u32,
    /// In the networks: weights between rows whose potential is unknown, those to all others, inverses of the diagonal.
    pub(super) weights: u32,
    pub(super) leak: u32,
    pub(super) inverse: u32,
    /// In the vectors: the right-hand side, the first sweep's result, the cycle's.
    pub(super) residual: u32,
    pub(super) swept: u32,
    pub(super) correction: u32,
    /// On coarse levels what the first sweep leaves.
    pub(super) left: u32,
    pub(super) padding: u32,
}

/// The plan of a network.
#[derive(Clone, Debug)]
pub(super) struct Plan {
    pub(super) columns: usize,
    pub(super) levels: Vec<Level>,
    /// Numbers that never change.
    pub(super) maps: Vec<u32>,
    pub(super) row_of_node: Vec<u32>,
    /// In the networks: weights of the finest level to all neighbours, and of links.
    pub(super) weights: u32,
    pub(super) links: u32,
    /// In the vectors.
    pub(super) potential: u32,
    pub(super) feed: u32,
    pub(super) image: u32,
    pub(super) steps: [u32; 2],
    pub(super) network_len: usize,
    pub(super) vectors_len: usize,
}

/// The rows of a level and what they lead to, and what is stored where.
struct Rows {
    around: Vec<Vec<u32>>,
    slices: Vec<u32>,
}

impl Rows {
    fn new(around: Vec<Vec<u32>>) -> Self {
        let mut slices = vec![0];
        for slice in around.chunks(SLICE) {
            let widest = slice.iter().map(Vec::len).max().unwrap_or(0);
            slices.push(slices[slices.len() - 1] + (SLICE * widest) as u32);
        }
        Self { around, slices }
    }

    fn entry(&self, row: usize, number: usize) -> usize {
        self.slices[row / SLICE] as usize + SLICE * number + row % SLICE
    }

    fn entries(&self) -> usize {
        self.slices[self.slices.len() - 1] as usize
    }

    fn columns(&self) -> Vec<u32> {
        let mut columns = Vec::with_capacity(self.entries());
        for (slice, ends) in self.slices.windows(2).enumerate() {
            let row = |lane: usize| (slice * SLICE + lane).min(self.around.len() - 1) as u32;
            columns.extend((0..(ends[1] - ends[0]) as usize).map(|entry| row(entry % SLICE)));
        }
        for (row, around) in self.around.iter().enumerate() {
            for (number, &other) in around.iter().enumerate() {
                columns[self.entry(row, number)] = other;
            }
        }
        columns
    }

    /// The rows of the aggregates, and for each of their entries the finer ones that it is the sum of.
    fn merged(&self, aggregate: &[u32], count: usize) -> (Self, Vec<Vec<u32>>) {
        let mut pairs = Vec::new();
        for (row, around) in self.around.iter().enumerate() {
            for (number, &other) in around.iter().enumerate() {
                let ends = [aggregate[row], aggregate[other as usize]];
                if ends[0] != ends[1] && !ends.contains(&NO_AGGREGATE) {
                    pairs.push((ends, self.entry(row, number) as u32));
                }
            }
        }
        pairs.sort_unstable();
        let mut around = vec![Vec::new(); count];
        for same in pairs.chunk_by(|a, b| a.0 == b.0) {
            around[same[0].0[0] as usize].push(same[0].0[1]);
        }
        let merged = Self::new(around);
        let mut parts = vec![Vec::new(); merged.entries()];
        let mut number = 0;
        let mut last = NO_AGGREGATE;
        for same in pairs.chunk_by(|a, b| a.0 == b.0) {
            let row = same[0].0[0];
            number = if row == last { number + 1 } else { 0 };
            last = row;
            parts[merged.entry(row as usize, number)] = same.iter().map(|&(_, entry)| entry).collect();
        }
        (merged, parts)
    }
}

/// Appends lists one after another: returns where their ends are, beginning with where the first begins, and where they are.
fn append(maps: &mut Vec<u32>, lists: &[Vec<u32>]) -> [u32; 2] {
    let ends_at = maps.len();
    let mut end = 0;
    maps.push(end);
    for list in lists {
        end += list.len() as u32;
        maps.push(end);
    }
    let at = maps.len();
    lists.iter().for_each(|list| maps.extend(list));
    [ends_at as u32, at as u32]
}

impl Plan {
    /// `None` where there is nothing to solve for, or numbers would not fit into words.
    pub(super) fn new(problem: &NetworkProblem) -> Option<Self> {
        let nodes = problem.nodes();
        let mut around = vec![Vec::new(); nodes];
        for node in 0..nodes {
            let neighbours = problem.neighbours(node).iter();
            around[problem.row_of_node[node] as usize] =
                neighbours.map(|&other| problem.row_of_node[other as usize]).collect();
        }
        let mut plan = Self {
            columns: problem.columns,
            levels: Vec::new(),
            maps: Vec::new(),
            row_of_node: problem.row_of_node.clone(),
            weights: 0,
            links: 0,
            potential: 0,
            feed: 0,
            image: 0,
            steps: [0; 2],
            network_len: 0,
            vectors_len: 0,
        };
        let mut rows = Rows::new(around);
        plan.weights = plan.reserve_numbers(rows.entries());
        plan.links = plan.reserve_numbers(nodes);
        plan.push_level(&rows, &[], &[]);
        // There always is a coarse level, be it one node.
        let one = vec![vec![0; nodes]];
        let aggregates = if problem.aggregates.is_empty() { &one } else { &problem.aggregates };
        for aggregate in aggregates.iter().take(MOST_LEVELS - 1) {
            let known = aggregate.iter().filter(|own| **own != NO_AGGREGATE);
            let count = known.max().map_or(0, |&most| most as usize + 1);
            let mut members = vec![Vec::new(); count];
            for (row, &own) in aggregate.iter().enumerate().filter(|(_, own)| **own != NO_AGGREGATE) {
                members[own as usize].push(row as u32);
            }
            let (coarse, parts) = rows.merged(aggregate, count);
            if let Some(finer) = plan.levels.last_mut() {
                finer.aggregate = plan.maps.len() as u32;
                plan.maps.extend(aggregate);
            }
            plan.push_level(&coarse, &members, &parts);
            rows = coarse;
        }
        let of_finest = nodes * plan.columns;
        [plan.potential, plan.feed, plan.image, plan.steps[0], plan.steps[1]] =
            [(); 5].map(|()| plan.reserve_values(of_finest));
        let largest = plan.maps.len().max(plan.network_len).max(plan.vectors_len);
        (nodes > 0 && plan.columns > 0 && u32::try_from(largest).is_ok()).then_some(plan)
    }

    fn push_level(&mut self, rows: &Rows, members: &[Vec<u32>], parts: &[Vec<u32>]) {
        let slices = self.maps.len() as u32;
        self.maps.extend(&rows.slices);
        let columns = self.maps.len() as u32;
        self.maps.extend(rows.columns());
        let [member_ends, members] = append(&mut self.maps, members);
        let [part_ends, parts] = append(&mut self.maps, parts);
        let count = rows.around.len();
        let level = Level {
            rows: count as u32,
            slices,
            columns,
            aggregate: 0,
            member_ends,
            members,
            part_ends,
            parts,
            weights: self.reserve_numbers(rows.entries()),
            leak: self.reserve_numbers(count),
            inverse: self.reserve_numbers(count),
            residual: self.reserve_values(count * self.columns),
            swept: self.reserve_values(count * self.columns),
            correction: self.reserve_values(count * self.columns),
            left: match self.levels.is_empty() {
                true => 0,
                false => self.reserve_values(count * self.columns),
            },
            padding: 0,
        };
        self.levels.push(level);
    }

    fn reserve_numbers(&mut self, count: usize) -> u32 {
        let at = self.network_len;
        self.network_len += count;
        at as u32
    }

    fn reserve_values(&mut self, count: usize) -> u32 {
        let at = self.vectors_len;
        self.vectors_len += count;
        at as u32
    }

    /// Number of nodes.
    pub(super) fn nodes(&self) -> usize {
        self.row_of_node.len()
    }

    /// Number of entries of a level, with those that fill slices up.
    pub(super) fn entry_count(&self, level: usize) -> u64 {
        let level = &self.levels[level];
        u64::from(self.maps[level.slices as usize + (level.rows as usize).div_ceil(SLICE)])
    }

    /// The entries of a row.
    #[cfg(test)]
    pub(super) fn entries(&self, level: &Level, row: usize) -> impl Iterator<Item = usize> + use<> {
        let slice = level.slices as usize + row / SLICE;
        let [first, end] = [self.maps[slice] as usize, self.maps[slice + 1] as usize];
        (first + row % SLICE..end).step_by(SLICE)
    }
}
