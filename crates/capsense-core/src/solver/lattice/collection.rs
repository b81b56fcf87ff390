//! The rows of a coarse network that a change reached, shared out among threads: each is computed by one of them, from the
//! fine network and shares that stay as they are meanwhile.

use super::coarse_row::CoarseRow;
use super::coarsening::{Taken, take_over};
use super::layout::BLOCK;
use super::network::{Changed, Network, whole_blocks};
use super::stage::Stage;
use crate::instructions::EightLanes;
use crate::workers::Workers;
use pulp::{Simd, WithSimd};
use std::ops::Range;

/// So many rows keep a thread busy for longer than it takes to hand them over, also where threads have no cache in common.
const ROWS_OF_A_TASK: usize = 128;

/// Up to so many tasks for each thread, as some take longer and some threads come later.
pub(super) const TASKS_OF_A_THREAD: usize = 4;

/// What a stage makes of the fine network.
#[derive(Clone, Debug, Default)]
pub(super) struct Made {
    pub(super) coarse: Network,
    /// Where it changed last.
    pub(super) changed: Changed,
    /// Storage for each task; the first has what a single thread needs.
    pub(super) rooms: Vec<Room>,
}

/// Storage for one task.
#[derive(Clone, Debug, Default)]
pub(super) struct Room {
    pub(super) row: CoarseRow,
    /// What was taken over of which rows.
    taken: Vec<([u32; 2], Taken)>,
}

impl Room {
    pub(super) fn new(row: CoarseRow) -> Self {
        Self { row, taken: Vec::new() }
    }
}

/// Some successive rows of those reached, with the piece of the network that they are in.
struct Collection<'a> {
    stage: &'a Stage,
    fine: &'a Network,
    rows: Range<usize>,
    coarse: Piece<'a>,
    room: &'a mut Room,
}

/// A network from some place on.
struct Piece<'a> {
    start: usize,
    /// Weights to the next nodes along x, y and z, and leaks.
    numbers: [&'a mut [f32]; 4],
}

/// In how many tasks so many rows are computed, given how many there may be.
pub(super) fn tasks(rows: usize, most: usize) -> usize {
    (rows / ROWS_OF_A_TASK).clamp(1, most)
}

impl Made {
    /// Gives back the room that the first refresh took.
    pub(super) fn settle(&mut self) {
        self.changed.release();
        self.rooms.iter_mut().for_each(|room| room.taken.shrink_to_fit());
    }

    /// Computes all rows that a stage has reached and takes them over where they are not nearly as they were.
    pub(super) fn collect(&mut self, workers: &Workers, arch: EightLanes, stage: &Stage, fine: &Network) {
        let Self { coarse, changed, rooms } = self;
        changed.clear();
        let count = stage.reached.rows();
        let tasks = tasks(count, rooms.len());
        // Rows are in the order of memory where there are several tasks.
        let end = |rows: &Range<usize>| {
            let (_, j, k) = (rows.end < count).then(|| stage.reached.row(rows.end))?;
            Some(stage.place_in_coarse([0, j, k]))
        };
        let rows = (0..tasks).map(|task| count * task / tasks..count * (task + 1) / tasks);
        let [x, y, z] = &mut coarse.next;
        let mut rest = Piece { start: 0, numbers: [x, y, z, &mut coarse.leak] };
        let collections = rows.zip(&mut *rooms).map(|(rows, room)| {
            let coarse = rest.split_off(end(&rows));
            Collection { stage, fine, rows, coarse, room }
        });
        workers.for_each(collections, |collection| arch.dispatch(collection));
        for ([j, k], taken) in rooms.iter_mut().flat_map(|room| room.taken.drain(..)) {
            // A weight is as much the next node's.
            let (Taken { nodes, next: [along_x, along_y, along_z] }, [j, k]) =
                (taken, [j as usize, k as usize]);
            let nodes = nodes.start as usize..nodes.end as usize;
            changed.add(nodes.start..nodes.end + usize::from(along_x), j, k);
            if along_y {
                changed.add(nodes.clone(), j + 1, k);
            }
            if along_z {
                changed.add(nodes, j, k + 1);
            }
        }
    }
}

impl<'a> Piece<'a> {
    /// What is before a place; this piece then starts there. All of it where there is no such place.
    fn split_off(&mut self, end: Option<usize>) -> Self {
        let n = end.map_or(self.numbers[3].len(), |end| end - self.start);
        let numbers = self.numbers.each_mut().map(|numbers| {
            let (piece, rest) = std::mem::take(numbers).split_at_mut(n);
            *numbers = rest;
            piece
        });
        let start = self.start;
        self.start += n;
        Self { start, numbers }
    }
}

impl WithSimd for Collection<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        for row in self.rows.clone() {
            let (nodes, j, k) = self.stage.reached.row(row);
            let nodes = whole_blocks(&nodes);
            let (stage, room, fine) = (self.stage, &mut self.room.row, self.fine);
            match stage.axis {
                0 => stage.collect_picked(simd, room, fine, &nodes, j, k),
                1 => stage.collect_rows::<S, 1>(simd, room, fine, &nodes, j, k),
                _ => stage.collect_rows::<S, 2>(simd, room, fine, &nodes, j, k),
            }
            self.take_over(simd, &nodes, j, k);
        }
    }
}

impl Collection<'_> {
    /// Takes over row (j, k) where it is not nearly as it was, and notes that.
    #[inline(always)]
    fn take_over<S: Simd>(&mut self, simd: S, nodes: &Range<usize>, j: usize, k: usize) {
        let place = self.stage.place_in_coarse([nodes.start, j, k]) - self.coarse.start;
        let (n, first) = (nodes.len(), BLOCK + nodes.start);
        let here = first..first + n;
        let [x, y, z, leak] = &mut self.coarse.numbers;
        let stored = [
            &mut x[place..place + n],
            &mut y[place..place + n],
            &mut z[place..place + n],
            &mut leak[place..place + n],
        ];
        let CoarseRow { next: [x, y, z], leak, .. } = &self.room.row;
        let new = [&x[here.clone()], &y[here.clone()], &z[here.clone()], &leak[here]];
        if let Some(taken) = take_over(simd, nodes.start, stored, new) {
            self.room.taken.push(([j as u32, k as u32], taken));
        }
    }
}
