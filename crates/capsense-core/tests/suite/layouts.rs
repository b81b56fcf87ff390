//! Lattices suit electrodes of any layout: edges close to each other, outlines that follow no axis, shields closer than a cell.

use capsense_core::capacitance::CapacitanceMatrix;
use capsense_core::electrode::{Electrode, Outline};
use capsense_core::geometry::Aabb;
use capsense_core::glam::{DVec2, DVec3};
use capsense_core::material::RelativePermittivity;
use capsense_core::mesh::Lattice;
use capsense_core::sensor::{Sensor, SensorDesign, Substrate, Wall};
use capsense_core::simulator::Simulator;
use capsense_core::solver::SolverOptions;

fn design(outlines: Vec<Outline>, substrate: Option<Substrate>) -> SensorDesign {
    let electrode = |(k, outline): (usize, Outline)| Electrode { name: format!("E{k}"), outline, z: 0.0 };
    SensorDesign {
        domain: Aabb { min: DVec3::new(-0.25, -0.25, -0.05), max: DVec3::new(0.25, 0.25, 0.45) },
        electrodes: (1..).zip(outlines).map(electrode).collect(),
        substrate,
        wall: Wall::Grounded,
    }
}

fn rectangle(x: f64, y: f64, width: f64, depth: f64) -> Outline {
    Outline::Rectangle { center: DVec2::new(x, y), size: DVec2::new(width, depth) }
}

fn turned_square(x: f64, y: f64, degrees: f64) -> Outline {
    let about = DVec2::from_angle(f64::to_radians(degrees));
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    Outline::Polygon(
        corners.map(|(i, j)| DVec2::new(x, y) + about.rotate(0.0175 * DVec2::new(i, j))).to_vec(),
    )
}

fn squares_across() -> SensorDesign {
    design(
        [(-0.05, -0.02), (0.0, 0.0), (0.05, 0.025)].map(|(x, y)| rectangle(x, y, 0.03, 0.03)).to_vec(),
        None,
    )
}

fn shielded_board() -> Substrate {
    Substrate {
        thickness: 0.0016,
        relative_permittivity: RelativePermittivity::new(4.4).unwrap(),
        size: DVec2::new(0.16, 0.12),
        grounded_back: true,
    }
}

fn capacitance(design: &SensorDesign, tets: usize) -> CapacitanceMatrix {
    let sensor = Sensor::on_lattice(design, &design.lattice(tets).unwrap()).unwrap();
    Simulator::new(sensor, Vec::new(), SolverOptions::default()).unwrap().base().clone()
}

/// The largest error of a self-capacitance, against 800,000 tetrahedra.
fn error(design: &SensorDesign, tets: usize) -> f64 {
    let [ours, exact] = [tets, 800_000].map(|tets| capacitance(design, tets));
    (0..ours.size()).map(|k| (ours.get(k, k) / exact.get(k, k) - 1.0).abs()).fold(0.0, f64::max)
}

/// Cells beside edges as large as the finest spacing would have it, where the next edge leaves a fifth of that, made C 42 % too large.
#[test]
fn cells_beside_edges_are_alike_where_edges_are_close_to_each_other() {
    let off = error(&squares_across(), 28_000);
    println!("squares across: {off:.4}");
    assert!(off < 0.06, "{off}");
}

/// With planes at both ends of all outlines, two of them 4 mm from each other and none between those, C was up to 55 % too small.
#[test]
fn outlines_that_follow_no_axis_need_no_planes_at_their_ends() {
    let turned = design(
        vec![
            turned_square(-0.05, 0.0, 30.0),
            turned_square(0.0, 0.0, 20.0),
            turned_square(0.055, 0.01, 45.0),
        ],
        None,
    );
    let off = error(&turned, 28_000);
    println!("turned squares: {off:.4}");
    assert!(off < 0.05, "{off}");
}

/// Over a shield what counts is the covered part of a cell. As if neighbours were equally far, C was 2.8 % too small.
#[test]
fn rims_over_shields_know_how_far_neighbours_are() {
    let stripes = [-0.03, 0.0, 0.03].map(|y| rectangle(0.0, y, 0.1, 0.02)).to_vec();
    let off = error(&design(stripes, Some(shielded_board())), 124_000);
    println!("stripes over a shield: {off:.4}");
    assert!(off < 0.006, "{off}");
}

