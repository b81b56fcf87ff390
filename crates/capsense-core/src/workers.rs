//! Work on blocks of rows, on one thread or several, with the same result.
//!
//! A frame has many short phases that threads share, shorter than a sleeping thread takes to wake. So the helpers of the
//! calling thread are woken once, when a frame begins, and look for work without sleeping until it ends. Nobody waits for
//! one that is not awake yet, or whose core something else has just taken: what it would do, the calling thread does.

use arrayvec::ArrayVec;
use rayon::{ThreadPool, Yield};
use std::cell::Cell;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Number of rows that one task takes. Sums are made by task and added in the order of the rows.
pub(crate) const TASK_ROWS: usize = 4096;

/// Fewer rows are not worth the threads.
const WORTHWHILE: usize = 20_000;

/// After so many looks in vain, a tenth of a millisecond or so, a thread offers its core to others. Not earlier, as it may
/// not get it back before it is needed.
const LOOKS: usize = 4096;

/// So many looks after a frame, a helper goes to sleep: what follows a frame at once, as a solve does an update, finds it
/// awake.
const LOOKS_BEFORE_SLEEP: usize = 1024;

/// So often, for a microsecond or so, the calling thread looks whether helpers that should look for work do. One that was
/// given a task while it has no core would hold up the frame.
const LOOKS_AT_HELPERS: usize = 32;

/// Of so many tasks the next ones are known, to be taken from both ends.
const KNOWN_TASKS: usize = 128;

/// The threads that share the work; none when one is to do it all.
#[derive(Clone, Debug, Default)]
pub(crate) struct Workers {
    team: Option<Arc<Team>>,
}

/// The threads beside the calling one.
#[derive(Debug)]
struct Team {
    pool: ThreadPool,
    attendance: Arc<Attendance>,
}

/// Who needs helpers, and which of them are there.
#[derive(Debug)]
struct Attendance {
    /// How many have asked for helpers and still want them.
    callers: AtomicUsize,
    /// For each helper, whether it looks for work or does some.
    is_awake: Vec<AtomicBool>,
    /// How many helpers are awake and have nothing to do.
    idle: AtomicUsize,
    /// Counts up as these look for work.
    looks: AtomicUsize,
}

/// Keeps the helpers awake as long as it lives.
#[must_use]
#[derive(Debug)]
pub(crate) struct Awake(Option<Arc<Team>>);

impl Workers {
    /// So many threads for so many rows. Where they cannot be had, the calling thread does the work.
    pub(crate) fn new(threads: usize, rows: usize) -> Self {
        let helpers = if rows >= WORTHWHILE { threads.saturating_sub(1) } else { 0 };
        let pool = (helpers > 0)
            .then(|| rayon::ThreadPoolBuilder::new().num_threads(helpers).build().ok())
            .flatten();
        let team = |pool| Team { pool, attendance: Arc::new(Attendance::of(helpers)) };
        Self { team: pool.map(|pool| Arc::new(team(pool))) }
    }

    /// How many threads there are, the calling one included.
    pub(crate) fn threads(&self) -> usize {
        self.team.as_ref().map_or(1, |team| 1 + team.pool.current_num_threads())
    }

    /// Into how many tasks work is cut, so many for each thread; one where a single thread does it all.
    pub(crate) fn tasks(&self, of_thread: usize) -> usize {
        if self.threads() == 1 { 1 } else { self.threads() * of_thread }
    }

    /// Wakes the helpers, without waiting for them.
    pub(crate) fn wake(&self) -> Awake {
        if let Some(Team { pool, attendance }) = self.team.as_deref()
            && attendance.callers.fetch_add(1, Ordering::SeqCst) == 0
            && !attendance.is_awake.iter().all(|awake| awake.load(Ordering::SeqCst))
        {
            let attendance = attendance.clone();
            pool.spawn_broadcast(move |helper| attendance.attend(helper.index()));
        }
        Awake(self.team.clone())
    }

