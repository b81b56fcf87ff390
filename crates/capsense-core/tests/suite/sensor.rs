//! Lattices, electrodes, and sensors that must be refused.

use crate::common::{
    DOMAIN, Dice, EXACT, bar, depth_of_boxes, rectangle, relative_error, stripes_sensor, three_stripes, to,
};
use capsense_core::electrode::{Electrode, Outline};
use capsense_core::glam::{DVec2, DVec3};
use capsense_core::material::{Connection, Material, RelativePermittivity};
use capsense_core::mesh::{Lattice, MeshError, TetMesh, graded_axis};
use capsense_core::sensor::{ElectrodeNodes, GROUND, MeshKind, Sensor, SensorDesign, SensorError, Substrate};
use capsense_core::simulator::{Simulator, SimulatorError};
use capsense_core::solver::{SolveError, SolverOptions};
use proptest::prelude::*;

fn with(electrodes: Vec<Electrode>) -> SensorDesign {
    SensorDesign { electrodes, ..three_stripes() }
}

fn disk(radius: f64) -> Electrode {
    Electrode { name: "D".into(), outline: Outline::Disk { center: DVec2::ZERO, radius }, z: 0.0 }
}

#[test]
fn designs_that_cannot_be_built_are_refused() {
    let refused = |electrodes| with(electrodes).validate().unwrap_err();
    assert_eq!(refused(vec![]), SensorError::NoElectrodes);
    let twin = rectangle("A", [0.0, 0.0], [0.01, 0.01]);
    assert_eq!(refused(vec![twin.clone(), twin.clone()]), SensorError::DuplicateName("A".into()));
    assert_eq!(
        refused(vec![rectangle("A", [1.0, 0.0], [0.01, 0.01])]),
        SensorError::OutsideDomain("A".into())
    );
    assert_eq!(refused(vec![rectangle("A", [0.0, 0.0], [0.5, 0.01])]), SensorError::TouchesWall("A".into()));
    assert_eq!(refused(vec![Electrode { z: -0.05, ..twin.clone() }]), SensorError::TouchesWall("A".into()));
    let outline = |outline| refused(vec![Electrode { outline, ..twin.clone() }]).to_string();
    assert!(outline(Outline::Disk { center: DVec2::ZERO, radius: -1.0 }).contains("has no area"));
    assert!(outline(Outline::Disk { center: DVec2::NAN, radius: 1.0 }).contains("is not finite"));
    assert!(outline(Outline::Polygon(vec![DVec2::ZERO, DVec2::X])).contains("fewer than three"));
    assert!(outline(Outline::Polygon(vec![DVec2::ZERO, DVec2::X, 2.0 * DVec2::X])).contains("has no area"));
    let bow = [[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.7]].map(DVec2::from);
    assert!(outline(Outline::Polygon(bow.to_vec())).contains("crosses itself"));
    let board = |thickness| Substrate {
        thickness,
        relative_permittivity: RelativePermittivity::VACUUM,
        size: DVec2::splat(0.1),
        grounded_back: false,
    };
    for thickness in [0.0, f64::NAN, 0.06] {
        let design = SensorDesign { substrate: Some(board(thickness)), ..three_stripes() };
        assert!(matches!(design.validate(), Err(SensorError::Substrate(_))), "{thickness}");
    }
    let empty = SensorDesign {
        domain: capsense_core::geometry::Aabb { max: DOMAIN.min, ..DOMAIN },
        ..three_stripes()
    };
    assert_eq!(empty.validate(), Err(SensorError::Domain));
    assert!(matches!(three_stripes().lattice(100), Err(SensorError::TooFewElements { allowed: 100, .. })));
}

