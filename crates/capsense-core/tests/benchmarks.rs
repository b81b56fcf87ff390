//! Published benchmarks and closed forms in free space and in two dimensions; the others are in `closed_forms`, `bodies`,
//! `open_wall` and `layered_box`. Figures are printed for the table of `docs/validation.md`:
//! `cargo test -p capsense-core --test benchmarks -- --nocapture`.

#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use capsense_core::electrode::{Electrode, Outline};
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::glam::{DVec2, DVec3};
use capsense_core::mesh::{Lattice, TetMesh};
use capsense_core::sensor::{ElectrodeNodes, Sensor, SensorDesign, Wall};
use capsense_core::simulator::Simulator;
use capsense_core::units::VACUUM_PERMITTIVITY;
use common::walled::{Body, Held, Rule, WalledBox, cubes};
use common::{GROUNDED, rectangle, to};
use std::f64::consts::{LN_2, PI};

fn nodes_where(mesh: &TetMesh, holds: impl Fn(DVec3) -> bool) -> Vec<u32> {
    (0..).zip(mesh.nodes()).filter(|(_, place)| holds(**place)).map(|(node, _)| node).collect()
}

/// A quarter of the space between cylinders of radius 0.5 and 1: the square's shell 0.5 <= max(x, y) <= 1, its layers
/// mapped to radii in geometric progression.
fn coaxial_quarter(cells: usize) -> TetMesh {
    let size = DVec3::new(1.0, 1.0, 1.0 / cells as f64);
    let lattice = Lattice::uniform(Aabb { min: DVec3::ZERO, max: size }, [cells, cells, 1]).unwrap();
    let square = lattice.to_tet_mesh().unwrap();
    let mut index = vec![None; square.nodes().len()];
    let (mut nodes, mut tets) = (Vec::new(), Vec::new());
    for tet in square.tets() {
        let layer = |node: u32| square.nodes()[node as usize].truncate().max_element();
        if tet.iter().all(|&node| layer(node) >= 0.5 - 1e-12) {
            tets.push(tet.map(|node| {
                *index[node as usize].get_or_insert_with(|| {
                    let place = square.nodes()[node as usize];
                    let radius = 0.5 * 2_f64.powf(2.0 * layer(node) - 1.0);
                    nodes.push((radius * place.truncate().normalize()).extend(place.z));
                    nodes.len() as u32 - 1
                })
            }));
        }
    }
    TetMesh::new(nodes, tets).unwrap()
}

/// C = 2πε₀ l/ln(b/a), of which a quarter is here.
#[test]
fn coaxial_cylinders() {
    let errors = [12, 24, 48].map(|cells| {
        let mesh = coaxial_quarter(cells);
        let on = |radius: f64| nodes_where(&mesh, |place| (place.truncate().length() - radius).abs() < 1e-9);
        let inner = vec![("E".to_owned(), ElectrodeNodes::Nodes(on(0.5)))];
        let sensor = Sensor::on_mesh(mesh.clone(), &on(1.0), inner).unwrap();
        let c = Simulator::new(sensor, vec![], to(1e-10)).unwrap().base().get(0, 0);
        c / (VACUUM_PERMITTIVITY * 0.5 * PI / LN_2 / cells as f64) - 1.0
    });
    println!("coaxial cylinders: {errors:+.5?}");
    assert!(errors[2].abs() < 1e-3, "{errors:?}");
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((1.7..2.3).contains(&order), "order {order} from {errors:?}");
    }
}

/// C/4πε₀a of a cube of side a (Hwang and Mascagni 2004: 0.6606780 ± 2.7e-7; Helsing and Perfekt 2013: 0.66067815409957).
const CUBE: f64 = 0.660_678_2;

