//! The `capsense` command: exit code 0 when all went well, 1 when something failed, 2 for bad input.

mod command;
mod quiet_graphics;

use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    quiet_graphics::keep_the_graphics_stack_quiet();
    match command::Arguments::parse().run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}", command::message(&error));
            ExitCode::from(command::exit_code(&error))
        }
    }
}
