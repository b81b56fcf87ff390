//! Experiments with real sensors, simulated: those of section V of the CapSense paper, and recordings of a robot that passes an arm.
//! docs/validation.md has what they print.
//!
//! ```sh
//! cargo run --release --example experiments -- fit FOLDER         # what is not published of section V-B, from two curves
//! cargo run --release --example experiments -- limbs              # a forearm and a leg past the plate of section V-C
//! cargo run --release --example experiments -- recordings FOLDER  # a limb fitted to some runs, the others predicted
//! ```

mod fit;
mod limbs;
mod map;
mod minimum;
#[path = "../../src/quiet_graphics.rs"]
mod quiet_graphics;
mod recordings;

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
    Limbs(limbs::LimbsArguments),
    Recordings(recordings::RecordingsArguments),
}

fn main() -> anyhow::Result<()> {
    quiet_graphics::keep_the_graphics_stack_quiet();
    match Arguments::parse().command {
        Command::Fit(arguments) => fit::fit(&arguments),
        Command::Limbs(arguments) => limbs::limbs(&arguments),
        Command::Recordings(arguments) => recordings::recordings(&arguments),
    }
}
