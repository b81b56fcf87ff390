//! The serial ports of this machine, and the line that describes each.

use serialport::{SerialPortInfo, SerialPortType};
use std::fmt;

/// What can go wrong with serial hardware.
#[derive(Debug, thiserror::Error)]
pub enum HwError {
    /// The operating system refuses to enumerate its serial ports.
    #[error("cannot list the serial ports: {0}")]
    ListPorts(#[source] serialport::Error),
    /// A port cannot be opened.
    #[error("{port}: cannot open: {error}")]
    OpenPort {
        /// Name of the port.
        port: String,
        /// What the operating system says.
        error: serialport::Error,
    },
    /// There is no pseudo-terminal to be had.
    #[error("cannot make a pseudo-terminal: {0}")]
    PseudoPort(#[source] serialport::Error),
    /// The thread that reads a port cannot be started.
    #[error("cannot start a thread: {0}")]
    Thread(#[source] std::io::Error),
}

/// A serial port and what is known of the device behind it.
///
/// [`Display`](fmt::Display) writes one line: the name, two spaces, then the [`PortKind`].
///
/// ```
/// use capsense_hw::{PortDescription, PortKind};
/// let port = PortDescription { name: "/dev/ttyS0".into(), kind: PortKind::Pci };
/// assert_eq!(port.to_string(), "/dev/ttyS0  PCI");
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PortDescription {
    /// What to open it by, such as `/dev/ttyUSB0` or `COM3`.
    pub name: String,
    /// How it is attached.
    pub kind: PortKind,
}

/// How a serial port is attached.
///
/// [`Display`](fmt::Display) writes `PCI`, `Bluetooth`, `unknown`, or the line of the [`UsbDevice`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PortKind {
    /// Through USB.
    Usb(UsbDevice),
    /// On the machine's own bus.
    Pci,
    /// Through Bluetooth.
    Bluetooth,
    /// The operating system does not say; pseudo-terminals and on-board ports often look like this.
    Unknown,
}

/// What a USB device says of itself.
///
/// [`Display`](fmt::Display) writes `USB vid:pid` in four hexadecimal digits each, then manufacturer and product if
/// known, then `, serial ` and the serial number if known: `USB 16c0:0483 Teensyduino USB Serial, serial 12345`.
/// Control characters in these texts, which come from the device, are written as `?`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct UsbDevice {
    /// Vendor id.
    pub vid: u16,
    /// Product id.
    pub pid: u16,
    /// Name of the manufacturer.
    pub manufacturer: Option<String>,
    /// Name of the product.
    pub product: Option<String>,
    /// Serial number.
    pub serial: Option<String>,
}

impl fmt::Display for PortDescription {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}  {}", self.name, self.kind)
    }
}

impl fmt::Display for PortKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Usb(device) => device.fmt(f),
            Self::Pci => f.write_str("PCI"),
            Self::Bluetooth => f.write_str("Bluetooth"),
            Self::Unknown => f.write_str("unknown"),
        }
    }
}

impl fmt::Display for UsbDevice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "USB {:04x}:{:04x}", self.vid, self.pid)?;
        for text in [&self.manufacturer, &self.product].into_iter().flatten() {
            write!(f, " {}", printable(text))?;
        }
        if let Some(serial) = &self.serial {
            write!(f, ", serial {}", printable(serial))?;
        }
        Ok(())
    }
}

/// A device's text on one line of a terminal.
fn printable(text: &str) -> String {
    text.trim().chars().map(|c| if c.is_control() { '?' } else { c }).collect()
}

impl From<SerialPortInfo> for PortDescription {
    fn from(info: SerialPortInfo) -> Self {
        let kind = match info.port_type {
            SerialPortType::UsbPort(usb) => PortKind::Usb(UsbDevice {
                vid: usb.vid,
                pid: usb.pid,
                manufacturer: usb.manufacturer,
                product: usb.product,
                serial: usb.serial_number,
            }),
            SerialPortType::PciPort => PortKind::Pci,
            SerialPortType::BluetoothPort => PortKind::Bluetooth,
            SerialPortType::Unknown => PortKind::Unknown,
        };
        Self { name: info.port_name, kind }
    }
}

/// Lists the serial ports of this machine, sorted by name. No port is opened.
///
/// # Errors
/// When the operating system cannot enumerate its ports.
pub fn list_ports() -> Result<Vec<PortDescription>, HwError> {
    let mut ports: Vec<PortDescription> = serialport::available_ports()
        .map_err(HwError::ListPorts)?
        .into_iter()
        .map(PortDescription::from)
        .collect();
    ports.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(ports)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serialport::UsbPortInfo;

    fn usb(manufacturer: Option<&str>, product: Option<&str>, serial: Option<&str>) -> PortDescription {
        PortDescription::from(SerialPortInfo {
            port_name: "/dev/ttyACM0".into(),
            port_type: SerialPortType::UsbPort(UsbPortInfo {
                vid: 0x16c0,
                pid: 0x0483,
                serial_number: serial.map(str::to_owned),
                manufacturer: manufacturer.map(str::to_owned),
                product: product.map(str::to_owned),
            }),
        })
    }

    #[test]
    fn usb_ports_show_ids_and_whatever_the_device_says() {
        let full = usb(Some("Teensyduino"), Some("USB Serial"), Some("12345"));
        assert_eq!(full.to_string(), "/dev/ttyACM0  USB 16c0:0483 Teensyduino USB Serial, serial 12345");
        assert_eq!(usb(None, Some("USB Serial"), None).to_string(), "/dev/ttyACM0  USB 16c0:0483 USB Serial");
        assert_eq!(usb(None, None, None).to_string(), "/dev/ttyACM0  USB 16c0:0483");
    }

    #[test]
    fn a_device_cannot_write_control_characters_to_the_terminal() {
        let rude = usb(Some("A\x1b[31mB\n"), None, Some("1\r2"));
        assert_eq!(rude.to_string(), "/dev/ttyACM0  USB 16c0:0483 A?[31mB, serial 1?2");
    }

    #[test]
    fn other_ports_show_their_kind() {
        for (port_type, line) in [
            (SerialPortType::PciPort, "COM1  PCI"),
            (SerialPortType::BluetoothPort, "COM1  Bluetooth"),
            (SerialPortType::Unknown, "COM1  unknown"),
        ] {
            let port = PortDescription::from(SerialPortInfo { port_name: "COM1".into(), port_type });
            assert_eq!(port.to_string(), line);
        }
    }

    #[test]
    fn ports_of_this_machine_are_listed_sorted_and_on_one_line_each() {
        let ports = list_ports().unwrap();
        assert!(ports.is_sorted_by(|a, b| a.name <= b.name));
        for port in ports {
            assert!(!port.name.is_empty());
            assert_eq!(port.to_string().lines().count(), 1);
        }
    }
}
