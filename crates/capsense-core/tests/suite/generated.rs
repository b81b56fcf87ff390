//! Bisected meshes of designed sensors: conforming, of bounded shape, with the sensor in their planes, and never too large.

use crate::common::conforming::{assert_conforming, faces};
use crate::common::{DOMAIN, rectangle, three_stripes};
use capsense_core::electrode::{Electrode, Outline};
use capsense_core::geometry::Aabb;
use capsense_core::glam::{DVec2, DVec3};
use capsense_core::material::RelativePermittivity;
use capsense_core::mesh::{MeshQuality, TetMesh, signed_volume};
use capsense_core::sensor::{GROUND, MeshKind, Sensor, SensorDesign, SensorError, Substrate, Wall};
use proptest::prelude::*;

/// The smallest dihedral angle, degrees: of the three stripes, and where a board is twenty times as thin as cells are wide.
const SMALLEST_ANGLE: f64 = 4.0;
const SMALLEST_ANGLE_WITH_BOARD: f64 = 1.5;

fn with_board() -> SensorDesign {
    let board = Substrate {
        thickness: 2e-3,
        relative_permittivity: RelativePermittivity::new(4.4).unwrap(),
        size: DVec2::new(0.2, 0.2),
        grounded_back: true,
    };
    let disk = Outline::Disk { center: DVec2::new(0.05, 0.0), radius: 0.03 };
    let disk = Electrode { name: "E2".to_owned(), outline: disk, z: 0.01 };
    let electrodes = vec![rectangle("E1", [-0.05, 0.0], [0.06, 0.1]), disk];
    SensorDesign { domain: DOMAIN, electrodes, substrate: Some(board), wall: Wall::Grounded }
}

/// One to three rectangles side by side, at any height.
fn designs() -> impl Strategy<Value = SensorDesign> {
    let rectangles = prop::collection::vec((0.01..0.06, 0.01..0.15, 0.0..0.03), 1..=3);
    rectangles.prop_map(|sizes| {
        let electrodes = sizes.iter().enumerate().map(|(k, &(width, length, z))| {
            let x = 0.07 * (k as f64 - 1.0);
            Electrode { z, ..rectangle(&format!("E{k}"), [x, 0.0], [width, length]) }
        });
        SensorDesign {
            domain: DOMAIN,
            electrodes: electrodes.collect(),
            substrate: None,
            wall: Wall::Grounded,
        }
    })
}

/// How much of the domain's cross-section is faces of the mesh.
fn covered(mesh: &TetMesh, domain: &Aabb, axis: usize, plane: f64) -> f64 {
    let size = domain.size();
    let lies_in =
        |face: &&[u32; 3]| face.iter().all(|&node| (mesh.nodes()[node as usize][axis] - plane).abs() < 1e-12);
    let area = |face: &[u32; 3]| {
        let [a, b, c]: [DVec3; 3] = face.map(|node| mesh.nodes()[node as usize]);
        0.5 * (b - a).cross(c - a).length()
    };
    let sum: f64 = faces(mesh).keys().filter(lies_in).map(area).sum();
    sum / (size[(axis + 1) % 3] * size[(axis + 2) % 3])
}

#[test]
fn bisected_meshes_conform_and_have_no_flat_elements() {
    for (design, smallest) in [(three_stripes(), SMALLEST_ANGLE), (with_board(), SMALLEST_ANGLE_WITH_BOARD)] {
        for elements in [30_000, 60_000] {
            let sensor = Sensor::generated(&design, MeshKind::Bisection, elements).unwrap();
            let mesh = sensor.mesh();
            assert_conforming(mesh, &design.domain);
            let quality = MeshQuality::of(mesh);
            println!(
                "{} {:.2} to {:.1}",
                mesh.tets().len(),
                quality.min_dihedral_degrees,
                quality.max_dihedral_degrees
            );
            assert!(quality.min_dihedral_degrees > smallest, "{}", quality.min_dihedral_degrees);
            assert!(5 * mesh.tets().len() > 3 * elements, "{} of {elements}", mesh.tets().len());
        }
    }
}

#[test]
fn electrodes_and_board_lie_in_planes_of_bisected_meshes() {
    let design = with_board();
    let sensor = Sensor::generated(&design, MeshKind::Bisection, 20_000).unwrap();
    let mesh = sensor.mesh();
    let planes =
        [(2, 0.0), (2, -2e-3), (2, 0.01), (0, -0.08), (0, -0.02), (0, 0.1), (1, 0.05), (1, -0.05), (1, 0.1)];
    for (axis, plane) in planes {
        let covered = covered(mesh, &design.domain, axis, plane);
        assert!((covered - 1.0).abs() < 1e-9, "{covered} of the plane {plane} across axis {axis}");
    }
    let board = (0..mesh.tets().len()).filter(|&element| mesh.relative_permittivity().at(element) == 4.4);
    let volume: f64 = board.map(|element| signed_volume(mesh.corners(element))).sum();
    assert!((volume / (0.2 * 0.2 * 2e-3) - 1.0).abs() < 1e-9, "{volume}");
    let shield = |node: &DVec3| node.z == -2e-3 && node.truncate().abs().max_element() <= 0.1;
    let mut held = mesh.nodes().iter().zip(sensor.terminals()).filter(|(node, _)| shield(node));
    assert!(held.all(|(_, terminal)| *terminal == GROUND));
}

#[test]
fn a_million_bisected_tetrahedra_are_finest_at_rims() {
    let design = three_stripes();
    let mesh = design.bisection(1_000_000).unwrap();
    assert!((600_000..=1_000_000).contains(&mesh.tet_count()), "{}", mesh.tet_count());
    let longest = |element: usize| {
        let corners = mesh.corners(element);
        corners.iter().flat_map(|a| corners.iter().map(|b| a.distance(*b))).fold(0.0, f64::max)
    };
    let near = |element: &usize| {
        mesh.corners(*element).iter().any(|corner| corner.distance(DVec3::new(0.05, 0.04, 0.0)) < 1e-3)
    };
    let at_corner = (0..mesh.tet_count()).filter(near).map(longest).fold(0.0, f64::max);
    let anywhere = (0..mesh.tet_count()).map(longest).fold(0.0, f64::max);
    assert!(at_corner < 0.2 * anywhere, "{at_corner} {anywhere}");
}

#[test]
fn too_few_elements_are_refused_for_both_kinds() {
    for kind in [MeshKind::Lattice, MeshKind::Bisection] {
        let error = Sensor::generated(&with_board(), kind, 100).unwrap_err();
        let SensorError::TooFewElements { allowed: 100, needed } = error else { panic!("{kind:?}: {error}") };
        assert!(needed > 100);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]

    #[test]
    fn elements_are_never_exceeded_and_meshes_are_the_same_each_time(
        design in designs(), elements in 3_000usize..60_000,
    ) {
        for kind in [MeshKind::Lattice, MeshKind::Bisection] {
            match Sensor::generated(&design, kind, elements) {
                Ok(sensor) => {
                    prop_assert!(sensor.mesh().tets().len() <= elements);
                    assert_conforming(sensor.mesh(), &design.domain);
                    prop_assert_eq!(sensor, Sensor::generated(&design, kind, elements).unwrap());
                }
                Err(SensorError::OwnsNoNode(_)) => {}
                Err(error) => prop_assert!(
                    matches!(error, SensorError::TooFewElements { needed, .. } if needed > elements), "{}", error
                ),
            }
        }
    }
}