/// The charge of a cube of side 1 over 4πε₀, in a box with walls 2 from its middle. The walls are at the potential that the
/// cube's own charge has there; what else a cube has begins with its sixteen-pole, of r⁻⁵.
fn cube(cells: f64) -> f64 {
    let domain = Aabb { min: DVec3::splat(-2.0), max: DVec3::splat(2.0) };
    let body = Body { shape: Shape::Box { size: DVec3::ONE }, pose: Pose::IDENTITY, material: GROUNDED };
    let space = WalledBox::new(&cubes(domain, 1.0 / cells), &[body], Rule::AsSolids);
    let nothing = |_: DVec3| 0.0;
    let of_charge = |place: DVec3| 1.0 / place.length();
    let solved =
        space.solve(&[Held { wall: &nothing, bodies: &[1.0] }, Held { wall: &of_charge, bodies: &[0.0] }]);
    let [own, induced] = [0, 1].map(|problem| solved.charge(problem, 0) / (4.0 * PI));
    own / (1.0 - induced)
}

#[test]
fn a_cube_in_free_space() {
    let errors = [6.25, 8.75, 12.25].map(|cells| cube(cells) / CUBE - 1.0);
    println!("cube: {errors:+.5?}");
    assert!(errors.iter().all(|error| error.abs() < 0.01), "{errors:?}");
    assert!(errors[2].abs() < 0.005, "{errors:?}");
}

/// A disk of radius 0.5 in the middle of a cube with open walls.
fn disk(half_width: f64, spacing: f64) -> f64 {
    let domain = Aabb { min: DVec3::splat(-half_width), max: DVec3::splat(half_width) };
    let outline = Outline::Disk { center: DVec2::ZERO, radius: 0.5 };
    let electrodes = vec![Electrode { name: "E".to_owned(), outline, z: 0.0 }];
    let design = SensorDesign { domain, electrodes, substrate: None, wall: Wall::Open };
    let lattice = design.lattice_of_spacing(spacing, 1.2).unwrap();
    let sensor = Sensor::on_lattice(&design, &lattice).unwrap();
    Simulator::new(sensor, vec![], to(1e-7)).unwrap().base().get(0, 0)
}

/// C = 8ε₀R.
#[test]
fn a_disk_in_free_space() {
    let errors = [(1.0, 16.0), (1.5, 16.0), (1.5, 32.0)]
        .map(|(half_width, across)| disk(half_width, 1.0 / across) / (4.0 * VACUUM_PERMITTIVITY) - 1.0);
    println!("disk: {errors:+.5?}");
    assert!(errors.iter().all(|error| error.abs() < 0.01), "{errors:?}");
}

/// The complete elliptic integral of the first kind, by the arithmetic-geometric mean.
fn elliptic(modulus: f64) -> f64 {
    let (mut a, mut b) = (1.0, (1.0 - modulus * modulus).sqrt());
    while (a - b).abs() > 1e-15 {
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
    }
    0.5 * PI / a
}

#[test]
fn elliptic_integrals_have_the_digits_of_tables() {
    for (modulus, digits) in
        [(0.0, std::f64::consts::FRAC_PI_2), (0.5_f64.sqrt(), 1.854_074_677_3), (0.8, 1.995_302_777_7)]
    {
        assert!((elliptic(modulus) - digits).abs() < 1e-10, "{modulus}");
    }
}

/// An axis with equal cells between -1 and 1, which grow outwards to both ends.
fn growing(cells_of_unit: i32, growth: f64, end: f64) -> Vec<f64> {
    let size = 1.0 / f64::from(cells_of_unit);
    let mut half: Vec<f64> = (0..=cells_of_unit).map(|k| size * f64::from(k)).collect();
    let mut step = size;
    while half.last().is_some_and(|last| *last < end) {
        step *= growth;
        half.push(half[half.len() - 1] + step);
    }
    half[1..].iter().rev().map(|x| -x).chain(half.iter().copied()).collect()
}

