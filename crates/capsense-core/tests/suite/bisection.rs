//! Bisected lattices: conforming, made of few shapes, and the same each time.

use crate::common::conforming::{assert_conforming, faces};
use approx::assert_relative_eq;
use capsense_core::geometry::Aabb;
use capsense_core::glam::DVec3;
use capsense_core::mesh::{
    Bisection, Lattice, MeshError, MeshQuality, Refinement, TetMesh, largest_first, signed_volume,
};
use proptest::prelude::*;
use proptest::sample::Index;
use std::collections::{BTreeMap, BTreeSet};

/// Shapes, turned or mirrored ones counted once, that the elements of a box of three different sides have, sizes apart:
/// three Kuhn tetrahedra, a half of them for each pair of sides, and two halves of each of those.
const SHAPES_OF_A_BOX: usize = 12;

/// Of a cube: one for each of three generations.
const SHAPES_OF_A_CUBE: usize = 3;

/// Dihedral angles of all three shapes of a cube, degrees.
const ANGLES_OF_A_CUBE: [f64; 2] = [45.0, 120.0];

const NO_LIMIT: usize = usize::MAX;

/// Cells between 0.1 and 1 wide, up to three along each axis.
fn lattices() -> impl Strategy<Value = Lattice> {
    let axis =
        (-1.0..1.0, prop::collection::vec(0.1..1.0, 1..=3)).prop_map(|(start, widths): (f64, Vec<f64>)| {
            let mut axis = vec![start];
            widths.into_iter().for_each(|width| axis.push(axis[axis.len() - 1] + width));
            axis
        });
    [axis.clone(), axis.clone(), axis].prop_map(|axes| Lattice::new(axes).unwrap())
}

/// What to mark, round by round.
fn rounds() -> impl Strategy<Value = Vec<Vec<Index>>> {
    prop::collection::vec(prop::collection::vec(any::<Index>(), 0..8), 0..12)
}

fn refined(lattice: &Lattice, rounds: &[Vec<Index>], max_tets: usize) -> Bisection {
    let mut bisection = Bisection::new(lattice).unwrap();
    for round in rounds {
        let marked = marks(round, &bisection);
        if bisection.refine(&marked, max_tets) == Refinement::Full {
            break;
        }
    }
    bisection
}

fn marks(round: &[Index], bisection: &Bisection) -> Vec<u32> {
    round.iter().map(|index| index.index(bisection.tet_count()) as u32).collect()
}

fn unit_cube(cells: usize) -> Lattice {
    Lattice::uniform(Aabb { min: DVec3::ZERO, max: DVec3::ONE }, [cells; 3]).unwrap()
}

fn domain(lattice: &Lattice) -> Aabb {
    let ends = |last: bool| lattice.axes().each_ref().map(|axis| axis[if last { axis.len() - 1 } else { 0 }]);
    Aabb { min: ends(false).into(), max: ends(true).into() }
}

fn face_area(mesh: &TetMesh, face: [u32; 3]) -> f64 {
    let [a, b, c] = face.map(|node| mesh.nodes()[node as usize]);
    0.5 * (b - a).cross(c - a).length()
}

/// Every plane of the lattice is full of faces.
fn assert_planes_kept(mesh: &TetMesh, lattice: &Lattice) {
    let size = domain(lattice).size();
    let faces = faces(mesh);
    for axis in 0..3 {
        for &plane in &lattice.axes()[axis] {
            let lies_in =
                |face: &&[u32; 3]| face.iter().all(|&node| mesh.nodes()[node as usize][axis] == plane);
            let area: f64 = faces.keys().filter(lies_in).map(|face| face_area(mesh, *face)).sum();
            assert_relative_eq!(area, size.element_product() / size[axis], max_relative = 1e-12);
        }
    }
}

