//! The `capsense-viewer` command.

use capsense_viewer::frame_rate;
use capsense_viewer::open_window;
use capsense_viewer::preferences::{Preferences, Theme};
use capsense_viewer::screenshot::{self, Request, ScreenshotError};
use capsense_viewer::start::Start;
use clap::{Parser, ValueEnum};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// A scene that can be touched, and what its sensor measures meanwhile.
#[derive(Parser)]
#[command(
    version,
    after_help = "Example:\n  capsense-viewer assets/scenes/hand.toml\n  \
                  capsense-viewer --screenshot hand.png --frame 110 assets/scenes/hand.toml\n\n\
                  Exit codes: 0 fine, 1 failed, 2 bad input."
)]
struct Arguments {
    /// A scene file, or the folder of a run; without one, a steel bar sweeps past three stripe electrodes
    scene: Option<PathBuf>,
    /// Draw the window into this PNG file in place of on a display, after computing the frames up to `--frame`
    #[arg(long, value_name = "FILE.png", group = "picture_or_rate")]
    screenshot: Option<PathBuf>,
    /// The frame of the picture; all before it are computed too
    #[arg(long, default_value_t = 0, requires = "screenshot", conflicts_with = "measure_fps")]
    frame: usize,
    /// Play the scene in the window for so many seconds, tell how many frames a second were drawn, and close
    #[arg(long, value_name = "SECONDS", group = "picture_or_rate",
        value_parser = clap::value_parser!(u64).range(1..=600))]
    measure_fps: Option<u64>,
    /// Width and height in pixels of the picture, or of the window that is measured
    #[arg(long, num_args = 2, value_names = ["WIDTH", "HEIGHT"], default_values_t = [1440, 900],
        value_parser = clap::value_parser!(u32).range(64..=8192), requires = "picture_or_rate")]
    size: Vec<u32>,
    /// Ground of the picture
    #[arg(long, value_enum, default_value_t = Ground::Dark, requires = "screenshot",
        conflicts_with = "measure_fps")]
    theme: Ground,
    /// Tell error bars of the picture's frame
    #[arg(long, requires = "screenshot", conflicts_with = "measure_fps")]
    bars: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Ground {
    Dark,
    Light,
}

fn main() -> ExitCode {
    let started = Instant::now();
    let arguments = Arguments::parse();
    let (start, mut code) = match arguments.scene.as_deref().map(Start::from_path) {
        None => (Start::built_in().map_err(|error| error.to_string()), 0),
        Some(Ok(start)) => (Ok(start), 0),
        Some(Err(message)) => {
            eprintln!("error: {message}");
            if arguments.screenshot.is_some() {
                return ExitCode::from(2);
            }
            // The window opens all the same, and says why it shows another scene.
            let built_in = Start::built_in().map_err(|error| error.to_string());
            (built_in.map(|start| Start { message: Some(message), ..start }), 2)
        }
    };
    let start = match start {
        Ok(start) => start,
        Err(message) => {
            eprintln!("error: {message}");
            return ExitCode::from(1);
        }
    };
    if let Some(out) = &arguments.screenshot {
        return picture(start, &arguments, out.clone());
    }
    let measured = arguments.measure_fps.map(|seconds| frame_rate::Request {
        length: Duration::from_secs(seconds),
        size: [arguments.size[0], arguments.size[1]],
        started,
    });
    match open_window(start, measured) {
        Ok(Some(report)) => println!("{report}"),
        Ok(None) if measured.is_some() => {
            eprintln!("error: the window was closed before anything was measured");
            code = code.max(1);
        }
        Ok(None) => {}
        Err(error) => {
            eprintln!("error: the window could not be opened: {error}");
            eprintln!(
                "The viewer needs a display and a Vulkan driver; on Debian a software driver comes with"
            );
            eprintln!("    apt-get install mesa-vulkan-drivers libvulkan1 libxkbcommon-x11-0");
            code = code.max(1);
        }
    }
    ExitCode::from(code)
}

fn picture(start: Start, arguments: &Arguments, out: PathBuf) -> ExitCode {
    let theme = match arguments.theme {
        Ground::Dark => Theme::Dark,
        Ground::Light => Theme::Light,
    };
    let request = Request {
        out,
        size: [arguments.size[0], arguments.size[1]],
        frame: arguments.frame,
        bars: arguments.bars,
        preferences: Preferences { theme, ..Preferences::default() },
    };
    match screenshot::take(start, &request) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            if matches!(error, ScreenshotError::NoAdapter(_)) {
                eprintln!("A Vulkan driver is needed; on Debian a software one comes with");
                eprintln!("    apt-get install mesa-vulkan-drivers libvulkan1");
            }
            let is_input = matches!(error, ScreenshotError::Scene(_) | ScreenshotError::Frame { .. });
            ExitCode::from(if is_input { 2 } else { 1 })
        }
    }
}
