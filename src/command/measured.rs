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

    /// Names of the columns: `raw_A_B`, where there are codes, and `measured_A_B_F`.
    pub(super) fn columns(&self, scene: &Scene) -> Vec<String> {
        let has_codes = scene.measurement.as_ref().is_some_and(|model| model.converter.is_some());
        let channels = self.measurement.iter().flat_map(Measurement::channels);
        let of_channel = channels.flat_map(|channel| {
            let [first, second] = [channel.row, channel.column].map(|index| &scene.electrodes[index]);
            let raw = has_codes.then(|| format!("raw_{first}_{second}"));
            raw.into_iter().chain([format!("measured_{first}_{second}_F")])
        });
        of_channel.collect()
    }

    /// A frame's values in the order of the columns; frames are counted as they were noted.
    pub(super) fn values(&self, frame: usize) -> impl Iterator<Item = String> {
        self.readings.get(frame).into_iter().flatten().flat_map(|reading| {
            let raw = reading.raw.map(|code| code.to_string());
            raw.into_iter().chain([format!("{:e}", reading.farads)])
        })
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
