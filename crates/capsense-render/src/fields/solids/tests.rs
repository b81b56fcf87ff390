//! Kernels against the solids and the occupancy of the processor: points and segments, and rows of K. On a software adapter, too.

use super::stand_alone::{Finder, stand_alone};
use capsense_core::electrode::{Electrode, Outline};
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::material::{Connection, Material, RelativePermittivity};
use capsense_core::occupancy::{Coupling, NO_OBJECT, Surfaces};
use capsense_core::sensor::{Sensor, SensorDesign, Substrate, Wall};
use capsense_core::solids::Solids;
use capsense_core::stiffness::EdgeNetwork;
use glam::{DQuat, DVec2, DVec3};
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

/// Needs no GPU: the functions are valid WGSL for any number of objects.
#[test]
fn the_functions_are_valid() {
    for most_objects in [1, 2, 7] {
        let module = naga::front::wgsl::parse_str(&stand_alone(most_objects)).unwrap();
        let flags = naga::valid::ValidationFlags::all();
        let mut validator = naga::valid::Validator::new(flags, naga::valid::Capabilities::empty());
        validator.validate(&module).unwrap();
    }
}

/// Scenes thrown by dice.
const CASES: usize = 40;

/// Of entries of K, in parts of their row: what rounding makes of a node that all but touches a conductor.
const ROUNDING: f64 = 5e-4;

pub(super) const GROUNDED: Material = Material::Conductor(Connection::Grounded);

pub(super) fn dielectric(permittivity: f64) -> Material {
    Material::Dielectric(RelativePermittivity::new(permittivity).unwrap())
}

/// Three stripes in a box of 0.6 m.
pub(super) fn sensor(tets: usize, on_board: bool) -> Sensor {
    let domain = Aabb { min: DVec3::new(-0.3, -0.3, -0.2), max: DVec3::new(0.3, 0.3, 0.4) };
    let stripe = |x: f64, name: &str| Electrode {
        name: name.into(),
        outline: Outline::Rectangle { center: DVec2::new(x, 0.0), size: DVec2::new(0.04, 0.2) },
        z: 0.0,
    };
    let electrodes = vec![stripe(-0.06, "E1"), stripe(0.0, "E2"), stripe(0.06, "E3")];
    let board = Substrate {
        thickness: 0.02,
        relative_permittivity: RelativePermittivity::new(4.4).unwrap(),
        size: DVec2::new(0.3, 0.3),
        grounded_back: false,
    };
    let substrate = on_board.then_some(board);
    let design = SensorDesign { domain, electrodes, substrate, wall: Wall::Grounded };
    Sensor::on_lattice(&design, &design.lattice(tets).unwrap()).unwrap()
}

/// A row of the stiffness matrix: the weights to the next nodes, and the sum of those of its links.
fn rows_of(network: &EdgeNetwork, nodes: usize, couplings: &[Coupling]) -> Vec<[f64; 4]> {
    let mut rows = vec![[0.0; 4]; nodes];
    for (edge, (coupling, weight)) in couplings.iter().zip(network.weights()).enumerate() {
        let Some(ends) = network.edges().ends(edge) else { continue };
        rows[edge / 3][edge % 3] = weight * coupling.through;
        for (end, node) in ends.into_iter().enumerate() {
            rows[node as usize][3] += weight * coupling.factor[end];
        }
    }
    rows
}

/// What differs between device and processor.
#[derive(Debug, Default)]
struct Difference {
    /// Nodes that other conductors hold, and rows of which an entry differs by more than [`ROUNDING`].
    moved: usize,
    otherwise: usize,
    /// The largest difference of entries of all other rows, in parts of the row.
    rounding: f64,
    /// Edges that objects change.
    changed: usize,
}

