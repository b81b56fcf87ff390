//! Objects: shape, material and motion.

use super::check::Checker;
use super::raw::{RawConnection, RawMaterial, RawObject};
use super::source::SceneError;
use super::trajectory;
use crate::motion::Motion;
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::glam::{DQuat, DVec3};
use capsense_core::material::{Connection, Material, RelativePermittivity};
use std::sync::Arc;

/// An object of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneObject {
    /// Unique name.
    pub name: String,
    /// Its shape, centred on its own origin.
    pub shape: Shape,
    /// What it is made of.
    pub material: Material,
    /// Where it is at each time.
    pub motion: Motion,
}

impl SceneObject {
    /// Whether a ball around the object reaches into the domain at any of some times.
    pub(super) fn meets(&self, domain: &Aabb, mut times: impl Iterator<Item = f64>) -> bool {
        let (centre, radius) = self.shape.bounding_ball();
        let reach = DVec3::splat(radius);
        times.any(|time| {
            let pose = self.motion.pose_at(time);
            let place = pose.translation + pose.rotation * centre;
            domain.intersects(&Aabb { min: place - reach, max: place + reach })
        })
    }
}

/// Objects that are not this large, in parts of the domain, were given in the wrong unit.
const PLAUSIBLE_SIZE: std::ops::RangeInclusive<f64> = 1e-3..=100.0;

/// Beyond these, which no material comes near, rounding spoils the solution.
const PLAUSIBLE_PERMITTIVITY: std::ops::RangeInclusive<f64> = 1e-9..=1e9;

pub(super) fn objects(
    check: Checker<'_>,
    raw: &[RawObject],
    domain: &Aabb,
) -> Result<Vec<SceneObject>, SceneError> {
    let names = raw.iter().map(|object| object.name.clone());
    check.unique(|index| format!("object[{index}].name"), names, "object")?;
    raw.iter()
        .enumerate()
        .map(|(index, raw)| object(check, &format!("object[{index}]"), raw, domain))
        .collect()
}

fn object(check: Checker<'_>, key: &str, raw: &RawObject, domain: &Aabb) -> Result<SceneObject, SceneError> {
    let name = check.name(&format!("{key}.name"), &raw.name)?;
    let shape = shape(check, key, raw, domain)?;
    let material = material(check, &format!("{key}.material"), &raw.material)?;
    let position = match raw.position {
        Some(position) => Some(check.finite3(&format!("{key}.position"), *position)?),
        None => None,
    };
    let rotation = match raw.rotation {
        Some(rotation) => check.rotation(&format!("{key}.rotation"), *rotation)?,
        None => DQuat::IDENTITY,
    };
    let motion = match (&raw.trajectory, position) {
        (Some(raw), _) => trajectory::motion(check, &format!("{key}.trajectory"), raw, rotation)?,
        (None, Some(translation)) => Motion::still(Pose { translation, rotation }),
        (None, None) => return check.error(key, "needs a `position` or a `trajectory`"),
    };
    Ok(SceneObject { name, shape, material, motion })
}

fn shape(check: Checker<'_>, key: &str, raw: &RawObject, domain: &Aabb) -> Result<Shape, SceneError> {
    let given: Vec<&str> = [
        ("box", raw.cuboid.is_some()),
        ("sphere", raw.sphere.is_some()),
        ("capsule", raw.capsule.is_some()),
        ("cylinder", raw.cylinder.is_some()),
        ("file", raw.file.is_some()),
    ]
    .into_iter()
    .filter_map(|(name, given)| given.then_some(name))
    .collect();
    if given.len() > 1 {
        return check.error(key, format!("has {} shapes ({}); give one", given.len(), given.join(", ")));
    }
    if raw.unit.is_some() && raw.file.is_none() {
        return check.error(&format!("{key}.unit"), "goes with `file`; all other lengths are in metres");
    }
    if let Some(file) = &raw.file {
        return surface(check, key, file, raw.unit.as_deref(), domain);
    }
    let Some(shape) = solid(check, key, raw)? else {
        return check.error(key, "has no shape: give `box`, `sphere`, `capsule`, `cylinder` or `file`");
    };
    let size = 2.0 * shape.bounding_radius();
    if !PLAUSIBLE_SIZE.contains(&(size / domain.size().max_element())) {
        let message = format!("is {size:e} m large, the domain {:?} m", domain.size().to_array());
        return check.error(&format!("{key}.{}", given[0]), format!("{message}; lengths are in metres"));
    }
    Ok(shape)
}

