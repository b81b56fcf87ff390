//! What the converters of a scene read, frame by frame.

use capsense::core::measurement::{Measurement, Reading};
use capsense::{Frame, Pipeline, Scene, SceneError};
use serde::Serialize;

/// Readings so far; none without a table `[measurement]` in the scene.
pub(super) struct MeasurementLog {
    measurement: Option<Measurement>,
    readings: Vec<Vec<Reading>>,
}

/// What `report.json` says of the converters.
#[derive(Serialize)]
pub(super) struct MeasurementReport {
    seed: u64,
    calibration_scans: u32,
    channels: Vec<ChannelReport>,
}

#[derive(Serialize)]
struct ChannelReport {
    electrodes: [String; 2],
    /// What the offset DAC is taken to subtract.
    offset_dac_farads: f64,
}

impl MeasurementLog {
    /// Sets and calibrates the converters by the sensor without objects.
    pub(super) fn new(scene: &Scene, pipeline: &Pipeline) -> Result<Self, SceneError> {
        let measurement = scene.measurement(pipeline.simulator().base())?;
        Ok(Self { measurement, readings: Vec::new() })
    }

    /// Notes what is read of a frame.
    pub(super) fn note(&mut self, frame: &Frame) {
        if let Some(measurement) = &mut self.measurement {
            self.readings.push(measurement.measure(frame.time_s, &frame.capacitance).to_vec());
        }
    }

    /// The readings of each frame; none where nothing reads.
    pub(super) fn of_frame(&self, frame: usize) -> Vec<Reading> {
        self.readings.get(frame).cloned().unwrap_or_default()
    }

    /// For `report.json`.
    pub(super) fn report(&self, scene: &Scene) -> Option<MeasurementReport> {
        let (measurement, model) = (self.measurement.as_ref()?, scene.measurement.as_ref()?);
        let dacs = measurement.channels().iter().zip(measurement.dac_farads());
        let channels = dacs.map(|(channel, offset_dac_farads)| ChannelReport {
            electrodes: [channel.row, channel.column].map(|index| scene.electrodes[index].clone()),
            offset_dac_farads,
        });
        Some(MeasurementReport {
            seed: model.seed,
            calibration_scans: model.calibration_scans,
            channels: channels.collect(),
        })
    }
}