/// Lengths of the edges in ascending order, of the size that the element's ancestor of generation 0, 1 or 2 had,
/// rounded.
fn shape(bisection: &Bisection, element: usize) -> [u64; 6] {
    let corners = bisection.corners(element);
    let halvings = bisection.generations()[element] / 3;
    let mut lengths = [0; 6];
    let pairs = (0..4).flat_map(|i| (0..i).map(move |j| (i, j)));
    for (length, (i, j)) in lengths.iter_mut().zip(pairs) {
        *length = (corners[i].distance(corners[j]) * f64::from(1u32 << halvings) * 1e9).round() as u64 / 10;
    }
    lengths.sort_unstable();
    lengths
}

/// Smallest and largest dihedral angle of the shapes that a cell's elements can have.
fn angles_of_cell(size: DVec3) -> [f64; 2] {
    let lattice = Lattice::uniform(Aabb { min: DVec3::ZERO, max: size }, [1; 3]).unwrap();
    let mut bisection = Bisection::new(&lattice).unwrap();
    let mut angles = [f64::INFINITY, 0.0];
    for _ in 0..3 {
        let quality = MeshQuality::of(&bisection.to_tet_mesh().unwrap());
        angles = [angles[0].min(quality.min_dihedral_degrees), angles[1].max(quality.max_dihedral_degrees)];
        refine_all(&mut bisection);
    }
    angles
}

