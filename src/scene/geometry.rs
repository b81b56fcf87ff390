//! Where a scene's surfaces come from: the depth camera, or the solids themselves.

use super::check::Checker;
use super::object::SceneObject;
use super::raw::{RawGeometry, RawScene};
use super::source::SceneError;
use capsense_core::geometry::Shape;
use capsense_core::solids::{SolidError, Solids};

/// Where surfaces come from.
#[derive(Clone, Debug)]
pub enum Geometry {
    /// A depth camera draws the objects.
    Camera,
    /// Exact solids, one for each object.
    Solids(Solids),
}

/// What finds the surfaces of objects.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum GeometrySource {
    /// The depth camera.
    #[default]
    Camera,
    /// The solids themselves.
    Solids,
}

impl GeometrySource {
    /// That of a scene.
    pub fn of(geometry: &Geometry) -> Self {
        match geometry {
            Geometry::Camera => Self::Camera,
            Geometry::Solids(_) => Self::Solids,
        }
    }

    /// The name in scene files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Camera => "camera",
            Self::Solids => "solids",
        }
    }
}

pub(super) fn geometry(
    check: Checker<'_>,
    raw: &RawScene,
    objects: &[SceneObject],
    warnings: &mut Vec<String>,
) -> Result<Geometry, SceneError> {
    if raw.simulation.geometry != Some(RawGeometry::Solids) {
        return Ok(Geometry::Camera);
    }
    if raw.simulation.back_fill == Some(true) {
        let message =
            "must not be true with simulation.geometry = \"solids\": solids have backs of their own";
        return check.error("simulation.back_fill", message);
    }
    let keys = [
        ("camera.pixels", raw.camera.pixels.is_some()),
        ("camera.layers", raw.camera.layers.is_some()),
        ("simulation.back_fill", raw.simulation.back_fill.is_some()),
    ];
    for (key, _) in keys.into_iter().filter(|(_, given)| *given) {
        let (file, line) = (check.source.file(), check.source.line(key));
        warnings.push(format!("{file}:{line}: {key} is ignored: simulation.geometry is \"solids\""));
    }
    let shapes: Vec<Shape> = objects.iter().map(|object| object.shape.clone()).collect();
    match Solids::new(&shapes) {
        Ok(solids) => Ok(Geometry::Solids(solids)),
        Err(SolidError::NotWatertight { object, edges }) => {
            let file = raw.object[object].file.as_deref().unwrap_or_default();
            let message = format!(
                "`{file}` is not watertight ({edges}), as simulation.geometry = \"solids\" needs it; \"camera\" does not"
            );
            check.error(&format!("object[{object}].file"), message)
        }
        Err(error) => check.error("simulation.geometry", error.to_string()),
    }
}
