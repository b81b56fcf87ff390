//! Conductors on a mesh with obtuse angles, some of whose edges weigh less than nothing: faces are where they are, and so
//! are edges.

use crate::common::walled::{Body, Held, Rule, WalledBox, cubes};
use crate::common::{Dice, conductor, three_stripes, to};
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::glam::{DQuat, DVec3};
use capsense_core::material::Connection;
use capsense_core::mesh::{Bisection, Lattice, Refinement, TetMesh, signed_volume};
use capsense_core::sensor::{MeshKind, Sensor};
use capsense_core::simulator::Simulator;
use capsense_core::solids::Solids;
use capsense_core::stiffness::EdgeNetwork;
use std::f64::consts::PI;

/// Cells across half of the cube.
const HALF: f64 = 6.0;
/// Of a conductor that ends nowhere in the cube but at its faces.
const LARGE: f64 = 1e3;

/// A cube of unit cells whose inner nodes are moved by up to a part of a cell.
fn moved_nodes(by: f64, seed: u64) -> TetMesh {
    let domain = Aabb { min: DVec3::splat(-HALF), max: DVec3::splat(HALF) };
    let mesh = cubes(domain, 1.0).to_tet_mesh().unwrap();
    let mut dice = Dice(seed);
    let mut moved = |p: &DVec3| {
        let to = DVec3::from_array([(); 3].map(|()| dice.between(-by, by)));
        if p.abs().max_element() < HALF - 0.5 { *p + to } else { *p }
    };
    let nodes: Vec<DVec3> = mesh.nodes().iter().map(&mut moved).collect();
    let tets = mesh.tets().to_vec();
    assert!(tets.iter().all(|tet| signed_volume(tet.map(|n| nodes[n as usize])) > 0.01));
    TetMesh::new(nodes, tets).unwrap()
}

/// How far potentials are from those of a field that is given on the walls, zero in a large box turned and with a corner
/// somewhere, by edges alone and with links of nodes.
fn deviations(mesh: &TetMesh, turn: DQuat, corner: DVec3, field: &dyn Fn(DVec3) -> f64) -> [f64; 2] {
    let outward = DVec3::new(0.5 * LARGE, 0.5 * LARGE, 0.0);
    [Rule::EdgesAlone, Rule::AsSolids].map(|rule| {
        let shape = Shape::Box { size: DVec3::splat(LARGE) };
        let pose = Pose { rotation: turn, ..Pose::at(corner - turn * outward) };
        let body = Body { shape, pose, material: conductor(Connection::Grounded) };
        let walled = WalledBox::on_mesh(mesh, &[body], rule);
        let solved = walled.solve(&[Held { wall: field, bodies: &[0.0] }]);
        solved.deviation(0, field)
    })
}

#[test]
fn meshes_have_negative_weights() {
    let network = EdgeNetwork::assemble(&moved_nodes(0.2, 1));
    let negative = network.weights().iter().filter(|weight| **weight < 0.0).count();
    assert!(negative > network.weights().len() / 20, "{negative}");
}

/// The mean of [`deviations`] over meshes, turns and places somewhere in the middle cell: `case` tells the box's corner and
/// the field.
fn mean_deviations<F: Fn(DVec3) -> f64>(
    mut dice: Dice,
    case: impl Fn(DQuat, DVec3) -> (DVec3, F),
) -> [f64; 2] {
    const CASES: u64 = 6;
    let mut sums = [0.0; 2];
    for seed in 0..CASES {
        let mesh = moved_nodes(0.2, seed);
        let axis = DVec3::from_array([(); 3].map(|()| dice.between(-1.0, 1.0)));
        let turn = DQuat::from_axis_angle(axis.normalize(), dice.between(0.0, 3.0));
        let place = DVec3::from_array([(); 3].map(|()| dice.between(-0.5, 0.5)));
        let (corner, field) = case(turn, place);
        let found = deviations(&mesh, turn, corner, &field);
        println!("{found:?}");
        (0..2).for_each(|k| sums[k] += found[k] / CASES as f64);
    }
    println!("mean {sums:?}");
    sums
}

#[test]
fn faces_are_where_they_are() {
    let means = mean_deviations(Dice(3), |turn, face| {
        // The box's face across x, its edges far away.
        let normal = turn * DVec3::X;
        let corner = face + turn * DVec3::Y * (0.5 * LARGE);
        (corner, move |p: DVec3| normal.dot(p - face).max(0.0))
    });
    assert!(means[1] < 0.3 * means[0], "{means:?}");
}

