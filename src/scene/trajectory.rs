//! Trajectories: waypoints with a speed, or a table of poses over time.

use super::check::{Checker, unit_quaternion};
use super::raw::{RawTrajectory, Tuple};
use super::source::SceneError;
use crate::motion::Motion;
use capsense_core::geometry::Pose;
use capsense_core::glam::{DQuat, DVec3};

const POSITION: [&str; 4] = ["t", "x", "y", "z"];
const ROTATION: [&str; 4] = ["qx", "qy", "qz", "qw"];

/// The motion of an object; `rotation` is the one it keeps where the trajectory says nothing about it.
pub(super) fn motion(
    check: Checker<'_>,
    key: &str,
    raw: &RawTrajectory,
    rotation: DQuat,
) -> Result<Motion, SceneError> {
    match (&raw.file, &raw.waypoints) {
        (Some(_), Some(_)) => check.error(key, "has both `file` and `waypoints`; give one of them"),
        (None, None) => check.error(key, "needs a `file` or `waypoints`"),
        (None, Some(waypoints)) => along_waypoints(check, key, waypoints, raw.speed, rotation),
        (Some(_), None) if raw.speed.is_some() => {
            check.error(&format!("{key}.speed"), "goes with `waypoints`; a file has times of its own")
        }
        (Some(file), None) => {
            let bytes = check.read(&format!("{key}.file"), file)?;
            read_table(file, &bytes, rotation)
        }
    }
}

fn along_waypoints(
    check: Checker<'_>,
    key: &str,
    waypoints: &[Tuple<f64, 3>],
    speed: Option<f64>,
    rotation: DQuat,
) -> Result<Motion, SceneError> {
    let waypoints_key = format!("{key}.waypoints");
    if waypoints.is_empty() {
        return check.error(&waypoints_key, "must name at least one point");
    }
    let Some(speed) = speed else {
        return check.error(key, "waypoints need a `speed` in metres per second");
    };
    let speed = check.positive(&format!("{key}.speed"), speed)?;
    let points = waypoints
        .iter()
        .enumerate()
        .map(|(index, point)| check.finite3(&format!("{waypoints_key}[{index}]"), **point))
        .collect::<Result<Vec<_>, _>>()?;
    Motion::along(&points, speed, rotation).or_else(|error| check.error(&waypoints_key, error.to_string()))
}

/// Reads a CSV file with the columns t,x,y,z and perhaps qx,qy,qz,qw.
fn read_table(file: &str, bytes: &[u8], rotation: DQuat) -> Result<Motion, SceneError> {
    let complaint = |line: usize, column: Option<&str>, message: String| SceneError::Invalid {
        file: file.to_owned(),
        line,
        key: column.map(str::to_owned),
        message,
    };
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).flexible(true).from_reader(bytes);
    let header = reader.headers().map_err(|error| complaint(1, None, csv_message(&error)))?.clone();
    let names: Vec<&str> = header.iter().map(|name| name.trim_start_matches('\u{feff}')).collect();
    let with_rotation = names == [POSITION, ROTATION].concat();
    if !with_rotation && names != POSITION {
        let message = format!("the header must be t,x,y,z or t,x,y,z,qx,qy,qz,qw, not {:?}", names.join(","));
        return Err(complaint(1, None, message));
    }
    let mut samples: Vec<(f64, Pose)> = Vec::new();
    let mut record = csv::StringRecord::new();
    loop {
        let start = reader.position().byte();
        let complaint = |column: Option<&str>, message: String| {
            complaint(line_of_next_row(bytes, start), column, message)
        };
        match reader.read_record(&mut record) {
            Ok(true) => {}
            Ok(false) => break,
            Err(error) => return Err(complaint(None, csv_message(&error))),
        }
        if record.len() != names.len() {
            let message = format!("has {} columns, the header has {}", record.len(), names.len());
            return Err(complaint(None, message));
        }
        let mut numbers = [0.0; 8];
        for ((number, text), name) in numbers.iter_mut().zip(&record).zip(&names) {
            *number = finite_number(text).map_err(|message| complaint(Some(name), message))?;
        }
        let [time, x, y, z, quaternion @ ..] = numbers;
        if let Some((before, _)) = samples.last()
            && time <= *before
        {
            let message = format!("{time} s is not later than {before} s in the row before");
            return Err(complaint(Some("t"), message));
        }
        let rotation = if with_rotation {
            unit_quaternion(quaternion).map_err(|message| complaint(Some("qx,qy,qz,qw"), message))?
        } else {
            rotation
        };
        samples.push((time, Pose { translation: DVec3::new(x, y, z), rotation }));
    }
    Motion::sampled(samples).map_err(|error| complaint(1, None, format!("empty trajectory: {error}")))
}

/// The line of the row that begins at a byte or, as empty lines are skipped, after the line ends there.
fn line_of_next_row(bytes: &[u8], start: u64) -> usize {
    let (before, rest) = bytes.split_at((start as usize).min(bytes.len()));
    let empty = rest.iter().take_while(|byte| matches!(byte, b'\r' | b'\n'));
    1 + before.iter().chain(empty).filter(|byte| **byte == b'\n').count()
}

fn finite_number(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        Ok(number) => Err(format!("must be finite, not {number}")),
        Err(_) => Err(format!("`{text}` is not a number")),
    }
}

fn csv_message(error: &csv::Error) -> String {
    match error.kind() {
        csv::ErrorKind::Utf8 { .. } => "is not UTF-8 text".to_owned(),
        _ => error.to_string(),
    }
}
