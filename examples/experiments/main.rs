//! Experiments with real sensors, simulated: those of section V of the CapSense paper, and recordings of a robot that passes an arm.
//! docs/validation.md has what they print.
//!
//! ```sh
//! cargo run --release --example experiments -- fit FOLDER         # what is not published of section V-B, from two curves
//! ```

mod fit;
mod map;
mod minimum;

use clap::{Parser, Subcommand};

/// Experiments with real sensors, simulated
#[derive(Debug, Parser)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Fit(fit::FitArguments),
}

fn main() -> anyhow::Result<()> {
    match Arguments::parse().command {
        Command::Fit(arguments) => fit::fit(&arguments),
    }
}