#[test]
fn edges_are_where_they_are() {
    let means = mean_deviations(Dice(4), |turn, corner| {
        let field = move |p: DVec3| {
            let local = turn.inverse() * (p - corner);
            // From the face across x, around the edge, to that across y.
            let theta = f64::atan2(local.y, local.x) + 0.5 * PI;
            let is_inside = local.x < 0.0 && local.y < 0.0;
            if is_inside {
                0.0
            } else {
                local.truncate().length().powf(2.0 / 3.0) * (2.0 / 3.0 * theta).sin()
            }
        };
        (corner, field)
    });
    assert!(means[1] < 0.6 * means[0], "{means:?}");
}

/// Cells eight times as long as high, bisected once or twice: below long edges of negative weight lie nodes that are much
/// nearer than the ends of these.
#[test]
fn faces_are_where_they_are_in_flat_elements() {
    let domain = Aabb { min: DVec3::new(-32.0, -32.0, -6.0), max: DVec3::new(32.0, 32.0, 6.0) };
    let mut bisection = Bisection::new(&Lattice::uniform(domain, [8, 8, 12]).unwrap()).unwrap();
    let mut dice = Dice(5);
    for times in [1, 2] {
        let all: Vec<u32> = (0..bisection.tet_count() as u32).collect();
        assert_eq!(bisection.refine(&all, usize::MAX), Refinement::Complete);
        let mesh = bisection.to_tet_mesh().unwrap();
        for case in 0..4 {
            let axis = DVec3::from_array([(); 3].map(|()| dice.between(-1.0, 1.0)));
            let angle = if case == 0 { 0.0 } else { dice.between(0.0, 3.0) };
            let turn = DQuat::from_axis_angle(axis.normalize(), angle);
            let normal = turn * DVec3::X;
            let face = DVec3::new(4.0, 4.0, 0.5) * dice.between(-1.0, 1.0);
            let corner = face + turn * DVec3::Y * (0.5 * LARGE);
            let field = |p: DVec3| normal.dot(p - face).max(0.0);
            let [alone, linked] = deviations(&mesh, turn, corner, &field);
            println!("{times} {case}: {alone} {linked}");
            assert!(linked < 0.1 * alone, "{times} {case}: {alone} {linked}");
        }
    }
}

/// As round bodies rise over a bisected mesh, an electrode's capacitance falls with each step, and steps change little from one to the
/// next as conductors come to hold nodes: were weight taken from links at once there, the sphere would have 0.0094.
#[test]
fn steps_change_little_as_conductors_come_to_hold_nodes() {
    let sensor = Sensor::generated(&three_stripes(), MeshKind::Bisection, 30_000).unwrap();
    let bodies = [
        (Shape::Sphere { radius: 0.045 }, DQuat::IDENTITY),
        (Shape::Capsule { radius: 0.03, length: 0.08 }, DQuat::from_rotation_y(1.3)),
        (Shape::Cylinder { radius: 0.03, length: 0.1 }, DQuat::from_rotation_y(1.3)),
    ];
    for (shape, rotation) in bodies {
        let grounded = vec![conductor(Connection::Grounded)];
        let mut simulator = Simulator::new(sensor.clone(), grounded, to(1e-8)).unwrap();
        let mut solids = Solids::new(std::slice::from_ref(&shape)).unwrap();
        let at = |step: u32| {
            let place = DVec3::new(0.01, 0.005, 0.07 + 5e-4 * f64::from(step));
            solids.place(&[Pose { rotation, ..Pose::at(place) }]).unwrap();
            let _ = simulator.step(&solids).unwrap();
            simulator.capacitance().get(0, 0)
        };
        let places: Vec<f64> = (0..200).map(at).collect();
        let falls: Vec<f64> = places.windows(2).map(|pair| pair[0] - pair[1]).collect();
        let all: f64 = falls.iter().sum();
        let squares = falls.windows(2).map(|pair| (pair[1] - pair[0]).powi(2));
        let kinks = squares.sum::<f64>().sqrt() / all;
        println!("{shape:?}: {kinks:.4}");
        assert!(falls.iter().all(|fall| *fall > 0.0), "{shape:?}");
        assert!(kinks < 0.006, "{shape:?}: {kinks}");
    }
}
