//! A board that is connected now: read on a thread of its own, decoded, recorded if wished, and never waited for.

use capsense_hw::PortReader;
use capsense_hw::profile::DeviceProfile;
use capsense_hw::recording::{Header, Note, RecordingError, RecordingWriter};
use capsense_hw::stream::{Decoder, Event, Stamped, Start};
use capsense_hw::{Counters, PortEvent, PortNews};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime};

/// Reads that may wait to be decoded: some seconds of a fast board.
const QUEUE: usize = 4096;

/// How long to wait for the port before looking around.
const PATIENCE: Duration = Duration::from_millis(30);

/// Samples that may wait for the window; beyond, the oldest are forgotten. They are recorded all the same.
const MOST_WAITING: usize = 100_000;

/// What to connect to.
#[derive(Clone, Debug)]
pub struct Connection {
    /// The serial port, or a pseudo-terminal.
    pub port: String,
    /// Bits per second.
    pub baud: u32,
    /// What is known of the board.
    pub profile: DeviceProfile,
    /// Where to record to, if it is to be recorded.
    pub record: Option<PathBuf>,
}

/// One sample: time since the connection in seconds, and what each channel reads, where it reads something.
pub type LiveSample = (f64, Vec<Option<f64>>);

#[derive(Default)]
struct State {
    samples: Vec<LiveSample>,
    counters: Counters,
    is_connected: bool,
    error: Option<String>,
}

/// A connected board. Dropping it disconnects, and completes the recording.
pub struct LiveSource {
    state: Arc<Mutex<State>>,
    stop: Arc<AtomicBool>,
    thread: Option<std::thread::JoinHandle<()>>,
}

fn lock(state: &Mutex<State>) -> MutexGuard<'_, State> {
    state.lock().unwrap_or_else(PoisonError::into_inner)
}

impl LiveSource {
    /// Opens the port and begins to read it. `wake` is called when there is something new.
    ///
    /// # Errors
    /// When the port cannot be opened, the recording cannot be created, or there is no sense in the profile.
    pub fn connect(connection: Connection, wake: impl Fn() + Send + 'static) -> Result<Self, String> {
        let Connection { port, baud, profile, record } = connection;
        let decoder = Decoder::new(&profile.stream, Start::Anywhere).map_err(|error| error.to_string())?;
        let reader = PortReader::open(&port, baud, QUEUE).map_err(|error| error.to_string())?;
        let writer = record.map(|path| {
            let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
            let anchor = u64::try_from(now.as_nanos()).unwrap_or(u64::MAX);
            let header = Header::new(&port, anchor, &profile)?;
            RecordingWriter::create(&path, &header)
        });
        let writer = writer.transpose().map_err(|error| error.to_string())?;
        let state = Arc::<Mutex<State>>::default();
        let stop = Arc::new(AtomicBool::new(false));
        let desk = Desk {
            state: state.clone(),
            stop: stop.clone(),
            profile,
            decoder,
            writer,
            counters: Counters::default(),
        };
        let run = move || desk.run(reader, wake);
        let thread = std::thread::Builder::new().name("board".to_owned()).spawn(run);
        Ok(Self { state, stop, thread: Some(thread.map_err(|error| error.to_string())?) })
    }

    /// Takes the samples that have come.
    pub fn take(&self) -> Vec<LiveSample> {
        std::mem::take(&mut lock(&self.state).samples)
    }

    /// What has come and gone so far.
    pub fn counters(&self) -> Counters {
        lock(&self.state).counters
    }

    /// Whether the port is there. One that goes is opened again when it comes back.
    pub fn is_connected(&self) -> bool {
        lock(&self.state).is_connected
    }

    /// Why reading ended, if it did.
    pub fn error(&self) -> Option<String> {
        lock(&self.state).error.clone()
    }
}

impl Drop for LiveSource {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // It looks around every 30 ms; a recording is completed before the window goes on.
            drop(thread.join());
        }
    }
}

