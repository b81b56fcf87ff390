//! A board that is connected now: read on a thread of its own, decoded, recorded if wished, and never waited for.

use capsense_hw::profile::DeviceProfile;
use capsense_hw::recording::{Header, RecordingWriter};
use capsense_hw::stream::{Decoder, Event, Stamped, Start};
use capsense_hw::{Counters, Heard, PortReader, receive};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::SystemTime;

/// Reads that may wait to be decoded: some seconds of a fast board.
const QUEUE: usize = 4096;

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

impl State {
    fn push(&mut self, sample: LiveSample) {
        if self.samples.len() >= MOST_WAITING {
            self.samples.drain(..MOST_WAITING / 10);
        }
        self.samples.push(sample);
    }
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
        // Before the port is opened: a profile may be nonsense.
        Decoder::new(&profile.stream, Start::Anywhere).map_err(|error| error.to_string())?;
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
        let desk = Desk { state: state.clone(), stop: stop.clone(), profile, writer };
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
            // It looks around every 50 ms; a recording is completed before the window goes on.
            drop(thread.join());
        }
    }
}

/// The thread's end.
struct Desk {
    state: Arc<Mutex<State>>,
    stop: Arc<AtomicBool>,
    profile: DeviceProfile,
    writer: Option<RecordingWriter>,
}

impl Desk {
    fn run(self, reader: PortReader, wake: impl Fn()) {
        let Self { state, stop, profile, writer } = self;
        let go_on = |counters: &Counters| {
            let mut state = lock(&state);
            if state.counters != *counters {
                state.counters = *counters;
                wake();
            }
            !stop.load(Ordering::Relaxed)
        };
        let hear = |heard: Heard<'_>| match heard {
            Heard::Connected => lock(&state).is_connected = true,
            Heard::Disconnected => lock(&state).is_connected = false,
            Heard::Event(Stamped { event: Event::Sample(sample), host_time, .. }) => {
                let values = sample.values.iter().enumerate();
                let values = values.map(|(channel, value)| profile.reading(channel, *value).value);
                lock(&state).push((host_time.as_secs_f64(), values.collect()));
            }
            Heard::Event(_) => {}
        };
        let result = receive(reader, &profile, writer, go_on, hear);
        let mut state = lock(&state);
        state.is_connected = false;
        match result {
            Ok(counters) => state.counters = counters,
            Err(error) => state.error = Some(error.to_string()),
        }
    }
}
