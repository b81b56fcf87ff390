//! `capacitance.csv`: one row for each frame, upper triangle of the Maxwell matrix in farads; at the end what converters read.

use super::measured::MeasurementLog;
use capsense::{Frame, Scene};

/// The index pairs of the upper triangle, row by row.
pub(super) fn upper_triangle(size: usize) -> impl Iterator<Item = (usize, usize)> + Clone {
    (0..size).flat_map(move |row| (row..size).map(move |column| (row, column)))
}

/// The table, every number in the shortest form that reads back to the same value.
pub(super) fn csv_table(
    scene: &Scene,
    frames: &[Frame],
    measured: &MeasurementLog,
) -> Result<Vec<u8>, csv::Error> {
    let electrodes = &scene.electrodes;
    let mut writer = csv::Writer::from_writer(Vec::new());
    let entries = upper_triangle(electrodes.len());
    let names =
        entries.clone().map(|(row, column)| format!("C_{}_{}_F", electrodes[row], electrodes[column]));
    let before = ["frame", "time_s"].map(str::to_owned);
    let after = ["changed_edges", "iterations", "geometry_ms", "update_ms", "solve_ms"].map(str::to_owned);
    writer.write_record(before.into_iter().chain(names).chain(after).chain(measured.columns(scene)))?;
    for (index, frame) in frames.iter().enumerate() {
        let farads = entries.clone().map(|(row, column)| format!("{:e}", frame.capacitance.get(row, column)));
        let before = [frame.index.to_string(), frame.time_s.to_string()];
        let took = &frame.milliseconds;
        let after = [
            frame.changed_edges.to_string(),
            frame.solve.iterations.to_string(),
            took.geometry.to_string(),
            took.update.to_string(),
            took.solve.to_string(),
        ];
        writer.write_record(before.into_iter().chain(farads).chain(after).chain(measured.values(index)))?;
    }
    Ok(writer.into_inner().map_err(|error| error.into_error())?)
}
