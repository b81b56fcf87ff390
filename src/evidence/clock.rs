//! How long a frame takes of its thread: processor time, which does not count what other programs take of the core.

use std::time::Instant;

/// What frames are timed with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Clock {
    /// Processor time of this thread.
    Thread,
    /// Wall-clock time.
    Wall,
}

impl Clock {
    /// That of the thread where it computes alone and the system tells its time.
    pub(super) fn for_threads(threads: usize) -> Self {
        if threads == 1 && thread_seconds().is_some() { Self::Thread } else { Self::Wall }
    }

    /// Its name in tables.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Thread => "thread",
            Self::Wall => "wall",
        }
    }
}

/// Milliseconds of some work by both clocks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Took {
    pub(super) wall: f64,
    /// Not known on every system.
    pub(super) thread: Option<f64>,
}

impl Took {
    /// Does the work.
    pub(super) fn measured<T>(work: impl FnOnce() -> T) -> (Self, T) {
        let (started, ran) = (Instant::now(), thread_seconds());
        let result = work();
        let thread = ran.zip(thread_seconds()).map(|(before, after)| 1e3 * (after - before));
        (Self { wall: 1e3 * started.elapsed().as_secs_f64(), thread }, result)
    }

    /// By one of the clocks.
    pub(super) fn by(self, clock: Clock) -> f64 {
        match clock {
            Clock::Thread => self.thread.unwrap_or(self.wall),
            Clock::Wall => self.wall,
        }
    }
}

/// Processor time of this thread so far, in seconds, on systems that tell it.
#[cfg(any(target_os = "linux", target_os = "macos"))]
pub fn thread_seconds() -> Option<f64> {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    Some(time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64)
}

/// Processor time of this thread so far, in seconds, on systems that tell it.
#[cfg(not(any(target_os = "linux", target_os = "macos")))]
pub fn thread_seconds() -> Option<f64> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sleep_takes_no_time_of_the_thread() {
        let (slept, ()) = Took::measured(|| std::thread::sleep(std::time::Duration::from_millis(20)));
        assert!(slept.by(Clock::Wall) >= 20.0);
        if Clock::for_threads(1) == Clock::Thread {
            assert!(slept.by(Clock::Thread) < 0.5 * slept.wall, "{slept:?}");
        }
        assert_eq!(Clock::for_threads(2), Clock::Wall);
    }
}
