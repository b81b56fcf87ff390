//! `capsense ports`: the serial ports of this machine.

use clap::Args;

/// List the serial ports that a capacitance-to-digital converter may be attached to
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  capsense ports")]
pub(super) struct PortsArguments {}

pub(super) fn ports(_arguments: &PortsArguments) -> anyhow::Result<()> {
    let ports = capsense_hw::list_ports()?;
    if ports.is_empty() {
        println!("no serial ports");
    }
    for port in ports {
        println!("{port}");
    }
    Ok(())
}
