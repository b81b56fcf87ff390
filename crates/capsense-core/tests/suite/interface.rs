//! The interface models: what each makes of the mesh, of conductors and of dielectrics, on a lattice and on any mesh, frame
//! by frame.

use crate::common::half_spaces::Convex;
use crate::common::updater::Updater;
use crate::common::{
    DOMAIN, Dice, FLOATING, GROUNDED, bar, depth_of_boxes, dielectric, on_three_meshes, stripes_sensor,
};
use capsense_core::geometry::Aabb;
use capsense_core::glam::DVec3;
use capsense_core::mesh::{TetMesh, signed_volume};
use capsense_core::occupancy::{Contact, DepthLayers, Interface, NO_OBJECT, OrthographicView};
use capsense_core::sensor::{ElectrodeNodes, FREE, Sensor};
use capsense_core::stiffness::{EdgeNetwork, StiffnessMatrix};
use proptest::prelude::*;
use std::sync::LazyLock;

const OF_ELEMENTS: [Interface; 2] = [Interface::Centroid, Interface::VolumeFraction];
const ALL: [Interface; 3] = [Interface::EdgeCut, Interface::Centroid, Interface::VolumeFraction];

static MESHES: LazyLock<[Sensor; 3]> = LazyLock::new(|| on_three_meshes(&stripes_sensor(6_000)));

/// K is that of the mesh with the permittivities that the elements now have.
fn assert_is_assembled(updater: &Updater<'_>) {
    let (permittivity, _) = updater.occupancy.elements().unwrap();
    let mesh = updater.sensor.mesh().clone().with_permittivity(|e| permittivity[e]).unwrap();
    let truth = StiffnessMatrix::new(EdgeNetwork::assemble(&mesh), mesh.nodes().len()).to_csr();
    let ours = updater.matrix.to_csr();
    let size = ours.values().iter().fold(0.0, |size, value| f64::max(size, value.abs()));
    // Electrode outlines that cross edges shorten them, whatever the elements; these sensors have none.
    let mut row = vec![0.0; mesh.nodes().len()];
    for node in 0..mesh.nodes().len() {
        for (matrix, sign) in [(&truth, -1.0), (&ours, 1.0)] {
            let entries = matrix.row(node);
            entries.col_indices().iter().zip(entries.values()).for_each(|(&c, v)| row[c] += sign * v);
        }
        let mut worst = 0.0;
        for matrix in [&truth, &ours] {
            for &column in matrix.row(node).col_indices() {
                worst = f64::max(worst, std::mem::take(&mut row[column]).abs());
            }
        }
        assert!(worst < 1e-11 * size, "row {node}: {worst} of {size}");
    }
}

