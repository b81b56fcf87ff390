//! Capacitance-to-digital hardware of CapSense: from serial bytes to farads, and from farads to the bytes a board would
//! send.
//!
//! - [`profile`]: what is known of a converter and its firmware, built in or from TOML; words to capacitance and back.
//! - [`stream`]: decoders and encoders of what boards send, without input or output.
//! - [`iq`]: mutual capacitance from sampled waveforms.
//! - [`recording`]: files that keep every byte beside what was made of it, and survive being cut off.
//! - [`PortReader`] and [`record`]: a port read on a thread of its own, into a recording.
//!
//! ```no_run
//! for port in capsense_hw::list_ports()? {
//!     println!("{port}");
//! }
//! # Ok::<(), capsense_hw::HwError>(())
//! ```

#![forbid(unsafe_code)]

pub mod iq;
mod port_reader;
mod ports;
pub mod profile;
mod pseudo_port;
mod recorder;
pub mod recording;
pub mod stream;

pub use port_reader::{PortEvent, PortNews, PortReader};
pub use ports::{HwError, PortDescription, PortKind, UsbDevice, list_ports};
pub use pseudo_port::PseudoPort;
pub use recorder::{Counters, Heard, receive, record};
