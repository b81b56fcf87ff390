//! `capsense replay`: a recording once more, as fast as it was or otherwise.

use super::BadInput;
use super::device_profile::{LINGER, find_profile, told};
use super::interrupt::Interrupt;
use super::output::print_out;
use anyhow::Context;
use capsense_hw::PseudoPort;
use capsense_hw::profile::DeviceProfile;
use capsense_hw::recording::{CsvTable, Decoded, Entry, RecordingReader, Samples};
use clap::{Args, ValueEnum};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// How long to sleep at most before looking for Ctrl-C.
const NAP: Duration = Duration::from_millis(50);

/// Show a recording once more, or send its bytes to a pseudo-terminal
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  capsense replay bar.mcap --speed max\n  capsense replay bar.mcap --to pty"
)]
pub(super) struct ReplayArguments {
    /// The recording
    file: PathBuf,
    /// How many times as fast as it was; `max` for no pause
    #[arg(long, default_value = "1")]
    speed: String,
    /// Where to
    #[arg(long, value_enum, default_value_t = Target::Terminal)]
    to: Target,
    /// Decode the bytes anew by this device profile, built-in or a file (.toml)
    #[arg(long)]
    device: Option<String>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Target {
    /// Samples as lines: time in seconds, then a value for each channel
    Terminal,
    /// The table that `capsense export` writes, line by line
    Csv,
    /// Bytes to a pseudo-terminal, whose path is the first line of output
    Pty,
}

pub(super) fn replay(arguments: &ReplayArguments) -> anyhow::Result<()> {
    let interrupt = Interrupt::listen().context("cannot listen for Ctrl-C")?;
    let profile = arguments.device.as_deref().map(find_profile).transpose()?;
    let reader = || RecordingReader::open(&arguments.file).map_err(told);
    let mut pace = Pace { speed: speed(&arguments.speed)?, begun: Instant::now(), interrupt };
    match arguments.to {
        Target::Terminal => {
            let samples = Samples::new(reader()?, profile).map_err(told)?;
            let profile = samples.profile().clone();
            show(samples, &mut pace, |sample| line(&profile, sample))
        }
        Target::Csv => {
            let (table, samples) = CsvTable::open(&arguments.file, profile.as_ref()).map_err(told)?;
            print_out(&table.header())?;
            pace.begun = Instant::now();
            show(samples, &mut pace, |sample| table.row(sample))
        }
        Target::Pty => {
            let reader = reader()?;
            let mut port = PseudoPort::open()?;
            print_out(&format!("{}\n", port.path()))?;
            for entry in reader {
                let Entry::Raw(time, bytes) = entry.map_err(told)? else { continue };
                // Nothing is dropped: a replay can wait for its reader.
                while pace.wait(time) && !port.send(&bytes)? {}
                if pace.interrupt.requested() {
                    break;
                }
            }
            while !pace.interrupt.requested() && !port.send(&[])? {}
            port.linger(LINGER, || !pace.interrupt.requested())?;
            Ok(())
        }
    }
}

/// Prints each sample when it is due.
fn show(samples: Samples, pace: &mut Pace, line: impl Fn(&Decoded) -> String) -> anyhow::Result<()> {
    for sample in samples {
        let sample = sample.map_err(told)?;
        if !pace.wait(sample.time) {
            break;
        }
        print_out(&line(&sample))?;
    }
    Ok(())
}

fn speed(text: &str) -> anyhow::Result<Option<f64>> {
    match text.parse::<f64>() {
        _ if text == "max" => Ok(None),
        Ok(speed) if speed.is_finite() && speed > 0.0 => Ok(Some(speed)),
        _ => Err(BadInput(format!("--speed {text}: must be a number above 0 or `max`")).into()),
    }
}

struct Pace {
    speed: Option<f64>,
    begun: Instant,
    interrupt: Interrupt,
}

impl Pace {
    /// Waits for a time of the recording; `false` if the user has had enough.
    fn wait(&mut self, time: Duration) -> bool {
        let due = self.speed.map_or(Duration::ZERO, |speed| {
            Duration::try_from_secs_f64(time.as_secs_f64() / speed).unwrap_or(Duration::MAX)
        });
        loop {
            let left = due.saturating_sub(self.begun.elapsed());
            if self.interrupt.requested() || left.is_zero() {
                return !self.interrupt.requested();
            }
            std::thread::sleep(left.min(NAP));
        }
    }
}

fn line(profile: &DeviceProfile, sample: &Decoded) -> String {
    let mut line = format!("{:.6}", sample.time.as_secs_f64());
    for (channel, value) in sample.values.iter().enumerate() {
        let value = profile.reading(channel, *value).value;
        line += &value.map_or(",".to_owned(), |value| format!(",{value:e}"));
    }
    line + "\n"
}
