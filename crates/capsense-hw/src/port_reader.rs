//! The thread that reads a port: it stamps what it reads at once and never waits for whoever takes it.
//!
//! A queue of bounded length lies between. When it is full, bytes are dropped and counted; the count comes with the next
//! piece that fits. When the port goes away it is opened again, as often as it takes.

use crate::ports::HwError;
use std::io::{ErrorKind, Read};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Most bytes that one read gives.
const LARGEST_PIECE: usize = 16 * 1024;

/// How long a read waits, and so how long it takes to stop.
const READ_TIMEOUT: Duration = Duration::from_millis(20);

/// How long to wait before the port is tried again.
const RETRY: Duration = Duration::from_millis(100);

/// What happened at the port, and when, since the reader began.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PortEvent {
    /// By a monotonic clock, taken right after the read.
    pub time: Duration,
    /// Bytes that were read before this and dropped because the queue was full.
    pub dropped: u64,
    /// What happened.
    pub what: PortNews,
}

/// What happened at a port.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PortNews {
    /// It was opened.
    Connected,
    /// Something was read.
    Bytes(Vec<u8>),
    /// It is gone.
    Disconnected(String),
}

/// Reads a port on a thread of its own, until it is dropped.
pub struct PortReader {
    events: Receiver<PortEvent>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<u64>>,
}

impl PortReader {
    /// Opens a serial port and begins to read it. `queue` is how many reads may wait to be taken.
    ///
    /// # Errors
    /// When it cannot be opened; later it is waited for.
    pub fn open(port: &str, baud: u32, queue: usize) -> Result<Self, HwError> {
        let name = port.to_owned();
        let open = move || serialport::new(&name, baud).timeout(READ_TIMEOUT).open();
        let first = open().map_err(|error| HwError::OpenPort { port: port.to_owned(), error })?;
        let mut first = Some(first);
        Self::start(queue, move || first.take().map_or_else(&open, Ok).map_err(|error| error.to_string()))
    }

    /// Begins to read what `open` gives, and opens it again when it ends or fails.
    fn start<R: Read>(
        queue: usize,
        open: impl FnMut() -> Result<R, String> + Send + 'static,
    ) -> Result<Self, HwError> {
        let (sender, events) = sync_channel(queue.max(1));
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = stop.clone();
        let begun = Instant::now();
        let thread = std::thread::Builder::new()
            .name("port reader".to_owned())
            .spawn(move || Worker { sender, stopped, begun, dropped: 0 }.run(open))
            .map_err(HwError::Thread)?;
        Ok(Self { events, stop, thread: Some(thread) })
    }

    /// The next event, or `None` if there is none for some time.
    pub fn next(&self, patience: Duration) -> Option<PortEvent> {
        self.events.recv_timeout(patience).ok()
    }

    /// Stops reading, and tells how many bytes were dropped that no event tells of. What waits in the queue can still be taken.
    pub fn stop(&mut self) -> u64 {
        self.stop.store(true, Ordering::Relaxed);
        // A panic of the thread has been printed; there is nothing to add.
        self.thread.take().and_then(|thread| thread.join().ok()).unwrap_or(0)
    }
}

impl Drop for PortReader {
    fn drop(&mut self) {
        self.stop();
    }
}

struct Worker {
    sender: SyncSender<PortEvent>,
    stopped: Arc<AtomicBool>,
    begun: Instant,
    dropped: u64,
}

impl Worker {
    fn run<R: Read>(mut self, mut open: impl FnMut() -> Result<R, String>) -> u64 {
        while self.goes_on() {
            match open() {
                Ok(port) => {
                    self.send_surely(PortNews::Connected);
                    if let Some(reason) = self.read(port) {
                        self.send_surely(PortNews::Disconnected(reason));
                    }
                }
                Err(_) => std::thread::sleep(RETRY),
            }
        }
        self.dropped
    }

    fn goes_on(&self) -> bool {
        !self.stopped.load(Ordering::Relaxed)
    }

    /// Reads until the port is gone, and says why; `None` if it was told to stop. At unplug some systems read nothing for ever, and some fail while
    /// bytes are still to be had; those are lost.
    fn read(&mut self, mut port: impl Read) -> Option<String> {
        let mut buffer = vec![0; LARGEST_PIECE];
        while self.goes_on() {
            match port.read(&mut buffer) {
                Ok(0) => return Some("end of file".to_owned()),
                Ok(count) => self.send(buffer[..count].to_vec()),
                Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
                Err(error) => return Some(error.to_string()),
            }
        }
        None
    }

