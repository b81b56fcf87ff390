//! Conducting spheres against image charges: in a grounded cube, over a plane, and two of them, floating and grounded.
//! Errors are printed for the table of `docs/validation.md`:
//! `cargo test -p capsense-core --test suite bodies:: -- --nocapture`.

use crate::common::walled::{Body, Held, Rule, WalledBox, cubes};
use crate::common::{conductor, cubic, to};
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::glam::DVec3;
use capsense_core::material::Connection;
use capsense_core::mesh::Lattice;
use capsense_core::sensor::{ElectrodeNodes, Sensor};
use capsense_core::simulator::Simulator;
use capsense_core::solids::Solids;
use capsense_core::units::VACUUM_PERMITTIVITY;
use std::f64::consts::PI;

/// Farads of a sphere in free space per metre of its radius.
const FARADS: f64 = 4.0 * PI * VACUUM_PERMITTIVITY;

/// Cells to a radius; never so that poles lie on nodes.
const CELLS: [f64; 3] = [4.3, 6.3, 9.3];

fn ball(radius: f64, centre: DVec3) -> Body {
    Body {
        shape: Shape::Sphere { radius },
        pose: Pose::at(centre),
        material: conductor(Connection::Grounded),
    }
}

/// A charge on the z axis, divided by 4πε₀.
#[derive(Clone, Copy)]
struct Charge {
    z: f64,
    q: f64,
}

/// A sphere of radius 1 about a point of the z axis.
#[derive(Clone, Copy)]
struct Sphere {
    z: f64,
    volts: f64,
}

/// The charges within each of two spheres: what is in one is mirrored in the other, again and again (Kelvin).
fn images(spheres: [Sphere; 2]) -> [Vec<Charge>; 2] {
    let mut found = [Vec::new(), Vec::new()];
    for start in 0..2 {
        let mut at = start;
        let mut charge = Charge { z: spheres[at].z, q: spheres[at].volts };
        while charge.q.abs() > 1e-17 {
            found[at].push(charge);
            at = 1 - at;
            let distance = charge.z - spheres[at].z;
            charge = Charge { z: spheres[at].z + 1.0 / distance, q: -charge.q / distance.abs() };
        }
    }
    found
}

fn sum(charges: &[Charge]) -> f64 {
    charges.iter().map(|charge| charge.q).sum()
}

fn potential(charges: &[Vec<Charge>; 2], p: DVec3) -> f64 {
    charges.iter().flatten().map(|charge| charge.q / p.distance(charge.z * DVec3::Z)).sum()
}

/// Errors fall at each step to finer cells with at least this order.
fn assert_order(errors: &[f64], cells: &[f64], least: f64) {
    for (e, n) in errors.windows(2).zip(cells.windows(2)) {
        let order = (e[0] / e[1]).ln() / (n[1] / n[0]).ln();
        assert!(order > least, "order {order} in {errors:?}");
    }
}

fn assert_below(errors: &[f64], allowed: &[f64]) {
    assert!(errors.iter().zip(allowed).all(|(e, allowed)| e.abs() < *allowed), "{errors:?} {allowed:?}");
}

/// Solids tell how they are rounded, which edges alone do not know.
fn assert_better(edges: &[f64], solids: &[f64]) {
    let all = || edges.iter().zip(solids);
    assert!(all().all(|(a, b)| b.abs() < 3.5e-3 && b.abs() < 1.05 * a.abs()), "{edges:?} {solids:?}");
}

fn percent(errors: &[f64]) -> String {
    errors.iter().map(|error| format!("{:+.2}", 100.0 * error)).collect::<Vec<_>>().join(", ")
}

/// The charge of a grounded sphere at a height of two radii over a plane at 1 V. Behind the plane is its mirror image; on
/// the box's other walls is the potential of all charges.
#[test]
fn a_grounded_sphere_over_a_plane() {
    let charges = images([Sphere { z: 2.0, volts: 1.0 }, Sphere { z: -2.0, volts: -1.0 }]);
    let exact = FARADS * sum(&charges[0]);
    assert!((exact * 1e12 - 149.213028).abs() < 1e-6, "{exact:e}");
    let domain = Aabb { min: DVec3::new(-2.2, -2.2, 0.0), max: DVec3::new(2.2, 2.2, 4.4) };
    let errors = |rule| {
        CELLS.map(|cells| {
            let space = WalledBox::new(&cubes(domain, 1.0 / cells), &[ball(1.0, 2.0 * DVec3::Z)], rule);
            let held = Held { wall: &|p| 1.0 - potential(&charges, p), bodies: &[0.0] };
            -VACUUM_PERMITTIVITY * space.solve(&[held]).charge(0, 0) / exact - 1.0
        })
    };
    let (edges, solids) = (errors(Rule::EdgesAlone), errors(Rule::AsSolids));
    println!("over a plane: edges alone {}, solids {}", percent(&edges), percent(&solids));
    assert_order(&edges, &CELLS, 1.5);
    assert_below(&edges, &[9e-3, 3.5e-3, 2e-3]);
    assert_order(&solids, &CELLS, 1.5);
    assert_better(&edges, &solids);
}

