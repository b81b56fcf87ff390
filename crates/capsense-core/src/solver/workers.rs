//! Work on blocks of rows, on one thread or several, with the same result.

use rayon::ThreadPool;
use std::sync::Arc;

/// Number of rows that one task takes. Sums are made by task and added in the order of the rows.
pub(super) const TASK_ROWS: usize = 4096;

/// Fewer rows are not worth the threads.
const WORTHWHILE: usize = 20_000;

/// Does work that the compiler can vectorise with the widest instructions of this machine. Not one of them fuses or
/// reorders operations, so the result is the same on every machine. The work must be an `#[inline(always)]` closure.
#[inline(always)]
pub(super) fn vectorised<R>(work: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(work)
}

/// The threads that share the work; none when one is to do it all.
#[derive(Clone, Debug, Default)]
pub(super) struct Workers {
    pool: Option<Arc<ThreadPool>>,
}

impl Workers {
    /// So many threads for so many rows. Where they cannot be had, the calling thread does the work.
    pub(super) fn new(threads: usize, rows: usize) -> Self {
        let several = threads > 1 && rows >= WORTHWHILE;
        let pool = several.then(|| rayon::ThreadPoolBuilder::new().num_threads(threads).build().ok());
        Self { pool: pool.flatten().map(Arc::new) }
    }

    /// How many threads there are.
    pub(super) fn threads(&self) -> usize {
        self.pool.as_ref().map_or(1, |pool| pool.current_num_threads())
    }

    /// Does work that shares out much of itself on one of the threads, so that none must wait for them each time.
    pub(super) fn among<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        match &self.pool {
            None => work(),
            Some(pool) => pool.install(work),
        }
    }

    /// Does two things that do not depend on each other.
    pub(super) fn both(&self, first: impl FnOnce() + Send, second: impl FnOnce() + Send) {
        match &self.pool {
            None => {
                first();
                second();
            }
            Some(pool) => {
                pool.join(first, second);
            }
        }
    }

    /// Does the work for every task, which must not depend on each other.
    pub(super) fn for_each<T: Send>(
        &self,
        mut tasks: impl Iterator<Item = T> + Send,
        work: impl Fn(T) + Sync,
    ) {
        match &self.pool {
            None => tasks.for_each(work),
            Some(pool) => pool.scope(|scope| {
                let work = &work;
                let own = tasks.next();
                tasks.for_each(|task| scope.spawn(move |_| work(task)));
                own.into_iter().for_each(work);
            }),
        }
    }
}