    fn event(&mut self, what: PortNews) -> PortEvent {
        PortEvent { time: self.begun.elapsed(), dropped: std::mem::take(&mut self.dropped), what }
    }

    /// Puts bytes into the queue, or counts them.
    fn send(&mut self, bytes: Vec<u8>) {
        let event = self.event(PortNews::Bytes(bytes));
        if let Err(TrySendError::Full(event) | TrySendError::Disconnected(event)) =
            self.sender.try_send(event)
        {
            let PortEvent { dropped, what: PortNews::Bytes(bytes), .. } = event else { return };
            self.dropped = dropped + bytes.len() as u64;
        }
    }

    /// Puts something into the queue that may wait, as nothing is read meanwhile.
    fn send_surely(&mut self, what: PortNews) {
        let mut event = self.event(what);
        while let Err(TrySendError::Full(back)) = self.sender.try_send(event) {
            if !self.goes_on() {
                self.dropped = back.dropped;
                return;
            }
            event = back;
            std::thread::sleep(READ_TIMEOUT);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::VecDeque;
    use std::io;

    /// Gives these pieces, then ends.
    struct Pieces(VecDeque<io::Result<Vec<u8>>>);

    impl Read for Pieces {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            let piece = self.0.pop_front().unwrap_or_else(|| Err(ErrorKind::BrokenPipe.into()))?;
            buffer[..piece.len()].copy_from_slice(&piece);
            Ok(piece.len())
        }
    }

    fn reader(queue: usize, connections: Vec<Vec<io::Result<Vec<u8>>>>) -> PortReader {
        let mut connections = connections.into_iter();
        let open = move || connections.next().map(|pieces| Pieces(pieces.into())).ok_or("gone".to_owned());
        PortReader::start(queue, open).unwrap()
    }

    fn news(reader: &PortReader, count: usize) -> Vec<PortEvent> {
        (0..count).map(|_| reader.next(Duration::from_secs(20)).unwrap()).collect()
    }

    /// The end that was asked for is no loss of the port, and what the full queue dropped before it is told.
    #[test]
    fn a_reader_that_is_stopped_tells_what_it_dropped() {
        struct Quiet(Pieces);
        impl Read for Quiet {
            fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
                if self.0.0.is_empty() {
                    std::thread::sleep(Duration::from_millis(1));
                    return Err(ErrorKind::TimedOut.into());
                }
                self.0.read(buffer)
            }
        }
        let pieces = || VecDeque::from([Ok(vec![1]), Ok(vec![2, 2]), Ok(vec![3, 3, 3])]);
        let mut reader = PortReader::start(2, move || Ok(Quiet(Pieces(pieces())))).unwrap();
        std::thread::sleep(Duration::from_millis(100));
        assert_eq!(reader.stop(), 5);
        let what: Vec<PortNews> = news(&reader, 2).into_iter().map(|event| event.what).collect();
        assert_eq!(what, [PortNews::Connected, PortNews::Bytes(vec![1])]);
        assert_eq!(reader.next(Duration::ZERO), None);
    }

    #[test]
    fn a_lost_port_is_opened_again() {
        let late = || Err(ErrorKind::TimedOut.into());
        let reader =
            reader(99, vec![vec![Ok(vec![1, 2]), late(), Ok(vec![3])], vec![Ok(vec![4]), Ok(vec![])]]);
        let events = news(&reader, 7);
        assert!(events.is_sorted_by_key(|event| event.time));
        let what: Vec<PortNews> = events.into_iter().map(|event| event.what).collect();
        assert_eq!(what[..3], [PortNews::Connected, PortNews::Bytes(vec![1, 2]), PortNews::Bytes(vec![3])]);
        assert!(matches!(what[3], PortNews::Disconnected(_)));
        assert_eq!(what[4..6], [PortNews::Connected, PortNews::Bytes(vec![4])]);
        assert_eq!(what[6], PortNews::Disconnected("end of file".to_owned()));
    }

    /// Nobody takes anything: reading goes on, and what does not fit is counted to the byte.
    #[test]
    fn a_full_queue_drops_and_counts() {
        let reader = reader(3, vec![(0..10).map(|size| Ok(vec![7; size + 1])).collect()]);
        std::thread::sleep(Duration::from_millis(200));
        let events = news(&reader, 4);
        let taken: usize = events
            .iter()
            .map(|event| match &event.what {
                PortNews::Bytes(bytes) => bytes.len(),
                PortNews::Connected | PortNews::Disconnected(_) => 0,
            })
            .sum();
        let dropped: u64 = events.iter().map(|event| event.dropped).sum();
        assert_eq!((taken, dropped), (1 + 2, 55 - 3));
    }
}