/// The Maxwell matrix of two spheres of radius 1, 4 apart, and what is left of it when one of them floats.
#[test]
fn two_spheres_grounded_and_floating() {
    let with = |a: f64, b: f64| images([Sphere { z: -2.0, volts: a }, Sphere { z: 2.0, volts: b }]);
    let [one, other] = [with(1.0, 0.0), with(0.0, 1.0)];
    let [own, mutual] = [0, 1].map(|sphere: usize| FARADS * sum(&one[sphere]));
    assert!((own * 1e12 - 119.25622).abs() < 1e-5 && (mutual * 1e12 + 29.956808).abs() < 1e-6);
    let domain = Aabb { min: DVec3::new(-2.2, -2.2, -4.2), max: DVec3::new(2.2, 2.2, 4.2) };
    let bodies = [ball(1.0, -2.0 * DVec3::Z), ball(1.0, 2.0 * DVec3::Z)];
    let errors = |rule| {
        CELLS.map(|cells| {
            let space = WalledBox::new(&cubes(domain, 1.0 / cells), &bodies, rule);
            let solved = space.solve(&[
                Held { wall: &|p| potential(&one, p), bodies: &[1.0, 0.0] },
                Held { wall: &|p| potential(&other, p), bodies: &[0.0, 1.0] },
            ]);
            let c = |i, j| VACUUM_PERMITTIVITY * solved.charge(i, j);
            let floating = c(0, 0) - c(0, 1) * c(1, 0) / c(1, 1);
            let exact = own - mutual * mutual / own;
            [c(0, 0) / own - 1.0, c(0, 1) / mutual - 1.0, floating / exact - 1.0]
        })
    };
    let (edges, solids) = (errors(Rule::EdgesAlone), errors(Rule::AsSolids));
    for (of, name) in ["own", "mutual", "beside a floating one"].into_iter().enumerate() {
        let column = |errors: [[f64; 3]; 3]| errors.map(|error| error[of]);
        let (edges, solids) = (column(edges), column(solids));
        println!("two spheres, {name}: edges alone {}, solids {}", percent(&edges), percent(&solids));
        assert_order(&edges, &CELLS, 1.4);
        assert_below(&edges, &[9e-3, 3.5e-3, 2e-3]);
        assert_order(&solids, &CELLS, 1.4);
        assert_better(&edges, &solids);
    }
}

/// A sphere in the middle of a grounded cube of side 1.
#[test]
fn a_sphere_in_a_grounded_cube() {
    // Radius, digits of a computation with more multipoles, and what errors may be.
    let known = [
        (0.2, 0.307462972732, [1.5e-2, 5e-3, 2.5e-3]),
        (0.25, 0.443980442323, [9e-3, 4e-3, 1.6e-3]),
        (0.3, 0.630782176522, [5e-3, 2.2e-3, 1.1e-3]),
    ];
    let cells = [17, 25, 37];
    let cube = Aabb { min: DVec3::splat(-0.5), max: DVec3::splat(0.5) };
    for (radius, digits, allowed) in known {
        let exact = cubic::capacitance(radius);
        assert!((exact / digits - 1.0).abs() < 3e-6, "{radius}: {exact}");
        let errors = |rule| {
            cells.map(|cells| {
                let lattice = Lattice::uniform(cube, [cells; 3]).unwrap();
                let space = WalledBox::new(&lattice, &[ball(radius, DVec3::ZERO)], rule);
                let c = space.solve(&[Held { wall: &|_| 0.0, bodies: &[1.0] }]).energy(0, 0);
                c / (4.0 * PI * exact) - 1.0
            })
        };
        let (edges, solids) = (errors(Rule::EdgesAlone), errors(Rule::AsSolids));
        println!("radius {radius} in a cube: edges alone {}, solids {}", percent(&edges), percent(&solids));
        assert_order(&edges, &cells.map(|cells| cells as f64), 1.5);
        assert_below(&edges, &allowed);
        assert_order(&solids, &cells.map(|cells| cells as f64), 1.5);
        assert_better(&edges, &solids);
    }
}

/// The same through `Simulator`: the lower wall is the electrode. Of all that ends on the sphere a sixth comes from there,
/// so what grounding the sphere adds to the electrode's capacitance is C²/36/(C + C_g), C that of the sphere and C_g what
/// it was tied to ground with before.
#[test]
fn a_floating_and_a_loaded_sphere_in_a_grounded_cube() {
    let (radius, cells) = (0.25, 37);
    let cube = Aabb { min: DVec3::splat(-0.5), max: DVec3::splat(0.5) };
    let mesh = Lattice::uniform(cube, [cells; 3]).unwrap().to_tet_mesh().unwrap();
    let nodes = |holds: &dyn Fn(DVec3) -> bool| -> Vec<u32> {
        mesh.nodes().iter().zip(0..).filter(|(p, _)| holds(**p)).map(|(_, n)| n).collect()
    };
    let bottom = nodes(&|p| p.z == -0.5 && p.truncate().abs().max_element() < 0.5);
    let walls = nodes(&|p| p.abs().max_element() == 0.5);
    let electrodes = vec![("bottom".to_owned(), ElectrodeNodes::Nodes(bottom))];
    let sensor = Sensor::on_mesh(mesh, &walls, electrodes).unwrap().with_rims_held();
    let mut solids = Solids::new(&[Shape::Sphere { radius }]).unwrap();
    solids.place(&[Pose::at(DVec3::ZERO)]).unwrap();
    let with = |connection| {
        let materials = vec![conductor(connection)];
        let mut simulator = Simulator::new(sensor.clone(), materials, to(1e-10)).unwrap();
        let _ = simulator.step(&solids).unwrap();
        simulator.capacitance().get(0, 0)
    };
    let exact = FARADS * cubic::capacitance(radius);
    let grounded = with(Connection::Grounded);
    for (connection, to_ground) in
        [(Connection::Floating, 0.0), (Connection::Capacitance(2.0 * exact), 2.0 * exact)]
    {
        let added = exact * exact / 36.0 / (exact + to_ground);
        let error = (grounded - with(connection)) / added - 1.0;
        println!("{connection:?} in a cube: {}", percent(&[error]));
        assert_below(&[error], &[2.4e-3]);
    }
}
