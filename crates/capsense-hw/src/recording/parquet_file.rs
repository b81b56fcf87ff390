//! Recordings as Parquet files, with the columns of the CSV files.

use super::export::{ExportReport, cell, flags, open, value_suffix};
use super::{Decoded, RecordingError};
use crate::profile::DeviceProfile;
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::parser::parse_message_type;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

/// Samples that are in memory together.
const ROW_GROUP: usize = 16 * 1024;

/// Writes a recording as a Parquet file. With a profile the bytes are decoded by it in place of the recording's own.
///
/// # Errors
/// When the recording cannot be read or the file cannot be written.
pub fn export_parquet(
    recording: &Path,
    profile: Option<&DeviceProfile>,
    out: &Path,
) -> Result<ExportReport, RecordingError> {
    let (mut samples, channels) = open(recording, profile)?;
    let profile = samples.profile().clone();
    let failed = |error| RecordingError::Parquet { path: out.to_owned(), error };
    let schema = Arc::new(parse_message_type(&schema(&profile, channels)).map_err(failed)?);
    let file = File::create(out).map_err(RecordingError::file(out))?;
    let properties = Arc::new(WriterProperties::builder().build());
    let mut writer = SerializedFileWriter::new(file, schema, properties).map_err(failed)?;
    let mut report = ExportReport { samples: 0, channels };
    loop {
        let rows: Vec<Decoded> = samples.by_ref().take(ROW_GROUP).collect::<Result<_, _>>()?;
        if rows.is_empty() {
            break;
        }
        report.samples += rows.len() as u64;
        let mut group = writer.next_row_group().map_err(failed)?;
        write_rows(&mut group, &profile, channels, &rows).map_err(failed)?;
        group.close().map_err(failed)?;
    }
    writer.close().map_err(failed)?;
    Ok(report)
}

fn schema(profile: &DeviceProfile, channels: usize) -> String {
    let mut text = String::from(
        "message recording { REQUIRED DOUBLE time_s; OPTIONAL DOUBLE device_time_s; OPTIONAL INT64 sequence; \
         REQUIRED INT64 status;",
    );
    for channel in 1..=channels {
        text += &format!(" OPTIONAL DOUBLE C{channel}_raw;");
        if let Some(suffix) = value_suffix(profile.meaning) {
            text += &format!(" OPTIONAL DOUBLE C{channel}_{suffix};");
        }
    }
    text + " REQUIRED BYTE_ARRAY flags (UTF8); }"
}

fn write_rows(
    group: &mut SerializedRowGroupWriter<'_, File>,
    profile: &DeviceProfile,
    channels: usize,
    rows: &[Decoded],
) -> Result<(), ParquetError> {
    let seconds = |time: std::time::Duration| time.as_secs_f64();
    required::<DoubleType>(group, rows.iter().map(|row| seconds(row.time)))?;
    optional::<DoubleType>(group, rows.iter().map(|row| row.device_time.map(seconds)))?;
    optional::<Int64Type>(group, rows.iter().map(|row| row.sequence.map(i64::from)))?;
    required::<Int64Type>(group, rows.iter().map(|row| row.status.into()))?;
    for channel in 0..channels {
        optional::<DoubleType>(group, rows.iter().map(|row| cell(profile, row, channel)[0]))?;
        if value_suffix(profile.meaning).is_some() {
            optional::<DoubleType>(group, rows.iter().map(|row| cell(profile, row, channel)[1]))?;
        }
    }
    required::<ByteArrayType>(group, rows.iter().map(|row| ByteArray::from(flags(profile, row).into_bytes())))
}

/// Writes the next column, which has a value in every row.
fn required<T: DataType>(
    group: &mut SerializedRowGroupWriter<'_, File>,
    values: impl Iterator<Item = T::T>,
) -> Result<(), ParquetError> {
    let values: Vec<T::T> = values.collect();
    write_column::<T>(group, &values, None)
}

/// Writes the next column, which may have none.
fn optional<T: DataType>(
    group: &mut SerializedRowGroupWriter<'_, File>,
    values: impl Iterator<Item = Option<T::T>>,
) -> Result<(), ParquetError> {
    let cells: Vec<Option<T::T>> = values.collect();
    let levels: Vec<i16> = cells.iter().map(|cell| cell.is_some().into()).collect();
    let values: Vec<T::T> = cells.into_iter().flatten().collect();
    write_column::<T>(group, &values, Some(&levels))
}

fn write_column<T: DataType>(
    group: &mut SerializedRowGroupWriter<'_, File>,
    values: &[T::T],
    levels: Option<&[i16]>,
) -> Result<(), ParquetError> {
    let column = group.next_column()?;
    let mut column = column.ok_or_else(|| ParquetError::General("a column too many".to_owned()))?;
    column.typed::<T>().write_batch(values, levels, None)?;
    column.close()
}
