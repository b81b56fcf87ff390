//! Domain, electrodes and board: the sensor as it is meant to be.

use super::check::Checker;
use super::electrode_stl;
use super::object::permittivity;
use super::raw::{RawBack, RawDomain, RawElectrode, RawSensor, RawSubstrate, RawWall, Tuple};
use super::source::{SceneError, Source};
use capsense_core::electrode::{Electrode, Outline};
use capsense_core::geometry::Aabb;
use capsense_core::glam::DVec3;
use capsense_core::sensor::{SensorError, Substrate, Wall};

/// The domain when the scene names none: a cube of 0.5 m, its floor 50 mm below the sensing surface.
pub(super) const DEFAULT_DOMAIN: Aabb =
    Aabb { min: DVec3::new(-0.25, -0.25, -0.05), max: DVec3::new(0.25, 0.25, 0.45) };

/// Names that `mesh.groups` needs for other things.
const RESERVED: [&str; 2] = ["ground", "substrate"];

/// The domain, if the scene gives one.
pub(super) fn domain(check: Checker<'_>, raw: &RawDomain) -> Result<Option<Aabb>, SceneError> {
    let (min, max) = match (raw.min, raw.max) {
        (None, None) => return Ok(None),
        (Some(min), Some(max)) => (check.finite3("domain.min", *min)?, check.finite3("domain.max", *max)?),
        (given, _) => {
            let [given, missing] = if given.is_some() { ["min", "max"] } else { ["max", "min"] };
            return check
                .error(&format!("domain.{given}"), format!("goes with `{missing}`; give both or neither"));
        }
    };
    match (0..3).find(|&axis| min[axis] >= max[axis]) {
        Some(axis) => check.error(
            &format!("domain.max[{axis}]"),
            format!("must be greater than domain.min[{axis}] = {}, but is {}", min[axis], max[axis]),
        ),
        None => Ok(Some(Aabb { min, max })),
    }
}

/// What lies beyond the wall of the domain.
pub(super) fn wall(raw: &RawDomain) -> Wall {
    match raw.wall {
        RawWall::Grounded => Wall::Grounded,
        RawWall::Open => Wall::Open,
    }
}

/// Names of the electrodes, in their order.
pub(super) fn electrode_names(check: Checker<'_>, raw: &RawSensor) -> Result<Vec<String>, SceneError> {
    if raw.electrode.is_empty() {
        return check.error("sensor.electrode", "the scene has no electrodes");
    }
    let names = raw
        .electrode
        .iter()
        .enumerate()
        .map(|(index, electrode)| {
            let key = format!("sensor.electrode[{index}].name");
            let name = check.name(&key, &electrode.name)?;
            if RESERVED.contains(&name.as_str()) {
                return check.error(&key, format!("`{name}` is not a name for an electrode"));
            }
            Ok(name)
        })
        .collect::<Result<Vec<_>, _>>()?;
    let key = |index| format!("sensor.electrode[{index}].name");
    check.unique(key, names.iter().cloned(), "electrode")?;
    Ok(names)
}

/// The shape of one electrode, if it has any.
pub(super) fn electrode(
    check: Checker<'_>,
    key: &str,
    raw: &RawElectrode,
) -> Result<Option<Electrode>, SceneError> {
    let shapes = [raw.rectangle.is_some(), raw.disk.is_some(), raw.polygon.is_some(), raw.stl.is_some()];
    let given = shapes.into_iter().filter(|given| *given).count();
    if given > 1 {
        return check.error(key, format!("has {given} shapes; give one"));
    }
    if raw.unit.is_some() && raw.stl.is_none() {
        return check.error(&format!("{key}.unit"), "goes with `stl`; all other lengths are in metres");
    }
    let z = raw.z.map(|z| check.finite(&format!("{key}.z"), z)).transpose()?;
    if let Some(file) = &raw.stl {
        let sheet = electrode_stl::sheet(check, key, file, raw.unit.as_deref())?;
        let electrode = Electrode { name: raw.name.clone(), outline: sheet.outline, z: z.unwrap_or(sheet.z) };
        return Ok(Some(electrode));
    }
    let outline = if let Some(rectangle) = &raw.rectangle {
        Outline::Rectangle {
            center: check.finite2(&format!("{key}.rectangle.center"), *rectangle.center)?,
            size: check.positive2(&format!("{key}.rectangle.size"), *rectangle.size)?,
        }
    } else if let Some(disk) = &raw.disk {
        Outline::Disk {
            center: check.finite2(&format!("{key}.disk.center"), *disk.center)?,
            radius: check.positive(&format!("{key}.disk.radius"), disk.radius)?,
        }
    } else if let Some(polygon) = &raw.polygon {
        let corner = |(index, corner): (usize, &Tuple<f64, 2>)| {
            check.finite2(&format!("{key}.polygon[{index}]"), **corner)
        };
        let mut corners = polygon.iter().enumerate().map(corner).collect::<Result<Vec<_>, _>>()?;
        // Some close an outline by its first corner.
        corners.pop_if(|last| {
            polygon.len() > 3 && polygon.first().is_some_and(|first| **first == last.to_array())
        });
        Outline::Polygon(corners)
    } else {
        return Ok(None);
    };
    Ok(Some(Electrode { name: raw.name.clone(), outline, z: z.unwrap_or(0.0) }))
}

pub(super) fn substrate(check: Checker<'_>, raw: &RawSubstrate) -> Result<Substrate, SceneError> {
    let key = |name: &str| format!("sensor.substrate.{name}");
    Ok(Substrate {
        thickness: check.positive(&key("thickness"), raw.thickness)?,
        relative_permittivity: permittivity(check, &key("relative_permittivity"), raw.relative_permittivity)?,
        size: check.positive2(&key("size"), *raw.size)?,
        grounded_back: raw.back == RawBack::Grounded,
    })
}

/// Says which key of the scene a complaint of the core is about.
pub(super) fn locate(source: &Source, names: &[String], error: &SensorError) -> SceneError {
    let electrode = |name: &String| match names.iter().position(|known| known == name) {
        Some(index) => format!("sensor.electrode[{index}]"),
        None => "sensor".to_owned(),
    };
    let key = match error {
        SensorError::NoElectrodes | SensorError::TooManyElectrodes(_) => "sensor.electrode".to_owned(),
        SensorError::DuplicateName(name)
        | SensorError::Outline { name, .. }
        | SensorError::OutsideDomain(name)
        | SensorError::TouchesWall(name)
        | SensorError::OwnsNoNode(name)
        | SensorError::Alone(name)
        | SensorError::SharedNode { second: name, .. }
        | SensorError::Meet { second: name, .. }
        | SensorError::NodeOutOfRange { name, .. } => electrode(name),
        SensorError::Substrate(_) => "sensor.substrate".to_owned(),
        SensorError::Domain => "domain".to_owned(),
        SensorError::NoWall => "domain.wall".to_owned(),
        SensorError::TooFewElements { .. } => "mesh.generate.elements".to_owned(),
        SensorError::NoGroundReachable { .. } | SensorError::Lattice(_) | SensorError::Mesh(_) => {
            "mesh".to_owned()
        }
    };
    let message = match error {
        SensorError::OutsideDomain(_) | SensorError::TouchesWall(_)
            if source.names(&format!("{key}.stl")) && !source.names(&format!("{key}.unit")) =>
        {
            format!("{error}; the file is read in metres, as no `unit` is given")
        }
        _ => error.to_string(),
    };
    source.error(&key, message)
}
