//! The board's end of a pseudo-terminal, for simulated boards: other programs open the other end like a serial port.

use crate::ports::HwError;
use std::io::{self, ErrorKind, Write};
use std::time::{Duration, Instant};

/// How long a write waits for room.
const PATIENCE: Duration = Duration::from_millis(1);

/// A port that is not there.
pub struct PseudoPort {
    port: Box<dyn Write + Send>,
    path: String,
    /// The rest of what was sent while there was no room for all of it.
    unsent: Vec<u8>,
}

impl PseudoPort {
    /// Makes a pseudo-terminal.
    ///
    /// # Errors
    /// When the operating system has none to give.
    #[cfg(unix)]
    pub fn open() -> Result<Self, HwError> {
        use serialport::{SerialPort, TTYPort};
        let (mut ours, theirs) = TTYPort::pair().map_err(HwError::PseudoPort)?;
        ours.set_timeout(PATIENCE).map_err(HwError::PseudoPort)?;
        let path = theirs.name().unwrap_or_default();
        Ok(Self { port: Box::new(ours), path, unsent: Vec::new() })
    }

    /// Makes a pseudo-terminal.
    ///
    /// # Errors
    /// Always: this operating system has none.
    #[cfg(not(unix))]
    pub fn open() -> Result<Self, HwError> {
        let kind = serialport::ErrorKind::NoDevice;
        Err(HwError::PseudoPort(serialport::Error::new(kind, "this system has no pseudo-terminals")))
    }

    /// What to open it by.
    pub fn path(&self) -> &str {
        &self.path
    }

    /// Sends something whole, as far as there is room; the rest follows with the next call. `false` if there was no room
    /// at all, as when nobody reads: then it is not sent, as a board's own buffer would have overflowed.
    ///
    /// # Errors
    /// When the pseudo-terminal fails.
    pub fn send(&mut self, bytes: &[u8]) -> io::Result<bool> {
        self.send_rest()?;
        if !self.unsent.is_empty() {
            return Ok(false);
        }
        self.unsent.extend_from_slice(bytes);
        self.send_rest()?;
        Ok(true)
    }

    /// Keeps what was sent for whoever still reads it: closing a pseudo-terminal takes it away. Ends after a time, or when `go_on`
    /// says so.
    ///
    /// # Errors
    /// When the pseudo-terminal fails.
    pub fn linger(&mut self, time: Duration, mut go_on: impl FnMut() -> bool) -> io::Result<()> {
        let begun = Instant::now();
        while go_on() && begun.elapsed() < time {
            self.send(&[])?;
            std::thread::sleep(Duration::from_millis(10));
        }
        Ok(())
    }

    fn send_rest(&mut self) -> io::Result<()> {
        while !self.unsent.is_empty() {
            match self.port.write(&self.unsent) {
                Ok(0) => break,
                Ok(count) => drop(self.unsent.drain(..count)),
                Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock) => break,
                // Nobody has opened the other end.
                Err(error) if error.kind() == ErrorKind::BrokenPipe => {
                    std::thread::sleep(PATIENCE);
                    break;
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}
