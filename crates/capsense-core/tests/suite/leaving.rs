//! Bodies that leave the domain through its wall: every frame has a solution, and what is outside counts no more.

use crate::common::{FLOATING, GROUNDED, relative_error, three_stripes, to};
use capsense_core::geometry::{Pose, Shape};
use capsense_core::glam::DVec3;
use capsense_core::material::Material;
use capsense_core::sensor::{Sensor, SensorDesign, Wall};
use capsense_core::simulator::Simulator;
use capsense_core::solids::Solids;

const TOLERANCE: f64 = 1e-4;

/// So far a body moves from frame to frame, in metres, and for so many frames.
const STEP: f64 = 6e-3;
const FRAMES: u32 = 40;

fn bodies() -> [Shape; 3] {
    [
        Shape::Box { size: DVec3::new(0.15, 0.15, 0.02) },
        Shape::Sphere { radius: 0.05 },
        Shape::Cylinder { radius: 0.03, length: 0.2 },
    ]
}

/// From where and which way: upwards, sideways, and down beside the electrodes.
fn ways() -> [(DVec3, DVec3); 3] {
    [
        (DVec3::new(0.0, 0.0, 0.36), DVec3::Z),
        (DVec3::new(0.2, 0.01, 0.1), DVec3::X),
        (DVec3::new(0.16, 0.0, 0.05), -DVec3::Z),
    ]
}

/// Moves a body out of the sensor's domain, beside a simulator that is told to be more exact.
fn leave(sensor: &Sensor, shape: &Shape, material: Material, (from, way): (DVec3, DVec3)) {
    let simulator = |tolerance| Simulator::new(sensor.clone(), vec![material], to(tolerance)).unwrap();
    let (mut usual, mut exact) = (simulator(TOLERANCE), simulator(1e-8));
    let mut solids = Solids::new(std::slice::from_ref(shape)).unwrap();
    for frame in 0..FRAMES {
        let place = from + STEP * f64::from(frame) * way;
        solids.place(&[Pose::at(place)]).unwrap();
        for simulator in [&mut usual, &mut exact] {
            let _ = simulator
                .step(&solids)
                .unwrap_or_else(|error| panic!("{shape:?} {material:?} at {place}: {error}"));
        }
        let error = relative_error(usual.capacitance(), exact.capacitance());
        assert!(error <= 3.0 * TOLERANCE, "{shape:?} {material:?} at {place}: {error:e}");
    }
    // It is two cells beyond the wall.
    let error = relative_error(exact.capacitance(), exact.base());
    assert!(error <= 1e-7, "{shape:?} {material:?} left {error:e}");
}

#[test]
fn bodies_leave_through_walls() {
    for wall in [Wall::Grounded, Wall::Open] {
        let design = SensorDesign { wall, ..three_stripes() };
        let sensor = Sensor::on_lattice(&design, &design.lattice(12_000).unwrap()).unwrap();
        for sensor in [sensor.clone().off_lattice(), sensor] {
            for shape in bodies() {
                for material in [FLOATING, GROUNDED] {
                    ways().into_iter().for_each(|way| leave(&sensor, &shape, material, way));
                }
            }
        }
    }
}

/// On a lattice of 130,000 tetrahedra, a bar below an open wall that it does not touch, and one through the lower wall.
#[test]
fn nodes_of_an_open_wall_have_no_links_of_wedges() {
    let design = SensorDesign { wall: Wall::Open, ..three_stripes() };
    let sensor = Sensor::on_lattice(&design, &design.lattice(130_000).unwrap()).unwrap();
    let mut solids = Solids::new(&bodies()[..1]).unwrap();
    for place in [DVec3::new(0.0, 0.0, 0.38), DVec3::new(0.16, 0.0, -0.022)] {
        let mut simulator = Simulator::new(sensor.clone(), vec![GROUNDED], to(TOLERANCE)).unwrap();
        solids.place(&[Pose::at(place)]).unwrap();
        let _ = simulator.step(&solids).unwrap();
        let on_wall = |node: usize| design.is_on_wall(sensor.mesh().nodes()[node]);
        let occupancy = simulator.occupancy();
        // Of single wedges, links are carried along x and lead from the first node; surfaces cut edges that they pass.
        let carried =
            occupancy.linked_edges().iter().filter(|&&edge| edge % 3 == 0 && on_wall(edge as usize / 3));
        let through = |&edge: &u32| occupancy.coupling(edge as usize).through;
        let alone = carried.filter(|edge| through(edge) == 1.0).count();
        assert_eq!(alone, 0, "{place}");
    }
}
