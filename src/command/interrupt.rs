//! Ctrl-C asks a running command to stop after the frame it is in, so that its files are complete.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether Ctrl-C has been pressed.
#[derive(Clone, Debug, Default)]
pub(super) struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// From now on Ctrl-C is noted here instead of ending the program.
    pub(super) fn listen() -> Result<Self, ctrlc::Error> {
        let interrupt = Self::default();
        let noted = interrupt.clone();
        ctrlc::set_handler(move || noted.0.store(true, Ordering::Relaxed))?;
        Ok(interrupt)
    }

    pub(super) fn requested(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}