fn refine_all(bisection: &mut Bisection) {
    let all: Vec<u32> = (0..bisection.tet_count() as u32).collect();
    assert_eq!(bisection.refine(&all, NO_LIMIT), Refinement::Complete);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, ..ProptestConfig::default() })]

    #[test]
    fn bisected_lattices_conform(lattice in lattices(), rounds in rounds(), spare in 0usize..3000) {
        let max_tets = lattice.tet_count() + spare;
        let bisection = refined(&lattice, &rounds, max_tets);
        prop_assert!(bisection.tet_count() <= max_tets);
        let mesh = bisection.to_tet_mesh().unwrap();
        prop_assert_eq!(mesh.tets().len(), bisection.tet_count());
        assert_conforming(&mesh, &domain(&lattice));
        assert_planes_kept(&mesh, &lattice);
        prop_assert_eq!(refined(&lattice, &rounds, max_tets), bisection.clone());
        prop_assert_eq!(bisection.into_tet_mesh().unwrap(), mesh);
    }

    /// No limit, or room for all, is the same; every mark is served.
    #[test]
    fn marked_elements_are_bisected(lattice in lattices(), rounds in rounds()) {
        let mut bisection = Bisection::new(&lattice).unwrap();
        for round in &rounds {
            let marked = marks(round, &bisection);
            let before = bisection.clone();
            prop_assert_eq!(bisection.refine(&marked, NO_LIMIT), Refinement::Complete);
            for element in marked {
                let generations = [&before, &bisection].map(|of| of.generations()[element as usize]);
                prop_assert!(generations[0] < generations[1]);
            }
            // Twice is not more than once.
            let twice = [marks(round, &before), marks(round, &before)].concat();
            for max_tets in [NO_LIMIT, bisection.tet_count()] {
                let mut again = before.clone();
                prop_assert_eq!(again.refine(&twice, max_tets), Refinement::Complete);
                prop_assert_eq!(&again, &bisection);
            }
        }
    }

    /// However often cells are bisected: a few shapes, and no angle worse than those of the first three generations.
    #[test]
    fn shapes_are_those_of_the_cell(lattice in lattices(), rounds in rounds()) {
        let bisection = refined(&lattice, &rounds, NO_LIMIT);
        let mesh = bisection.to_tet_mesh().unwrap();
        let mut cells: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for (element, origin) in bisection.origins().into_iter().enumerate() {
            cells.entry(origin / 6).or_default().push(element);
        }
        for (cell, elements) in cells {
            let shapes: BTreeSet<[u64; 6]> = elements.iter().map(|&e| shape(&bisection, e)).collect();
            prop_assert!(shapes.len() <= SHAPES_OF_A_BOX, "{} {shapes:?}", shapes.len());
            let corners = elements.iter().flat_map(|&element| bisection.corners(element));
            let bounds = Aabb::around(corners);
            let [low, high] = angles_of_cell(bounds.size());
            let of_cell = elements.iter().map(|&element| mesh.tets().at(element)).collect();
            let quality = MeshQuality::of(&with_own_nodes(&mesh, of_cell));
            prop_assert!(quality.min_dihedral_degrees > low - 1e-6, "cell {cell}: {low} {quality:?}");
            prop_assert!(quality.max_dihedral_degrees < high + 1e-6, "cell {cell}: {high} {quality:?}");
        }
    }

    #[test]
    fn fields_and_elements_inherit_what_was(
        lattice in lattices(), rounds in rounds(), slope in prop::array::uniform3(-1.0..1.0),
    ) {
        let of = |point: DVec3| 0.3 + DVec3::from(slope).dot(point);
        let half = refined(&lattice, &rounds[..rounds.len() / 2], NO_LIMIT);
        let all = refined(&lattice, &rounds, NO_LIMIT);
        for before in [&Bisection::new(&lattice).unwrap(), &half] {
            let mut values: Vec<f64> = before.nodes().iter().map(|&node| of(node)).collect();
            all.prolong(&mut values);
            prop_assert_eq!(values.len(), all.nodes().len());
            for (value, node) in values.iter().zip(all.nodes()) {
                prop_assert!((value - of(*node)).abs() < 1e-14, "{value} {node}");
            }
            let mut elements: Vec<usize> = (0..before.tet_count()).collect();
            all.inherit(&mut elements);
            prop_assert_eq!(elements.len(), all.tet_count());
            for (element, &ancestor) in elements.iter().enumerate() {
                let centroid = all.corners(element).iter().sum::<DVec3>() / 4.0;
                prop_assert!(is_in(before.corners(ancestor), centroid), "{element} {ancestor}");
            }
        }
        let mut origins: Vec<u32> = (0..lattice.tet_count() as u32).collect();
        half.inherit(&mut origins);
        prop_assert_eq!(&origins, &half.origins());
        all.inherit(&mut origins);
        prop_assert_eq!(&origins, &all.origins());
    }

    #[test]
    fn no_edge_is_longer_than_wanted(
        lattice in lattices(), focus in prop::array::uniform3(-1.0..2.0), slope in 0.3..1.0, spare in 0usize..20_000,
    ) {
        let size = |point: DVec3| 0.1 + slope * point.distance(focus.into());
        let mut bisection = Bisection::new(&lattice).unwrap();
        let max_tets = lattice.tet_count() + spare;
        let refinement = bisection.refine_to_size(size, max_tets);
        prop_assert!(bisection.tet_count() <= max_tets);
        let mut again = Bisection::new(&lattice).unwrap();
        prop_assert_eq!(again.refine_to_size(size, max_tets), refinement);
        prop_assert_eq!(&again, &bisection);
        assert_conforming(&bisection.to_tet_mesh().unwrap(), &domain(&lattice));
        let too_long = |element: &usize| {
            let corners = bisection.corners(*element);
            let wanted = corners.into_iter().map(size).fold(f64::INFINITY, f64::min);
            corners.iter().any(|a| corners.iter().any(|b| a.distance(*b) > wanted))
        };
        if refinement == Refinement::Complete {
            prop_assert_eq!((0..bisection.tet_count()).find(too_long), None);
            let before = bisection.clone();
            prop_assert_eq!(bisection.refine_to_size(size, NO_LIMIT), Refinement::Complete);
            prop_assert_eq!(bisection, before);
        } else {
            prop_assert_eq!(bisection.refine_to_size(size, NO_LIMIT), Refinement::Complete);
            prop_assert!(bisection.tet_count() > max_tets);
        }
    }
}

/// Some elements of a mesh as a mesh of their own.
fn with_own_nodes(mesh: &TetMesh, tets: Vec<[u32; 4]>) -> TetMesh {
    let used: BTreeSet<u32> = tets.iter().flatten().copied().collect();
    let numbers: BTreeMap<u32, u32> = used.iter().copied().zip(0..).collect();
    let nodes = used.iter().map(|&node| mesh.nodes()[node as usize]).collect();
    TetMesh::new(nodes, tets.into_iter().map(|tet| tet.map(|node| numbers[&node])).collect()).unwrap()
}