/// The thread's end.
struct Desk {
    state: Arc<Mutex<State>>,
    stop: Arc<AtomicBool>,
    profile: DeviceProfile,
    decoder: Decoder,
    writer: Option<RecordingWriter>,
    counters: Counters,
}

impl Desk {
    fn run(mut self, mut reader: PortReader, wake: impl Fn()) {
        let begun = std::time::Instant::now();
        let mut result = Ok(());
        while result.is_ok() && !self.stop.load(Ordering::Relaxed) {
            match reader.next(PATIENCE) {
                Some(event) => {
                    result = self.take(event);
                    wake();
                }
                None => self.counters.time = self.counters.time.max(begun.elapsed()),
            }
            lock(&self.state).counters = self.counters;
            if let Some(writer) = &mut self.writer {
                result = result.and_then(|()| writer.tick(self.counters.time));
            }
        }
        reader.stop();
        while let Some(event) = reader.next(Duration::ZERO).filter(|_| result.is_ok()) {
            result = self.take(event);
        }
        result = result.and_then(|()| self.end_of_stream());
        if let Some(writer) = self.writer.take() {
            result = result.and_then(|()| writer.finish().map(drop));
        }
        let mut state = lock(&self.state);
        state.is_connected = false;
        state.error = result.err().map(|error| error.to_string());
    }

    fn take(&mut self, event: PortEvent) -> Result<(), RecordingError> {
        self.counters.time = event.time;
        if event.dropped > 0 {
            self.counters.dropped += event.dropped;
            self.end_of_stream()?;
            self.note(&Note::Dropped { bytes: event.dropped })?;
        }
        match event.what {
            PortNews::Connected => {
                lock(&self.state).is_connected = true;
                self.note(&Note::Connected)
            }
            PortNews::Disconnected(reason) => {
                lock(&self.state).is_connected = false;
                self.counters.disconnections += 1;
                self.end_of_stream()?;
                self.note(&Note::Disconnected { reason })
            }
            PortNews::Bytes(bytes) => {
                self.counters.bytes += bytes.len() as u64;
                if let Some(writer) = &mut self.writer {
                    writer.raw(event.time, &bytes)?;
                }
                self.decode(|decoder, events| decoder.push(&bytes, event.time, events))
            }
        }
    }

    fn note(&mut self, note: &Note) -> Result<(), RecordingError> {
        self.writer.as_mut().map_or(Ok(()), |writer| writer.note(self.counters.time, note))
    }

    /// What comes next does not continue what came before.
    fn end_of_stream(&mut self) -> Result<(), RecordingError> {
        let time = self.counters.time;
        self.decode(|decoder, events| decoder.finish(time, events))?;
        self.decoder = Decoder::new(&self.profile.stream, Start::Anywhere)?;
        Ok(())
    }

    fn decode(
        &mut self,
        work: impl FnOnce(&mut Decoder, &mut dyn FnMut(Stamped<'_>)),
    ) -> Result<(), RecordingError> {
        let Self { decoder, counters, writer, profile, state, .. } = self;
        let mut result = Ok(());
        let mut samples: Vec<LiveSample> = Vec::new();
        work(decoder, &mut |stamped| {
            match stamped.event {
                Event::Sample(sample) => {
                    counters.samples += 1;
                    let values = sample.values.iter().enumerate();
                    let values = values.map(|(channel, value)| profile.reading(channel, *value).value);
                    samples.push((stamped.host_time.as_secs_f64(), values.collect()));
                }
                Event::Text(_) => counters.lines += 1,
                Event::Resync => counters.passed_over += stamped.length,
                Event::Gap(missing) => counters.missing += u64::from(missing.unwrap_or(0)),
            }
            if let (Ok(()), Some(writer)) = (&result, writer.as_mut()) {
                result = writer.event(&stamped);
            }
        });
        let waiting = &mut lock(state).samples;
        waiting.append(&mut samples);
        let excess = waiting.len().saturating_sub(MOST_WAITING);
        waiting.drain(..excess);
        result
    }
}
