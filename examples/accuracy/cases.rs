//! What is computed: the stripes of the built-in scene, and the bodies near them.

use capsense::core::capacitance::CapacitanceMatrix;
use capsense::core::electrode::{Electrode, Outline};
use capsense::core::geometry::{Aabb, Pose, Shape};
use capsense::core::glam::{DQuat, DVec2, DVec3};
use capsense::core::material::Connection;
use capsense::core::sensor::{SensorDesign, Wall};

/// The domain of the built-in scene.
pub(crate) const DOMAIN: Aabb =
    Aabb { min: DVec3::new(-0.25, -0.25, -0.05), max: DVec3::new(0.25, 0.25, 0.45) };

/// The steel bar.
pub(crate) const BAR: DVec3 = DVec3::new(0.15, 0.15, 0.02);

/// The entries of the capacitance matrix that are compared: their names, rows and columns. E3 mirrors E1.
pub(crate) const ENTRIES: [(&str, usize, usize); 4] =
    [("C11", 0, 0), ("C22", 1, 1), ("C12", 0, 1), ("C13", 0, 2)];

/// What holds a body's potential.
pub(crate) const CONNECTIONS: [(&str, Connection); 2] =
    [("grounded", Connection::Grounded), ("floating", Connection::Floating)];

/// The compared entries of one matrix, or of its change, in femtofarads.
pub(crate) type Entries = [f64; ENTRIES.len()];

/// A conducting body near the sensor.
pub(crate) struct Body {
    /// Its name in tables and among the references.
    pub(crate) name: &'static str,
    pub(crate) shape: Shape,
    pub(crate) pose: Pose,
}

/// Three stripes 100 mm x 20 mm along x with gaps of 10 mm, in air.
pub(crate) fn stripes() -> SensorDesign {
    let stripe = |k: usize| {
        let center = DVec2::new(0.0, 0.03 * (k as f64 - 2.0));
        let outline = Outline::Rectangle { center, size: DVec2::new(0.1, 0.02) };
        Electrode { name: format!("E{k}"), outline, z: 0.0 }
    };
    SensorDesign {
        domain: DOMAIN,
        electrodes: (1..=3).map(stripe).collect(),
        substrate: None,
        wall: Wall::Grounded,
    }
}

/// The compared entries of a matrix in farads.
pub(crate) fn entries(capacitance: &CapacitanceMatrix) -> Entries {
    ENTRIES.map(|(_, row, column)| 1e15 * capacitance.get(row, column))
}

/// All bodies. Heights in names are those of the lowest point above the electrodes.
pub(crate) fn bodies() -> Vec<Body> {
    let at = |y: f64, z: f64| Pose::at(DVec3::new(0.0, y, z));
    let bar = |name, pose| Body { name, shape: Shape::Box { size: BAR }, pose };
    let sphere = |name, z| {
        let pose = Pose::at(DVec3::new(0.01, 0.005, z));
        Body { name, shape: Shape::Sphere { radius: 0.04 }, pose }
    };
    let capsule = Shape::Capsule { radius: 0.03, length: 0.1 };
    vec![
        bar("bar at 20 mm", at(0.0, 0.03)),
        bar("bar at 50 mm", at(0.0, 0.06)),
        bar("bar at 100 mm", at(0.0, 0.11)),
        bar("bar at 200 mm", at(0.0, 0.21)),
        bar("bar at 50 mm sideways", at(0.06, 0.06)),
        bar("bar at 20 mm sideways", at(0.06, 0.03)),
        bar("bar at 50 mm turned", turned(at(0.0, 0.06), DVec3::Z, 30.0)),
        bar("bar tilted", turned(at(0.0, 0.11), DVec3::X, 30.0)),
        sphere("sphere at 30 mm", 0.07),
        Body { name: "capsule", shape: capsule, pose: turned(at(0.01, 0.06), DVec3::X, 70.0) },
        sphere("sphere at 80 mm", 0.12),
    ]
}

/// Those that are computed in a hurry.
pub(crate) fn few_bodies() -> Vec<Body> {
    let few = ["bar at 20 mm", "bar at 50 mm", "bar at 50 mm turned", "sphere at 30 mm"];
    bodies().into_iter().filter(|body| few.contains(&body.name)).collect()
}

fn turned(pose: Pose, axis: DVec3, degrees: f64) -> Pose {
    Pose { rotation: DQuat::from_axis_angle(axis, degrees.to_radians()), ..pose }
}
