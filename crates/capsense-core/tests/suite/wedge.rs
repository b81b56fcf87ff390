//! Links beside edges of boxes and cylinders, some of them negative, leave a matrix and capacitances as they must be.

use crate::common::shapes::{at, rotation};
use crate::common::{
    Dice, conductor, oracle, relative_error, stripes_sensor, three_stripes, to, with_moved_nodes,
};
use capsense_core::geometry::{Pose, Shape};
use capsense_core::glam::DVec3;
use capsense_core::material::Connection;
use capsense_core::mesh::{Bisection, Lattice};
use capsense_core::occupancy::{Coupling, EdgeGeometry, NO_OBJECT, Occupancy};
use capsense_core::sensor::{ElectrodeNodes, FREE, Sensor};
use capsense_core::simulator::Simulator;
use capsense_core::solids::Solids;
use capsense_core::stiffness::EdgeNetwork;
use proptest::prelude::*;
use std::sync::LazyLock;

/// Cells up to eight times as long as wide or high.
fn stretched() -> Sensor {
    stretched_by([40, 50, 10])
}

/// Equal cells.
fn stretched_by(cells: [usize; 3]) -> Sensor {
    let design = three_stripes();
    let axis = |axis: usize| -> Vec<f64> {
        let (low, high) = (design.domain.min[axis], design.domain.max[axis]);
        let cells = cells[axis];
        (0..=cells).map(|k| low + (high - low) * k as f64 / cells as f64).collect()
    };
    Sensor::on_lattice(&design, &Lattice::new([0, 1, 2].map(axis)).unwrap()).unwrap()
}

/// Flat elements, most of them with obtuse angles.
fn bisected() -> Sensor {
    let design = three_stripes();
    let mut bisection = Bisection::new(&design.lattice_of_spacing(0.02, 2.5).unwrap()).unwrap();
    for _ in 0..4 {
        let all: Vec<u32> = (0..bisection.tet_count() as u32).collect();
        let _ = bisection.refine(&all, usize::MAX);
    }
    let mesh = bisection.into_tet_mesh().unwrap();
    let at_side =
        |p: &DVec3| (*p - design.domain.min).min_element().min((design.domain.max - *p).min_element()) < 1e-9;
    let ground: Vec<u32> =
        (0..).zip(mesh.nodes()).filter(|(_, p)| at_side(p)).map(|(node, _)| node).collect();
    let electrodes = design.electrodes.into_iter().map(|e| (e.name.clone(), ElectrodeNodes::Shape(e)));
    Sensor::on_mesh(mesh, &ground, electrodes.collect()).unwrap()
}

static SENSORS: LazyLock<[Sensor; 4]> = LazyLock::new(|| {
    [stripes_sensor(12_000), stretched(), with_moved_nodes(&stripes_sensor(12_000)), bisected()]
});

fn shape(dice: &mut Dice) -> Shape {
    let length = |dice: &mut Dice| 0.2 * 10_f64.powf(dice.between(-1.7, 0.0));
    match dice.below(6) {
        0 => Shape::Cylinder { radius: 0.5 * length(dice), length: length(dice) },
        1 => Shape::Capsule { radius: 0.5 * length(dice), length: length(dice) },
        2 => Shape::Sphere { radius: 0.5 * length(dice) },
        _ => Shape::Box { size: DVec3::new(length(dice), length(dice), length(dice)) },
    }
}

fn pose(dice: &mut Dice) -> Pose {
    let translation =
        DVec3::new(dice.between(-0.12, 0.12), dice.between(-0.12, 0.12), dice.between(0.01, 0.2));
    if dice.below(2) == 0 {
        return Pose::at(translation);
    }
    let axis = [dice.between(-1.0, 1.0), dice.between(-1.0, 1.0), dice.between(-1.0, 1.0)];
    Pose { rotation: rotation(axis, dice.between(0.0, 3.0)), ..Pose::at(translation) }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn capacitances_are_those_of_conductors(seed in any::<u64>()) {
        let mut dice = Dice(seed);
        let sensor = &SENSORS[dice.below(4)];
        let materials = [Connection::Grounded, Connection::Floating].map(conductor);
        let solids = at(&[shape(&mut dice), shape(&mut dice)], &[pose(&mut dice), pose(&mut dice)]);
        let mut exact = oracle(sensor, &materials);
        let _ = exact.step(&solids).unwrap();
        let mut simulator = Simulator::new(sensor.clone(), materials.to_vec(), to(1e-6)).unwrap();
        let _ = simulator.step(&solids).unwrap();
        let c = simulator.capacitance();
        let error = relative_error(c, exact.capacitance());
        // How exact a tolerance is kept is for `oracle` to say. A floating body that touches an electrode is at its potential
        // but for what single precision makes of links a thousand times as strong as all others.
        let allowed = if simulator.contacts().is_empty() { 1e-5 } else { 1e-4 };
        prop_assert!(error < allowed, "{error:e}");
        // What obtuse angles make of signs has no bound.
        for s in (0..3).filter(|_| sensor.lattice().is_some()) {
            let row: f64 = (0..3).map(|t| c.get(s, t)).sum();
            prop_assert!(row >= -1e-6 * c.get(s, s), "row {s}: {row:e}");
            for t in (0..3).filter(|&t| t != s) {
                prop_assert!(c.get(s, t) <= 1e-6 * c.get(s, s) && c.get(s, t) == c.get(t, s));
            }
        }
    }
}

