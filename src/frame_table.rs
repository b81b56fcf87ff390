//! `capacitance.csv`: one row for each frame, upper triangle of the Maxwell matrix in farads; at the end what converters read.

use crate::pipeline::{Frame, Milliseconds};
use capsense_core::capacitance::upper_triangle;
use capsense_core::measurement::{MeasurementModel, Reading};

/// One row.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameRow {
    /// Number of the frame.
    pub frame: usize,
    /// Time in seconds.
    pub time_s: f64,
    /// Upper triangle of the Maxwell matrix, row by row, in farads.
    pub farads: Vec<f64>,
    /// Edges of the mesh that changed.
    pub changed_edges: usize,
    /// Iterations of the solver.
    pub iterations: usize,
    /// Where the time went.
    pub milliseconds: Milliseconds,
    /// What converters read, channel by channel.
    pub readings: Vec<Reading>,
}

impl FrameRow {
    /// That of a frame.
    pub fn new(frame: &Frame, readings: Vec<Reading>) -> Self {
        Self {
            frame: frame.index,
            time_s: frame.time_s,
            farads: frame.capacitance.upper(),
            changed_edges: frame.changed_edges,
            iterations: frame.solve.iterations,
            milliseconds: frame.milliseconds,
            readings,
        }
    }
}

/// The table, every number in the shortest form that reads back to the same value.
///
/// # Errors
/// When rows are of other numbers of electrodes or channels than the header.
pub fn frame_table(
    electrodes: &[String],
    converters: Option<&MeasurementModel>,
    rows: impl IntoIterator<Item = FrameRow>,
) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let entries = upper_triangle(electrodes.len());
    let names = entries.map(|(row, column)| format!("C_{}_{}_F", electrodes[row], electrodes[column]));
    let before = ["frame", "time_s"].map(str::to_owned);
    let after = ["changed_edges", "iterations", "geometry_ms", "update_ms", "solve_ms"].map(str::to_owned);
    let read = converters.map_or_else(Vec::new, |model| columns(electrodes, model));
    writer.write_record(before.into_iter().chain(names).chain(after).chain(read))?;
    for row in rows {
        let before = [row.frame.to_string(), row.time_s.to_string()];
        let farads = row.farads.iter().map(|farads| format!("{farads:e}"));
        let Milliseconds { geometry, update, solve, .. } = row.milliseconds;
        let counts = [row.changed_edges, row.iterations].map(|count| count.to_string());
        let took = [geometry, update, solve].map(|milliseconds| milliseconds.to_string());
        let read = row.readings.iter().flat_map(|reading| {
            let raw = reading.raw.map(|code| code.to_string());
            raw.into_iter().chain([format!("{:e}", reading.farads)])
        });
        writer.write_record(before.into_iter().chain(farads).chain(counts).chain(took).chain(read))?;
    }
    Ok(writer.into_inner().map_err(|error| error.into_error())?)
}

/// `raw_A_B`, where there are codes, and `measured_A_B_F`, of each channel.
fn columns(electrodes: &[String], model: &MeasurementModel) -> Vec<String> {
    let of_channel = model.channels.iter().flat_map(|channel| {
        let [first, second] = [channel.row, channel.column].map(|index| &electrodes[index]);
        let raw = model.converter.as_ref().map(|_| format!("raw_{first}_{second}"));
        raw.into_iter().chain([format!("measured_{first}_{second}_F")])
    });
    of_channel.collect()
}