fn compare(finder: &Finder, solids: &Solids, materials: &[Material]) -> Difference {
    let expected = finder.expected(solids, materials);
    let found = finder.found(solids, materials);
    let of_core = expected.conductors().iter().map(|&object| u32::from(object));
    let nodes = expected.conductors().len();
    let empty =
        vec![Coupling { through: 1.0, factor: [0.0; 2], object: [u16::MAX; 2] }; found.couplings.len()];
    let couplings: Vec<Coupling> = expected.couplings().copied().collect();
    let [ours, theirs, without] =
        [&found.couplings, &couplings, &empty].map(|couplings| rows_of(&finder.network, nodes, couplings));
    let mut all = Difference {
        moved: of_core.zip(&found.conductors).filter(|(a, b)| a != *b).count(),
        changed: couplings.iter().zip(&empty).filter(|(a, b)| a != b).count(),
        ..Difference::default()
    };
    let lattice = finder.sensor.lattice().unwrap();
    for node in (0..nodes).filter(|&node| expected.conductors()[node] == NO_OBJECT) {
        let place = lattice.node_place(node);
        let sum = |rows: &[[f64; 4]]| {
            let before = (0..3).filter(|&axis| place[axis] > 0);
            let before = before.map(|axis| rows[node - lattice.strides()[axis]][axis]);
            rows[node].iter().copied().chain(before).sum::<f64>()
        };
        let whole = sum(&theirs).max(sum(&without));
        let apart = |entry: usize| (ours[node][entry] - theirs[node][entry]).abs() / whole;
        let error = (0..4).map(apart).fold(0.0, |a: f64, b| if b.is_nan() { f64::NAN } else { a.max(b) });
        if error < ROUNDING {
            all.rounding = all.rounding.max(error);
        } else {
            all.otherwise += 1;
        }
    }
    all
}

/// Shapes of all kinds, from thinner than cells to far larger, with edges in planes of nodes and turned.
pub(super) fn any_object() -> impl Strategy<Value = (Shape, Pose, Material)> {
    let length = || prop_oneof![0.002..0.02, 0.02..0.2_f64];
    let shape = prop_oneof![
        [length(), length(), length()].prop_map(|size| Shape::Box { size: size.into() }),
        length().prop_map(|radius| Shape::Sphere { radius }),
        [length(), length()].prop_map(|[radius, length]| Shape::Capsule { radius, length }),
        [length(), length()].prop_map(|[radius, length]| Shape::Cylinder { radius, length }),
    ];
    let rotation = prop_oneof![
        Just(DQuat::IDENTITY),
        Just(DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2)),
        (0.0..6.0).prop_map(DQuat::from_rotation_z),
        [0.0..6.0, 0.0..6.0, 0.0..6.0].prop_map(|[x, y, z]| DQuat::from_euler(glam::EulerRot::XYZ, x, y, z)),
    ];
    let place = [-0.2..0.2, -0.2..0.2, -0.02..0.3];
    let material = prop_oneof![Just(GROUNDED), Just(dielectric(4.0)), Just(dielectric(80.0))];
    (shape, rotation, place, material).prop_map(|(shape, rotation, place, material)| {
        (shape, Pose { translation: place.into(), rotation }, material)
    })
}

pub(super) fn dice() -> TestRunner {
    TestRunner::new_with_rng(Config::default(), TestRng::deterministic_rng(RngAlgorithm::ChaCha))
}

/// Holders, links of nodes, walls beside edges, faces that hold edges: all that solids make of K, object by object and together.
#[test]
fn any_solids_make_of_rows_what_they_do_on_the_processor() {
    let finders = [sensor(9_000, false), sensor(40_000, true)].map(Finder::new);
    let mut dice = dice();
    let objects = prop::collection::vec(any_object(), 1..4);
    let (mut worst, mut changed) = (0.0_f64, 0);
    for case in 0..CASES {
        let objects = objects.new_tree(&mut dice).unwrap().current();
        let shapes: Vec<Shape> = objects.iter().map(|(shape, ..)| shape.clone()).collect();
        let poses: Vec<Pose> = objects.iter().map(|(_, pose, _)| *pose).collect();
        let materials: Vec<Material> = objects.iter().map(|(.., material)| *material).collect();
        let mut solids = Solids::new(&shapes).unwrap();
        solids.place(&poses).unwrap();
        let found = compare(&finders[case % 2], &solids, &materials);
        assert!(found.moved == 0 && found.otherwise == 0, "{found:?}: {objects:?}");
        (worst, changed) = (worst.max(found.rounding), changed + found.changed);
    }
    println!("{changed} edges that objects change, entries differ by up to {worst:.1e} of their row");
}