    /// Does two things that do not depend on each other. The calling thread does the first, which may share out its work.
    pub(crate) fn both(&self, first: impl FnOnce(), second: impl FnOnce() + Send) {
        match self.team.as_deref().filter(|team| team.claim(1) == 1) {
            None => {
                first();
                second();
            }
            Some(team) => {
                let second = Mutex::new(Some(second));
                let take = || second.lock().unwrap_or_else(PoisonError::into_inner).take();
                team.share(1, first, || take().into_iter().for_each(|second| second()));
            }
        }
    }

    /// Does something and the work for every task, none of which must depend on another. The calling thread does the one thing, then
    /// tasks from the first on; helpers do tasks from the last on meanwhile.
    pub(crate) fn beside<T: Send>(
        &self,
        first: impl FnOnce(),
        tasks: impl Iterator<Item = T> + Send,
        work: impl Fn(T) + Sync,
    ) {
        let claimed = self.team.as_deref().map(|team| (team, team.claim(usize::MAX)));
        match claimed.filter(|(_, helpers)| *helpers > 0) {
            Some((team, helpers)) => team.share_tasks(helpers, first, tasks, work),
            None => {
                first();
                self.for_each(tasks, work);
            }
        }
    }

    /// Does the work for every task, which must not depend on each other. The calling thread takes the first ones and helpers the
    /// last ones, so that from phase to phase and frame to frame each meets mostly what it wrote itself.
    pub(crate) fn for_each<T: Send>(
        &self,
        mut tasks: impl Iterator<Item = T> + Send,
        work: impl Fn(T) + Sync,
    ) {
        let Some(team) = self.team.as_deref() else { return tasks.for_each(work) };
        let Some(mut own) = tasks.next() else { return };
        while let Some(other) = tasks.next() {
            // Helpers may become idle from task to task.
            let helpers = team.claim(usize::MAX);
            if helpers > 0 {
                return team.share_tasks(helpers, || work(own), std::iter::once(other).chain(tasks), &work);
            }
            work(std::mem::replace(&mut own, other));
        }
        work(own);
    }
}

/// Tasks to be taken from both ends, as far as the next ones are known.
struct Queue<T, I> {
    known: ArrayVec<Option<T>, KNOWN_TASKS>,
    /// How many of these are gone from the beginning.
    gone: usize,
    others: I,
}

impl<T, I: Iterator<Item = T>> Queue<T, I> {
    fn of(others: I) -> Self {
        Self { known: ArrayVec::new(), gone: 0, others }
    }

    fn first(&mut self) -> Option<T> {
        self.look_ahead();
        let task = self.known.get_mut(self.gone)?.take();
        self.gone += 1;
        task
    }

    fn last(&mut self) -> Option<T> {
        self.look_ahead();
        self.known.pop().flatten()
    }

    /// Fills up what is known once that is gone.
    fn look_ahead(&mut self) {
        if self.gone == self.known.len() {
            self.gone = 0;
            self.known.clear();
            self.known.extend(self.others.by_ref().take(KNOWN_TASKS).map(Some));
        }
    }
}

impl Team {
    /// Takes so many helpers at most that are idle. None for a helper: while it waited it might be called for good.
    fn claim(&self, most: usize) -> usize {
        let Attendance { idle, looks, .. } = &*self.attendance;
        if idle.load(Ordering::Acquire) == 0 || self.pool.current_thread_index().is_some() {
            return 0;
        }
        let before = looks.load(Ordering::Relaxed);
        let is_moving = |_| {
            std::hint::spin_loop();
            looks.load(Ordering::Relaxed) != before
        };
        if !(0..LOOKS_AT_HELPERS).any(is_moving) {
            return 0;
        }
        let rest = |idle: usize| Some(idle.saturating_sub(most));
        idle.fetch_update(Ordering::AcqRel, Ordering::Acquire, rest).map_or(0, |idle| idle.min(most))
    }

    /// Does the one thing and then tasks from the first on; so many claimed helpers do tasks from the last on.
    fn share_tasks<T: Send>(
        &self,
        helpers: usize,
        first: impl FnOnce(),
        tasks: impl Iterator<Item = T> + Send,
        work: impl Fn(T) + Sync,
    ) {
        let tasks = Mutex::new(Queue::of(tasks));
        let lock = || tasks.lock().unwrap_or_else(PoisonError::into_inner);
        let from_first = || {
            first();
            let next = || lock().first();
            while let Some(task) = next() {
                work(task);
            }
        };
        let from_last = || {
            let next = || lock().last();
            while let Some(task) = next() {
                work(task);
            }
        };
        self.share(helpers, from_first, from_last);
    }

