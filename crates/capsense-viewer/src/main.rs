//! The `capsense-viewer` command.

use capsense_viewer::app::Content;
use capsense_viewer::{load_run, open_window};
use clap::Parser;
use std::path::PathBuf;
use std::process::ExitCode;

/// Shows the curves of a finished run, and the mesh that it was computed on.
#[derive(Parser)]
#[command(
    version,
    after_help = "Example:\n  capsense run --out capsense-out\n  capsense-viewer capsense-out\n\n\
                  Exit codes: 0 fine, 1 the window could not be opened, 2 bad input."
)]
struct Arguments {
    /// The folder of a run, or its capacitance.csv.
    run: Option<PathBuf>,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let (content, mut code) = match &arguments.run {
        None => (Content::Nothing, 0),
        Some(run) => match load_run(run) {
            Ok(data) => (Content::Run { name: run.display().to_string(), data: Box::new(data) }, 0),
            Err(error) => {
                eprintln!("error: {error}");
                (Content::Failed(error.to_string()), 2)
            }
        },
    };
    if let Err(error) = open_window(content) {
        eprintln!("error: the window could not be opened: {error}");
        eprintln!("The viewer needs a display and a Vulkan driver; on Debian a software driver comes with");
        eprintln!("    apt-get install mesa-vulkan-drivers libvulkan1 libxkbcommon-x11-0");
        code = code.max(1);
    }
    ExitCode::from(code)
}
