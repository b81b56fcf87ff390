//! Weak dielectrics in uniform fields along the axes, on lattices whose cells are large for them or stretched: the rule that
//! is in use (`core::occupancy::parallel`) beside that of edges alone, which any other mesh has for strong ones, so that the same
//! tetrahedra are taken as one. What a body adds to the energy is compared with that on a lattice of 48 cells a side, whose
//! own error is about a percent. `docs/interface.md` has what this prints: `cargo test --release -p capsense-core --test suite weak::
//! -- --nocapture`.

use crate::common::dielectric;
use crate::common::walled::{Body, Held, Rule, WalledBox};
use capsense_core::geometry::{Aabb, Pose, Shape};
use capsense_core::glam::{DQuat, DVec3, EulerRot};
use capsense_core::mesh::Lattice;

const CUBE: Aabb = Aabb { min: DVec3::splat(-0.5), max: DVec3::splat(0.5) };
const FINE: usize = 48;

/// Where the first planes are, in cells, along the axes.
const PLACES: [[f64; 3]; 3] = [[0.05, 0.35, 0.65], [0.55, 0.8, 0.1], [0.8, 0.1, 0.4]];

/// A body with its name. A box of 12, 12 and 8 cells of the finest lattice, along the axes and turned, a ball and a plate.
fn bodies() -> [(&'static str, Shape, DQuat); 4] {
    let block = || Shape::Box { size: DVec3::new(12.0, 12.0, 8.0) / FINE as f64 };
    let plate = Shape::Box { size: DVec3::new(16.0, 16.0, 4.0) / FINE as f64 };
    let turned = DQuat::from_euler(EulerRot::XYZ, 0.4, 0.3, 0.5);
    [
        ("block", block(), DQuat::IDENTITY),
        ("block, turned", block(), turned),
        ("ball", Shape::Sphere { radius: 0.15 }, DQuat::IDENTITY),
        ("plate", plate, DQuat::IDENTITY),
    ]
}

/// How planes along an axis follow each other.
#[derive(Clone, Copy)]
struct Planes {
    /// The first step.
    step: f64,
    /// By how much a step is longer than the one before.
    growth: f64,
}

const fn even(step: f64) -> Planes {
    Planes { step, growth: 1.0 }
}

const LATTICES: [(&str, [Planes; 3]); 7] = [
    ("cubes of 0.1", [even(0.1); 3]),
    ("cubes of 0.05", [even(0.05); 3]),
    ("growing by 1.25", [Planes { step: 0.03, growth: 1.25 }; 3]),
    ("5 : 5 : 1", [even(0.15), even(0.15), even(0.03)]),
    ("5 : 1 : 1", [even(0.15), even(0.03), even(0.03)]),
    ("10 : 10 : 1", [even(0.15), even(0.15), even(0.015)]),
    ("50 : 50 : 1", [even(0.15), even(0.15), even(0.003)]),
];

impl Planes {
    /// From wall to wall, the first place so many cells from it.
    fn at(self, place: f64) -> Vec<f64> {
        let mut planes = vec![-0.5];
        let mut step = self.step;
        let mut next = -0.5 + step * (0.5 + place);
        while next < 0.5 - 0.4 * step {
            planes.push(next);
            step *= self.growth;
            next += step;
        }
        planes.push(0.5);
        planes
    }
}

/// What a body adds to the energies of uniform fields along the axes.
fn added(space: &WalledBox) -> DVec3 {
    let along = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| move |p: DVec3| axis.dot(p));
    let problems = along.each_ref().map(|wall| Held { wall, bodies: &[0.0] });
    let solved = space.solve(&problems);
    DVec3::from_array([0, 1, 2].map(|axis| solved.energy(axis, axis) - 1.0))
}

/// The root mean squares of relative errors over places of the lattice: those of edges alone, and as it is; the last for all
/// fields together.
fn errors(body: &dyn Fn() -> Body, truth: DVec3, planes: [Planes; 3]) -> [[f64; 4]; 2] {
    let mut squares = [DVec3::ZERO; 2];
    for places in PLACES {
        let axes = [0, 1, 2].map(|axis| planes[axis].at(places[axis]));
        let lattice = Lattice::new(axes).unwrap();
        let mesh = lattice.to_tet_mesh().unwrap();
        let alone = WalledBox::on_mesh(&mesh, &[body()], Rule::EdgesAlone);
        let as_it_is = WalledBox::new(&lattice, &[body()], Rule::AsSolids);
        for (squares, space) in squares.iter_mut().zip([alone, as_it_is]) {
            let error = added(&space) / truth - 1.0;
            *squares += error * error / PLACES.len() as f64;
        }
    }
    squares.map(|s| [s.x, s.y, s.z, s.element_sum() / 3.0].map(f64::sqrt))
}

#[test]
fn weak_bodies_are_no_worse_than_by_edges_alone() {
    let fine = Lattice::uniform(CUBE, [FINE; 3]).unwrap();
    for (name, shape, rotation) in bodies() {
        for permittivity in [2.0, 4.0, 8.0] {
            let body = || Body {
                shape: shape.clone(),
                pose: Pose { translation: DVec3::ZERO, rotation },
                material: dielectric(permittivity),
            };
            let truth = added(&WalledBox::new(&fine, &[body()], Rule::AsSolids));
            for (lattice, planes) in LATTICES {
                let [alone, as_it_is] = errors(&body, truth, planes);
                let row = |of: [f64; 4]| of.map(|error| format!("{:.0}", 100.0 * error)).join(", ");
                println!("| {name}, {permittivity} | {lattice} | {} | {} |", row(alone), row(as_it_is));
                let [alone, as_it_is] = [alone, as_it_is].map(|of| of[3]);
                let most = f64::max(0.02, 1.15 * alone).min(0.25);
                assert!(as_it_is < most, "{name}, {permittivity}, {lattice}: {alone} {as_it_is}");
            }
        }
    }
}