    /// Does the one thing, and so many claimed helpers the other.
    fn share(&self, helpers: usize, own: impl FnOnce(), others: impl Fn() + Sync) {
        let busy = AtomicUsize::new(helpers);
        self.pool.in_place_scope(|scope| {
            for _ in 0..helpers {
                scope.spawn(|_| {
                    let _done = Done { busy: &busy, idle: &self.attendance.idle };
                    others();
                });
            }
            own();
            // The scope would sleep.
            spin_while(|| busy.load(Ordering::Acquire) > 0, || false);
        });
    }
}

/// A helper with a task. When that has ended, even by a panic, the helper is idle again.
struct Done<'a> {
    busy: &'a AtomicUsize,
    idle: &'a AtomicUsize,
}

impl Drop for Done<'_> {
    fn drop(&mut self) {
        self.idle.fetch_add(1, Ordering::AcqRel);
        self.busy.fetch_sub(1, Ordering::AcqRel);
    }
}

impl Attendance {
    fn of(helpers: usize) -> Self {
        let is_awake = (0..helpers).map(|_| AtomicBool::new(false)).collect();
        Self { callers: AtomicUsize::new(0), is_awake, idle: AtomicUsize::new(0), looks: AtomicUsize::new(0) }
    }

    /// A helper does what it is given until nobody wants it for a while. Nothing if that is what it does.
    fn attend(&self, helper: usize) {
        let Some(is_awake) = self.is_awake.get(helper) else { return };
        let is_wanted = || self.callers.load(Ordering::SeqCst) > 0;
        while is_wanted() && !is_awake.swap(true, Ordering::SeqCst) {
            self.idle.fetch_add(1, Ordering::AcqRel);
            let in_vain = Cell::new(0);
            let act = || {
                self.looks.fetch_add(1, Ordering::Relaxed);
                in_vain.set(if is_wanted() { 0 } else { in_vain.get() + 1 });
                matches!(rayon::yield_now(), Some(Yield::Executed))
            };
            spin_while(|| in_vain.get() < LOOKS_BEFORE_SLEEP, act);
            self.idle.fetch_sub(1, Ordering::AcqRel);
            // Who came before this does not wake a helper that still was awake, but then it is wanted.
            is_awake.store(false, Ordering::SeqCst);
        }
    }
}

impl Drop for Awake {
    fn drop(&mut self) {
        if let Some(team) = &self.0 {
            team.attendance.callers.fetch_sub(1, Ordering::SeqCst);
        }
    }
}

/// Spins while something holds. `act` says whether it has done anything.
fn spin_while(holds: impl Fn() -> bool, act: impl Fn() -> bool) {
    let mut looks = 0;
    while holds() {
        if act() {
            looks = 0;
            continue;
        }
        looks += 1;
        if looks % LOOKS == 0 {
            std::thread::yield_now();
        } else {
            std::hint::spin_loop();
        }
    }
}

