//! Electrodes from STL files: reading and units. What their outline is, is up to the core.

use super::check::Checker;
use super::source::SceneError;
use capsense_core::electrode::Sheet;
use capsense_core::geometry::TriangleMesh;
use capsense_core::glam::DVec3;
use capsense_core::units::LengthUnit;
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
    let surface = capsense_render::load_mesh(check.path(file), LengthUnit::Metre)
        .or_else(|error| check.error(&key, error.to_string()))?;
    let vertices = surface.vertices().iter().map(|&vertex| as_written(vertex) * unit.metres()).collect();
    TriangleMesh::new(vertices, surface.triangles().to_vec())
        .map_err(|error| error.to_string())
        .and_then(|surface| Sheet::of_surface(&surface).map_err(|error| error.to_string()))
        .or_else(|message| check.error(&key, format!("`{file}` {message}")))
}

/// STL files hold single-precision numbers. The shortest decimal that stands for one is what was meant: 0.1, not
/// 0.10000000149.
fn as_written(vertex: DVec3) -> DVec3 {
    let decimal = |coordinate: f64| (coordinate as f32).to_string().parse().unwrap_or(coordinate);
    DVec3::from_array(vertex.to_array().map(decimal))
}