#[test]
fn meshes_and_electrodes_that_do_not_fit_are_refused() {
    let mesh = || Lattice::uniform(DOMAIN, [3, 3, 3]).unwrap().to_tet_mesh().unwrap();
    let nodes = |nodes: &[u32]| ElectrodeNodes::Nodes(nodes.to_vec());
    let build = |electrodes: Vec<(&str, ElectrodeNodes)>| {
        Sensor::on_mesh(mesh(), &[], electrodes.into_iter().map(|(n, e)| (n.to_owned(), e)).collect())
    };
    assert_eq!(build(vec![("A", nodes(&[]))]), Err(SensorError::OwnsNoNode("A".into())));
    let small = ElectrodeNodes::Shape(disk(1e-6));
    assert_eq!(build(vec![("D", small)]), Err(SensorError::OwnsNoNode("D".into())));
    let shared = build(vec![("A", nodes(&[1, 2])), ("B", nodes(&[2]))]);
    assert_eq!(shared, Err(SensorError::SharedNode { first: "A".into(), second: "B".into(), node: 2 }));
    let missing = build(vec![("A", nodes(&[999]))]);
    assert_eq!(missing, Err(SensorError::NodeOutOfRange { name: "A".into(), node: 999, nodes: 64 }));
}

/// The number of cells jumps where the search for the best spacing ends, so near to it rounding must not decide.
#[test]
fn a_symmetric_design_has_a_symmetric_lattice() {
    for tets in (10_000..=150_000).step_by(5_000) {
        let lattice = three_stripes().lattice(tets).unwrap();
        for axis in &lattice.axes()[..2] {
            let mirrored = axis.iter().rev().map(|x| -x);
            let apart = axis.iter().zip(mirrored).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(apart < 1e-9, "{tets}: {axis:?}");
        }
    }
}

#[test]
fn a_part_of_the_mesh_without_terminal_is_found() {
    let one = mesh_of_two_parts();
    let electrode = vec![("A".to_owned(), ElectrodeNodes::Nodes(vec![0]))];
    assert!(matches!(
        Sensor::on_mesh(one, &[1], electrode),
        Err(SensorError::NoGroundReachable { node: 4, .. })
    ));
}

fn mesh_of_two_parts() -> TetMesh {
    let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    let nodes = corners.into_iter().chain(corners.map(|c| c + DVec3::splat(5.0))).collect();
    TetMesh::new(nodes, vec![[0, 1, 2, 3], [4, 5, 6, 7]]).unwrap()
}

#[test]
fn elements_that_are_none_are_named() {
    let corners = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    let mesh = |tets: Vec<[u32; 4]>| TetMesh::new(corners.clone(), tets);
    assert!(mesh(vec![[0, 1, 2, 3]]).is_ok());
    assert_eq!(mesh(vec![]), Err(MeshError::Empty));
    assert!(matches!(mesh(vec![[1, 0, 2, 3]]), Err(MeshError::Inverted { element: 0, .. })));
    assert!(matches!(mesh(vec![[0, 1, 2, 3], [0, 1, 2, 2]]), Err(MeshError::ZeroVolume { element: 1, .. })));
    assert_eq!(mesh(vec![[0, 1, 2, 4]]), Err(MeshError::NodeOutOfRange { element: 0, node: 4, nodes: 4 }));
    let orphan = corners.iter().copied().chain([DVec3::ONE]).collect();
    assert_eq!(TetMesh::new(orphan, vec![[0, 1, 2, 3]]), Err(MeshError::OrphanNode(4)));
    let nan = vec![DVec3::NAN, DVec3::X, DVec3::Y, DVec3::Z];
    assert_eq!(TetMesh::new(nan, vec![[0, 1, 2, 3]]), Err(MeshError::NonFiniteNode(0)));
    let negative = mesh(vec![[0, 1, 2, 3]]).unwrap().with_permittivity(|_| -1.0);
    assert_eq!(negative, Err(MeshError::Permittivity { element: 0, value: -1.0 }));
}

#[test]
fn simulators_refuse_what_they_cannot_simulate() {
    let build = |material, options| Simulator::new(stripes_sensor(5_000), vec![material], options);
    let grounded = Material::Conductor(Connection::Grounded);
    let bad = SolverOptions { tolerance: 0.0, ..SolverOptions::default() };
    assert_eq!(build(grounded, bad).unwrap_err(), SimulatorError::Tolerance(0.0));
    let negative = Material::Conductor(Connection::Capacitance(-1e-12));
    let error = build(negative, SolverOptions::default()).unwrap_err();
    assert_eq!(error, SimulatorError::CapacitanceToGround { object: 0, farads: -1e-12 });
    let mut simulator = build(grounded, SolverOptions::default()).unwrap();
    let two = depth_of_boxes([8, 8], &[bar(0.1, 0.0), bar(0.2, 0.0)]);
    assert_eq!(simulator.step(&two), Err(SimulatorError::ObjectCount { seen: 2, known: 1 }));
    let mut nan = depth_of_boxes([8, 8], &[bar(0.1, 0.0)]);
    nan.layer_mut(0).0[0] = f32::NAN;
    assert!(matches!(simulator.step(&nan), Err(SimulatorError::Depth(_))));
}

