//! What a sensor is meant to be, before it has a mesh: its electrodes and the board below them.

use super::{FREE, IN_PLANE, SensorError, Wall};
use crate::electrode::Electrode;
use crate::geometry::Aabb;
use crate::material::RelativePermittivity;
use glam::{DVec2, DVec3};

/// The board below the electrodes: its top is the plane z = 0, its centre the sensor's axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Substrate {
    /// Thickness in metres.
    pub thickness: f64,
    /// Relative permittivity of the board.
    pub relative_permittivity: RelativePermittivity,
    /// Extent along x and y in metres.
    pub size: DVec2,
    /// Whether its far side is a grounded shield plane.
    pub grounded_back: bool,
}

impl Substrate {
    /// The space the board takes.
    pub fn bounds(&self) -> Aabb {
        let half = 0.5 * self.size;
        Aabb { min: (-half).extend(-self.thickness), max: half.extend(0.0) }
    }

    /// Whether a point lies on the far side, give or take `slack` metres.
    pub fn is_on_back(&self, point: DVec3, slack: f64) -> bool {
        (point.z + self.thickness).abs() <= slack
            && (point.truncate().abs() - 0.5 * self.size).max_element() <= slack
    }
}

/// What a sensor is meant to be, before it has a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorDesign {
    /// The simulated space.
    pub domain: Aabb,
    /// Electrodes in the order of the capacitance matrix.
    pub electrodes: Vec<Electrode>,
    /// The board below them.
    pub substrate: Option<Substrate>,
    /// What lies beyond the wall of the simulated space.
    pub wall: Wall,
}

impl SensorDesign {
    /// Checks what can be checked without a mesh.
    ///
    /// # Errors
    /// For an empty domain, no electrodes, names that repeat, unusable outlines, electrodes that touch each other or the wall or
    /// lie outside, and a board that does not fit.
    pub fn validate(&self) -> Result<(), SensorError> {
        let Aabb { min, max } = self.domain;
        if !(min.is_finite() && max.is_finite() && min.cmplt(max).all()) {
            return Err(SensorError::Domain);
        }
        check_names(self.electrodes.iter().map(|electrode| electrode.name.as_str()))?;
        for electrode in &self.electrodes {
            self.check_place(electrode)?;
        }
        let slack = IN_PLANE * self.domain.size().max_element();
        for (number, first) in self.electrodes.iter().enumerate() {
            let meets = |other: &&Electrode| {
                (other.z - first.z).abs() <= slack && first.outline.meets(&other.outline)
            };
            if let Some(second) = self.electrodes[number + 1..].iter().find(meets) {
                return Err(SensorError::Meet { first: first.name.clone(), second: second.name.clone() });
            }
        }
        if let Some(board) = &self.substrate {
            let bounds = board.bounds();
            if !(board.thickness > 0.0 && board.size.min_element() > 0.0 && bounds.min.is_finite()) {
                return Err(SensorError::Substrate("must have a positive thickness and size"));
            }
            if !(self.domain.contains(bounds.min) && self.domain.contains(bounds.max)) {
                return Err(SensorError::Substrate("reaches out of the domain"));
            }
        }
        Ok(())
    }

    fn check_place(&self, electrode: &Electrode) -> Result<(), SensorError> {
        let name = || electrode.name.clone();
        if let Some(defect) = electrode.outline.defect() {
            return Err(SensorError::Outline { name: name(), defect });
        }
        if !electrode.z.is_finite() {
            return Err(SensorError::Outline { name: name(), defect: "is not finite" });
        }
        let [low, high] = electrode.outline.bounds().map(|corner| corner.extend(electrode.z));
        if !(self.domain.contains(low) && self.domain.contains(high)) {
            return Err(SensorError::OutsideDomain(name()));
        }
        let slack = IN_PLANE * self.domain.size().max_element();
        if (low - self.domain.min).min_element() <= slack || (self.domain.max - high).min_element() <= slack {
            return Err(SensorError::TouchesWall(name()));
        }
        Ok(())
    }
}

/// Names must be there, be few enough to be numbered, and differ.
pub(super) fn check_names<'a>(names: impl Iterator<Item = &'a str>) -> Result<(), SensorError> {
    let mut sorted: Vec<&str> = names.collect();
    sorted.sort_unstable();
    if sorted.is_empty() {
        return Err(SensorError::NoElectrodes);
    }
    if sorted.len() > usize::from(FREE) / 2 {
        return Err(SensorError::TooManyElectrodes(sorted.len()));
    }
    match sorted.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(SensorError::DuplicateName(pair[0].to_owned())),
        None => Ok(()),
    }
}
