//! `capsense ports`: the serial ports of this machine.

use super::output::print_out;
use clap::Args;

/// List the serial ports that a capacitance-to-digital converter may be attached to
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  capsense ports")]
pub(super) struct PortsArguments {}

pub(super) fn ports(_arguments: &PortsArguments) -> anyhow::Result<()> {
    let ports = capsense_hw::list_ports()?;
    let lines: String = ports.iter().map(|port| format!("{port}\n")).collect();
    print_out(if lines.is_empty() { "no serial ports\n" } else { &lines })
}