#[test]
fn too_few_iterations_are_a_failure_that_leaves_the_last_good_frame() {
    let hasty = SolverOptions { max_iterations: 3, ..EXACT };
    let error = Simulator::new(stripes_sensor(5_000), vec![], hasty).unwrap_err();
    let SimulatorError::Solve(SolveError::NotConverged { iterations: 3, relative_error, tolerance }) = error
    else {
        panic!("{error}");
    };
    assert!(relative_error > tolerance && relative_error.is_finite());
}

#[test]
fn a_disk_whose_rim_cuts_edges_is_nearly_as_large_as_it_is() {
    // The same disk on lattices that know nothing of its rim: the area enclosed by cut edges hardly changes, so the
    // self-capacitance must not jump as the number of nodes inside does.
    let capacitance = |radius: f64| {
        let design = with(vec![disk(0.03)]);
        let lattice = design.lattice_of_spacing(0.006, 1.3).unwrap();
        let sensor = Sensor::on_lattice(&with(vec![disk(radius)]), &lattice).unwrap();
        Simulator::new(sensor, vec![], EXACT).unwrap().base().get(0, 0)
    };
    let values: Vec<f64> = (0..15).map(|k| capacitance(0.02 + 0.0004 * f64::from(k))).collect();
    for pair in values.windows(2) {
        let growth = pair[1] / pair[0] - 1.0;
        assert!(growth > 0.0 && growth < 0.05, "{values:?}");
    }
}

#[test]
fn a_board_and_its_shield_raise_the_capacitance() {
    let board = |permittivity, grounded_back| {
        let relative_permittivity = RelativePermittivity::new(permittivity).unwrap();
        let substrate = Substrate {
            thickness: 1.6e-3,
            relative_permittivity,
            size: DVec2::new(0.14, 0.12),
            grounded_back,
        };
        let design = SensorDesign { substrate: Some(substrate), ..three_stripes() };
        let sensor = Sensor::on_lattice(&design, &design.lattice(60_000).unwrap()).unwrap();
        Simulator::new(sensor, vec![], SolverOptions::default()).unwrap().base().get(0, 0)
    };
    let (air, fr4, shielded) = (board(1.0, false), board(4.4, false), board(4.4, true));
    assert!(air < fr4 && fr4 < shielded, "{air} {fr4} {shielded}");
    // The shield makes a plate capacitor of 100 mm x 20 mm. Cells at the rim are several times wider than the board is
    // thick here, which exaggerates the fringes.
    let plates = capsense_core::units::VACUUM_PERMITTIVITY * 4.4 * 0.1 * 0.02 / 1.6e-3;
    assert!(shielded > plates && shielded < 2.0 * plates, "{shielded} {plates}");
}

#[test]
fn walls_are_grounded_and_electrodes_own_their_corners() {
    let sensor = stripes_sensor(20_000);
    let terminal_at = |p: DVec3| {
        let at = sensor.mesh().nodes().iter().position(|n| n.distance(p) < 1e-9);
        sensor.owners()[at.unwrap()]
    };
    assert_eq!(terminal_at(DOMAIN.min), GROUND);
    assert_eq!(terminal_at(DVec3::new(0.05, -0.04, 0.0)), 1);
    assert_eq!(terminal_at(DVec3::new(-0.05, 0.01, 0.0)), 2);
    assert_eq!(terminal_at(DVec3::new(0.05, 0.02, 0.0)), 3);
}

