//! Electrodes from STL files: reading and units. What their outline is, is up to the core.

use super::check::Checker;
use super::source::SceneError;
use capsense_core::electrode::Sheet;
use std::path::Path;

/// Reads the STL file of the electrode with this key.
pub(super) fn sheet(
    check: Checker<'_>,
    key: &str,
    file: &str,
    unit: Option<&str>,
) -> Result<Sheet, SceneError> {
    let unit = check.unit(&format!("{key}.unit"), unit)?;
    let key = format!("{key}.stl");
    // The reader knows other kinds of files too; this key does not.
    if !Path::new(file).extension().is_some_and(|extension| extension.eq_ignore_ascii_case("stl")) {
        return check.error(&key, format!("`{file}` must end in .stl"));
    }
    let surface = capsense_render::load_mesh(check.path(file), unit)
        .or_else(|error| check.error(&key, error.to_string()))?;
    Sheet::of_surface(&surface).or_else(|error| check.error(&key, format!("`{file}` {error}")))
}