/// The shape that is given by its lengths, if one is.
fn solid(check: Checker<'_>, key: &str, raw: &RawObject) -> Result<Option<Shape>, SceneError> {
    let positive = |name: &str, value: f64| check.positive(&format!("{key}.{name}"), value);
    let shape = if let Some(cuboid) = &raw.cuboid {
        Shape::Box { size: check.positive3(&format!("{key}.box.size"), *cuboid.size)? }
    } else if let Some(sphere) = &raw.sphere {
        Shape::Sphere { radius: positive("sphere.radius", sphere.radius)? }
    } else if let Some(rod) = &raw.capsule {
        let radius = positive("capsule.radius", rod.radius)?;
        Shape::Capsule { radius, length: positive("capsule.length", rod.length)? }
    } else if let Some(rod) = &raw.cylinder {
        let radius = positive("cylinder.radius", rod.radius)?;
        Shape::Cylinder { radius, length: positive("cylinder.length", rod.length)? }
    } else {
        return Ok(None);
    };
    Ok(Some(shape))
}

fn surface(
    check: Checker<'_>,
    key: &str,
    file: &str,
    unit: Option<&str>,
    domain: &Aabb,
) -> Result<Shape, SceneError> {
    let unit_key = format!("{key}.unit");
    let unit = check.unit(&unit_key, unit)?;
    let mesh = capsense_render::load_mesh(check.path(file), unit)
        .or_else(|error| check.error(&format!("{key}.file"), error.to_string()))?;
    let size = Aabb::around(mesh.vertices().iter().copied()).size().max_element();
    let part = size / domain.size().max_element();
    if !PLAUSIBLE_SIZE.contains(&part) {
        let message =
            format!("`{file}` is {size} m long in `{unit}`, the domain {:?} m", domain.size().to_array());
        return check.error(&unit_key, format!("{message}: wrong unit?"));
    }
    Ok(Shape::Mesh(Arc::new(mesh)))
}

fn material(check: Checker<'_>, key: &str, raw: &RawMaterial) -> Result<Material, SceneError> {
    match (raw.conductor, raw.relative_permittivity) {
        (Some(_), Some(_)) => {
            check.error(key, "is either a `conductor` or has a `relative_permittivity`, not both")
        }
        (None, None) => check.error(key, "needs `conductor` or `relative_permittivity`"),
        (Some(RawConnection::Grounded), None) => Ok(Material::Conductor(Connection::Grounded)),
        (Some(RawConnection::Floating), None) => Ok(Material::Conductor(Connection::Floating)),
        (Some(RawConnection::Capacitance(farads)), None) => {
            let farads = check.not_negative(&format!("{key}.conductor.capacitance"), farads)?;
            Ok(Material::Conductor(Connection::Capacitance(farads)))
        }
        (None, Some(value)) => {
            let key = format!("{key}.relative_permittivity");
            permittivity(check, &key, value).map(Material::Dielectric)
        }
    }
}

pub(super) fn permittivity(
    check: Checker<'_>,
    key: &str,
    value: f64,
) -> Result<RelativePermittivity, SceneError> {
    let value = check.positive(key, value)?;
    match RelativePermittivity::new(value) {
        Some(permittivity) if PLAUSIBLE_PERMITTIVITY.contains(&value) => Ok(permittivity),
        _ => {
            let (least, most) = (PLAUSIBLE_PERMITTIVITY.start(), PLAUSIBLE_PERMITTIVITY.end());
            check.error(key, format!("must be from {least:e} to {most:e}, but is {value:e}"))
        }
    }
}
