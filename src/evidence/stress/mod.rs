//! Where methods fail: each interface model with each solver and precision, under what breaks them.
//!
//! [`Map::measure`] runs everything; the same machine code gives the same numbers every time, as no clock is read. A result is
//! compared with a sparse factorisation of the same equations, which tells what the solver makes wrong, and, where it is the
//! interface model that is stressed, with a lattice of 100,000 tetrahedra with planes in the faces of bodies, which tells what
//! mesh and model make wrong.

mod cell;
mod drawing;
mod ladder;
mod measure;
mod meshes;
mod method;
mod scenario;
mod table;

pub use cell::{ALLOWED, Cell, MODEL, Measured, Outcome, SLOW, Status};
pub use drawing::DrawingError;
pub use ladder::{Afloat, Parts, Stress};
pub use method::{Method, Solver};
pub use table::{TableError, Worse};

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What became of all methods under all stresses: columns in the order of [`Stress::all`], each in that of [`Method::all`].
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// The fields, column by column.
    pub cells: Vec<Cell>,
}

impl Map {
    /// Measures all columns on so many threads. `keep_going` is asked before each field with the number of columns that are
    /// done; once it says no, the columns that are complete are all there is.
    pub fn measure(threads: usize, keep_going: impl Fn(usize) -> bool + Sync) -> Self {
        let stresses = Stress::all();
        let rows = Method::all().len();
        let columns: Mutex<Vec<Vec<Cell>>> = Mutex::new(vec![Vec::new(); stresses.len()]);
        let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let work = || {
            let going = || keep_going(done.load(Ordering::Relaxed));
            while let Some(&stress) = stresses.get(next.fetch_add(1, Ordering::Relaxed))
                && going()
            {
                let column = measure::column(stress, going);
                if column.len() == rows
                    && let Some(index) = stresses.iter().position(|other| *other == stress)
                    && let Ok(mut columns) = columns.lock()
                {
                    columns[index] = column;
                }
                done.fetch_add(1, Ordering::Relaxed);
            }
        };
        std::thread::scope(|scope| {
            for _ in 1..threads.max(1) {
                scope.spawn(work);
            }
            work();
        });
        let columns = columns.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
        Self { cells: columns.into_iter().flatten().collect() }
    }
}
