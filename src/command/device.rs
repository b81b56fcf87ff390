//! `capsense device`: a running simulation that talks like a board.

use super::BadInput;
use super::device_profile::{LINGER, find_profile};
use super::interrupt::Interrupt;
use super::load_scene;
use super::output::print_out;
use anyhow::Context;
use capsense::Pipeline;
use capsense::core::capacitance::{CapacitanceMatrix, upper_triangle};
use capsense::core::measurement::Measurement;
use capsense_hw::PseudoPort;
use capsense_hw::profile::{DeviceProfile, Meaning};
use capsense_hw::stream::{Encoder, Sample, Value};
use clap::{Args, ValueEnum};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Simulate a scene and send it as a board would
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  capsense device scene.toml --port pty --device fdc2214")]
pub(super) struct DeviceArguments {
    /// The scene file; without one, a steel bar sweeps past three stripe electrodes
    scene: Option<PathBuf>,
    /// Where to send to; the first line of output is its path
    #[arg(long, value_enum)]
    port: Port,
    /// A built-in device profile, or a profile file (.toml)
    #[arg(long, default_value = "generic")]
    device: String,
    /// Begin again when the scene ends, until Ctrl-C
    #[arg(long)]
    repeat: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Port {
    /// A pseudo-terminal
    Pty,
}

pub(super) fn device(arguments: &DeviceArguments) -> anyhow::Result<()> {
    let profile = find_profile(&arguments.device)?;
    if profile.meaning == Meaning::Counts {
        let message = format!("{}: sends bare counts, which no capacitance is known for", profile.name);
        return Err(BadInput(message).into());
    }
    let encoder = Encoder::new(&profile.stream).map_err(|error| BadInput(error.to_string()))?;
    let scene = load_scene(arguments.scene.as_deref())?;
    let interrupt = Interrupt::listen().context("cannot listen for Ctrl-C")?;
    let mut pipeline = Pipeline::new(&scene)?;
    let mut measurement = scene.measurement(pipeline.simulator().base())?;
    let Port::Pty = arguments.port;
    let mut port = PseudoPort::open()?;
    print_out(&format!("{}\n", port.path()))?;
    let begun = Instant::now();
    let mut bytes = Vec::new();
    for count in 0u32.. {
        let index = count as usize;
        if interrupt.requested() || (index >= scene.frames && !arguments.repeat) {
            break;
        }
        let frame = pipeline.frame(index % scene.frames)?;
        let due = Duration::from_secs_f64(index as f64 / scene.frame_rate);
        std::thread::sleep(due.saturating_sub(begun.elapsed()));
        let seen = match &mut measurement {
            Some(measurement) => analogue(measurement, index as f64 / scene.frame_rate, &frame.capacitance),
            None => upper_triangle(scene.electrodes.len())
                .map(|(row, column)| Some(frame.capacitance.get(row, column)))
                .collect(),
        };
        let values = values(&profile, scene.electrodes.len(), &seen);
        bytes.clear();
        let sample = Sample { values: &values, sequence: Some(count), device_time: Some(due), status: 0 };
        encoder.encode(&sample, &mut bytes);
        // What nobody reads is lost, as with a board; the count of samples tells of it.
        port.send(&bytes).context("cannot write to the pseudo-terminal")?;
    }
    port.linger(LINGER, || !interrupt.requested()).context("cannot write to the pseudo-terminal")?;
    Ok(())
}

/// The upper triangle of the matrix as the scene's converters see it before they round, which is the board's own matter;
/// nothing for entries that they do not measure.
fn analogue(measurement: &mut Measurement, time_s: f64, capacitance: &CapacitanceMatrix) -> Vec<Option<f64>> {
    let readings = measurement.measure(time_s, capacitance).to_vec();
    let measured = |(row, column)| {
        let channel = measurement.channels().iter().position(|c| (c.row, c.column) == (row, column))?;
        Some(readings[channel].analogue_farads)
    };
    upper_triangle(capacitance.size()).map(measured).collect()
}

/// Boards with a fixed number of channels measure the self-capacitance of an electrode with each; those with any number
/// send the matrix's upper triangle in the order of `capacitance.csv`. `seen` is that triangle.
fn values(profile: &DeviceProfile, electrodes: usize, seen: &[Option<f64>]) -> Vec<Value> {
    let entries = || upper_triangle(electrodes).zip(seen);
    let value = |channel, farads: Option<f64>| match farads {
        Some(farads) => profile.raw(channel, farads),
        None => Value::Missing,
    };
    if profile.channels == 0 {
        return entries().enumerate().map(|(channel, (_, farads))| value(channel, *farads)).collect();
    }
    let own: Vec<Option<f64>> =
        entries().filter(|((row, column), _)| row == column).map(|(_, farads)| *farads).collect();
    (0..profile.channels).map(|channel| value(channel, own.get(channel).copied().flatten())).collect()
}