/// Two strips from 1/3 to 1 on either side, a third of their distance apart, between insulated walls across them.
fn coplanar_strips(cells: i32) -> f64 {
    let xs = growing(3 * cells, 1.15, 60.0);
    let zs: Vec<f64> = growing(3 * cells, 1.15, 60.0);
    // Four cells along the strips, so that what a rim is can be told from straight parts of it.
    let length = 4.0 / f64::from(3 * cells);
    let ys: Vec<f64> = (0..5).map(|k| 0.25 * length * f64::from(k)).collect();
    let end = xs[xs.len() - 1];
    let mesh = Lattice::new([xs, ys, zs]).unwrap().to_tet_mesh().unwrap();
    let wall = nodes_where(&mesh, |place| place.x.abs().max(place.z.abs()) > 0.999 * end);
    let strip = |name: &str, side: f64| {
        let strip = rectangle(name, [side * 2.0 / 3.0, 0.5 * length], [2.0 / 3.0, 2.0 * length]);
        (name.to_owned(), ElectrodeNodes::Shape(strip))
    };
    let sensor = Sensor::on_mesh(mesh, &wall, vec![strip("E1", -1.0), strip("E2", 1.0)]).unwrap();
    let simulator = Simulator::new(sensor, vec![], to(1e-9)).unwrap();
    let c = simulator.base();
    // Half a volt on one and minus half a volt on the other.
    0.5 * (c.get(0, 0) - c.get(0, 1)) / length
}

/// C = ε₀ l K(k')/K(k), k the gap over the distance of the outer edges, by conformal mapping.
#[test]
fn coplanar_strips_in_free_space() {
    let k: f64 = 1.0 / 3.0;
    let exact = VACUUM_PERMITTIVITY * elliptic((1.0 - k * k).sqrt()) / elliptic(k);
    let errors = [2, 4, 8].map(|cells| coplanar_strips(cells) / exact - 1.0);
    println!("coplanar strips: {exact:e} F/m, {errors:+.5?}");
    assert!(errors.iter().all(|error| error.abs() < 0.01), "{errors:?}");
    assert!(errors[2].abs() < 0.003, "{errors:?}");
}

/// Two strips along x and two along y, 1 wide, 1 apart, 5 long, the pairs 1 apart, in a grounded box around them.
fn crossing_buses(cells: f64) -> [f64; 4] {
    let domain = Aabb { min: DVec3::new(-5.0, -5.0, -4.5), max: DVec3::new(5.0, 5.0, 5.5) };
    let strip = |name: &str, center: [f64; 2], size: [f64; 2], z: f64| {
        let mut strip = rectangle(name, center, size);
        strip.z = z;
        strip
    };
    let electrodes = vec![
        strip("X1", [0.0, -1.0], [5.0, 1.0], 0.0),
        strip("X2", [0.0, 1.0], [5.0, 1.0], 0.0),
        strip("Y1", [-1.0, 0.0], [1.0, 5.0], 1.0),
        strip("Y2", [1.0, 0.0], [1.0, 5.0], 1.0),
    ];
    let design = SensorDesign { domain, electrodes, substrate: None, wall: Wall::Grounded };
    let count = |length: f64| (length * cells).round() as usize;
    let lattice = Lattice::uniform(domain, [count(10.0), count(10.0), count(10.0)]).unwrap();
    let sensor = Sensor::on_lattice(&design, &lattice).unwrap();
    let simulator = Simulator::new(sensor, vec![], to(1e-8)).unwrap();
    let c = simulator.base();
    // All strips are alike, but for the one that one looks from.
    assert!((c.get(0, 0) / c.get(2, 2) - 1.0).abs() < 2e-3);
    [(0, 0), (0, 1), (0, 2), (0, 3)].map(|(i, j)| c.get(i, j) / VACUUM_PERMITTIVITY)
}

#[test]
fn crossing_buses_of_few_cells_are_those_of_many() {
    let ladder = [4.0, 8.0].map(crossing_buses);
    println!("crossing buses: {ladder:.5?}");
    for (values, allowed) in ladder.into_iter().zip([0.01, 0.003]) {
        for (value, limit) in values.iter().zip(BUSES) {
            assert!((value / limit - 1.0).abs() < allowed, "{value} {limit}");
        }
    }
}

/// C/ε₀ in units of the strips' width. Nobody's but ours: 4, 6, 8 and 12 cells to a strip give 17.49595, 17.50958, 17.51454,
/// 17.51813 for the first, and like sequences for the others, whose errors fall with the square of the cells' size.
const BUSES: [f64; 4] = [17.521, -2.6545, -3.4247, -3.4247];