#[cfg(test)]
impl Workers {
    /// Wakes the helpers and waits for them.
    pub(crate) fn wake_all(&self) -> Awake {
        let awake = self.wake();
        if let Some(Team { pool, attendance }) = self.team.as_deref() {
            spin_while(|| attendance.idle.load(Ordering::Acquire) < pool.current_num_threads(), || false);
        }
        awake
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;
    use std::thread::{ThreadId, current};

    const ROWS: usize = 1_000_000;

    /// Does tasks, each once, until all threads have had one.
    fn meet(workers: &Workers) {
        let seen = Mutex::new(HashSet::<ThreadId>::new());
        let all_seen = || seen.lock().unwrap_or_else(PoisonError::into_inner).len() == workers.threads();
        while !all_seen() {
            let mut done = [0; 50];
            workers.for_each(done.iter_mut(), |done| {
                *done += 1;
                seen.lock().unwrap_or_else(PoisonError::into_inner).insert(current().id());
                std::thread::yield_now();
            });
            assert_eq!(done, [1; 50]);
        }
    }

    #[test]
    fn awake_helpers_share_tasks_again_and_again() {
        let workers = Workers::new(3, ROWS);
        for _ in 0..20 {
            let _awake = workers.wake_all();
            for _ in 0..20 {
                meet(&workers);
            }
        }
    }

    #[test]
    fn the_caller_does_what_sleeping_helpers_would() {
        let (workers, caller) = (Workers::new(2, ROWS), current().id());
        drop(workers.wake_all());
        let team = workers.team.as_deref();
        spin_while(|| team.is_some_and(|team| team.attendance.idle.load(Ordering::Acquire) > 0), || false);
        let done = AtomicUsize::new(0);
        workers.for_each(0..10, |_| {
            assert_eq!(current().id(), caller);
            done.fetch_add(1, Ordering::AcqRel);
        });
        assert_eq!(done.into_inner(), 10);
    }

    /// So that in the next phase each finds what it wrote itself; also where there are more tasks than are known at once.
    #[test]
    fn the_caller_takes_the_first_tasks_and_helpers_the_last_ones() {
        let (workers, caller) = (Workers::new(2, ROWS), current().id());
        let _awake = workers.wake_all();
        let mut were_shared = 0;
        while were_shared < 20 {
            let mut by_caller = [None; 3 * KNOWN_TASKS];
            for count in [KNOWN_TASKS, by_caller.len()] {
                by_caller.fill(None);
                workers.for_each(by_caller[..count].iter_mut(), |by_caller| {
                    assert_eq!(*by_caller, None);
                    *by_caller = Some(current().id() == caller);
                    std::thread::yield_now();
                });
                assert!(by_caller[..count].iter().all(Option::is_some));
                if count == KNOWN_TASKS {
                    let known = &by_caller[..count];
                    assert!(known.is_sorted_by_key(|by_caller| *by_caller == Some(false)), "{known:?}");
                    were_shared += usize::from(known.contains(&Some(false)));
                }
            }
        }
    }

    #[test]
    fn a_helper_does_the_second_of_two_things_and_then_helps_with_the_first() {
        let workers = Workers::new(2, ROWS);
        let _awake = workers.wake_all();
        let (caller, by_helper) = (current().id(), AtomicUsize::new(0));
        // A helper without a core is not given anything.
        while by_helper.load(Ordering::Acquire) == 0 {
            let second = || {
                let me = current().id();
                // Within a task, nobody waits for others.
                workers.for_each(0..5, |_| assert_eq!(current().id(), me));
                by_helper.fetch_add(usize::from(me != caller), Ordering::AcqRel);
            };
            workers.both(|| workers.for_each(0..5, |_| ()), second);
        }
        workers.both(|| meet(&workers), || ());
    }

    #[test]
    fn helpers_begin_with_tasks_while_the_caller_does_something_else() {
        let (workers, alone, caller) = (Workers::new(2, ROWS), Workers::default(), current().id());
        let _awake = workers.wake_all();
        let mut were_begun = 0;
        while were_begun < 5 {
            for workers in [&workers, &alone] {
                let (mut done, by_helper) = ([0; 20], AtomicUsize::new(0));
                let mut firsts = 0;
                let first = || {
                    firsts += 1;
                    let has_begun = |_| {
                        std::hint::spin_loop();
                        by_helper.load(Ordering::Acquire) > 0
                    };
                    were_begun += usize::from((0..10_000).any(has_begun));
                };
                workers.beside(first, done.iter_mut(), |done| {
                    *done += 1;
                    by_helper.fetch_add(usize::from(current().id() != caller), Ordering::AcqRel);
                });
                assert_eq!((firsts, done), (1, [1; 20]));
            }
        }
    }

    /// Helpers stay as long as anyone wants them, and are idle again even after a panic.
    #[test]
    fn helpers_are_there_until_the_last_caller_goes() {
        let workers = Workers::new(2, ROWS);
        let outer = workers.wake_all();
        drop(workers.wake());
        meet(&workers);
        let caller = current().id();
        let both = || workers.both(|| (), || assert_eq!(current().id(), caller));
        let fails = || std::panic::catch_unwind(std::panic::AssertUnwindSafe(both)).is_err();
        while !fails() {}
        meet(&workers);
        drop(outer);
    }
}
