//! Capacitance-to-digital hardware of CapSense: the serial ports that a measuring board may be attached to.
//!
//! ```no_run
//! for port in capsense_hw::list_ports()? {
//!     println!("{port}");
//! }
//! # Ok::<(), capsense_hw::HwError>(())
//! ```

#![forbid(unsafe_code)]

mod ports;
pub mod profile;
pub mod recording;
pub mod stream;

pub use ports::{HwError, PortDescription, PortKind, UsbDevice, list_ports};