/// Nodes a hair in front of a face, beside which another edge passes, are all but at the conductor's potential.
#[test]
fn nodes_in_faces_are_held() {
    let sensor = stripes_sensor(8_000);
    let face = sensor.lattice().unwrap().axes()[2][5];
    let boxes = [DVec3::new(0.094, 0.163, 0.053), DVec3::new(0.058, 0.118, 0.0425)];
    let shapes = boxes.map(|size| Shape::Box { size });
    let materials = [Connection::Grounded; 2].map(conductor);
    let mut exact = oracle(&sensor, &materials);
    for gap in [1e-3, 1e-5, 1e-7, 1e-9, 0.0, -1e-9] {
        let turned = |angle, x, y, z| Pose {
            rotation: rotation([0.0, 0.0, 1.0], angle),
            ..Pose::at(DVec3::new(x, y, z))
        };
        let poses = [
            turned(-0.9167, 0.0082, 0.1302, 0.0997),
            turned(0.9324, 0.0615, -0.0008, face - gap - 0.5 * boxes[1].z),
        ];
        let _ = exact.step(&at(&shapes, &poses)).unwrap();
        for (node, place) in sensor.mesh().nodes().iter().enumerate() {
            let is_free = sensor.owners()[node] == FREE && exact.occupancy().conductors()[node] == NO_OBJECT;
            let share = exact.matrix().link_weight(node) / exact.matrix().diagonal(node);
            assert!(!is_free || (-0.2..=1.0).contains(&share), "{share} at {place} for {gap}");
        }
    }
}

/// A sphere is listed before or behind a box that touches the corner of the cube around it: far from the sphere itself, links are
/// those of the box.
#[test]
fn a_body_without_a_share_leaves_the_field_of_another_alone() {
    let sensor = stretched_by([40, 50, 50]);
    let network = EdgeNetwork::of_sensor(&sensor);
    let mesh = EdgeGeometry {
        nodes: sensor.mesh().nodes(),
        terminals: sensor.owners(),
        edges: network.edges(),
        permittivity: network.permittivity(),
    };
    let (radius, centre) = (0.12, DVec3::new(0.0, 0.0, 0.2));
    let bodies = [
        (Shape::Sphere { radius }, centre),
        (Shape::Box { size: DVec3::splat(0.06) }, centre + 0.15 * DVec3::new(1.0, 1.0, 1.001)),
    ];
    let materials = [conductor(Connection::Grounded), conductor(Connection::Grounded)];
    let couplings = |order: [usize; 2]| -> Vec<Coupling> {
        let mut solids = Solids::new(&order.map(|body| bodies[body].0.clone())).unwrap();
        solids.place(&order.map(|body| Pose::at(bodies[body].1))).unwrap();
        let mut occupancy = Occupancy::empty(mesh.nodes.len(), mesh.edges.len());
        occupancy.update(mesh, &materials, &solids);
        occupancy.couplings().copied().collect()
    };
    let swapped = |object: u16| if object == NO_OBJECT { object } else { 1 - object };
    let mut links = 0;
    for (edge, (first, second)) in couplings([0, 1]).into_iter().zip(couplings([1, 0])).enumerate() {
        let Some(ends) = mesh.edges.ends(edge) else { continue };
        let is_far = |node: u32| mesh.nodes[node as usize].distance(centre) > radius + 0.045;
        if ends.into_iter().all(is_far) {
            assert_eq!(first, Coupling { object: second.object.map(swapped), ..second }, "{edge}");
            links += usize::from(first.is_linked());
        }
    }
    assert!(links > 100, "{links}");
}
