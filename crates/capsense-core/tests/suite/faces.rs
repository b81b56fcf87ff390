//! Faces of dielectrics in planes of a lattice: edges in such a face have half of their box on either side.

use crate::common::{dielectric, rectangle, stripes_sensor, to};
use approx::assert_relative_eq;
use capsense_core::capacitance::CapacitanceMatrix;
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::glam::{DQuat, DVec3};
use capsense_core::sensor::{Sensor, SensorDesign, Wall};
use capsense_core::simulator::Simulator;
use capsense_core::solids::Solids;

const DOMAIN: Aabb = Aabb { min: DVec3::splat(-0.1), max: DVec3::splat(0.1) };

/// Above an electrode in the middle plane of a box, in units of what the empty box has.
fn raised_by(permittivity: f64, shape: Shape, centre: DVec3) -> f64 {
    let electrodes = vec![rectangle("E", [0.0; 2], [0.06, 0.04])];
    let design = SensorDesign { domain: DOMAIN, electrodes, substrate: None, wall: Wall::Grounded };
    // Its halves must be mirror images, too.
    let lattice = design.lattice_of_spacing(0.006, 1.4).unwrap();
    let sensor = Sensor::on_lattice(&design, &lattice).unwrap();
    let mut simulator = Simulator::new(sensor, vec![dielectric(permittivity)], to(1e-10)).unwrap();
    let mut solids = Solids::new(&[shape]).unwrap();
    solids.place(&[Pose::at(centre)]).unwrap();
    let _ = simulator.step(&solids).unwrap();
    simulator.capacitance().get(0, 0) / simulator.base().get(0, 0)
}

/// Both halves of the field are mirror images, whatever fills one of them, so capacitances add up.
#[test]
fn half_of_the_space_filled_up_to_the_electrode_is_half_of_the_field() {
    for permittivity in [4.0, 10.0, 50.0, 80.0] {
        let shape = Shape::Box { size: DVec3::new(0.4, 0.4, 0.2) };
        let raised = raised_by(permittivity, shape, 0.1 * DVec3::Z);
        assert_relative_eq!(raised, 0.5 + 0.5 * permittivity, max_relative = 5e-6);
        let shape = Shape::Cylinder { radius: 0.3, length: 0.2 };
        let raised = raised_by(permittivity, shape, -0.1 * DVec3::Z);
        assert_relative_eq!(raised, 0.5 + 0.5 * permittivity, max_relative = 5e-6);
    }
}

/// Faces come into planes of the lattice and leave them, also by rounding alone: no edge is left as it was.
#[test]
fn what_was_in_a_face_leaves_no_trace() {
    let sensor = stripes_sensor(6_000);
    let planes = sensor.lattice().unwrap().axes()[2].clone();
    let above: Vec<f64> = planes.into_iter().filter(|z| *z > 0.0).take(3).collect();
    let size = DVec3::new(0.15, 0.15, 0.02);
    let new = || Simulator::new(sensor.clone(), vec![dielectric(50.0)], to(1e-6)).unwrap();
    let shapes = [Shape::Box { size }];
    let mut solids = Solids::new(&shapes).unwrap();
    let mut simulator = new();
    let upright = DQuat::IDENTITY;
    let heights = [above[1], above[1] + 3e-10, above[1] + 6e-10, above[1] + 2e-3, above[2], above[1]];
    let turned = heights.map(|height| (height, upright)).into_iter().chain([
        (above[1], DQuat::from_rotation_z(0.3)),
        (above[1], DQuat::from_rotation_x(1e-6)),
        (above[0] - size.z, upright),
    ]);
    let bits = |of: &Simulator| -> Vec<u64> {
        of.matrix().to_csr().values().iter().map(|value| value.to_bits()).collect()
    };
    for (height, rotation) in turned {
        let pose = Pose { translation: (height + 0.5 * size.z) * DVec3::Z, rotation };
        solids.place(&[pose]).unwrap();
        let _ = simulator.step(&solids).unwrap();
        let mut fresh = new();
        let mut alone = Solids::new(&shapes).unwrap();
        alone.place(&[pose]).unwrap();
        let _ = fresh.step(&alone).unwrap();
        assert!(bits(&simulator) == bits(&fresh), "at {height}, {rotation}");
    }
}

/// A face that comes into a plane of nodes and leaves it: half of the box of edges in it is on either side. What comes at once, as
/// edges within a strong body count as a whole, is less than what a millimetre makes.
#[test]
fn little_comes_at_once_as_a_face_passes_a_plane() {
    let sensor = stripes_sensor(6_000);
    let plane = sensor.lattice().unwrap().axes()[2].iter().copied().find(|z| *z > 0.01).unwrap();
    let size = DVec3::new(0.15, 0.15, 0.05);
    let mut solids = Solids::new(&[Shape::Box { size }]).unwrap();
    let mut simulator = Simulator::new(sensor, vec![dielectric(50.0)], to(1e-9)).unwrap();
    let mut at = |z: f64| -> CapacitanceMatrix {
        solids.place(&[Pose::at((z + 0.5 * size.z) * DVec3::Z)]).unwrap();
        let _ = simulator.step(&solids).unwrap();
        simulator.capacitance().clone()
    };
    let [before, there, behind, far] = [-1e-6, 0.0, 1e-6, 1e-3].map(|shift| at(plane + shift).get(1, 1));
    let at_once = [before - there, there - behind].map(|step| step / (before - far));
    assert!(at_once.into_iter().all(|part| (-0.02..0.8).contains(&part)), "{at_once:?}");
}