/// What is compared keeps to the number, is nothing twice, and has planes where electrodes and faces of the board are.
#[test]
fn lattices_to_choose_from_differ_and_keep_what_must_be_planes() {
    let board = Substrate { thickness: 0.003, size: DVec2::new(0.15, 0.09), ..shielded_board() };
    let bounds = board.bounds();
    let mut design = SensorDesign { substrate: Some(board), ..squares_across() };
    design.electrodes[1].z = 0.004;
    let varied = design.varied_lattices(28_000).unwrap();
    assert!(varied.len() > 10, "{}", varied.len());
    let lower = design.lattices_of_lower_layers(300_000).unwrap();
    let sized =
        |lattices: &[Lattice], most: usize| lattices.iter().all(|lattice| lattice.tet_count() <= most);
    assert!(sized(&varied, 28_000) && sized(&lower, 300_000));
    let lattices: Vec<_> = varied.iter().chain(&lower).collect();
    for (k, &lattice) in lattices.iter().enumerate() {
        assert!(!lattices[..k].contains(&lattice), "{k}");
        assert!(lattice.axes()[2].iter().any(|plane| (plane - 0.004).abs() < 1e-12), "{k}");
        for axis in 0..3 {
            let planes = &lattice.axes()[axis];
            let must_be = [bounds.min[axis], bounds.max[axis]];
            assert!(must_be.iter().all(|plane| planes.contains(plane)), "{k}, axis {axis}: {planes:?}");
        }
        Sensor::on_lattice(&design, lattice).unwrap();
    }
}

/// Lower layers are more, and leave fewer tetrahedra for each; there are none where there is no room for them.
#[test]
fn lower_layers_are_more() {
    let design = squares_across();
    let planes = |lattice: &Lattice| [0, 2].map(|axis| lattice.axes()[axis].len());
    let usual = design.varied_lattices(300_000).unwrap().swap_remove(0);
    let lower = design.lattices_of_lower_layers(300_000).unwrap();
    assert_eq!(lower.len(), 4);
    let all: Vec<_> = [&usual].into_iter().chain(&lower).map(planes).collect();
    assert!(all.windows(2).all(|pair| pair[1][0] <= pair[0][0] && pair[1][1] >= pair[0][1]), "{all:?}");
    assert!(all[4][0] < all[0][0] && all[4][1] > all[0][1], "{all:?}");
    assert!(lower.iter().all(|lattice| (250_000..=300_000).contains(&lattice.tet_count())));
    assert!(design.lattices_of_lower_layers(500).unwrap().is_empty());
}

/// The two edges of a narrow stripe, 6 mm from each other, are never one plane; those of squares 5 mm from each other are in some.
#[test]
fn edges_of_different_electrodes_share_planes() {
    let is_plane = |planes: &[f64], edge: f64| planes.iter().any(|plane| (plane - edge).abs() < 1e-9);
    let narrow = design([-0.02, 0.0, 0.02].map(|x| rectangle(x, 0.0, 0.006, 0.08)).to_vec(), None);
    for lattice in narrow.varied_lattices(16_000).unwrap() {
        let planes = &lattice.axes()[0];
        assert!([-0.003, 0.003].iter().all(|edge| is_plane(planes, *edge)), "{planes:?}");
    }
    let shares = |lattice: &Lattice| {
        let planes = &lattice.axes()[1];
        is_plane(planes, 0.0125) && !is_plane(planes, 0.01) && !is_plane(planes, 0.015)
    };
    assert!(squares_across().varied_lattices(28_000).unwrap().iter().any(shares));
}

/// What is on one side in a mirrored design is where it was on the other.
#[test]
fn mirrored_electrodes_have_mirrored_lattices() {
    let mirrored = SensorDesign {
        electrodes: squares_across()
            .electrodes
            .into_iter()
            .map(|electrode| {
                let [low, high] = electrode.outline.bounds();
                let center = -0.5 * (low + high);
                Electrode { outline: Outline::Rectangle { center, size: high - low }, ..electrode }
            })
            .collect(),
        ..squares_across()
    };
    for tets in [16_000, 28_000, 60_000] {
        let [ours, theirs] = [squares_across(), mirrored.clone()].map(|design| design.lattice(tets).unwrap());
        for axis in 0..2 {
            let pairs = ours.axes()[axis].iter().zip(theirs.axes()[axis].iter().rev());
            assert_eq!(ours.axes()[axis].len(), theirs.axes()[axis].len());
            assert!(
                pairs.clone().all(|(a, b)| (a + b).abs() < 1e-6),
                "{tets}: {:?}",
                pairs.collect::<Vec<_>>()
            );
        }
    }
}
