//! Checks of single numbers and paths; every complaint carries the key.

use super::source::{SceneError, Source};
use capsense_core::glam::{DQuat, DVec2, DVec3};
use capsense_core::units::LengthUnit;
use std::path::{Path, PathBuf};

/// A quaternion's length may differ from one by this much: that is rounding, and is mended.
const ALMOST_UNIT: f64 = 1e-3;

/// The file that is being checked, and the folder that paths in it are relative to.
#[derive(Clone, Copy)]
pub(super) struct Checker<'a> {
    pub(super) source: &'a Source,
    pub(super) folder: &'a Path,
}

impl Checker<'_> {
    pub(super) fn error<T>(&self, key: &str, message: impl Into<String>) -> Result<T, SceneError> {
        Err(self.source.error(key, message))
    }

    pub(super) fn finite(&self, key: &str, value: f64) -> Result<f64, SceneError> {
        if value.is_finite() { Ok(value) } else { self.error(key, format!("must be finite, not {value}")) }
    }

    pub(super) fn positive(&self, key: &str, value: f64) -> Result<f64, SceneError> {
        if self.finite(key, value)? > 0.0 {
            Ok(value)
        } else {
            self.error(key, format!("must be greater than zero, not {value}"))
        }
    }

    pub(super) fn not_negative(&self, key: &str, value: f64) -> Result<f64, SceneError> {
        if self.finite(key, value)? >= 0.0 {
            Ok(value)
        } else {
            self.error(key, format!("must not be negative, but is {value}"))
        }
    }

    /// A number strictly between zero and one.
    pub(super) fn fraction(&self, key: &str, value: f64) -> Result<f64, SceneError> {
        if self.finite(key, value)? > 0.0 && value < 1.0 {
            Ok(value)
        } else {
            self.error(key, format!("must lie between 0 and 1, but is {value}"))
        }
    }

    pub(super) fn count(
        &self,
        key: &str,
        value: i64,
        smallest: usize,
        largest: usize,
    ) -> Result<usize, SceneError> {
        match usize::try_from(value) {
            Ok(count) if (smallest..=largest).contains(&count) => Ok(count),
            _ => self.error(key, format!("must be from {smallest} to {largest}, but is {value}")),
        }
    }

    fn each<const N: usize>(
        &self,
        key: &str,
        values: [f64; N],
        check: impl Fn(&str, f64) -> Result<f64, SceneError>,
    ) -> Result<[f64; N], SceneError> {
        for (index, value) in values.into_iter().enumerate() {
            check(&format!("{key}[{index}]"), value)?;
        }
        Ok(values)
    }

    pub(super) fn finite2(&self, key: &str, values: [f64; 2]) -> Result<DVec2, SceneError> {
        Ok(DVec2::from_array(self.each(key, values, |key, value| self.finite(key, value))?))
    }

    pub(super) fn positive2(&self, key: &str, values: [f64; 2]) -> Result<DVec2, SceneError> {
        Ok(DVec2::from_array(self.each(key, values, |key, value| self.positive(key, value))?))
    }

    pub(super) fn finite3(&self, key: &str, values: [f64; 3]) -> Result<DVec3, SceneError> {
        Ok(DVec3::from_array(self.each(key, values, |key, value| self.finite(key, value))?))
    }

    pub(super) fn positive3(&self, key: &str, values: [f64; 3]) -> Result<DVec3, SceneError> {
        Ok(DVec3::from_array(self.each(key, values, |key, value| self.positive(key, value))?))
    }

    pub(super) fn rotation(&self, key: &str, values: [f64; 4]) -> Result<DQuat, SceneError> {
        let values = self.each(key, values, |key, value| self.finite(key, value))?;
        unit_quaternion(values).or_else(|message| self.error(key, message))
    }

    /// A name that can head a column: not empty, no control characters.
    pub(super) fn name(&self, key: &str, name: &str) -> Result<String, SceneError> {
        if name.trim().is_empty() {
            self.error(key, "must not be empty")
        } else if name.chars().any(char::is_control) {
            self.error(key, "must not contain control characters")
        } else {
            Ok(name.to_owned())
        }
    }

    pub(super) fn unit(&self, key: &str, unit: Option<&str>) -> Result<LengthUnit, SceneError> {
        match unit.map(str::parse::<LengthUnit>) {
            None => Ok(LengthUnit::default()),
            Some(Ok(unit)) => Ok(unit),
            Some(Err(unknown)) => self.error(key, unknown.to_string()),
        }
    }

    /// Path of a file that the scene names, relative to the scene's folder.
    pub(super) fn path(&self, written: &str) -> PathBuf {
        self.folder.join(written)
    }

    /// Reads a file that the scene names.
    pub(super) fn read(&self, key: &str, written: &str) -> Result<Vec<u8>, SceneError> {
        let path = self.path(written);
        std::fs::read(&path).or_else(|error| {
            self.error(key, format!("cannot read `{written}` ({}): {error}", path.display()))
        })
    }

    /// Finds the name that occurs twice.
    pub(super) fn unique(
        &self,
        key_of: impl Fn(usize) -> String,
        names: impl Iterator<Item = String>,
        what: &str,
    ) -> Result<(), SceneError> {
        let mut seen = std::collections::HashSet::new();
        for (index, name) in names.enumerate() {
            if seen.contains(&name) {
                return self.error(&key_of(index), format!("another {what} is already named `{name}`"));
            }
            seen.insert(name);
        }
        Ok(())
    }
}

/// x, y, z, w to a rotation of unit length.
pub(super) fn unit_quaternion(values: [f64; 4]) -> Result<DQuat, String> {
    let quaternion = DQuat::from_array(values);
    let length = quaternion.length();
    // NaN fails this test too.
    if (length - 1.0).abs() <= ALMOST_UNIT {
        Ok(quaternion.normalize())
    } else {
        Err(format!("must be a quaternion of unit length, but its length is {length}"))
    }
}
