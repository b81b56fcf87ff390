//! Published benchmarks and closed forms in free space and in two dimensions; the others are in `closed_forms`, `bodies`,
//! `open_wall` and `layered_box`. Figures are printed for the table of `docs/validation.md`:
//! `cargo test -p capsense-core --test suite benchmarks:: -- --nocapture`.

use crate::common::walled::{Body, Held, Rule, WalledBox, cubes};
use crate::common::{GROUNDED, rectangle, to};
use capsense_core::electrode::{Electrode, Outline};
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::glam::{DVec2, DVec3};
use capsense_core::mesh::{Lattice, TetMesh};
use capsense_core::sensor::{ElectrodeNodes, Sensor, SensorDesign, Wall};
use capsense_core::simulator::Simulator;
use capsense_core::units::VACUUM_PERMITTIVITY;
use nalgebra_sparse::na::DMatrix;
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
    for tet in square.tets().iter() {
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

/// Distances of the walls from the middle, in sizes of what is looked at.
const WALLS: [f64; 3] = [1.5, 3.0, 6.0];

/// Planes across an axis: cells of one size between two ends, and outside of them growing ones up to the last of the walls, with
/// planes in all of them.
fn planes(spacing: f64, ends: [f64; 2], growth: f64, walls: [f64; 3]) -> Vec<f64> {
    let middle = 0.5 * (ends[0] + ends[1]);
    let half = 0.5 * (ends[1] - ends[0]);
    let cells = (2.0 * half / spacing).round();
    let outwards = walls.iter().fold(vec![half], |mut planes, wall| {
        let last = planes[planes.len() - 1];
        let step = if planes.len() < 2 { spacing } else { last - planes[planes.len() - 2] };
        let steps = (1.0 + (growth - 1.0) * (wall - last) / (growth * step)).ln() / growth.ln();
        let steps = steps.ceil() as i32;
        let way = |k: i32| (growth.powi(k) - 1.0) / (growth.powi(steps) - 1.0);
        planes.extend((1..=steps).map(|k| last + (wall - last) * way(k)));
        planes
    });
    let within = (1..cells as u32).map(|k| -half + spacing * f64::from(k));
    let below = outwards.iter().rev().map(|away| -away);
    below.chain(within).chain(outwards.iter().copied()).map(|place| middle + place).collect()
}

/// C/ε₀ of thin electrodes in free space. In a grounded cube of half width L, potentials of charges are lower by a/L + b/L³ +
/// ..., which three domains with the same cells tell.
fn in_free_space(
    electrodes: &[Electrode],
    size: f64,
    axes: [&dyn Fn([f64; 3]) -> Vec<f64>; 3],
) -> DMatrix<f64> {
    let walls = WALLS.map(|wall| wall * size);
    let axes = axes.map(|planes| planes(walls));
    let potentials = walls.map(|wall| {
        let within = axes.clone().map(|planes| {
            let middle = 0.5 * (planes[0] + planes[planes.len() - 1]);
            planes.into_iter().filter(|place| (place - middle).abs() < 1.001 * wall).collect::<Vec<_>>()
        });
        let [min, max] = [0, usize::MAX]
            .map(|end| DVec3::from_array(within.each_ref().map(|planes| planes[end.min(planes.len() - 1)])));
        let domain = Aabb { min, max };
        let design =
            SensorDesign { domain, electrodes: electrodes.to_vec(), substrate: None, wall: Wall::Grounded };
        let sensor = Sensor::on_lattice(&design, &Lattice::new(within).unwrap()).unwrap();
        let simulator = Simulator::new(sensor, vec![], to(1e-7)).unwrap();
        let c = simulator.base();
        let c = DMatrix::from_fn(c.size(), c.size(), |i, j| c.get(i, j) / VACUUM_PERMITTIVITY);
        c.try_inverse().unwrap()
    });
    let [near, far] = [0, 1].map(|at| 2.0 * &potentials[at + 1] - &potentials[at]);
    ((8.0 * far - near) / 7.0).try_inverse().unwrap()
}

/// An electrode of size 1 in the plane z = 0, by cells to its size: C/ε₀.
fn of_unit_size(outline: Outline, cells: f64) -> f64 {
    let electrode = Electrode { name: "E".to_owned(), outline, z: 0.0 };
    let axis = |walls| planes(1.0 / cells, [-1.0, 1.0], 1.08, walls);
    in_free_space(&[electrode], 1.0, [&axis, &axis, &axis])[(0, 0)]
}

/// C/4πε₀a of a square plate of side a (Wintle 2004).
const SQUARE: f64 = 0.366_789_2;

#[test]
fn a_square_plate_in_free_space() {
    let outline = Outline::Rectangle { center: DVec2::ZERO, size: DVec2::ONE };
    let errors = [8.0, 12.0].map(|cells| of_unit_size(outline.clone(), cells) / (4.0 * PI * SQUARE) - 1.0);
    println!("square plate: {errors:+.5?}");
    assert!(errors.iter().all(|error| error.abs() < 0.000_6), "{errors:?}");
}

/// C = 8ε₀R.
#[test]
fn a_disk_in_free_space() {
    let outline = Outline::Disk { center: DVec2::ZERO, radius: 0.5 };
    let errors = [8.0, 12.0, 16.0].map(|cells| of_unit_size(outline.clone(), cells) / 4.0 - 1.0);
    println!("disk: {errors:+.5?}");
    assert!(errors.iter().all(|error| error.abs() < 0.01), "{errors:?}");
    assert!(errors[2].abs() < 0.002, "{errors:?}");
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

/// Two strips along x and two along y, 1 wide, 1 apart, 5 long, the pairs 1 apart: C11, C12, C13, C14 in ε₀.
fn crossing_buses(cells: f64) -> [f64; 4] {
    let strip = |name: &str, center: [f64; 2], size: [f64; 2], z: f64| {
        let mut strip = rectangle(name, center, size);
        strip.z = z;
        strip
    };
    let electrodes = [
        strip("X1", [0.0, -1.0], [5.0, 1.0], 0.0),
        strip("X2", [0.0, 1.0], [5.0, 1.0], 0.0),
        strip("Y1", [-1.0, 0.0], [1.0, 5.0], 1.0),
        strip("Y2", [1.0, 0.0], [1.0, 5.0], 1.0),
    ];
    let across = |walls| planes(1.0 / cells, [-3.0, 3.0], 1.1, walls);
    let upwards = |walls| planes(1.0 / cells, [-0.5, 1.5], 1.1, walls);
    let c = in_free_space(&electrodes, 10.0 / 3.0, [&across, &across, &upwards]);
    // All strips are alike, but for the one that one looks from.
    assert!((c[(0, 0)] / c[(2, 2)] - 1.0).abs() < 1e-5);
    [0, 1, 2, 3].map(|other| c[(0, other)])
}

/// The same by another method, see [`buses_of_panels`], with 16 and 22 panels across, extrapolated.
const BUSES: [f64; 4] = [16.770_6, -3.256_1, -3.989_3, -3.989_3];

/// Panels of a strip, finer towards its edges: two ends along x, two along y.
fn panels(center: [f64; 2], size: [f64; 2], across: usize) -> Vec<[f64; 4]> {
    let cuts = [0, 1].map(|axis| {
        let count = if size[axis] > 1.0 { 2 * across } else { across };
        let place = |k: usize| {
            let along = 2.0 * k as f64 / count as f64 - 1.0;
            center[axis] + 0.5 * size[axis] * along.signum() * (1.0 - (1.0 - along.abs()).powf(2.5))
        };
        (0..=count).map(place).collect::<Vec<_>>()
    });
    let [xs, ys] = &cuts;
    xs.windows(2).flat_map(|x| ys.windows(2).map(move |y| [x[0], x[1], y[0], y[1]])).collect()
}

/// What has 1/r as its derivative, twice along x and twice along y.
fn integral_of_inverse_distance(x: f64, y: f64, z: f64) -> f64 {
    let r = (x * x + y * y + z * z).sqrt();
    // ln(u + r) without cancellation; its factor is zero where it has no value.
    let log = |u: f64, rest: f64| if u >= 0.0 { u + r } else { rest / (r - u) }.max(1e-300).ln();
    let twist = if z == 0.0 { 0.0 } else { x * y * z * (x * y / (z * r)).atan() };
    0.5 * (y * y - z * z) * x * log(x, y * y + z * z) + 0.5 * (x * x - z * z) * y * log(y, x * x + z * z)
        - (x * x + y * y - 2.0 * z * z) * r / 6.0
        - twist
}

/// C of crossing buses by charges that are constant on panels, tested with the panels (Galerkin).
fn buses_of_panels(across: usize) -> [f64; 4] {
    let strips = [
        ([0.0, -1.0], [5.0, 1.0], 0.0),
        ([0.0, 1.0], [5.0, 1.0], 0.0),
        ([-1.0, 0.0], [1.0, 5.0], 1.0),
        ([1.0, 0.0], [1.0, 5.0], 1.0),
    ];
    let all: Vec<(usize, f64, [f64; 4])> = (0..4)
        .flat_map(|k| panels(strips[k].0, strips[k].1, across).into_iter().map(move |p| (k, strips[k].2, p)))
        .collect();
    let mutual = |(_, z, p): &(usize, f64, [f64; 4]), (_, w, q): &(usize, f64, [f64; 4])| {
        let corners = (0..16).map(|bits| [0, 1, 2, 3].map(|bit| (bits >> bit) & 1));
        let parts = corners.map(|[a, b, c, d]: [usize; 4]| {
            let sign = if (a + b + c + d) % 2 == 0 { 1.0 } else { -1.0 };
            sign * integral_of_inverse_distance(p[a] - q[b], p[2 + c] - q[2 + d], z - w)
        });
        parts.sum::<f64>() / (4.0 * PI)
    };
    let potentials = DMatrix::from_fn(all.len(), all.len(), |i, j| mutual(&all[i.min(j)], &all[i.max(j)]));
    let area = |p: &[f64; 4]| (p[1] - p[0]) * (p[3] - p[2]);
    let held = DMatrix::from_fn(all.len(), 4, |i, k| if all[i].0 == k { area(&all[i].2) } else { 0.0 });
    let c = held.transpose() * potentials.cholesky().unwrap().solve(&held);
    [0, 1, 2, 3].map(|other| c[(0, other)])
}

#[test]
fn crossing_buses_of_panels_are_what_lattices_are_compared_with() {
    let [coarse, fine] = [6, 12].map(buses_of_panels);
    // Errors fall with the power of 2.5 by which panels become finer towards edges.
    let gain = 2.0_f64.powf(2.5) - 1.0;
    let errors = [0, 1, 2, 3].map(|k| (fine[k] + (fine[k] - coarse[k]) / gain) / BUSES[k] - 1.0);
    println!("crossing buses of panels: {coarse:.4?}, {fine:.4?}, {errors:+.5?}");
    assert!(errors.iter().all(|error| error.abs() < 2e-4), "{errors:?}");
}

#[test]
fn crossing_buses_in_free_space() {
    for (cells, allowed) in [(6.0, 0.005), (12.0, 0.001)] {
        let c = crossing_buses(cells);
        let errors = [0, 1, 2, 3].map(|other| c[other] / BUSES[other] - 1.0);
        println!("crossing buses: {c:.4?}, {errors:+.5?}");
        assert!(errors.iter().all(|error| error.abs() < allowed), "{errors:?}");
    }
}