/// Three boxes, perhaps turned, as solids, or what a camera sees of three boxes.
fn random_convex(dice: &mut Dice) -> Convex {
    (0..3).fold(Convex(Vec::new()), |all, _| {
        let half = DVec3::new(dice.between(0.01, 0.1), dice.between(0.01, 0.1), dice.between(0.01, 0.1));
        let (axis, centre) = (dice.point() + 0.4, dice.point());
        all.joined(Convex::turned(half, axis, dice.between(0.0, 3.0), centre))
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]

    #[test]
    fn frames_leave_no_trace(seed in any::<u64>(), width in 1..60usize, height in 1..60usize) {
        let mut dice = Dice(seed);
        let materials = [dielectric(4.0), GROUNDED, dielectric(30.0)];
        for interface in ALL {
            let mut updaters = MESHES.each_ref().map(|sensor| Updater::with_interface(interface, sensor, &materials));
            for _ in 0..4 {
                let boxes = [0; 3].map(|_| {
                    let (a, b) = (dice.point(), dice.point());
                    Aabb { min: a.min(b), max: a.max(b) }
                });
                let depth = depth_of_boxes([width, height], &boxes);
                updaters.iter_mut().for_each(|updater| updater.step_checked(&depth));
                let convex = random_convex(&mut dice);
                updaters.iter_mut().for_each(|updater| updater.step_checked(&convex));
            }
            if interface != Interface::EdgeCut {
                updaters.iter().for_each(assert_is_assembled);
            }
        }
    }
}

#[test]
fn many_frames_and_other_materials_leave_no_trace() {
    for interface in OF_ELEMENTS {
        for sensor in &*MESHES {
            let mut updater = Updater::with_interface(interface, sensor, &[dielectric(3.0), GROUNDED]);
            let seen = |step: u32| {
                let near = bar(0.05 - 1e-3 * f64::from(step % 40), 0.0);
                depth_of_boxes([32, 32], &[near, bar(0.1, 0.02)])
            };
            for step in 0..300 {
                updater.step(&seen(step));
            }
            updater.step_checked(&seen(7));
            assert!(!updater.occupancy.changed_edges().is_empty());
            updater.step_checked(&seen(7));
            assert!(updater.occupancy.changed_edges().is_empty() && updater.matrix.changed_rows().is_empty());
            updater.materials = vec![FLOATING, dielectric(9.0)];
            updater.step_checked(&seen(7));
            assert_is_assembled(&updater);
        }
    }
}

#[test]
fn noise_in_depth_images_leaves_no_trace() {
    let mut dice = Dice(11);
    let view = OrthographicView { domain: DOMAIN, width: 9, height: 7 };
    for interface in OF_ELEMENTS {
        for sensor in &*MESHES {
            let mut updater = Updater::with_interface(interface, sensor, &[dielectric(4.0), GROUNDED]);
            let mut depth = DepthLayers::empty(view, 2);
            for frame in 0..300 {
                let (front, back) = depth.layer_mut(dice.below(2));
                let pixel = dice.below(front.len());
                let (a, b) = (dice.between(0.0, 0.2) as f32, dice.between(0.0, 0.2) as f32);
                (front[pixel], back[pixel]) =
                    if a <= b { (a, b) } else { (f32::INFINITY, f32::NEG_INFINITY) };
                if frame % 60 == 59 { updater.step_checked(&depth) } else { updater.step(&depth) }
            }
        }
    }
}

/// Four elements around an edge along which their weights cancel without objects, and that edge.
fn cancelling() -> (TetMesh, [u32; 2]) {
    // Around the edge up z. With the ring of other nodes at distance R, an element of angle α about the edge weighs
    // R sin(α/2) (R cos(α/2) - 1/(4 R cos(α/2))) / 3 along it: for R² = 2/3, angles of 60° and 120° cancel.
    let round = [0.0, 60.0, 180.0, 240.0].map(f64::to_radians);
    let mut nodes = vec![DVec3::ZERO, DVec3::Z];
    let radius = (2.0_f64 / 3.0).sqrt();
    nodes.extend(round.map(|angle: f64| DVec3::new(radius * angle.cos(), radius * angle.sin(), 0.5)));
    let ring = [[2, 3], [3, 4], [4, 5], [5, 2]];
    let tets = ring.map(|[a, b]| [0, a, b, 1]).map(|tet| {
        let volume = signed_volume(tet.map(|n: u32| nodes[n as usize]));
        if volume < 0.0 { [tet[0], tet[2], tet[1], tet[3]] } else { tet }
    });
    (TetMesh::new(nodes, tets.to_vec()).unwrap(), [0, 1])
}

#[test]
fn weights_that_cancel_in_air_come_back_in_a_dielectric() {
    let (mesh, edge) = cancelling();
    let ends = |network: &EdgeNetwork| {
        (0..network.edges().len()).filter_map(|e| network.edges().ends(e)).any(|ends| ends == edge)
    };
    assert!(!ends(&EdgeNetwork::assemble(&mesh)), "they cancel");
    let electrodes = vec![("E".to_owned(), ElectrodeNodes::Nodes(vec![2]))];
    let sensor = Sensor::on_mesh(mesh.clone(), &[4], electrodes).unwrap();
    for interface in OF_ELEMENTS {
        let mut updater = Updater::with_interface(interface, &sensor, &[dielectric(5.0)]);
        assert!(ends(&updater.network));
        assert_is_assembled(&updater);
        let corner = Aabb { min: DVec3::new(0.15, 0.05, -1.0), max: DVec3::new(3.0, 3.0, 3.0) };
        updater.step_checked(&Convex::boxes(&[corner]));
        let (permittivity, _) = updater.occupancy.elements().unwrap();
        assert!(permittivity.iter().any(|p| *p > 1.5) && permittivity.contains(&1.0), "{permittivity:?}");
        assert_is_assembled(&updater);
        let row = updater.matrix.to_csr();
        let entry = row.get_entry(0, 1).unwrap().into_value();
        assert!(entry.abs() > 1e-3, "{entry}");
    }
}

#[test]
fn an_element_that_is_filled_has_exactly_the_permittivity_of_the_object() {
    for sensor in &*MESHES {
        let mut updater = Updater::with_interface(Interface::VolumeFraction, sensor, &[dielectric(7.3)]);
        let block = Aabb { min: DVec3::new(-0.21, -0.21, 0.03), max: DVec3::new(0.2, 0.2, 0.41) };
        let within = Aabb { min: block.min + 1e-9, max: block.max - 1e-9 };
        updater.step(&Convex::boxes(&[block]));
        let (permittivity, _) = updater.occupancy.elements().unwrap();
        let (mut full, mut mixed) = (0, 0);
        for (element, &found) in permittivity.iter().enumerate() {
            let corners = sensor.mesh().corners(element);
            if corners.iter().all(|corner| within.contains(*corner)) {
                assert!(found == 7.3, "{found}");
                full += 1;
            }
            assert!((1.0..=7.3 + 1e-13).contains(&found), "{found}");
            mixed += usize::from(found > 1.0 && found < 7.0);
        }
        assert!(full > 10 && mixed > 10, "{full} {mixed}");
    }
}

/// The part of a tetrahedron's volume below a plane: the tetrahedron cut off at the only corner on one side, or, with
/// two on either side, three tetrahedra between them.
fn volume_below(corners: [DVec3; 4], normal: DVec3, offset: f64) -> f64 {
    let mut order = corners.map(|corner| (normal.dot(corner) - offset, corner));
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    let whole = signed_volume(corners).abs();
    let cut = |i: usize, j: usize| {
        let ((a, from), (b, to)) = (order[i], order[j]);
        from.lerp(to, a / (a - b))
    };
    let volume = |corners: [DVec3; 4]| signed_volume(corners).abs();
    match order.iter().filter(|(distance, _)| *distance < 0.0).count() {
        0 => 0.0,
        1 => volume([order[0].1, cut(0, 1), cut(0, 2), cut(0, 3)]) / whole,
        2 => {
            let (a, b) = (order[0].1, order[1].1);
            let (ac, ad, bc, bd) = (cut(0, 2), cut(0, 3), cut(1, 2), cut(1, 3));
            (volume([a, ac, ad, b]) + volume([ac, ad, b, bc]) + volume([ad, b, bc, bd])) / whole
        }
        3 => 1.0 - volume([order[3].1, cut(3, 0), cut(3, 1), cut(3, 2)]) / whole,
        _ => 1.0,
    }
}

/// The bound that the documentation of volume fractions names.
#[test]
fn volume_fractions_of_half_spaces_are_nearly_exact() {
    let mut dice = Dice(3);
    let (mut worst, mut sum, mut count) = (0.0_f64, 0.0, 0);
    for _ in 0..60 {
        let sensor = &MESHES[1];
        let through = dice.point();
        let normal = (DVec3::new(dice.next(), dice.next(), dice.next()) - 0.5).normalize();
        let solid = Convex(vec![vec![(normal, normal.dot(through))]]);
        let mut updater = Updater::with_interface(Interface::VolumeFraction, sensor, &[dielectric(2.0)]);
        updater.step(&solid);
        for (element, permittivity) in updater.occupancy.elements().unwrap().0.iter().enumerate() {
            let exact = volume_below(sensor.mesh().corners(element), normal, normal.dot(through));
            let error = (permittivity - 1.0 - exact).abs();
            if exact > 0.0 && exact < 1.0 {
                (sum, count) = (sum + error * error, count + 1);
            }
            worst = worst.max(error);
        }
    }
    let mean = (sum / f64::from(count)).sqrt();
    println!("fractions: worst {worst}, root mean square {mean} of {count}");
    assert!(count > 10_000 && worst < 0.14 && mean < 0.009, "{worst} {mean} {count}");
}

#[test]
fn electrodes_win_over_conductors_and_conductors_over_dielectrics() {
    for interface in OF_ELEMENTS {
        for sensor in &*MESHES {
            let materials = [dielectric(4.0), FLOATING, GROUNDED];
            let mut updater = Updater::with_interface(interface, sensor, &materials);
            let all = bar(-0.005, 0.0);
            updater.step_checked(&Convex::boxes(&[all, bar(0.0, 0.0), all]));
            let (permittivity, holders) = updater.occupancy.elements().unwrap();
            for (element, (&permittivity, &holder)) in permittivity.iter().zip(holders).enumerate() {
                let corners = sensor.mesh().corners(element);
                let within = |b: Aabb| corners.iter().all(|corner| b.contains(*corner));
                if within(bar(0.0, 0.0)) {
                    assert!(holder == 1 && permittivity == 1.0, "of two conductors the first listed");
                }
                if holder != NO_OBJECT {
                    for node in sensor.mesh().tets().at(element).map(|node| node as usize) {
                        let held = updater.occupancy.conductors()[node];
                        let free = sensor.owners()[node] == FREE;
                        assert_eq!(held == NO_OBJECT, !free);
                    }
                }
            }
            assert!(holders.contains(&1));
            for electrode in 0..3 {
                assert!(updater.occupancy.contacts().contains(&Contact { object: 1, electrode }));
            }
            updater.step_checked(&Convex::boxes(&[all, bar(0.2, 0.0), bar(0.3, 0.0)]));
            assert!(updater.occupancy.contacts().is_empty());
        }
    }
}

#[test]
fn two_layers_end_an_object_at_its_back() {
    let sensor = &MESHES[2];
    let mut updater = Updater::with_interface(Interface::Centroid, sensor, &[dielectric(5.0)]);
    updater.step_checked(&depth_of_boxes([64, 64], &[bar(0.05, 0.0)]));
    for (element, permittivity) in updater.occupancy.elements().unwrap().0.iter().enumerate() {
        let z = sensor.mesh().centroid(element).z;
        assert!(*permittivity == 1.0 || (0.05..0.07).contains(&z));
    }
    assert!(updater.occupancy.elements().unwrap().0.contains(&5.0));
}