fn is_in([a, b, c, d]: [DVec3; 4], point: DVec3) -> bool {
    let whole = signed_volume([a, b, c, d]);
    let parts = [[point, b, c, d], [a, point, c, d], [a, b, point, d], [a, b, c, point]];
    parts.into_iter().all(|part| signed_volume(part) / whole > 1e-9)
}

#[test]
fn an_unrefined_lattice_is_the_lattice() {
    let lattice = unit_cube(3);
    assert_eq!(Bisection::new(&lattice).unwrap().to_tet_mesh(), lattice.to_tet_mesh());
}

#[test]
fn three_bisections_of_all_give_the_nodes_and_shapes_of_half_the_cells() {
    let lattice = unit_cube(2);
    let mut bisection = Bisection::new(&lattice).unwrap();
    // Only the first generation is obtuse.
    for largest in [120.0, 90.0, 90.0] {
        refine_all(&mut bisection);
        let quality = MeshQuality::of(&bisection.to_tet_mesh().unwrap());
        assert_relative_eq!(quality.min_dihedral_degrees, 45.0, max_relative = 1e-12);
        assert_relative_eq!(quality.max_dihedral_degrees, largest, max_relative = 1e-12);
    }
    let places = |nodes: &[DVec3]| -> BTreeSet<[u64; 3]> {
        nodes.iter().map(|node| node.to_array().map(f64::to_bits)).collect()
    };
    assert_eq!(places(bisection.nodes()), places(unit_cube(4).to_tet_mesh().unwrap().nodes()));
    assert_eq!(bisection.tet_count(), 8 * lattice.tet_count());
}

#[test]
fn cubes_have_three_shapes_with_angles_from_45_to_120_degrees() {
    let mut bisection = Bisection::new(&unit_cube(2)).unwrap();
    let size = |point: DVec3| 0.01 + 0.6 * point.distance(DVec3::splat(0.3));
    assert_eq!(bisection.refine_to_size(size, NO_LIMIT), Refinement::Complete);
    let shapes: BTreeSet<[u64; 6]> = (0..bisection.tet_count()).map(|e| shape(&bisection, e)).collect();
    assert_eq!(shapes.len(), SHAPES_OF_A_CUBE);
    let quality = MeshQuality::of(&bisection.to_tet_mesh().unwrap());
    let angles = [quality.min_dihedral_degrees, quality.max_dihedral_degrees];
    for (angle, expected) in angles.into_iter().zip(ANGLES_OF_A_CUBE) {
        assert_relative_eq!(angle, expected, max_relative = 1e-9);
    }
}

#[test]
fn boxes_have_twelve_shapes() {
    let domain = Aabb { min: DVec3::ZERO, max: DVec3::new(1.0, 1.3, 1.9) };
    let mut bisection = Bisection::new(&Lattice::uniform(domain, [2; 3]).unwrap()).unwrap();
    let mut shapes = BTreeSet::new();
    for _ in 0..7 {
        shapes.extend((0..bisection.tet_count()).map(|element| shape(&bisection, element)));
        refine_all(&mut bisection);
    }
    assert_eq!(shapes.len(), SHAPES_OF_A_BOX);
}

#[test]
fn refinement_stays_local() {
    let mut bisection = Bisection::new(&unit_cube(8)).unwrap();
    let coarse = bisection.tet_count();
    let size = |point: DVec3| if point.distance(DVec3::splat(0.3)) < 0.02 { 0.02 } else { f64::INFINITY };
    assert_eq!(bisection.refine_to_size(size, NO_LIMIT), Refinement::Complete);
    assert!(bisection.tet_count() < 2 * coarse, "{}", bisection.tet_count());
    let far = bisection.generations().iter().filter(|&&generation| generation == 0).count();
    assert!(far > coarse / 2, "{far}");
}