proptest! {
    #[test]
    fn graded_axes_contain_their_planes_and_grow_slowly(
        planes in prop::collection::vec(0.05..0.95, 1..5), finest in 0.002..0.2, growth in 1.05..1.6,
    ) {
        let axis = graded_axis(0.0, 1.0, &planes, &[], finest, growth);
        prop_assert!(axis.windows(2).all(|pair| pair[0] < pair[1]));
        prop_assert_eq!((axis[0], axis[axis.len() - 1]), (0.0, 1.0));
        for plane in &planes {
            prop_assert!(axis.iter().any(|x| (x - plane).abs() <= 1e-9));
        }
        // A step may not be longer than the wanted spacing at its far end.
        for pair in axis.windows(2) {
            let distance = planes.iter().map(|p| (pair[0] - p).abs().max((pair[1] - p).abs())).fold(1.0, f64::min);
            prop_assert!(pair[1] - pair[0] <= (finest + (growth - 1.0) * distance) * 1.02, "{:?}", axis);
        }
    }
}

// Each lattice takes a tenth of a second.
proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Electrodes in a row, neither narrower nor closer to each other than cells may be: each has a node of its own, cells are
    /// alike on both sides of all edges, and layers nowhere in the workspace are as high as a third of it.
    #[test]
    fn lattices_suit_electrodes_and_the_room_above(
        tets in 60_000usize..200_000, count in 1..5usize, width in 0.01..0.03, gap in 0.01..0.03,
    ) {
        let pitch = width + gap;
        let electrodes = (0..count).map(|k| {
            let y = pitch * (k as f64 - 0.5 * (count - 1) as f64);
            rectangle(&format!("E{k}"), [0.0, y], [0.1, width])
        });
        let design = SensorDesign { electrodes: electrodes.collect(), ..three_stripes() };
        let lattice = design.lattice(tets).unwrap();
        prop_assert!(lattice.tet_count() <= tets);
        prop_assert!(Sensor::on_lattice(&design, &lattice).is_ok());
        let edges = |axis: usize| {
            design.electrodes.iter().flat_map(move |electrode| electrode.outline.axis_planes(axis))
        };
        for axis in 0..2 {
            for three in lattice.axes()[axis].windows(3) {
                if edges(axis).any(|edge| (edge - three[1]).abs() < 1e-9) {
                    let ratio = (three[2] - three[1]) / (three[1] - three[0]);
                    prop_assert!(ratio.max(1.0 / ratio) < 1.41, "{} {:?}", axis, three);
                }
            }
        }
        let layers = lattice.axes()[2].windows(2).filter(|pair| pair[0] >= 0.0 && pair[1] < 0.2);
        for pair in layers {
            prop_assert!(pair[1] - pair[0] < 0.075, "{:?}", lattice.axes()[2]);
        }
    }

    #[test]
    fn a_lattice_has_at_most_the_elements_asked_for(tets in 3_000usize..60_000) {
        let count = three_stripes().lattice(tets).unwrap().tet_count();
        prop_assert!(count <= tets && count > tets / 2, "{} of {}", count, tets);
    }
}

/// On a mesh with triangles of any shape around rims.
#[test]
fn capacitances_do_not_depend_on_how_nodes_are_numbered() {
    let sensor = Sensor::generated(&three_stripes(), MeshKind::Bisection, 30_000).unwrap();
    let nodes = sensor.mesh().nodes().len() as u32;
    let capacitances = |order: &[u32]| {
        let mesh = sensor.mesh().renumbered(order);
        let owned_by = |terminal: u16| -> Vec<u32> {
            let owners = order.iter().map(|&node| sensor.owners()[node as usize]);
            owners.zip(0..).filter(|(owner, _)| *owner == terminal).map(|(_, node)| node).collect()
        };
        let of_electrode = |k: u16| (format!("E{k}"), ElectrodeNodes::Nodes(owned_by(k)));
        let sensor = Sensor::on_mesh(mesh, &owned_by(GROUND), (1..=3).map(of_electrode).collect()).unwrap();
        Simulator::new(sensor, vec![], to(1e-9)).unwrap().base().clone()
    };
    let as_made = capacitances(&(0..nodes).collect::<Vec<u32>>());
    let mut dice = Dice(3);
    for _ in 0..3 {
        let mut order: Vec<(f64, u32)> = (0..nodes).map(|node| (dice.next(), node)).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        let order: Vec<u32> = order.into_iter().map(|(_, node)| node).collect();
        let error = relative_error(&capacitances(&order), &as_made);
        assert!(error < 1e-7, "{error:e}");
    }
}