/// Faces in planes of nodes, where all nodes of a plane are outside and edges lie in faces; and bodies larger and smaller than
/// most that dice throw.
#[test]
fn faces_in_planes_and_round_bodies_are_those_of_the_processor() {
    let finder = Finder::new(sensor(24_000, false));
    let lattice = finder.sensor.lattice().unwrap();
    let planes = |low: [f64; 3], high: [f64; 3]| {
        let near = |axis: usize, at: f64| {
            let planes = lattice.axes()[axis].iter().copied();
            planes.min_by(|a, b| (a - at).abs().total_cmp(&(b - at).abs())).unwrap()
        };
        [low, high].map(|place| DVec3::from_array([0, 1, 2].map(|axis| near(axis, place[axis]))))
    };
    let mut scenes = Vec::new();
    let boxes = [
        ([-0.1, -0.08, 0.05], [0.06, 0.1, 0.12]),
        ([-0.03, -0.03, 0.0], [0.03, 0.03, 0.08]),
        ([-0.05, -0.28, 0.05], [0.05, 0.28, 0.12]),
    ];
    for [low, high] in boxes.map(|(low, high)| planes(low, high)) {
        let (size, centre) = (high - low, 0.5 * (low + high));
        let upright = Shape::Cylinder { radius: 0.045, length: size.z };
        scenes.push((upright, Pose::at(centre)));
        for rotation in [DQuat::IDENTITY, DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2)] {
            let size = (rotation.inverse() * size).abs();
            scenes.push((Shape::Box { size }, Pose { translation: centre, rotation }));
        }
    }
    let turned = DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -0.3, 0.9);
    for (radius, length) in [(0.12, 0.05), (0.07, 0.3), (0.01, 0.2)] {
        let translation = DVec3::new(0.013, -0.021, 0.15);
        let pose = Pose { translation, rotation: turned };
        scenes.push((Shape::Cylinder { radius, length }, pose));
        scenes.push((Shape::Capsule { radius, length }, pose));
        scenes.push((Shape::Sphere { radius: radius.max(0.03) }, pose));
    }
    let mut worst = 0.0_f64;
    for (shape, pose) in scenes {
        for material in [GROUNDED, dielectric(4.0), dielectric(80.0)] {
            let mut solid = Solids::new(std::slice::from_ref(&shape)).unwrap();
            solid.place(&[pose]).unwrap();
            let found = compare(&finder, &solid, &[material]);
            assert!(found.moved == 0 && found.otherwise == 0, "{found:?}: {shape:?} {pose:?} {material:?}");
            assert!(found.changed > 5, "{found:?}: {shape:?} {material:?}");
            worst = worst.max(found.rounding);
        }
    }
    println!("entries differ by up to {worst:.1e} of their row");
}

/// Spans and points inside of turned solids at any place.
#[test]
fn spans_are_those_of_the_processor() {
    let finder = Finder::new(sensor(1_000, false));
    let mut dice = dice();
    let point = || [-0.3..0.3_f32, -0.3..0.3_f32, -0.2..0.4_f32];
    let segments = prop::collection::vec([point(), point()], 3_000);
    for _ in 0..20 {
        let (shape, pose, _) = any_object().new_tree(&mut dice).unwrap().current();
        let segments = segments.new_tree(&mut dice).unwrap().current();
        let mut solid = Solids::new(std::slice::from_ref(&shape)).unwrap();
        solid.place(&[pose]).unwrap();
        let size = solid.bounds(0).size().min_element();
        for (ends, (found, is_in)) in segments.iter().zip(finder.spans(&solid, &segments)) {
            let [a, b] = ends.map(|point| DVec3::from_array(point.map(f64::from)));
            let expected = solid.span(0, a, b);
            let found = (found[0] <= found[1]).then_some(found);
            let length = |span: [f64; 2]| (span[1] - span[0]) * a.distance(b);
            assert_eq!(is_in, solid.contains(0, a), "{shape:?} {a}");
            match (found.map(|span| span.map(f64::from)), expected.map(|span| [span.enter, span.exit])) {
                (None, None) => {}
                (Some(found), Some(expected)) => {
                    // Where a segment all but touches, its ends move by the root of what rounding moves the surface.
                    let slack = 1e-6 * (1.0 + size / length(expected).max(1e-3 * size));
                    let apart = [0, 1].map(|end| (found[end] - expected[end]).abs());
                    assert!(apart[0].max(apart[1]) < slack, "{shape:?} {a} {b}: {found:?} {expected:?}");
                }
                (found, expected) => {
                    let part = found.or(expected).map_or(0.0, length);
                    assert!(part < 3e-3 * size, "{shape:?} {a} {b}: {found:?} {expected:?}");
                }
            }
        }
    }
}
