//! The `capsense` command: exit code 0 when all went well, 1 when something failed, 2 for bad input.

mod command;

use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    keep_the_graphics_stack_quiet();
    match command::Arguments::parse().run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}", command::message(&error));
            ExitCode::from(command::exit_code(&error))
        }
    }
}

/// Without a session's runtime folder, Mesa's device selection complains on standard error about a display that this
/// command never opens; a user would take that for a failure of ours.
fn keep_the_graphics_stack_quiet() {
    let unset = |name| std::env::var_os(name).is_none();
    if unset("XDG_RUNTIME_DIR") && unset("NODEVICE_SELECT") {
        // SAFETY: the first thing the program does; no other thread exists that could read the environment.
        unsafe { std::env::set_var("NODEVICE_SELECT", "1") };
    }
}