/// What is left of the generations between, which may be obtuse, is what conformity asks for between cells of two sizes.
#[test]
fn most_elements_are_kuhn_tetrahedra() {
    let mut bisection = Bisection::new(&unit_cube(4)).unwrap();
    let size = |point: DVec3| 0.03 + 0.4 * point.distance(DVec3::splat(0.3));
    assert_eq!(bisection.refine_to_size(size, NO_LIMIT), Refinement::Complete);
    let kuhn = bisection.generations().iter().filter(|generation| **generation % 3 == 0).count();
    let share = kuhn as f64 / bisection.tet_count() as f64;
    assert!(bisection.tet_count() > 5_000 && share > 0.7, "{share} of {}", bisection.tet_count());
}

/// With a budget sizes exceed those wanted by about one factor: the mesh is that of the size times the largest factor
/// found.
#[test]
fn a_budget_stretches_sizes_evenly() {
    let size = |point: DVec3| 1e-3 * (0.1 + point.distance(DVec3::splat(0.3)));
    let mut limited = Bisection::new(&unit_cube(2)).unwrap();
    assert_eq!(limited.refine_to_size(size, 20_000), Refinement::Full);
    let ratio = |element: usize| {
        let corners = limited.corners(element);
        let lengths = corners.iter().flat_map(|a| corners.iter().map(|b| a.distance(*b)));
        lengths.fold(0.0, f64::max) / corners.into_iter().map(size).fold(f64::INFINITY, f64::min)
    };
    let factor = (0..limited.tet_count()).map(ratio).fold(0.0, f64::max);
    let mut free = Bisection::new(&unit_cube(2)).unwrap();
    assert_eq!(free.refine_to_size(|point| factor * size(point), NO_LIMIT), Refinement::Complete);
    let counts = [free.tet_count(), limited.tet_count()];
    assert!(
        counts[1] > 19_000 && 3 * counts[0] > 2 * counts[1] && 2 * counts[0] < 3 * counts[1],
        "{counts:?}"
    );
}

#[test]
fn sizes_that_are_no_numbers_ask_for_nothing_and_none_for_all_there_is_room_for() {
    let mut bisection = Bisection::new(&unit_cube(2)).unwrap();
    let before = bisection.clone();
    assert_eq!(bisection.refine_to_size(|_| f64::NAN, NO_LIMIT), Refinement::Complete);
    assert_eq!(bisection.refine_to_size(|_| f64::INFINITY, NO_LIMIT), Refinement::Complete);
    assert_eq!(bisection, before);
    for nothing in [0.0, -1.0] {
        let mut bisection = before.clone();
        assert_eq!(bisection.refine_to_size(|_| nothing, 1000), Refinement::Full);
        assert!((900..=1000).contains(&bisection.tet_count()), "{}", bisection.tet_count());
    }
}

#[test]
fn the_budget_goes_to_the_largest_indicators() {
    let mut bisection = Bisection::new(&unit_cube(4)).unwrap();
    let indicators: Vec<f64> = (0..bisection.tet_count()).map(|e| ((e * 7919) % 384) as f64).collect();
    let marked = largest_first(&indicators, 1.0);
    let before = bisection.tet_count();
    assert_eq!(bisection.refine(&marked, before + 40), Refinement::Full);
    assert!((before + 30..=before + 40).contains(&bisection.tet_count()));
    let smallest = marked.iter().rev().take(marked.len() / 2);
    let bisected = smallest.filter(|&&element| bisection.generations()[element as usize] > 0).count();
    let first = marked.iter().take_while(|&&element| bisection.generations()[element as usize] > 0).count();
    assert!(first >= 6 && bisected < 30, "{first} {bisected}");
}

#[test]
fn more_tetrahedra_than_can_be_numbered_are_refused() {
    let error = Bisection::new(&unit_cube(900)).unwrap_err();
    assert_eq!(error, MeshError::TooManyElements(6 * 900 * 900 * 900));
    assert!(error.to_string().contains("4374000000 tetrahedra"), "{error}");
}
